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
///
/// # Example
/// ```
/// use tumble_identification::IdentificationError;
/// use tumble_identification::nalgebra::{SMatrix, SVector, Vector2};
/// use tumble_identification::recursive::{DifferentiableModel, ExtendedKalmanFilter, FilterModel};
///
/// /// A cart: its speed (m/s) and the logarithm of its mass, which stays positive whatever is learned.
/// struct Cart;
/// struct Look {
///     force_n: f64,
///     step_s: f64,
///     speed_m_s: f64,
/// }
/// impl FilterModel<2, 1, 1> for Cart {
///     type State = Vector2<f64>;
///     type Observation = Look;
///     fn propagate(&self, x: &Vector2<f64>, look: &Look) -> Result<Vector2<f64>, IdentificationError> {
///         Ok(Vector2::new(x[0] + look.force_n * (-x[1]).exp() * look.step_s, x[1]))
///     }
///     fn process_noise(&self, _x: &Vector2<f64>, _look: &Look) -> SMatrix<f64, 2, 2> {
///         SMatrix::identity() * 1e-12
///     }
///     fn residual(&self, x: &Vector2<f64>, look: &Look) -> SVector<f64, 1> {
///         SVector::from([look.speed_m_s - x[0]])
///     }
///     fn standard_deviation(&self, _look: &Look) -> SVector<f64, 1> {
///         SVector::from([1e-3])
///     }
///     fn parameters(&self, x: &Vector2<f64>) -> SVector<f64, 1> {
///         SVector::from([x[1].exp()])
///     }
///     fn parameter_jacobian(&self, x: &Vector2<f64>) -> SMatrix<f64, 1, 2> {
///         SMatrix::from([[0.0], [x[1].exp()]])
///     }
/// }
/// impl DifferentiableModel<2, 1, 1> for Cart {
///     fn predicted_covariance(&self, x: &Vector2<f64>, look: &Look, p: &SMatrix<f64, 2, 2>) -> SMatrix<f64, 2, 2> {
///         let by_mass = -look.force_n * (-x[1]).exp() * look.step_s;
///         let phi = SMatrix::<f64, 2, 2>::new(1.0, by_mass, 0.0, 1.0);
///         phi * p * phi.transpose() + self.process_noise(x, look)
///     }
///     fn sensitivity(&self, _x: &Vector2<f64>, _look: &Look) -> SMatrix<f64, 1, 2> {
///         SMatrix::from([[1.0], [0.0]])
///     }
/// }
/// let start = Vector2::new(0.0, 1.8_f64.ln());
/// let mut filter = ExtendedKalmanFilter::new(Cart, start, SMatrix::from_diagonal(&Vector2::new(1e-6, 0.04)));
/// for step in 1..=50 {
///     let force_n = if step <= 25 { 2.0 } else { -2.0 };
///     let speed_m_s = 0.1 * (25.0 - (25.0 - f64::from(step)).abs()); // of a cart of two kilograms
///     filter.update_rows(&Look { force_n, step_s: 0.1, speed_m_s })?;
/// }
/// assert!((filter.parameters()[0] - 2.0).abs() < 0.02);
/// # Ok::<(), IdentificationError>(())
/// ```
/// Tutorial: [the body on its principal axes](https://github.com/tumble-robotics/tumble/blob/main/crates/identification/src/recursive/principal_body.rs).
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
///
/// # Example
/// That of [`FilterModel`], whose derivatives by differences are those that are written:
/// ```
/// use tumble_identification::IdentificationError;
/// use tumble_identification::nalgebra::{SMatrix, SVector};
/// use tumble_identification::recursive::{DifferentiableModel, FilterModel};
///
/// /// A level that stays, measured as it is.
/// struct Level;
/// impl FilterModel<1, 1, 1> for Level {
///     type State = SVector<f64, 1>;
///     type Observation = f64;
///     fn propagate(&self, x: &SVector<f64, 1>, _seen: &f64) -> Result<SVector<f64, 1>, IdentificationError> {
///         Ok(*x)
///     }
///     fn process_noise(&self, _x: &SVector<f64, 1>, _seen: &f64) -> SMatrix<f64, 1, 1> {
///         SMatrix::zeros()
///     }
///     fn residual(&self, x: &SVector<f64, 1>, seen: &f64) -> SVector<f64, 1> {
///         SVector::from([seen - x[0]])
///     }
///     fn standard_deviation(&self, _seen: &f64) -> SVector<f64, 1> {
///         SVector::from([1.0])
///     }
///     fn parameters(&self, x: &SVector<f64, 1>) -> SVector<f64, 1> {
///         *x
///     }
///     fn parameter_jacobian(&self, _x: &SVector<f64, 1>) -> SMatrix<f64, 1, 1> {
///         SMatrix::identity()
///     }
/// }
/// impl DifferentiableModel<1, 1, 1> for Level {
///     fn predicted_covariance(&self, _x: &SVector<f64, 1>, _seen: &f64, p: &SMatrix<f64, 1, 1>) -> SMatrix<f64, 1, 1> {
///         *p
///     }
///     fn sensitivity(&self, _x: &SVector<f64, 1>, _seen: &f64) -> SMatrix<f64, 1, 1> {
///         SMatrix::identity()
///     }
/// }
/// let at = |x: f64| Level.residual(&SVector::from([x]), &3.0)[0];
/// let by_differences = (at(1.0 - 1e-6) - at(1.0 + 1e-6)) / 2e-6;
/// assert!((Level.sensitivity(&SVector::from([1.0]), &3.0)[0] - by_differences).abs() < 1e-9);
/// ```
/// Tutorial: [the principal body](https://github.com/tumble-robotics/tumble/blob/main/crates/identification/src/recursive/principal_body.rs).
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
