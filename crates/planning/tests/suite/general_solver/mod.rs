//! The same program by another road: an interior point method with the matrices written out.
//!
//! Meant to check `GramProgram` against: it shares nothing with it.

use clarabel::algebra::CscMatrix;
use clarabel::solver::{DefaultSettings, DefaultSolver, IPSolver, SolverStatus, SupportedConeT};

/// Gap and residuals at which the general solver ends.
const TOLERANCE: f64 = 1e-12;

/// What the general solver found.
#[derive(Clone, Debug, PartialEq)]
pub struct GramOptimum {
    /// Best `x`.
    pub x: Vec<f64>,
    /// Value at it.
    pub cost: f64,
}

/// Minimises `1/2 x' H x + f . x` over `lower <= A x <= upper`, matrices row by row; `None` where no `x` fulfils all rows.
///
/// # Errors
/// The status of the general solver where it comes to no end.
pub fn solve_gram_with_clarabel(
    hessian: &[f64],
    linear: &[f64],
    rows: &[f64],
    lower: &[f64],
    upper: &[f64],
    equality: &[bool],
) -> Result<Option<GramOptimum>, SolverStatus> {
    let (n, m) = (linear.len(), equality.len());
    assert_eq!([hessian.len(), rows.len(), lower.len(), upper.len()], [n * n, m * n, m, m]);
    assert!(hessian.iter().chain(linear).chain(rows).all(|entry| entry.is_finite()));
    // Rows of the general form `s = offset - normal . x` in their cone: equations first.
    let normal = |row: usize| &rows[row * n..][..n];
    let mut conditions: Vec<(f64, usize, f64)> =
        (0..m).filter(|row| equality[*row]).map(|row| (1.0, row, 0.5 * (lower[row] + upper[row]))).collect();
    let equations = conditions.len();
    for row in (0..m).filter(|row| !equality[*row]) {
        for (sign, bound) in [(1.0, upper[row]), (-1.0, lower[row])] {
            if bound.is_infinite() && bound * sign < 0.0 {
                return Ok(None);
            }
            if bound.is_finite() {
                conditions.push((sign, row, sign * bound));
            }
        }
    }
    let columns = |entry: &dyn Fn(usize, usize) -> f64, rows: usize, is_upper: bool| {
        let (mut starts, mut indices, mut values) = (vec![0], Vec::new(), Vec::new());
        for column in 0..n {
            for row in 0..if is_upper { column + 1 } else { rows } {
                let value = entry(row, column);
                if value != 0.0 {
                    indices.push(row);
                    values.push(value);
                }
            }
            starts.push(indices.len());
        }
        CscMatrix::new(rows, n, starts, indices, values)
    };
    let quadratic = columns(&|i, j| hessian[i * n + j], n, true);
    let constraints = columns(&|i, j| conditions[i].0 * normal(conditions[i].1)[j], conditions.len(), false);
    let offsets: Vec<f64> = conditions.iter().map(|(_, _, offset)| *offset).collect();
    let cones = [SupportedConeT::ZeroConeT(equations), SupportedConeT::NonnegativeConeT(conditions.len() - equations)];
    let settings = DefaultSettings {
        verbose: false,
        max_threads: 1,
        tol_gap_abs: TOLERANCE,
        tol_gap_rel: TOLERANCE,
        tol_feas: TOLERANCE,
        ..DefaultSettings::default()
    };
    let mut solver = DefaultSolver::new(&quadratic, linear, &constraints, &offsets, &cones, settings).unwrap();
    solver.solve();
    match solver.solution.status {
        SolverStatus::Solved | SolverStatus::AlmostSolved => {
            let (x, cost) = (solver.solution.x.clone(), solver.solution.obj_val);
            Ok(Some(GramOptimum { x, cost }))
        }
        SolverStatus::PrimalInfeasible | SolverStatus::AlmostPrimalInfeasible => Ok(None),
        status => Err(status),
    }
}
