//! How much a torque moves a body that is damped late.

use super::InertiaInterval;

/// When commands are made, and when they act.
///
/// A command is computed from what is measured at the beginning of each step and held for it; it passes a pure delay and then a lag of first
/// order.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct AttitudeTiming {
    /// Time between commands, s.
    pub step_s: f64,
    /// Pure delay, s.
    pub delay_s: f64,
    /// Time constant of the actuator, s.
    pub lag_s: f64,
}

impl AttitudeTiming {
    /// No sampling, no delay, no lag.
    pub const CONTINUOUS: Self = Self { step_s: 0.0, delay_s: 0.0, lag_s: 0.0 };

    /// Oldest information that acts, on average of the lag, s.
    pub(super) fn age_s(&self) -> f64 {
        self.step_s + self.delay_s + self.lag_s
    }
}

/// The answer of `J s' = w - damping late(s)` to a bounded torque `w`, for every inertia of an interval.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct PeakGain {
    /// `|s| <= gain |w| / damping` at the instants of measurement, from rest or from `|s| <= start |w| / damping`.
    pub gain: f64,
    /// See there.
    pub start: f64,
}

/// Half the relative distance of the inertias looked at.
const HALF_CELL: f64 = 2.5e-3;
/// What may be left of a response where it is cut off; counted.
const TAIL: f64 = 1e-3;
/// Largest ratio of the moments of inertia.
const LARGEST_RATIO: f64 = 1e4;
/// Longest delay in steps.
const LONGEST_DELAY: f64 = 256.0;
/// Steps after which a response that has not died out counts as unstable.
const STEPS: usize = 20_000;

impl PeakGain {
    /// Of a timing; `None` where the loop is not stable for all these inertias.
    pub fn of(damping: f64, inertia: &InertiaInterval, timing: &AttitudeTiming) -> Option<Self> {
        let (least, largest) = (inertia.least_kg_m2(), inertia.largest_kg_m2());
        let ratio = largest / least;
        if !(ratio <= LARGEST_RATIO) {
            return None;
        }
        let log = nalgebra::ComplexField::ln(ratio);
        if timing.age_s() == 0.0 {
            return Some(Self { gain: 1.0 + log / core::f64::consts::E, start: 1.0 });
        }
        Envelope::try_new(damping / largest, log, timing)?.peak_gain()
    }
}

/// The responses of bodies all over an interval to a unit start, step by step.
struct Envelope {
    step_s: f64,
    /// `step * max of rate |response|` at each step.
    weighted: Vec<f64>,
    /// `max |response|` at each step.
    plain: Vec<f64>,
    /// What is left at the end, as a share of the beginning.
    tail: f64,
}

impl Envelope {
    fn try_new(least_rate: f64, log_ratio: f64, timing: &AttitudeTiming) -> Option<Self> {
        let AttitudeTiming { step_s, delay_s, lag_s } = *timing;
        let delay_steps = delay_s / step_s;
        if !(delay_steps <= LONGEST_DELAY) {
            return None;
        }
        let whole = f64::floor(delay_steps) as usize;
        let late_s = (delay_s - whole as f64 * step_s).clamp(0.0, step_s);
        let cells = f64::ceil(log_ratio / (2.0 * HALF_CELL * (1.0 - HALF_CELL))).max(1.0);
        let count = cells as usize;
        let rate = |cell: usize| least_rate * nalgebra::ComplexField::exp(log_ratio * (cell as f64 + 0.5) / cells);
        let rates: Vec<f64> = (0..count).map(rate).collect();
        let (mut response, mut acting) = (vec![1.0; count], vec![0.0; count]);
        // commands of the present and the steps before it, newest first
        let mut commands = vec![vec![0.0; count]; whole + 2];
        let (mut weighted, mut plain): (Vec<f64>, Vec<f64>) = (Vec::new(), Vec::new());
        let parts = [(whole + 1, late_s), (whole, step_s - late_s)].map(|(age, time_s)| {
            let kept = if lag_s > 0.0 { nalgebra::ComplexField::exp(-time_s / lag_s) } else { 0.0 };
            (age, time_s, kept)
        });
        for step in 0..STEPS {
            let largest =
                |values: &[f64]| rates.iter().zip(values).map(|(rate, value)| rate * value.abs()).fold(0.0, f64::max);
            let now = largest(&response);
            let pending: f64 = weighted.iter().rev().take(whole + 1).sum();
            let left = now / least_rate + lag_s * largest(&acting) + pending;
            if left <= TAIL && step > 0 {
                return Some(Self { step_s, weighted, plain, tail: left });
            }
            if !(now < 1e6 * least_rate) && step > whole + 1 {
                return None;
            }
            weighted.push(step_s * now);
            plain.push(response.iter().fold(0.0, |largest: f64, value| largest.max(value.abs())));
            commands.rotate_right(1);
            if let Some(newest) = commands.first_mut() {
                newest.copy_from_slice(&response);
            }
            for (age, time_s, kept) in parts {
                let Some(command) = commands.get(age) else { continue };
                for (((response, acting), rate), command) in
                    response.iter_mut().zip(&mut acting).zip(&rates).zip(command)
                {
                    *response -= rate * (command * time_s + (*acting - command) * lag_s * (1.0 - kept));
                    *acting = command + (*acting - command) * kept;
                }
            }
        }
        None
    }

    fn peak_gain(&self) -> Option<PeakGain> {
        let head: f64 = self.weighted.iter().sum();
        let whole = head / (1.0 - self.tail);
        let between = HALF_CELL * whole;
        if !(between < 1.0) || !self.step_s.is_finite() {
            return None;
        }
        let largest = self.plain.iter().fold(0.0, |largest: f64, value| largest.max(*value)) / (1.0 - between);
        // what the start can still be felt between the inertias looked at and after the end
        let floor = between * largest + self.tail * largest;
        let gain = (1.0 + HALF_CELL) * whole / (1.0 - between) + floor;
        let (mut start, mut before) = (1.0_f64, 0.0);
        for (weighted, plain) in self.weighted.iter().zip(&self.plain) {
            let room = (1.0 + HALF_CELL) * (whole - before) + floor;
            start = start.min(room / (plain + between * largest));
            before += weighted;
        }
        Some(PeakGain { gain, start })
    }
}
