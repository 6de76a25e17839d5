//! From a scenario to a mission: `[fly]`, and everything that the closed loop needs, built.

mod bodies;
mod draw;
mod numbers;
mod table;

pub use draw::{LARGEST_OUTSIDE, draw_mission};
pub use table::{ArrivalTable, ComputingTable, EstimatorTable, FlyTable, InformationTable};

use super::{Margins, MissionProblem, ScenarioSource};
use crate::TumbleError;
use crate::mission::FlyOptions;
use tumble_dynamics::Environment;
use tumble_identification::recursive::SlowErrors;
use tumble_planning::PlanningError;

impl ScenarioSource {
    /// The mission that this scenario and these options are, everything checked.
    ///
    /// # Errors
    /// [`TumbleError::BadScenario`] with the key and its place; the errors of files that it names.
    pub fn mission(&self, options: &FlyOptions) -> Result<MissionProblem, TumbleError> {
        let place = self.place()?;
        let numbers = self.fly_numbers(place)?;
        let belief = self.mission_belief(place, options.model)?;
        let prior = self.mission_prior(&belief)?;
        let flown = self.as_flown(options.seed, &belief, &numbers);
        let (flight, mut planning) = (flown.flight()?, flown.planning_problem()?);
        self.share_limits(&mut planning, &numbers);
        planning.belief.estimate = prior;
        let slow = SlowErrors::of(&numbers.sensing).map_err(PlanningError::from)?;
        let margins_m = Margins::of(numbers.margin_m, &slow);
        planning.margin_m = margins_m.way;
        let mut truth = self.true_body(place, self.payload_in_the_end())?;
        if place.is_planar() {
            truth = tumble_astrobee::simulator::planar_part(&truth);
        }
        let fly = self.scenario.fly.as_ref();
        let is_told = fly.and_then(|fly| fly.knows_environment).unwrap_or(true);
        Ok(MissionProblem {
            name: self.scenario.name.clone(),
            place,
            planar: place.is_planar(),
            weighting: numbers.weighting(&belief),
            stop: numbers.stop(&belief, place.is_planar()),
            flight,
            planning,
            prior,
            truth,
            seen_from_s: self.seen_from_s(place)?,
            force_limit_n: numbers.force_limit_n,
            torque_limit_n_m: numbers.torque_limit_n_m,
            plan_force_share: numbers.plan_force_share,
            plan_torque_share: numbers.plan_torque_share,
            speed_limit_m_s: numbers.speed_limit_m_s,
            rate_limit_rad_s: numbers.rate_limit_rad_s,
            mass_interval_share: numbers.mass_interval_share,
            unknowns: numbers.unknowns,
            stretch_s: numbers.stretch_steps as f64 * numbers.step_s,
            step_s: numbers.step_s,
            belief_period_s: numbers.belief_period_s,
            stretch_lead_s: numbers.stretch_lead_s,
            way_lead_s: numbers.way_lead_s,
            computing: numbers.computing,
            margins_m,
            arrival: numbers.arrival,
            longest_s: self.scenario.duration_s,
            noise: numbers.noise.drifting(numbers.drift_share, &belief).map_err(PlanningError::from)?,
            planned_motion: numbers.planned_motion(),
            slow,
            thrusters: self.erring_thrusters()?,
            station_stretches: numbers.station_stretches,
            environment: if is_told { self.environment()? } else { Environment::default() },
            layers: options.layers.or(fly.and_then(|fly| fly.layers).unwrap_or_default()),
        })
    }
}

#[cfg(test)]
mod tests;
