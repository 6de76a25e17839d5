//! A program that adds an estimator in flight and a method of its own: both are asked for by name, and listed where a name is unknown.

#[path = "../../examples/own_layers.rs"]
mod own_layers;

use crate::support::scratch;
use serde_json::Value;
use std::error::Error;
use std::process::ExitCode;
use tumble::TumbleError;
use tumble::cli::identify::ADDED_METHODS;
use tumble::cli::{Outcome, captured};
use tumble::mission::{ADDED_CONTROLLERS, ADDED_ESTIMATORS, ADDED_PLANNERS, estimator};
use tumble::robots::shipped;
use tumble_dynamics::{DynamicsError, RigidBodyState};
use tumble_identification::MotionSample;
use tumble_identification::estimator::{Acted, Estimator, EstimatorError, Finding, Measurement, StateEstimator};
use tumble_identification::recursive::{FlightEstimator, Reception};
use tumble_planning::PlanningError;

fn said(words: &[&str]) -> (Result<bool, String>, String) {
    let words = ["tumble"].iter().chain(words).map(|word| (*word).into());
    match tumble::answer(words, &shipped()) {
        Ok(answer) => (Ok(answer.outcome == Outcome::Achieved), answer.said.stdout),
        Err(error) => (Err(error.to_string()), String::new()),
    }
}

#[test]
fn what_a_program_adds_flies_and_identifies_by_name() {
    own_layers::add();
    let folder = scratch("own-layers").join("flight");
    let out = folder.to_str().unwrap();
    let (flown, text) = said(&["fly", "iss-cargo", "--estimator", "as-measured", "--out", out, "--json"]);
    assert!(flown.is_ok(), "{flown:?}");
    let summary: Value = serde_json::from_str(&text).unwrap();
    assert_eq!(summary["options"]["layers"], serde_json::json!({ "estimator": "as-measured" }), "{text}");
    let flown = serde_json::json!({
        "estimator": "as-measured", "planner": "flight", "local_planner": "informative", "controller": "tube"
    });
    assert_eq!(summary["layers"], flown, "{text}");
    // It learns nothing, and says so: the payload is what nobody told it of.
    let mass = &summary["parameters"][0];
    assert_eq!(mass["estimate"], mass["initial"], "{mass}");
    // The record of the flight names the layer, and is flown again with it.
    assert_eq!(said(&["replay", &format!("{out}/report.html")]).0, Ok(true));
    let (found, text) = said(&["identify", "--demo", "--method", "recent", "--json"]);
    assert_eq!(found, Ok(true), "{text}");
    let found: Value = serde_json::from_str(&text).unwrap();
    assert_eq!(found["method"], "recent");
    // What only the library's own likelihood takes is not passed over in silence.
    let told = ["identify", "--demo", "--method", "recent", "--sensing", "nominal"];
    assert!(said(&told).0.unwrap_err().contains("belong to `--method flight-likelihood`"));
    // A campaign takes it as well, and its rows name it.
    let rows = scratch("own-layers-campaign").join("campaign");
    let place = rows.to_str().unwrap();
    let named = ["--missions", "1", "--dry-run", "--estimator", "as-measured", "--out", place];
    assert_eq!(said(&[&["campaign"], &named[..]].concat()).0, Ok(true));
    let table = std::fs::read_to_string(rows.join("rows.csv")).unwrap();
    assert!(table.trim_end().ends_with("--estimator as-measured"), "{table}");
    for (unknown, known) in [("fly", "--estimator"), ("campaign", "--estimator"), ("identify", "--method")] {
        let (refused, _) = said(&[unknown, known, "mien"]);
        let text = refused.unwrap_err();
        assert!(text.contains("as-measured") || text.contains("recent"), "{text}");
    }
}

/// An error of a program's own, with text of run time and a reason that it does not repeat.
#[derive(Debug, thiserror::Error)]
#[error("table {table} is not loaded")]
struct NotLoaded {
    table: String,
    source: std::io::Error,
}

fn not_loaded(table: usize) -> NotLoaded {
    NotLoaded { table: format!("no. {table}"), source: std::io::Error::other(format!("disk {table} is full")) }
}

/// Says so of every record, at once or through an actuator of its own.
struct Unloaded {
    by_actuator: bool,
}

impl Estimator for Unloaded {
    type Record = [MotionSample];
    fn estimate(&self, record: &[MotionSample]) -> Result<Finding, EstimatorError> {
        let error = not_loaded(record.len());
        let actuator = |error| tumble_identification::IdentificationError::from(DynamicsError::foreign("wheel", error));
        Err(if self.by_actuator { actuator(error).into() } else { EstimatorError::foreign("table", error) })
    }
}

#[test]
fn an_error_of_the_programs_own_keeps_its_text_and_its_sources() {
    let unloaded = |by_actuator| move |_: &_| Ok(Box::new(Unloaded { by_actuator }) as Box<_>);
    ADDED_METHODS.add("unloaded", "reads tables that are not there", unloaded(false));
    ADDED_METHODS.add("unloaded-wheel", "the same of a wheel", unloaded(true));
    ADDED_ESTIMATORS.add("unloaded", "", |_| Err(PlanningError::foreign("table", not_loaded(1))));
    ADDED_PLANNERS.add("unloaded", "", |_| Err(EstimatorError::foreign("table", not_loaded(2)).into()));
    ADDED_CONTROLLERS.add("unloaded", "", |_| Err(DynamicsError::foreign("table", not_loaded(3)).into()));
    let hold = tumble::answer(["tumble", "scenario", "show", "iss-hold"].map(Into::into), &shipped());
    let scenario = scratch("unloaded").join("hold.toml");
    let flown = hold.unwrap().said.stdout.replace("controller = \"flown\"", "controller = \"unloaded\"");
    std::fs::write(&scenario, flown).unwrap();
    let commands: [(&[&str], &str); 6] = [
        (&["identify", "--demo", "--method", "unloaded"], "T015"),
        (&["identify", "--demo", "--method", "unloaded-wheel"], "T015"),
        (&["fly", "iss-cargo", "--estimator", "unloaded"], "T033"),
        (&["fly", "iss-cargo", "--planner", "unloaded"], "T033"),
        (&["fly", "iss-cargo", "--controller", "unloaded"], "T033"),
        (&["simulate", scenario.to_str().unwrap()], "T035"),
    ];
    for (words, code) in commands {
        let words = || ["tumble"].iter().chain(words).map(|word| (*word).into());
        let error: TumbleError = tumble::answer(words(), &shipped()).unwrap_err();
        assert_eq!(error.code(), code, "{error}");
        let mut sources = std::iter::successors(error.source(), |error| (*error).source());
        let own = sources.find_map(|source| source.downcast_ref::<NotLoaded>());
        let own = own.unwrap_or_else(|| panic!("{error} has lost its source"));
        assert!(error.to_string().ends_with(&format!("{own}")), "{error}");
        // The program says what the error itself leaves to its source.
        let (ended, said) = captured(|| tumble::run(words(), &shipped()));
        assert_eq!(ended, ExitCode::from(2));
        let expected = format!("error[{code}]: {error}: {}\n  remedy: ", own.source);
        assert!(said.stderr.contains(&expected), "{expected}{}", said.stderr);
    }
}

/// The joint filter until its motion is no number.
struct FallsSilent(FlightEstimator);

/// When that is, ns.
const SILENT_NS: i64 = 14_000_000_000;

impl StateEstimator for FallsSilent {
    fn acted(&mut self, acted: &Acted) {
        StateEstimator::acted(&mut self.0, acted);
    }
    fn measured(&mut self, measurement: &Measurement) -> Reception {
        StateEstimator::measured(&mut self.0, measurement)
    }
    fn state_at(&self, time_ns: i64) -> RigidBodyState<f64> {
        let mut state = StateEstimator::state_at(&self.0, time_ns);
        if time_ns >= SILENT_NS {
            state.world_from_body.translation.vector.z = f64::NAN;
        }
        state
    }
    fn finding(&self) -> Result<Finding, EstimatorError> {
        StateEstimator::finding(&self.0)
    }
    fn newest_stamp_ns(&self) -> i64 {
        StateEstimator::newest_stamp_ns(&self.0)
    }
    fn restart(&mut self, body: &Finding) -> Result<(), EstimatorError> {
        StateEstimator::restart(&mut self.0, body)
    }
}

#[test]
fn a_mission_whose_estimator_falls_silent_ends_at_rest_and_says_why() {
    ADDED_ESTIMATORS
        .add("falls-silent", "the joint filter for a while", |problem| Ok(Box::new(FallsSilent(estimator(problem)?))));
    let folder = scratch("falls-silent").join("flight");
    let out = folder.to_str().unwrap();
    let (flown, text) = said(&["fly", "iss-cargo", "--estimator", "falls-silent", "--out", out, "--json"]);
    assert_eq!(flown, Ok(false));
    let summary: Value = serde_json::from_str(&text).unwrap();
    let warnings = summary["warnings"].to_string();
    assert!(warnings.contains("told no motion any more") && !warnings.contains("safe-state"), "{warnings}");
    assert!(summary["mission_s"].as_f64().unwrap() < 30.0, "{text}");
    assert_eq!(said(&["replay", &format!("{out}/report.html")]).0, Ok(true));
}
