//! Whether the filter's own account of its errors is still true.

use super::erring_thrusters::Suspect;
use super::flight_motion::ALL_ROWS as ROWS;
use super::settings::FlightEstimatorSettings;
use crate::error::IdentificationError;
use crate::recursive::belief::Rows;
use crate::recursive::{ChiSquareGate, Innovation};
use crate::statistics::{chi_square_quantile, normal_quantile};
use nalgebra::ComplexField;

/// Last time at which all is filtered again, s: what is known by then is linear enough.
pub(super) const LAST_S: f64 = 40.0;

/// The filter's health.
#[allow(clippy::struct_excessive_bools)] // each of them may be so by itself
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct FlightHealth {
    /// Running mean of the normalised innovation squared per degree of freedom: one where the model holds.
    pub mean_nis: f64,
    /// The running mean above which it is called diverged.
    pub alarm_above: f64,
    /// The running mean left its chi-square band and has not come back well inside, or the body has come to more than a hundred times the mass or
    /// ten times an extent of the one that the filter was begun with, or less than a hundredth of its mass: see
    /// [`restart`](super::FlightEstimator::restart).
    pub diverged: bool,
    /// Innovations have been one-sided for long, or all that is learned of the body pulls it to one side: it is no longer what it was, see
    /// [`body_changed`](super::FlightEstimator::body_changed).
    pub body_doubtful: bool,
    /// The body is just being learned again, or is far from the one that all is linear about and waits for that: until that has come to its end, what is
    /// known of it may be surer than it should be.
    pub relearning: bool,
    /// What was seen since the body was doubted is explained by thrust better than by another body: see
    /// [`wrench_doubtful`](super::FlightEstimator::wrench_doubtful).
    pub thrust_doubtful: bool,
    /// What was seen since the body was doubted is explained by no one thruster or supply nearly as well as by another body.
    pub thrust_acquitted: bool,
    /// What failed, where it is one thruster or supply alone.
    pub suspect: Option<Suspect>,
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
/// So long after it was made uncertain, s, a body that does not fit was not learned, and is no other one.
const LEARNING_S: f64 = 30.0;

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

    /// Whether so many squares, of so many degrees of freedom, are within their gate.
    pub(super) fn lets_pass(&self, (nis, freedom): (f64, usize)) -> bool {
        nis <= self.gate(freedom)
    }

    /// Upper end of the band of a mean of `count` squares, by Wilson and Hilferty's cube.
    fn mean_square(&self, count: f64) -> f64 {
        let part = 2.0 / (9.0 * count);
        let root = 1.0 - part + self.score * ComplexField::sqrt(part);
        root * root * root
    }
}

/// Rows of what inertial sensors measure, rate and acceleration. They tell of the body whatever a localisation does.
fn is_inertial(row: usize) -> bool {
    matches!(row, 6..9 | 12..15)
}

/// Innovations of a measurement: squares and degrees of freedom of the inertial rows, and of all others.
///
/// Where the localisation is not known to wander its rows tell of the motion as well as those of inertial sensors: all are of the others.
#[derive(Clone, Copy, Debug)]
pub(super) struct Groups {
    pub(super) inertial: (f64, usize),
    pub(super) localised: (f64, usize),
}

impl Groups {
    pub(super) fn of<const R: usize>(innovation: &Innovation<R>, wanders: bool) -> Self {
        if !wanders {
            return Self { inertial: (0.0, 0), localised: (innovation.nis, innovation.degrees_of_freedom) };
        }
        Self { inertial: squares(innovation, is_inertial), localised: squares(innovation, |row| !is_inertial(row)) }
    }

    /// Leaves the inertial rows of these, or the others.
    pub(super) fn leave<const N: usize, const R: usize>(rows: &mut Rows<N, R>, inertial: bool) {
        for row in (0..R).filter(|row| is_inertial(*row) != inertial) {
            rows.standard_deviation[row] = f64::INFINITY;
        }
    }
}

/// Normalised square of some rows of an innovation, and how many they are.
fn squares<const R: usize>(innovation: &Innovation<R>, is_one: impl Fn(usize) -> bool) -> (f64, usize) {
    let mut root = [[0.0; R]; R];
    let (mut white, mut rows, mut count, mut square) = ([0.0; R], [0; R], 0, 0.0);
    for row in (0..R).filter(|row| is_one(*row) && innovation.covariance[(*row, *row)].is_finite()) {
        // One row of the Cholesky factor after the other.
        let (mut pivot, mut value) = (innovation.covariance[(row, row)], innovation.residual[row]);
        for k in 0..count {
            let inner: f64 = (0..k).map(|i| root[count][i] * root[k][i]).sum();
            root[count][k] = (innovation.covariance[(row, rows[k])] - inner) / root[k][k];
            pivot -= root[count][k] * root[count][k];
            value -= root[count][k] * white[k];
        }
        root[count][count] = ComplexField::sqrt(pivot);
        white[count] = value / root[count][count];
        square += white[count] * white[count];
        rows[count] = row;
        count += 1;
    }
    (square, count)
}

/// A running mean of squares.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
struct MeanSquare {
    nis: f64,
    freedom: f64,
    /// Of the weights and of their squares: how many measurements the mean is worth.
    weight: f64,
    squares: f64,
}

impl MeanSquare {
    fn observe(&mut self, keep: f64, nis: f64, freedom: usize) {
        let share = 1.0 - keep;
        self.nis = keep * self.nis + share * nis;
        self.freedom = keep * self.freedom + share * freedom as f64;
        self.weight = keep * self.weight + share;
        self.squares = keep * keep * self.squares + share * share;
    }

    /// Per degree of freedom, and the level above which it is an alarm.
    fn mean_and_alarm(&self, thresholds: &Thresholds) -> Option<(f64, f64)> {
        (self.squares > 0.0 && self.freedom > 0.0).then(|| {
            let count = self.weight * self.weight / self.squares;
            let alarm = TOLERANCE * thresholds.mean_square(count * self.freedom / self.weight);
            (self.nis / self.freedom, alarm)
        })
    }
}

/// Running means of innovations.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) struct Monitor {
    all: MeanSquare,
    inertial: MeanSquare,
    means: [f64; ROWS],
    diverged: bool,
    /// How long the body is still in doubt, s.
    doubt_s: f64,
    /// For how long it is not doubted, s.
    unacquainted_s: f64,
    /// For how long one that does not fit was not learned, s.
    learning_s: f64,
    /// For how long what was learned of another body may be learned again, s.
    lessons_s: f64,
    alarm: f64,
}

impl Monitor {
    /// Of a body at the start of a flight that is known roughly at best: there is none that it could have been before.
    pub(super) fn of_first_body() -> Self {
        Self { unacquainted_s: ACQUAINTANCE_S, learning_s: ACQUAINTANCE_S, ..Self::default() }
    }

    /// Of a body that was just made uncertain.
    pub(super) fn of_new_body() -> Self {
        Self { unacquainted_s: ACQUAINTANCE_S, learning_s: LEARNING_S, lessons_s: LAST_S, ..Self::default() }
    }

    /// Of a body that is learned anew from what it is usually taken for.
    pub(super) fn of_learning() -> Self {
        Self { learning_s: LEARNING_S - ACQUAINTANCE_S, lessons_s: LAST_S, ..Self::default() }
    }

    /// Counts an innovation; one beyond its gate counts as if it lay there and says no more of the body.
    ///
    /// Where inertial sensors are heard the body is accused by their rows alone, by a mean that is one-sided or by squares that are too
    /// large, and a filter whose inertial rows do not fit is one of another body and not one that has lost its way. One that was to learn
    /// another body, has had the time to, and does not fit again has.
    pub(super) fn observe<const R: usize>(
        &mut self,
        thresholds: &Thresholds,
        innovation: &Innovation<R>,
        groups: &Groups,
        dt_s: f64,
    ) {
        let keep = ComplexField::exp(-dt_s.max(0.0) / thresholds.time_s);
        let share = 1.0 - keep;
        let limit = thresholds.gate(innovation.degrees_of_freedom);
        self.all.observe(keep, innovation.nis.min(limit), innovation.degrees_of_freedom);
        let (nis, freedom) = groups.inertial;
        let gated = nis > thresholds.gate(freedom);
        let judge_inertial = freedom > 0;
        if judge_inertial {
            self.inertial.observe(keep, nis.min(thresholds.gate(freedom)), freedom);
        }
        if !judge_inertial && innovation.nis > limit {
            return;
        }
        let accuses = |row: usize| if judge_inertial { is_inertial(row) } else { self.inertial.weight == 0.0 };
        let (mut rows, mut lopsided) = (0, 0.0);
        if !gated {
            for (i, mean) in self.means.iter_mut().enumerate().take(R).filter(|(i, _)| accuses(*i)) {
                let variance = innovation.covariance[(i, i)];
                if variance.is_finite() {
                    let deviation = ComplexField::sqrt(variance);
                    *mean = keep * *mean + share * innovation.residual[i] / deviation;
                    lopsided += *mean * *mean;
                    rows += 1;
                }
            }
        }
        let Some((mean, alarm)) = self.all.mean_and_alarm(thresholds) else { return };
        let inertial = self.inertial.mean_and_alarm(thresholds).is_some_and(|(mean, alarm)| mean > alarm);
        let is_another = inertial && self.learning_s <= 0.0;
        self.alarm = alarm;
        let level = if self.diverged { 1.0 + BACK_INSIDE * (alarm - 1.0) } else { alarm };
        let is_unacquainted = self.unacquainted_s > 0.0;
        self.diverged = mean > level && !is_another && !(inertial && is_unacquainted);
        self.learning_s -= dt_s;
        self.lessons_s -= dt_s;
        self.unacquainted_s -= dt_s;
        if is_unacquainted {
            return;
        }
        let base = if judge_inertial { self.inertial.squares } else { self.all.squares };
        let limit = TOLERANCE * thresholds.doubts.get(rows).copied().unwrap_or(f64::INFINITY);
        let limit = if self.doubt_s > 0.0 { BACK_INSIDE * limit } else { limit };
        let is_doubted = is_another || rows > 0 && lopsided > limit * base;
        self.doubt_s = if is_doubted { DOUBT_S } else { (self.doubt_s - dt_s).max(0.0) };
    }

    /// Whether the body has been known for long enough to be judged by what it is corrected to: another one than that of the start once nothing of
    /// it is left to be learned again.
    pub(super) fn has_learned_the_body(&self) -> bool {
        self.unacquainted_s <= 0.0 && self.lessons_s <= 0.0
    }

    /// What is believed cannot be.
    pub(super) fn diverge(&mut self) {
        self.diverged = true;
    }

    /// The body is another one than was learned.
    pub(super) fn accuse_the_body(&mut self) {
        self.doubt_s = DOUBT_S;
    }

    /// Of a motion that begins anew.
    pub(super) fn doubting(self, is_the_body: bool) -> Self {
        Self { doubt_s: if is_the_body { DOUBT_S } else { 0.0 }, lessons_s: self.lessons_s, ..Self::default() }
    }

    pub(super) fn health(&self) -> FlightHealth {
        let MeanSquare { nis, freedom, .. } = self.all;
        let mean_nis = if freedom > 0.0 { nis / freedom } else { 1.0 };
        FlightHealth {
            mean_nis,
            alarm_above: self.alarm,
            diverged: self.diverged,
            body_doubtful: self.doubt_s > 0.0,
            relearning: false,
            thrust_doubtful: false,
            thrust_acquitted: false,
            suspect: None,
        }
    }
}
