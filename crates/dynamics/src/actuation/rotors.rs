//! Rotors that turn both ways.

use super::Actuation;
use super::effectiveness::{finite, limited, right_inverse};
use crate::error::DynamicsError;
use tumble_lie::Wrench;
use tumble_lie::nalgebra::{ComplexField, SMatrix, SVector, UnitVector3, Vector3};

/// A propeller of fixed pitch, as good one way as the other.
/// # Frame
/// Body axes.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Rotor {
    /// Its hub, from the body origin, m.
    pub position_body: Vector3<f64>,
    /// The way it pushes the body at positive speed.
    pub axis_body: UnitVector3<f64>,
    /// Thrust per squared speed, N s^2/rad^2; positive.
    pub thrust_coefficient: f64,
    /// Torque of the air on the body about the axis per squared speed, N m s^2/rad^2: negative for a rotor that turns
    /// right-handed about its axis at positive speed.
    pub drag_coefficient: f64,
    /// Largest speed either way, rad/s; positive.
    pub largest_speed_rad_s: f64,
}

impl Rotor {
    /// Wrench at the largest positive speed, torque about the body origin.
    pub fn wrench_body(&self) -> Wrench<f64> {
        let axis = self.axis_body.into_inner() * (self.largest_speed_rad_s * self.largest_speed_rad_s);
        let force = axis * self.thrust_coefficient;
        Wrench::new(self.position_body.cross(&force) + axis * self.drag_coefficient, force)
    }
}

/// `N` rotors that share a wrench with the least sum of squared efforts (thrust over largest thrust).
///
/// Its command is the speed of each, rad/s. When one rotor would have to exceed its limit, the whole wrench is scaled
/// down along its direction. With six rotors that is all the machine can give that way; with more, a sharing that is not
/// of least norm might give a little more.
/// # Frame
/// Body axes, torque about the body origin.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RotorSet<const N: usize> {
    rotors: [Rotor; N],
    /// Wrench per effort.
    effectiveness: SMatrix<f64, 6, N>,
    /// Efforts per wrench.
    sharing: SMatrix<f64, N, 6>,
}

impl<const N: usize> RotorSet<N> {
    /// Rotors that together can push and turn any way.
    ///
    /// # Errors
    /// [`DynamicsError::InvalidActuator`] for one whose thrust or speed is not positive or whose numbers are not finite,
    /// [`DynamicsError::OutOfReach`] if some direction cannot be given.
    pub fn try_new(rotors: [Rotor; N]) -> Result<Self, DynamicsError> {
        let mut effectiveness = SMatrix::<f64, 6, N>::zeros();
        for (index, rotor) in rotors.iter().enumerate() {
            let wrench = rotor.wrench_body().to_vector();
            let pushes = rotor.thrust_coefficient > 0.0 && rotor.largest_speed_rad_s > 0.0;
            if !(wrench.iter().all(ComplexField::is_finite) && pushes) {
                return Err(DynamicsError::InvalidActuator { index });
            }
            effectiveness.set_column(index, &wrench);
        }
        Ok(Self { rotors, effectiveness, sharing: right_inverse(&effectiveness)? })
    }

    /// The rotors.
    pub fn rotors(&self) -> &[Rotor; N] {
        &self.rotors
    }
}

impl<const N: usize> Actuation for RotorSet<N> {
    type Command = SVector<f64, N>;

    fn allocate(&self, wrench_body: &Wrench<f64>) -> Result<SVector<f64, N>, DynamicsError> {
        let efforts = finite(self.sharing * finite(wrench_body.to_vector())?)?;
        let efforts = efforts / efforts.amax().max(1.0);
        Ok(SVector::from_fn(|i, _| {
            let speed = ComplexField::sqrt(efforts[i].abs()) * self.rotors[i].largest_speed_rad_s;
            speed.copysign(efforts[i])
        }))
    }

    fn realize(&self, command: &SVector<f64, N>) -> Wrench<f64> {
        let effort = |i: usize| {
            let speed = limited(command[i] / self.rotors[i].largest_speed_rad_s, -1.0, 1.0);
            speed * speed.abs()
        };
        Wrench::from(self.effectiveness * SVector::<f64, N>::from_fn(|i, _| effort(i)))
    }
}
