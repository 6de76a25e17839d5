//! What the controllers here believe of the body, and the numbers they take.

use super::{Adoption, ControlRequest, ReferenceMotion};
use crate::belief::{ModelBelief, Plan};
use crate::error::{self, PlanningError, finite, moderate, not_negative, positive};
use crate::motion::TranslationState;
use nalgebra::Vector3;
use tumble_dynamics::{FreeFlyer, InertialParameters, PoseReference, RigidBodyState, WrenchBox};
use tumble_lie::Twist;

/// A body and the revision of the belief it comes from.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct BelievedBody {
    pub body: FreeFlyer<f64>,
    /// Zero before the first belief.
    pub revision: u64,
}

impl BelievedBody {
    /// Before the first belief.
    pub fn nominal(parameters: &InertialParameters<f64>) -> Result<Self, PlanningError> {
        positive("the nominal mass", parameters.validated()?.mass)?;
        Ok(Self { body: FreeFlyer::new(*parameters), revision: 0 })
    }

    /// This body from now on.
    ///
    /// # Errors
    /// A body that cannot be; a variance of its mass that cannot be; a revision older than the one in use.
    pub fn adopt(&mut self, belief: &ModelBelief) -> Result<Adoption, PlanningError> {
        *self = self.after(belief)?;
        Ok(Adoption::Adopted)
    }

    /// What [`Self::adopt`] makes of it.
    pub fn after(&self, belief: &ModelBelief) -> Result<Self, PlanningError> {
        let parameters = belief.parameters().validated()?;
        positive("the believed mass", parameters.mass)?;
        not_negative("the variance of the mass", belief.estimate.covariance[(0, 0)])?;
        if belief.revision < self.revision {
            let (value, lower) = (belief.revision as f64, self.revision as f64);
            let what = "the revision of a belief";
            return Err(PlanningError::OutOfRange { what, value, lower, upper: f64::INFINITY });
        }
        Ok(Self { body: FreeFlyer::new(parameters), revision: belief.revision })
    }
}

fn vector(what: &'static str, vector: &Vector3<f64>) -> Result<(), PlanningError> {
    vector.iter().try_for_each(|component| moderate(what, *component).map(|_| ()))
}

fn twist(what: &'static str, twist: &Twist<f64>) -> Result<(), PlanningError> {
    vector(what, &twist.angular)?;
    vector(what, &twist.linear)
}

/// The state asked about, where it and the time are numbers.
///
/// # Errors
/// [`PlanningError::NotFinite`], [`PlanningError::OutOfRange`].
pub(super) fn sound_state<'a>(request: &ControlRequest<'a>) -> Result<&'a RigidBodyState<f64>, PlanningError> {
    finite("the time of a request", request.time_s)?;
    error::pose(&request.state.world_from_body)?;
    twist("a measured velocity", &request.state.twist_body)?;
    Ok(request.state)
}

/// The reference at a time, where it is numbers.
///
/// # Errors
/// [`PlanningError::NotFinite`], [`PlanningError::OutOfRange`].
pub(super) fn sound_reference(plan: &Plan<&dyn ReferenceMotion>, time_s: f64) -> Result<PoseReference, PlanningError> {
    let reference = plan.trajectory.at(time_s);
    error::pose(&reference.state.world_from_body)?;
    twist("a velocity of the reference", &reference.state.twist_body)?;
    vector("an angular acceleration of the reference", &reference.acceleration.angular_acceleration_body)?;
    vector("an acceleration of the reference", &reference.acceleration.acceleration_origin_body)?;
    Ok(reference)
}

/// Position and velocity of the body origin, world axes.
pub(super) fn translation(state: &RigidBodyState<f64>) -> TranslationState {
    let RigidBodyState { world_from_body, twist_body } = state;
    TranslationState {
        position: world_from_body.translation.vector,
        velocity: world_from_body.rotation * twist_body.linear,
    }
}

/// Limits that leave something, each positive or infinite.
///
/// # Errors
/// [`PlanningError::NotPositive`], [`PlanningError::NotFinite`] for one that is no number.
pub(super) fn sound_limits(limits: &WrenchBox) -> Result<(), PlanningError> {
    for limit in limits.torque_limit.iter().chain(&limits.force_limit) {
        let what = "a limit of the wrench";
        if limit.is_nan() {
            return Err(PlanningError::NotFinite { what, value: *limit });
        }
        if *limit <= 0.0 {
            return Err(PlanningError::NotPositive { what, value: *limit });
        }
    }
    Ok(())
}
