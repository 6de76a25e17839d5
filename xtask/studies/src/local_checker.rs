//! Judges local plans by their inputs alone.
//!
//! Shares no code with the planner. The motion is integrated here with the raw quaternion, as problem 8's frozen program does
//! it, by Runge-Kutta steps as long as the planner's and 20 times finer; numbers that carry their changes by the unknown
//! quantities give the sensitivities; cost, information, limits and obstacles are worked out from plain numbers.

use std::array::from_fn;
use std::ops::{Add, Mul, Sub};

/// How much finer the judge looks than the planner.
pub const FINER: usize = 20;

/// A state: position (world), quaternion (w first), velocity (world) and rate (body).
pub type Moment = [f64; 13];

/// A number and its changes by `P` quantities.
#[derive(Clone, Copy)]
struct Number<const P: usize> {
    value: f64,
    by: [f64; P],
}

impl<const P: usize> Number<P> {
    fn plain(value: f64) -> Self {
        Self { value, by: [0.0; P] }
    }

    fn inverse(self) -> Self {
        let inverse = 1.0 / self.value;
        Self { value: inverse, by: self.by.map(|change| -change * inverse * inverse) }
    }
}

impl<const P: usize> Add for Number<P> {
    type Output = Self;
    fn add(self, other: Self) -> Self {
        Self { value: self.value + other.value, by: from_fn(|i| self.by[i] + other.by[i]) }
    }
}

impl<const P: usize> Sub for Number<P> {
    type Output = Self;
    fn sub(self, other: Self) -> Self {
        Self { value: self.value - other.value, by: from_fn(|i| self.by[i] - other.by[i]) }
    }
}

#[allow(clippy::suspicious_arithmetic_impl, reason = "the rule of the product adds")]
impl<const P: usize> Mul for Number<P> {
    type Output = Self;
    fn mul(self, other: Self) -> Self {
        Self { value: self.value * other.value, by: from_fn(|i| self.by[i] * other.value + self.value * other.by[i]) }
    }
}

impl<const P: usize> Mul<f64> for Number<P> {
    type Output = Self;
    fn mul(self, factor: f64) -> Self {
        Self { value: self.value * factor, by: self.by.map(|change| change * factor) }
    }
}

type Triple<const P: usize> = [Number<P>; 3];
type Square<const P: usize> = [[Number<P>; 3]; 3];

fn cross<const P: usize>(a: &Triple<P>, b: &Triple<P>) -> Triple<P> {
    [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]
}

fn times<const P: usize>(m: &Square<P>, v: &Triple<P>) -> Triple<P> {
    from_fn(|i| m[i][0] * v[0] + m[i][1] * v[1] + m[i][2] * v[2])
}

fn plus<const P: usize>(a: &Triple<P>, b: &Triple<P>, factor: f64) -> Triple<P> {
    from_fn(|i| a[i] + b[i] * factor)
}

/// A body: mass, centre of mass, inertia about it and the inverse of that.
struct Body<const P: usize> {
    over_mass: Number<P>,
    center: Triple<P>,
    inertia: Square<P>,
    inverse: Square<P>,
}

impl<const P: usize> Body<P> {
    /// From mass, first moment and the upper triangle of the inertia about the origin.
    fn new(parameters: [Number<P>; 10]) -> Self {
        let [mass, hx, hy, hz, xx, xy, xz, yy, yz, zz] = parameters;
        let over_mass = mass.inverse();
        let c = [hx * over_mass, hy * over_mass, hz * over_mass];
        let about_origin = [[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]];
        let square = c[0] * c[0] + c[1] * c[1] + c[2] * c[2];
        let zero = Number::plain(0.0);
        let inertia: Square<P> =
            from_fn(|i| from_fn(|j| about_origin[i][j] - mass * ((if i == j { square } else { zero }) - c[i] * c[j])));
        let columns = cross(&inertia[1], &inertia[2]);
        let determinant = inertia[0][0] * columns[0] + inertia[0][1] * columns[1] + inertia[0][2] * columns[2];
        let over = determinant.inverse();
        // of a symmetric matrix, the rows' cross products are the columns of the adjugate
        let rows = [columns, cross(&inertia[2], &inertia[0]), cross(&inertia[0], &inertia[1])];
        Self { over_mass, center: c, inertia, inverse: rows.map(|row| row.map(|entry| entry * over)) }
    }

    /// Change per second of a state under a wrench about the origin, `[torque; force]`.
    fn field(&self, state: &[Number<P>; 13], wrench: &[f64; 6]) -> [Number<P>; 13] {
        let [_, _, _, q0, q1, q2, q3, vx, vy, vz, w0, w1, w2] = *state;
        let (q, w) = ([q1, q2, q3], [w0, w1, w2]);
        let torque: Triple<P> = from_fn(|i| Number::plain(wrench[i]));
        let force: Triple<P> = from_fn(|i| Number::plain(wrench[3 + i]));
        let about_com = plus(&torque, &cross(&self.center, &force), -1.0);
        let momentum = times(&self.inertia, &w);
        let turning = times(&self.inverse, &plus(&about_com, &cross(&w, &momentum), -1.0));
        let of_com = force.map(|component| component * self.over_mass);
        let of_origin = plus(&of_com, &cross(&turning, &self.center), -1.0);
        let of_origin = plus(&of_origin, &cross(&w, &cross(&w, &self.center)), -1.0);
        let t = cross(&q, &of_origin).map(|component| component * 2.0);
        let turned = cross(&q, &t);
        let in_world: Triple<P> = from_fn(|i| of_origin[i] + q0 * t[i] + turned[i]);
        let across = cross(&q, &w);
        let half: Triple<P> = from_fn(|i| (q0 * w[i] + across[i]) * 0.5);
        let scalar = (q1 * w0 + q2 * w1 + q3 * w2) * -0.5;
        [
            vx,
            vy,
            vz,
            scalar,
            half[0],
            half[1],
            half[2],
            in_world[0],
            in_world[1],
            in_world[2],
            turning[0],
            turning[1],
            turning[2],
        ]
    }

    fn step(&self, state: &[Number<P>; 13], wrench: &[f64; 6], step_s: f64) -> [Number<P>; 13] {
        let along = |slope: &[Number<P>; 13], part: f64| from_fn(|i| state[i] + slope[i] * (part * step_s));
        let k1 = self.field(state, wrench);
        let k2 = self.field(&along(&k1, 0.5), wrench);
        let k3 = self.field(&along(&k2, 0.5), wrench);
        let k4 = self.field(&along(&k3, 1.0), wrench);
        from_fn(|i| state[i] + (k1[i] + k2[i] * 2.0 + k3[i] * 2.0 + k4[i]) * (step_s / 6.0))
    }
}

/// An ellipsoid whose axes are the world's: centre and semi-axes, m.
pub type Solid = ([f64; 3], [f64; 3]);

/// What a plan is for. The attitude to hold is the world's.
#[derive(Clone, Debug)]
pub struct LocalTask<const P: usize> {
    /// Mass, first moment, and the upper triangle of the inertia about the origin.
    pub parameters: [f64; 10],
    /// Change of those by one unit of each unknown quantity.
    pub quantities: [[f64; 10]; P],
    /// What is known of the quantities: the inverse of their covariance.
    pub prior_information: [[f64; P]; P],
    /// Weight of the variance of each.
    pub information_weights: [f64; P],
    pub start: Moment,
    pub goal: [f64; 3],
    pub step_s: f64,
    /// Weights of the squares of position error, vector part of the quaternion, velocity and rate, before the last node.
    pub tracking: [f64; 4],
    /// The same at the last node.
    pub terminal: [f64; 4],
    /// Weights of the squares of torque and force.
    pub effort: [f64; 2],
    /// Standard deviations of measured position, quaternion, velocity and rate at each node; infinite for what is not measured.
    pub measured: [f64; 4],
    /// Largest torques and forces.
    pub wrench: [f64; 6],
    pub speed_m_s: f64,
    pub rate_rad_s: f64,
    pub obstacles: Vec<Solid>,
}

/// A cost and its parts.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Cost<const P: usize> {
    pub tracking_and_effort: f64,
    pub information: f64,
    /// Predicted standard deviations of the quantities at the end.
    pub sigma: [f64; P],
}

impl<const P: usize> Cost<P> {
    pub fn total(&self) -> f64 {
        self.tracking_and_effort + self.information
    }
}

/// What the judge found. Ratios are of the largest value to its limit.
#[derive(Clone, Debug)]
pub struct LocalFindings<const P: usize> {
    /// With one integration step per input, as the planner counts.
    pub cost: Cost<P>,
    /// With [`FINER`] steps per input.
    pub fine_cost: Cost<P>,
    /// Information gathered about the quantities, the prior not included, one step per input.
    #[cfg(test)]
    pub gathered: [[f64; P]; P],
    pub input_ratio: f64,
    pub speed_ratio: f64,
    pub rate_ratio: f64,
    /// Least `|(p - c) / a|^2 - 1` over the nodes after the first; infinite without obstacles.
    pub node_margin: f64,
    /// The same over the finer grid.
    pub fine_margin: f64,
    /// Points of the finer grid inside an obstacle.
    pub inside: usize,
    pub goal_error_m: f64,
    /// The states at the nodes, one integration step per input.
    pub nodes: Vec<Moment>,
}

impl<const P: usize> LocalFindings<P> {
    /// Whether inputs, speeds and rates are within their limits, up to `slack` of them.
    pub fn keeps_limits(&self, slack: f64) -> bool {
        [self.input_ratio, self.speed_ratio, self.rate_ratio].iter().all(|ratio| *ratio <= 1.0 + slack)
    }
}

struct Rollout<const P: usize> {
    cost: Cost<P>,
    #[cfg(test)]
    gathered: [[f64; P]; P],
    /// The states after each integration step, the start first.
    states: Vec<Moment>,
}

impl<const P: usize> LocalTask<P> {
    /// Looks at a plan: torque and force, held for a step each.
    pub fn judge(&self, inputs: &[[f64; 6]]) -> LocalFindings<P> {
        let coarse = self.roll_out(inputs, 1);
        let fine = self.roll_out(inputs, FINER);
        let margin = |state: &Moment| {
            let gauge = |(center, semi_axes): &Solid| {
                (0..3).map(|i| ((state[i] - center[i]) / semi_axes[i]).powi(2)).sum::<f64>() - 1.0
            };
            least(self.obstacles.iter().map(gauge))
        };
        let ratio = |first: usize, limit: f64| {
            largest(coarse.states.iter().skip(1).flat_map(|state| &state[first..first + 3]).map(|x| x.abs() / limit))
        };
        let end = coarse.states.last().unwrap_or(&self.start);
        let away = (0..3).map(|i| (end[i] - self.goal[i]).powi(2)).sum::<f64>();
        LocalFindings {
            input_ratio: largest(inputs.iter().flat_map(|u| (0..6).map(|i| u[i].abs() / self.wrench[i]))),
            speed_ratio: ratio(7, self.speed_m_s),
            rate_ratio: ratio(10, self.rate_rad_s),
            node_margin: least(coarse.states.iter().skip(1).map(margin)),
            fine_margin: least(fine.states.iter().skip(1).map(margin)),
            // a NaN is inside
            inside: fine.states.iter().skip(1).filter(|state| !margin(state).ge(&0.0)).count(),
            goal_error_m: away.sqrt(),
            cost: coarse.cost,
            fine_cost: fine.cost,
            #[cfg(test)]
            gathered: coarse.gathered,
            nodes: coarse.states,
        }
    }

    fn roll_out(&self, inputs: &[[f64; 6]], finer: usize) -> Rollout<P> {
        let parameters = from_fn(|i| Number { value: self.parameters[i], by: from_fn(|c| self.quantities[c][i]) });
        let body = Body::<P>::new(parameters);
        let mut state: [Number<P>; 13] = self.start.map(Number::plain);
        let mut states = vec![self.start];
        let mut spent = 0.0;
        let mut gathered = [[0.0; P]; P];
        for input in inputs {
            spent += self.deviation(&state, &self.tracking)
                + self.effort[0] * squares(&input[..3])
                + self.effort[1] * squares(&input[3..]);
            for _ in 0..finer {
                state = body.step(&state, input, self.step_s / finer as f64);
                states.push(state.map(|number| number.value));
            }
            for (range, sd) in [0..3, 3..7, 7..10, 10..13].into_iter().zip(self.measured) {
                for number in &state[range] {
                    for (i, row) in gathered.iter_mut().enumerate() {
                        for (j, entry) in row.iter_mut().enumerate() {
                            *entry += number.by[i] * number.by[j] / (sd * sd);
                        }
                    }
                }
            }
        }
        spent += self.deviation(&state, &self.terminal);
        let information = from_fn(|i| from_fn(|j| self.prior_information[i][j] + gathered[i][j]));
        let variances = diagonal_of_inverse(&information);
        let cost = Cost {
            tracking_and_effort: spent,
            information: (0..P).map(|i| self.information_weights[i] * variances[i]).sum(),
            sigma: variances.map(f64::sqrt),
        };
        Rollout {
            cost,
            #[cfg(test)]
            gathered,
            states,
        }
    }

    fn deviation(&self, state: &[Number<P>; 13], weights: &[f64; 4]) -> f64 {
        let value = state.map(|number| number.value);
        let away: [f64; 3] = from_fn(|i| value[i] - self.goal[i]);
        let [position, attitude, velocity, rate] = *weights;
        position * squares(&away)
            + attitude * squares(&value[4..7])
            + velocity * squares(&value[7..10])
            + rate * squares(&value[10..13])
    }
}

fn squares(values: &[f64]) -> f64 {
    values.iter().map(|x| x * x).sum()
}

/// NaN where there is one: `f64::min` would drop it.
fn least(values: impl Iterator<Item = f64>) -> f64 {
    values.fold(f64::INFINITY, |least, x| if x < least || x.is_nan() { x } else { least })
}

fn largest(values: impl Iterator<Item = f64>) -> f64 {
    -least(values.map(|x| -x))
}

/// By Gauss-Jordan elimination without pivots, which symmetric positive definite matrices allow; NaN for others.
fn diagonal_of_inverse<const P: usize>(matrix: &[[f64; P]; P]) -> [f64; P] {
    let mut left = *matrix;
    let mut right: [[f64; P]; P] = from_fn(|i| from_fn(|j| if i == j { 1.0 } else { 0.0 }));
    for pivot in 0..P {
        let over = if left[pivot][pivot] > 0.0 { 1.0 / left[pivot][pivot] } else { f64::NAN };
        let (left_row, right_row) = (left[pivot].map(|x| x * over), right[pivot].map(|x| x * over));
        for row in 0..P {
            let factor = left[row][pivot];
            for column in 0..P {
                left[row][column] =
                    if row == pivot { left_row[column] } else { left[row][column] - factor * left_row[column] };
                right[row][column] =
                    if row == pivot { right_row[column] } else { right[row][column] - factor * right_row[column] };
            }
        }
    }
    from_fn(|i| right[i][i])
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::local_tasks::{frozen_task, inputs_of_prototype};

    fn close(found: f64, expected: f64, tolerance: f64) {
        assert!((found - expected).abs() <= tolerance, "{found} is not {expected} within {tolerance}");
    }

    fn start_c() -> Vec<[f64; 6]> {
        inputs_of_prototype(&(0..144).map(|i| 0.6 * (1.0 + 1.7 * f64::from(i)).sin()).collect::<Vec<_>>())
    }

    /// What an algebra system's derivatives of the frozen program and our C prototype both found.
    #[test]
    fn the_checkpoints_of_the_recipe() {
        let task = frozen_task();
        let found = task.judge(&start_c());
        close(found.cost.total(), 28.385_632_267_756, 1e-12);
        close(found.cost.tracking_and_effort, 27.982_329_926_129, 1e-12);
        close(found.cost.information, 0.403_302_341_626_99, 1e-13);
        let expected = [
            [1.742_109_093, -0.281_171_385_7, 0.010_396_365_56, 0.260_001_064_1],
            [-0.281_171_385_7, 331.985_989_8, -44.939_263_78, -11.540_409_29],
            [0.010_396_365_56, -44.939_263_78, 312.313_790_5, 38.093_793_02],
            [0.260_001_064_1, -11.540_409_29, 38.093_793_02, 115.408_920_6],
        ];
        let sd = [1.0, 0.05, 0.05, 0.05];
        for i in 0..4 {
            for j in 0..4 {
                close(found.gathered[i][j] * sd[i] * sd[j], expected[i][j], 1e-7);
            }
        }
        let end = [
            0.007_632_991_857_64,
            -0.072_232_711_652_6,
            0.019_901_878_172_1,
            0.966_391_280_262,
            0.042_730_835_312_6,
            0.239_746_000_184,
            -0.082_363_102_529_3,
            0.002_955_751_321_97,
            -0.012_286_277_186_1,
            -4.773_716_417_63e-5,
            -0.005_308_120_268_76,
            0.081_415_053_869_8,
            -0.018_521_934_705_3,
        ];
        for (found, expected) in found.nodes[24].iter().zip(end) {
            close(*found, expected, 1e-12);
        }
        let turn =
            |k: usize, i: usize| 0.3 * (std::f64::consts::TAU * (k as f64 + 0.5) / 24.0 * (i as f64 + 1.0)).sin();
        let z: Vec<f64> = (0..144).map(|n| if n < 72 { turn(n / 3, n % 3) } else { 0.0 }).collect();
        close(task.judge(&inputs_of_prototype(&z)).cost.total(), 35.094_545_088_905, 1e-11);
    }

    /// The plans of our prototype, as the frozen program judged them.
    #[test]
    fn the_plans_of_the_prototype() {
        const NODES: &str = include_str!("local_golden/nodes.csv");
        const SEGMENTS: &str = include_str!("local_golden/segments.csv");
        let task = frozen_task();
        for (text, cost, fine_cost, on_segments) in
            [(NODES, 10.702_38, 10.702_371, false), (SEGMENTS, 10.717_37, 10.717_341, true)]
        {
            let z: Vec<f64> = text.lines().filter(|line| !line.starts_with('#')).map(|x| x.parse().unwrap()).collect();
            let found = task.judge(&inputs_of_prototype(&z));
            close(found.cost.total(), cost, 3e-5);
            close(found.fine_cost.total(), fine_cost, 1e-6);
            assert!(found.keeps_limits(1e-12) && found.rate_ratio < 0.64 && found.speed_ratio < 0.64, "{found:?}");
            let trace: f64 = found.fine_cost.sigma.iter().skip(1).map(|sigma| sigma * sigma).sum();
            close(trace, 6.15e-5, 1e-6);
            assert!(found.node_margin > -1e-9);
            if on_segments {
                assert_eq!(found.inside, 0);
                close(found.fine_margin, 2.1e-5, 2e-6);
            } else {
                assert!(found.inside > 0);
                close(found.fine_margin, -0.017, 1e-3);
                close(found.goal_error_m, 0.192, 1e-3);
            }
            // faults are seen
            let mut faulty = inputs_of_prototype(&z);
            faulty[3][5] = 0.258;
            assert!(!task.judge(&faulty).keeps_limits(1e-6));
            let slow = LocalTask { speed_m_s: 0.05, ..task.clone() };
            assert!(slow.judge(&inputs_of_prototype(&z)).speed_ratio > 1.0);
            let stiff = LocalTask { rate_rad_s: 0.05, ..task.clone() };
            assert!(stiff.judge(&inputs_of_prototype(&z)).rate_ratio > 1.0);
            faulty[3][5] = f64::NAN;
            let found = task.judge(&faulty);
            assert!(found.inside > 0 && !found.keeps_limits(1.0) && found.cost.total().is_nan());
        }
    }

    /// A body with its centre of mass elsewhere: sensitivities against differences of whole motions, and angular momentum
    /// about the centre of mass kept without a wrench.
    #[test]
    fn a_general_body() {
        let mut task = ten();
        task.start[7..13].copy_from_slice(&[0.01, -0.02, 0.03, 0.2, -0.1, 0.15]);
        let inputs = start_c();
        let found = task.judge(&inputs);
        let rows: [Vec<f64>; 10] = from_fn(|c| {
            let size = task.quantities[c].iter().fold(0.0_f64, |size, x| size.max(x.abs())) * 3e-6;
            let moved = |sign: f64| {
                let mut moved = task.clone();
                for i in 0..10 {
                    moved.parameters[i] += sign * size * task.quantities[c][i];
                }
                moved.judge(&inputs).nodes
            };
            let (up, down) = (moved(1.0), moved(-1.0));
            let pairs = up.iter().zip(&down).skip(1);
            pairs
                .flat_map(|(up, down)| (7..13).map(|i| (up[i] - down[i]) / (2.0 * size * 0.005)).collect::<Vec<_>>())
                .collect()
        });
        for i in 0..10 {
            for j in 0..10 {
                let product: f64 = rows[i].iter().zip(&rows[j]).map(|(a, b)| a * b).sum();
                let scale = (found.gathered[i][i] * found.gathered[j][j]).sqrt();
                close(found.gathered[i][j] / scale, product / scale, 1e-6);
            }
        }

        let parameters = task.parameters.map(Number::<0>::plain);
        let body = Body::new(parameters);
        let momentum = |moment: &Moment| {
            let w: Triple<0> = from_fn(|i| Number::plain(moment[10 + i]));
            let body_axes = times(&body.inertia, &w).map(|number| number.value);
            let (q, a) = ([moment[4], moment[5], moment[6]], body_axes);
            let t = [q[1] * a[2] - q[2] * a[1], q[2] * a[0] - q[0] * a[2], q[0] * a[1] - q[1] * a[0]].map(|x| 2.0 * x);
            let u = [q[1] * t[2] - q[2] * t[1], q[2] * t[0] - q[0] * t[2], q[0] * t[1] - q[1] * t[0]];
            [a[0] + moment[3] * t[0] + u[0], a[1] + moment[3] * t[1] + u[1], a[2] + moment[3] * t[2] + u[2]]
        };
        let idle = LocalTask { step_s: 0.05, ..task.clone() }.judge(&vec![[0.0; 6]; 100]);
        let (first, last) = (momentum(&idle.nodes[0]), momentum(&idle.nodes[100]));
        for axis in 0..3 {
            close(last[axis], first[axis], 1e-8);
        }
    }

    fn ten() -> LocalTask<10> {
        crate::local_tasks::ten_parameter_task(0.5)
    }

    #[test]
    fn inverses() {
        let matrix = [[4.0, 1.0, 0.5], [1.0, 3.0, -0.2], [0.5, -0.2, 2.0]];
        let inverse = diagonal_of_inverse(&matrix);
        let determinant: f64 = 4.0 * (6.0 - 0.04) - (2.0 + 0.1) + 0.5 * (-0.2 - 1.5);
        close(inverse[0], (6.0 - 0.04) / determinant, 1e-15);
        close(inverse[2], 11.0 / determinant, 1e-15);
        assert!(diagonal_of_inverse(&[[1.0, 2.0], [2.0, 1.0]])[0].is_nan());
    }
}
