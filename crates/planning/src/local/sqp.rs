//! Sequential quadratic programming from any start.

use super::problem::CondensedProblem;
use super::quadratic_program::QuadraticProgram;
use super::quasi_newton::CurvaturePairs;
use super::sqp_settings::{MOST_PAIRS, SqpOutcome, SqpSettings, SqpStatus};
use crate::budget::Budget;
use crate::vectors::{dot, largest};

/// Share of the predicted decrease below which a step is not taken.
const ACCEPTED: f64 = 1e-3;
/// The same below which the damping grows, and above which it falls.
const POOR: f64 = 0.25;
const GOOD: f64 = 0.5;
/// Damping below which there is none, and beyond which no step is left.
const LEAST_DAMPING: f64 = 1e-6;
const MOST_DAMPING: f64 = 1e8;
/// Penalty beyond which rows that are still violated have no point in common.
const MOST_PENALTY: f64 = 1e6;
/// Share of the violation that no linear step undoes, and how many such steps in a row raise the penalty.
const STUCK: f64 = 0.9;
const MOST_STUCK: u32 = 3;
/// How often a search that has converged to less than it has met goes back there.
const MOST_RETURNS: u32 = 2;
/// Relative differences of the merit that are rounding.
const ROUNDING: f64 = 1e-14;

/// The memory of a search, and what it remembers for the next one: what was active, and the multipliers.
#[derive(Clone, Debug)]
pub struct SqpWorkspace {
    program: QuadraticProgram,
    pairs: CurvaturePairs,
    /// Multipliers of the rows, of the last step taken.
    multipliers: Vec<f64>,
    row_values: Vec<f64>,
    current: Vec<f64>,
    trial: Vec<f64>,
    corrected: Vec<f64>,
    /// Gradient of the Lagrangian of the rows at the current point, and what is left of it by the bounds.
    lagrangian: Vec<f64>,
    residual: Vec<f64>,
}

impl SqpWorkspace {
    /// Room for so many unknowns and rows.
    pub fn new(unknowns: usize, rows: usize) -> Self {
        let vector = vec![0.0; unknowns];
        Self {
            program: QuadraticProgram::new(unknowns, rows),
            pairs: CurvaturePairs::new(unknowns, MOST_PAIRS),
            multipliers: vec![0.0; rows],
            row_values: vec![0.0; rows],
            current: vector.clone(),
            trial: vector.clone(),
            corrected: vector.clone(),
            lagrangian: vector.clone(),
            residual: vector,
        }
    }

    /// Room for so many unknowns and rows, with nothing remembered. Allocates only where the numbers have changed.
    pub fn prepare(&mut self, unknowns: usize, rows: usize) {
        if self.current.len() == unknowns && self.row_values.len() == rows {
            self.forget();
        } else {
            *self = Self::new(unknowns, rows);
        }
    }

    /// Forgets what the last search left: the next one depends on its start alone.
    pub fn forget(&mut self) {
        self.program.forget();
        self.multipliers.fill(0.0);
    }
}

/// Value of a point.
#[derive(Clone, Copy, Debug)]
struct Value {
    cost: f64,
    violation: f64,
    worst_row: Option<usize>,
}

impl Value {
    fn of(cost: f64, rows: &[f64]) -> Self {
        let mut value = Self { cost, violation: 0.0, worst_row: None };
        for (row, row_value) in rows.iter().enumerate() {
            let violation = if row_value.is_nan() { f64::INFINITY } else { -row_value };
            if violation > value.violation {
                (value.violation, value.worst_row) = (violation, Some(row));
            }
        }
        value
    }

    /// Exact penalty of the largest violation, as in the quadratic program of a step.
    fn merit(&self, penalty: f64) -> f64 {
        self.cost + (penalty + 0.5 * self.violation) * self.violation
    }

    fn is_better_than(&self, other: &Self, feasibility: f64) -> bool {
        match (self.violation <= feasibility, other.violation <= feasibility) {
            (true, true) => self.cost < other.cost,
            (false, false) => self.violation < other.violation,
            (is_feasible, _) => is_feasible && self.cost.is_finite(),
        }
    }
}

/// What is adapted from step to step.
#[derive(Clone, Copy, Debug)]
struct Control {
    damping: f64,
    penalty: f64,
    /// Steps in a row that left the violation as it was.
    stuck: u32,
}

impl Control {
    fn damp(&mut self, least: f64) {
        self.damping = f64::max(4.0 * self.damping, least);
    }

    /// After a step that gained this share of what was predicted.
    fn accept(&mut self, ratio: f64, is_stuck: bool) {
        if ratio > GOOD {
            let damping = 0.2 * self.damping;
            self.damping = if damping < LEAST_DAMPING { 0.0 } else { damping };
        } else if ratio < POOR {
            self.damp(1e-4);
        }
        self.stuck = if is_stuck { self.stuck + 1 } else { 0 };
        if self.stuck == MOST_STUCK {
            (self.penalty, self.stuck) = (4.0 * self.penalty, 0);
        }
    }
}

/// Searches for a minimum from `z` and leaves there the best point met: of those that violate no row, the one of least cost,
/// or else the least violating. A point at which the search converges is the best, unless it costs more by more than the tolerance
/// than a better one that was met.
///
/// Each iteration asks the budget for `units_per_iteration`. Nothing is allocated.
///
/// # Source
/// Sequential quadratic programming with an exact penalty of the largest violation, damped steps and second-order corrections:
/// Fletcher, Practical Methods of Optimization, 14.3 and 14.4; Nocedal and Wright, Numerical Optimization, 18.5.
pub fn minimise<P: CondensedProblem>(
    problem: &mut P,
    z: &mut [f64],
    settings: &SqpSettings,
    workspace: &mut SqpWorkspace,
    budget: &mut dyn Budget,
    units_per_iteration: u64,
) -> SqpOutcome {
    let SqpWorkspace { program, pairs, multipliers, row_values, current, trial, corrected, lagrangian, residual } =
        workspace;
    for input in z.iter_mut() {
        *input = input.clamp(-1.0, 1.0);
    }
    pairs.clear();
    current.copy_from_slice(z);
    let mut value = if problem.linearize(z) {
        Value::of(problem.cost(), problem.row_values())
    } else {
        Value { cost: f64::INFINITY, violation: f64::INFINITY, worst_row: None }
    };
    let (mut best, mut best_optimality, mut is_current_best) = (value, None, true);
    let mut control = Control { damping: settings.damping, penalty: settings.penalty, stuck: 0 };
    let (mut iterations, mut last_optimality, mut is_restarted, mut returns) = (0, f64::INFINITY, false, 0);
    let status = loop {
        let merit = value.merit(control.penalty);
        if !merit.is_finite() || control.damping > MOST_DAMPING || control.penalty > MOST_PENALTY {
            break SqpStatus::Stalled;
        }
        if iterations == settings.iterations {
            break SqpStatus::IterationLimit;
        }
        if !budget.spend(units_per_iteration) {
            break SqpStatus::BudgetSpent;
        }
        iterations += 1;
        if !problem.factorise(multipliers, control.damping) {
            control.damp(1e-4);
            continue;
        }
        pairs.build(problem, control.damping);
        if !program.solve(problem, pairs, current, control.penalty) {
            control.damp(1e-4);
            continue;
        }
        let slack = f64::max(0.0, program.slack());
        program.row_multipliers(multipliers);
        gradient_of_lagrangian(problem, multipliers, lagrangian);
        residual.copy_from_slice(lagrangian);
        program.subtract_bounds(residual);
        let optimality = largest(residual);
        if is_current_best {
            best_optimality = Some(optimality);
        }
        let is_feasible = value.violation <= settings.feasibility;
        if is_feasible && optimality < settings.tolerance {
            // A valley may be left through points that violate rows, at a penalty too low to forbid it: back, with what it has
            // grown to.
            let is_worse = best.violation <= settings.feasibility
                && value.cost > best.cost + settings.tolerance * best.cost.abs().max(1.0);
            if is_worse && returns < MOST_RETURNS {
                returns += 1;
                if !problem.linearize(z) {
                    break SqpStatus::Stalled;
                }
                current.copy_from_slice(z);
                (value, best_optimality, is_current_best) = (best, None, true);
                (control.damping, control.penalty) = (f64::max(settings.damping, 0.01), 4.0 * control.penalty);
                (last_optimality, is_restarted) = (f64::INFINITY, false);
                pairs.clear();
                continue;
            }
            if is_worse {
                break SqpStatus::Stalled;
            }
            z.copy_from_slice(current);
            (best, best_optimality) = (value, Some(optimality));
            break SqpStatus::Converged;
        }

        let step = program.step();
        // The matrix, with its damping, times the step is the negative residual.
        let curvature = -dot(step, residual) - control.damping * dot(step, step);
        let predicted = -dot(problem.gradient(), step) - 0.5 * curvature
            + control.penalty * (value.violation - slack)
            + 0.5 * (value.violation * value.violation - slack * slack);
        let rounding = ROUNDING * merit.abs();
        if is_feasible && predicted < rounding {
            // The merit no longer tells steps apart. The residual does, unless strong damping makes all steps small ones.
            if optimality > 0.5 * last_optimality {
                if is_restarted || control.damping == 0.0 {
                    break SqpStatus::Stalled;
                }
                (control.damping, last_optimality, is_restarted) = (0.0, f64::INFINITY, true);
                pairs.clear();
                continue;
            }
            last_optimality = optimality;
        }

        end_of(step, current, trial);
        let cost = problem.evaluate(trial, row_values);
        let mut decrease = merit - Value::of(cost, row_values).merit(control.penalty);
        if decrease.is_finite() && decrease < GOOD * predicted {
            // Rows bend: a correction takes those that are active to where the linear ones are.
            program.correct(row_values, residual);
            end_of(residual, current, corrected);
            let cost = problem.evaluate(corrected, row_values);
            let corrected_decrease = merit - Value::of(cost, row_values).merit(control.penalty);
            if corrected_decrease > decrease {
                core::mem::swap(trial, corrected);
                decrease = corrected_decrease;
            }
        }
        let ratio = decrease / f64::max(predicted, f64::MIN_POSITIVE);
        let is_rounding = predicted < 1e4 * rounding && decrease.abs() < 1e3 * rounding;
        let is_accepted = ratio > ACCEPTED || is_rounding;
        if is_accepted && problem.linearize(trial) {
            for (step, (trial, current)) in residual.iter_mut().zip(trial.iter().zip(current.iter())) {
                *step = trial - current;
            }
            control.accept(ratio, slack > settings.feasibility.max(STUCK * value.violation));
            current.copy_from_slice(trial);
            value = Value::of(problem.cost(), problem.row_values());
            is_current_best = value.is_better_than(&best, settings.feasibility);
            if is_current_best {
                z.copy_from_slice(current);
                (best, best_optimality) = (value, None);
            }
            if largest(residual) < settings.pair_step {
                // Of the gradient of the Lagrangian with the same multipliers at both ends.
                gradient_of_lagrangian(problem, multipliers, trial);
                for (change, before) in trial.iter_mut().zip(lagrangian.iter()) {
                    *change -= before;
                }
                pairs.remember(residual, trial, settings.pairs);
            }
        } else {
            if is_accepted && !problem.linearize(current) {
                break SqpStatus::Stalled;
            }
            control.damp(1e-3);
        }
        if slack <= settings.feasibility {
            control.penalty = f64::max(control.penalty, 2.0 * multipliers.iter().sum::<f64>());
        }
    };
    let optimality = best_optimality.unwrap_or_else(|| {
        if !is_current_best || !value.cost.is_finite() {
            return f64::INFINITY;
        }
        gradient_of_lagrangian(problem, multipliers, lagrangian);
        residual_in_box(current, lagrangian)
    });
    SqpOutcome {
        status,
        cost: best.cost,
        optimality,
        violation: best.violation,
        worst_row: if best.violation > settings.feasibility { best.worst_row } else { None },
        iterations,
        active: program.active(),
    }
}

/// Where a step leads within the box.
fn end_of(step: &[f64], start: &[f64], end: &mut [f64]) {
    for ((end, start), step) in end.iter_mut().zip(start).zip(step) {
        *end = (start + step).clamp(-1.0, 1.0);
    }
}

/// Largest entry of a gradient of the Lagrangian that the bounds of the box do not hold.
fn residual_in_box(z: &[f64], lagrangian: &[f64]) -> f64 {
    z.iter().zip(lagrangian).fold(0.0, |most, (z, slope)| {
        let is_held = (*z <= -1.0 && *slope > 0.0) || (*z >= 1.0 && *slope < 0.0);
        if is_held { most } else { f64::max(most, slope.abs()) }
    })
}

/// `g - A' multipliers` of the rows at the current point.
fn gradient_of_lagrangian<P: CondensedProblem>(problem: &mut P, multipliers: &[f64], lagrangian: &mut [f64]) {
    lagrangian.fill(0.0);
    problem.add_rows(multipliers, lagrangian);
    for (lagrangian, gradient) in lagrangian.iter_mut().zip(problem.gradient()) {
        *lagrangian = gradient - *lagrangian;
    }
}

#[cfg(test)]
#[allow(clippy::float_cmp, clippy::needless_range_loop, reason = "the same operations give the same bits")]
mod tests {
    use super::super::toy_problem::{Point, ToyProblem};
    use super::*;
    use crate::budget::Units;
    use nalgebra::{DMatrix, DVector};
    use rand_chacha::ChaCha8Rng;
    use rand_core::SeedableRng;
    use tumble_identification::noise::signed_unit;

    fn search(problem: &mut ToyProblem, z: &mut [f64], settings: &SqpSettings) -> SqpOutcome {
        let mut workspace = SqpWorkspace::new(problem.unknowns, problem.rows);
        minimise(problem, z, settings, &mut workspace, &mut Units::new(u64::MAX), 1)
    }

    const EXACT: SqpSettings = SqpSettings { tolerance: 1e-8, ..SqpSettings::COLD };

    /// Rosenbrock's valley in `x = 2 z` with the residuals' matrix as the model, inside the unit circle.
    fn valley(has_circle: bool) -> ToyProblem {
        let residuals = |z: &[f64]| {
            let (x, y) = (2.0 * z[0], 2.0 * z[1]);
            (
                DVector::from_vec(vec![10.0 * (y - x * x), 1.0 - x]),
                DMatrix::from_row_slice(2, 2, &[-40.0 * x, 20.0, -2.0, 0.0]),
            )
        };
        let rows = usize::from(has_circle);
        ToyProblem {
            unknowns: 2,
            rows,
            cost: Box::new(move |z| residuals(z).0.norm_squared()),
            gradient: Box::new(move |z| residuals(z).1.transpose() * residuals(z).0 * 2.0),
            row_values: Box::new(move |z| DVector::from_fn(rows, |_, _| 1.0 - 4.0 * (z[0] * z[0] + z[1] * z[1]))),
            row_gradients: Box::new(move |z| DMatrix::from_fn(rows, 2, |_, i| -8.0 * z[i])),
            model: Box::new(move |z, _| {
                residuals(z).1.transpose() * residuals(z).1 * 2.0 + DMatrix::identity(2, 2) * 1e-3
            }),
            point: Point::none(),
            evaluations: 0,
        }
    }

    /// A chain of points in the plane from one end to the other of the box, tight as a string, that keeps off discs.
    fn string(points: usize, discs: Vec<[f64; 3]>) -> ToyProblem {
        let n = 2 * points;
        let mut h = DMatrix::identity(n, n) * 0.02;
        let mut g = DVector::zeros(n);
        let ends = [[-1.0, 0.0], [1.0, 0.1]];
        for link in 0..=points {
            for axis in 0..2 {
                let (one, two) =
                    (link.checked_sub(1).map(|k| 2 * k + axis), (link < points).then_some(2 * link + axis));
                let scale = 2.0 * points as f64;
                for i in [one, two].into_iter().flatten() {
                    h[(i, i)] += scale;
                }
                match (one, two) {
                    (Some(i), Some(j)) => (h[(i, j)] -= scale, h[(j, i)] -= scale).0,
                    (None, Some(j)) => g[j] -= scale * ends[0][axis],
                    (Some(i), None) => g[i] -= scale * ends[1][axis],
                    (None, None) => {}
                }
            }
        }
        let mut toy = ToyProblem::quadratic(h, g, DVector::zeros(0), DMatrix::zeros(0, n));
        let discs_of_rows = discs.clone();
        toy.rows = points * discs.len();
        toy.row_values = Box::new(move |z| {
            let value = |point: usize, disc: &[f64; 3]| {
                let (x, y) = (z[2 * point] - disc[0], z[2 * point + 1] - disc[1]);
                (x * x + y * y) / (disc[2] * disc[2]) - 1.0
            };
            DVector::from_iterator(
                points * discs_of_rows.len(),
                (0..points).flat_map(|k| discs_of_rows.iter().map(move |d| value(k, d))),
            )
        });
        toy.row_gradients = Box::new(move |z| {
            DMatrix::from_fn(points * discs.len(), n, |row, i| {
                let disc = discs[row % discs.len()];
                if i / 2 == row / discs.len() { 2.0 * (z[i] - disc[i % 2]) / (disc[2] * disc[2]) } else { 0.0 }
            })
        });
        toy
    }

    /// Residual of the optimality conditions found by least squares for the multipliers of what is nearly active.
    fn independent_optimality(problem: &ToyProblem, z: &[f64]) -> f64 {
        let n = problem.unknowns;
        let (gradient, values, rows) = ((problem.gradient)(z), (problem.row_values)(z), (problem.row_gradients)(z));
        let mut normals: Vec<DVector<f64>> =
            (0..problem.rows).filter(|row| values[*row] < 1e-5).map(|row| rows.row(row).transpose()).collect();
        for i in 0..n {
            if z[i].abs() > 1.0 - 1e-9 {
                normals.push(DVector::from_fn(n, |j, _| if i == j { -z[i].signum() } else { 0.0 }));
            }
        }
        // Projected gradient on the cone of the normals: coordinate descent on least squares with no negative multipliers.
        let mut left = gradient;
        let mut multipliers = vec![0.0; normals.len()];
        for _ in 0..20_000 {
            for (normal, multiplier) in normals.iter().zip(&mut multipliers) {
                let next = f64::max(0.0, *multiplier + normal.dot(&left) / normal.norm_squared());
                left -= normal * (next - *multiplier);
                *multiplier = next;
            }
        }
        left.amax()
    }

    #[test]
    fn a_quadratic_program_takes_one_step() {
        let mut rng = ChaCha8Rng::seed_from_u64(4);
        for _ in 0..20 {
            let (n, rows) = (12, 8);
            let root = DMatrix::from_fn(n, n, |_, _| signed_unit(&mut rng));
            let h = &root * root.transpose() + DMatrix::identity(n, n) * 0.1;
            let g = DVector::from_fn(n, |_, _| 3.0 * signed_unit(&mut rng));
            let a = DMatrix::from_fn(rows, n, |_, _| signed_unit(&mut rng));
            let c = DVector::from_fn(rows, |_, _| 0.5 * signed_unit(&mut rng).abs());
            let mut problem = ToyProblem::quadratic(h, g, c, a);
            let mut z: Vec<f64> = (0..n).map(|_| signed_unit(&mut rng)).collect();
            let settings = SqpSettings { damping: 0.0, penalty: 100.0, ..EXACT };
            let outcome = search(&mut problem, &mut z, &settings);
            assert_eq!((outcome.status, outcome.iterations), (SqpStatus::Converged, 2), "{outcome:?}");
            assert!(independent_optimality(&problem, &z) < 1e-6);
            assert!(outcome.violation <= 1e-9 && outcome.optimality < 1e-8);
            assert!(((problem.cost)(&z) - outcome.cost).abs() < 1e-12);
        }
    }

    #[test]
    fn the_valley_is_followed_to_its_end() {
        for start in [[-0.6, 0.5], [0.9, -0.9], [0.0, 0.0]] {
            let mut z = start;
            let outcome = search(&mut valley(false), &mut z, &EXACT);
            assert_eq!(outcome.status, SqpStatus::Converged, "{outcome:?}");
            assert!((z[0] - 0.5).abs() < 1e-7 && (z[1] - 0.5).abs() < 1e-7 && outcome.active == 0, "{z:?}");
            let mut z = start;
            let outcome = search(&mut valley(true), &mut z, &EXACT);
            assert_eq!(outcome.status, SqpStatus::Converged, "{outcome:?}");
            // Least on the circle, by a fine search along it.
            let angle = |i: i32| 0.6 + 1e-5 * f64::from(i);
            let least = (0..20_000)
                .map(|i| (valley(false).cost)(&[0.5 * libm::cos(angle(i)), 0.5 * libm::sin(angle(i))]))
                .fold(f64::INFINITY, f64::min);
            assert!((outcome.cost - least).abs() < 1e-8 && outcome.active == 1, "{outcome:?} {least}");
            assert!(outcome.iterations < 40, "{outcome:?}");
        }
    }

    #[test]
    fn strings_are_pulled_tight_around_discs_from_any_start() {
        let mut rng = ChaCha8Rng::seed_from_u64(5);
        let mut most = 0;
        for _ in 0..20 {
            let mut problem = string(12, vec![[-0.4, 0.1, 0.3], [0.3, -0.1, 0.25]]);
            let mut z: Vec<f64> = (0..24).map(|_| signed_unit(&mut rng)).collect();
            let outcome = search(&mut problem, &mut z, &EXACT);
            assert_eq!(outcome.status, SqpStatus::Converged, "{outcome:?}");
            assert!(outcome.violation <= 1e-6 && outcome.worst_row.is_none() && outcome.active >= 2, "{outcome:?}");
            assert!(independent_optimality(&problem, &z) < 1e-5, "{}", independent_optimality(&problem, &z));
            most = most.max(outcome.iterations);
        }
        assert!(most < 100, "{most}");
    }

    #[test]
    fn rows_without_a_common_point_end_with_the_least_violation() {
        let a = DMatrix::from_row_slice(2, 2, &[1.0, 0.0, -1.0, 0.0]);
        let c = DVector::from_vec(vec![-0.2, -0.4]);
        let mut problem = ToyProblem::quadratic(DMatrix::identity(2, 2), DVector::from_vec(vec![-1.0, 0.5]), c, a);
        let mut z = [0.9, 0.9];
        let outcome = search(&mut problem, &mut z, &EXACT);
        assert_eq!(outcome.status, SqpStatus::Stalled, "{outcome:?}");
        assert!((outcome.violation - 0.3).abs() < 1e-4 && outcome.worst_row.is_some(), "{outcome:?}");
        assert!(outcome.iterations < 60, "{outcome:?}");
    }

    #[test]
    fn a_penalty_too_small_grows() {
        // The multiplier is 50.
        let a = DMatrix::from_row_slice(1, 1, &[1.0]);
        let mut problem = ToyProblem::quadratic(
            DMatrix::identity(1, 1),
            DVector::from_vec(vec![50.0]),
            DVector::from_vec(vec![0.5]),
            a,
        );
        let mut z = [0.3];
        let outcome = search(&mut problem, &mut z, &SqpSettings { penalty: 0.1, ..EXACT });
        assert_eq!(outcome.status, SqpStatus::Converged, "{outcome:?}");
        assert!((z[0] + 0.5).abs() < 1e-6, "{z:?}");
    }

    #[test]
    fn more_budget_is_never_worse_and_what_comes_back_is_what_was_met() {
        let mut last = f64::INFINITY;
        for budget in 0..30 {
            let mut problem = string(8, vec![[0.0, 0.05, 0.4]]);
            let mut z: Vec<f64> = (0..16).map(|i| 0.9 * libm::sin(1.0 + 1.7 * f64::from(i))).collect();
            let mut workspace = SqpWorkspace::new(16, problem.rows);
            let mut units = Units::new(3 * budget);
            let outcome = minimise(&mut problem, &mut z, &EXACT, &mut workspace, &mut units, 3);
            assert_eq!(outcome.iterations as u64 * 3, units.spent());
            if outcome.status == SqpStatus::BudgetSpent {
                assert_eq!(outcome.iterations as u64, budget);
            }
            let mut rows = vec![0.0; problem.rows];
            assert_eq!(problem.evaluate(&z, &mut rows), outcome.cost);
            assert_eq!(f64::max(0.0, -rows.iter().copied().fold(f64::INFINITY, f64::min)), outcome.violation);
            if outcome.violation <= EXACT.feasibility {
                assert!(outcome.cost <= last);
                last = outcome.cost;
            } else {
                assert_eq!(last, f64::INFINITY);
            }
        }
        assert!(last.is_finite());
    }

    #[test]
    fn the_same_again_gives_the_same_bits_and_memory_saves_work() {
        let mut problem = string(10, vec![[0.0, 0.05, 0.4]]);
        let mut workspace = SqpWorkspace::new(20, problem.rows);
        let start: Vec<f64> = (0..20).map(|i| 0.9 * libm::sin(1.0 + 1.7 * f64::from(i))).collect();
        let mut run = |workspace: &mut SqpWorkspace, start: &[f64], settings: &SqpSettings| {
            let mut z = start.to_vec();
            let outcome = minimise(&mut problem, &mut z, settings, workspace, &mut Units::new(u64::MAX), 1);
            (outcome, z)
        };
        let first = run(&mut workspace, &start, &EXACT);
        workspace.forget();
        assert_eq!(run(&mut workspace, &start, &EXACT), first);
        let warm = run(&mut workspace, &first.1, &SqpSettings { damping: 0.0, ..EXACT });
        assert!(warm.0.iterations <= 2 && warm.0.status == SqpStatus::Converged, "{warm:?}");
    }

    #[test]
    fn where_there_is_no_cost_no_step_goes() {
        let mut problem = ToyProblem::quadratic(
            DMatrix::identity(1, 1),
            DVector::from_vec(vec![2.0]),
            DVector::zeros(0),
            DMatrix::zeros(0, 1),
        );
        problem.cost = Box::new(|z| if z[0] < -0.25 { f64::INFINITY } else { 0.5 * z[0] * z[0] + 2.0 * z[0] });
        let mut z = [0.5];
        let outcome = search(&mut problem, &mut z, &EXACT);
        assert!(outcome.cost.is_finite() && z[0] > -0.25 - 1e-9 && z[0] < 0.0, "{outcome:?} {z:?}");
        problem.cost = Box::new(|_| f64::NAN);
        assert_eq!(search(&mut problem, &mut z, &EXACT).status, SqpStatus::Stalled);
    }
}
