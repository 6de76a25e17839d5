//! Weights derived from what uncertainty costs.

use super::{InformationWeighting, WeightingContext};
use crate::error::{PlanningError, not_negative};
use crate::local::tracking_loss::TrackedMotion;
use nalgebra::SMatrix;
use num_traits::AsPrimitive;
use tumble_dynamics::{InertialParameters, PARAMETERS};

/// Weighs each variance with the tracking cost that it is expected to cause over the rest of the mission
/// ([`super::super::TrackingLoss`]), in units of the planner's own cost: nothing to tune, and nothing to switch off, as the
/// weights end with the motion that they are for.
///
/// A plan gathers knowledge for what comes after it, so costs count from `used_after_s` after the present on.
#[derive(Clone, Debug, PartialEq)]
pub struct BeliefWeighting<const P: usize> {
    mission: TrackedMotion,
    body: InertialParameters<f64>,
    by_quantity: SMatrix<f64, PARAMETERS, P>,
    used_after_s: f64,
}

impl<const P: usize> BeliefWeighting<P> {
    /// For a mission that begins at no elapsed time, flown with this model; see [`TrackedMotion::loss`] for `by_quantity`.
    ///
    /// # Errors
    /// Those of [`TrackedMotion::loss`]; a time that is negative or not finite.
    pub fn try_new(
        mission: TrackedMotion,
        body: InertialParameters<f64>,
        by_quantity: SMatrix<f64, PARAMETERS, P>,
        used_after_s: f64,
    ) -> Result<Self, PlanningError> {
        not_negative("the time until knowledge is used", used_after_s)?;
        mission.loss(&body, &by_quantity, mission.steps())?;
        Ok(Self { mission, body, by_quantity, used_after_s })
    }

    /// Takes the body for another from now on.
    ///
    /// # Errors
    /// Those of [`TrackedMotion::loss`].
    pub fn adopt(
        &mut self,
        body: InertialParameters<f64>,
        by_quantity: SMatrix<f64, PARAMETERS, P>,
    ) -> Result<(), PlanningError> {
        self.mission.loss(&body, &by_quantity, self.mission.steps())?;
        (self.body, self.by_quantity) = (body, by_quantity);
        Ok(())
    }
}

impl<const P: usize> InformationWeighting<P> for BeliefWeighting<P> {
    fn weights(&mut self, context: &WeightingContext<P>) -> Result<[f64; P], PlanningError> {
        let steps = (context.elapsed_s() + self.used_after_s) / self.mission.step_s();
        let first = libm::round(steps).as_();
        Ok(self.mission.loss(&self.body, &self.by_quantity, first)?.weights())
    }
}
