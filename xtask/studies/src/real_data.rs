//! `real-data`: what the crates make of measured motion whose answer is known.

use std::path::{Path, PathBuf};

use crate::arguments::Arguments;
use crate::{
    Failure, air_table, allocation, arm_payload, brushless, propulsion_dynamics, station_imu, throws, thrust_imu,
};

/// What processes a set, and returns the targets it missed.
type Set = fn(&Path, bool) -> Result<Vec<String>, Failure>;

/// All sets that are read, each by the name of its folder among the data.
const SETS: &[(&str, Set)] = &[
    (throws::SET, throws::run),
    (brushless::SET, brushless::run),
    (thrust_imu::SET, thrust_imu::run),
    (allocation::SET, allocation::real_data),
    (propulsion_dynamics::SET, propulsion_dynamics::run),
    (arm_payload::SET, arm_payload::run),
    (station_imu::SET, station_imu::run),
    (air_table::SET, air_table::run),
];

/// Runs every set found in the data folder: `--data`, else `TUMBLE_DATA`, else `../shared/data`.
pub fn run(arguments: &Arguments) -> Result<(), Failure> {
    let required = std::env::var("TUMBLE_REQUIRE_DATA").is_ok_and(|value| value == "1");
    let from_environment = std::env::var("TUMBLE_DATA").ok();
    let usual: Vec<&str> = from_environment.as_deref().into_iter().chain(["../shared/data"]).collect();
    let Some(folder) = arguments.folder("--data", &usual)? else {
        let absent = "no data folder: name one with --data DIR or TUMBLE_DATA".to_owned();
        if required {
            return Err(Failure::BadInput(absent));
        }
        eprintln!("skipped: {absent}");
        return Ok(());
    };
    let (json, mut missed) = (arguments.has("--json"), Vec::new());
    let without = arguments.value("--without");
    if let Some(unknown) = without.filter(|without| SETS.iter().all(|(name, _)| name != without)) {
        let known: Vec<&str> = SETS.iter().map(|(name, _)| *name).collect();
        return Err(Failure::BadInput(format!("no set `{unknown}`; there are {}", known.join(", "))));
    }
    let sets = SETS.iter().filter(|(name, _)| Some(*name) != without);
    let sets: Vec<(&str, PathBuf, Set)> = sets.map(|(name, run)| (*name, folder.join(name), *run)).collect();
    // every row names its set, so that they may answer in any order
    let answers: Vec<Option<Result<Vec<String>, Failure>>> = std::thread::scope(|scope| {
        let running: Vec<_> =
            sets.iter().map(|(_, set, run)| set.is_dir().then(|| scope.spawn(move || run(set, json)))).collect();
        let end = |answer: std::thread::Result<_>| answer.unwrap_or_else(|panic| std::panic::resume_unwind(panic));
        running.into_iter().map(|set| set.map(|set| end(set.join()))).collect()
    });
    for ((_, set, _), answer) in sets.iter().zip(answers) {
        match answer {
            Some(answer) => missed.extend(answer?),
            None if required => return Err(Failure::file(set, "is not there")),
            None => eprintln!("skipped: {} is not there", set.display()),
        }
    }
    for name in other_sets(&folder) {
        eprintln!("{name}: not yet supported");
    }
    for miss in &missed {
        eprintln!("missed: {miss}");
    }
    if arguments.has("--check") && !missed.is_empty() {
        return Err(Failure::TargetMissed(format!("{} targets missed", missed.len())));
    }
    Ok(())
}

/// Folders no set reads, by name.
fn other_sets(folder: &Path) -> Vec<String> {
    let entries = std::fs::read_dir(folder).into_iter().flatten().flatten().map(|entry| entry.path());
    let mut names: Vec<String> = entries
        .filter(|path| path.is_dir())
        .filter_map(|path: PathBuf| path.file_name().map(|name| name.to_string_lossy().into_owned()))
        .filter(|name| SETS.iter().all(|(known, _)| known != name))
        .collect();
    names.sort();
    names
}
