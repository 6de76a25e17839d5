//! The program behind `cargo xtask bench | real-data | study | reproduce`.
//!
//! To add a benchmark problem: a module with `pub fn run(bench: &mut Bench) -> Result<(), Failure>` and a line in [`PROBLEMS`].

mod actuation;
mod air_table;
mod allocation;
mod arguments;
mod arm_payload;
mod arms;
mod attitude_certificate;
mod attitude_loop;
mod bench;
mod brushless;
mod calibration;
mod change_detection;
mod chapter4;
mod chapter5;
mod core_clock;
mod dynamics;
mod ekf_rls;
mod ellipsoid;
mod ellipsoid_distance;
mod excitation;
mod faults;
mod flight_estimator;
mod flights;
mod fourier;
mod ident_sdp;
mod identification;
mod infoplan;
mod information_bought;
mod integrator;
mod lie;
mod likelihood;
mod local_cases;
mod local_checker;
mod local_plans;
mod local_tasks;
mod measured;
mod model_knowledge;
mod multibody;
mod original_criterion;
mod path_checker;
mod plain_throws;
mod planning;
mod planning_runs;
mod planning_scenes;
mod plot;
mod predicted_sigma;
mod propulsion_dynamics;
#[path = "../../../crates/identification/tests/suite/random.rs"]
mod random;
mod rattle;
mod real_data;
mod real_sensors;
mod recording;
mod rrt;
mod simulator;
mod station_imu;
mod statistical_tests;
mod sweep;
mod targets;
mod throw_terms;
mod throws;
mod thrust_imu;
mod thruster_faults;
mod tube_bench;
#[path = "../../../crates/planning/tests/suite/tube_flights.rs"]
mod tube_flights;
mod tube_missions;
#[path = "../../../crates/planning/tests/suite/tube_plant.rs"]
mod tube_plant;
#[path = "../../../crates/planning/tests/suite/tube_shares.rs"]
mod tube_shares;
mod tube_tables;

use std::process::ExitCode;

use arguments::Arguments;
use bench::Bench;

/// Why a study stopped; its exit code is that of the command-line contract.
#[derive(Debug)]
pub enum Failure {
    /// Exit code 2.
    BadInput(String),
    /// Exit code 3: it ran, and missed what it was asked to reach.
    TargetMissed(String),
}

impl Failure {
    /// Names the file that could not be used.
    pub fn file(path: &std::path::Path, error: impl std::fmt::Display) -> Self {
        Self::BadInput(format!("{}: {error}", path.display()))
    }
}

/// A benchmark problem: its name in `benchmarks/PROBLEMS.md` and the module that runs it.
type Problem = (&'static str, fn(&mut Bench) -> Result<(), Failure>);

const PROBLEMS: &[Problem] = &[
    ("lie", lie::run),
    ("dynamics", dynamics::run),
    ("multibody", multibody::run),
    ("integrator", integrator::run),
    ("ident_sdp", ident_sdp::run),
    ("ekf_rls", ekf_rls::run),
    ("fourier", fourier::run),
    ("likelihood", likelihood::bench),
    ("allocation", allocation::run),
    ("propulsion", propulsion_dynamics::bench),
    ("simulator", simulator::run),
    ("recording", recording::run),
    ("ellipsoid-distance", ellipsoid_distance::run),
    ("sweep", sweep::run),
    ("ellipsoid", ellipsoid::run),
    ("rrt", rrt::run),
    ("infoplan", infoplan::run),
    ("tube", tube_bench::run),
];

/// What a result folder says about the run that wrote it.
fn run_record(command: &str, configuration: &serde_json::Value) -> String {
    let commit = std::process::Command::new("git").args(["rev-parse", "HEAD"]).output().ok();
    let commit =
        commit.filter(|output| output.status.success()).and_then(|output| String::from_utf8(output.stdout).ok());
    let record = serde_json::json!({
        "format": 1,
        "command": command,
        "version": env!("CARGO_PKG_VERSION"),
        "commit": commit.map(|text| text.trim().to_owned()),
        "configuration": configuration,
    });
    format!("{record:#}\n")
}

/// A named program: its name, the options it takes, and the function that runs it.
type Program = (&'static str, &'static [&'static str], fn(&Arguments) -> Result<(), Failure>);

const STUDIES: &[Program] = &[
    ("identification", &["--cells", "--runs", "--out"], identification::run),
    ("arms", &["--runs", "--steps"], arms::run),
    ("change-detection", &["--grasps", "--hours", "--seed"], change_detection::run),
    ("calibration", &["--runs", "--only"], calibration::run),
    ("excitation", &["--cases", "--flights"], excitation::run),
    ("sweep", &["--runs", "--samples", "--seed"], sweep::study),
    ("ellipsoid", &["--runs", "--seed"], ellipsoid::count),
    ("planning", &["--runs", "--reference-units", "--only"], planning::run),
    ("predicted-sigma", &["--runs"], predicted_sigma::run),
    ("local-plans", &["--runs"], local_plans::run),
    ("tube-missions", &["--missions", "--only"], tube_missions::run),
    ("tube-tables", &["--json"], tube_tables::run),
    ("information-bought", &["--json", "--runs", "--out", "--way"], information_bought::run),
    ("flight-estimator", &["--runs", "--only"], flight_estimator::run),
    ("model-knowledge", &["--seeds", "--only"], model_knowledge::run),
    ("faults", &["--missions", "--seeds", "--only", "--sensing"], faults::run),
    ("attitude-certificate", &["--runs"], attitude_certificate::run),
    ("throws", &["--data"], throw_terms::run),
    ("real-sensors", &["--seeds", "--first", "--only"], real_sensors::run),
    ("thruster-faults", &["--seeds", "--first"], thruster_faults::run),
];

const REPRODUCTIONS: &[Program] = &[
    ("chapter4", &["--out", "--runs"], chapter4::run),
    ("chapter5", &["--out", "--runs"], chapter5::run),
    ("actuation", &["--out", "--flights"], actuation::run),
    ("rattle", &["--out", "--seeds", "--sensing", "--only"], rattle::run),
];

/// Runs the program that `words` begin with.
fn run_one(command: &str, programs: &[Program], words: &[String]) -> Result<(), Failure> {
    let (name, rest) = words.split_first().map_or(("", &[][..]), |(name, rest)| (name.as_str(), rest));
    let Some((_, options, run)) = programs.iter().find(|(known, ..)| *known == name) else {
        let known: Vec<String> = programs.iter().map(|(known, ..)| format!("`{known}`")).collect();
        return Err(Failure::BadInput(format!("{command} what? {}", known.join(", "))));
    };
    let (flags, options): (Vec<&str>, Vec<&str>) = options.iter().partition(|option| **option == "--json");
    Arguments::parse(rest, &flags, &options).and_then(|arguments| run(&arguments))
}

fn main() -> ExitCode {
    let words: Vec<String> = std::env::args().skip(1).collect();
    let (name, rest) = words.split_first().map_or(("", &[][..]), |(name, rest)| (name.as_str(), rest));
    let result = match name {
        "bench" => Arguments::parse(rest, &["--json"], &["--data", "--only", "--sweeps", "--runs"])
            .and_then(|arguments| bench::run(&arguments, PROBLEMS)),
        "real-data" => Arguments::parse(rest, &["--json", "--check"], &["--data", "--without"])
            .and_then(|arguments| real_data::run(&arguments)),
        "reproduce" => run_one("reproduce", REPRODUCTIONS, rest),
        "study" => run_one("study", STUDIES, rest),
        unknown => Err(Failure::BadInput(format!("no study is called `{unknown}`"))),
    };
    match result {
        Ok(()) => ExitCode::SUCCESS,
        Err(Failure::BadInput(reason)) => {
            eprintln!("{reason}");
            ExitCode::from(2)
        }
        Err(Failure::TargetMissed(reason)) => {
            eprintln!("{reason}");
            ExitCode::from(3)
        }
    }
}
