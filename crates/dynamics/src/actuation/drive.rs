//! Actuators as a simulator drives them.

use super::StatefulActuation;
use crate::error::DynamicsError;
use tumble_lie::Wrench;
use tumble_lie::nalgebra::Vector3;

/// What came of a wanted wrench, held for some time.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Driven {
    /// Mean of what the actuators gave, body axes, torque about the body origin: of wheels the reaction to their motors.
    pub wrench_body: Wrench<f64>,
    /// Whether the actuators could not give what was wanted: a limit, and for [`StatefulDrive`] whatever else made it less or other.
    pub is_at_limit: bool,
}

/// Actuators that are told a wanted wrench in every control period and carry their own state on: what a simulator holds
/// without knowing the robot.
///
/// [`StatefulDrive`] makes one of every [`StatefulActuation`], and thus of every [`Actuation`](crate::Actuation).
///
/// # Example
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
/// Tutorial: [an actuator of your own](https://github.com/tumble-robotics/tumble/blob/main/crates/dynamics/tests/suite/custom_actuator.rs).
/// # Frame
/// Body axes, torque about the body origin.
pub trait ActuatorDrive: Send {
    /// Asks for a wrench for the next `hold_s` seconds.
    ///
    /// # Errors
    /// [`DynamicsError::NotFinite`] for a wrench that is not; the machine's own otherwise.
    fn drive(&mut self, wanted_body: &Wrench<f64>, hold_s: f64) -> Result<Driven, DynamicsError>;

    /// Angular momentum that turns within the body now, relative to it, body axes, N m s; `None` of actuators that never hold any. Whoever
    /// simulates the body adds the torque of turning it along, as [`StoredMomentum`](crate::StoredMomentum) does.
    fn stored_momentum_body(&self) -> Option<Vector3<f64>> {
        None
    }
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
        let (left_out, wanted) = ((*wanted_body - wrench_body).to_vector().amax(), wanted_body.to_vector().amax());
        self.inner = self.actuators.advanced(&self.inner, &command, hold_s);
        Ok(Driven { wrench_body, is_at_limit: left_out > ROUNDING * wanted })
    }

    fn stored_momentum_body(&self) -> Option<Vector3<f64>> {
        self.actuators.stored_momentum_body(&self.inner)
    }
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;
    use crate::{ReactionWheel, ReactionWheels};

    /// Wheels driven along x until they are full: what the body got they hold, and they stop to push.
    #[test]
    fn wheels_fill_up() {
        let wheel = |axis_body| ReactionWheel { axis_body, largest_torque_n_m: 0.2, largest_momentum_n_m_s: 0.5 };
        let wheels = ReactionWheels::try_new([Vector3::x_axis(), Vector3::y_axis(), Vector3::z_axis()].map(wheel));
        let mut drive = StatefulDrive::new(wheels.unwrap(), Vector3::zeros());
        let wanted = Wrench::new(Vector3::x() * 0.1, Vector3::zeros());
        for seconds in 0..5 {
            assert!((drive.stored_momentum_body().unwrap() + Vector3::x() * 0.1 * f64::from(seconds)).amax() < 1e-15);
            let driven = drive.drive(&wanted, 1.0).unwrap();
            assert!((driven.wrench_body - wanted).to_vector().amax() < 1e-15 && !driven.is_at_limit, "{driven:?}");
        }
        let full = drive.drive(&wanted, 1.0).unwrap();
        assert!(full.wrench_body.torque.amax() < 1e-12 && full.is_at_limit, "{full:?}");
        assert!((drive.stored_momentum_body().unwrap() + Vector3::x() * 0.5).amax() < 1e-12);
        let bad = Wrench::new(Vector3::repeat(f64::NAN), Vector3::zeros());
        assert_eq!(drive.drive(&bad, 1.0), Err(DynamicsError::NotFinite));
    }
}
