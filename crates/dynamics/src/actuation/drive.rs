//! Actuators as a simulator drives them.

use super::StatefulActuation;
use crate::error::DynamicsError;
use tumble_lie::Wrench;

/// What came of a wanted wrench, held for some time.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Driven {
    /// Mean of what acted, body axes, torque about the body origin.
    pub wrench_body: Wrench<f64>,
    /// Whether the actuators were at a limit.
    pub is_at_limit: bool,
}

/// Actuators that are told a wanted wrench in every control period and carry their own state on: what a simulator holds
/// without knowing the robot.
///
/// [`StatefulDrive`] makes one of every [`StatefulActuation`], and thus of every [`Actuation`](crate::Actuation):
///
/// ```
/// use tumble_dynamics::lie::Wrench;
/// use tumble_dynamics::nalgebra::Vector3;
/// use tumble_dynamics::{ActuatorDrive, StatefulDrive, WrenchBox};
/// let limits = WrenchBox { torque_limit: Vector3::repeat(0.1), force_limit: Vector3::repeat(1.0) };
/// let mut drive: Box<dyn ActuatorDrive> = Box::new(StatefulDrive::new(limits, ()));
/// let driven = drive.drive(&Wrench::new(Vector3::zeros(), Vector3::x() * 3.0), 0.016)?;
/// assert!(driven.is_at_limit && driven.wrench_body.force == Vector3::x());
/// # Ok::<(), tumble_dynamics::DynamicsError>(())
/// ```
/// # Frame
/// Body axes, torque about the body origin.
pub trait ActuatorDrive: Send {
    /// Asks for a wrench for the next `hold_s` seconds; what acts leaves
    /// [`gyroscopic_torque`](super::StatefulActuation::gyroscopic_torque) out.
    ///
    /// # Errors
    /// [`DynamicsError::NotFinite`] for a wrench that is not; the machine's own otherwise.
    fn drive(&mut self, wanted_body: &Wrench<f64>, hold_s: f64) -> Result<Driven, DynamicsError>;
}

/// A [`StatefulActuation`] with its state.
#[derive(Clone, Debug)]
pub struct StatefulDrive<A: StatefulActuation> {
    actuators: A,
    inner: A::Inner,
}

impl<A: StatefulActuation> StatefulDrive<A> {
    /// Actuators in this state.
    pub fn new(actuators: A, inner: A::Inner) -> Self {
        Self { actuators, inner }
    }
}

/// What is given may differ from what is wanted by rounding, as a share of it.
const ROUNDING: f64 = 1e-9;

impl<A: StatefulActuation + Send> ActuatorDrive for StatefulDrive<A>
where
    A::Inner: Send,
{
    fn drive(&mut self, wanted_body: &Wrench<f64>, hold_s: f64) -> Result<Driven, DynamicsError> {
        let command = self.actuators.allocate_over(&self.inner, wanted_body, hold_s)?;
        let wrench_body = self.actuators.realize_over(&self.inner, &command, hold_s);
        self.inner = self.actuators.advanced(&self.inner, &command, hold_s);
        let (left_out, wanted) = ((*wanted_body - wrench_body).to_vector().amax(), wanted_body.to_vector().amax());
        Ok(Driven { wrench_body, is_at_limit: left_out > ROUNDING * wanted })
    }
}
