//! A local plan as a problem in its inputs alone: every state follows from them.

mod conditions;
#[cfg(test)]
pub(super) mod tests;

use super::answer::CostParts;
use super::curvature::small::{accumulate, transpose_times};
use super::curvature::{Curvature, Factorisation};
use super::information::{
    ArrowFactor, ColumnSweep, InformationCost, InformationValue, add_information_gradient, gather, information_columns,
    pairs,
};
use super::model::{Array2, InformativeModel, KINEMATICS, Kinematics, StepDerivatives};
use super::problem::CondensedProblem;
use super::request::{LocalSettings, Reference, TerminalRegion};
use super::rows::MotionRow;
use super::stages::Stages;
use super::surroundings::{RowSettings, Surroundings};
use nalgebra::SMatrix;

/// What one plan is asked for, ready for sweeps.
#[derive(Clone, Debug)]
pub(super) struct Task<'a, S, const X: usize, const U: usize, const P: usize> {
    pub settings: &'a LocalSettings<X, U>,
    pub start: &'a S,
    pub reference: Reference<'a, S>,
    pub terminal: Option<TerminalRegion>,
    pub surroundings: &'a Surroundings,
    pub row_settings: RowSettings,
    pub information: InformationCost<P>,
    /// Effort and acceleration: the cost is `u' E u`.
    pub effort: Array2<U, U>,
    /// Coordinate of the kinematics and its largest absolute value at the nodes.
    pub speed_limits: Vec<(usize, f64)>,
}

/// The motion that inputs lead to.
#[derive(Clone, Debug)]
struct Rollout<S, const X: usize, const P: usize> {
    states: Vec<S>,
    sensitivities: Vec<Array2<P, X>>,
    kinematics: Vec<Kinematics>,
    information: SMatrix<f64, P, P>,
}

impl<S, const X: usize, const P: usize> Rollout<S, X, P> {
    fn new(nodes: usize) -> Self {
        Self {
            states: Vec::with_capacity(nodes),
            sensitivities: Vec::with_capacity(nodes),
            kinematics: Vec::with_capacity(nodes),
            information: SMatrix::zeros(),
        }
    }
}

/// Gradient of a row by the changes of one node, or of the two nodes of a segment.
#[derive(Clone, Copy, Debug)]
struct StateRow<const X: usize> {
    /// The first node.
    node: usize,
    by_start: [f64; X],
    /// Zero for a row of one node.
    by_end: [f64; X],
}

/// All memory of a plan.
#[derive(Clone, Debug)]
pub(super) struct Workspace<S, const X: usize, const U: usize, const P: usize> {
    current: Rollout<S, X, P>,
    trial: Rollout<S, X, P>,
    derivatives: Vec<StepDerivatives<X, U, P>>,
    stages: Stages<X, U>,
    /// Derivatives of the information matrix, one column per pair of parameters.
    columns: Vec<f64>,
    sweep: ColumnSweep<X>,
    arrow_factor: ArrowFactor,
    curvature: Curvature<X, U>,
    gradient: Vec<f64>,
    row_values: Vec<f64>,
    state_rows: Vec<StateRow<X>>,
    motion_rows: Vec<MotionRow>,
    /// Adjoints, or changes of the nodes.
    node_vectors: Vec<[f64; X]>,
    kinematics_by_state: Vec<Array2<KINEMATICS, X>>,
    /// Curvature of the last node without that of the terminal rows.
    terminal_curvature: Array2<X, X>,
    /// Columns that moving contacts may add.
    contacts: usize,
    value: Option<InformationValue<P>>,
    parts: CostParts,
}

impl<S: Clone, const X: usize, const U: usize, const P: usize> Workspace<S, X, U, P> {
    /// Memory for plans of so many steps.
    pub fn new(steps: usize, factorisation: Factorisation) -> Self {
        let unknowns = steps * U;
        let contacts = 2 * steps;
        let columns = pairs(P) + contacts;
        Self {
            current: Rollout::new(steps + 1),
            trial: Rollout::new(steps + 1),
            derivatives: vec![StepDerivatives::zeros(); steps],
            stages: Stages::new(steps, columns),
            columns: vec![0.0; pairs(P) * unknowns],
            sweep: ColumnSweep::new(P),
            arrow_factor: ArrowFactor::new(P),
            curvature: Curvature::new(factorisation, steps, columns),
            gradient: vec![0.0; unknowns],
            row_values: Vec::new(),
            state_rows: Vec::new(),
            motion_rows: Vec::new(),
            node_vectors: vec![[0.0; X]; steps + 1],
            kinematics_by_state: vec![[[0.0; X]; KINEMATICS]; steps + 1],
            terminal_curvature: [[0.0; X]; X],
            contacts,
            value: None,
            parts: CostParts { tracking: 0.0, effort: 0.0, information: 0.0 },
        }
    }
}

/// A plan's problem: `z` are the inputs in units of their limits, step after step.
///
/// Its rows: the half-spaces of the inputs, step by step; speeds and rates, node by node; the terminal region; what the
/// surroundings ask for.
#[derive(Debug)]
pub(super) struct Shooting<'a, M: InformativeModel<X, U, P>, const X: usize, const U: usize, const P: usize> {
    pub model: &'a M,
    pub task: Task<'a, M::State, X, U, P>,
    pub workspace: &'a mut Workspace<M::State, X, U, P>,
    measurement: Array2<X, X>,
}

/// What measurements of a node leave of sensitivities.
fn retained<const X: usize, const P: usize>(sensitivity: &Array2<P, X>, share: &[f64; X]) -> Array2<P, X> {
    sensitivity.map(|row| core::array::from_fn(|i| row[i] * share[i]))
}

fn dot<const X: usize>(a: &[f64; X], b: &[f64; X]) -> f64 {
    a.iter().zip(b).map(|(a, b)| a * b).sum()
}

/// `J' diag(w) J`, and nothing where the weights are zero.
fn weighted_square<const R: usize, const C: usize>(weights: &[f64; R], jacobian: &Array2<R, C>) -> Array2<C, C> {
    let mut square = [[0.0; C]; C];
    for (weight, row) in weights.iter().zip(jacobian) {
        if *weight != 0.0 {
            for (sums, factor) in square.iter_mut().zip(row) {
                accumulate(weight * factor, row, sums);
            }
        }
    }
    square
}

impl<'a, M: InformativeModel<X, U, P>, const X: usize, const U: usize, const P: usize> Shooting<'a, M, X, U, P> {
    /// The problem of one plan. The rows' memory grows here, once.
    pub fn new(
        model: &'a M,
        task: Task<'a, M::State, X, U, P>,
        workspace: &'a mut Workspace<M::State, X, U, P>,
    ) -> Self {
        let settings = task.settings;
        let measurement = core::array::from_fn(|i| core::array::from_fn(|j| settings.measurement[(i, j)]));
        let barrier_rows = task.surroundings.rows(settings.steps, &task.row_settings);
        let node_rows = 2 * settings.steps * task.speed_limits.len() + 2 * usize::from(task.terminal.is_some());
        let input_rows = settings.steps * settings.wrench.half_spaces.len();
        let empty = StateRow { node: 0, by_start: [0.0; X], by_end: [0.0; X] };
        let no_motion = [0.0; KINEMATICS];
        workspace.state_rows.clear();
        workspace.state_rows.resize(node_rows + barrier_rows, empty);
        workspace.motion_rows.clear();
        let empty = MotionRow { node: 0, value: 0.0, by_start: no_motion, by_end: no_motion, contact: None };
        workspace.motion_rows.resize(barrier_rows, empty);
        workspace.row_values.clear();
        workspace.row_values.resize(input_rows + node_rows + barrier_rows, 0.0);
        Self { model, task, workspace, measurement }
    }

    fn input_rows(&self) -> usize {
        self.task.settings.steps * self.task.settings.wrench.half_spaces.len()
    }

    fn barrier_rows_start(&self) -> usize {
        self.workspace.row_values.len() - self.workspace.motion_rows.len()
    }

    /// Index of a barrier row among those of the surroundings.
    pub fn barrier_row(&self, row: usize) -> Option<usize> {
        row.checked_sub(self.barrier_rows_start())
    }

    /// Inputs of a step in SI units.
    pub fn input(&self, z: &[f64], step: usize) -> [f64; U] {
        let limit = &self.task.settings.wrench.limit;
        core::array::from_fn(|i| z.get(step * U + i).copied().unwrap_or(f64::NAN) * limit[i])
    }

    /// States at the current point.
    pub fn states(&self) -> &[M::State] {
        &self.workspace.current.states
    }

    /// Sensitivities at the current point.
    pub fn sensitivities(&self) -> &[Array2<P, X>] {
        &self.workspace.current.sensitivities
    }

    /// Information at the current point, the prior included.
    #[cfg(test)]
    pub fn information(&self) -> &SMatrix<f64, P, P> {
        &self.workspace.current.information
    }

    /// What the measurements of a node tell.
    pub fn measurement(&self) -> &Array2<X, X> {
        &self.measurement
    }

    /// The parts of the cost at the current point.
    pub fn parts(&self) -> CostParts {
        self.workspace.parts
    }

    fn reference(&self, node: usize) -> Option<&'a M::State> {
        match self.task.reference {
            Reference::Hold(state) => Some(state),
            Reference::Nodes(states) => states.get(node),
        }
    }

    fn tracking_weights(&self, node: usize) -> &'a [f64; X] {
        let settings = self.task.settings;
        if node == settings.steps { &settings.terminal } else { &settings.tracking }
    }

    /// Rolls out; with derivatives where they have a place.
    fn roll_out(
        &self,
        z: &[f64],
        rollout: &mut Rollout<M::State, X, P>,
        mut derivatives: Option<&mut [StepDerivatives<X, U, P>]>,
    ) -> bool {
        let settings = self.task.settings;
        rollout.states.clear();
        rollout.sensitivities.clear();
        rollout.kinematics.clear();
        rollout.information = self.task.information.prior;
        let mut state = self.task.start.clone();
        let mut sensitivity = [[0.0; X]; P];
        for k in 0..settings.steps {
            let input = self.input(z, k);
            let left = retained(&sensitivity, &settings.retained);
            let next = match derivatives.as_deref_mut().and_then(|all| all.get_mut(k)) {
                Some(place) => self.model.differentiate(&state, &left, &input, settings.step_s, place),
                None => self.model.step(&state, &left, &input, settings.step_s),
            };
            let Some((next_state, next_sensitivity)) = next else { return false };
            gather(&mut rollout.information, &self.measurement, &next_sensitivity);
            rollout.kinematics.push(self.model.kinematics(&state));
            rollout.states.push(core::mem::replace(&mut state, next_state));
            rollout.sensitivities.push(core::mem::replace(&mut sensitivity, next_sensitivity));
        }
        rollout.kinematics.push(self.model.kinematics(&state));
        rollout.states.push(state);
        rollout.sensitivities.push(sensitivity);
        true
    }

    /// The cost of a rollout; `None` where it has none.
    fn price(&self, z: &[f64], rollout: &Rollout<M::State, X, P>) -> Option<(CostParts, Option<InformationValue<P>>)> {
        let mut tracking = 0.0;
        for (node, state) in rollout.states.iter().enumerate() {
            let (residual, _) = self.model.residual(state, self.reference(node)?);
            tracking += residual.iter().zip(self.tracking_weights(node)).map(|(r, w)| w * r * r).sum::<f64>();
        }
        let mut effort = 0.0;
        for k in 0..self.task.settings.steps {
            let input = self.input(z, k);
            effort += dot(&input, &transpose_times(&self.task.effort, &input));
        }
        let value =
            if self.task.information.matters() { Some(self.task.information.of(&rollout.information)?) } else { None };
        let information = value.as_ref().map_or(0.0, |value| value.value);
        let parts = CostParts { tracking, effort, information };
        parts.total().is_finite().then_some((parts, value))
    }

    /// Gradient, stages and information at the current point.
    fn linearize_cost(&mut self) {
        let settings = self.task.settings;
        let limit = &settings.wrench.limit;
        let steps = settings.steps;
        // curvature and gradient by the nodes
        for node in 1..=steps {
            let Some((state, reference)) = self.workspace.current.states.get(node).zip(self.reference(node)) else {
                return;
            };
            let (residual, jacobian) = self.model.residual(state, reference);
            let weights = self.tracking_weights(node).map(|weight| 2.0 * weight);
            let weighted = core::array::from_fn(|i| weights[i] * residual[i]);
            self.workspace.node_vectors[node] = transpose_times(&jacobian, &weighted);
            self.workspace.stages.state_curvature[node - 1] = weighted_square(&weights, &jacobian);
        }
        let Workspace {
            stages, derivatives, gradient, node_vectors, columns, sweep, arrow_factor, value, current, ..
        } = &mut *self.workspace;
        for (k, step) in derivatives.iter().enumerate() {
            stages.by_state[k] = step.by_state;
            stages.by_input[k] = step.by_input.map(|row| core::array::from_fn(|i| row[i] * limit[i]));
            let effort = &self.task.effort;
            stages.input_curvature[k] =
                core::array::from_fn(|i| core::array::from_fn(|j| 2.0 * effort[i][j] * limit[i] * limit[j]));
        }
        let mut adjoint = [0.0; X];
        for k in (0..steps).rev() {
            accumulate(1.0, &node_vectors[k + 1], &mut adjoint);
            let by_input = transpose_times(&stages.by_input[k], &adjoint);
            gradient[k * U..(k + 1) * U].copy_from_slice(&by_input);
            adjoint = transpose_times(&stages.by_state[k], &adjoint);
        }
        stages.arrow.clear();
        if let Some(value) = value {
            let sensitivities = &current.sensitivities;
            let measured = (&self.measurement, &settings.retained);
            information_columns::<M, X, U, P>(derivatives, sensitivities, measured, limit, sweep, columns);
            add_information_gradient(value, columns, gradient);
            arrow_factor.append(value, columns, gradient.len(), &mut stages.arrow);
        }
        if let Some(last) = self.workspace.stages.state_curvature.last() {
            self.workspace.terminal_curvature = *last;
        }
    }

    fn add_effort_gradient(&mut self, z: &[f64]) {
        let limit = &self.task.settings.wrench.limit;
        for k in 0..self.task.settings.steps {
            let by_input = transpose_times(&self.task.effort, &self.input(z, k));
            for ((sum, force), limit) in self.workspace.gradient[k * U..(k + 1) * U].iter_mut().zip(by_input).zip(limit)
            {
                *sum += 2.0 * force * limit;
            }
        }
    }
}

impl<M: InformativeModel<X, U, P>, const X: usize, const U: usize, const P: usize> CondensedProblem
    for Shooting<'_, M, X, U, P>
{
    fn unknowns(&self) -> usize {
        self.task.settings.steps * U
    }

    fn rows(&self) -> usize {
        self.workspace.row_values.len()
    }

    fn evaluate(&mut self, z: &[f64], rows: &mut [f64]) -> f64 {
        let mut trial = core::mem::replace(&mut self.workspace.trial, Rollout::new(0));
        let is_motion = self.roll_out(z, &mut trial, None);
        let price = is_motion.then(|| self.price(z, &trial)).flatten();
        if price.is_some() {
            self.plain_rows(z, &trial.kinematics, rows);
            let barriers = self.barrier_rows_start();
            self.task.surroundings.values(&trial.kinematics, &self.task.row_settings, &mut rows[barriers..]);
        }
        self.workspace.trial = trial;
        price.map_or(f64::INFINITY, |(parts, _)| parts.total())
    }

    fn linearize(&mut self, z: &[f64]) -> bool {
        let mut current = core::mem::replace(&mut self.workspace.current, Rollout::new(0));
        let mut derivatives = core::mem::take(&mut self.workspace.derivatives);
        let is_motion = self.roll_out(z, &mut current, Some(&mut derivatives));
        let price = is_motion.then(|| self.price(z, &current)).flatten();
        self.workspace.current = current;
        self.workspace.derivatives = derivatives;
        let Some((parts, value)) = price else { return false };
        self.workspace.parts = parts;
        self.workspace.value = value;
        let mut values = core::mem::take(&mut self.workspace.row_values);
        self.plain_rows(z, &self.workspace.current.kinematics, &mut values);
        self.workspace.row_values = values;
        self.linearize_cost();
        self.add_effort_gradient(z);
        self.linearize_rows();
        true
    }

    fn cost(&self) -> f64 {
        self.workspace.parts.total()
    }

    fn gradient(&self) -> &[f64] {
        &self.workspace.gradient
    }

    fn row_values(&self) -> &[f64] {
        &self.workspace.row_values
    }

    fn rows_along(&mut self, x: &[f64], changes: &mut [f64]) {
        let settings = self.task.settings;
        let limit = &settings.wrench.limit;
        let mut changes = changes.iter_mut();
        for scaled in x.chunks_exact(U) {
            for ((normal, offset), change) in settings.wrench.half_spaces.iter().zip(&mut changes) {
                let along: f64 = normal.iter().zip(scaled).zip(limit).map(|((n, z), l)| n * z * l).sum();
                *change = -along / offset;
            }
        }
        let Workspace { stages, node_vectors, state_rows, .. } = &mut *self.workspace;
        let mut change = [0.0; X];
        node_vectors[0] = change;
        for (k, scaled) in x.chunks_exact(U).enumerate() {
            let mut next = [0.0; X];
            for ((sum, by_state), by_input) in next.iter_mut().zip(&stages.by_state[k]).zip(&stages.by_input[k]) {
                *sum = dot(by_state, &change) + by_input.iter().zip(scaled).map(|(a, b)| a * b).sum::<f64>();
            }
            change = next;
            node_vectors[k + 1] = change;
        }
        for (row, change) in state_rows.iter().zip(&mut changes) {
            let first = node_vectors.get(row.node).map_or(0.0, |node| dot(&row.by_start, node));
            let second = node_vectors.get(row.node + 1).map_or(0.0, |node| dot(&row.by_end, node));
            *change = first + second;
        }
    }

    fn add_row(&mut self, row: usize, factor: f64, gradient: &mut [f64]) {
        let input_rows = self.input_rows();
        if let Some(index) = row.checked_sub(input_rows) {
            if let Some(row) = self.workspace.state_rows.get(index) {
                Self::sweep_back(&self.workspace.stages, row, factor, gradient);
            }
            return;
        }
        let wrench = &self.task.settings.wrench;
        let count = wrench.half_spaces.len();
        if let Some((normal, offset)) = wrench.half_spaces.get(row % count.max(1)) {
            let k = row / count.max(1);
            for ((sum, normal), limit) in gradient[k * U..(k + 1) * U].iter_mut().zip(normal).zip(&wrench.limit) {
                *sum -= factor * normal * limit / offset;
            }
        }
    }

    fn add_rows(&mut self, factors: &[f64], gradient: &mut [f64]) {
        let input_rows = self.input_rows();
        for (row, factor) in factors.iter().enumerate().take(input_rows) {
            if *factor != 0.0 {
                self.add_row(row, *factor, gradient);
            }
        }
        let Workspace { stages, node_vectors, state_rows, .. } = &mut *self.workspace;
        node_vectors.fill([0.0; X]);
        for (row, factor) in state_rows.iter().zip(factors.iter().skip(input_rows)) {
            if *factor != 0.0 {
                if let Some(node) = node_vectors.get_mut(row.node) {
                    accumulate(*factor, &row.by_start, node);
                }
                if let Some(node) = node_vectors.get_mut(row.node + 1) {
                    accumulate(*factor, &row.by_end, node);
                }
            }
        }
        let mut adjoint = [0.0; X];
        for k in (0..stages.by_state.len()).rev() {
            accumulate(1.0, &node_vectors[k + 1], &mut adjoint);
            let by_input = transpose_times(&stages.by_input[k], &adjoint);
            for (sum, entry) in gradient[k * U..(k + 1) * U].iter_mut().zip(by_input) {
                *sum += entry;
            }
            adjoint = transpose_times(&stages.by_state[k], &adjoint);
        }
    }

    fn factorise(&mut self, multipliers: &[f64], damping: f64) -> bool {
        let unknowns = self.unknowns();
        let columns = if self.workspace.value.is_some() { pairs(P) * unknowns } else { 0 };
        self.workspace.stages.arrow.truncate(columns);
        self.add_terminal_curvature(multipliers);
        self.append_contacts(multipliers);
        let Workspace { curvature, stages, .. } = &mut *self.workspace;
        curvature.factorise(stages, damping)
    }

    fn curvature_times(&mut self, x: &[f64], product: &mut [f64]) {
        let Workspace { curvature, stages, .. } = &mut *self.workspace;
        curvature.times(stages, x, product);
    }

    fn solve(&mut self, x: &mut [f64]) {
        let Workspace { curvature, stages, .. } = &mut *self.workspace;
        curvature.solve(stages, x);
    }
}
