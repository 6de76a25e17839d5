//! What a filter began with: told apart from its data in every finding.

use crate::estimator::{EstimatorError, Finding};
use nalgebra::{SMatrix, SVector};

/// A mean with its covariance.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Knowledge<const P: usize> {
    pub(super) mean: SVector<f64, P>,
    pub(super) covariance: SMatrix<f64, P, P>,
}

impl<const P: usize> Knowledge<P> {
    /// The finding of a filter that began with this. Directions are compared in units of its first standard deviations, which scale as the
    /// parameters do.
    pub(super) fn then(
        &self,
        point: SVector<f64, P>,
        covariance: &SMatrix<f64, P, P>,
    ) -> Result<Finding<P>, EstimatorError> {
        let magnitudes = self.covariance.diagonal().map(crate::householder::sqrt);
        let prior = Finding::of_covariance(self.mean, &self.covariance, magnitudes)?;
        Ok(Finding::of_covariance(point, covariance, magnitudes)?.with_prior(*prior.information()))
    }
}
