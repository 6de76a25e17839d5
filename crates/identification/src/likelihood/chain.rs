//! The segments of one record: nodes, wrench noise, normal matrices, and one Gauss-Newton step of all of them.

use super::calibration::Calibration;
use super::coordinates::{Coordinates, ParameterStep};
use super::drive::{Drive, Passage, drives};
use super::elimination::{
    CostToGo, Evidence, First, Gain, Indefinite, Posterior, Schur, Square, Stage, forward, recenter,
};
use super::flow::State;
use super::lanes::{NOISE, PARAMETERS};
use super::nodes;
use super::noise::Levels;
use super::record::{Doubt, Record, median};
use super::sample::Sample;
use super::segment::{GATE, MEASUREMENTS, Model, Robust, Rows, Tally, Tangent, normal_matrix, packed_len};
use crate::error::Column;
use crate::statistics::Whiteness;
use nalgebra::{SVector, Vector3, Vector6};

/// The columns of the measurement groups.
const COLUMNS: [Column; MEASUREMENTS] =
    [Column::Position, Column::Attitude, Column::Velocity, Column::Rate, Column::Acceleration];
/// Residuals are compared with so many of their successors.
const WHITENESS_DISTANCES: usize = 20;
/// Median of the square of a normal 3-vector.
const MEDIAN_OF_SQUARE: f64 = 2.365_974;

/// Everything a Gauss-Newton iteration changes, and its workspace.
pub(super) struct Chain<const W: usize> {
    pub(super) record: Record,
    gravity: Vector3<f64>,
    /// What acts on each sample after this passage.
    drives: Vec<Drive>,
    passage: Passage,
    /// First sample of each segment.
    pub(super) starts: Vec<usize>,
    pub(super) nodes: Vec<State>,
    pub(super) noise: Vec<[f64; 6]>,
    /// Groups measured at all.
    pub(super) groups: Vec<usize>,
    normals: Vec<f64>,
    transitions: Vec<Tangent<W>>,
    gains: Vec<Gain<W>>,
    /// Of segments that begin a stretch.
    firsts: Vec<Option<First<W>>>,
    rows: Rows<W>,
    cost_to_go: CostToGo<W>,
    /// What is known of the first state and the parameters from before the chain, about the present nodes.
    arrival: Box<Square<W>>,
    lanes: usize,
}

/// What a sweep over all segments found.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Sweep {
    pub(super) tally: Tally,
    /// Squares of the wrench noise of the segments in units of its prior's standard deviation (torque, force).
    pub(super) noise_squares: [f64; 2],
    /// Largest component by which a segment's end misses the next node.
    pub(super) largest_defect: f64,
}

impl<const W: usize> Chain<W> {
    pub(super) fn new(
        record: Record,
        gravity: Vector3<f64>,
        starts: Vec<usize>,
        nodes: Vec<State>,
        calibration: &Calibration,
    ) -> Self {
        let (segments, samples) = (starts.len(), &record.samples);
        let present = [
            true,
            true,
            samples.iter().any(|s| s.velocity.is_some()),
            samples.iter().any(|s| s.rate.is_some()),
            samples.iter().any(|s| s.acceleration.is_some()),
        ];
        let groups: Vec<usize> = (0..MEASUREMENTS).filter(|&group| present[group]).collect();
        let lanes = PARAMETERS + calibration.columns() + 1;
        let passage = calibration.passage();
        Self {
            drives: drives(samples, record.median_step_s, &passage),
            passage,
            gravity,
            starts,
            nodes,
            noise: vec![[0.0; 6]; segments],
            normals: vec![0.0; segments * groups.len() * packed_len(lanes)],
            groups,
            transitions: vec![[[[0.0; W]; 3]; 4]; segments],
            gains: vec![Gain::new(); segments],
            firsts: vec![None; segments],
            rows: Rows::new(),
            cost_to_go: CostToGo::new(lanes),
            arrival: Box::new([[0.0; W]; W]),
            lanes,
            record,
        }
    }

    /// End of segment `j`: one past its last sample.
    pub(super) fn end(&self, j: usize) -> usize {
        self.starts.get(j + 1).copied().unwrap_or_else(|| self.record.rows(&self.passage).end)
    }

    /// Of the prior of the wrench noise in segment `j`.
    fn precision(&self, j: usize, levels: &Levels) -> [f64; 6] {
        let samples = (self.end(j) - self.starts[j]) as f64;
        let doubt = self.record.doubt_at(self.starts[j], self.passage.shift_s);
        core::array::from_fn(|i| 1.0 / (levels.wrench[i / 3].powi(2) / samples + doubt.map_or(0.0, |extra| extra[i])))
    }

    /// What the last sweep and elimination say about the noise levels.
    pub(super) fn evidence(&self, schur: &Schur, levels: &Levels) -> Option<Evidence> {
        let (length, count) = (packed_len(self.lanes), self.groups.len());
        let mut evidence = Evidence::default();
        let mut posterior = Posterior::<W>::new(schur)?;
        for j in 0..self.starts.len() {
            if let Some(first) = &self.firsts[j] {
                posterior.enter(first);
            }
            posterior.with_noise(&self.gains[j]);
            let normals = &self.normals[j * count * length..][..count * length];
            for (&group, packed) in self.groups.iter().zip(normals.chunks_exact(length)) {
                let weight = levels.measurements[group].powi(-2);
                let (square, trace) = posterior.contract(packed);
                evidence.squares[group] += weight * square;
                evidence.absorbed[group] += weight * trace;
            }
            if self.record.doubt_at(self.starts[j], self.passage.shift_s).is_none() {
                evidence.wrench_counted += 3.0;
                for (i, precision) in self.precision(j, levels).into_iter().enumerate() {
                    let (step, variance) = posterior.noise(i);
                    evidence.wrench_squares[i / 3] += precision * (self.noise[j][i] + step).powi(2);
                    evidence.wrench_absorbed[i / 3] += precision * variance;
                }
            }
            posterior.advance(&self.gains[j], &self.transitions[j]);
        }
        Some(evidence)
    }

    /// Measurement levels that the residuals of the last sweep show, whatever a few of them do.
    pub(super) fn residual_levels(&mut self, levels: &mut Levels) {
        for &group in &self.groups {
            let mut squares: Vec<f64> = self.rows.residuals[group].iter().map(Vector3::norm_squared).collect();
            let level = (median(&mut squares) / MEDIAN_OF_SQUARE).sqrt();
            if level > 0.0 {
                levels.measurements[group] = level;
            }
        }
    }

    /// Whether the residuals of the last sweep are white, group by group; outliers count as nothing.
    pub(super) fn whiteness(&self, levels: &Levels) -> Vec<(Column, Whiteness)> {
        let judged = |&group: &usize| {
            let bound = (GATE * levels.measurements[group]).powi(2);
            let axis = |i: usize| -> Vec<f64> {
                let inlier = |r: &Vector3<f64>| if r.norm_squared() < bound { r[i] } else { 0.0 };
                self.rows.residuals[group].iter().map(inlier).collect()
            };
            let [x, y, z] = [axis(0), axis(1), axis(2)];
            Some((COLUMNS[group], Whiteness::of(&[&x, &y, &z], WHITENESS_DISTANCES, 0).ok()?))
        };
        self.groups.iter().filter_map(judged).collect()
    }

    /// The same states cut into other segments; those on rows that had none are taken from their poses.
    pub(super) fn resegmented(
        self,
        length: usize,
        (eta, calibration): (&Coordinates, &Calibration),
        node_window_s: f64,
    ) -> Self {
        let starts = self.record.segments(length, &calibration.passage());
        let samples = &self.record.samples;
        let from_poses = |starts: &[usize]| nodes::from_poses(&self.record, starts, node_window_s, &eta.center);
        let before = starts.partition_point(|start| self.starts.first().is_some_and(|first| start < first));
        let mut nodes = from_poses(&starts[..before]);
        let mut noise = vec![[0.0; 6]; before];
        let (body, mut wanted) = (eta.body(), starts[before..].iter().copied().peekable());
        let gravity = self.gravity + calibration.slope();
        for j in 0..self.starts.len() {
            let mut state = self.nodes[j];
            for (k, sample) in samples.iter().enumerate().take(self.end(j)).skip(self.starts[j]) {
                if wanted.next_if_eq(&k).is_some() {
                    nodes.push(state);
                    noise.push(self.noise[j]);
                }
                let input = calibration.input(&self.drives[k].input, &self.noise[j]);
                state = body.over(&state, &input, &gravity, sample.step_s);
            }
        }
        nodes.extend(from_poses(&starts[nodes.len()..]));
        noise.resize(starts.len(), [0.0; 6]);
        let mut chain = Self::new(self.record, self.gravity, starts, nodes, calibration);
        chain.noise = noise;
        chain.arrival = self.arrival;
        chain
    }

    /// Whether segment `j` ends a stretch: nothing ties its end to the next segment.
    fn is_last(&self, j: usize) -> bool {
        let end = self.end(j);
        end == self.record.rows(&self.passage).end || self.record.breaks.binary_search(&end).is_ok()
    }

    /// Rolls every segment out and adds up what its residuals say.
    pub(super) fn sweep(
        &mut self,
        eta: &Coordinates,
        calibration: &Calibration,
        levels: &Levels,
        robust: Option<Robust>,
    ) -> Sweep {
        self.sweep_first(self.starts.len(), eta, calibration, levels, robust)
    }

    /// Rolls the first `segments` out.
    pub(super) fn sweep_first(
        &mut self,
        segments: usize,
        eta: &Coordinates,
        calibration: &Calibration,
        levels: &Levels,
        robust: Option<Robust>,
    ) -> Sweep {
        let passage = calibration.passage();
        if self.passage != passage {
            self.drives = drives(&self.record.samples, self.record.median_step_s, &passage);
            self.passage = passage;
        }
        let mut sweep = Sweep::default();
        self.rows.restart();
        for j in 0..segments {
            self.sweep_segment(j, eta, calibration, levels, robust, &mut sweep);
        }
        sweep.tally = self.rows.tally;
        sweep
    }

    /// Rolls one segment out; gives what became of its residuals.
    pub(super) fn sweep_alone(
        &mut self,
        j: usize,
        eta: &Coordinates,
        calibration: &Calibration,
        levels: &Levels,
        robust: Option<Robust>,
    ) -> Tally {
        self.rows.restart();
        self.sweep_segment(j, eta, calibration, levels, robust, &mut Sweep::default());
        self.rows.tally
    }

    fn sweep_segment(
        &mut self,
        j: usize,
        eta: &Coordinates,
        calibration: &Calibration,
        levels: &Levels,
        robust: Option<Robust>,
        sweep: &mut Sweep,
    ) {
        let model = Model {
            samples: &self.record.samples,
            drives: &self.drives,
            gravity: self.gravity + calibration.slope(),
            body: eta.body(),
            calibration,
            sigma: levels.measurements,
            robust,
        };
        let (length, count) = (packed_len(self.lanes), self.groups.len());
        let (range, last) = (self.starts[j]..self.end(j), self.is_last(j));
        let precision = self.precision(j, levels);
        let tangent = &mut self.transitions[j];
        let end = model.roll(&self.nodes[j], &self.noise[j], range, last, &mut self.rows, tangent);
        let normals = &mut self.normals[j * count * length..][..count * length];
        for (&group, packed) in self.groups.iter().zip(normals.chunks_exact_mut(length)) {
            normal_matrix(&self.rows.groups[group], self.lanes, packed);
        }
        if !last {
            let defect = end.difference(&self.nodes[j + 1]);
            for (i, value) in defect.iter().enumerate() {
                tangent[i / 3][i % 3][self.lanes - 1] = *value;
                sweep.largest_defect = sweep.largest_defect.max(value.abs());
            }
        }
        for (i, value) in self.noise[j].iter().enumerate() {
            sweep.noise_squares[i / 3] += precision[i] * value * value;
        }
    }

    /// Eliminates states and noise under these levels.
    pub(super) fn eliminate(&mut self, levels: &Levels) -> Result<Schur, Indefinite> {
        self.eliminate_first(self.starts.len(), levels)
    }

    /// The same as if the record ended with the first `segments`.
    pub(super) fn eliminate_first(&mut self, segments: usize, levels: &Levels) -> Result<Schur, Indefinite> {
        self.eliminate_past(segments, levels, |_, _| {})
    }

    /// What the record says as a whole, and by itself from every `every`th segment on: last to first.
    pub(super) fn eliminate_parts(
        &mut self,
        every: usize,
        levels: &Levels,
    ) -> Result<(Schur, Vec<(usize, Schur)>), Indefinite> {
        let mut parts = Vec::new();
        let whole = self.eliminate_past(self.starts.len(), levels, |j, later| {
            if j > 0 && j.is_multiple_of(every) {
                parts.push((j, later.alone()));
            }
        })?;
        Ok((whole, parts))
    }

    /// Shows what follows from each segment on as it is passed.
    fn eliminate_past(
        &mut self,
        segments: usize,
        levels: &Levels,
        mut passed: impl FnMut(usize, &mut CostToGo<W>),
    ) -> Result<Schur, Indefinite> {
        let (length, count) = (packed_len(self.lanes), self.groups.len());
        let weights = self.weights(levels);
        self.cost_to_go.clear();
        for j in (0..segments).rev() {
            let tied = j + 1 < segments && !self.is_last(j);
            let stage = Stage {
                normals: &self.normals[j * count * length..][..count * length],
                weights: &weights[..count],
                noise: &self.noise[j],
                precision: &self.precision(j, levels),
                transition: tied.then(|| self.transitions[j].as_flattened()),
            };
            self.cost_to_go.eliminate(&stage, &mut self.gains[j])?;
            if j > 0 && self.is_last(j - 1) {
                self.firsts[j] = Some(self.cost_to_go.release());
            }
            passed(j, &mut self.cost_to_go);
        }
        self.cost_to_go.add(&self.arrival);
        let first = self.cost_to_go.release();
        if let Some(known) = self.firsts.first_mut() {
            *known = Some(first);
        }
        Ok(self.cost_to_go.schur())
    }

    /// Weights of the groups, in their order; the rest is not used.
    fn weights(&self, levels: &Levels) -> [f64; MEASUREMENTS] {
        let mut weights = [0.0; MEASUREMENTS];
        for (weight, &group) in weights.iter_mut().zip(&self.groups) {
            *weight = levels.measurements[group].powi(-2);
        }
        weights
    }

    /// Moves nodes and noise along with a step of the parameters; gives the largest component of a node's step.
    pub(super) fn follow(&mut self, step: &ParameterStep) -> f64 {
        let (nodes, noise) = (&mut self.nodes, &mut self.noise);
        let (mut largest, mut first): (f64, _) = (0.0, [0.0; 12]);
        forward(step.step.as_slice(), &self.firsts, &self.gains, &self.transitions, |j, z| {
            let change: [f64; 12] = core::array::from_fn(|i| z[i]);
            if j == 0 {
                first = change;
            }
            largest = change.iter().fold(largest, |largest, x| largest.max(x.abs()));
            nodes[j] = nodes[j].retracted(&change);
            for (value, change) in noise[j].iter_mut().zip(&z[NOISE..PARAMETERS]) {
                *value += change;
            }
        });
        recenter(&mut self.arrival, &first, step.moved.as_slice());
        largest
    }

    /// Adds independent knowledge of the parameters, which are now this far from where they are expected.
    pub(super) fn add_prior(&mut self, precision: &SVector<f64, 10>, away: &SVector<f64, 10>) {
        let last = self.lanes - 1;
        for (i, (value, away)) in precision.iter().zip(away.iter()).enumerate() {
            self.arrival[PARAMETERS + i][PARAMETERS + i] += value;
            self.arrival[PARAMETERS + i][last] += value * away;
            self.arrival[last][PARAMETERS + i] += value * away;
            self.arrival[last][last] += value * away * away;
        }
    }

    /// Appends a segment. Its first state is predicted, or, where nothing ties it to the chain, taken from its poses.
    pub(super) fn push(
        &mut self,
        samples: &[Sample],
        doubt: Option<Vector6<f64>>,
        after_break: bool,
        (eta, calibration): (&Coordinates, &Calibration),
        node_window_s: f64,
    ) {
        let start = self.record.samples.len();
        if let Some(variance) = doubt {
            self.record.doubts.push(Doubt { sample: start, variance });
        }
        self.record.samples.extend_from_slice(samples);
        // A drive looks back to the row before.
        let before = start.saturating_sub(1);
        let fresh = drives(&self.record.samples[before..], self.record.median_step_s, &self.passage);
        self.drives.extend_from_slice(&fresh[start - before..]);
        let predicted = match (self.starts.last(), self.nodes.last(), self.noise.last()) {
            (Some(&from), Some(node), Some(noise)) if !after_break => {
                let (body, gravity) = (eta.body(), self.gravity + calibration.slope());
                let rows = self.record.samples[from..start].iter().zip(&self.drives[from..start]);
                Some(rows.fold(*node, |state, (sample, drive)| {
                    body.over(&state, &calibration.input(&drive.input, noise), &gravity, sample.step_s)
                }))
            }
            _ => {
                self.record.breaks.push(start);
                None
            }
        };
        self.starts.push(start);
        match predicted {
            Some(node) => self.nodes.push(node),
            None => self.nodes.extend(nodes::from_poses(&self.record, &[start], node_window_s, &eta.center)),
        }
        self.noise.push([0.0; 6]);
        self.normals.resize(self.normals.len() + self.groups.len() * packed_len(self.lanes), 0.0);
        self.transitions.push([[[0.0; W]; 3]; 4]);
        self.gains.push(Gain::new());
        self.firsts.push(None);
    }

    /// Keeps the first `segments` only.
    pub(super) fn truncate(&mut self, segments: usize) {
        if let Some(&end) = self.starts.get(segments) {
            self.record.samples.truncate(end);
            self.drives.truncate(end);
            self.record.doubts.retain(|doubt| doubt.sample < end);
            self.record.breaks.retain(|first| *first < end);
            self.starts.truncate(segments);
            self.nodes.truncate(segments);
            self.noise.truncate(segments);
            self.normals.truncate(segments * self.groups.len() * packed_len(self.lanes));
            self.transitions.truncate(segments);
            self.gains.truncate(segments);
            self.firsts.truncate(segments);
        }
    }

    /// Sums up what the first `segments` say about what follows, as last swept, and forgets them.
    pub(super) fn marginalize(&mut self, segments: usize, levels: &Levels) -> Result<(), Indefinite> {
        let (length, count) = (packed_len(self.lanes), self.groups.len());
        let weights = self.weights(levels);
        for j in 0..segments {
            let stage = Stage {
                normals: &self.normals[j * count * length..][..count * length],
                weights: &weights[..count],
                noise: &self.noise[j],
                precision: &self.precision(j, levels),
                transition: (!self.is_last(j)).then(|| self.transitions[j].as_flattened()),
            };
            self.cost_to_go.arrive(&stage, &mut self.arrival, &mut self.gains[j])?;
        }
        let end = self.starts.get(segments).copied().unwrap_or(self.record.samples.len());
        self.record.samples.drain(..end);
        self.drives.drain(..end);
        self.record.doubts.retain(|doubt| doubt.sample >= end);
        for doubt in &mut self.record.doubts {
            doubt.sample -= end;
        }
        self.record.breaks.retain(|first| *first > end);
        for first in &mut self.record.breaks {
            *first -= end;
        }
        self.starts.drain(..segments);
        for start in &mut self.starts {
            *start -= end;
        }
        self.nodes.drain(..segments);
        self.noise.drain(..segments);
        self.normals.drain(..segments * count * length);
        self.transitions.drain(..segments);
        self.gains.drain(..segments);
        self.firsts.drain(..segments);
        Ok(())
    }

    /// Gives memory back that only the past of the chain needed.
    pub(super) fn shrink(&mut self) {
        self.record.wrenches = Vec::new();
        self.record.samples.shrink_to_fit();
        self.drives.shrink_to_fit();
        self.starts.shrink_to_fit();
        self.nodes.shrink_to_fit();
        self.noise.shrink_to_fit();
        self.normals.shrink_to_fit();
        self.transitions.shrink_to_fit();
        self.gains.shrink_to_fit();
        self.firsts.shrink_to_fit();
        self.rows = Rows::new();
    }
}
