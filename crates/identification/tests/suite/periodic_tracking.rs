//! Periodic motions flown with feedback by a robot that does not know its load: more harmonics than the reference has.
#![allow(clippy::cast_possible_truncation, clippy::cast_sign_loss, clippy::cast_possible_wrap)]

use crate::periodic_log::{flown, noise, noisy};
use crate::random::Random;
use tumble_identification::dynamics::{InertialParameters, WrenchBox};
use tumble_identification::fourier::{AttitudeChart, FourierMotion};
use tumble_identification::harmonics::{
    HarmonicEstimator, HarmonicIdentification, HarmonicSettings, PeriodicRecord, average_cycles, cramer_rao,
    identify_periodic, likeliest_harmonics, maximum_likelihood,
};
use tumble_identification::lie::Pose;
use tumble_identification::nalgebra::Vector3;
use tumble_identification::statistics::{mean_square_band, normalized_squared_error};
use tumble_identification::{Estimate, MotionSample, Noise};

const REFERENCE: usize = 3;
const CYCLES: usize = 10;
const SAMPLES: usize = 400;

/// Wrench noise five times that of the studies: with so few samples the steps of the held wrench would show otherwise.
fn flight_noise() -> Noise {
    Noise { torque_n_m: 0.005, force_n: 0.05, ..noise() }
}

struct Flight {
    reference: FourierMotion,
    load: InertialParameters<f64>,
    samples: Vec<MotionSample>,
}

impl Flight {
    /// Within 0.75 m and 0.8 rad, without limits of the actuators.
    fn new(seed: u64) -> Self {
        let mut random = Random::new(seed);
        let (reference, load) = (random.motion(10.0, REFERENCE), random.load());
        let unlimited = WrenchBox { torque_limit: Vector3::repeat(1e3), force_limit: Vector3::repeat(1e3) };
        let (samples, saturation) = flown(&reference, &load, &unlimited, &Pose::identity(), 8.0, (CYCLES, SAMPLES));
        assert!(saturation == 0.0, "{saturation}");
        Self { reference, load, samples: noisy(samples, &Pose::identity(), &flight_noise(), seed) }
    }

    fn settings(&self) -> HarmonicSettings {
        HarmonicSettings::new(self.reference.basis().period_s(), REFERENCE)
    }

    fn record(&self) -> PeriodicRecord {
        average_cycles(&self.samples, &self.settings()).unwrap().record
    }

    fn identified(&self, estimator: HarmonicEstimator) -> HarmonicIdentification {
        identify_periodic(&self.samples, &HarmonicSettings { estimator, ..self.settings() }).unwrap()
    }

    fn normalized_squared_error(&self, found: &Estimate) -> f64 {
        let error = found.parameters.to_vector() - self.load.to_vector();
        normalized_squared_error(&error, &found.covariance).unwrap()
    }
}

/// Six flights: errors as stated with the harmonics that Akaike's criterion chooses, far from it with those whose residual of
/// least squares is least.
#[test]
fn the_likelihood_needs_the_harmonics_that_tracking_adds() {
    const RUNS: usize = 6;
    let (mut sum, mut least_with_few) = (0.0, f64::INFINITY);
    for seed in 0..RUNS as u64 {
        let flight = Flight::new(500 + seed);
        let likely = flight.identified(HarmonicEstimator::Likelihood);
        assert_eq!(likely.estimator, HarmonicEstimator::Likelihood);
        let by_residual = flight.identified(HarmonicEstimator::LeastSquares).harmonics();
        assert!(by_residual < likely.harmonics(), "{by_residual} {}", likely.harmonics());
        let with_few = maximum_likelihood(&likely.record, by_residual).unwrap();
        let (error, with_few) =
            (flight.normalized_squared_error(&likely.estimate), flight.normalized_squared_error(&with_few.estimate));
        sum += error;
        least_with_few = least_with_few.min(with_few);
    }
    let band = mean_square_band(10.0, RUNS, 0.9999);
    assert!(band.contains(sum / RUNS as f64), "{} {band}", sum / RUNS as f64);
    assert!(least_with_few > 20.0 * band.high, "{least_with_few}");
}

/// From the solution of fewer harmonics, and not to the end: nothing is lost by either near the best.
#[test]
fn the_scan_of_harmonics_finds_what_each_alone_finds() {
    let mut compared = 0;
    let record = Flight::new(500).record();
    let (found, table) = likeliest_harmonics(&record, REFERENCE..=20).unwrap();
    let chosen = found.motion.basis().harmonics();
    let alone = maximum_likelihood(&record, chosen).unwrap();
    let apart = found.estimate.parameters.to_vector() - alone.estimate.parameters.to_vector();
    assert!(normalized_squared_error(&apart, &alone.estimate.covariance).unwrap() < 1e-5);
    assert!((found.cost - alone.cost).abs() < 1e-5, "{} {}", found.cost, alone.cost);
    let least = table.iter().map(|(_, criterion)| *criterion).fold(f64::INFINITY, f64::min);
    for (harmonics, criterion) in table.into_iter().filter(|(_, criterion)| *criterion < least + 50.0) {
        let alone = maximum_likelihood(&record, harmonics).unwrap().cost + (12 * (2 * harmonics + 1)) as f64;
        assert!((criterion - alone).abs() < 0.2, "{harmonics}: {criterion} {alone}");
        compared += 1;
    }
    assert!(compared > 6, "{compared}");
}

/// A flight's own sigmas are those that the bound lets expect of the reference with as many harmonics free, though it flew another
/// motion; where the motion is held to be the reference exactly, the bound promises more.
#[test]
fn the_bound_with_free_harmonics_is_that_of_a_flight() {
    for seed in 500..506 {
        let flight = Flight::new(seed);
        let found = flight.identified(HarmonicEstimator::Likelihood);
        let ratios = |harmonics: usize| {
            let motion = flight.reference.extended_to(harmonics);
            let bound = cramer_rao(&motion, &flight.load, SAMPLES, found.cycles_used, &flight_noise()).unwrap();
            let bound = bound.covariance.unwrap();
            let mut ratios = [0; 10].map(f64::from);
            for (i, ratio) in ratios.iter_mut().enumerate() {
                *ratio = (found.estimate.covariance[(i, i)] / bound[(i, i)]).sqrt();
            }
            ratios.sort_by(f64::total_cmp);
            ratios
        };
        let (held, free) = (ratios(REFERENCE), ratios(found.harmonics()));
        // What the tracker adds to the motion also shows the body: better than the bound of the reference by up to a half.
        assert!(free[0] > 0.5 && free[9] < 1.2, "{seed} {free:?}");
        assert!(held[9] > 1.2 && held.iter().zip(&free).all(|(held, free)| held > free), "{seed} {held:?} {free:?}");
    }
}

/// Four components of a quaternion hold three numbers of noise: counted as four, chance would not explain the residuals.
#[test]
fn the_likelihood_answers_in_quaternions_too() {
    let flight = Flight::new(500);
    let settings = HarmonicSettings { chart: AttitudeChart::Quaternion, ..flight.settings() };
    let found = identify_periodic(&flight.samples, &settings).unwrap();
    assert_eq!(found.estimator, HarmonicEstimator::Likelihood);
    let attitude = found.noise.attitude_rad / flight_noise().attitude_rad;
    // Of turns, less than of the angles that the noise is added to where pitch is steep.
    assert!((0.9..1.02).contains(&attitude), "{attitude}");
    let ratio = maximum_likelihood(&found.record, found.harmonics()).unwrap().reduced_chi_square();
    assert!((ratio - 1.0).abs() < 0.05, "{ratio}");
    assert!(mean_square_band(10.0, 1, 0.9999).contains(flight.normalized_squared_error(&found.estimate)));
}
