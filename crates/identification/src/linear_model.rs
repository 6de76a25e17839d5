//! Models that are linear in their parameters.

use crate::lie::Scalar;
use nalgebra::{SMatrix, SVector};

/// A measurement equation `regressor(sample) * parameters = output(sample)`.
///
/// [`Rows`](crate::estimator::Rows) makes the observations of any recursive estimator of it.
///
/// Laws: `crate::laws::check_linear_model`. Tutorial: `tests/suite/custom_regressor.rs`.
///
/// # Shape
/// `ROWS` equations for each sample, `PARAMS` unknowns.
pub trait LinearModel<T: Scalar, const ROWS: usize, const PARAMS: usize> {
    /// What one evaluation needs.
    type Sample;
    /// The matrix that multiplies the parameters.
    fn regressor(&self, sample: &Self::Sample) -> SMatrix<T, ROWS, PARAMS>;
    /// The measured left side.
    fn output(&self, sample: &Self::Sample) -> SVector<T, ROWS>;
}
