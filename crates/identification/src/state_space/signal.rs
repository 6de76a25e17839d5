//! Sampled signals between their samples, and behind an actuator's lag.

use crate::IdentificationError;
use tumble_lie::nalgebra::SVector;

/// `K` channels sampled at increasing times, read at any time: cubic between samples, so that a likelihood has a
/// derivative by a delay; held before the first and after the last.
#[derive(Debug, Clone, PartialEq)]
pub struct Signal<const K: usize> {
    times_s: Vec<f64>,
    values: Vec<SVector<f64, K>>,
    slopes_per_s: Vec<SVector<f64, K>>,
}

impl<const K: usize> Signal<K> {
    /// A signal through these samples, its slopes by central differences.
    ///
    /// # Errors
    /// [`IdentificationError::TooFewSamples`] for fewer than two samples, or times and values that differ in number,
    /// [`IdentificationError::TimesNotIncreasing`], [`IdentificationError::NotFinite`].
    pub fn try_new(times_s: Vec<f64>, values: Vec<SVector<f64, K>>) -> Result<Self, IdentificationError> {
        let samples = times_s.len().min(values.len());
        if samples < 2 || times_s.len() != values.len() {
            return Err(IdentificationError::TooFewSamples { samples, needed: times_s.len().max(values.len()).max(2) });
        }
        if let Some(row) =
            (0..samples).find(|k| !(times_s[*k].is_finite() && values[*k].iter().all(|value| value.is_finite())))
        {
            return Err(IdentificationError::NotFinite { row });
        }
        if let Some(index) = times_s.windows(2).position(|pair| pair[1] <= pair[0]) {
            return Err(IdentificationError::TimesNotIncreasing { index: index + 1 });
        }
        let slopes_per_s = (0..samples)
            .map(|k| {
                let (before, after) = (k.saturating_sub(1), (k + 1).min(samples - 1));
                (values[after] - values[before]) / (times_s[after] - times_s[before])
            })
            .collect();
        Ok(Self { times_s, values, slopes_per_s })
    }

    /// The signal behind a first-order lag, `y' = (u - y) / lag`, which begins settled; exact for commands that are
    /// linear between samples.
    ///
    /// # Errors
    /// [`IdentificationError::NotPositive`] for the lag (component 0).
    pub fn lagged(&self, lag_s: f64) -> Result<Self, IdentificationError> {
        if !(lag_s.is_finite() && lag_s > 0.0) {
            return Err(IdentificationError::NotPositive { index: 0, value: lag_s });
        }
        let mut values = Vec::with_capacity(self.values.len());
        let mut behind = self.values[0];
        values.push(behind);
        for (times, commands) in self.times_s.windows(2).zip(self.values.windows(2)) {
            let step = (times[1] - times[0]) / lag_s;
            let kept = (-step).exp();
            let mean_kept = (1.0 - kept) / step;
            behind = behind * kept + commands[0] * (mean_kept - kept) + commands[1] * (1.0 - mean_kept);
            values.push(behind);
        }
        let slopes_per_s =
            self.values.iter().zip(&values).map(|(command, behind)| (command - behind) / lag_s).collect();
        Ok(Self { times_s: self.times_s.clone(), values, slopes_per_s })
    }

    /// The value at a time.
    pub fn at(&self, time_s: f64) -> SVector<f64, K> {
        let last = self.times_s.len() - 1;
        if time_s <= self.times_s[0] {
            return self.values[0];
        }
        if time_s >= self.times_s[last] {
            return self.values[last];
        }
        let after = self.times_s.partition_point(|sample_s| *sample_s <= time_s).clamp(1, last);
        let before = after - 1;
        let span_s = self.times_s[after] - self.times_s[before];
        let share = (time_s - self.times_s[before]) / span_s;
        let rest = 1.0 - share;
        // Hermite's cubic.
        self.values[before] * (rest * rest * (1.0 + 2.0 * share))
            + self.values[after] * (share * share * (1.0 + 2.0 * rest))
            + (self.slopes_per_s[before] * rest - self.slopes_per_s[after] * share) * (share * rest * span_s)
    }
}
