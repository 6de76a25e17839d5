//! Least squares with a second, independent look at the regressors.

use crate::body_scale::BodyScale;
use crate::error::IdentificationError;
use crate::regressors::Regressor;
use crate::weighted_least_squares::{WrenchRow, scaled, weights};
use nalgebra::{SMatrix, SVector};

/// Solves `sum Z^T W (wrench - regressor p) = 0` with instruments `Z` whose noise is independent of the regressors'.
///
/// `instruments` are regressors of the same nodes from somewhere else: a simulation of the commanded motion with a rough
/// body, a second sensor, or poses other than the row's own. Noise in the regressors then averages out where plain least
/// squares is attenuated by it. `residual` are the standard deviations of torque and force that weigh the rows; only their
/// ratio matters.
///
/// # Errors
/// [`IdentificationError::TooFewSamples`] without a row, or with fewer instruments than rows;
/// [`IdentificationError::NotExcited`] where instruments and regressors have too little in common.
pub fn instrumental_variables(
    rows: &[WrenchRow],
    instruments: &[Regressor<f64>],
    residual: (f64, f64),
    scale: BodyScale,
) -> Result<SVector<f64, 10>, IdentificationError> {
    if rows.is_empty() || instruments.len() < rows.len() {
        return Err(IdentificationError::TooFewSamples { samples: instruments.len(), needed: rows.len().max(2) });
    }
    let weights = weights(residual.0, residual.1);
    let (mut normal, mut moment) = (SMatrix::<f64, 10, 10>::zeros(), SVector::<f64, 10>::zeros());
    for (instrument, row) in instruments.iter().zip(rows) {
        let left = scaled(&weights, instrument).transpose();
        normal += left * row.regressor;
        moment += left * row.wrench;
    }
    let magnitudes = scale.parameter_magnitudes();
    let to_scaled = SMatrix::<f64, 10, 10>::from_diagonal(&magnitudes);
    (to_scaled * normal * to_scaled)
        .lu()
        .solve(&magnitudes.component_mul(&moment))
        .map(|solution| solution.component_mul(&magnitudes))
        .filter(|solution| solution.iter().all(|x| x.is_finite()))
        .ok_or(IdentificationError::Indefinite { parameters: 10 })
}
