//! A motion log as the likelihood reads it: times, inputs, and the places where the logged wrench is in doubt.

use super::drive::Passage;
use super::flow::Input;
use super::sample::Sample;
use crate::WrenchTiming;
use crate::beside::{UnloggedWrench, environment, stored_momenta};
use crate::error::{Column, IdentificationError};
use crate::motion::{MotionSample, filled_poses};
use core::ops::Range;
use nalgebra::{Vector3, Vector6};

/// Fewest samples that are tried.
const FEWEST_SAMPLES: usize = 8;
/// A step longer than this many median steps is a gap: the wrench there is only guessed by the last one.
pub(super) const GAP: f64 = 1.5;
/// A gap longer than this is not bridged: the unknown course of the wrench within it would matter too.
pub(super) const LONGEST_BRIDGE: f64 = 3.5;
/// Distance from the running median, in robust standard deviations of such distances, at which a wrench is a spike.
const SPIKE: f64 = 5.0 * 1.4826;
/// Spikes more frequent than this are how the body is driven.
const LARGEST_SPIKE_SHARE: f64 = 0.03;

/// A sample whose wrench is less certain than the others'.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Doubt {
    pub(super) sample: usize,
    /// Variance beyond that of the noise, torque and force.
    pub(super) variance: Vector6<f64>,
}

#[derive(Clone)]
pub(super) struct Record {
    pub(super) samples: Vec<Sample>,
    /// As logged, spikes replaced.
    pub(super) wrenches: Vec<Vector6<f64>>,
    pub(super) median_step_s: f64,
    /// In ascending order of samples.
    pub(super) doubts: Vec<Doubt>,
    /// Distances from the running median beyond which a wrench is a spike.
    pub(super) spike_bounds: Vector6<f64>,
    /// Samples after gaps that are not bridged, in ascending order.
    pub(super) breaks: Vec<usize>,
}

impl Record {
    pub(super) fn try_new(
        record: &[MotionSample],
        timing: WrenchTiming,
        filter_spikes: bool,
    ) -> Result<Self, IdentificationError> {
        if record.len() < FEWEST_SAMPLES {
            return Err(IdentificationError::TooFewSamples { samples: record.len(), needed: FEWEST_SAMPLES });
        }
        if let Some(index) = record.windows(2).position(|pair| pair[1].time_ns <= pair[0].time_ns) {
            return Err(IdentificationError::TimesNotIncreasing { index: index + 1 });
        }
        if let Some(row) = record.iter().position(|sample| !is_finite(sample)) {
            return Err(IdentificationError::NotFinite { row });
        }
        // Held until another one is logged; before the first, the first.
        let first = record.iter().find_map(|sample| sample.wrench_body);
        let mut held = first.ok_or(IdentificationError::MissingColumn(Column::Wrench))?.to_vector();
        let mut wrenches: Vec<Vector6<f64>> = record
            .iter()
            .map(|sample| {
                held = sample.wrench_body.map_or(held, |wrench| wrench.to_vector());
                held
            })
            .collect();
        let between = |a: usize, b: usize| (record[b].time_ns - record[a].time_ns) as f64 * 1e-9;
        let last = record.len() - 1;
        let steps: Vec<f64> = (0..record.len()).map(|k| between(k, (k + 1).min(last))).collect();
        let median_step_s = median(&mut steps[..last].to_vec());
        let (mut doubts, spike_bounds) =
            if filter_spikes { spikes(&mut wrenches) } else { (Vec::new(), Vector6::repeat(f64::INFINITY)) };
        let mut breaks = Vec::new();
        for (sample, step) in steps.iter().enumerate().filter(|(_, step)| **step > GAP * median_step_s) {
            if *step > LONGEST_BRIDGE * median_step_s {
                breaks.push(sample + 1);
                continue;
            }
            let lag = super::rounding::whole(step / median_step_s).clamp(1, last);
            doubts.push(Doubt { sample, variance: change_variance(&wrenches, lag) });
        }
        doubts.sort_by_key(|doubt| doubt.sample);
        doubts.dedup_by(|next, kept| {
            let same = next.sample == kept.sample;
            if same {
                kept.variance += next.variance;
            }
            same
        });
        let unlogged = environment(record);
        let momenta = stored_momenta(record).unwrap_or_else(|| vec![Vector3::zeros(); record.len()]);
        let input = |k: usize| {
            let mut input = input(&wrenches, &steps, k, timing, GAP * median_step_s);
            input.stored = (momenta[k] + momenta[(k + 1).min(last)]) * 0.5;
            if let Some(UnloggedWrench { mean, slope, .. }) = unlogged.as_ref().map(|unlogged| unlogged[k]) {
                input.torque += mean.torque;
                input.force += mean.force;
                input.torque_slope += slope.torque;
                input.force_slope += slope.force;
            }
            input
        };
        let poses = filled_poses(record).ok_or(IdentificationError::MissingColumn(Column::Pose))?;
        let samples = record
            .iter()
            .enumerate()
            .map(|(k, sample)| Sample {
                time_s: between(0, k),
                step_s: steps[k],
                input: input(k),
                posed: sample.world_from_body.is_some(),
                position: poses[k].translation.vector,
                world_from_body: poses[k].rotation,
                velocity: sample.velocity_origin_world,
                rate: sample.rate_body,
                acceleration: sample.acceleration_origin_body,
            })
            .collect();
        Ok(Self { samples, wrenches, median_step_s, doubts, spike_bounds, breaks })
    }

    /// Largest torque about this point.
    pub(super) fn largest_torque(&self, center: &Vector3<f64>) -> f64 {
        let about = |input: &Input| (input.torque - center.cross(&input.force)).norm();
        self.samples.iter().map(|sample| about(&sample.input)).fold(0.0, f64::max)
    }

    /// The stretch without an unbridged gap that holds this sample.
    pub(super) fn stretch(&self, sample: usize) -> core::ops::Range<usize> {
        let next = self.breaks.partition_point(|&first| first <= sample);
        let end = self.breaks.get(next).copied().unwrap_or(self.samples.len());
        next.checked_sub(1).map_or(0, |before| self.breaks[before])..end
    }

    /// Rows that a logged wrench acts on.
    pub(super) fn rows(&self, passage: &Passage) -> Range<usize> {
        let Passage { shift_s, settling_s, .. } = *passage;
        let steps = |time_s: f64| super::rounding::whole((time_s / self.median_step_s).ceil());
        let first = steps(shift_s.max(0.0) + settling_s);
        let end = self.samples.len().saturating_sub(steps(-shift_s.min(0.0)));
        first.min(end)..end
    }

    /// First samples of segments of `length` samples; a sample in doubt is a segment of its own.
    pub(super) fn segments(&self, length: usize, passage: &Passage) -> Vec<usize> {
        let mut starts = Vec::new();
        let rows = self.rows(passage);
        let mut next = rows.start;
        for k in rows {
            let doubted = self.doubt_at(k, passage.shift_s).is_some();
            if k == next || doubted || self.breaks.binary_search(&k).is_ok() {
                starts.push(k);
                next = k + if doubted { 1 } else { length };
            }
        }
        starts
    }

    /// Extra variance of the wrench in the segment that starts at this sample.
    pub(super) fn doubt_at(&self, sample: usize, shift_s: f64) -> Option<&Vector6<f64>> {
        let late = shift_s / self.median_step_s;
        // A step between two logged ones is under both.
        [late.ceil(), late.floor()].into_iter().find_map(|late| {
            let sample = sample.checked_add_signed(-super::rounding::whole_signed(late))?;
            let found = self.doubts.binary_search_by_key(&sample, |doubt| doubt.sample).ok()?;
            self.doubts.get(found).map(|doubt| &doubt.variance)
        })
    }
}

/// Mean wrench over the step after sample `k`, and its slope.
///
/// # Source
/// Sampled: average over the cell of the cubic through four samples, or of the chord where one of them is missing.
pub(super) fn input(wrenches: &[Vector6<f64>], steps: &[f64], k: usize, timing: WrenchTiming, gap_s: f64) -> Input {
    let here = wrenches[k];
    let (mean, slope) = match (timing, wrenches.get(k + 1)) {
        (WrenchTiming::Sampled, Some(next)) if steps[k] <= gap_s => {
            let h = steps[k];
            let like = |other: f64| (other / h - 1.0).abs() < 0.01;
            let outer = k
                .checked_sub(1)
                .zip(wrenches.get(k + 2))
                .filter(|(before, _)| like(steps[*before]) && like(steps[k + 1]));
            let mean = match outer {
                Some((before, after)) => ((here + next) * 13.0 - wrenches[before] - after) / 24.0,
                None => (here + next) * 0.5,
            };
            (mean, (next - here) / h)
        }
        _ => (here, Vector6::zeros()),
    };
    let half = |v: &Vector6<f64>, first: usize| Vector3::new(v[first], v[first + 1], v[first + 2]);
    Input {
        torque: half(&mean, 0),
        force: half(&mean, 3),
        torque_slope: half(&slope, 0),
        force_slope: half(&slope, 3),
        ..Input::default()
    }
}

/// Replaces rare spikes by the running median of five; what they were is the doubt that remains.
fn spikes(wrenches: &mut [Vector6<f64>]) -> (Vec<Doubt>, Vector6<f64>) {
    let mut bounds = Vector6::repeat(f64::INFINITY);
    let original = wrenches.to_vec();
    let mut doubts: Vec<Doubt> = Vec::new();
    for axis in 0..6 {
        let medians: Vec<f64> = (0..original.len()).map(|k| running_median(&original, k, axis)).collect();
        let away = |k: usize| (original[k][axis] - medians[k]).abs();
        let bound = SPIKE * median(&mut (0..original.len()).map(away).collect::<Vec<_>>());
        let found: Vec<usize> = (0..original.len()).filter(|&k| away(k) > bound).collect();
        if bound == 0.0 || found.len() as f64 > LARGEST_SPIKE_SHARE * original.len() as f64 {
            continue;
        }
        bounds[axis] = bound;
        for sample in found {
            let mut variance = Vector6::zeros();
            variance[axis] = away(sample).powi(2);
            wrenches[sample][axis] = medians[sample];
            doubts.push(Doubt { sample, variance });
        }
    }
    (doubts, bounds)
}

/// Median of the five wrenches around sample `k`.
pub(super) fn running_median(wrenches: &[Vector6<f64>], k: usize, axis: usize) -> f64 {
    let first = k.saturating_sub(2).min(wrenches.len().saturating_sub(5));
    let mut near = [0.0; 5];
    let count = wrenches.len().min(5);
    for (value, wrench) in near.iter_mut().zip(&wrenches[first..]) {
        *value = wrench[axis];
    }
    median(&mut near[..count])
}

/// Half the mean square change of the wrench over `lag` samples, the same for the three axes of torque and of force.
pub(super) fn change_variance(wrenches: &[Vector6<f64>], lag: usize) -> Vector6<f64> {
    let (mut torque, mut force) = (0.0, 0.0);
    for (a, b) in wrenches.iter().zip(&wrenches[lag..]) {
        let change = b - a;
        torque += change.fixed_rows::<3>(0).norm_squared();
        force += change.fixed_rows::<3>(3).norm_squared();
    }
    let pairs = 6.0 * (wrenches.len() - lag).max(1) as f64;
    Vector6::from_fn(|i, _| if i < 3 { torque / pairs } else { force / pairs })
}

pub(super) fn is_finite(sample: &MotionSample) -> bool {
    let place = sample.world_from_body.map(|pose| pose.translation.vector);
    let vectors = [sample.velocity_origin_world, sample.rate_body, sample.acceleration_origin_body];
    let [wrench, besides] = [sample.wrench_body, sample.besides_body].map(|w| w.map(|w| w.torque + w.force));
    let all = |v: &Vector3<f64>| v.iter().all(|x| x.is_finite());
    sample.world_from_body.is_none_or(|pose| pose.rotation.coords.iter().all(|x| x.is_finite()))
        && vectors.into_iter().chain([place, wrench, besides, sample.stored_momentum_body]).flatten().all(|v| all(&v))
}

/// Median of a list that is not empty; zero of an empty one.
pub(super) fn median(values: &mut [f64]) -> f64 {
    if values.is_empty() {
        return 0.0;
    }
    let middle = values.len() / 2;
    *values.select_nth_unstable_by(middle, f64::total_cmp).1
}
