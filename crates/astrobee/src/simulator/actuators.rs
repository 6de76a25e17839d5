//! How a wanted wrench becomes a real one.

use super::SimulatorError;
use crate::propulsion::{
    ForceAllocation, ImpellerMode, PropulsionCommand, PropulsionPlant, PropulsionSettings, QuantizedAllocation,
};
use tumble_dynamics::nalgebra::Vector3;
use tumble_dynamics::{Actuation, DynamicsError, WrenchBox};
use tumble_lie::Wrench;

/// What makes the wrench. Wrenches are in body axes with the torque about the body origin.
#[allow(clippy::large_enum_variant)] // one per simulator, never moved
pub enum Actuators {
    /// Whatever is wanted.
    Exact,
    /// What is wanted, each component cut at its limit.
    Limited(WrenchBox),
    /// Allocation to bytes as flown, then servos, impellers and nozzles.
    Hardware {
        /// From wrench to bytes.
        allocation: QuantizedAllocation,
        /// From bytes to the wrench that acts.
        plant: PropulsionPlant,
        /// The same as the robot knows it: [`PropulsionSettings::PHYSICAL`], whatever the hardware is.
        known: PropulsionPlant,
    },
}

/// What came of a wanted wrench in one control period.
pub(super) struct Made {
    pub believed_wrench_body: Wrench<f64>,
    pub realized_wrench_body: Wrench<f64>,
    pub command: PropulsionCommand,
    pub saturated: bool,
}

impl Actuators {
    /// The hardware with its impellers at speed, nozzles closed.
    pub fn hardware(mode: ImpellerMode, center_of_mass_body: Vector3<f64>, settings: PropulsionSettings) -> Self {
        Self::Hardware {
            allocation: QuantizedAllocation(ForceAllocation::new(mode, center_of_mass_body)),
            plant: PropulsionPlant::spun_up(settings, mode),
            known: PropulsionPlant::spun_up(PropulsionSettings::PHYSICAL, mode),
        }
    }

    /// One control period; the body turns at `rate_body`.
    pub(super) fn step(&mut self, wanted: &Wrench<f64>, rate_body: &Vector3<f64>) -> Result<Made, SimulatorError> {
        let realized = match self {
            Self::Exact if wanted.to_vector().iter().all(|x| x.is_finite()) => *wanted,
            Self::Exact => return Err(DynamicsError::NotFinite.into()),
            Self::Limited(limits) => limits.realize(&limits.allocate(wanted)?),
            Self::Hardware { allocation, plant, known } => {
                let steps = allocation.0.allocate_steps(wanted)?;
                let command = steps.bytes;
                return Ok(Made {
                    // What the robot can know: what its bytes make of servos and impellers as they are on paper.
                    believed_wrench_body: known.step(&command, &Vector3::zeros()).wrench_body,
                    realized_wrench_body: plant.step(&command, rate_body).wrench_body,
                    command,
                    saturated: steps.limits.is_saturated(),
                });
            }
        };
        Ok(Made {
            believed_wrench_body: realized,
            realized_wrench_body: realized,
            command: PropulsionCommand::default(),
            saturated: realized != *wanted,
        })
    }
}
