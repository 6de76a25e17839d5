//! What the solver sees of a planning problem.

/// A smooth cost over scaled inputs `z` in `[-1, 1]^n` with rows `c_r(z) >= 0`, its derivatives at one current point, and a
/// positive definite model of its curvature there.
///
/// A row is scaled so that one is its natural size (the limit over which it is measured).
///
/// # Example
/// ```
/// use tumble_planning::Units;
/// use tumble_planning::local::{CondensedProblem, SqpSettings, SqpStatus, SqpWorkspace, minimise};
///
/// /// (z - 0.7)^2, kept below a half by the row 0.5 - z >= 0.
/// struct Parabola {
///     at: f64,
///     gradient: [f64; 1],
///     row: [f64; 1],
///     curvature: f64,
/// }
/// impl CondensedProblem for Parabola {
///     fn unknowns(&self) -> usize {
///         1
///     }
///     fn rows(&self) -> usize {
///         1
///     }
///     fn evaluate(&mut self, z: &[f64], rows: &mut [f64]) -> f64 {
///         rows[0] = 0.5 - z[0];
///         (z[0] - 0.7).powi(2)
///     }
///     fn linearize(&mut self, z: &[f64]) -> bool {
///         (self.at, self.gradient, self.row) = (z[0], [2.0 * (z[0] - 0.7)], [0.5 - z[0]]);
///         true
///     }
///     fn cost(&self) -> f64 {
///         (self.at - 0.7).powi(2)
///     }
///     fn gradient(&self) -> &[f64] {
///         &self.gradient
///     }
///     fn row_values(&self) -> &[f64] {
///         &self.row
///     }
///     fn rows_along(&mut self, x: &[f64], changes: &mut [f64]) {
///         changes[0] = -x[0];
///     }
///     fn add_row(&mut self, _row: usize, factor: f64, gradient: &mut [f64]) {
///         gradient[0] -= factor;
///     }
///     fn add_rows(&mut self, factors: &[f64], gradient: &mut [f64]) {
///         gradient[0] -= factors[0];
///     }
///     fn factorise(&mut self, _multipliers: &[f64], damping: f64) -> bool {
///         self.curvature = 2.0 + damping;
///         true
///     }
///     fn curvature_times(&mut self, x: &[f64], product: &mut [f64]) {
///         product[0] = self.curvature * x[0];
///     }
///     fn solve(&mut self, x: &mut [f64]) {
///         x[0] /= self.curvature;
///     }
/// }
/// let mut problem = Parabola { at: 0.0, gradient: [0.0], row: [0.0], curvature: 2.0 };
/// let (mut z, mut workspace) = ([0.0], SqpWorkspace::new(1, 1));
/// let outcome = minimise(&mut problem, &mut z, &SqpSettings::COLD, &mut workspace, &mut Units::new(100), 1);
/// assert_eq!(outcome.status, SqpStatus::Converged);
/// assert!((z[0] - 0.5).abs() < 1e-6);
/// ```
/// Tutorial: [a plan whose curvature is one dense matrix](https://github.com/tumble-robotics/tumble/blob/main/xtask/studies/src/original_criterion.rs).
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
