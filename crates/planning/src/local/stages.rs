//! The quadratic model of a plan, stage by stage, with the few columns that tie all stages together.

use super::model::Array2;

/// `1/2 z' H z` for inputs `z` in units of their limits: the change of node `k + 1` is
/// `by_state[k] * (change of node k) + by_input[k] * z_k`, that of node 0 is zero, and
/// `H = sum over nodes of state curvature + input curvature + arrow * arrow'`.
#[derive(Clone, Debug, PartialEq)]
pub struct Stages<const X: usize, const U: usize> {
    /// One for each step.
    pub by_state: Vec<Array2<X, X>>,
    /// One for each step, by the scaled input.
    pub by_input: Vec<Array2<X, U>>,
    /// Of nodes 1 to N: symmetric, positive semidefinite.
    pub state_curvature: Vec<Array2<X, X>>,
    /// Of each step: symmetric, positive definite.
    pub input_curvature: Vec<Array2<U, U>>,
    /// Columns of length `N U`, one after the other.
    pub arrow: Vec<f64>,
}

impl<const X: usize, const U: usize> Stages<X, U> {
    /// A horizon of `steps`, everything zero, room for `columns` columns.
    pub fn new(steps: usize, columns: usize) -> Self {
        Self {
            by_state: vec![[[0.0; X]; X]; steps],
            by_input: vec![[[0.0; U]; X]; steps],
            state_curvature: vec![[[0.0; X]; X]; steps],
            input_curvature: vec![[[0.0; U]; U]; steps],
            arrow: Vec::with_capacity(columns * steps * U),
        }
    }

    /// Number of unknowns.
    pub fn unknowns(&self) -> usize {
        self.by_input.len() * U
    }

    /// Columns of the arrow.
    pub fn arrow_columns(&self) -> impl ExactSizeIterator<Item = &[f64]> {
        self.arrow.chunks_exact(self.unknowns().max(1))
    }

    /// Whether every step has all its parts, and every column all its entries.
    pub fn is_consistent(&self) -> bool {
        let steps = self.by_input.len();
        let lengths = [self.by_state.len(), self.state_curvature.len(), self.input_curvature.len()];
        lengths.iter().all(|length| *length == steps) && self.arrow.len().is_multiple_of(self.unknowns().max(1))
    }
}
