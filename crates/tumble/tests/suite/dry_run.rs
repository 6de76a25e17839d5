//! `identify --dry-run`: what is promised of a log, with the options that identify it, is what is stated of it later, and true.

use crate::support::{json, scratch, stderr, tumble_in};
use serde_json::Value;
use std::path::Path;

/// A flight, the options that it is flown with, and those that it is identified with.
const FLIGHTS: [(&str, &str, &str); 6] = [
    ("iss-excite", "", ""),
    ("iss-excite", "--sensing thesis-flight", "--sensing thesis-flight"),
    ("iss-payload", "", ""),
    ("iss-payload", "", "--actuators FLIGHT/actuators.toml"),
    ("granite-excite", "", "--planar"),
    ("granite-cargo", "", "--planar --actuators FLIGHT/actuators.toml"),
];

fn words(options: &str, flight: &str) -> Vec<String> {
    options.split_whitespace().map(|word| word.replace("FLIGHT", flight)).collect()
}

fn run(folder: &Path, arguments: &[&str], more: &[String]) -> std::process::Output {
    let all: Vec<&str> = arguments.iter().copied().chain(more.iter().map(String::as_str)).collect();
    tumble_in(folder, &all)
}

/// All numbers of a tree that are not `null`.
fn numbers(value: &Value) -> Vec<f64> {
    match value {
        Value::Array(values) => values.iter().flat_map(numbers).collect(),
        Value::Object(values) => values.values().flat_map(numbers).collect(),
        other => other.as_f64().into_iter().collect(),
    }
}

#[test]
fn what_is_promised_with_the_options_of_identify_is_stated_later_and_true() {
    let folder = scratch("promised");
    for (index, (scenario, flown, told)) in FLIGHTS.into_iter().enumerate() {
        let (flight, seed) = (format!("{index}"), format!("{}", 300 + index));
        let output = run(&folder, &["simulate", scenario, "--seed", &seed, "--out", &flight], &words(flown, &flight));
        assert_eq!(output.status.code(), Some(0), "{}", stderr(&output));
        let (log, truth) = (format!("{flight}/log.csv"), format!("{flight}/truth.toml"));
        let told = words(told, &flight);
        let output = run(&folder, &["identify", &log, "--dry-run", "--json"], &told);
        assert_eq!(output.status.code(), Some(0), "{scenario} {told:?}: {}", stderr(&output));
        let promised = json(&output);
        let stated = json(&run(&folder, &["identify", &log, "--reference", &truth, "--json"], &told));
        assert_eq!(promised["std"], stated["std"], "{scenario} {told:?}");
        assert!(promised.get("mass_kg").is_none() && numbers(&promised["std"]).len() >= 4, "{promised}");
        let errors = numbers(&stated["reference"]["error_over_sigma"]);
        println!("{scenario} {told:?}: {errors:.1?}");
        assert!(errors.iter().all(|z| z.abs() < 4.0), "{scenario} {told:?}: {errors:?}");
    }
}

/// Before anything is flown: the same as of the log that `simulate` writes with these sensors and this seed, also of a scenario of one's own.
#[test]
fn a_scenario_is_promised_what_its_log_states() {
    let folder = scratch("unflown");
    let shown = tumble_in(&folder, &["scenario", "show", "granite-excite"]);
    std::fs::write(folder.join("mine.toml"), shown.stdout).unwrap();
    for (scenario, options) in [("iss-excite", "--sensing bumble --seed 41"), ("mine.toml", "")] {
        let told = words(options, "");
        let promised = run(&folder, &["identify", scenario, "--dry-run", "--json"], &told);
        assert_eq!(promised.status.code(), Some(0), "{}", stderr(&promised));
        let output = run(&folder, &["simulate", scenario, "--out", "flown", "--force"], &told);
        assert_eq!(output.status.code(), Some(0), "{}", stderr(&output));
        let sensing = told.get(..2).unwrap_or_default();
        let of_log = run(&folder, &["identify", "flown/log.csv", "--dry-run", "--json"], sensing);
        assert_eq!(promised.stdout, of_log.stdout, "{scenario}");
    }
    // Nothing of it stays behind, and only a promise is made of what nobody flew.
    let left = std::fs::read_dir(&folder).unwrap().count();
    assert_eq!(left, 2);
    let output = tumble_in(&folder, &["identify", "iss-excite"]);
    assert!(stderr(&output).contains("error[T001]"), "{}", stderr(&output));
    for refused in [
        ["identify", "iss-excite", "--seed", "41"].as_slice(),
        &["identify", "flown/log.csv", "--dry-run", "--seed", "41"],
        &["identify", "flown/log.csv", "--dry-run", "--wrench-noise", "1e-3,1e-3", "--sensing", "nominal"],
    ] {
        let output = tumble_in(&folder, refused);
        assert!(stderr(&output).contains("error[T014]"), "{refused:?}: {}", stderr(&output));
    }
}
