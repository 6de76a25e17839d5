//! The quadratic program of one axis: the nominal motion, its start, and the size of the tube around it.

use super::{AxisTemplate, MassInterval, discrete_lqr};
use crate::error::{PlanningError, finite, not_negative, positive};
use crate::vectors::add_scaled;
use nalgebra::{Matrix2, SMatrix, Vector2};

/// What the tube around the nominal motion must hold beside the uncertain mass, each bound in world axes.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TubeDisturbance {
    /// Error of the measured position on each axis, m.
    pub position_m: f64,
    /// Error of the measured velocity on each axis, m/s; the scarce budget: what it adds to the tube's input is the largest.
    pub velocity_m_s: f64,
    /// Force from outside on each axis, N.
    pub force_n: f64,
    /// Acceleration of the tracked point from outside on each axis, m/s^2.
    pub acceleration_m_s2: f64,
}

impl TubeDisturbance {
    /// Half-widths of what the errors of measurement add to the measured state from one decision to the next: an error now, carried
    /// forward by the step, and one then.
    pub fn of_measurement(&self, step_s: f64) -> Vector2<f64> {
        Vector2::new(2.0 * self.position_m + step_s * self.velocity_m_s, 2.0 * self.velocity_m_s)
    }
}

/// Where the nominal motion of an axis may end.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum Terminal {
    /// Where it can still be stopped inside the walls.
    StopSet,
    /// At rest, anywhere.
    Rest,
}

/// What a nominal motion is judged by, per decision.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TubeWeights {
    /// Of the squared position error, 1/m^2.
    pub position: f64,
    /// Of the squared velocity error, s^2/m^2.
    pub velocity: f64,
    /// Of the squared acceleration, s^4/m^2.
    pub acceleration: f64,
    /// Of the squared scale of the tube.
    pub scale: f64,
}

impl TubeWeights {
    /// Quick but smooth.
    pub const DEFAULT: Self = Self { position: 10.0, velocity: 30.0, acceleration: 100.0, scale: 0.01 };
}

/// The limits of one axis.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct AxisLimits {
    /// Largest force, N.
    pub force_n: f64,
    /// Largest speed, m/s.
    pub speed_m_s: f64,
    /// Least and largest position of the tracked point, m; infinite where there is no wall.
    pub walls_m: [f64; 2],
}

/// What one axis is asked to do, for one revision of the belief.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct AxisRequest<'a> {
    /// Gain and unit tubes.
    pub template: &'a AxisTemplate,
    /// Where the mass is.
    pub mass: MassInterval,
    /// What the axis may do.
    pub limits: AxisLimits,
    /// Largest share by which the force along the axis falls short of the commanded one, beside the mass.
    pub shortfall: f64,
    /// Force and acceleration from outside, and the errors of measurement once more; those of the template hold the step.
    pub disturbance: TubeDisturbance,
    /// What is judged.
    pub weights: TubeWeights,
    /// Decisions planned.
    pub steps: usize,
    /// Where the plan may end.
    pub terminal: Terminal,
}

/// The program of one axis: unknowns are the nominal start `z0` (position, velocity), `steps` accelerations, and the scale of
/// the tube. Nothing in it but the tube's size knows the mass.
///
/// # Source
/// Thesis 2.4.2; the tube is homothetic, with the start free.
#[derive(Clone, Debug)]
pub struct AxisProblem {
    /// Decisions planned.
    pub steps: usize,
    /// Length of a step, s.
    pub step_s: f64,
    /// The mass that turns accelerations into forces, kg.
    pub center_kg: f64,
    /// The mass interval the tube holds.
    pub mass: MassInterval,
    /// Largest force, N.
    pub force_n: f64,
    /// Nominal acceleration left at scale one, m/s^2, and what of it each unit of scale gives.
    pub acceleration_m_s2: f64,
    /// `acceleration = scale * scaled_acceleration - held_acceleration`.
    pub scaled_acceleration: f64,
    /// See [`Self::scaled_acceleration`].
    pub held_acceleration: f64,
    /// Distance of each face of the tube from the centre, for each unit of scale.
    pub scaled: [f64; 5],
    /// The same for no scale.
    pub held: [f64; 5],
    /// Least and largest position of the tracked point, m.
    pub walls_m: [f64; 2],
    /// What tightens positions and velocities beside the tube: errors of measurement, overshoot between decisions.
    pub slack: [f64; 2],
    /// Least scale.
    pub least_scale: f64,
    /// The faces' unit normals.
    pub normals: [Vector2<f64>; 5],
    /// Stiffness and damping as a row, acceleration per error; negative.
    pub feedback: Vector2<f64>,
    /// n x n, row-major.
    pub hessian: Vec<f64>,
    /// m x n, row-major.
    pub rows: Vec<f64>,
    /// Rows that hold with equality.
    pub equality: Vec<bool>,
    /// Bounds at the state zero.
    pub lower: Vec<f64>,
    /// Bounds at the state zero.
    pub upper: Vec<f64>,
    /// What the measured state adds to both bounds of each row.
    pub of_state: Vec<Vector2<f64>>,
    weights: TubeWeights,
    terminal_cost: Matrix2<f64>,
}

/// Most decisions that can be planned: building a program takes the third power of it.
const MOST_STEPS: usize = 100;
/// Smallest size of a tube that an excess is measured by, m or m/s.
const LEAST_FACE: f64 = 1e-3;
/// Most steps a stop may take.
const LONGEST_STOP: u32 = 500;

fn at_most(what: &'static str, value: f64, most: u32) -> Result<f64, PlanningError> {
    let upper = f64::from(most);
    if value <= upper { Ok(value) } else { Err(PlanningError::OutOfRange { what, value, lower: 1.0, upper }) }
}

/// The rows while they are collected.
struct Rows {
    unknowns: usize,
    entries: Vec<f64>,
    equality: Vec<bool>,
    lower: Vec<f64>,
    upper: Vec<f64>,
    of_state: Vec<Vector2<f64>>,
}

impl Rows {
    /// Index of the new row.
    fn add(&mut self, row: &[f64], upper: f64) -> usize {
        self.entries.extend_from_slice(row);
        self.equality.push(false);
        self.lower.push(f64::NEG_INFINITY);
        self.upper.push(upper);
        self.of_state.push(Vector2::zeros());
        self.upper.len() - 1
    }

    fn blank(&self) -> Vec<f64> {
        vec![0.0; self.unknowns]
    }
}

impl AxisProblem {
    /// Gathers the program of one axis.
    ///
    /// # Errors
    /// Numbers out of range; [`PlanningError::NotPositive`] for "the acceleration left" where the tube takes all the force there is.
    pub fn try_new(request: &AxisRequest<'_>) -> Result<Self, PlanningError> {
        let AxisRequest { template, mass, limits, disturbance, weights, steps, terminal, .. } = *request;
        let step_s = template.gain.step_s;
        let force_n = positive("the force limit", limits.force_n)?;
        let speed = positive("the speed limit", limits.speed_m_s)?;
        let shortfall = not_negative("the shortfall of force", request.shortfall)?;
        let outside = not_negative("the force from outside", disturbance.force_n)? / mass.least_kg()
            + not_negative("the acceleration from outside", disturbance.acceleration_m_s2)?;
        let errors = [
            not_negative("the error of the position", disturbance.position_m)?,
            not_negative("the error of the velocity", disturbance.velocity_m_s)?,
        ];
        if !(1..=MOST_STEPS).contains(&steps) {
            let (value, upper) = (steps as f64, MOST_STEPS as f64);
            return Err(PlanningError::OutOfRange { what: "the decisions planned", value, lower: 1.0, upper });
        }
        let center_kg = mass.center_kg();
        let limit = force_n / center_kg;
        let uncertainty = mass.uncertainty() + (1.0 + mass.uncertainty()) * shortfall;
        let matched = uncertainty * limit;
        let scaled = template.matched.map(|face| matched * face);
        let held: [f64; 5] = core::array::from_fn(|i| template.unmatched[i] + outside * template.matched[i]);
        let feedback = template.gain.feedback();
        let steepness = f64::sqrt(feedback.norm_squared());
        let scaled_acceleration = limit - scaled[4] * steepness;
        let held_acceleration = template.reserved * held[4] * steepness;
        let acceleration_m_s2 = positive("the acceleration left", scaled_acceleration - held_acceleration)?;
        // what moves faster than the plan's straight lines between two decisions
        let overshoot = (limit * (1.0 + mass.uncertainty()) + outside) * step_s * step_s / 8.0;
        let mut problem = Self {
            steps,
            step_s,
            center_kg,
            mass,
            force_n,
            acceleration_m_s2,
            scaled_acceleration,
            held_acceleration,
            scaled,
            held,
            slack: [errors[0] + overshoot, errors[1]],
            walls_m: limits.walls_m,
            // a little above the least possible, so that the input rows are not all active at rest
            least_scale: f64::min(1.0, held_acceleration / scaled_acceleration + 0.05),
            normals: template.normals,
            feedback,
            hessian: Vec::new(),
            rows: Vec::new(),
            equality: Vec::new(),
            lower: Vec::new(),
            upper: Vec::new(),
            of_state: Vec::new(),
            weights,
            terminal_cost: Matrix2::zeros(),
        };
        problem.judge()?;
        problem.gather(speed, terminal)?;
        Ok(problem)
    }

    /// Number of unknowns.
    pub fn unknowns(&self) -> usize {
        self.steps + 3
    }

    /// Index of the tube's scale among the unknowns.
    pub fn scale_index(&self) -> usize {
        self.steps + 2
    }

    /// Position and velocity of the nominal motion at a node as rows over the unknowns.
    pub fn node_rows(&self, node: usize) -> [Vec<f64>; 2] {
        let (mut position, mut velocity) = (vec![0.0; self.unknowns()], vec![0.0; self.unknowns()]);
        let h = self.step_s;
        (position[0], position[1], velocity[1]) = (1.0, node as f64 * h, 1.0);
        for k in 0..node.min(self.steps) {
            position[2 + k] = h * h * ((node - 1 - k) as f64 + 0.5);
            velocity[2 + k] = h;
        }
        [position, velocity]
    }

    fn judge(&mut self) -> Result<(), PlanningError> {
        let TubeWeights { position, velocity, acceleration, scale } = self.weights;
        let (position, velocity) =
            (positive("the weight of the position", position)?, not_negative("the weight of the velocity", velocity)?);
        let acceleration = positive("the weight of the acceleration", acceleration)?;
        let scale = positive("the weight of the scale", scale)?;
        let h = self.step_s;
        let (a, b) = (Matrix2::new(1.0, h, 0.0, 1.0), Vector2::new(0.5 * h * h, h));
        let node = Matrix2::from_diagonal(&Vector2::new(position, velocity));
        self.terminal_cost = discrete_lqr(&a, &b, &node, &SMatrix::<f64, 1, 1>::new(acceleration))?.1;
        let n = self.unknowns();
        let mut hessian = vec![0.0; n * n];
        for k in 0..=self.steps {
            let cost = if k < self.steps { node } else { self.terminal_cost };
            let nodes = self.node_rows(k);
            for (i, row) in hessian.chunks_exact_mut(n).enumerate() {
                let left = Vector2::new(nodes[0][i], nodes[1][i]);
                let weighted = cost * left;
                add_scaled(row, weighted.x, &nodes[0]);
                add_scaled(row, weighted.y, &nodes[1]);
            }
        }
        for i in 2..n {
            hessian[i * n + i] += if i == self.scale_index() { scale } else { acceleration };
        }
        self.hessian = hessian;
        Ok(())
    }

    fn gather(&mut self, speed: f64, terminal: Terminal) -> Result<(), PlanningError> {
        let n = self.unknowns();
        let scale = self.scale_index();
        let mut rows = Rows {
            unknowns: n,
            entries: Vec::new(),
            equality: Vec::new(),
            lower: Vec::new(),
            upper: Vec::new(),
            of_state: Vec::new(),
        };
        // the measured state is in the tube around the start
        for (face, normal) in self.normals.iter().enumerate() {
            for sign in [1.0, -1.0] {
                let mut row = rows.blank();
                (row[0], row[1], row[scale]) = (-sign * normal.x, -sign * normal.y, -self.scaled[face]);
                let index = rows.add(&row, self.held[face]);
                rows.of_state[index] = normal * -sign;
            }
        }
        for k in 0..self.steps {
            for sign in [1.0, -1.0] {
                let mut row = rows.blank();
                (row[2 + k], row[scale]) = (sign, -self.scaled_acceleration);
                rows.add(&row, -self.held_acceleration);
            }
        }
        let step_s = self.step_s;
        let tightened = |limit: f64, i: usize| limit - self.held[2 + i] - self.slack[i];
        let room = |what, value| positive(what, value);
        room("the speed left beside the tube", tightened(speed, 1) - self.scaled[3] * self.least_scale)?;
        let walls = self.walls_m;
        let walled = [walls[0].is_finite(), walls[1].is_finite()];
        let mut largest_scale = 1.0;
        if walled[0] && walled[1] {
            let half = tightened(0.5 * (walls[1] - walls[0]), 0);
            // a braking step away from one wall must not end at the other
            let needed = self.scaled[2] + step_s * step_s * self.scaled_acceleration;
            room("the room left between the walls", half - needed * self.least_scale)?;
            largest_scale = f64::min(1.0, half / needed);
        }
        for (wall, open) in walls.into_iter().zip([f64::NEG_INFINITY, f64::INFINITY]) {
            if !wall.is_finite() && wall.total_cmp(&open).is_ne() {
                finite("a wall", wall)?;
            }
        }
        for k in 1..=self.steps {
            let nodes = self.node_rows(k);
            let sides = [
                (1, 1.0, tightened(speed, 1), true),
                (1, -1.0, tightened(speed, 1), true),
                (0, 1.0, tightened(walls[1], 0), walled[1]),
                (0, -1.0, tightened(-walls[0], 0), walled[0]),
            ];
            for (which, sign, upper, there) in sides {
                if !there {
                    continue;
                }
                let mut row: Vec<f64> = nodes[which].iter().map(|entry| sign * entry).collect();
                row[scale] += self.scaled[2 + which];
                rows.add(&row, upper);
            }
        }
        let mut row = rows.blank();
        row[scale] = 1.0;
        let index = rows.add(&row, largest_scale);
        rows.lower[index] = self.least_scale;
        let [position, velocity] = self.node_rows(self.steps);
        match terminal {
            Terminal::Rest => {
                let index = rows.add(&velocity, 0.0);
                rows.lower[index] = 0.0;
                rows.equality[index] = true;
            }
            Terminal::StopSet if walled[0] || walled[1] => {
                let stopping = f64::ceil(speed / (self.acceleration_m_s2 * step_s)) + 1.0;
                let stopping = at_most("the steps to a stop", stopping, LONGEST_STOP)?;
                for later in (1..=LONGEST_STOP).map(f64::from).take_while(|j| *j <= stopping) {
                    let later = later * step_s;
                    let gained = 0.5 * later * later;
                    for (sign, wall, there) in [(1.0, walls[1], walled[1]), (-1.0, -walls[0], walled[0])] {
                        if !there {
                            continue;
                        }
                        let mut row: Vec<f64> = position.iter().map(|entry| sign * entry).collect();
                        add_scaled(&mut row, sign * later, &velocity);
                        row[scale] += self.scaled[2] - gained * self.scaled_acceleration;
                        rows.add(&row, tightened(wall, 0) - gained * self.held_acceleration);
                    }
                }
                // a smaller tube brakes less: at rest when the rows above end, whatever the scale
                for sign in [1.0, -1.0] {
                    let mut row: Vec<f64> = velocity.iter().map(|entry| sign * entry).collect();
                    row[scale] -= stopping * step_s * self.scaled_acceleration;
                    rows.add(&row, -stopping * step_s * self.held_acceleration);
                }
            }
            Terminal::StopSet => {}
        }
        let Rows { entries, equality, lower, upper, of_state, .. } = rows;
        (self.rows, self.equality, self.lower, self.upper) = (entries, equality, lower, upper);
        self.of_state = of_state;
        Ok(())
    }

    /// The linear part of the cost for a reference, position and velocity at each node; missing nodes are at the last one given.
    /// Effort is what goes beyond the acceleration between the nodes' velocities, so that what can be followed is.
    pub fn linear(&self, reference: &[Vector2<f64>], linear: &mut [f64]) {
        let weight = Vector2::new(self.weights.position, self.weights.velocity);
        let at = |k: usize| reference.get(k).or(reference.last()).copied().unwrap_or_default();
        let h = self.step_s;
        let mut adjoint = self.terminal_cost * at(self.steps);
        for k in (0..self.steps).rev() {
            if let Some(entry) = linear.get_mut(2 + k) {
                let wanted = (at(k + 1).y - at(k).y) / h;
                *entry = -(0.5 * h * h * adjoint.x + h * adjoint.y + self.weights.acceleration * wanted);
            }
            let here = at(k).component_mul(&weight);
            adjoint = Vector2::new(adjoint.x + here.x, h * adjoint.x + adjoint.y + here.y);
        }
        if let [position, velocity, ..] = linear {
            (*position, *velocity) = (-adjoint.x, -adjoint.y);
        }
        if let Some(scale) = linear.get_mut(self.scale_index()) {
            *scale = 0.0;
        }
    }

    /// The bounds of all rows at a measured state (position, velocity).
    pub fn bounds(&self, state: &Vector2<f64>, lower: &mut [f64], upper: &mut [f64]) {
        for (((low, high), shift), (to_low, to_high)) in
            self.lower.iter().zip(&self.upper).zip(&self.of_state).zip(lower.iter_mut().zip(upper.iter_mut()))
        {
            let shift = shift.x * state.x + shift.y * state.y;
            *to_low = low + shift;
            *to_high = high + shift;
        }
    }

    /// Largest excess of an error (position, velocity) over the faces of the tube of a scale, as a share of their distances (a
    /// millimetre or a millimetre per second at least); not positive inside.
    pub fn outside(&self, error: &Vector2<f64>, scale: f64) -> f64 {
        let excess = |i: usize| {
            let distance = f64::max(scale * self.scaled[i] + self.held[i], LEAST_FACE);
            (self.normals[i].dot(error).abs() - distance) / distance
        };
        (0..self.normals.len()).map(excess).fold(f64::NEG_INFINITY, f64::max)
    }
}

#[cfg(test)]
mod tests;
