//! Errors of sensors that last: wander of a localisation, biases, filters that rates and accelerations have gone through,
//! content that is old.

use super::super::MotionNoise;
use super::axis_errors::AxisErrors;
use super::wrench_history::{Held, WrenchHistory};
use crate::error::IdentificationError;
use crate::lie::Wrench;
use crate::sensing::{LinearFilter, Sensing};
use nalgebra::{ComplexField, Vector3, Vector6};
use std::vec::Vec;

/// A slow error of first order (Gauss-Markov).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct GaussMarkov {
    /// Stationary standard deviation of each axis; zero where there is none.
    pub sigma: f64,
    /// Correlation time, s.
    pub time_s: f64,
}

impl GaussMarkov {
    /// None.
    pub const NONE: Self = Self { sigma: 0.0, time_s: 1.0 };

    /// What is left of it after a step, and the variance of what has come to it.
    pub(super) fn step(&self, step_s: f64) -> (f64, f64) {
        let decay = ComplexField::exp(-step_s / self.time_s);
        (decay, self.sigma * self.sigma * (1.0 - decay * decay))
    }
}

/// Longest answer of a filter that is kept, in pieces of equal length.
const PIECES: usize = 64;
/// An answer ends where less than this is missing.
const ENDED: f64 = 1e-4;
/// Steps of a filter that are looked at.
const LONGEST_ANSWER: usize = 4096;

/// How much of the wrench of each of the last pieces of time a filtered sensor shows.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FilterMemory {
    weights: [f64; PIECES],
    pieces: usize,
    piece_ns: i64,
    /// How much later than the sample the first piece ends, ns.
    ahead_ns: i64,
    /// Samples closer than this say the same twice, ns: of what a filter lets through nothing is lost between them.
    rest_ns: i64,
}

impl FilterMemory {
    /// Of an acceleration that has gone through a filter: what it has shown of each piece, in sum one.
    ///
    /// # Errors
    /// [`IdentificationError::ImpossibleSensing`] for a filter that answers for longer than 4096 of its steps.
    pub fn of_acceleration(filter: &LinearFilter) -> Result<Self, IdentificationError> {
        let missing = missing(filter)?;
        let shown: Vec<f64> = core::iter::once(1.0)
            .chain(missing.iter().copied())
            .zip(missing.iter().copied().chain([0.0]))
            .map(|(before, after)| before - after)
            .collect();
        let mut memory = Self::of(&shown, filter);
        // A sample stands for the time about it.
        memory.ahead_ns = memory.piece_ns / 2;
        Ok(memory)
    }

    /// Of a rate that has gone through a filter: what it has not shown yet of the change in each piece, in sum its delay in pieces. None
    /// where it shows every sample at once.
    ///
    /// # Errors
    /// As [`of_acceleration`](Self::of_acceleration).
    pub fn of_rate(filter: &LinearFilter) -> Result<Option<Self>, IdentificationError> {
        let missing = missing(filter)?;
        Ok((!missing.is_empty()).then(|| Self::of(&missing, filter)))
    }

    fn of(weights: &[f64], filter: &LinearFilter) -> Self {
        let steps = weights.len().div_ceil(PIECES).max(1);
        let pieces = weights.len().div_ceil(steps);
        let mut memory = Self { weights: [0.0; PIECES], pieces, piece_ns: 0, ahead_ns: 0, rest_ns: 0 };
        for (piece, weights) in memory.weights.iter_mut().zip(weights.chunks(steps)) {
            *piece = weights.iter().sum::<f64>();
        }
        #[allow(clippy::cast_possible_truncation)] // saturates
        let whole_ns = |time_s: f64| ComplexField::round(time_s * 1e9) as i64;
        let step_ns = whole_ns(filter.step_s());
        memory.rest_ns = whole_ns(0.5 * filter.delay_samples().max(0.0) * filter.step_s());
        memory.piece_ns = step_ns.saturating_mul(i64::try_from(steps).unwrap_or(1)).max(1);
        let in_pieces = steps as f64;
        if steps > 1 {
            // A weight belongs to a step; over a piece it is their sum of as many steps.
            for piece in &mut memory.weights {
                *piece /= in_pieces;
            }
        }
        memory
    }

    /// Sum of the weights times the length of a piece, s: of a rate the time by which it is late where it grows steadily.
    pub fn length_s(&self) -> f64 {
        self.weights.iter().sum::<f64>() * self.piece_ns as f64 * 1e-9
    }

    /// Whether a sample says something that one before did not.
    pub(super) fn is_rested(&self, before_ns: i64, now_ns: i64) -> bool {
        now_ns.saturating_sub(before_ns) >= self.rest_ns
    }

    /// The mean of what was believed to act, by these weights, at a sample of `now_ns`.
    pub(super) fn held(&self, history: &WrenchHistory, now_ns: i64) -> Held {
        let (mut wrench, mut stored) = (Vector6::zeros(), Vector3::zeros());
        let mut until_ns = now_ns.saturating_add(self.ahead_ns);
        let whole: f64 = self.weights.iter().sum();
        for weight in self.weights.iter().take(self.pieces) {
            let from_ns = until_ns.saturating_sub(self.piece_ns);
            let held = history.mean(from_ns, until_ns);
            wrench += held.wrench.to_vector() * (weight / whole);
            stored += held.stored * (weight / whole);
            until_ns = from_ns;
        }
        Held { wrench: Wrench::from(wrench), stored }
    }
}

/// What the answer to a step still misses after each sample; empty where nothing is.
fn missing(filter: &LinearFilter) -> Result<Vec<f64>, IdentificationError> {
    let mut step = vec![1.0; LONGEST_ANSWER];
    step[0] = 0.0;
    let mut missing: Vec<f64> = filter.filtered(&step).iter().skip(1).map(|shown| 1.0 - shown).collect();
    let ended = missing.iter().rposition(|missing| missing.abs() > ENDED).map_or(0, |last| last + 1);
    if ended == missing.len() {
        let value = filter.step_s() * LONGEST_ANSWER as f64;
        return Err(IdentificationError::ImpossibleSensing { what: "answer of a filter, s", value });
    }
    missing.truncate(ended);
    Ok(missing)
}

/// Errors of sensors that last; white noise of each sample is told with each measurement.
///
/// # Source
/// `measured = true exp(wander) exp(noise)` for an attitude, sums for position and velocity, in inertial axes, and for rates, in body axes.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SlowErrors {
    /// Of the attitude, rad, body axes.
    pub attitude: GaussMarkov,
    /// Of the position, m, inertial axes.
    pub position: GaussMarkov,
    /// Of the velocity, m/s, inertial axes.
    pub velocity: GaussMarkov,
    /// Bias of the rate at the start, each axis, rad/s.
    pub rate_bias_rad_s: f64,
    /// What the bias moves by, rad/s per root of a second.
    pub rate_bias_walk: f64,
    /// Errors of the gyroscope's axes, which make the inertia less certain.
    pub rate_axes: AxisErrors,
    /// Filter that the rate has gone through.
    pub rate_memory: Option<FilterMemory>,
    /// Bias of the acceleration at the start, each axis, m/s^2.
    pub acceleration_bias_m_s2: f64,
    /// What that bias moves by, m/s^2 per root of a second.
    pub acceleration_bias_walk: f64,
    /// Error of scale of each axis of a sane accelerometer.
    pub acceleration_scale: f64,
    /// The same of one that need not be sane, see [`Sensing::doubted_scale_sigma`].
    pub doubted_scale: f64,
    /// Filter that the acceleration has gone through.
    pub acceleration_memory: Option<FilterMemory>,
    /// Where the accelerometer sits, from the body origin, m.
    pub lever_arm_body_m: Vector3<f64>,
    /// What the publisher adds for gravity by the attitude that it measured, inertial axes, m/s^2, in flights that hang from nothing; on a
    /// table what it bears.
    pub gravity_added_world_m_s2: Vector3<f64>,
    /// Age of poses, velocities, rates and accelerations at their stamps, ns.
    pub age_ns: [i64; 4],
}

/// What biases of which nothing else is known move by, rad/s and m/s^2 per root of a second.
const BIAS_WALK: [f64; 2] = [1e-5, 3e-5];
/// Wander of a localisation whose level nobody states: attitude rad, position m, velocity m/s, and its time, s.
const USUAL_WANDER: [f64; 3] = [0.01, 0.02, 2e-3];
const USUAL_TIME_S: f64 = 10.0;

impl SlowErrors {
    /// None: what is measured is the truth and white noise.
    pub const NONE: Self = Self {
        attitude: GaussMarkov::NONE,
        position: GaussMarkov::NONE,
        velocity: GaussMarkov::NONE,
        rate_bias_rad_s: 0.0,
        rate_bias_walk: 0.0,
        rate_axes: AxisErrors::NONE,
        rate_memory: None,
        acceleration_bias_m_s2: 0.0,
        acceleration_bias_walk: 0.0,
        acceleration_scale: 0.0,
        doubted_scale: 0.0,
        acceleration_memory: None,
        lever_arm_body_m: Vector3::new(0.0, 0.0, 0.0),
        gravity_added_world_m_s2: Vector3::new(0.0, 0.0, 0.0),
        age_ns: [0; 4],
    };

    /// Of described sensors; wander that is not stated is taken for a usual one.
    ///
    /// # Errors
    /// [`IdentificationError::ImpossibleSensing`].
    pub fn of(sensing: &Sensing) -> Result<Self, IdentificationError> {
        sensing.check()?;
        let wander = |stated: crate::sensing::Wander, k: usize| {
            let (sigma, time_s) = stated.or(USUAL_WANDER[k], USUAL_TIME_S);
            GaussMarkov { sigma, time_s }
        };
        let velocity_delay = sensing.velocity_delay.unwrap_or(sensing.pose_delay);
        #[allow(clippy::cast_possible_truncation)] // at most 10 s
        let age_ns = [sensing.pose_delay, velocity_delay, sensing.rate.delay, sensing.acceleration.delay]
            .map(|delay| ComplexField::round(delay.expected_s * 1e9) as i64);
        Ok(Self {
            attitude: wander(sensing.attitude.wander, 0),
            position: wander(sensing.position.wander, 1),
            velocity: wander(sensing.velocity.wander, 2),
            rate_bias_rad_s: sensing.rate.bias_sigma,
            rate_bias_walk: BIAS_WALK[0],
            rate_axes: AxisErrors { scale: sensing.rate.scale_sigma, misalignment: sensing.rate.misalignment_sigma },
            rate_memory: sensing.rate.filter.as_ref().map(FilterMemory::of_rate).transpose()?.flatten(),
            acceleration_bias_m_s2: sensing.acceleration.bias_sigma,
            acceleration_bias_walk: BIAS_WALK[1],
            acceleration_scale: sensing.acceleration.scale_sigma,
            doubted_scale: sensing.doubted_scale_sigma.max(sensing.acceleration.scale_sigma),
            acceleration_memory: sensing.acceleration.filter.as_ref().map(FilterMemory::of_acceleration).transpose()?,
            lever_arm_body_m: sensing.lever_arm_body_m.into(),
            gravity_added_world_m_s2: sensing.gravity_added_world_m_s2.unwrap_or_default().into(),
            age_ns,
        })
    }

    /// Wander of attitude, position and velocity.
    pub(super) fn wander(&self) -> [GaussMarkov; 3] {
        [self.attitude, self.position, self.velocity]
    }

    /// Whether the localisation is off by anything that lasts.
    pub(super) fn wanders(&self) -> bool {
        self.wander().iter().any(|error| error.sigma > 0.0)
    }

    /// The levels of white noise that such sensors state, and these where they state none.
    pub fn noise(sensing: &Sensing, otherwise: MotionNoise) -> MotionNoise {
        MotionNoise {
            attitude_rad: sensing.attitude.white.or(otherwise.attitude_rad),
            position_m: sensing.position.white.or(otherwise.position_m),
            velocity_m_s: sensing.velocity.white.or(otherwise.velocity_m_s),
            rate_rad_s: sensing.rate.white.or(otherwise.rate_rad_s),
            acceleration_m_s2: sensing.acceleration.white.or(otherwise.acceleration_m_s2),
            ..otherwise
        }
    }

    pub(super) fn check(&self) -> Result<(), IdentificationError> {
        let [a, p, v] = self.wander();
        for (index, time_s) in [a.time_s, p.time_s, v.time_s].into_iter().enumerate() {
            if !(time_s > 0.0 && time_s.is_finite()) {
                return Err(IdentificationError::NotPositive { index, value: time_s });
            }
        }
        let levels = [
            a.sigma,
            p.sigma,
            v.sigma,
            self.rate_bias_rad_s,
            self.rate_bias_walk,
            self.rate_axes.scale,
            self.rate_axes.misalignment,
            self.acceleration_bias_m_s2,
            self.acceleration_bias_walk,
            self.acceleration_scale,
            self.doubted_scale,
        ];
        match levels.iter().position(|level| !(*level >= 0.0 && level.is_finite())) {
            Some(index) => Err(IdentificationError::NotPositive { index: 3 + index, value: levels[index] }),
            None => Ok(()),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_mean_of_four_is_one_and_a_half_steps_late() {
        let (mean, none) = ([0.25; 4], [1.0]);
        let filter = |numerator: &[f64]| LinearFilter::try_new(numerator, &[1.0], 0.004).unwrap();
        let rate = FilterMemory::of_rate(&filter(&mean)).unwrap().unwrap();
        assert!((rate.length_s() - 1.5 * 0.004).abs() < 1e-12);
        assert_eq!((rate.pieces, rate.piece_ns, rate.weights[0]), (3, 4_000_000, 0.75));
        assert_eq!(FilterMemory::of_rate(&filter(&none)).unwrap(), None);
        // A torque that has been there for longer than the answer is owed for the whole delay.
        let mut history = WrenchHistory::new(0);
        let torque = Vector6::new(0.1, 0.0, 0.0, 0.0, 0.0, 0.0).into();
        history.hold(0, 100_000_000, &torque, &Vector3::zeros());
        assert!((rate.held(&history, 100_000_000).wrench.torque.x - 0.1).abs() < 1e-12);
        // One that began a step ago is owed to three quarters, over one step: as a mean over the delay of 1.5 steps, half of it.
        assert!((rate.held(&history, 4_000_000).wrench.torque.x - 0.05).abs() < 1e-12);
        // An acceleration shows a quarter of each of the last four samples, of the newest but half of it so far.
        let acceleration = FilterMemory::of_acceleration(&filter(&mean)).unwrap();
        assert_eq!((acceleration.pieces, acceleration.weights[..4].to_vec()), (4, mean.to_vec()));
        assert!((acceleration.held(&history, 4_000_000).wrench.torque.x - 0.1 * 0.375).abs() < 1e-12);
        let at_once = FilterMemory::of_acceleration(&filter(&none)).unwrap();
        assert!((at_once.held(&history, 50_000_000).wrench.torque.x - 0.1).abs() < 1e-12);
    }

    #[test]
    fn a_slow_filter_keeps_its_delay() {
        let filter = LinearFilter::try_new(&[0.01], &[1.0, -0.99], 0.01).unwrap();
        let rate = FilterMemory::of_rate(&filter).unwrap().unwrap();
        assert!((rate.length_s() - 0.99).abs() < 0.02 && rate.pieces <= PIECES, "{}", rate.length_s());
        let acceleration = FilterMemory::of_acceleration(&filter).unwrap();
        let sum = acceleration.weights.iter().sum::<f64>() * acceleration.piece_ns as f64 / 1e7;
        assert!((sum - 1.0).abs() < 1e-3 && acceleration.pieces <= PIECES, "{sum}");
    }
}
