//! The log of a flight that nobody has flown yet, for `tumble identify --dry-run SCENARIO`.

use super::commanded_nozzles::CommandedNozzles;
use super::flown_sensing::FlownSensing;
use super::identify_options::IdentifyArgs;
use super::log_files;
use super::said::progress;
use super::simulate_flight::{fly_to_log, seconds};
use crate::TumbleError;
use crate::scenario::ScenarioSource;
use std::path::{Path, PathBuf};
use tumble_formats::{LogFile, Robots};

/// The logs that were named, as files, or the one of a scenario.
pub(super) fn logs_of(args: &IdentifyArgs, named: &[PathBuf], robots: &Robots) -> Result<Vec<LogFile>, TumbleError> {
    match named {
        [scenario] if args.is_of_scenario() => Ok(vec![log_of(args, scenario, robots)?]),
        logs => log_files(logs),
    }
}

/// What `tumble simulate` would write of this scenario, with the sensors and the seed of the options.
fn log_of(args: &IdentifyArgs, named: &Path, robots: &Robots) -> Result<LogFile, TumbleError> {
    let found = ScenarioSource::find(&named.to_string_lossy())?.among(robots);
    let mut source = FlownSensing { sensing: args.sensing.clone() }.of(found)?;
    source.scenario.seed = args.seed.unwrap_or(source.scenario.seed);
    let mut flight = source.flight()?;
    let log = LogFile::to_write(named)?;
    fly_to_log(&mut flight, &CommandedNozzles::of(&source)?, log.path())?;
    progress("");
    if let Some(first) = flight.simulator.events().iter().find(|event| event.event.is_violation()) {
        tell_line!("warning: the flight is not as it should be: {} at {:.3} s", first.event, seconds(first));
    }
    Ok(log)
}
