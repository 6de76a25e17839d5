//! How likely the record is at the present levels, and whether lasting errors of the wrench make it likelier.

use super::super::layout::STATES;
use super::{Fit, LASTING_SHOWN, solved};
use nalgebra::{DMatrix, DVector};

/// Minus twice the logarithm of the likelihood, but for what the white levels of the measurements alone say, in two parts.
pub(super) struct Likelihood {
    /// What is left at the best motion and parameters, priors counted, in squared standard deviations.
    pub(super) cost: f64,
    /// Logarithm of the determinant of the information of all that was sought.
    pub(super) log_determinant: f64,
}

impl Fit<'_> {
    /// At the point where the chain was linearised; none where the record fixes nothing.
    pub(super) fn likelihood(&mut self) -> Option<Likelihood> {
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
        let gone = solved(&joint, &cross)?;
        // In units of its diagonal: what is measured in other units does not decide whether it can be factored.
        let scale = DVector::from_fn(n, |i, _| joint[(i, i)].abs().max(f64::MIN_POSITIVE).sqrt());
        let scaled = DMatrix::from_fn(n, n, |i, j| joint[(i, j)] / (scale[i] * scale[j]));
        let of_joint = scaled.cholesky().map(|factor| factor.l_dirty().diagonal().component_mul(&scale))?;
        let logarithms = of_joint.iter().map(|pivot| pivot.ln()).sum::<f64>() + self.chain.log_pivots();
        Some(Likelihood { cost: cost - cross.dot(&gone), log_determinant: 2.0 * logarithms })
    }

    /// Does without lasting errors of torque or force where the record is as likely without them; whether that left any out.
    ///
    /// The level of the white errors stays, or stands for both: levels that still move when this is asked are otherwise not compared fairly.
    pub(super) fn forget_lasting(&mut self) -> bool {
        let total = |this: &mut Self, lasting: [f64; 2], white: [f64; 2]| {
            this.levels.lasting = lasting;
            this.take_white_wrench(white);
            this.linearise();
            this.likelihood().map_or(f64::INFINITY, |of| of.cost + of.log_determinant)
        };
        let (mut lasting, mut white, mut forgot) = (self.levels.lasting, self.levels.wrench, false);
        let mut with = total(self, lasting, white);
        for part in 0..2 {
            if lasting[part] == 0.0 {
                continue;
            }
            let (mut fewer, mut wider) = (lasting, white);
            fewer[part] = 0.0;
            wider[part] = white[part].hypot(lasting[part] * (self.samples as f64).sqrt());
            for white_alone in [white, wider] {
                let without = total(self, fewer, white_alone);
                if without < with + LASTING_SHOWN {
                    (lasting, white, with, forgot) = (fewer, white_alone, without, true);
                    break;
                }
            }
        }
        self.levels.lasting = lasting;
        self.take_white_wrench(white);
        forgot
    }
}
