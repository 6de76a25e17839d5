//! Motion, body, and slow errors of the wrench as one state of 34 numbers.

use super::settings::{FlightEstimatorSettings, WrenchErrors};
use crate::dynamics::{FreeFlyer, LogCholesky, RigidBodyState};
use crate::error::IdentificationError;
use crate::lie::{LieGroup, Manifold, Twist, Wrench};
use crate::recursive::belief::Rows;
use crate::recursive::extended_kalman::FilterModel;
use crate::recursive::joint_motion::{JointMotion, JointObservation, JointState};
use nalgebra::{ComplexField, SMatrix, SVector, UnitQuaternion, Vector3, Vector6};

/// Motion 12, body 10, additive error of the wrench 6, relative error of the wrench 6.
pub(super) const COORDINATES: usize = 34;
pub(super) const BODY: usize = 12;
pub(super) const DRIFT: usize = 22;
pub(super) const SCALE: usize = 28;
/// Rows attitude, position, rate, velocity.
pub(super) const ROWS: usize = 12;
/// Rows of motion that a planar flight knows nothing of: attitude x, y; position z; rate x, y; velocity z.
const OUT_OF_PLANE: [usize; 6] = [0, 1, 5, 6, 7, 11];

/// Actuators that give less than this share of what they are told are told no more for it.
const LEAST_SHARE: f64 = 0.5;

pub(super) type Vector = SVector<f64, COORDINATES>;
pub(super) type Covariance = SMatrix<f64, COORDINATES, COORDINATES>;

/// Everything that is estimated.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct FlightState {
    pub(super) joint: JointState,
    /// Added to the believed wrench.
    pub(super) drift: Vector6<f64>,
    /// By this part of itself each component of the believed wrench is larger.
    pub(super) scale: Vector6<f64>,
}

impl FlightState {
    pub(super) fn moved_by(&self, step: &Vector) -> Self {
        Self {
            joint: self.joint.oplus(&step.fixed_rows::<22>(0).into_owned()),
            drift: self.drift + step.fixed_rows::<6>(DRIFT),
            scale: self.scale + step.fixed_rows::<6>(SCALE),
        }
    }
}

/// The model of the filter.
#[derive(Clone, Copy, Debug)]
pub(super) struct FlightMotion {
    joint: JointMotion,
    errors: WrenchErrors,
    planar: bool,
}

impl FlightMotion {
    pub(super) fn new(settings: &FlightEstimatorSettings) -> Self {
        let joint = JointMotion { noise: settings.noise, gravity_world: Vector3::zeros() };
        Self { joint, errors: settings.wrench, planar: settings.planar }
    }

    /// The same with a wrench that is in doubt.
    pub(super) fn doubting(&self) -> Self {
        Self { errors: self.errors.doubted(), ..*self }
    }

    /// The wrench that is thought to act.
    fn acting(&self, state: &FlightState, believed: &Wrench<f64>) -> Wrench<f64> {
        let believed = believed.to_vector();
        let mut acting = believed + believed.component_mul(&state.scale) + state.drift;
        if self.planar {
            for i in [0, 1, 5] {
                acting[i] = 0.0;
            }
        }
        acting.into()
    }

    /// What has to be believed so that a wrench acts.
    pub(super) fn asked(&self, state: &FlightState, wanted: &Wrench<f64>) -> Wrench<f64> {
        let mut asked = wanted.to_vector() - state.drift;
        for i in 0..6 {
            asked[i] /= f64::max(1.0 + state.scale[i], LEAST_SHARE);
            if self.planar && [0, 1, 5].contains(&i) {
                asked[i] = 0.0;
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
        believed: &Wrench<f64>,
        step_s: f64,
    ) -> Result<FlightState, IdentificationError> {
        let mut joint = state.joint;
        if self.planar {
            joint.body = Self::in_plane(&joint.body).0;
        }
        let observation = step_of(&self.acting(state, believed), step_s);
        let mut motion = self.joint.propagate(&joint, &observation)?.motion;
        if self.planar {
            motion = back_into_plane(&motion, &state.joint.motion);
        }
        let joint = JointState { motion, body: state.joint.body };
        Ok(FlightState { joint, drift: state.drift * self.remaining(step_s), scale: state.scale })
    }

    /// What is left of a drift after a step.
    fn remaining(&self, step_s: f64) -> f64 {
        ComplexField::exp(-step_s / self.errors.drift_time_s)
    }

    /// Moves state and covariance on under a held wrench; nothing is changed where that fails.
    ///
    /// With an `anchor` the motion is linear in the chart of the body about that body, wherever the estimate is: what a
    /// filter began with then does no harm to what it learns.
    pub(super) fn predict(
        &self,
        state: &mut FlightState,
        covariance: &mut Covariance,
        believed: &Wrench<f64>,
        step_s: f64,
        anchor: Option<&LogCholesky<f64>>,
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
        // Columns of Φ P: rows of motion here, the rest only decays.
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
        let decay = self.remaining(step_s);
        let factor = |i: usize| if (DRIFT..SCALE).contains(&i) { decay } else { 1.0 };
        for (j, moved) in moved.iter().enumerate() {
            if j < BODY {
                for i in 0..BODY {
                    p[j][i] = 0.5 * (corner[j][i] + corner[i][j]);
                }
            } else {
                for (i, value) in moved.iter().enumerate() {
                    p[j][i] = value * factor(j);
                    p[i][j] = p[j][i];
                }
                let column = factor(j);
                for (i, value) in p[j].iter_mut().enumerate().skip(BODY) {
                    *value *= column * factor(i);
                }
            }
        }
        for i in 0..10 {
            let drift = self.joint.noise.drift[i];
            p[BODY + i][BODY + i] += drift * drift * step_s;
        }
        for i in 0..6 {
            let drift = self.errors.drift[i];
            p[DRIFT + i][DRIFT + i] += drift * drift * (1.0 - decay * decay);
        }
        *state = next;
        Ok(())
    }

    /// Variance of the white part of the wrench, held over a step.
    fn wrench_noise(&self, step_s: f64) -> Vector6<f64> {
        let (torque, force) = (self.joint.noise.torque_n_m, self.joint.noise.force_n);
        let share = self.errors.period_s / step_s;
        let (torque, force) = (torque * torque * share, force * force * share);
        Vector6::new(torque, torque, torque, force, force, force)
    }

    /// Derivatives of the motion at the end of a step by the state before it and by a wrench held over it.
    fn derivatives(
        &self,
        state: &FlightState,
        believed: &Wrench<f64>,
        step_s: f64,
    ) -> (SMatrix<f64, BODY, COORDINATES>, SMatrix<f64, BODY, 6>) {
        let mut joint = state.joint;
        let mut slopes = None;
        if self.planar {
            let (flat, slope) = Self::in_plane(&joint.body);
            joint.body = flat;
            slopes = Some(slope);
        }
        let observation = step_of(&self.acting(state, believed), step_s);
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
        let mut by_state = SMatrix::<f64, BODY, COORDINATES>::zeros();
        by_state.fixed_view_mut::<BODY, BODY>(0, 0).copy_from(&by_motion);
        by_state.fixed_view_mut::<BODY, 10>(0, BODY).copy_from(&by_body);
        by_state.fixed_view_mut::<BODY, 6>(0, DRIFT).copy_from(&by_wrench);
        let believed = believed.to_vector();
        for j in 0..6 {
            by_state.fixed_view_mut::<BODY, 1>(0, SCALE + j).copy_from(&(by_wrench.column(j) * believed[j]));
        }
        (by_state, by_wrench)
    }

    /// The linearised rows of a measurement.
    pub(super) fn rows(&self, state: &FlightState, seen: &JointObservation) -> Rows<COORDINATES, ROWS> {
        let residual = self.joint.residual(&state.joint, seen).fixed_rows::<ROWS>(0).into_owned();
        let mut standard_deviation = self.joint.standard_deviation(seen).fixed_rows::<ROWS>(0).into_owned();
        if self.planar {
            for i in OUT_OF_PLANE {
                standard_deviation[i] = f64::INFINITY;
            }
        }
        let mut sensitivity = SMatrix::<f64, ROWS, COORDINATES>::zeros();
        sensitivity.fixed_view_mut::<ROWS, ROWS>(0, 0).fill_with_identity();
        let twist = &state.joint.motion.twist_body;
        sensitivity.fixed_view_mut::<3, 3>(9, 0).copy_from(&-crate::lie::skew(&twist.linear));
        Rows { sensitivity, residual, standard_deviation }
    }

    /// Variance of the motion's coordinates at the start, or where a measurement of this deviation was all there is.
    pub(super) fn motion_variance(&self, deviation: &[f64; 4]) -> SVector<f64, BODY> {
        let mut variance = SVector::<f64, BODY>::from_fn(|i, _| deviation[i / 3] * deviation[i / 3]);
        if self.planar {
            for i in OUT_OF_PLANE {
                variance[i] = 0.0;
            }
        }
        variance
    }
}

/// column += factor · slope.
#[inline(always)]
fn add_scaled<const N: usize>(column: &mut [f64; N], factor: f64, slope: &[f64; N]) {
    for (c, s) in column.iter_mut().zip(slope) {
        *c += factor * s;
    }
}

fn step_of(wrench: &Wrench<f64>, step_s: f64) -> JointObservation {
    JointObservation {
        step_s,
        wrench_body: *wrench,
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
