//! A program of one's own: a satellite with jets among the robots that come with `tumble`, and its log reader, reports, scenarios,
//! missions and campaigns for it. `cargo run --example own_robot -- identify flight.bag`

use std::process::ExitCode;
use tumble_dynamics::nalgebra::Vector3;
use tumble_dynamics::{InertialParameters, StatefulDrive, WrenchBox};
use tumble_formats::recording::RawMessage;
use tumble_formats::{ActuatorBytes, ActuatorPreset, ActuatorReplay, BodyPreset, FormatsError, Robot};
use tumble_identification::recursive::ErringThruster;
use tumble_lie::Wrench;

/// A cube of 12 kg with jets along and about every axis.
pub struct Kite;

impl Robot for Kite {
    fn name(&self) -> &'static str {
        "kite"
    }

    fn sentence(&self) -> &'static str {
        "a satellite of 12 kg with jets along and about every axis"
    }

    fn bodies(&self) -> Vec<BodyPreset> {
        vec![BodyPreset { name: "kite", body: InertialParameters::solid_box(12.0, [0.3, 0.3, 0.32]) }]
    }

    fn actuators(&self) -> Vec<ActuatorPreset> {
        vec![ActuatorPreset {
            name: "kite-jets",
            sentence: "jets along and about every axis",
            make: || {
                let limits = WrenchBox { torque_limit: Vector3::repeat(0.06), force_limit: Vector3::repeat(0.5) };
                Ok(Box::new(StatefulDrive::new(limits, ())))
            },
            thrusters: || Ok(ErringThruster::along_axes(0.01)),
        }]
    }

    fn replay(&self) -> Option<Box<dyn ActuatorReplay>> {
        Some(Box::new(Jets))
    }
}

/// Its recordings hold the openings of the jets, along each axis and about each: a byte each with its sign, 127 the largest.
pub struct Jets;

impl ActuatorReplay for Jets {
    fn command_type(&self) -> &'static str {
        "kite_msgs/Jets"
    }

    fn decode(&self, message: &RawMessage<'_>) -> Result<Option<ActuatorBytes>, FormatsError> {
        match message.payload.len() {
            6 => Ok(ActuatorBytes::new(message.payload)),
            jets => Err(FormatsError::foreign("kite-jets", OtherJets { jets })),
        }
    }

    fn take(
        &mut self,
        _time_ns: i64,
        command: &ActuatorBytes,
        _speeds: Option<[u8; 2]>,
    ) -> Result<Option<Wrench<f64>>, FormatsError> {
        let &[x, y, z, about_x, about_y, about_z] = command.as_slice() else { return Ok(None) };
        let share = |byte: u8| f64::from(i8::from_le_bytes([byte])) / 127.0;
        let force = Vector3::new(share(x), share(y), share(z)) * 0.5;
        Ok(Some(Wrench::new(Vector3::new(share(about_x), share(about_y), share(about_z)) * 0.06, force)))
    }
}

/// Commands of another build of this satellite: what its jets do, nobody here knows.
#[derive(Debug)]
pub struct OtherJets {
    /// How many it has.
    pub jets: usize,
}

impl std::fmt::Display for OtherJets {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "a command of {} jets, six are known", self.jets)
    }
}

impl std::error::Error for OtherJets {}

#[allow(dead_code, reason = "the test of this program takes the robot alone")]
fn main() -> ExitCode {
    tumble::run(std::env::args_os(), &tumble::robots::shipped().with(Kite))
}
