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

/// One line of the report of a set without configurations.
pub struct Measured<'a> {
    pub dataset: &'a str,
    pub file: &'a str,
    pub quantity: &'a str,
    pub estimate: f64,
    /// One standard deviation, where the method gives one.
    pub sigma: Option<f64>,
    /// What it should be, where that is known.
    pub reference: Option<f64>,
}

impl Measured<'_> {
    /// Prints it, as JSON or for the eye.
    pub fn print(&self, json: bool) {
        let error_percent = self.reference.map(|reference| 100.0 * (self.estimate / reference - 1.0));
        if json {
            let line = serde_json::json!({
                "dataset": self.dataset,
                "file": self.file,
                "quantity": self.quantity,
                "estimate": self.estimate,
                "sigma": self.sigma,
                "reference": self.reference,
                "error_percent": error_percent,
            });
            println!("{line}");
            return;
        }
        let Self { dataset, file, quantity, estimate, .. } = self;
        let sigma = self.sigma.map_or(String::new(), |sigma| format!(" +- {sigma:.2e}"));
        let error = error_percent.map_or(String::new(), |percent| format!("  error {percent:6.2} %"));
        println!("{dataset}  {file:<20} {quantity:<40} {estimate:11.4e}{sigma}{error}");
    }
}

/// The CSV files of a folder, by name.
pub fn tables(folder: &Path) -> Result<Vec<PathBuf>, Failure> {
    let entries = std::fs::read_dir(folder).map_err(|error| Failure::file(folder, error))?;
    let mut files: Vec<PathBuf> = entries.flatten().map(|entry| entry.path()).collect();
    files.retain(|path| path.extension().is_some_and(|extension| extension == "csv"));
    files.sort();
    Ok(files)
}

/// These columns of a table of numbers, row by row.
pub fn columns<const N: usize>(path: &Path, names: &[&str; N]) -> Result<Vec<[f64; N]>, Failure> {
    let text = std::fs::read_to_string(path).map_err(|error| Failure::file(path, error))?;
    let mut lines = text.lines().zip(1..).filter(|(line, _)| !line.trim().is_empty());
    let header: Vec<&str> = lines.next().map_or(Vec::new(), |(line, _)| line.split(',').map(str::trim).collect());
    let mut places = [0; N];
    for (place, name) in places.iter_mut().zip(names) {
        *place = header
            .iter()
            .position(|column| column == name)
            .ok_or_else(|| Failure::file(path, format!("column `{name}` is missing")))?;
    }
    lines
        .map(|(line, number)| {
            let cells: Vec<&str> = line.split(',').map(str::trim).collect();
            let mut row = [0.0; N];
            for ((value, place), name) in row.iter_mut().zip(places).zip(names) {
                let cell = cells.get(place).copied().unwrap_or_default();
                *value = cell.parse().ok().filter(|value: &f64| value.is_finite()).ok_or_else(|| {
                    Failure::file(path, format!("line {number}, column `{name}`: `{cell}` is not a finite number"))
                })?;
            }
            Ok(row)
        })
        .collect()
}
