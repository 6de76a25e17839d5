//! The log that a simulated flight writes: what was measured, what was true, what was commanded.

#[cfg(feature = "astrobee")]
mod recorder;

#[cfg(feature = "astrobee")]
pub use recorder::{EstimateColumns, MoreColumns, NOZZLE_COLUMNS, Recorder};

use tumble_dynamics::nalgebra::{Isometry3, UnitQuaternion};
use tumble_formats::excitation_file::NoiseTable;
use tumble_identification::MotionSample;
use tumble_identification::excitation::{Execution, ExecutionSample};
use tumble_identification::noise::Gaussian;
use tumble_lie::{LieGroup, Pose, Wrench};

/// The columns, measured ones first.
const HEADER: &str = "t_s,p_x,p_y,p_z,q_x,q_y,q_z,q_w,f_x,f_y,f_z,tau_x,tau_y,tau_z,\
true_p_x,true_p_y,true_p_z,true_q_x,true_q_y,true_q_z,true_q_w,\
true_v_x,true_v_y,true_v_z,true_w_x,true_w_y,true_w_z,\
true_f_x,true_f_y,true_f_z,true_tau_x,true_tau_y,true_tau_z,\
cmd_f_x,cmd_f_y,cmd_f_z,cmd_tau_x,cmd_tau_y,cmd_tau_z";

/// What a robot with this noise logs of a flight.
pub fn measured(flown: &Execution, sigma: &NoiseTable, noise: &mut Gaussian) -> Vec<MotionSample> {
    let sample = |sample: &ExecutionSample| {
        let truth = &sample.state.world_from_body;
        let position = truth.translation.vector + noise.vector(sigma.position_m);
        let rotation = truth.rotation * <UnitQuaternion<f64> as LieGroup>::exp(&noise.vector(sigma.attitude_rad));
        let wrench = &sample.realized_wrench_body;
        MotionSample {
            time_ns: nanoseconds(sample.time_s),
            world_from_body: Some(Isometry3::from_parts(position.into(), rotation)),
            velocity_origin_world: None,
            rate_body: None,
            acceleration_origin_body: None,
            wrench_body: Some(Wrench::new(
                wrench.torque + noise.vector(sigma.torque_n_m),
                wrench.force + noise.vector(sigma.force_n),
            )),
            ..MotionSample::default()
        }
    };
    flown.samples.iter().map(sample).collect()
}

/// Nearest nanosecond; flights end long before 292 years.
pub fn nanoseconds(time_s: f64) -> i64 {
    #[allow(clippy::cast_possible_truncation)]
    let time_ns = (time_s * 1e9).round() as i64;
    time_ns
}

/// The log as CSV.
pub fn csv(flown: &Execution, measured: &[MotionSample]) -> String {
    let mut text = format!("{HEADER}\n");
    for (flown, measured) in flown.samples.iter().zip(measured) {
        let (truth, twist) = (&flown.state.world_from_body, &flown.state.twist_body);
        text += &time_cell(measured.time_ns);
        push_pose(&mut text, &measured.world_from_body.unwrap_or_default());
        push_wrench(&mut text, &measured.wrench_body.unwrap_or_else(Wrench::zero));
        push_pose(&mut text, truth);
        push_numbers(&mut text, (truth.rotation * twist.linear).iter().chain(&twist.angular));
        push_wrench(&mut text, &flown.realized_wrench_body);
        push_wrench(&mut text, &flown.wanted_wrench_body);
        text.push('\n');
    }
    text
}

/// Decimal seconds, exact to the nanosecond; not negative.
pub fn time_cell(time_ns: i64) -> String {
    format!("{}.{:09}", time_ns / 1_000_000_000, time_ns % 1_000_000_000)
}

/// `,p_x,p_y,p_z,q_x,q_y,q_z,q_w`.
pub fn push_pose(text: &mut String, pose: &Pose<f64>) {
    push_numbers(text, pose.translation.vector.iter().chain(&pose.rotation.coords));
}

/// `,f_x,f_y,f_z,tau_x,tau_y,tau_z`.
pub fn push_wrench(text: &mut String, wrench: &Wrench<f64>) {
    push_numbers(text, wrench.force.iter().chain(&wrench.torque));
}

/// Numbers that read back to the same bits, a comma before each.
pub fn push_numbers<'a>(text: &mut String, numbers: impl IntoIterator<Item = &'a f64>) {
    let mut digits = ryu::Buffer::new();
    for number in numbers {
        text.push(',');
        text.push_str(digits.format(*number));
    }
}
