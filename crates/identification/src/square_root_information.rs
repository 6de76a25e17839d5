//! Recursive linear least squares on the square root of the information: the triangular pair (R, z).
//!
//! All scalars are `f64`: decisions are made here, derivatives do not flow through.

use crate::error::IdentificationError;
use crate::householder::Reflection;
use crate::jacobi::singular_values;
use nalgebra::{SMatrix, SVector};

/// Relative singular value below which a direction counts as undetermined.
///
/// Regressors are differences of double-precision poses; what is left of a direction below this level is rounding.
pub const RANK_TOLERANCE: f64 = 1e-10;

/// Everything whitened linear measurements say about `P` parameters: min |R p − z|² + residual.
///
/// # Shape
/// `R` is P×P upper triangular with non-negative diagonal, `z` has P entries. Rows of a block are whitened: divided by
/// their standard deviation, so that |R p − z|² is a chi-square and R⁻¹R⁻ᵀ a covariance.
///
/// # Source
/// Thesis (5.32)-(5.34); the triangular update replaces the economy QR of the whole stack.
///
/// # Deviation
/// The printed recursion holds only once P independent rows have arrived. Starting from R = 0 the same update is right
/// from the first row on (test `is_right_before_ten_rows_have_arrived`). The residual sum of squares, which the print
/// drops, is kept: it carries the measured noise level.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SquareRootInformation<const P: usize> {
    /// Rows of `R`; row-major, because the update walks along rows.
    pub(crate) factor_rows: [[f64; P]; P],
    pub(crate) rhs: [f64; P],
    residual_sum_of_squares: f64,
    rows: usize,
}

impl<const P: usize> Default for SquareRootInformation<P> {
    fn default() -> Self {
        Self::new()
    }
}

impl<const P: usize> SquareRootInformation<P> {
    /// No information at all.
    pub fn new() -> Self {
        Self { factor_rows: [[0.0; P]; P], rhs: [0.0; P], residual_sum_of_squares: 0.0, rows: 0 }
    }

    /// Information given by a square (not necessarily triangular) pair: |factor p − rhs|².
    ///
    /// # Errors
    /// [`IdentificationError::NotFinite`].
    pub fn from_square_root(factor: &SMatrix<f64, P, P>, rhs: &SVector<f64, P>) -> Result<Self, IdentificationError> {
        let mut information = Self::new();
        information.update(factor, rhs)?;
        Ok(information)
    }

    /// The upper triangular square root `R` of the information matrix.
    pub fn factor(&self) -> SMatrix<f64, P, P> {
        SMatrix::from_fn(|i, j| self.factor_rows[i][j])
    }

    /// The whitened right-hand side `z`.
    pub fn rhs(&self) -> SVector<f64, P> {
        SVector::from(self.rhs)
    }

    /// Σ|H p − y|² over all rows at the least-squares solution.
    pub fn residual_sum_of_squares(&self) -> f64 {
        self.residual_sum_of_squares
    }

    /// Number of scalar rows received, those of priors included.
    pub fn rows(&self) -> usize {
        self.rows
    }

    /// ½|R p − z|², the misfit of `parameters` beyond that of the unconstrained solution.
    pub fn objective(&self, parameters: &SVector<f64, P>) -> f64 {
        0.5 * self.residual(parameters).norm_squared()
    }

    /// R p − z.
    pub fn residual(&self, parameters: &SVector<f64, P>) -> SVector<f64, P> {
        SVector::from_fn(|i, _| {
            let mut sum = -self.rhs[i];
            for j in i..P {
                sum += self.factor_rows[i][j] * parameters[j];
            }
            sum
        })
    }

    /// Adds the whitened rows `block · p = rhs`.
    ///
    /// # Errors
    /// [`IdentificationError::NotFinite`]; nothing is changed then.
    ///
    /// # Source
    /// Thesis (5.32)-(5.33).
    pub fn update<const ROWS: usize>(
        &mut self,
        block: &SMatrix<f64, ROWS, P>,
        rhs: &SVector<f64, ROWS>,
    ) -> Result<(), IdentificationError> {
        let mut rows = [[0.0; P]; ROWS];
        let mut outputs = [0.0; ROWS];
        for i in 0..ROWS {
            outputs[i] = rhs[i];
            let mut finite = rhs[i].is_finite();
            for j in 0..P {
                rows[i][j] = block[(i, j)];
                finite &= rows[i][j].is_finite();
            }
            if !finite {
                return Err(IdentificationError::NotFinite { row: i });
            }
        }
        self.absorb(&mut rows, &mut outputs);
        self.rows += ROWS;
        Ok(())
    }

    /// Adds what another estimator of the same parameters knows, from independent measurements.
    pub fn merge(&mut self, other: &Self) {
        let (mut rows, mut outputs) = (other.factor_rows, other.rhs);
        self.absorb(&mut rows, &mut outputs);
        self.residual_sum_of_squares += other.residual_sum_of_squares;
        self.rows += other.rows;
    }

    /// Adds independent Gaussian prior knowledge of each parameter; an infinite standard deviation means none.
    ///
    /// # Errors
    /// [`IdentificationError::NotPositive`], [`IdentificationError::NotFinite`].
    pub fn add_prior(
        &mut self,
        mean: &SVector<f64, P>,
        standard_deviation: &SVector<f64, P>,
    ) -> Result<(), IdentificationError> {
        let mut block = SMatrix::<f64, P, P>::zeros();
        let mut rhs = SVector::<f64, P>::zeros();
        let mut stated = 0;
        for i in 0..P {
            let value = standard_deviation[i];
            if value.is_nan() || value <= 0.0 {
                return Err(IdentificationError::NotPositive { index: i, value });
            }
            if value.is_finite() {
                block[(i, i)] = 1.0 / value;
                rhs[i] = mean[i] / value;
                stated += 1;
            }
        }
        self.update(&block, &rhs)?;
        self.rows -= P - stated;
        Ok(())
    }

    /// Folds `rows` into the triangle; they are left without meaning.
    fn absorb<const ROWS: usize>(&mut self, rows: &mut [[f64; P]; ROWS], outputs: &mut [f64; ROWS]) {
        for j in 0..P {
            let column = core::array::from_fn(|i| rows[i][j]);
            if let Some(reflection) = Reflection::new(self.factor_rows[j][j], column) {
                reflection.apply_to_rows(&mut self.factor_rows[j], rows, ROWS);
                reflection.apply(&mut self.rhs[j], outputs);
                self.factor_rows[j][j] = reflection.norm;
                for row in rows.iter_mut() {
                    row[j] = 0.0;
                }
            }
        }
        self.residual_sum_of_squares += outputs.iter().map(|output| output * output).sum::<f64>();
    }

    /// The unconstrained least-squares solution R⁻¹z.
    ///
    /// `magnitudes` are typical sizes of the parameters (for a body:
    /// [`BodyScale::parameter_magnitudes`](crate::BodyScale::parameter_magnitudes)); they put kilograms and kilogram
    /// square metres in like units before directions are compared, so that no answer depends on the units chosen.
    ///
    /// # Errors
    /// [`IdentificationError::NotExcited`] where a direction is weaker than [`RANK_TOLERANCE`] times the strongest.
    pub fn solve(&self, magnitudes: &SVector<f64, P>) -> Result<SVector<f64, P>, IdentificationError> {
        self.require_full_rank(magnitudes)?;
        Ok(SVector::from(self.back_substitute(self.rhs)))
    }

    /// Covariance R⁻¹R⁻ᵀ of the solution, for rows whitened with their true standard deviations.
    ///
    /// Multiply by [`residual_variance`](Self::residual_variance) where only their ratios were known.
    ///
    /// # Errors
    /// As [`solve`](Self::solve).
    pub fn covariance(&self, magnitudes: &SVector<f64, P>) -> Result<SMatrix<f64, P, P>, IdentificationError> {
        self.require_full_rank(magnitudes)?;
        let inverse = self.inverse_factor();
        Ok(inverse * inverse.transpose())
    }

    /// Residual sum of squares per degree of freedom: one where the stated standard deviations are right.
    ///
    /// # Errors
    /// [`IdentificationError::NoResidual`] with no more rows than parameters.
    pub fn residual_variance(&self) -> Result<f64, IdentificationError> {
        if self.rows <= P {
            return Err(IdentificationError::NoResidual { rows: self.rows, parameters: P });
        }
        Ok(self.residual_sum_of_squares / (self.rows - P) as f64)
    }

    /// Multiplies what is known by `factor` ≤ 1 in the square root: the covariance by its inverse square.
    pub(crate) fn scale(&mut self, factor: f64) {
        for value in self.factor_rows.iter_mut().flatten().chain(&mut self.rhs) {
            *value *= factor;
        }
    }

    /// R⁻¹ w for a factor known to be nonsingular.
    pub(crate) fn back_substitute(&self, mut w: [f64; P]) -> [f64; P] {
        for i in (0..P).rev() {
            for j in i + 1..P {
                w[i] -= self.factor_rows[i][j] * w[j];
            }
            w[i] /= self.factor_rows[i][i];
        }
        w
    }

    /// R⁻ᵀ w for a factor known to be nonsingular.
    pub(crate) fn back_substitute_transposed(&self, mut w: [f64; P]) -> [f64; P] {
        for i in 0..P {
            w[i] /= self.factor_rows[i][i];
            for j in i + 1..P {
                w[j] -= self.factor_rows[i][j] * w[i];
            }
        }
        w
    }

    pub(crate) fn inverse_factor(&self) -> SMatrix<f64, P, P> {
        let mut inverse = SMatrix::<f64, P, P>::zeros();
        for j in 0..P {
            let mut unit = [0.0; P];
            unit[j] = 1.0;
            inverse.set_column(j, &SVector::from(self.back_substitute(unit)));
        }
        inverse
    }

    /// Refuses where `R · diag(magnitudes)` is singular to working accuracy.
    ///
    /// The Frobenius condition number, an upper bound of the spectral one, settles the ordinary case in a fraction of a
    /// microsecond; singular values are computed only where it does not.
    pub(crate) fn require_full_rank(&self, magnitudes: &SVector<f64, P>) -> Result<(), IdentificationError> {
        let mut inverse = [[0.0; P]; P];
        let (mut norm, mut inverse_norm) = (0.0, 0.0);
        for i in (0..P).rev() {
            let reciprocal = 1.0 / self.factor_rows[i][i];
            let mut row = [0.0; P];
            for (k, below) in inverse.iter().enumerate().skip(i + 1) {
                let weight = self.factor_rows[i][k] * reciprocal;
                for (r, b) in row.iter_mut().zip(below) {
                    *r -= weight * b;
                }
            }
            row[i] = reciprocal;
            for j in i..P {
                let (forward, backward) = (self.factor_rows[i][j] * magnitudes[j], row[j] / magnitudes[i]);
                norm += forward * forward;
                inverse_norm += backward * backward;
            }
            inverse[i] = row;
        }
        if norm * inverse_norm < 1.0 / (RANK_TOLERANCE * RANK_TOLERANCE) {
            return Ok(());
        }
        let (values, _) = singular_values(self.scaled_factor(magnitudes));
        let relative = |value: f64| if values[0] > 0.0 { value / values[0] } else { 0.0 };
        let rank = values.iter().filter(|&&value| relative(value) > RANK_TOLERANCE).count();
        if rank == P {
            return Ok(());
        }
        Err(IdentificationError::NotExcited { rank, expected: P, smallest_singular_value: relative(values[P - 1]) })
    }

    /// `R · diag(magnitudes)`: columns in like units.
    pub(crate) fn scaled_factor(&self, magnitudes: &SVector<f64, P>) -> SMatrix<f64, P, P> {
        SMatrix::from_fn(|i, j| self.factor_rows[i][j] * magnitudes[j])
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    type Block = (SMatrix<f64, 6, 10>, SVector<f64, 6>);

    /// Deterministic, irregular numbers of order one.
    fn blocks(count: usize) -> Vec<Block> {
        let wave = |k: usize| (1.7 * k as f64 + (0.3 * (k * k % 101) as f64).cos()).sin();
        (0..count)
            .map(|b| {
                (
                    SMatrix::from_fn(|i, j| wave(97 * b + 13 * i + 7 * j)),
                    SVector::from_fn(|i, _| wave(1000 + 31 * b + i)),
                )
            })
            .collect()
    }

    fn folded(blocks: &[Block]) -> SquareRootInformation<10> {
        let mut information = SquareRootInformation::new();
        for (block, rhs) in blocks {
            information.update(block, rhs).unwrap();
        }
        information
    }

    fn ones() -> SVector<f64, 10> {
        SVector::repeat(1.0)
    }

    #[test]
    fn equals_batch_householder() {
        for count in [2, 7, 100] {
            let blocks = blocks(count);
            let information = folded(&blocks);
            let stack = nalgebra::DMatrix::from_fn(6 * count, 10, |i, j| blocks[i / 6].0[(i % 6, j)]);
            let rhs = nalgebra::DVector::from_fn(6 * count, |i, _| blocks[i / 6].1[i % 6]);
            let qr = stack.clone().qr();
            let r = qr.r();
            let mut z = rhs.clone();
            qr.q_tr_mul(&mut z);
            let factor = information.factor();
            for i in 0..10 {
                let sign = r[(i, i)].signum();
                for j in 0..10 {
                    let expected = if j < i { 0.0 } else { sign * r[(i, j)] };
                    assert!((factor[(i, j)] - expected).abs() < 1e-13 * r.norm(), "{count} {i} {j}");
                }
                assert!((information.rhs()[i] - sign * z[i]).abs() < 1e-13 * rhs.norm());
            }
            let residual = z.rows(10, 6 * count - 10).norm_squared();
            assert!((information.residual_sum_of_squares() - residual).abs() < 1e-13 * rhs.norm_squared());
            assert_eq!(information.rows(), 6 * count);
        }
    }

    #[test]
    fn is_right_before_ten_rows_have_arrived() {
        let blocks = blocks(2);
        let information = folded(&blocks[..1]);
        // The one block is reproduced: R'R = H'H, and any solution of the block has no misfit.
        let (block, rhs) = &blocks[0];
        assert!((information.factor().transpose() * information.factor() - block.transpose() * block).amax() < 1e-14);
        assert!(information.residual_sum_of_squares() < 1e-28);
        let some = block.transpose() * (block * block.transpose()).try_inverse().unwrap() * rhs;
        assert!(information.objective(&some) < 1e-26);
        match information.solve(&ones()) {
            Err(IdentificationError::NotExcited { rank: 6, expected: 10, smallest_singular_value }) => {
                assert!(smallest_singular_value < 1e-14);
            }
            other => panic!("{other:?}"),
        }
        assert!(matches!(
            SquareRootInformation::<10>::new().solve(&ones()),
            Err(IdentificationError::NotExcited { rank: 0, .. })
        ));
        assert_eq!(information.residual_variance(), Err(IdentificationError::NoResidual { rows: 6, parameters: 10 }));
        // The two blocks together determine all.
        assert!(folded(&blocks).solve(&ones()).is_ok());
    }

    #[test]
    fn merge_equals_folding_everything() {
        let blocks = blocks(9);
        let whole = folded(&blocks);
        let mut merged = folded(&blocks[..4]);
        merged.merge(&folded(&blocks[4..]));
        assert!((merged.factor() - whole.factor()).amax() < 1e-13);
        assert!((merged.rhs() - whole.rhs()).amax() < 1e-13);
        assert!((merged.residual_sum_of_squares() - whole.residual_sum_of_squares()).abs() < 1e-12);
        assert_eq!(merged.rows(), whole.rows());
    }

    #[test]
    fn prior_weighs_mean_and_measurement() {
        let mut information = SquareRootInformation::<2>::new();
        information.add_prior(&SVector::from([1.0, 7.0]), &SVector::from([2.0, f64::INFINITY])).unwrap();
        assert_eq!(information.rows(), 1);
        // A measurement 3 ± 1 of the first: (1/4 · 1 + 3) / (1/4 + 1) = 2.6; of the second only 5 ± 0.5.
        information.update(&SMatrix::<f64, 2, 2>::new(1.0, 0.0, 0.0, 2.0), &SVector::from([3.0, 10.0])).unwrap();
        let ones = SVector::repeat(1.0);
        assert!((information.solve(&ones).unwrap() - SVector::from([2.6, 5.0])).amax() < 1e-14);
        let covariance = information.covariance(&ones).unwrap();
        assert!((covariance - SMatrix::<f64, 2, 2>::new(0.8, 0.0, 0.0, 0.25)).amax() < 1e-14);
        // Residual: (2.6 − 1)²/4 + (3 − 2.6)² on one degree of freedom.
        assert!((information.residual_variance().unwrap() - 0.8).abs() < 1e-14);
        for value in [0.0, -1.0, f64::NAN] {
            let refused = information.add_prior(&SVector::zeros(), &SVector::from([1.0, value]));
            assert!(matches!(refused, Err(IdentificationError::NotPositive { index: 1, .. })));
        }
    }

    #[test]
    fn refuses_what_is_not_finite_and_stays_as_it_was() {
        let mut information = folded(&blocks(3));
        let before = information;
        for value in [f64::NAN, f64::INFINITY, f64::NEG_INFINITY] {
            let (mut block, rhs) = blocks(1)[0];
            block[(4, 9)] = value;
            assert_eq!(information.update(&block, &rhs), Err(IdentificationError::NotFinite { row: 4 }));
            let (block, mut rhs) = blocks(1)[0];
            rhs[2] = value;
            assert_eq!(information.update(&block, &rhs), Err(IdentificationError::NotFinite { row: 2 }));
            assert_eq!(information, before);
        }
    }

    #[test]
    fn rank_is_judged_in_like_units() {
        // The second parameter is small, not undetermined: 1e-12 of the first in its own units.
        let factor = SMatrix::<f64, 2, 2>::new(1.0, 0.0, 0.0, 1e-12);
        let information = SquareRootInformation::from_square_root(&factor, &SVector::from([1.0, 1.0])).unwrap();
        assert!(matches!(
            information.solve(&SVector::from([1.0, 1.0])),
            Err(IdentificationError::NotExcited { rank: 1, expected: 2, .. })
        ));
        let solution = information.solve(&SVector::from([1.0, 1e12])).unwrap();
        assert!((solution - SVector::from([1.0, 1e12])).norm() < 1e-3);
    }
}
