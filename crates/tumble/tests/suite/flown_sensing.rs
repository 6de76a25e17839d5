//! `--sensing` of the commands that fly.

use crate::support::{json, number, scratch, stderr, tumble_in};
use serde_json::Value;
use std::fs;
use std::path::Path;

fn succeed(folder: &Path, arguments: &[&str]) -> Value {
    let output = tumble_in(folder, arguments);
    assert_eq!(output.status.code(), Some(0), "{}", stderr(&output));
    json(&output)
}

fn printed(folder: &Path, arguments: &[&str]) -> String {
    String::from_utf8(tumble_in(folder, arguments).stdout).unwrap()
}

#[test]
fn a_named_sensing_is_that_of_the_scenario_to_the_byte() {
    let folder = scratch("sensing-name");
    let own = printed(&folder, &["scenario", "show", "iss-excite"]);
    for name in ["nominal", "thesis-flight", "bumble", "perfect"] {
        let text = format!("{}[sensing]\npreset = \"{name}\"\n", own.split("[sensing").next().unwrap());
        fs::write(folder.join("own.toml"), text).unwrap();
        let flown = ["--duration", "3", "--force", "--json", "--out"];
        succeed(&folder, &[&["simulate", "own.toml"], &flown[..], &["own"]].concat());
        succeed(&folder, &[&["simulate", "iss-excite", "--sensing", name], &flown[..], &["named"]].concat());
        for file in ["log.csv", "scenario.toml", "summary.json", "truth.toml", "position.svg"] {
            let [own, named] = ["own", "named"].map(|place| fs::read(folder.join(place).join(file)).unwrap());
            assert!(own == named, "{name}: {file}");
        }
    }
}

#[test]
fn a_file_is_flown_as_it_stands() {
    let folder = scratch("sensing-file");
    let shown = printed(&folder, &["sensing", "show", "nominal"]);
    fs::write(folder.join("shown.toml"), &shown).unwrap();
    let fly = |file: &str, out: &str| {
        let words = ["simulate", "iss-excite", "--duration", "40", "--sensing", file, "--out", out, "--json"];
        succeed(&folder, &words);
        let log = format!("{out}/log.csv");
        succeed(&folder, &["sensing", "check", &log, "--json"])
    };
    fly("shown.toml", "shown");
    // what was flown stands in full in the copy, which flies again to the byte
    succeed(&folder, &["simulate", "shown/scenario.toml", "--out", "again", "--json"]);
    let [first, again] = ["shown", "again"].map(|place| fs::read(folder.join(place).join("log.csv")).unwrap());
    assert!(first == again);

    let poses = "[pose_delay]\nexpected_s = 0.08\n[position]\nwhite = { known = 0.004 }\nwander = { known = { sigma = 0.0, time_s = 1.0 } }\n\
        [attitude]\nwhite = { known = 0.002 }\nwander = { known = { sigma = 0.0, time_s = 1.0 } }\n";
    fs::write(folder.join("poses.toml"), format!("format = 1\n{poses}")).unwrap();
    let found = fly("poses.toml", "poses");
    let white = number(&found["pose"]["position_white_m"]);
    assert!((white / 0.004 - 1.0).abs() < 0.1, "{found}");
    assert!((number(&found["pose"]["attitude_white_rad"]) / 0.002 - 1.0).abs() < 0.1, "{found}");
    let pose = found["streams"].as_array().unwrap().iter().find(|stream| stream["name"] == "pose").unwrap();
    assert!((number(&pose["offset_s"]) - 0.08).abs() < 0.01, "{pose}");
}

#[test]
fn a_sensing_that_cannot_be_flown_names_file_key_and_remedy() {
    let folder = scratch("sensing-bad");
    let bad = |name: &str, text: &str, expected: &[&str]| {
        fs::write(folder.join(name), text).unwrap();
        for command in ["simulate", "fly", "campaign"] {
            let output = tumble_in(&folder, &[command, "iss-slalom", "--sensing", name]);
            let said = stderr(&output);
            assert_eq!(output.status.code(), Some(2), "{said}");
            assert!(expected.iter().all(|word| said.contains(word)), "{command}: {said}");
        }
    };
    let late = "format = 1\n[velocity_delay]\nexpected_s = 0.3\n";
    bad(
        "late.toml",
        late,
        &["T025", "late.toml", "`velocity_delay.expected_s`", "`pose_delay.expected_s`", "sensing.md"],
    );
    let falling = "format = 1\ngravity_added_world_m_s2 = [0.0, 0.0, -9.8]\n";
    bad("falling.toml", falling, &["T025", "falling.toml", "gravity_added_world_m_s2", "scenario's world"]);
    bad("unknown.toml", "format = 1\nnoise = 1\n", &["T012", "unknown.toml", "noise"]);
    let output = tumble_in(&folder, &["simulate", "iss-slalom", "--sensing", "nominl"]);
    let said = stderr(&output);
    assert!(said.contains("T014") && said.contains("perfect, ideal, nominal, thesis-flight, bumble"), "{said}");
    assert!(said.contains("did you mean `nominal`"), "{said}");
    assert!(!folder.join("tumble-out").exists());
}

#[test]
fn a_campaign_remembers_its_sensing_and_replays_it() {
    let folder = scratch("sensing-campaign");
    let planned = ["campaign", "iss-slalom", "--dry-run", "--missions", "2", "--json", "--sensing"];
    let shown = printed(&folder, &["sensing", "show", "bumble"]);
    fs::write(folder.join("s.toml"), &shown).unwrap();
    let hash = |out: &str| {
        let record = fs::read_to_string(folder.join(out).join("run.json")).unwrap();
        let record: Value = serde_json::from_str(&record).unwrap();
        assert_eq!(record["configuration"]["sensing"], "s.toml");
        record["configuration"]["scenarios"][0]["hash"].as_str().unwrap().to_owned()
    };
    succeed(&folder, &[&planned[..], &["s.toml", "--out", "first"]].concat());
    let rows = fs::read_to_string(folder.join("first/rows.csv")).unwrap();
    assert!(rows.lines().nth(1).unwrap().ends_with(" --sensing s.toml"), "{rows}");
    fs::write(folder.join("s.toml"), shown.replace("time_s = 3.0", "time_s = 4.0")).unwrap();
    succeed(&folder, &[&planned[..], &["s.toml", "--out", "second"]].concat());
    assert_ne!(hash("first"), hash("second"));
}

/// A robot that loses its localisation in motions as slow as those it needs to stay on course is faster all the same: not in silence.
#[test]
fn time_beyond_what_the_localisation_survives_is_counted() {
    let folder = scratch("sensing-limits");
    let nominal = printed(&folder, &["sensing", "show", "nominal"]);
    let limits = |rate_rad_s: f64, acceleration_m_s2: f64| {
        format!(
            "{nominal}\n[localization_limits]\nrate_rad_s = {rate_rad_s:?}\nacceleration_m_s2 = {acceleration_m_s2:?}\njumps_hz = 1e-3\n\
             jump_position_m = 0.05\njump_attitude_rad = 0.05\njump_rate_rad_s = 0.05\n"
        )
    };
    let scenario = printed(&folder, &["scenario", "show", "iss-cargo"]);
    let short = scenario.lines().map(|line| if line.starts_with("duration_s") { "duration_s = 15.0" } else { line });
    fs::write(folder.join("short.toml"), short.collect::<Vec<_>>().join("\n")).unwrap();
    let beyond_s = |name: &str, limits: String| {
        fs::write(folder.join("limits.toml"), limits).unwrap();
        // It is on its way when the time is over.
        tumble_in(&folder, &["fly", "short.toml", "--seed", "3", "--sensing", "limits.toml", "--out", name, "--json"]);
        let summary: Value =
            serde_json::from_slice(&fs::read(folder.join(name).join("summary.json")).unwrap()).unwrap();
        number(&summary["beyond_localization_s"])
    };
    assert!(beyond_s("tight", limits(0.03, 0.006)) > 0.1);
    assert!(beyond_s("wide", limits(3.0, 3.0)) == 0.0);
}

/// A gyroscope whose axes are off by half a degree makes products of inertia of its own: they are stated as wide as that.
#[test]
fn axes_of_a_gyroscope_that_are_off_make_products_of_inertia_less_certain() {
    let folder = scratch("sensing-axes");
    let nominal = printed(&folder, &["sensing", "show", "nominal"]);
    let (before, rate) = nominal.split_once("[rate]").unwrap();
    let line = rate.lines().find(|line| line.starts_with("misalignment_sigma")).unwrap();
    let off = format!("{before}[rate]{}", rate.replacen(line, "misalignment_sigma = 0.0087", 1));
    fs::write(folder.join("off.toml"), off).unwrap();
    let missions =
        ["campaign", "iss-cargo", "--missions", "6", "--seed", "5", "--sensing", "off.toml", "--out", "c", "--json"];
    succeed(&folder, &missions);
    let rows = fs::read_to_string(folder.join("c/rows.csv")).unwrap();
    let mut lines = rows.lines().map(|line| line.split(',').collect::<Vec<_>>());
    let names = lines.next().unwrap();
    let mut scores = Vec::new();
    for row in lines {
        let value = |name: &str| row[names.iter().position(|column| *column == name).unwrap()].parse::<f64>().unwrap();
        for product in ["inertia_xy", "inertia_xz", "inertia_yz"] {
            let error = value(&format!("{product}_estimate")) - value(&format!("{product}_truth"));
            scores.push(error / value(&format!("{product}_sigma")));
        }
    }
    let rms = (scores.iter().map(|score| score * score).sum::<f64>() / scores.len() as f64).sqrt();
    assert!(scores.len() == 18 && (0.5..1.5).contains(&rms), "{rms} {scores:?}");
}
