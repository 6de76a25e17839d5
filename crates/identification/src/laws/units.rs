//! The law that no unit decides, of a whole identification.

use super::broken_unless;
use super::estimator::ANSWERED;
use super::recursive_estimator::{Short, violation};
use crate::estimator::EstimatorError;
use crate::lie::{Pose, Wrench};
use crate::motion::MotionSample;
use crate::{Identification, Settings};
use nalgebra::{SMatrix, SVector};
use tumble_lie::laws::{LawViolation, require};

/// Units of mass, length and time, each by how many of them make a kilogram, a metre, a second.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Units {
    /// Units of mass in a kilogram.
    pub mass: f64,
    /// Units of length in a metre.
    pub length: f64,
    /// Units of time in a second.
    pub time: f64,
}

impl Units {
    fn force(&self) -> f64 {
        self.mass * self.length / (self.time * self.time)
    }

    /// A record as told in these units. Times are whole nanoseconds: a step must stay many of them.
    #[must_use]
    pub fn record(&self, record: &[MotionSample]) -> Vec<MotionSample> {
        let (force, speed) = (self.force(), self.length / self.time);
        let wrench = |w: Wrench<f64>| Wrench::new(w.torque * (force * self.length), w.force * force);
        #[allow(clippy::cast_possible_truncation)] // saturates
        let told = |sample: &MotionSample| MotionSample {
            time_ns: (sample.time_ns as f64 * self.time).round() as i64,
            world_from_body: sample
                .world_from_body
                .map(|pose| Pose::from_parts((pose.translation.vector * self.length).into(), pose.rotation)),
            velocity_origin_world: sample.velocity_origin_world.map(|v| v * speed),
            rate_body: sample.rate_body.map(|w| w / self.time),
            acceleration_origin_body: sample.acceleration_origin_body.map(|a| a * (speed / self.time)),
            wrench_body: sample.wrench_body.map(wrench),
            besides_body: sample.besides_body.map(wrench),
            stored_momentum_body: sample.stored_momentum_body.map(|h| h * (force * self.length * self.time)),
        };
        record.iter().map(told).collect()
    }

    /// From the ten parameters in SI units to those in these.
    #[must_use]
    pub fn parameters(&self) -> SMatrix<f64, 10, 10> {
        SMatrix::from_diagonal(&SVector::from_fn(|i, _| match i {
            0 => self.mass,
            1..=3 => self.mass * self.length,
            _ => self.mass * self.length * self.length,
        }))
    }
}

/// What the law asks to identify a record with given settings.
pub type Identifies<'a> = dyn Fn(&[MotionSample], &Settings) -> Result<Identification, EstimatorError> + 'a;

/// The law of an identification that no unit decides: told in each of `units`, the record gives the same method, rows and rank, the same
/// verdict, and the same body.
///
/// `identify` is given the settings of each telling, gravity in its units; a prior has no place in this law. `tolerance` is the largest
/// difference of a parameter that is still rounding, in standard deviations; of a standard deviation a hundredth may change.
///
/// # Errors
/// The first broken law: `a good record is answered`, `units do not decide`, `units do not matter`.
pub fn check_identification_units(
    identify: &Identifies<'_>,
    record: &[MotionSample],
    settings: &Settings,
    units: &[Units],
    tolerance: f64,
) -> Result<(), LawViolation> {
    let found = |record: &[MotionSample], settings: &Settings, of: &dyn core::fmt::Debug| {
        identify(record, settings).map_err(|error| violation(ANSWERED, std::format!("{of:?}"), &error))
    };
    let one = found(record, settings, &"SI units")?;
    for units in units {
        let gravity_world = settings.gravity_world * (units.length / (units.time * units.time));
        let other = found(&units.record(record), &Settings { gravity_world, ..*settings }, units)?;
        let law = "units do not decide";
        let decided = |found: &Identification| {
            let verdict = core::mem::discriminant(&found.verdict);
            (found.method, found.lag, found.rank, found.samples_used, found.silence, verdict, found.determined())
        };
        let (expected, answer) = (decided(&one), decided(&other));
        require(law, units, &expected, &answer, broken_unless(expected == answer), 0.0)?;
        let law = "units do not matter";
        let both = [one.estimate.or(one.regularised), other.estimate.or(other.regularised)];
        let [Some(here), Some(there)] = both else { continue };
        let map = units.parameters();
        let expected = map * here.parameters.to_vector();
        let deviation = (map * here.covariance * map.transpose()).diagonal().map(f64::sqrt);
        let body = there.parameters.to_vector();
        let apart = (body - expected).component_div(&deviation).amax();
        require(law, units, &Short(&expected), &Short(&body), apart, tolerance)?;
        let said = there.covariance.diagonal().map(f64::sqrt);
        let ratio = said.component_div(&deviation).map(|ratio| (ratio - 1.0).abs()).amax();
        require(law, &(units, "sigmas"), &Short(&deviation), &Short(&said), ratio, tolerance.max(0.01))?;
    }
    Ok(())
}
