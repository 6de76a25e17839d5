//! The filter of the motion given a body, and how its innovations depend on that body.

use super::filtered::steps;
use super::flight_motion::{ALL_ROWS, BODY, DRIFT, FlightMotion, FlightState, Fresh, MOVING, SCALE, Shown};
use super::wrench_history::WrenchHistory;
use crate::SquareRootInformation;
use crate::dynamics::{LogCholesky, RigidBodyState};
use crate::error::IdentificationError;
use crate::estimator::Measurement;
use crate::lie::Manifold;
use crate::recursive::belief::Rows;
use crate::recursive::joint_motion::JointState;
use nalgebra::{ComplexField, SMatrix, SVector};

/// Motion 12, drift of the wrench 6, relative error of the wrench 6.
const STATE: usize = 24;
/// Columns of drift and relative error in it.
const STATE_DRIFT: usize = BODY;
const STATE_SCALE: usize = BODY + 6;
/// Standard deviation of every coordinate of a motion of which nothing is known: rad, m, rad/s and m/s.
const UNKNOWN: [f64; 4] = [1.0; 4];

/// A measurement to learn from, and the motion at it, about which everything is linear.
#[derive(Clone, Debug)]
pub(super) struct Lesson {
    pub(super) measurement: Measurement,
    pub(super) motion: RigidBodyState<f64>,
    /// Whether the map was another one before.
    pub(super) breaks: bool,
}

/// A Kalman filter of motion and wrench errors that takes the body for known, and the derivative of its estimate by that body.
///
/// Its innovations are `sensitivity · (truth − body) + noise`, and that noise is white: it is the innovation of the filter that had the
/// right body. So they are independent rows of the body's coordinates, with the covariance that the filter states. Noise of the sensors
/// is in what is compared and not in the regressor; a drift that lasts longer than any window is in the filter's state, and what one
/// measurement told of it is not told again by the next.
///
/// All is linear about the motion of the lessons, which is near the truth whatever the body is, so that the body may be far off.
///
/// # Source
/// B. Friedland, Treatment of bias in recursive filtering, IEEE Transactions on Automatic Control 14(4), 1969.
#[derive(Clone, Debug)]
pub(super) struct MotionGivenBody {
    about: LogCholesky<f64>,
    now_ns: i64,
    reference: RigidBodyState<f64>,
    /// Of truth from reference, as estimated under the body `about`.
    off: SVector<f64, STATE>,
    covariance: SMatrix<f64, STATE, STATE>,
    /// Of `off` by the coordinates of the body: what the estimate would have been under another one, to first order.
    slopes: SMatrix<f64, STATE, 10>,
}

impl MotionGivenBody {
    /// With a motion of which nothing is known, at a lesson.
    pub(super) fn new(model: &FlightMotion, about: &LogCholesky<f64>, lesson: &Lesson) -> Self {
        let errors = model.errors();
        let mut covariance = SMatrix::zeros();
        for i in 0..6 {
            covariance[(STATE_DRIFT + i, STATE_DRIFT + i)] = errors.drift[i] * errors.drift[i];
            covariance[(STATE_SCALE + i, STATE_SCALE + i)] = errors.scale[i] * errors.scale[i];
        }
        let mut begun = Self {
            about: *about,
            now_ns: lesson.measurement.stamp_ns,
            reference: lesson.motion,
            off: SVector::zeros(),
            covariance,
            slopes: SMatrix::zeros(),
        };
        begun.forget_motion(model, lesson);
        begun
    }

    pub(super) fn now_ns(&self) -> i64 {
        self.now_ns
    }

    /// A motion of which nothing is known; what is known of the wrench stays.
    fn forget_motion(&mut self, model: &FlightMotion, lesson: &Lesson) {
        (self.now_ns, self.reference) = (lesson.measurement.stamp_ns, lesson.motion);
        self.off.fixed_rows_mut::<BODY>(0).fill(0.0);
        self.slopes.fixed_rows_mut::<BODY>(0).fill(0.0);
        self.covariance.fixed_rows_mut::<BODY>(0).fill(0.0);
        self.covariance.fixed_columns_mut::<BODY>(0).fill(0.0);
        let unknown = SMatrix::<f64, BODY, BODY>::from_diagonal(&model.motion_variance(&UNKNOWN));
        self.covariance.fixed_view_mut::<BODY, BODY>(0, 0).copy_from(&unknown);
    }

    /// The wrench may be off by more from now on.
    pub(super) fn widen_drift(&mut self, doubting: &FlightMotion) {
        let errors = doubting.errors();
        for i in 0..6 {
            self.covariance[(STATE_DRIFT + i, STATE_DRIFT + i)] += errors.drift[i] * errors.drift[i];
        }
    }

    /// Takes a lesson and adds its innovations to the rows of `about + step`, unknown `step`.
    pub(super) fn take(
        &mut self,
        model: &FlightMotion,
        history: &WrenchHistory,
        lesson: &Lesson,
        said: &mut SquareRootInformation<10>,
    ) -> Result<(), IdentificationError> {
        if lesson.breaks {
            self.forget_motion(model, lesson);
        } else {
            self.advance(model, history, lesson)?;
        }
        self.measure(model, lesson, said)
    }

    fn advance(
        &mut self,
        model: &FlightMotion,
        history: &WrenchHistory,
        lesson: &Lesson,
    ) -> Result<(), IdentificationError> {
        let joint = JointState { motion: self.reference, body: self.about };
        let mut state = FlightState::of(joint);
        for (from_ns, to_ns) in steps(self.now_ns, lesson.measurement.stamp_ns) {
            let (held, step_s) = (history.mean(from_ns, to_ns), (to_ns - from_ns) as f64 * 1e-9);
            let (by_state, by_wrench) = model.derivatives(&state, &held, step_s);
            state = model.propagate(&state, &held, step_s)?;
            self.predict(model, &by_state, &by_wrench, step_s);
        }
        // Of the same truth from the next reference.
        let apart = state.joint.motion.ominus(&lesson.motion);
        let mut off = self.off.fixed_rows_mut::<BODY>(0);
        off += apart;
        (self.now_ns, self.reference) = (lesson.measurement.stamp_ns, lesson.motion);
        Ok(())
    }

    fn predict(
        &mut self,
        model: &FlightMotion,
        by_state: &SMatrix<f64, BODY, MOVING>,
        by_wrench: &SMatrix<f64, BODY, 6>,
        step_s: f64,
    ) {
        let mut transition = SMatrix::<f64, BODY, STATE>::zeros();
        transition.fixed_columns_mut::<BODY>(0).copy_from(&by_state.fixed_columns::<BODY>(0));
        transition.fixed_columns_mut::<6>(STATE_DRIFT).copy_from(&by_state.fixed_columns::<6>(DRIFT));
        transition.fixed_columns_mut::<6>(STATE_SCALE).copy_from(&by_state.fixed_columns::<6>(SCALE));
        let (decay, drives) = model.drift_step(step_s);
        let motion = transition * self.off;
        self.off.fixed_rows_mut::<BODY>(0).copy_from(&motion);
        self.off.fixed_rows_mut::<6>(STATE_DRIFT).scale_mut(decay);
        let motion = transition * self.slopes + by_state.fixed_columns::<10>(BODY);
        self.slopes.fixed_rows_mut::<BODY>(0).copy_from(&motion);
        self.slopes.fixed_rows_mut::<6>(STATE_DRIFT).scale_mut(decay);
        let moved = transition * self.covariance;
        let noise = SMatrix::<f64, 6, 6>::from_diagonal(&model.wrench_noise(step_s));
        let corner = moved * transition.transpose() + by_wrench * noise * by_wrench.transpose();
        let p = &mut self.covariance;
        p.fixed_view_mut::<BODY, STATE>(0, 0).copy_from(&moved);
        p.fixed_view_mut::<BODY, BODY>(0, 0).copy_from(&((corner + corner.transpose()) * 0.5));
        p.fixed_rows_mut::<6>(STATE_DRIFT).scale_mut(decay);
        p.fixed_columns_mut::<6>(STATE_DRIFT).scale_mut(decay);
        for i in 0..6 {
            p[(STATE_DRIFT + i, STATE_DRIFT + i)] += drives[i];
        }
        let rest = p.fixed_view::<BODY, { STATE - BODY }>(0, BODY).transpose();
        p.fixed_view_mut::<{ STATE - BODY }, BODY>(BODY, 0).copy_from(&rest);
    }

    /// One row after the other, so that each innovation is a number.
    fn measure(
        &mut self,
        model: &FlightMotion,
        lesson: &Lesson,
        said: &mut SquareRootInformation<10>,
    ) -> Result<(), IdentificationError> {
        let joint = JointState { motion: lesson.motion, body: self.about };
        let state = FlightState::of(joint);
        let fresh = Fresh { attitude: true, position: true, rate: true, velocity: true, acceleration: false };
        let Rows { sensitivity, residual, standard_deviation } = model.rows::<ALL_ROWS>(
            &state,
            &lesson.measurement,
            fresh,
            &Shown { owed: None, acceleration: None, samples: [1.0; 2] },
        );
        let mut block = SMatrix::<f64, ALL_ROWS, 10>::zeros();
        let mut rhs = SVector::<f64, ALL_ROWS>::zeros();
        for i in (0..ALL_ROWS).filter(|i| standard_deviation[*i].is_finite()) {
            let row = sensitivity.fixed_view::<1, BODY>(i, 0).into_owned();
            let shared = self.covariance.fixed_columns::<BODY>(0) * row.transpose();
            let variance = (row * shared.fixed_rows::<BODY>(0)).x + standard_deviation[i] * standard_deviation[i];
            let innovation = residual[i] - (row * self.off.fixed_rows::<BODY>(0)).x;
            let by_body = row * self.slopes.fixed_rows::<BODY>(0);
            let gain = shared / variance;
            self.off += gain * innovation;
            self.slopes -= gain * by_body;
            self.covariance -= gain * shared.transpose();
            let weight = 1.0 / ComplexField::sqrt(variance);
            block.set_row(i, &(by_body * weight));
            rhs[i] = innovation * weight;
        }
        said.update(&block, &rhs)
    }
}
