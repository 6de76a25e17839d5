//! What is to be small of a predicted covariance.

/// A measure of the predicted covariance of the quantities, whitened by their weights.
///
/// # Source
/// Thesis 2.3.1, (6.9).
#[derive(Clone, Copy, Debug, PartialEq, Eq, Default)]
#[non_exhaustive]
pub enum Criterion {
    /// Weighted sum of the variances: `Gamma' diag(M^-1)`.
    #[default]
    A,
    /// Logarithm of the determinant of the weighted covariance.
    D,
    /// The largest eigenvalue of the weighted covariance, smoothed.
    E,
}
