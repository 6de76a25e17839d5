//! The basis functions of a truncated Fourier series and their derivatives.

use crate::error::IdentificationError;
use core::f64::consts::TAU;
use nalgebra::DMatrix;

/// Harmonics 1 to n of one period, in the parametrisation whose coefficients are amplitudes of the *rate*.
///
/// `x(t) = a0 + sum_k a_k/(w k) sin(w k t) - b_k/(w k) cos(w k t)`, `w = 2 pi / period`; coefficients in the order
/// `[a0, a_1 .. a_n, b_1 .. b_n]`.
/// # Source
/// Thesis (4.13).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FourierBasis {
    period_s: f64,
    harmonics: usize,
}

impl FourierBasis {
    /// Of at least one harmonic.
    ///
    /// # Errors
    /// [`IdentificationError::InvalidPeriod`], [`IdentificationError::NoHarmonics`].
    pub fn try_new(period_s: f64, harmonics: usize) -> Result<Self, IdentificationError> {
        if !(period_s.is_finite() && period_s > 0.0) {
            return Err(IdentificationError::InvalidPeriod { period_s });
        }
        if harmonics == 0 {
            return Err(IdentificationError::NoHarmonics);
        }
        Ok(Self { period_s, harmonics })
    }

    /// The same period with at least so many harmonics.
    pub(super) fn extended_to(&self, harmonics: usize) -> Self {
        Self { period_s: self.period_s, harmonics: harmonics.max(self.harmonics) }
    }

    /// Time after which everything repeats, s.
    pub fn period_s(&self) -> f64 {
        self.period_s
    }

    /// Number n of harmonics.
    pub fn harmonics(&self) -> usize {
        self.harmonics
    }

    /// Number `2n + 1` of coefficients.
    pub fn coefficients(&self) -> usize {
        2 * self.harmonics + 1
    }

    /// Angular frequency `w k` of harmonic k, rad/s.
    pub fn frequency_rad_s(&self, harmonic: usize) -> f64 {
        TAU / self.period_s * harmonic as f64
    }

    /// The functions at one time: value, first and second derivative by time, each `2n + 1` long.
    ///
    /// The time may be any; it is taken modulo the period first.
    pub fn at(&self, time_s: f64) -> [Vec<f64>; 3] {
        let phase = (time_s / self.period_s).rem_euclid(1.0);
        let n = self.harmonics;
        let zero = vec![0.0; self.coefficients()];
        let [mut value, mut rate, mut acceleration] = [zero.clone(), zero.clone(), zero];
        value[0] = 1.0;
        for k in 1..=n {
            let (sine, cosine) = (TAU * (phase * k as f64).fract()).sin_cos();
            let frequency = self.frequency_rad_s(k);
            (value[k], value[n + k]) = (sine / frequency, -cosine / frequency);
            (rate[k], rate[n + k]) = (cosine, sine);
            (acceleration[k], acceleration[n + k]) = (-frequency * sine, frequency * cosine);
        }
        [value, rate, acceleration]
    }

    /// The functions at many times, one row each: values, first and second derivatives.
    pub fn table(&self, times_s: &[f64]) -> [DMatrix<f64>; 3] {
        let zero = DMatrix::zeros(times_s.len(), self.coefficients());
        let mut tables = [zero.clone(), zero.clone(), zero];
        for (row, &time_s) in times_s.iter().enumerate() {
            for (table, functions) in tables.iter_mut().zip(self.at(time_s)) {
                table.row_mut(row).copy_from_slice(&functions);
            }
        }
        tables
    }

    /// An orthonormal basis, one column each, of the coefficients whose motion starts and ends at zero and at rest, without
    /// acceleration: `2n - 2` of them, none for n = 1.
    ///
    /// # Source
    /// The constraints below thesis (4.15): `a0 = sum b_k/(w k)`, `sum a_k = 0`, `sum k b_k = 0`; those at the end of the
    /// period say the same.
    pub fn rest_to_rest(&self) -> DMatrix<f64> {
        let n = self.harmonics;
        let mut columns = DMatrix::zeros(self.coefficients(), 2 * n - 2);
        for k in 2..=n {
            let (cosine, sine) = (k - 2, n - 1 + k - 2);
            (columns[(1, cosine)], columns[(k, cosine)]) = (-1.0, 1.0);
            (columns[(n + 1, sine)], columns[(n + k, sine)]) = (-(k as f64), 1.0);
            columns[(0, sine)] = 1.0 / self.frequency_rad_s(k) - k as f64 / self.frequency_rad_s(1);
        }
        if n < 2 { columns } else { columns.qr().q() }
    }
}

#[cfg(test)]
#[allow(clippy::unreadable_literal)]
mod tests {
    use super::*;
    use nalgebra::DVector;

    /// Golden series of the reference equations, section e.
    #[test]
    fn golden_series() {
        let basis = FourierBasis::try_new(10.0, 2).unwrap();
        let coefficients = [0.1, 0.2, -0.2, 0.3, -0.15];
        let golden = [-0.0494219314017197, 0.3397589090039991, 0.2938922070715539];
        for time_s in [1.7, 11.7, -8.3] {
            for (functions, expected) in basis.at(time_s).iter().zip(golden) {
                let found: f64 = functions.iter().zip(coefficients).map(|(f, c)| f * c).sum();
                assert!((found - expected).abs() < 3e-15, "{found} {expected}");
            }
        }
    }

    #[test]
    fn rest_to_rest_is_all_that_starts_and_ends_at_rest() {
        for (n, free) in [(1, 0), (2, 2), (3, 4), (5, 8), (12, 22)] {
            let basis = FourierBasis::try_new(7.0, n).unwrap();
            let rest = basis.rest_to_rest();
            assert_eq!(rest.shape(), (2 * n + 1, free));
            assert!((rest.transpose() * &rest - DMatrix::identity(free, free)).norm() < 1e-13);
            for functions in basis.table(&[0.0, 7.0]) {
                assert!((functions * &rest).amax() < 1e-12 * basis.frequency_rad_s(n).max(1.0));
            }
            let free_again = DMatrix::from_fn(3, 2 * n + 1, |row, column| basis.at(0.0)[row][column]).rank(1e-9);
            assert_eq!(2 * n + 1 - free_again, free);
        }
    }

    #[test]
    fn derivatives_are_derivatives() {
        let basis = FourierBasis::try_new(3.0, 4).unwrap();
        let (time_s, step_s) = (0.83, 1e-5);
        let [_, rate, acceleration] = basis.at(time_s).map(DVector::from_vec);
        let [before, after] = [time_s - step_s, time_s + step_s].map(|t| basis.at(t).map(DVector::from_vec));
        assert!(((&after[0] - &before[0]) / (2.0 * step_s) - rate).amax() < 1e-8);
        assert!(((&after[1] - &before[1]) / (2.0 * step_s) - acceleration).amax() < 1e-7);
    }

    #[test]
    fn nonsense_is_refused() {
        for period_s in [0.0, -1.0, f64::NAN, f64::INFINITY] {
            assert!(matches!(FourierBasis::try_new(period_s, 3), Err(IdentificationError::InvalidPeriod { .. })));
        }
        assert!(matches!(FourierBasis::try_new(1.0, 0), Err(IdentificationError::NoHarmonics)));
    }
}
