//! The measurement update that all estimators in covariance form share.

use super::{ChiSquareGate, Innovation, Outcome, Verdict};
use crate::error::IdentificationError;
use crate::householder::sqrt;
use nalgebra::{SMatrix, SVector};

/// Linearised rows: residual = sensitivity · (truth − estimate) + noise.
pub(super) struct Rows<const N: usize, const ROWS: usize> {
    pub(super) sensitivity: SMatrix<f64, ROWS, N>,
    pub(super) residual: SVector<f64, ROWS>,
    /// Infinite where nothing was measured.
    pub(super) standard_deviation: SVector<f64, ROWS>,
}

/// What an observation would change.
pub(super) struct Correction<const N: usize, const ROWS: usize> {
    pub(super) step: SVector<f64, N>,
    pub(super) covariance: SMatrix<f64, N, N>,
    pub(super) innovation: Innovation<ROWS>,
}

/// Refuses rows without a positive standard deviation, and measured rows that are not finite.
pub(super) fn check_rows<const N: usize, const ROWS: usize>(
    sensitivity: &[[f64; N]; ROWS],
    residual: &SVector<f64, ROWS>,
    standard_deviation: &SVector<f64, ROWS>,
) -> Result<(), IdentificationError> {
    let rows = sensitivity.iter().zip(residual.iter()).zip(standard_deviation.iter());
    for (index, ((row, residual), &value)) in rows.enumerate() {
        if value.is_nan() || value <= 0.0 {
            return Err(IdentificationError::NotPositive { index, value });
        }
        // The sum is not finite where any summand is not.
        if value.is_finite() && !(residual + row.iter().sum::<f64>()).is_finite() {
            return Err(IdentificationError::NotFinite { row: index });
        }
    }
    Ok(())
}

/// Rows of a matrix as arrays.
pub(super) fn rows_of<const N: usize, const ROWS: usize>(matrix: &SMatrix<f64, ROWS, N>) -> [[f64; N]; ROWS] {
    matrix.transpose().data.0
}

fn dot<const N: usize>(a: &[f64; N], b: &[f64; N]) -> f64 {
    a.iter().zip(b).map(|(a, b)| a * b).sum()
}

impl<const N: usize, const ROWS: usize> Rows<N, ROWS> {
    /// The Kalman update, one scalar row after the other: no matrix is inverted, the covariance stays symmetric to the last
    /// bit, and the factor of the innovation covariance falls out on the way.
    #[inline]
    pub(super) fn correct(&self, covariance: &SMatrix<f64, N, N>) -> Result<Correction<N, ROWS>, IdentificationError> {
        let rows = rows_of(&self.sensitivity);
        check_rows(&rows, &self.residual, &self.standard_deviation)?;
        let mut p = covariance.data.0;
        let mut step = [0.0; N];
        // gains[i] = P hᵢ / √sᵢ with P as the rows before left it; lower = √S.
        let (mut gains, mut lower) = ([[0.0; N]; ROWS], [[0.0; ROWS]; ROWS]);
        let (mut nis, mut determinant, mut degrees_of_freedom) = (0.0, 1.0, 0);
        for i in 0..ROWS {
            let (h, deviation) = (&rows[i], self.standard_deviation[i]);
            if deviation == f64::INFINITY {
                continue;
            }
            let mut gain = [0.0; N];
            for (column, h) in p.iter().zip(h) {
                for (g, c) in gain.iter_mut().zip(column) {
                    *g += c * h;
                }
            }
            let pivot = dot(h, &gain) + deviation * deviation;
            let root = sqrt(pivot);
            let inverse = 1.0 / root;
            for g in &mut gain {
                *g *= inverse;
            }
            for (column, gj) in p.iter_mut().zip(&gain) {
                for (c, gk) in column.iter_mut().zip(&gain) {
                    *c -= gj * gk;
                }
            }
            let unexpected = (self.residual[i] - dot(h, &step)) * inverse;
            for (s, g) in step.iter_mut().zip(&gain) {
                *s += g * unexpected;
            }
            for j in 0..i {
                lower[i][j] = dot(h, &gains[j]);
            }
            lower[i][i] = root;
            gains[i] = gain;
            nis += unexpected * unexpected;
            determinant *= pivot;
            degrees_of_freedom += 1;
        }
        let innovation = Innovation {
            residual: measured_only(&self.residual, &self.standard_deviation),
            covariance: product_with_transpose(&lower),
            nis,
            degrees_of_freedom,
            determinant,
        };
        Ok(Correction {
            step: SVector::from(step),
            covariance: SMatrix::from_data(nalgebra::ArrayStorage(p)),
            innovation,
        })
    }
}

/// The mean of a matrix and its transpose.
#[inline]
pub(super) fn symmetric<const N: usize>(m: &SMatrix<f64, N, N>) -> SMatrix<f64, N, N> {
    (m + m.transpose()) * 0.5
}

/// The residual with zeros where nothing was measured.
pub(super) fn measured_only<const ROWS: usize>(
    residual: &SVector<f64, ROWS>,
    standard_deviation: &SVector<f64, ROWS>,
) -> SVector<f64, ROWS> {
    residual.zip_map(standard_deviation, |r, s| if s == f64::INFINITY { 0.0 } else { r })
}

/// L Lᵀ of a lower triangle given by rows; infinite on the diagonal where a row is empty.
pub(super) fn product_with_transpose<const ROWS: usize>(lower: &[[f64; ROWS]; ROWS]) -> SMatrix<f64, ROWS, ROWS> {
    let mut product = [[0.0; ROWS]; ROWS];
    for i in 0..ROWS {
        for j in 0..=i {
            let mut sum = 0.0;
            for k in 0..=j {
                sum += lower[i][k] * lower[j][k];
            }
            product[i][j] = sum;
            product[j][i] = sum;
        }
        if lower[i][i] == 0.0 {
            product[i][i] = f64::INFINITY;
        }
    }
    SMatrix::from_data(nalgebra::ArrayStorage(product))
}

/// Judges an observation: what to change, unless it is rejected, and the outcome.
pub(super) fn gated<const N: usize, const ROWS: usize>(
    gate: &mut Option<ChiSquareGate>,
    covariance: &SMatrix<f64, N, N>,
    correct: impl Fn(&SMatrix<f64, N, N>) -> Result<Correction<N, ROWS>, IdentificationError>,
) -> Result<(Option<Correction<N, ROWS>>, Outcome<ROWS>), IdentificationError> {
    let correction = correct(covariance)?;
    let innovation = correction.innovation;
    let verdict =
        gate.as_mut().map_or(Verdict::Accepted, |gate| gate.judge(innovation.nis, innovation.degrees_of_freedom));
    let correction = match verdict {
        Verdict::Accepted => Some(correction),
        Verdict::Rejected { .. } => None,
        Verdict::Recovered { inflation } => Some(correct(&(covariance * inflation))?),
    };
    Ok((correction, Outcome { innovation, verdict }))
}
