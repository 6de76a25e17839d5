//! A rigid body that moves in a plane, three degrees of freedom.

use crate::error::DynamicsError;
use crate::state::{GroupState, GroupTangent};
use crate::system::MechanicalSystem;
use tumble_lie::Scalar;
use tumble_lie::nalgebra::{ComplexField, Isometry2, Vector2, Vector3};

/// A rigid body on a plane (an air-bearing table), moved by a torque and a force at its origin.
///
/// # Frame
/// Body axes, about the body origin. Velocity and input in the order `[angular; linear]`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PlanarBody<T: Scalar> {
    /// Mass, kg.
    pub mass_kg: T,
    /// Centre of mass, m.
    pub center_of_mass: Vector2<T>,
    /// Inertia about the centre of mass, kg m^2.
    pub inertia_about_com: T,
}

impl<T: Scalar> PlanarBody<T> {
    /// Kinetic energy at the velocity `[omega; v_origin]`, J.
    pub fn kinetic_energy(&self, velocity: &Vector3<T>) -> T {
        let (rate, c) = (velocity.x, &self.center_of_mass);
        let velocity_com = Vector2::new(velocity.y - rate * c.y, velocity.z + rate * c.x);
        (velocity_com.norm_squared() * self.mass_kg + rate * rate * self.inertia_about_com) * tumble_lie::real(0.5)
    }
}

impl<T: Scalar> MechanicalSystem for PlanarBody<T> {
    type State = GroupState<Isometry2<T>>;
    /// `[torque; force]`, body axes, about the body origin.
    type Input = Vector3<T>;
    fn vector_field(
        &self,
        _time_s: T,
        state: &Self::State,
        wrench_body: &Vector3<T>,
    ) -> Result<GroupTangent<Isometry2<T>>, DynamicsError> {
        let (c, force) = (&self.center_of_mass, Vector2::new(wrench_body.y, wrench_body.z));
        let (rate, velocity) = (state.velocity.x, Vector2::new(state.velocity.y, state.velocity.z));
        let angular = (wrench_body.x - (c.x * force.y - c.y * force.x)) / self.inertia_about_com;
        // inertial acceleration of the origin, then the component rate of its velocity
        let acceleration = force / self.mass_kg + Vector2::new(c.y, -c.x) * angular + c * (rate * rate);
        let linear = acceleration + Vector2::new(velocity.y, -velocity.x) * rate;
        if angular.is_finite() && linear.iter().all(ComplexField::is_finite) {
            Ok(GroupTangent { configuration: state.velocity, velocity: Vector3::new(angular, linear.x, linear.y) })
        } else {
            Err(DynamicsError::NotFinite)
        }
    }
}
