//! Weights by what uncertainty is expected to cost on the rest of the way.

use super::motion::MissionMotion;
use super::stretch::StretchTask;
use crate::control::ReferenceMotion;
use crate::error::PlanningError;
use crate::local::{ClosedLoop, TrackedMotion, body_by_mass_center_and_inertia};
use nalgebra::SMatrix;
use tumble_dynamics::{FreeFlyer, PARAMETERS, PoseTracker};

/// What follows the rest of the way, and what deviations from it cost; see [`crate::local::TrackingLoss`].
#[derive(Clone, Debug, PartialEq)]
pub struct ExpectedLoss<const P: usize> {
    /// Natural frequencies of rotation and position of the feedback that flies the way, rad/s.
    pub tracker_rad_s: [f64; 2],
    /// Weights of squared deviations: position, velocity, attitude, rate.
    pub tracking: [f64; 4],
    /// Of mass, centre of mass (x, y, z) and inertia about it (xx, xy, xz, yy, yz, zz), which each quantity is.
    pub places: [usize; P],
}

impl<const P: usize> ExpectedLoss<P> {
    /// Weight of the variance of each quantity: nothing where the way ends within the stretch.
    ///
    /// # Errors
    /// Those of [`TrackedMotion::loss`].
    pub(super) fn weights(
        &self,
        task: &StretchTask<'_>,
        horizon_s: f64,
        step_s: f64,
    ) -> Result<[f64; P], PlanningError> {
        let body = task.belief.parameters();
        let all = body_by_mass_center_and_inertia(body);
        let mut by_quantity = SMatrix::<f64, PARAMETERS, P>::zeros();
        for (index, place) in self.places.iter().enumerate().filter(|(_, place)| **place < PARAMETERS) {
            by_quantity.set_column(index, &all.column(*place));
        }
        let (from_s, until_s) = (task.start_s + horizon_s, task.way_start_s + task.way.duration_s());
        if until_s <= from_s {
            return Ok([0.0; P]);
        }
        let rest = MissionMotion::along(task.way, task.way_start_s, from_s, until_s);
        #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "positive; `as` saturates")]
        let steps = ((until_s - from_s) / step_s).ceil() as usize;
        // the middle of a step stands for it
        let motion = (0..steps.min(MOST_STEPS)).map(|step| rest.at(from_s + step_s * (step as f64 + 0.5))).collect();
        let [rotation, position] = self.tracker_rad_s;
        let tracker = PoseTracker::critically_damped(FreeFlyer::new(*body), rotation, position);
        let [p, v, a, w] = self.tracking;
        let tracking = [p, p, p, v, v, v, a, a, a, w, w, w];
        let tracked = TrackedMotion::try_new(motion, step_s, ClosedLoop::from(&tracker), tracking)?;
        Ok(tracked.loss(body, &by_quantity, 0)?.weights())
    }
}

/// Most steps of the rest of a way.
const MOST_STEPS: usize = 10_000;
