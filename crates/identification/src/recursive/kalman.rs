//! The linear Kalman filter.

use super::belief::{gated, symmetric};
use super::{ChiSquareGate, LinearObservation, Outcome, RecursiveEstimator};
use crate::error::IdentificationError;
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
}

impl<const N: usize, const ROWS: usize> KalmanFilter<N, ROWS> {
    /// Starts from this knowledge; accepts every observation.
    pub fn new(process: LinearProcess<N>, state: SVector<f64, N>, covariance: SMatrix<f64, N, N>) -> Self {
        Self { process, state, covariance, gate: None }
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
        self.covariance = symmetric(&(transition * self.covariance * transition.transpose())) + noise;
    }

    /// Learns from an observation of the present state.
    ///
    /// # Errors
    /// [`IdentificationError::NotPositive`], [`IdentificationError::NotFinite`]; nothing is changed then.
    #[inline]
    pub fn correct(&mut self, observation: &LinearObservation<ROWS, N>) -> Result<Outcome<ROWS>, IdentificationError> {
        let rows = observation.rows_about(&self.state);
        let (step, outcome) = gated(&mut self.gate, &mut self.covariance, |p| rows.correct(p))?;
        if let Some(step) = step {
            self.state += step;
        }
        Ok(outcome)
    }
}

impl<const N: usize, const ROWS: usize> RecursiveEstimator<N, ROWS> for KalmanFilter<N, ROWS> {
    type Observation = LinearObservation<ROWS, N>;

    #[inline]
    fn update(&mut self, observation: &Self::Observation) -> Result<Outcome<ROWS>, IdentificationError> {
        let mut next = *self;
        next.predict(&SVector::zeros());
        let outcome = next.correct(observation)?;
        *self = next;
        Ok(outcome)
    }

    fn parameters(&self) -> SVector<f64, N> {
        self.state
    }

    fn covariance(&self) -> SMatrix<f64, N, N> {
        self.covariance
    }
}
