//! Units in which a body is of an ordinary size, so that no level that is written in kilograms, metres or seconds decides.

use super::Settings;
use super::noise::SampleNoise;
use crate::BodyScale;
use crate::error::IdentificationError;
use crate::lie::{Pose, Wrench};
use crate::motion::MotionSample;
use nalgebra::SVector;

/// An ordinary body and an ordinary step: a robot of ten kilograms, sampled at 62.5 Hz.
const MASS_KG: f64 = 10.0;
const LENGTH_M: f64 = 0.15;
const STEP_S: f64 = 0.016;
/// Within this factor of it, either way, nothing is changed.
const ORDINARY: f64 = 4.0;

/// Factors from the units of a record to those of this file; powers of two, so that no digit is lost. One within the ordinary.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Units {
    mass: f64,
    length: f64,
    time: f64,
}

impl Units {
    pub(super) fn of(scale: BodyScale, step_s: f64) -> Self {
        let factor = |ordinary: f64, value: f64| {
            let ratio = ordinary / value;
            if (1.0 / ORDINARY..=ORDINARY).contains(&ratio) { 1.0 } else { ratio.log2().round().exp2() }
        };
        Self {
            mass: factor(MASS_KG, scale.mass_kg()),
            length: factor(LENGTH_M, scale.length_m()),
            time: factor(STEP_S, step_s),
        }
    }

    fn force(&self) -> f64 {
        self.mass * self.length / (self.time * self.time)
    }

    /// The record in these units; `None` where they are its own.
    pub(super) fn record(&self, record: &[MotionSample]) -> Option<Vec<MotionSample>> {
        let (length, time, force) = (self.length, self.time, self.force());
        let speed = length / time;
        let first_ns = record.first()?.time_ns;
        #[allow(clippy::cast_possible_truncation)] // saturates
        let scaled = |sample: &MotionSample| MotionSample {
            time_ns: ((sample.time_ns - first_ns) as f64 * time).round() as i64,
            world_from_body: sample
                .world_from_body
                .map(|pose| Pose::from_parts((pose.translation.vector * length).into(), pose.rotation)),
            velocity_origin_world: sample.velocity_origin_world.map(|v| v * speed),
            rate_body: sample.rate_body.map(|w| w / time),
            acceleration_origin_body: sample.acceleration_origin_body.map(|a| a * (speed / time)),
            wrench_body: sample.wrench_body.map(|w| Wrench::new(w.torque * (force * length), w.force * force)),
            besides_body: sample.besides_body.map(|w| Wrench::new(w.torque * (force * length), w.force * force)),
            stored_momentum_body: sample.stored_momentum_body.map(|h| h * (force * length * time)),
        };
        (*self != Self { mass: 1.0, length: 1.0, time: 1.0 }).then(|| record.iter().map(scaled).collect())
    }

    /// A time of the scaled record in the record itself.
    #[allow(clippy::cast_possible_truncation)] // saturates
    pub(super) fn time_ns(&self, scaled_ns: i64, record: &[MotionSample]) -> i64 {
        let first_ns = record.first().map_or(0, |sample| sample.time_ns);
        first_ns.saturating_add((scaled_ns as f64 / self.time).round() as i64)
    }

    pub(super) fn settings(&self, settings: &Settings) -> Settings {
        let gravity_world = settings.gravity_world * (self.length / (self.time * self.time));
        Settings { gravity_world, ..*settings }
    }

    pub(super) fn noise(&self, noise: &SampleNoise) -> SampleNoise {
        SampleNoise {
            attitude_rad: noise.attitude_rad,
            position_m: noise.position_m * self.length,
            rate_rad_s: noise.rate_rad_s / self.time,
            velocity_m_s: noise.velocity_m_s * (self.length / self.time),
            acceleration_m_s2: noise.acceleration_m_s2 * (self.length / (self.time * self.time)),
        }
    }

    /// Noise of torque and force.
    pub(super) fn wrench_noise(&self, (torque, force): (f64, f64)) -> (f64, f64) {
        (torque * (self.force() * self.length), force * self.force())
    }

    pub(super) fn scale(&self, scale: BodyScale) -> Result<BodyScale, IdentificationError> {
        BodyScale::try_new(scale.mass_kg() * self.mass, scale.length_m() * self.length)
    }

    /// From the ten parameters in these units to those of the record.
    pub(super) fn parameter_factors(&self) -> SVector<f64, 10> {
        let (mass, length) = (1.0 / self.mass, 1.0 / self.length);
        SVector::from_fn(|i, _| match i {
            0 => mass,
            1..=3 => mass * length,
            _ => mass * length * length,
        })
    }
}
