//! The segments of one record: nodes, wrench noise, normal matrices, and one Gauss-Newton step of all of them.

use super::calibration::Calibration;
use super::coordinates::{Coordinates, ParameterStep};
use super::drive::{Drive, Passage, drives};
use super::elimination::{CostToGo, Evidence, First, Gain, Indefinite, Posterior, Schur, Stage, forward};
use super::flow::State;
use super::noise::Levels;
use super::record::{Record, median};
use super::segment::{MEASUREMENTS, Model, NOISE, PARAMETERS, Robust, Rows, Tally, Tangent, normal_matrix, packed_len};
use nalgebra::Vector3;

/// Median of the square of a normal 3-vector.
const MEDIAN_OF_SQUARE: f64 = 2.365_974;

/// Everything a Gauss-Newton iteration changes, and its workspace.
pub(super) struct Chain<'a, const W: usize> {
    record: &'a Record,
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

impl<'a, const W: usize> Chain<'a, W> {
    pub(super) fn new(
        record: &'a Record,
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
            record,
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
            lanes,
        }
    }

    /// End of segment `j`: one past its last sample.
    fn end(&self, j: usize) -> usize {
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
            let level = (median(&mut self.rows.squares[group]) / MEDIAN_OF_SQUARE).sqrt();
            if level > 0.0 {
                levels.measurements[group] = level;
            }
        }
    }

    /// The same states cut into other segments.
    pub(super) fn resegmented(self, length: usize, eta: &Coordinates, calibration: &Calibration) -> Self {
        let starts = self.record.segments(length, &calibration.passage());
        let samples = &self.record.samples;
        let (mut nodes, mut noise) = (Vec::with_capacity(starts.len()), Vec::with_capacity(starts.len()));
        let (body, mut wanted) = (eta.body(), starts.iter().copied().peekable());
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
        let (record, gravity) = (self.record, self.gravity);
        drop(self);
        let mut chain = Self::new(record, gravity, starts, nodes, calibration);
        chain.noise = noise;
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
        let passage = calibration.passage();
        if self.passage != passage {
            self.drives = drives(&self.record.samples, self.record.median_step_s, &passage);
            self.passage = passage;
        }
        let model = Model {
            samples: &self.record.samples,
            drives: &self.drives,
            gravity: self.gravity + calibration.slope(),
            body: eta.body(),
            calibration,
            sigma: levels.measurements,
            robust,
        };
        let mut sweep = Sweep::default();
        self.rows.restart();
        let (length, count) = (packed_len(self.lanes), self.groups.len());
        for j in 0..self.starts.len() {
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
        sweep.tally = self.rows.tally;
        sweep
    }

    /// Eliminates states and noise under these levels.
    pub(super) fn eliminate(&mut self, levels: &Levels) -> Result<Schur, Indefinite> {
        let (length, count) = (packed_len(self.lanes), self.groups.len());
        let weights: Vec<f64> = self.groups.iter().map(|&group| levels.measurements[group].powi(-2)).collect();
        self.cost_to_go.clear();
        for j in (0..self.starts.len()).rev() {
            let stage = Stage {
                normals: &self.normals[j * count * length..][..count * length],
                weights: &weights,
                noise: &self.noise[j],
                precision: &self.precision(j, levels),
                transition: (!self.is_last(j)).then(|| self.transitions[j].as_flattened()),
            };
            self.cost_to_go.eliminate(&stage, &mut self.gains[j])?;
            if j == 0 || self.is_last(j - 1) {
                self.firsts[j] = Some(self.cost_to_go.release());
            }
        }
        Ok(self.cost_to_go.schur())
    }

    /// Moves nodes and noise along with a step of the parameters; gives the largest component of a node's step.
    pub(super) fn follow(&mut self, step: &ParameterStep) -> f64 {
        let (nodes, noise) = (&mut self.nodes, &mut self.noise);
        let mut largest: f64 = 0.0;
        let step = step.step.as_slice();
        forward(step, &self.firsts, &self.gains, &self.transitions, |j, z| {
            let change: [f64; 12] = core::array::from_fn(|i| z[i]);
            largest = change.iter().fold(largest, |largest, x| largest.max(x.abs()));
            nodes[j] = nodes[j].retracted(&change);
            for (value, change) in noise[j].iter_mut().zip(&z[NOISE..PARAMETERS]) {
                *value += change;
            }
        });
        largest
    }
}
