//! Payloads of ROS 1 messages for tests, written field by field.

use tumble_astrobee::propulsion::PropulsionCommand;
use tumble_dynamics::nalgebra::{Isometry3, Vector3};
use tumble_lie::Wrench;

/// Bytes one after the other.
#[derive(Default)]
pub struct Payload(pub Vec<u8>);

impl Payload {
    pub fn header(time_ns: i64, frame_id: &str) -> Self {
        let mut payload = Self::default();
        payload.0.extend([0; 4]);
        payload.0.extend(u32::try_from(time_ns / 1_000_000_000).unwrap().to_le_bytes());
        payload.0.extend(u32::try_from(time_ns % 1_000_000_000).unwrap().to_le_bytes());
        payload.text(frame_id)
    }

    pub fn text(mut self, text: &str) -> Self {
        self.0.extend(u32::try_from(text.len()).unwrap().to_le_bytes());
        self.0.extend(text.as_bytes());
        self
    }

    pub fn vector(self, v: &Vector3<f64>) -> Self {
        self.numbers(v.as_slice())
    }

    pub fn numbers(mut self, numbers: &[f64]) -> Self {
        self.0.extend(numbers.iter().flat_map(|x| x.to_le_bytes()));
        self
    }

    pub fn bytes(mut self, bytes: &[u8]) -> Self {
        self.0.extend(bytes);
        self
    }

    pub fn pose(self, pose: &Isometry3<f64>) -> Self {
        self.vector(&pose.translation.vector).numbers(pose.rotation.coords.as_slice())
    }

    pub fn wrench(self, wrench: &Wrench<f64>) -> Self {
        self.vector(&wrench.force).vector(&wrench.torque)
    }
}

/// What a localisation says at one time.
pub struct State {
    pub time_ns: i64,
    pub pose: Isometry3<f64>,
    pub velocity_world: Vector3<f64>,
    pub rate_body: Vector3<f64>,
    pub acceleration_body: Vector3<f64>,
}

pub fn ekf_state(state: &State, confidence: u8) -> Vec<u8> {
    let zero = Vector3::zeros();
    Payload::header(state.time_ns, "world")
        .text("body")
        .pose(&state.pose)
        .vector(&state.velocity_world)
        .vector(&state.rate_body)
        .vector(&zero)
        .vector(&state.acceleration_body)
        .vector(&zero)
        .bytes(&[0; 60])
        .bytes(&[confidence, 0, 0, 20, 20])
        .pose(&Isometry3::identity())
        .bytes(&[0; 201])
        .0
}

pub fn pmc_command(time_ns: i64, command: &PropulsionCommand) -> Vec<u8> {
    let [starboard, port] = command.impeller_speeds;
    Payload::header(time_ns, "body")
        .bytes(&2_u32.to_le_bytes())
        .bytes(&[starboard])
        .bytes(&command.nozzles[..6])
        .bytes(&[port])
        .bytes(&command.nozzles[6..])
        .0
}

pub fn pmc_telemetry(time_ns: i64, speeds: [u8; 2]) -> Vec<u8> {
    let status = |payload: Payload, speed| {
        payload.bytes(&[speed, 9, 9, 1, 1]).bytes(&7_u32.to_le_bytes()).bytes(&[30; 7]).bytes(&[0; 3])
    };
    let payload = Payload::header(time_ns, "").bytes(&2_u32.to_le_bytes());
    status(status(payload, speeds[0]), speeds[1]).0
}

pub fn fam_command(time_ns: i64, wrench_about_center_of_mass: &Wrench<f64>) -> Vec<u8> {
    Payload::header(time_ns, "body")
        .wrench(wrench_about_center_of_mass)
        .numbers(&[0.0; 6])
        .bytes(&[0])
        .numbers(&[0.0; 12])
        .bytes(&[0; 5])
        .0
}

pub fn inertia(time_ns: i64, mass: f64, center_of_mass: &Vector3<f64>) -> Vec<u8> {
    Payload::header(time_ns, "body")
        .numbers(&[mass])
        .vector(center_of_mass)
        .numbers(&[0.15, 0.0, 0.0, 0.15, 0.0, 0.15])
        .0
}

pub fn odometry(state: &State) -> Vec<u8> {
    let velocity_body = state.pose.rotation.inverse() * state.velocity_world;
    Payload::header(state.time_ns, "world")
        .text("body")
        .pose(&state.pose)
        .numbers(&[0.0; 36])
        .vector(&velocity_body)
        .vector(&state.rate_body)
        .numbers(&[0.0; 36])
        .0
}

pub fn wrench_stamped(time_ns: i64, frame_id: &str, wrench: &Wrench<f64>) -> Vec<u8> {
    Payload::header(time_ns, frame_id).wrench(wrench).0
}

/// A time as bags write it: seconds in the lower, nanoseconds in the upper half.
pub fn bag_time(time_ns: i64) -> u64 {
    let (s, ns) = (time_ns / 1_000_000_000, time_ns % 1_000_000_000);
    u64::try_from(s).unwrap() | u64::try_from(ns).unwrap() << 32
}
