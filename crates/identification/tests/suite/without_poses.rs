//! Records whose poses are missing: here and there, and throughout.

use crate::exact_motion::{Multisine, Run, errors};
use crate::random::Random;
use tumble_identification::dynamics::strategies::body_d;
use tumble_identification::estimator::Verdict;
use tumble_identification::nalgebra::Vector3;
use tumble_identification::{Column, IdentificationError, MotionSample, Settings, Warning, WrenchTiming, identify};

/// Forty seconds at 20 Hz.
fn record(held: bool) -> Vec<MotionSample> {
    let push = Multisine::random(&mut Random::new(5), 1.0, 4.0, (0.5, 3.0), 5);
    let wrench = |time_s: f64| push.at(if held { time_s + 0.025 } else { time_s });
    Run { samples: 801, ..Run::new(body_d(), &wrench, held) }.record()
}

fn settings(method: &'static str, held: bool) -> Settings {
    let wrench_timing = if held { WrenchTiming::Held } else { WrenchTiming::Sampled };
    Settings { method, wrench_timing, ..Settings::default() }
}

fn is_near(record: &[MotionSample], settings: &Settings, relative: f64) {
    let found = identify(record, settings).unwrap_or_else(|error| panic!("{}: {error}", settings.method));
    // a filter that diverges says so, and a regression answers
    let has_diverged = found.warnings.iter().any(|warning| matches!(warning, Warning::FilterDiverged { .. }));
    let is_asked = settings.method == "auto" || found.method == settings.method;
    assert!(is_asked || has_diverged, "{} answered by {}", settings.method, found.method);
    let estimate = found.estimate.unwrap_or_else(|| panic!("{}: no estimate, rank {}", settings.method, found.rank));
    let [mass, center, inertia] = errors(&estimate.parameters, &body_d());
    let largest = mass.max(center).max(inertia);
    assert!(largest < relative, "{}: {mass:.1e} {center:.1e} {inertia:.1e}", settings.method);
}

#[test]
fn an_outage_of_the_star_tracker_costs_its_rows_alone() {
    for held in [true, false] {
        let mut outage = record(held);
        for row in &mut outage[300..420] {
            row.world_from_body = None;
        }
        for method in
            ["auto", "newton-euler", "variational4", "maximum-likelihood", "rls", "recursive-sdp", "ekf", "ukf"]
        {
            is_near(&outage, &settings(method, held), 0.02);
        }
    }
}

#[test]
fn poses_slower_than_rates_do_for_the_likelihood() {
    let mut slow = record(true);
    for (k, row) in slow.iter_mut().enumerate() {
        row.world_from_body = row.world_from_body.filter(|_| k % 5 == 0);
    }
    is_near(&slow, &settings("maximum-likelihood", true), 0.01);
    is_near(&slow, &settings("auto", true), 0.02);
}

#[test]
fn rates_and_accelerations_need_no_pose() {
    for held in [true, false] {
        let mut blind = record(held);
        for row in &mut blind {
            (row.world_from_body, row.velocity_origin_world) = (None, None);
        }
        for method in ["auto", "newton-euler", "rls", "recursive-sdp", "ekf"] {
            is_near(&blind, &settings(method, held), 0.02);
        }
        let found = identify(&blind, &settings("auto", held)).unwrap();
        assert_eq!((found.method, found.verdict), ("newton-euler", Verdict::Identified));
    }
}

#[test]
fn what_is_missing_is_named() {
    let missing = |column| Err(IdentificationError::MissingColumn(column));
    let mut blind = record(true);
    for row in &mut blind {
        row.world_from_body = None;
    }
    for method in ["variational", "variational4", "variational6", "maximum-likelihood"] {
        assert_eq!(identify(&blind, &settings(method, true)), missing(Column::Pose), "{method}");
    }
    // which way is down nobody sees
    let falls = Settings { gravity_world: Vector3::z() * -9.8, ..settings("newton-euler", true) };
    assert_eq!(identify(&blind, &falls), missing(Column::Pose));
    let without = |of: fn(&mut MotionSample)| {
        let mut record = blind.clone();
        record.iter_mut().for_each(of);
        identify(&record, &settings("auto", true))
    };
    assert_eq!(without(|row| row.acceleration_origin_body = None), missing(Column::Acceleration));
    assert_eq!(without(|row| row.rate_body = None), missing(Column::Rate));
    assert_eq!(without(|row| row.wrench_body = None), missing(Column::Wrench));
}
