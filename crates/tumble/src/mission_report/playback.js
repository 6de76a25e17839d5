// The playback, and the cursors of the plots. Everything drawn comes from the record that the page holds.
const missionPage = (() => {
  const byId = (id) => document.getElementById(id);
  const record = JSON.parse(byId('mission-record').textContent);
  const series = record.series;
  const times = series.t_s;
  const lastTime = times.length ? times[times.length - 1] : 0;
  const canvas = byId('view');
  const context = canvas.getContext('2d');
  const slider = byId('time');
  const playButton = byId('play');
  const calm = matchMedia('(prefers-reduced-motion: reduce)');

  // ---- vectors ----
  const add = (a, b, k = 1) => [a[0] + k * b[0], a[1] + k * b[1], a[2] + k * b[2]];
  const dot = (a, b) => a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
  const cross = (a, b) => [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]];
  const length = (a) => Math.sqrt(dot(a, a));
  const unit = (a) => { const n = length(a) || 1; return [a[0] / n, a[1] / n, a[2] / n]; };
  const distance = (a, b) => length(add(a, b, -1));
  const mix = (a, b, k) => a.map((v, i) => v + (b[i] - v) * k);
  const clamp = (v, low, high) => Math.min(Math.max(v, low), high);
  // Quaternions are x, y, z, w.
  const rotate = (q, v) => {
    const axis = [q[0], q[1], q[2]];
    const t = cross(axis, v);
    return add(add(v, t, 2 * q[3]), cross(axis, t), 2);
  };
  const slerp = (a, b, k) => {
    const sign = a[0] * b[0] + a[1] * b[1] + a[2] * b[2] + a[3] * b[3] < 0 ? -1 : 1;
    const q = a.map((v, i) => v * (1 - k) + sign * b[i] * k);
    const n = Math.hypot(...q) || 1;
    return q.map((v) => v / n);
  };

  // ---- time ----
  let now = 0;
  /** The row at or before a time. */
  const rowAt = (t) => {
    let low = 0, high = times.length - 1;
    while (low < high) {
      const middle = (low + high + 1) >> 1;
      if (times[middle] <= t) low = middle; else high = middle - 1;
    }
    return Math.max(low, 0);
  };
  const between = (column, t, join) => {
    const i = rowAt(t), j = Math.min(i + 1, times.length - 1);
    const span = times[j] - times[i];
    return join(column[i], column[j], span > 0 ? clamp((t - times[i]) / span, 0, 1) : 0);
  };
  const latest = (rows, t) => rows.filter((row) => row.t_s <= t + 1e-9).pop();

  // ---- what the picture is about ----
  const bounds = (() => {
    const lower = [Infinity, Infinity, Infinity], upper = [-Infinity, -Infinity, -Infinity];
    const include = (p) => p.forEach((v, i) => { lower[i] = Math.min(lower[i], v); upper[i] = Math.max(upper[i], v); });
    series.position_m.forEach(include);
    record.ways.forEach((way) => way.points_m.forEach(include));
    record.stretches.forEach((stretch) => stretch.points_m.forEach(include));
    include(record.goal_m);
    return { lower, upper };
  })();
  const center = mix(bounds.lower, bounds.upper, 0.5);
  const size = Math.max(distance(bounds.lower, bounds.upper), 4 * record.robot_radius_m, 0.5);
  const margin = 0.3 * size + 2 * record.robot_radius_m;
  const scene = {
    lower: bounds.lower.map((v) => v - margin),
    upper: bounds.upper.map((v) => v + margin),
  };
  // Not beyond the walls of the rooms in which the way lies.
  (() => {
    const rooms = record.keep_in.filter((box) => [0, 1, 2].every((i) => box.lower_m[i] <= bounds.upper[i] && box.upper_m[i] >= bounds.lower[i]));
    if (!rooms.length || record.planar) return;
    [0, 1, 2].forEach((i) => {
      scene.lower[i] = Math.max(scene.lower[i], Math.min(...rooms.map((box) => box.lower_m[i])));
      scene.upper[i] = Math.min(scene.upper[i], Math.max(...rooms.map((box) => box.upper_m[i])));
    });
  })();
  const inScene = (p) => p.every((v, i) => v >= scene.lower[i] && v <= scene.upper[i]);
  const meetsScene = (box) => [0, 1, 2].every((i) => box.lower_m[i] <= scene.upper[i] && box.upper_m[i] >= scene.lower[i]);

  // ---- camera: z of the world points down ----
  const views = {
    corner: [record.planar ? 0.0 : -2.5, record.planar ? 1.1 : 0.42], top: [0, 1.55], side: [0, 0.02], front: [Math.PI / 2, 0.02],
  };
  const camera = { yaw: views.corner[0], pitch: views.corner[1], zoom: 1, target: center.slice() };
  let basis;
  const place = () => {
    const { yaw, pitch } = camera;
    // From the picture into the depth.
    const depth = [-Math.cos(pitch) * Math.cos(yaw), -Math.cos(pitch) * Math.sin(yaw), Math.sin(pitch)];
    const right = [Math.sin(yaw), -Math.cos(yaw), 0];
    const up = cross(right, depth);
    const width = canvas.clientWidth, height = canvas.clientHeight;
    const away = 2.1 * size / camera.zoom;
    basis = { depth, right, up, away, width, height, focal: 1.35 * Math.min(width, 1.6 * height), eye: add(camera.target, depth, -away) };
  };
  const nearest = () => 0.02 * basis.away;
  const seen = (p) => {
    const d = add(p, basis.eye, -1);
    return [dot(d, basis.right), dot(d, basis.up), dot(d, basis.depth)];
  };
  const flat = (v) => {
    const k = basis.focal / v[2];
    return [basis.width / 2 + v[0] * k, basis.height / 2 - v[1] * k];
  };

  // ---- pens ----
  let ink = {};
  const readInk = () => {
    const style = getComputedStyle(document.documentElement);
    ['ink', 'soft', 'line', 'c0', 'c1', 'c2', 'c3', 'tube', 'tail', 'ban', 'obstacle', 'view', 'card'].forEach((name) => {
      ink[name] = style.getPropertyValue('--' + name).trim();
    });
  };
  const stroke = (points, color, width = 1, alpha = 1, dash = []) => {
    context.beginPath();
    let before = null;
    for (const p of points) {
      const v = p && seen(p);
      if (v && before) {
        let a = before, b = v;
        const near = nearest();
        if (a[2] > near || b[2] > near) {
          if (a[2] < near) a = mix(a, b, (near - a[2]) / (b[2] - a[2]));
          else if (b[2] < near) b = mix(b, a, (near - b[2]) / (a[2] - b[2]));
          const s = flat(a), e = flat(b);
          if (a !== before || !context.started) context.moveTo(s[0], s[1]); else context.lineTo(s[0], s[1]);
          context.lineTo(e[0], e[1]);
          context.started = b === v;
        } else context.started = false;
      } else context.started = false;
      before = v;
    }
    context.globalAlpha = alpha;
    context.strokeStyle = color;
    context.lineWidth = width;
    context.setLineDash(dash);
    context.stroke();
    context.setLineDash([]);
    context.globalAlpha = 1;
  };
  /** The outline of points that lie anywhere. */
  const hull = (points) => {
    const list = points.map(seen).filter((v) => v[2] > nearest()).map(flat).sort((a, b) => a[0] - b[0] || a[1] - b[1]);
    if (list.length < 3) return list;
    const half = (side) => {
      const chain = [];
      for (const p of side) {
        while (chain.length > 1) {
          const a = chain[chain.length - 2], b = chain[chain.length - 1];
          if ((b[0] - a[0]) * (p[1] - a[1]) - (b[1] - a[1]) * (p[0] - a[0]) > 0) break;
          chain.pop();
        }
        chain.push(p);
      }
      chain.pop();
      return chain;
    };
    return half(list).concat(half(list.reverse()));
  };
  const fill = (outline, color, alpha) => {
    if (outline.length < 3) return;
    context.beginPath();
    outline.forEach((p, i) => (i ? context.lineTo(p[0], p[1]) : context.moveTo(p[0], p[1])));
    context.closePath();
    context.globalAlpha = alpha;
    context.fillStyle = color;
    context.fill();
    context.globalAlpha = 1;
  };

  // ---- shapes ----
  const corners = (lower, upper) => [0, 1, 2, 3, 4, 5, 6, 7].map((k) => [k & 1 ? upper[0] : lower[0], k & 2 ? upper[1] : lower[1], k & 4 ? upper[2] : lower[2]]);
  const edges = [[0, 1], [2, 3], [4, 5], [6, 7], [0, 2], [1, 3], [4, 6], [5, 7], [0, 4], [1, 5], [2, 6], [3, 7]];
  const faces = [[0, 1, 3, 2], [4, 5, 7, 6], [0, 1, 5, 4], [2, 3, 7, 6], [0, 2, 6, 4], [1, 3, 7, 5]];
  const wireBox = (points, color, width, alpha) => edges.forEach(([a, b]) => stroke([points[a], points[b]], color, width, alpha));

  /** Rings of an ellipsoid: points with the normal that tells front from back. */
  const rings = (() => {
    const list = [];
    for (let m = 0; m < 6; m += 1) {
      const angle = Math.PI * m / 6, ring = [];
      for (let k = 0; k <= 48; k += 1) {
        const s = 2 * Math.PI * k / 48;
        ring.push([Math.cos(angle) * Math.sin(s), Math.sin(angle) * Math.sin(s), Math.cos(s)]);
      }
      list.push(ring);
    }
    for (let m = -4; m <= 4; m += 1) {
      const height = Math.sin(Math.PI * m / 10), radius = Math.sqrt(1 - height * height), ring = [];
      for (let k = 0; k <= 48; k += 1) ring.push([radius * Math.cos(2 * Math.PI * k / 48), radius * Math.sin(2 * Math.PI * k / 48), height]);
      list.push(ring);
    }
    return list;
  })();

  const centerOf = (obstacle, t) => add(obstacle.center_m, obstacle.velocity_m_s, t);
  const isSeen = (obstacle, t) => t >= obstacle.seen_s[0] && (obstacle.seen_s[1] === null || t <= obstacle.seen_s[1]);

  const drawFlatObstacle = (obstacle, middle) => {
    // On a table only the section at the robot's height matters.
    const axes = obstacle.semi_axes_m, height = series.position_m.length ? series.position_m[0][2] : 0;
    const share = Math.sqrt(Math.max(0, 1 - ((height - middle[2]) / axes[2]) ** 2));
    const ring = (z) => rings[rings.length - 5].map((u) => {
      const p = add(middle, rotate(obstacle.quaternion_xyzw, [share * axes[0] * u[0], share * axes[1] * u[1], 0]));
      return [p[0], p[1], z];
    });
    const low = ring(height + 0.1), high = ring(height - 0.1);
    fill(hull(low.concat(high)), ink.obstacle, 0.22);
    stroke(low, ink.obstacle, 1, 0.5);
    stroke(high, ink.obstacle, 1.4, 0.95);
    for (let k = 0; k < 48; k += 4) stroke([low[k], high[k]], ink.obstacle, 1, 0.45);
  };

  const drawObstacle = (obstacle, t) => {
    const middle = centerOf(obstacle, t), axes = obstacle.semi_axes_m;
    if (record.planar) return drawFlatObstacle(obstacle, middle);
    const outline = [];
    for (const ring of rings) {
      const front = [], back = [];
      let wasFront = null;
      for (const u of ring) {
        const p = add(middle, rotate(obstacle.quaternion_xyzw, [axes[0] * u[0], axes[1] * u[1], axes[2] * u[2]]));
        const normal = rotate(obstacle.quaternion_xyzw, [u[0] / axes[0], u[1] / axes[1], u[2] / axes[2]]);
        const isFront = dot(normal, add(basis.eye, p, -1)) > 0;
        if (!inScene(p)) { front.push(null); back.push(null); wasFront = null; continue; }
        outline.push(p);
        if (wasFront !== null && wasFront !== isFront) (wasFront ? front : back).push(p);
        (isFront ? front : back).push(p);
        (isFront ? back : front).push(null);
        wasFront = isFront;
      }
      stroke(back, ink.obstacle, 0.8, 0.22);
      stroke(front, ink.obstacle, 1.1, 0.8);
    }
    fill(hull(outline), ink.obstacle, 0.13);
  };

  byId('payload-key').hidden = !record.payload;
  const drawSolidBox = ({ center, points, color }) => {
    if (seen(center)[2] <= nearest()) return;
    faces
      .map((face, k) => {
        const corner = face.map((c) => points[c]);
        const middle = mix(corner[0], corner[2], 0.5);
        return { corner, k, depth: seen(middle)[2], facing: dot(add(middle, center, -1), add(basis.eye, middle, -1)) };
      })
      .filter((face) => face.facing > 0)
      .sort((a, b) => b.depth - a.depth)
      .forEach((face) => {
        fill(face.corner.map((p) => flat(seen(p))), ink.card, 0.92);
        fill(face.corner.map((p) => flat(seen(p))), color, 0.18 + 0.1 * (face.k >> 1));
        stroke(face.corner.concat([face.corner[0]]), color, 1.1, 0.9);
      });
  };
  const drawRobot = (position, attitude) => {
    const radius = record.robot_radius_m, v = seen(position);
    if (v[2] <= nearest()) return;
    const [x, y] = flat(v), r = radius * basis.focal / v[2];
    const half = radius / Math.sqrt(3);
    context.beginPath();
    context.arc(x, y, r, 0, 2 * Math.PI);
    context.globalAlpha = 0.14; context.fillStyle = ink.c0; context.fill();
    context.globalAlpha = 0.7; context.strokeStyle = ink.c0; context.lineWidth = 1.2; context.stroke();
    context.globalAlpha = 1;
    const boxes = [{ center: position, points: corners([-half, -half, -half], [half, half, half]).map((p) => add(position, rotate(attitude, p))), color: ink.c0 }];
    const load = record.payload;
    if (load && now >= load.held_s[0] && !(load.held_s[1] !== null && now >= load.held_s[1])) {
      const halves = load.edges_m.map((edge) => Math.max(edge / 2, 0.01));
      const placed = (p) => add(position, rotate(attitude, add(load.center_m, rotate(load.quaternion_xyzw, p))));
      boxes.push({ center: placed([0, 0, 0]), points: corners(halves.map((edge) => -edge), halves).map(placed), color: ink.c2 });
    }
    boxes.sort((a, b) => seen(b.center)[2] - seen(a.center)[2]).forEach(drawSolidBox);
    ['c1', 'c2', 'c3'].forEach((color, k) => {
      const tip = add(position, rotate(attitude, [0, 1, 2].map((i) => (i === k ? 1.75 * radius : 0))));
      stroke([position, tip], ink[color], 2.2);
      const at = seen(tip);
      if (at[2] > nearest()) label('xyz'[k], ...flat(at), ink[color]);
    });
  };
  const label = (text, x, y, color) => {
    context.font = '600 12px system-ui, sans-serif';
    context.lineWidth = 3;
    context.strokeStyle = ink.view;
    context.strokeText(text, x + 4, y + 4);
    context.fillStyle = color;
    context.fillText(text, x + 4, y + 4);
  };

  // Where the stop after each stretch begins: at the point nearest to what was wanted at its end.
  const cuts = record.stretches.map((stretch) => {
    if (!times.length || !stretch.points_m.length) return 0;
    const end = between(series.wanted_position_m, stretch.end_s, mix);
    let best = stretch.points_m.length - 1;
    stretch.points_m.forEach((p, i) => { if (distance(p, end) < distance(stretch.points_m[best], end) - 1e-6) best = i; });
    return best;
  });

  const shows = (name) => {
    const box = document.querySelector('#layers input[value="' + name + '"]');
    return Boolean(box && box.checked);
  };

  const drawTube = () => {
    const until = Math.min(now + 12, lastTime);
    for (let t = until; t >= now; t -= 0.5) {
      const half = between(series.tube_m, t, mix);
      if (!(length(half) > 0)) continue;
      const middle = between(series.wanted_position_m, t, mix);
      fill(hull(corners(add(middle, half, -1), add(middle, half))), ink.tube, 0.07);
    }
    const half = between(series.tube_m, now, mix), middle = between(series.wanted_position_m, now, mix);
    if (length(half) > 0) {
      const box = corners(add(middle, half, -1), add(middle, half));
      fill(hull(box), ink.tube, 0.25);
      wireBox(box, ink.tube, 1, 0.9);
    }
  };

  const draw = () => {
    place();
    context.setTransform(canvas.width / Math.max(basis.width, 1), 0, 0, canvas.height / Math.max(basis.height, 1), 0, 0);
    context.clearRect(0, 0, basis.width, basis.height);
    context.lineJoin = 'round';
    const hasRows = times.length > 0;
    const robot = hasRows ? between(series.position_m, now, mix) : record.goal_m;
    if (shows('boxes')) {
      record.keep_in.filter(meetsScene).forEach((box) => wireBox(corners(box.lower_m, box.upper_m), ink.soft, 1, 0.4));
      record.keep_out.filter(meetsScene).forEach((box) => {
        const points = corners(box.lower_m, box.upper_m);
        faces.forEach((face) => fill(hull(face.map((k) => points[k])), ink.ban, 0.07));
        wireBox(points, ink.ban, 1, 0.6);
      });
    }
    const way = latest(record.ways, now);
    if (way && shows('tree')) way.tree_m.forEach((edge) => stroke(edge, ink.soft, 0.8, 0.4));
    if (way && shows('way')) stroke(way.points_m, ink.c3, 1.8, 0.9, [7, 5]);
    const obstacles = shows('obstacles') ? record.obstacles.filter((obstacle) => isSeen(obstacle, now)) : [];
    const robotDepth = seen(robot)[2];
    const byDepth = obstacles
      .map((obstacle) => ({ obstacle, depth: seen(centerOf(obstacle, now))[2] }))
      .sort((a, b) => b.depth - a.depth);
    byDepth.filter((o) => o.depth >= robotDepth).forEach((o) => drawObstacle(o.obstacle, now));
    if (shows('path') && hasRows) {
      stroke(series.position_m, ink.c0, 1, 0.3);
      stroke(series.position_m.slice(0, rowAt(now) + 1).concat([robot]), ink.c0, 2.6);
    }
    if (hasRows && shows('stretches')) {
      const index = record.stretches.findIndex((stretch) => stretch.plan_revision === series.plan_revision[rowAt(now)]);
      const stretch = record.stretches[index];
      if (stretch) {
        stroke(stretch.points_m.slice(0, cuts[index] + 1), ink.c2, 2.6);
        stroke(stretch.points_m.slice(cuts[index]), ink.tail, 2, 1, [2, 4]);
      }
    }
    if (shows('tube') && hasRows) drawTube();
    drawEnds([['start', series.position_m[0]], ['goal', record.goal_m]]);
    if (shows('robot') && hasRows) {
      const believed = seen(between(series.believed_position_m, now, mix));
      drawRobot(robot, between(series.quaternion_xyzw, now, slerp));
      if (believed[2] > nearest()) {
        context.beginPath();
        context.arc(...flat(believed), 3, 0, 2 * Math.PI);
        context.fillStyle = ink.c1; context.fill();
      }
    }
    byDepth.filter((o) => o.depth < robotDepth).forEach((o) => drawObstacle(o.obstacle, now));
    drawCompass();
  };

  const drawEnds = (ends) => ends.forEach(([name, point]) => {
    const place = point && seen(point);
    if (!place || place[2] <= nearest()) return;
    const [x, y] = flat(place);
    context.beginPath();
    context.moveTo(x - 7, y); context.lineTo(x + 7, y); context.moveTo(x, y - 7); context.lineTo(x, y + 7);
    context.strokeStyle = ink.ink; context.lineWidth = 1.6; context.stroke();
    label(name, x + 4, y - 4, ink.ink);
  });

  const drawCompass = () => {
    const origin = [basis.width - 44, basis.height - 40];
    ['c1', 'c2', 'c3'].forEach((color, k) => {
      const axis = [0, 1, 2].map((i) => (i === k ? 1 : 0));
      const tip = [origin[0] + 24 * dot(axis, basis.right), origin[1] - 24 * dot(axis, basis.up)];
      context.beginPath(); context.moveTo(...origin); context.lineTo(...tip);
      context.strokeStyle = ink[color]; context.lineWidth = 1.6; context.stroke();
      label('xyz'[k], tip[0] - 4, tip[1], ink[color]);
    });
    context.font = '11px system-ui, sans-serif';
    context.textAlign = 'center'; context.fillStyle = ink.soft;
    context.fillText('world', origin[0], origin[1] + 36);
    context.textAlign = 'start';
  };

  // ---- numbers at the time of the playback ----
  const digits = (value, count) => (value === null || value === undefined ? '–' : chartPage.digits(value, count));
  /** An estimate to the digits of its standard deviation. */
  const withSigma = (value, sigma) => {
    if (!(sigma > 0)) return digits(value, 5);
    const decimals = clamp(1 - Math.floor(Math.log10(sigma)), 0, 9);
    return (value.toFixed(decimals) + ' ± ' + (2 * sigma).toFixed(decimals)).replaceAll('-', '\u2212');
  };
  const speedAt = (i) => {
    const j = Math.min(i + 1, times.length - 1);
    return j > i ? distance(series.position_m[j], series.position_m[i]) / (times[j] - times[i]) : 0;
  };
  const sigmaOf = (k) => series.sigma[rowAt(now)][k];
  const readers = {
    estimate: (k) => withSigma(series.estimate[rowAt(now)][k], sigmaOf(k)),
    information: (k) => (sigmaOf(k) > 0 ? digits(sigmaOf(k) ** -2, 2) : '–'),
    error: (k) => digits(1000 * (series.position_m[rowAt(now)][k] - series.wanted_position_m[rowAt(now)][k]), 2),
    distance: () => digits(1000 * series.tracking_error_m[rowAt(now)], 2),
    angle: () => digits(series.attitude_error_rad[rowAt(now)] * 180 / Math.PI, 2),
    force: (k) => digits(series.force_n[rowAt(now)][k], 2),
    torque: (k) => digits(series.torque_n_m[rowAt(now)][k], 2),
    speed: () => (1000 * speedAt(rowAt(now))).toFixed(0),
    clearance: () => digits(series.clearance_m[rowAt(now)], 3),
    belief: () => String(series.belief_revision[rowAt(now)]),
  };
  const read = (key) => {
    const [name, k] = key.split(':');
    return Object.hasOwn(readers, name) && times.length ? readers[name](Number(k)) : '';
  };
  const outputs = [...document.querySelectorAll('[data-reads]')].filter((node) => node.dataset.reads);
  const charts = [...document.querySelectorAll('svg[data-end]')].map((svg) => ({
    svg, cursor: svg.querySelector('.cursor'), inner: Number(svg.dataset.inner), height: svg.dataset.height || 22, end: Number(svg.dataset.end),
  }));
  const readout = (name, text) => {
    const node = document.querySelector('[data-readout="' + name + '"]');
    if (node) node.textContent = text;
  };
  const showNumbers = () => {
    if (!times.length) return;
    const i = rowAt(now);
    readout('time', now.toFixed(1) + ' s');
    readout('stretch', series.plan_revision[i] ? String(series.plan_revision[i]) : 'none');
    readout('speed', readers.speed() + ' mm/s');
    readout('clearance', series.clearance_m[i] === null ? '–' : digits(series.clearance_m[i], 3) + ' m');
    readout('error', (1000 * series.tracking_error_m[i]).toFixed(1) + ' mm');
    readout('mass', readers.estimate(0) + ' kg');
    const event = latest(record.events, now);
    byId('now').textContent = event ? event.t_s.toFixed(1) + ' s: ' + event.text : '\u00a0';
    outputs.forEach((node) => { node.textContent = node.dataset.reads.split(' ').map(read).join(', '); });
    charts.forEach(({ cursor, inner, height, end }) => {
      const x = (inner * clamp(now / end, 0, 1)).toFixed(1);
      cursor.setAttribute('d', 'M' + x + ' 0V' + height);
    });
    slider.value = String(now);
    slider.setAttribute('aria-valuetext', now.toFixed(1) + ' seconds');
  };

  // ---- one picture per frame at most ----
  let isDue = false;
  const due = () => {
    if (isDue) return;
    isDue = true;
    requestAnimationFrame(() => { isDue = false; draw(); });
  };
  const seek = (t) => {
    now = clamp(t, 0, lastTime);
    if (shows('follow') && times.length) camera.target = between(series.position_m, now, mix);
    showNumbers();
    due();
  };

  // ---- play ----
  let playedAt = null;
  const setPlaying = (isPlaying) => {
    playedAt = isPlaying ? performance.now() : null;
    playButton.textContent = isPlaying ? '❚❚ Pause' : '▶ Play';
    playButton.setAttribute('aria-pressed', String(isPlaying));
    if (isPlaying) {
      if (now >= lastTime) seek(0);
      requestAnimationFrame(advance);
    }
  };
  const advance = (stamp) => {
    if (playedAt === null) return;
    // Who wants less motion sees a picture each second instead of a film.
    const pause = calm.matches ? 1000 : 0;
    const passed = stamp - playedAt;
    if (passed >= pause && passed > 0) {
      playedAt = stamp;
      seek(now + Math.min(passed, 1100) / 1000 * Number(byId('rate').value));
    }
    if (now >= lastTime) setPlaying(false); else requestAnimationFrame(advance);
  };
  const toggle = () => setPlaying(playedAt === null);

  // ---- hands ----
  const turn = (yaw, pitch) => {
    camera.yaw += yaw;
    camera.pitch = clamp(camera.pitch + pitch, -1.55, 1.55);
    due();
  };
  const zoom = (factor) => { camera.zoom = clamp(camera.zoom * factor, 0.3, 14); due(); };
  const view = (name) => {
    [camera.yaw, camera.pitch] = views[name] || views.corner;
    camera.zoom = 1;
    camera.target = center.slice();
    seek(now);
  };
  const fingers = new Map();
  const spread = () => { const [a, b] = [...fingers.values()]; return Math.hypot(a[0] - b[0], a[1] - b[1]) || 1; };
  canvas.addEventListener('pointerdown', (event) => {
    canvas.setPointerCapture(event.pointerId);
    fingers.set(event.pointerId, [event.clientX, event.clientY]);
  });
  canvas.addEventListener('pointermove', (event) => {
    const before = fingers.get(event.pointerId);
    if (!before) return;
    const width = fingers.size === 2 ? spread() : 0;
    fingers.set(event.pointerId, [event.clientX, event.clientY]);
    if (fingers.size === 2) zoom(spread() / width);
    else turn(0.007 * (event.clientX - before[0]), 0.007 * (event.clientY - before[1]));
  });
  ['pointerup', 'pointercancel'].forEach((name) => canvas.addEventListener(name, (event) => fingers.delete(event.pointerId)));
  canvas.addEventListener('wheel', (event) => { event.preventDefault(); zoom(Math.exp(-0.0012 * event.deltaY)); }, { passive: false });
  const step = (count) => { setPlaying(false); seek(times[clamp(rowAt(now) + count, 0, times.length - 1)] || 0); };
  const keys = {
    ArrowLeft: () => turn(0.08, 0), ArrowRight: () => turn(-0.08, 0), ArrowUp: () => turn(0, 0.08), ArrowDown: () => turn(0, -0.08),
    '+': () => zoom(1.15), '=': () => zoom(1.15), '-': () => zoom(1 / 1.15), 0: () => view('corner'),
    ' ': toggle, ',': () => step(-1), '.': () => step(1), Home: () => seek(0), End: () => seek(lastTime),
  };
  canvas.addEventListener('keydown', (event) => {
    if (event.ctrlKey || event.metaKey || event.altKey || !Object.hasOwn(keys, event.key)) return;
    event.preventDefault();
    keys[event.key]();
  });
  slider.max = String(lastTime);
  slider.addEventListener('input', () => { setPlaying(false); seek(Number(slider.value)); });
  slider.addEventListener('keydown', (event) => { if (event.key === ' ') { event.preventDefault(); toggle(); } });
  playButton.addEventListener('click', toggle);
  byId('layers').addEventListener('change', () => { if (!shows('follow')) camera.target = center.slice(); seek(now); });
  byId('views').addEventListener('click', (event) => { if (event.target.dataset.view) view(event.target.dataset.view); });
  document.querySelectorAll('[data-seek]').forEach((button) => button.addEventListener('click', () => { setPlaying(false); seek(Number(button.dataset.seek)); }));
  charts.forEach(({ svg, end }) => svg.addEventListener('click', (event) => {
    const box = svg.getBoundingClientRect();
    const t = svg.dataset.start === undefined ? (event.clientX - box.left) / box.width * end : chartPage.at(svg, event.clientX);
    // Who marked a part of a chart wanted to see that, not another time.
    if (t === null) return;
    setPlaying(false);
    seek(t);
  }));

  const resize = () => {
    const ratio = Math.min(window.devicePixelRatio || 1, 2);
    canvas.width = Math.max(1, Math.round(canvas.clientWidth * ratio));
    canvas.height = Math.max(1, Math.round(canvas.clientHeight * ratio));
    draw();
  };
  readInk();
  new ResizeObserver(resize).observe(canvas);
  matchMedia('(prefers-color-scheme: dark)').addEventListener('change', () => { readInk(); due(); });
  resize();
  // How it ended is what one looks for first; playing begins at the start.
  seek(lastTime);
  return { record, seek, draw, view, toggle, zoom, turn, time: () => now, end: lastTime, isPlaying: () => playedAt !== null };
})();
