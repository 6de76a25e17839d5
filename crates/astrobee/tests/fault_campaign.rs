//! The closed loop when things go wrong: a handful of the cases of `cargo xtask study faults`.

#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic)]

use tumble_astrobee::mission::{
    FlyOptions, MissionRecord, ModelChoice, NoHooks, WeightingChoice, fly, replay_line,
};
use tumble_astrobee::scenario::ScenarioSource;

fn flown(scenario: &str, fault: &str, seed: u64) -> MissionRecord {
    let source = ScenarioSource::load(scenario).unwrap();
    let fault = Some(fault.parse().unwrap());
    let options = FlyOptions {
        seed,
        weighting: WeightingChoice::default(),
        feedback: true,
        model: ModelChoice::default(),
        fault,
    };
    let line = replay_line(scenario, &options);
    let record = fly(&source, &options, &mut NoHooks).unwrap_or_else(|error| panic!("{line}: {error}"));
    let summary = &record.summary;
    let reason = summary.unsafe_because();
    assert!(reason.is_none() || summary.unavoidable().is_some(), "{line}: {reason:?}, {:?}", summary.warnings);
    assert!(!summary.faults.is_empty(), "{line}: nothing went wrong");
    record
}

fn arrives(scenario: &str, fault: &str, seed: u64) -> MissionRecord {
    let record = flown(scenario, fault, seed);
    assert!(record.summary.arrived, "{scenario} {fault}: given up after {} s", record.summary.mission_s);
    record
}

fn says(record: &MissionRecord, text: &str) -> bool {
    record.events.iter().any(|event| event.text.contains(text))
}
