//! Logs that say little, or something other than is stated of them: answered as far as they go, or refused with what they show.

use crate::support::{columns_of, json, number, scratch, stderr, tumble, tumble_in};
use serde_json::Value;
use std::fs;
use std::path::{Path, PathBuf};

const POSE: [&str; 8] = ["t_s", "p_x", "p_y", "p_z", "q_x", "q_y", "q_z", "q_w"];
const WRENCH: [&str; 6] = ["f_x", "f_y", "f_z", "tau_x", "tau_y", "tau_z"];
const RATE: [&str; 3] = ["w_x", "w_y", "w_z"];
const VELOCITY: [&str; 3] = ["v_x", "v_y", "v_z"];
const ACCELERATION: [&str; 3] = ["a_x", "a_y", "a_z"];

fn flown(folder: &Path, scenario: &str, seed: &str) -> PathBuf {
    let output = tumble_in(folder, &["simulate", scenario, "--sensing", "nominal", "--seed", seed, "--out", scenario]);
    assert_eq!(output.status.code(), Some(0), "{}", stderr(&output));
    folder.join(scenario)
}

fn write(path: &Path, names: &[&str], rows: impl IntoIterator<Item = Vec<String>>) {
    let rows = rows.into_iter().map(|cells| cells.join(",") + "\n");
    fs::write(path, names.join(",") + "\n" + &rows.collect::<String>()).unwrap();
}

/// Mass over truth, its standard deviation, and all errors in standard deviations, of a log that is identified.
fn identified(log: &Path, flight: &Path) -> (f64, Vec<f64>) {
    let truth = flight.join("truth.toml");
    let output = tumble(&["identify", log.to_str().unwrap(), "--reference", truth.to_str().unwrap(), "--json"]);
    assert_eq!(output.status.code(), Some(0), "{}: {}", log.display(), stderr(&output));
    let found = json(&output);
    let errors = found["reference"]["error_over_sigma"].as_array().unwrap().iter().filter_map(Value::as_f64).collect();
    (number(&found["std"]["mass_kg"]), errors)
}

/// A slope of two milliradians, of which nobody tells: its pull is found beside the body.
#[test]
fn a_table_may_be_tilted() {
    let folder = scratch("tilted");
    let flight = flown(&folder, "granite-excite", "61");
    let names = ["t_s", "p_x", "p_y", "q_z", "q_w", "f_x", "f_y", "tau_z", "v_x", "v_y", "w_z"];
    let level = columns_of(&flight.join("log.csv"), &names);
    let planar = ["t_s", "p_x", "p_y", "yaw_rad", "f_x", "f_y", "tau_z", "v_x", "v_y", "w_z"];
    let mut sigma = 0.0;
    for slope_m_s2 in [0.0, 0.02] {
        let log = folder.join(format!("{slope_m_s2}.csv"));
        let tilted = level.iter().map(|cells| {
            let number = |at: usize| cells[at].parse::<f64>().unwrap();
            let (t, yaw_rad) = (number(0), 2.0 * number(3).atan2(number(4)));
            let mut row = vec![cells[0].clone(), (number(1) + 0.5 * slope_m_s2 * t * t).to_string(), cells[2].clone()];
            row.push(yaw_rad.to_string());
            row.extend_from_slice(&cells[5..8]);
            row.extend([(number(8) + slope_m_s2 * t).to_string(), cells[9].clone(), cells[10].clone()]);
            row
        });
        write(&log, &planar, tilted);
        let (mass_sigma, errors) = identified(&log, &flight);
        println!("{slope_m_s2}: {mass_sigma} {errors:?}");
        assert!(errors.len() == 4 && errors.iter().all(|z| z.abs() < 4.0), "{slope_m_s2}: {errors:?}");
        assert!(sigma == 0.0 || (0.8..1.25).contains(&(mass_sigma / sigma)), "{mass_sigma} beside {sigma}");
        sigma = mass_sigma;
    }
}

/// Nothing is invented of a body at rest, and what is wrong is not sought in signs and frames.
#[test]
fn a_body_at_rest_shows_nothing() {
    let folder = scratch("rest");
    let mut bits = 1_u64;
    let mut noise = |sigma: f64| {
        bits = bits.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        sigma * 3.46 * ((bits >> 11) as f64 / (1_u64 << 53) as f64 - 0.5)
    };
    let names = [&POSE[..], &WRENCH, &VELOCITY, &RATE].concat();
    for (wrench_noise, said) in [(0.0, "the wrench is zero throughout"), (1e-3, "")] {
        let log = folder.join(format!("{wrench_noise}.csv"));
        let levels: Vec<f64> =
            [&[1e-3; 3][..], &[5e-4; 3], &[0.0], &[wrench_noise; 6], &[2e-3; 3], &[1e-3; 3]].concat();
        let rows: Vec<Vec<String>> = (0..1500)
            .map(|k| {
                let cells = levels.iter().enumerate().map(|(i, level)| f64::from(u8::from(i == 6)) + noise(*level));
                std::iter::once(0.016 * f64::from(k)).chain(cells).map(|cell| cell.to_string()).collect()
            })
            .collect();
        write(&log, &names, rows);
        for options in [&[][..], &["--sensing", "nominal"], &["--planar"], &["--dry-run", "--sensing", "nominal"]] {
            let output = tumble(&[&["identify", log.to_str().unwrap(), "--json"], options].concat());
            let told = stderr(&output);
            assert_eq!(output.status.code(), Some(3), "{options:?}: {told}");
            assert!(json(&output)["std"]["mass_kg"].is_null(), "{options:?}");
            assert!(told.contains(said) && !told.contains("check the sign"), "{options:?}: {told}");
        }
    }
    let told = stderr(&tumble(&["identify", folder.join("0.001.csv").to_str().unwrap()]));
    assert!(told.contains("a body at rest shows nothing of itself"), "{told}");
}

/// Each stream that is missing costs what it told, and no more is claimed than what is left tells.
#[test]
fn streams_may_be_missing_at_the_price_of_what_they_told() {
    let folder = scratch("missing-streams");
    let flight = flown(&folder, "iss-excite", "62");
    let mut sigmas = Vec::new();
    for (name, more) in [
        ("all", [&VELOCITY[..], &RATE, &ACCELERATION].concat()),
        ("no accelerations", [&VELOCITY[..], &RATE].concat()),
        ("rates", RATE.to_vec()),
        ("velocities", VELOCITY.to_vec()),
        ("poses", Vec::new()),
    ] {
        let names = [&POSE[..], &WRENCH, &more].concat();
        let log = folder.join("log.csv");
        write(&log, &names, columns_of(&flight.join("log.csv"), &names));
        let (sigma, errors) = identified(&log, &flight);
        println!("{name}: {sigma} {errors:.1?}");
        assert!(errors.len() == 10 && errors.iter().all(|z| z.abs() < 4.0), "{name}: {errors:?}");
        sigmas.push(sigma);
    }
    let [all, unaccelerated, rates, velocities, poses]: [f64; 5] = sigmas.clone().try_into().unwrap();
    assert!(all < 1.02 * unaccelerated && unaccelerated < 1.02 * rates && unaccelerated < 1.02 * velocities);
    assert!(rates.min(velocities) < 1.02 * poses && all < 0.5 * poses, "{sigmas:?}");
}

/// The preset is of the station; on a table its publisher adds gravity by an attitude that wanders, which stands in the accelerations.
#[test]
fn sensors_of_the_station_are_contradicted_by_a_log_of_the_table() {
    let folder = scratch("station-sensors");
    let flight = flown(&folder, "granite-excite", "63");
    let log = flight.join("log.csv");
    let told = ["identify", log.to_str().unwrap(), "--sensing", "nominal"];
    let output = tumble(&told);
    let said = stderr(&output);
    let shown = said.lines().find(|line| line.contains("the log contradicts what `--sensing` states")).unwrap();
    let number = shown.split("the log shows ").nth(1).unwrap().split(' ').next().unwrap();
    assert!(shown.contains("`gravity_added_world_m_s2`") && shown.contains("stated 0.0000"), "{said}");
    assert!((number.parse::<f64>().unwrap() - 9.807).abs() < 1.0, "{shown}");
    // Stated as it is, nothing is contradicted, and the body is found.
    let nominal = tumble(&["sensing", "show", "nominal"]).stdout;
    let nominal = String::from_utf8(nominal).unwrap();
    let stated = nominal.replace("[0.0, 0.0, 0.0]", "[0.0, 0.0, 9.80665]");
    assert!(nominal.contains("gravity_added_world_m_s2 = [0.0, 0.0, 0.0]"), "{nominal}");
    fs::write(folder.join("table.toml"), stated).unwrap();
    let output = tumble(&[&told[..3], &[folder.join("table.toml").to_str().unwrap()]].concat());
    assert_eq!(output.status.code(), Some(0), "{}", stderr(&output));
    assert!(!stderr(&output).contains("contradicts"), "{}", stderr(&output));
    // Without rates nothing tells where the accelerometer sits, nor what its publisher added.
    let names = [&POSE[..], &WRENCH, &VELOCITY, &ACCELERATION].concat();
    let without = folder.join("without.csv");
    write(&without, &names, columns_of(&log, &names));
    let output = tumble(&[&told[..1], &[without.to_str().unwrap()], &told[2..]].concat());
    assert!(!stderr(&output).contains("lever_arm"), "{}", stderr(&output));
}
