//! From recorded commands to the wrench that the nozzles made of them.

use super::constants::speed_of_byte_rad_s;
use super::{PropulsionCommand, PropulsionPlant, PropulsionSettings};
use tumble_lie::Wrench;

/// Time between two commands, and between two steps of the servos, ns.
const PERIOD_NS: i64 = 16_000_000;

/// The nozzles of one robot, their servos stepped as commands come in.
///
/// The flaps follow their bytes late (two periods of dead time, 63 % after 0.064 s, an overshoot), so that what the bytes give
/// in steady flow ([`InverseAllocation`](super::InverseAllocation)) is not what acts when they come. Where commands are late or
/// missing the servos go on under the last one. Before the first one, and after a silence, the flaps are taken to stand where
/// the next command wants them.
#[derive(Clone, Copy, Debug, Default)]
pub struct PropulsionReplay {
    running: Option<Running>,
}

#[derive(Clone, Copy, Debug)]
struct Running {
    plant: PropulsionPlant,
    command: PropulsionCommand,
    stepped_ns: i64,
}

impl PropulsionReplay {
    /// Takes a command that came at this time; the wrench that acts from then on, body axes, torque about the body origin.
    ///
    /// `speeds` are the measured speeds of the impellers in counts; those of the command where there are none. `None` where the
    /// command follows the last one so soon that the servos see it in their next period only.
    pub fn take(&mut self, time_ns: i64, command: PropulsionCommand, speeds: Option<[u8; 2]>) -> Option<Wrench<f64>> {
        let running = self.running.get_or_insert_with(|| Running {
            plant: PropulsionPlant::settled(PropulsionSettings::PHYSICAL, &command),
            command,
            stepped_ns: time_ns.saturating_sub(PERIOD_NS),
        });
        running.command = command;
        (time_ns.saturating_sub(running.stepped_ns) >= PERIOD_NS / 2).then(|| running.step(time_ns, speeds))
    }

    /// The time at which the servos have waited half a period too long for a command and go on under the last one.
    pub fn overdue_ns(&self) -> Option<i64> {
        self.running.as_ref().map(|running| running.stepped_ns.saturating_add(PERIOD_NS + PERIOD_NS / 2))
    }

    /// Goes on under the last command: the wrench that acts from [`overdue_ns`](Self::overdue_ns) on.
    pub fn go_on(&mut self, speeds: Option<[u8; 2]>) -> Option<Wrench<f64>> {
        let running = self.running.as_mut()?;
        Some(running.step(running.stepped_ns.saturating_add(PERIOD_NS), speeds))
    }

    /// Forgets where the flaps stand: nobody knows what they did since.
    pub fn silence(&mut self) {
        self.running = None;
    }
}

impl Running {
    fn step(&mut self, time_ns: i64, speeds: Option<[u8; 2]>) -> Wrench<f64> {
        self.stepped_ns = time_ns;
        let speeds_rad_s = speeds.unwrap_or(self.command.impeller_speeds).map(speed_of_byte_rad_s);
        self.plant.step_at_speeds(&self.command, speeds_rad_s)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::propulsion::ImpellerMode;

    fn command(byte: u8) -> PropulsionCommand {
        PropulsionCommand {
            impeller_speeds: [ImpellerMode::Nominal.speed_byte(); 2],
            nozzles: [byte, 20, 20, 20, 20, 20, 20, 20, 20, 20, 20, 20],
        }
    }

    /// Early, late or lost, commands meet the servos in the periods in which they would have come in time.
    #[test]
    fn jitter_of_commands_does_not_shift_the_servos() {
        let wrench_after = |times_ns: &[i64], bytes: &[u8]| {
            let mut replay = PropulsionReplay::default();
            let mut last = Wrench::zero();
            for (time_ns, byte) in times_ns.iter().zip(bytes) {
                while replay.overdue_ns().is_some_and(|overdue_ns| overdue_ns <= *time_ns) {
                    last = replay.go_on(None).unwrap();
                }
                last = replay.take(*time_ns, command(*byte), None).unwrap_or(last);
            }
            last
        };
        let even: Vec<i64> = (0..7).map(|k| k * PERIOD_NS).collect();
        let expected = wrench_after(&even, &[20, 120, 120, 60, 60, 60, 60]);
        let jittered: Vec<i64> = even.iter().zip([0, 3, -3, 2, 0, -2, 1]).map(|(t, ms)| t + ms * 1_000_000).collect();
        assert_eq!(wrench_after(&jittered, &[20, 120, 120, 60, 60, 60, 60]), expected);
        // The repeats are lost: the servos go on by themselves.
        let some = [even[0], even[1], even[3], even[6]];
        assert_eq!(wrench_after(&some, &[20, 120, 60, 60]), expected);
        assert_ne!(wrench_after(&even, &[20, 120, 60, 60, 60, 60, 60]), expected);
    }

    #[test]
    fn a_command_acts_in_its_third_period() {
        let mut replay = PropulsionReplay::default();
        let before = replay.take(0, command(20), None).unwrap();
        let forces: Vec<f64> = (1..=4)
            .map(|k| (replay.take(k * PERIOD_NS, command(120), None).unwrap().force - before.force).norm())
            .collect();
        assert!(forces[..2].iter().all(|moved| *moved < 1e-4) && forces[2] > 1e-3, "{forces:?}");
    }
}
