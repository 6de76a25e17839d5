//! What the nozzles of a flight are told, beside its log.

use crate::support::{json, scratch, stderr, tumble_in};
use std::fs;
use std::path::Path;
use tumble_formats::actuator_file;
use tumble_formats::log::CommandedReader;

/// The wrench that the commands of a flight give, and that of its columns, row by row; torque first.
fn wrenches(flight: &Path) -> Vec<[[f64; 6]; 2]> {
    let file = actuator_file::read(&flight.join("actuators.toml")).unwrap();
    assert_eq!(file.columns.len(), 12);
    let mut reader = CommandedReader::open(&flight.join("log.csv"), false, &file.columns).unwrap();
    let (mut record, mut commands) = (Vec::new(), Vec::new());
    while let Some(sample) = reader.next_sample().unwrap() {
        commands.extend(sample.commands.into_iter().map(Option::unwrap));
        record.push(sample.motion);
    }
    let logged: Vec<[f64; 6]> = record.iter().map(|row| row.wrench_body.unwrap().to_vector().into()).collect();
    file.actuators.drive(&mut record, &commands).unwrap();
    let driven = record.iter().map(|row| row.wrench_body.unwrap().to_vector().into());
    driven.zip(logged).map(|(driven, logged)| [driven, logged]).collect()
}

#[test]
fn commands_and_actuators_give_the_wrench_of_the_log() {
    let folder = scratch("nozzles");
    let output = tumble_in(&folder, &["simulate", "iss-excite", "--duration", "20", "--out", "flight"]);
    assert_eq!(output.status.code(), Some(0), "{}", stderr(&output));
    let both = wrenches(&folder.join("flight"));
    assert!(both.len() > 1200);
    for (row, [driven, logged]) in both.iter().enumerate() {
        for (axis, (driven, logged)) in driven.iter().zip(logged).enumerate() {
            assert!((driven - logged).abs() < 1e-10, "row {row}, axis {axis}: {driven} {logged}");
        }
    }
}

#[test]
fn flights_without_nozzles_have_none_of_both() {
    let folder = scratch("no-nozzles");
    for name in ["open-tumble", "spheres-excite"] {
        let output = tumble_in(&folder, &["simulate", name, "--duration", "2", "--out", name]);
        assert_eq!(output.status.code(), Some(0), "{}", stderr(&output));
        assert!(!folder.join(name).join("actuators.toml").exists());
        let log = fs::read_to_string(folder.join(name).join("log.csv")).unwrap();
        assert!(!log.lines().next().unwrap().contains("nozzle"));
    }
}

#[test]
fn a_flight_is_identified_by_what_its_nozzles_were_told() {
    let folder = scratch("told-nozzles");
    let output = tumble_in(&folder, &["simulate", "iss-excite", "--duration", "60", "--out", "flight"]);
    assert_eq!(output.status.code(), Some(0), "{}", stderr(&output));
    let words = ["identify", "flight/log.csv", "--actuators", "flight/actuators.toml", "--reference"];
    let found = json(&tumble_in(&folder, &[&words[..], &["flight/truth.toml", "--json"]].concat()));
    assert_eq!((&found["rank"], found["actuators"].is_object()), (&10.into(), true), "{found}");
    let errors = found["reference"]["error_over_sigma"].as_array().unwrap();
    assert!(errors.len() == 10 && errors.iter().all(|z| z.as_f64().unwrap().abs() < 3.5), "{errors:?}");
}
