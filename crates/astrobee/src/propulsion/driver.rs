//! What stands between the flight software's bytes and the hardware: trims of each robot, and a watchdog.

use super::PropulsionCommand;

/// The robots whose nozzles are trimmed one by one.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Robot {
    /// Flown.
    Bumble,
    /// Flown; the robot without trims.
    Honey,
    /// Flown.
    Queen,
    /// Ground unit.
    Bsharp,
    /// Ground unit.
    Wannabee,
    /// Ground unit.
    Melissa,
    /// Prototype.
    P4C,
    /// Prototype.
    P4D,
}

impl Robot {
    /// All of them.
    pub const ALL: [Self; 8] =
        [Self::Bumble, Self::Honey, Self::Queen, Self::Bsharp, Self::Wannabee, Self::Melissa, Self::P4C, Self::P4D];
}

/// Counts by which the range of each nozzle is narrowed at its closed and its open end; at most 64.
///
/// # Source
/// `hw/pmc_actuator.config` of nasa/astrobee 0.19.1.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct ByteTrims {
    /// Byte that the hardware gets for a commanded 0.
    pub low: [u8; 12],
    /// Counts below 255 that the hardware gets for a commanded 255.
    pub high: [u8; 12],
}

impl ByteTrims {
    /// The trims of a robot.
    pub fn of(robot: Robot) -> Self {
        let none = [0; 12];
        match robot {
            Robot::Honey | Robot::P4C | Robot::P4D => Self::default(),
            Robot::Bumble => Self { low: none, high: [0, 0, 0, 0, 0, 0, 5, 0, 5, 5, 0, 0] },
            Robot::Queen => Self { low: none, high: [0, 5, 0, 5, 0, 0, 0, 10, 5, 5, 0, 0] },
            Robot::Bsharp | Robot::Wannabee => {
                let both = [0, 5, 0, 0, 0, 0, 0, 0, 0, 0, 0, 14];
                Self { low: both, high: both }
            }
            Robot::Melissa => {
                Self { low: [0, 0, 0, 0, 0, 0, 0, 0, 3, 3, 0, 0], high: [0, 0, 0, 5, 0, 0, 0, 0, 0, 0, 0, 0] }
            }
        }
    }

    /// The command that reaches the hardware: `x (255 - high - low) / 255 + low` of each nozzle, in integers.
    pub fn apply(&self, command: &PropulsionCommand) -> PropulsionCommand {
        let mut trimmed = *command;
        for ((byte, low), high) in trimmed.nozzles.iter_mut().zip(self.low).zip(self.high) {
            let range = 255_u16.saturating_sub(u16::from(low)).saturating_sub(u16::from(high));
            let scaled = u16::from(*byte) * range / 255 + u16::from(low);
            *byte = u8::try_from(scaled).unwrap_or(u8::MAX);
        }
        trimmed
    }
}

/// Holds the last command, and shuts the propulsion down when none has come for 0.32 s.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct CommandWatchdog {
    timeout_ns: i64,
    shut_down: PropulsionCommand,
    last: Option<(i64, PropulsionCommand)>,
}

impl CommandWatchdog {
    /// Time without a command after which the propulsion shuts down, ns.
    pub const TIMEOUT_NS: i64 = 320_000_000;

    /// As the driver of the hardware: impellers off, nozzles half open (128).
    pub fn of_hardware() -> Self {
        Self::shutting_to(128)
    }

    /// As NASA's simulation: impellers off, nozzles closed.
    pub fn of_simulation() -> Self {
        Self::shutting_to(0)
    }

    fn shutting_to(nozzle: u8) -> Self {
        let shut_down = PropulsionCommand { impeller_speeds: [0; 2], nozzles: [nozzle; 12] };
        Self { timeout_ns: Self::TIMEOUT_NS, shut_down, last: None }
    }

    /// With another timeout, ns; a service of the robot raises it to 2 s.
    #[must_use]
    pub fn with_timeout_ns(self, timeout_ns: i64) -> Self {
        Self { timeout_ns, ..self }
    }

    /// A command has come.
    pub fn receive(&mut self, time_ns: i64, command: &PropulsionCommand) {
        self.last = Some((time_ns, *command));
    }

    /// What the hardware is told at this time: the last command, or the shut-down when that is too old or none came yet.
    pub fn command(&self, time_ns: i64) -> PropulsionCommand {
        match self.last {
            Some((received_ns, command)) if time_ns.saturating_sub(received_ns) <= self.timeout_ns => command,
            _ => self.shut_down,
        }
    }
}
