//! Scenarios: one TOML format for everything that flies.
//!
//! `docs/scenarios.md` describes every key.

mod build;
mod control;
mod description;
mod embedded;
mod fly;
mod nozzles;
mod plan;
mod plan_local;
mod plan_local_table;
mod sensed;

pub use build::{Flight, PayloadChange, read_wrenches};
pub use control::{BeliefTable, ControlTable, Steering};
pub use embedded::EMBEDDED;
pub use fly::{
    ArrivalTable, ArrivalTolerance, ComputingSettings, ComputingTable, EstimatorTable, FlyTable, InformationTable,
    LARGEST_OUTSIDE, Margins, MissionProblem, PlannedMotion, WeightingSettings, draw_mission,
};
pub use plan::{PlanBodyTable, PlanTable, PlanningProblem};
pub use plan_local::LocalProblem;
pub use plan_local_table::{
    CriterionName, EffortTable, LocalTable, MeasurementTable, NuisanceTable, PriorTable, TrackingTable, UnknownsName,
    WeightingName,
};

use crate::{TumbleError, robots};
use serde::{Deserialize, Serialize};
use std::fs;
use std::path::{Path, PathBuf};
use tumble_astrobee::sensing::{LocalizationSettings, SensingPreset};
use tumble_formats::FormatsError;
use tumble_formats::body_file::{self, BodyFile};
use tumble_formats::log::shortened;
use tumble_formats::text_file::{self, printable};
use tumble_formats::{ActuatorPreset, Robots, place, toml_text};

/// The only version of the format.
pub const FORMAT: u32 = 1;
/// Longest flight, s.
pub const LONGEST_S: f64 = 86_400.0;
/// Name of computed torque with the believed body, which steers where nothing else is asked for.
pub(crate) const TRACKER: &str = "tracker";
/// Name of the cascade that Astrobee flies.
pub(crate) const FLOWN: &str = "flown";
/// Name of no controller.
const NONE: &str = "none";

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
    #[serde(default, deserialize_with = "control::known_controller", skip_serializing_if = "Option::is_none")]
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

/// A scenario with the text it came from, so that errors can name line and column.
#[derive(Clone, Debug, PartialEq)]
pub struct ScenarioSource {
    /// The file, or the name of an embedded scenario.
    pub path: PathBuf,
    /// The text.
    pub text: String,
    /// What it says.
    pub scenario: Scenario,
    /// The robots whose bodies and actuators it may name: those that come with the program, unless told.
    pub robots: Robots,
}

impl ScenarioSource {
    /// A file of this name, or else an embedded scenario.
    ///
    /// # Errors
    /// [`TumbleError::NoSuchScenario`], [`FormatsError::Unreadable`], [`TumbleError::BadScenario`].
    pub fn find(name: &str) -> Result<Self, TumbleError> {
        let path = Path::new(name);
        let embedded = EMBEDDED.iter().find(|embedded| embedded.name == name);
        // a folder of that name, such as one of results, hides nothing
        if !path.exists() || (path.is_dir() && embedded.is_some()) {
            return match embedded {
                Some(embedded) => Self::parse(path, embedded.text),
                None => Err(TumbleError::NoSuchScenario {
                    name: shortened(name),
                    nearest: place::suggestion(name, EMBEDDED.iter().map(|embedded| embedded.name)),
                }),
            };
        }
        let text = text_file::read(path).map_err(|source| FormatsError::Unreadable { path: path.into(), source })?;
        Self::parse(path, &text)
    }

    /// From text; `path` is for errors and for the files that the scenario names.
    ///
    /// # Errors
    /// [`TumbleError::BadScenario`] with line and column.
    pub fn parse(path: &Path, text: &str) -> Result<Self, TumbleError> {
        let scenario = toml_text::read(text).map_err(|error| {
            let (line, column) = place::of_offset(text, error.offset());
            let message = place::with_suggestion(&error.message());
            TumbleError::BadScenario { path: path.into(), line, column, message }
        })?;
        Ok(Self { path: path.into(), text: text.to_owned(), scenario, robots: robots::shipped() })
    }

    /// The same among these robots, whose bodies and actuators it may name.
    #[must_use]
    pub fn among(self, robots: &Robots) -> Self {
        Self { robots: robots.clone(), ..self }
    }

    /// What makes wrenches, in a few words.
    ///
    /// # Errors
    /// [`TumbleError::BadScenario`] for actuators that no robot has.
    pub fn describe_propulsion(&self) -> Result<&'static str, TumbleError> {
        Ok(match &self.scenario.propulsion.kind {
            PropulsionName::Plant => "nozzles, servos and impellers",
            PropulsionName::Limited => "whatever is wanted within limits",
            PropulsionName::Exact => "whatever is wanted",
            PropulsionName::Named(name) => self.actuators_named(name)?.sentence,
        })
    }

    /// The actuators of a robot.
    fn actuators_named(&self, name: &str) -> Result<ActuatorPreset, TumbleError> {
        self.robots.actuators(name).map_err(|unknown| {
            let names = [&["plant", "limited", "exact"], unknown.known.as_slice()].concat();
            let near = place::suggestion(name, names.iter().copied());
            self.bad("propulsion.kind", &format!("`{}` is none of {}{near}", unknown.asked, names.join(", ")))
        })
    }

    /// The folder that files are relative to.
    pub(crate) fn folder(&self) -> &Path {
        self.path.parent().unwrap_or(Path::new(""))
    }

    /// That a key has an impossible value.
    fn bad(&self, key: &str, message: &str) -> TumbleError {
        let (line, column) = place::of_key(&self.text, key);
        let message = printable(&format!("`{key}`: {message}")).replace('\n', " ");
        TumbleError::BadScenario { path: self.path.clone(), line, column, message }
    }

    /// That a key in the `index`-th table of an array has an impossible value.
    fn bad_in(&self, table: &str, index: usize, key: &str, message: &str) -> TumbleError {
        let (line, column) = place::of_key_in(&self.text, table, index, key);
        let message = printable(&format!("`{table}.{key}`: {message}")).replace('\n', " ");
        TumbleError::BadScenario { path: self.path.clone(), line, column, message }
    }

    /// The files that it names.
    pub fn files(&self) -> Vec<&Path> {
        let Scenario { body, belief, payload, drive, .. } = &self.scenario;
        let bodies = [body, belief].map(|body| body.as_ref().and_then(|body| body.file.as_deref()));
        let payload = payload.as_ref().and_then(|payload| payload.file.as_deref());
        let others = [payload, drive.excitation.as_deref(), drive.wrenches.as_deref()];
        bodies.into_iter().chain(others).flatten().collect()
    }

    /// The same without what drives a simulation, which a mission does not ask for.
    #[must_use]
    pub fn without_drive(&self) -> Self {
        let mut alone = self.clone();
        alone.scenario.drive = DriveTable::default();
        alone
    }

    /// The scenario as TOML that is valid wherever it lies: bodies in place of the files that hold them, the other files by their absolute paths.
    ///
    /// # Errors
    /// [`TumbleError::BadScenario`]; the errors of files that it names.
    pub fn to_toml(&self) -> Result<String, TumbleError> {
        let mut scenario = self.scenario.clone();
        let read = |file: &mut Option<PathBuf>| -> Result<Option<BodyFile>, TumbleError> {
            let path = file.take().map(|file| self.folder().join(file));
            Ok(path.as_deref().map(body_file::read_written).transpose()?)
        };
        for body in [&mut scenario.body, &mut scenario.belief].into_iter().flatten() {
            if let Some(BodyFile { mass_kg, com_m, inertia_about_com_kg_m2 }) = read(&mut body.file)? {
                (body.mass_kg, body.com_m) = (Some(mass_kg), Some(com_m));
                body.inertia_about_com_kg_m2 = Some(inertia_about_com_kg_m2);
            }
        }
        if let Some(body) = &mut scenario.payload
            && let Some(BodyFile { mass_kg, com_m, inertia_about_com_kg_m2 }) = read(&mut body.file)?
        {
            (body.mass_kg, body.com_m) = (Some(mass_kg), Some(com_m));
            body.inertia_about_com_kg_m2 = Some(inertia_about_com_kg_m2);
        }
        for file in [&mut scenario.drive.excitation, &mut scenario.drive.wrenches].into_iter().flatten() {
            let path = self.folder().join(&*file);
            *file = fs::canonicalize(&path).map_err(|source| FormatsError::Unreadable { path, source })?;
        }
        toml::to_string(&scenario).map_err(|error| self.bad("format", &error.to_string()))
    }
}
