//! `tumble fly` and `tumble replay`, as a user meets them.
#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic, missing_docs)]

use crate::support::{number, scratch, stderr, tumble_in};
use serde_json::Value;
use std::fs;
use std::path::Path;

fn json(path: &Path) -> Value {
    serde_json::from_str(&fs::read_to_string(path).unwrap()).unwrap()
}

/// The whole of what the README promises of its first command: it arrives, has learned its body, and writes everything down.
#[test]
fn the_default_mission_arrives_and_everything_it_writes_agrees() {
    let folder = scratch("default");
    let output = tumble_in(&folder, &["fly"]);
    let said = String::from_utf8(output.stdout.clone()).unwrap();
    assert_eq!(output.status.code(), Some(0), "{said}{}", stderr(&output));
    for expected in
        ["arrived                   yes", "least clearance", "inertia_zz", "global plan", "estimator update"]
    {
        assert!(said.contains(expected), "{expected}: {said}");
    }
    let place = folder.join("tumble-out/fly-iss-cargo-1");
    let mut files: Vec<_> =
        fs::read_dir(&place).unwrap().map(|entry| entry.unwrap().file_name().into_string().unwrap()).collect();
    files.sort();
    let written = [
        "actuators.toml",
        "log.csv",
        "log.mcap",
        "mass.svg",
        "path_xy.svg",
        "report.html",
        "run.json",
        "scenario.toml",
        "summary.json",
        "timings.json",
        "truth.toml",
    ];
    assert_eq!(files, written);

    let summary = json(&place.join("summary.json"));
    assert!(summary["arrived"] == true && summary["limit_violations"] == 0);
    assert!(number(&summary["min_clearance_m"]) > 0.0 && number(&summary["belief_revisions"]) > 10.0);
    let parameters = summary["parameters"].as_array().unwrap();
    assert_eq!(parameters.len(), 10);
    for row in parameters {
        let of = |key: &str| number(&row[key]);
        let off = (of("estimate") - of("truth")).abs() / of("sigma");
        assert!(off < 4.0, "{row}");
    }
    let [truth, first, last] = ["truth", "initial", "estimate"].map(|key| number(&parameters[0][key]));
    assert!((last - truth).abs() < 0.05 * truth && (first - truth).abs() > 0.2 * truth);

    // what the log tells afterwards is what the robot said on the way, within two standard deviations of both
    let report = tumble_in(&place, &["identify", "log.csv", "--reference", "truth.toml", "--json"]);
    assert_eq!(report.status.code(), Some(0), "{}", stderr(&report));
    let found: Value = serde_json::from_slice(&report.stdout).unwrap();
    let flown = &found["reference"]["body"];
    assert!((number(&flown["mass_kg"]) - truth).abs() < 1e-12 * truth, "{flown}");
    let errors = found["reference"]["error_over_sigma"].as_array().unwrap();
    assert!(errors.len() == 10 && errors.iter().all(|error| number(error).abs() < 4.0), "{errors:?}");
    let mass_sigma = number(&found["std"]["mass_kg"]).hypot(number(&parameters[0]["sigma"]));
    assert!((number(&found["mass_kg"]) - last).abs() < 2.0 * mass_sigma);
    for axis in 0..3 {
        let row = &parameters[1 + axis];
        let sigma = number(&found["std"]["com_m"][axis]).hypot(number(&row["sigma"]));
        assert!((number(&found["com_m"][axis]) - number(&row["estimate"])).abs() < 2.0 * sigma, "{row}");
    }

    // the columns of the robot's own estimate end where the summary does
    let log = fs::read_to_string(place.join("log.csv")).unwrap();
    let column = log.lines().next().unwrap().split(',').position(|name| name == "est_m").unwrap();
    let cell: f64 = log.lines().last().unwrap().split(',').nth(column).unwrap().parse().unwrap();
    assert!((cell - last).abs() < 0.5 * number(&parameters[0]["sigma"]), "{cell} {last}");

    // the report holds the mission: flown again it is the same, to the last digit
    let replayed = tumble_in(&folder, &["replay", place.join("report.html").to_str().unwrap()]);
    let said = String::from_utf8(replayed.stdout.clone()).unwrap();
    assert_eq!(replayed.status.code(), Some(0), "{said}{}", stderr(&replayed));
    assert!(said.contains("the same, to the last digit"));
    let changed = fs::read_to_string(place.join("report.html")).unwrap();
    let changed = changed.replacen("\"replans\":", "\"replans\":1", 1);
    fs::write(folder.join("changed.html"), changed).unwrap();
    assert_eq!(tumble_in(&folder, &["replay", "changed.html"]).status.code(), Some(3));
    let page = fs::read_to_string(place.join("report.html")).unwrap();
    let reaching = page.replace("[payload]\\n", "[payload]\\nfile = \\\"/etc/passwd\\\"\\n");
    assert_ne!(reaching, page);
    fs::write(folder.join("reaching.html"), reaching).unwrap();
    let refused = tumble_in(&folder, &["replay", "reaching.html"]);
    assert_eq!(refused.status.code(), Some(2));
    assert!(
        stderr(&refused).contains("error[T036]") && stderr(&refused).contains("/etc/passwd"),
        "{}",
        stderr(&refused)
    );
}

/// On the table, by JSON: one object and nothing else, the options written down.
#[test]
fn a_mission_on_the_table_answers_in_one_object() {
    let folder = scratch("table");
    let arguments = ["fly", "granite-cargo", "--seed", "5", "--weighting", "none", "--feedback", "off", "--json"];
    let output = tumble_in(&folder, &arguments);
    let summary: Value = serde_json::from_slice(&output.stdout).unwrap();
    let achieved = summary["arrived"] == true && summary["limit_violations"] == 0;
    assert_eq!(output.status.code(), Some(if achieved { 0 } else { 3 }), "{}", stderr(&output));
    assert_eq!(summary["options"]["weighting"], "none");
    assert_eq!(summary["options"]["layers"], Value::Null, "none was asked for");
    let usual = serde_json::json!({
        "estimator": "joint", "planner": "flight", "local_planner": "informative", "controller": "tube"
    });
    assert_eq!(summary["layers"], usual);
    assert_eq!((&summary["options"]["feedback"], &summary["belief_revisions"]), (&Value::from(false), &Value::from(0)));
    assert!(number(&summary["min_clearance_m"]) > 0.0);
    let run = json(&folder.join("tumble-out/fly-granite-cargo-5/run.json"));
    assert_eq!((&run["command"], &run["seed"]), (&Value::from("fly"), &Value::from(5)));
}

/// Thrusters that are off by a per cent make torques a tenth as large as those of a mission in a straight line, and a controller answers what the
/// body does under them: taken for white noise they drew moments of inertia five standard deviations off, or the search never came to rest.
#[test]
fn missions_whose_thrusts_are_off_are_identified() {
    let folder = scratch("thrusts-off");
    for (weighting, seeds) in [("covariance", ["7306", "7307", "7308"]), ("none", ["7307", "7310", "7311"])] {
        for seed in seeds {
            let flight = ["fly", "iss-cargo", "--weighting", weighting, "--seed", seed, "--out", "flight", "--force"];
            let output = tumble_in(&folder, &flight);
            assert_eq!(output.status.code(), Some(0), "{}", stderr(&output));
            let output =
                tumble_in(&folder, &["identify", "flight/log.csv", "--reference", "flight/truth.toml", "--json"]);
            assert_eq!(output.status.code(), Some(0), "{}", stderr(&output));
            let found: Value = serde_json::from_slice(&output.stdout).unwrap();
            let errors = found["reference"]["error_over_sigma"].as_array().unwrap();
            assert!(errors.iter().all(|error| number(error).abs() < 3.0), "{weighting} {seed}: {errors:?}");
            assert!(number(&found["std"]["mass_kg"]) < 0.04 * number(&found["mass_kg"]), "{found}");
        }
    }
}

/// Every refusal names the place and the remedy, and leaves nothing behind.
#[test]
fn what_cannot_be_flown_is_refused() {
    let folder = scratch("refused");
    let refused = |arguments: &[&str], expected: &str| {
        let output = tumble_in(&folder, arguments);
        let said = stderr(&output);
        assert_eq!(output.status.code(), Some(2), "{arguments:?}: {said}");
        assert!(said.contains(expected), "{arguments:?}: {said}");
    };
    refused(&["fly", "iss-carg"], "iss-cargo");
    refused(&["fly", "--fault", "gremlin"], "gremlin");
    refused(&["fly", "--fault", "drop:9"], "severity");
    refused(&["fly", "--weighting", "much"], "covariance");
    fs::write(folder.join("no.html"), "<p>nothing here").unwrap();
    refused(&["replay", "no.html"], "remedy");
    refused(&["replay", "absent.html"], "absent.html");
    fs::create_dir(folder.join("there")).unwrap();
    fs::write(folder.join("there/mine.txt"), "mine").unwrap();
    refused(&["fly", "--out", "there"], "there");
    assert_eq!(fs::read_to_string(folder.join("there/mine.txt")).unwrap(), "mine");
    assert!(!folder.join("tumble-out").exists());
}

/// A mission on the table without its obstacles, towards a point half a metre away, and something of a radius of 0.1 m in it.
fn among(goal: &str, obstacle: &str) -> String {
    format!(
        "format = 1\nname = \"tight\"\nworld = \"granite\"\nobstacle_set = 3\nduration_s = 70.0\nflight_mode = \"difficult\"\n[payload]\n\
         mass_kg = 6.0\ninertia_about_com_kg_m2 = [[0.03, 0.0, 0.0], [0.0, 0.03, 0.0], [0.0, 0.0, 0.02]]\n\
         grasp_position_m = [0.1, -0.1, 0.0]\nattach_s = 0.0\n[start]\npoint = \"A\"\n[goal]\nposition_m = [{goal}, -0.76]\n\
         quaternion_xyzw = [0.0, 0.0, 0.0, 1.0]\n[drive]\n[propulsion]\nkind = \"plant\"\nthrust_sigma = 0.01\ndrag = true\n[plan]\n\
         speed_limit_m_s = [0.05, 0.05, 0.05]\nmargin_m = 0.03\n[fly]\nunknowns = \"planar-com\"\nmass_interval_share = [0.5, 2.0]\n\
         [[obstacles]]\ncenter_m = [{obstacle}, -0.7]\nsemi_axes_m = [0.1, 0.1, 0.3]\n"
    )
}

#[test]
fn a_robot_that_stands_nearer_than_it_may_come_leaves() {
    let folder = scratch("tight");
    // Its sphere begins 32 mm from the obstacle, where 70 mm are kept under way.
    fs::write(folder.join("tight.toml"), among("-0.3, 0.3", "0.0, 0.88")).unwrap();
    let output = tumble_in(&folder, &["fly", "tight.toml", "--out", "flown", "--json"]);
    assert_eq!(output.status.code(), Some(0), "{}", stderr(&output));
    let clearance_m = number(&json(&folder.join("flown/summary.json"))["min_clearance_m"]);
    assert!((0.015..0.05).contains(&clearance_m), "{clearance_m}");
}

#[test]
fn a_goal_that_is_taken_is_told_in_a_sentence() {
    let folder = scratch("taken");
    fs::write(folder.join("taken.toml"), among("-0.3, 0.3", "-0.3, 0.3")).unwrap();
    let output = tumble_in(&folder, &["fly", "taken.toml", "--out", "flown"]);
    assert_eq!(output.status.code(), Some(3), "{}", stderr(&output));
    let said = stderr(&output);
    assert!(said.contains("no way leads to the goal: the goal is -0.") && said.contains("m from obstacle 0"), "{said}");
    let page = fs::read_to_string(folder.join("flown/report.html")).unwrap();
    assert!(page.contains("found after 0.0 s that no way leads to the goal") && !page.contains("GoalBlocked"));
}
