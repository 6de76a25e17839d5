//! Proportional-derivative tracking behind the interface of controllers.

use super::believed_body::{BelievedBody, sound_limits, sound_reference, sound_state};
use super::{Adoption, ControlCommand, ControlRequest, Controller};
use crate::belief::ModelBelief;
use crate::error::{PlanningError, not_negative};
use nalgebra::Vector3;
use tumble_dynamics::{Actuation, PoseTracker, WrenchBox};

/// A [`PoseTracker`] whose body is the believed one and whose wrench is cut at limits; it promises nothing.
///
/// It decides anew at every output. Each belief in a body that can be is adopted at once; one older than the belief in use is
/// an error.
#[derive(Clone, Debug, PartialEq)]
pub struct PoseTracking {
    tracker: PoseTracker,
    limits: WrenchBox,
    believed: BelievedBody,
}

impl PoseTracking {
    /// This tracker, its wrench cut at these limits.
    ///
    /// # Errors
    /// A body that cannot be, a gain that is negative, a limit that is not positive.
    pub fn try_new(tracker: PoseTracker, limits: WrenchBox) -> Result<Self, PlanningError> {
        let PoseTracker { rotation_stiffness, rotation_damping, position_stiffness, position_damping, .. } = tracker;
        for gain in [rotation_stiffness, rotation_damping, position_stiffness, position_damping] {
            not_negative("a gain of the tracker", gain)?;
        }
        sound_limits(&limits)?;
        Ok(Self { tracker, limits, believed: BelievedBody::nominal(tracker.body.parameters())? })
    }

    /// This tracker with nothing cut.
    ///
    /// # Errors
    /// Those of [`Self::try_new`].
    pub fn unlimited(tracker: PoseTracker) -> Result<Self, PlanningError> {
        let unlimited = Vector3::repeat(f64::INFINITY);
        Self::try_new(tracker, WrenchBox { torque_limit: unlimited, force_limit: unlimited })
    }
}

impl Controller for PoseTracking {
    fn adopt(&mut self, belief: &ModelBelief) -> Result<Adoption, PlanningError> {
        let adoption = self.believed.adopt(belief)?;
        self.tracker.body = self.believed.body;
        Ok(adoption)
    }

    fn command(&mut self, request: &ControlRequest<'_>) -> Result<ControlCommand, PlanningError> {
        let state = sound_state(request)?;
        let reference = sound_reference(request.plan, request.time_s)?;
        let wrench_body = self.limits.realize(&self.tracker.wrench_body(state, &reference));
        Ok(ControlCommand { wrench_body, model_revision: self.believed.revision, fallback: None, mass: None })
    }
}
