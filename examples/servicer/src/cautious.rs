//! An estimator of the body in flight on the shipped filter of the motion: a second of flight that surprises counts less.

use tumble_planning::identification::SquareRootInformation;
use tumble_planning::identification::estimator::{EstimatorError, Finding, Outcome, RecursiveEstimator};
use tumble_planning::identification::recursive::{Verdict, WindowRows};
use tumble_planning::nalgebra::{Cholesky, SMatrix};

/// Least squares by Huber's weights. [`TwoStageEstimator`](tumble_planning::identification::recursive::TwoStageEstimator) tells it once a
/// second what the motion said of the ten parameters: whitened rows, zero where nothing was seen.
pub struct Cautious {
    said: SquareRootInformation<10>,
    start: Finding,
}

/// Mean of the squared deviations from which on a window counts less.
const USUAL: f64 = 4.0;

impl Cautious {
    /// With what is known before.
    #[must_use]
    pub fn new(start: &Finding) -> Self {
        Self { said: *start.information(), start: start.clone() }
    }
}

impl RecursiveEstimator<10> for Cautious {
    type Observation = WindowRows;

    fn update(&mut self, rows: &WindowRows) -> Result<Outcome, EstimatorError> {
        let magnitudes = self.start.magnitudes();
        let (point, covariance) = (self.said.solve(magnitudes)?, self.said.covariance(magnitudes)?);
        let residual = rows.output - rows.regressor * point;
        let expected = rows.regressor * covariance * rows.regressor.transpose() + SMatrix::identity();
        let whitened = Cholesky::new(expected).map_or(residual * f64::NAN, |root| root.solve(&residual));
        let (nis, degrees_of_freedom) = (residual.dot(&whitened), 10);
        let weight = (USUAL * 10.0 / nis).sqrt().min(1.0);
        self.said.update(&(rows.regressor * weight), &(rows.output * weight))?;
        Ok(Outcome { nis, degrees_of_freedom, log_likelihood: None, gate: Verdict::Accepted })
    }

    fn finding(&self) -> Result<Finding, EstimatorError> {
        Ok(Finding::of_information(self.said, *self.start.magnitudes()).with_prior(*self.start.information()))
    }
}
