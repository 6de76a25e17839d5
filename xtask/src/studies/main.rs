//! The program behind `cargo xtask bench | real-data | study | reproduce`.
//!
//! To add a benchmark problem: a module with `pub fn run(bench: &mut Bench) -> Result<(), Failure>` and a line in [`PROBLEMS`].

mod actuation;
mod allocation;
mod arguments;
mod bench;
mod brushless;
mod calibration;
mod change_detection;
mod chapter4;
mod chapter5;
mod dynamics;
mod ekf_rls;
mod excitation;
mod flights;
mod fourier;
mod ident_sdp;
mod identification;
mod integrator;
mod lie;
mod likelihood;
mod path_checker;
mod plain_throws;
mod plot;
mod propulsion_dynamics;
mod real_data;
mod recording;
mod rrt;
mod simulator;
mod throws;
mod thrust_imu;

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
    ("integrator", integrator::run),
    ("ident_sdp", ident_sdp::run),
    ("ekf_rls", ekf_rls::run),
    ("fourier", fourier::run),
    ("likelihood", likelihood::bench),
    ("allocation", allocation::run),
    ("propulsion", propulsion_dynamics::bench),
    ("simulator", simulator::run),
    ("recording", recording::run),
    ("rrt", rrt::run),
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

fn main() -> ExitCode {
    let words: Vec<String> = std::env::args().skip(1).collect();
    let (name, rest) = words.split_first().map_or(("", &[][..]), |(name, rest)| (name.as_str(), rest));
    let result =
        match name {
            "bench" => Arguments::parse(rest, &["--json"], &["--data", "--only", "--sweeps", "--runs", "--reference"])
                .and_then(|arguments| bench::run(&arguments, PROBLEMS)),
            "real-data" => Arguments::parse(rest, &["--json", "--check"], &["--data"])
                .and_then(|arguments| real_data::run(&arguments)),
            "reproduce" => {
                match rest.split_first() {
                    Some((what, rest)) if what == "chapter4" => Arguments::parse(rest, &[], &["--out", "--runs"])
                        .and_then(|arguments| chapter4::run(&arguments)),
                    Some((what, rest)) if what == "chapter5" => Arguments::parse(rest, &[], &["--out", "--runs"])
                        .and_then(|arguments| chapter5::run(&arguments)),
                    Some((what, rest)) if what == "actuation" => Arguments::parse(rest, &[], &["--out", "--flights"])
                        .and_then(|arguments| actuation::run(&arguments)),
                    _ => Err(Failure::BadInput("reproduce what? `chapter4`, `chapter5`, `actuation`".to_owned())),
                }
            }
            "study" => match rest.split_first() {
                Some((what, rest)) if what == "identification" => {
                    Arguments::parse(rest, &[], &["--cells", "--runs", "--out"])
                        .and_then(|arguments| identification::run(&arguments))
                }
                Some((what, rest)) if what == "change-detection" => {
                    Arguments::parse(rest, &[], &["--grasps", "--hours", "--seed"])
                        .and_then(|arguments| change_detection::run(&arguments))
                }
                Some((what, rest)) if what == "calibration" => Arguments::parse(rest, &[], &["--runs", "--only"])
                    .and_then(|arguments| calibration::run(&arguments)),
                Some((what, rest)) if what == "excitation" => Arguments::parse(rest, &[], &["--cases", "--flights"])
                    .and_then(|arguments| excitation::run(&arguments)),
                _ => Err(Failure::BadInput(
                    "study what? `identification`, `calibration`, `change-detection`, `excitation`".to_owned(),
                )),
            },
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
