//! A rigid body that turns about a fixed point in gravity: the heavy top, the spherical pendulum.

use crate::error::DynamicsError;
use crate::state::{GroupState, GroupTangent};
use crate::system::MechanicalSystem;
use tumble_lie::Scalar;
use tumble_lie::nalgebra::{Matrix3, UnitQuaternion, Vector3};

/// A rigid body whose origin is held by a ball joint in a uniform gravity field.
///
/// # Frame
/// Body axes about the pivot, except gravity.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PivotedBody<T: Scalar> {
    /// Inertia about the pivot, kg m^2.
    pub inertia_about_pivot: Matrix3<T>,
    /// Mass times centre of mass, kg m.
    pub first_moment: Vector3<T>,
    /// Gravity, inertial axes, m/s^2.
    pub gravity_world: Vector3<T>,
}

impl<T: Scalar> PivotedBody<T> {
    /// Potential energy, zero with the centre of mass in the pivot, J.
    pub fn potential_energy(&self, world_from_body: &UnitQuaternion<T>) -> T {
        -self.gravity_world.dot(&(world_from_body * self.first_moment))
    }

    /// Kinetic energy, J.
    pub fn kinetic_energy(&self, rate_body: &Vector3<T>) -> T {
        rate_body.dot(&(self.inertia_about_pivot * rate_body)) * tumble_lie::real(0.5)
    }
}

impl<T: Scalar> MechanicalSystem for PivotedBody<T> {
    type State = GroupState<UnitQuaternion<T>>;
    /// Torque about the pivot, body axes.
    type Input = Vector3<T>;
    fn vector_field(
        &self,
        _time_s: T,
        state: &Self::State,
        torque_body: &Vector3<T>,
    ) -> Result<GroupTangent<UnitQuaternion<T>>, DynamicsError> {
        let gravity_body = state.configuration.inverse_transform_vector(&self.gravity_world);
        let torque = torque_body + self.first_moment.cross(&gravity_body)
            - state.velocity.cross(&(self.inertia_about_pivot * state.velocity));
        let acceleration = self.inertia_about_pivot.try_inverse().ok_or(DynamicsError::NotFinite)? * torque;
        Ok(GroupTangent { configuration: state.velocity, velocity: acceleration })
    }
}
