//! `cargo xtask fuzz`: the fuzz targets of `fuzz/`, each for a bounded time.

use std::process::{Command, ExitCode, Stdio};

use crate::command::{Outcome, line, root, target_dir};

/// Seconds that each target runs, unless told otherwise.
const SECONDS: u32 = 60;
/// A target that needs more memory than this for an input of its size is a finding.
const MEMORY_MB: u32 = 1024;

pub fn main(arguments: &[String]) -> ExitCode {
    let (mut seconds, mut names) = (SECONDS, Vec::new());
    let mut rest = arguments.iter();
    while let Some(argument) = rest.next() {
        if argument == "--seconds" {
            match rest.next().and_then(|number| number.parse().ok()).filter(|number| *number > 0) {
                Some(number) => seconds = number,
                None => return bad_input("--seconds wants a number of seconds"),
            }
        } else if targets().contains(argument) {
            names.push(argument.clone());
        } else {
            return bad_input(&format!("unknown target `{argument}`; there are {}", targets().join(", ")));
        }
    }
    match run(seconds, &names) {
        Outcome::Ok => ExitCode::SUCCESS,
        Outcome::Skipped(reason) => {
            println!("skipped: {reason}");
            ExitCode::SUCCESS
        }
        Outcome::Failed(reason) => {
            eprintln!("FAILED: {reason}");
            ExitCode::FAILURE
        }
    }
}

fn bad_input(message: &str) -> ExitCode {
    eprintln!("{message}");
    ExitCode::from(2)
}

/// `fuzz/fuzz_targets/*.rs`, by name.
fn targets() -> Vec<String> {
    let files = std::fs::read_dir(root().join("fuzz/fuzz_targets"));
    let mut names: Vec<String> = files
        .into_iter()
        .flatten()
        .flatten()
        .filter_map(|entry| Some(entry.file_name().to_str()?.strip_suffix(".rs")?.to_owned()))
        .collect();
    names.sort();
    names
}

/// Fuzzes the targets named, all if none is, one after the other.
pub fn run(seconds: u32, names: &[String]) -> Outcome {
    let missing = if !works(&mut rustup("rustc --version")) {
        "a nightly compiler: `rustup toolchain install nightly`"
    } else if !works(&mut rustup("cargo fuzz --version")) {
        "cargo-fuzz: `cargo install cargo-fuzz` (it needs a C++ compiler)"
    } else {
        ""
    };
    if !missing.is_empty() {
        let reason = format!("fuzzing needs {missing}");
        let required = std::env::var("TUMBLE_REQUIRE_FUZZ").is_ok_and(|value| value == "1");
        return if required { Outcome::Failed(reason) } else { Outcome::Skipped(reason) };
    }
    let all = targets();
    let mut failed = Vec::new();
    let mut rows = Vec::new();
    for name in if names.is_empty() { &all } else { names } {
        match fuzz(name, seconds) {
            Ok(runs) => rows.push(format!("{name:<20} {runs:>12} {:>12}  nothing found", runs / u64::from(seconds))),
            Err(reason) => {
                rows.push(format!("{name:<20} {:>12} {:>12}  {reason}", "", ""));
                failed.push(name.as_str());
            }
        }
    }
    println!("\n{:<20} {:>12} {:>12}  result", "target", "inputs", "per second");
    for row in rows {
        println!("{row}");
    }
    if failed.is_empty() {
        Outcome::Ok
    } else {
        Outcome::Failed(format!(
            "{}: repeat one with `cargo +nightly fuzz run TARGET fuzz/artifacts/TARGET/FILE`; when it is repaired, put the \
             file into tests/seeds/TARGET of `tumble` or `tumble-planning`, where `cargo test` replays it",
            failed.join(", ")
        ))
    }
}

/// `rustup run nightly <arguments>` at the root of the checkout.
fn rustup(arguments: &str) -> Command {
    let mut command = Command::new("rustup");
    command.current_dir(root()).args(["run", "nightly"]).args(arguments.split_whitespace());
    // what the `cargo` that runs this set for itself
    command.env_remove("CARGO").env_remove("RUSTC").env_remove("RUSTUP_TOOLCHAIN");
    command
}

fn works(command: &mut Command) -> bool {
    command.stdout(Stdio::null()).stderr(Stdio::null()).status().is_ok_and(|status| status.success())
}

/// The folder of a target's seeds, which lie with the tests that replay them.
fn seeds(name: &str) -> String {
    let package = if name == "planning" { "planning" } else { "tumble" };
    format!("crates/{package}/tests/seeds/{name}")
}

/// Runs one target; how many inputs it saw, or what went wrong.
fn fuzz(name: &str, seconds: u32) -> Result<u64, String> {
    let corpus = format!("fuzz/corpus/{name}");
    std::fs::create_dir_all(root().join(&corpus)).map_err(|error| format!("{corpus}: {error}"))?;
    let mut command = rustup("cargo fuzz run --fuzz-dir fuzz --target-dir");
    command.arg(target_dir().join("fuzz")).args([name, &corpus, &seeds(name), "--"]);
    command.args([format!("-max_total_time={seconds}"), format!("-rss_limit_mb={MEMORY_MB}"), "-timeout=10".into()]);
    println!("$ {}", line(&command));
    let output = command.output().map_err(|error| error.to_string())?;
    let said = String::from_utf8_lossy(&output.stderr);
    runs(&said).filter(|_| output.status.success()).ok_or_else(|| {
        eprintln!("{said}");
        "FOUND or not built: see above".into()
    })
}

/// The count in libFuzzer's last line, `Done 123 runs in 4 second(s)`.
fn runs(said: &str) -> Option<u64> {
    said.lines().rev().find_map(|line| line.strip_prefix("Done ")?.split(' ').next()?.parse().ok())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_count_of_runs_is_read() {
        assert_eq!(runs("#12 NEW\nDone 74834 runs in 21 second(s)\n"), Some(74834));
        assert_eq!(runs("==1== ERROR: libFuzzer: out-of-memory\n"), None);
    }

    #[test]
    fn every_target_has_its_program_and_its_seeds() {
        let manifest = std::fs::read_to_string(root().join("fuzz/Cargo.toml")).unwrap();
        let manifest: toml::Table = manifest.parse().unwrap();
        let programs = manifest["bin"].as_array().unwrap().iter().map(|bin| bin["name"].as_str().unwrap().to_owned());
        let mut programs: Vec<String> = programs.collect();
        programs.sort();
        assert_eq!(targets(), programs);
        for name in targets() {
            let seeds = root().join(seeds(&name));
            assert!(seeds.read_dir().is_ok_and(|mut files| files.next().is_some()), "{}", seeds.display());
        }
    }
}
