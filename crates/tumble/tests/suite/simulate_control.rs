//! `tumble simulate` with controllers that decide every so often, as a user meets them.
#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic, missing_docs)]

use crate::support::{number, scratch, stderr, tumble_in};
use serde_json::Value;
use std::fs;
use std::path::Path;

fn shown(name: &str) -> String {
    let output = tumble_in(Path::new("."), &["scenario", "show", name]);
    assert_eq!(output.status.code(), Some(0), "{}", stderr(&output));
    String::from_utf8(output.stdout).unwrap()
}

/// Flies a text and gives its summary.
fn flown(folder: &Path, name: &str, text: &str) -> Value {
    let file = format!("{name}.toml");
    fs::write(folder.join(&file), text).unwrap();
    let output = tumble_in(folder, &["simulate", &file, "--out", name, "--json"]);
    assert_eq!(output.status.code(), Some(0), "{name}: {}", stderr(&output));
    serde_json::from_slice(&output.stdout).unwrap()
}

/// The last cells of the first and the last row of a log.
fn ends(folder: &Path, name: &str) -> [Vec<String>; 2] {
    let log = fs::read_to_string(folder.join(name).join("log.csv")).unwrap();
    assert!(log.lines().next().unwrap().ends_with(",plan_revision,belief_revision"));
    let cells = |line: &str| line.rsplit(',').take(2).map(str::to_owned).collect();
    [cells(log.lines().nth(1).unwrap()), cells(log.lines().last().unwrap())]
}

/// The slalom with a payload that the controller learns of on the way: no wall is touched, no limit passed, the tube never left, each
/// belief taken over at the next decision; the log says from when on, and the mass is found in it.
#[test]
fn the_slalom_is_flown_in_the_tube_and_the_mass_is_learned_on_the_way() {
    let folder = scratch("slalom");
    let output = tumble_in(&folder, &["simulate", "tube-slalom", "--out", "flight"]);
    let said = String::from_utf8(output.stdout.clone()).unwrap();
    assert_eq!(output.status.code(), Some(0), "{}", stderr(&output));
    for expected in [
        "leg 1, 0 to 24 s",
        "leg 4, 72 to 80 s",
        "controller                  tube, belief 3, mass ",
        "beliefs                     3 adopted",
        "fallbacks                   none",
        "force limits used",
    ] {
        assert!(said.contains(expected), "{expected}: {said}");
    }
    let summary: Value =
        serde_json::from_str(&fs::read_to_string(folder.join("flight/summary.json")).unwrap()).unwrap();
    let control = &summary["control"];
    assert_eq!((control["controller"].as_str(), control["model_revision"].as_u64()), (Some("tube"), Some(3)));
    assert_eq!((control["fallbacks"].as_array().unwrap().len(), number(&control["fallback_s"]).to_bits()), (0, 0));
    let truth = number(&summary["truth"]["mass_kg"]);
    let interval = [0, 1].map(|end| number(&control["mass_interval_kg"][end]));
    assert!(interval[0] < truth && truth < interval[1] && interval[1] - interval[0] < 0.7, "{interval:?} {truth}");
    for axis in 0..3 {
        assert!(number(&control["largest_force_n"][axis]) <= number(&control["force_limit_n"][axis]));
    }
    assert!(number(&control["largest_torque_n_m"]) <= number(&control["torque_limit_n_m"]));
    for belief in control["beliefs"].as_array().unwrap() {
        assert_eq!(belief["outcome"], "adopted");
        let waited_s = number(&belief["used_from_s"]) - number(&belief["t_s"]);
        assert!((0.0..0.2).contains(&waited_s), "{belief}");
    }
    let legs = summary["tracking"].as_array().unwrap();
    assert_eq!(legs.len(), 4);
    for leg in legs {
        let (rms, worst) = (number(&leg["rms_m"]), number(&leg["worst_m"]));
        assert!(rms > 0.0 && rms <= worst && worst < 0.05 && number(&leg["worst_rad"]) < 0.05, "{leg}");
    }
    assert!(number(&summary["to_goal"]["distance_m"]) < 0.02, "{}", summary["to_goal"]);
    // the first estimate comes with the second period
    assert_eq!(ends(&folder, "flight"), [["0", "1"], ["3", "1"]]);
    for picture in ["tracking.svg", "mass.svg"] {
        assert!(fs::read_to_string(folder.join("flight").join(picture)).unwrap().contains("<svg"), "{picture}");
    }
    // the columns are known to whoever reads the log
    let found = tumble_in(&folder, &["identify", "flight/log.csv", "--json"]);
    let found: Value = serde_json::from_slice(&found.stdout).unwrap_or_else(|_| panic!("{}", stderr(&found)));
    let warnings = found["warnings"].to_string();
    assert!(!warnings.contains("revision"), "{warnings}");
    assert!((number(&found["mass_kg"]) / truth - 1.0).abs() < 0.05, "{found}");
}

/// Station keeping; two beliefs are taken over, one that contradicts them is not, and the controller goes on.
#[test]
fn a_belief_that_contradicts_what_is_certain_is_refused_and_named() {
    let folder = scratch("hold");
    let output = tumble_in(&folder, &["simulate", "tube-hold", "--out", "flight"]);
    let said = String::from_utf8(output.stdout.clone()).unwrap();
    assert_eq!(output.status.code(), Some(0), "{}", stderr(&output));
    assert!(said.contains("3 adopted, 1 contradicts") && said.contains("belief 4 contradicts"), "{said}");
    let summary: Value =
        serde_json::from_str(&fs::read_to_string(folder.join("flight/summary.json")).unwrap()).unwrap();
    let outcomes: Vec<_> =
        summary["control"]["beliefs"].as_array().unwrap().iter().map(|b| b["outcome"].as_str().unwrap()).collect();
    assert_eq!(outcomes, ["adopted", "adopted", "adopted", "contradicts"]);
    assert_eq!(summary["control"]["model_revision"], 3);
    let again = tumble_in(&folder, &["simulate", "tube-hold", "--duration", "1", "--out", "flight", "--force"]);
    assert_eq!(again.status.code(), Some(0), "{}", stderr(&again));
    assert!(number(&summary["tracking"][0]["worst_m"]) < 0.01, "{}", summary["tracking"]);
}

/// The mass lies outside of the interval, and a jump of the localisation takes the robot out of its tube: it says so, with reasons,
/// and comes back.
#[test]
fn leaving_the_tube_is_named_with_its_reason() {
    let folder = scratch("jump");
    let text =
        shown("tube-hold").replace("[sensing.settings.pose]", JUMP).replace("duration_s = 60.0", "duration_s = 45.0");
    let summary = flown(&folder, "jump", &text);
    let fallbacks = summary["control"]["fallbacks"].as_array().unwrap();
    let first = fallbacks.first().expect("the jump was not seen");
    assert_eq!((first["fallback"].as_str(), first["reason"].as_str()), (Some("restarted"), Some("outside-tube")));
    assert!((5.0..5.3).contains(&number(&first["from_s"])) && number(&first["excess"]) > 0.0, "{first}");
    let sum: f64 = fallbacks.iter().map(|spell| number(&spell["until_s"]) - number(&spell["from_s"])).sum();
    assert!((number(&summary["control"]["fallback_s"]) - sum).abs() < 1e-6, "{sum}");
    let last = fallbacks.last().map_or(0.0, |spell| number(&spell["until_s"]));
    assert!(last < 20.0 && number(&summary["tracking"][0]["worst_m"]) < 0.2, "{last}: {}", summary["tracking"]);
}

const JUMP: &str = "[[sensing.settings.faults.jumps]]\nstart_s = 5.0\nduration_s = 2.0\nrecovery_s = 0.0\n\
                    position_m = [0.1, 0.0, 0.0]\n\n[sensing.settings.pose]";

/// A short way, flown by every controller there is: near the goal in the end.
const WAY: &str = "format = 1\nname = \"way\"\nworld = \"iss\"\nduration_s = 30.0\n[start]\npoint = \"A\"\n[goal]\n\
                   position_m = [10.7, -9.4, 4.9]\n[drive]\ncontroller = \"NAME\"\n[[drive.waypoints]]\ntime_s = 20.0\n\
                   position_m = [10.7, -9.4, 4.9]\n[[drive.beliefs]]\ntime_s = 5.0\nmass_kg = 9.6\nsigma_kg = 0.2\n\
                   [propulsion]\nkind = \"exact\"\n[sensing]\npreset = \"perfect\"\n";

#[test]
fn every_controller_flies_the_same_way_and_is_told_the_same() {
    let folder = scratch("every");
    for name in CONTROLLERS {
        let summary = flown(&folder, name, &WAY.replace("NAME", name));
        assert!(number(&summary["to_goal"]["distance_m"]) < 0.02, "{name}: {}", summary["to_goal"]);
        let control = &summary["control"];
        assert_eq!((control["controller"].as_str(), control["model_revision"].as_u64()), (Some(name), Some(2)));
        assert_eq!(control["beliefs"][1]["outcome"], "adopted", "{name}");
        assert_eq!(control["force_limit_n"].is_null(), matches!(name, "tracker" | "flown"));
        // the same flight once more, to the byte
        let again = flown(&folder, &format!("{name}-again"), &WAY.replace("NAME", name));
        assert_eq!(again["tracking"], summary["tracking"]);
        let logs = [name.to_owned(), format!("{name}-again")];
        let [one, other] = logs.map(|log| fs::read(folder.join(log).join("log.csv")).unwrap());
        assert_eq!(one, other, "{name}");
    }
}

const CONTROLLERS: [&str; 6] = ["tracker", "flown", "tube", "lqr", "mpc", "original-tube"];

/// Without new controllers and beliefs a log has the columns that it always had.
#[test]
fn other_flights_have_no_columns_of_revisions() {
    let folder = scratch("columns");
    let text = WAY.replace("NAME", "flown");
    let text = format!("{}{}", text.split("[[drive.beliefs]]").next().unwrap(), "[propulsion]\nkind = \"exact\"\n");
    let summary = flown(&folder, "plain", &text.replace("duration_s = 30.0", "duration_s = 2.0"));
    assert!(summary["control"].is_null() && summary["tracking"].as_array().unwrap().len() == 1, "{summary}");
    let log = fs::read_to_string(folder.join("plain/log.csv")).unwrap();
    assert!(log.lines().next().unwrap().ends_with(",cmd_tau_z"));
    assert!(!folder.join("plain/tracking.svg").exists() && !folder.join("plain/mass.svg").exists());
}

/// What is wrong is said with line, key and the way out, before anything is written, and the exit code is 2.
#[test]
fn what_is_wrong_is_named() {
    let folder = scratch("wrong");
    let control = "[drive.control]\nmass_interval_share = [0.5, 1.5]\nforce_limit_n = [0.3, 0.3, 0.3]\ntorque_limit_n_m = 0.02\n\
                   speed_limit_m_s = 0.1\nwalls = true\nvelocity_error_m_s = 0.0001\n";
    let good = WAY.replace("NAME", "tube").replace("[[drive.waypoints]]", &format!("{control}[[drive.waypoints]]"));
    flown(&folder, "good", &good.replace("duration_s = 30.0", "duration_s = 6.0"));
    for (from, to, expected) in [
        ("\"tube\"", "\"tub\"", "did you mean `tube`?"),
        (
            "\"tube\"",
            "\"pid\"",
            "no controller is called `pid`; known: tube, lqr, mpc, original-tube, tracker, flown, none",
        ),
        ("\"tube\"", "\"original-tub\"", "did you mean `original-tube`?"),
        ("\"tube\"", "\"tracker\"", "`drive.control`: `tracker` takes none"),
        ("\"tube\"", "\"lqr\"", "`drive.control.speed_limit_m_s`: only with `controller = \"tube\"`"),
        ("mass_interval_share", "mass_intervall_share", "did you mean `mass_interval_share`?"),
        ("[0.5, 1.5]", "[-0.5, 1.5]", "`drive.control.mass_interval_share`: -0.5 to 1.5: from above 0"),
        ("[0.5, 1.5]", "[1.5, 0.5]", "1.5 to 0.5"),
        ("[0.5, 1.5]", "[1.1, 1.5]", "with 1, the believed mass, between them"),
        ("[0.5, 1.5]", "[0.0, 1.5]", "from above 0"),
        ("[0.5, 1.5]", "[nan, 1.5]", "NaN to 1.5"),
        ("[0.5, 1.5]", "[0.5, inf]", "at most 1000"),
        ("[0.5, 1.5]", "[0.5]", "invalid length 1"),
        ("[0.3, 0.3, 0.3]", "[0.3, -0.3, 0.3]", "`drive.control.force_limit_n`: -0.3: each between"),
        ("[0.3, 0.3, 0.3]", "[0.3, 0.3, nan]", "`drive.control.force_limit_n`: NaN"),
        ("[0.3, 0.3, 0.3]", "[0.0, 0.3, 0.3]", "`drive.control.force_limit_n`: 0: each"),
        ("[0.3, 0.3, 0.3]", "[1e-6, 0.3, 0.3]", "`drive.control`: "),
        ("m = 0.02", "m = nan", "`drive.control.torque_limit_n_m`: NaN: between"),
        ("m_s = 0.1", "m_s = -0.1", "`drive.control.speed_limit_m_s`: -0.1: between"),
        ("m_s = 0.1\n", "m_s = 0.0001\n", "`drive.control`: "),
        ("m_s = 0.0001", "m_s = 0.5", "`drive.control`: "),
        ("m_s = 0.0001", "m_s = -1.0", "`drive.control.velocity_error_m_s`: -1: between 0e0 and 1e0"),
        ("walls = true", "walls = 1", "expected a boolean"),
        ("[10.7, -9.4, 4.9]\n[[", "[10.7, -9.4, 7.0]\n[[", "`drive.control.walls`: no box of the place holds"),
        ("time_s = 5.0", "time_s = 0.0", "`drive.beliefs.time_s`: 0: times begin after 0"),
        ("time_s = 5.0", "time_s = 1e9", "at most 86400 s"),
        ("time_s = 5.0", "time_s = nan", "`drive.beliefs.time_s`: NaN"),
        ("mass_kg = 9.6", "mass_kg = -9.6", "`drive.beliefs.mass_kg`: -9.6: between"),
        ("mass_kg = 9.6", "mass_kg = inf", "`drive.beliefs.mass_kg`: inf"),
        ("sigma_kg = 0.2", "sigma_kg = -0.2", "`drive.beliefs.sigma_kg`: -0.2: between 0"),
        ("sigma_kg = 0.2", "sigma_kgs = 0.2", "did you mean `sigma_kg`?"),
        ("\nsigma_kg = 0.2", "", "missing field `sigma_kg`"),
        ("world = \"iss\"", "world = \"granite\"", ""),
    ] {
        assert!(good.contains(from), "{from}");
        fs::write(folder.join("bad.toml"), good.replacen(from, to, 1)).unwrap();
        let output = tumble_in(&folder, &["simulate", "bad.toml", "--out", "never"]);
        let said = stderr(&output);
        assert_eq!(output.status.code(), Some(2), "{to}: {said}");
        assert!(said.contains("error[T026]: bad.toml, line ") && said.contains(expected), "{to}: {said}");
        assert!(!folder.join("never").exists(), "{to}");
    }
    // not in the plane, and nobody to tell
    let on_table = "format = 1\nname = \"t\"\nworld = \"granite\"\nduration_s = 2\n[start]\npoint = \"A\"\n[drive]\n";
    for (drive, expected) in [
        ("controller = \"tube\"\n", "`drive.controller`: `tube` flies in three dimensions"),
        (
            "controller = \"none\"\n[[drive.beliefs]]\ntime_s = 1\nmass_kg = 1\nsigma_kg = 1\n",
            "`drive.beliefs`: beliefs need a controller",
        ),
    ] {
        fs::write(folder.join("bad.toml"), format!("{on_table}{drive}")).unwrap();
        let output = tumble_in(&folder, &["simulate", "bad.toml", "--out", "never"]);
        assert_eq!(output.status.code(), Some(2));
        assert!(stderr(&output).contains(expected), "{}", stderr(&output));
    }
    let open = good.replace("\"iss\"", "\"open\"").replace("point = \"A\"", "position_m = [10.8, -9.6, 4.8]");
    fs::write(folder.join("bad.toml"), open).unwrap();
    let output = tumble_in(&folder, &["simulate", "bad.toml", "--out", "never"]);
    assert!(stderr(&output).contains("`drive.control.walls`: the world `open` has no walls"), "{}", stderr(&output));
}
