//! The measurement update that all estimators in covariance form share.

use super::{ChiSquareGate, Innovation, RowsOutcome, Verdict};
use crate::error::IdentificationError;
use crate::householder::sqrt;
use nalgebra::{ArrayStorage, SMatrix, SVector};

/// Linearised rows: residual = sensitivity · (truth − estimate) + noise.
pub(super) struct Rows<const N: usize, const ROWS: usize> {
    pub(super) sensitivity: SMatrix<f64, ROWS, N>,
    pub(super) residual: SVector<f64, ROWS>,
    /// Infinite where nothing was measured.
    pub(super) standard_deviation: SVector<f64, ROWS>,
}

/// What an observation says: the step of the estimate, beside the covariance that was changed in place.
pub(super) struct Correction<const N: usize, const ROWS: usize> {
    pub(super) step: SVector<f64, N>,
    pub(super) innovation: Innovation<ROWS>,
}

/// Refuses rows without a positive standard deviation.
#[inline(always)]
pub(super) fn check_deviations<const ROWS: usize>(
    standard_deviation: &SVector<f64, ROWS>,
) -> Result<(), IdentificationError> {
    for (index, &value) in standard_deviation.iter().enumerate() {
        if value.is_nan() || value <= 0.0 {
            return Err(IdentificationError::NotPositive { index, value });
        }
    }
    Ok(())
}

/// Rows of a matrix as arrays.
#[inline(always)]
pub(super) fn rows_of<const N: usize, const ROWS: usize>(matrix: &SMatrix<f64, ROWS, N>) -> [[f64; N]; ROWS] {
    matrix.transpose().data.0
}

/// Σ columns[k] · weights[k] over the k that count; rows of a large state are mostly zeros.
#[inline(always)]
fn combination<const M: usize, const N: usize>(
    columns: &[[f64; M]; N],
    weights: &[f64; N],
    counts: &[bool; N],
) -> [f64; M] {
    let mut sum = [0.0; M];
    for ((column, weight), counts) in columns.iter().zip(weights).zip(counts) {
        if *counts {
            for (s, c) in sum.iter_mut().zip(column) {
                *s += c * weight;
            }
        }
    }
    sum
}

/// target −= factor · row, in the fixed length that the processor takes in few steps.
#[inline(always)]
fn subtract<const M: usize>(target: &mut [f64; M], factor: f64, row: &[f64; M]) {
    for (t, r) in target.iter_mut().zip(row) {
        *t -= factor * r;
    }
}

impl<const N: usize, const ROWS: usize> Rows<N, ROWS> {
    /// The Kalman update by the factors S = L D Lᵀ: no matrix is inverted, the covariance is written once and stays symmetric
    /// to the last bit. Column i of P Hᵀ L⁻ᵀ is the gain of row i after those before it.
    #[inline(always)]
    pub(super) fn correct(
        &self,
        covariance: &mut SMatrix<f64, N, N>,
    ) -> Result<Correction<N, ROWS>, IdentificationError> {
        check_deviations(&self.standard_deviation)?;
        let mut rows = rows_of(&self.sensitivity);
        let residual = measured_only(&self.residual, &self.standard_deviation);
        let mut columns = self.sensitivity.data.0;
        let [deviations] = self.standard_deviation.data.0;
        let measured = deviations.map(|deviation| deviation != f64::INFINITY);
        for i in 0..ROWS {
            if !measured[i] {
                rows[i] = [0.0; N];
                for column in &mut columns {
                    column[i] = 0.0;
                }
            }
        }
        let p = &mut covariance.data.0;
        let (mut gains, mut remaining) = ([[0.0; N]; ROWS], [[0.0; ROWS]; ROWS]);
        let observed = columns.map(|column| column.iter().any(|slope| *slope != 0.0));
        for i in 0..ROWS {
            if measured[i] {
                gains[i] = combination(p, &rows[i], &rows[i].map(|slope| slope != 0.0));
                remaining[i] = combination(&columns, &gains[i], &observed);
                remaining[i][i] += deviations[i] * deviations[i];
            }
        }
        let mut innovation_covariance = remaining;
        for i in 0..ROWS {
            for j in 0..i {
                innovation_covariance[i][j] = remaining[j][i];
            }
            if !measured[i] {
                innovation_covariance[i][i] = f64::INFINITY;
            }
        }
        let (mut step, [mut unexpected]) = ([0.0; N], residual.data.0);
        let (mut nis, mut determinant, mut degrees_of_freedom) = (0.0, 1.0, 0);
        for i in 0..ROWS {
            if !measured[i] {
                continue;
            }
            let (pivot, gain, row, surprise) = (remaining[i][i], gains[i], remaining[i], unexpected[i]);
            // Whatever is not finite in a row has come to one of the two.
            if !(pivot > 0.0 && (pivot + surprise).is_finite()) {
                return Err(IdentificationError::NotFinite { row: i });
            }
            let inverse = 1.0 / pivot;
            for j in i + 1..ROWS {
                let share = row[j] * inverse;
                unexpected[j] -= share * surprise;
                subtract(&mut gains[j], share, &gain);
                subtract(&mut remaining[j], share, &row);
            }
            let normalised = surprise * inverse;
            subtract(&mut step, -normalised, &gain);
            let root = sqrt(inverse);
            gains[i] = gain.map(|g| g * root);
            nis += surprise * normalised;
            determinant *= pivot;
            degrees_of_freedom += 1;
        }
        for (j, column) in p.iter_mut().enumerate() {
            for (gain, measured) in gains.iter().zip(&measured) {
                if *measured {
                    subtract(column, gain[j], gain);
                }
            }
        }
        let covariance = SMatrix::from_data(ArrayStorage(innovation_covariance));
        let innovation = Innovation { residual, covariance, nis, degrees_of_freedom, determinant };
        Ok(Correction { step: SVector::from(step), innovation })
    }
}

/// The mean of a matrix and its transpose.
#[inline]
pub(super) fn symmetric<const N: usize>(m: &SMatrix<f64, N, N>) -> SMatrix<f64, N, N> {
    (m + m.transpose()) * 0.5
}

/// The residual with zeros where nothing was measured.
#[inline(always)]
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
            let sum: f64 = lower[i].iter().zip(&lower[j]).take(j + 1).map(|(a, b)| a * b).sum();
            product[i][j] = sum;
            product[j][i] = sum;
        }
        if lower[i][i] == 0.0 {
            product[i][i] = f64::INFINITY;
        }
    }
    SMatrix::from_data(ArrayStorage(product))
}

/// Judges an observation: the step of the estimate, unless it is rejected, and the outcome.
///
/// `correct` changes a covariance and says the step; on rejection and on failure `covariance` stays what it was.
#[inline(always)]
pub(super) fn gated<const N: usize, const ROWS: usize>(
    gate: &mut Option<ChiSquareGate>,
    covariance: &mut SMatrix<f64, N, N>,
    correct: impl Fn(&mut SMatrix<f64, N, N>) -> Result<Correction<N, ROWS>, IdentificationError>,
) -> Result<(Option<SVector<f64, N>>, RowsOutcome<ROWS>), IdentificationError> {
    let mut learned = *covariance;
    let Correction { mut step, innovation } = correct(&mut learned)?;
    let verdict =
        gate.as_mut().map_or(Verdict::Accepted, |gate| gate.judge(innovation.nis, innovation.degrees_of_freedom));
    let outcome = RowsOutcome { innovation, verdict };
    match verdict {
        Verdict::Accepted => {}
        Verdict::Rejected { .. } => return Ok((None, outcome)),
        Verdict::Recovered { inflation } => {
            learned = *covariance * inflation;
            step = correct(&mut learned)?.step;
        }
    }
    *covariance = learned;
    Ok((Some(step), outcome))
}
