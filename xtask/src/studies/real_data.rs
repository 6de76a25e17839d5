//! `real-data`: what the crates make of measured motion whose answer is known.

use std::path::{Path, PathBuf};

use crate::arguments::Arguments;
use crate::{Failure, throws};

/// A set: its folder and what processes it, which returns the targets it missed.
type Set = (&'static str, fn(&Path, bool) -> Result<Vec<String>, Failure>);

const SETS: &[Set] = &[(throws::SET, throws::run)];

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
    let mut missed = Vec::new();
    for (name, run) in SETS {
        let set = folder.join(name);
        if set.is_dir() {
            missed.extend(run(&set, arguments.has("--json"))?);
        } else if required {
            return Err(Failure::file(&set, "is not there"));
        } else {
            eprintln!("skipped: {} is not there", set.display());
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
