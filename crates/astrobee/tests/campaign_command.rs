//! `tumble campaign` as a user meets it.
#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic, missing_docs)]

use serde_json::Value;
use std::fs;
use std::path::{Path, PathBuf};
use std::process::{Command, Output};

fn tumble_in(folder: &Path, arguments: &[&str]) -> Output {
    Command::new(env!("CARGO_BIN_EXE_tumble")).args(arguments).current_dir(folder).output().unwrap()
}

fn stderr(output: &Output) -> String {
    String::from_utf8(output.stderr.clone()).unwrap()
}

fn succeed(folder: &Path, arguments: &[&str]) -> Output {
    let output = tumble_in(folder, arguments);
    assert_eq!(output.status.code(), Some(0), "{}", stderr(&output));
    output
}

fn scratch(name: &str) -> PathBuf {
    let path = std::env::temp_dir().join(format!("tumble-campaigns-{name}-{}", std::process::id()));
    let _ = fs::remove_dir_all(&path);
    fs::create_dir_all(&path).unwrap();
    path
}

const PLANNED: [&str; 8] =
    ["campaign", "iss-slalom", "--dry-run", "--missions", "5", "--weighting", "covariance,none", "--draw"];

#[test]
fn a_plan_of_parts_is_the_plan_of_the_whole() {
    let folder = scratch("plan");
    let whole = succeed(&folder, &[&PLANNED[..], &["--out", "whole", "--json"]].concat());
    let summary: Value = serde_json::from_slice(&whole.stdout).unwrap();
    assert_eq!((&summary["all"]["missions"], &summary["all"]["flown"]), (&10.into(), &0.into()));
    for shard in ["2/3", "0/3", "1/3"] {
        succeed(&folder, &[&PLANNED[..], &["--out", "parts", "--shard", shard, "--jobs", "3"]].concat());
    }
    // a task that is started again finds its part complete
    let again = succeed(&folder, &[&PLANNED[..], &["--out", "parts", "--shard", "1/3"]].concat());
    assert!(stderr(&again).contains("complete already"));
    succeed(&folder, &["campaign", "merge", "parts", "--out", "merged"]);
    for name in ["rows.csv", "summary.json", "run.json"] {
        let read = |place: &str| fs::read_to_string(folder.join(place).join(name)).unwrap();
        assert_eq!(read("whole"), read("merged"), "{name}");
    }
    let table = fs::read_to_string(folder.join("whole/rows.csv")).unwrap();
    assert_eq!(table.lines().count(), 11);
    assert!(table.lines().nth(2).unwrap().ends_with("--weighting none --feedback on --model scenario --draw"));
    assert!(!folder.join("whole.unfinished").exists());
}

#[test]
fn the_default_place_goes_on_with_what_was_begun() {
    let folder = scratch("default-place");
    succeed(&folder, &PLANNED);
    let place = folder.join("tumble-out/campaign-iss-slalom-1");
    assert!(place.join("rows.csv").exists());
    // as a killed run would have left it: begun, and torn in the second row
    let other = [&PLANNED[..], &["--seed", "2"]].concat();
    succeed(&folder, &[&other[..], &["--out", "begun"]].concat());
    let rows = fs::read(folder.join("begun/rows.csv")).unwrap();
    let record: Value = serde_json::from_slice(&fs::read(folder.join("begun/run.json")).unwrap()).unwrap();
    let unfinished = folder.join("tumble-out/campaign-iss-slalom-2.unfinished");
    fs::create_dir(&unfinished).unwrap();
    let begun = serde_json::json!({ "configuration": record["configuration"], "shard": record["shard"] });
    fs::write(unfinished.join("campaign.json"), begun.to_string()).unwrap();
    let line = std::str::from_utf8(&rows).unwrap().lines().nth(1).unwrap();
    let journal = format!("header\n{line},{:08x}\n1,0,", crc32fast::hash(line.as_bytes()));
    fs::write(unfinished.join("journal.csv"), journal).unwrap();
    let resumed = succeed(&folder, &other);
    assert!(stderr(&resumed).contains("going on: 1 of 10"), "{}", stderr(&resumed));
    let written = folder.join("tumble-out/campaign-iss-slalom-2");
    assert!(fs::read(written.join("rows.csv")).unwrap() == rows && !unfinished.exists());
    // other options never go on with it, and a finished campaign is kept
    succeed(&folder, &other);
    assert!(folder.join("tumble-out/campaign-iss-slalom-2-2/rows.csv").exists());
}

#[test]
fn bad_campaigns_are_refused_before_anything_is_written() {
    let folder = scratch("bad");
    let cases: [(&[&str], &str); 9] = [
        (&["--missions", "0"], "at least one"),
        (&["--weighting", "none,none"], "stands twice"),
        (&["--weighting", "most"], "invalid value"),
        (&["--fault", "drop:4"], "severity"),
        (&["--shard", "3/3", "--out", "x"], "INDEX/COUNT"),
        (&["--shard", "0/3"], "--out"),
        (&["--outside", "0.1"], "--draw"),
        (&["--draw", "--outside", "0.4"], "0 to 0.3"),
        (&["nowhere"], "no scenario"),
    ];
    for (options, said) in cases {
        let output = tumble_in(&folder, &[&["campaign", "iss-slalom", "--dry-run"], options].concat());
        assert_eq!(output.status.code(), Some(2), "{options:?}");
        assert!(stderr(&output).contains(said), "{options:?}: {}", stderr(&output));
    }
    assert_eq!(fs::read_dir(&folder).unwrap().count(), 0);
    let output = tumble_in(&folder, &["campaign", "merge", "nowhere", "--out", "x"]);
    assert_eq!(output.status.code(), Some(2));
    assert!(stderr(&output).contains("T001"), "{}", stderr(&output));
}

#[test]
fn a_mission_that_cannot_be_flown_is_a_row_with_its_error() {
    // a scenario without a goal is no mission
    let folder = scratch("error");
    let output = tumble_in(&folder, &["campaign", "open-tumble", "--missions", "2", "--out", "run"]);
    assert_eq!(output.status.code(), Some(3), "{}", stderr(&output));
    let table = fs::read_to_string(folder.join("run/rows.csv")).unwrap();
    assert_eq!(table.lines().filter(|line| line.contains(",error,")).count(), 2, "{table}");
    let summary: Value = serde_json::from_slice(&fs::read(folder.join("run/summary.json")).unwrap()).unwrap();
    assert_eq!((&summary["all"]["errors"], &summary["all"]["arrived"]["count"]), (&2.into(), &0.into()));
}
