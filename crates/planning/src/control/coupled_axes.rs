//! Three axes that obstacles tie together.

use super::gram_program::{BlockProgram, JointPart};
use super::{AxisPlan, AxisProblem, GramProgram, GramSettings, GramStatus, GramWorkspace, Reach};
use crate::error::PlanningError;
use nalgebra::{Vector2, Vector3};

/// Planes along a plan for which memory is set up, each with both ends of its segment.
const PLANES: usize = 20;

/// A half-space that one node of a plan is kept in, with its tube: `normal . r <= offset`, in the axes of the plan.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct AxisPlane {
    /// What it keeps off.
    pub obstacle: usize,
    /// The segment it belongs to, from node `step - 1` to node `step`.
    pub step: usize,
    /// The node it is kept at.
    pub node: usize,
    /// Unit normal.
    pub normal: Vector3<f64>,
    /// Largest `normal . r`, m.
    pub offset_m: f64,
}

/// The program of three axes with planes across them, for one revision of the belief.
///
/// A plane that is kept at a node by the nominal motion and its tube, `n . z + sum |n_i| (scale_i * scaled_i + held_i + slack_i) <=
/// offset`, is kept there by every motion in the tube. The axes' own rows are set up once; planes may change at every decision.
#[derive(Clone, Debug)]
pub struct CoupledAxes {
    problems: [AxisProblem; 3],
    program: BlockProgram,
    workspace: GramWorkspace,
    settings: GramSettings,
    planes: Vec<AxisPlane>,
    previous: Vec<AxisPlane>,
    linear: Vec<f64>,
    lower: Vec<f64>,
    upper: Vec<f64>,
    plans: [AxisPlan; 3],
}

impl CoupledAxes {
    /// Sets up the solver, without planes yet.
    ///
    /// # Errors
    /// Axes of different steps; plans that need not end at rest: only at rest they keep oblique planes for ever.
    pub fn try_new(problems: [AxisProblem; 3]) -> Result<Self, PlanningError> {
        let [first, ..] = &problems;
        let steps = first.steps;
        for problem in &problems {
            if problem.steps != steps {
                return Err(PlanningError::WrongCount { what: "steps", given: problem.steps, expected: steps });
            }
            if problem.step_s.to_bits() != first.step_s.to_bits() {
                let (what, value, only) = ("the step of an axis", problem.step_s, first.step_s);
                return Err(PlanningError::OutOfRange { what, value, lower: only, upper: only });
            }
            if !problem.equality.contains(&true) {
                let what = "axes whose plans end at rest";
                return Err(PlanningError::WrongCount { what, given: 0, expected: 3 });
            }
        }
        let [x, y, z] = &problems;
        let blocks = [block(x)?, block(y)?, block(z)?];
        let room = 2 * PLANES * steps;
        let program = BlockProgram::new(blocks, room);
        let workspace = program.workspace();
        let with_room = |value: f64| {
            let mut bounds = Vec::with_capacity(program.own_rows() + room);
            bounds.resize(program.own_rows(), value);
            bounds
        };
        Ok(Self {
            settings: GramSettings { tolerance: 1e-10, iterations: 2000 },
            planes: Vec::with_capacity(room),
            previous: Vec::with_capacity(room),
            linear: vec![0.0; problems.iter().map(AxisProblem::unknowns).sum()],
            lower: with_room(f64::NEG_INFINITY),
            upper: with_room(f64::INFINITY),
            plans: [0, 1, 2].map(|_| AxisPlan::at_rest(0.0, steps)),
            workspace,
            program,
            problems,
        })
    }

    /// The programs of the axes.
    pub fn problems(&self) -> &[AxisProblem; 3] {
        &self.problems
    }

    /// The plans in force.
    pub fn plans(&self) -> &[AxisPlan; 3] {
        &self.plans
    }

    /// The planes in force.
    pub fn planes(&self) -> &[AxisPlane] {
        &self.planes
    }

    /// Iterations of the last search.
    pub fn iterations(&self) -> usize {
        self.workspace.iterations()
    }

    /// Begins anew: plans at rest where the states (position, velocity) are, with the widest tube, and no planes.
    pub fn begin(&mut self, states: &[Vector2<f64>; 3]) {
        for (plan, state) in self.plans.iter_mut().zip(states) {
            plan.start = Vector2::new(state.x, 0.0);
            plan.accelerations.fill(0.0);
            plan.scale = 1.0;
        }
        self.workspace.forget();
        self.set_planes(&[]);
    }

    /// Half-widths of the tube of the plans in force, slack included, m.
    pub fn tube_m(&self) -> Vector3<f64> {
        Vector3::from_fn(|i, _| width(&self.problems[i], self.plans[i].scale))
    }

    /// Nominal positions of the plans in force at the nodes, in their axes.
    pub fn positions(&self, positions: &mut Vec<Vector3<f64>>) {
        positions.clear();
        let mut states: [Vector2<f64>; 3] = core::array::from_fn(|i| self.plans[i].start);
        for node in 0..=self.problems[0].steps {
            positions.push(Vector3::from_fn(|i, _| states[i].x));
            for ((state, plan), problem) in states.iter_mut().zip(&self.plans).zip(&self.problems) {
                let gained = problem.step_s * plan.accelerations.get(node).copied().unwrap_or(0.0);
                *state = Vector2::new(state.x + problem.step_s * (state.y + 0.5 * gained), state.y + gained);
            }
        }
    }

    /// Where the plans from these measured states (position, velocity) can lead.
    pub fn reach(&self, states: &[Vector2<f64>; 3]) -> Reach {
        let tube = |problem: &AxisProblem| {
            let velocity = problem.scaled[3] + problem.held[3] + problem.slack[1];
            Vector2::new(width(problem, 1.0), velocity)
        };
        Reach {
            states: *states,
            tubes: [0, 1, 2].map(|i: usize| tube(&self.problems[i])),
            accelerations_m_s2: Vector3::from_fn(|i, _| self.problems[i].acceleration_m_s2),
        }
    }

    /// Takes over the planes of this decision; those of nodes that are not planned, or with a normal of no length, are left out.
    pub fn set_planes(&mut self, planes: &[AxisPlane]) {
        let steps = self.problems[0].steps;
        let is_planned = |plane: &&AxisPlane| plane.node <= steps && plane.normal.norm_squared() > 0.0;
        let planned = || planes.iter().filter(is_planned);
        let is_like = |(old, new): (&AxisPlane, &AxisPlane)| old.is_row_of(new) && old.normal == new.normal;
        let own = self.program.own_rows();
        if planned().count() == self.planes.len() && self.planes.iter().zip(planned()).all(is_like) {
            self.planes.clear();
            self.planes.extend(planned());
        } else {
            core::mem::swap(&mut self.planes, &mut self.previous);
            self.planes.clear();
            self.planes.extend(planned());
            self.program.set_joint(self.planes.iter().map(|plane| parts(&self.problems, plane)));
            let (old, new) = (&self.previous, &self.planes);
            self.program.fit(&mut self.workspace, |row| match row.checked_sub(own) {
                None => Some(row),
                Some(joint) => old.get(joint).and_then(|plane| find(new, joint, plane)).map(|joint| own + joint),
            });
        }
        self.lower.truncate(own);
        self.upper.truncate(own);
        for plane in &self.planes {
            let held = |i: usize| plane.normal[i].abs() * (self.problems[i].held[2] + self.problems[i].slack[0]);
            self.lower.push(f64::NEG_INFINITY);
            self.upper.push(plane.offset_m - (0..3).map(held).sum::<f64>());
        }
    }

    /// Plans from measured states (position, velocity) towards references (position and velocity at each node; the last stands
    /// for those missing). The plans in force are replaced where new ones are found.
    pub fn solve(&mut self, states: &[Vector2<f64>; 3], references: [&[Vector2<f64>]; 3]) -> GramStatus {
        let (unknowns, rows) = (self.program.first_unknowns(), self.program.first_rows());
        for (i, problem) in self.problems.iter().enumerate() {
            problem.linear(references[i], &mut self.linear[unknowns[i]..][..problem.unknowns()]);
            let count = problem.equality.len();
            let (lower, upper) = (&mut self.lower[rows[i]..][..count], &mut self.upper[rows[i]..][..count]);
            problem.bounds(&states[i], lower, upper);
        }
        let mut status = self.search();
        if matches!(status, GramStatus::Capped | GramStatus::Numerical) {
            // a warm start can be a dead end; what is asked is whether there is a plan
            self.workspace.forget();
            status = self.search();
        }
        if status == GramStatus::Solved {
            let solution = self.workspace.solution();
            for ((plan, problem), first) in self.plans.iter_mut().zip(&self.problems).zip(unknowns) {
                plan.assign(&solution[first..][..problem.unknowns()]);
            }
        }
        status
    }

    fn search(&mut self) -> GramStatus {
        self.program.solve(&self.linear, &self.lower, &self.upper, &self.settings, &mut self.workspace)
    }

    /// One step on: the plans in force. The next search begins with the rows that were active: most stay where they are along the
    /// plan, at its limits and at what it leans on, rather than come nearer by a step.
    pub fn advance(&mut self) {
        for (plan, problem) in self.plans.iter_mut().zip(&self.problems) {
            plan.shift(problem);
        }
    }
}

/// Half-width of the tube of one axis, slack included, m.
fn width(problem: &AxisProblem, scale: f64) -> f64 {
    scale * problem.scaled[2] + problem.held[2] + problem.slack[0]
}

/// The program of an axis with rows that bound nothing: its positions at all nodes, and the scale of its tube.
fn block(problem: &AxisProblem) -> Result<GramProgram, PlanningError> {
    let mut rows = problem.rows.clone();
    let mut equality = problem.equality.clone();
    for node in 0..=problem.steps {
        let [position, _] = problem.node_rows(node);
        rows.extend_from_slice(&position);
        equality.push(false);
    }
    let scale = problem.scale_index();
    rows.extend((0..problem.unknowns()).map(|i| if i == scale { 1.0 } else { 0.0 }));
    equality.push(false);
    GramProgram::try_new(&problem.hessian, &rows, &equality)
}

/// The row of a plane by those rows.
fn parts(problems: &[AxisProblem; 3], plane: &AxisPlane) -> [JointPart; 3] {
    core::array::from_fn(|i| {
        let (own, along) = (problems[i].equality.len(), plane.normal[i]);
        [(own + plane.node, along), (own + problems[i].steps + 1, along.abs() * problems[i].scaled[2])]
    })
}

impl AxisPlane {
    /// Whether another keeps off the same, at the same place of the plan.
    fn is_row_of(&self, other: &Self) -> bool {
        (self.obstacle, self.step, self.node) == (other.obstacle, other.step, other.node)
    }
}

/// The place of a plane among new ones; they mostly keep their order.
fn find(planes: &[AxisPlane], index: usize, old: &AxisPlane) -> Option<usize> {
    let (before, after) = planes.split_at(index.min(planes.len()));
    let behind = before.iter().rposition(|plane| plane.is_row_of(old));
    behind.or_else(|| after.iter().position(|plane| plane.is_row_of(old)).map(|i| before.len() + i))
}
