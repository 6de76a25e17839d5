//! A mass on a spring: the smallest system on which integrators differ.

use crate::error::DynamicsError;
use crate::state::{GroupState, GroupTangent};
use crate::system::MechanicalSystem;
use tumble_lie::Scalar;
use tumble_lie::nalgebra::{Translation, Vector1};

/// A mass on a linear spring.
///
/// # Source
/// Thesis, figure 2.6.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Oscillator<T: Scalar> {
    /// Mass, kg.
    pub mass_kg: T,
    /// Stiffness, N/m.
    pub stiffness_n_per_m: T,
}

impl<T: Scalar> Oscillator<T> {
    /// Kinetic energy, J.
    pub fn kinetic_energy(&self, velocity: T) -> T {
        self.mass_kg * velocity * velocity * tumble_lie::real(0.5)
    }

    /// Energy of the spring, J.
    pub fn potential_energy(&self, position: T) -> T {
        self.stiffness_n_per_m * position * position * tumble_lie::real(0.5)
    }
}

impl<T: Scalar> MechanicalSystem for Oscillator<T> {
    type State = GroupState<Translation<T, 1>>;
    /// Force, N.
    type Input = Vector1<T>;
    fn vector_field(
        &self,
        _time_s: T,
        state: &Self::State,
        force: &Vector1<T>,
    ) -> Result<GroupTangent<Translation<T, 1>>, DynamicsError> {
        let acceleration = (force - state.configuration.vector * self.stiffness_n_per_m) / self.mass_kg;
        Ok(GroupTangent { configuration: state.velocity, velocity: acceleration })
    }
}
