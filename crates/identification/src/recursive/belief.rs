//! The measurement update that all estimators in covariance form share.

use super::{ChiSquareGate, Innovation, Outcome, Verdict};
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

/// In four lanes, which the processor adds at once.
#[inline(always)]
fn dot<const N: usize>(a: &[f64; N], b: &[f64; N]) -> f64 {
    let mut lanes = [0.0; 4];
    for (k, (a, b)) in a.iter().zip(b).enumerate() {
        lanes[k % 4] += a * b;
    }
    (lanes[0] + lanes[1]) + (lanes[2] + lanes[3])
}

/// Σ columns[k] · weights[k].
#[inline(always)]
fn combination<const M: usize, const N: usize>(columns: &[[f64; M]; N], weights: &[f64; N]) -> [f64; M] {
    let mut sum = [0.0; M];
    for (column, weight) in columns.iter().zip(weights) {
        for (s, c) in sum.iter_mut().zip(column) {
            *s += c * weight;
        }
    }
    sum
}

impl<const N: usize, const ROWS: usize> Rows<N, ROWS> {
    /// The Kalman update, one scalar row after the other: no matrix is inverted, the covariance stays symmetric to the last
    /// bit, and the factor of the innovation covariance falls out on the way.
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
        for i in 0..ROWS {
            if deviations[i] == f64::INFINITY {
                rows[i] = [0.0; N];
                for column in &mut columns {
                    column[i] = 0.0;
                }
            }
        }
        let p = &mut covariance.data.0;
        let (mut step, [mut unexpected]) = ([0.0; N], residual.data.0);
        let mut innovation_covariance = [[0.0; ROWS]; ROWS];
        let (mut nis, mut determinant, mut degrees_of_freedom) = (0.0, 1.0, 0);
        for i in 0..ROWS {
            let (h, deviation) = (&rows[i], deviations[i]);
            if deviation == f64::INFINITY {
                innovation_covariance[i][i] = f64::INFINITY;
                continue;
            }
            // P h / √s with P as the rows before left it.
            let mut gain = combination(p, h);
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
            // Column i of √S: nothing above the diagonal.
            let mut shared = combination(&columns, &gain);
            for (j, value) in shared.iter_mut().enumerate() {
                if j < i {
                    *value = 0.0;
                }
            }
            shared[i] = root;
            for (column, sj) in innovation_covariance.iter_mut().zip(&shared) {
                for (c, sk) in column.iter_mut().zip(&shared) {
                    *c += sj * sk;
                }
            }
            let normalised = unexpected[i] * inverse;
            // Whatever is not finite in a row has come to one of the two.
            if !(pivot + normalised).is_finite() {
                return Err(IdentificationError::NotFinite { row: i });
            }
            for (u, s) in unexpected.iter_mut().zip(&shared) {
                *u -= s * normalised;
            }
            for (s, g) in step.iter_mut().zip(&gain) {
                *s += g * normalised;
            }
            nis += normalised * normalised;
            determinant *= pivot;
            degrees_of_freedom += 1;
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
) -> Result<(Option<SVector<f64, N>>, Outcome<ROWS>), IdentificationError> {
    let mut learned = *covariance;
    let Correction { mut step, innovation } = correct(&mut learned)?;
    let verdict =
        gate.as_mut().map_or(Verdict::Accepted, |gate| gate.judge(innovation.nis, innovation.degrees_of_freedom));
    let outcome = Outcome { innovation, verdict };
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
