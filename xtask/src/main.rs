//! Automation of the Tumble workspace: `cargo xtask <command>`.

mod ci;
mod cluster;
mod command;
mod fuzz;
mod mutants;
mod packages;
mod python;
mod report_check;
mod tidy;

use std::process::ExitCode;

const USAGE: &str = "\
cargo xtask <command>

  ci [--full] [--only NAME]... [--list]   every check beyond `cargo test --workspace`
  tidy                                    the rules a machine can hold
  freeze                                  the hashes that the step `determinism` wants, from an optimised build
  mutants [--only TEXT] [--list]          planted source changes; the tests must kill every one
  fuzz [--seconds N] [TARGET]...           the parsers, on bytes that a fuzzer makes up (cargo-fuzz, nightly compiler)
  report-check [FILE...] [--screenshots DIR] pages of results (of every kind where none is named) in a real headless browser, cut off from every network
  cluster-test                            a campaign in sixteen parts, one killed; in Slurm too where that is installed
  python                                  the Python module: its wheel, its tests, its import and its speed beside the command line
  bench [--json] [--only TEXT] [--data DIR] [--sweeps N]
                                          speed on the frozen peer problems (target-cpu=native)
  real-data [--data DIR] [--without SET] [--json] [--check]
  reproduce chapter4 | chapter5 [--runs N] [--out DIR]
  reproduce actuation [--flights N] [--out DIR]
  reproduce rattle [--seeds N] [--sensing NAME] [--only module | granite | flights | defects] [--out DIR]
  study identification [--cells NAME] [--runs N] [--out DIR]
  study excitation [--cases N] [--flights N]
  study ellipsoid [--runs N] [--seed N]   pairs misclassified, by decade of their true gap
  study sweep [--runs N] [--samples N] [--seed N]
                                          first contacts of random motions, judged by dense sampling
  study planning [--runs SEEDS] [--reference-units N] [--only SCENE]   the claims on the planner
  study local-plans [--runs N]            the claims on the information-aware planner, times aside
  study predicted-sigma [--runs N]        predicted standard deviations against those found in estimates
  study information-bought [--way diagonal | side] [--runs N] [--out DIR] [--json]
                                          what information costs, by our criterion and by the thesis's planner's
  study tube-missions [--missions N] [--only SERIES]   the claims on the tube controller in closed loop
  study real-sensors [--seeds N] [--first SEED] [--only SCENARIO]   identification from what sensors show, other robots' drawn
  study thruster-faults [--seeds N] [--first SEED]   dead, weak and stuck thrusters, named or not
  study tube-tables [--json]              what is left of the input, by how well the mass is known

Exit 0: done. 1: a check failed. 2: bad input. 3: a target was missed.
";

fn main() -> ExitCode {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let Some((name, rest)) = arguments.split_first() else {
        print!("{USAGE}");
        return ExitCode::from(2);
    };
    match name.as_str() {
        "ci" => ci::main(rest),
        "tidy" => tidy::main(),
        "freeze" => ci::freeze(),
        "mutants" => mutants::main(rest),
        "cluster-test" => cluster::main(rest),
        "fuzz" => fuzz::main(rest),
        "python" => python::main(),
        "report-check" => report_check::main(rest),
        "bench" | "real-data" | "study" | "reproduce" => {
            let mut studies = command::studies(name);
            studies.args(&arguments);
            command::forward(studies)
        }
        "help" | "--help" | "-h" => {
            print!("{USAGE}");
            ExitCode::SUCCESS
        }
        unknown => {
            eprintln!("unknown command `{unknown}`\n\n{USAGE}");
            ExitCode::from(2)
        }
    }
}
