//! The times of a record: steps, gaps, equality of steps.

use crate::error::IdentificationError;
use crate::motion::MotionSample;

/// Steps of one window agree when they differ by no more than this fraction.
const EQUAL_STEPS: f64 = 0.01;
/// A step longer than this many median steps is a gap.
const GAP: f64 = 1.5;

pub(super) struct Timeline {
    times_ns: Vec<i64>,
    median_ns: f64,
    pub(super) gaps: usize,
    pub(super) longest_step_s: f64,
}

impl Timeline {
    pub(super) fn try_new(record: &[MotionSample]) -> Result<Self, IdentificationError> {
        let times_ns: Vec<i64> = record.iter().map(|sample| sample.time_ns).collect();
        if times_ns.len() < 3 {
            return Err(IdentificationError::TooFewSamples { samples: times_ns.len(), needed: 3 });
        }
        let mut steps_ns: Vec<i64> = times_ns.windows(2).map(|pair| pair[1].saturating_sub(pair[0])).collect();
        if let Some(index) = steps_ns.iter().position(|&step| step <= 0) {
            return Err(IdentificationError::TimesNotIncreasing { index: index + 1 });
        }
        let longest_step_s = steps_ns.iter().copied().max().unwrap_or(0) as f64 * 1e-9;
        let middle = steps_ns.len() / 2;
        let median_ns = *steps_ns.select_nth_unstable(middle).1 as f64;
        let gaps = steps_ns.iter().filter(|&&step| step as f64 > GAP * median_ns).count();
        Ok(Self { times_ns, median_ns, gaps, longest_step_s })
    }

    pub(super) fn len(&self) -> usize {
        self.times_ns.len()
    }

    pub(super) fn duration_s(&self) -> f64 {
        self.times_ns
            .first()
            .zip(self.times_ns.last())
            .map_or(0.0, |(first, last)| last.saturating_sub(*first) as f64 * 1e-9)
    }

    pub(super) fn median_step_s(&self) -> f64 {
        self.median_ns * 1e-9
    }

    pub(super) fn time_ns(&self, index: usize) -> i64 {
        self.times_ns[index]
    }

    /// Time of `index` relative to `node`, s: exact, because the difference is taken in nanoseconds.
    pub(super) fn relative_s(&self, index: usize, node: usize) -> f64 {
        (self.times_ns[index] - self.times_ns[node]) as f64 * 1e-9
    }

    /// Whether no step between samples `first` and `last` is a gap.
    pub(super) fn without_gap(&self, first: usize, last: usize) -> bool {
        self.times_ns[first..=last].windows(2).all(|pair| (pair[1] - pair[0]) as f64 <= GAP * self.median_ns)
    }

    /// Whether all steps between samples `first` and `last` agree to 1 %.
    pub(super) fn equal_steps(&self, first: usize, last: usize) -> bool {
        let (mut shortest, mut longest) = (i64::MAX, 0);
        for pair in self.times_ns[first..=last].windows(2) {
            let step = pair[1] - pair[0];
            shortest = shortest.min(step);
            longest = longest.max(step);
        }
        (longest - shortest) as f64 <= EQUAL_STEPS * shortest as f64
    }
}
