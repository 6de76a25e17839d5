//! Singular values of a size known only at run time, by faer: the one place in this crate that calls it.
//!
//! faer chooses its instructions at run time, so that last bits may differ between machines: no path of promised bytes comes
//! through here. It is told to work alone, whatever the program that uses this crate does with its threads.

use crate::error::IdentificationError;
use faer::diag::DiagMut;
use faer::dyn_stack::{MemBuffer, MemStack};
use faer::linalg::svd::{ComputeSvdVectors, svd, svd_scratch};
use faer::{MatMut, MatRef, Par, Spec};
use nalgebra::{DMatrix, DVector};

/// Singular values in descending order, the right singular vectors and their images A V, as columns in the same order.
pub(super) struct SingularValues {
    pub(super) values: DVector<f64>,
    pub(super) right: DMatrix<f64>,
    pub(super) images: DMatrix<f64>,
}

impl SingularValues {
    /// Of finite numbers, at least as many rows as columns.
    ///
    /// # Errors
    /// [`IdentificationError::NoSingularValues`] where the iterations do not settle.
    pub(super) fn of(a: &DMatrix<f64>) -> Result<Self, IdentificationError> {
        let (rows, columns) = a.shape();
        let mut values = DVector::zeros(columns);
        let mut right = DMatrix::zeros(columns, columns);
        let mut images = DMatrix::zeros(rows, columns);
        let thin = ComputeSvdVectors::Thin;
        let mut memory = MemBuffer::new(svd_scratch::<f64>(rows, columns, thin, thin, Par::Seq, Spec::default()));
        svd(
            MatRef::from_column_major_slice(a.as_slice(), rows, columns),
            DiagMut::from_slice_mut(values.as_mut_slice()),
            Some(MatMut::from_column_major_slice_mut(images.as_mut_slice(), rows, columns)),
            Some(MatMut::from_column_major_slice_mut(right.as_mut_slice(), columns, columns)),
            Par::Seq,
            MemStack::new(&mut memory),
            Spec::default(),
        )
        .map_err(|_| IdentificationError::NoSingularValues { rows, columns })?;
        for (mut image, value) in images.column_iter_mut().zip(values.iter()) {
            image *= *value;
        }
        Ok(Self { values, right, images })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn recovers_graded_values_and_exact_rank() {
        // Products of known factors: rank 7 of 12, over eight decades.
        let wave = |k: usize| (1.3 * k as f64 + (0.7 * (k * k % 97) as f64).cos()).sin();
        let left = DMatrix::from_fn(15, 7, |i, j| wave(17 * i + j));
        let sizes = DVector::from_fn(7, |i, _| 10.0_f64.powf(-(i as f64) * 8.0 / 6.0));
        let right = DMatrix::from_fn(7, 12, |i, j| wave(1000 + 13 * i + j));
        let a = left * DMatrix::from_diagonal(&sizes) * right;
        let found = SingularValues::of(&a).unwrap();
        assert_eq!(found.values.iter().filter(|&&value| value > 1e-12 * found.values[0]).count(), 7);
        assert!((found.right.transpose() * &found.right - DMatrix::identity(12, 12)).amax() < 1e-14);
        assert!((&a * &found.right - &found.images).amax() < 1e-14 * a.norm());
        for i in 0..7 {
            for j in 0..i {
                let cosine = found.images.column(i).dot(&found.images.column(j)) / (found.values[i] * found.values[j]);
                assert!(cosine.abs() < 1e-13, "{i} {j} {cosine:e}");
            }
        }
    }
}
