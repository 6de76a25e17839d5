//! Records that the likelihood of the series cannot answer: handed over after a bounded work, refused, or said.
#![allow(clippy::cast_possible_truncation, clippy::cast_sign_loss, clippy::cast_possible_wrap)]

use crate::periodic_log::{PeriodicLog, flown, noise, noisy};
use crate::random::Random;
use tumble_identification::dynamics::{InertialParameters, WrenchBox};
use tumble_identification::estimator::Verdict;
use tumble_identification::fourier::FourierMotion;
use tumble_identification::harmonics::{
    FourierFit, HarmonicEstimator, HarmonicIdentification, HarmonicSettings, HarmonicWarning, LARGEST_WORK,
    PeriodicLeastSquares, average_cycles, identify_periodic, likeliest_harmonics,
};
use tumble_identification::lie::{Pose, Wrench};
use tumble_identification::nalgebra::Vector3;
use tumble_identification::statistics::{mean_square_band, normalized_squared_error};
use tumble_identification::{IdentificationError, MotionSample, Noise, Settings, WrenchTiming, identify};

fn log(seed: u64, period_s: f64, samples_per_cycle: usize) -> PeriodicLog {
    let mut random = Random::new(seed);
    let motion = random.motion(period_s, 3);
    PeriodicLog { cycles: 4, samples_per_cycle, ..PeriodicLog::new(motion, random.load()) }
}

fn settings(log: &PeriodicLog) -> HarmonicSettings {
    HarmonicSettings { wrench_timing: WrenchTiming::Sampled, ..HarmonicSettings::new(log.motion.basis().period_s(), 3) }
}

fn has(found: &HarmonicIdentification, matches: impl Fn(&HarmonicWarning) -> bool) -> bool {
    found.warnings.iter().any(matches)
}

/// At least the square of any one number's error in its standard deviations.
fn squared_error(found: &HarmonicIdentification, body: &InertialParameters<f64>) -> f64 {
    let error = found.estimate.parameters.to_vector() - body.to_vector();
    normalized_squared_error(&error, &found.estimate.covariance).unwrap()
}

/// A motion flown with feedback of this bandwidth by a robot that does not know its load.
fn flight(
    seed: u64,
    bandwidth_rad_s: f64,
    shape: (usize, usize),
    noise: &Noise,
) -> (Vec<MotionSample>, InertialParameters<f64>) {
    let mut random = Random::new(seed);
    let (motion, load) = (random.motion(10.0, 3), random.load());
    let unlimited = WrenchBox { torque_limit: Vector3::repeat(1e3), force_limit: Vector3::repeat(1e3) };
    let (samples, _) = flown(&motion, &load, &unlimited, &Pose::identity(), bandwidth_rad_s, shape);
    (noisy(samples, &Pose::identity(), noise, seed), load)
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
fn a_scan_ends_when_its_work_is_spent() {
    let log = log(2, 50.0, 5000);
    let record = average_cycles(&log.samples(0), &settings(&log)).unwrap().record;
    match likeliest_harmonics(&record, 20..=60) {
        Err(IdentificationError::SeriesTooLong { samples: 5000, harmonics, work }) => {
            assert!(harmonics > 20 && work > 0.1 * LARGEST_WORK && work <= LARGEST_WORK, "{harmonics} {work:e}");
        }
        other => panic!("{:?}", other.map(|(found, _)| found.cost)),
    }
    // Not even one step.
    match likeliest_harmonics(&record, 400..=400) {
        Err(IdentificationError::SeriesTooLong { harmonics: 400, work, .. }) => assert!(work == 0.0),
        other => panic!("{:?}", other.map(|(found, _)| found.cost)),
    }
}

#[test]
fn too_much_work_goes_to_the_trajectory_likelihood() {
    let log = log(2, 10.0, 1000);
    let settings = HarmonicSettings { reference_harmonics: 70, largest_harmonics: 71, ..settings(&log) };
    let found = identify_periodic(&log.samples(0), &settings).unwrap();
    assert_eq!(found.estimator, HarmonicEstimator::TrajectoryLikelihood);
    assert!(has(&found, |w| matches!(w, HarmonicWarning::SeriesTooLong { harmonics: 70, samples: 1000 })));
    assert!(has(&found, |w| matches!(w, HarmonicWarning::TrajectoryLikelihood)));
    assert!(!has(&found, |w| matches!(w, HarmonicWarning::Widened | HarmonicWarning::ShortSeries { .. })));
    let trajectory = found.trajectory.as_ref().unwrap();
    assert_eq!((trajectory.estimate, trajectory.explained), (Some(found.estimate), Some(found.explained)));
    assert!(squared_error(&found, &log.body) < mean_square_band(10.0, 1, 0.9999).high);
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

/// A constant wrench that nobody tells: [`identify`] has no body for it, and neither has this.
#[test]
fn what_the_trajectory_likelihood_refuses_is_refused() {
    let (mut samples, _) = flight(32, 8.0, (6, 400), &noise());
    for sample in &mut samples {
        let bias = Wrench::new(Vector3::new(0.01, 0.02, -0.01), Vector3::new(0.2, -0.1, 0.3));
        sample.wrench_body = sample.wrench_body.map(|wrench| wrench + bias);
    }
    let settings = Settings { method: "maximum-likelihood", ..Settings::default() };
    let alone = identify(&samples, &settings).unwrap();
    assert!(alone.rank < 10 || matches!(alone.verdict, Verdict::NoBodyExplains { .. }));
    match identify_periodic(&samples, &HarmonicSettings::new(10.0, 3)) {
        Err(IdentificationError::NotExcited { rank, .. }) => assert_eq!(rank, alone.rank),
        other => assert!(matches!(other.unwrap().verdict, Verdict::NoBodyExplains { share } if share < 0.5)),
    }
}

/// A robot that drifts, which takes no wrench: the average of its cycles is no cycle, the trajectory is one all the same.
#[test]
fn cycles_that_differ_go_to_the_trajectory_likelihood() {
    let (mut samples, load) = flight(33, 8.0, (4, 500), &Noise { position_m: 0.005, attitude_rad: 0.003, ..noise() });
    for sample in &mut samples {
        sample.world_from_body.as_mut().unwrap().translation.vector.y += 0.05 * (sample.time_ns as f64 * 1e-9);
    }
    let found = identify_periodic(&samples, &HarmonicSettings::new(10.0, 3)).unwrap();
    assert!(has(&found, |w| matches!(w, HarmonicWarning::Leakage { ratio } if *ratio > 3.0)), "{:?}", found.warnings);
    assert_eq!(found.estimator, HarmonicEstimator::TrajectoryLikelihood);
    assert!(has(&found, |w| matches!(w, HarmonicWarning::TrajectoryLikelihood)));
    assert!(squared_error(&found, &load) < mean_square_band(10.0, 1, 0.9999).high, "{}", squared_error(&found, &load));
}

/// Six flights on which least squares is off by more than it knows of: said, and sigma wide enough.
#[test]
fn least_squares_says_when_it_is_off() {
    const RUNS: usize = 6;
    let (mut stated, mut alone) = (0.0, 0.0);
    for seed in 0..RUNS as u64 {
        let (samples, load) = flight(700 + seed, 8.0, (10, 400), &noise());
        let settings =
            HarmonicSettings { estimator: HarmonicEstimator::LeastSquares, ..HarmonicSettings::new(10.0, 3) };
        let found = identify_periodic(&samples, &settings).unwrap();
        assert_eq!(found.estimator, HarmonicEstimator::LeastSquares);
        assert!(has(&found, |w| matches!(w, HarmonicWarning::ShortSeries { .. })));
        assert!(has(&found, |w| matches!(w, HarmonicWarning::Widened)));
        stated += squared_error(&found, &load) / RUNS as f64;
        let fit = FourierFit::new(&found.record, found.harmonics()).unwrap();
        let plain = PeriodicLeastSquares::fit(&found.record, &fit).unwrap();
        let error = found.estimate.parameters.to_vector() - load.to_vector();
        alone += normalized_squared_error(&error, &plain.covariance).unwrap() / RUNS as f64;
    }
    let band = mean_square_band(10.0, RUNS, 0.9999);
    assert!(stated < band.high && alone > 2.0 * band.high, "{stated} {alone} {band}");
}

/// The wrench of every sample as somebody else logs it: `[torque; force]`, time, s.
fn logged(mut samples: Vec<MotionSample>, change: impl Fn(Wrench<f64>, f64) -> Wrench<f64>) -> Vec<MotionSample> {
    for sample in &mut samples {
        let time_s = sample.time_ns as f64 * 1e-9;
        sample.wrench_body = sample.wrench_body.map(|wrench| change(wrench, time_s));
    }
    samples
}

#[test]
fn healthy_periods_are_identified() {
    for seed in 0..5 {
        let log = PeriodicLog { cycles: 10, ..log(40 + seed, 10.0, 500) };
        for estimator in [HarmonicEstimator::Likelihood, HarmonicEstimator::LeastSquares] {
            let found =
                identify_periodic(&log.samples(seed), &HarmonicSettings { estimator, ..settings(&log) }).unwrap();
            println!("{seed} {:?}: {:?}, {:.1}", found.estimator, found.verdict, squared_error(&found, &log.body));
            assert!(found.verdict.is_identified(), "{seed} {estimator:?}: {:?}", found.verdict);
        }
    }
    for seed in 0..3 {
        let (samples, load) = flight(900 + seed, 8.0, (10, 400), &noise());
        let found = identify_periodic(&samples, &HarmonicSettings::new(10.0, 3)).unwrap();
        println!("flown {seed} {:?}: {:?}, {:.1}", found.estimator, found.verdict, squared_error(&found, &load));
        assert!(found.verdict.is_identified(), "{seed}: {:?}", found.verdict);
    }
}

/// Each before was an answer with a small sigma. A gain of all forces is one of the mass, and one of all torques is nearly one of the
/// inertia: nothing in a record shows them.
#[test]
fn planted_trouble_of_periods_is_not_identified() {
    let turn = |harmonic: f64, time_s: f64| std::f64::consts::TAU * harmonic * time_s / 10.0;
    let mut missed = Vec::new();
    for seed in 0..3 {
        let log = PeriodicLog { cycles: 10, ..log(60 + seed, 10.0, 500) };
        let one_axis = |wrench: Wrench<f64>, _: f64| {
            Wrench::new(wrench.torque, wrench.force.component_mul(&Vector3::new(1.03, 1.0, 1.0)))
        };
        let shaken = |harmonic: f64| {
            move |wrench: Wrench<f64>, time_s: f64| {
                let (sine, cosine) = turn(harmonic, time_s).sin_cos();
                wrench + Wrench::new(Vector3::y() * (2e-3 * cosine), Vector3::x() * (0.04 * sine))
            }
        };
        for (name, samples) in [
            ("gain of one axis", logged(log.samples(seed), one_axis)),
            ("disturbance at harmonic 2", logged(log.samples(seed), shaken(2.0))),
            ("disturbance at harmonic 5", logged(log.samples(seed), shaken(5.0))),
        ] {
            match identify_periodic(&samples, &settings(&log)) {
                Ok(found) => {
                    let squares = squared_error(&found, &log.body);
                    println!("{name} {seed} {:?}: {:?}, {squares:.1}", found.estimator, found.verdict);
                    // What does no harm need not be seen.
                    if found.verdict.is_identified() && squares > mean_square_band(10.0, 1, 0.9999).high {
                        missed.push((name, seed));
                    }
                }
                Err(error) => println!("{name} {seed}: {error}"),
            }
        }
    }
    assert!(missed.is_empty(), "{missed:?}");
}
