//! One axis with its solver: the plan of each decision, and the plan that stands where no better one is found.

use super::{AxisProblem, AxisRequest, GramProgram, GramSettings, GramStatus, GramWorkspace};
use crate::error::PlanningError;
use nalgebra::Vector2;

/// What one axis is to do: the nominal motion, and the size of the tube around it.
#[derive(Clone, Debug, PartialEq)]
pub struct AxisPlan {
    /// Nominal position and velocity now, m, m/s.
    pub start: Vector2<f64>,
    /// Nominal acceleration of each step, m/s^2.
    pub accelerations: Vec<f64>,
    /// Scale of the tube; one is the largest that the mass interval can ask for.
    pub scale: f64,
}

impl AxisPlan {
    /// At rest in a place, the tube at its widest.
    pub fn at_rest(position_m: f64, steps: usize) -> Self {
        Self { start: Vector2::new(position_m, 0.0), accelerations: vec![0.0; steps], scale: 1.0 }
    }

    /// Nominal state after a number of steps; beyond the last it coasts.
    pub fn node(&self, step_s: f64, node: usize) -> Vector2<f64> {
        let coasting = core::iter::repeat(0.0);
        let accelerations = self.accelerations.iter().copied().chain(coasting).take(node);
        accelerations.fold(self.start, |state, acceleration| stepped(&state, acceleration, step_s))
    }

    /// Takes over an answer of the solver: start, accelerations, scale.
    pub(super) fn assign(&mut self, solution: &[f64]) {
        if let [position, velocity, accelerations @ .., scale] = solution {
            self.start = Vector2::new(*position, *velocity);
            for (to, from) in self.accelerations.iter_mut().zip(accelerations) {
                *to = *from;
            }
            self.scale = *scale;
        }
    }

    /// The same plan one step later. It ends in braking, which keeps every limit where the plan itself did.
    pub(super) fn shift(&mut self, problem: &AxisProblem) {
        let step_s = problem.step_s;
        let end = self.node(step_s, self.accelerations.len());
        self.start = self.node(step_s, 1);
        self.accelerations.rotate_left(1);
        if let Some(last) = self.accelerations.last_mut() {
            *last = problem.braking(self.scale, &end);
        }
    }
}

/// A step of constant acceleration.
fn stepped(state: &Vector2<f64>, acceleration: f64, step_s: f64) -> Vector2<f64> {
    let gained = acceleration * step_s;
    Vector2::new(state.x + step_s * (state.y + 0.5 * gained), state.y + gained)
}

impl AxisProblem {
    /// The nominal acceleration that keeps a state of the terminal set in it: to rest, and where that ended beyond a wall, no
    /// farther than the wall.
    fn braking(&self, scale: f64, state: &Vector2<f64>) -> f64 {
        let step_s = self.step_s;
        let limit = f64::max(0.0, scale * self.scaled_acceleration - self.held_acceleration);
        let tube = scale * self.scaled[2] + self.held[2] + self.slack[0];
        let reaching = |wall: f64| 2.0 * (wall - state.x - step_s * state.y) / (step_s * step_s);
        let to_rest = -state.y / step_s;
        let short = to_rest.min(reaching(self.walls_m[1] - tube)).max(reaching(self.walls_m[0] + tube));
        short.clamp(-limit, limit)
    }

    /// The force that follows a plan from a measured state (position, velocity), N.
    ///
    /// Inside the tube it is inside the limit, up to rounding that is cut here.
    pub fn force_n(&self, plan: &AxisPlan, state: &Vector2<f64>) -> f64 {
        let planned = plan.accelerations.first().copied().unwrap_or(0.0);
        let acceleration = planned + self.feedback.dot(&(state - plan.start));
        (self.center_kg * acceleration).clamp(-self.force_n, self.force_n)
    }
}

/// One axis, for one revision of the belief, with its solver.
#[derive(Clone, Debug)]
pub struct AxisTube {
    problem: AxisProblem,
    program: GramProgram,
    workspace: GramWorkspace,
    settings: GramSettings,
    linear: Vec<f64>,
    lower: Vec<f64>,
    upper: Vec<f64>,
    plan: AxisPlan,
}

impl AxisTube {
    /// Sets up the solver.
    ///
    /// # Errors
    /// Those of [`AxisProblem::try_new`].
    pub fn try_new(request: &AxisRequest<'_>) -> Result<Self, PlanningError> {
        Self::of(AxisProblem::try_new(request)?)
    }

    /// The same for a program.
    ///
    /// # Errors
    /// Those of [`GramProgram::try_new`].
    pub fn of(problem: AxisProblem) -> Result<Self, PlanningError> {
        let program = GramProgram::try_new(&problem.hessian, &problem.rows, &problem.equality)?;
        let workspace = GramWorkspace::new(&program);
        let (unknowns, rows) = (problem.unknowns(), problem.equality.len());
        Ok(Self {
            program,
            workspace,
            settings: GramSettings { tolerance: 1e-11, iterations: 400 },
            linear: vec![0.0; unknowns],
            lower: vec![0.0; rows],
            upper: vec![0.0; rows],
            plan: AxisPlan::at_rest(0.0, problem.steps),
            problem,
        })
    }

    /// The program.
    pub fn problem(&self) -> &AxisProblem {
        &self.problem
    }

    /// The plan in force.
    pub fn plan(&self) -> &AxisPlan {
        &self.plan
    }

    /// Iterations of the last search.
    pub fn iterations(&self) -> usize {
        self.workspace.iterations()
    }

    /// Plans from a measured state towards a reference (position and velocity at each node; the last stands for those missing).
    /// The plan in force is replaced where one is found.
    pub fn solve(&mut self, state: &Vector2<f64>, reference: &[Vector2<f64>]) -> GramStatus {
        let mut status = self.search(state, reference);
        if status != GramStatus::Solved {
            // a warm start can be a dead end; what is asked is whether there is a plan
            self.workspace.forget();
            status = self.search(state, reference);
        }
        if status == GramStatus::Solved {
            self.plan.assign(self.workspace.solution());
        }
        status
    }

    fn search(&mut self, state: &Vector2<f64>, reference: &[Vector2<f64>]) -> GramStatus {
        self.problem.linear(reference, &mut self.linear);
        self.problem.bounds(state, &mut self.lower, &mut self.upper);
        self.program.solve(&self.linear, &self.lower, &self.upper, &self.settings, &mut self.workspace)
    }

    /// The force for a measured state, N.
    pub fn force_n(&self, state: &Vector2<f64>) -> f64 {
        self.problem.force_n(&self.plan, state)
    }

    /// One step on: the plan in force. The rows that were active stay where the next search begins: with the start free they are
    /// mostly active again, at the same places of the plan.
    pub fn advance(&mut self) {
        self.plan.shift(&self.problem);
    }
}

#[cfg(test)]
mod tests;
