//! What a scenario's nozzles are commanded by, as an estimator is told of them.

use super::{PropulsionName, ScenarioSource};
use crate::TumbleError;
use crate::flight_log::NOZZLE_COLUMNS;
use tumble_astrobee::propulsion::{commanded_nozzles, erring_nozzles};
use tumble_formats::actuator_file::ActuatorFile;
use tumble_identification::recursive::{ErringThruster, THRUSTERS};

/// What the thrust of a nozzle is off by in flight, one standard deviation, as a share.
const NOZZLE_SIGMA: f64 = 0.01;

impl ScenarioSource {
    /// The nozzles and their columns in the log; `None` where none are simulated, or their impellers are at rest.
    ///
    /// `thrust_sigma` of the scenario is that of each; of a `thrust_factor` the robot does not know, so that all may be off by as much.
    ///
    /// # Errors
    /// [`TumbleError::BadScenario`] for a flight mode that does not exist.
    pub fn nozzles(&self) -> Result<Option<ActuatorFile>, TumbleError> {
        let table = &self.scenario.propulsion;
        if table.kind != PropulsionName::Plant {
            return Ok(None);
        }
        let (thrust_sigma, factor) = (table.thrust_sigma.unwrap_or(0.0), table.thrust_factor.unwrap_or(1.0));
        let nozzles = commanded_nozzles(self.flight_mode()?.impellers(), thrust_sigma, (factor - 1.0).abs());
        Ok(nozzles.map(|actuators| ActuatorFile { columns: NOZZLE_COLUMNS.map(str::to_owned).to_vec(), actuators }))
    }

    /// What makes wrenches, as an estimator in flight is told of it; nothing errs that makes whatever is wanted.
    ///
    /// # Errors
    /// [`TumbleError::BadScenario`] for actuators that no robot has.
    pub(super) fn erring_thrusters(&self) -> Result<[ErringThruster; THRUSTERS], TumbleError> {
        Ok(match &self.scenario.propulsion.kind {
            PropulsionName::Plant => erring_nozzles(NOZZLE_SIGMA),
            PropulsionName::Limited | PropulsionName::Exact => [ErringThruster::NONE; THRUSTERS],
            PropulsionName::Named(name) => (self.actuators_named(name)?.thrusters)()?,
        })
    }
}
