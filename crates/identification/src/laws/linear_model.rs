//! The laws of a model that is linear in its parameters.

use crate::linear_model::LinearModel;
use nalgebra::{SMatrix, SVector};
use tumble_lie::laws::{LawViolation, require};

/// Laws of a [`LinearModel`] against an inverse dynamics that shares no code with it.
///
/// `inverse(sample, parameters)` gives the output that a system with these parameters needs for the motion of the
/// sample. `samples` together should be a rich motion, `parameters` random. `tolerance` is relative; 1e-10 suits
/// regressors in double precision.
///
/// # Errors
/// The first broken law: `regressor times parameters is the inverse dynamics`,
/// `inverse dynamics is linear in the parameters`, `a rich motion determines every parameter`.
pub fn check_linear_model<M, const ROWS: usize, const PARAMS: usize>(
    model: &M,
    samples: &[M::Sample],
    parameters: &[SVector<f64, PARAMS>],
    inverse: impl Fn(&M::Sample, &SVector<f64, PARAMS>) -> SVector<f64, ROWS>,
    tolerance: f64,
) -> Result<(), LawViolation>
where
    M: LinearModel<f64, ROWS, PARAMS>,
{
    let mut information = SMatrix::<f64, PARAMS, PARAMS>::zeros();
    for (k, sample) in samples.iter().enumerate() {
        let regressor = model.regressor(sample);
        information += regressor.transpose() * regressor;
        for theta in parameters {
            let (expected, found) = (inverse(sample, theta), regressor * theta);
            let size = expected.norm() + regressor.norm() * theta.norm();
            let law = "regressor times parameters is the inverse dynamics";
            require(law, &(k, theta), &expected, &found, (expected - found).norm(), tolerance * size)?;
        }
        for pair in parameters.windows(2) {
            let (a, b) = (pair[0], pair[1]);
            let (left, right) = (inverse(sample, &(a + b * 2.0)), inverse(sample, &a) + inverse(sample, &b) * 2.0);
            let law = "inverse dynamics is linear in the parameters";
            require(law, &(k, a, b), &left, &right, (left - right).norm(), tolerance * (left.norm() + right.norm()))?;
        }
    }
    // Columns of unit length, so that no unit decides.
    let unit: SVector<f64, PARAMS> = information.diagonal().map(|d| if d > 0.0 { 1.0 / d.sqrt() } else { 0.0 });
    let scaled = SMatrix::<f64, PARAMS, PARAMS>::from_fn(|i, j| information[(i, j)] * unit[i] * unit[j]);
    let determined = scaled.cholesky().map_or(0.0, |cholesky| {
        let factor = cholesky.l();
        (0..PARAMS).map(|i| factor[(i, i)]).fold(f64::INFINITY, f64::min)
    });
    let law = "a rich motion determines every parameter";
    require(law, &samples.len(), &"independent columns", &determined, if determined > 1e-5 { 0.0 } else { 1.0 }, 0.0)
}
