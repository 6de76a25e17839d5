'use strict';
// Charts under the pointer: values are read, a part is enlarged. Everything comes from what is drawn.
const chartPage = (() => {
  const clamp = (v, low, high) => Math.min(Math.max(v, low), high);
  const minus = (text) => text.replace('-', '\u2212');
  /** A number with so many digits that count. */
  const digits = (value, count) => {
    if (!Number.isFinite(value)) return '–';
    const size = Math.abs(value);
    if (size !== 0 && (size < 1e-4 || size >= 1e6)) return minus(value.toExponential(count - 1));
    return minus(value.toFixed(clamp(count - 1 - Math.floor(Math.log10(size || 1)), 0, 9)));
  };
  const roundDown = (value) => {
    const unit = 10 ** Math.floor(Math.log10(value));
    return (value >= 5 * unit ? 5 : value >= 2 * unit ? 2 : 1) * unit;
  };
  const made = (parent, name, attributes, text) => {
    const node = document.createElementNS(parent.namespaceURI, name);
    Object.entries(attributes).forEach(([key, value]) => node.setAttribute(key, value));
    if (text !== undefined) node.textContent = text;
    parent.append(node);
    return node;
  };

  const charts = new Map();
  const begin = (svg) => {
    const number = (name) => Number(svg.dataset[name]);
    const chart = {
      svg, figure: svg.closest('figure'), inner: svg.querySelector('.inner'), axes: svg.querySelector('.axes'),
      left: number('left'), top: number('top'), width: number('inner'), height: number('height'),
      start: number('start'), end: number('end'), lower: number('lower'), upper: number('upper'),
      unit: svg.dataset.unit, isLogarithmic: svg.dataset.logarithmic !== undefined,
      reading: svg.closest('figure').querySelector('.reading'), kept: null, at: null,
    };
    chart.span = chart.end - chart.start;
    chart.drawnAxes = [...chart.axes.childNodes];
    chart.window = [0, 0, chart.width, chart.height];
    // Places of the points of each curve, in the units of the picture.
    chart.curves = [...chart.inner.querySelectorAll('path.line[data-name], path.mark[data-name], path.line[class*="c"]')].map((path) => ({
      name: path.dataset.name || '',
      points: (path.getAttribute('d').match(/[ML]-?[\d.]+ -?[\d.]+/g) || []).map((text) => text.slice(1).split(' ').map(Number)),
    })).filter((curve) => curve.points.length > 0);
    chart.hover = made(chart.inner, 'path', { class: 'hover', d: 'M-9 0V' + chart.height });
    charts.set(svg, chart);
    return chart;
  };
  const valueX = (chart, x) => chart.start + x / chart.width * chart.span;
  const valueY = (chart, y) => {
    const value = chart.upper - y / chart.height * (chart.upper - chart.lower);
    return chart.isLogarithmic ? 10 ** value : value;
  };
  /** From a place on the screen to one in the picture. */
  const placeX = (chart, clientX) => {
    const box = chart.svg.getBoundingClientRect();
    const share = ((clientX - box.left) / box.width * chart.svg.viewBox.baseVal.width - chart.left) / chart.width;
    return chart.window[0] + clamp(share, 0, 1) * chart.window[2];
  };

  const read = (chart, x) => {
    chart.at = clamp(x, 0, chart.width);
    if (chart.kept === null) chart.kept = chart.reading.textContent;
    const values = chart.curves.map((curve) => {
      let best = curve.points[0];
      for (const point of curve.points) if (Math.abs(point[0] - chart.at) < Math.abs(best[0] - chart.at)) best = point;
      return (curve.name ? curve.name + ' ' : '') + digits(valueY(chart, best[1]), 4);
    });
    const place = chart.at.toFixed(2);
    chart.hover.setAttribute('d', 'M' + place + ' 0V' + chart.height);
    chart.reading.textContent = values.join(', ') + ' at ' + digits(valueX(chart, chart.at), 4) + (chart.unit ? ' ' + chart.unit : '');
  };
  const leave = (chart) => {
    if (chart.kept !== null) chart.reading.textContent = chart.kept;
    chart.kept = null;
    chart.hover.setAttribute('d', 'M-9 0V' + chart.height);
  };

  const drawAxes = (chart) => {
    const [x0, y0, w, h] = chart.window;
    chart.axes.replaceChildren();
    const scale = (low, high, parts, place) => {
      const step = roundDown((high - low) / parts);
      for (let k = Math.ceil(low / step); k * step <= high && k < Math.ceil(low / step) + 14; k += 1) place(k * step, step);
    };
    const label = (value, step) => minus(value.toFixed(clamp(-Math.floor(Math.log10(step)), 0, 9)));
    const top = chart.upper - y0 / chart.height * (chart.upper - chart.lower);
    const bottom = chart.upper - (y0 + h) / chart.height * (chart.upper - chart.lower);
    scale(bottom, top, 3.5, (value, step) => {
      const y = chart.top + (top - value) / (top - bottom) * chart.height;
      made(chart.axes, 'path', { d: 'M' + chart.left + ' ' + y.toFixed(1) + 'h' + chart.width });
      made(chart.axes, 'text', { class: 'y', x: chart.left - 6, y: y.toFixed(1), dy: '.32em' }, chart.isLogarithmic ? digits(10 ** value, 2) : label(value, step));
    });
    const from = valueX(chart, x0), to = valueX(chart, x0 + w), floor = chart.top + chart.height;
    scale(from, to, 4.5, (value, step) => {
      const x = chart.left + (value - from) / (to - from) * chart.width;
      made(chart.axes, 'path', { d: 'M' + x.toFixed(1) + ' ' + floor + 'v4' });
      made(chart.axes, 'text', { class: 'x', x: x.toFixed(1), y: floor + 17 }, label(value, step));
    });
  };
  /** Enlarges from one place to another, upright as far as the curves go there; all of it without places. */
  const enlarge = (chart, from, to) => {
    if (from === undefined) {
      chart.window = [0, 0, chart.width, chart.height];
      chart.axes.replaceChildren(...chart.drawnAxes);
    } else {
      const width = clamp(Math.abs(to - from), chart.width / 500, chart.width);
      const x = clamp(Math.min(from, to), 0, chart.width - width);
      const heights = chart.curves.flatMap((curve) => curve.points.filter((point) => point[0] >= x && point[0] <= x + width).map((point) => point[1]));
      let top = 0, bottom = chart.height;
      if (heights.length > 1) {
        const room = Math.max(0.08 * (Math.max(...heights) - Math.min(...heights)), chart.height / 200);
        top = Math.max(Math.min(...heights) - room, 0);
        bottom = Math.min(Math.max(...heights) + room, chart.height);
      }
      chart.window = [x, top, width, Math.max(bottom - top, 1e-3)];
      drawAxes(chart);
    }
    chart.inner.setAttribute('viewBox', chart.window.map((value) => value.toFixed(3)).join(' '));
    chart.figure.classList.toggle('zoomed', from !== undefined);
  };

  let dragged = false;
  const hands = (chart) => {
    const { svg } = chart;
    let from = null, selection = null;
    svg.addEventListener('pointerdown', (event) => { from = placeX(chart, event.clientX); dragged = false; });
    svg.addEventListener('pointermove', (event) => {
      const x = placeX(chart, event.clientX);
      read(chart, x);
      if (from === null || event.pointerType === 'touch' || !(event.buttons & 1)) return;
      if (Math.abs(x - from) > chart.window[2] / 60) dragged = true;
      if (!dragged) return;
      selection = selection || made(chart.inner, 'rect', { class: 'selection', y: 0, height: chart.height });
      selection.setAttribute('x', Math.min(from, x));
      selection.setAttribute('width', Math.abs(x - from));
    });
    const end = (event) => {
      if (selection) { selection.remove(); selection = null; enlarge(chart, from, placeX(chart, event.clientX)); }
      from = null;
    };
    svg.addEventListener('pointerup', end);
    svg.addEventListener('pointerleave', (event) => { end(event); leave(chart); });
    svg.addEventListener('dblclick', () => enlarge(chart));
    svg.addEventListener('blur', () => leave(chart));
    svg.addEventListener('keydown', (event) => {
      if (event.ctrlKey || event.metaKey || event.altKey) return;
      const [x, , width] = chart.window, at = chart.at === null ? x + width / 2 : chart.at;
      const around = (factor) => enlarge(chart, at - width * factor / 2, at + width * factor / 2);
      const keys = {
        ArrowLeft: () => read(chart, at - width / 60), ArrowRight: () => read(chart, at + width / 60),
        '+': () => around(0.5), '=': () => around(0.5), '-': () => (width * 2 >= chart.width ? enlarge(chart) : around(2)), 0: () => enlarge(chart),
      };
      if (!Object.hasOwn(keys, event.key)) return;
      event.preventDefault();
      keys[event.key]();
    });
  };
  document.querySelectorAll('svg[data-start]').forEach((svg) => hands(begin(svg)));

  return {
    digits,
    /** The value of the horizontal axis at a place on the screen; nothing after a part was marked there. */
    at: (svg, clientX) => (dragged ? null : valueX(charts.get(svg), placeX(charts.get(svg), clientX))),
    read: (svg, share) => read(charts.get(svg), share * charts.get(svg).width),
    leave: (svg) => leave(charts.get(svg)),
    enlarge: (svg, from, to) => { const chart = charts.get(svg); if (from === undefined) enlarge(chart); else enlarge(chart, from * chart.width, to * chart.width); },
  };
})();
