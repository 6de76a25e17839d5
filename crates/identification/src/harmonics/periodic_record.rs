//! One period of a motion, averaged over its cycles.

use super::joint_information::BasisTable;
use crate::error::IdentificationError;
use crate::fourier::{AttitudeChart, FourierBasis};
use nalgebra::{DMatrix, SVector, Vector3};

/// One averaged period: what the Fourier fit, harmonic selection and both estimators work on.
///
/// Sample i lies at `i period / N`; the end point is the first sample of the next period and absent.
/// # Units
/// s, m, rad or quaternion components, N m, N.
/// # Source
/// Thesis 4.3.
#[derive(Clone, Debug, PartialEq)]
pub struct PeriodicRecord {
    /// Period, s.
    pub period_s: f64,
    /// Coordinates of the attitude channels.
    pub chart: AttitudeChart,
    /// N x (3 + channels of the chart): averaged position of the body origin and attitude, one row per sample.
    pub channels: DMatrix<f64>,
    /// N x 6: averaged wrench `[torque; force]` without that of gravity, body axes, about the body origin.
    pub wrenches: DMatrix<f64>,
    /// Gravitational acceleration, axes of the coordinates, m/s^2.
    pub gravity: Vector3<f64>,
    /// By how much later than the pose of its row a wrench counts, s: half a step where it is held, zero where sampled.
    pub wrench_offset_s: f64,
    /// Standard deviation of the noise of one averaged sample, channel by channel.
    pub channel_std: Vec<f64>,
    /// Standard deviation of the noise of one averaged wrench, component by component.
    pub wrench_std: SVector<f64, 6>,
}

impl PeriodicRecord {
    /// Number N of samples in the period.
    pub fn samples(&self) -> usize {
        self.channels.nrows()
    }

    /// Times of the samples, s.
    pub fn times_s(&self) -> Vec<f64> {
        (0..self.samples()).map(|sample| self.time_s(sample)).collect()
    }

    /// Time of one sample, s.
    pub(super) fn time_s(&self, sample: usize) -> f64 {
        self.period_s * sample as f64 / self.samples() as f64
    }

    /// Refuses tables of different lengths, what is not finite, and standard deviations that are none.
    ///
    /// # Errors
    /// [`IdentificationError::RecordShape`], [`IdentificationError::NotFinite`], [`IdentificationError::NotPositive`] for a
    /// standard deviation that is negative or not finite.
    pub(super) fn validated(&self) -> Result<(), IdentificationError> {
        let (samples, channels) = (self.samples(), 3 + self.chart.channels());
        for (rows, columns, expected_columns) in [
            (samples, self.channels.ncols(), channels),
            (self.wrenches.nrows(), self.wrenches.ncols(), 6),
            (samples, self.channel_std.len(), channels),
        ] {
            if (rows, columns) != (samples, expected_columns) {
                let expected_rows = samples;
                return Err(IdentificationError::RecordShape { rows, columns, expected_rows, expected_columns });
            }
        }
        let finite = |row: usize| {
            self.channels.row(row).iter().chain(self.wrenches.row(row).iter()).all(|value| value.is_finite())
        };
        if let Some(row) = (0..samples).find(|&row| !finite(row)) {
            return Err(IdentificationError::NotFinite { row });
        }
        let all_std = self.channel_std.iter().chain(self.wrench_std.iter());
        if let Some((index, &value)) = all_std.enumerate().find(|(_, std)| !(**std >= 0.0 && std.is_finite())) {
            return Err(IdentificationError::NotPositive { index, value });
        }
        Ok(())
    }

    /// The basis functions at the times for which the wrenches count.
    pub(super) fn wrench_table(&self, basis: &FourierBasis) -> BasisTable {
        BasisTable::new(basis, self.times_s().iter().map(|time_s| time_s + self.wrench_offset_s), self.gravity)
    }

    /// The averaged wrench of one sample.
    pub fn wrench(&self, sample: usize) -> SVector<f64, 6> {
        self.wrenches.fixed_view::<1, 6>(sample, 0).transpose()
    }
}
