//! Options of `tumble excite`.

use crate::space_cobot;
use clap::{Args, ValueEnum};
use std::path::PathBuf;
use tumble_dynamics::nalgebra::Vector3;

/// Options of `tumble excite`.
#[derive(Args)]
#[allow(clippy::struct_excessive_bools)]
pub struct ExciteArgs {
    /// Period of the motion, s.
    #[arg(long, value_name = "S", default_value_t = 10.0)]
    pub(super) period: f64,
    /// Harmonics of each channel: 2 to 30; a start takes some seconds with 12, ten or more with 30.
    #[arg(long, value_name = "N", default_value_t = 3)]
    pub(super) harmonics: usize,
    /// What the motion is to make small.
    #[arg(long, value_enum, default_value_t = CriterionName::D)]
    pub(super) criterion: CriterionName,
    /// Random starts of the search: 1 to 1000.
    #[arg(long, value_name = "N", default_value_t = 3)]
    pub(super) starts: usize,
    /// Seed of the starts, of the random payload and of the noise.
    #[arg(long, value_name = "N", default_value_t = 1)]
    pub(super) seed: u64,
    /// Samples and control steps, 1/s.
    #[arg(long, value_name = "HZ", default_value_t = 100.0)]
    pub(super) rate: f64,
    /// Cycles to fly; two at least, of which the first one settles.
    #[arg(long, value_name = "N", default_value_t = 10)]
    pub(super) cycles: usize,
    /// Largest distance from the start along x, y and z, m (one number, or three); inf for no limit.
    #[arg(long, value_name = "M", default_value = "0.75", value_parser = parse_distances, allow_hyphen_values = true)]
    pub(super) position: Vector3<f64>,
    /// Largest Euler angle (roll, pitch, yaw), rad.
    #[arg(long, value_name = "RAD", default_value_t = 0.8, allow_hyphen_values = true)]
    pub(super) angle: f64,
    /// Largest velocity along each axis, m/s.
    #[arg(long, value_name = "M/S", default_value_t = 0.6, allow_hyphen_values = true)]
    pub(super) speed: f64,
    /// Largest rate of each Euler angle, rad/s.
    #[arg(long, value_name = "RAD/S", default_value_t = 0.8, allow_hyphen_values = true)]
    pub(super) angular_rate: f64,
    /// Largest acceleration along each axis, m/s^2.
    #[arg(long, value_name = "M/S^2", default_value_t = 0.4, allow_hyphen_values = true)]
    pub(super) acceleration: f64,
    /// Largest second derivative of each Euler angle, rad/s^2.
    #[arg(long, value_name = "RAD/S^2", default_value_t = 0.8, allow_hyphen_values = true)]
    pub(super) angular_acceleration: f64,
    /// Move in the plane: x, y and yaw only.
    #[arg(long)]
    pub(super) planar: bool,
    /// The robot without payload (TOML or JSON); Space CoBot unless given.
    #[arg(long, value_name = "FILE")]
    pub(super) body: Option<PathBuf>,
    /// Largest force of the actuators along each body axis, N.
    #[arg(long, value_name = "N", default_value_t = space_cobot::FORCE_LIMIT_N, allow_hyphen_values = true)]
    pub(super) force_limit: f64,
    /// Largest torque of the actuators about each body axis, N m.
    #[arg(long, value_name = "N_M", default_value_t = space_cobot::TORQUE_LIMIT_N_M, allow_hyphen_values = true)]
    pub(super) torque_limit: f64,
    /// Leave force and torque limits out of the design, so that the flight may run into them.
    #[arg(long)]
    pub(super) saturate: bool,
    /// Noise of each axis of the logged position, one sigma per sample, m.
    #[arg(long, value_name = "M", default_value_t = 0.05, allow_hyphen_values = true)]
    pub(super) position_noise: f64,
    /// Noise of each axis of the logged attitude, one sigma per sample, rad.
    #[arg(long, value_name = "RAD", default_value_t = 0.03, allow_hyphen_values = true)]
    pub(super) attitude_noise: f64,
    /// Noise of each axis of the logged force, one sigma per sample, N.
    #[arg(long, value_name = "N", default_value_t = 0.01, allow_hyphen_values = true)]
    pub(super) force_noise: f64,
    /// Noise of each axis of the logged torque, one sigma per sample, N m.
    #[arg(long, value_name = "N_M", default_value_t = 0.001, allow_hyphen_values = true)]
    pub(super) torque_noise: f64,
    /// Simulate the flight with an unknown payload and write its log.
    #[arg(long)]
    pub(super) fly: bool,
    /// With --fly: what the robot carries (TOML or JSON, about the robot's origin); random from the seed unless given.
    #[arg(long, value_name = "FILE", requires = "fly")]
    pub(super) payload: Option<PathBuf>,
    /// Folder to write [default: tumble-out/excite-CRITERION-SEED, numbered where it exists].
    #[arg(long, value_name = "DIR")]
    pub(super) out: Option<PathBuf>,
    /// Replace an earlier result.
    #[arg(long)]
    pub(super) force: bool,
    /// Print one JSON object and nothing else on stdout.
    #[arg(long)]
    pub(super) json: bool,
}

#[derive(Clone, Copy, Debug, ValueEnum)]
pub(super) enum CriterionName {
    /// Condition number of the normalised regressor, less a reward for large motions (thesis V1).
    V1,
    /// Volume of the uncertainty: determinant of the information (thesis V2).
    D,
    /// Mean squared error.
    A,
    /// Largest error.
    E,
    /// Condition number of the information; ignores size (a motion of centimetres may win): prefer v1 or d.
    Condition,
}

impl CriterionName {
    pub(super) fn name(self) -> &'static str {
        match self {
            Self::V1 => "v1",
            Self::D => "d",
            Self::A => "a",
            Self::E => "e",
            Self::Condition => "condition",
        }
    }
}

fn parse_distances(text: &str) -> Result<Vector3<f64>, String> {
    let numbers: Option<Vec<f64>> = text.split(',').map(|part| part.trim().parse().ok()).collect();
    match numbers.as_deref() {
        Some([all]) => Ok(Vector3::repeat(*all)),
        Some([x, y, z]) => Ok(Vector3::new(*x, *y, *z)),
        _ => Err("one number is needed, or three such as 0.5,0.5,0.2".to_owned()),
    }
}
