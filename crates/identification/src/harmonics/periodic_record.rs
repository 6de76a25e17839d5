//! One period of a motion, averaged over its cycles.

use crate::fourier::AttitudeChart;
use nalgebra::{DMatrix, SVector};

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
    /// N x 6: averaged wrench `[torque; force]` less that of gravity, body axes, about the body origin.
    pub wrenches: DMatrix<f64>,
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
        (0..self.samples()).map(|i| self.period_s * i as f64 / self.samples() as f64).collect()
    }
}
