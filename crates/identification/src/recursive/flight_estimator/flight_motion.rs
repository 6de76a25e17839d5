//! Motion, body, and slow errors of wrench and sensors as one state of 58 numbers.

use super::erring_thrusters::{THRUSTERS, ThrustShares};
use super::settings::{FlightEstimatorSettings, WrenchErrors};
use super::slow_errors::SlowErrors;
use super::wrench_history::Held;
use crate::dynamics::{FreeFlyer, LogCholesky, RigidBodyState};
use crate::error::IdentificationError;
use crate::estimator::{Gauss, Measurement};
use crate::lie::{LieGroup, Manifold, Twist, Wrench};
use crate::recursive::belief::Rows;
use crate::recursive::extended_kalman::FilterModel;
use crate::recursive::joint_motion::{JointMotion, JointObservation, JointState, felt};
use nalgebra::{ComplexField, Matrix3, SMatrix, SVector, UnitQuaternion, Vector3, Vector6};

/// Motion 12, body 10, additive error of the wrench 6, relative error of each thruster 12; wander of attitude, position and velocity 9, bias of
/// the rate 3, bias and error of scale of the acceleration 6.
pub(super) const COORDINATES: usize = 58;
pub(super) const BODY: usize = 12;
pub(super) const DRIFT: usize = 22;
pub(super) const THRUST: usize = 28;
pub(super) const WANDER: usize = 40;
pub(super) const BIAS: usize = 49;
pub(super) const ACCELERATION_BIAS: usize = 52;
pub(super) const ACCELERATION_SCALE: usize = 55;
/// The first of the coordinates, that motion depends on.
pub(super) const MOVING: usize = WANDER;
/// Rows attitude, position, rate, velocity, acceleration.
pub(super) const ROWS: usize = 15;
/// And those of a quantity of the user's own.
pub(super) const ALL_ROWS: usize = 18;
/// Rows of motion that a planar flight knows nothing of: attitude x, y; position z; rate x, y; velocity z; and acceleration z.
const OUT_OF_PLANE: [usize; 6] = [0, 1, 5, 6, 7, 11];
const ACCELERATION_OUT_OF_PLANE: usize = 14;

/// Thrusters that give less than this share of what they are told are told no more for it, and those that give as much too much no less.
const LEAST_SHARE: f64 = 0.5;
/// What is asked of erring actuators is found to this power of their error: to two thousandths where it is a half.
const ASKED_ANEW: usize = 9;

pub(super) type Vector = SVector<f64, COORDINATES>;
pub(super) type Covariance = SMatrix<f64, COORDINATES, COORDINATES>;

/// Everything that is estimated.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct FlightState {
    pub(super) joint: JointState,
    /// Added to the believed wrench.
    pub(super) drift: Vector6<f64>,
    /// By this part of itself the thrust of each thruster is larger.
    pub(super) thrust: SVector<f64, THRUSTERS>,
    /// Slow errors of attitude (body axes), position and velocity (inertial axes).
    pub(super) wander: [Vector3<f64>; 3],
    /// What measured rates are larger by.
    pub(super) bias: Vector3<f64>,
    /// What measured accelerations are larger by, and the logarithm of their scale, in which it and the mass are linear together.
    pub(super) acceleration_bias: Vector3<f64>,
    pub(super) acceleration_scale: Vector3<f64>,
}

impl FlightState {
    /// Of motion and body, without slow errors.
    pub(super) fn of(joint: JointState) -> Self {
        Self {
            joint,
            drift: Vector6::zeros(),
            thrust: SVector::zeros(),
            wander: [Vector3::zeros(); 3],
            bias: Vector3::zeros(),
            acceleration_bias: Vector3::zeros(),
            acceleration_scale: Vector3::zeros(),
        }
    }

    pub(super) fn moved_by(&self, step: &Vector) -> Self {
        Self {
            joint: self.joint.oplus(&step.fixed_rows::<22>(0).into_owned()),
            drift: self.drift + step.fixed_rows::<6>(DRIFT),
            thrust: self.thrust + step.fixed_rows::<THRUSTERS>(THRUST),
            wander: core::array::from_fn(|k| self.wander[k] + step.fixed_rows::<3>(WANDER + 3 * k)),
            bias: self.bias + step.fixed_rows::<3>(BIAS),
            acceleration_bias: self.acceleration_bias + step.fixed_rows::<3>(ACCELERATION_BIAS),
            acceleration_scale: self.acceleration_scale + step.fixed_rows::<3>(ACCELERATION_SCALE),
        }
    }
}

/// Which quantities of a measurement are looked at.
#[allow(clippy::struct_excessive_bools)] // one for each quantity, all independent
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Fresh {
    pub(super) attitude: bool,
    pub(super) position: bool,
    pub(super) rate: bool,
    pub(super) velocity: bool,
    pub(super) acceleration: bool,
}

/// What filtered sensors show of the wrench: what the rate has not shown yet, over which time, and what the acceleration shows.
#[derive(Clone, Copy, Debug)]
pub(super) struct Shown {
    pub(super) owed: Option<(Held, f64)>,
    pub(super) acceleration: Option<Held>,
    /// How many samples of rate and acceleration one stands for.
    pub(super) samples: [f64; 2],
    /// The body about which all is linear, where that is not the estimated one.
    pub(super) about: Option<LogCholesky<f64>>,
}

/// Angular acceleration and acceleration of the origin under a wrench, and their derivatives by rate, body and wrench.
struct Acceleration {
    value: Vector6<f64>,
    by_rate: SMatrix<f64, 6, 3>,
    by_body: SMatrix<f64, 6, 10>,
    by_drift: SMatrix<f64, 6, 6>,
    by_thrust: SMatrix<f64, 6, THRUSTERS>,
}

impl Acceleration {
    /// The derivative of three sums of these by the coordinates.
    fn along(&self, sums: &SMatrix<f64, 3, 6>) -> SMatrix<f64, 3, COORDINATES> {
        let mut sensitivity = SMatrix::<f64, 3, COORDINATES>::zeros();
        sensitivity.fixed_view_mut::<3, 3>(0, 6).copy_from(&(sums * self.by_rate));
        sensitivity.fixed_view_mut::<3, 10>(0, BODY).copy_from(&(sums * self.by_body));
        sensitivity.fixed_view_mut::<3, 6>(0, DRIFT).copy_from(&(sums * self.by_drift));
        sensitivity.fixed_view_mut::<3, THRUSTERS>(0, THRUST).copy_from(&(sums * self.by_thrust));
        sensitivity
    }
}

/// Rows of one quantity, in body axes.
struct Quantity {
    first: usize,
    residual: Vector3<f64>,
    sensitivity: SMatrix<f64, 3, COORDINATES>,
    covariance: Matrix3<f64>,
    /// Body axes to those of the covariance.
    turn: Matrix3<f64>,
}

/// The one variance of a covariance that is alike in all directions.
fn isotropic(covariance: &Matrix3<f64>) -> Option<f64> {
    let variance = covariance.m11;
    (variance.is_finite() && *covariance == Matrix3::from_diagonal_element(variance)).then_some(variance)
}

/// W with W C Wᵀ = 1 over the components of finite variance, zero rows for the others; none where that is no covariance.
pub(super) fn whitening(covariance: &Matrix3<f64>) -> Option<Matrix3<f64>> {
    let known = |i: usize| covariance[(i, i)] < f64::INFINITY;
    let finite = Matrix3::from_fn(|i, j| match (known(i) && known(j), i == j) {
        (true, _) => covariance[(i, j)],
        (false, same) => f64::from(u8::from(same)),
    });
    if !finite.iter().copied().all(f64::is_finite) || (finite - finite.transpose()).amax() > 1e-9 * finite.amax() {
        return None;
    }
    let mut white = Matrix3::identity();
    if !finite.cholesky()?.l().solve_lower_triangular_mut(&mut white) {
        return None;
    }
    for i in 0..3 {
        if !known(i) {
            white.row_mut(i).fill(0.0);
        }
    }
    Some(white)
}

/// The model of the filter.
#[derive(Clone, Copy, Debug)]
pub(super) struct FlightMotion {
    joint: JointMotion,
    errors: WrenchErrors,
    shares: ThrustShares,
    slow: SlowErrors,
    planar: bool,
}

impl FlightMotion {
    pub(super) fn new(settings: &FlightEstimatorSettings) -> Self {
        let joint = JointMotion { noise: settings.noise, gravity_world: Vector3::zeros() };
        let shares = ThrustShares::new(&settings.wrench.thrusters);
        Self { joint, errors: settings.wrench, shares, slow: settings.slow, planar: settings.planar }
    }

    /// Slow errors of the wrench.
    pub(super) fn errors(&self) -> &WrenchErrors {
        &self.errors
    }

    /// Slow errors of the sensors.
    pub(super) fn slow(&self) -> &SlowErrors {
        &self.slow
    }

    /// The same with a wrench that is in doubt.
    pub(super) fn doubting(&self) -> Self {
        Self { errors: self.errors.doubted(), ..*self }
    }

    /// The wrench that is thought to act.
    pub(super) fn acting(&self, state: &FlightState, believed: &Held) -> Wrench<f64> {
        let believed = believed.wrench.to_vector();
        let mut acting = believed + self.shares.contributions(&believed) * state.thrust + state.drift;
        if self.planar {
            for i in [0, 1, 5] {
                acting[i] = 0.0;
            }
        }
        acting.into()
    }

    /// What has to be believed so that a wrench acts.
    pub(super) fn asked(&self, state: &FlightState, wanted: &Wrench<f64>) -> Wrench<f64> {
        let left = wanted.to_vector() - state.drift;
        let off = state.thrust.map(|off| off.clamp(LEAST_SHARE - 1.0, 1.0 - LEAST_SHARE));
        let mut asked = Vector6::zeros();
        for _ in 0..=ASKED_ANEW {
            asked = left - self.shares.contributions(&asked) * off;
            if self.planar {
                for i in [0, 1, 5] {
                    asked[i] = 0.0;
                }
            }
        }
        asked.into()
    }

    /// The body as the plane sees it: a body that stays in the plane of its own accord, of the same mass, centre of mass in
    /// the plane and inertia about its normal; and the derivative of its chart by that of the body.
    fn in_plane(body: &LogCholesky<f64>) -> (LogCholesky<f64>, SMatrix<f64, 10, 10>) {
        let mut flat = *body;
        let mut slopes = SMatrix::<f64, 10, 10>::identity();
        flat.center_of_mass.z = 0.0;
        slopes[(3, 3)] = 0.0;
        for (extent, shear) in [(0, 1), (1, 2)] {
            let (square, s) = (ComplexField::exp(2.0 * body.log_extents[extent]), body.shears[shear]);
            let whole = square + s * s;
            flat.log_extents[extent] = 0.5 * ComplexField::ln(whole);
            flat.shears[shear] = 0.0;
            slopes[(4 + extent, 4 + extent)] = square / whole;
            slopes[(4 + extent, 7 + shear)] = s / whole;
            slopes[(7 + shear, 7 + shear)] = 0.0;
        }
        (flat, slopes)
    }

    /// Moves the state on under a held wrench.
    pub(super) fn propagate(
        &self,
        state: &FlightState,
        believed: &Held,
        step_s: f64,
    ) -> Result<FlightState, IdentificationError> {
        let mut joint = state.joint;
        if self.planar {
            joint.body = Self::in_plane(&joint.body).0;
        }
        let observation = step_of(&self.acting(state, believed), &believed.stored, step_s);
        let mut motion = self.joint.propagate(&joint, &observation)?.motion;
        if self.planar {
            motion = back_into_plane(&motion, &state.joint.motion);
        }
        let joint = JointState { motion, body: state.joint.body };
        let (drift_left, _) = self.drift_step(step_s);
        let wander = self.slow.wander().map(|error| error.step(step_s).0);
        Ok(FlightState {
            joint,
            drift: state.drift * drift_left,
            wander: core::array::from_fn(|k| state.wander[k] * wander[k]),
            ..*state
        })
    }

    /// Standard deviations of slow errors of which nothing has been learned, zero elsewhere.
    pub(super) fn slow_deviation(&self) -> [f64; COORDINATES] {
        let (wrench, slow) = (&self.errors, &self.slow);
        let [attitude, position, velocity] = slow.wander().map(|error| error.sigma);
        let mut deviation = [0.0; COORDINATES];
        deviation[DRIFT..THRUST].copy_from_slice(wrench.drift.as_slice());
        for (deviation, thruster) in deviation[THRUST..WANDER].iter_mut().zip(&wrench.thrusters) {
            *deviation = thruster.relative;
        }
        let of_axes = [
            (WANDER, attitude),
            (WANDER + 3, position),
            (WANDER + 6, velocity),
            (BIAS, slow.rate_bias_rad_s),
            (ACCELERATION_BIAS, slow.acceleration_bias_m_s2),
            (ACCELERATION_SCALE, slow.doubted_scale),
        ];
        for (first, sigma) in of_axes {
            deviation[first..first + 3].fill(sigma);
        }
        deviation
    }

    /// What is left after a step of every coordinate that motion does not carry on, and the variance of what has come to each; wander of
    /// attitude, position and velocity that is `louder` than stated, in variance.
    pub(super) fn slow_step(&self, step_s: f64, louder: &[f64; 3]) -> ([f64; COORDINATES], [f64; COORDINATES]) {
        let (mut left, mut variance) = ([1.0; COORDINATES], [0.0; COORDINATES]);
        for i in 0..10 {
            let drift = self.joint.noise.drift[i];
            variance[BODY + i] = drift * drift * step_s;
        }
        let (decay, drives) = self.drift_step(step_s);
        for i in 0..6 {
            (left[DRIFT + i], variance[DRIFT + i]) = (decay, drives[i]);
        }
        for (k, error) in self.slow.wander().iter().enumerate() {
            let (decay, drive) = error.step(step_s);
            for i in WANDER + 3 * k..WANDER + 3 * k + 3 {
                (left[i], variance[i]) = (decay, drive * louder[k]);
            }
        }
        for (first, walk) in [(BIAS, self.slow.rate_bias_walk), (ACCELERATION_BIAS, self.slow.acceleration_bias_walk)] {
            variance[first..first + 3].fill(walk * walk * step_s);
        }
        (left, variance)
    }

    /// Moves state and covariance on under a held wrench; nothing is changed where that fails.
    ///
    /// With an `anchor` the motion is linear in the chart of the body about that body, wherever the estimate is: what a
    /// filter began with then does no harm to what it learns. Wander is `louder` than stated by these factors of its variance.
    pub(super) fn predict(
        &self,
        state: &mut FlightState,
        covariance: &mut Covariance,
        believed: &Held,
        step_s: f64,
        anchor: Option<&LogCholesky<f64>>,
        louder: &[f64; 3],
    ) -> Result<(), IdentificationError> {
        let body = state.joint.body;
        let mut about = *state;
        about.joint.body = *anchor.unwrap_or(&body);
        let mut next = self.propagate(&about, believed, step_s)?;
        let (by_state, by_wrench) = self.derivatives(&about, believed, step_s);
        if anchor.is_some() {
            let off = body.to_vector() - about.joint.body.to_vector();
            let moved = by_state.fixed_view::<BODY, 10>(0, BODY) * off;
            let motion = next.joint.motion.oplus(&moved);
            next.joint.motion = if self.planar { back_into_plane(&motion, &next.joint.motion) } else { motion };
            next.joint.body = body;
        }
        let p = &mut covariance.data.0;
        // Columns of Φ P: rows of motion here, the rest only decays. Slow errors of sensors move nothing.
        let m = &by_state.data.0;
        let mut moved = [[0.0; BODY]; COORDINATES];
        for (column, p) in moved.iter_mut().zip(p.iter()) {
            for (slope, value) in m.iter().zip(p) {
                add_scaled(column, *value, slope);
            }
        }
        let mut corner = [[0.0; BODY]; BODY];
        for (j, column) in corner.iter_mut().enumerate() {
            for (moved, slope) in moved.iter().zip(m) {
                add_scaled(column, slope[j], moved);
            }
        }
        let noise = self.wrench_noise(step_s);
        for (j, column) in corner.iter_mut().enumerate() {
            for (slope, variance) in by_wrench.data.0.iter().zip(noise.iter()) {
                add_scaled(column, slope[j] * variance, slope);
            }
        }
        let (left, variance) = self.slow_step(step_s, louder);
        for (j, moved) in moved.iter().enumerate() {
            if j < BODY {
                for i in 0..BODY {
                    p[j][i] = 0.5 * (corner[j][i] + corner[i][j]);
                }
            } else {
                for (i, value) in moved.iter().enumerate() {
                    p[j][i] = value * left[j];
                    p[i][j] = p[j][i];
                }
                for (value, left_too) in p[j].iter_mut().zip(&left).skip(BODY) {
                    *value *= left[j] * left_too;
                }
                p[j][j] += variance[j];
            }
        }
        *state = next;
        Ok(())
    }

    /// What is left of a drift after a step, and the variance of what has come to it.
    pub(super) fn drift_step(&self, step_s: f64) -> (f64, Vector6<f64>) {
        let decay = ComplexField::exp(-step_s / self.errors.drift_time_s);
        (decay, self.errors.drift.map(|drift| drift * drift * (1.0 - decay * decay)))
    }

    /// Variance of the white part of the wrench, held over a step.
    pub(super) fn wrench_noise(&self, step_s: f64) -> Vector6<f64> {
        let (torque, force) = (self.joint.noise.torque_n_m, self.joint.noise.force_n);
        let share = self.errors.period_s / step_s;
        let (torque, force) = (torque * torque * share, force * force * share);
        Vector6::new(torque, torque, torque, force, force, force)
    }

    /// Derivatives of the motion at the end of a step by the state before it and by a wrench held over it.
    pub(super) fn derivatives(
        &self,
        state: &FlightState,
        believed: &Held,
        step_s: f64,
    ) -> (SMatrix<f64, BODY, MOVING>, SMatrix<f64, BODY, 6>) {
        let mut joint = state.joint;
        let mut slopes = None;
        if self.planar {
            let (flat, slope) = Self::in_plane(&joint.body);
            joint.body = flat;
            slopes = Some(slope);
        }
        let observation = step_of(&self.acting(state, believed), &believed.stored, step_s);
        let (mut by_motion, mut by_body) = self.joint.transition(&joint, &observation);
        let mut by_wrench = by_wrench(&FreeFlyer::new(joint.body.to_parameters()), step_s);
        if let Some(slopes) = slopes {
            by_body *= slopes;
            for i in OUT_OF_PLANE {
                by_motion.row_mut(i).fill(0.0);
                by_motion.column_mut(i).fill(0.0);
                by_motion[(i, i)] = 1.0;
                by_body.row_mut(i).fill(0.0);
                by_wrench.row_mut(i).fill(0.0);
            }
            for i in [0, 1, 5] {
                by_wrench.column_mut(i).fill(0.0);
            }
        }
        let mut by_state = SMatrix::<f64, BODY, MOVING>::zeros();
        by_state.fixed_view_mut::<BODY, BODY>(0, 0).copy_from(&by_motion);
        by_state.fixed_view_mut::<BODY, 10>(0, BODY).copy_from(&by_body);
        by_state.fixed_view_mut::<BODY, 6>(0, DRIFT).copy_from(&by_wrench);
        let contributions = self.shares.contributions(&believed.wrench.to_vector());
        by_state.fixed_view_mut::<BODY, THRUSTERS>(0, THRUST).copy_from(&(by_wrench * contributions));
        (by_state, by_wrench)
    }

    /// The linearised rows of what is fresh in a measurement, each quantity whitened by its whole covariance.
    pub(super) fn rows<const R: usize>(
        &self,
        state: &FlightState,
        seen: &Measurement,
        fresh: Fresh,
        shown: &Shown,
    ) -> Rows<COORDINATES, R> {
        let motion = &state.joint.motion;
        let twist = &motion.twist_body;
        let body_from_world = motion.world_from_body.rotation.inverse();
        let world_from_body = motion.world_from_body.rotation.to_rotation_matrix().into_inner();
        let mut rows = Rows {
            sensitivity: SMatrix::zeros(),
            residual: SVector::zeros(),
            standard_deviation: SVector::repeat(f64::INFINITY),
        };
        let own = |first: usize, slow: usize, by_slow: &Matrix3<f64>| {
            let mut sensitivity = SMatrix::<f64, 3, COORDINATES>::zeros();
            sensitivity.fixed_view_mut::<3, 3>(0, first).fill_with_identity();
            sensitivity.fixed_view_mut::<3, 3>(0, slow).copy_from(by_slow);
            sensitivity
        };
        let [attitude_off, position_off, velocity_off] = &state.wander;
        if let Some(Gauss { value, covariance }) = seen.attitude.filter(|_| fresh.attitude) {
            let off: UnitQuaternion<f64> = LieGroup::exp(attitude_off);
            let residual = LieGroup::log(&(off.inverse() * (body_from_world * value)));
            let turn = Matrix3::identity();
            let by_off = <UnitQuaternion<f64> as LieGroup>::right_jacobian(attitude_off);
            let mut sensitivity = own(0, WANDER, &by_off);
            sensitivity.fixed_view_mut::<3, 3>(0, 0).copy_from(off.inverse().to_rotation_matrix().matrix());
            self.put(&mut rows, &Quantity { first: 0, residual, sensitivity, covariance, turn });
        }
        if let Some(Gauss { value, covariance }) = seen.position_world.filter(|_| fresh.position) {
            let residual = body_from_world * (value - position_off - motion.world_from_body.translation.vector);
            let sensitivity = own(3, WANDER + 3, &world_from_body.transpose());
            self.put(&mut rows, &Quantity { first: 3, residual, sensitivity, covariance, turn: world_from_body });
        }
        if let Some(Gauss { value, covariance }) = seen.rate_body.filter(|_| fresh.rate) {
            let (mut residual, turn) = (value - state.bias - twist.angular, Matrix3::identity());
            let mut sensitivity = own(6, BIAS, &turn);
            if let Some((held, delay_s)) = &shown.owed {
                // What a filter has not shown of the rate is what the wrench that it still owes changes it by.
                let owed = self.acceleration(state, held, shown.about.as_ref());
                residual += owed.value.fixed_rows::<3>(0) * *delay_s;
                let by = owed.along(&SMatrix::<f64, 3, 6>::identity());
                sensitivity -= by * *delay_s;
            }
            let covariance = covariance / shown.samples[0];
            self.put(&mut rows, &Quantity { first: 6, residual, sensitivity, covariance, turn });
        }
        if let Some(Gauss { value, covariance }) = seen.velocity_world.filter(|_| fresh.velocity) {
            let residual = body_from_world * (value - velocity_off) - twist.linear;
            let mut sensitivity = own(9, WANDER + 6, &world_from_body.transpose());
            sensitivity.fixed_view_mut::<3, 3>(0, 0).copy_from(&-crate::lie::skew(&twist.linear));
            self.put(&mut rows, &Quantity { first: 9, residual, sensitivity, covariance, turn: world_from_body });
        }
        if let (Some(Gauss { value, covariance }), Some(held)) =
            (seen.acceleration_body.filter(|_| fresh.acceleration), &shown.acceleration)
        {
            // At the unit's place; what turning makes of that place its publisher has taken out.
            let found = self.acceleration(state, held, shown.about.as_ref());
            let mut at_unit = SMatrix::<f64, 3, 6>::zeros();
            at_unit.fixed_view_mut::<3, 3>(0, 0).copy_from(&-crate::lie::skew(&self.slow.lever_arm_body_m));
            at_unit.fixed_view_mut::<3, 3>(0, 3).fill_with_identity();
            // Gravity was added by an attitude that was measured, off by its errors.
            let gravity = self.slow.gravity_added_world_m_s2;
            let added = seen.attitude.map_or_else(Vector3::zeros, |seen| seen.value.inverse() * gravity);
            let acts = body_from_world * gravity;
            let expected = at_unit * found.value + (added - acts);
            let gain = state.acceleration_scale.map(ComplexField::exp);
            let mut sensitivity = found.along(&at_unit);
            sensitivity.fixed_view_mut::<3, 3>(0, 0).copy_from(&-crate::lie::skew(&acts));
            for (i, mut row) in sensitivity.row_iter_mut().enumerate() {
                row *= gain[i];
            }
            for i in 0..3 {
                sensitivity[(i, ACCELERATION_BIAS + i)] = 1.0;
                sensitivity[(i, ACCELERATION_SCALE + i)] = gain[i] * expected[i];
            }
            let residual = value - state.acceleration_bias - gain.component_mul(&expected);
            let (covariance, turn) = (covariance / shown.samples[1], Matrix3::identity());
            self.put(&mut rows, &Quantity { first: 12, residual, sensitivity, covariance, turn });
        }
        if let Some((sensor, Gauss { value, covariance })) = seen.other.as_ref().filter(|_| R == ALL_ROWS) {
            let residual = sensor.residual(value, motion);
            let mut sensitivity = SMatrix::<f64, 3, COORDINATES>::zeros();
            sensitivity.fixed_columns_mut::<BODY>(0).copy_from(&sensor.sensitivity(motion));
            let (covariance, turn) = (*covariance, Matrix3::identity());
            self.put(&mut rows, &Quantity { first: ROWS, residual, sensitivity, covariance, turn });
        }
        rows
    }

    /// Accelerations under what is believed to act, linear in the body about another one where there is one.
    fn acceleration(&self, state: &FlightState, believed: &Held, about: Option<&LogCholesky<f64>>) -> Acceleration {
        let mut joint = state.joint;
        joint.body = *about.unwrap_or(&state.joint.body);
        let off = state.joint.body.to_vector() - joint.body.to_vector();
        let mut slopes = None;
        if self.planar {
            let (flat, slope) = Self::in_plane(&joint.body);
            joint.body = flat;
            slopes = Some(slope);
        }
        // With the origin at rest the rate of its velocity is its acceleration.
        joint.motion.twist_body.linear = Vector3::zeros();
        let acting = self.acting(state, believed);
        let felt = felt(&acting, &believed.stored, &joint.motion.twist_body.angular);
        let flyer = FreeFlyer::new(joint.body.to_parameters());
        let forward = flyer.forward(&joint.motion.twist_body, &felt);
        let found = self.joint.derivatives(&joint, &felt, &believed.stored);
        let mut by_wrench = by_wrench(&flyer, 1.0).fixed_rows::<6>(6).into_owned();
        let mut by_body = found.body;
        if let Some(slopes) = slopes {
            by_body *= slopes;
            for i in [0, 1, 5] {
                by_wrench.column_mut(i).fill(0.0);
            }
        }
        let contributions = self.shares.contributions(&believed.wrench.to_vector());
        let (angular, linear) = (forward.angular_acceleration_body, forward.acceleration_origin_body);
        Acceleration {
            value: Twist::new(angular, linear).to_vector() + by_body * off,
            by_rate: found.twist.fixed_columns::<3>(0).into_owned(),
            by_body,
            by_drift: by_wrench,
            by_thrust: by_wrench * contributions,
        }
    }

    fn put<const R: usize>(&self, rows: &mut Rows<COORDINATES, R>, quantity: &Quantity) {
        let &Quantity { first, mut residual, mut sensitivity, mut covariance, turn } = quantity;
        let out_of_plane = |i: usize| self.planar && first + i < ROWS && is_out_of_plane(first + i);
        let mut deviation = Vector3::repeat(1.0);
        if let Some(variance) = isotropic(&covariance) {
            deviation.fill(ComplexField::sqrt(variance));
        } else {
            // What is in the plane is not to be mixed with what is not.
            for i in 0..3 {
                for j in 0..3 {
                    if out_of_plane(i) != out_of_plane(j) {
                        covariance[(i, j)] = 0.0;
                    }
                }
            }
            // What is no covariance was refused on arrival.
            let white = whitening(&covariance).unwrap_or_else(Matrix3::zeros);
            residual = white * (turn * residual);
            sensitivity = white * (turn * sensitivity);
            for i in 0..3 {
                if white[(i, i)] == 0.0 {
                    deviation[i] = f64::INFINITY;
                }
            }
        }
        for i in 0..3 {
            rows.standard_deviation[first + i] = if out_of_plane(i) { f64::INFINITY } else { deviation[i] };
        }
        rows.residual.fixed_rows_mut::<3>(first).copy_from(&residual);
        rows.sensitivity.fixed_rows_mut::<3>(first).copy_from(&sensitivity);
    }

    /// Variance of the motion's coordinates at the start.
    pub(super) fn motion_variance(&self, deviation: &[f64; 4]) -> SVector<f64, BODY> {
        let mut variance = SVector::<f64, BODY>::from_fn(|i, _| deviation[i / 3] * deviation[i / 3]);
        if self.planar {
            for i in OUT_OF_PLANE {
                variance[i] = 0.0;
            }
        }
        variance
    }

    /// Motion and its covariance from a measurement, without memory: what was not measured of rate and velocity is as uncertain as at
    /// the start, a place or an attitude that was not measured is what it was, so much less certain.
    pub(super) fn begun_at(
        &self,
        before: &RigidBodyState<f64>,
        covariance: &SMatrix<f64, BODY, BODY>,
        seen: &Measurement,
        start_deviation: &[f64; 4],
    ) -> (RigidBodyState<f64>, SMatrix<f64, BODY, BODY>) {
        let mut motion = *before;
        let mut known = SMatrix::<f64, BODY, BODY>::from_diagonal(&self.motion_variance(start_deviation));
        if let Some(attitude) = &seen.attitude {
            motion.world_from_body.rotation = attitude.value;
        }
        let turn = motion.world_from_body.rotation.to_rotation_matrix().into_inner();
        let measured = [
            seen.attitude.map(|seen| (seen.covariance, false)),
            seen.position_world.map(|seen| (seen.covariance, true)),
            seen.rate_body.map(|seen| (seen.covariance, false)),
            seen.velocity_world.map(|seen| (seen.covariance, true)),
        ];
        for (k, measured) in measured.iter().enumerate() {
            let mut block = known.fixed_view_mut::<3, 3>(3 * k, 3 * k);
            match measured {
                Some((seen, _)) if isotropic(seen).is_some() => block.copy_from(seen),
                Some((seen, in_world)) => {
                    let start = start_deviation[k] * start_deviation[k];
                    let usable = Matrix3::from_fn(|i, j| {
                        let known = seen[(i, i)].is_finite() && seen[(j, j)].is_finite();
                        if known { seen[(i, j)] } else { start * f64::from(u8::from(i == j)) }
                    });
                    block.copy_from(&if *in_world { turn.transpose() * usable * turn } else { usable });
                }
                None if k < 2 => block += covariance.fixed_view::<3, 3>(3 * k, 3 * k),
                None => {}
            }
        }
        if let Some(position) = &seen.position_world {
            motion.world_from_body.translation = position.value.into();
        }
        if let Some(rate) = &seen.rate_body {
            motion.twist_body.angular = rate.value;
        }
        if let Some(velocity) = &seen.velocity_world {
            motion.twist_body.linear = motion.world_from_body.rotation.inverse() * velocity.value;
        }
        if self.planar {
            motion = back_into_plane(&motion, before);
            for i in OUT_OF_PLANE {
                known.row_mut(i).fill(0.0);
                known.column_mut(i).fill(0.0);
            }
        }
        (motion, known)
    }
}

/// Whether a row of the library's own quantities is out of the plane.
fn is_out_of_plane(row: usize) -> bool {
    OUT_OF_PLANE.contains(&row) || row == ACCELERATION_OUT_OF_PLANE
}

/// column += factor · slope.
#[inline(always)]
fn add_scaled<const N: usize>(column: &mut [f64; N], factor: f64, slope: &[f64; N]) {
    for (c, s) in column.iter_mut().zip(slope) {
        *c += factor * s;
    }
}

fn step_of(wrench: &Wrench<f64>, stored: &Vector3<f64>, step_s: f64) -> JointObservation {
    JointObservation {
        step_s,
        wrench_body: *wrench,
        stored_body: *stored,
        world_from_body: None,
        rate_body: None,
        velocity_origin_world: None,
        acceleration_origin_body: None,
    }
}

/// Change of the motion at the end of a step by a wrench held over it.
fn by_wrench(flyer: &FreeFlyer<f64>, step_s: f64) -> SMatrix<f64, BODY, 6> {
    let mut slopes = SMatrix::<f64, BODY, 6>::zeros();
    for j in 0..6 {
        let change = flyer.forward(&Twist::zero(), &Wrench::from(Vector6::ith(j, step_s)));
        let change = Twist::new(change.angular_acceleration_body, change.acceleration_origin_body).to_vector();
        slopes.fixed_view_mut::<6, 1>(0, j).copy_from(&(change * (0.5 * step_s)));
        slopes.fixed_view_mut::<6, 1>(6, j).copy_from(&change);
    }
    slopes
}

/// A motion with what is out of the plane as it was before: rounding, or a measurement, moved it.
pub(super) fn back_into_plane(motion: &RigidBodyState<f64>, before: &RigidBodyState<f64>) -> RigidBodyState<f64> {
    let mut flat = *motion;
    flat.world_from_body.translation.z = before.world_from_body.translation.z;
    let turn = before.world_from_body.rotation.inverse() * motion.world_from_body.rotation;
    let about_z = LieGroup::log(&turn).z;
    flat.world_from_body.rotation =
        before.world_from_body.rotation * <UnitQuaternion<f64> as LieGroup>::exp(&Vector3::new(0.0, 0.0, about_z));
    flat.twist_body.angular = Vector3::new(0.0, 0.0, motion.twist_body.angular.z);
    flat.twist_body.linear.z = 0.0;
    flat
}
