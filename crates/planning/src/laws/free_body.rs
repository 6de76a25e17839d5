//! A free rigid body for the laws of controllers, computed about its centre of mass in world axes: nothing here asks the models
//! that controllers are made of.

use nalgebra::{Matrix3, Quaternion, UnitQuaternion, Vector3};
use tumble_dynamics::{InertialParameters, RigidBodyState};
use tumble_lie::{Pose, Twist, Wrench};

/// A body and where it is.
#[derive(Clone, Copy, Debug)]
pub(super) struct FreeBody {
    mass_kg: f64,
    center_body: Vector3<f64>,
    inertia: Matrix3<f64>,
    inertia_inverse: Matrix3<f64>,
    motion: Motion,
}

/// Position and velocity of the centre of mass in world axes, attitude, rate in body axes; or the rates of these.
#[derive(Clone, Copy, Debug)]
struct Motion {
    position: Vector3<f64>,
    velocity: Vector3<f64>,
    attitude: Quaternion<f64>,
    rate: Vector3<f64>,
}

impl Motion {
    fn after(&self, slope: &Self, step_s: f64) -> Self {
        Self {
            position: self.position + slope.position * step_s,
            velocity: self.velocity + slope.velocity * step_s,
            attitude: self.attitude + slope.attitude * step_s,
            rate: self.rate + slope.rate * step_s,
        }
    }
}

impl FreeBody {
    /// A body with extent in every direction; `None` for another.
    pub fn new(parameters: &InertialParameters<f64>, state: &RigidBodyState<f64>) -> Option<Self> {
        let inertia = parameters.inertia_about_com();
        let center_body = parameters.center_of_mass();
        let (attitude, twist) = (state.world_from_body.rotation, &state.twist_body);
        let motion = Motion {
            position: state.world_from_body.translation.vector + attitude * center_body,
            velocity: attitude * (twist.linear + twist.angular.cross(&center_body)),
            attitude: *attitude.quaternion(),
            rate: twist.angular,
        };
        let inertia_inverse = inertia.try_inverse()?;
        (parameters.mass > 0.0).then_some(Self {
            mass_kg: parameters.mass,
            center_body,
            inertia,
            inertia_inverse,
            motion,
        })
    }

    /// The state of the body frame.
    pub fn state(&self) -> RigidBodyState<f64> {
        let Motion { position, velocity, attitude, rate } = self.motion;
        let attitude = UnitQuaternion::from_quaternion(attitude);
        RigidBodyState {
            world_from_body: Pose::from_parts((position - attitude * self.center_body).into(), attitude),
            twist_body: Twist::new(rate, attitude.inverse() * velocity - rate.cross(&self.center_body)),
        }
    }

    fn slope(&self, motion: &Motion, wrench: &Wrench<f64>) -> Motion {
        let rate = motion.rate;
        let attitude = UnitQuaternion::from_quaternion(motion.attitude);
        let torque = wrench.torque - self.center_body.cross(&wrench.force) - rate.cross(&(self.inertia * rate));
        Motion {
            position: motion.velocity,
            velocity: attitude * (wrench.force / self.mass_kg),
            attitude: motion.attitude * Quaternion::from_imag(rate * 0.5),
            rate: self.inertia_inverse * torque,
        }
    }

    /// Moves on by one step of the classical method of order four, the wrench (body axes, about the origin) held.
    pub fn step(&mut self, wrench: &Wrench<f64>, step_s: f64) {
        let start = self.motion;
        let first = self.slope(&start, wrench);
        let second = self.slope(&start.after(&first, 0.5 * step_s), wrench);
        let third = self.slope(&start.after(&second, 0.5 * step_s), wrench);
        let fourth = self.slope(&start.after(&third, step_s), wrench);
        self.motion = start
            .after(&first, step_s / 6.0)
            .after(&second, step_s / 3.0)
            .after(&third, step_s / 3.0)
            .after(&fourth, step_s / 6.0);
        self.motion.attitude = self.motion.attitude.normalize();
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use tumble_dynamics::{FreeFlyer, Integrator, MuntheKaas4};
    use tumble_lie::LieGroup;

    #[test]
    fn agrees_with_the_integrator_on_the_group() {
        let inertia = Matrix3::new(0.15, 0.01, 0.0, 0.01, 0.12, 0.005, 0.0, 0.005, 0.17);
        let parameters = InertialParameters::about_com(9.5, Vector3::new(0.05, -0.06, 0.03), inertia);
        let start = RigidBodyState {
            world_from_body: Pose::new(Vector3::new(1.0, -2.0, 0.5), Vector3::new(0.3, 1.2, -0.7)),
            twist_body: Twist::new(Vector3::new(0.3, -0.2, 0.5), Vector3::new(0.1, 0.02, -0.3)),
        };
        let wrench = Wrench::new(Vector3::new(0.02, -0.01, 0.03), Vector3::new(0.3, 0.1, -0.2));
        let mut body = FreeBody::new(&parameters, &start).unwrap();
        let mut expected = start;
        for _ in 0..500 {
            body.step(&wrench, 0.01);
            expected = MuntheKaas4.step(&FreeFlyer::new(parameters), &expected, &wrench, 0.0, 0.01).unwrap();
        }
        let found = body.state();
        let apart = expected.world_from_body.between(&found.world_from_body);
        let turned: f64 = apart.rotation.angle();
        assert!(turned < 1e-7 && apart.translation.vector.norm() < 1e-7, "{apart:?}");
        assert!((found.twist_body - expected.twist_body).to_vector().amax() < 1e-7);
    }
}
