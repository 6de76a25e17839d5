//! The closed loop of a mission, its layers taken from the registries.

use super::layers::{computing_time, loop_settings, scene};
use super::options::FlyOptions;
use super::registries::{controllers, estimators, local_planners, planners};
use crate::TumbleError;
use crate::scenario::MissionProblem;
use tumble_identification::estimator::StateEstimator;
use tumble_planning::collision::EllipsoidWorld;
use tumble_planning::control::Controller;
use tumble_planning::global::GlobalPlanner;
use tumble_planning::mission::{ClosedLoop, Simulated, StretchPlanner};

/// RATTLE around the simulated robot.
pub type AstrobeeLoop = ClosedLoop<EllipsoidWorld, Box<dyn Controller + Send>, Box<dyn StateEstimator>>;

/// Its planners, whose computing time is simulated.
pub type MissionPlanners = Simulated<Box<dyn GlobalPlanner<EllipsoidWorld>>, Box<dyn StretchPlanner>>;

/// The whole loop, and its planners.
///
/// # Errors
/// What one of its layers refuses.
pub fn closed_loop(
    problem: &MissionProblem,
    options: &FlyOptions,
) -> Result<(AstrobeeLoop, MissionPlanners), TumbleError> {
    let build = || {
        let layers = &problem.layers;
        let ways = planners().make(layers.planner(), &problem.planning)?;
        let stretches = local_planners().make(layers.local_planner(), &options.weighting)?(problem)?;
        let planners = Simulated::new((ways, stretches), computing_time(problem));
        let flying = ClosedLoop::try_new(
            loop_settings(problem, options.feedback, options.seed),
            scene(problem, 0.0, &[])?,
            controllers().make(layers.controller(), problem)?,
            estimators().make(layers.estimator(), problem)?,
            problem.flight.simulator.time_ns(),
        )?;
        Ok((flying, planners))
    };
    build().map_err(TumbleError::Planning)
}
