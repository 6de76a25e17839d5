//! Errors of sensors that last: wander of a localisation, bias of a gyroscope, filters that rates have gone through, content that is old.

use super::super::MotionNoise;
use super::flight_motion::Held;
use super::wrench_history::WrenchHistory;
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

/// What a rate that has gone through a filter is behind the true one: the change of rate in each of the last pieces of time, times the
/// share that the filter has not shown yet.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RateLag {
    missing: [f64; PIECES],
    pieces: usize,
    piece_ns: i64,
}

impl RateLag {
    /// Of a filter; none where it shows every sample at once.
    ///
    /// # Errors
    /// [`IdentificationError::ImpossibleSensing`] for a filter that answers for longer than 4096 of its steps.
    pub fn try_new(filter: &LinearFilter) -> Result<Option<Self>, IdentificationError> {
        let mut step = Vec::from([1.0; LONGEST_ANSWER]);
        step[0] = 0.0;
        let answer = filter.filtered(&step);
        let missing: Vec<f64> = answer.iter().skip(1).map(|shown| 1.0 - shown).collect();
        let Some(last) = missing.iter().rposition(|missing| missing.abs() > ENDED) else { return Ok(None) };
        if last + 2 > missing.len() {
            let value = filter.step_s() * LONGEST_ANSWER as f64;
            return Err(IdentificationError::ImpossibleSensing { what: "answer of a filter of the rate, s", value });
        }
        let steps = last / PIECES + 1;
        let mut lag = Self { missing: [0.0; PIECES], pieces: last / steps + 1, piece_ns: 0 };
        for (piece, missing) in lag.missing.iter_mut().zip(missing.chunks(steps)) {
            *piece = missing.iter().sum::<f64>() / steps as f64;
        }
        lag.missing[lag.pieces..].fill(0.0);
        #[allow(clippy::cast_possible_truncation)] // saturates
        let piece_ns = ComplexField::round(filter.step_s() * steps as f64 * 1e9) as i64;
        lag.piece_ns = piece_ns.max(1);
        Ok(Some(lag))
    }

    /// Time by which a rate that grows steadily is late, s.
    pub fn delay_s(&self) -> f64 {
        self.missing.iter().sum::<f64>() * self.piece_ns as f64 * 1e-9
    }

    /// A wrench and stored momentum that, held for [`delay_s`](Self::delay_s), change the rate by what is missing at `now_ns`.
    pub(super) fn owed(&self, history: &WrenchHistory, now_ns: i64) -> Held {
        let (mut wrench, mut stored, mut until_ns) = (Vector6::zeros(), Vector3::zeros(), now_ns);
        let whole: f64 = self.missing.iter().sum();
        for missing in self.missing.iter().take(self.pieces) {
            let from_ns = until_ns.saturating_sub(self.piece_ns);
            let held = history.mean(from_ns, until_ns);
            wrench += held.wrench.to_vector() * (missing / whole);
            stored += held.stored * (missing / whole);
            until_ns = from_ns;
        }
        Held { wrench: Wrench::from(wrench), stored }
    }
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
    /// Filter that the rate has gone through.
    pub rate_lag: Option<RateLag>,
    /// Age of poses, of velocities and of rates at their stamps, ns.
    pub age_ns: [i64; 3],
}

/// What a bias of which nothing else is known moves by, rad/s per root of a second.
const BIAS_WALK: f64 = 1e-5;
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
        rate_lag: None,
        age_ns: [0; 3],
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
        let age_ns = [sensing.pose_delay, velocity_delay, sensing.rate.delay]
            .map(|delay| ComplexField::round(delay.expected_s * 1e9) as i64);
        Ok(Self {
            attitude: wander(sensing.attitude.wander, 0),
            position: wander(sensing.position.wander, 1),
            velocity: wander(sensing.velocity.wander, 2),
            rate_bias_rad_s: sensing.rate.bias_sigma,
            rate_bias_walk: BIAS_WALK,
            rate_lag: sensing.rate.filter.as_ref().map(RateLag::try_new).transpose()?.flatten(),
            age_ns,
        })
    }

    /// Wander of attitude, position and velocity.
    pub(super) fn wander(&self) -> [GaussMarkov; 3] {
        [self.attitude, self.position, self.velocity]
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
        let levels = [a.sigma, p.sigma, v.sigma, self.rate_bias_rad_s, self.rate_bias_walk];
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
        let lag = RateLag::try_new(&LinearFilter::try_new(&[0.25; 4], &[1.0], 0.004).unwrap()).unwrap().unwrap();
        assert!((lag.delay_s() - 1.5 * 0.004).abs() < 1e-12);
        assert_eq!((lag.pieces, lag.piece_ns, lag.missing[0]), (3, 4_000_000, 0.75));
        assert_eq!(RateLag::try_new(&LinearFilter::try_new(&[1.0], &[1.0], 0.004).unwrap()).unwrap(), None);
        // A torque that has been there for longer than the answer is owed for the whole delay.
        let mut history = WrenchHistory::new(0);
        let torque = Vector6::new(0.1, 0.0, 0.0, 0.0, 0.0, 0.0).into();
        history.hold(0, 100_000_000, &torque, &Vector3::zeros());
        assert!((lag.owed(&history, 100_000_000).wrench.torque.x - 0.1).abs() < 1e-12);
        // One that began a step ago is owed to three quarters, over one step: as a mean over the delay of 1.5 steps, half of it.
        assert!((lag.owed(&history, 4_000_000).wrench.torque.x - 0.05).abs() < 1e-12);
    }

    #[test]
    fn a_slow_filter_keeps_its_delay() {
        let filter = LinearFilter::try_new(&[0.01], &[1.0, -0.99], 0.01).unwrap();
        let lag = RateLag::try_new(&filter).unwrap().unwrap();
        assert!((lag.delay_s() - 0.99).abs() < 0.02 && lag.pieces <= PIECES, "{}", lag.delay_s());
    }
}
