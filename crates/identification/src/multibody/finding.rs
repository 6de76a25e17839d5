//! What is known of as many unknowns as a tree has.

use super::layout::require_unknowns;
use crate::error::IdentificationError;
use crate::estimator::EstimatorError;
use core::ops::Range;
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

    /// Variances of the principal directions of some unknowns, in units of their magnitudes: of those that the data determine whatever the
    /// others are.
    pub(super) fn variances(&self, columns: Range<usize>) -> Vec<f64> {
        let shown = shown(&self.free(&columns));
        if shown.ncols() == 0 {
            return Vec::new();
        }
        self.covariance_along(&shown, &columns).symmetric_eigenvalues().iter().copied().collect()
    }

    /// Squared distance from another finding of the same unknowns (others may stand behind them) in joint standard deviations, for each
    /// direction of them that both determine; `None` where there is none.
    pub(super) fn distance(&self, other: &Self, columns: Range<usize>) -> Option<f64> {
        let shown = shown(&(self.free(&columns) + other.free(&columns)));
        if shown.ncols() == 0 {
            return None;
        }
        let apart = DVector::from_iterator(
            columns.len(),
            columns.clone().map(|k| (self.point[k] - other.point[k]) / self.magnitudes[k]),
        );
        let apart = shown.transpose() * apart;
        let joint = self.covariance_along(&shown, &columns) + other.covariance_along(&shown, &columns);
        Some(joint.cholesky().map_or(f64::INFINITY, |c| apart.dot(&c.solve(&apart)) / shown.ncols() as f64))
    }

    /// How much of each combination of these unknowns lies in directions that the data leave free: a quadratic form.
    fn free(&self, columns: &Range<usize>) -> DMatrix<f64> {
        let determined = self.determined.rows_range(columns.clone());
        DMatrix::identity(columns.len(), columns.len()) - determined * determined.transpose()
    }

    fn covariance_along(&self, directions: &DMatrix<f64>, columns: &Range<usize>) -> DMatrix<f64> {
        let determined = self.determined.rows_range(columns.clone()).transpose() * directions;
        determined.transpose() * &self.covariance * determined
    }
}

/// The directions in which nothing of such a form is left but rounding, as orthonormal columns.
fn shown(free: &DMatrix<f64>) -> DMatrix<f64> {
    let eigen = free.clone().symmetric_eigen();
    let columns: Vec<_> =
        (0..free.ncols()).filter(|i| eigen.eigenvalues[*i] < FREE).map(|i| eigen.eigenvectors.column(i)).collect();
    if columns.is_empty() { DMatrix::zeros(free.nrows(), 0) } else { DMatrix::from_columns(&columns) }
}

/// Squared share of a direction outside of what is determined that is still rounding.
const FREE: f64 = 1e-10;

/// Share of a function outside of what is determined that is still rounding.
const ROUNDING: f64 = 1e-8;

/// The dynamic counterpart of [`Estimator`](crate::estimator::Estimator). Object safe.
///
/// # Example
/// ```
/// use tumble_identification::IdentificationError;
/// use tumble_identification::estimator::EstimatorError;
/// use tumble_identification::multibody::{DynEstimator, DynFinding};
/// use tumble_identification::nalgebra::{DMatrix, DVector};
///
/// /// Stiffness of each spring, N m/rad, from pairs of angle (rad) and torque (N m), both listed by spring; 0.01 N m of noise.
/// struct Springs;
/// impl DynEstimator for Springs {
///     type Record = [(DVector<f64>, DVector<f64>)];
///     fn estimate(&self, record: &Self::Record) -> Result<DynFinding, EstimatorError> {
///         let springs = record.first().ok_or(IdentificationError::TooFewSamples { samples: 0, needed: 1 })?.0.len();
///         let squares = DVector::from_fn(springs, |i, _| record.iter().map(|(angle, _)| angle[i] * angle[i]).sum::<f64>());
///         let products = DVector::from_fn(springs, |i, _| record.iter().map(|(angle, torque)| angle[i] * torque[i]).sum::<f64>());
///         // What never moved stays unknown: its direction is left out.
///         let moved: Vec<usize> = (0..springs).filter(|i| squares[*i] > 0.0).collect();
///         let point = DVector::from_fn(springs, |i, _| if squares[i] > 0.0 { products[i] / squares[i] } else { 0.0 });
///         let determined = DMatrix::from_fn(springs, moved.len(), |i, j| f64::from(u8::from(i == moved[j])));
///         let variances = DVector::from_fn(moved.len(), |j, _| 1e-4 / squares[moved[j]]);
///         DynFinding::try_new(point, determined, DMatrix::from_diagonal(&variances), DVector::repeat(springs, 1.0))
///     }
/// }
/// let row = |angle: [f64; 2], torque: [f64; 2]| (DVector::from_row_slice(&angle), DVector::from_row_slice(&torque));
/// let found = Springs.estimate(&[row([0.1, 0.0], [0.5, 0.0]), row([0.2, 0.0], [1.0, 0.0])])?;
/// assert!(found.rank() == 1 && (found.point()[0] - 5.0).abs() < 1e-12);
/// // Nothing is said of the second spring, nor of the sum of both.
/// assert_eq!(found.covariance_of(&DMatrix::from_row_slice(1, 2, &[1.0, 1.0]))?, None);
/// # Ok::<(), EstimatorError>(())
/// ```
/// Tutorial: [the estimator of trees](https://github.com/tumble-robotics/tumble/blob/main/crates/identification/src/multibody/tree_estimator.rs).
pub trait DynEstimator {
    /// What one estimate needs.
    type Record: ?Sized;

    /// What the record says. Undetermined directions are an answer, not an error.
    ///
    /// # Errors
    /// A malformed record; those of the implementation.
    fn estimate(&self, record: &Self::Record) -> Result<DynFinding, EstimatorError>;
}
