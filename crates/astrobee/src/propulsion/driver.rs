//! What stands between the flight software's bytes and the hardware: trims of each robot, and a watchdog.

use super::PropulsionCommand;

/// The robots whose nozzles are trimmed one by one.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn trims_narrow_the_range_from_both_ends_in_integers() {
        let full = PropulsionCommand { impeller_speeds: [166; 2], nozzles: [255; 12] };
        let closed = PropulsionCommand { nozzles: [0; 12], ..full };
        for robot in Robot::ALL {
            let trims = ByteTrims::of(robot);
            for nozzle in 0..12 {
                assert!(trims.low[nozzle] <= 64 && trims.high[nozzle] <= 64, "limits of the driver");
                assert_eq!(trims.apply(&full).nozzles[nozzle], 255 - trims.high[nozzle], "{robot:?} {nozzle}");
                assert_eq!(trims.apply(&closed).nozzles[nozzle], trims.low[nozzle], "{robot:?} {nozzle}");
            }
            assert_eq!(trims.apply(&full).impeller_speeds, [166; 2]);
        }
        let half = PropulsionCommand { nozzles: [128; 12], ..full };
        assert_eq!(ByteTrims::of(Robot::Honey).apply(&half), half);
        // starboard 2: low 5, high 5; 128 * 245 / 255 = 122.98 truncated, + 5
        assert_eq!(ByteTrims::of(Robot::Bsharp).apply(&half).nozzles[1], 127);
        // port 2 of Queen: high 10; 128 * 245 / 255
        assert_eq!(ByteTrims::of(Robot::Queen).apply(&half).nozzles[7], 122);
        assert_eq!(ByteTrims::of(Robot::Melissa).apply(&half).nozzles[8], 129);
        assert_eq!(
            ByteTrims::of(Robot::Bumble).apply(&full).nozzles,
            [255, 255, 255, 255, 255, 255, 250, 255, 250, 250, 255, 255]
        );
    }

    #[test]
    fn silence_shuts_the_propulsion_down() {
        let command = PropulsionCommand { impeller_speeds: [207; 2], nozzles: [40; 12] };
        for (mut watchdog, nozzle) in [(CommandWatchdog::of_hardware(), 128), (CommandWatchdog::of_simulation(), 0)] {
            let shut_down = PropulsionCommand { impeller_speeds: [0; 2], nozzles: [nozzle; 12] };
            assert_eq!(watchdog.command(0), shut_down, "nothing came yet");
            watchdog.receive(1_000, &command);
            assert_eq!(watchdog.command(1_000 + CommandWatchdog::TIMEOUT_NS), command);
            assert_eq!(watchdog.command(1_001 + CommandWatchdog::TIMEOUT_NS), shut_down);
            let patient = watchdog.with_timeout_ns(2_000_000_000);
            assert_eq!(patient.command(1_001 + CommandWatchdog::TIMEOUT_NS), command);
        }
    }
}
