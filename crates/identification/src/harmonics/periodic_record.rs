//! One period of a motion, averaged over its cycles.

use crate::error::IdentificationError;
use crate::fourier::{AttitudeChart, FourierMotion, MotionInstant};
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
        (0..self.samples()).map(|i| self.period_s * i as f64 / self.samples() as f64).collect()
    }

    /// A motion at the times for which the wrenches count, accelerations less gravity: what the wrenches have to explain.
    ///
    /// # Errors
    /// [`IdentificationError::NotFinite`] naming the sample where the quaternion passes through zero.
    pub fn felt_motion(&self, motion: &FourierMotion) -> Result<Vec<MotionInstant>, IdentificationError> {
        let times_s: Vec<f64> = self.times_s().iter().map(|time_s| time_s + self.wrench_offset_s).collect();
        let [value, rate, acceleration] =
            motion.basis().table(&times_s).map(|functions| (functions * motion.coefficients()).transpose());
        let channels = value.nrows();
        let at = |matrix: &DMatrix<f64>, i: usize| -> [f64; 7] {
            core::array::from_fn(|channel| if channel < channels { matrix[(channel, i)] } else { 0.0 })
        };
        (0..times_s.len())
            .map(|i| {
                let (value, rate, acceleration) = (at(&value, i), at(&rate, i), at(&acceleration, i));
                let mut instant = MotionInstant::from_channels(motion.chart(), &value, &rate, &acceleration)
                    .ok_or(IdentificationError::NotFinite { row: i })?;
                instant.acceleration_origin_world -= self.gravity;
                Ok(instant)
            })
            .collect()
    }

    /// The averaged wrench of one sample.
    pub fn wrench(&self, sample: usize) -> SVector<f64, 6> {
        self.wrenches.fixed_view::<1, 6>(sample, 0).transpose()
    }
}
