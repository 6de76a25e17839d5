//! Square-root information of as many unknowns as there are.

use super::layout::require_unknowns;
use super::reflections::fold;
use crate::error::IdentificationError;
use nalgebra::{DMatrix, DVector};

/// Rows folded at a time; enough that the triangle is touched seldom, few enough that they stay in cache.
const BLOCK_ROWS: usize = 128;

/// Everything whitened linear measurements say about n unknowns: min |R x − z|² + residual.
///
/// # Shape
/// `R` is n×n upper triangular with non-negative diagonal, `z` has n entries. Rows are whitened: divided by their standard
/// deviation, so that |R x − z|² is a chi-square.
///
/// # Source
/// Thesis (5.32)-(5.34), as in [`SquareRootInformation`](crate::SquareRootInformation), for a size known only at run time.
#[derive(Debug, Clone, PartialEq)]
pub struct LinkInformation {
    factor: DMatrix<f64>,
    rhs: DVector<f64>,
    residual_sum_of_squares: f64,
    rows: usize,
}

impl LinkInformation {
    /// No information at all about this many unknowns.
    pub fn new(unknowns: usize) -> Self {
        Self {
            factor: DMatrix::zeros(unknowns, unknowns),
            rhs: DVector::zeros(unknowns),
            residual_sum_of_squares: 0.0,
            rows: 0,
        }
    }

    /// Number of unknowns.
    pub fn unknowns(&self) -> usize {
        self.rhs.len()
    }

    /// The upper triangular square root `R` of the information matrix.
    pub fn factor(&self) -> &DMatrix<f64> {
        &self.factor
    }

    /// The whitened right-hand side `z`.
    pub fn rhs(&self) -> &DVector<f64> {
        &self.rhs
    }

    /// What the rows leave beside |R x − z|²: Σ|H x − y|² − |R x − z|² for every x.
    ///
    /// At full rank this is the least sum of squares; below it [`BaseParameters`](super::BaseParameters) has the least.
    pub fn residual_sum_of_squares(&self) -> f64 {
        self.residual_sum_of_squares
    }

    /// Number of scalar rows received.
    pub fn rows(&self) -> usize {
        self.rows
    }

    /// Adds whitened rows, one after the other in `coefficients`, with their right-hand sides; many at a time is fastest.
    ///
    /// # Errors
    /// [`IdentificationError::RowShape`], [`IdentificationError::NotFinite`]; nothing is changed then.
    pub fn add_rows(&mut self, coefficients: &[f64], rhs: &[f64]) -> Result<(), IdentificationError> {
        let columns = self.unknowns();
        if coefficients.len() != rhs.len() * columns {
            return Err(IdentificationError::RowShape { coefficients: coefficients.len(), rows: rhs.len(), columns });
        }
        let row_of = |entry: usize| entry / columns.max(1);
        let broken = coefficients.iter().position(|entry| !entry.is_finite()).map(row_of);
        let broken_rhs = rhs.iter().position(|entry| !entry.is_finite());
        if let Some(row) = broken.into_iter().chain(broken_rhs).min() {
            return Err(IdentificationError::NotFinite { row });
        }
        for (rows, rhs) in coefficients.chunks(BLOCK_ROWS * columns.max(1)).zip(rhs.chunks(BLOCK_ROWS)) {
            self.absorb(DMatrix::from_row_slice(rhs.len(), columns, rows), DVector::from_column_slice(rhs));
        }
        self.rows += rhs.len();
        Ok(())
    }

    /// Adds what independent measurements say of the same unknowns.
    ///
    /// # Errors
    /// [`IdentificationError::UnknownCount`].
    pub fn merge(&mut self, other: &Self) -> Result<(), IdentificationError> {
        require_unknowns(other.unknowns(), self.unknowns())?;
        self.absorb(other.factor.clone(), other.rhs.clone());
        self.residual_sum_of_squares += other.residual_sum_of_squares;
        self.rows += other.rows;
        Ok(())
    }

    /// ½|R x − z|², in units of half a chi-square.
    ///
    /// # Errors
    /// [`IdentificationError::UnknownCount`].
    pub fn objective(&self, unknowns: &DVector<f64>) -> Result<f64, IdentificationError> {
        require_unknowns(unknowns.len(), self.unknowns())?;
        Ok(0.5 * self.residual(unknowns).norm_squared())
    }

    /// R x − z for a vector of the right length.
    pub(super) fn residual(&self, unknowns: &DVector<f64>) -> DVector<f64> {
        &self.factor * unknowns - &self.rhs
    }

    fn absorb(&mut self, rows: DMatrix<f64>, mut rhs: DVector<f64>) {
        fold(&mut self.factor, rows).apply(&mut self.rhs, &mut rhs);
        self.residual_sum_of_squares += rhs.norm_squared();
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::square_root_information::SquareRootInformation;
    use nalgebra::{SMatrix, SVector};

    /// Deterministic, irregular numbers of order one.
    fn wave(k: usize) -> f64 {
        (1.7 * k as f64 + (0.3 * (k * k % 101) as f64).cos()).sin()
    }

    #[test]
    fn ten_unknowns_are_what_the_fixed_size_says() {
        for rows in [3, 10, 127, 128, 300] {
            let coefficients: Vec<f64> = (0..10 * rows).map(wave).collect();
            let rhs: Vec<f64> = (0..rows).map(|i| wave(100_000 + i)).collect();
            let mut information = LinkInformation::new(10);
            information.add_rows(&coefficients, &rhs).unwrap();
            let mut fixed = SquareRootInformation::<10>::new();
            for (row, y) in coefficients.chunks(10).zip(&rhs) {
                fixed.update(&SMatrix::<f64, 1, 10>::from_row_slice(row), &SVector::from([*y])).unwrap();
            }
            // The triangle is unique only at full rank.
            let gram = information.factor().transpose() * information.factor();
            let difference =
                gram - DMatrix::from_column_slice(10, 10, (fixed.factor().transpose() * fixed.factor()).as_slice());
            assert!(difference.amax() < 1e-13 * rows as f64);
            let (rss, expected) = (information.residual_sum_of_squares(), fixed.residual_sum_of_squares());
            assert!((rss - expected).abs() < 1e-13 * rows as f64, "{rows}: {rss} {expected}");
            assert_eq!(information.rows(), rows);
            assert!(information.factor().diagonal().min() >= 0.0);
            // In parts and merged: the same.
            let cut = rows / 3;
            let mut merged = LinkInformation::new(10);
            merged.add_rows(&coefficients[..10 * cut], &rhs[..cut]).unwrap();
            let mut rest = LinkInformation::new(10);
            rest.add_rows(&coefficients[10 * cut..], &rhs[cut..]).unwrap();
            merged.merge(&rest).unwrap();
            let x = DVector::from_fn(10, |i, _| wave(i));
            let sum = |i: &LinkInformation| 2.0 * i.objective(&x).unwrap() + i.residual_sum_of_squares();
            assert!((sum(&merged) - sum(&information)).abs() < 1e-12 * sum(&information));
            assert_eq!(merged.rows(), rows);
        }
    }

    #[test]
    fn a_wrong_shape_changes_nothing() {
        let mut information = LinkInformation::new(3);
        let refused = information.add_rows(&[1.0, 2.0], &[1.0]);
        assert_eq!(refused, Err(IdentificationError::RowShape { coefficients: 2, rows: 1, columns: 3 }));
        let refused = information.add_rows(&[1.0, 2.0, 3.0, 1.0, f64::NAN, 2.0], &[1.0, 1.0]);
        assert_eq!(refused, Err(IdentificationError::NotFinite { row: 1 }));
        let refused = information.add_rows(&[1.0, 2.0, 3.0], &[f64::INFINITY]);
        assert_eq!(refused, Err(IdentificationError::NotFinite { row: 0 }));
        let refused = information.merge(&LinkInformation::new(4));
        assert_eq!(refused, Err(IdentificationError::UnknownCount { given: 4, expected: 3 }));
        assert_eq!(information, LinkInformation::new(3));
    }
}
