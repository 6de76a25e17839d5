//! What is known of as many unknowns as a tree has.

use super::layout::require_unknowns;
use crate::error::IdentificationError;
use crate::estimator::EstimatorError;
use nalgebra::{DMatrix, DVector};

/// The dynamic counterpart of [`Finding`](crate::estimator::Finding), for a number of unknowns that only the record tells: a point, and the
/// covariance of the directions that the data determine.
#[derive(Clone, Debug, PartialEq)]
pub struct DynFinding {
    point: DVector<f64>,
    /// Directions of the unknowns that the data determine, in units of the magnitudes, as orthonormal columns.
    determined: DMatrix<f64>,
    covariance: DMatrix<f64>,
    magnitudes: DVector<f64>,
}

impl DynFinding {
    /// Of a point, the determined directions as orthonormal columns in units of `magnitudes`, and their covariance in these units.
    ///
    /// # Errors
    /// [`EstimatorError::Refused`] for numbers that are not finite; [`IdentificationError::UnknownCount`] for sizes that do not fit.
    pub fn try_new(
        point: DVector<f64>,
        determined: DMatrix<f64>,
        covariance: DMatrix<f64>,
        magnitudes: DVector<f64>,
    ) -> Result<Self, EstimatorError> {
        let unknowns = point.len();
        require_unknowns(magnitudes.len(), unknowns)?;
        require_unknowns(determined.nrows(), unknowns)?;
        require_unknowns(covariance.nrows(), determined.ncols())?;
        require_unknowns(covariance.ncols(), determined.ncols())?;
        let refused = |what, index, value| Err(EstimatorError::Refused { what, index, value });
        if let Some(index) = point.iter().position(|x| !x.is_finite()) {
            return refused("estimate", index, point[index]);
        }
        if let Some(index) = covariance.iter().position(|x| !x.is_finite()) {
            return refused("covariance", index, covariance[index]);
        }
        Ok(Self { point, determined, covariance, magnitudes })
    }

    /// The estimate; along directions that the data leave free it is what was expected.
    pub fn point(&self) -> &DVector<f64> {
        &self.point
    }

    /// Number of directions that the data determine.
    pub fn rank(&self) -> usize {
        self.determined.ncols()
    }

    /// Sizes in which directions are compared.
    pub fn magnitudes(&self) -> &DVector<f64> {
        &self.magnitudes
    }

    /// Covariance of linear functions of the unknowns, one a row; `None` where the data leave one of them free.
    ///
    /// # Errors
    /// [`IdentificationError::UnknownCount`].
    pub fn covariance_of(&self, functionals: &DMatrix<f64>) -> Result<Option<DMatrix<f64>>, IdentificationError> {
        require_unknowns(functionals.ncols(), self.point.len())?;
        let scaled = functionals * DMatrix::from_diagonal(&self.magnitudes);
        let seen = &scaled * &self.determined;
        let free = (&scaled - &seen * self.determined.transpose()).norm();
        Ok((free <= ROUNDING * scaled.norm()).then(|| &seen * &self.covariance * seen.transpose()))
    }
}

/// Share of a function outside of what is determined that is still rounding.
const ROUNDING: f64 = 1e-8;

/// The dynamic counterpart of [`Estimator`](crate::estimator::Estimator). Object safe.
pub trait DynEstimator {
    /// What one estimate needs.
    type Record: ?Sized;

    /// What the record says. Undetermined directions are an answer, not an error.
    ///
    /// # Errors
    /// A malformed record; those of the implementation.
    fn estimate(&self, record: &Self::Record) -> Result<DynFinding, EstimatorError>;
}
