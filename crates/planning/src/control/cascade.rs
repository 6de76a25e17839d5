//! A slow law of translation around a fast law of rotation.

use super::believed_body::{BelievedBody, sound_limits, sound_reference, sound_state, translation};
use super::{
    Adoption, AttitudeController, AttitudeLaw, ControlCommand, ControlRequest, Controller, Fallback, ReferenceMotion,
};
use crate::belief::{ModelBelief, Plan};
use crate::error::{PlanningError, not_negative, positive};
use crate::motion::TranslationState;
use nalgebra::{UnitQuaternion, Vector3};
use tumble_dynamics::{FreeFlyer, PoseReference, RigidBodyState, WrenchBox};
use tumble_lie::Wrench;

/// What a law of translation is asked.
#[derive(Clone, Copy)]
pub struct TranslationRequest<'a> {
    /// Mission time, s.
    pub time_s: f64,
    /// Position and velocity of the body origin.
    pub state: TranslationState,
    /// Measured attitude, `world_from_body`.
    pub attitude: UnitQuaternion<f64>,
    /// What to follow.
    pub plan: &'a Plan<&'a dyn ReferenceMotion>,
    /// The body believed in.
    pub body: &'a FreeFlyer<f64>,
    /// Largest force along each body axis, N.
    pub force_limit: Vector3<f64>,
}

/// A force to hold until the next decision.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TranslationDecision {
    /// World axes, N.
    pub force_world: Vector3<f64>,
    /// Where the law left its main road.
    pub fallback: Option<Fallback>,
}

/// Decides on the force that moves the body origin.
///
/// # Example
/// ```
/// use tumble_planning::PlanningError;
/// use tumble_planning::control::{AttitudeController, AttitudeGains, AttitudeLaw, Cascade, TranslationDecision};
/// use tumble_planning::control::{TranslationLaw, TranslationRequest};
/// use tumble_planning::dynamics::InertialParameters;
/// use tumble_planning::nalgebra::Vector3;
///
/// /// A spring and a damper to the reference, ten times a second.
/// struct Spring;
/// impl TranslationLaw for Spring {
///     fn step_s(&self) -> f64 {
///         0.1
///     }
///     fn decide(&mut self, request: &TranslationRequest<'_>) -> Result<TranslationDecision, PlanningError> {
///         let wanted = request.plan.trajectory.at(request.time_s).state.world_from_body.translation.vector;
///         let force_world = (wanted - request.state.position) * 0.4 - request.state.velocity * 4.0;
///         Ok(TranslationDecision { force_world, fallback: None })
///     }
/// }
/// let attitude = AttitudeController {
///     law: AttitudeLaw::Geometric,
///     gains: AttitudeGains { stiffness_n_m: 0.05, damping_n_m_s: 0.2 },
///     body: InertialParameters::solid_box(9.5, [0.3; 3]),
///     torque_limit_n_m: 0.03,
/// };
/// let controller = Cascade::try_new(Spring, attitude, Vector3::repeat(0.3))?; // a `Controller` now
/// assert_eq!(controller.law().step_s(), 0.1);
/// # Ok::<(), PlanningError>(())
/// ```
/// Tutorial: [a controller of your own](https://github.com/tumble-robotics/tumble/blob/main/crates/planning/tests/suite/custom_controller.rs).
pub trait TranslationLaw {
    /// Time between decisions, s; positive.
    fn step_s(&self) -> f64;

    /// Learns of a belief, which can be; asked before anything is decided with it.
    ///
    /// # Errors
    /// A belief that cannot be used; then it was not.
    fn adopt(&mut self, _belief: &ModelBelief) -> Result<(), PlanningError> {
        Ok(())
    }

    /// The force to hold from now on. Time and state are finite numbers.
    ///
    /// # Errors
    /// A reference that is no number; then nothing was decided.
    fn decide(&mut self, request: &TranslationRequest<'_>) -> Result<TranslationDecision, PlanningError>;
}

#[derive(Clone, Copy, Debug)]
struct Held {
    decision: TranslationDecision,
    since_s: f64,
    due_s: f64,
}

/// Share of a step by which an output may come early and still be the one at which to decide.
const EARLY: f64 = 1e-6;

/// A law of translation that decides every so often, its force held along world axes in between and turned into body axes by the
/// attitude measured at each output; the torque is found anew at each output. Both are cut at limits; it promises nothing.
///
/// Each belief in a body that can be is adopted at once, and decided with at the next output; one older than the belief in use
/// is an error.
#[derive(Clone, Debug)]
pub struct Cascade<L> {
    law: L,
    attitude: AttitudeController,
    force_limit: Vector3<f64>,
    believed: BelievedBody,
    held: Option<Held>,
}

impl<L: TranslationLaw> Cascade<L> {
    /// This law of translation, with at most this force along each body axis (N), and this of rotation, for the body in it until a
    /// belief tells better.
    ///
    /// # Errors
    /// A body that cannot be, a gain that is negative, a step or a limit that is not positive.
    pub fn try_new(law: L, attitude: AttitudeController, force_limit: Vector3<f64>) -> Result<Self, PlanningError> {
        positive("the time between decisions", law.step_s())?;
        not_negative("the stiffness of the attitude", attitude.gains.stiffness_n_m)?;
        not_negative("the damping of the attitude", attitude.gains.damping_n_m_s)?;
        sound_limits(&WrenchBox { torque_limit: Vector3::repeat(attitude.torque_limit_n_m), force_limit })?;
        let believed = BelievedBody::nominal(&attitude.body)?;
        Ok(Self { law, attitude, force_limit, believed, held: None })
    }

    /// The law of translation.
    pub fn law(&self) -> &L {
        &self.law
    }

    /// The decision to use at this time, made now where it is due.
    fn decision(&mut self, request: &ControlRequest<'_>) -> Result<TranslationDecision, PlanningError> {
        let (time_s, step_s) = (request.time_s, self.law.step_s());
        if let Some(held) = &self.held
            && time_s >= held.since_s
            && time_s < held.due_s - EARLY * step_s
        {
            return Ok(held.decision);
        }
        let decision = self.law.decide(&TranslationRequest {
            time_s,
            state: translation(request.state),
            attitude: request.state.world_from_body.rotation,
            plan: request.plan,
            body: &self.believed.body,
            force_limit: self.force_limit,
        })?;
        // on the grid of the first decision, unless that was left far behind
        let due_s = match &self.held {
            Some(held) if time_s >= held.since_s && time_s < held.due_s + step_s => held.due_s + step_s,
            _ => time_s + step_s,
        };
        self.held = Some(Held { decision, since_s: time_s, due_s });
        Ok(decision)
    }

    /// Wrench in body axes for a force, inside the limits.
    fn wrench(
        &self,
        state: &RigidBodyState<f64>,
        reference: &PoseReference,
        force_world: &Vector3<f64>,
    ) -> Wrench<f64> {
        let body_from_world = state.world_from_body.rotation.inverse();
        let mut force = body_from_world * force_world;
        if self.attitude.law == AttitudeLaw::Geometric {
            // what the origin needs because it turns about the centre of mass
            let body_from_wanted = body_from_world * reference.state.world_from_body.rotation;
            let rate = body_from_wanted * reference.state.twist_body.angular;
            let moment = &self.attitude.body.first_moment;
            let angular = body_from_wanted * reference.acceleration.angular_acceleration_body;
            force += angular.cross(moment) + rate.cross(&rate.cross(moment));
        }
        let force = force.zip_map(&self.force_limit, |force, limit| force.min(limit).max(-limit));
        Wrench::new(self.attitude.torque_body(state, reference, &force).torque_n_m, force)
    }
}

impl<L: TranslationLaw> Controller for Cascade<L> {
    fn adopt(&mut self, belief: &ModelBelief) -> Result<Adoption, PlanningError> {
        let believed = self.believed.after(belief)?;
        self.law.adopt(belief)?;
        (self.believed, self.held) = (believed, None);
        self.attitude.body = *believed.body.parameters();
        Ok(Adoption::Adopted)
    }

    fn command(&mut self, request: &ControlRequest<'_>) -> Result<ControlCommand, PlanningError> {
        let state = sound_state(request)?;
        let reference = sound_reference(request.plan, request.time_s)?;
        let TranslationDecision { force_world, fallback } = self.decision(request)?;
        let wrench_body = self.wrench(state, &reference, &force_world);
        Ok(ControlCommand { wrench_body, model_revision: self.believed.revision, fallback, mass: None })
    }
}
