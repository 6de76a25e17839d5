//! The extended Kalman filter, and what a model of a filter is.

use super::belief::{Rows, gated, symmetric};
use super::knowledge::Knowledge;
use super::{ChiSquareGate, RowsOutcome};
use crate::error::IdentificationError;
use crate::estimator::{EstimatorError, Finding, Outcome, RecursiveEstimator};
use crate::lie::Manifold;
use nalgebra::{SMatrix, SVector};

/// Motion and measurement of a state that `N` numbers move, with parameters of a body in it.
///
/// The state is a point of a manifold, so that attitudes stay attitudes; its coordinates are to be chosen such that every
/// point is physical, so that no estimate need be repaired.
///
/// # Shape
/// `N` coordinates of an increment of the state, at most `ROWS` measured numbers, `P` reported parameters.
pub trait FilterModel<const N: usize, const ROWS: usize, const P: usize> {
    /// What the filter knows.
    type State: Manifold<Scalar = f64, Tangent = SVector<f64, N>> + Copy;
    /// What one update needs: inputs and step since the last one, and measurements.
    type Observation;

    /// The state at the time of the observation.
    ///
    /// # Errors
    /// Where the inputs are not finite.
    fn propagate(
        &self,
        state: &Self::State,
        observation: &Self::Observation,
    ) -> Result<Self::State, IdentificationError>;

    /// Covariance that the step to the observation adds; `state` before the step.
    fn process_noise(&self, state: &Self::State, observation: &Self::Observation) -> SMatrix<f64, N, N>;

    /// Measured minus predicted; anything in rows that were not measured.
    fn residual(&self, state: &Self::State, observation: &Self::Observation) -> SVector<f64, ROWS>;

    /// Standard deviation of each measured row; infinite in the others.
    fn standard_deviation(&self, observation: &Self::Observation) -> SVector<f64, ROWS>;

    /// The parameters of the body.
    fn parameters(&self, state: &Self::State) -> SVector<f64, P>;

    /// Derivative of [`parameters`](Self::parameters) along an increment of the state.
    fn parameter_jacobian(&self, state: &Self::State) -> SMatrix<f64, P, N>;
}

/// A [`FilterModel`] that knows its derivatives.
pub trait DifferentiableModel<const N: usize, const ROWS: usize, const P: usize>: FilterModel<N, ROWS, P> {
    /// Φ P Φᵀ + Q of the step to the observation, about `state` before the step.
    fn predicted_covariance(
        &self,
        state: &Self::State,
        observation: &Self::Observation,
        covariance: &SMatrix<f64, N, N>,
    ) -> SMatrix<f64, N, N>;

    /// −∂residual/∂increment, the change of the prediction along an increment of the state.
    fn sensitivity(&self, state: &Self::State, observation: &Self::Observation) -> SMatrix<f64, ROWS, N>;
}

/// The Kalman filter of a linearised model.
///
/// # Shape
/// As its [`FilterModel`]: `N` coordinates of the state, `ROWS` measured numbers, `P` parameters; [`new`](Self::new) takes them from the
/// model.
/// # Source
/// Thesis table A.2, (A.39), (A.40), (6.10), (6.11).
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ExtendedKalmanFilter<M, S, const N: usize, const ROWS: usize, const P: usize> {
    model: M,
    state: S,
    covariance: SMatrix<f64, N, N>,
    gate: Option<ChiSquareGate>,
    start: Knowledge<P>,
}

impl<M, S, const N: usize, const ROWS: usize, const P: usize> ExtendedKalmanFilter<M, S, N, ROWS, P>
where
    M: FilterModel<N, ROWS, P, State = S>,
    S: Manifold<Scalar = f64, Tangent = SVector<f64, N>> + Copy,
{
    /// Starts from this knowledge; the covariance is that of an increment of the state. Accepts every observation.
    pub fn new(model: M, state: S, covariance: SMatrix<f64, N, N>) -> Self {
        let start = parameters_of(&model, &state, &covariance);
        Self { model, state, covariance, gate: None, start }
    }

    /// The same behind a gate.
    pub fn with_gate(self, gate: ChiSquareGate) -> Self {
        Self { gate: Some(gate), ..self }
    }

    /// The same with another covariance of the state.
    pub fn with_state_covariance(self, covariance: SMatrix<f64, N, N>) -> Self {
        Self { covariance, ..self }
    }

    /// The model.
    pub fn model(&self) -> &M {
        &self.model
    }

    /// The estimated state.
    pub fn state(&self) -> S {
        self.state
    }

    /// Covariance of an increment of the state.
    pub fn state_covariance(&self) -> &SMatrix<f64, N, N> {
        &self.covariance
    }

    /// The present parameters.
    pub fn parameters(&self) -> SVector<f64, P> {
        self.model.parameters(&self.state)
    }

    /// Their covariance.
    pub fn covariance(&self) -> SMatrix<f64, P, P> {
        parameters_of(&self.model, &self.state, &self.covariance).covariance
    }
}

/// What the belief of a state says of the parameters.
pub(super) fn parameters_of<M, const N: usize, const ROWS: usize, const P: usize>(
    model: &M,
    state: &M::State,
    covariance: &SMatrix<f64, N, N>,
) -> Knowledge<P>
where
    M: FilterModel<N, ROWS, P>,
{
    let jacobian = model.parameter_jacobian(state);
    let covariance = symmetric(&(jacobian * covariance * jacobian.transpose()));
    Knowledge { mean: model.parameters(state), covariance }
}

impl<M, const N: usize, const ROWS: usize, const P: usize> ExtendedKalmanFilter<M, M::State, N, ROWS, P>
where
    M: DifferentiableModel<N, ROWS, P>,
{
    /// Goes on to the observation, judges it and, unless it is rejected, learns from it.
    ///
    /// # Errors
    /// Those of [`FilterModel::propagate`]; [`IdentificationError::NotPositive`], [`IdentificationError::NotFinite`]; nothing is changed
    /// then.
    #[inline]
    pub fn update_rows(&mut self, observation: &M::Observation) -> Result<RowsOutcome<ROWS>, IdentificationError> {
        let model = &self.model;
        let state = model.propagate(&self.state, observation)?;
        let mut covariance = model.predicted_covariance(&self.state, observation, &self.covariance);
        let rows = Rows {
            sensitivity: model.sensitivity(&state, observation),
            residual: model.residual(&state, observation),
            standard_deviation: model.standard_deviation(observation),
        };
        let (step, outcome) = gated(&mut self.gate, &mut covariance, |p| rows.correct(p))?;
        self.state = step.map_or(state, |step| state.oplus(&step));
        self.covariance = covariance;
        Ok(outcome)
    }
}

/// The prior of its findings is what it was begun with, as if nothing had drifted since.
impl<M, const N: usize, const ROWS: usize, const P: usize> RecursiveEstimator<P>
    for ExtendedKalmanFilter<M, M::State, N, ROWS, P>
where
    M: DifferentiableModel<N, ROWS, P>,
{
    type Observation = M::Observation;

    #[inline]
    fn update(&mut self, observation: &M::Observation) -> Result<Outcome, EstimatorError> {
        Ok(self.update_rows(observation)?.into())
    }

    fn finding(&self) -> Result<Finding<P>, EstimatorError> {
        self.start.then(self.parameters(), &self.covariance())
    }
}
