//! How a wanted wrench becomes a real one.

use super::SimulatorError;
use crate::propulsion::inverse::wrench_of_flow;
use crate::propulsion::{
    ForceAllocation, ImpellerMode, InverseAllocation, PropulsionCommand, PropulsionPlant, PropulsionSettings,
    QuantizedAllocation,
};
use crate::spheres;
use tumble_dynamics::nalgebra::{SVector, Vector3};
use tumble_dynamics::{Actuation, DynamicsError, PulsedThrusters, Rotor, RotorSet, WrenchBox};
use tumble_lie::Wrench;

/// A rotor is at its limit at this part of its largest speed: the last bits are rounding.
const AT_LIMIT: f64 = 1.0 - 1e-12;

/// What makes the wrench. Wrenches are in body axes with the torque about the body origin.
#[allow(clippy::large_enum_variant)] // one per simulator, never moved
pub enum Actuators {
    /// Whatever is wanted.
    Exact,
    /// What is wanted, each component cut at its limit.
    Limited(WrenchBox),
    /// Valves that open for pulses.
    Pulsed(PulseTrain<12>),
    /// Rotors that are at their speeds at once.
    Rotors(RotorSet<6>),
    /// Allocation to bytes as flown, then servos, impellers and nozzles.
    Hardware {
        /// From wrench to bytes.
        allocation: QuantizedAllocation,
        /// From bytes to the wrench that acts.
        plant: PropulsionPlant,
    },
}

/// Thrusters whose pulses all begin with the valves' own period, which need not be the simulator's; a pulse is drawn out
/// over as many control periods as it lasts, and each has the mean of its part.
#[derive(Clone, Debug)]
pub struct PulseTrain<const N: usize> {
    thrusters: PulsedThrusters<N>,
    ticks_per_step: u32,
    /// Within the valves' period.
    tick: u32,
    pulses: [u32; N],
}

impl<const N: usize> PulseTrain<N> {
    /// Closed valves at the beginning of their period; their clock ticks `ticks_per_step` times in a control period.
    pub fn new(thrusters: PulsedThrusters<N>, ticks_per_step: u32) -> Self {
        Self { thrusters, ticks_per_step, tick: 0, pulses: [0; N] }
    }

    /// The mean wrench of the next control period, and whether a valve is open throughout its own.
    ///
    /// # Errors
    /// As [`PulsedThrusters::allocate`].
    pub fn step(&mut self, wanted: &Wrench<f64>) -> Result<(Wrench<f64>, bool), DynamicsError> {
        let mut open = [0_u32; N];
        for _ in 0..self.ticks_per_step {
            if self.tick == 0 {
                self.pulses = self.thrusters.allocate(wanted)?;
            }
            for (open, pulse) in open.iter_mut().zip(&self.pulses) {
                *open += u32::from(self.tick < *pulse);
            }
            self.tick = (self.tick + 1) % self.thrusters.timing.ticks_per_period.max(1);
        }
        let set = &self.thrusters.thrusters;
        let share = |i: usize| f64::from(open[i]) / f64::from(self.ticks_per_step.max(1));
        let thrusts = SVector::from_fn(|i, _| set.thrusters()[i].largest_thrust_n * share(i));
        let at_limit = self.pulses.iter().any(|pulse| *pulse >= self.thrusters.timing.ticks_per_period);
        Ok((set.realize(&thrusts), at_limit))
    }
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
        }
    }

    /// The twelve valves of [`spheres`], closed.
    ///
    /// # Errors
    /// As [`spheres::thrusters`].
    pub fn spheres() -> Result<Self, DynamicsError> {
        Ok(Self::Pulsed(PulseTrain::new(spheres::thrusters()?, spheres::TICKS_PER_FLIGHT_STEP)))
    }

    /// One control period; the body turns at `rate_body`.
    pub(super) fn step(&mut self, wanted: &Wrench<f64>, rate_body: &Vector3<f64>) -> Result<Made, SimulatorError> {
        let (realized, saturated) = match self {
            Self::Exact if wanted.to_vector().iter().all(|x| x.is_finite()) => (*wanted, false),
            Self::Exact => return Err(DynamicsError::NotFinite.into()),
            Self::Limited(limits) => {
                let given = limits.realize(&limits.allocate(wanted)?);
                (given, given != *wanted)
            }
            Self::Pulsed(valves) => valves.step(wanted)?,
            Self::Rotors(rotors) => {
                let speeds = rotors.allocate(wanted)?;
                let at_limit = |(speed, rotor): (&f64, &Rotor)| speed.abs() >= rotor.largest_speed_rad_s * AT_LIMIT;
                (rotors.realize(&speeds), speeds.iter().zip(rotors.rotors()).any(at_limit))
            }
            Self::Hardware { allocation, plant } => {
                let steps = allocation.0.allocate_steps(wanted)?;
                let command = steps.bytes;
                // What the robot can know: what its bytes give in steady flow.
                let believed = wrench_of_flow(&InverseAllocation::default().flow_of_bytes(&command));
                return Ok(Made {
                    believed_wrench_body: believed,
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
            saturated,
        })
    }
}
