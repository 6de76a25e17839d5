//! Thrusters and rotors as they are commanded: from what is told to them to the wrench, and how far that may be off.

use crate::error::IdentificationError;
use crate::lie::Wrench;
use crate::likelihood::Thrusters;
use crate::motion::MotionSample;
use crate::sensing::{Delay, Sensing};
use nalgebra::Vector3;

/// From a tenth to nine tenths of a first-order rise, in its time constants.
const RISE: f64 = 2.197_224_577_336_219_4;
/// Length of a direction that is none.
const NO_DIRECTION: f64 = 1e-9;
/// Thrust that is later than this, s, or takes as long to rise, belongs to another command.
const LATEST_S: f64 = 10.0;

/// One thruster, valve or rotor.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Actuator {
    /// Where its force acts, body axes, m.
    pub position_m: [f64; 3],
    /// Direction of its force on the body, body axes; any length but zero.
    pub direction: [f64; 3],
    /// Force at a command of one, N.
    pub thrust_n: f64,
    /// One standard deviation of its relative error, of this one alone.
    pub thrust_sigma: f64,
}

/// What all actuators of a robot have in common.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct CommonErrors {
    /// One standard deviation of a relative error that all share: it is exchanged with the mass one for one.
    pub scale_sigma: f64,
    /// One standard deviation, about none, of the share of thrust that is lost for each further actuator open at the same time.
    pub sag_sigma: f64,
    /// From command to thrust, s.
    pub delay_s: f64,
    /// One standard deviation of that, s.
    pub delay_sigma_s: f64,
    /// Time from a tenth to nine tenths of the thrust, s.
    pub rise_s: f64,
    /// Propellant spent per impulse, kg per N s; what is left keeps its shape.
    pub mass_flow_kg_per_n_s: f64,
}

/// The actuators of a robot.
///
/// # Example
/// ```
/// use tumble_identification::MotionSample;
/// use tumble_identification::actuators::{Actuator, Actuators, CommonErrors};
///
/// let nozzle = Actuator {
///     position_m: [0.1, 0.0, 0.0],
///     direction: [0.0, 1.0, 0.0],
///     thrust_n: 0.5,
///     thrust_sigma: 0.01,
/// };
/// let actuators = Actuators { actuators: vec![nozzle], common: CommonErrors::default() };
/// let mut record = [MotionSample::default(), MotionSample { time_ns: 100_000_000, ..MotionSample::default() }];
/// actuators.drive(&mut record, &[1.0, 0.0])?;
/// assert_eq!(record[0].wrench_body.unwrap().torque.z, 0.05);
/// assert_eq!(record[1].wrench_body.unwrap().force.y, 0.0);
/// # Ok::<(), tumble_identification::IdentificationError>(())
/// ```
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Actuators {
    /// Each of them.
    pub actuators: Vec<Actuator>,
    /// What they share.
    pub common: CommonErrors,
}

impl Actuators {
    /// Whether there can be such actuators.
    ///
    /// # Errors
    /// [`IdentificationError::ImpossibleSensing`] naming the first number that cannot be.
    pub fn check(&self) -> Result<(), IdentificationError> {
        let refused = |what: &'static str, value: f64| Err(IdentificationError::ImpossibleSensing { what, value });
        let not_negative = |what: &'static str, value: f64| {
            if value >= 0.0 && value.is_finite() { Ok(()) } else { refused(what, value) }
        };
        let at_most = |what: &'static str, value: f64, most: f64| {
            if value <= most { not_negative(what, value) } else { refused(what, value) }
        };
        if self.actuators.is_empty() {
            return refused("number of thrusters", 0.0);
        }
        for actuator in &self.actuators {
            let all = actuator.position_m.iter().chain(&actuator.direction);
            if let Some(value) = all.copied().find(|x| !x.is_finite()) {
                return refused("position or direction of a thruster", value);
            }
            let length = Vector3::from(actuator.direction).norm();
            if length < NO_DIRECTION {
                return refused("length of the direction of a thruster", length);
            }
            if !(actuator.thrust_n > 0.0 && actuator.thrust_n.is_finite()) {
                return refused("thrust of a thruster, N", actuator.thrust_n);
            }
            not_negative("standard deviation of a thruster's thrust", actuator.thrust_sigma)?;
        }
        let common = &self.common;
        at_most("standard deviation of the common scale", common.scale_sigma, 1.0)?;
        at_most("standard deviation of the sag", common.sag_sigma, 1.0)?;
        at_most("delay of the thrusters, s", common.delay_s, LATEST_S)?;
        at_most("standard deviation of the thrusters' delay, s", common.delay_sigma_s, LATEST_S)?;
        at_most("rise of the thrust, s", common.rise_s, LATEST_S)?;
        not_negative("propellant spent, kg per N s", common.mass_flow_kg_per_n_s)
    }

    /// Sets the wrench of every sample from the commands, `commands[sample * actuators + actuator]`, held from each sample to the next; what
    /// of it may be off.
    ///
    /// # Errors
    /// As [`Actuators::check`], and for a command that is not finite or negative; [`IdentificationError::RecordShape`] where the commands are
    /// not one per sample and actuator; [`IdentificationError::TimesNotIncreasing`].
    pub fn drive(&self, record: &mut [MotionSample], commands: &[f64]) -> Result<Thrusters, IdentificationError> {
        self.check()?;
        let (n, rows) = (self.actuators.len(), record.len());
        if commands.len() != n * rows {
            return Err(IdentificationError::RecordShape {
                rows: commands.len() / n,
                columns: n,
                expected_rows: rows,
                expected_columns: n,
            });
        }
        if let Some(value) = commands.iter().find(|x| !(**x >= 0.0 && x.is_finite())) {
            return Err(IdentificationError::ImpossibleSensing { what: "command of a thruster", value: *value });
        }
        if let Some(index) = record.windows(2).position(|pair| pair[1].time_ns <= pair[0].time_ns) {
            return Err(IdentificationError::TimesNotIncreasing { index: index + 1 });
        }
        let first_ns = record.first().map_or(0, |sample| sample.time_ns);
        let times: Vec<f64> =
            record.iter().map(|sample| sample.time_ns.saturating_sub(first_ns) as f64 * 1e-9).collect();
        let columns: Vec<[f64; 6]> = self
            .actuators
            .iter()
            .map(|actuator| {
                let direction = Vector3::from(actuator.direction).normalize();
                let torque = Vector3::from(actuator.position_m).cross(&direction);
                [torque.x, torque.y, torque.z, direction.x, direction.y, direction.z]
            })
            .collect();
        let mut thrusts = vec![0.0; commands.len()];
        let mut open = vec![0.0; rows];
        for (i, actuator) in self.actuators.iter().enumerate() {
            let command: Vec<f64> = commands.iter().skip(i).step_by(n).copied().collect();
            for (k, duty) in self.common.followed(&times, &command).into_iter().enumerate() {
                thrusts[k * n + i] = actuator.thrust_n * duty;
                open[k] += duty;
            }
        }
        let mut impulse = 0.0;
        let mut spent = Vec::with_capacity(rows);
        for (k, sample) in record.iter_mut().enumerate() {
            let of_sample = &thrusts[k * n..(k + 1) * n];
            let mut wrench = Wrench::zero();
            for (column, thrust) in columns.iter().zip(of_sample) {
                wrench.torque += Vector3::new(column[0], column[1], column[2]) * *thrust;
                wrench.force += Vector3::new(column[3], column[4], column[5]) * *thrust;
            }
            sample.wrench_body = Some(wrench);
            let step_s = times.get(k + 1).map_or(0.0, |next| next - times[k]);
            let per_step = of_sample.iter().sum::<f64>() * step_s;
            spent.push(self.common.mass_flow_kg_per_n_s * (impulse + 0.5 * per_step));
            impulse += per_step;
        }
        let further: Vec<f64> = open.iter().map(|open| (open - 1.0).max(0.0)).collect();
        let sigma: Vec<f64> = self.actuators.iter().map(|actuator| actuator.thrust_sigma).collect();
        Thrusters::try_new(&columns, &sigma, &thrusts)?
            .with_common_scale(self.common.scale_sigma)?
            .with_sag(self.common.sag_sigma, &further)?
            .with_spent(&spent)
    }

    /// The sensors of a robot whose actuators answer late by an unknown time: every stream seems as old.
    #[must_use]
    pub fn aged(&self, mut sensing: Sensing) -> Sensing {
        let streams = [
            Some(&mut sensing.pose_delay),
            sensing.velocity_delay.as_mut(),
            Some(&mut sensing.rate.delay),
            Some(&mut sensing.acceleration.delay),
        ];
        for Delay { sigma_s, .. } in streams.into_iter().flatten() {
            *sigma_s = sigma_s.hypot(self.common.delay_sigma_s);
        }
        sensing
    }
}

impl CommonErrors {
    /// The mean command over each step as it arrives: late by the delay, risen as far as it could. Before the first row its command was held.
    fn followed(&self, times: &[f64], command: &[f64]) -> Vec<f64> {
        let constant_s = self.rise_s / RISE;
        let mut risen = command.first().copied().unwrap_or_default();
        // The row whose command arrives.
        let mut row = 0;
        let mut out = Vec::with_capacity(times.len());
        let mut length_s = 0.0;
        for (k, &start) in times.iter().enumerate() {
            length_s = times.get(k + 1).map_or(length_s, |next| next - start);
            let end = start + length_s;
            let (mut at, mut sum) = (start, 0.0);
            while at < end {
                while times.get(row + 1).is_some_and(|next| next + self.delay_s <= at) {
                    row += 1;
                }
                let next = times.get(row + 1).map_or(end, |next| (next + self.delay_s).min(end));
                let (told, held_s) = (command[row], next - at);
                if constant_s > 0.0 {
                    let share = (-held_s / constant_s).exp();
                    sum += told * held_s + (risen - told) * constant_s * (1.0 - share);
                    risen = told + (risen - told) * share;
                } else {
                    sum += told * held_s;
                }
                at = next;
            }
            out.push(if length_s > 0.0 { sum / length_s } else { command[k] });
        }
        out
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn nozzle(x: f64) -> Actuator {
        Actuator { position_m: [x, 0.0, 0.0], direction: [0.0, 2.0, 0.0], thrust_n: 0.5, thrust_sigma: 0.01 }
    }

    #[test]
    fn commands_arrive_late_and_rise() {
        let times: Vec<f64> = (0..40).map(|k| 0.1 * f64::from(k)).collect();
        let command: Vec<f64> = (0..40).map(|k| if (10..20).contains(&k) { 1.0 } else { 0.0 }).collect();
        let plain = CommonErrors { delay_s: 0.25, ..CommonErrors::default() }.followed(&times, &command);
        for (row, expected) in [(11, 0.0), (12, 0.5), (13, 1.0), (21, 1.0), (22, 0.5), (23, 0.0)] {
            assert!((plain[row] - expected).abs() < 1e-9, "{row}: {}", plain[row]);
        }
        // A rise moves impulse and loses none.
        let slow = CommonErrors { rise_s: 0.4, ..CommonErrors::default() }.followed(&times, &command);
        assert!((slow.iter().sum::<f64>() - 10.0).abs() < 1e-3);
        let constant = 0.4 / RISE;
        let first = 1.0 - constant / 0.1 * (1.0 - (-0.1 / constant).exp());
        assert!((slow[10] - first).abs() < 1e-12 && slow[21] > 0.0);
    }

    #[test]
    fn what_cannot_be_is_refused() {
        let good = Actuators { actuators: vec![nozzle(0.1)], common: CommonErrors::default() };
        assert_eq!(good.check(), Ok(()));
        let with = |change: &dyn Fn(&mut Actuators)| {
            let mut bad = good.clone();
            change(&mut bad);
            bad.check().unwrap_err().to_string()
        };
        assert!(with(&|a| a.actuators.clear()).contains("number"));
        assert!(with(&|a| a.actuators[0].direction = [0.0; 3]).contains("direction"));
        assert!(with(&|a| a.actuators[0].thrust_n = -1.0).contains("thrust"));
        assert!(with(&|a| a.actuators[0].thrust_sigma = f64::NAN).contains("deviation"));
        assert!(with(&|a| a.common.rise_s = -0.1).contains("rise"));
        assert!(with(&|a| a.common.delay_s = 100.0).contains("delay"));
        assert!(with(&|a| a.common.sag_sigma = 9.0).contains("sag"));
        let mut record = [MotionSample::default(), MotionSample { time_ns: 1, ..MotionSample::default() }];
        assert!(matches!(good.drive(&mut record, &[1.0]), Err(IdentificationError::RecordShape { .. })));
        assert!(good.drive(&mut record, &[1.0, -1.0]).is_err());
        record[1].time_ns = 0;
        assert!(matches!(
            good.drive(&mut record, &[1.0; 2]),
            Err(IdentificationError::TimesNotIncreasing { index: 1 })
        ));
    }
}
