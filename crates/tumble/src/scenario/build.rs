//! From a scenario to a robot that flies.

use super::{
    BodyTable, FORMAT, Flight, LONGEST_S, NONE, PayloadChange, PayloadMotionName, PayloadTable, PropulsionName,
    ScenarioSource, Steering,
};
use crate::TumbleError;
use crate::flight_log;
use std::fs::File;
use std::io::{self, Read};
use std::path::{Path, PathBuf};
use tumble_astrobee::AstrobeeError;
use tumble_astrobee::air_drag::air_drag;
use tumble_astrobee::flight_modes::FlightMode;
use tumble_astrobee::propulsion::{ImpellerMode, PropulsionSettings};
use tumble_astrobee::sensing::{Localization, LocalizationSettings, SensingPreset};
use tumble_astrobee::simulator::{
    Actuators, AddedWrench, AstrobeeSimulator, CONTROL_PERIOD_NS, CONTROL_PERIOD_S, ControlAccount, Drive, Event,
    Grasp, Multisine, ObstacleMotion, PayloadMotion, Reference, SimulatorError, SimulatorSettings, Surroundings,
    Waypoint,
};
use tumble_astrobee::worlds::{OBSTACLE_SETS, ROBOT_RADIUS_M, WorldPreset};
use tumble_dynamics::nalgebra::{UnitQuaternion, Vector3};
use tumble_dynamics::{
    AlignedBox, Environment, InertialParameters, ObstacleEllipsoid, RigidBodyState, World, WrenchBox,
};
use tumble_formats::FormatsError;
use tumble_formats::body_file::{self, BodyFile};
use tumble_formats::environment_file::{EnvironmentTable, ImpossibleNumber};
use tumble_formats::excitation_file::ExcitationFile;
use tumble_formats::log::{BoundedRows, QUATERNION_NORM_TOLERANCE, Row, read_row, seconds, shortened};
use tumble_identification::noise::Gaussian;
use tumble_identification::sensing::Sensing;
use tumble_lie::{Pose, Twist, Wrench};

/// Most sines per axis.
const MOST_TONES: usize = 50;
/// Most obstacles besides those of the place, each looked at in every period.
const MOST_OBSTACLES: usize = 1000;
/// Most rows of a file of wrenches: a day of control periods.
const MOST_WRENCHES: usize = 5_400_000;
/// What the seeds of the phases and of the nozzles differ by from that of the sensors.
const PHASES: u64 = 0x5068_6173_6573;
const NOZZLES: u64 = 0x4e6f_7a7a_6c65;
/// Beyond this a nozzle could pull.
const LARGEST_THRUST_SIGMA: f64 = 0.1;

/// A pose in any of the tables that hold one.
struct WrittenPose<'a> {
    key: &'a str,
    point: Option<&'a str>,
    position_m: Option<[f64; 3]>,
    quaternion_xyzw: Option<[f64; 4]>,
    /// Attitude where none is written.
    otherwise: UnitQuaternion<f64>,
}

/// A body in any of the tables that hold one.
struct WrittenBody<'a> {
    key: &'a str,
    preset: Option<&'a str>,
    file: Option<&'a Path>,
    mass_kg: Option<f64>,
    com_m: Option<[f64; 3]>,
    inertia: Option<[[f64; 3]; 3]>,
}

impl<'a> WrittenBody<'a> {
    fn of(key: &'a str, table: &'a BodyTable) -> Self {
        Self {
            key,
            preset: table.preset.as_deref(),
            file: table.file.as_deref(),
            mass_kg: table.mass_kg,
            com_m: table.com_m,
            inertia: table.inertia_about_com_kg_m2,
        }
    }
}

impl ScenarioSource {
    /// The robot at the start of this scenario, everything checked.
    ///
    /// # Errors
    /// [`TumbleError::BadScenario`] with the key and its place; the errors of files that it names.
    pub fn flight(&self) -> Result<Flight, TumbleError> {
        let scenario = &self.scenario;
        let place = self.place()?;
        self.check_duration()?;
        let periods = libm::round(scenario.duration_s / CONTROL_PERIOD_S);
        #[allow(clippy::cast_possible_truncation)] // tested above
        let duration_ns = periods as i64 * CONTROL_PERIOD_NS;
        let mode = self.flight_mode()?;
        let radius_m = self.robot_radius_m()?;
        let (body, belief) = self.bodies(place)?;
        let (world, obstacle_motions) = self.world(place)?;
        let start = self.start(place)?;
        self.check_start(place, &world, &obstacle_motions, &start, radius_m)?;
        let goal = self.goal(place, &start)?;
        // Nobody plans here, but what is written must make sense.
        self.plan_limits(place, &start)?;
        self.fly_numbers(place)?;
        self.seen_from_s(place)?;
        let impellers = mode.impellers();
        let settings = SimulatorSettings {
            body,
            start,
            planar: place.is_planar(),
            world: world.clone(),
            obstacle_motions,
            table_half_width_m: place.table_half_width_m(),
            robot_radius_m: radius_m,
            speed_limit_m_s: self.limit("limits.speed_m_s", scenario.limits.and_then(|limits| limits.speed_m_s))?,
            rate_limit_rad_s: self.limit("limits.rate_rad_s", scenario.limits.and_then(|limits| limits.rate_rad_s))?,
            drag: scenario.propulsion.drag.then(air_drag),
            environment: self.environment()?,
            actuators: self.actuators(impellers, &belief)?,
            sensors: Some(self.sensors(place, impellers)?),
        };
        let simulator = AstrobeeSimulator::try_new(settings).map_err(|error| {
            let is_of_body = matches!(error, SimulatorError::Dynamics(_)) && scenario.body.is_some();
            self.bad(if is_of_body { "body" } else { "start" }, &error.to_string())
        })?;
        let (drive, steering) = self.drive(place, &start, &belief, duration_ns)?;
        Ok(Flight {
            drive,
            steering,
            simulator,
            goal,
            place,
            world,
            duration_ns,
            payload_changes: self.payload_changes(duration_ns)?,
            estimate: None,
        })
    }

    /// What acts beside actuators and the cabin's air.
    pub(super) fn environment(&self) -> Result<Environment, TumbleError> {
        let models = self.scenario.environment.as_ref().map(EnvironmentTable::environment);
        let bad = |error: ImpossibleNumber| self.bad(&format!("environment.{}", error.key), &error.message);
        Ok(models.transpose().map_err(bad)?.unwrap_or_default())
    }

    /// At least a control period, at most a day.
    pub(super) fn check_duration(&self) -> Result<(), TumbleError> {
        let duration_s = self.scenario.duration_s;
        if (CONTROL_PERIOD_S..=LONGEST_S).contains(&duration_s) {
            return Ok(());
        }
        let message = format!("{duration_s}: at least {CONTROL_PERIOD_S} s and at most {LONGEST_S} s");
        Err(self.bad("duration_s", &message))
    }

    /// Where it flies; version and name of the scenario are checked as well.
    pub(super) fn place(&self) -> Result<WorldPreset, TumbleError> {
        let scenario = &self.scenario;
        if scenario.format != FORMAT {
            return Err(
                self.bad("format", &format!("{} is not a version this program reads; {FORMAT} is", scenario.format))
            );
        }
        let allowed = |c: char| c.is_ascii_alphanumeric() || c == '-' || c == '_';
        if scenario.name.is_empty() || scenario.name.len() > 64 || !scenario.name.chars().all(allowed) {
            return Err(self.bad("name", "1 to 64 letters, digits, `-` and `_`: it names a folder"));
        }
        self.named("world", &scenario.world, WorldPreset::from_name, &WorldPreset::ALL.map(WorldPreset::name))
    }

    pub(super) fn robot_radius_m(&self) -> Result<f64, TumbleError> {
        self.positive("robot_radius_m", self.scenario.robot_radius_m, ROBOT_RADIUS_M)
    }

    /// What the robot is, and what it is taken for.
    pub(super) fn bodies(
        &self,
        place: WorldPreset,
    ) -> Result<(InertialParameters<f64>, InertialParameters<f64>), TumbleError> {
        let body = match &self.scenario.body {
            Some(table) => self.body(&WrittenBody::of("body", table))?,
            None => place.body(),
        };
        let belief = match &self.scenario.belief {
            Some(table) => self.body(&WrittenBody::of("belief", table))?,
            None => body,
        };
        Ok((body, belief))
    }

    pub(super) fn goal(
        &self,
        place: WorldPreset,
        start: &RigidBodyState<f64>,
    ) -> Result<Option<Pose<f64>>, TumbleError> {
        let Some(table) = &self.scenario.goal else { return Ok(None) };
        let written = WrittenPose {
            key: "goal",
            point: table.point.as_deref(),
            position_m: table.position_m,
            quaternion_xyzw: table.quaternion_xyzw,
            otherwise: start.world_from_body.rotation,
        };
        self.pose(place, &written).map(Some)
    }

    /// One of a few names.
    fn named<T>(
        &self,
        key: &str,
        name: &str,
        find: impl Fn(&str) -> Option<T>,
        names: &[&str],
    ) -> Result<T, TumbleError> {
        find(name).ok_or_else(|| {
            let near = tumble_formats::place::suggestion(name, names.iter().copied());
            self.bad(key, &format!("`{}` is none of {}{near}", shortened(name), names.join(", ")))
        })
    }

    pub(super) fn flight_mode(&self) -> Result<FlightMode, TumbleError> {
        let Some(name) = &self.scenario.flight_mode else { return Ok(FlightMode::default()) };
        let find = |name: &str| FlightMode::ALL.into_iter().find(|mode| mode.name() == name);
        self.named("flight_mode", name, find, &FlightMode::ALL.map(FlightMode::name))
    }

    pub(super) fn positive(&self, key: &str, value: Option<f64>, otherwise: f64) -> Result<f64, TumbleError> {
        let value = value.unwrap_or(otherwise);
        if value > 0.0 && value.is_finite() {
            Ok(value)
        } else {
            Err(self.bad(key, &format!("{value}: positive and finite")))
        }
    }

    /// A limit; without one nothing is too much.
    fn limit(&self, key: &str, value: Option<f64>) -> Result<f64, TumbleError> {
        match value {
            Some(_) => self.positive(key, value, 0.0),
            None => Ok(f64::INFINITY),
        }
    }

    pub(super) fn finite(&self, key: &str, values: [f64; 3]) -> Result<Vector3<f64>, TumbleError> {
        if values.iter().all(|value| value.is_finite()) {
            Ok(Vector3::from(values))
        } else {
            Err(self.bad(key, "every number must be finite"))
        }
    }

    pub(super) fn rotation(&self, key: &str, [x, y, z, w]: [f64; 4]) -> Result<UnitQuaternion<f64>, TumbleError> {
        tumble_lie::from_xyzw(x, y, z, w, QUATERNION_NORM_TOLERANCE).map_err(|_| {
            let norm = [x, y, z, w].iter().map(|c| c * c).sum::<f64>();
            self.bad(key, &format!("norm {:.6}; x, y, z, w of norm 1 are needed", libm::sqrt(norm)))
        })
    }

    fn pose(&self, place: WorldPreset, written: &WrittenPose) -> Result<Pose<f64>, TumbleError> {
        let key = |name: &str| format!("{}.{name}", written.key);
        match (written.point, written.position_m) {
            (Some(_), Some(_)) => Err(self.bad(&key("position_m"), "a named `point` has its position")),
            (None, None) => Err(self.bad(written.key, "`point` or `position_m` is needed")),
            (Some(name), None) => {
                let mut pose = place.pose(name).ok_or_else(|| {
                    let names: Vec<&str> = place.poses().iter().map(|pose| pose.name).collect();
                    let near = tumble_formats::place::suggestion(name, names.iter().copied());
                    self.bad(&key("point"), &format!("`{}` is none of: {}{near}", shortened(name), names.join(", ")))
                })?;
                if let Some(quaternion) = written.quaternion_xyzw {
                    pose.rotation = self.rotation(&key("quaternion_xyzw"), quaternion)?;
                }
                Ok(pose)
            }
            (None, Some(position)) => {
                let rotation = match written.quaternion_xyzw {
                    Some(quaternion) => self.rotation(&key("quaternion_xyzw"), quaternion)?,
                    None => written.otherwise,
                };
                Ok(Pose::from_parts(self.finite(&key("position_m"), position)?.into(), rotation))
            }
        }
    }

    fn body(&self, written: &WrittenBody) -> Result<InertialParameters<f64>, TumbleError> {
        let inline = (written.mass_kg, written.com_m, written.inertia);
        match (written.preset, written.file, inline) {
            (Some(name), None, (None, None, None)) => self
                .robots
                .body(name)
                .map_err(|unknown| self.bad(&format!("{}.preset", written.key), &unknown.none_of())),
            (None, Some(file), (None, None, None)) => Ok(body_file::read(&self.folder().join(file))?),
            (None, None, (Some(mass_kg), com_m, Some(inertia_about_com_kg_m2))) => {
                let com_m = com_m.unwrap_or_default();
                self.finite(&format!("{}.com_m", written.key), com_m)?;
                BodyFile { mass_kg, com_m, inertia_about_com_kg_m2 }
                    .to_parameters(&self.path)
                    .map_err(|error| self.bad(&format!("{}.mass_kg", written.key), &error.to_string()))
            }
            _ => Err(self.bad(
                written.key,
                "a body is one of: `preset`; `file`; `mass_kg` and `inertia_about_com_kg_m2` (and `com_m`)",
            )),
        }
    }

    /// Volumes and obstacles as they are at time zero, and those of the obstacles that move, appear or vanish.
    pub(super) fn world(&self, place: WorldPreset) -> Result<(World, Vec<ObstacleMotion>), TumbleError> {
        let mut motions = Vec::new();
        let mut world = place.volumes();
        if let Some(set) = self.scenario.obstacle_set {
            if !matches!(place, WorldPreset::Iss | WorldPreset::Granite) {
                let message = format!("{set}: the world `{}` has no sets, `iss` and `granite` have", place.name());
                return Err(self.bad("obstacle_set", &message));
            }
            world.obstacles = place.obstacles(set).ok_or_else(|| {
                self.bad("obstacle_set", &format!("{set}: there are sets 0 to {}", OBSTACLE_SETS - 1))
            })?;
        }
        let count = self.scenario.obstacles.len();
        if count > MOST_OBSTACLES {
            return Err(self.bad("obstacles", &format!("{count}: at most {MOST_OBSTACLES}")));
        }
        for table in &self.scenario.obstacles {
            let semi_axes = self.finite("obstacles.semi_axes_m", table.semi_axes_m)?;
            if semi_axes.min() <= 0.0 {
                return Err(self.bad("obstacles.semi_axes_m", "every semi-axis must be positive"));
            }
            let rotation = match table.quaternion_xyzw {
                Some(quaternion) => self.rotation("obstacles.quaternion_xyzw", quaternion)?,
                None => UnitQuaternion::identity(),
            };
            let center = self.finite("obstacles.center_m", table.center_m)?;
            let velocity = self.finite("obstacles.velocity_m_s", table.velocity_m_s.unwrap_or_default())?;
            let (appear_s, vanish_s) = (table.appear_s.unwrap_or(0.0), table.vanish_s.unwrap_or(f64::INFINITY));
            if !(appear_s >= 0.0 && appear_s.is_finite()) {
                return Err(self.bad("obstacles.appear_s", &format!("{appear_s}: 0 or later")));
            }
            if vanish_s.is_nan() || vanish_s <= appear_s {
                return Err(self.bad("obstacles.vanish_s", &format!("{vanish_s}: after `appear_s`, {appear_s} s")));
            }
            if velocity != Vector3::zeros() || appear_s > 0.0 || vanish_s < f64::INFINITY {
                motions.push(ObstacleMotion {
                    obstacle: world.obstacles.len(),
                    center_world: center,
                    velocity_world: velocity,
                    appear_s,
                    vanish_s,
                });
            }
            world
                .obstacles
                .push(ObstacleEllipsoid { world_from_ellipsoid: Pose::from_parts(center.into(), rotation), semi_axes });
        }
        let count = self.scenario.keep_out.len();
        if count > MOST_OBSTACLES {
            return Err(self.bad("keep_out", &format!("{count}: at most {MOST_OBSTACLES}")));
        }
        for table in &self.scenario.keep_out {
            let lower = self.finite("keep_out.lower_m", table.lower_m)?;
            let upper = self.finite("keep_out.upper_m", table.upper_m)?;
            if (upper - lower).min() <= 0.0 {
                return Err(self.bad("keep_out.upper_m", "every coordinate must be larger than that of `lower_m`"));
            }
            world.keep_out.push(AlignedBox { lower_world: lower, upper_world: upper });
        }
        Ok((world, motions))
    }

    /// The state at time zero, wherever it is.
    pub(super) fn start(&self, place: WorldPreset) -> Result<RigidBodyState<f64>, TumbleError> {
        let table = &self.scenario.start;
        let written = WrittenPose {
            key: "start",
            point: table.point.as_deref(),
            position_m: table.position_m,
            quaternion_xyzw: table.quaternion_xyzw,
            otherwise: UnitQuaternion::identity(),
        };
        let world_from_body = self.pose(place, &written)?;
        let velocity_world = self.finite("start.velocity_m_s", table.velocity_m_s.unwrap_or_default())?;
        let rate_body = self.finite("start.rate_rad_s", table.rate_rad_s.unwrap_or_default())?;
        let twist_body = Twist::new(rate_body, world_from_body.rotation.inverse() * velocity_world);
        Ok(RigidBodyState { world_from_body, twist_body })
    }

    /// That nothing is in the way where the robot starts.
    fn check_start(
        &self,
        place: WorldPreset,
        world: &World,
        motions: &[ObstacleMotion],
        start: &RigidBodyState<f64>,
        radius_m: f64,
    ) -> Result<(), TumbleError> {
        let position = start.world_from_body.translation.vector;
        let is_there = |index| motions.iter().all(|motion| motion.obstacle != index || motion.is_there(0.0));
        let around = Surroundings::among(world, is_there, place.table_half_width_m(), &position, radius_m);
        if let Some(event) = Surroundings::events_of(&around).next() {
            let what = match event {
                Event::HitObstacle { index } => format!("inside obstacle {index}"),
                Event::EnteredKeepOut { index } => format!("inside keep-out box {index}"),
                Event::LeftTable => "beyond the edge of the table".to_owned(),
                _ => "outside the keep-in volume".to_owned(),
            };
            return Err(self.bad("start", &format!("the robot starts {what}")));
        }
        Ok(())
    }

    fn actuators(&self, mode: ImpellerMode, belief: &InertialParameters<f64>) -> Result<Actuators, TumbleError> {
        let table = &self.scenario.propulsion;
        let foreign =
            |key: &str, kind: &str| self.bad(&format!("propulsion.{key}"), &format!("only with `kind = \"{kind}\"`"));
        if table.kind != PropulsionName::Limited {
            if table.force_limit_n.is_some() {
                return Err(foreign("force_limit_n", "limited"));
            }
            if table.torque_limit_n_m.is_some() {
                return Err(foreign("torque_limit_n_m", "limited"));
            }
        }
        if table.kind != PropulsionName::Plant {
            if table.thrust_factor.is_some() {
                return Err(foreign("thrust_factor", "plant"));
            }
            if table.supply_v.is_some() {
                return Err(foreign("supply_v", "plant"));
            }
            if table.thrust_sigma.is_some() {
                return Err(foreign("thrust_sigma", "plant"));
            }
        }
        let limit = |key: &str, limit: Option<[f64; 3]>| {
            let limit = limit.ok_or_else(|| self.bad("propulsion", &format!("`{key}` is needed with `limited`")))?;
            // Infinite is no limit.
            if limit.iter().all(|component| *component >= 0.0) {
                Ok(Vector3::from(limit))
            } else {
                Err(self.bad(&format!("propulsion.{key}"), "a limit is not negative"))
            }
        };
        Ok(match &table.kind {
            PropulsionName::Exact => Actuators::Exact,
            PropulsionName::Named(name) => Actuators::Other((self.actuators_named(name)?.make)()?),
            PropulsionName::Limited => Actuators::Limited(WrenchBox {
                torque_limit: limit("torque_limit_n_m", table.torque_limit_n_m)?,
                force_limit: limit("force_limit_n", table.force_limit_n)?,
            }),
            PropulsionName::Plant => {
                let physical = PropulsionSettings::PHYSICAL;
                let thrust_sigma = table.thrust_sigma.unwrap_or(0.0);
                if !(0.0..=LARGEST_THRUST_SIGMA).contains(&thrust_sigma) {
                    return Err(self.bad("propulsion.thrust_sigma", "it lies between 0 and 0.1"));
                }
                let mut variation = Gaussian::from_seed(self.scenario.seed ^ NOZZLES);
                let settings = PropulsionSettings {
                    nozzle_factors: physical.nozzle_factors.map(|factor| factor + thrust_sigma * variation.normal()),
                    thrust_factor: self.positive(
                        "propulsion.thrust_factor",
                        table.thrust_factor,
                        physical.thrust_factor,
                    )?,
                    supply_v: self.positive("propulsion.supply_v", table.supply_v, physical.supply_v)?,
                    ..physical
                };
                Actuators::hardware(mode, belief.center_of_mass(), settings)
            }
        })
    }

    fn sensors(&self, place: WorldPreset, mode: ImpellerMode) -> Result<Localization, TumbleError> {
        let settings = self.sensing_settings(place)?;
        Localization::new(&settings, self.scenario.seed, mode).map_err(|error| self.bad_sensing(error))
    }

    fn sensing_settings(&self, place: WorldPreset) -> Result<LocalizationSettings, TumbleError> {
        let table = &self.scenario.sensing;
        let mut settings = match (&table.preset, &table.settings) {
            (Some(_), Some(_)) => return Err(self.bad("sensing.settings", "a preset has its settings: one of both")),
            (preset, None) => preset.unwrap_or(SensingPreset::Nominal).settings(),
            (None, Some(settings)) => settings.clone(),
        };
        settings.gravity_world_m_s2 = place.gravity_m_s2();
        Ok(settings)
    }

    fn bad_sensing(&self, error: AstrobeeError) -> TumbleError {
        match error {
            AstrobeeError::SensingOutOfRange { key, .. } => {
                self.bad(&format!("sensing.settings.{key}"), &error.to_string())
            }
            other => other.into(),
        }
    }

    /// The sensors as the robot itself is told of them.
    pub(super) fn stated_sensing(&self, place: WorldPreset) -> Result<Sensing, TumbleError> {
        let settings = self.sensing_settings(place)?;
        settings.check().map_err(|error| self.bad_sensing(error))?;
        let mode = self.flight_mode()?.impellers();
        Ok(settings.as_stated(mode).map_err(tumble_planning::PlanningError::from)?)
    }

    /// The payload and how it is held.
    pub(super) fn grasp(&self) -> Result<Option<Grasp>, TumbleError> {
        let Some(table) = &self.scenario.payload else { return Ok(None) };
        let written = WrittenBody {
            key: "payload",
            preset: None,
            file: table.file.as_deref(),
            mass_kg: table.mass_kg,
            com_m: table.com_m,
            inertia: table.inertia_about_com_kg_m2,
        };
        let rotation = match table.grasp_quaternion_xyzw {
            Some(quaternion) => self.rotation("payload.grasp_quaternion_xyzw", quaternion)?,
            None => UnitQuaternion::identity(),
        };
        let position = self.finite("payload.grasp_position_m", table.grasp_position_m)?;
        let robot_from_payload = Pose::from_parts(position.into(), rotation);
        Ok(Some(Grasp { payload: self.body(&written)?, robot_from_payload }))
    }

    /// The payload, where it has a mass and so can be drawn.
    pub(crate) fn drawn_grasp(&self) -> Result<Option<Grasp>, TumbleError> {
        Ok(self.grasp()?.filter(|grasp| grasp.payload.mass > 0.0))
    }

    fn payload_changes(&self, duration_ns: i64) -> Result<Vec<(i64, PayloadChange)>, TumbleError> {
        let (Some(table), Some(grasp)) = (&self.scenario.payload, self.grasp()?) else { return Ok(Vec::new()) };
        let PayloadTable { attach_s, release_s, .. } = *table;
        let end_s = duration_ns as f64 / 1e9;
        if !(0.0..end_s).contains(&attach_s) {
            return Err(self.bad("payload.attach_s", &format!("{attach_s}: 0 or later, before the end at {end_s} s")));
        }
        let motion = match table.motion {
            None | Some(PayloadMotionName::WithRobot) => PayloadMotion::WithRobot,
            Some(PayloadMotionName::AtRest) => PayloadMotion::AtRest,
        };
        let mut changes = vec![(flight_log::nanoseconds(attach_s), PayloadChange::Attach(grasp, motion))];
        if let Some(release_s) = release_s {
            if !(release_s > attach_s && release_s < end_s) {
                let message = format!("{release_s}: after `attach_s`, before the end at {end_s} s");
                return Err(self.bad("payload.release_s", &message));
            }
            changes.push((flight_log::nanoseconds(release_s), PayloadChange::Release));
        }
        Ok(changes)
    }

    fn drive(
        &self,
        place: WorldPreset,
        start: &RigidBodyState<f64>,
        belief: &InertialParameters<f64>,
        duration_ns: i64,
    ) -> Result<(Drive, Steering), TumbleError> {
        let table = &self.scenario.drive;
        let is_driven = table.steering() != NONE;
        if !is_driven && (table.excitation.is_some() || !table.waypoints.is_empty()) {
            return Err(self.bad("drive.controller", "waypoints and an excitation need a controller that follows them"));
        }
        let reference = self.reference(place, start)?;
        let (follower, steering) = self.controller(place, belief, &reference)?;
        let drive = Drive {
            tracking: follower.map(|follower| (follower, reference)),
            added: self.added(duration_ns)?,
            beliefs: self.beliefs(&steering, belief)?,
            account: match steering.decision_s {
                Some(decision_s) => ControlAccount::with_decisions(flight_log::nanoseconds(decision_s)),
                None => ControlAccount::default(),
            },
        };
        Ok((drive, steering))
    }

    fn reference(&self, place: WorldPreset, start: &RigidBodyState<f64>) -> Result<Reference, TumbleError> {
        let table = &self.scenario.drive;
        let from = start.world_from_body;
        if let Some(file) = &table.excitation {
            if !table.waypoints.is_empty() {
                return Err(self.bad("drive.excitation", "either an excitation or waypoints"));
            }
            let path: PathBuf = self.folder().join(file);
            let motion = Box::new(ExcitationFile::read(&path)?.motion(&path)?);
            return Ok(Reference::Periodic { motion, world_from_start: from });
        }
        if table.waypoints.is_empty() {
            return Ok(Reference::Hold(from));
        }
        let mut path = vec![Waypoint { time_s: 0.0, world_from_body: from }];
        let mut last = Waypoint { time_s: 0.0, world_from_body: from };
        for (index, waypoint) in table.waypoints.iter().enumerate() {
            if !(waypoint.time_s > last.time_s && waypoint.time_s <= LONGEST_S) {
                let message = "times begin after 0 and increase";
                return Err(self.bad_in("drive.waypoints", index, "time_s", message));
            }
            let world_from_body = self.pose(
                place,
                &WrittenPose {
                    key: "drive.waypoints",
                    point: waypoint.point.as_deref(),
                    position_m: waypoint.position_m,
                    quaternion_xyzw: waypoint.quaternion_xyzw,
                    otherwise: last.world_from_body.rotation,
                },
            )?;
            last = Waypoint { time_s: waypoint.time_s, world_from_body };
            path.push(last);
        }
        Ok(Reference::Path(path))
    }

    fn added(&self, duration_ns: i64) -> Result<AddedWrench, TumbleError> {
        let table = &self.scenario.drive;
        let wrench = |key: &str, force_n: [f64; 3], torque_n_m: [f64; 3]| {
            Ok::<_, TumbleError>(Wrench::new(
                self.finite(&format!("{key}.torque_n_m"), torque_n_m)?,
                self.finite(&format!("{key}.force_n"), force_n)?,
            ))
        };
        match (&table.constant, &table.wrenches, &table.multisine) {
            (None, None, None) => Ok(AddedWrench::Nothing),
            (Some(table), None, None) => {
                Ok(AddedWrench::Constant(wrench("drive.constant", table.force_n, table.torque_n_m)?))
            }
            (None, Some(file), None) => {
                let path = self.folder().join(file);
                let source =
                    File::open(&path).map_err(|source| FormatsError::Unreadable { path: path.clone(), source })?;
                read_wrenches(source, &path, duration_ns).map(AddedWrench::Sequence)
            }
            (None, None, Some(table)) => {
                if !(1..=MOST_TONES).contains(&table.tones) {
                    return Err(self.bad("drive.multisine.tones", &format!("{}: 1 to {MOST_TONES}", table.tones)));
                }
                let lowest_hz = self.positive("drive.multisine.lowest_hz", Some(table.lowest_hz), 0.0)?;
                let nyquist_hz = 0.5 / CONTROL_PERIOD_S;
                if !(table.highest_hz > lowest_hz && table.highest_hz < nyquist_hz) {
                    let message = format!("{}: above `lowest_hz`, below {nyquist_hz} Hz", table.highest_hz);
                    return Err(self.bad("drive.multisine.highest_hz", &message));
                }
                let peak = wrench("drive.multisine", table.force_n, table.torque_n_m)?;
                let seed = self.scenario.seed ^ PHASES;
                Ok(AddedWrench::Multisine(Multisine::new(&peak, table.tones, lowest_hz, table.highest_hz, seed)))
            }
            _ => Err(self.bad("drive", "one of `constant`, `wrenches` and `multisine`")),
        }
    }
}

/// The columns of a file of wrenches.
const WRENCH_COLUMNS: [&str; 7] = ["t_s", "f_x", "f_y", "f_z", "tau_x", "tau_y", "tau_z"];

/// A table of wrenches before `duration_ns`: `t_s` and six columns, each row held until the next; those of a log will do.
///
/// # Errors
/// [`TumbleError`] with the line; `path` names the table.
pub fn read_wrenches(source: impl Read, path: &Path, duration_ns: i64) -> Result<Vec<(i64, Wrench<f64>)>, TumbleError> {
    let mut records = csv::ReaderBuilder::new()
        .has_headers(false)
        .flexible(true)
        .quoting(false)
        .comment(Some(b'#'))
        .from_reader(BoundedRows::new(source));
    let mut record = csv::ByteRecord::new();
    if !read_row(&mut records, &mut record, path)? {
        return Err(FormatsError::Empty { path: path.into(), what: "header" }.into());
    }
    let cell_text = |cell: &[u8]| String::from_utf8_lossy(cell).trim_start_matches('\u{feff}').trim().to_owned();
    let names: Vec<String> = record.iter().map(cell_text).collect();
    let mut columns = [0; 7];
    for (slot, column) in columns.iter_mut().zip(WRENCH_COLUMNS) {
        *slot = names.iter().position(|name| name == column).ok_or_else(|| FormatsError::MissingColumn {
            path: path.into(),
            column: column.to_owned(),
            because: ": a file of wrenches has `t_s`, `f_*` and `tau_*`",
        })?;
    }
    let [time, force @ .., tau_x, tau_y, tau_z] = columns;
    let mut rows: Vec<(i64, Wrench<f64>)> = Vec::new();
    while read_row(&mut records, &mut record, path)? {
        let line = record.position().map_or(0, csv::Position::line);
        let (found, expected) = (record.len() as u64, names.len() as u64);
        if found != expected {
            return Err(FormatsError::RowLength { path: path.into(), line, found, expected }.into());
        }
        let row = Row { path, line, record: &record, names: &names };
        let time_ns = row.time_ns(time)?;
        if let Some((last_ns, _)) = rows.last().filter(|(last_ns, _)| *last_ns >= time_ns) {
            let (previous_s, found_s) = (seconds(*last_ns), seconds(time_ns));
            return Err(FormatsError::TimeNotIncreasing { path: path.into(), line, previous_s, found_s }.into());
        }
        if time_ns >= duration_ns {
            break;
        }
        if rows.len() >= MOST_WRENCHES {
            let message = format!("line {line}: more than {MOST_WRENCHES} rows before the end of the flight");
            let source = io::Error::new(io::ErrorKind::FileTooLarge, message);
            return Err(FormatsError::Unreadable { path: path.into(), source }.into());
        }
        let vector = |columns: [usize; 3]| -> Result<Vector3<f64>, TumbleError> {
            let [x, y, z] = columns;
            Ok(Vector3::new(row.number(x)?, row.number(y)?, row.number(z)?))
        };
        rows.push((time_ns, Wrench::new(vector([tau_x, tau_y, tau_z])?, vector(force)?)));
    }
    if rows.is_empty() {
        return Err(FormatsError::Empty { path: path.into(), what: "data rows" }.into());
    }
    Ok(rows)
}
