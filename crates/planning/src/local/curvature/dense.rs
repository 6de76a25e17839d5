//! Factorisation of the matrix as a whole.

use super::cholesky::LowerTriangle;
use super::small::{add, add_transpose_product, product};
use crate::local::Stages;

/// Cholesky factor of `H + damping I`.
#[derive(Clone, Debug)]
pub(super) struct Dense<const X: usize, const U: usize> {
    matrix: LowerTriangle,
    /// Change of the nodes after a step by that step's input.
    changes: Vec<[[f64; U]; X]>,
}

impl<const X: usize, const U: usize> Dense<X, U> {
    /// Room for a horizon.
    pub(super) fn new(steps: usize) -> Self {
        Self { matrix: LowerTriangle::new(steps * U), changes: Vec::with_capacity(steps) }
    }

    /// Factorises consistent stages; false where the matrix is not positive definite.
    pub(super) fn factorise(&mut self, stages: &Stages<X, U>, damping: f64) -> bool {
        self.matrix.clear(stages.unknowns());
        for step in 0..stages.by_input.len() {
            self.condense(stages, step);
        }
        for (step, curvature) in stages.input_curvature.iter().enumerate() {
            for (i, (row, entries)) in self.matrix.block_rows(step * U, U).zip(curvature).enumerate() {
                let Some(row) = row.get_mut(step * U..) else { return false };
                row.iter_mut().zip(entries).for_each(|(to, entry)| *to += entry);
                if let Some(diagonal) = row.get_mut(i) {
                    *diagonal += damping;
                }
            }
        }
        self.matrix.add_squares(&stages.arrow);
        self.matrix.factorise()
    }

    /// The columns of one step's input, from its own rows down: the changes it makes forward in time, what they cost backward.
    fn condense(&mut self, stages: &Stages<X, U>, step: usize) {
        let (Some(by_state), Some(by_input), Some(of_state)) =
            (stages.by_state.get(step..), stages.by_input.get(step..), stages.state_curvature.get(step..))
        else {
            return;
        };
        let Some(mut change) = by_input.first().copied() else { return };
        self.changes.clear();
        self.changes.push(change);
        for by_state in by_state.iter().skip(1) {
            change = product(by_state, &change);
            self.changes.push(change);
        }
        let mut costate = [[0.0; U]; X];
        let backward = by_state.iter().zip(by_input).zip(of_state).zip(&self.changes).enumerate().rev();
        for (later, (((by_state, by_input), of_state), change)) in backward {
            add(&product(of_state, change), &mut costate);
            let mut block = [[0.0; U]; U];
            add_transpose_product(by_input, &costate, &mut block);
            for (row, entries) in self.matrix.block_rows((step + later) * U, U).zip(&block) {
                if let Some(to) = row.get_mut(step * U..(step + 1) * U) {
                    to.copy_from_slice(entries);
                }
            }
            let mut earlier = [[0.0; U]; X];
            add_transpose_product(by_state, &costate, &mut earlier);
            costate = earlier;
        }
    }

    /// Solves in place.
    pub(super) fn solve(&mut self, x: &mut [f64]) {
        self.matrix.solve_lower(x);
        self.matrix.solve_upper(x);
    }
}
