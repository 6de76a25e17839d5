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
            // x − x is zero for finite x only; the sum over a row is finite exactly when all entries are.
            let mut probe = rhs[i] - rhs[i];
            for j in 0..P {
                let value = block[(i, j)];
                rows[i][j] = value;
                probe += value - value;
            }
            outputs[i] = rhs[i];
            if probe != 0.0 {
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

    fn inverse_factor(&self) -> SMatrix<f64, P, P> {
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
            for k in i + 1..P {
                let weight = self.factor_rows[i][k] * reciprocal;
                for (r, below) in row.iter_mut().zip(&inverse[k]) {
                    *r -= weight * below;
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
