//! Fisher information: how much a motion can tell, before any estimate is made.

use crate::error::IdentificationError;
use crate::jacobi::singular_values;
use crate::square_root_information::{RANK_TOLERANCE, SquareRootInformation};
use nalgebra::{SMatrix, SVector};

/// Fisher information of `P` parameters, a sum over independent blocks of whitened rows.
///
/// # Source
/// Thesis (2.18); bound (2.15).
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct FisherInformation<const P: usize> {
    matrix: SMatrix<f64, P, P>,
}

impl<const P: usize> Default for FisherInformation<P> {
    fn default() -> Self {
        Self { matrix: SMatrix::zeros() }
    }
}

impl<const P: usize> FisherInformation<P> {
    /// No information.
    pub fn new() -> Self {
        Self::default()
    }

    /// Adds HᵀH of a whitened block.
    pub fn add<const ROWS: usize>(&mut self, block: &SMatrix<f64, ROWS, P>) {
        self.matrix += block.transpose() * block;
    }

    /// The information matrix.
    pub fn matrix(&self) -> &SMatrix<f64, P, P> {
        &self.matrix
    }

    /// Cramér-Rao bound F⁻¹: no unbiased estimator has a smaller covariance.
    ///
    /// `magnitudes` as in [`SquareRootInformation::solve`]. Forming F squares the condition number; where directions
    /// are weaker than 1e-7 of the strongest use [`SquareRootInformation::covariance`].
    ///
    /// # Errors
    /// [`IdentificationError::NotExcited`] where no bound exists.
    pub fn cramer_rao_bound(&self, magnitudes: &SVector<f64, P>) -> Result<SMatrix<f64, P, P>, IdentificationError> {
        let scaled = SMatrix::<f64, P, P>::from_fn(|i, j| self.matrix[(i, j)] * magnitudes[i] * magnitudes[j]);
        let (values, _) = singular_values(scaled);
        let relative = |value: f64| if values[0] > 0.0 { value / values[0] } else { 0.0 };
        // Rounding of F hides directions below the square root of the machine precision, far above RANK_TOLERANCE².
        let visible = |value: f64| relative(value) > (f64::EPSILON * P as f64).max(RANK_TOLERANCE * RANK_TOLERANCE);
        let rank = values.iter().filter(|&&value| visible(value)).count();
        match scaled.cholesky() {
            Some(cholesky) if rank == P => {
                let inverse = cholesky.inverse();
                Ok(SMatrix::from_fn(|i, j| inverse[(i, j)] * magnitudes[i] * magnitudes[j]))
            }
            _ => Err(IdentificationError::NotExcited {
                rank: rank.min(P - 1),
                expected: P,
                smallest_singular_value: nalgebra::ComplexField::sqrt(relative(values[P - 1])),
            }),
        }
    }
}

impl<const P: usize> From<&SquareRootInformation<P>> for FisherInformation<P> {
    fn from(information: &SquareRootInformation<P>) -> Self {
        let factor = information.factor();
        Self { matrix: factor.transpose() * factor }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn bound_is_the_inverse_and_needs_full_rank() {
        let mut fisher = FisherInformation::<2>::new();
        let ones = SVector::from([1.0, 1.0]);
        fisher.add(&SMatrix::<f64, 1, 2>::new(3.0, 4.0));
        assert!(matches!(
            fisher.cramer_rao_bound(&ones),
            Err(IdentificationError::NotExcited { rank: 1, expected: 2, .. })
        ));
        fisher.add(&SMatrix::<f64, 1, 2>::new(0.0, 2.0));
        // F = [9, 12; 12, 20], inverse by hand.
        let bound = fisher.cramer_rao_bound(&ones).unwrap();
        let expected = SMatrix::<f64, 2, 2>::new(20.0, -12.0, -12.0, 9.0) / 36.0;
        assert!((bound - expected).amax() < 1e-14);
        let mut root = SquareRootInformation::<2>::new();
        root.update(&SMatrix::<f64, 2, 2>::new(3.0, 4.0, 0.0, 2.0), &SVector::zeros()).unwrap();
        assert!((FisherInformation::from(&root).matrix() - fisher.matrix()).amax() < 1e-14);
        assert!((root.covariance(&ones).unwrap() - expected).amax() < 1e-14);
    }
}
