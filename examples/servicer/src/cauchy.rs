//! An estimator of a record: least squares in which a row counts the less the farther it is off.

use tumble_planning::identification::estimator::{Estimator, EstimatorError, Finding};
use tumble_planning::identification::{MotionSample, Problem};
use tumble_planning::nalgebra::{SMatrix, SVector};

/// Rows weighted by the density of Cauchy, so that a plume that hits a panel or a stuck valve bends nothing.
pub struct Cauchy {
    /// The record as a regression: rows, noise, the size of the body.
    pub problem: Problem,
    /// How many standard deviations off a row counts half.
    pub half: f64,
}

/// An error of your own keeps its numbers all the way to the command line.
#[derive(Debug)]
pub struct Singular {
    /// How many rows do not determine ten parameters.
    pub rows: usize,
}

impl std::fmt::Display for Singular {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "{} rows do not determine ten parameters", self.rows)
    }
}

impl std::error::Error for Singular {}

impl Estimator for Cauchy {
    type Record = [MotionSample];

    fn estimate(&self, record: &[MotionSample]) -> Result<Finding, EstimatorError> {
        let (rows, scale) = (self.problem.rows(record)?, self.problem.scale);
        let (m, length) = (scale.parameter_magnitudes(), scale.length_m());
        let singular = || EstimatorError::foreign("cauchy", Singular { rows: rows.len() });
        // Torque counts at the body's length until residuals say more.
        let mut sigma = SVector::<f64, 6>::from([length, length, length, 1.0, 1.0, 1.0]);
        let (mut weights, mut found) = (vec![1.0; rows.len()], Err(singular()));
        for _ in 0..10 {
            let (mut a, mut b) = (SMatrix::<f64, 10, 10>::zeros(), SVector::<f64, 10>::zeros());
            for (row, weight) in rows.iter().zip(&weights) {
                let counts = SMatrix::<f64, 6, 6>::from_diagonal(&sigma.map(|s| weight / (s * s)));
                a += row.regressor.transpose() * counts * row.regressor;
                b += row.regressor.transpose() * counts * row.wrench;
            }
            let solver = a.component_mul(&(m * m.transpose())).cholesky().ok_or_else(singular)?;
            let point = solver.solve(&b.component_mul(&m)).component_mul(&m);
            // Neighbouring rows share samples, so they say less than as many independent ones.
            let covariance = solver.inverse().component_mul(&(m * m.transpose())) * self.problem.rows_alike();
            found = Finding::of_covariance(point, &covariance, m);
            let left: Vec<_> = rows.iter().map(|row| row.wrench - row.regressor * point).collect();
            let squares: SVector<f64, 6> = left.iter().zip(&weights).map(|(l, w)| l.component_mul(l) * *w).sum();
            sigma = squares.map(|s| (s / weights.iter().sum::<f64>()).sqrt());
            let off = |l: &SVector<f64, 6>| l.component_div(&sigma).norm_squared() / (6.0 * self.half * self.half);
            weights = left.iter().map(|l| 1.0 / (1.0 + off(l))).collect();
        }
        found
    }
}
