//! A motion log row by row: the same samples as [`Record`](super::record::Record) makes of a whole one, a few rows late.

use super::record::{GAP, LONGEST_BRIDGE, Record, change_variance, input, is_finite, running_median};
use super::sample::Sample;
use crate::WrenchTiming;
use crate::error::IdentificationError;
use crate::motion::MotionSample;
use nalgebra::Vector6;

/// Rows kept before the one that is turned into a sample.
const BEFORE: usize = 3;
/// Wrenches from which the uncertainty of a gap is taken.
const HISTORY: usize = 512;

/// A sample, and what the rows around it say of its wrench.
#[derive(Clone, Copy)]
pub(super) struct Read {
    pub(super) sample: Sample,
    /// Extra variance of the wrench.
    pub(super) doubt: Option<Vector6<f64>>,
    /// A gap that is not bridged comes before it.
    pub(super) after_break: bool,
}

/// The last rows, and what the stretch before them said about steps and spikes.
pub(super) struct Stream {
    timing: WrenchTiming,
    gap_s: f64,
    median_step_s: f64,
    spike_bounds: Vector6<f64>,
    /// Rows before the present one, the present one, rows after it.
    rows: Vec<MotionSample>,
    /// Their wrenches as logged, or held.
    wrenches: Vec<Vector6<f64>>,
    present: usize,
    history: Vec<Vector6<f64>>,
    oldest: usize,
    start_ns: i64,
    after_break: bool,
    /// Rows seen.
    pub(super) count: usize,
}

impl Stream {
    /// Goes on after `rows`, of which `record` was made; the last [`late`](Self::late) of them are still to come as samples.
    ///
    /// `forgotten`: rows seen before these.
    pub(super) fn after(rows: &[MotionSample], forgotten: usize, record: &Record, timing: WrenchTiming) -> Self {
        let mut stream = Self {
            timing,
            gap_s: GAP * record.median_step_s,
            median_step_s: record.median_step_s,
            spike_bounds: record.spike_bounds,
            rows: Vec::with_capacity(2 * BEFORE + 3),
            wrenches: Vec::with_capacity(2 * BEFORE + 3),
            present: 0,
            history: Vec::with_capacity(HISTORY),
            oldest: 0,
            after_break: false,
            start_ns: rows.first().map_or(0, |row| row.time_ns),
            count: forgotten + rows.len(),
        };
        let mut held = rows.iter().find_map(|row| row.wrench_body).map_or_else(Vector6::zeros, |w| w.to_vector());
        let kept = rows.len().saturating_sub(Self::late(timing) + BEFORE);
        for (k, row) in rows.iter().enumerate() {
            held = row.wrench_body.map_or(held, |wrench| wrench.to_vector());
            stream.remember(held);
            if k >= kept {
                stream.rows.push(*row);
                stream.wrenches.push(held);
            }
        }
        stream.present = stream.rows.len().saturating_sub(Self::late(timing));
        stream.after_break = record.breaks.contains(&(rows.len() - Self::late(timing)));
        stream
    }

    /// Rows after a sample that it depends on.
    pub(super) fn late(timing: WrenchTiming) -> usize {
        match timing {
            // Two for the running median.
            WrenchTiming::Held => 2,
            // Two for the cubic through the wrenches, two for the running median of the last of them.
            WrenchTiming::Sampled => 4,
        }
    }

    /// Takes the next row; gives the sample that is complete now, with the extra variance of its wrench.
    pub(super) fn push(&mut self, row: &MotionSample) -> Result<Read, IdentificationError> {
        if !is_finite(row) {
            return Err(IdentificationError::NotFinite { row: self.count });
        }
        if self.rows.last().is_some_and(|last| row.time_ns <= last.time_ns) {
            return Err(IdentificationError::TimesNotIncreasing { index: self.count });
        }
        let held = self.wrenches.last().copied().unwrap_or_else(Vector6::zeros);
        let wrench = row.wrench_body.map_or(held, |wrench| wrench.to_vector());
        self.count += 1;
        self.remember(wrench);
        self.rows.push(*row);
        self.wrenches.push(wrench);
        let found = self.sample();
        if self.present > BEFORE {
            self.rows.remove(0);
            self.wrenches.remove(0);
            self.present -= 1;
        }
        Ok(found)
    }

    /// The samples left when no more rows come.
    pub(super) fn flush(&mut self) -> Option<Read> {
        (self.present < self.rows.len()).then(|| self.sample())
    }

    /// The last row's time, ns.
    pub(super) fn time_ns(&self) -> i64 {
        self.rows.last().map_or(0, |row| row.time_ns)
    }

    fn remember(&mut self, wrench: Vector6<f64>) {
        if self.history.len() < HISTORY {
            self.history.push(wrench);
        } else {
            self.history[self.oldest] = wrench;
            self.oldest = (self.oldest + 1) % HISTORY;
        }
    }

    /// The present row as a sample; the next one becomes the present one.
    fn sample(&mut self) -> Read {
        let k = self.present;
        let first = k.saturating_sub(1);
        let end = self.rows.len().min(k + 3);
        let (mut wrenches, mut steps, mut spike) = ([Vector6::zeros(); 4], [0.0; 4], None);
        for (i, at) in (first..end).enumerate() {
            let (wrench, variance) = self.without_spike(at);
            wrenches[i] = wrench;
            if at == k {
                spike = variance;
            }
            let next = (at + 1).min(self.rows.len() - 1);
            steps[i] = (self.rows[next].time_ns - self.rows[at].time_ns) as f64 * 1e-9;
        }
        let count = end - first;
        let (row, step_s) = (&self.rows[k], steps[k - first]);
        let mut doubt = spike;
        let after_break = self.after_break;
        self.after_break = step_s > LONGEST_BRIDGE * self.median_step_s;
        if step_s > self.gap_s && !self.after_break {
            self.history.rotate_left(self.oldest);
            self.oldest = 0;
            let lag = super::whole(step_s / self.median_step_s).clamp(1, self.history.len() / 2);
            doubt = Some(doubt.unwrap_or_else(Vector6::zeros) + change_variance(&self.history, lag));
        }
        let pose = row.world_from_body.unwrap_or_default();
        let sample = Sample {
            time_s: (row.time_ns - self.start_ns) as f64 * 1e-9,
            step_s,
            input: input(&wrenches[..count], &steps[..count], k - first, self.timing, self.gap_s),
            posed: row.world_from_body.is_some(),
            position: pose.translation.vector,
            world_from_body: pose.rotation,
            velocity: row.velocity_origin_world,
            rate: row.rate_body,
            acceleration: row.acceleration_origin_body,
        };
        self.present += 1;
        Read { sample, doubt, after_break }
    }

    fn without_spike(&self, k: usize) -> (Vector6<f64>, Option<Vector6<f64>>) {
        let (mut wrench, mut variance) = (self.wrenches[k], None);
        for axis in 0..6 {
            let bound = self.spike_bounds[axis];
            if bound.is_finite() {
                let middle = running_median(&self.wrenches, k, axis);
                let away = (wrench[axis] - middle).abs();
                if away > bound {
                    wrench[axis] = middle;
                    variance.get_or_insert_with(Vector6::zeros)[axis] = away * away;
                }
            }
        }
        (wrench, variance)
    }
}
