//! One step of a rigid body under a wrench that is constant or linear in time, in body axes, and its tangent.
//!
//! The state is about the centre of mass, so that attitude and position couple only through the applied force. Errors of
//! one step are O(h^4) in rate, velocity and position.

use crate::lie::{LieGroup, skew};
use nalgebra::{Matrix3, SMatrix, UnitQuaternion, Vector3};

/// Largest turn in one step of the flow, rad; longer steps are split.
const LARGEST_TURN: f64 = 0.15;

/// Attitude, body rate, centre of mass and its velocity in inertial axes.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct State {
    pub(crate) world_from_body: UnitQuaternion<f64>,
    pub(crate) rate: Vector3<f64>,
    pub(crate) center: Vector3<f64>,
    pub(crate) velocity: Vector3<f64>,
}

impl State {
    /// `self (-) base`: attitude (right increment), rate, centre, velocity.
    pub(crate) fn difference(&self, base: &Self) -> [f64; 12] {
        let turn = LieGroup::log(&(base.world_from_body.conjugate() * self.world_from_body));
        let parts = [turn, self.rate - base.rate, self.center - base.center, self.velocity - base.velocity];
        core::array::from_fn(|i| parts[i / 3][i % 3])
    }

    pub(crate) fn retracted(&self, step: &[f64; 12]) -> Self {
        let part = |i: usize| Vector3::new(step[i], step[i + 1], step[i + 2]);
        let turned = self.world_from_body * <UnitQuaternion<f64> as LieGroup>::exp(&part(0));
        Self {
            world_from_body: UnitQuaternion::new_normalize(turned.into_inner()),
            rate: self.rate + part(3),
            center: self.center + part(6),
            velocity: self.velocity + part(9),
        }
    }
}

/// Mass, centre of mass and inertia about it, with what a step needs of them.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Body {
    pub(crate) mass: f64,
    pub(crate) center: Vector3<f64>,
    pub(crate) inertia: Matrix3<f64>,
    pub(crate) inverse: Matrix3<f64>,
}

/// Wrench over one step: value at the middle and slope, body axes, about the body origin.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Input {
    /// Momentum in wheels, as in the middle of the step, which the body turns along.
    pub(crate) stored: Vector3<f64>,
    pub(crate) torque: Vector3<f64>,
    pub(crate) force: Vector3<f64>,
    pub(crate) torque_slope: Vector3<f64>,
    pub(crate) force_slope: Vector3<f64>,
}

impl Input {
    /// The wrench of one of `parts` equal parts of the step.
    pub(crate) fn part(&self, index: usize, parts: usize, step_s: f64) -> Self {
        let shift = step_s * ((index as f64 + 0.5) / parts as f64 - 0.5);
        Self { torque: self.torque + self.torque_slope * shift, force: self.force + self.force_slope * shift, ..*self }
    }
}

/// One step and the intermediate values its tangent needs.
pub(crate) struct Step {
    pub(crate) next: State,
    pub(crate) turn: Vector3<f64>,
    pub(crate) turned: UnitQuaternion<f64>,
    /// Of body and wheels at the start, body axes.
    pub(crate) momentum: Vector3<f64>,
    /// Angular acceleration at the start and its first derivative.
    pub(crate) acceleration: Vector3<f64>,
    pub(crate) jerk: Vector3<f64>,
    /// Mean forces that drive velocity and centre.
    pub(crate) velocity_force: Vector3<f64>,
    pub(crate) center_force: Vector3<f64>,
}

/// Derivatives of a 3-vector by body rate, torque about the centre of mass and inertia (11, 12, 13, 22, 23, 33).
#[derive(Clone, Copy)]
pub(crate) struct ByAngular {
    pub(crate) rate: Matrix3<f64>,
    pub(crate) torque: Matrix3<f64>,
    pub(crate) inertia: SMatrix<f64, 3, 6>,
}

/// Tangent of the angular part of one step.
pub(crate) struct AngularTangent {
    /// Of the next rate.
    pub(crate) rate: ByAngular,
    /// Of the turn.
    pub(crate) turn: ByAngular,
    /// Of the angular acceleration at the start.
    pub(crate) acceleration: ByAngular,
}

impl Body {
    pub(crate) fn new(mass: f64, center: Vector3<f64>, inertia: Matrix3<f64>) -> Self {
        Self { mass, center, inertia, inverse: inverse(&inertia) }
    }

    /// Parts a step must be split into.
    pub(crate) fn parts(&self, state: &State, input: &Input, step_s: f64) -> usize {
        let momentum = self.inertia * state.rate + input.stored;
        let torque = input.torque - self.center.cross(&input.force) - state.rate.cross(&momentum);
        let acceleration = self.inverse * torque;
        let size = |v: &Vector3<f64>| (v.x * v.x + v.y * v.y + v.z * v.z).sqrt();
        let turn = size(&state.rate) * step_s + 0.5 * size(&acceleration) * step_s * step_s;
        // A diverging trial must not take forever.
        if turn <= LARGEST_TURN { 1 } else { super::rounding::whole((turn / LARGEST_TURN).ceil().min(64.0)) }
    }

    /// # Source
    /// Taylor expansion of the Newton-Euler equations about the centre of mass, (2.4) of the thesis, along the flow.
    pub(crate) fn step(&self, state: &State, input: &Input, gravity: &Vector3<f64>, h: f64) -> Step {
        let (w, c, k) = (state.rate, self.center, &self.inverse);
        let force = input.force - input.force_slope * (0.5 * h);
        let torque = input.torque - input.torque_slope * (0.5 * h) - c.cross(&force);
        let torque_slope = input.torque_slope - c.cross(&input.force_slope);
        let momentum = self.inertia * w + input.stored;
        let a0 = k * (torque - w.cross(&momentum));
        let momentum_rate = self.inertia * a0;
        let a1 = k * (torque_slope - a0.cross(&momentum) - w.cross(&momentum_rate));
        let a2 = k * -(a1.cross(&momentum) + a0.cross(&momentum_rate) * 2.0 + w.cross(&(self.inertia * a1)));
        let rate = w + a0 * h + a1 * (h * h / 2.0) + a2 * (h * h * h / 6.0);
        let cubed = h * h * h;
        let turn = w * h + a0 * (h * h / 2.0) + a1 * (cubed / 6.0) + w.cross(&a0) * (cubed / 12.0);
        let swept = w.cross(&force);
        let second = a0.cross(&force) + w.cross(&swept) + w.cross(&input.force_slope) * 2.0;
        let first = swept + input.force_slope;
        let velocity_force = force + first * (h / 2.0) + second * (h * h / 6.0);
        let center_force = force * 0.5 + first * (h / 6.0) + second * (h * h / 24.0);
        let rotation = &state.world_from_body;
        let turned = <UnitQuaternion<f64> as LieGroup>::exp(&turn);
        let next = State {
            world_from_body: rotation * turned,
            rate,
            center: state.center
                + state.velocity * h
                + (rotation * center_force) * (h * h / self.mass)
                + gravity * (h * h / 2.0),
            velocity: state.velocity + (rotation * velocity_force) * (h / self.mass) + gravity * h,
        };
        Step { next, turn, turned, momentum, acceleration: a0, jerk: a1, velocity_force, center_force }
    }

    /// The state after a whole step, split where it must be.
    pub(crate) fn over(&self, state: &State, input: &Input, gravity: &Vector3<f64>, step_s: f64) -> State {
        let parts = self.parts(state, input, step_s);
        let mut state = *state;
        for part in 0..parts {
            state = self.step(&state, &input.part(part, parts, step_s), gravity, step_s / parts as f64).next;
        }
        state
    }

    pub(crate) fn angular_tangent(&self, rate: &Vector3<f64>, step: &Step, h: f64) -> AngularTangent {
        let (j, k) = (&self.inertia, &self.inverse);
        let (a0, a1) = (&step.acceleration, &step.jerk);
        let (sw, sa) = (skew(rate), skew(a0));
        let (of_rate, of_acceleration) = (by_inertia(rate), by_inertia(a0));
        let rate0 = k * (skew(&step.momentum) - sw * j);
        let inertia0 = -(k * (sw * of_rate + of_acceleration));
        let rate1 = rate0 * rate0 + k * (skew(&(j * a0)) - sa * j);
        let torque1 = rate0 * k;
        let inertia1 = rate0 * inertia0 - k * (sa * of_rate + sw * of_acceleration + by_inertia(a1));
        let (half, third) = (h * h / 2.0, h * h * h / 6.0);
        let twist = sw * (third / 2.0);
        AngularTangent {
            rate: ByAngular {
                rate: Matrix3::identity() + rate0 * h + rate1 * half,
                torque: k * h + torque1 * half,
                inertia: inertia0 * h + inertia1 * half,
            },
            turn: ByAngular {
                rate: Matrix3::identity() * h + rate0 * half + rate1 * third + twist * rate0 - sa * (third / 2.0),
                torque: k * half + torque1 * third + twist * k,
                inertia: inertia0 * half + inertia1 * third + twist * inertia0,
            },
            acceleration: ByAngular { rate: rate0, torque: *k, inertia: inertia0 },
        }
    }
}

/// The matrix that takes (J11, J12, J13, J22, J23, J33) to `J v`.
pub(crate) fn by_inertia(v: &Vector3<f64>) -> SMatrix<f64, 3, 6> {
    let o = 0.0;
    SMatrix::<f64, 3, 6>::new(v.x, v.y, v.z, o, o, o, o, v.x, o, v.y, v.z, o, o, o, v.x, o, v.y, v.z)
}

/// Inverse of a symmetric 3x3 matrix by cofactors; not finite where it is singular.
pub(crate) fn inverse(a: &Matrix3<f64>) -> Matrix3<f64> {
    let (xx, xy, xz, yy, yz, zz) = (a[(0, 0)], a[(0, 1)], a[(0, 2)], a[(1, 1)], a[(1, 2)], a[(2, 2)]);
    let (c00, c01, c02) = (yy * zz - yz * yz, xz * yz - xy * zz, xy * yz - xz * yy);
    let determinant = xx * c00 + xy * c01 + xz * c02;
    let (c11, c12, c22) = (xx * zz - xz * xz, xy * xz - xx * yz, xx * yy - xy * xy);
    Matrix3::new(c00, c01, c02, c01, c11, c12, c02, c12, c22) / determinant
}

#[cfg(test)]
mod tests {
    use super::*;

    fn body() -> Body {
        let inertia = Matrix3::new(0.160, 0.004, -0.003, 0.004, 0.142, 0.006, -0.003, 0.006, 0.170);
        Body::new(9.41, Vector3::new(0.031, -0.017, 0.052), inertia)
    }

    fn start() -> (State, Input) {
        let state = State {
            world_from_body: UnitQuaternion::identity(),
            rate: Vector3::new(0.3, -0.2, 0.5),
            center: Vector3::zeros(),
            velocity: Vector3::new(0.1, -0.05, 0.2),
        };
        let input =
            Input { torque: Vector3::new(0.02, -0.03, 0.01), force: Vector3::new(0.4, -0.1, 0.3), ..Input::default() };
        (state, input)
    }

    #[test]
    fn golden_step() {
        // Provenance: design/maximum-likelihood.md, section 8 (prototypes/python/ml_golden.py).
        let (state, input) = start();
        let found = body().step(&state, &input, &Vector3::zeros(), 0.05);
        let close = |a: Vector3<f64>, b: [f64; 3]| assert!((a - Vector3::from(b)).amax() < 6e-13, "{a} {b:?}");
        close(found.next.rate, [0.308_039_278_345, -0.214_203_729_359, 0.501_927_256_421]);
        close(found.next.center, [0.005_053_108_773, -0.002_513_041_659, 0.010_039_965_48]);
        close(found.next.velocity, [0.102_123_746_083, -0.050_516_853_789, 0.201_600_975_585]);
        close(found.turn, [0.015_202_142_14, -0.010_354_424_288, 0.025_047_759_96]);
    }

    #[test]
    fn is_of_the_order_it_claims_with_slope_and_gravity() {
        // Against the same flow in many small parts: errors of one step fall by 2^4 and more when it is halved.
        let (state, mut input) = start();
        input.torque_slope = Vector3::new(0.05, 0.02, -0.04);
        input.force_slope = Vector3::new(-0.5, 0.3, 0.8);
        let gravity = Vector3::new(0.3, -0.8, 1.1);
        let error = |h: f64| {
            let once = body().step(&state, &input, &gravity, h).next;
            let (mut fine, parts) = (state, 64);
            for i in 0..parts {
                fine = body().step(&fine, &input.part(i, parts, h), &gravity, h / parts as f64).next;
            }
            once.difference(&fine)
        };
        let (long, short) = (error(0.2), error(0.1));
        for block in 0..4 {
            let size = |e: &[f64; 12]| (0..3).map(|i| e[3 * block + i].powi(2)).sum::<f64>().sqrt();
            assert!(size(&long) > 12.0 * size(&short) && size(&long) < 1e-3, "{block}: {long:?} {short:?}");
        }
    }
}
