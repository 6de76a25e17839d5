//! The search of a condensed problem by another road: matrices written out and a general solver, an oracle of the tests.
//!
//! Meant to check [`minimise`](super::minimise) against: it shares with it the problem and the conditions at which it ends,
//! nothing else. It allocates, and takes seconds where the other takes milliseconds.

use super::problem::CondensedProblem;
use super::sqp_settings::{SqpOutcome, SqpSettings, SqpStatus};
use crate::budget::Budget;
use clarabel::algebra::CscMatrix;
use clarabel::solver::{DefaultSettings, DefaultSolver, IPSolver, SolverStatus, SupportedConeT};

/// Gap and residuals at which the general solver ends.
const TOLERANCE: f64 = 1e-11;

/// What a step must gain of what its length promises.
const GAINED: f64 = 1e-4;

/// Shortest part of a step that is tried.
const SHORTEST: f64 = 1e-9;

/// Relative gain that rounding hides.
const ROUNDING: f64 = 1e-14;

/// The search gives up where an exact penalty would have to be larger.
const MOST_PENALTY: f64 = 1e6;

/// `minimise 1/2 x'Hx + g'x + penalty t + t^2/2` over `c + A x + t >= 0`, `t >= 0`, and `x` in a box.
struct ElasticProgram {
    /// Columns of `H`.
    curvature: Vec<Vec<f64>>,
    gradient: Vec<f64>,
    /// Rows of `A`, with their values `c`.
    rows: Vec<(Vec<f64>, f64)>,
    /// Least and largest entries of `x`.
    bounds: Vec<[f64; 2]>,
}

struct ElasticSolution {
    x: Vec<f64>,
    slack: f64,
    /// Of the rows.
    multipliers: Vec<f64>,
    /// Largest entry of `g - A' multipliers - multipliers of the box`.
    optimality: f64,
}

impl ElasticProgram {
    /// The program of the steps from `z`, the current point of a problem that has just been factorised.
    fn at(problem: &mut impl CondensedProblem, z: &[f64]) -> Self {
        let n = z.len();
        let curvature = (0..n).map(|i| {
            let (mut unit, mut column) = (vec![0.0; n], vec![0.0; n]);
            unit.iter_mut().skip(i).take(1).for_each(|entry| *entry = 1.0);
            problem.curvature_times(&unit, &mut column);
            column
        });
        let curvature = curvature.collect();
        let values = problem.row_values().to_vec();
        let rows = values.into_iter().enumerate().map(|(row, value)| {
            let mut normal = vec![0.0; n];
            problem.add_row(row, 1.0, &mut normal);
            (normal, value)
        });
        let rows = rows.collect();
        let bounds = z.iter().map(|z| [-1.0 - z, 1.0 - z]).collect();
        Self { curvature, gradient: problem.gradient().to_vec(), rows, bounds }
    }

    /// Its solution; none where the general solver finds none.
    fn solve(&self, penalty: f64) -> Option<ElasticSolution> {
        let (n, rows) = (self.gradient.len(), self.rows.len());
        // Unknowns `(x, t)`; rows, the slack, then both sides of the box.
        let mut quadratic = Columns::default();
        for (j, column) in self.curvature.iter().enumerate() {
            quadratic.push(column.iter().copied().enumerate().take(j + 1));
        }
        quadratic.push([(n, 1.0)]);
        let mut constraints = Columns::default();
        for j in 0..n {
            let normals = self.rows.iter().map(|(normal, _)| -normal.get(j).copied().unwrap_or(0.0)).enumerate();
            constraints.push(normals.chain([(rows + 1 + 2 * j, 1.0), (rows + 2 + 2 * j, -1.0)]));
        }
        constraints.push((0..=rows).map(|row| (row, -1.0)));
        let mut linear = self.gradient.clone();
        linear.push(penalty);
        let mut offsets: Vec<f64> = self.rows.iter().map(|(_, value)| *value).collect();
        offsets.push(0.0);
        offsets.extend(self.bounds.iter().flat_map(|[least, most]| [*most, -least]));
        if ![&linear, &offsets, &quadratic.values, &constraints.values]
            .iter()
            .all(|all| all.iter().all(|x| x.is_finite()))
        {
            return None;
        }
        let settings = DefaultSettings {
            verbose: false,
            max_threads: 1,
            tol_gap_abs: TOLERANCE,
            tol_gap_rel: TOLERANCE,
            tol_feas: TOLERANCE,
            ..DefaultSettings::default()
        };
        let cones = [SupportedConeT::NonnegativeConeT(offsets.len())];
        let (quadratic, constraints) = (quadratic.matrix(n + 1), constraints.matrix(offsets.len()));
        let mut solver = DefaultSolver::new(&quadratic, &linear, &constraints, &offsets, &cones, settings).ok()?;
        solver.solve();
        if !matches!(solver.solution.status, SolverStatus::Solved | SolverStatus::AlmostSolved) {
            return None;
        }
        let slack = solver.solution.x.get(n).copied()?;
        let x = solver.solution.x.get(..n)?.to_vec();
        let multipliers = solver.solution.z.get(..rows)?.to_vec();
        let (of_box, _) = solver.solution.z.get(rows + 1..)?.as_chunks::<2>();
        let mut left: Vec<f64> = self.gradient.iter().zip(of_box).map(|(g, [most, least])| g + most - least).collect();
        for ((normal, _), multiplier) in self.rows.iter().zip(&multipliers) {
            left.iter_mut().zip(normal).for_each(|(left, entry)| *left -= multiplier * entry);
        }
        let optimality = left.iter().fold(0.0, |most, entry| f64::max(most, entry.abs()));
        Some(ElasticSolution { x, slack, multipliers, optimality })
    }
}

/// A sparse matrix that grows by columns.
struct Columns {
    starts: Vec<usize>,
    indices: Vec<usize>,
    values: Vec<f64>,
}

impl Default for Columns {
    fn default() -> Self {
        Self { starts: vec![0], indices: Vec::new(), values: Vec::new() }
    }
}

impl Columns {
    fn push(&mut self, entries: impl IntoIterator<Item = (usize, f64)>) {
        for (row, value) in entries {
            if value != 0.0 {
                self.indices.push(row);
                self.values.push(value);
            }
        }
        self.starts.push(self.indices.len());
    }

    fn matrix(self, rows: usize) -> CscMatrix<f64> {
        CscMatrix::new(rows, self.starts.len() - 1, self.starts, self.indices, self.values)
    }
}

/// Searches for a minimum from `z` and leaves there the last point, as [`minimise`](super::minimise) does by other means: no
/// damping as long as the curvature is positive definite, no pairs, steps cut back along their line until they gain.
///
/// Of the settings, tolerance, feasibility, iterations and the penalty to begin with count.
///
/// # Source
/// Nocedal and Wright, Numerical Optimization, 18.3 and 18.5.
fn minimise_with_clarabel<P: CondensedProblem>(
    problem: &mut P,
    z: &mut [f64],
    settings: &SqpSettings,
    budget: &mut dyn Budget,
    units_per_iteration: u64,
) -> SqpOutcome {
    for input in z.iter_mut() {
        *input = input.clamp(-1.0, 1.0);
    }
    let mut penalty = settings.penalty;
    let mut multipliers = vec![0.0; problem.rows()];
    let mut trial = z.to_vec();
    let mut trial_rows = vec![0.0; problem.rows()];
    let mut outcome = SqpOutcome {
        status: SqpStatus::Stalled,
        cost: f64::INFINITY,
        optimality: f64::INFINITY,
        violation: f64::INFINITY,
        worst_row: None,
        iterations: 0,
        active: 0,
    };
    while problem.linearize(z) {
        (outcome.cost, outcome.optimality) = (problem.cost(), f64::INFINITY);
        (outcome.violation, outcome.worst_row) = worst(problem.row_values(), settings.feasibility);
        if outcome.iterations == settings.iterations {
            outcome.status = SqpStatus::IterationLimit;
            return outcome;
        }
        if !budget.spend(units_per_iteration) {
            outcome.status = SqpStatus::BudgetSpent;
            return outcome;
        }
        outcome.iterations += 1;
        let dampings = [0.0, 1e-6, 1e-4, 1e-2, 1.0];
        if !dampings.iter().any(|damping| problem.factorise(&multipliers, *damping)) {
            break;
        }
        let program = ElasticProgram::at(problem, z);
        let Some(solution) = program.solve(penalty) else { break };
        multipliers.clone_from(&solution.multipliers);
        outcome.optimality = solution.optimality;
        outcome.active = multipliers.iter().filter(|multiplier| **multiplier > settings.tolerance).count();
        if outcome.violation <= settings.feasibility && solution.optimality < settings.tolerance {
            outcome.status = SqpStatus::Converged;
            return outcome;
        }
        if solution.slack > settings.feasibility && solution.slack > 0.9 * outcome.violation {
            penalty *= 4.0;
            if penalty > MOST_PENALTY {
                break;
            }
            continue;
        }
        penalty = f64::max(penalty, 2.0 * multipliers.iter().sum::<f64>());

        let merit = |cost: f64, violation: f64| cost + (penalty + 0.5 * violation) * violation;
        let before = merit(outcome.cost, outcome.violation);
        // Twice what the step changes of the quadratic term is its own curvature.
        let along = |vector: &[f64]| vector.iter().zip(&solution.x).map(|(a, b)| a * b).sum::<f64>();
        let bend: f64 = program.curvature.iter().map(|column| along(column)).zip(&solution.x).map(|(a, b)| a * b).sum();
        let modelled = outcome.cost + along(&program.gradient) + 0.5 * bend;
        let promised = before - merit(modelled, f64::max(0.0, solution.slack));
        let gains = |length: &f64| {
            for ((trial, z), x) in trial.iter_mut().zip(&*z).zip(&solution.x) {
                *trial = (z + length * x).clamp(-1.0, 1.0);
            }
            let cost = problem.evaluate(&trial, &mut trial_rows);
            before - merit(cost, worst(&trial_rows, 0.0).0) >= GAINED * length * promised
        };
        let lengths = core::iter::successors(Some(1.0), |length| Some(0.5 * length));
        let found = lengths.take_while(|length| *length > SHORTEST).find(gains);
        if found.is_none() || promised <= ROUNDING * before.abs() {
            break;
        }
        z.copy_from_slice(&trial);
    }
    outcome
}

/// The largest violation, and its row where it counts.
fn worst(rows: &[f64], feasibility: f64) -> (f64, Option<usize>) {
    let violation = |value: f64| if value.is_nan() { f64::INFINITY } else { f64::max(0.0, -value) };
    let (mut most, mut at) = (0.0, None);
    for (row, value) in rows.iter().enumerate() {
        if violation(*value) > most {
            (most, at) = (violation(*value), Some(row));
        }
    }
    (most, at.filter(|_| most > feasibility))
}

#[cfg(test)]
mod tests {
    use super::super::quadratic_program::QuadraticProgram;
    use super::super::quasi_newton::CurvaturePairs;
    use super::super::shooting::tests::{inputs, with_terminal_radius};
    use super::super::toy_problem::ToyProblem;
    use super::super::{Criterion, SqpWorkspace, minimise};
    use super::*;
    use crate::budget::Units;
    use nalgebra::{DMatrix, DVector};
    use rand_chacha::ChaCha8Rng;
    use rand_core::SeedableRng;
    use tumble_identification::noise::signed_unit;

    const EXACT: SqpSettings = SqpSettings { tolerance: 1e-7, ..SqpSettings::COLD };

    /// A random program whose rows begin `at` least at this value.
    fn program(rng: &mut ChaCha8Rng, at: f64) -> ToyProblem {
        let (n, rows) = (14, 10);
        let root = DMatrix::from_fn(n, n, |_, _| signed_unit(rng));
        let h = &root * root.transpose() + DMatrix::identity(n, n) * 0.05;
        let g = DVector::from_fn(n, |_, _| 3.0 * signed_unit(rng));
        let a = DMatrix::from_fn(rows, n, |_, _| signed_unit(rng));
        let c = DVector::from_fn(rows, |_, _| at + 0.5 * signed_unit(rng).abs());
        ToyProblem::quadratic(h, g, c, a)
    }

    #[test]
    fn the_dual_active_set_solves_the_same_programs() {
        let mut rng = ChaCha8Rng::seed_from_u64(1);
        let (mut slacks, mut active) = (0, 0);
        for round in 0..60 {
            // Half of them have rows that ask for more than the box gives.
            let mut problem = program(&mut rng, if round % 2 == 0 { 0.0 } else { -6.0 });
            let z: Vec<f64> = (0..14).map(|_| signed_unit(&mut rng)).collect();
            let penalty = 0.5 + 3.0 * f64::from(round % 5);
            assert!(problem.linearize(&z) && problem.factorise(&[0.0; 10], 0.01));
            let expected = ElasticProgram::at(&mut problem, &z).solve(penalty).unwrap();

            let (mut other, mut pairs) = (QuadraticProgram::new(14, 10), CurvaturePairs::new(14, 4));
            pairs.build(&mut problem, 0.01);
            assert!(other.solve(&mut problem, &mut pairs, &z, penalty));
            for (a, b) in other.step().iter().zip(&expected.x) {
                assert!((a - b).abs() < 1e-7, "{a} {b}");
            }
            assert!((f64::max(0.0, other.slack()) - expected.slack).abs() < 1e-7);
            let mut multipliers = vec![0.0; 10];
            other.row_multipliers(&mut multipliers);
            for (a, b) in multipliers.iter().zip(&expected.multipliers) {
                assert!((a - b).abs() < 1e-6 * (1.0 + b), "{a} {b}");
            }
            slacks += usize::from(expected.slack > 1e-6);
            active += expected.multipliers.iter().filter(|multiplier| **multiplier > 1e-6).count();
        }
        assert!(slacks > 20 && slacks < 50 && active > 60, "{slacks} {active}");
    }

    #[test]
    fn both_roads_lead_to_the_same_plan() {
        for criterion in [Criterion::A, Criterion::D] {
            with_terminal_radius(0.8, criterion, |problem| {
                let mut z = inputs(1.0);
                let mut workspace = SqpWorkspace::new(z.len(), problem.rows());
                let mut budget = Units::new(u64::MAX);
                let expected = minimise(problem, &mut z, &EXACT, &mut workspace, &mut budget, 1);
                assert_eq!(expected.status, SqpStatus::Converged, "{expected:?}");

                let mut same = z.clone();
                let at_once = minimise_with_clarabel(problem, &mut same, &EXACT, &mut budget, 1);
                // The first curvature knows no multipliers yet.
                assert!(at_once.status == SqpStatus::Converged && at_once.iterations <= 2, "{at_once:?}");
                assert!((at_once.cost - expected.cost).abs() < 1e-9, "{at_once:?} {expected:?}");
                assert!(same.iter().zip(&z).all(|(a, b)| (a - b).abs() < 1e-6));

                let mut far = inputs(1.0);
                let settings = SqpSettings { tolerance: 1e-5, ..SqpSettings::COLD };
                let again = minimise_with_clarabel(problem, &mut far, &settings, &mut budget, 1);
                assert_eq!(again.status, SqpStatus::Converged, "{again:?}");
                assert!((again.cost - expected.cost).abs() < 1e-6, "{again:?} {expected:?}");
            });
        }
    }

    #[test]
    fn what_cannot_be_is_left_with_its_violation() {
        let a = DMatrix::from_row_slice(2, 2, &[1.0, 0.0, -1.0, 0.0]);
        let c = DVector::from_vec(vec![-0.2, -0.4]);
        let mut problem = ToyProblem::quadratic(DMatrix::identity(2, 2), DVector::from_vec(vec![-1.0, 0.5]), c, a);
        let mut z = [0.9, 0.9];
        let outcome = minimise_with_clarabel(&mut problem, &mut z, &EXACT, &mut Units::new(1000), 1);
        assert_eq!(outcome.status, SqpStatus::Stalled, "{outcome:?}");
        assert!((outcome.violation - 0.3).abs() < 1e-4 && outcome.worst_row.is_some(), "{outcome:?}");
        let mut units = Units::new(7);
        let outcome = minimise_with_clarabel(&mut problem, &mut [0.9, 0.9], &EXACT, &mut units, 4);
        assert_eq!((outcome.status, outcome.iterations, units.spent()), (SqpStatus::BudgetSpent, 1, 4));
    }
}
