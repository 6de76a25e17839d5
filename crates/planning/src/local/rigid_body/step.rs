//! One step of a body whose origin need not be its centre of mass, with all its derivatives.

use super::arrays::{M3, V3, V4, cross, is_zero, plus, product, rotation, skew, times, transpose_times};
use super::turning::{
    Along, Effort, Lanes, Rotor, RotorChange, Turn, TurnAlong, TurnLanes, turn, turn_along, turn_along_by_start,
    turn_by_start,
};
use crate::local::model::{Array2, StepDerivatives};

/// What a step needs of a body.
#[derive(Clone, Copy, Debug)]
pub struct Body {
    /// 1/kg.
    pub mass_inverse: f64,
    /// Body axes, m.
    pub center_of_mass: V3,
    /// How it turns about the centre of mass.
    pub rotor: Rotor,
}

impl Body {
    /// Acceleration of the origin and angular acceleration of the resting body by torque and force, body axes.
    pub fn acceleration_by_input(&self) -> Array2<6, 6> {
        let (c, inverse) = (&self.center_of_mass, &self.rotor.inverse);
        let spun_by_force = product(inverse, &skew(&c.map(|x| -x)));
        let (moved, mut moved_by_force) = (product(&skew(c), inverse), product(&skew(c), &spun_by_force));
        for (i, row) in moved_by_force.iter_mut().enumerate() {
            row[i] += self.mass_inverse;
        }
        let row = |by_torque: &V3, by_force: &V3| {
            let ([t0, t1, t2], [f0, f1, f2]) = (*by_torque, *by_force);
            [t0, t1, t2, f0, f1, f2]
        };
        let rows = moved.iter().zip(&moved_by_force).chain(inverse.iter().zip(&spun_by_force));
        let mut accelerations = [[0.0; 6]; 6];
        for (acceleration, (by_torque, by_force)) in accelerations.iter_mut().zip(rows) {
            *acceleration = row(by_torque, by_force);
        }
        accelerations
    }
}

/// The change of a body and of the wrench on it with a parameter.
#[derive(Clone, Copy, Debug)]
pub struct Direction {
    /// Of the inverse mass.
    pub mass_inverse: f64,
    /// Of the centre of mass.
    pub center_of_mass: V3,
    /// Of the inertia.
    pub rotor: RotorChange,
    /// Of the torque, over the torque commanded, axis by axis.
    pub torque_scale: V3,
    /// Of the torque besides.
    pub torque_bias: V3,
    /// Of the force, over the force commanded, axis by axis.
    pub force_scale: V3,
    /// Of the force besides.
    pub force_bias: V3,
}

/// The start of a step: all that its end depends on, beside the translations that it copies.
#[derive(Clone, Copy, Debug)]
pub struct Start {
    /// Rotation matrix of the attitude.
    pub world_from_body: M3,
    /// Body axes, rad/s.
    pub rate: V3,
    /// Held over the step, body axes, about the origin, N m.
    pub torque: V3,
    /// Held over the step, body axes, N.
    pub force: V3,
    /// s.
    pub step_s: f64,
}

/// Lanes of the derivatives: attitude, rate, torque and force, three each.
const WIDE: usize = 12;
type Wide = [f64; WIDE];
const NONE: Wide = [0.0; WIDE];

/// Position, velocity, attitude and rate of a change.
#[derive(Clone, Copy, Debug)]
struct Change {
    position: V3,
    velocity: V3,
    attitude: V3,
    rate: V3,
}

impl Change {
    #[inline(always)]
    fn new(x: &[f64; 12]) -> Self {
        Self {
            position: [x[0], x[1], x[2]],
            velocity: [x[3], x[4], x[5]],
            attitude: [x[6], x[7], x[8]],
            rate: [x[9], x[10], x[11]],
        }
    }

    #[inline(always)]
    fn to_array(self) -> [f64; 12] {
        let ([p0, p1, p2], [v0, v1, v2]) = (self.position, self.velocity);
        let ([a0, a1, a2], [w0, w1, w2]) = (self.attitude, self.rate);
        [p0, p1, p2, v0, v1, v2, a0, a1, a2, w0, w1, w2]
    }
}

/// A step taken.
#[derive(Clone, Copy, Debug)]
pub struct Step<'a> {
    body: &'a Body,
    start: &'a Start,
    effort: Effort,
    turn: Turn,
    /// Rotation of the step.
    turned: M3,
    /// Velocity of the origin about the centre of mass at the end, in body axes, turned about.
    lever_rate: V3,
    /// Way of the origin beside that of its velocity at the start, body axes at the start.
    pub position: V3,
    /// Velocity of the origin gained, body axes at the start.
    pub velocity: V3,
}

/// The change of a step along one parameter.
struct StepAlong {
    turn: TurnAlong,
    effort: Effort,
    lever_rate: V3,
    /// Of [`Step::position`] and of the axes it is in.
    position: V3,
    /// Of [`Step::velocity`] and of the axes it is in.
    velocity: V3,
    /// The attitude's change at the start, in body axes at the end.
    attitude_before: V3,
}

impl<'a> Step<'a> {
    /// Takes it.
    #[inline]
    pub fn new(body: &'a Body, start: &'a Start) -> Self {
        let c = &body.center_of_mass;
        let effort = Effort {
            torque: plus(&start.torque, -1.0, &cross(c, &start.force)),
            push: start.force.map(|f| f * body.mass_inverse),
        };
        let turn = turn(&body.rotor, &start.rate, &effort, start.step_s);
        let turned = rotation(&turn.attitude, &turn.attitude);
        let (before, lever_rate) = (cross(&start.rate, c), cross(&turn.rate, c));
        let velocity = plus(&plus(&before, 1.0, &turn.velocity), -1.0, &times(&turned, &lever_rate));
        let position = plus(&plus(c, 1.0, &turn.position), -1.0, &times(&turned, c));
        Self {
            body,
            start,
            effort,
            turn,
            turned,
            lever_rate,
            position: plus(&position, start.step_s, &before),
            velocity,
        }
    }

    /// Attitude at the end, from the body axes at the start: a unit quaternion, the real part first.
    pub fn attitude(&self) -> V4 {
        self.turn.attitude
    }

    /// Rate at the end, body axes, rad/s.
    pub fn rate(&self) -> V3 {
        self.turn.rate
    }

    #[inline]
    fn along(&self, direction: &Direction, phi: &Change) -> (StepAlong, Change) {
        let (body, start, turn, step_s) = (self.body, self.start, &self.turn, self.start.step_s);
        let (c, changed_c) = (&body.center_of_mass, &direction.center_of_mass);
        let force: V3 = core::array::from_fn(|i| direction.force_scale[i] * start.force[i] + direction.force_bias[i]);
        let torque: V3 =
            core::array::from_fn(|i| direction.torque_scale[i] * start.torque[i] + direction.torque_bias[i]);
        let levered = plus(&cross(c, &force), 1.0, &cross(changed_c, &start.force));
        let push: V3 = core::array::from_fn(|i| direction.mass_inverse * start.force[i] + body.mass_inverse * force[i]);
        let effort = Effort { torque: plus(&torque, -1.0, &levered), push };
        let change = Along { rate: phi.rate, effort, rotor: &direction.rotor };
        let along = turn_along(&body.rotor, turn, &self.effort, &change, step_s);

        let before = plus(&cross(&phi.rate, c), 1.0, &cross(&start.rate, changed_c));
        let lever_rate = plus(&cross(&along.rate, c), 1.0, &cross(&turn.rate, changed_c));
        let swept_rate = plus(&cross(&along.attitude, &self.lever_rate), 1.0, &lever_rate);
        let swept = plus(&cross(&along.attitude, c), 1.0, changed_c);
        let velocity = plus(&plus(&before, 1.0, &along.velocity), -1.0, &times(&self.turned, &swept_rate));
        let position = plus(&plus(changed_c, 1.0, &along.position), -1.0, &times(&self.turned, &swept));
        let position = plus(&position, step_s, &before);
        let velocity = plus(&velocity, 1.0, &cross(&phi.attitude, &self.velocity));
        let position = plus(&position, 1.0, &cross(&phi.attitude, &self.position));
        let attitude_before = transpose_times(&self.turned, &phi.attitude);
        let end = Change {
            position: plus(&plus(&phi.position, step_s, &phi.velocity), 1.0, &times(&start.world_from_body, &position)),
            velocity: plus(&phi.velocity, 1.0, &times(&start.world_from_body, &velocity)),
            attitude: plus(&attitude_before, 1.0, &along.attitude),
            rate: along.rate,
        };
        (StepAlong { turn: along, effort, lever_rate, position, velocity, attitude_before }, end)
    }

    /// The sensitivity to one parameter at the end.
    #[inline]
    pub fn sensitivity(&self, direction: &Direction, phi: &[f64; 12]) -> [f64; 12] {
        self.along(direction, &Change::new(phi)).1.to_array()
    }

    /// The sensitivities at the end, and all derivatives.
    #[inline]
    pub fn differentiate<const P: usize>(
        &self,
        directions: &[Direction; P],
        sensitivity: &Array2<P, 12>,
        derivatives: &mut StepDerivatives<12, 6, P>,
    ) -> Array2<P, 12> {
        let (body, start, step_s) = (self.body, self.start, self.start.step_s);
        let c = &body.center_of_mass;
        let has_lever = !is_zero(c);
        let torque_by_force = skew(&c.map(|x| -x));
        let by_start = turn_by_start(&body.rotor, &self.turn, &self.effort, step_s);

        // the turn by attitude (nothing), rate, torque and force
        let mut turn = WideTurn::new(&by_start.end, &torque_by_force);
        add_diagonal(&mut turn.velocity, &self.turn.velocity_by_push, body.mass_inverse);
        add_diagonal(&mut turn.position, &self.turn.position_by_push, body.mass_inverse);
        let mut lever = [NONE; 3];
        add_cross(&mut lever, 1.0, c, &turn.rate);

        // velocity and position of the origin
        let (mut velocity, mut position) = (turn.velocity, turn.position);
        if has_lever {
            let (mut swept_rate, mut swept) = (lever, [NONE; 3]);
            add_cross(&mut swept_rate, 1.0, &self.lever_rate, &turn.attitude);
            add_cross(&mut swept, 1.0, c, &turn.attitude);
            add_times(&mut velocity, &self.turned, &swept_rate);
            add_times(&mut position, &self.turned, &swept);
            add_to_lanes(&mut velocity, RATE, -1.0, &skew(c));
            add_to_lanes(&mut position, RATE, -step_s, &skew(c));
        }
        let (mut velocity_rows, mut position_rows) = (velocity, position);
        add_to_lanes(&mut velocity_rows, ATTITUDE, -1.0, &skew(&self.velocity));
        add_to_lanes(&mut position_rows, ATTITUDE, -1.0, &skew(&self.position));
        let mut attitude_rows = turn.attitude;
        for (row, turned) in attitude_rows.iter_mut().zip(transpose(&self.turned)) {
            row[..3].copy_from_slice(&turned);
        }
        write(
            &mut derivatives.by_state,
            &mut derivatives.by_input,
            &[
                turned_by(&start.world_from_body, &position_rows),
                turned_by(&start.world_from_body, &velocity_rows),
                attitude_rows,
                turn.rate,
            ],
        );
        for i in 0..3 {
            derivatives.by_state[i][i] = 1.0;
            derivatives.by_state[i][3 + i] = step_s;
            derivatives.by_state[3 + i][3 + i] = 1.0;
        }

        let mut sensitivities = [[0.0; 12]; P];
        let outputs = derivatives.sensitivity_by_state.iter_mut().zip(&mut derivatives.sensitivity_by_input);
        let inputs = directions.iter().zip(sensitivity).zip(&mut sensitivities);
        for (((direction, phi), sensitivity_end), (by_state, by_input)) in inputs.zip(outputs) {
            let phi = Change::new(phi);
            let (along, end) = self.along(direction, &phi);
            *sensitivity_end = end.to_array();

            let change = Along { rate: phi.rate, effort: along.effort, rotor: &direction.rotor };
            let second = turn_along_by_start(&self.turn, &by_start, &self.effort, &change, &along.turn, step_s);
            let mut wide = WideTurn::new(&second.end, &torque_by_force);
            let changed_c = &direction.center_of_mass;
            // the effort's change depends on the input itself
            if !is_zero(&direction.torque_scale) {
                let scale = diagonal(&direction.torque_scale);
                wide.add_torque(&by_start.end, TORQUE, &scale);
            }
            let changes_lever = !is_zero(changed_c);
            if !is_zero(&direction.force_scale) || changes_lever {
                let scale = diagonal(&direction.force_scale);
                let mut changed = product(&torque_by_force, &scale);
                let lever = skew(changed_c);
                for (row, lever) in changed.iter_mut().zip(&lever) {
                    *row = plus(row, -1.0, lever);
                }
                wide.add_torque(&by_start.end, FORCE, &changed);
            }
            let push_by_force = direction.force_scale.map(|s| direction.mass_inverse + body.mass_inverse * s);
            add_scaled(&mut wide.velocity, &self.turn.velocity_by_push, &push_by_force);
            add_scaled(&mut wide.position, &self.turn.position_by_push, &push_by_force);
            add_diagonal(&mut wide.velocity, &second.velocity_by_push, body.mass_inverse);
            add_diagonal(&mut wide.position, &second.position_by_push, body.mass_inverse);

            if has_lever || changes_lever {
                let (mut swept_rate, mut swept) = ([NONE; 3], [NONE; 3]);
                let beta = &along.turn.attitude;
                let moved_rate = plus(&cross(beta, &self.lever_rate), 1.0, &along.lever_rate);
                let moved = plus(&cross(beta, c), 1.0, changed_c);
                add_cross(&mut swept_rate, 1.0, &moved_rate, &turn.attitude);
                add_cross(&mut swept_rate, 1.0, &self.lever_rate, &wide.attitude);
                add_cross(&mut swept_rate, 1.0, beta, &lever);
                add_cross(&mut swept_rate, 1.0, c, &wide.rate);
                add_cross(&mut swept_rate, 1.0, changed_c, &turn.rate);
                add_cross(&mut swept, 1.0, &moved, &turn.attitude);
                add_cross(&mut swept, 1.0, c, &wide.attitude);
                add_times(&mut wide.velocity, &self.turned, &swept_rate);
                add_times(&mut wide.position, &self.turned, &swept);
                add_to_lanes(&mut wide.velocity, RATE, -1.0, &skew(changed_c));
                add_to_lanes(&mut wide.position, RATE, -step_s, &skew(changed_c));
            }
            // the axes at the start are turned by the parameter and by the attitude at the start
            add_cross(&mut wide.velocity, 1.0, &phi.attitude, &velocity);
            add_cross(&mut wide.position, 1.0, &phi.attitude, &position);
            add_to_lanes(&mut wide.velocity, ATTITUDE, -1.0, &skew(&along.velocity));
            add_to_lanes(&mut wide.position, ATTITUDE, -1.0, &skew(&along.position));
            add_cross(&mut wide.attitude, 1.0, &along.attitude_before, &turn.attitude);
            write(
                by_state,
                by_input,
                &[
                    turned_by(&start.world_from_body, &wide.position),
                    turned_by(&start.world_from_body, &wide.velocity),
                    wide.attitude,
                    wide.rate,
                ],
            );
        }
        sensitivities
    }
}

/// First lanes of the four.
const ATTITUDE: usize = 0;
const RATE: usize = 3;
const TORQUE: usize = 6;
const FORCE: usize = 9;
/// First lanes of rate and torque in [`Lanes`].
const LANE_OF_TORQUE: usize = 3;

/// [`TurnLanes`] by attitude, rate, torque about the origin, and force.
struct WideTurn {
    attitude: [Wide; 3],
    rate: [Wide; 3],
    velocity: [Wide; 3],
    position: [Wide; 3],
}

impl WideTurn {
    /// The change through the torque about the centre of mass alone.
    #[inline(always)]
    fn new(lanes: &TurnLanes, torque_by_force: &M3) -> Self {
        let widened = |rows: &[Lanes; 3]| {
            let mut wide = [NONE; 3];
            for (wide, row) in wide.iter_mut().zip(rows) {
                wide[RATE..FORCE].copy_from_slice(&row[..6]);
            }
            add_by_torque(&mut wide, rows, FORCE, torque_by_force);
            wide
        };
        Self {
            attitude: widened(&lanes.attitude),
            rate: widened(&lanes.rate),
            velocity: widened(&lanes.velocity),
            position: widened(&lanes.position),
        }
    }

    /// Adds the change by the torque about the centre of mass, times `m`, to three lanes.
    #[inline(always)]
    fn add_torque(&mut self, lanes: &TurnLanes, first: usize, m: &M3) {
        add_by_torque(&mut self.attitude, &lanes.attitude, first, m);
        add_by_torque(&mut self.rate, &lanes.rate, first, m);
        add_by_torque(&mut self.velocity, &lanes.velocity, first, m);
        add_by_torque(&mut self.position, &lanes.position, first, m);
    }
}

#[inline(always)]
fn add_by_torque(wide: &mut [Wide; 3], rows: &[Lanes; 3], first: usize, m: &M3) {
    for (wide, row) in wide.iter_mut().zip(rows) {
        let by_torque = [row[LANE_OF_TORQUE], row[LANE_OF_TORQUE + 1], row[LANE_OF_TORQUE + 2]];
        for (wide, x) in wide[first..first + 3].iter_mut().zip(transpose_times(m, &by_torque)) {
            *wide += x;
        }
    }
}

/// Adds `m` scaled column by column to the lanes of the force.
#[inline(always)]
fn add_scaled(wide: &mut [Wide; 3], m: &M3, scale: &V3) {
    for (wide, row) in wide.iter_mut().zip(m) {
        for j in 0..3 {
            wide[FORCE + j] += row[j] * scale[j];
        }
    }
}

#[inline(always)]
fn add_diagonal(wide: &mut [Wide; 3], m: &M3, scale: f64) {
    add_scaled(wide, m, &[scale; 3]);
}

/// Adds `factor m` to three lanes.
#[inline(always)]
fn add_to_lanes(wide: &mut [Wide; 3], first: usize, factor: f64, m: &M3) {
    for (wide, row) in wide.iter_mut().zip(m) {
        for (wide, x) in wide[first..first + 3].iter_mut().zip(row) {
            *wide += factor * x;
        }
    }
}

/// Adds `factor a x b` in every lane.
#[inline(always)]
fn add_cross(sum: &mut [Wide; 3], factor: f64, a: &V3, b: &[Wide; 3]) {
    let [a0, a1, a2] = a.map(|x| factor * x);
    for l in 0..WIDE {
        sum[0][l] += a1 * b[2][l] - a2 * b[1][l];
        sum[1][l] += a2 * b[0][l] - a0 * b[2][l];
        sum[2][l] += a0 * b[1][l] - a1 * b[0][l];
    }
}

/// Adds `m x` in every lane.
#[inline(always)]
fn add_times(sum: &mut [Wide; 3], m: &M3, x: &[Wide; 3]) {
    for (sum, row) in sum.iter_mut().zip(m) {
        for l in 0..WIDE {
            sum[l] += row[0] * x[0][l] + row[1] * x[1][l] + row[2] * x[2][l];
        }
    }
}

#[inline(always)]
fn turned_by(m: &M3, x: &[Wide; 3]) -> [Wide; 3] {
    let mut turned = [NONE; 3];
    add_times(&mut turned, m, x);
    turned
}

#[inline(always)]
fn transpose(m: &M3) -> M3 {
    core::array::from_fn(|i| core::array::from_fn(|j| m[j][i]))
}

#[inline(always)]
fn diagonal(d: &V3) -> M3 {
    [[d[0], 0.0, 0.0], [0.0, d[1], 0.0], [0.0, 0.0, d[2]]]
}

/// Position, velocity, attitude and rate, row by row.
#[inline(always)]
fn write(by_state: &mut Array2<12, 12>, by_input: &mut Array2<12, 6>, blocks: &[[Wide; 3]; 4]) {
    let rows = by_state.iter_mut().zip(by_input);
    for ((by_state, by_input), row) in rows.zip(blocks.iter().flatten()) {
        by_state[..6].fill(0.0);
        by_state[6..].copy_from_slice(&row[..6]);
        by_input.copy_from_slice(&row[6..]);
    }
}
