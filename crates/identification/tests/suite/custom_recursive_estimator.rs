//! Tutorial: bring your own recursive estimator. Three steps: implement, check the laws, use it like any other.
//!
//! The estimator here knows one number, the drag of a sail, from measured forces: a running mean with a weight, the Kalman
//! filter at its smallest.
#![allow(clippy::unwrap_used)]

use nalgebra::{SMatrix, SVector};
use tumble_identification::IdentificationError;
use tumble_identification::laws::{EstimatorPromises, check_recursive_estimator};
use tumble_identification::recursive::{Innovation, Outcome, RecursiveEstimator, Verdict};

/// `force = drag * speed` with noise.
struct DragSample {
    speed_m_s: f64,
    force_n: f64,
}

#[derive(Clone)]
struct Drag {
    mean: f64,
    variance: f64,
    /// Variance of a measured force, N^2.
    noise: f64,
}

// Step 1: say what was unexpected in an observation, then learn from it. One parameter, one row.
impl RecursiveEstimator<1, 1> for Drag {
    type Observation = DragSample;

    fn update(&mut self, sample: &DragSample) -> Result<Outcome<1>, IdentificationError> {
        let residual = sample.force_n - self.mean * sample.speed_m_s;
        if !residual.is_finite() {
            return Err(IdentificationError::NotFinite { row: 0 });
        }
        let expected = sample.speed_m_s * self.variance * sample.speed_m_s + self.noise;
        let gain = self.variance * sample.speed_m_s / expected;
        self.mean += gain * residual;
        self.variance -= gain * sample.speed_m_s * self.variance;
        let innovation = Innovation {
            residual: SVector::from([residual]),
            covariance: SMatrix::from([[expected]]),
            nis: residual * residual / expected,
            degrees_of_freedom: 1,
            determinant: expected,
        };
        Ok(Outcome { innovation, verdict: Verdict::Accepted })
    }

    fn parameters(&self) -> SVector<f64, 1> {
        SVector::from([self.mean])
    }

    fn covariance(&self) -> SMatrix<f64, 1, 1> {
        SMatrix::from([[self.variance]])
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
    let start = Drag { mean: 0.0, variance: 100.0, noise: 1e-3 };

    // Step 2: the laws. What all samples together say is the prior and the normal equation.
    let information = 1.0 / start.variance + samples.iter().map(|s| s.speed_m_s.powi(2)).sum::<f64>() / start.noise;
    let moment = samples.iter().map(|s| s.speed_m_s * s.force_n).sum::<f64>() / start.noise;
    let batch = Some((SVector::from([moment / information]), SMatrix::from([[1.0 / information]])));
    let promises = EstimatorPromises { constant_parameters: true, batch, feasible_set: None };
    check_recursive_estimator(&start, &samples, &promises, 1e-9).unwrap();

    // Step 3: it is an estimator like any other.
    let mut estimator: Box<dyn RecursiveEstimator<1, 1, Observation = DragSample>> = Box::new(start);
    let mut sum_of_nis = 0.0;
    for sample in &samples {
        sum_of_nis += estimator.update(sample).unwrap().innovation.nis;
    }
    assert!((estimator.parameters()[0] - 0.3).abs() < 3.0 * estimator.covariance()[0].sqrt());
    assert!((sum_of_nis / 50.0 - 1.0).abs() < 0.5, "{sum_of_nis}");
}
