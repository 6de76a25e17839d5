//! Scenarios as they are written.

use super::control_table::{BeliefTable, ControlTable};
use super::flight::TRACKER;
use super::fly::FlyTable;
use super::plan_table::PlanTable;
use serde::{Deserialize, Serialize};
use std::path::PathBuf;
use tumble_astrobee::sensing::{LocalizationSettings, SensingPreset};
use tumble_formats::environment_file::EnvironmentTable;

/// The only version of the format.
pub const FORMAT: u32 = 1;
/// Longest flight, s.
pub const LONGEST_S: f64 = 86_400.0;

/// A scenario as it is written.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Scenario {
    /// Version of the format: 1.
    pub format: u32,
    /// Names the output folder: letters, digits, `-` and `_`.
    pub name: String,
    /// One line for people.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub description: Option<String>,
    /// Where: `iss`, `granite`, `mgtf` or `open`.
    pub world: String,
    /// Which obstacles of that place, 0 to 4; none unless given.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub obstacle_set: Option<u8>,
    /// Radius of the sphere that stands for the robot, m.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub robot_radius_m: Option<f64>,
    /// Length of the flight, s.
    pub duration_s: f64,
    /// What all random numbers follow from.
    #[serde(default = "first_seed")]
    pub seed: u64,
    /// Flight mode: impeller speed, limits of the planner.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub flight_mode: Option<String>,
    /// The robot without payload.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub body: Option<BodyTable>,
    /// What controller and allocation take the robot for; the robot without payload unless given.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub belief: Option<BodyTable>,
    /// What the robot takes hold of.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub payload: Option<PayloadTable>,
    /// State at time zero.
    pub start: StartTable,
    /// Where the robot is to be in the end.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub goal: Option<PoseTable>,
    /// What asks for wrenches.
    #[serde(default)]
    pub drive: DriveTable,
    /// What makes them.
    #[serde(default)]
    pub propulsion: PropulsionTable,
    /// What acts beside them.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub environment: Option<EnvironmentTable>,
    /// What measures.
    #[serde(default)]
    pub sensing: SensingTable,
    /// What is reported as an event where it is exceeded.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub limits: Option<LimitsTable>,
    /// What a planner keeps within.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub plan: Option<PlanTable>,
    /// What a mission is.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub fly: Option<FlyTable>,
    /// Obstacles beside those of the set.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub obstacles: Vec<ObstacleTable>,
    /// Keep-out boxes beside those of the place.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub keep_out: Vec<KeepOutTable>,
}

fn first_seed() -> u64 {
    1
}

/// A body: a preset, a file, or its numbers.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct BodyTable {
    /// `iss`, `granite`, `mgtf`, `gazebo`, `space-cobot` or `spheres`.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub preset: Option<String>,
    /// A body file, relative to the scenario's folder.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub file: Option<PathBuf>,
    /// Mass, kg.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub mass_kg: Option<f64>,
    /// Centre of mass from the origin, m.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub com_m: Option<[f64; 3]>,
    /// Inertia tensor about the centre of mass, kg m^2.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub inertia_about_com_kg_m2: Option<[[f64; 3]; 3]>,
}

/// A payload: a file or its numbers, and how and when it is held.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct PayloadTable {
    /// A body file, relative to the scenario's folder.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub file: Option<PathBuf>,
    /// Mass, kg.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub mass_kg: Option<f64>,
    /// Centre of mass in the payload's frame, m.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub com_m: Option<[f64; 3]>,
    /// Inertia tensor about the centre of mass, axes of the payload's frame, kg m^2.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub inertia_about_com_kg_m2: Option<[[f64; 3]; 3]>,
    /// Origin of the payload's frame in the robot's, m.
    pub grasp_position_m: [f64; 3],
    /// Its attitude there, scalar last.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub grasp_quaternion_xyzw: Option<[f64; 4]>,
    /// When it is taken hold of, s; from the start unless given.
    #[serde(default)]
    pub attach_s: f64,
    /// When it is let go, s; never unless given.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub release_s: Option<f64>,
    /// How it moves before: `with-robot` or `at-rest` in the world.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub motion: Option<PayloadMotionName>,
}

/// See [`PayloadMotion`](tumble_astrobee::simulator::PayloadMotion).
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[non_exhaustive]
#[serde(rename_all = "kebab-case")]
pub enum PayloadMotionName {
    /// As if it were part of the robot.
    WithRobot,
    /// At rest in the world.
    AtRest,
}

/// A pose: a named point of the world, or its numbers.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct PoseTable {
    /// A named pose of the world, such as `A`.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub point: Option<String>,
    /// Body origin, world axes, m.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub position_m: Option<[f64; 3]>,
    /// Body to world, scalar last.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub quaternion_xyzw: Option<[f64; 4]>,
}

/// A pose and a twist; at rest unless given.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct StartTable {
    /// A named pose of the world, such as `A`.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub point: Option<String>,
    /// Body origin, world axes, m.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub position_m: Option<[f64; 3]>,
    /// Body to world, scalar last.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub quaternion_xyzw: Option<[f64; 4]>,
    /// Velocity of the body origin, world axes, m/s.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub velocity_m_s: Option<[f64; 3]>,
    /// Angular rate, body axes, rad/s.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub rate_rad_s: Option<[f64; 3]>,
}

/// What asks for wrenches: a controller that follows a reference, and a wrench added to it.
///
/// Without waypoints and excitation the reference is the start pose.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct DriveTable {
    /// A name of [`controllers`](crate::mission::controllers), or `none`; `tracker` unless given.
    #[serde(
        default,
        deserialize_with = "super::control_table::known_controller",
        skip_serializing_if = "Option::is_none"
    )]
    pub controller: Option<String>,
    /// Natural frequency of the tracker's rotation, rad/s.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub tracker_rotation_rad_s: Option<f64>,
    /// Natural frequency of the tracker's position, rad/s.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub tracker_position_rad_s: Option<f64>,
    /// What the last four of them are told.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub control: Option<ControlTable>,
    /// A file of `tumble excite`, relative to the scenario's folder; flown from the start pose.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub excitation: Option<PathBuf>,
    /// A CSV file of wrenches, relative to the scenario's folder.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub wrenches: Option<PathBuf>,
    /// A wrench that never changes.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub constant: Option<WrenchTable>,
    /// A sum of sines.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub multisine: Option<MultisineTable>,
    /// Poses and their times, from rest to rest; the first leg begins at the start.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub waypoints: Vec<WaypointTable>,
    /// What the controller is told of the mass on the way.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub beliefs: Vec<BeliefTable>,
}

impl DriveTable {
    /// Name of what steers.
    pub(crate) fn steering(&self) -> &str {
        self.controller.as_deref().unwrap_or(TRACKER)
    }
}

/// A wrench, body axes, torque about the body origin.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct WrenchTable {
    /// Force, N.
    pub force_n: [f64; 3],
    /// Torque, N m.
    pub torque_n_m: [f64; 3],
}

/// Sines of different frequencies on all axes, phases from the seed.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct MultisineTable {
    /// Sum of the amplitudes of each axis, N.
    pub force_n: [f64; 3],
    /// Sum of the amplitudes about each axis, N m.
    pub torque_n_m: [f64; 3],
    /// Sines per axis, 1 to 50.
    pub tones: usize,
    /// Lowest frequency, Hz.
    pub lowest_hz: f64,
    /// Highest frequency, Hz.
    pub highest_hz: f64,
}

/// A pose and its time.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct WaypointTable {
    /// Time since the start, s.
    pub time_s: f64,
    /// A named pose of the world.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub point: Option<String>,
    /// Body origin, world axes, m.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub position_m: Option<[f64; 3]>,
    /// Body to world, scalar last; that of the waypoint before unless given.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub quaternion_xyzw: Option<[f64; 4]>,
}

/// What makes wrenches.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct PropulsionTable {
    /// `plant`, `limited`, `exact`, or the actuators of a robot: `spheres`, `space-cobot`.
    #[serde(default)]
    pub kind: PropulsionName,
    /// With `limited`: largest force along each body axis, N.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub force_limit_n: Option<[f64; 3]>,
    /// With `limited`: largest torque about each body axis, N m.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub torque_limit_n_m: Option<[f64; 3]>,
    /// With `plant`: factor on every thrust; 1.25 is what NASA's simulation has.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub thrust_factor: Option<f64>,
    /// With `plant`: supply of the impeller motors, V.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub supply_v: Option<f64>,
    /// With `plant`: standard deviation of each nozzle's thrust about what the robot knows, as a share; drawn by the seed.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub thrust_sigma: Option<f64>,
    /// Whether the cabin's air brakes the robot.
    #[serde(default)]
    pub drag: bool,
}

/// See [`Actuators`](tumble_astrobee::simulator::Actuators).
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[non_exhaustive]
#[serde(rename_all = "kebab-case")]
pub enum PropulsionName {
    /// Allocation to bytes, servos, impellers, nozzles.
    #[default]
    Plant,
    /// A box of limits.
    Limited,
    /// Whatever is wanted.
    Exact,
    /// The actuators of a robot, by their name.
    #[serde(untagged)]
    Named(String),
}

/// What measures: a preset, or all settings.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct SensingTable {
    /// `perfect`, `ideal`, `nominal`, `thesis-flight` or `bumble`.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub preset: Option<SensingPreset>,
    /// Instead of a preset; what is left out is as in `nominal`. Gravity is the world's.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub settings: Option<LocalizationSettings>,
}

/// What is reported as an event where it is exceeded; the first two are of vector norms.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct LimitsTable {
    /// Speed of the body origin, m/s.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub speed_m_s: Option<f64>,
    /// Angular rate, rad/s.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub rate_rad_s: Option<f64>,
}

/// An ellipsoid.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ObstacleTable {
    /// Centre, world axes, m.
    pub center_m: [f64; 3],
    /// Semi-axes, m.
    pub semi_axes_m: [f64; 3],
    /// Axes to world, scalar last; along the world's axes unless given.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub quaternion_xyzw: Option<[f64; 4]>,
    /// Velocity of the centre, world axes, m/s; at rest unless given. `center_m` is where it is at time zero.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub velocity_m_s: Option<[f64; 3]>,
    /// When it appears, s; there from the start unless given.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub appear_s: Option<f64>,
    /// When it vanishes, s; never unless given.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub vanish_s: Option<f64>,
    /// When the robot of a mission learns of it, s; when it appears unless given.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub seen_s: Option<f64>,
}

/// A box along the world's axes.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct KeepOutTable {
    /// Least coordinates, m.
    pub lower_m: [f64; 3],
    /// Largest coordinates, m.
    pub upper_m: [f64; 3],
}
