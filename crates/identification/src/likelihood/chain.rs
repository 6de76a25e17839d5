//! The segments of one record: nodes, wrench noise, normal matrices, and one Gauss-Newton step of all of them.

use super::calibration::Calibration;
use super::coordinates::{Coordinates, ParameterStep};
use super::elimination::{CostToGo, Gain, Indefinite, Schur, Stage, forward};
use super::flow::State;
use super::noise::Levels;
use super::segment::{
    MEASUREMENTS, Model, NOISE, PARAMETERS, Robust, Rows, Sample, Tally, Tangent, normal_matrix, packed_len,
};
use nalgebra::Vector3;

/// Everything a Gauss-Newton iteration changes, and its workspace.
pub(crate) struct Chain<'a, const W: usize> {
    samples: &'a [Sample],
    gravity: Vector3<f64>,
    /// First sample of each segment.
    pub(crate) starts: Vec<usize>,
    pub(crate) nodes: Vec<State>,
    pub(crate) noise: Vec<[f64; 6]>,
    /// Groups measured at all.
    pub(crate) groups: Vec<usize>,
    normals: Vec<f64>,
    transitions: Vec<Tangent<W>>,
    gains: Vec<Gain<W>>,
    rows: Rows<W>,
    cost_to_go: CostToGo<W>,
    lanes: usize,
}

/// What a sweep over all segments found.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Sweep {
    pub(crate) tally: Tally,
    /// Squares of the wrench noise of the segments in units of its prior's standard deviation (torque, force).
    pub(crate) noise_squares: [f64; 2],
    /// Largest component by which a segment's end misses the next node.
    pub(crate) largest_defect: f64,
}

impl<'a, const W: usize> Chain<'a, W> {
    pub(crate) fn new(
        samples: &'a [Sample],
        gravity: Vector3<f64>,
        starts: Vec<usize>,
        nodes: Vec<State>,
        calibration: &Calibration,
    ) -> Self {
        let segments = starts.len();
        let present = [
            true,
            true,
            samples.iter().any(|s| s.velocity.is_some()),
            samples.iter().any(|s| s.rate.is_some()),
            samples.iter().any(|s| s.acceleration.is_some()),
        ];
        let groups: Vec<usize> = (0..MEASUREMENTS).filter(|&group| present[group]).collect();
        let lanes = PARAMETERS + calibration.columns() + 1;
        Self {
            samples,
            gravity,
            starts,
            nodes,
            noise: vec![[0.0; 6]; segments],
            normals: vec![0.0; segments * groups.len() * packed_len(lanes)],
            groups,
            transitions: vec![[[[0.0; W]; 3]; 4]; segments],
            gains: vec![Gain::new(); segments],
            rows: Rows::new(),
            cost_to_go: CostToGo::new(lanes),
            lanes,
        }
    }

    /// End of segment `j`: one past its last sample.
    fn end(&self, j: usize) -> usize {
        self.starts.get(j + 1).copied().unwrap_or(self.samples.len())
    }

    /// Rolls every segment out and adds up what its residuals say.
    pub(crate) fn sweep(
        &mut self,
        eta: &Coordinates,
        calibration: &Calibration,
        levels: &Levels,
        robust: Option<Robust>,
    ) -> Sweep {
        let model = Model {
            samples: self.samples,
            gravity: self.gravity,
            body: eta.body(),
            calibration,
            sigma: levels.measurements,
            robust,
        };
        let mut sweep = Sweep::default();
        let (length, count) = (packed_len(self.lanes), self.groups.len());
        for j in 0..self.starts.len() {
            let (range, last) = (self.starts[j]..self.end(j), j + 1 == self.starts.len());
            let samples = range.len() as f64;
            let tangent = &mut self.transitions[j];
            let end =
                model.roll(&self.nodes[j], &self.noise[j], range, last, &mut self.rows, tangent, &mut sweep.tally);
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
                sweep.noise_squares[i / 3] += samples * (value / levels.wrench[i / 3]).powi(2);
            }
        }
        sweep
    }

    /// Eliminates states and noise under these levels.
    pub(crate) fn eliminate(&mut self, levels: &Levels) -> Result<Schur<W>, Indefinite> {
        let (length, count) = (packed_len(self.lanes), self.groups.len());
        let weights: Vec<f64> = self.groups.iter().map(|&group| levels.measurements[group].powi(-2)).collect();
        self.cost_to_go.clear();
        for j in (0..self.starts.len()).rev() {
            let samples = (self.end(j) - self.starts[j]) as f64;
            let stage = Stage {
                normals: &self.normals[j * count * length..][..count * length],
                weights: &weights,
                noise: &self.noise[j],
                precision: &core::array::from_fn(|i| samples / levels.wrench[i / 3].powi(2)),
                transition: (j + 1 < self.starts.len()).then(|| self.transitions[j].as_flattened()),
            };
            self.cost_to_go.eliminate(&stage, &mut self.gains[j])?;
        }
        self.cost_to_go.finish()
    }

    /// Moves nodes and noise along with a step of the parameters; gives the largest component of a node's step.
    pub(crate) fn follow(&mut self, schur: &Schur<W>, step: &ParameterStep) -> f64 {
        let (nodes, noise) = (&mut self.nodes, &mut self.noise);
        let mut largest: f64 = 0.0;
        let step = step.step.as_slice();
        forward(schur.first_state(step), step, &self.gains, &self.transitions, |j, z| {
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
