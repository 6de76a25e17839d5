//! `--sensing` of the commands that fly.

use crate::TumbleError;
use crate::scenario::ScenarioSource;
use clap::Args;

/// The sensors that are flown with.
#[derive(Args)]
pub(super) struct FlownSensing {
    /// Sensors to fly with instead of the scenario's `[sensing]`: perfect, ideal, nominal, thesis-flight, bumble, or a TOML file as
    /// `tumble sensing show NAME` prints one. docs/sensing.md says what of a file is flown.
    #[arg(long, value_name = "NAME|FILE")]
    pub(super) sensing: Option<String>,
}

impl FlownSensing {
    /// The scenario with these sensors.
    pub(super) fn of(&self, source: ScenarioSource) -> Result<ScenarioSource, TumbleError> {
        match &self.sensing {
            Some(name) => source.sensed_by(name),
            None => Ok(source),
        }
    }
}
