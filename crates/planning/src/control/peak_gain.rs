//! How much a torque moves a body that is damped late.

use super::InertiaInterval;
use num_traits::AsPrimitive;

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
const LARGEST_RATIO: f64 = 1e3;
/// Largest step in times that the lightest body takes to answer; beyond two it rings away even without delay.
const LARGEST_STEP: f64 = 10.0;
/// A response so much larger than its start is not going to die out.
const GONE: f64 = 1e6;
/// Longest delay in steps.
const LONGEST_DELAY: f64 = 256.0;
/// Steps after which a response that has not died out counts as unstable.
const STEPS: usize = 20_000;

impl PeakGain {
    /// Of a timing; `None` where the loop is not stable for all these inertias.
    pub fn of(damping: f64, inertia: &InertiaInterval, timing: &AttitudeTiming) -> Option<Self> {
        let (least, largest) = (inertia.least_kg_m2(), inertia.largest_kg_m2());
        let ratio = largest / least;
        if ratio > LARGEST_RATIO || damping * timing.step_s > LARGEST_STEP * least {
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
        if delay_steps > LONGEST_DELAY {
            return None;
        }
        let whole: usize = f64::floor(delay_steps).as_();
        let late_s = (delay_s - whole as f64 * step_s).clamp(0.0, step_s);
        let cells = f64::ceil(log_ratio / (2.0 * HALF_CELL * (1.0 - HALF_CELL))).max(1.0);
        let count: usize = cells.as_();
        let rate = |cell: usize| least_rate * nalgebra::ComplexField::exp(log_ratio * (cell as f64 + 0.5) / cells);
        let rates: Vec<f64> = (0..count).map(rate).collect();
        let largest_rate = rates.iter().copied().fold(0.0, f64::max);
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
                return Some(Self { weighted, plain, tail: left });
            }
            if now > GONE * largest_rate {
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
        if between >= 1.0 {
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

#[cfg(test)]
#[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "counts of steps")]
mod tests {
    use super::*;

    fn of(damping: f64, least: f64, largest: f64, timing: AttitudeTiming) -> Option<PeakGain> {
        PeakGain::of(damping, &InertiaInterval::between(least, largest).unwrap(), &timing)
    }

    const SAMPLED: AttitudeTiming = AttitudeTiming { step_s: 0.016, delay_s: 0.0, lag_s: 0.0 };

    /// By brute force: the largest of a hundred exponentials, summed in thin slices.
    #[test]
    fn continuous_gain_is_the_integral_of_the_largest_exponential() {
        let (damping, least, largest) = (0.4, 0.07, 0.25);
        let mut integral = 0.0;
        for slice in 0..40_000 {
            let time_s = (f64::from(slice) + 0.5) * 2.5e-4;
            let kernel = |j: f64| f64::exp(-damping * time_s / j) / j;
            let inertias = (0..=100).map(|i| least + (largest - least) * f64::from(i) / 100.0);
            integral += 2.5e-4 * inertias.map(kernel).fold(0.0, f64::max);
        }
        let found = of(damping, least, largest, AttitudeTiming::CONTINUOUS).unwrap();
        assert!((damping * integral - found.gain).abs() < 1e-3, "{} {}", damping * integral, found.gain);
        assert!(found.gain <= f64::sqrt(largest / least));
    }

    /// Sampling alone: geometric series in closed form.
    #[test]
    fn sampled_gain_is_the_sum_of_the_largest_power() {
        let (damping, least, largest) = (0.4, 0.07, 0.25);
        let mut sum = 0.0;
        for power in 0..1000 {
            let kernel = |i: i32| {
                let rate = damping / (least + (largest - least) * f64::from(i) / 500.0);
                rate * f64::powi(1.0 - rate * SAMPLED.step_s, power)
            };
            sum += SAMPLED.step_s * (0..=500).map(kernel).fold(0.0, f64::max);
        }
        let found = of(damping, least, largest, SAMPLED).unwrap();
        assert!(found.gain >= sum && found.gain <= 1.02 * sum, "{} {sum}", found.gain);
        assert!((0.99..=1.0).contains(&found.start));
    }

    /// The loop of one inertia by small steps of its own; the disturbance is any function of time.
    fn simulate(rate: f64, timing: &AttitudeTiming, start: f64, end: usize, push: impl Fn(f64) -> f64) -> Vec<f64> {
        const FINE: usize = 64;
        let step_s = timing.step_s / FINE as f64;
        let delay = (timing.delay_s / step_s).round() as usize;
        let (mut s, mut acting, mut held) = (start, 0.0, Vec::new());
        let mut measured = Vec::new();
        for step in 0..end * FINE {
            if step % FINE == 0 {
                measured.push(s);
            }
            held.push(measured[step / FINE]);
            let command = if step >= delay { held[step - delay] } else { 0.0 };
            let next = if timing.lag_s > 0.0 { acting + step_s / timing.lag_s * (command - acting) } else { command };
            s += step_s * rate * (push((step as f64 + 0.5) * step_s) - 0.5 * (acting + next));
            acting = next;
        }
        measured.push(s);
        measured
    }

    #[test]
    fn the_worst_torque_reaches_the_gain_of_one_inertia_and_none_exceeds_it() {
        let (damping, inertia, end) = (0.4, 0.1, 400);
        for (delay_s, lag_s) in [(0.0, 0.0), (0.0, 0.18), (0.08, 0.08), (0.13, 0.0), (0.1, 0.05)] {
            let timing = AttitudeTiming { delay_s, lag_s, ..SAMPLED };
            let rate = damping / inertia;
            let found = of(damping, inertia, inertia, timing).unwrap();
            let answer = simulate(rate, &timing, 1.0, end, |_| 0.0);
            // a push before the instant n steps ahead of the end is felt there as the answer to a start, n steps on
            let worst = simulate(rate, &timing, 0.0, end, |time_s| {
                f64::signum(answer[end - 1 - ((time_s / timing.step_s) as usize).min(end - 1)])
            });
            let reached = worst[end];
            assert!(reached <= found.gain && reached >= 0.985 * found.gain, "{timing:?}: {reached} {}", found.gain);
            // and from the start it admits, in the worst direction
            for sign in [1.0, -1.0] {
                let from_start = simulate(rate, &timing, sign * found.start, end, |_| 1.0);
                assert!(from_start.iter().all(|s| s.abs() <= found.gain), "{timing:?}");
            }
        }
    }

    /// Delay alone is stable below a quarter turn of the integrator; half a step of it comes from sampling.
    #[test]
    fn a_loop_that_rings_up_is_refused() {
        let timing = |delay_s| AttitudeTiming { step_s: 0.01, delay_s, lag_s: 0.0 };
        let critical = core::f64::consts::FRAC_PI_2 * 0.1 / 0.4 - 0.005;
        assert!(of(0.4, 0.1, 0.1, timing(0.97 * critical)).is_some());
        assert!(of(0.4, 0.1, 0.1, timing(1.03 * critical)).is_none());
        // the lightest body decides
        assert!(of(0.4, 0.09, 0.2, timing(0.97 * critical)).is_none());
        assert!(of(0.4, 1e-3, 0.9, SAMPLED).is_none() && of(0.4, 1e-4, 1.0, SAMPLED).is_none());
        assert!(of(0.4, 0.1, 0.1, timing(f64::MAX)).is_none());
        let tiny = AttitudeTiming { step_s: 1e-300, ..SAMPLED };
        assert!(of(0.4, 0.1, 0.2, tiny).is_none());
    }

    #[test]
    fn a_wider_interval_a_longer_delay_or_lag_is_no_better() {
        let base = of(0.4, 0.1, 0.2, SAMPLED).unwrap().gain;
        for (least, largest, delay_s, lag_s) in
            [(0.09, 0.2, 0.0, 0.0), (0.1, 0.3, 0.0, 0.0), (0.1, 0.2, 0.1, 0.0), (0.1, 0.2, 0.0, 0.1)]
        {
            assert!(of(0.4, least, largest, AttitudeTiming { delay_s, lag_s, ..SAMPLED }).unwrap().gain > base);
        }
    }
}
