//! Three axes of a tube that half-spaces couple: 84 unknowns and 736 rows.

use super::{Matrices, SETTINGS, STEPS, uniform};
use tumble_planning::control::{
    AxisGain, AxisLimits, AxisProblem, AxisRequest, AxisTemplate, GramProgram, GramStatus, GramWorkspace, MassInterval,
    SymmetricBox, Terminal, TubeDisturbance, TubeWeights,
};
use tumble_planning::nalgebra::{Vector2, Vector3};

const MASS_KG: f64 = 9.58;
const HALF_SPACES: usize = 10;
const HALF_WIDTHS_M: [f64; 3] = [0.45, 1.15, 0.55];
const DISTURBANCE: [f64; 2] = [1e-4, 2e-4];

/// `normal . position <= offset_m` at every step.
#[derive(Clone, Copy, Debug)]
pub struct HalfSpace {
    pub normal: Vector3<f64>,
    pub offset_m: f64,
}

pub struct Coupled {
    pub axes: Vec<AxisProblem>,
    pub half_spaces: Vec<HalfSpace>,
    pub matrices: Matrices,
    /// Upper bounds of the rows of half-spaces.
    upper: Vec<f64>,
}

impl Coupled {
    pub fn new(seed: &mut u64) -> Self {
        let template = AxisTemplate::try_new(AxisGain::default(), &SymmetricBox(Vector2::from(DISTURBANCE))).unwrap();
        let axes = HALF_WIDTHS_M.map(|half_width| {
            AxisProblem::try_new(&AxisRequest {
                template: &template,
                mass: MassInterval::between(0.5 * MASS_KG, 1.5 * MASS_KG).unwrap(),
                limits: AxisLimits { force_n: 0.15, speed_m_s: 0.05, walls_m: [-half_width, half_width] },
                shortfall: 0.0,
                disturbance: TubeDisturbance {
                    position_m: 0.0,
                    velocity_m_s: 0.0,
                    force_n: 0.0,
                    acceleration_m_s2: 0.0,
                },
                weights: TubeWeights::DEFAULT,
                steps: STEPS,
                terminal: Terminal::Rest,
            })
            .unwrap()
        });
        let half_spaces: Vec<_> = (0..HALF_SPACES)
            .map(|_| HalfSpace {
                normal: Vector3::from_fn(|_, _| uniform(seed) + uniform(seed) + uniform(seed)).normalize(),
                offset_m: 0.325 + 0.075 * uniform(seed),
            })
            .collect();
        let n = axes[0].unknowns();
        let mut matrices = Matrices { hessian: vec![0.0; 9 * n * n], ..Matrices::default() };
        let mut upper = Vec::new();
        for (axis, problem) in axes.iter().enumerate() {
            for (i, row) in problem.hessian.chunks_exact(n).enumerate() {
                matrices.hessian[(axis * n + i) * 3 * n + axis * n..][..n].copy_from_slice(row);
            }
            matrices.equality.extend(&problem.equality);
            for row in problem.rows.chunks_exact(n) {
                let mut padded = vec![0.0; 3 * n];
                padded[axis * n..][..n].copy_from_slice(row);
                matrices.rows.extend(padded);
            }
        }
        for half_space in &half_spaces {
            for node in 1..=STEPS {
                let mut row = vec![0.0; 3 * n];
                let mut bound = half_space.offset_m;
                for (axis, problem) in axes.iter().enumerate() {
                    let along = half_space.normal[axis];
                    for (entry, position) in row[axis * n..].iter_mut().zip(&problem.node_rows(node)[0]) {
                        *entry = along * position;
                    }
                    row[axis * n + problem.scale_index()] += along.abs() * problem.scaled[2];
                    bound -= along.abs() * (problem.held[2] + problem.slack[0]);
                }
                matrices.rows.extend(row);
                matrices.equality.push(false);
                upper.push(bound);
            }
        }
        Self { axes: axes.into(), half_spaces, matrices, upper }
    }
}

/// Missions one after the other, each from another start to another goal.
pub struct CoupledLoop {
    pub coupled: Coupled,
    pub program: GramProgram,
    pub workspace: GramWorkspace,
    pub linear: Vec<f64>,
    pub lower: Vec<f64>,
    pub upper: Vec<f64>,
    pub states: [Vector2<f64>; 3],
    pub goal: [f64; 3],
    mass_kg: f64,
    seed: u64,
}

impl CoupledLoop {
    pub fn new() -> Self {
        let mut seed = 3;
        let coupled = Coupled::new(&mut seed);
        let program = coupled.matrices.program();
        Self {
            workspace: GramWorkspace::new(&program),
            linear: vec![0.0; program.unknowns()],
            lower: vec![f64::NEG_INFINITY; program.rows()],
            upper: vec![f64::INFINITY; program.rows()],
            states: [Vector2::zeros(); 3],
            goal: [0.0; 3],
            mass_kg: MASS_KG,
            seed,
            coupled,
            program,
        }
    }

    /// Another start at rest, goal and mass; nothing is known of what is active.
    pub fn restart(&mut self) {
        let mut point =
            || Vector3::new(0.35, 1.0, 0.45).component_mul(&Vector3::from_fn(|_, _| uniform(&mut self.seed)));
        let half_spaces = &self.coupled.half_spaces;
        let start = loop {
            let start = point();
            if half_spaces.iter().all(|half_space| half_space.normal.dot(&start) < half_space.offset_m - 0.06) {
                break start;
            }
        };
        self.goal = point().into();
        self.states = [0, 1, 2].map(|axis| Vector2::new(start[axis], 0.0));
        self.mass_kg = MASS_KG * if uniform(&mut self.seed) > 0.0 { 1.5 } else { 0.5 };
        self.workspace.forget();
    }

    pub fn write(&mut self) {
        let n = self.coupled.axes[0].unknowns();
        let mut first = 0;
        for (axis, problem) in self.coupled.axes.iter().enumerate() {
            problem.linear(&[Vector2::new(self.goal[axis], 0.0)], &mut self.linear[axis * n..][..n]);
            let rows = first..first + problem.equality.len();
            problem.bounds(&self.states[axis], &mut self.lower[rows.clone()], &mut self.upper[rows.clone()]);
            first = rows.end;
        }
        self.upper[first..].copy_from_slice(&self.coupled.upper);
    }

    pub fn solve(&mut self) -> GramStatus {
        self.program.solve(&self.linear, &self.lower, &self.upper, &SETTINGS, &mut self.workspace)
    }

    /// Largest force asked for beyond the limit, and largest amount by which the position is beyond a half-space.
    pub fn advance(&mut self) -> [f64; 2] {
        let n = self.coupled.axes[0].unknowns();
        let mut worst = [f64::NEG_INFINITY; 2];
        for (axis, problem) in self.coupled.axes.iter().enumerate() {
            let plan = &self.workspace.solution()[axis * n..][..n];
            let state = &mut self.states[axis];
            let error = *state - Vector2::new(plan[0], plan[1]);
            let force_n = problem.center_kg * (plan[2] + problem.feedback.dot(&error));
            worst[0] = f64::max(worst[0], force_n.abs() - problem.force_n);
            let acceleration = force_n / self.mass_kg;
            let pushed = DISTURBANCE.map(|size| if uniform(&mut self.seed) > 0.0 { size } else { -size });
            let step_s = problem.step_s;
            *state +=
                Vector2::new(state.y + 0.5 * step_s * acceleration, acceleration) * step_s + Vector2::from(pushed);
        }
        let position = Vector3::from_fn(|axis, _| self.states[axis].x);
        let beyond = self.coupled.half_spaces.iter().map(|plane| plane.normal.dot(&position) - plane.offset_m);
        worst[1] = beyond.fold(f64::NEG_INFINITY, f64::max);
        worst
    }
}
