//! How the robot pushes itself: two modules, each a plenum that one impeller fills and six nozzles empty.
//!
//! A value goes this way: wanted wrench -> [`PropulsionCommand`] (what the flight software sends) -> flap angles and
//! impeller speeds (what the hardware does) -> wrench on the body.
//!
//! Module 0 is starboard (+y, "PM1", nozzles 0 to 5), module 1 is port (-y, "PM2", nozzles 6 to 11). Everything is in
//! body axes: x forward, y starboard, z towards the deck, origin at the geometric centre.

pub mod allocation;
pub mod blower;
mod commanded;
pub mod constants;
mod damage;
mod driver;
mod impeller;
pub mod inverse;
pub mod nozzle;
mod pid;
mod plant;
mod replay;
mod servo;
mod wrench_set;

pub use allocation::{Allocation, ForceAllocation, QuantizedAllocation};
pub use commanded::{commanded_nozzles, erring_nozzles, largest_thrusts_n};
pub use damage::Damage;
pub use driver::{ByteTrims, CommandWatchdog, Robot};
pub use impeller::{IMPELLER_INERTIA_KG_M2, Impeller, SPEED_COMMAND_RATE_RAD_S2};
pub use inverse::{AreaTable, Belief, FlapCommand, InverseAllocation};
pub use nozzle::{Module, PositivityShift};
pub use plant::{GyroscopicSign, PropulsionPlant, PropulsionSettings, PropulsionStep};
pub use replay::PropulsionReplay;
pub use servo::Servo;
pub use wrench_set::nozzle_wrench_set;

/// How fast the impellers turn, as the flight software names it.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum ImpellerMode {
    /// Impellers at rest: no pressure, no thrust.
    Off,
    /// 2000 rpm.
    Quiet,
    /// 2500 rpm.
    #[default]
    Nominal,
    /// 2800 rpm.
    Aggressive,
}

impl ImpellerMode {
    /// All modes, in the order of their numbers.
    pub const ALL: [Self; 4] = [Self::Off, Self::Quiet, Self::Nominal, Self::Aggressive];

    /// The mode of a number 0 to 3.
    pub fn from_number(number: u8) -> Option<Self> {
        Self::ALL.get(usize::from(number)).copied()
    }

    /// Number in messages and files, 0 to 3.
    pub fn number(self) -> u8 {
        self as u8
    }

    /// Speed that the allocation assumes, rad/s.
    pub fn speed_rad_s(self) -> f64 {
        let rpm = match self {
            Self::Off => 0.0,
            Self::Quiet => 2000.0,
            Self::Nominal => 2500.0,
            Self::Aggressive => 2800.0,
        };
        rpm * core::f64::consts::TAU / 60.0
    }

    /// The byte that asks a module for this speed: `floor(0.792095 N + 0.5)`.
    pub fn speed_byte(self) -> u8 {
        match self {
            Self::Off => 0,
            Self::Quiet => 166,
            Self::Nominal => 207,
            Self::Aggressive => 232,
        }
    }
}

/// What both modules are told: impeller speeds and nozzle openings in counts.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct PropulsionCommand {
    /// Impeller speed of each module, counts of [`constants::SPEED_COUNTS_PER_RAD_S`].
    pub impeller_speeds: [u8; 2],
    /// Opening of each nozzle, 0 closed, 255 at the open stop.
    pub nozzles: [u8; 12],
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn speed_bytes_follow_their_rule() {
        for mode in ImpellerMode::ALL {
            let counts = (constants::SPEED_COUNTS_PER_RAD_S * mode.speed_rad_s() + 0.5).floor();
            assert!((counts - f64::from(mode.speed_byte())).abs() < 1e-12);
            assert_eq!(ImpellerMode::from_number(mode.number()), Some(mode));
        }
        assert_eq!(ImpellerMode::from_number(4), None);
    }
}
