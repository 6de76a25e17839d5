//! What the solver sees of a planning problem.

/// A smooth cost over scaled inputs `z` in `[-1, 1]^n` with rows `c_r(z) >= 0`, its derivatives at one current point, and a
/// positive definite model of its curvature there.
///
/// A row is scaled so that one is its natural size (the limit over which it is measured).
pub trait CondensedProblem {
    /// Number of unknowns `n`.
    fn unknowns(&self) -> usize;

    /// Number of rows.
    fn rows(&self) -> usize;

    /// Cost at `z`, infinite where there is none, and the rows' values. The current point stays.
    fn evaluate(&mut self, z: &[f64], rows: &mut [f64]) -> f64;

    /// Makes `z` the current point and computes its derivatives; false where there is no such point.
    fn linearize(&mut self, z: &[f64]) -> bool;

    /// Cost at the current point.
    fn cost(&self) -> f64;

    /// Gradient of the cost at the current point.
    fn gradient(&self) -> &[f64];

    /// Values of the rows at the current point.
    fn row_values(&self) -> &[f64];

    /// Change of every row along `x`.
    fn rows_along(&mut self, x: &[f64], changes: &mut [f64]);

    /// Adds `factor` times the gradient of a row.
    fn add_row(&mut self, row: usize, factor: f64, gradient: &mut [f64]);

    /// Adds the gradients of all rows times `factors`.
    fn add_rows(&mut self, factors: &[f64], gradient: &mut [f64]);

    /// Factorises the model of the curvature of the Lagrangian at the current point with these multipliers (one per row, not
    /// negative), `damping` times the identity added; false where it is not positive definite.
    fn factorise(&mut self, multipliers: &[f64], damping: f64) -> bool;

    /// The factorised matrix times `x`.
    fn curvature_times(&mut self, x: &[f64], product: &mut [f64]);

    /// Solves with the factorised matrix in place.
    fn solve(&mut self, x: &mut [f64]);
}
