//! What a log shows, against what was stated of its sensors.

use super::found::Found;
use super::{SensingCheck, StreamName};
use crate::sensing::{Delay, InertialErrors, Level, Sensing, Wander};
use core::fmt;

/// Standard deviations by which a statement must be missed.
const BEYOND: f64 = 4.0;
/// A level is missed where it is off by this factor at least, as a logarithm.
const LEVEL: f64 = 0.4;
/// Ages are no nearer than this, s, and than this share of what a filter delays: a filter is no pure delay.
const AGE_S: f64 = 5e-4;
const OF_FILTER: f64 = 0.05;
/// Gravity is told no better than this, m/s^2, and than this share of it: not all of an attitude's error is what the publisher went by.
const GRAVITY_M_S2: f64 = 0.25;
const OF_GRAVITY: f64 = 0.05;
/// Axes of poses and rates are the same within this, rad.
const SAME_AXES: f64 = 0.05;

/// A statement that the log contradicts.
#[derive(Clone, Debug, PartialEq)]
pub struct Contradiction {
    /// Key of the statement in a sensing file.
    pub key: &'static str,
    /// What is stated, in words, with its unit.
    pub what: &'static str,
    /// As stated.
    pub stated: f64,
    /// One standard deviation, as stated; zero where it is stated as known.
    pub stated_sigma: f64,
    /// What the log shows.
    pub found: Found,
}

impl fmt::Display for Contradiction {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { key, what, stated, stated_sigma, found } = self;
        write!(
            f,
            "`{key}`: {what}: stated {stated:.4} +- {stated_sigma:.4}, the log shows {:.4} +- {:.4}",
            found.value, found.sigma
        )
    }
}

/// Filter and delay of a triad, s, and one standard deviation of them.
fn age(triad: &InertialErrors) -> (f64, f64) {
    let filter = triad.filter.as_ref().map_or(0.0, |f| f.delay_samples() * f.step_s());
    (triad.delay.expected_s + filter, triad.delay.sigma_s.hypot(OF_FILTER * filter))
}

impl SensingCheck {
    /// What the log contradicts by more than four standard deviations; axes of poses and rates that are not the same always.
    pub fn contradictions(&self, stated: Option<&Sensing>) -> Vec<Contradiction> {
        let mut all = Vec::new();
        if let Some(alignment) = &self.alignment {
            let [x, y, z] = alignment.sigma_rad;
            let found = Found { value: alignment.pose_from_rate.angle(), sigma: x.max(y).max(z) };
            if found.value > SAME_AXES + BEYOND * found.sigma {
                let what = "angle between the axes of poses and of rates, rad";
                all.push(Contradiction { key: "axes", what, stated: 0.0, stated_sigma: 0.0, found });
            }
        }
        if let Some(stated) = stated {
            self.ages(stated, &mut all);
            self.levels(stated, &mut all);
            self.triads(stated, &mut all);
        }
        all
    }

    fn ages(&self, stated: &Sensing, all: &mut Vec<Contradiction>) {
        if self.reference != Some(StreamName::Rate) {
            return;
        }
        let (rate, rate_sigma) = age(&stated.rate);
        let of = |delay: &Delay| (delay.expected_s, delay.sigma_s);
        let velocity = stated.velocity_delay.as_ref().unwrap_or(&stated.pose_delay);
        let told = [
            (StreamName::Pose, "pose_delay", "age of the poses less that of the rates, s", of(&stated.pose_delay)),
            (StreamName::Velocity, "velocity_delay", "age of the velocities less that of the rates, s", of(velocity)),
            (
                StreamName::Acceleration,
                "acceleration.delay",
                "age of the accelerations less that of the rates, filters included, s",
                age(&stated.acceleration),
            ),
        ];
        for (stream, key, what, (expected, sigma)) in told {
            let Some(found) = self.stream(stream).and_then(|s| s.offset_s) else { continue };
            let told = (expected - rate, sigma.hypot(rate_sigma));
            missed(key, what, told, (found, AGE_S), all);
        }
    }

    fn levels(&self, stated: &Sensing, all: &mut Vec<Contradiction>) {
        let pose = self.pose.unwrap_or_default();
        let velocity = self.stream(StreamName::Velocity);
        let whites = [
            ("position.white", "white noise of the position, m", stated.position.white, pose.position_white_m),
            ("attitude.white", "white noise of the attitude, rad", stated.attitude.white, pose.attitude_white_rad),
            (
                "velocity.white",
                "white noise of the velocity, m/s",
                stated.velocity.white,
                velocity.and_then(|s| s.white),
            ),
        ];
        for (key, what, level, found) in whites {
            if let (Level::Known(stated), Some(found)) = (level, found) {
                level_missed(key, what, stated, found, all);
            }
        }
        let slow = [
            ("position.wander", "slow error of the position, m", stated.position.wander, pose.position_wander_m),
            ("attitude.wander", "slow error of the attitude, rad", stated.attitude.wander, pose.attitude_wander_rad),
            (
                "velocity.wander",
                "slow error of the velocity, m/s",
                stated.velocity.wander,
                velocity.and_then(|s| s.wander),
            ),
        ];
        for (key, what, wander, found) in slow {
            if let (Wander::Known { sigma, .. }, Some(found)) = (wander, found) {
                level_missed(key, what, sigma, found, all);
            }
        }
    }

    fn triads(&self, stated: &Sensing, all: &mut Vec<Contradiction>) {
        let doubted = stated.acceleration.scale_sigma.max(stated.doubted_scale_sigma);
        let triads = [
            (
                StreamName::Rate,
                ["rate.bias_sigma", "rate.scale_sigma"],
                ["bias of the rate, rad/s", "gain of the rate"],
                (stated.rate.bias_sigma, stated.rate.scale_sigma),
            ),
            (
                StreamName::Acceleration,
                ["acceleration.bias_sigma", "acceleration.scale_sigma"],
                ["bias of the acceleration, m/s^2", "gain of the acceleration"],
                (stated.acceleration.bias_sigma, doubted),
            ),
        ];
        for (stream, keys, whats, (bias_sigma, scale_sigma)) in triads {
            let Some(stream) = self.stream(stream) else { continue };
            for found in stream.bias.iter().flatten().flatten() {
                missed(keys[0], whats[0], (0.0, bias_sigma), (*found, 0.0), all);
            }
            for found in stream.gain.iter().flatten().flatten() {
                missed(keys[1], whats[1], (1.0, scale_sigma), (*found, 0.0), all);
            }
        }
        if let (Some([0.0, 0.0, stated]), Some(found)) = (stated.gravity_added_world_m_s2, self.gravity_added_m_s2) {
            let what = "gravity that the publisher of the accelerations added along the world's z axis, m/s^2";
            let unseen = GRAVITY_M_S2.hypot(OF_GRAVITY * stated);
            missed("gravity_added_world_m_s2", what, (stated, 0.0), (found, unseen), all);
        }
        for (axis, found) in self.lever_arm_m.iter().flatten().enumerate() {
            let told = (stated.lever_arm_body_m[axis], stated.lever_arm_sigma_m);
            missed("lever_arm_body_m", "place of the accelerometer along an axis, m", told, (*found, 0.0), all);
        }
    }
}

/// A number that is not as stated, beside what no method tells apart.
fn missed(
    key: &'static str,
    what: &'static str,
    (stated, stated_sigma): (f64, f64),
    (found, unseen): (Found, f64),
    all: &mut Vec<Contradiction>,
) {
    if (found.value - stated).abs() > BEYOND * stated_sigma.hypot(found.sigma).hypot(unseen) {
        all.push(Contradiction { key, what, stated, stated_sigma, found });
    }
}

fn level_missed(key: &'static str, what: &'static str, stated: f64, found: Found, all: &mut Vec<Contradiction>) {
    let apart = (found.value - stated).abs();
    let factor = (found.value.max(1e-30) / stated.max(1e-30)).ln().abs();
    if apart > BEYOND * found.sigma && factor > LEVEL {
        all.push(Contradiction { key, what, stated, stated_sigma: 0.0, found });
    }
}
