//! How a wanted wrench becomes a real one.

use super::SimulatorError;
use crate::propulsion::PropulsionCommand;
use tumble_dynamics::nalgebra::Vector3;
use tumble_dynamics::{Actuation, DynamicsError, WrenchBox};
use tumble_lie::Wrench;

/// What makes the wrench. Wrenches are in body axes with the torque about the body origin.
pub enum Actuators {
    /// Whatever is wanted.
    Exact,
    /// What is wanted, each component cut at its limit.
    Limited(WrenchBox),
}

/// What came of a wanted wrench in one control period.
pub(super) struct Made {
    pub believed_wrench_body: Wrench<f64>,
    pub realized_wrench_body: Wrench<f64>,
    pub command: PropulsionCommand,
}

impl Actuators {
    /// One control period; the body turns at `rate_body`.
    pub(super) fn step(&mut self, wanted: &Wrench<f64>, _rate_body: &Vector3<f64>) -> Result<Made, SimulatorError> {
        let realized = match self {
            Self::Exact if wanted.to_vector().iter().all(|x| x.is_finite()) => *wanted,
            Self::Exact => return Err(DynamicsError::NotFinite.into()),
            Self::Limited(limits) => limits.realize(&limits.allocate(wanted)?),
        };
        Ok(Made {
            believed_wrench_body: realized,
            realized_wrench_body: realized,
            command: PropulsionCommand::default(),
        })
    }
}
