//! Linear-quadratic feedback of position and velocity: the baseline without limits in its mind.

use super::AttitudeController;
use super::believed_body::{sound_reference, translation};
use super::cascade::{Cascade, TranslationDecision, TranslationLaw, TranslationRequest};
use super::riccati::discrete_lqr;
use crate::error::{PlanningError, positive};
use nalgebra::{Matrix1, Matrix2, Vector2, Vector3};

/// What errors of position and velocity, and accelerations, weigh along each axis.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TranslationWeights {
    /// Per m^2; positive.
    pub position: f64,
    /// Per (m/s)^2; positive.
    pub velocity: f64,
    /// Per (m/s^2)^2; positive.
    pub acceleration: f64,
}

impl Default for TranslationWeights {
    fn default() -> Self {
        Self { position: 10.0, velocity: 30.0, acceleration: 100.0 }
    }
}

/// One axis of a body that is accelerated in steps: the motion over a step, and what its input adds.
pub(super) fn axis_model(step_s: f64) -> (Matrix2<f64>, Vector2<f64>) {
    (Matrix2::new(1.0, step_s, 0.0, 1.0), Vector2::new(0.5 * step_s * step_s, step_s))
}

/// Stiffness (1/s^2) and damping (1/s) that cost least in the long run, and the matrix of that cost.
pub(super) fn axis_lqr(
    step_s: f64,
    weights: &TranslationWeights,
) -> Result<(Vector2<f64>, Matrix2<f64>), PlanningError> {
    let TranslationWeights { position, velocity, acceleration } = *weights;
    positive("the time between decisions", step_s)?;
    positive("the weight of the position", position)?;
    positive("the weight of the velocity", velocity)?;
    positive("the weight of the acceleration", acceleration)?;
    let (a, b) = axis_model(step_s);
    let state = Matrix2::from_diagonal(&Vector2::new(position, velocity));
    let (gain, cost) = discrete_lqr(&a, &b, &state, &Matrix1::new(acceleration))?;
    Ok((-gain.transpose(), cost))
}

/// Acceleration of the reference, on average until the next decision, minus feedback of the error; times the believed mass.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LinearFeedback {
    step_s: f64,
    stiffness: f64,
    damping: f64,
}

impl LinearFeedback {
    /// The feedback that costs least in the long run by these weights, decided anew every `step_s`.
    ///
    /// # Errors
    /// A step or a weight that is not positive.
    pub fn try_new(step_s: f64, weights: &TranslationWeights) -> Result<Self, PlanningError> {
        let (gain, _) = axis_lqr(step_s, weights)?;
        Ok(Self { step_s, stiffness: gain.x, damping: gain.y })
    }

    /// Acceleration per error of the position, 1/s^2.
    pub fn stiffness(&self) -> f64 {
        self.stiffness
    }

    /// Acceleration per error of the velocity, 1/s.
    pub fn damping(&self) -> f64 {
        self.damping
    }
}

impl TranslationLaw for LinearFeedback {
    fn step_s(&self) -> f64 {
        self.step_s
    }

    fn decide(&mut self, request: &TranslationRequest<'_>) -> Result<TranslationDecision, PlanningError> {
        let now = translation(&sound_reference(request.plan, request.time_s)?.state);
        let next = translation(&sound_reference(request.plan, request.time_s + self.step_s)?.state);
        let acceleration = (next.velocity - now.velocity) / self.step_s
            + (now.position - request.state.position) * self.stiffness
            + (now.velocity - request.state.velocity) * self.damping;
        let force_world = acceleration * request.body.parameters().mass;
        Ok(TranslationDecision { force_world, fallback: None })
    }
}

/// The linear-quadratic baseline: [`LinearFeedback`] around the attitude's feedback.
pub type LqrController = Cascade<LinearFeedback>;

impl LqrController {
    /// Feedback by these weights every `step_s`, with at most this force along each body axis (N), around this of the attitude.
    ///
    /// # Errors
    /// A body that cannot be, a weight, step or limit that is not positive, a gain that is negative.
    pub fn lqr(
        step_s: f64,
        weights: &TranslationWeights,
        attitude: AttitudeController,
        force_limit: Vector3<f64>,
    ) -> Result<Self, PlanningError> {
        Self::try_new(LinearFeedback::try_new(step_s, weights)?, attitude, force_limit)
    }
}
