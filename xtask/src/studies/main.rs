//! The program behind `cargo xtask bench | real-data | study | reproduce`.
//!
//! To add a benchmark problem: a module with `pub fn run(bench: &mut Bench) -> Result<(), Failure>` and a line in [`PROBLEMS`].

mod arguments;
mod bench;
mod calibration;
mod dynamics;
mod ident_sdp;
mod integrator;
mod lie;
mod real_data;
mod throws;

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

const PROBLEMS: &[Problem] =
    &[("lie", lie::run), ("dynamics", dynamics::run), ("integrator", integrator::run), ("ident_sdp", ident_sdp::run)];

fn main() -> ExitCode {
    let words: Vec<String> = std::env::args().skip(1).collect();
    let (name, rest) = words.split_first().map_or(("", &[][..]), |(name, rest)| (name.as_str(), rest));
    let result =
        match name {
            "bench" => Arguments::parse(rest, &["--json"], &["--data", "--only", "--sweeps"])
                .and_then(|arguments| bench::run(&arguments, PROBLEMS)),
            "real-data" => Arguments::parse(rest, &["--json", "--check"], &["--data"])
                .and_then(|arguments| real_data::run(&arguments)),
            "study" => match rest.split_first() {
                Some((study, rest)) if study == "calibration" => Arguments::parse(rest, &[], &["--runs", "--only"])
                    .and_then(|arguments| calibration::run(&arguments)),
                _ => Err(Failure::BadInput("study what? `calibration`".to_owned())),
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
