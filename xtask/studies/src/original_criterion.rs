//! The cost that the thesis's planner minimises, to be compared with.
//!
//! Beside tracking and effort it sums over all nodes before the last and all quantities `gamma / (1 + |phi|^2)^2`, where `phi`
//! is the sensitivity of the state at that node alone: position, velocity, quaternion and rate in SI units by the quantity in
//! its own. Nothing is accumulated and nothing is known before. The published code leaves out that a turned body turns its
//! force; here it does not, so that only the criteria differ.
//!
//! Everything is a sum of squares: gradient and Gauss-Newton curvature are those of dense Jacobians, carried forward.

use nalgebra::{Cholesky, DMatrix, DVector, Dyn, Isometry3};
use tumble_planning::PlanningError;
use tumble_planning::local::{Array2, CondensedProblem, InformativeModel, Kinematics, RigidBodyModel, StepDerivatives};

use crate::local_cases::{LocalCase, by_coordinate, state};

/// Residuals of a node: tracking, then one per quantity.
const NODE_ROWS: usize = 16;
/// Weights of the squared sensitivities; of the quaternion it is a quarter of that of the turn.
const SENSITIVITY: [f64; 4] = [1.0; 4];

/// The problem in its inputs over their limits.
pub struct OriginalCriterion<'a> {
    case: &'a LocalCase<4>,
    model: RigidBodyModel<4>,
    start: Kinematics,
    goal: Kinematics,
    /// `gamma`, by quantity.
    weights: [f64; 4],
    /// Squares of the change of the model's coordinates by the quantities.
    scales: [f64; 4],
    cost: f64,
    gradient: Vec<f64>,
    curvature: DMatrix<f64>,
    factor: Option<(f64, Cholesky<f64, Dyn>)>,
}

impl<'a> OriginalCriterion<'a> {
    /// # Errors
    /// A body that is none.
    pub fn new(case: &'a LocalCase<4>, weights: [f64; 4]) -> Result<Self, PlanningError> {
        let mut model = RigidBodyModel::principal();
        let knowledge = model.adopt(&case.belief)?;
        let unknowns = 6 * case.steps();
        let [x, y, z] = case.task.goal;
        Ok(Self {
            case,
            model,
            start: state(&case.task.start),
            goal: Kinematics::at_rest(Isometry3::translation(x, y, z)),
            weights,
            scales: std::array::from_fn(|i| knowledge.quantities[(i, i)].powi(-2)),
            cost: f64::INFINITY,
            gradient: vec![0.0; unknowns],
            curvature: DMatrix::zeros(unknowns, unknowns),
            factor: None,
        })
    }

    /// The wrenches of these unknowns.
    pub fn inputs(&self, z: &[f64]) -> Vec<[f64; 6]> {
        let wrench = &self.case.task.wrench;
        z.chunks_exact(6).map(|z| std::array::from_fn(|i| z[i] * wrench[i])).collect()
    }

    /// Weight of the square of an unknown.
    fn effort(&self, unknown: usize) -> f64 {
        let (channel, task) = (unknown % 6, &self.case.task);
        task.effort[channel / 3] * task.wrench[channel].powi(2)
    }

    fn spent(&self, z: &[f64]) -> f64 {
        z.iter().enumerate().map(|(i, z)| self.effort(i) * z * z).sum()
    }

    /// Residuals of a node, and their changes by its state and by its sensitivities.
    fn residuals(&self, node: usize, state: &Kinematics, phi: &Array2<4, 12>) -> NodeResiduals {
        let is_last = node == self.case.steps();
        let weights = by_coordinate(if is_last { &self.case.task.terminal } else { &self.case.task.tracking });
        let (errors, by_state) = self.model.residual(state, &self.goal);
        let mut node = NodeResiduals { values: [0.0; NODE_ROWS], by_state: [[0.0; 12]; 12], by_phi: [[0.0; 12]; 4] };
        for i in 0..12 {
            let weight = weights[i].sqrt();
            node.values[i] = weight * errors[i];
            node.by_state[i] = by_state[i].map(|entry| weight * entry);
        }
        if !is_last {
            let metric = by_coordinate(&SENSITIVITY);
            for (i, phi) in phi.iter().enumerate() {
                let (gamma, scale) = (self.weights[i].sqrt(), self.scales[i]);
                let seen = 1.0 + scale * phi.iter().zip(metric).map(|(x, weight)| weight * x * x).sum::<f64>();
                node.values[12 + i] = gamma / seen;
                node.by_phi[i] = std::array::from_fn(|j| -2.0 * gamma * scale * metric[j] * phi[j] / (seen * seen));
            }
        }
        node
    }
}

struct NodeResiduals {
    values: [f64; NODE_ROWS],
    by_state: Array2<12, 12>,
    by_phi: Array2<4, 12>,
}

fn squares(values: &[f64]) -> f64 {
    values.iter().map(|x| x * x).sum()
}

fn dense<const R: usize, const C: usize>(array: &Array2<R, C>) -> DMatrix<f64> {
    DMatrix::from_fn(R, C, |i, j| array[i][j])
}

/// Adds the change by the inputs of one step, in units of their limits.
fn add_inputs(changes: &mut DMatrix<f64>, by_input: &Array2<12, 6>, step: usize, wrench: &[f64; 6]) {
    for (i, row) in by_input.iter().enumerate() {
        for (j, entry) in row.iter().enumerate() {
            changes[(i, 6 * step + j)] += entry * wrench[j];
        }
    }
}

impl CondensedProblem for OriginalCriterion<'_> {
    fn unknowns(&self) -> usize {
        self.gradient.len()
    }

    fn rows(&self) -> usize {
        0
    }

    fn evaluate(&mut self, z: &[f64], _rows: &mut [f64]) -> f64 {
        let (mut state, mut phi) = (self.start, [[0.0; 12]; 4]);
        let mut cost = self.spent(z) + squares(&self.residuals(0, &state, &phi).values);
        for (step, input) in self.inputs(z).iter().enumerate() {
            match self.model.step(&state, &phi, input, self.case.task.step_s) {
                Some(end) => (state, phi) = end,
                None => return f64::INFINITY,
            }
            cost += squares(&self.residuals(step + 1, &state, &phi).values);
        }
        cost
    }

    fn linearize(&mut self, z: &[f64]) -> bool {
        let (unknowns, steps, wrench) = (z.len(), self.case.steps(), self.case.task.wrench);
        let (mut state, mut phi) = (self.start, [[0.0; 12]; 4]);
        let mut by_inputs = DMatrix::zeros(12, unknowns);
        let mut phi_by_inputs = vec![DMatrix::zeros(12, unknowns); 4];
        let mut derivatives = StepDerivatives::zeros();
        let mut jacobian = DMatrix::zeros(NODE_ROWS * (steps + 1), unknowns);
        let mut values = DVector::zeros(NODE_ROWS * (steps + 1));
        for node in 0..=steps {
            let residuals = self.residuals(node, &state, &phi);
            let first = NODE_ROWS * node;
            values.rows_mut(first, NODE_ROWS).copy_from_slice(&residuals.values);
            jacobian.rows_mut(first, 12).copy_from(&(dense(&residuals.by_state) * &by_inputs));
            for (i, changes) in phi_by_inputs.iter().enumerate() {
                let row = dense(&[residuals.by_phi[i]]) * changes;
                jacobian.rows_mut(first + 12 + i, 1).copy_from(&row);
            }
            let Some(z) = z.get(6 * node..6 * node + 6) else { break };
            let input = std::array::from_fn(|i| z[i] * wrench[i]);
            let step_s = self.case.task.step_s;
            let Some(end) = self.model.differentiate(&state, &phi, &input, step_s, &mut derivatives) else {
                return false;
            };
            (state, phi) = end;
            let by_state = dense(&derivatives.by_state);
            for (i, changes) in phi_by_inputs.iter_mut().enumerate() {
                *changes = &by_state * &*changes + dense(&derivatives.sensitivity_by_state[i]) * &by_inputs;
                add_inputs(changes, &derivatives.sensitivity_by_input[i], node, &wrench);
            }
            by_inputs = by_state * by_inputs;
            add_inputs(&mut by_inputs, &derivatives.by_input, node, &wrench);
        }
        let transposed = jacobian.transpose();
        let slope = &transposed * &values;
        self.curvature = 2.0 * (transposed * jacobian);
        for i in 0..unknowns {
            self.gradient[i] = 2.0 * (slope[i] + self.effort(i) * z[i]);
            self.curvature[(i, i)] += 2.0 * self.effort(i);
        }
        self.cost = self.spent(z) + values.norm_squared();
        self.cost.is_finite()
    }

    fn cost(&self) -> f64 {
        self.cost
    }

    fn gradient(&self) -> &[f64] {
        &self.gradient
    }

    fn row_values(&self) -> &[f64] {
        &[]
    }

    fn rows_along(&mut self, _x: &[f64], _changes: &mut [f64]) {}

    fn add_row(&mut self, _row: usize, _factor: f64, _gradient: &mut [f64]) {}

    fn add_rows(&mut self, _factors: &[f64], _gradient: &mut [f64]) {}

    fn factorise(&mut self, _multipliers: &[f64], damping: f64) -> bool {
        let mut damped = self.curvature.clone();
        for i in 0..damped.nrows() {
            damped[(i, i)] += damping;
        }
        self.factor = damped.cholesky().map(|factor| (damping, factor));
        self.factor.is_some()
    }

    fn curvature_times(&mut self, x: &[f64], product: &mut [f64]) {
        let damping = self.factor.as_ref().map_or(0.0, |(damping, _)| *damping);
        let x = DVector::from_column_slice(x);
        product.copy_from_slice((&self.curvature * &x + damping * &x).as_slice());
    }

    fn solve(&mut self, x: &mut [f64]) {
        if let Some((_, factor)) = &self.factor {
            let solution = factor.solve(&DVector::from_column_slice(x));
            x.copy_from_slice(solution.as_slice());
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::local_tasks::short_way;

    const WEIGHTS: [f64; 4] = [50.0, 20.0, 3.0, 7.0];

    fn case() -> LocalCase<4> {
        LocalCase::new(short_way([0.35, 0.15, 0.08]), 40, false).unwrap()
    }

    fn stirred() -> Vec<f64> {
        (0..240).map(|i| 0.5 * (1.0 + 1.7 * f64::from(i)).sin()).collect()
    }

    #[test]
    fn the_gradient_is_that_of_the_cost() {
        let (case, z) = (case(), stirred());
        let mut problem = OriginalCriterion::new(&case, WEIGHTS).unwrap();
        assert!(problem.linearize(&z));
        let value = problem.evaluate(&z, &mut []);
        assert!((problem.cost() - value).abs() < 1e-11 * value);
        let gradient = problem.gradient().to_vec();
        let scale = gradient.iter().fold(0.0, |most: f64, x| most.max(x.abs()));
        let mut quiet = OriginalCriterion::new(&case, [0.0; 4]).unwrap();
        assert!(quiet.linearize(&z));
        let told = gradient.iter().zip(quiet.gradient()).fold(0.0, |most: f64, (x, y)| most.max((x - y).abs()));
        assert!(told > 0.01 * scale, "{told} of {scale}: the criterion hardly counts");
        for i in 0..240 {
            let mut at = |sign: f64| {
                let mut moved = z.clone();
                moved[i] += sign * 1e-4;
                problem.evaluate(&moved, &mut [])
            };
            let quotient = (8.0 * (at(1.0) - at(-1.0)) - (at(2.0) - at(-2.0))) / 12e-4;
            assert!((quotient - gradient[i]).abs() < 1e-7 * scale, "{i}: {quotient}, {}", gradient[i]);
        }
    }

    /// Without weights the cost is the judge's, which shares no code with it.
    #[test]
    fn tracking_and_effort_are_those_of_the_judge() {
        let (case, z) = (case(), stirred());
        let mut problem = OriginalCriterion::new(&case, [0.0; 4]).unwrap();
        let judged = case.task.judge(&problem.inputs(&z)).cost.tracking_and_effort;
        assert!((problem.evaluate(&z, &mut []) - judged).abs() < 1e-6 * judged);
    }

    /// Force and torque along one axis: the sensitivities are integrals by hand.
    #[test]
    fn the_criterion_of_one_axis_by_hand() {
        let case = case();
        let z: Vec<f64> = (0..240).map(|i| [0.8, 0.0, 0.0, 0.5, 0.0, 0.0][i % 6]).collect();
        let [mut with, mut without] = [WEIGHTS, [0.0; 4]].map(|w| OriginalCriterion::new(&case, w).unwrap());
        let found = with.evaluate(&z, &mut []) - without.evaluate(&z, &mut []);
        let (mass, inertia) = (case.task.parameters[0], case.task.parameters[4]);
        let (force, torque) = (0.5 * 0.15 / (mass * mass), 0.8 * 0.015 / (inertia * inertia));
        let expected: f64 = (0..40)
            .map(|k| {
                let t = 0.3 * f64::from(k);
                let moved = force * force * (t * t + 0.25 * t.powi(4));
                let turned = torque * torque * (t * t + t.powi(4) / 16.0);
                50.0 / (1.0 + moved).powi(2) + 20.0 / (1.0 + turned).powi(2) + 3.0 + 7.0
            })
            .sum();
        assert!((found - expected).abs() < 1e-6 * expected, "{found} is not {expected}");
    }

    #[test]
    fn the_curvature_is_factorised() {
        let (case, z) = (case(), stirred());
        let mut problem = OriginalCriterion::new(&case, WEIGHTS).unwrap();
        assert!(problem.linearize(&z) && problem.factorise(&[], 0.3));
        let (mut product, mut back) = (vec![0.0; 240], z.clone());
        problem.solve(&mut back);
        problem.curvature_times(&back, &mut product);
        assert!(product.iter().zip(&z).all(|(x, y)| (x - y).abs() < 1e-9));
        // no input is free
        assert!((0..240).all(|i| problem.curvature[(i, i)] > 2.0 * problem.effort(i)));
    }
}
