//! Actuators at their limits.

use crate::dynamics::WrenchBox;
use crate::motion::MotionSample;

/// A component this near to its limit, relative to it, is at the limit.
const AT_LIMIT: f64 = 0.01;
/// Values that differ by less than this share of the largest are one value.
const SAME: f64 = 1e-6;
/// A value held this many times longer than usual is a limit.
const LONG: usize = 3;

/// Share of samples at which a component of the wrench is at its limit.
///
/// Where no limits are given they are looked for: the largest and the smallest value of a component are limits where the
/// wrench stays at one of them, to one part in a million, at least three times longer than it usually stays at a value. Noise
/// on the logged wrench hides such limits; state them then.
pub fn saturated_share(samples: &[MotionSample], limits: Option<&WrenchBox>) -> f64 {
    let wrenches: Vec<_> = samples.iter().filter_map(|sample| sample.wrench_body).map(|w| w.to_vector()).collect();
    let mut saturated = vec![false; wrenches.len()];
    for component in 0..6 {
        let series: Vec<f64> = wrenches.iter().map(|wrench| wrench[component]).collect();
        match limits {
            Some(limits) => {
                let limit =
                    if component < 3 { limits.torque_limit[component] } else { limits.force_limit[component - 3] };
                for (at_limit, value) in saturated.iter_mut().zip(&series) {
                    *at_limit |= limit > 0.0 && value.abs() >= (1.0 - AT_LIMIT) * limit;
                }
            }
            None => mark_held_extremes(&series, &mut saturated),
        }
    }
    saturated.iter().filter(|&&at_limit| at_limit).count() as f64 / samples.len().max(1) as f64
}

/// Marks long runs at the largest or the smallest value.
fn mark_held_extremes(series: &[f64], saturated: &mut [bool]) {
    let (low, high) = series.iter().fold((f64::INFINITY, f64::NEG_INFINITY), |(l, h), &x| (l.min(x), h.max(x)));
    let tolerance = SAME * low.abs().max(high.abs());
    // Also a component that never changes has no limit that would show.
    if series.is_empty() || high - low <= tolerance {
        return;
    }
    let (mut runs, mut start) = (Vec::new(), 0);
    for end in 1..=series.len() {
        if end == series.len() || (series[end] - series[start]).abs() > tolerance {
            runs.push(start..end);
            start = end;
        }
    }
    let mut lengths: Vec<usize> = runs.iter().map(ExactSizeIterator::len).collect();
    let middle = lengths.len() / 2;
    let usual = *lengths.select_nth_unstable(middle).1;
    for run in runs {
        let value = series[run.start];
        let extreme = high - value <= tolerance && high > 0.0 || value - low <= tolerance && low < 0.0;
        if extreme && run.len() >= LONG * usual {
            saturated[run].fill(true);
        }
    }
}
