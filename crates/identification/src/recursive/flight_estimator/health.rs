//! Whether the filter's own account of its errors is still true.

use super::flight_motion::ALL_ROWS as ROWS;
use super::settings::FlightEstimatorSettings;
use crate::error::IdentificationError;
use crate::recursive::{ChiSquareGate, Innovation};
use crate::statistics::{chi_square_quantile, normal_quantile};
use nalgebra::ComplexField;

/// The filter's health.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct FlightHealth {
    /// Running mean of the normalised innovation squared per degree of freedom: one where the model holds.
    pub mean_nis: f64,
    /// The running mean above which it is called diverged.
    pub alarm_above: f64,
    /// The running mean left its chi-square band and has not come back well inside: see
    /// [`restart`](super::FlightEstimator::restart).
    pub diverged: bool,
    /// Innovations have been one-sided for long: the body is no longer what it was, see
    /// [`body_changed`](super::FlightEstimator::body_changed).
    pub body_doubtful: bool,
}

/// Levels that innovations are compared with.
#[derive(Clone, Debug)]
pub(super) struct Thresholds {
    gates: [f64; ROWS + 1],
    /// Sum of squares of the normalised mean innovation.
    doubts: [f64; ROWS + 1],
    /// Standard score of the alarm.
    score: f64,
    time_s: f64,
}

/// Noise of sensors that are a fifth noisier than on paper is no divergence.
const TOLERANCE: f64 = 1.5;
/// An alarm ends when the mean is back at this part of the way from one to its level.
const BACK_INSIDE: f64 = 0.5;
/// A doubt stays so long after its cause, s.
const DOUBT_S: f64 = 2.0;
/// A body that was just made uncertain is not doubted for so long, s: until it is known roughly, what is linear about it errs.
const ACQUAINTANCE_S: f64 = 8.0;

impl Thresholds {
    pub(super) fn try_new(settings: &FlightEstimatorSettings) -> Result<Self, IdentificationError> {
        let gate = ChiSquareGate::try_new(settings.gate_probability)?;
        let gates = core::array::from_fn(|freedom| gate.threshold(freedom));
        let alarm = settings.alarm_probability;
        let doubts = core::array::from_fn(|freedom| chi_square_quantile(freedom as f64, alarm));
        // One-sided: the two-sided quantile of twice the distance from one.
        let score = normal_quantile(2.0 * alarm - 1.0);
        Ok(Self { gates, doubts, score, time_s: settings.health_time_s })
    }

    pub(super) fn gate(&self, freedom: usize) -> f64 {
        self.gates.get(freedom).copied().unwrap_or(f64::INFINITY)
    }

    /// Upper end of the band of a mean of `count` squares, by Wilson and Hilferty's cube.
    fn mean_square(&self, count: f64) -> f64 {
        let part = 2.0 / (9.0 * count);
        let root = 1.0 - part + self.score * ComplexField::sqrt(part);
        root * root * root
    }
}

/// Running means of innovations.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) struct Monitor {
    nis: f64,
    freedom: f64,
    weight: f64,
    squares: f64,
    means: [f64; ROWS],
    diverged: bool,
    /// How long the body is still in doubt, s.
    doubt_s: f64,
    /// How long it is above doubt, s.
    new_s: f64,
    alarm: f64,
}

impl Monitor {
    /// Of a body that was just made uncertain.
    pub(super) fn of_new_body() -> Self {
        Self { new_s: ACQUAINTANCE_S, ..Self::default() }
    }

    /// Counts an innovation; one beyond the gate `limit` counts as if it lay there and says nothing of the body.
    pub(super) fn observe<const R: usize>(
        &mut self,
        thresholds: &Thresholds,
        innovation: &Innovation<R>,
        limit: f64,
        dt_s: f64,
    ) {
        let nis = innovation.nis.min(limit);
        let keep = ComplexField::exp(-dt_s.max(0.0) / thresholds.time_s);
        let share = 1.0 - keep;
        self.nis = keep * self.nis + share * nis;
        self.freedom = keep * self.freedom + share * innovation.degrees_of_freedom as f64;
        // Of the weights and of their squares: how many measurements the mean is worth.
        self.weight = keep * self.weight + share;
        self.squares = keep * keep * self.squares + share * share;
        if innovation.nis > limit {
            return;
        }
        let (mut rows, mut lopsided) = (0, 0.0);
        for (i, mean) in self.means.iter_mut().enumerate().take(R) {
            let variance = innovation.covariance[(i, i)];
            if variance.is_finite() {
                let deviation = ComplexField::sqrt(variance);
                *mean = keep * *mean + share * innovation.residual[i] / deviation;
                lopsided += *mean * *mean;
                rows += 1;
            }
        }
        if self.squares <= 0.0 || self.freedom <= 0.0 {
            return;
        }
        let count = self.weight * self.weight / self.squares;
        self.alarm = TOLERANCE * thresholds.mean_square(count * self.freedom / self.weight);
        let mean = self.nis / self.freedom;
        let level = if self.diverged { 1.0 + BACK_INSIDE * (self.alarm - 1.0) } else { self.alarm };
        self.diverged = mean > level;
        self.new_s -= dt_s;
        if self.new_s > 0.0 {
            return;
        }
        let doubt = lopsided / self.squares;
        let limit = TOLERANCE * thresholds.doubts.get(rows).copied().unwrap_or(f64::INFINITY);
        let limit = if self.doubt_s > 0.0 { BACK_INSIDE * limit } else { limit };
        self.doubt_s = if doubt > limit { DOUBT_S } else { (self.doubt_s - dt_s).max(0.0) };
    }

    /// Of a motion that begins anew.
    pub(super) fn doubting(is_the_body: bool) -> Self {
        Self { doubt_s: if is_the_body { DOUBT_S } else { 0.0 }, ..Self::default() }
    }

    pub(super) fn health(&self) -> FlightHealth {
        let mean_nis = if self.freedom > 0.0 { self.nis / self.freedom } else { 1.0 };
        FlightHealth { mean_nis, alarm_above: self.alarm, diverged: self.diverged, body_doubtful: self.doubt_s > 0.0 }
    }
}
