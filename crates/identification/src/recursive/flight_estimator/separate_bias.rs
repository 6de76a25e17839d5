//! The filter of the motion given a body, and how its innovations depend on that body.

use super::filtered::{Heard, steps};
use super::flight_motion::{
    ACCELERATION_BIAS, ALL_ROWS, BODY, COORDINATES, DRIFT, FlightMotion, FlightState, Fresh, MOVING, Shown, WANDER,
};
use super::wrench_history::WrenchHistory;
use crate::SquareRootInformation;
use crate::dynamics::{LogCholesky, RigidBodyState};
use crate::error::IdentificationError;
use crate::estimator::Measurement;
use crate::lie::Manifold;
use crate::recursive::belief::Rows;
use crate::recursive::joint_motion::JointState;
use nalgebra::{ComplexField, SMatrix, SVector};

/// All coordinates but those of the body, which is known, and of the acceleration, which is not looked at: motion 12, drift of the
/// wrench 6, thrusters 12, wander 9, bias of the rate 3.
const STATE: usize = BODY + SLOW;
/// Those from the drift on.
const SLOW: usize = ACCELERATION_BIAS - DRIFT;
/// Of these the first move the motion.
const PUSHING: usize = WANDER - DRIFT;
const WANDERING: usize = BODY + PUSHING;
/// Standard deviation of every coordinate of a motion of which nothing is known: rad, m, rad/s and m/s.
const UNKNOWN: [f64; 4] = [1.0; 4];

/// A measurement to learn from, and the motion at it, about which everything is linear.
#[derive(Clone, Debug)]
pub(super) struct Lesson {
    pub(super) measurement: Measurement,
    pub(super) motion: RigidBodyState<f64>,
    pub(super) heard: Heard,
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
        let mut covariance = SMatrix::zeros();
        for (i, deviation) in model.slow_deviation().iter().enumerate().take(ACCELERATION_BIAS).skip(DRIFT) {
            let at = i - DRIFT + BODY;
            covariance[(at, at)] = deviation * deviation;
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

    /// A motion of which nothing is known, and a map that wanders anew; what is known of the wrench stays.
    fn forget_motion(&mut self, model: &FlightMotion, lesson: &Lesson) {
        (self.now_ns, self.reference) = (lesson.measurement.stamp_ns, lesson.motion);
        let motion = model.motion_variance(&UNKNOWN);
        let slow = model.slow_deviation();
        for at in (0..BODY).chain(WANDERING..WANDERING + 9) {
            self.off[at] = 0.0;
            self.slopes.row_mut(at).fill(0.0);
            self.covariance.row_mut(at).fill(0.0);
            self.covariance.column_mut(at).fill(0.0);
            self.covariance[(at, at)] =
                if at < BODY { motion[at] } else { slow[at - BODY + DRIFT] * slow[at - BODY + DRIFT] };
        }
    }

    /// The wrench may be off by more from now on.
    pub(super) fn widen_drift(&mut self, doubting: &FlightMotion) {
        let errors = doubting.errors();
        for i in 0..6 {
            self.covariance[(BODY + i, BODY + i)] += errors.drift[i] * errors.drift[i];
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
        self.measure(model, history, lesson, said)
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
            self.predict(model, &by_state, &by_wrench, step_s, &lesson.heard.louder);
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
        louder: &[f64; 3],
    ) {
        let mut transition = SMatrix::<f64, BODY, STATE>::zeros();
        transition.fixed_columns_mut::<BODY>(0).copy_from(&by_state.fixed_columns::<BODY>(0));
        transition.fixed_columns_mut::<PUSHING>(BODY).copy_from(&by_state.fixed_columns::<PUSHING>(DRIFT));
        let (left, drives) = model.slow_step(step_s, louder);
        let motion = transition * self.off;
        self.off.fixed_rows_mut::<BODY>(0).copy_from(&motion);
        let motion = transition * self.slopes + by_state.fixed_columns::<10>(BODY);
        self.slopes.fixed_rows_mut::<BODY>(0).copy_from(&motion);
        let moved = transition * self.covariance;
        let noise = SMatrix::<f64, 6, 6>::from_diagonal(&model.wrench_noise(step_s));
        let corner = moved * transition.transpose() + by_wrench * noise * by_wrench.transpose();
        let p = &mut self.covariance;
        p.fixed_view_mut::<BODY, STATE>(0, 0).copy_from(&moved);
        p.fixed_view_mut::<BODY, BODY>(0, 0).copy_from(&((corner + corner.transpose()) * 0.5));
        for (at, i) in (BODY..STATE).zip(DRIFT..) {
            self.off[at] *= left[i];
            self.slopes.row_mut(at).scale_mut(left[i]);
            p.row_mut(at).scale_mut(left[i]);
            p.column_mut(at).scale_mut(left[i]);
            p[(at, at)] += drives[i];
        }
        let rest = p.fixed_view::<BODY, SLOW>(0, BODY).transpose();
        p.fixed_view_mut::<SLOW, BODY>(BODY, 0).copy_from(&rest);
    }

    /// One row after the other, so that each innovation is a number.
    fn measure(
        &mut self,
        model: &FlightMotion,
        history: &WrenchHistory,
        lesson: &Lesson,
        said: &mut SquareRootInformation<10>,
    ) -> Result<(), IdentificationError> {
        let joint = JointState { motion: lesson.motion, body: self.about };
        let state = FlightState::of(joint);
        let Heard { fresh, samples, .. } = lesson.heard;
        let owed = model.slow().rate_memory.filter(|_| fresh.rate);
        let owed = owed.map(|memory| (memory.held(history, lesson.measurement.stamp_ns), memory.length_s()));
        let Rows { sensitivity, residual, standard_deviation } = model.rows::<ALL_ROWS>(
            &state,
            &lesson.measurement,
            Fresh { acceleration: false, ..fresh },
            &Shown { owed, acceleration: None, samples, about: None },
        );
        let mut block = SMatrix::<f64, ALL_ROWS, 10>::zeros();
        let mut rhs = SVector::<f64, ALL_ROWS>::zeros();
        for i in (0..ALL_ROWS).filter(|i| standard_deviation[*i].is_finite()) {
            let whole = sensitivity.fixed_view::<1, COORDINATES>(i, 0).into_owned();
            let mut row = SMatrix::<f64, 1, STATE>::zeros();
            row.fixed_columns_mut::<BODY>(0).copy_from(&whole.fixed_columns::<BODY>(0));
            row.fixed_columns_mut::<SLOW>(BODY).copy_from(&whole.fixed_columns::<SLOW>(DRIFT));
            let shared = self.covariance * row.transpose();
            let variance = (row * shared).x + standard_deviation[i] * standard_deviation[i];
            let innovation = residual[i] - (row * self.off).x;
            // A filtered rate depends on the body by what it has not shown yet.
            let by_body = row * self.slopes + whole.fixed_columns::<10>(BODY);
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
