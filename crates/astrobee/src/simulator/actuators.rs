//! How a wanted wrench becomes a real one.

use super::CONTROL_PERIOD_S;
use super::error::SimulatorError;
use crate::propulsion::{
    Damage, ForceAllocation, ImpellerMode, PropulsionCommand, PropulsionPlant, PropulsionSettings, QuantizedAllocation,
};
use tumble_dynamics::nalgebra::Vector3;
use tumble_dynamics::{Actuation, ActuatorDrive, DynamicsError, WrenchBox};
use tumble_lie::Wrench;

/// What makes the wrench. Wrenches are in body axes with the torque about the body origin.
#[allow(clippy::large_enum_variant)] // one per simulator, never moved
#[non_exhaustive]
pub enum Actuators {
    /// Whatever is wanted.
    Exact,
    /// What is wanted, each component cut at its limit.
    Limited(WrenchBox),
    /// Those of another robot.
    Other(Box<dyn ActuatorDrive>),
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

/// Forces that are tried to find the largest one.
const SHARES: u32 = 64;

/// What came of a wanted wrench in one control period.
pub(super) struct Made {
    pub believed_wrench_body: Wrench<f64>,
    pub believed_thrusts_n: [f64; 12],
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

    /// Angular momentum of wheels relative to the body, body axes, N m s; `None` without wheels.
    pub(super) fn stored_momentum_body(&self) -> Option<Vector3<f64>> {
        match self {
            Self::Other(actuators) => actuators.stored_momentum_body(),
            Self::Exact | Self::Limited(_) | Self::Hardware { .. } => None,
        }
    }

    /// One control period; the body turns at `rate_body`.
    pub(super) fn step(
        &mut self,
        wanted: &Wrench<f64>,
        rate_body: &Vector3<f64>,
        damage: &Damage,
    ) -> Result<Made, SimulatorError> {
        let has_nozzles = matches!(self, Self::Exact | Self::Limited(_));
        let (realized, saturated) = match self {
            Self::Exact if wanted.to_vector().iter().all(|x| x.is_finite()) => (*wanted, false),
            Self::Exact => return Err(DynamicsError::NotFinite.into()),
            Self::Limited(limits) => {
                let given = limits.realize(&limits.allocate(wanted)?);
                (given, given != *wanted)
            }
            Self::Other(actuators) => {
                let driven = actuators.drive(wanted, CONTROL_PERIOD_S)?;
                (driven.wrench_body, driven.is_at_limit)
            }
            Self::Hardware { allocation, plant, known } => {
                let steps = allocation.0.allocate_steps(wanted)?;
                let command = steps.bytes;
                plant.set_damage(*damage);
                // What the robot can know: what its bytes make of servos and impellers as they are on paper.
                let believed = known.step(&command, &Vector3::zeros());
                return Ok(Made {
                    believed_wrench_body: believed.wrench_body,
                    believed_thrusts_n: believed.thrusts_n,
                    realized_wrench_body: plant.step(&command, rate_body).wrench_body,
                    command,
                    saturated: steps.limits.is_saturated(),
                });
            }
        };
        Ok(Made {
            believed_wrench_body: realized,
            believed_thrusts_n: [0.0; 12],
            realized_wrench_body: if has_nozzles {
                damage.of_wrench(&realized)
            } else {
                realized * damage.thrust_factor
            },
            command: PropulsionCommand::default(),
            saturated,
        })
    }

    /// See [`super::AstrobeeSimulator::largest_force_n`].
    pub(super) fn largest_force_n(
        &self,
        direction_body: &Vector3<f64>,
        through_body: &Vector3<f64>,
        up_to_n: f64,
    ) -> f64 {
        let given_n = |share: u32| {
            let force = direction_body * (up_to_n * f64::from(share) / f64::from(SHARES));
            let asked = Wrench::new(through_body.cross(&force), force);
            let given = match self {
                Self::Exact | Self::Other(_) => Ok(asked),
                Self::Limited(limits) => limits.allocate(&asked).map(|given| limits.realize(&given)),
                Self::Hardware { allocation, .. } => {
                    allocation.0.allocate(&asked).map(|flaps| allocation.0.realize(&flaps))
                }
            };
            given.map_or(0.0, |given| given.force.dot(direction_body))
        };
        (1..=SHARES).map(given_n).fold(0.0, f64::max)
    }
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;
    use tumble_dynamics::nalgebra::UnitVector3;
    use tumble_dynamics::{
        PulseTiming, PulseTrain, PulsedThrusters, Rotor, RotorSet, StatefulDrive, Thruster, ThrusterSet,
    };

    const THRUST_N: f64 = 0.112;
    const TICKS_PER_STEP: u32 = 16;

    /// Two valves push along each axis and two against it, one at either end of a lever.
    fn valves() -> PulsedThrusters<12> {
        let along = |axis: usize, size: f64| Vector3::from_fn(|row, _| if row == axis % 3 { size } else { 0.0 });
        let set = std::array::from_fn(|i| Thruster {
            position_body: along(i / 4 + 2, if i % 2 == 0 { 0.0965 } else { -0.0965 }),
            direction_body: UnitVector3::new_unchecked(along(i / 4, if i % 4 < 2 { 1.0 } else { -1.0 })),
            largest_thrust_n: THRUST_N,
        });
        let timing = PulseTiming { ticks_per_period: 200, shortest_ticks: 10 };
        PulsedThrusters { thrusters: ThrusterSet::try_new(set).unwrap(), timing }
    }

    fn pulsed() -> Actuators {
        Actuators::Other(Box::new(PulseTrain::new(valves(), TICKS_PER_STEP)))
    }

    /// Six rotors around the body, tilted to alternate sides.
    fn rotors() -> Actuators {
        let set = RotorSet::<6>::try_new(std::array::from_fn(|i| {
            let (y, x) = (f64::from(u8::try_from(i).unwrap()) * std::f64::consts::FRAC_PI_3).sin_cos();
            let side = if i % 2 == 0 { 1.0 } else { -1.0 };
            Rotor {
                position_body: Vector3::new(x, y, 0.0) * 0.2,
                axis_body: UnitVector3::new_normalize(Vector3::new(
                    -y * side,
                    x * side,
                    std::f64::consts::FRAC_1_SQRT_2,
                )),
                thrust_coefficient: 2.5 / 1500.0 / 1500.0,
                drag_coefficient: side * 0.01 * 2.5 / 1500.0 / 1500.0,
                largest_speed_rad_s: 1500.0,
            }
        }));
        Actuators::Other(Box::new(StatefulDrive::new(set.unwrap(), ())))
    }

    #[test]
    fn what_cannot_be_given_is_said() {
        let nothing = Vector3::zeros();
        for mut actuators in [pulsed(), rotors()] {
            let small = Wrench::new(Vector3::zeros(), Vector3::new(0.1, 0.0, 0.0));
            let made = actuators.step(&small, &nothing, &Damage::NONE).unwrap();
            assert!(!made.saturated && made.believed_wrench_body == made.realized_wrench_body);
        }
        for mut actuators in [pulsed(), rotors()] {
            let large = Wrench::new(Vector3::zeros(), Vector3::new(100.0, 0.0, 0.0));
            let made = actuators.step(&large, &nothing, &Damage::NONE).unwrap();
            assert!(made.saturated && made.realized_wrench_body.force.x < 20.0);
            let bad = Wrench::new(Vector3::zeros(), Vector3::new(f64::NAN, 0.0, 0.0));
            assert!(actuators.step(&bad, &nothing, &Damage::NONE).is_err());
        }
    }

    #[test]
    fn nozzles_push_less_hard_than_their_limits_say_and_no_less_than_they_can() {
        let center = Vector3::new(0.03, -0.015, 0.008);
        let hardware = Actuators::hardware(ImpellerMode::Aggressive, center, PropulsionSettings::PHYSICAL);
        let direction = Vector3::new(0.9, 0.38, 0.2).normalize();
        let most_n = hardware.largest_force_n(&direction, &center, 0.5);
        assert!(most_n > 0.2 && most_n < 0.4, "{most_n}");
        // a little is given as it is asked for, and what can be given is not exceeded by asking for more
        assert!((hardware.largest_force_n(&direction, &center, 0.05) - 0.05).abs() < 1e-4);
        assert!(hardware.largest_force_n(&direction, &center, 5.0) < 1.2 * most_n);
        let limited = Actuators::Limited(WrenchBox { torque_limit: center * 0.0, force_limit: Vector3::repeat(0.1) });
        assert!((limited.largest_force_n(&Vector3::x(), &center, 5.0) - 0.1).abs() < 1e-12);
        assert!((Actuators::Exact.largest_force_n(&direction, &center, 5.0) - 5.0).abs() < 1e-12);
    }
}
