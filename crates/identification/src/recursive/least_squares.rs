//! Recursive least squares in covariance form.

use super::belief::{Rows, gated};
use super::knowledge::Knowledge;
use super::{ChiSquareGate, LinearObservation, RowsOutcome};
use crate::error::IdentificationError;
use crate::estimator::{EstimatorError, Finding, Outcome, RecursiveEstimator};
use nalgebra::{SMatrix, SVector};

/// Recursive least squares of `P` constant parameters from blocks of `ROWS` rows.
///
/// The covariance form: fastest, and good while the prior is not surer or vaguer than the data by more than ten digits;
/// [`SquareRootFilter`](super::SquareRootFilter) has no such limit.
///
/// # Source
/// Thesis (6.26)-(6.28), (A.25)-(A.34), (A.36).
///
/// # Deviation
/// (A.35) prints P after the update and the weight where P before it and its inverse belong (test
/// `printed_gain_of_the_appendix_diverges`). (6.27) names no P; it is that before the update. Rows are taken one after the
/// other, which gives the same numbers without an inverse.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct RecursiveLeastSquares<const P: usize, const ROWS: usize> {
    parameters: SVector<f64, P>,
    covariance: SMatrix<f64, P, P>,
    gate: Option<ChiSquareGate>,
    start: Knowledge<P>,
}

impl<const P: usize, const ROWS: usize> RecursiveLeastSquares<P, ROWS> {
    /// Starts from this knowledge, which may be vague; accepts every observation.
    pub fn new(parameters: SVector<f64, P>, covariance: SMatrix<f64, P, P>) -> Self {
        Self { parameters, covariance, gate: None, start: Knowledge { mean: parameters, covariance } }
    }

    /// The same behind a gate.
    pub fn with_gate(self, gate: ChiSquareGate) -> Self {
        Self { gate: Some(gate), ..self }
    }
}

impl<const P: usize, const ROWS: usize> RecursiveLeastSquares<P, ROWS> {
    /// Judges the rows and, unless they are rejected, learns from them.
    ///
    /// # Errors
    /// [`IdentificationError::NotPositive`], [`IdentificationError::NotFinite`]; nothing is changed then.
    #[inline]
    pub fn update_rows(
        &mut self,
        observation: &LinearObservation<ROWS, P>,
    ) -> Result<RowsOutcome<ROWS>, IdentificationError> {
        let rows = observation.rows_about(&self.parameters);
        let (step, outcome) = gated(&mut self.gate, &mut self.covariance, |p| rows.correct(p))?;
        if let Some(step) = step {
            self.parameters += step;
        }
        Ok(outcome)
    }

    /// The present estimate.
    pub fn parameters(&self) -> SVector<f64, P> {
        self.parameters
    }

    /// Its covariance.
    pub fn covariance(&self) -> SMatrix<f64, P, P> {
        self.covariance
    }
}

impl<const P: usize, const ROWS: usize> RecursiveEstimator<P> for RecursiveLeastSquares<P, ROWS> {
    type Observation = LinearObservation<ROWS, P>;

    #[inline]
    fn update(&mut self, observation: &Self::Observation) -> Result<Outcome, EstimatorError> {
        Ok(self.update_rows(observation)?.into())
    }

    fn finding(&self) -> Result<Finding<P>, EstimatorError> {
        self.start.then(self.parameters, &self.covariance)
    }
}

impl<const ROWS: usize, const P: usize> LinearObservation<ROWS, P> {
    /// The rows as seen from an estimate.
    pub(super) fn rows_about(&self, parameters: &SVector<f64, P>) -> Rows<P, ROWS> {
        Rows {
            sensitivity: self.regressor,
            residual: self.output - self.regressor * parameters,
            standard_deviation: self.standard_deviation,
        }
    }
}
