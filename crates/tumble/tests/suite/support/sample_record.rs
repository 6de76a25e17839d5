//! A mission that was not flown: the walls of the station's slalom, an astronaut on the way, beliefs that converge.
//! Everything a report can show occurs in it.

use std::collections::BTreeMap;
use std::f64::consts::{FRAC_1_SQRT_2, FRAC_PI_4, PI, TAU};
use tumble::mission::{
    BeliefRow, DrawnBox, DrawnEllipsoid, DrawnPayload, FallbackRow, FaultChoice, FaultName, FlyOptions, LayerNames,
    MissionEvent, MissionRecord, MissionSummary, ModelChoice, ParameterRow, Promises, Series, StretchRow, TrackingRms,
    WayRow, WeightingChoice,
};

const DURATION_S: f64 = 150.0;
const ROWS: u32 = 750;
const STRETCH_S: f64 = 12.0;
/// The astronaut comes into view.
const ASTRONAUT_S: f64 = 66.0;
const TRUTH: [f64; 10] = [11.6, 0.012, -0.008, 0.004, 0.171, 0.158, 0.182, 0.003, -0.002, 0.004];
const INITIAL: [f64; 10] = [20.0, 0.0, 0.0, 0.0, 0.3, 0.3, 0.3, 0.0, 0.0, 0.0];
const PARAMETERS: [(&str, &str); 10] = [
    ("mass", "kg"),
    ("com_x", "m"),
    ("com_y", "m"),
    ("com_z", "m"),
    ("inertia_xx", "kg m^2"),
    ("inertia_yy", "kg m^2"),
    ("inertia_zz", "kg m^2"),
    ("inertia_xy", "kg m^2"),
    ("inertia_xz", "kg m^2"),
    ("inertia_yz", "kg m^2"),
];
/// Index of the parameters that are weighted, their largest weight and wanted standard deviation.
const WEIGHTED: [(usize, f64, f64); 4] = [(0, 50.0, 0.13), (4, 20.0, 0.0055), (5, 20.0, 0.006), (6, 20.0, 0.005)];

fn smooth(x: f64) -> f64 {
    let x = x.clamp(0.0, 1.0);
    x * x * (3.0 - 2.0 * x)
}

fn bump(s: f64, center: f64, width: f64) -> f64 {
    (-((s - center) / width).powi(2)).exp()
}

/// Share of the way flown: rest at both ends, and a pause while a new way is sought.
fn progress(t: f64) -> f64 {
    0.47 * smooth((t - 4.0) / 66.0) + 0.53 * smooth((t - 76.0) / 60.0)
}

fn on_way(s: f64) -> [f64; 3] {
    let x = 10.8 - 0.44 * bump(s, 0.32, 0.15) + 0.30 * bump(s, 0.6, 0.12);
    [x, -9.6 + 1.85 * s, 4.8 + 0.4 * s + 0.07 * (3.0 * TAU * s).sin() * (PI * s).sin()]
}

fn quaternion(roll: f64, pitch: f64, yaw: f64) -> [f64; 4] {
    let half = |angle: f64| (0.5 * angle).sin_cos();
    let ((sr, cr), (sp, cp), (sy, cy)) = (half(roll), half(pitch), half(yaw));
    [sr * cp * cy - cr * sp * sy, cr * sp * cy + sr * cp * sy, cr * cp * sy - sr * sp * cy, cr * cp * cy + sr * sp * sy]
}

fn wanted_attitude(t: f64) -> [f64; 4] {
    let excitation = smooth((t - 6.0) / 10.0) * (1.0 - smooth((t - 58.0) / 12.0));
    let roll = 0.35 * excitation * (0.42 * t).sin();
    let pitch = 0.30 * excitation * (0.31 * t + 0.8).sin();
    quaternion(roll, pitch, -2.0 * FRAC_PI_4 * (1.0 - smooth((t - 128.0) / 16.0)))
}

/// Something that looks like noise, always the same.
fn ripple(t: f64, phase: f64) -> f64 {
    (0.45 * (1.31 * t + phase).sin() + 0.35 * (2.87 * t + 2.0 * phase).sin() + 0.2 * (7.3 * t - phase).sin())
        * (1.0 + 0.3 * (0.11 * t + phase).cos())
}

fn sigma(index: usize, t: f64) -> f64 {
    let (start, end, time) = match index {
        0 => (4.0, 0.045, 9.0),
        1..=3 => (0.02, 0.0011, 16.0),
        4 | 5 => (0.08, 0.0028, 11.0),
        6 => (0.08, 0.0024, 14.0),
        _ => (0.02, 0.0014, 18.0),
    };
    // Information grows while there is weight, and once more in the last turn.
    let gathered = smooth((t - 4.0) / 60.0) * (t / time).powi(2)
        + if index == 6 { 90.0 * smooth((t - 128.0) / 14.0) } else { 0.0 };
    let information: f64 = 1.0 / f64::powi(start, 2) + (gathered / 60.0).min(1.4) / f64::powi(end, 2);
    information.sqrt().recip()
}

fn estimates(t: f64) -> ([f64; 10], [f64; 10]) {
    let sigma: [f64; 10] = std::array::from_fn(|i| sigma(i, t));
    let estimate = std::array::from_fn(|i| {
        let left = (-(t - 4.0).max(0.0) / 7.0).exp();
        #[allow(clippy::cast_precision_loss)]
        let phase = 1.7 * i as f64;
        TRUTH[i] + left * (INITIAL[i] - TRUTH[i]) + (1.0 - left) * 0.8 * sigma[i] * ripple(0.08 * t, phase)
    });
    (estimate, sigma)
}

/// Distance from a point to the surface of an ellipsoid along the axes, by looking at many points of it.
fn distance(point: [f64; 3], obstacle: &DrawnEllipsoid, t: f64) -> f64 {
    let mut least = f64::INFINITY;
    for i in 0..24 {
        let (sin_v, cos_v) = (PI * (f64::from(i) + 0.5) / 24.0).sin_cos();
        for j in 0..36 {
            let (sin_u, cos_u) = (TAU * f64::from(j) / 36.0).sin_cos();
            let unit = [sin_v * cos_u, sin_v * sin_u, cos_v];
            let away: f64 = (0..3)
                .map(|k| {
                    let center = obstacle.center_m[k] + obstacle.velocity_m_s[k] * t;
                    (center + obstacle.semi_axes_m[k] * unit[k] - point[k]).powi(2)
                })
                .sum();
            least = least.min(away.sqrt());
        }
    }
    least
}

fn obstacles() -> Vec<DrawnEllipsoid> {
    let upright = [0.0, 0.0, 0.0, 1.0];
    let wall = |x: f64, y: f64| DrawnEllipsoid {
        center_m: [x, y, 4.9],
        velocity_m_s: [0.0; 3],
        quaternion_xyzw: upright,
        semi_axes_m: [0.5, 0.05, 2.0],
        seen_s: [0.0, f64::INFINITY],
    };
    let astronaut = DrawnEllipsoid {
        center_m: [11.75, -8.3, 4.7],
        velocity_m_s: [-0.003, 0.0, 0.0],
        quaternion_xyzw: upright,
        semi_axes_m: [0.2, 0.2, 0.6],
        seen_s: [ASTRONAUT_S, f64::INFINITY],
    };
    vec![wall(10.3, -8.5), wall(11.2, -9.0), astronaut]
}

fn series(obstacles: &[DrawnEllipsoid]) -> Series {
    let mut series =
        Series { force_limit_n: [0.452, 0.216, 0.257], torque_limit_n_m: [0.045, 0.022, 0.026], ..Series::default() };
    for row in 0..=ROWS {
        let t = DURATION_S * f64::from(row) / f64::from(ROWS);
        let (estimate, sigma) = estimates(t);
        let wanted = on_way(progress(t));
        let moving = smooth((t - 3.0) / 4.0) * (1.0 - smooth((t - 138.0) / 8.0));
        let mass_off = ((estimate[0] - TRUTH[0]) / TRUTH[0]).abs();
        let size = (0.004 + 0.03 * mass_off) * (0.3 + moving);
        let position: [f64; 3] = std::array::from_fn(|k| wanted[k] + size * ripple(0.4 * t, [0.0, 2.1, 4.4][k]));
        let attitude = wanted_attitude(t);
        let angle = (0.012 + 0.05 * mass_off) * (0.3 + moving) * ripple(0.5 * t, 1.0);
        let [x, y, z, w] = attitude;
        let (s, c) = (0.5 * angle).sin_cos();
        let error: [f64; 3] = std::array::from_fn(|k| position[k] - wanted[k]);
        let excitation = smooth((t - 5.0) / 4.0) * (1.0 - smooth((t - 62.0) / 8.0));
        series.t_s.push(t);
        series.position_m.push(position);
        series.quaternion_xyzw.push([x * c + w * s, y * c + z * s, z * c - y * s, w * c - x * s]);
        series.wanted_position_m.push(wanted);
        series.wanted_quaternion_xyzw.push(attitude);
        series
            .believed_position_m
            .push(std::array::from_fn(|k| position[k] + 0.002 * ripple(1.3 * t, [5.0, 1.0, 3.0][k])));
        series.tracking_error_m.push(error.iter().map(|e| e * e).sum::<f64>().sqrt());
        series.attitude_error_rad.push(angle.abs());
        let revised = (t / 10.0).floor() * 10.0;
        let tube = if t < 2.0 { 0.0 } else { 0.012 + 0.045 * sigma_share(revised) };
        series.tube_m.push([tube, tube, 0.8 * tube]);
        series.force_n.push(std::array::from_fn(|k| {
            let drawn = 0.06 * excitation * (0.5 * t + [0.0, 2.0, 4.0][k]).sin()
                + 0.035 * moving * ripple(0.3 * t, [1.0, 2.0, 3.0][k]);
            (drawn * if k == 0 && excitation > 0.5 { 2.6 } else { 1.0 }).clamp(-0.452, 0.452)
        }));
        series.torque_n_m.push(std::array::from_fn(|k| {
            let turn = if k == 2 { bump(t, 131.0, 3.0) - bump(t, 141.0, 3.0) } else { 0.0 };
            (0.013 * excitation * (0.42 * t + [1.57, 2.4, 0.5][k]).sin()
                + 0.002 * ripple(t, [3.0, 4.0, 5.0][k])
                + 0.012 * turn)
                .clamp(-0.022, 0.022)
        }));
        let clear = obstacles
            .iter()
            .filter(|o| t >= o.seen_s[0] && t <= o.seen_s[1])
            .map(|o| distance(position, o, t) - 0.15)
            .fold(0.75, f64::min);
        series.clearance_m.push(if t < 1.0 { None } else { Some(clear) });
        series.estimate.push(estimate);
        series.sigma.push(sigma);
        #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)]
        let count = |from: f64, each: f64| ((t - from) / each).floor().max(0.0) as u64;
        // Between 90 and 110 s nothing of what is learnt reaches the controller.
        series.belief_revision.push(if (90.0..110.0).contains(&t) { 44 } else { count(0.0, 2.0) });
        series.plan_revision.push(if t < 4.0 { 0 } else { count(4.0, STRETCH_S).min(11) + 1 });
    }
    series
}

fn sigma_share(t: f64) -> f64 {
    sigma(0, t) / sigma(0, 0.0)
}

fn stretches() -> Vec<StretchRow> {
    (0..12_u32)
        .map(|number| {
            let start_s = 4.0 + STRETCH_S * f64::from(number);
            let end_s = (start_s + STRETCH_S).min(DURATION_S);
            let mut points_m: Vec<[f64; 3]> =
                (0..=40).map(|i| on_way(progress(start_s + (end_s - start_s) * f64::from(i) / 40.0))).collect();
            let (from, to) = (points_m[points_m.len() - 2], points_m[points_m.len() - 1]);
            points_m.extend((1..=12).map(|i| {
                let share = f64::from(i) / 12.0;
                std::array::from_fn(|k| to[k] + (to[k] - from[k]) * 10.0 * (share - 0.5 * share * share))
            }));
            let sigma: Vec<[f64; 2]> =
                WEIGHTED.iter().map(|&(i, ..)| [sigma(i, start_s), 1.05 * sigma(i, end_s)]).collect();
            let weights = WEIGHTED.iter().zip(&sigma).map(|(&(_, most, wanted), [now, _])| {
                let (target, variance) = (wanted * wanted, now * now);
                if variance <= 2.2 * target { 0.0 } else { most * (-5.0 * target / variance).exp() }
            });
            StretchRow {
                plan_revision: u64::from(number) + 1,
                start_s,
                end_s,
                model_revision: u64::from(6 * number),
                points_m,
                quantities: WEIGHTED.iter().map(|&(i, ..)| PARAMETERS[i].0.into()).collect(),
                weights: weights.collect(),
                information: sigma.iter().map(|[a, b]| 1.0 / (b * b) - 1.0 / (a * a)).collect(),
                stated: sigma.iter().map(|[_, promised]| 1.1 * promised).collect(),
                sigma,
            }
        })
        .collect()
}

fn way(t_s: f64, model_revision: u64, from: f64, seed: f64) -> WayRow {
    let points_m: Vec<[f64; 3]> = (0..=60).map(|i| on_way(from + (1.0 - from) * f64::from(i) / 60.0)).collect();
    let mut tree_m = Vec::new();
    for i in 0..900_u32 {
        let s = from + (1.0 - from) * f64::from(i % 60) / 60.0;
        let twig = f64::from(i / 60);
        let root = on_way(s);
        let reach = |k: f64| 0.09 * (f64::from(i) * 12.9898 + k * 4.1 + seed).sin() * (1.0 + twig * 0.13);
        let tip = [root[0] + reach(1.0), root[1] + reach(2.0), root[2] + reach(3.0)];
        tree_m.push([root, tip]);
        if i % 3 == 0 {
            tree_m.push([tip, [tip[0] + reach(4.0), tip[1] + reach(5.0), tip[2] + reach(6.0)]]);
        }
    }
    WayRow { t_s, model_revision, points_m, tree_m }
}

fn event(t_s: f64, kind: &str, text: &str) -> MissionEvent {
    MissionEvent { t_s, kind: kind.into(), text: text.into() }
}

/// The mission.
pub fn sample() -> MissionRecord {
    let obstacles = obstacles();
    let series = series(&obstacles);
    let stretches = stretches();
    let (estimate, sigma) = estimates(DURATION_S);
    let rms = |from: usize| {
        let tail = &series.tracking_error_m[from..];
        #[allow(clippy::cast_precision_loss)]
        let count = tail.len() as f64;
        (tail.iter().map(|e| e * e).sum::<f64>() / count).sqrt()
    };
    let impulse =
        |rows: &[[f64; 3]]| 0.2 * rows.iter().map(|v| v.iter().map(|c| c * c).sum::<f64>().sqrt()).sum::<f64>();
    let shut_off = WEIGHTED.iter().enumerate().filter_map(|(column, &(i, ..))| {
        let row = stretches.iter().find(|row| row.weights[column] == 0.0)?;
        Some((PARAMETERS[i].0.to_string(), row.start_s))
    });
    let summary = MissionSummary {
        format: 1,
        scenario: "iss-slalom-cargo".into(),
        seed: 9_007_199_254_740_993,
        options: FlyOptions {
            seed: 9_007_199_254_740_993,
            weighting: WeightingChoice::Covariance,
            feedback: true,
            model: ModelChoice::High,
            fault: Some(FaultChoice { name: FaultName::LateObstacle, severity: 1 }),
            layers: LayerNames::default(),
        },
        layers: LayerNames::default().all(),
        arrived: true,
        no_way: None,
        mission_s: DURATION_S,
        min_clearance_m: series.clearance_m.iter().flatten().copied().reduce(f64::min),
        limit_violations: 0,
        impulse_n_s: impulse(&series.force_n),
        angular_impulse_n_m_s: impulse(&series.torque_n_m),
        rms_tracking_m: TrackingRms { all: rms(0), last_leg: rms(560) },
        parameters: (0..10)
            .map(|i| ParameterRow {
                name: PARAMETERS[i].0.into(),
                unit: PARAMETERS[i].1.into(),
                truth: TRUTH[i],
                initial: INITIAL[i],
                estimate: estimate[i],
                sigma: sigma[i],
            })
            .collect(),
        replans: 1,
        belief_revisions: 76,
        fallbacks: vec![FallbackRow { t_s: 71.2, reason: "hold: no stretch in time".into() }],
        faults: BTreeMap::from([("late-obstacle".into(), 1)]),
        information_shut_off_s: shut_off.collect(),
        warnings: vec!["beliefs 45 to 54 reached the controller late".into()],
        doubts: Vec::new(),
        beyond_localization_s: 0.0,
        promises: Promises::default(),
    };
    let beliefs = (0..=75_u32).map(|number| {
        let t_s = 2.0 * f64::from(number);
        let (estimate, sigma) = estimates(t_s);
        let used_from_s = (!(90.0..110.0).contains(&t_s)).then_some(t_s + 0.2);
        BeliefRow { t_s, revision: u64::from(number), used_from_s, estimate, sigma }
    });
    MissionRecord {
        scenario_toml: "format = 1\nname = \"iss-slalom-cargo\"\n\n[world]\npreset = \"iss\"\nobstacles = 4\n".into(),
        version: env!("CARGO_PKG_VERSION").into(),
        robot_radius_m: 0.15,
        planar: false,
        goal_m: on_way(1.0),
        keep_in: vec![DrawnBox { lower_m: [10.0, -9.95, 4.05], upper_m: [11.75, -7.4, 5.55] }],
        keep_out: vec![DrawnBox { lower_m: [10.0, -7.75, 4.05], upper_m: [10.35, -7.4, 4.55] }],
        obstacles,
        payload: Some(DrawnPayload {
            center_m: [0.25, 0.0, 0.02],
            quaternion_xyzw: [0.0, 0.0, 0.0, 1.0],
            edges_m: [0.2, 0.3, 0.12],
            held_s: [0.0, f64::INFINITY],
        }),
        series,
        ways: vec![way(0.0, 0, 0.0, 0.3), way(73.0, 36, progress(73.0), 1.9)],
        stretches,
        beliefs: beliefs.collect(),
        events: vec![
            event(0.0, "way", "first way adopted: 61 points"),
            event(ASTRONAUT_S, "obstacle", "an obstacle came into view 0.9 m away: stop"),
            event(71.2, "fallback", "hold at the end of the stop"),
            event(73.0, "way", "second way adopted"),
            event(90.0, "belief", "no update for 20 s"),
            event(146.4, "arrival", "at rest at the goal"),
        ],
        summary,
    }
}

/// A world with its last coordinate left out: the slalom of the table.
#[allow(dead_code)]
pub fn planar_sample() -> MissionRecord {
    let mut record = sample();
    let quaternion = [0.0, 0.0, -FRAC_1_SQRT_2, FRAC_1_SQRT_2];
    record.planar = true;
    record.summary.scenario = "granite-room".into();
    let flat = |points: &mut Vec<[f64; 3]>| points.iter_mut().for_each(|p| p[2] = -0.76);
    flat(&mut record.series.position_m);
    flat(&mut record.series.wanted_position_m);
    flat(&mut record.series.believed_position_m);
    record.series.quaternion_xyzw.iter_mut().for_each(|q| *q = quaternion);
    record.series.wanted_quaternion_xyzw.iter_mut().for_each(|q| *q = quaternion);
    for way in &mut record.ways {
        flat(&mut way.points_m);
        way.tree_m.iter_mut().flatten().for_each(|p| p[2] = -0.76);
    }
    record.stretches.iter_mut().for_each(|stretch| flat(&mut stretch.points_m));
    for obstacle in &mut record.obstacles {
        obstacle.center_m[2] = 0.0;
        obstacle.semi_axes_m[2] = 5.0;
    }
    record.goal_m[2] = -0.76;
    record.keep_in = vec![DrawnBox { lower_m: [10.0, -9.95, -0.76], upper_m: [11.75, -7.4, -0.76] }];
    record.keep_out.clear();
    record
}
