//! Changes of the body in flight: found in time, not imagined, and the split estimates are right. The long run is
//! `cargo xtask study change-detection`.
#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic)]

mod change_scenario;

use change_scenario::{Filter, Flight, STEP_S};
use tumble_identification::recursive::{Change, RecursiveEstimator, Watch};

/// Seconds until a change is reported, and the report.
fn found_after(flight: &mut Flight, limit_s: f64) -> Option<(f64, Change<Filter>)> {
    let mut elapsed_s = 0.0;
    while elapsed_s < limit_s {
        elapsed_s += STEP_S;
        if let Watch::Changed(change) = flight.step() {
            return Some((elapsed_s, change));
        }
    }
    None
}

fn mass(filter: &Filter) -> (f64, f64) {
    (filter.parameters()[0], filter.covariance()[(0, 0)].sqrt())
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
        let (new, _) = mass(flight.detector.current());
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
    assert_eq!(flight.detector.visible(), [false; 10]);
    flight.force_n = 0.2;
    assert!(found_after(&mut flight, 2.0).is_some());
    for _ in 0..125 {
        flight.step();
    }
    assert!(flight.detector.visible()[0] && flight.step() == Watch::Quiet);
}
