//! The quadratic program of a step.

use super::problem::CondensedProblem;
use super::quasi_newton::CurvaturePairs;
use crate::vectors::{add_scaled, dot};

/// Largest violation of a condition at the solution.
const EXACT: f64 = 1e-10;
/// Share of a normal that is new to those of the active conditions, below which it counts as one of their combinations.
const DEPENDENT: f64 = 1e-12;

/// A condition on a step `d` and the slack `t`, of which there are finitely many, numbered.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Condition {
    /// `c + a . d + t >= 0`.
    Row(usize),
    /// `t >= 0`.
    Slack,
    /// `d >= -1 - z` in one unknown.
    Lower(usize),
    /// `d <= 1 - z` in one unknown.
    Upper(usize),
}

/// Least `1/2 d' B d + g . d + penalty t + 1/2 t^2` over steps `d` and the slack `t >= 0` of all rows, with
/// `c_r + a_r . d + t >= 0` and `z + d` in the box.
///
/// Dual active set: starts from the least value without conditions and adds violated ones, one at a time; what it keeps are the
/// columns `B^-1 a` of the active ones and the triangular factor of `A' B^-1 A`. It always has a solution.
///
/// # Source
/// Goldfarb and Idnani, A numerically stable dual method for solving strictly convex quadratic programs, 1983.
#[derive(Clone, Debug)]
pub(super) struct QuadraticProgram {
    unknowns: usize,
    rows: usize,
    /// Solution; and the one without conditions.
    step: Vec<f64>,
    slack: f64,
    free_step: Vec<f64>,
    free_slack: f64,
    /// `c + a . d` of each row.
    row_values: Vec<f64>,
    is_active: Vec<bool>,
    /// Numbers of the active conditions, their multipliers, and where their columns are.
    active: Vec<usize>,
    multipliers: Vec<f64>,
    places: Vec<usize>,
    columns: Vec<f64>,
    /// Upper triangular, column by column.
    factor: Vec<f64>,
    /// Conditions to try first.
    likely: Vec<usize>,
    normal: Vec<f64>,
    column: Vec<f64>,
    coupling: Vec<f64>,
    projection: Vec<f64>,
    changes: Vec<f64>,
}

impl QuadraticProgram {
    /// Room for so many unknowns and rows.
    pub(super) fn new(unknowns: usize, rows: usize) -> Self {
        let most = unknowns + 1;
        Self {
            unknowns,
            rows,
            step: vec![0.0; unknowns],
            slack: 0.0,
            free_step: vec![0.0; unknowns],
            free_slack: 0.0,
            row_values: vec![0.0; rows],
            is_active: vec![false; rows + 1 + 2 * unknowns],
            active: Vec::with_capacity(most),
            multipliers: Vec::with_capacity(most),
            places: (0..most).collect(),
            columns: vec![0.0; most * unknowns],
            factor: vec![0.0; most * most],
            likely: Vec::with_capacity(most),
            normal: vec![0.0; unknowns],
            column: vec![0.0; unknowns],
            coupling: vec![0.0; most],
            projection: vec![0.0; most],
            changes: vec![0.0; most],
        }
    }

    /// Forgets which conditions were active.
    pub(super) fn forget(&mut self) {
        self.active.clear();
        self.multipliers.clear();
    }

    /// The step of least value.
    pub(super) fn step(&self) -> &[f64] {
        &self.step
    }

    /// The slack of least value.
    pub(super) fn slack(&self) -> f64 {
        self.slack
    }

    /// Number of rows and bounds that are active.
    pub(super) fn active(&self) -> usize {
        self.active.iter().filter(|condition| **condition != self.rows).count()
    }

    /// Writes the multiplier of each row.
    pub(super) fn row_multipliers(&self, multipliers: &mut [f64]) {
        multipliers.fill(0.0);
        for (condition, multiplier) in self.active.iter().zip(&self.multipliers) {
            if let Condition::Row(row) = self.condition(*condition) {
                multipliers[row] = *multiplier;
            }
        }
    }

    /// Subtracts the bounds' multipliers from a gradient of the Lagrangian of the rows.
    pub(super) fn subtract_bounds(&self, gradient: &mut [f64]) {
        for (condition, multiplier) in self.active.iter().zip(&self.multipliers) {
            match self.condition(*condition) {
                Condition::Lower(i) => gradient[i] -= multiplier,
                Condition::Upper(i) => gradient[i] += multiplier,
                Condition::Row(_) | Condition::Slack => {}
            }
        }
    }

    /// Solves with the matrix built last by `pairs`, at the problem's current point `z`. What was active in the last solution is
    /// tried first. False where rounding prevents a solution.
    pub(super) fn solve<P: CondensedProblem>(
        &mut self,
        problem: &mut P,
        pairs: &mut CurvaturePairs,
        z: &[f64],
        penalty: f64,
    ) -> bool {
        self.likely.clear();
        self.likely.extend_from_slice(&self.active);
        self.is_active.fill(false);
        self.active.clear();
        self.multipliers.clear();
        for (step, gradient) in self.free_step.iter_mut().zip(problem.gradient()) {
            *step = -gradient;
        }
        pairs.solve(problem, &mut self.free_step);
        self.free_slack = -penalty;
        // Without conditions the slack is `-penalty`: its own condition is the first to hold.
        self.columns[self.places[0] * self.unknowns..][..self.unknowns].fill(0.0);
        self.factor[0] = 1.0;
        self.activate(self.rows, penalty);
        self.place(problem);
        // Each solution of a subproblem is better than the one before, so that none comes twice; rounding may say otherwise.
        let most_additions = 10 * (self.unknowns + self.rows) + 100;
        for _ in 0..most_additions {
            let Some((condition, residual)) = self.most_violated(z) else {
                self.refine(problem, z);
                return true;
            };
            if !self.add(problem, pairs, condition, residual) {
                return false;
            }
            self.place(problem);
        }
        false
    }

    /// The step with a correction that is as short as the matrix tells and takes the active rows from their values at the end of
    /// the step to zero.
    pub(super) fn correct(&mut self, values_at_end: &[f64], corrected: &mut [f64]) {
        for (position, number) in self.active.iter().enumerate() {
            self.coupling[position] = match self.condition(*number) {
                Condition::Row(row) => values_at_end[row] + self.slack,
                Condition::Slack | Condition::Lower(_) | Condition::Upper(_) => 0.0,
            };
        }
        self.project();
        corrected.copy_from_slice(&self.step);
        for (position, change) in self.changes[..self.active.len()].iter().enumerate() {
            add_scaled(corrected, -change, &self.columns[self.places[position] * self.unknowns..][..self.unknowns]);
        }
    }

    fn condition(&self, number: usize) -> Condition {
        let Some(bound) = number.checked_sub(self.rows + 1) else {
            return if number == self.rows { Condition::Slack } else { Condition::Row(number) };
        };
        if bound.is_multiple_of(2) { Condition::Lower(bound / 2) } else { Condition::Upper(bound / 2) }
    }

    /// Part of a condition's normal, and of its column, that belongs to the slack.
    fn slack_part(&self, number: usize) -> f64 {
        if number <= self.rows { 1.0 } else { 0.0 }
    }

    fn residual(&self, number: usize, z: &[f64]) -> f64 {
        match self.condition(number) {
            Condition::Row(row) => self.row_values[row] + self.slack,
            Condition::Slack => self.slack,
            Condition::Lower(i) => z[i] + self.step[i] + 1.0,
            Condition::Upper(i) => 1.0 - (z[i] + self.step[i]),
        }
    }

    /// Of the likely conditions, or else of all, the one violated most.
    fn most_violated(&self, z: &[f64]) -> Option<(usize, f64)> {
        let worst_of = |worst: Option<(usize, f64)>, number: usize| {
            if self.is_active[number] {
                return worst;
            }
            let residual = self.residual(number, z);
            if residual < worst.map_or(-EXACT, |(_, least)| least) { Some((number, residual)) } else { worst }
        };
        let likely = self.likely.iter().fold(None, |worst, number| worst_of(worst, *number));
        likely.or_else(|| (0..self.is_active.len()).fold(None, worst_of))
    }

    fn activate(&mut self, number: usize, multiplier: f64) {
        self.is_active[number] = true;
        self.active.push(number);
        self.multipliers.push(multiplier);
    }

    /// Step, slack and rows of the multipliers: `d = d_free + B^-1 A u`.
    fn place<P: CondensedProblem>(&mut self, problem: &mut P) {
        self.step.copy_from_slice(&self.free_step);
        self.slack = self.free_slack;
        for ((number, multiplier), place) in self.active.iter().zip(&self.multipliers).zip(&self.places) {
            add_scaled(&mut self.step, *multiplier, &self.columns[place * self.unknowns..][..self.unknowns]);
            self.slack += multiplier * self.slack_part(*number);
        }
        problem.rows_along(&self.step, &mut self.row_values);
        for (value, constant) in self.row_values.iter_mut().zip(problem.row_values()) {
            *value += constant;
        }
    }

    /// Takes a violated condition into the active ones, and drops those whose multipliers that makes negative.
    fn add<P: CondensedProblem>(
        &mut self,
        problem: &mut P,
        pairs: &mut CurvaturePairs,
        number: usize,
        mut residual: f64,
    ) -> bool {
        self.normal.fill(0.0);
        match self.condition(number) {
            Condition::Row(row) => problem.add_row(row, 1.0, &mut self.normal),
            Condition::Slack => {}
            Condition::Lower(i) => self.normal[i] = 1.0,
            Condition::Upper(i) => self.normal[i] = -1.0,
        }
        self.column.copy_from_slice(&self.normal);
        pairs.solve(problem, &mut self.column);
        let slack_part = self.slack_part(number);
        let curvature = dot(&self.normal, &self.column) + slack_part;
        for (position, other) in self.active.iter().enumerate() {
            let column = &self.columns[self.places[position] * self.unknowns..][..self.unknowns];
            let along = match self.condition(number) {
                Condition::Row(_) => dot(column, &self.normal),
                Condition::Slack => 0.0,
                Condition::Lower(i) => column[i],
                Condition::Upper(i) => -column[i],
            };
            self.coupling[position] = along + slack_part * self.slack_part(*other);
        }
        let mut multiplier = 0.0;
        loop {
            let count = self.active.len();
            self.project();
            let projection = &self.projection[..count];
            let pivot = curvature - dot(projection, projection);
            let is_dependent = pivot.is_nan() || pivot <= DEPENDENT * curvature || count > self.unknowns;
            let steepest = self.changes[..count].iter().fold(0.0, |most, change| f64::max(most, *change));
            let (mut drop_at, mut length) = (None, if is_dependent { f64::INFINITY } else { -residual / pivot });
            for (position, (change, other)) in self.changes.iter().zip(&self.multipliers).enumerate() {
                if *change > 1e-12 * steepest && other / change < length {
                    (drop_at, length) = (Some(position), other / change);
                }
            }
            if !length.is_finite() {
                return false;
            }
            for (other, change) in self.multipliers.iter_mut().zip(&self.changes) {
                *other = f64::max(0.0, *other - length * change);
            }
            multiplier += length;
            if let Some(position) = drop_at {
                if !is_dependent {
                    residual += length * pivot;
                }
                self.drop(position);
            } else {
                let start = count * (self.unknowns + 1);
                self.factor[start..start + count].copy_from_slice(&self.projection[..count]);
                self.factor[start + count] = f64::sqrt(pivot);
                self.columns[self.places[count] * self.unknowns..][..self.unknowns].copy_from_slice(&self.column);
                self.activate(number, multiplier);
                return true;
            }
        }
    }

    /// `R' projection = coupling` and `R changes = projection`: how the multipliers fall as that of the new condition grows.
    fn project(&mut self) {
        let count = self.active.len();
        let stride = self.unknowns + 1;
        for position in 0..count {
            let column = &self.factor[position * stride..][..=position];
            let sum = dot(&column[..position], &self.projection[..position]);
            self.projection[position] = (self.coupling[position] - sum) / column[position];
        }
        self.changes[..count].copy_from_slice(&self.projection[..count]);
        self.solve_upper(count);
    }

    /// Solves with the triangular factor in place of the changes.
    fn solve_upper(&mut self, count: usize) {
        let stride = self.unknowns + 1;
        for position in (0..count).rev() {
            let column = &self.factor[position * stride..][..=position];
            let change = self.changes[position] / column[position];
            self.changes[position] = change;
            add_scaled(&mut self.changes[..position], -change, &column[..position]);
        }
    }

    /// Takes an active condition out; rotations make the factor triangular again.
    fn drop(&mut self, position: usize) {
        let stride = self.unknowns + 1;
        let number = self.active.remove(position);
        self.is_active[number] = false;
        self.multipliers.remove(position);
        let count = self.active.len();
        self.places[position..=count].rotate_left(1);
        self.coupling[position..=count].rotate_left(1);
        for column in position..count {
            let from = (column + 1) * stride;
            self.factor.copy_within(from..from + column + 2, column * stride);
        }
        for row in position..count {
            let start = row * stride + row;
            let (upper, lower) = (self.factor[start], self.factor[start + 1]);
            let norm = f64::sqrt(upper * upper + lower * lower);
            let (cosine, sine) = (upper / norm, lower / norm);
            for column in row..count {
                let start = column * stride + row;
                let (upper, lower) = (self.factor[start], self.factor[start + 1]);
                self.factor[start] = cosine * upper + sine * lower;
                self.factor[start + 1] = cosine * lower - sine * upper;
            }
        }
    }

    /// Moves the multipliers so that the active conditions hold up to rounding.
    fn refine<P: CondensedProblem>(&mut self, problem: &mut P, z: &[f64]) {
        for _ in 0..3 {
            let mut worst = 0.0;
            for position in 0..self.active.len() {
                let residual = self.residual(self.active[position], z);
                self.coupling[position] = residual;
                worst = f64::max(worst, residual.abs());
            }
            if worst <= EXACT {
                return;
            }
            self.project();
            for (multiplier, change) in self.multipliers.iter_mut().zip(&self.changes) {
                *multiplier = f64::max(0.0, *multiplier - change);
            }
            self.place(problem);
        }
    }
}

#[cfg(test)]
#[allow(clippy::float_cmp, reason = "the same operations give the same bits")]
mod tests {
    use super::super::toy_problem::ToyProblem;
    use super::*;
    use nalgebra::{DMatrix, DVector};
    use rand_chacha::ChaCha8Rng;
    use rand_core::{Rng, SeedableRng};
    use tumble_identification::noise::signed_unit;

    struct Case {
        h: DMatrix<f64>,
        g: DVector<f64>,
        c: DVector<f64>,
        a: DMatrix<f64>,
        z: Vec<f64>,
        penalty: f64,
    }

    impl Case {
        /// Rows among which some are copies, combinations or opposites of others, or empty.
        fn random(rng: &mut ChaCha8Rng, n: usize, rows: usize) -> Self {
            let root = DMatrix::from_fn(n, n, |_, _| signed_unit(rng));
            let scales = DVector::from_fn(n, |_, _| libm::pow(10.0, 1.5 * signed_unit(rng)));
            let h = (&root * root.transpose() + DMatrix::identity(n, n) * 0.1)
                .component_mul(&(&scales * scales.transpose()));
            let slope = 5.0 * signed_unit(rng).abs();
            let g = DVector::from_fn(n, |_, _| slope * signed_unit(rng));
            let mut a = DMatrix::from_fn(rows, n, |_, _| signed_unit(rng));
            let mut c = DVector::from_fn(rows, |_, _| 0.3 + signed_unit(rng));
            for row in 2..rows {
                let (one, two) = (a.row(row - 1).into_owned(), a.row(row - 2).into_owned());
                match rng.next_u64() % 8 {
                    0 => (a.set_row(row, &one), c[row] = c[row - 1]).1,
                    1 => a.set_row(row, &-one),
                    2 => a.set_row(row, &(one + two * 0.5)),
                    3 => a.set_row(row, &(one * 0.0)),
                    _ => {}
                }
            }
            let z = (0..n).map(|_| signed_unit(rng)).collect();
            Self { h, g, c, a, z, penalty: if rng.next_u64().is_multiple_of(2) { 0.5 } else { 20.0 } }
        }

        fn solved(&self) -> (ToyProblem, QuadraticProgram) {
            let n = self.g.len();
            let z = DVector::from_column_slice(&self.z);
            // Gradient and rows at `z` are `g` and `c`.
            let (g, c) = (&self.g - &self.h * &z, &self.c - &self.a * &z);
            let mut problem = ToyProblem::quadratic(self.h.clone(), g, c, self.a.clone());
            let (mut program, mut pairs) = (QuadraticProgram::new(n, self.c.len()), CurvaturePairs::new(n, 0));
            assert!(problem.linearize(&self.z) && problem.factorise(&[], 0.0));
            pairs.build(&mut problem, 0.0);
            assert!(program.solve(&mut problem, &mut pairs, &self.z, self.penalty));
            (problem, program)
        }

        /// All conditions as `normal . (d, t) >= bound`.
        fn conditions(&self) -> (DMatrix<f64>, DVector<f64>) {
            let (n, rows) = (self.g.len(), self.c.len());
            let mut normals = DMatrix::zeros(rows + 1 + 2 * n, n + 1);
            let mut bounds = DVector::zeros(rows + 1 + 2 * n);
            normals.view_mut((0, 0), (rows, n)).copy_from(&self.a);
            normals.view_mut((0, n), (rows + 1, 1)).fill(1.0);
            bounds.rows_mut(0, rows).copy_from(&-&self.c);
            for i in 0..n {
                normals[(rows + 1 + 2 * i, i)] = 1.0;
                normals[(rows + 2 + 2 * i, i)] = -1.0;
                bounds[rows + 1 + 2 * i] = -1.0 - self.z[i];
                bounds[rows + 2 + 2 * i] = self.z[i] - 1.0;
            }
            (normals, bounds)
        }

        /// What is left of the optimality conditions: of the gradient, of the conditions, of the signs, of the products.
        fn residuals(&self, program: &QuadraticProgram) -> [f64; 4] {
            let (n, rows) = (self.g.len(), self.c.len());
            let (normals, bounds) = self.conditions();
            let x = DVector::from_fn(n + 1, |i, _| if i < n { program.step()[i] } else { program.slack() });
            let mut gradient = DVector::zeros(n + 1);
            gradient.rows_mut(0, n).copy_from(&(&self.h * x.rows(0, n) + &self.g));
            gradient[n] = self.penalty + x[n];
            let mut multipliers = vec![0.0; rows];
            program.row_multipliers(&mut multipliers);
            let mut all = DVector::zeros(bounds.len());
            for (number, multiplier) in program.active.iter().zip(&program.multipliers) {
                all[*number] = *multiplier;
            }
            assert!(multipliers.iter().zip(&all).all(|(one, other)| one == other));
            gradient -= normals.transpose() * &all;
            // The same by the solver's own bookkeeping.
            let mut by_parts: Vec<f64> =
                (&self.h * x.rows(0, n) + &self.g - self.a.transpose() * all.rows(0, rows)).data.into();
            program.subtract_bounds(&mut by_parts);
            assert!(by_parts.iter().zip(&gradient).all(|(one, other)| (one - other).abs() < 1e-10));
            let left = normals * x - bounds;
            [gradient.amax(), (-left.min()).max(0.0), (-all.min()).max(0.0), left.component_mul(&all).amax()]
        }

        /// The solution by trying every set of active conditions.
        fn brute_force(&self) -> DVector<f64> {
            let n = self.g.len() + 1;
            let (normals, bounds) = self.conditions();
            let mut h = DMatrix::identity(n, n);
            h.view_mut((0, 0), (n - 1, n - 1)).copy_from(&self.h);
            let mut g = DVector::from_element(n, self.penalty);
            g.rows_mut(0, n - 1).copy_from(&self.g);
            let mut least: Option<(f64, DVector<f64>)> = None;
            for set in 0..1_u32 << bounds.len() {
                let active: Vec<usize> = (0..bounds.len()).filter(|i| set >> i & 1 == 1).collect();
                if active.len() > n {
                    continue;
                }
                let size = n + active.len();
                let mut system = DMatrix::zeros(size, size);
                let mut right = DVector::zeros(size);
                system.view_mut((0, 0), (n, n)).copy_from(&h);
                right.rows_mut(0, n).copy_from(&-&g);
                for (k, i) in active.iter().enumerate() {
                    system.view_mut((n + k, 0), (1, n)).copy_from(&normals.row(*i));
                    system.view_mut((0, n + k), (n, 1)).copy_from(&normals.row(*i).transpose());
                    right[n + k] = bounds[*i];
                }
                let Some(x) = system.lu().solve(&right) else { continue };
                let x = x.rows(0, n).into_owned();
                if (&normals * &x - &bounds).min() < -1e-8 {
                    continue;
                }
                let value = 0.5 * x.dot(&(&h * &x)) + g.dot(&x);
                if least.as_ref().is_none_or(|(least, _)| value < *least) {
                    least = Some((value, x));
                }
            }
            least.unwrap().1
        }
    }

    #[test]
    fn agrees_with_every_set_of_active_conditions_tried() {
        let mut rng = ChaCha8Rng::seed_from_u64(1);
        let mut active = [0; 8];
        for _ in 0..150 {
            let case = Case::random(&mut rng, 2, 6);
            let (_, program) = case.solved();
            let expected = case.brute_force();
            for i in 0..2 {
                assert!((program.step()[i] - expected[i]).abs() < 1e-7, "{:?} {expected}", program.step());
            }
            assert!((program.slack() - expected[2]).abs() < 1e-7);
            active[program.active()] += 1;
        }
        assert!(active[0] > 0 && active[1] > 10 && active[2] > 10, "{active:?}");
    }

    #[test]
    fn optimality_holds_for_large_programs_with_dependent_rows() {
        let mut rng = ChaCha8Rng::seed_from_u64(2);
        let (mut slacks, mut most) = (0, 0);
        for (n, rows) in [(1, 0), (1, 3), (5, 40), (20, 10), (40, 120), (60, 300)] {
            for _ in 0..20 {
                let case = Case::random(&mut rng, n, rows);
                let (_, program) = case.solved();
                let residuals = case.residuals(&program);
                assert!(residuals.iter().all(|residual| *residual < 1e-8), "{residuals:?} for {n} and {rows}");
                slacks += usize::from(program.slack() > 1e-6);
                most = most.max(program.active());
            }
        }
        assert!(slacks > 20 && most > 30, "{slacks} {most}");
    }

    #[test]
    fn a_second_solution_of_the_same_needs_no_drop_and_is_the_same() {
        let mut rng = ChaCha8Rng::seed_from_u64(3);
        for _ in 0..20 {
            let case = Case::random(&mut rng, 30, 60);
            let (mut problem, mut program) = case.solved();
            let (step, active) = (program.step().to_vec(), program.active.clone());
            let mut pairs = CurvaturePairs::new(30, 0);
            assert!(program.solve(&mut problem, &mut pairs, &case.z, case.penalty));
            assert!(program.step().iter().zip(&step).all(|(one, other)| (one - other).abs() < 1e-9));
            assert_eq!(program.active.len(), active.len());
        }
    }
}
