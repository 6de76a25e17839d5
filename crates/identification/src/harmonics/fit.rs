//! The Fourier series nearest to one averaged period.

use super::joint_information::coefficient_std;
use super::periodic_record::PeriodicRecord;
use crate::error::IdentificationError;
use crate::fourier::{FourierBasis, FourierMotion};
use core::f64::consts::TAU;
use nalgebra::DMatrix;

/// Cosine and sine at the samples of a period, so that every harmonic reads the same numbers.
pub(super) struct Circle {
    cosine: Vec<f64>,
    sine: Vec<f64>,
}

impl Circle {
    pub(super) fn new(samples: usize) -> Self {
        let (sine, cosine) = (0..samples).map(|i| (TAU * (i as f64 / samples as f64)).sin_cos()).unzip();
        Self { cosine, sine }
    }

    /// Amplitudes of the cosine and the sine of a harmonic in one period; of harmonic zero the mean, and zero.
    pub(super) fn amplitudes(&self, series: &[f64], harmonic: usize) -> (f64, f64) {
        let samples = self.cosine.len();
        let (mut cosine, mut sine, mut index) = (0.0, 0.0, 0);
        for value in series {
            cosine += value * self.cosine[index];
            sine += value * self.sine[index];
            index = (index + harmonic) % samples;
        }
        let share = if harmonic == 0 { 1.0 } else { 2.0 } / samples as f64;
        (share * cosine, share * sine)
    }
}

/// A truncated Fourier series fitted to an averaged period, with the uncertainty of its coefficients.
///
/// Equal steps over a whole period make the basis functions orthogonal: least squares is the discrete Fourier transform, and
/// the coefficients are independent. Rates and accelerations follow by differentiating the series.
/// # Source
/// The minimisation of thesis 4.3 over the coefficients of (4.13).
#[derive(Clone, Debug, PartialEq)]
pub struct FourierFit {
    /// The series.
    pub motion: FourierMotion,
    /// Standard deviations of its coefficients, in the same places.
    pub coefficient_std: DMatrix<f64>,
}

impl FourierFit {
    /// The fit with harmonics 1 to `harmonics`.
    ///
    /// # Errors
    /// [`IdentificationError::TooManyHarmonics`] unless the period has more than twice as many samples,
    /// [`IdentificationError::NoHarmonics`], [`IdentificationError::InvalidPeriod`], [`IdentificationError::NotFinite`].
    pub fn new(record: &PeriodicRecord, harmonics: usize) -> Result<Self, IdentificationError> {
        record.validated()?;
        let samples = record.samples();
        let basis = FourierBasis::try_new(record.period_s, harmonics)?;
        if 2 * harmonics >= samples {
            return Err(IdentificationError::TooManyHarmonics { harmonics, samples });
        }
        let circle = Circle::new(samples);
        let channels = record.channels.ncols();
        let mut coefficients = DMatrix::zeros(basis.coefficients(), channels);
        for (channel, series) in record.channels.column_iter().enumerate() {
            let series: Vec<f64> = series.iter().copied().collect();
            coefficients[(0, channel)] = circle.amplitudes(&series, 0).0;
            for k in 1..=harmonics {
                let frequency = basis.frequency_rad_s(k);
                let (cosine, sine) = circle.amplitudes(&series, k);
                coefficients[(k, channel)] = frequency * sine;
                coefficients[(harmonics + k, channel)] = -frequency * cosine;
            }
        }
        let coefficient_std = coefficient_std(&basis, samples, &record.channel_std);
        Ok(Self { motion: FourierMotion::try_new(basis, record.chart, coefficients)?, coefficient_std })
    }
}
