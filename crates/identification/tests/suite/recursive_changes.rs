//! Changes of the body in flight: found in time, not imagined, and the split estimates are right. The long run is
//! `cargo xtask study change-detection`.
#![allow(clippy::cast_possible_truncation, clippy::cast_sign_loss, clippy::cast_possible_wrap)]

use crate::change_scenario::{Flight, STEP_S};
use crate::exact_motion::{Multisine, Run};
use crate::random::Random;
use tumble_identification::dynamics::InertialParameters;
use tumble_identification::estimator::{Finding, RecursiveEstimator};
use tumble_identification::lie::{Pose, Wrench};
use tumble_identification::nalgebra::{Matrix3, UnitQuaternion, Vector3};
use tumble_identification::recursive::{Change, Watch};
use tumble_identification::{MotionSample, Settings, Warning, identify, identify_parts};

/// Seconds until a change is reported, and the report.
fn found_after(flight: &mut Flight, limit_s: f64) -> Option<(f64, Change<10>)> {
    let mut elapsed_s = 0.0;
    while elapsed_s < limit_s {
        elapsed_s += STEP_S;
        if let Watch::Changed(change) = flight.step() {
            return Some((elapsed_s, change));
        }
    }
    None
}

fn mass(found: &Finding) -> (f64, f64) {
    (found.point().unwrap()[0], found.covariance().unwrap()[(0, 0)].sqrt())
}

#[test]
fn a_tenth_more_or_less_mass_is_found_within_two_seconds_and_the_estimate_split() {
    for seed in 0..4 {
        let mut flight = Flight::new(seed, 0.1);
        assert!(found_after(&mut flight, 6.0 + 0.37 * seed as f64).is_none(), "false alarm, seed {seed}");
        let before = flight.mass_kg();
        flight.grasp(if seed % 2 == 0 { 1.1 } else { 0.9 });
        let (delay_s, change) = found_after(&mut flight, 4.0).expect("a change");
        println!("{seed}: {delay_s:.2} s, evidence {:.1}, onset {} updates ago", change.evidence, change.updates_ago);
        assert!(delay_s < 2.0, "seed {seed}: {delay_s} s");
        let (old, old_deviation) = mass(&change.before);
        assert!((old - before).abs() < 0.01 * before && old_deviation < 0.01 * before, "{old} {old_deviation}");
        // The new model goes on learning; a report that comes to another onset may follow.
        found_after(&mut flight, 4.0);
        let (new, _) = mass(&flight.detector.current().finding().unwrap());
        assert!((new - flight.mass_kg()).abs() < 0.02 * before, "{new}");
    }
}

#[test]
fn without_a_force_nothing_is_said() {
    let mut flight = Flight::new(11, 0.0);
    for step in 0..250 {
        // Half way through a grasp that nobody can see.
        if step == 125 {
            flight.grasp(1.5);
        }
        assert_eq!(flight.step(), Watch::NotObservable, "{step}");
    }
    assert_eq!(flight.detector.visible().unwrap(), [false; 10]);
    flight.force_n = 0.2;
    assert!(found_after(&mut flight, 2.0).is_some());
    for _ in 0..125 {
        flight.step();
    }
    assert!(flight.detector.visible().unwrap()[0] && flight.step() == Watch::Quiet);
}

/// Poses at 62.5 Hz under a multisine; `factor` multiplies mass and inertia from `onset` (samples) on.
fn log(seed: u64, samples: usize, onset: usize, factor: f64, noise: f64) -> Vec<MotionSample> {
    let mut random = Random::new(seed);
    let signal = Multisine::random(&mut random, 0.04, 0.4, (0.3, 3.0), 5);
    let inertia = Matrix3::new(0.153, 0.004, -0.006, 0.004, 0.143, 0.003, -0.006, 0.003, 0.162);
    let body =
        |factor: f64| InertialParameters::about_com(9.4 * factor, Vector3::new(0.031, -0.017, 0.052), inertia * factor);
    let wrench = |t: f64| signal.at(t);
    let mut run = Run::new(body(1.0), &wrench, true);
    run.step_ns = 16_000_000;
    // The last one is the first of the body after.
    run.samples = onset + 1;
    let mut record = run.record();
    let last = record.pop().unwrap();
    let wrench = |t: f64| signal.at(t + onset as f64 * STEP_S);
    let mut run = Run::new(body(factor), &wrench, true);
    run.step_ns = 16_000_000;
    run.samples = samples - onset;
    run.start_ns = last.time_ns;
    run.start = last.world_from_body.unwrap();
    run.velocity_world = last.velocity_origin_world.unwrap();
    run.rate_body = last.rate_body.unwrap();
    record.extend(run.record());
    for sample in &mut record {
        let turn = UnitQuaternion::from_scaled_axis(random.normal3(noise));
        let attitude = sample.world_from_body.unwrap().rotation * turn;
        let place = sample.world_from_body.unwrap().translation.vector + random.normal3(noise);
        sample.world_from_body = Some(Pose::from_parts(place.into(), attitude));
        (sample.rate_body, sample.velocity_origin_world, sample.acceleration_origin_body) = (None, None, None);
        sample.wrench_body =
            sample.wrench_body.map(|w| Wrench::new(w.torque + random.normal3(1e-4), w.force + random.normal3(1e-3)));
    }
    record
}

fn changed(warnings: &[Warning]) -> Option<Warning> {
    warnings.iter().copied().find(|warning| matches!(warning, Warning::BodyChanged { .. }))
}

#[test]
fn a_change_within_a_log_is_told_and_the_parts_are_taken_apart() {
    for seed in 0..4 {
        // Noisy poses by likelihood, exact ones by regression.
        let noise = if seed < 2 { 1e-3 } else { 0.0 };
        let (onset, factor) = (700 + 137 * seed as usize, if seed % 2 == 0 { 1.1 } else { 0.9 });
        let record = log(seed, 1800, onset, factor, noise);
        let found = identify(&record, &Settings::default()).unwrap();
        assert_eq!(found.method == "maximum-likelihood", noise > 0.0);
        let Some(Warning::BodyChanged { time_ns, earliest_ns, latest_ns, mass_before_kg, mass_after_kg }) =
            changed(&found.warnings)
        else {
            panic!("seed {seed}: {:?}", found.warnings)
        };
        let onset_s = onset as f64 * STEP_S;
        println!(
            "{seed}: {onset_s:.2} s, found {:.2} s, {mass_before_kg:.3} -> {mass_after_kg:.3}",
            time_ns as f64 * 1e-9
        );
        assert!(
            earliest_ns as f64 * 1e-9 <= onset_s && onset_s <= latest_ns as f64 * 1e-9,
            "{earliest_ns} {latest_ns}"
        );
        assert!((mass_before_kg / 9.4 - 1.0).abs() < 0.03 && (mass_after_kg / (9.4 * factor) - 1.0).abs() < 0.03);
        let taken = identify_parts(&record, &Settings::default()).unwrap();
        let parts = &taken.parts;
        assert_eq!(parts.len(), 2, "seed {seed}");
        for (part, factor) in parts.iter().zip([1.0, factor]) {
            assert_eq!(changed(&part.found.warnings), None);
            let estimate = part.found.estimate.unwrap();
            let error = estimate.parameters.mass - 9.4 * factor;
            assert!(error.abs() < 4.5 * estimate.std.mass_kg && error.abs() < 0.01 * 9.4, "{error}");
        }
        let [change] = taken.changes[..] else { panic!("{:?}", taken.changes) };
        assert!(change.earliest_ns <= change.time_ns && change.time_ns <= change.latest_ns);
        let difference = change.difference.unwrap();
        let error = difference.parameters.mass - 9.4 * (factor - 1.0);
        assert!(error.abs() < 4.5 * difference.std.mass_kg, "{error}");
    }
}

#[test]
fn a_change_too_small_to_matter_is_not_told() {
    for seed in 0..3 {
        // Half a percent: seen by exact poses, of no use to anybody.
        let record = log(80 + seed, 1200, 600, 1.005, if seed == 0 { 0.0 } else { 1e-3 });
        let found = identify(&record, &Settings::default()).unwrap();
        assert_eq!(changed(&found.warnings), None, "seed {seed}");
    }
}

#[test]
fn no_change_is_told_where_there_is_none() {
    for seed in 0..6 {
        let noise = if seed % 3 == 0 { 0.0 } else { 1e-3 };
        let record = log(50 + seed, 1200, 700, 1.0, noise);
        let parts = identify_parts(&record, &Settings::default()).unwrap().parts;
        assert_eq!(parts.iter().map(|part| changed(&part.found.warnings)).collect::<Vec<_>>(), [None], "seed {seed}");
    }
}
