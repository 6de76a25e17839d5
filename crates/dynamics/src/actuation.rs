//! From a wanted wrench to a command, and what the command really gives (`f64`: a decision).

mod drive;
mod effectiveness;
mod pulse_train;
mod reaction_wheels;
mod rotors;
mod stateful;
mod thrusters;

pub use drive::{ActuatorDrive, Driven, StatefulDrive};
pub use pulse_train::PulseTrain;
pub use reaction_wheels::{ReactionWheel, ReactionWheels};
pub use rotors::{Rotor, RotorSet};
pub use stateful::StatefulActuation;
pub use thrusters::{PulseTiming, PulsedThrusters, Thruster, ThrusterSet};

use crate::error::DynamicsError;
use tumble_lie::Wrench;
use tumble_lie::nalgebra::Vector3;

/// What turns wanted wrenches into commands of a machine that has no state of its own: nozzles, rotors.
///
/// What spins up, empties or lags is a [`StatefulActuation`]; it has no `Actuation`, so that no plant can hold it without
/// carrying its state on.
///
/// Laws ([`check_actuation`](crate::laws::check_actuation), feature `testing`): a wrench inside the limits is realised;
/// no limit is ever exceeded; what was realised can be realised again.
///
/// # Example
/// ```
/// use tumble_dynamics::lie::Wrench;
/// use tumble_dynamics::nalgebra::Vector3;
/// use tumble_dynamics::{Actuation, DynamicsError};
///
/// /// One fan along x: its command is the thrust, from nothing to two newtons.
/// struct Fan;
/// impl Actuation for Fan {
///     type Command = f64;
///     fn allocate(&self, wrench_body: &Wrench<f64>) -> Result<f64, DynamicsError> {
///         let thrust_n = wrench_body.force.x;
///         if thrust_n.is_finite() { Ok(thrust_n.clamp(0.0, 2.0)) } else { Err(DynamicsError::NotFinite) }
///     }
///     fn realize(&self, thrust_n: &f64) -> Wrench<f64> {
///         Wrench::new(Vector3::zeros(), Vector3::x() * *thrust_n)
///     }
/// }
/// let wanted = Wrench::new(Vector3::zeros(), Vector3::x() * 5.0);
/// assert_eq!(Fan.realize(&Fan.allocate(&wanted)?).force.x, 2.0);
/// # Ok::<(), DynamicsError>(())
/// ```
/// Tutorial: [an actuator of your own](https://github.com/tumble-robotics/tumble/blob/main/crates/dynamics/tests/suite/custom_actuator.rs).
pub trait Actuation {
    /// What the machine is told: a wrench, nozzle openings, wheel torques.
    type Command: Clone + core::fmt::Debug;
    /// The command whose wrench is the wanted one, or the closest the machine can give.
    ///
    /// # Errors
    /// [`DynamicsError::NotFinite`] for a wrench that is not; the machine's own otherwise.
    fn allocate(&self, wrench_body: &Wrench<f64>) -> Result<Self::Command, DynamicsError>;
    /// The wrench that a command gives: what saturation lets through.
    fn realize(&self, command: &Self::Command) -> Wrench<f64>;
}

/// Independent symmetric limits on the components of torque and force.
///
/// Its command is the wrench itself, cut at the limits component by component.
/// # Frame
/// Body axes, torque about the body origin.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct WrenchBox {
    /// Largest torque about each axis, N m; not negative.
    pub torque_limit: Vector3<f64>,
    /// Largest force along each axis, N; not negative.
    pub force_limit: Vector3<f64>,
}

impl WrenchBox {
    /// The same limits for every axis: a torque in N m, a force in N.
    pub fn in_every_axis(torque_n_m: f64, force_n: f64) -> Self {
        Self { torque_limit: Vector3::repeat(torque_n_m), force_limit: Vector3::repeat(force_n) }
    }
}

/// Each component cut at plus and minus its limit.
fn cut(v: &Vector3<f64>, limit: &Vector3<f64>) -> Vector3<f64> {
    v.zip_map(limit, |component, bound| component.min(bound).max(-bound))
}

impl Actuation for WrenchBox {
    type Command = Wrench<f64>;
    fn allocate(&self, wrench_body: &Wrench<f64>) -> Result<Wrench<f64>, DynamicsError> {
        if !wrench_body.to_vector().iter().all(|component| component.is_finite()) {
            return Err(DynamicsError::NotFinite);
        }
        Ok(self.realize(wrench_body))
    }
    fn realize(&self, command: &Wrench<f64>) -> Wrench<f64> {
        Wrench::new(cut(&command.torque, &self.torque_limit), cut(&command.force, &self.force_limit))
    }
}
