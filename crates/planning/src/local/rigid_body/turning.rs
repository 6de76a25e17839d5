//! One step of a body about its centre of mass, and how its end changes: the kernel of [`super::RigidBodyModel`].
//!
//! The attitude is `q r` with `q` held and the raw quaternion `r` from one: the classical Runge-Kutta method commutes with the
//! product from the left. Everything is in the body axes at the start, so nothing here depends on where the body is, how fast
//! it moves, or how it stands:
//! `r' = r (0, w) / 2`, `w' = J^-1 (t - w x J w)`, `v' = r g r* / |r|^2`, `p' = v` for a torque `t` about the centre of mass and a
//! push `g`, its acceleration in body axes, both held.

use super::arrays::{M3, V3, V4, add, add_matrix, cross, dot, is_zero, plus, product, rotation, skew, times};

/// Number of lanes: change by the rate (3) and by the torque (3), and two that fill up the vectors of the processor.
pub const LANES: usize = 8;
/// One number in each lane.
pub type Lanes = [f64; LANES];

/// Places of the stages of the classical Runge-Kutta method and weights of their slopes, over the step.
const PLACES: [f64; 4] = [0.0, 0.5, 0.5, 1.0];
const WEIGHTS: [f64; 4] = [1.0 / 6.0, 1.0 / 3.0, 1.0 / 3.0, 1.0 / 6.0];
/// Weights of accelerations in the position, over the squared step.
const POSITION_WEIGHTS: [f64; 4] = [1.0 / 6.0, 1.0 / 6.0, 1.0 / 6.0, 0.0];

/// How a body turns: `w' = inverse t + 1/2 G(w) w` with `G(w) = sum of w_k bend[k]` the derivative of `w'` by `w`.
#[derive(Clone, Copy, Debug)]
pub struct Rotor {
    /// Inverse of the inertia about the centre of mass.
    pub inverse: M3,
    bend: [M3; 3],
}

/// The change of a [`Rotor`] with a parameter.
#[derive(Clone, Copy, Debug)]
pub struct RotorChange {
    is_none: bool,
    inverse: M3,
    bend: [M3; 3],
}

/// `S(J w) - S(w) J`: minus the derivative of `w x J w`.
fn gyroscopic(inertia: &M3, rate: &V3) -> M3 {
    let (mut bend, turned) = (skew(&times(inertia, rate)), product(&skew(rate), inertia));
    add_matrix(&mut bend, -1.0, &turned);
    bend
}

const AXES: M3 = [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]];

impl Rotor {
    /// A body with this inertia about its centre of mass and its inverse.
    pub fn new(inertia: &M3, inverse: &M3) -> Self {
        Self { inverse: *inverse, bend: AXES.map(|axis| product(inverse, &gyroscopic(inertia, &axis))) }
    }

    /// Its change with a change of the inertia.
    pub fn change(&self, inertia: &M3) -> RotorChange {
        let minus = product(&self.inverse, inertia).map(|row| row.map(|x| -x));
        let bend = core::array::from_fn(|k| {
            let mut bend = product(&self.inverse, &gyroscopic(inertia, &AXES[k]));
            add_matrix(&mut bend, 1.0, &product(&minus, &self.bend[k]));
            bend
        });
        RotorChange { is_none: inertia.iter().all(is_zero), inverse: product(&minus, &self.inverse), bend }
    }
}

/// Sum of `rate_k bend[k]`.
#[inline(always)]
fn bent(bend: &[M3; 3], rate: &V3) -> M3 {
    let row = |i: usize| {
        core::array::from_fn(|j| rate[0] * bend[0][i][j] + rate[1] * bend[1][i][j] + rate[2] * bend[2][i][j])
    };
    [row(0), row(1), row(2)]
}

/// `r (0, w) / 2`.
#[inline(always)]
fn quaternion_rate(r: &V4, w: &V3) -> V4 {
    let ([r0, r1, r2, r3], [w0, w1, w2]) = (*r, w.map(|x| 0.5 * x));
    [
        -(r1 * w0 + r2 * w1 + r3 * w2),
        r0 * w0 + r2 * w2 - r3 * w1,
        r0 * w1 + r3 * w0 - r1 * w2,
        r0 * w2 + r1 * w1 - r2 * w0,
    ]
}

/// Change of `r g r*` by `r`.
#[inline(always)]
fn swing(r: &V4, g: &V3) -> [V4; 3] {
    let [r0, r1, r2, r3] = r.map(|x| 2.0 * x);
    let d = dot(&[r1, r2, r3], g);
    let [u0, u1, u2] = plus(&cross(&[r1, r2, r3], g), r0, g);
    [[u0, d, u2, -u1], [u1, -u2, d, u0], [u2, u1, -u0, d]]
}

/// Adds `factor a b'`.
#[inline(always)]
fn add_outer(m: &mut [V4; 3], factor: f64, a: &V3, b: &V4) {
    for (row, a) in m.iter_mut().zip(a) {
        add(row, factor * a, b);
    }
}

#[inline(always)]
fn times4(m: &[V4; 3], x: &V4) -> V3 {
    [dot4(&m[0], x), dot4(&m[1], x), dot4(&m[2], x)]
}

#[inline(always)]
fn dot4(a: &V4, b: &V4) -> f64 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2] + a[3] * b[3]
}

/// Torque about the centre of mass and acceleration by the force, body axes.
#[derive(Clone, Copy, Debug)]
pub struct Effort {
    /// N m.
    pub torque: V3,
    /// m/s^2.
    pub push: V3,
}

#[derive(Clone, Copy, Debug, Default)]
struct Stage {
    attitude: V4,
    rate: V3,
    /// Change of the angular acceleration by the rate.
    bend: M3,
    /// Over the squared norm of the quaternion.
    inverse_square: f64,
    /// Rotation matrix of the attitude.
    turned: M3,
    /// The push, turned.
    pushed: V3,
}

impl Stage {
    /// Change of a push, turned, by the quaternion: of `r g r* / |r|^2` by `r`.
    #[inline(always)]
    fn swing(&self, push: &V3, pushed: &V3) -> [V4; 3] {
        let mut swing = swing(&self.attitude, push);
        add_outer(&mut swing, -2.0, pushed, &self.attitude);
        swing.map(|row| row.map(|x| x * self.inverse_square))
    }
}

/// The end of a step.
#[derive(Clone, Copy, Debug)]
pub struct Turn {
    stages: [Stage; 4],
    raw: V4,
    inverse_square: f64,
    /// Attitude at the end, from the body axes at the start.
    pub attitude: V4,
    /// Rate at the end, body axes at the end.
    pub rate: V3,
    /// Velocity gained.
    pub velocity: V3,
    /// Way gained, beside that of the velocity at the start.
    pub position: V3,
    /// Change of the velocity by the push.
    pub velocity_by_push: M3,
    /// Change of the way by the push.
    pub position_by_push: M3,
}

/// Takes a step.
#[inline]
pub fn turn(rotor: &Rotor, rate: &V3, effort: &Effort, step_s: f64) -> Turn {
    let mut stages = [Stage::default(); 4];
    let (mut raw, mut end_rate) = ([1.0, 0.0, 0.0, 0.0], *rate);
    let (start, spun) = (raw, times(&rotor.inverse, &effort.torque));
    let (mut velocity_by_push, mut position_by_push) = ([[0.0; 3]; 3], [[0.0; 3]; 3]);
    let (mut attitude_rate, mut rate_rate) = ([0.0; 4], [0.0; 3]);
    for (i, stage) in stages.iter_mut().enumerate() {
        let (place, weight) = (PLACES[i] * step_s, WEIGHTS[i] * step_s);
        stage.attitude = plus(&start, place, &attitude_rate);
        stage.rate = plus(rate, place, &rate_rate);
        stage.bend = bent(&rotor.bend, &stage.rate);
        attitude_rate = quaternion_rate(&stage.attitude, &stage.rate);
        rate_rate = plus(&spun, 0.5, &times(&stage.bend, &stage.rate));
        add(&mut raw, weight, &attitude_rate);
        add(&mut end_rate, weight, &rate_rate);
        stage.inverse_square = 1.0 / dot4(&stage.attitude, &stage.attitude);
        stage.turned = rotation(&stage.attitude, &stage.attitude).map(|row| row.map(|x| x * stage.inverse_square));
        stage.pushed = times(&stage.turned, &effort.push);
        add_matrix(&mut velocity_by_push, weight, &stage.turned);
        add_matrix(&mut position_by_push, POSITION_WEIGHTS[i] * step_s * step_s, &stage.turned);
    }
    let inverse_square = 1.0 / dot4(&raw, &raw);
    let inverse_norm = f64::sqrt(inverse_square);
    Turn {
        stages,
        raw,
        inverse_square,
        attitude: raw.map(|x| x * inverse_norm),
        rate: end_rate,
        velocity: times(&velocity_by_push, &effort.push),
        position: times(&position_by_push, &effort.push),
        velocity_by_push,
        position_by_push,
    }
}

/// Rows of the imaginary part of `factor r* x` as a matrix on `x`.
#[inline(always)]
fn imaginary_of_quotient(r: &V4, factor: f64) -> [V4; 3] {
    let [r0, r1, r2, r3] = r.map(|x| factor * x);
    [[-r1, r0, r3, -r2], [-r2, -r3, r0, r1], [-r3, r2, -r1, r0]]
}

/// How start, effort and body change together.
#[derive(Clone, Copy, Debug)]
pub struct Along<'a> {
    /// Of the rate at the start.
    pub rate: V3,
    /// Of the effort.
    pub effort: Effort,
    /// Of the body.
    pub rotor: &'a RotorChange,
}

impl Along<'_> {
    /// Whether the body turns as before.
    fn turns_alike(&self) -> bool {
        self.rotor.is_none && is_zero(&self.rate) && is_zero(&self.effort.torque)
    }
}

#[derive(Clone, Copy, Debug, Default)]
struct StageAlong {
    attitude: V4,
    rate: V3,
    /// Change of the angular acceleration by the rate, changed.
    bend: M3,
}

/// The change of the end of a step.
#[derive(Clone, Copy, Debug)]
pub struct TurnAlong {
    stages: [StageAlong; 4],
    raw: V4,
    /// Of the attitude, a right increment, rad.
    pub attitude: V3,
    /// Of the rate.
    pub rate: V3,
    /// Of the velocity gained.
    pub velocity: V3,
    /// Of the way gained.
    pub position: V3,
}

/// How the end of a step changes along one change of everything.
#[inline]
pub fn turn_along(rotor: &Rotor, turn: &Turn, effort: &Effort, along: &Along<'_>, step_s: f64) -> TurnAlong {
    let mut stages = [StageAlong::default(); 4];
    let spun = plus(&times(&rotor.inverse, &along.effort.torque), 1.0, &times(&along.rotor.inverse, &effort.torque));
    let (mut raw, mut end_rate) = ([0.0; 4], along.rate);
    let mut velocity = times(&turn.velocity_by_push, &along.effort.push);
    let mut position = times(&turn.position_by_push, &along.effort.push);
    let (mut attitude_rate, mut rate_rate) = ([0.0; 4], [0.0; 3]);
    for (i, (stage, at)) in stages.iter_mut().zip(&turn.stages).enumerate() {
        let (place, weight) = (PLACES[i] * step_s, WEIGHTS[i] * step_s);
        stage.attitude = attitude_rate.map(|x| place * x);
        stage.rate = plus(&along.rate, place, &rate_rate);
        let changed = bent(&along.rotor.bend, &at.rate);
        stage.bend = bent(&rotor.bend, &stage.rate);
        add_matrix(&mut stage.bend, 1.0, &changed);
        attitude_rate =
            plus(&quaternion_rate(&stage.attitude, &at.rate), 1.0, &quaternion_rate(&at.attitude, &stage.rate));
        rate_rate = plus(&spun, 0.5, &times(&changed, &at.rate));
        add(&mut rate_rate, 1.0, &times(&at.bend, &stage.rate));
        add(&mut raw, weight, &attitude_rate);
        add(&mut end_rate, weight, &rate_rate);
        let swung = times4(&at.swing(&effort.push, &at.pushed), &stage.attitude);
        add(&mut velocity, weight, &swung);
        add(&mut position, POSITION_WEIGHTS[i] * step_s * step_s, &swung);
    }
    let attitude = imaginary_of_quotient(&turn.raw, 2.0 * turn.inverse_square).map(|row| dot4(&row, &raw));
    TurnAlong { stages, raw, attitude, rate: end_rate, velocity, position }
}

#[derive(Clone, Copy, Debug)]
struct StageLanes {
    attitude: [Lanes; 4],
    rate: [Lanes; 3],
}

const NONE: Lanes = [0.0; LANES];
const NO_STAGE: StageLanes = StageLanes { attitude: [NONE; 4], rate: [NONE; 3] };

/// The change of the end of a step by rate and torque, one lane each.
#[derive(Clone, Copy, Debug)]
pub struct TurnLanes {
    /// Of the attitude, a right increment, rad.
    pub attitude: [Lanes; 3],
    /// Of the rate.
    pub rate: [Lanes; 3],
    /// Of the velocity gained.
    pub velocity: [Lanes; 3],
    /// Of the way gained.
    pub position: [Lanes; 3],
}

/// The change of the whole step by rate and torque.
#[derive(Clone, Copy, Debug)]
pub struct TurnByStart {
    stages: [StageLanes; 4],
    raw: [Lanes; 4],
    /// Of the end.
    pub end: TurnLanes,
}

/// Adds `m x` in every lane.
#[inline(always)]
fn add_times<const R: usize, const C: usize>(sum: &mut [Lanes; R], m: &[[f64; C]; R], x: &[Lanes; C]) {
    for (sum, row) in sum.iter_mut().zip(m) {
        for l in 0..LANES {
            let mut s = sum[l];
            for (m, x) in row.iter().zip(x) {
                s += m * x[l];
            }
            sum[l] = s;
        }
    }
}

/// Adds `factor x` in every lane.
#[inline(always)]
fn add_lanes<const R: usize>(sum: &mut [Lanes; R], factor: f64, x: &[Lanes; R]) {
    for (sum, x) in sum.iter_mut().zip(x) {
        for l in 0..LANES {
            sum[l] += factor * x[l];
        }
    }
}

/// Adds the change of `r (0, w) / 2` for the changes `x` of `r` and `w`.
#[inline(always)]
fn add_quaternion_rate(sum: &mut [Lanes; 4], r: &V4, w: &V3, x: &StageLanes) {
    let ([r0, r1, r2, r3], [w0, w1, w2]) = (r.map(|x| 0.5 * x), w.map(|x| 0.5 * x));
    let ([q0, q1, q2, q3], [v0, v1, v2]) = (&x.attitude, &x.rate);
    for l in 0..LANES {
        let (x0, x1, x2, x3, y0, y1, y2) = (q0[l], q1[l], q2[l], q3[l], v0[l], v1[l], v2[l]);
        sum[0][l] -= (x1 * w0 + x2 * w1 + x3 * w2) + (r1 * y0 + r2 * y1 + r3 * y2);
        sum[1][l] += (x0 * w0 + x2 * w2 - x3 * w1) + (r0 * y0 + r2 * y2 - r3 * y1);
        sum[2][l] += (x0 * w1 + x3 * w0 - x1 * w2) + (r0 * y1 + r3 * y0 - r1 * y2);
        sum[3][l] += (x0 * w2 + x1 * w1 - x2 * w0) + (r0 * y2 + r1 * y1 - r2 * y0);
    }
}

/// Writes `m` into the lanes of the torque.
#[inline(always)]
fn by_torque(m: &M3) -> [Lanes; 3] {
    m.map(|[x, y, z]| [0.0, 0.0, 0.0, x, y, z, 0.0, 0.0])
}

/// How the end of a step changes by rate and torque.
#[inline]
pub fn turn_by_start(rotor: &Rotor, turn: &Turn, effort: &Effort, step_s: f64) -> TurnByStart {
    let mut stages = [NO_STAGE; 4];
    let spun = by_torque(&rotor.inverse);
    let (mut start, mut slope) = (NO_STAGE, NO_STAGE);
    for (k, lanes) in start.rate.iter_mut().enumerate() {
        lanes[k] = 1.0;
    }
    let mut end = start;
    let (mut velocity, mut position) = ([NONE; 3], [NONE; 3]);
    for (i, (stage, at)) in stages.iter_mut().zip(&turn.stages).enumerate() {
        let (place, weight) = (PLACES[i] * step_s, WEIGHTS[i] * step_s);
        *stage = start;
        add_lanes(&mut stage.attitude, place, &slope.attitude);
        add_lanes(&mut stage.rate, place, &slope.rate);
        slope = StageLanes { attitude: [NONE; 4], rate: spun };
        add_quaternion_rate(&mut slope.attitude, &at.attitude, &at.rate, stage);
        add_times(&mut slope.rate, &at.bend, &stage.rate);
        add_lanes(&mut end.attitude, weight, &slope.attitude);
        add_lanes(&mut end.rate, weight, &slope.rate);
        let mut swung = [NONE; 3];
        add_times(&mut swung, &at.swing(&effort.push, &at.pushed), &stage.attitude);
        add_lanes(&mut velocity, weight, &swung);
        add_lanes(&mut position, POSITION_WEIGHTS[i] * step_s * step_s, &swung);
    }
    let mut attitude = [NONE; 3];
    add_times(&mut attitude, &imaginary_of_quotient(&turn.raw, 2.0 * turn.inverse_square), &end.attitude);
    TurnByStart { stages, raw: end.attitude, end: TurnLanes { attitude, rate: end.rate, velocity, position } }
}

/// How a [`TurnAlong`] changes with the start.
#[derive(Clone, Copy, Debug)]
pub struct TurnAlongByStart {
    /// By rate and torque.
    pub end: TurnLanes,
    /// Change of the velocity by the push.
    pub velocity_by_push: M3,
    /// Change of the way by the push.
    pub position_by_push: M3,
}

/// How [`turn_along`] changes by rate, torque and push, with the numbers of `along` held.
#[inline]
pub fn turn_along_by_start(
    turn: &Turn,
    by_start: &TurnByStart,
    effort: &Effort,
    along: &Along<'_>,
    turn_along: &TurnAlong,
    step_s: f64,
) -> TurnAlongByStart {
    let (mut velocity, mut position) = ([NONE; 3], [NONE; 3]);
    if along.turns_alike() {
        for i in 1..4 {
            let weight = WEIGHTS[i] * step_s;
            let mut swung = [NONE; 3];
            let (at, push) = (&turn.stages[i], &along.effort.push);
            add_times(&mut swung, &at.swing(push, &times(&at.turned, push)), &by_start.stages[i].attitude);
            add_lanes(&mut velocity, weight, &swung);
            add_lanes(&mut position, POSITION_WEIGHTS[i] * step_s * step_s, &swung);
        }
        let end = TurnLanes { attitude: [NONE; 3], rate: [NONE; 3], velocity, position };
        return TurnAlongByStart { end, velocity_by_push: [[0.0; 3]; 3], position_by_push: [[0.0; 3]; 3] };
    }
    let spun = by_torque(&along.rotor.inverse);
    let (mut velocity_by_push, mut position_by_push) = ([[0.0; 3]; 3], [[0.0; 3]; 3]);
    // at the start the attitude is one, whatever changes
    let mut slope = StageLanes { attitude: [NONE; 4], rate: spun };
    add_times(&mut slope.rate, &turn_along.stages[0].bend, &by_start.stages[0].rate);
    let mut end = NO_STAGE;
    add_lanes(&mut end.rate, WEIGHTS[0] * step_s, &slope.rate);
    for i in 1..4 {
        let (at, changed, x) = (&turn.stages[i], &turn_along.stages[i], &by_start.stages[i]);
        let (place, weight) = (PLACES[i] * step_s, WEIGHTS[i] * step_s);
        let mut stage = NO_STAGE;
        add_lanes(&mut stage.attitude, place, &slope.attitude);
        add_lanes(&mut stage.rate, place, &slope.rate);
        slope = StageLanes { attitude: [NONE; 4], rate: spun };
        add_quaternion_rate(&mut slope.attitude, &at.attitude, &at.rate, &stage);
        add_quaternion_rate(&mut slope.attitude, &changed.attitude, &changed.rate, x);
        add_times(&mut slope.rate, &at.bend, &stage.rate);
        add_times(&mut slope.rate, &changed.bend, &x.rate);
        add_lanes(&mut end.attitude, weight, &slope.attitude);
        add_lanes(&mut end.rate, weight, &slope.rate);
        let by_attitude = at.swing(&effort.push, &at.pushed);
        let pushed = plus(&times(&at.turned, &along.effort.push), 1.0, &times4(&by_attitude, &changed.attitude));
        let grown = 2.0 * dot4(&at.attitude, &changed.attitude);
        let mut by_attitude_changed = swing(&at.attitude, &along.effort.push);
        let by_changed = swing(&changed.attitude, &effort.push);
        for (row, (by_changed, by_attitude)) in by_attitude_changed.iter_mut().zip(by_changed.iter().zip(&by_attitude))
        {
            add(row, 1.0, by_changed);
            add(row, -grown, by_attitude);
        }
        add_outer(&mut by_attitude_changed, -2.0, &pushed, &at.attitude);
        add_outer(&mut by_attitude_changed, -2.0, &at.pushed, &changed.attitude);
        let by_attitude_changed = by_attitude_changed.map(|row| row.map(|x| x * at.inverse_square));
        let mut swung = [NONE; 3];
        add_times(&mut swung, &by_attitude, &stage.attitude);
        add_times(&mut swung, &by_attitude_changed, &x.attitude);
        let position_weight = POSITION_WEIGHTS[i] * step_s * step_s;
        add_lanes(&mut velocity, weight, &swung);
        add_lanes(&mut position, position_weight, &swung);
        let mut turned = rotation(&at.attitude, &changed.attitude).map(|row| row.map(|x| 2.0 * x));
        add_matrix(&mut turned, -grown, &at.turned);
        add_matrix(&mut velocity_by_push, weight * at.inverse_square, &turned);
        add_matrix(&mut position_by_push, position_weight * at.inverse_square, &turned);
    }
    // the change of 2 Im(r* r_c) / |r|^2
    let factor = 2.0 * turn.inverse_square;
    let mut by_raw = imaginary_of_quotient(&turn_along.raw, -factor);
    for (row, changed) in by_raw.iter_mut().zip(turn_along.attitude) {
        add(row, -factor * changed, &turn.raw);
    }
    let mut attitude = [NONE; 3];
    add_times(&mut attitude, &imaginary_of_quotient(&turn.raw, factor), &end.attitude);
    add_times(&mut attitude, &by_raw, &by_start.raw);
    let end = TurnLanes { attitude, rate: end.rate, velocity, position };
    TurnAlongByStart { end, velocity_by_push, position_by_push }
}
