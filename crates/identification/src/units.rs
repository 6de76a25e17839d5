//! Units in which a body is of an ordinary size, so that no level that is written in kilograms, metres or seconds decides.

use crate::lie::{Pose, Wrench};
use crate::motion::MotionSample;
use crate::{BodyScale, IdentificationError, Noise};
use nalgebra::{SVector, Vector3};

/// An ordinary body and an ordinary step: a robot of ten kilograms, sampled at 62.5 Hz.
const MASS_KG: f64 = 10.0;
const LENGTH_M: f64 = 0.15;
const STEP_S: f64 = 0.016;
/// What drives it, and the lever arm of that.
const FORCE_N: f64 = 0.3;
const ARM_M: f64 = 0.3;
/// Within these factors of it, either way, a record counts as ordinary before anything is known of its body.
const ORDINARY_FORCE: f64 = 64.0;
const ORDINARY_ARM: f64 = 32.0;
const ORDINARY_STEP: f64 = 8.0;

/// Factors from the units of a record to those of this file. Powers of ten: what is told in units ten times as large is then the same, and
/// an ordinary record stays as it is.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Units {
    mass: f64,
    length: f64,
    time: f64,
}

/// The nearest power of ten; one within a factor of the ordinary, and where there is no value.
fn factor(ordinary: f64, value: f64, within: f64) -> f64 {
    let ratio = ordinary / value;
    let is_none = !(ratio.is_finite() && ratio > 0.0);
    if is_none || (1.0 / within..=within).contains(&ratio) { 1.0 } else { 10.0_f64.powf(ratio.log10().round()) }
}

impl Units {
    pub(crate) fn of(scale: BodyScale, step_s: f64) -> Self {
        Self {
            mass: factor(MASS_KG, scale.mass_kg(), 1.0),
            length: factor(LENGTH_M, scale.length_m(), 1.0),
            time: factor(STEP_S, step_s, 1.0),
        }
    }

    /// Before anything is known of the body: of its wrench and its steps.
    pub(crate) fn of_record(record: &[MotionSample]) -> Self {
        let mut steps_ns: Vec<i64> = record.windows(2).map(|pair| pair[1].time_ns - pair[0].time_ns).collect();
        let middle = steps_ns.len() / 2;
        let step_ns = if steps_ns.is_empty() { 0 } else { *steps_ns.select_nth_unstable(middle).1 };
        let time = factor(STEP_S, step_ns as f64 * 1e-9, ORDINARY_STEP);
        let wrenches = || record.iter().filter_map(|sample| sample.wrench_body);
        let count = wrenches().count().max(1);
        let rms = |squares: f64| (squares / (3 * count) as f64).sqrt();
        let force = rms(wrenches().map(|wrench| wrench.force.norm_squared()).sum());
        let torque = rms(wrenches().map(|wrench| wrench.torque.norm_squared()).sum());
        let length = factor(ARM_M, torque / force, ORDINARY_ARM);
        let told = Self { mass: 1.0, length, time }.force();
        let drive = told * force.hypot(torque * length / ARM_M);
        Self { mass: factor(FORCE_N, drive, ORDINARY_FORCE), length, time }
    }

    pub(crate) fn force(&self) -> f64 {
        self.mass * self.acceleration()
    }

    pub(crate) fn acceleration(&self) -> f64 {
        self.length / (self.time * self.time)
    }

    pub(crate) fn length(&self) -> f64 {
        self.length
    }

    pub(crate) fn time(&self) -> f64 {
        self.time
    }

    /// From these units to those of the record.
    pub(crate) fn back(&self) -> Self {
        Self { mass: 1.0 / self.mass, length: 1.0 / self.length, time: 1.0 / self.time }
    }

    /// The record in these units; `None` where they are its own.
    pub(crate) fn record(&self, record: &[MotionSample]) -> Option<Vec<MotionSample>> {
        let speed = self.length / self.time;
        let first_ns = record.first()?.time_ns;
        #[allow(clippy::cast_possible_truncation)] // saturates
        let scaled = |sample: &MotionSample| MotionSample {
            time_ns: (sample.time_ns.saturating_sub(first_ns) as f64 * self.time).round() as i64,
            world_from_body: sample
                .world_from_body
                .map(|pose| Pose::from_parts((pose.translation.vector * self.length).into(), pose.rotation)),
            velocity_origin_world: sample.velocity_origin_world.map(|v| v * speed),
            rate_body: sample.rate_body.map(|w| w / self.time),
            acceleration_origin_body: sample.acceleration_origin_body.map(|a| a * self.acceleration()),
            wrench_body: sample.wrench_body.map(|wrench| self.wrench(&wrench)),
            besides_body: sample.besides_body.map(|wrench| self.wrench(&wrench)),
            stored_momentum_body: sample.stored_momentum_body.map(|h| h * (self.force() * self.length * self.time)),
        };
        (*self != Self { mass: 1.0, length: 1.0, time: 1.0 }).then(|| record.iter().map(scaled).collect())
    }

    /// A time of the scaled record in the record itself.
    #[allow(clippy::cast_possible_truncation)] // saturates
    pub(crate) fn time_ns(&self, scaled_ns: i64, record: &[MotionSample]) -> i64 {
        let first_ns = record.first().map_or(0, |sample| sample.time_ns);
        first_ns.saturating_add((scaled_ns as f64 / self.time).round() as i64)
    }

    pub(crate) fn wrench(&self, wrench: &Wrench<f64>) -> Wrench<f64> {
        Wrench::new(wrench.torque * (self.force() * self.length), wrench.force * self.force())
    }

    pub(crate) fn gravity(&self, gravity_world: &Vector3<f64>) -> Vector3<f64> {
        gravity_world * self.acceleration()
    }

    pub(crate) fn noise(&self, noise: &Noise) -> Noise {
        Noise {
            torque_n_m: noise.torque_n_m * (self.force() * self.length),
            force_n: noise.force_n * self.force(),
            attitude_rad: noise.attitude_rad,
            position_m: noise.position_m * self.length,
            rate_rad_s: noise.rate_rad_s / self.time,
            velocity_m_s: noise.velocity_m_s * (self.length / self.time),
            acceleration_m_s2: noise.acceleration_m_s2 * self.acceleration(),
        }
    }

    pub(crate) fn scale(&self, scale: BodyScale) -> Result<BodyScale, IdentificationError> {
        BodyScale::try_new(scale.mass_kg() * self.mass, scale.length_m() * self.length)
    }

    /// From the ten parameters of the record to those in these units.
    pub(crate) fn parameter_factors(&self) -> SVector<f64, 10> {
        SVector::from_fn(|i, _| match i {
            0 => self.mass,
            1..=3 => self.mass * self.length,
            _ => self.mass * self.length * self.length,
        })
    }
}
