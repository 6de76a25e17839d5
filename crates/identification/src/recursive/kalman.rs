//! The linear Kalman filter.

use super::belief::{gated, symmetric};
use super::knowledge::Knowledge;
use super::{ChiSquareGate, LinearObservation, RowsOutcome};
use crate::error::IdentificationError;
use crate::estimator::{EstimatorError, Finding, Outcome, RecursiveEstimator};
use nalgebra::{SMatrix, SVector};

/// How a linear state moves from one observation to the next: x ← transition · x + noise.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct LinearProcess<const N: usize> {
    /// Φ.
    pub transition: SMatrix<f64, N, N>,
    /// Q, the covariance that a step adds.
    pub noise: SMatrix<f64, N, N>,
}

impl<const N: usize> LinearProcess<N> {
    /// Parameters that drift: x ← x + noise.
    ///
    /// # Source
    /// Thesis (6.10), (6.11).
    pub fn random_walk(noise: SMatrix<f64, N, N>) -> Self {
        Self { transition: SMatrix::identity(), noise }
    }
}

/// The Kalman filter of a linear state; with a random walk, least squares that forgets.
///
/// An update of the trait is [`predict`](Self::predict) without input, then [`correct`](Self::correct); a rejected
/// observation leaves the prediction in place.
///
/// # Source
/// Thesis table A.1, (A.37), (A.38).
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct KalmanFilter<const N: usize, const ROWS: usize> {
    process: LinearProcess<N>,
    state: SVector<f64, N>,
    covariance: SMatrix<f64, N, N>,
    gate: Option<ChiSquareGate>,
    /// What is left of the start: it moves and fades as the state does.
    start: Knowledge<N>,
}

impl<const N: usize, const ROWS: usize> KalmanFilter<N, ROWS> {
    /// Starts from this knowledge; accepts every observation.
    pub fn new(process: LinearProcess<N>, state: SVector<f64, N>, covariance: SMatrix<f64, N, N>) -> Self {
        Self { process, state, covariance, gate: None, start: Knowledge { mean: state, covariance } }
    }

    /// The same behind a gate.
    pub fn with_gate(self, gate: ChiSquareGate) -> Self {
        Self { gate: Some(gate), ..self }
    }

    /// Moves the state on by one step: x ← Φ x + `input`, the printed `B u`.
    #[inline]
    pub fn predict(&mut self, input: &SVector<f64, N>) {
        let LinearProcess { transition, noise } = &self.process;
        self.state = transition * self.state + input;
        let moved =
            |covariance: &SMatrix<f64, N, N>| symmetric(&(transition * covariance * transition.transpose())) + noise;
        self.covariance = moved(&self.covariance);
        self.start =
            Knowledge { mean: transition * self.start.mean + input, covariance: moved(&self.start.covariance) };
    }

    /// Learns from an observation of the present state.
    ///
    /// # Errors
    /// [`IdentificationError::NotPositive`], [`IdentificationError::NotFinite`]; nothing is changed then.
    #[inline]
    pub fn correct(
        &mut self,
        observation: &LinearObservation<ROWS, N>,
    ) -> Result<RowsOutcome<ROWS>, IdentificationError> {
        let rows = observation.rows_about(&self.state);
        let (step, outcome) = gated(&mut self.gate, &mut self.covariance, |p| rows.correct(p))?;
        if let Some(step) = step {
            self.state += step;
        }
        Ok(outcome)
    }
}

impl<const N: usize, const ROWS: usize> KalmanFilter<N, ROWS> {
    /// [`predict`](Self::predict) without input, then [`correct`](Self::correct); a rejected observation leaves the prediction in place.
    ///
    /// # Errors
    /// As [`correct`](Self::correct); nothing is changed then, the prediction included.
    #[inline]
    pub fn update_rows(
        &mut self,
        observation: &LinearObservation<ROWS, N>,
    ) -> Result<RowsOutcome<ROWS>, IdentificationError> {
        let mut next = *self;
        next.predict(&SVector::zeros());
        let outcome = next.correct(observation)?;
        *self = next;
        Ok(outcome)
    }

    /// The present state.
    pub fn parameters(&self) -> SVector<f64, N> {
        self.state
    }

    /// Its covariance.
    pub fn covariance(&self) -> SMatrix<f64, N, N> {
        self.covariance
    }
}

impl<const N: usize, const ROWS: usize> RecursiveEstimator<N> for KalmanFilter<N, ROWS> {
    type Observation = LinearObservation<ROWS, N>;

    #[inline]
    fn update(&mut self, observation: &Self::Observation) -> Result<Outcome, EstimatorError> {
        Ok(self.update_rows(observation)?.into())
    }

    fn finding(&self) -> Result<Finding<N>, EstimatorError> {
        self.start.then(self.state, &self.covariance)
    }
}
