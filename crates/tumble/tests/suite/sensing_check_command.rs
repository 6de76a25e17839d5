//! `tumble sensing check`: what a log shows of its own sensors.

use crate::support::{json, number, scratch, stderr, tumble};
use std::fmt::Write as _;
use std::fs;
use std::path::{Path, PathBuf};
use tumble_identification::noise::Gaussian;

/// A log of a body that swings about z and moves along x and y; poses show the motion of `age_s` ago. Columns that are not shown are blank.
fn log(folder: &Path, size: f64, age_s: f64, shown: &str) -> PathBuf {
    let mut bits = 1_u64;
    let mut noise = |sigma: f64| {
        (0..12)
            .map(|_| {
                bits = bits.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
                (bits >> 11) as f64 / (1_u64 << 53) as f64 - 0.5
            })
            .sum::<f64>()
            * sigma
    };
    let mut text = format!("t_s,{ALL}\n");
    for k in 0..3000 {
        let t = 0.016 * f64::from(k);
        let (angle, rate) = ((0.9 * (t - age_s)).sin(), 0.9 * (0.9 * t).cos());
        let half = 0.5 * (size * angle + noise(5e-4));
        let row = ALL.split(',').map(|column| match column {
            "p_x" => size * (0.8 * (t - age_s)).sin() + noise(1e-3),
            "p_y" => size * (0.5 * (t - age_s)).sin() + noise(1e-3),
            "p_z" | "w_x" | "w_y" => noise(1e-3),
            "q_z" => half.sin(),
            "q_w" => half.cos(),
            "w_z" => size * rate + 2e-3 + noise(1e-3),
            _ => 0.0,
        });
        let cell = |(column, x): (&str, f64)| if shown.contains(column) { format!("{x:.9}") } else { String::new() };
        let row: Vec<String> = ALL.split(',').zip(row).map(cell).collect();
        writeln!(text, "{t:.6},{}", row.join(",")).unwrap();
    }
    let path = folder.join("log.csv");
    fs::write(&path, text).unwrap();
    path
}

const ALL: &str = "p_x,p_y,p_z,q_x,q_y,q_z,q_w,w_x,w_y,w_z";

#[test]
fn the_table_and_the_object_say_what_the_log_shows() {
    let folder = scratch("sensing-check");
    let log = log(&folder, 1.0, 0.062, ALL);
    let log = log.to_str().unwrap();
    let found = json(&tumble(&["sensing", "check", log, "--json"]));
    assert_eq!(found["format"], 1);
    let pose = &found["pose"];
    for name in ["position_white", "position_wander", "attitude_white", "attitude_wander", "wander_time"] {
        let unit = if name == "wander_time" {
            "s"
        } else if name.starts_with("position") {
            "m"
        } else {
            "rad"
        };
        for key in [format!("{name}_{unit}"), format!("{name}_sigma_{unit}")] {
            assert!(pose.as_object().unwrap().contains_key(&key), "no {key}: {pose}");
        }
    }
    assert!((number(&pose["position_white_m"]) / 1e-3 - 1.0).abs() < 0.3, "{pose}");
    assert_eq!(found["reference"], "rate");
    let streams = found["streams"].as_array().unwrap();
    let names: Vec<&str> = streams.iter().map(|s| s["name"].as_str().unwrap()).collect();
    assert_eq!(names, ["pose", "rate"]);
    for stream in streams {
        for key in ["offset_s", "offset_sigma_s", "bias", "bias_sigma", "gain", "gain_sigma", "white", "white_sigma"] {
            assert!(stream.as_object().unwrap().contains_key(key), "no {key}: {stream}");
        }
    }
    let (age, sigma) = (number(&streams[0]["offset_s"]), number(&streams[0]["offset_sigma_s"]));
    assert!((age - 0.062).abs() < 4.0 * sigma && sigma < 3e-3, "{age} +- {sigma}");
    assert!((number(&streams[1]["bias"][2]) - 2e-3).abs() < 4.0 * number(&streams[1]["bias_sigma"][2]), "{found}");
    assert_eq!(found["contradictions"], serde_json::json!([]));

    let output = tumble(&["sensing", "check", log]);
    assert_eq!(output.status.code(), Some(0), "{}", stderr(&output));
    let table = String::from_utf8(output.stdout).unwrap();
    for word in ["pose", "rate", "age", "bias z", "gain z", "position, white", "attitude, slow", "+-"] {
        assert!(table.contains(word), "no {word}:\n{table}");
    }
}

#[test]
fn a_folder_holds_the_object_and_a_picture() {
    let folder = scratch("sensing-check-out");
    let log = log(&folder, 1.0, 0.0, ALL);
    let out = folder.join("out");
    let arguments = ["sensing", "check", log.to_str().unwrap(), "--json", "--out", out.to_str().unwrap()];
    let output = tumble(&arguments);
    let written: serde_json::Value = serde_json::from_slice(&fs::read(out.join("sensing.json")).unwrap()).unwrap();
    assert_eq!(written, json(&output));
    assert!(fs::read_to_string(out.join("attitude_error.svg")).unwrap().contains("<svg"));
    assert!(fs::read_to_string(out.join("run.json")).unwrap().contains("sensing check"));
    assert_eq!(tumble(&arguments).status.code(), Some(2), "a folder that exists is not replaced");
}

#[test]
fn at_rest_there_are_levels_and_no_age() {
    let folder = scratch("sensing-check-rest");
    let log = log(&folder, 0.0, 0.0, ALL);
    let output = tumble(&["sensing", "check", log.to_str().unwrap(), "--json"]);
    assert_eq!(output.status.code(), Some(0), "{}", stderr(&output));
    let found = json(&output);
    assert!(found["streams"][0]["offset_s"].is_null() && found["streams"][1]["gain"].is_null(), "{found}");
    assert!(found["pose"]["position_white_m"].is_number(), "{found}");
}

/// Poses and wrenches that are noise alone: differentiated poses are loud where such wrenches are, and soft where motion would be.
#[test]
fn noise_of_a_wrench_at_rest_has_no_age() {
    let folder = scratch("sensing-check-noise");
    let (mut dice, path) = (Gaussian::from_seed(5), folder.join("log.csv"));
    for _ in 0..3 {
        let mut text = "t_s,p_x,p_y,p_z,q_x,q_y,q_z,q_w,f_x,f_y,f_z,tau_x,tau_y,tau_z\n".to_owned();
        for k in 0..3000 {
            let mut three = |sigma: f64| [0; 3].map(|_| sigma * dice.normal());
            let ([x, y, z], [a, b, c], [fx, fy, fz], [tx, ty, tz]) =
                (three(1e-3), three(5e-4), three(1e-2), three(1e-3));
            let w = (1.0 - a * a - b * b - c * c).sqrt();
            writeln!(text, "{:.2},{x},{y},{z},{a},{b},{c},{w},{fx},{fy},{fz},{tx},{ty},{tz}", 0.02 * f64::from(k))
                .unwrap();
        }
        fs::write(&path, text).unwrap();
        let found = json(&tumble(&["sensing", "check", path.to_str().unwrap(), "--json"]));
        assert!(found["streams"][0]["offset_s"].is_null(), "{found}");
    }
}

/// Poses wander, and the robot with them: what they show is not what the rate shows of another time.
#[test]
fn where_a_controller_follows_the_poses_no_age_of_them_is_told() {
    for scenario in ["iss-hold", "iss-cargo"] {
        let folder = scratch(&format!("sensing-check-{scenario}"));
        let flown = folder.join("flown");
        let ended = tumble(&["simulate", scenario, "--seed", "1", "--out", flown.to_str().unwrap()]);
        assert_eq!(ended.status.code(), Some(0), "{}", stderr(&ended));
        let found = json(&tumble(&["sensing", "check", flown.join("log.csv").to_str().unwrap(), "--json"]));
        for stream in found["streams"].as_array().unwrap() {
            let untold = stream["name"] == "rate" || stream["name"] == "wrench" || stream["offset_s"].is_null();
            assert!(untold, "{scenario}: {stream}");
        }
    }
}

#[test]
fn a_log_that_tells_nothing_exits_with_3() {
    let folder = scratch("sensing-check-nothing");
    let path = folder.join("log.csv");
    let mut text = format!("t_s,{ALL}\n");
    (0..100).for_each(|k| writeln!(text, "{:.3},,,,,,,,0,0,0", 0.016 * f64::from(k)).unwrap());
    fs::write(&path, text).unwrap();
    let output = tumble(&["sensing", "check", path.to_str().unwrap()]);
    assert_eq!(output.status.code(), Some(3), "{}", stderr(&output));
}

#[test]
fn streams_may_be_missing() {
    let folder = scratch("sensing-check-missing");
    let poses = log(&folder, 1.0, 0.0, "p_x,p_y,p_z,q_x,q_y,q_z,q_w");
    let found = json(&tumble(&["sensing", "check", poses.to_str().unwrap(), "--json"]));
    assert!(found["reference"].is_null() && found["streams"].as_array().unwrap().len() == 1, "{found}");
    let rates = log(&folder, 1.0, 0.0, "w_x,w_y,w_z");
    let found = json(&tumble(&["sensing", "check", rates.to_str().unwrap(), "--json"]));
    assert!(found["pose"].is_null() && found["streams"][0]["white"].is_number(), "{found}");
}

#[test]
fn a_statement_that_the_log_contradicts_is_said() {
    let folder = scratch("sensing-check-stated");
    let log = log(&folder, 1.0, 0.062, ALL);
    let stated = folder.join("stated.toml");
    fs::write(
        &stated,
        "format = 1\n[pose_delay]\nexpected_s = 0.0\nsigma_s = 0.0\n[rate.delay]\nexpected_s = 0.0\nsigma_s = 0.0\n",
    )
    .unwrap();
    let arguments = ["sensing", "check", log.to_str().unwrap(), "--sensing", stated.to_str().unwrap()];
    let output = tumble(&arguments);
    assert_eq!(output.status.code(), Some(0), "{}", stderr(&output));
    let table = String::from_utf8(output.stdout).unwrap();
    assert!(table.contains("contradicted") && table.contains("`pose_delay`"), "{table}");
    let said = &json(&tumble(&[&arguments[..], &["--json"]].concat()))["contradictions"];
    assert_eq!(said[0]["key"], "pose_delay", "{said}");
    assert!((number(&said[0]["found"]) - 0.062).abs() < 5e-3, "{said}");
}
