//! Maximum of a likelihood over the parameters that enter nonlinearly.

use super::{Evidence, LinearEstimate};
use crate::IdentificationError;
use tumble_lie::nalgebra::{DMatrix, DVector};

/// A parameter that enters nonlinearly, where the search begins.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Parameter {
    /// First value.
    pub start: f64,
    /// A change that matters but little: differences are taken over it, a step of the search is at most thirty of it.
    pub scale: f64,
}

/// The maximum and how sure it is.
#[derive(Debug, Clone, PartialEq)]
pub struct LikelihoodMaximum {
    /// The nonlinear parameters.
    pub parameters: DVector<f64>,
    /// Their covariance: the inverse of the curvature.
    pub parameter_covariance: DMatrix<f64>,
    /// The unknown inputs there; their covariance takes the nonlinear parameters as known.
    pub linear: LinearEstimate,
    /// Covariance of the unknown inputs, the nonlinear parameters as unsure as they are.
    pub linear_covariance: DMatrix<f64>,
    /// Steps of the search.
    pub iterations: usize,
}

/// Longest step along a parameter, in scales.
const LONGEST_STEP: f64 = 30.0;
/// Steps of the search before it gives up.
const MAX_ITERATIONS: usize = 100;
/// The search ends where the quadratic model promises less than this of the logarithm of the likelihood.
const PROMISE: f64 = 1e-3;
/// Where no step along the search rises, a promise below this (a fifth of a standard deviation) is what differences can
/// tell.
const UNRESOLVED: f64 = 0.02;
/// Curvature per squared scale below which a parameter counts as open.
const FLAT: f64 = 1e-9;

/// Climbs the likelihood by Newton's method on central differences, from the starts; `evidence` runs the model.
///
/// # Errors
/// Those of `evidence` and [`Evidence::solve`] at the start; [`IdentificationError::LikelihoodNotMaximal`];
/// [`IdentificationError::NotExcited`] where the likelihood is flat along a parameter.
pub fn maximize_likelihood<const C: usize>(
    parameters: &[Parameter],
    evidence: impl Fn(&[f64]) -> Result<Evidence<C>, IdentificationError>,
) -> Result<LikelihoodMaximum, IdentificationError> {
    let count = parameters.len();
    let value_at = |scaled: &DVector<f64>| -> Vec<f64> {
        parameters.iter().zip(scaled.iter()).map(|(parameter, s)| parameter.start + parameter.scale * s).collect()
    };
    let solve = |scaled: &DVector<f64>| evidence(&value_at(scaled))?.solve();
    let mut scaled = DVector::<f64>::zeros(count);
    let mut best = solve(&scaled)?;
    let mut promise = 0.0;
    let along = |scaled: &DVector<f64>, i: usize, step: f64| {
        let mut moved = scaled.clone();
        moved[i] += step;
        moved
    };
    for iteration in 0..MAX_ITERATIONS {
        // Gradient and curvature by central differences; a parameter at the edge of its domain is an error there.
        let mut gradient = DVector::<f64>::zeros(count);
        let mut curvature = DMatrix::<f64>::zeros(count, count);
        let mut slope = DMatrix::<f64>::zeros(best.value.len(), count);
        let mut ahead = Vec::with_capacity(count);
        for i in 0..count {
            let (plus, minus) = (solve(&along(&scaled, i, 1.0))?, solve(&along(&scaled, i, -1.0))?);
            gradient[i] = 0.5 * (plus.log_likelihood - minus.log_likelihood);
            curvature[(i, i)] = 2.0 * best.log_likelihood - plus.log_likelihood - minus.log_likelihood;
            slope.set_column(i, &((&plus.value - &minus.value) * 0.5));
            ahead.push((plus.log_likelihood, minus.log_likelihood));
        }
        for i in 0..count {
            for j in 0..i {
                let both = solve(&along(&along(&scaled, i, 1.0), j, 1.0))?.log_likelihood;
                let neither = solve(&along(&along(&scaled, i, -1.0), j, -1.0))?.log_likelihood;
                let mixed = 0.5
                    * (ahead[i].0 + ahead[j].0 + ahead[i].1 + ahead[j].1 - both - neither - 2.0 * best.log_likelihood);
                curvature[(i, j)] = mixed;
                curvature[(j, i)] = mixed;
            }
        }
        let eigen = curvature.clone().symmetric_eigen();
        let least = eigen.eigenvalues.iter().fold(f64::INFINITY, |least, value| least.min(*value));
        let projected = eigen.eigenvectors.transpose() * &gradient;
        let uphill = DVector::from_fn(count, |i, _| projected[i] / eigen.eigenvalues[i].abs().max(FLAT));
        let mut step = &eigen.eigenvectors * uphill;
        promise = step.dot(&gradient);
        let longest = step.amax();
        if longest > LONGEST_STEP {
            step *= LONGEST_STEP / longest;
        }
        let better = core::iter::successors(Some(1.0), |share| Some(share * 0.5))
            .take(12)
            .filter_map(|share| {
                let moved = &scaled + &step * share;
                solve(&moved).ok().map(|estimate| (moved, estimate))
            })
            .find(|(_, estimate)| estimate.log_likelihood > best.log_likelihood);
        if let Some((moved, estimate)) = better
            && !(least > FLAT && promise < PROMISE)
        {
            (scaled, best) = (moved, estimate);
        } else if count == 0 || (least > FLAT && promise < UNRESOLVED) {
            let inverse = &eigen.eigenvectors
                * DMatrix::from_diagonal(&eigen.eigenvalues.map(|value| 1.0 / value))
                * eigen.eigenvectors.transpose();
            let linear_covariance = &best.covariance + &slope * &inverse * slope.transpose();
            let scales = DVector::from_iterator(count, parameters.iter().map(|parameter| parameter.scale));
            let scaled_inverse = DMatrix::from_fn(count, count, |i, j| scales[i] * inverse[(i, j)] * scales[j]);
            return Ok(LikelihoodMaximum {
                parameters: DVector::from_vec(value_at(&scaled)),
                parameter_covariance: scaled_inverse,
                linear: best,
                linear_covariance,
                iterations: iteration,
            });
        } else {
            return Err(if least <= FLAT {
                IdentificationError::NotExcited {
                    rank: count - 1,
                    expected: count,
                    smallest_singular_value: least.max(0.0),
                }
            } else {
                IdentificationError::LikelihoodNotMaximal { iterations: iteration, promise }
            });
        }
    }
    Err(IdentificationError::LikelihoodNotMaximal { iterations: MAX_ITERATIONS, promise })
}
