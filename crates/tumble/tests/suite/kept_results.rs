//! Whatever becomes of names and of standard output meanwhile, no result is lost.
#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic, missing_docs)]

use crate::support::{scratch, stderr};
use std::fs;
use std::path::Path;
use std::process::{Child, Command, Output, Stdio};
use std::time::{Duration, Instant};

/// Commands that work for a while, each with the file by which its folder is known.
const WORK: [(&[&str], &str); 3] = [
    (&["plan", "iss-slalom", "--budget", "20000"], "plan.json"),
    (&["excite", "--starts", "1", "--fly"], "log.csv"),
    (&["identify", "--demo", "--export", "body.toml"], "result.json"),
];

fn begin(folder: &Path, arguments: &[&str], stdout: Stdio) -> Child {
    Command::new(env!("CARGO_BIN_EXE_tumble"))
        .args(arguments)
        .args(["--out", "race"])
        .current_dir(folder)
        .stdout(stdout)
        .stderr(Stdio::piped())
        .spawn()
        .unwrap()
}

/// Creates a folder of this name once the command holds it.
fn take(folder: &Path, child: &Child) {
    let held = folder.join(format!("race.partial-{}", child.id()));
    let began = Instant::now();
    while !held.exists() {
        assert!(began.elapsed() < Duration::from_secs(60), "the name is not held");
        std::thread::sleep(Duration::from_millis(1));
    }
    fs::create_dir(folder.join("race")).unwrap();
    fs::write(folder.join("race/thesis.tex"), "years of work").unwrap();
}

#[test]
fn a_name_that_is_taken_meanwhile_costs_no_result() {
    for (arguments, known_by) in WORK {
        let folder = scratch(&format!("race-{}", arguments[0]));
        let child = begin(&folder, arguments, Stdio::null());
        take(&folder, &child);
        let output: Output = child.wait_with_output().unwrap();
        assert_eq!(output.status.code(), Some(0), "{arguments:?}: {}", stderr(&output));
        assert!(folder.join("race-2").join(known_by).exists(), "{arguments:?}");
        assert!(stderr(&output).contains("race-2"), "{}", stderr(&output));
        assert_eq!(fs::read_to_string(folder.join("race/thesis.tex")).unwrap(), "years of work");
    }
}

#[test]
#[cfg(target_os = "linux")]
fn what_cannot_be_printed_is_written_and_named() {
    for (arguments, known_by) in WORK {
        let folder = scratch(&format!("full-{}", arguments[0]));
        let full = fs::OpenOptions::new().write(true).open("/dev/full").unwrap();
        let output = begin(&folder, arguments, full.into()).wait_with_output().unwrap();
        assert_eq!(output.status.code(), Some(2), "{arguments:?}");
        assert!(folder.join("race").join(known_by).exists(), "{arguments:?}");
        assert!(stderr(&output).contains("wrote race"), "{}", stderr(&output));
        assert_eq!(folder.join("body.toml").exists(), arguments.contains(&"--export"));
    }
}
