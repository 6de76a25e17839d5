//! Records that the likelihood of the series cannot answer: handed over after a bounded work, refused, or said.
#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic)]
#![allow(clippy::cast_possible_truncation, clippy::cast_sign_loss, clippy::cast_possible_wrap)]

mod periodic_log;

use periodic_log::{PeriodicLog, Random, flown, noise, noisy};
use tumble_identification::dynamics::WrenchBox;
use tumble_identification::fourier::FourierMotion;
use tumble_identification::harmonics::{
    HarmonicEstimator, HarmonicIdentification, HarmonicSettings, HarmonicWarning, LARGEST_WORK, average_cycles,
    identify_periodic, likeliest_harmonics,
};
use tumble_identification::lie::Pose;
use tumble_identification::nalgebra::Vector3;
use tumble_identification::statistics::normalized_squared_error;
use tumble_identification::{IdentificationError, Noise, WrenchTiming};

fn log(seed: u64, period_s: f64, samples_per_cycle: usize) -> PeriodicLog {
    let mut random = Random::new(seed);
    let motion = random.motion(period_s, 3);
    PeriodicLog { cycles: 4, samples_per_cycle, ..PeriodicLog::new(motion, random.load()) }
}

fn settings(log: &PeriodicLog) -> HarmonicSettings {
    HarmonicSettings {
        wrench_timing: WrenchTiming::Sampled,
        ..HarmonicSettings::new(log.motion.basis().period_s(), 3)
    }
}

fn has(found: &HarmonicIdentification, matches: impl Fn(&HarmonicWarning) -> bool) -> bool {
    found.warnings.iter().any(matches)
}

/// Standard deviations of the worst direction: squared, at least the square of any one number's.
fn squared_error(found: &HarmonicIdentification, log: &PeriodicLog) -> f64 {
    let error = found.estimate.parameters.to_vector() - log.body.to_vector();
    normalized_squared_error(&error, &found.estimate.covariance).unwrap()
}

/// Motion in a plane: turns about z, moves along x and y.
#[test]
fn planar_records_are_refused_before_any_likelihood() {
    for noise in [noise(), Noise::default()] {
        let mut log = PeriodicLog { noise, ..log(1, 10.0, 500) };
        let mut coefficients = log.motion.coefficients().clone();
        for channel in [2, 3, 4] {
            coefficients.column_mut(channel).fill(0.0);
        }
        log.motion = FourierMotion::try_new(*log.motion.basis(), log.motion.chart(), coefficients).unwrap();
        match identify_periodic(&log.samples(0), &settings(&log)).map(|found| found.warnings) {
            Err(IdentificationError::NotExcited { rank, .. }) => assert!(rank <= 7, "{rank}"),
            other => panic!("{other:?}"),
        }
    }
}

#[test]
fn long_periods_go_to_the_trajectory_likelihood_after_a_bounded_work() {
    let log = log(2, 50.0, 5000);
    let samples = log.samples(0);
    let record = average_cycles(&samples, &settings(&log)).unwrap().record;
    match likeliest_harmonics(&record, 10..=30) {
        Err(IdentificationError::SeriesTooLong { samples: 5000, work, .. }) => assert!(work <= LARGEST_WORK, "{work:e}"),
        other => panic!("{:?}", other.map(|(found, _)| found.cost)),
    }
    // Not even one step.
    match likeliest_harmonics(&record, 400..=400) {
        Err(IdentificationError::SeriesTooLong { harmonics: 400, work, .. }) => assert!(work == 0.0),
        other => panic!("{:?}", other.map(|(found, _)| found.cost)),
    }
}

/// What no series explains: gravity that is not told.
#[test]
fn a_scan_that_leads_nowhere_ends() {
    let log = PeriodicLog { gravity_world: Vector3::new(0.0, 0.0, -9.81), ..log(3, 10.0, 500) };
    let samples = log.samples(0);
    let record = average_cycles(&samples, &settings(&log)).unwrap().record;
    match likeliest_harmonics(&record, 3..=20) {
        Err(IdentificationError::NoSeriesExplains { reduced_chi_square, work, .. }) => {
            assert!(reduced_chi_square > 4.0 && work < LARGEST_WORK, "{reduced_chi_square} {work:e}");
        }
        other => panic!("{:?}", other.map(|(found, table)| (found.cost, table))),
    }
}
