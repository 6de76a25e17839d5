//! A record as the sweeps read it: rows in nearly equal steps, gaps filled with rows that measured nothing.

use super::Thrusters;
use crate::WrenchTiming;
use crate::beside::{listed_beside, stored_momenta};
use crate::error::{Column, IdentificationError};
use crate::lie::{LieGroup, Pose, Wrench};
use crate::motion::{MotionSample, filled_poses};
use nalgebra::{UnitQuaternion, Vector3};

/// Streams of measurements, in the order of their rows.
pub(super) const POSITION: usize = 0;
pub(super) const ATTITUDE: usize = 1;
pub(super) const VELOCITY: usize = 2;
pub(super) const RATE: usize = 3;
pub(super) const ACCELERATION: usize = 4;
pub(super) const STREAMS: usize = 5;

/// A step longer than this, by the median, is a gap.
const GAP: f64 = 1.5;
/// Rows that fill a gap at most.
const LONGEST_FILL: usize = 500;
/// A step that differs from the median by more than this share of it makes the rows uneven.
const UNEVEN: f64 = 0.1;
/// Fewest rows that anything is made of.
const FEWEST: usize = 32;

/// One row: what was measured at its time, by its publisher's own account.
#[derive(Clone, Copy, Debug)]
pub(super) struct Row {
    pub(super) position: Vector3<f64>,
    pub(super) attitude: UnitQuaternion<f64>,
    pub(super) velocity: Vector3<f64>,
    pub(super) rate: Vector3<f64>,
    /// Acceleration as published, less the gravity that the publisher added.
    pub(super) acceleration: Vector3<f64>,
    /// Rate and direction of gravity in body axes, as the publisher of the acceleration had them.
    pub(super) rate_beside: Vector3<f64>,
    pub(super) upward_beside: Vector3<f64>,
}

/// Rows of a record, by the streams that they hold.
#[derive(Clone)]
pub(super) struct Grid {
    /// Median step, s.
    pub(super) step_s: f64,
    /// Steps from each row to the next; that of the last is the median.
    pub(super) steps: Vec<f64>,
    /// Times since the first row, s.
    pub(super) times: Vec<f64>,
    pub(super) rows: Vec<Row>,
    pub(super) valid: Vec<[bool; STREAMS]>,
    /// Wrench over the step that begins at a row: torque about the origin, force, body axes.
    pub(super) torque: Vec<Vector3<f64>>,
    pub(super) force: Vec<Vector3<f64>>,
    /// Momentum of wheels in the middle of that step, body axes.
    pub(super) stored: Vec<Vector3<f64>>,
    /// Amounts of the thrusters' terms over that step, row by row.
    pub(super) amounts: Vec<f64>,
    /// The row of the record that each is made of.
    pub(super) source: Vec<usize>,
    /// Poses without gaps, for a start.
    pub(super) guess: Vec<Pose<f64>>,
    /// Rows filled in.
    pub(super) filled: usize,
}

fn is_finite(sample: &MotionSample) -> bool {
    let vectors =
        [sample.velocity_origin_world, sample.rate_body, sample.acceleration_origin_body, sample.stored_momentum_body];
    let wrenches = [sample.wrench_body, sample.besides_body];
    vectors.iter().flatten().all(|v| v.iter().all(|x| x.is_finite()))
        && wrenches.iter().flatten().all(|w| w.to_vector().iter().all(|x| x.is_finite()))
        && sample
            .world_from_body
            .is_none_or(|pose| pose.translation.vector.iter().chain(pose.rotation.coords.iter()).all(|x| x.is_finite()))
}

impl Grid {
    pub(super) fn try_new(
        record: &[MotionSample],
        timing: WrenchTiming,
        gravity_added: &Vector3<f64>,
        thrusters: Option<&Thrusters>,
    ) -> Result<Self, IdentificationError> {
        let samples = record.len();
        if samples < FEWEST {
            return Err(IdentificationError::TooFewSamples { samples, needed: FEWEST });
        }
        if let Some(row) = record.iter().position(|sample| !is_finite(sample)) {
            return Err(IdentificationError::NotFinite { row });
        }
        if record.iter().all(|sample| sample.wrench_body.is_none()) {
            return Err(IdentificationError::MissingColumn(Column::Wrench));
        }
        let beside = listed_beside(record);
        let momenta = stored_momenta(record).unwrap_or_else(|| vec![Vector3::zeros(); samples]);
        if let Some(index) = record.windows(2).position(|pair| pair[1].time_ns <= pair[0].time_ns) {
            return Err(IdentificationError::TimesNotIncreasing { index: index + 1 });
        }
        let seconds = |i: usize| record[i].time_ns.saturating_sub(record[0].time_ns) as f64 * 1e-9;
        let mut lengths: Vec<f64> = (1..samples).map(|i| seconds(i) - seconds(i - 1)).collect();
        let middle = lengths.len() / 2;
        let step_s = *lengths.select_nth_unstable_by(middle, f64::total_cmp).1;
        let guesses = filled_poses(record).unwrap_or_else(|| turned_by_rates(record));
        let mut grid = Self {
            step_s,
            steps: Vec::with_capacity(samples),
            times: Vec::with_capacity(samples),
            rows: Vec::with_capacity(samples),
            valid: Vec::with_capacity(samples),
            torque: Vec::with_capacity(samples),
            force: Vec::with_capacity(samples),
            stored: Vec::with_capacity(samples),
            amounts: Vec::new(),
            source: Vec::with_capacity(samples),
            guess: Vec::with_capacity(samples),
            filled: 0,
        };
        let (mut torque, mut force) = (Vector3::zeros(), Vector3::zeros());
        let (mut rate, mut attitude) = (Vector3::zeros(), guesses[0].rotation);
        for (i, sample) in record.iter().enumerate() {
            if let Some(wrench) = held(record, beside.as_deref(), i, timing) {
                (torque, force) = wrench;
            }
            rate = sample.rate_body.unwrap_or(rate);
            attitude = sample.world_from_body.map_or(attitude, |pose| pose.rotation);
            let pose = guesses[i];
            let added = attitude.inverse_transform_vector(gravity_added);
            let row = Row {
                position: pose.translation.vector,
                attitude: pose.rotation,
                velocity: sample.velocity_origin_world.unwrap_or_default(),
                rate: sample.rate_body.unwrap_or_default(),
                acceleration: sample.acceleration_origin_body.unwrap_or_default() - added,
                rate_beside: rate,
                upward_beside: attitude.inverse_transform_vector(&Vector3::z()),
            };
            let [stored, stored_then] = [i, (i + 1).min(samples - 1)].map(|at| momenta[at]);
            let posed = sample.world_from_body.is_some();
            let valid = [
                posed,
                posed,
                sample.velocity_origin_world.is_some(),
                sample.rate_body.is_some(),
                sample.acceleration_origin_body.is_some(),
            ];
            let length = if i + 1 < samples { seconds(i + 1) - seconds(i) } else { step_s };
            let parts = if length > GAP * step_s { whole(length / step_s).clamp(2, LONGEST_FILL) } else { 1 };
            for part in 0..parts {
                let along = length / parts as f64;
                grid.times.push(seconds(i) + along * part as f64);
                grid.steps.push(along);
                grid.rows.push(row);
                grid.valid.push(if part == 0 { valid } else { [false; STREAMS] });
                grid.torque.push(torque);
                grid.force.push(force);
                grid.stored.push(stored.lerp(&stored_then, (part as f64 + 0.5) / parts as f64));
                grid.source.push(i);
                grid.guess.push(pose);
            }
            grid.filled += parts - 1;
            if let Some(thrusters) = thrusters {
                for _ in 0..parts {
                    grid.amounts.extend_from_slice(thrusters.of_sample(i));
                }
            }
        }
        Ok(grid)
    }

    /// Wrenches as they would have to be for the body that began, where it has become lighter since.
    pub(super) fn lighten(&mut self, thrusters: &Thrusters, mass_kg: f64) {
        for (k, source) in self.source.iter().enumerate() {
            let Some(spent_kg) = thrusters.spent_kg(*source) else { continue };
            let factor = mass_kg / (mass_kg - spent_kg.min(0.5 * mass_kg));
            self.torque[k] *= factor;
            self.force[k] *= factor;
            self.stored[k] *= factor;
            for amount in self.amounts.iter_mut().skip(k * thrusters.width).take(thrusters.width) {
                *amount *= factor;
            }
        }
    }

    pub(super) fn len(&self) -> usize {
        self.rows.len()
    }

    /// The same of rows at uneven times: so many median steps later, on the straight line between the rows there where both are seen.
    fn moved_in_time(&self, k: usize, shift: &[isize; 4]) -> (Row, [bool; STREAMS]) {
        let last = self.len() - 1;
        let at = |by: isize, stream: usize| -> Option<(&Row, &Row, f64)> {
            let time = self.times[k] + by as f64 * self.step_s;
            let next = self.times.partition_point(|there| *there <= time);
            let before = next.checked_sub(1).filter(|_| time <= self.times[last])?;
            let next = next.min(last);
            let span = self.times[next] - self.times[before];
            if by != 0 && span > 0.0 && self.valid[before][stream] && self.valid[next][stream] {
                return Some((&self.rows[before], &self.rows[next], (time - self.times[before]) / span));
            }
            let there = k.checked_add_signed(by).filter(|there| *there <= last && self.valid[*there][stream])?;
            Some((&self.rows[there], &self.rows[there], 0.0))
        };
        let [pose, velocity, rate, acceleration] = *shift;
        let found = [
            at(pose, POSITION),
            at(pose, ATTITUDE),
            at(velocity, VELOCITY),
            at(rate, RATE),
            at(acceleration, ACCELERATION),
        ];
        let line = |stream: usize, of: fn(&Row) -> Vector3<f64>| {
            found[stream].map_or_else(|| of(&self.rows[k]), |(here, next, along)| of(here).lerp(&of(next), along))
        };
        let row = Row {
            position: line(POSITION, |row| row.position),
            attitude: found[ATTITUDE].map_or(self.rows[k].attitude, |(here, next, along)| {
                let turn: Vector3<f64> = LieGroup::log(&here.attitude.between(&next.attitude));
                here.attitude * UnitQuaternion::from_scaled_axis(turn * along)
            }),
            velocity: line(VELOCITY, |row| row.velocity),
            rate: line(RATE, |row| row.rate),
            acceleration: line(ACCELERATION, |row| row.acceleration),
            rate_beside: line(ACCELERATION, |row| row.rate_beside),
            upward_beside: line(ACCELERATION, |row| row.upward_beside),
        };
        (row, found.map(|found| found.is_some()))
    }

    /// The measurements with each stream moved by whole rows: what a stream says late stands then where it belongs.
    pub(super) fn shifted(&self, shift: &[isize; 4]) -> (Vec<Row>, Vec<[bool; STREAMS]>) {
        if *shift == [0; 4] {
            return (self.rows.clone(), self.valid.clone());
        }
        let last = self.len().saturating_sub(1);
        if self.steps.iter().any(|step| (step - self.step_s).abs() > UNEVEN * self.step_s) {
            return (0..self.len()).map(|k| self.moved_in_time(k, shift)).unzip();
        }
        let from = |k: usize, by: isize| k.checked_add_signed(by).filter(|index| *index <= last);
        (0..self.len())
            .map(|k| {
                let [pose, velocity, rate, acceleration] = shift.map(|by| from(k, by));
                let at = |index: Option<usize>| (self.rows[index.unwrap_or(k)], index.map(|index| self.valid[index]));
                let (p, v, w, a) = (at(pose), at(velocity), at(rate), at(acceleration));
                let row = Row {
                    position: p.0.position,
                    attitude: p.0.attitude,
                    velocity: v.0.velocity,
                    rate: w.0.rate,
                    acceleration: a.0.acceleration,
                    rate_beside: a.0.rate_beside,
                    upward_beside: a.0.upward_beside,
                };
                let seen = |found: Option<[bool; STREAMS]>, stream: usize| found.is_some_and(|valid| valid[stream]);
                let valid = [
                    seen(p.1, POSITION),
                    seen(p.1, ATTITUDE),
                    seen(v.1, VELOCITY),
                    seen(w.1, RATE),
                    seen(a.1, ACCELERATION),
                ];
                (row, valid)
            })
            .unzip()
    }
}

/// Torque and force over the step that begins at sample `i`.
pub(super) fn held(
    record: &[MotionSample],
    beside: Option<&[Wrench<f64>]>,
    i: usize,
    timing: WrenchTiming,
) -> Option<(Vector3<f64>, Vector3<f64>)> {
    let all = |i: usize| {
        let wrench = record.get(i)?.wrench_body?;
        let beside = beside.map_or_else(Wrench::zero, |beside| beside[i]);
        Some((wrench.torque + beside.torque, wrench.force + beside.force))
    };
    let here = all(i)?;
    match (timing, all(i + 1)) {
        (WrenchTiming::Sampled, Some(next)) => Some(((here.0 + next.0) * 0.5, (here.1 + next.1) * 0.5)),
        _ => Some(here),
    }
}

/// Attitudes of a record without any pose, from its rates.
fn turned_by_rates(record: &[MotionSample]) -> Vec<Pose<f64>> {
    let mut pose = Pose::<f64>::identity();
    let mut before = record.first().map_or(0, |sample| sample.time_ns);
    record
        .iter()
        .map(|sample| {
            let step_s = sample.time_ns.saturating_sub(before) as f64 * 1e-9;
            before = sample.time_ns;
            let turn = sample.rate_body.unwrap_or_default() * step_s;
            pose.rotation *= <UnitQuaternion<f64> as LieGroup>::exp(&turn);
            pose
        })
        .collect()
}

/// The nearest whole number.
#[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)] // saturates
pub(super) fn whole(value: f64) -> usize {
    value.round().max(0.0) as usize
}
