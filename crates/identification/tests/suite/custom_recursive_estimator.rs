//! Tutorial: bring your own recursive estimator. Three steps: implement, check the laws, use it like any other.
//!
//! The estimator here knows one number, the drag of a sail, from measured forces: a running mean with a weight, the Kalman
//! filter at its smallest.
#![allow(clippy::unwrap_used)]

use nalgebra::{SMatrix, SVector};
use tumble_identification::IdentificationError;
use tumble_identification::estimator::{EstimatorError, Finding, Outcome, RecursiveEstimator};
use tumble_identification::laws::{EstimatorPromises, check_recursive_estimator};
use tumble_identification::recursive::Verdict;

/// `force = drag * speed` with noise.
struct DragSample {
    speed_m_s: f64,
    force_n: f64,
}

struct Drag {
    mean: f64,
    variance: f64,
    /// Variance of a measured force, N^2.
    noise: f64,
    /// What it began with.
    start: Finding<1>,
}

impl Drag {
    fn try_new(mean: f64, variance: f64, noise: f64) -> Result<Self, EstimatorError> {
        Ok(Self { mean, variance, noise, start: known(mean, variance)? })
    }
}

fn known(mean: f64, variance: f64) -> Result<Finding<1>, EstimatorError> {
    Finding::of_covariance(SVector::from([mean]), &SMatrix::from([[variance]]), SVector::from([1.0]))
}

// Step 1: say what was unexpected in an observation, then learn from it; say what is known, and how much of it was known before. One
// parameter.
impl RecursiveEstimator<1> for Drag {
    type Observation = DragSample;

    fn update(&mut self, sample: &DragSample) -> Result<Outcome, EstimatorError> {
        let residual = sample.force_n - self.mean * sample.speed_m_s;
        if !residual.is_finite() {
            return Err(IdentificationError::NotFinite { row: 0 }.into());
        }
        let expected = sample.speed_m_s * self.variance * sample.speed_m_s + self.noise;
        let gain = self.variance * sample.speed_m_s / expected;
        self.mean += gain * residual;
        self.variance -= gain * sample.speed_m_s * self.variance;
        let nis = residual * residual / expected;
        let log_likelihood = Some(-0.5 * (nis + (expected * std::f64::consts::TAU).ln()));
        Ok(Outcome { nis, degrees_of_freedom: 1, log_likelihood, gate: Verdict::Accepted })
    }

    fn finding(&self) -> Result<Finding<1>, EstimatorError> {
        Ok(known(self.mean, self.variance)?.with_prior(*self.start.information()))
    }
}

#[test]
fn a_running_mean_of_ones_own() {
    let samples: Vec<DragSample> = (0..50)
        .map(|k| {
            let speed_m_s = 1.0 + 0.5 * f64::from(k).sin();
            DragSample { speed_m_s, force_n: 0.3 * speed_m_s + 0.01 * f64::from(7 * k % 11 - 5) }
        })
        .collect();
    let (variance, noise) = (100.0, 1e-3);

    // Step 2: the laws. What all samples together say is the prior and the normal equation.
    let information = 1.0 / variance + samples.iter().map(|s| s.speed_m_s.powi(2)).sum::<f64>() / noise;
    let moment = samples.iter().map(|s| s.speed_m_s * s.force_n).sum::<f64>() / noise;
    let batch = Some((SVector::from([moment / information]), SMatrix::from([[1.0 / information]])));
    let promises = EstimatorPromises { constant_parameters: true, batch, feasible_set: None };
    let each: Vec<&DragSample> = samples.iter().collect();
    check_recursive_estimator(&|| Drag::try_new(0.0, variance, noise), &each, &promises, 1e-9).unwrap();

    // Step 3: it is an estimator like any other.
    let mut estimator: Box<dyn RecursiveEstimator<1, Observation = DragSample>> =
        Box::new(Drag::try_new(0.0, variance, noise).unwrap());
    let mut sum_of_nis = 0.0;
    for sample in &samples {
        sum_of_nis += estimator.update(sample).unwrap().nis;
    }
    let found = estimator.finding().unwrap();
    assert!((found.point().unwrap()[0] - 0.3).abs() < 3.0 * found.covariance().unwrap()[0].sqrt());
    assert!((sum_of_nis / 50.0 - 1.0).abs() < 0.5, "{sum_of_nis}");
}
