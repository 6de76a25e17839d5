//! Rows of a linear model with their noise.

use nalgebra::{SMatrix, SVector};

/// The equations `regressor * parameters = output + noise`, the noise independent from row to row.
///
/// Correlated rows are made independent by the caller: both sides times the inverse of a square root of their covariance.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct LinearObservation<const ROWS: usize, const P: usize> {
    /// What multiplies the parameters.
    pub regressor: SMatrix<f64, ROWS, P>,
    /// What was measured.
    pub output: SVector<f64, ROWS>,
    /// Standard deviation of each row; infinite where nothing was measured.
    pub standard_deviation: SVector<f64, ROWS>,
}
