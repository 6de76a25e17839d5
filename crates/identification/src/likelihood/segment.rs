//! One segment of a record rolled out from its first state: residuals, their tangents, normal matrices.
//!
//! # Shape
//! A row of a tangent has one lane per column: attitude, rate, centre, velocity of the segment's first state (12), torque
//! and force noise (6), ln m, centre of mass (3), inertia about it (6), calibration columns, and last the residual (or
//! defect) itself. `W` is the number of lanes, a multiple of eight; those past the last column stay zero.

use super::calibration::{Calibration, Nuisance};
use super::drive::Drive;
use super::flow::{AngularTangent, Body, Input, State, Step, by_inertia};
use super::lanes::{NOISE, PARAMETERS};
use super::sample::Sample;
use crate::lie::{LieGroup, rotation_jacobian, rotation_jacobian_inverse, skew};
use core::ops::Range;
use nalgebra::{Matrix3, UnitQuaternion, Vector3};

const CENTER: usize = PARAMETERS + 1;
const INERTIA: usize = PARAMETERS + 4;

/// Measurement groups, each with one noise level.
pub(crate) const POSITION: usize = 0;
pub(crate) const ATTITUDE: usize = 1;
pub(crate) const VELOCITY: usize = 2;
pub(crate) const RATE: usize = 3;
pub(crate) const ACCELERATION: usize = 4;
pub(crate) const MEASUREMENTS: usize = 5;

/// Derivatives of attitude, rate, centre and velocity, three rows each.
pub(crate) type Tangent<const W: usize> = [[[f64; W]; 3]; 4];

/// Bounds on residual 3-vectors, in standard deviations.
pub(super) const HUBER: f64 = 2.5;
pub(super) const GATE: f64 = 4.5;

/// Bounds on the norm of one residual 3-vector, in standard deviations.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Robust {
    /// Beyond this a residual counts linearly.
    pub(crate) huber: f64,
    /// Beyond this it does not count at all.
    pub(crate) gate: f64,
}

/// What a rollout depends on besides its first state.
#[derive(Clone, Copy)]
pub(crate) struct Model<'a> {
    pub(crate) samples: &'a [Sample],
    /// What acts on each of them.
    pub(crate) drives: &'a [Drive],
    /// All acceleration that is not by the wrench, inertial axes.
    pub(crate) gravity: Vector3<f64>,
    pub(crate) body: Body,
    pub(crate) calibration: &'a Calibration,
    /// Standard deviations, to judge outliers by.
    pub(crate) sigma: [f64; MEASUREMENTS],
    pub(crate) robust: Option<Robust>,
}

/// Residuals by group: the rows of one segment, and what a whole sweep adds up.
pub(crate) struct Rows<const W: usize> {
    /// Of the last segment rolled out.
    pub(crate) groups: [Vec<[f64; W]>; MEASUREMENTS],
    /// Residual 3-vectors of a whole sweep.
    pub(crate) residuals: [Vec<Vector3<f64>>; MEASUREMENTS],
    /// Sums over them.
    pub(crate) tally: Tally,
}

impl<const W: usize> Rows<W> {
    pub(crate) fn new() -> Self {
        Self {
            groups: [const { Vec::new() }; MEASUREMENTS],
            residuals: [const { Vec::new() }; MEASUREMENTS],
            tally: Tally::default(),
        }
    }

    /// Before a sweep.
    pub(crate) fn restart(&mut self) {
        for residuals in &mut self.residuals {
            residuals.clear();
        }
        self.tally = Tally::default();
    }
}

/// Sums over residual 3-vectors, by group.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Tally {
    /// Weighted squares of residuals, in their own units.
    pub(crate) squares: [f64; MEASUREMENTS],
    /// Residual 3-vectors that count.
    pub(crate) counted: [usize; MEASUREMENTS],
    /// Residual 3-vectors beyond the gate.
    pub(crate) rejected: [usize; MEASUREMENTS],
}

impl Model<'_> {
    /// Rolls the samples out, leaves their residual rows in `rows` and the end tangent in `tangent`; gives the end state.
    ///
    /// `last`: the record ends here, and the wrench after its last sample acts on nothing.
    pub(crate) fn roll<const W: usize>(
        &self,
        start: &State,
        noise: &[f64; 6],
        samples: Range<usize>,
        last: bool,
        rows: &mut Rows<W>,
        tangent: &mut Tangent<W>,
    ) -> State {
        *tangent = [[[0.0; W]; 3]; 4];
        for i in 0..12 {
            tangent[i / 3][i % 3][i] = 1.0;
        }
        for group in &mut rows.groups {
            group.clear();
        }
        let (mut state, end) = (*start, samples.end);
        for k in samples {
            let (sample, drive) = (&self.samples[k], &self.drives[k]);
            let input = self.calibration.input(&drive.input, noise);
            let parts = self.body.parts(&state, &input, sample.step_s);
            let h = sample.step_s / parts as f64;
            for part in 0..parts {
                let acting = if parts == 1 { input } else { input.part(part, parts, sample.step_s) };
                let step = self.body.step(&state, &acting, &self.gravity, h);
                let angular = self.body.angular_tangent(&state.rate, &step, h);
                if part == 0 {
                    Measured { model: self, state: &state, input: &input, noise, angular: &angular, tangent }.rows(
                        sample,
                        drive,
                        &step.acceleration,
                        rows,
                    );
                }
                if last && k + 1 == end {
                    return state;
                }
                self.propagate(&state, &acting, &step, &angular, h, tangent);
                self.calibration.input_columns(&input, &drive.by_lag, |lane, column| {
                    let column = column.part(part, parts, sample.step_s);
                    self.add_input_column((lane, &column), &state, &step, &angular, h, tangent);
                });
                state = step.next;
            }
        }
        state
    }

    fn propagate<const W: usize>(
        &self,
        state: &State,
        input: &Input,
        step: &Step,
        angular: &AngularTangent,
        h: f64,
        tangent: &mut Tangent<W>,
    ) {
        let rotation = state.world_from_body.adjoint();
        let (drive, reach) = (h / self.body.mass, h * h / self.body.mass);
        let jacobian = rotation_jacobian(&step.turn);
        let swept = rotation * skew(&input.force) * drive;
        let matrices = Transition {
            attitude_by_attitude: step.turned.adjoint().transpose(),
            attitude_by_rate: jacobian * angular.turn.rate,
            rate_by_rate: angular.rate.rate,
            center_by_attitude: -(rotation * skew(&step.center_force)) * reach,
            center_by_rate: swept * (-h * h / 6.0),
            velocity_by_attitude: -(rotation * skew(&step.velocity_force)) * drive,
            velocity_by_rate: swept * (-h / 2.0),
            step_s: h,
        };
        matrices.apply(tangent);
        let [attitude, rate, center, velocity] = tangent;
        // Torque about the centre of mass: d torque + S(f) dc - S(c) df.
        let (attitude_by_torque, rate_by_torque) = (jacobian * angular.turn.torque, angular.rate.torque);
        let lever = skew(&self.body.center);
        let (attitude_by_force, rate_by_force) = (-(attitude_by_torque * lever), -(rate_by_torque * lever));
        let (velocity_by_force, center_by_force) = (rotation * drive, rotation * (0.5 * reach));
        let (torque_scale, force_scale) = self.calibration.wrench_scale();
        let (by_torque, by_force) = (Matrix3::from_diagonal(&torque_scale), Matrix3::from_diagonal(&force_scale));
        add_columns(attitude, NOISE, &(attitude_by_torque * by_torque));
        add_columns(rate, NOISE, &(rate_by_torque * by_torque));
        add_columns(attitude, NOISE + 3, &(attitude_by_force * by_force));
        add_columns(rate, NOISE + 3, &(rate_by_force * by_force));
        add_columns(center, NOISE + 3, &(center_by_force * by_force));
        add_columns(velocity, NOISE + 3, &(velocity_by_force * by_force));
        for axis in 0..3 {
            if let Some(lane) = self.calibration.lane(Nuisance::TableSlope(axis)) {
                velocity[axis][lane] += h;
                center[axis][lane] += 0.5 * h * h;
            }
        }
        let moment = skew(&input.force);
        add_columns(attitude, CENTER, &(attitude_by_torque * moment));
        add_columns(rate, CENTER, &(rate_by_torque * moment));
        add_columns(attitude, INERTIA, &(jacobian * angular.turn.inertia));
        add_columns(rate, INERTIA, &angular.rate.inertia);
        add_column(velocity, PARAMETERS, &(rotation * step.velocity_force * -drive));
        add_column(center, PARAMETERS, &(rotation * step.center_force * -reach));
    }

    /// What a change of the acting wrench does to the end of one step.
    ///
    /// In the direction in which mass, inertia and wrench grow alike this cancels the columns of mass and inertia to the
    /// last digit.
    fn add_input_column<const W: usize>(
        &self,
        (lane, change): (usize, &Input),
        state: &State,
        step: &Step,
        angular: &AngularTangent,
        h: f64,
        tangent: &mut Tangent<W>,
    ) {
        let (w, body) = (&state.rate, &self.body);
        let force = change.force - change.force_slope * (0.5 * h);
        let torque = change.torque - change.torque_slope * (0.5 * h) - body.center.cross(&force);
        let torque_slope = change.torque_slope - body.center.cross(&change.force_slope);
        let a0 = body.inverse * torque;
        let a1 = body.inverse * torque_slope + angular.acceleration.rate * a0;
        let turn = a0 * (h * h / 2.0) + a1 * (h * h * h / 6.0) + w.cross(&a0) * (h * h * h / 12.0);
        let swept = w.cross(&force);
        let first = swept + change.force_slope;
        let second = step.acceleration.cross(&force) + w.cross(&swept) + w.cross(&change.force_slope) * 2.0;
        let velocity_force = force + first * (h / 2.0) + second * (h * h / 6.0);
        let center_force = force * 0.5 + first * (h / 6.0) + second * (h * h / 24.0);
        let [attitude, rate, center, velocity] = tangent;
        add_column(attitude, lane, &(rotation_jacobian(&step.turn) * turn));
        add_column(rate, lane, &(a0 * h + a1 * (h * h / 2.0)));
        add_column(center, lane, &(state.world_from_body * center_force * (h * h / body.mass)));
        add_column(velocity, lane, &(state.world_from_body * velocity_force * (h / body.mass)));
    }
}

/// Derivative of the next state by the state.
struct Transition {
    attitude_by_attitude: Matrix3<f64>,
    attitude_by_rate: Matrix3<f64>,
    rate_by_rate: Matrix3<f64>,
    center_by_attitude: Matrix3<f64>,
    center_by_rate: Matrix3<f64>,
    velocity_by_attitude: Matrix3<f64>,
    velocity_by_rate: Matrix3<f64>,
    step_s: f64,
}

impl Transition {
    fn apply<const W: usize>(&self, tangent: &mut Tangent<W>) {
        let [[p0, p1, p2], [w0, w1, w2], [r0, r1, r2], [v0, v1, v2]] = tangent;
        let rows = |m: &Matrix3<f64>| -> [[f64; 3]; 3] { m.transpose().into() };
        let (pp, pw, ww) = (rows(&self.attitude_by_attitude), rows(&self.attitude_by_rate), rows(&self.rate_by_rate));
        let (rp, rw) = (rows(&self.center_by_attitude), rows(&self.center_by_rate));
        let (vp, vw) = (rows(&self.velocity_by_attitude), rows(&self.velocity_by_rate));
        let h = self.step_s;
        let dot = |m: &[f64; 3], a: f64, b: f64, c: f64| m[0] * a + m[1] * b + m[2] * c;
        for q in 0..W {
            let (a, b, c) = (p0[q], p1[q], p2[q]);
            let (d, e, f) = (w0[q], w1[q], w2[q]);
            r0[q] += h * v0[q] + dot(&rp[0], a, b, c) + dot(&rw[0], d, e, f);
            r1[q] += h * v1[q] + dot(&rp[1], a, b, c) + dot(&rw[1], d, e, f);
            r2[q] += h * v2[q] + dot(&rp[2], a, b, c) + dot(&rw[2], d, e, f);
            v0[q] += dot(&vp[0], a, b, c) + dot(&vw[0], d, e, f);
            v1[q] += dot(&vp[1], a, b, c) + dot(&vw[1], d, e, f);
            v2[q] += dot(&vp[2], a, b, c) + dot(&vw[2], d, e, f);
            p0[q] = dot(&pp[0], a, b, c) + dot(&pw[0], d, e, f);
            p1[q] = dot(&pp[1], a, b, c) + dot(&pw[1], d, e, f);
            p2[q] = dot(&pp[2], a, b, c) + dot(&pw[2], d, e, f);
            w0[q] = dot(&ww[0], d, e, f);
            w1[q] = dot(&ww[1], d, e, f);
            w2[q] = dot(&ww[2], d, e, f);
        }
    }
}

/// What an accelerometer feels, and by what.
struct Felt<'a> {
    /// The wrench.
    start: &'a Input,
    /// Angular acceleration under it, and by how much it is more than the one the step begins with.
    alpha: &'a Vector3<f64>,
    change: &'a Vector3<f64>,
    /// From the accelerometer to the centre of mass.
    arm: &'a Vector3<f64>,
    fall: &'a Vector3<f64>,
    all: Vector3<f64>,
}

/// Everything the rows of one sample depend on.
struct Measured<'a, const W: usize> {
    model: &'a Model<'a>,
    state: &'a State,
    input: &'a Input,
    noise: &'a [f64; 6],
    angular: &'a AngularTangent,
    tangent: &'a Tangent<W>,
}

impl<const W: usize> Measured<'_, W> {
    fn rows(&self, sample: &Sample, drive: &Drive, alpha: &Vector3<f64>, rows: &mut Rows<W>) {
        let Model { body, calibration, gravity, .. } = self.model;
        let State { world_from_body, rate, center, velocity } = self.state;
        let [attitude, angular, central, linear] = self.tangent;
        let rotation = world_from_body.adjoint();
        let (c, delay) = (&body.center, calibration.delay_s());
        let swept = rate.cross(c);
        let origin_velocity = velocity - rotation * swept;
        let force = self.input.force - self.input.force_slope * (0.5 * sample.step_s);
        let specific = force / body.mass - alpha.cross(c) - rate.cross(&swept);
        let origin_acceleration = rotation * specific + gravity;
        let lever = rotation * skew(c);
        let turning = rotation * skew(rate);
        let delay_lane = calibration.lane(Nuisance::Delay);

        if sample.posed {
            let residual = center - rotation * c - origin_velocity * delay
                + origin_acceleration * (0.5 * delay * delay)
                - sample.position;
            self.push(POSITION, &residual, rows, |row| {
                *row = *central;
                add_product(row, &lever, attitude);
                add_columns(row, CENTER, &-rotation);
                if delay != 0.0 {
                    add_product(row, &(rotation * skew(&swept) * -delay), attitude);
                    add_product(row, &(lever * -delay), angular);
                    add_product(row, &(Matrix3::identity() * -delay), linear);
                    add_columns(row, CENTER, &(turning * delay));
                }
                if let Some(lane) = delay_lane {
                    add_column(row, lane, &(origin_acceleration * delay - origin_velocity));
                }
            });

            let lag = alpha * (0.5 * delay * delay) - rate * delay;
            let late = world_from_body * <UnitQuaternion<f64> as LieGroup>::exp(&lag);
            let residual = LieGroup::log(&(sample.world_from_body.conjugate() * late));
            self.push(ATTITUDE, &residual, rows, |row| {
                let inverse = rotation_jacobian_inverse(&residual);
                if delay == 0.0 {
                    add_product(row, &inverse, attitude);
                } else {
                    let back = <UnitQuaternion<f64> as LieGroup>::exp(&(rate * delay)).adjoint();
                    add_product(row, &(inverse * back), attitude);
                    add_product(row, &(inverse * -delay), angular);
                }
                if let Some(lane) = delay_lane {
                    add_column(row, lane, &(inverse * (alpha * delay - rate)));
                }
            });
        }

        if let Some(measured) = sample.velocity {
            let residual = origin_velocity - origin_acceleration * delay - measured;
            self.push(VELOCITY, &residual, rows, |row| {
                *row = *linear;
                add_product(row, &(rotation * skew(&swept)), attitude);
                add_product(row, &lever, angular);
                add_columns(row, CENTER, &-turning);
                if let Some(lane) = delay_lane {
                    add_column(row, lane, &-origin_acceleration);
                }
            });
        }
        if let Some(measured) = sample.rate {
            self.push(RATE, &(rate - alpha * delay - measured), rows, |row| {
                *row = *angular;
                if let Some(lane) = delay_lane {
                    add_column(row, lane, &-alpha);
                }
            });
        }
        if let Some(measured) = sample.acceleration {
            let fall = world_from_body.inverse_transform_vector(gravity);
            let (scale, bias, position) = calibration.accelerometer();
            let start = calibration.input(&calibration.felt(&drive.start), self.noise);
            let torque = start.torque - c.cross(&start.force);
            let start_alpha = body.inverse * (torque - rate.cross(&(body.inertia * rate + start.stored)));
            let arm = c - position;
            let felt = start.force / body.mass - start_alpha.cross(&arm) - rate.cross(&rate.cross(&arm)) + fall;
            let residual = felt.component_mul(&scale) + bias - measured;
            self.push(ACCELERATION, &residual, rows, |row| {
                let change = start_alpha - alpha;
                let felt =
                    Felt { start: &start, alpha: &start_alpha, change: &change, arm: &arm, fall: &fall, all: felt };
                self.accelerometer(row, drive, &felt, &scale);
            });
        }
    }

    fn accelerometer(&self, row: &mut [[f64; W]; 3], drive: &Drive, at: &Felt<'_>, scale: &Vector3<f64>) {
        let Model { body, calibration, .. } = self.model;
        let Felt { start, alpha, change, arm, fall, all } = at;
        let (w, c) = (&self.state.rate, &body.center);
        let by = &self.angular.acceleration;
        let arm_cross = skew(arm);
        let centripetal = *arm * w.transpose() * 2.0 - w * arm.transpose() - Matrix3::identity() * w.dot(arm);
        add_product(row, &(centripetal + arm_cross * by.rate), &self.tangent[1]);
        add_product(row, &skew(fall), &self.tangent[0]);
        let by_torque = arm_cross * by.torque;
        let by_force = Matrix3::identity() / body.mass - by_torque * skew(c);
        let turning = skew(w);
        let by_arm = -skew(alpha) - turning * turning;
        let (torque_scale, force_scale) = calibration.wrench_scale();
        add_columns(row, NOISE, &(by_torque * Matrix3::from_diagonal(&torque_scale)));
        add_columns(row, NOISE + 3, &(by_force * Matrix3::from_diagonal(&force_scale)));
        add_columns(row, CENTER, &(by_torque * skew(&start.force) + by_arm));
        add_column(row, PARAMETERS, &(start.force / -body.mass));
        add_columns(row, INERTIA, &(arm_cross * (by.inertia - body.inverse * by_inertia(change))));
        calibration.input_columns(start, &calibration.felt(&drive.start_by_lag), |lane, column| {
            add_column(row, lane, &(by_torque * column.torque + by_force * column.force));
        });
        if let Some(lane) = calibration.lane(Nuisance::AccelerationDelay) {
            let (torque, force) = (
                drive.start.torque_slope.component_mul(&torque_scale),
                drive.start.force_slope.component_mul(&force_scale),
            );
            add_column(row, lane, &-(by_torque * torque + by_force * force));
        }
        for axis in 0..3 {
            if let Some(lane) = calibration.lane(Nuisance::AccelerometerPosition(axis)) {
                add_column(row, lane, &-by_arm.column(axis));
            }
            if let Some(lane) = calibration.lane(Nuisance::TableSlope(axis)) {
                let axis = self.state.world_from_body.inverse_transform_vector(&Vector3::ith(axis, 1.0));
                add_column(row, lane, &axis);
            }
        }
        for axis in 0..3 {
            for value in &mut row[axis] {
                *value *= scale[axis];
            }
            if let Some(lane) = calibration.lane(Nuisance::AccelerometerBias(axis)) {
                row[axis][lane] = 1.0;
            }
            if let Some(lane) = calibration.lane(Nuisance::AccelerometerScale(axis)) {
                row[axis][lane] = all[axis];
            }
        }
    }

    /// Weighs a residual, and keeps its row unless it is rejected.
    fn push(&self, group: usize, residual: &Vector3<f64>, rows: &mut Rows<W>, fill: impl FnOnce(&mut [[f64; W]; 3])) {
        let square = residual.dot(residual);
        rows.residuals[group].push(*residual);
        let mut weight = 1.0;
        if let Some(robust) = self.model.robust {
            let size = square.sqrt() / self.model.sigma[group];
            if size > robust.gate {
                rows.tally.rejected[group] += 1;
                return;
            }
            weight = (robust.huber / size).min(1.0);
        }
        rows.tally.squares[group] += weight * square;
        rows.tally.counted[group] += 1;
        let mut row = [[0.0; W]; 3];
        fill(&mut row);
        let (root, last) = (weight.sqrt(), self.model.calibration.columns() + PARAMETERS);
        for axis in 0..3 {
            row[axis][last] = residual[axis];
            if weight < 1.0 {
                for value in &mut row[axis] {
                    *value *= root;
                }
            }
        }
        rows.groups[group].extend_from_slice(&row);
    }
}

/// `rows += m * factors`.
fn add_product<const W: usize>(rows: &mut [[f64; W]; 3], m: &Matrix3<f64>, factors: &[[f64; W]; 3]) {
    let [a, b, c] = factors;
    for (i, row) in rows.iter_mut().enumerate() {
        let (x, y, z) = (m[(i, 0)], m[(i, 1)], m[(i, 2)]);
        for q in 0..W {
            row[q] += x * a[q] + y * b[q] + z * c[q];
        }
    }
}

fn add_columns<const W: usize, const N: usize>(
    rows: &mut [[f64; W]; 3],
    lane: usize,
    m: &nalgebra::SMatrix<f64, 3, N>,
) {
    for (i, row) in rows.iter_mut().enumerate() {
        for (j, value) in row[lane..lane + N].iter_mut().enumerate() {
            *value += m[(i, j)];
        }
    }
}

fn add_column<const W: usize>(rows: &mut [[f64; W]; 3], lane: usize, v: &Vector3<f64>) {
    for (row, value) in rows.iter_mut().zip(v.iter()) {
        row[lane] += value;
    }
}

/// Upper triangle of the sum of `row^T row`, row after row, `lanes` columns.
pub(crate) fn normal_matrix<const W: usize>(rows: &[[f64; W]], lanes: usize, packed: &mut [f64]) {
    const TALL: usize = 4;
    const WIDE: usize = 4;
    for top in (0..lanes).step_by(TALL) {
        for left in (top / WIDE * WIDE..lanes).step_by(WIDE) {
            let mut tile = [[0.0; WIDE]; TALL];
            for row in rows {
                let (factors, values) =
                    (&row.as_chunks::<TALL>().0[top / TALL], &row.as_chunks::<WIDE>().0[left / WIDE]);
                for (sums, factor) in tile.iter_mut().zip(factors) {
                    for (sum, value) in sums.iter_mut().zip(values) {
                        *sum += factor * value;
                    }
                }
            }
            for (i, sums) in (top..lanes).zip(&tile) {
                let start = packed_start(i, lanes);
                for (j, sum) in (left..lanes).zip(sums) {
                    if j >= i {
                        packed[start + j - i] = *sum;
                    }
                }
            }
        }
    }
}

/// Place of the diagonal entry of row `i` in a packed upper triangle.
pub(crate) fn packed_start(i: usize, lanes: usize) -> usize {
    i * lanes - i * i.saturating_sub(1) / 2
}

/// Entries of a packed upper triangle.
pub(crate) fn packed_len(lanes: usize) -> usize {
    lanes * (lanes + 1) / 2
}
