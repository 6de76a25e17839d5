//! What the robot knows of its own motion: localisation and inertial sensors with noise, filters, latency and jumps.
//!
//! Truth goes in at the inertial unit's rate as [`TrueMotion`]; what the flight software would publish comes out as
//! [`LocalizationEstimate`], each with the time it speaks of and the time it arrives.
//!
//! ```rust
//! use tumble_astrobee::propulsion::ImpellerMode;
//! use tumble_astrobee::sensing::{Localization, SensingPreset, TrueMotion};
//! use tumble_dynamics::{RigidBodyState, nalgebra::Vector3};
//!
//! let settings = SensingPreset::Nominal.settings();
//! let mut localization = Localization::new(&settings, 42, ImpellerMode::Nominal)?;
//! for step in 0..100 {
//!     let truth = TrueMotion {
//!         time_ns: step * 8_000_000,
//!         state: RigidBodyState::at_rest(),
//!         acceleration_origin_body: Vector3::zeros(),
//!         angular_acceleration_body: Vector3::zeros(),
//!     };
//!     localization.observe(&truth);
//!     while let Some(estimate) = localization.arrived(truth.time_ns) {
//!         println!("{} ns: {}", estimate.stamp_ns, estimate.world_from_body);
//!     }
//! }
//! # Ok::<(), tumble_astrobee::AstrobeeError>(())
//! ```

mod description;
mod faults;
mod flight_filter;
mod flown;
mod imu;
mod localization;
mod settings;
mod streams;

pub use flight_filter::{AccelerometerFilter, GyroFilter};
pub use imu::{FilteredImu, ImuBias, ImuChain, ImuModel, ImuSample};
pub use localization::Localization;
pub use settings::{
    FaultSettings, ImuSettings, Interval, Jump, JumpSettings, LocalizationSettings, PoseErrorSettings, SensingPreset,
    SensorErrors, TimingSettings,
};

use tumble_dynamics::RigidBodyState;
use tumble_dynamics::nalgebra::Vector3;
use tumble_lie::Pose;

/// The true motion at one instant, as a simulator knows it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TrueMotion {
    /// Time since the start, ns.
    pub time_ns: i64,
    /// Pose and body twist (of the body origin).
    pub state: RigidBodyState<f64>,
    /// Acceleration of the body origin without gravity, body axes, m/s^2; where it jumps, the mean of both sides.
    pub acceleration_origin_body: Vector3<f64>,
    /// Angular acceleration, body axes, rad/s^2; where it jumps, the mean of both sides.
    pub angular_acceleration_body: Vector3<f64>,
}

/// How much the localisation trusts itself; numbers as in its messages.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Confidence {
    /// 0.
    #[default]
    Good,
    /// 1.
    Poor,
    /// 2.
    Lost,
}

/// What the localisation publishes.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LocalizationEstimate {
    /// The time that the message says it speaks of, ns.
    pub stamp_ns: i64,
    /// The time at which it reaches its readers, ns; not before `stamp_ns`.
    pub arrival_ns: i64,
    /// Pose of the body.
    pub world_from_body: Pose<f64>,
    /// Velocity of the body origin, inertial axes, m/s.
    pub velocity_origin_world: Vector3<f64>,
    /// Angular rate, body axes, rad/s.
    pub rate_body: Vector3<f64>,
    /// Acceleration of the body origin without gravity, body axes, m/s^2.
    pub acceleration_origin_body: Vector3<f64>,
    /// Trust in itself.
    pub confidence: Confidence,
}
