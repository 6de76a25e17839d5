//! A fit at levels that are as wide as what is sought, none of them searched for.

use super::super::layout::STATES;
use super::{Fit, WRENCH_FLOOR, indefinite, solved};
use crate::error::IdentificationError;
use nalgebra::DMatrix;

/// Error of one sample of the wrench as a share of its root mean square: a thruster that is dead or stuck is off for seconds, and over these it
/// counts as much more than it does in a sample.
const WIDE: f64 = 0.1;
/// Sweeps at most, and the squared length of the last step in standard deviations.
const SWEEPS: usize = 12;
const AT_REST: f64 = 1.0;

impl Fit<'_> {
    /// Fits all but the levels; minus twice the logarithm of the likelihood there, but for what levels alone say.
    pub(in super::super) fn run_coarsely(&mut self) -> Result<f64, IdentificationError> {
        if self.of.wrench_noise.is_none() {
            self.levels.wrench = core::array::from_fn(|part| WIDE * self.floors[part] / WRENCH_FLOOR[part]);
        }
        for sweep in 0..SWEEPS {
            self.sweeps = sweep + 1;
            self.linearise();
            let (states, noises) = self.step()?;
            self.advance(&states, &noises);
            let moved = sweep > 0 && self.move_streams();
            if !moved && sweep > 1 && self.decrement < AT_REST {
                break;
            }
        }
        self.linearise();
        let form = self.chain.eliminate(0, self.segments, false);
        let (ny, n) = (self.chain.shape.eliminated(), STATES + self.free.len());
        let at = |i: usize, j: usize| form[i * ny + j];
        let mut joint = DMatrix::from_fn(n, n, at);
        let mut cross = DMatrix::from_fn(n, 1, |i, _| at(i, ny - 1));
        let mut cost = at(ny - 1, ny - 1);
        for (i, (column, prior)) in self.free.iter().zip(&self.prior).enumerate() {
            let apart = self.eta[*column] - self.mean[*column];
            joint[(STATES + i, STATES + i)] += prior;
            cross[STATES + i] += prior * apart;
            cost += prior * apart * apart;
        }
        let gone = solved(&joint, &cross).ok_or(indefinite(self.free.len()))?;
        Ok(cost - cross.dot(&gone))
    }

    /// Rows that weigh anything.
    pub(in super::super) fn weighing_rows(&self) -> usize {
        self.chain.weights.iter().flatten().filter(|weight| **weight > 0.0).count()
    }
}
