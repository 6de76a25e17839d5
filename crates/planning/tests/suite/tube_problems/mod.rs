//! Quadratic programs of tube controllers: a frozen nominal one, and three axes coupled by half-spaces.
#![allow(dead_code, clippy::unwrap_used, reason = "tests and benches each use a part")]

pub mod coupled;
pub mod random;

use tumble_planning::control::{GramProgram, GramSettings, GramStatus, GramWorkspace};
use tumble_planning::nalgebra::{Matrix2, Vector2};

#[path = "../uniform/mod.rs"]
mod uniform;

pub use uniform::uniform;

pub const STEP_S: f64 = 0.2;
pub const STEPS: usize = 25;
pub const SETTINGS: GramSettings = GramSettings { tolerance: 1e-10, iterations: 1000 };

/// `A` and `b` of an axis whose input is an acceleration.
pub fn axis() -> (Matrix2<f64>, Vector2<f64>) {
    (Matrix2::new(1.0, STEP_S, 0.0, 1.0), Vector2::new(0.5 * STEP_S * STEP_S, STEP_S))
}

/// Cost to go and feedback of the regulator, from steps of the Riccati equation.
pub fn regulator(
    a: &Matrix2<f64>,
    b: &Vector2<f64>,
    tracking: &Matrix2<f64>,
    effort: f64,
) -> (Matrix2<f64>, Vector2<f64>) {
    let (mut p, mut k) = (*tracking, Vector2::zeros());
    for _ in 0..5000 {
        k = -(a.transpose() * p * b) / (effort + b.dot(&(p * b)));
        p = tracking + a.transpose() * p * (a + b * k.transpose());
        p = (p + p.transpose()) * 0.5;
    }
    (p, k)
}

/// A program by its matrices, row by row.
#[derive(Clone, Debug, Default)]
pub struct Matrices {
    pub hessian: Vec<f64>,
    pub rows: Vec<f64>,
    pub equality: Vec<bool>,
}

impl Matrices {
    pub fn program(&self) -> GramProgram {
        GramProgram::try_new(&self.hessian, &self.rows, &self.equality).unwrap()
    }
}

/// Rows that give the states after each step: `columns` unknowns, of which the first inputs come at `first_input`.
fn predictions(a: &Matrix2<f64>, b: &Vector2<f64>, columns: usize, first_input: usize) -> [Vec<Vec<f64>>; 2] {
    let mut states = [vec![vec![0.0; columns]], vec![vec![0.0; columns]]];
    for step in 0..STEPS {
        let mut by_input = [states[0][step].clone(), states[1][step].clone()];
        for column in 0..columns {
            let next = a * Vector2::new(states[0][step][column], states[1][step][column]);
            (by_input[0][column], by_input[1][column]) = (next.x, next.y);
        }
        by_input[0][first_input + step] += b.x;
        by_input[1][first_input + step] += b.y;
        states.iter_mut().zip(by_input).for_each(|(states, next)| states.push(next));
    }
    states
}

/// Adds `weight a b'`.
fn add_product(matrix: &mut [f64], weight: f64, a: &[f64], b: &[f64]) {
    for (row, a) in matrix.chunks_exact_mut(b.len()).zip(a) {
        row.iter_mut().zip(b).for_each(|(entry, b)| *entry += weight * a * b);
    }
}

/// Per axis: forces over 25 steps, with forces, positions and velocities in boxes narrowed by an invariant set. One program
/// serves the three axes, of which only the boxes differ.
pub struct Nominal {
    pub matrices: Matrices,
    a: Matrix2<f64>,
    b: Vector2<f64>,
    tracking: Matrix2<f64>,
    terminal: Matrix2<f64>,
    pub feedback: Vector2<f64>,
    /// Support of the invariant set along position, velocity and force.
    pub supports: [f64; 3],
    /// Powers of `A`.
    powers: Vec<Matrix2<f64>>,
    /// By initial state and by goal.
    linear: Vec<[f64; 4]>,
    /// Half-widths of the rows of each axis.
    limits: [Vec<f64>; 3],
}

pub const NOMINAL_GOAL: [[f64; 2]; 3] = [[0.3, 0.0], [1.0, 0.0], [0.2, 0.0]];
pub const NOMINAL_START: [[f64; 2]; 3] = [[-0.2, 0.0], [0.0, 0.0], [-0.2, 0.0]];

impl Nominal {
    pub fn new() -> Self {
        let (a, mut b) = axis();
        b /= 9.5838;
        let tracking = Matrix2::new(10.0, 0.0, 0.0, 1.0);
        let (terminal, feedback) = regulator(&a, &b, &tracking, 1.0);
        // Rakovic's set: so many terms that the next would add at most the share `alpha` of `W`.
        let (half_widths, accuracy) = (Vector2::new(5e-4, 1e-3), 1e-3);
        let closed = a + b * feedback.transpose();
        let support = |power: &Matrix2<f64>, d: &Vector2<f64>| (power.transpose() * d).abs().dot(&half_widths);
        let (mut power, mut sums, mut terms) = (Matrix2::identity(), Vector2::zeros(), [0.0; 3]);
        let alpha = loop {
            let directions = [Vector2::x(), Vector2::y(), feedback];
            terms.iter_mut().zip(&directions).for_each(|(sum, d)| *sum += support(&power, d));
            sums += Vector2::new(support(&power, &directions[0]), support(&power, &directions[1]));
            power = closed * power;
            let share = |i: usize| support(&power, &directions[i]) / half_widths[i];
            let alpha = f64::max(share(0), share(1));
            if alpha <= accuracy / (accuracy + sums.max()) {
                break alpha;
            }
        };
        let supports = terms.map(|sum| sum / (1.0 - alpha));

        let [positions, velocities] = predictions(&a, &b, STEPS, 0);
        let mut powers = vec![Matrix2::identity()];
        (0..STEPS).for_each(|step| powers.push(a * powers[step]));
        let mut hessian = vec![0.0; STEPS * STEPS];
        let mut linear = vec![[0.0; 4]; STEPS];
        for step in 0..=STEPS {
            let weight = if step < STEPS { tracking } else { terminal };
            let states = [&positions[step], &velocities[step]];
            for (i, j) in [(0, 0), (0, 1), (1, 0), (1, 1)] {
                add_product(&mut hessian, weight[(i, j)], states[i], states[j]);
            }
            let by_state = weight * powers[step];
            for (input, linear) in linear.iter_mut().enumerate() {
                for j in 0..2 {
                    for i in 0..2 {
                        linear[j] += states[i][input] * by_state[(i, j)];
                        linear[2 + j] -= states[i][input] * weight[(i, j)];
                    }
                }
            }
        }
        (0..STEPS).for_each(|i| hessian[i * STEPS + i] += 1.0);
        let mut rows = Vec::new();
        for step in 0..STEPS {
            rows.extend((0..STEPS).map(|input| f64::from(u8::from(input == step))));
        }
        rows.extend(positions[1..].iter().flatten());
        rows.extend(velocities[1..].iter().flatten());
        let limits = [(0.452, 0.59), (0.216, 3.04), (0.257, 0.69)].map(|(force_n, position_m)| {
            let widths = [force_n - supports[2], position_m - supports[0], 0.2 - supports[1]];
            widths.iter().flat_map(|width| vec![*width; STEPS]).collect()
        });
        let equality = vec![false; 3 * STEPS];
        let matrices = Matrices { hessian, rows, equality };
        Self { matrices, a, b, tracking, terminal, feedback, supports, powers, linear, limits }
    }

    /// What each row becomes one step later.
    pub fn shift() -> Vec<Option<usize>> {
        (0..3 * STEPS).map(|row| if row % STEPS == 0 { None } else { Some(row - 1) }).collect()
    }

    /// Writes the linear part and the bounds of an axis.
    pub fn write(&self, axis: usize, z: [f64; 2], room: &mut NominalRoom) {
        let goal = NOMINAL_GOAL[axis];
        for (entry, by) in room.linear.iter_mut().zip(&self.linear) {
            *entry = by[0] * z[0] + by[1] * z[1] + by[2] * goal[0] + by[3] * goal[1];
        }
        room.lower.iter_mut().zip(&self.limits[axis]).for_each(|(lower, limit)| *lower = -limit);
        room.upper.copy_from_slice(&self.limits[axis]);
        for (step, power) in self.powers[1..].iter().enumerate() {
            let free = power * Vector2::from(z);
            for (row, free) in [(STEPS + step, free.x), (2 * STEPS + step, free.y)] {
                room.lower[row] -= free;
                room.upper[row] -= free;
            }
        }
    }

    /// Cost of a plan, with its part by the initial state; and by how much it is beyond a limit.
    pub fn cost_and_violation(&self, axis: usize, z: [f64; 2], inputs: &[f64]) -> (f64, f64) {
        let goal = Vector2::from(NOMINAL_GOAL[axis]);
        let (mut state, mut cost, mut violation) = (Vector2::from(z), 0.0, f64::NEG_INFINITY);
        for step in 0..=STEPS {
            let weight = if step < STEPS { self.tracking } else { self.terminal };
            cost += 0.5 * state.dot(&(weight * state)) - goal.dot(&(weight * state));
            if let Some(input) = inputs.get(step).filter(|_| step < STEPS) {
                cost += 0.5 * input * input;
                state = self.a * state + self.b * *input;
                let over = |value: f64, row: usize| value.abs() - self.limits[axis][row];
                let beyond = [over(*input, step), over(state.x, STEPS + step), over(state.y, 2 * STEPS + step)];
                violation = beyond.iter().fold(violation, |most, beyond| f64::max(most, *beyond));
            }
        }
        (cost, violation)
    }

    pub fn next(&self, z: [f64; 2], force: f64) -> [f64; 2] {
        (self.a * Vector2::from(z) + self.b * force).into()
    }
}

pub struct NominalRoom {
    pub linear: Vec<f64>,
    pub lower: Vec<f64>,
    pub upper: Vec<f64>,
}

/// Three axes in closed loop.
pub struct NominalLoop {
    pub nominal: Nominal,
    pub program: GramProgram,
    pub shift: Vec<Option<usize>>,
    pub room: NominalRoom,
    pub workspaces: [GramWorkspace; 3],
    pub states: [[f64; 2]; 3],
}

impl NominalLoop {
    pub fn new() -> Self {
        let nominal = Nominal::new();
        let program = nominal.matrices.program();
        let workspace = GramWorkspace::new(&program);
        Self {
            shift: Nominal::shift(),
            room: NominalRoom { linear: vec![0.0; STEPS], lower: vec![0.0; 3 * STEPS], upper: vec![0.0; 3 * STEPS] },
            workspaces: [workspace.clone(), workspace.clone(), workspace],
            states: NOMINAL_START,
            nominal,
            program,
        }
    }

    pub fn restart(&mut self) {
        self.states = NOMINAL_START;
        self.workspaces.iter_mut().for_each(GramWorkspace::forget);
    }

    /// Solves the three programs of the current states.
    pub fn solve(&mut self, is_warm: bool) {
        for axis in 0..3 {
            let workspace = &mut self.workspaces[axis];
            if is_warm {
                workspace.shift(&self.shift);
            } else {
                workspace.forget();
            }
            let room = &mut self.room;
            self.nominal.write(axis, self.states[axis], room);
            let status = self.program.solve(&room.linear, &room.lower, &room.upper, &SETTINGS, workspace);
            assert_eq!(status, GramStatus::Solved, "axis {axis}");
        }
    }

    /// Applies the first inputs.
    pub fn advance(&mut self) {
        for (state, workspace) in self.states.iter_mut().zip(&self.workspaces) {
            *state = self.nominal.next(*state, workspace.solution()[0]);
        }
    }
}
