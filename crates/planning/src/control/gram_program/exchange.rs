//! Room for a row that is a combination of the active ones, or the proof that there is none.

use super::GramStatus;
use super::search::{Programmed, REFINEMENTS, Search};
use super::workspace::Side;
use crate::vectors::{dot, largest};

/// Square of the share of a row that is new to the active ones, below which it counts as a combination of them even where that
/// leads nowhere; rounding leaves less.
const SURELY_DEPENDENT: f64 = 1e-13;
/// Share of the largest factor of a combination below which one counts as zero.
const VANISHING: f64 = 1e-10;
/// How many times as far as the solution so far a proof that there is none must reach.
const FAR: f64 = 1e3;

impl<P: Programmed> Search<'_, P> {
    /// Makes room for a violated row among the active ones it is a combination of, and takes it in; a status where that cannot be.
    pub(super) fn exchange(&mut self, row: usize, side: Side, sign: f64) -> Option<GramStatus> {
        let mut multiplier = 0.0;
        while !self.append(row, side, multiplier) {
            if !self.count() {
                return Some(GramStatus::Capped);
            }
            // Along this the solution stays, while the multiplier of the row grows.
            let workspace = &mut *self.workspace;
            workspace.target.iter_mut().for_each(|factor| *factor *= -sign);
            let vanishing = VANISHING * f64::max(1.0, largest(&workspace.target));
            let (mut length, mut leaving, mut steepest) = (f64::INFINITY, None, 0.0);
            for (position, (change, multiplier)) in workspace.target.iter().zip(&workspace.multipliers).enumerate() {
                let of_side = workspace.active[position].1.sign();
                let (change, multiplier) = (of_side * change, of_side * multiplier);
                if change < -vanishing {
                    let until = -multiplier / change;
                    if until < length || (until <= length && change < steepest) {
                        (length, leaving, steepest) = (until, Some(position), change);
                    }
                }
            }
            let Some(leaving) = leaving else {
                let is_proved = self.prove_infeasible(row, sign);
                if !is_proved && self.append_if_new(row, side, multiplier, SURELY_DEPENDENT) {
                    break;
                }
                return Some(if is_proved { GramStatus::Infeasible } else { GramStatus::Numerical });
            };
            for (change, multiplier) in workspace.target.iter().zip(&mut workspace.multipliers) {
                *multiplier += length * change;
            }
            multiplier += sign * length;
            self.remove(leaving);
        }
        None
    }

    /// That a row cannot hold together with the active ones, of which it is the combination in `target`: checked before it is said.
    fn prove_infeasible(&mut self, row: usize, sign: f64) -> bool {
        let mut left = self.combine(row, sign);
        for _ in 0..REFINEMENTS {
            // What is left of the combination is one of the same rows, but for what is new in this one.
            let (program, workspace) = (self.program, &mut *self.workspace);
            workspace.changes.clear();
            workspace
                .changes
                .extend(workspace.active.iter().map(|(row, _)| program.value(*row, &workspace.correction)));
            workspace.factor.solve(&mut workspace.changes);
            for (factor, change) in workspace.target.iter_mut().zip(&workspace.changes) {
                *factor -= change;
            }
            left = self.combine(row, sign);
        }
        let (program, workspace) = (self.program, &mut *self.workspace);
        let mut support = sign * if sign > 0.0 { workspace.upper[row] } else { workspace.lower[row] };
        workspace.certificate[row] = sign * program.scale(row);
        for ((row, side), factor) in workspace.active.iter().zip(&workspace.target) {
            if *factor != 0.0 && side.sign() * factor >= 0.0 {
                support += factor * if *factor > 0.0 { workspace.upper[*row] } else { workspace.lower[*row] };
                workspace.certificate[*row] = factor * program.scale(*row);
            }
        }
        program.times_hessian(&workspace.x, &mut workspace.correction);
        let distance = f64::sqrt(f64::max(0.0, dot(&workspace.x, &workspace.correction)));
        let is_proved = -support > FAR * (1.0 + distance) * left;
        if !is_proved {
            workspace.certificate.fill(0.0);
        }
        is_proved
    }

    /// Combines a row with the active ones by the factors in `target`, as far as their signs are right; the length of what that
    /// is, in `correction` by `H^-1`.
    fn combine(&mut self, row: usize, sign: f64) -> f64 {
        let (program, workspace) = (self.program, &mut *self.workspace);
        workspace.gradient.fill(0.0);
        workspace.correction.fill(0.0);
        let active = workspace.active.iter().zip(&workspace.target);
        let active = active.filter(|((_, side), factor)| side.sign() * **factor >= 0.0);
        for (row, factor) in active.map(|((row, _), factor)| (*row, *factor)).chain([(row, sign)]) {
            program.add_normal(row, factor, &mut workspace.gradient);
            program.add_column(row, factor, &mut workspace.correction);
        }
        f64::sqrt(f64::max(0.0, dot(&workspace.gradient, &workspace.correction)))
    }
}
