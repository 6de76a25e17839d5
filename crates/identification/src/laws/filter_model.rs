//! Laws of the models of filters.

use crate::lie::Manifold;
use crate::recursive::{DifferentiableModel, FilterModel};
use nalgebra::{SMatrix, SVector};
use std::fmt::Debug;
use tumble_lie::laws::{LawViolation, require};

/// Width of a difference quotient, in sizes of the coordinates.
const WIDTH: f64 = 1e-4;

/// The laws of a [`FilterModel`] at samples of a state and an observation.
///
/// "the step has a value"; "process noise is a covariance"; "standard deviations are positive";
/// "the parameter Jacobian is the derivative". `sizes` is how far each coordinate of the state is worth distinguishing: a
/// metre, a radian, a kilogram; `tolerance` is relative, not below about 1e-8.
///
/// # Errors
/// The first broken law.
pub fn check_filter_model<M, const N: usize, const ROWS: usize, const P: usize>(
    model: &M,
    samples: &[(M::State, M::Observation)],
    sizes: &SVector<f64, N>,
    tolerance: f64,
) -> Result<(), LawViolation>
where
    M: FilterModel<N, ROWS, P, State: Debug, Observation: Debug>,
{
    for sample @ (state, observation) in samples {
        propagated(model, sample, state)?;
        let noise = model.process_noise(state, observation);
        let scaled = SMatrix::<f64, N, N>::from_fn(|i, j| noise[(i, j)] / (sizes[i] * sizes[j]));
        let asymmetry = (scaled - scaled.transpose()).amax();
        let rounding = 1e-12 * (scaled.amax() + f64::MIN_POSITIVE);
        let lifted = scaled + SMatrix::from_diagonal_element(rounding);
        let error = if scaled.amax() == 0.0 || lifted.cholesky().is_some() { asymmetry } else { f64::INFINITY };
        require("process noise is a covariance", sample, &"positive semidefinite", &noise, error, rounding)?;
        let deviation = model.standard_deviation(observation);
        let broken = if deviation.iter().all(|d| *d > 0.0) { 0.0 } else { f64::INFINITY };
        require("standard deviations are positive", sample, &"positive numbers", &deviation, broken, 0.0)?;

        let given = model.parameter_jacobian(state) * SMatrix::from_diagonal(sizes);
        let found: SMatrix<f64, P, N> = slopes(sizes, |xi| Ok(model.parameters(&state.oplus(xi))))?;
        // each parameter in its own unit
        for (given, found) in given.row_iter().zip(found.row_iter()) {
            let size = given.amax().max(found.amax());
            let error = (given - found).amax() / if size > 0.0 { size } else { 1.0 };
            require("the parameter Jacobian is the derivative", sample, &found, &given, error, tolerance)?;
        }
    }
    Ok(())
}

/// The laws of a [`DifferentiableModel`], those of [`check_filter_model`] among them.
///
/// "the predicted covariance is that of the step": F P F' + Q with F by difference quotients of
/// [`propagate`](FilterModel::propagate), for two covariances of the sizes given, one with everything correlated;
/// "the sensitivity is the derivative of the residual", in rows that were measured. The sample's observation should hold
/// what the state would show, so that the residual is small. A model that linearises to some order in the step has
/// a `tolerance` of that order.
///
/// # Errors
/// The first broken law.
pub fn check_differentiable_model<M, const N: usize, const ROWS: usize, const P: usize>(
    model: &M,
    samples: &[(M::State, M::Observation)],
    sizes: &SVector<f64, N>,
    tolerance: f64,
) -> Result<(), LawViolation>
where
    M: DifferentiableModel<N, ROWS, P, State: Debug, Observation: Debug>,
{
    check_filter_model(model, samples, sizes, tolerance)?;
    for sample @ (state, observation) in samples {
        let end = propagated(model, sample, state)?;
        let ends = |xi: &SVector<f64, N>| Ok(propagated(model, sample, &state.oplus(xi))?.ominus(&end));
        let transition: SMatrix<f64, N, N> = slopes(sizes, ends)?;
        let spread = SMatrix::from_diagonal(sizes);
        let correlated = SMatrix::<f64, N, N>::from_fn(|i, j| {
            let sign = if (i * j) % 3 == 1 { -1.0 } else { 1.0 };
            if i == j { 1.0 } else { 0.7 * sign / N as f64 }
        });
        for covariance in [SMatrix::identity(), correlated] {
            let noise = model.process_noise(state, observation);
            let expected = transition * covariance * transition.transpose() + noise;
            let found = model.predicted_covariance(state, observation, &(spread * covariance * spread));
            let unit = |i: usize| expected[(i, i)].max(0.0).sqrt().max(1e-12 * sizes[i]);
            let error =
                SMatrix::<f64, N, N>::from_fn(|i, j| (found[(i, j)] - expected[(i, j)]).abs() / (unit(i) * unit(j)));
            let (row, column) = error.iamax_full();
            let (law, worst) = ("the predicted covariance is that of the step", error[(row, column)]);
            let (expected, found) = (expected[(row, column)], found[(row, column)]);
            require(law, &(sample, row, column), &expected, &found, worst, tolerance)?;
        }
        let given = model.sensitivity(state, observation) * spread;
        let found: SMatrix<f64, ROWS, N> = slopes(sizes, |xi| Ok(-model.residual(&state.oplus(xi), observation)))?;
        let deviation = model.standard_deviation(observation);
        for row in (0..ROWS).filter(|row| deviation[*row].is_finite()) {
            let (given, found) = (given.row(row), found.row(row));
            let size = given.amax().max(found.amax());
            let error = (given - found).amax() / if size > 0.0 { size } else { 1.0 };
            let law = "the sensitivity is the derivative of the residual";
            require(law, &(sample, row), &found, &given, error, tolerance)?;
        }
    }
    Ok(())
}

/// The state at the observation, or the violation that there is none.
fn propagated<M, const N: usize, const ROWS: usize, const P: usize>(
    model: &M,
    sample: &(M::State, M::Observation),
    from: &M::State,
) -> Result<M::State, LawViolation>
where
    M: FilterModel<N, ROWS, P, State: Debug, Observation: Debug>,
{
    model.propagate(from, &sample.1).map_err(|error| LawViolation {
        law: "the step has a value",
        inputs: format!("{sample:?}"),
        expected: String::from("a state"),
        found: error.to_string(),
        error: f64::INFINITY,
        tolerance: 0.0,
    })
}

/// Derivatives along coordinates in units of their sizes, by differences of the fourth order.
fn slopes<const R: usize, const N: usize>(
    sizes: &SVector<f64, N>,
    function: impl Fn(&SVector<f64, N>) -> Result<SVector<f64, R>, LawViolation>,
) -> Result<SMatrix<f64, R, N>, LawViolation> {
    let mut slopes = SMatrix::<f64, R, N>::zeros();
    for j in 0..N {
        let at = |amount: f64| function(&SVector::from_fn(|i, _| if i == j { amount * WIDTH * sizes[j] } else { 0.0 }));
        let slope = (at(1.0)? - at(-1.0)?) * 8.0 - (at(2.0)? - at(-2.0)?);
        slopes.set_column(j, &(slope / (12.0 * WIDTH)));
    }
    Ok(slopes)
}
