//! The unscented Kalman filter: a model's derivatives are not needed, only the model.

use super::belief::{Correction, check_deviations, gated, measured_only, product_with_transpose};
use super::extended_kalman::{FilterModel, parameters_of};
use super::knowledge::Knowledge;
use super::{ChiSquareGate, Innovation, RowsOutcome};
use crate::error::IdentificationError;
use crate::estimator::{EstimatorError, Finding, Outcome, RecursiveEstimator};
use crate::householder::sqrt;
use crate::lie::Manifold;
use nalgebra::{SMatrix, SVector};

/// The Kalman filter by sigma points, on the manifold of the state.
///
/// The 2 N points lie at √N standard deviations along the columns of a root of the covariance and weigh the same: the set
/// without a centre, whose covariances cannot be indefinite. Means are taken in the chart about the image of the estimate.
///
/// # Shape
/// As its [`FilterModel`]: `N` coordinates of the state, `ROWS` measured numbers, `P` parameters; [`new`](Self::new) takes them from the
/// model.
/// # Source
/// Thesis A.2.2 after (A.40), figure A.2.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct UnscentedKalmanFilter<M, S, const N: usize, const ROWS: usize, const P: usize> {
    model: M,
    state: S,
    covariance: SMatrix<f64, N, N>,
    gate: Option<ChiSquareGate>,
    start: Knowledge<P>,
}

impl<M, S, const N: usize, const ROWS: usize, const P: usize> UnscentedKalmanFilter<M, S, N, ROWS, P>
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

    /// Goes on to the observation, judges it and, unless it is rejected, learns from it.
    ///
    /// # Errors
    /// Those of [`FilterModel::propagate`]; [`IdentificationError::NotPositive`], [`IdentificationError::NotFinite`]; nothing is changed
    /// then.
    pub fn update_rows(&mut self, observation: &M::Observation) -> Result<RowsOutcome<ROWS>, IdentificationError> {
        let (state, mut covariance) = self.predict(observation)?;
        let model = &self.model;
        let (step, outcome) = gated(&mut self.gate, &mut covariance, |p| correct(model, &state, observation, p))?;
        self.state = step.map_or(state, |step| state.oplus(&step));
        self.covariance = covariance;
        Ok(outcome)
    }

    fn predict(&self, observation: &M::Observation) -> Result<(S, SMatrix<f64, N, N>), IdentificationError> {
        let model = &self.model;
        let center = model.propagate(&self.state, observation)?;
        let weight = 1.0 / (2 * N) as f64;
        let (mut mean, mut square) = (SVector::<f64, N>::zeros(), SMatrix::<f64, N, N>::zeros());
        for_each_sigma_point(&self.covariance, |increment| {
            let image = model.propagate(&self.state.oplus(increment), observation)?.ominus(&center);
            mean += image * weight;
            square += image * image.transpose() * weight;
            Ok::<(), IdentificationError>(())
        })?;
        let covariance = square - mean * mean.transpose() + model.process_noise(&self.state, observation);
        Ok((center.oplus(&mean), covariance))
    }
}

/// Lower triangle with L Lᵀ = a, by rows; a direction without variance gives a zero column.
fn lower_root<const N: usize>(a: &SMatrix<f64, N, N>) -> [[f64; N]; N] {
    let mut lower = [[0.0; N]; N];
    for i in 0..N {
        for j in 0..=i {
            let known: f64 = lower[i].iter().zip(&lower[j]).take(j).map(|(a, b)| a * b).sum();
            let sum = a[(i, j)] - known;
            lower[i][j] = if i == j {
                sqrt(sum.max(0.0))
            } else if lower[j][j] > 0.0 {
                sum / lower[j][j]
            } else {
                0.0
            };
        }
    }
    lower
}

/// The increments of the sigma points in pairs, and what a function makes of each: `visit(increment)` for 2 N increments.
fn for_each_sigma_point<const N: usize, E>(
    covariance: &SMatrix<f64, N, N>,
    mut visit: impl FnMut(&SVector<f64, N>) -> Result<(), E>,
) -> Result<(), E> {
    let (lower, spread) = (lower_root(covariance), sqrt(N as f64));
    for j in 0..N {
        let increment = SVector::from(lower.map(|row| spread * row[j]));
        visit(&increment)?;
        visit(&-increment)?;
    }
    Ok(())
}

/// The update about a predicted state.
fn correct<M, S, const N: usize, const ROWS: usize, const P: usize>(
    model: &M,
    state: &S,
    observation: &M::Observation,
    covariance: &mut SMatrix<f64, N, N>,
) -> Result<Correction<N, ROWS>, IdentificationError>
where
    M: FilterModel<N, ROWS, P, State = S>,
    S: Manifold<Scalar = f64, Tangent = SVector<f64, N>> + Copy,
{
    let standard_deviation = model.standard_deviation(observation);
    let residual_at = |state: &S| measured_only(&model.residual(state, observation), &standard_deviation);
    let center = residual_at(state);
    check_deviations(&standard_deviation)?;
    if let Some(row) = center.iter().position(|r| !r.is_finite()) {
        return Err(IdentificationError::NotFinite { row });
    }
    let weight = 1.0 / (2 * N) as f64;
    let mut mean = SVector::<f64, ROWS>::zeros();
    let (mut square, mut cross) = (SMatrix::<f64, ROWS, ROWS>::zeros(), SMatrix::<f64, N, ROWS>::zeros());
    for_each_sigma_point(covariance, |increment| {
        // Relative to the centre, so that the square is not a difference of large numbers.
        let change = residual_at(&state.oplus(increment)) - center;
        mean += change * weight;
        square += change * change.transpose() * weight;
        cross -= increment * change.transpose() * weight;
        Ok::<(), IdentificationError>(())
    })?;
    let residual = center + mean;
    square -= mean * mean.transpose();
    for i in 0..ROWS {
        if standard_deviation[i].is_finite() {
            square[(i, i)] += standard_deviation[i] * standard_deviation[i];
        }
    }
    // Rows not measured have a zero row and column in S, hence in its root, and take no part.
    let lower = lower_root(&square);
    let mut step = SVector::zeros();
    let mut gains = SMatrix::<f64, N, ROWS>::zeros();
    let mut whitened = [0.0; ROWS];
    let (mut nis, mut determinant, mut degrees_of_freedom) = (0.0, 1.0, 0);
    for i in 0..ROWS {
        let pivot = lower[i][i];
        if pivot == 0.0 {
            continue;
        }
        let mut gain: SVector<f64, N> = cross.column(i).into_owned();
        let mut unexpected = residual[i];
        for k in 0..i {
            gain -= gains.column(k) * lower[i][k];
            unexpected -= lower[i][k] * whitened[k];
        }
        gain /= pivot;
        whitened[i] = unexpected / pivot;
        step += gain * whitened[i];
        *covariance -= gain * gain.transpose();
        gains.set_column(i, &gain);
        nis += whitened[i] * whitened[i];
        determinant *= pivot * pivot;
        degrees_of_freedom += 1;
    }
    let covariance_of_innovation = product_with_transpose(&lower);
    let innovation =
        Innovation { residual, covariance: covariance_of_innovation, nis, degrees_of_freedom, determinant };
    Ok(Correction { step, innovation })
}

/// The prior of its findings is what it was begun with, as if nothing had drifted since.
impl<M, const N: usize, const ROWS: usize, const P: usize> RecursiveEstimator<P>
    for UnscentedKalmanFilter<M, M::State, N, ROWS, P>
where
    M: FilterModel<N, ROWS, P>,
{
    type Observation = M::Observation;

    fn update(&mut self, observation: &M::Observation) -> Result<Outcome, EstimatorError> {
        Ok(self.update_rows(observation)?.into())
    }

    fn finding(&self) -> Result<Finding<P>, EstimatorError> {
        self.start.then(self.parameters(), &self.covariance())
    }
}
