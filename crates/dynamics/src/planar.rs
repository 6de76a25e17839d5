//! A rigid body with three degrees of freedom in the plane: a robot on a granite table.

use crate::error::DynamicsError;
use crate::state::{GroupState, GroupTangent};
use crate::system::MechanicalSystem;
use tumble_lie::nalgebra::{ComplexField, Isometry2, Vector2, Vector3};
use tumble_lie::{Scalar, real};

/// Force in the plane and torque about the body origin.
///
/// # Frame
/// Body axes.
/// # Units
/// N m, N.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PlanarWrench<T: Scalar> {
    /// Torque about the body origin, N m.
    pub torque: T,
    /// Force, N.
    pub force: Vector2<T>,
}

/// Second-order motion in the plane; see [`BodyAcceleration`](crate::BodyAcceleration).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PlanarAcceleration<T: Scalar> {
    /// Rate of the angular velocity, rad/s^2.
    pub angular_acceleration: T,
    /// Inertial acceleration of the body origin resolved in body axes, m/s^2.
    pub acceleration_origin_body: Vector2<T>,
}

/// A rigid body in the plane. Its state is a pose in SE(2) with `[angular velocity; velocity of the origin]` in body
/// axes.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PlanarBody<T: Scalar> {
    /// Mass, kg.
    pub mass: T,
    /// Moment of inertia about the centre of mass, kg m^2.
    pub inertia_about_com: T,
    /// Centre of mass, body axes, m.
    pub center_of_mass: Vector2<T>,
}

/// A quarter turn to the left: the cross product of the plane's normal with `v`.
#[inline]
fn turned<T: Scalar>(v: &Vector2<T>) -> Vector2<T> {
    Vector2::new(-v.y, v.x)
}

impl<T: Scalar> PlanarBody<T> {
    /// Acceleration that this wrench gives.
    ///
    /// # Source
    /// Thesis (2.4) in the plane.
    #[inline]
    pub fn forward(&self, angular_velocity: T, wrench_body: &PlanarWrench<T>) -> PlanarAcceleration<T> {
        let c = &self.center_of_mass;
        let torque_about_com = wrench_body.torque - c.perp(&wrench_body.force);
        let angular_acceleration = torque_about_com / self.inertia_about_com;
        let acceleration_origin_body = wrench_body.force / self.mass - turned(c) * angular_acceleration
            + c * (angular_velocity * angular_velocity);
        PlanarAcceleration { angular_acceleration, acceleration_origin_body }
    }

    /// Kinetic energy at the velocity `[omega; v_origin]`, J.
    pub fn kinetic_energy(&self, velocity: &Vector3<T>) -> T {
        let velocity_com = Vector2::new(velocity.y, velocity.z) + turned(&self.center_of_mass) * velocity.x;
        (velocity_com.norm_squared() * self.mass + velocity.x * velocity.x * self.inertia_about_com) * real(0.5)
    }

    /// Wrench that gives this acceleration.
    #[inline]
    pub fn inverse(&self, angular_velocity: T, acceleration: &PlanarAcceleration<T>) -> PlanarWrench<T> {
        let c = &self.center_of_mass;
        let acceleration_com = acceleration.acceleration_origin_body + turned(c) * acceleration.angular_acceleration
            - c * (angular_velocity * angular_velocity);
        let force = acceleration_com * self.mass;
        let torque = self.inertia_about_com * acceleration.angular_acceleration + c.perp(&force);
        PlanarWrench { torque, force }
    }
}

impl<T: Scalar> MechanicalSystem for PlanarBody<T> {
    type State = GroupState<Isometry2<T>>;
    type Input = PlanarWrench<T>;
    fn vector_field(
        &self,
        _time_s: T,
        state: &GroupState<Isometry2<T>>,
        wrench_body: &PlanarWrench<T>,
    ) -> Result<GroupTangent<Isometry2<T>>, DynamicsError> {
        let (w, v) = (state.velocity.x, Vector2::new(state.velocity.y, state.velocity.z));
        let acceleration = self.forward(w, wrench_body);
        let linear = acceleration.acceleration_origin_body - turned(&v) * w;
        let velocity = Vector3::new(acceleration.angular_acceleration, linear.x, linear.y);
        if velocity.iter().all(ComplexField::is_finite) {
            Ok(GroupTangent { configuration: state.velocity, velocity })
        } else {
            Err(DynamicsError::NotFinite)
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{FreeFlyer, InertialParameters, Integrator, MuntheKaas4};
    use tumble_lie::nalgebra::{Matrix3, SVector, UnitComplex};
    use tumble_lie::{LieGroup, Twist, Wrench};

    fn body() -> PlanarBody<f64> {
        PlanarBody { mass: 9.5, inertia_about_com: 0.16, center_of_mass: Vector2::new(0.02, -0.03) }
    }

    fn input(k: u32) -> PlanarWrench<f64> {
        let k = f64::from(k);
        let force = Vector2::new(0.3 * (0.4 * k).sin(), 0.25 * (0.3 * k).cos());
        PlanarWrench { torque: 0.02 * (0.5 * k + 1.0).sin(), force }
    }

    /// Position, heading, inertial velocity, rate: the coordinates of the golden value.
    fn field(x: &SVector<f64, 6>, wrench: &PlanarWrench<f64>) -> SVector<f64, 6> {
        let acceleration = body().forward(x[5], wrench);
        let a = UnitComplex::new(x[2]) * acceleration.acceleration_origin_body;
        SVector::from([x[3], x[4], x[5], a.x, a.y, acceleration.angular_acceleration])
    }

    const GOLDEN: [f64; 6] =
        [0.030192862605, 0.006682977270, 0.010441532053, 0.015442937978, -0.003994473825, 0.003993896108];

    #[test]
    fn golden_trajectory() {
        let (mut x, h) = (SVector::<f64, 6>::zeros(), 0.1);
        for k in 0..40 {
            let u = input(k);
            let k1 = field(&x, &u);
            let k2 = field(&(x + k1 * (h / 2.0)), &u);
            let k3 = field(&(x + k2 * (h / 2.0)), &u);
            let k4 = field(&(x + k3 * h), &u);
            x += (k1 + k2 * 2.0 + k3 * 2.0 + k4) * (h / 6.0);
        }
        assert!((x - SVector::from(GOLDEN)).amax() < 1e-11, "{x}");
    }

    #[test]
    fn the_system_on_se2_follows_the_golden_trajectory() {
        // another integrator of order 4: agrees to its error, not to 1e-11
        let mut state = GroupState { configuration: Isometry2::identity(), velocity: Vector3::zeros() };
        for k in 0..40 {
            state = MuntheKaas4.step(&body(), &state, &input(k), 0.0, 0.1).unwrap();
        }
        let (pose, v) = (state.configuration, state.velocity);
        let world = pose.rotation * Vector2::new(v.y, v.z);
        let (p, heading) = (pose.translation.vector, LieGroup::log(&pose).x);
        let found = SVector::from([p.x, p.y, heading, world.x, world.y, v.x]);
        assert!((found - SVector::from(GOLDEN)).amax() < 1e-8, "{found}");
    }

    #[test]
    fn equals_the_body_in_space() {
        let planar = body();
        let c = Vector3::new(planar.center_of_mass.x, planar.center_of_mass.y, 0.0);
        let inertia = Matrix3::from_diagonal(&Vector3::new(0.1, 0.12, planar.inertia_about_com));
        let spatial = FreeFlyer::new(InertialParameters::about_com(planar.mass, c, inertia));
        let (w, wrench) = (0.7, PlanarWrench { torque: 0.3, force: Vector2::new(1.2, -0.8) });
        let found = planar.forward(w, &wrench);
        let expected = spatial.forward(
            &Twist::new(Vector3::new(0.0, 0.0, w), Vector3::zeros()),
            &Wrench::new(Vector3::new(0.0, 0.0, 0.3), Vector3::new(1.2, -0.8, 0.0)),
        );
        assert!((found.angular_acceleration - expected.angular_acceleration_body.z).abs() < 1e-14);
        assert!((found.acceleration_origin_body - expected.acceleration_origin_body.xy()).amax() < 1e-14);
        let back = planar.inverse(w, &found);
        assert!((back.torque - wrench.torque).abs() < 1e-14 && (back.force - wrench.force).amax() < 1e-14);
    }
}
