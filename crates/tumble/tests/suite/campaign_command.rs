//! `tumble campaign` as a user meets it.
#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic, missing_docs)]

use crate::support::page_checks::findings_of_any;
use crate::support::{scratch, stderr, tumble_in};
use serde_json::Value;
use std::collections::BTreeMap;
use std::fs;
use std::path::Path;
use std::process::Output;

fn succeed(folder: &Path, arguments: &[&str]) -> Output {
    let output = tumble_in(folder, arguments);
    assert_eq!(output.status.code(), Some(0), "{}", stderr(&output));
    output
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
    for name in ["rows.csv", "summary.json", "run.json", "report.html"] {
        let read = |place: &str| fs::read_to_string(folder.join(place).join(name)).unwrap();
        assert_eq!(read("whole"), read("merged"), "{name}");
    }
    let table = fs::read_to_string(folder.join("whole/rows.csv")).unwrap();
    assert_eq!(table.lines().count(), 11);
    assert!(table.lines().nth(2).unwrap().ends_with("--weighting none --feedback on --model scenario --draw"));
    assert!(!folder.join("whole.unfinished").exists());
    assert_eq!(findings_of_any(&fs::read_to_string(folder.join("whole/report.html")).unwrap()), [""; 0]);
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

/// The rows of a finished campaign, by column.
fn rows_of(place: &Path) -> Vec<BTreeMap<String, String>> {
    let mut table = csv::Reader::from_path(place.join("rows.csv")).unwrap();
    table.deserialize().map(Result::unwrap).collect()
}

#[test]
fn layers_are_those_of_the_options_or_else_of_the_scenario() {
    let folder = scratch("layers");
    let whole = String::from_utf8(succeed(&folder, &["scenario", "show", "granite-cargo"]).stdout).unwrap();
    let short = whole.replacen("duration_s = 150.0", "duration_s = 8.0", 1);
    assert!(short.contains("duration_s = 8.0"));
    fs::write(folder.join("usual.toml"), &short).unwrap();
    fs::write(folder.join("named.toml"), format!("{short}\n[fly.layers]\ncontroller = \"lqr\"\n")).unwrap();
    let fly = |scenarios: &[&str], options: &[&str], place: &str| {
        let words = [&["campaign"], scenarios, &["--missions", "1", "--out", place], options].concat();
        let flown = tumble_in(&folder, &words);
        assert_eq!(flown.status.code(), Some(3), "nothing arrives in 8 s: {}", stderr(&flown));
        let record: Value = serde_json::from_slice(&fs::read(folder.join(place).join("run.json")).unwrap()).unwrap();
        (rows_of(&folder.join(place)), record["configuration"]["layers"].clone())
    };
    let (by_scenario, none) = fly(&["usual.toml", "named.toml"], &[], "by-scenario");
    assert_eq!(none, Value::Null);
    let (by_option, named) = fly(&["usual.toml"], &["--controller", "lqr"], "by-option");
    assert_eq!(named, serde_json::json!({ "controller": "lqr" }));
    let (instead, _) = fly(&["named.toml"], &["--controller", "tube"], "instead");
    let of = |row: &BTreeMap<String, String>| {
        assert_eq!(row["status"], "flown", "{}", row["message"]);
        ["impulse_n_s", "rms_tracking_all_m", "min_clearance_m", "mass_estimate"].map(|column| row[column].clone())
    };
    let [usual, lqr] = &by_scenario[..] else { panic!("{} rows", by_scenario.len()) };
    assert_ne!(of(usual), of(lqr), "the scenario's controller is flown");
    assert_eq!(of(&by_option[0]), of(lqr));
    assert_eq!(of(&instead[0]), of(usual), "an option comes before the scenario");
    assert!(by_option[0]["replay"].ends_with(" --controller lqr"), "{}", by_option[0]["replay"]);
    assert!(!lqr["replay"].contains("--controller"), "{}", lqr["replay"]);

    let all = ["--estimator", "two-stage-rls", "--planner", "thesis-rrt", "--local-planner", "along-way"];
    succeed(
        &folder,
        &[&["campaign", "usual.toml", "--dry-run", "--missions", "1", "--out", "plan"], &all[..]].concat(),
    );
    let row = &rows_of(&folder.join("plan"))[0];
    assert!(row["replay"].ends_with(&all.join(" ")), "{}", row["replay"]);
    for option in ["--estimator", "--planner", "--local-planner", "--controller"] {
        let [fly, campaign] = ["fly", "campaign"].map(|command| {
            let output = tumble_in(&folder, &[command, "usual.toml", option, "mien"]);
            assert_eq!(output.status.code(), Some(2));
            stderr(&output).split("\n\n").next().unwrap().to_owned()
        });
        assert!(fly.contains("possible values") && fly == campaign, "{fly}\n{campaign}");
    }
}

/// A table that is a device or a pipe has no end.
#[test]
#[cfg(target_os = "linux")]
fn a_table_without_end_is_refused() {
    let folder = scratch("endless");
    succeed(&folder, &["campaign", "--missions", "2", "--dry-run", "--shard", "0/1", "--out", "parts"]);
    let rows = folder.join("parts/part-0-of-1/rows.csv");
    fs::remove_file(&rows).unwrap();
    std::os::unix::fs::symlink("/dev/zero", &rows).unwrap();
    let merged = tumble_in(&folder, &["campaign", "merge", "parts", "--out", "whole"]);
    assert_eq!(merged.status.code(), Some(2), "{}", stderr(&merged));
    assert!(stderr(&merged).contains("a pipe or a device, where a file is needed"), "{}", stderr(&merged));
}

#[test]
fn the_command_of_a_row_flies_the_same_mission() {
    let folder = scratch("replay");
    // the beginning of a mission shows as much as all of it
    let whole = succeed(&folder, &["scenario", "show", "granite-cargo"]).stdout;
    let short = String::from_utf8(whole).unwrap().replacen("duration_s = 150.0", "duration_s = 20.0", 1);
    assert!(short.contains("duration_s = 20.0"));
    fs::write(folder.join("short.toml"), short).unwrap();
    let options =
        ["--missions", "2", "--shard", "1/2", "--draw", "--outside", "0.2", "--weighting", "fixed", "--out", "run"];
    let flown = tumble_in(&folder, &[&["campaign", "short.toml"], &options[..]].concat());
    assert_eq!(flown.status.code(), Some(3), "nothing arrives in 20 s: {}", stderr(&flown));
    let rows = rows_of(&folder.join("run/part-1-of-2"));
    let [row] = &rows[..] else { panic!("{} rows", rows.len()) };
    assert_eq!((row["row"].as_str(), row["status"].as_str()), ("1", "flown"), "{}", row["message"]);

    let words: Vec<&str> = row["replay"].split(' ').collect();
    assert_eq!((words[0], words[1], words[2]), ("tumble", "fly", "short.toml"));
    assert!(row["replay"].ends_with("--draw --outside 0.2"), "{}", row["replay"]);
    let again = tumble_in(&folder, &[&words[1..], &["--out", "again", "--json"]].concat());
    assert_eq!(again.status.code(), Some(3), "{}", stderr(&again));
    let again: Value = serde_json::from_slice(&again.stdout).unwrap();
    let same = |column: &str, value: &Value| {
        let text = &row[column];
        let is_same = match value {
            Value::Null => text.is_empty(),
            Value::Number(number) => text.parse::<f64>().ok().map(f64::to_bits) == number.as_f64().map(f64::to_bits),
            Value::Bool(flag) => text.parse() == Ok(*flag),
            _ => false,
        };
        assert!(is_same, "{column}: {text} in the row, {value} in the mission");
    };
    for column in ["seed", "arrived", "mission_s", "min_clearance_m", "limit_violations", "replans", "belief_revisions"]
    {
        same(column, &again[column]);
    }
    for column in ["impulse_n_s", "angular_impulse_n_m_s"] {
        assert!(again[column].as_f64().unwrap() > 0.0);
        same(column, &again[column]);
    }
    same("rms_tracking_all_m", &again["rms_tracking_m"]["all"]);
    same("rms_tracking_last_leg_m", &again["rms_tracking_m"]["last_leg"]);
    same("fallbacks", &again["fallbacks"].as_array().unwrap().len().into());
    let parameters = again["parameters"].as_array().unwrap();
    assert_eq!(parameters.len(), 10);
    for parameter in parameters {
        let name = parameter["name"].as_str().unwrap();
        let is_in_plane = ["mass", "com_x", "com_y", "inertia_zz"].contains(&name);
        for what in ["truth", "initial", "estimate", "sigma"] {
            if !is_in_plane {
                same(&format!("{name}_{what}"), &Value::Null);
                continue;
            }
            same(&format!("{name}_{what}"), &parameter[what]);
        }
        same(&format!("{name}_shut_off_s"), &again["information_shut_off_s"][name]);
    }

    // planners speak of the parameters by the names of the summary
    let report = folder.join("again/report.html");
    let page = fs::read_to_string(&report).unwrap();
    let record = tumble::mission_report::record_of(&page, &report).unwrap();
    assert!(!record.stretches.is_empty());
    for stretch in &record.stretches {
        assert_eq!(stretch.quantities, ["mass", "inertia_zz", "com_x", "com_y"]);
    }
    // and what is drawn is not what the scenario says
    let drawn = &words[1..words.len() - 3];
    let plain = tumble_in(&folder, &[drawn, &["--out", "plain", "--json"]].concat());
    let plain: Value = serde_json::from_slice(&plain.stdout).unwrap();
    assert_eq!(plain["seed"], again["seed"]);
    assert!(plain["parameters"][0]["truth"] != again["parameters"][0]["truth"]);
}
