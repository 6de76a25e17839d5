//! Control effectiveness: the matrix whose columns are what each actuator gives at full effort.

use crate::error::DynamicsError;
use tumble_lie::nalgebra::{ComplexField, SMatrix, SVector};

/// Below this part of its row or column a number counts as zero.
const RANK_TOLERANCE: f64 = 1e-9;

/// The largest entry of each row; every row must have one, or its component is out of reach.
pub(super) fn row_sizes<const R: usize, const N: usize>(
    effectiveness: &SMatrix<f64, R, N>,
) -> Result<SVector<f64, R>, DynamicsError> {
    let sizes = SVector::<f64, R>::from_fn(|row, _| effectiveness.row(row).amax());
    match sizes.iter().position(|size| *size <= 0.0) {
        Some(component) => Err(DynamicsError::OutOfReach { component }),
        None => Ok(sizes),
    }
}

/// `R` independent columns, chosen greedily by what they add to those before.
pub(super) fn spanning_columns<const R: usize, const N: usize>(
    effectiveness: &SMatrix<f64, R, N>,
) -> Result<[usize; R], DynamicsError> {
    let mut rest = *effectiveness;
    let mut spanned = SMatrix::<f64, R, R>::zeros();
    let mut chosen = [0; R];
    for (count, place) in chosen.iter_mut().enumerate() {
        let (mut best, mut size) = (0, 0.0);
        for (index, column) in rest.column_iter().enumerate() {
            if column.norm() > size {
                (best, size) = (index, column.norm());
            }
        }
        if size <= RANK_TOLERANCE * effectiveness.amax() {
            // the component that the columns so far say least about
            let reach = SVector::<f64, R>::from_fn(|row, _| spanned.row(row).norm_squared());
            return Err(DynamicsError::OutOfReach { component: reach.imin() });
        }
        let direction = rest.column(best) / size;
        spanned.set_column(count, &direction);
        rest -= direction * (direction.transpose() * rest);
        *place = best;
    }
    Ok(chosen)
}

/// The efforts of least norm that give a wanted value: the right inverse.
pub(super) fn right_inverse<const R: usize, const N: usize>(
    effectiveness: &SMatrix<f64, R, N>,
) -> Result<SMatrix<f64, N, R>, DynamicsError> {
    // rows of like size first: torques and forces differ in unit
    let sizes = row_sizes(effectiveness)?;
    let scaled = SMatrix::<f64, R, N>::from_fn(|row, column| effectiveness[(row, column)] / sizes[row]);
    spanning_columns(&scaled)?;
    let gram = (scaled * scaled.transpose()).try_inverse().ok_or(DynamicsError::NotFinite)?;
    let inverse = scaled.transpose() * gram;
    Ok(SMatrix::from_fn(|row, column| inverse[(row, column)] / sizes[column]))
}

/// All numbers finite, or an error.
pub(super) fn finite<const R: usize>(wanted: SVector<f64, R>) -> Result<SVector<f64, R>, DynamicsError> {
    if wanted.iter().all(ComplexField::is_finite) { Ok(wanted) } else { Err(DynamicsError::NotFinite) }
}

/// A commanded value within its limits, which hold zero; what is no number is nothing.
pub(super) fn limited(value: f64, lower: f64, upper: f64) -> f64 {
    if value.is_nan() { 0.0 } else { value.max(lower).min(upper) }
}
