//! Actuators as a simulator drives them.

use super::StatefulActuation;
use crate::error::DynamicsError;
use tumble_lie::Wrench;
use tumble_lie::nalgebra::Vector3;

/// What came of a wanted wrench, held for some time.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Driven {
    /// Mean of what acted, body axes, torque about the body origin.
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
/// let driven = drive.drive(&Wrench::new(Vector3::zeros(), Vector3::x() * 3.0), &Vector3::zeros(), 0.016)?;
/// assert!(driven.is_at_limit && driven.wrench_body.force == Vector3::x());
/// # Ok::<(), tumble_dynamics::DynamicsError>(())
/// ```
/// Tutorial: [an actuator of your own](https://github.com/tumble-robotics/tumble/blob/main/crates/dynamics/tests/suite/custom_actuator.rs).
/// # Frame
/// Body axes, torque about the body origin.
pub trait ActuatorDrive: Send {
    /// Asks for a wrench for the next `hold_s` seconds, the body turning at `rate_body` (body axes, rad/s) as they begin. What acts
    /// includes the [gyroscopic torque](super::StatefulActuation::gyroscopic_torque) of stored momentum at that rate.
    ///
    /// # Errors
    /// [`DynamicsError::NotFinite`] for a wrench that is not; the machine's own otherwise.
    fn drive(
        &mut self,
        wanted_body: &Wrench<f64>,
        rate_body: &Vector3<f64>,
        hold_s: f64,
    ) -> Result<Driven, DynamicsError>;
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
    fn drive(
        &mut self,
        wanted_body: &Wrench<f64>,
        rate_body: &Vector3<f64>,
        hold_s: f64,
    ) -> Result<Driven, DynamicsError> {
        let command = self.actuators.allocate_over(&self.inner, wanted_body, hold_s)?;
        let mut wrench_body = self.actuators.realize_over(&self.inner, &command, hold_s);
        let (left_out, wanted) = ((*wanted_body - wrench_body).to_vector().amax(), wanted_body.to_vector().amax());
        wrench_body.torque += self.actuators.gyroscopic_torque(&self.inner, rate_body);
        self.inner = self.actuators.advanced(&self.inner, &command, hold_s);
        Ok(Driven { wrench_body, is_at_limit: left_out > ROUNDING * wanted })
    }
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;
    use crate::{ReactionWheel, ReactionWheels};

    /// Wheels driven along x until they are full: they stop to push, and what they hold turns with the body.
    #[test]
    fn wheels_fill_up_and_precess() {
        let wheel = |axis_body| ReactionWheel { axis_body, largest_torque_n_m: 0.2, largest_momentum_n_m_s: 0.5 };
        let wheels = ReactionWheels::try_new([Vector3::x_axis(), Vector3::y_axis(), Vector3::z_axis()].map(wheel));
        let mut drive = StatefulDrive::new(wheels.unwrap(), Vector3::zeros());
        let (wanted, still) = (Wrench::new(Vector3::x() * 0.1, Vector3::zeros()), Vector3::zeros());
        for _ in 0..5 {
            let driven = drive.drive(&wanted, &still, 1.0).unwrap();
            assert!((driven.wrench_body - wanted).to_vector().amax() < 1e-15 && !driven.is_at_limit, "{driven:?}");
        }
        let full = drive.drive(&wanted, &(Vector3::z() * 2.0), 1.0).unwrap();
        // h x w: (-0.5, 0, 0) x (0, 0, 2) = (0, 1, 0)
        assert!((full.wrench_body.torque - Vector3::y()).amax() < 1e-12 && full.is_at_limit, "{full:?}");
        let bad = Wrench::new(Vector3::repeat(f64::NAN), Vector3::zeros());
        assert_eq!(drive.drive(&bad, &still, 1.0), Err(DynamicsError::NotFinite));
    }
}
