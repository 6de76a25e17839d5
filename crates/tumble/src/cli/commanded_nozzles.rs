//! The nozzles of a flight: their columns in the log, and the file that tells `identify --actuators` of them.

use crate::TumbleError;
use crate::output::OutputFolder;
use crate::scenario::ScenarioSource;
use tumble_formats::actuator_file::{self, ActuatorFile};

/// The file beside the log.
const FILE: &str = "actuators.toml";

/// Nozzles of a flight, where there are any.
pub(super) struct CommandedNozzles(Option<ActuatorFile>);

impl CommandedNozzles {
    /// Those of a scenario.
    pub(super) fn of(source: &ScenarioSource) -> Result<Self, TumbleError> {
        source.nozzles().map(Self)
    }

    /// Thrust of each at a command of one, N.
    pub(super) fn largest_thrusts_n(&self) -> Option<[f64; 12]> {
        let nozzles = self.0.as_ref()?.actuators.actuators.iter();
        nozzles.map(|nozzle| nozzle.thrust_n).collect::<Vec<_>>().try_into().ok()
    }

    /// Writes the file.
    pub(super) fn write(&self, folder: &OutputFolder) -> Result<(), TumbleError> {
        match &self.0 {
            Some(nozzles) => folder.write(FILE, &actuator_file::text(nozzles, &folder.file(FILE))?),
            None => Ok(()),
        }
    }
}
