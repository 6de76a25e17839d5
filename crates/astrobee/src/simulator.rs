//! The robot in its world: wanted wrenches go in; motion, estimates and what really acted come out.
//!
//! One control period of 0.016 s goes this way: wanted wrench -> command -> wrench of the hardware, held -> two steps of the
//! variational integrator -> sensors. The state is that of the body origin throughout, whatever the robot carries.
//!
//! Sensors see the instant at which a period begins just after the new wrench acts, so that a log pairs a pose, the
//! acceleration there and the wrench held from there on. What they publish is out when the period ends: the
//! controller is one period behind at the least.
//!
//! Contact is not simulated: the body flies on through an obstacle, a wall or beyond the edge of the table, and an
//! [`Event`] says so.

mod actuators;
mod body_step;
mod control_account;
mod drive;
mod error;
mod flown_controller;
mod payload;
mod surroundings;

pub use actuators::Actuators;
pub use body_step::BodyStep;
pub use control_account::{ControlAccount, FallbackSpell, OfferedBelief};
pub use drive::{AddedWrench, Drive, Follower, Following, Multisine, Reference, Waypoint};
pub use error::SimulatorError;
pub use flown_controller::FlownController;
pub use payload::{Grasp, PayloadMotion, ReleasedPayload, planar_part};
pub use surroundings::{Event, ObstacleMotion, Surroundings, TimedEvent};

use crate::AstrobeeError;
pub use crate::propulsion::constants::CONTROL_PERIOD_S;
use crate::propulsion::{Damage, PropulsionCommand};
use crate::sensing::{Localization, LocalizationEstimate, TrueMotion};
use crate::worlds::WorldPreset;
use tumble_dynamics::nalgebra::Vector3;
use tumble_dynamics::{
    DynamicsError, Environment, FreeFlyer, InertialParameters, Plant, QuadraticDrag, RigidBodyState, StoredMomentum,
    World, WrenchModel, spatial_momentum, variational_step,
};
use tumble_lie::{LieGroup, Wrench};

/// Control period, ns (62.5 Hz).
pub const CONTROL_PERIOD_NS: i64 = 16_000_000;
/// Time between two looks of the sensors and integration step, ns (125 Hz).
const SUBSTEP_NS: i64 = 8_000_000;
const SUBSTEP_S: f64 = 0.008;
/// Integration steps in a control period.
const SUBSTEPS: i64 = 2;
/// Largest quaternion components about x and y of a body that stands upright on the table.
const TILT_TOLERANCE: f64 = 1e-9;

/// What a simulator is made of.
pub struct SimulatorSettings {
    /// Robot without payload, about its origin.
    pub body: InertialParameters<f64>,
    /// State at time zero.
    pub start: RigidBodyState<f64>,
    /// Three degrees of freedom instead of six.
    pub planar: bool,
    /// Volumes and obstacles.
    pub world: World,
    /// Those of the obstacles that move, appear or vanish.
    pub obstacle_motions: Vec<ObstacleMotion>,
    /// Half the edge of the table that the body should stay on, m.
    pub table_half_width_m: Option<f64>,
    /// Radius of the sphere that stands for the robot, m.
    pub robot_radius_m: f64,
    /// Speed above which an event says so, m/s.
    pub speed_limit_m_s: f64,
    /// Angular rate above which an event says so, rad/s.
    pub rate_limit_rad_s: f64,
    /// Air drag, held over a step as NASA's plug-in holds it.
    pub drag: Option<QuadraticDrag<f64>>,
    /// What else acts; the time of its models is the flight's.
    pub environment: Environment,
    /// How wrenches are made.
    pub actuators: Actuators,
    /// Sensors; `None` measures nothing.
    pub sensors: Option<Localization>,
}

impl SimulatorSettings {
    /// The robot of a place, its volumes, no obstacles; actuators that give whatever is wanted, no sensors, no drag.
    pub fn ideal(place: WorldPreset, start: RigidBodyState<f64>) -> Self {
        Self {
            body: place.body(),
            start,
            planar: place.is_planar(),
            world: place.volumes(),
            obstacle_motions: Vec::new(),
            table_half_width_m: place.table_half_width_m(),
            robot_radius_m: crate::worlds::ROBOT_RADIUS_M,
            speed_limit_m_s: f64::INFINITY,
            rate_limit_rad_s: f64::INFINITY,
            drag: None,
            environment: Environment::default(),
            actuators: Actuators::Exact,
            sensors: None,
        }
    }
}

/// What happened in a control period.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SimulatorMeasurement {
    /// Truth at the start of the (last) period, accelerations just after the wrench changed.
    pub start: TrueMotion,
    /// Truth at its end, accelerations just before the wrench changes again.
    pub end: TrueMotion,
    /// The newest of the estimates that have arrived by its end.
    pub estimate: Option<LocalizationEstimate>,
    /// Wrench asked for.
    pub wanted_wrench_body: Wrench<f64>,
    /// What the robot believes it applied: its commands through the propulsion as it is on paper.
    pub believed_wrench_body: Wrench<f64>,
    /// Thrust of each nozzle in it, N; zero where none are simulated.
    pub believed_thrusts_n: [f64; 12],
    /// Mean of what really acted: propulsion, drag, environment, and wheels that are turned along with the body; on the table the part in the
    /// plane.
    pub realized_wrench_body: Wrench<f64>,
    /// Angular momentum of wheels relative to the body as the period begins and as it ends, body axes, N m s; zero without.
    pub stored_momentum_body: [Vector3<f64>; 2],
    /// What the modules were told; zero where none are simulated.
    pub command: PropulsionCommand,
    /// Whether the propulsion was at a limit.
    pub saturated: bool,
}

/// The simulated robot; see the [module](self).
///
/// ```
/// use tumble_astrobee::{simulator::{AstrobeeSimulator, SimulatorSettings}, worlds::WorldPreset};
/// use tumble_dynamics::{Plant, RigidBodyState, lie::{Twist, Wrench}, nalgebra::Vector3};
/// let start = RigidBodyState {
///     world_from_body: WorldPreset::Iss.pose("A").unwrap_or_default(),
///     twist_body: Twist::zero(),
/// };
/// let mut robot = AstrobeeSimulator::try_new(SimulatorSettings::ideal(WorldPreset::Iss, start))?;
/// let push = Wrench::new(Vector3::zeros(), Vector3::new(0.1, 0.0, 0.0));
/// let after = robot.advance(&push, 1.6)?;
/// assert!((after.end.state.twist_body.linear.x - 0.1 * 1.6 / 9.5838).abs() < 1e-4);
/// # Ok::<(), tumble_astrobee::AstrobeeError>(())
/// ```
pub struct AstrobeeSimulator {
    robot: InertialParameters<f64>,
    flyer: FreeFlyer<f64>,
    held: Option<Grasp>,
    planar: bool,
    world: World,
    obstacle_motions: Vec<ObstacleMotion>,
    obstacle_is_there: Vec<bool>,
    table_half_width_m: Option<f64>,
    robot_radius_m: f64,
    speed_limit_m_s: f64,
    rate_limit_rad_s: f64,
    drag: Option<QuadraticDrag<f64>>,
    environment: Environment,
    actuators: Actuators,
    damage: Damage,
    sensors: Option<Localization>,
    time_ns: i64,
    state: RigidBodyState<f64>,
    arrived: Vec<LocalizationEstimate>,
    newest: Option<LocalizationEstimate>,
    around: Surroundings,
    events: Vec<TimedEvent>,
    events_lost: u64,
}

/// Room for estimates that arrive in one period and for events: a step allocates nothing.
const ROOM: usize = 256;

impl AstrobeeSimulator {
    /// The robot at the start, time zero.
    ///
    /// # Errors
    /// [`SimulatorError::OutOfPlane`] for a start in the plane that is none; [`DynamicsError`] for a body that is none.
    pub fn try_new(settings: SimulatorSettings) -> Result<Self, SimulatorError> {
        let SimulatorSettings { body, start, planar, world, table_half_width_m, robot_radius_m, .. } = settings;
        body.validated()?;
        let mut state = start;
        if planar {
            state = in_plane(&start)?;
        }
        let mut simulator = Self {
            robot: body,
            flyer: FreeFlyer::new(body),
            held: None,
            planar,
            obstacle_is_there: vec![true; world.obstacles.len()],
            obstacle_motions: settings.obstacle_motions,
            world,
            table_half_width_m,
            robot_radius_m,
            speed_limit_m_s: settings.speed_limit_m_s,
            rate_limit_rad_s: settings.rate_limit_rad_s,
            drag: settings.drag,
            environment: settings.environment,
            actuators: settings.actuators,
            damage: Damage::NONE,
            sensors: settings.sensors,
            time_ns: 0,
            state,
            arrived: Vec::with_capacity(ROOM),
            newest: None,
            around: Surroundings::default(),
            events: Vec::with_capacity(ROOM),
            events_lost: 0,
        };
        simulator.take_load(None);
        simulator.look_around();
        Ok(simulator)
    }

    /// Time since the start, ns.
    pub fn time_ns(&self) -> i64 {
        self.time_ns
    }

    /// The true state.
    pub fn state(&self) -> &RigidBodyState<f64> {
        &self.state
    }

    /// Robot and what it carries, about the robot's origin.
    pub fn body(&self) -> InertialParameters<f64> {
        self.held.map_or(self.robot, |grasp| self.robot.with_payload(&grasp.payload, &grasp.robot_from_payload))
    }

    /// Linear momentum and angular momentum about the world's origin, world axes; on the table of the motion in it.
    pub fn spatial_momentum(&self) -> Wrench<f64> {
        spatial_momentum(self.flyer.parameters(), &self.state)
    }

    /// Angular momentum of wheels relative to the body, body axes, N m s; `None` without wheels.
    pub fn stored_momentum_body(&self) -> Option<Vector3<f64>> {
        self.actuators.stored_momentum_body()
    }

    /// The estimates that arrived during the last advance, in order of arrival.
    pub fn estimates(&self) -> &[LocalizationEstimate] {
        &self.arrived
    }

    /// What is around the body at this time.
    pub fn surroundings(&self) -> &Surroundings {
        &self.around
    }

    /// The first events of the flight; a step that began in an obstacle counts as hitting it.
    pub fn events(&self) -> &[TimedEvent] {
        &self.events
    }

    /// Events for which there was no room.
    pub fn events_lost(&self) -> u64 {
        self.events_lost
    }

    /// Takes hold of a payload, instantly and rigidly: momentum is kept, energy is not.
    ///
    /// # Errors
    /// [`SimulatorError::PayloadHeld`].
    pub fn attach(&mut self, grasp: Grasp, motion: PayloadMotion) -> Result<(), SimulatorError> {
        if self.held.is_some() {
            return Err(SimulatorError::PayloadHeld);
        }
        let part = self.described(&grasp);
        let robot = *self.flyer.parameters();
        self.state.twist_body = payload::twist_after_attach(&robot, &part, &self.state.twist_body, motion);
        self.take_load(Some(grasp));
        self.push_event(Event::PayloadAttached);
        Ok(())
    }

    /// Lets go of the payload, which leaves with the velocity it has; the robot's does not change.
    ///
    /// # Errors
    /// [`SimulatorError::NoPayload`].
    pub fn release(&mut self) -> Result<ReleasedPayload, SimulatorError> {
        let grasp = self.held.ok_or(SimulatorError::NoPayload)?;
        let released = ReleasedPayload::leaving(&grasp, &self.state);
        self.take_load(None);
        self.push_event(Event::PayloadReleased);
        Ok(released)
    }

    /// The most force along a direction (unit vector) whose line passes through a point that can be had by asking for up to so
    /// much of it, N: more may be asked for than nozzles give. Of pulses and rotors what is asked for; damage does not count.
    ///
    /// # Frame
    /// Body axes.
    pub fn largest_force_n(&self, direction_body: &Vector3<f64>, through_body: &Vector3<f64>, up_to_n: f64) -> f64 {
        self.actuators.largest_force_n(direction_body, through_body, up_to_n)
    }

    /// Breaks something of the propulsion, or mends it with [`Damage::NONE`]; what the robot believes it applies does not change.
    ///
    /// Without simulated modules, the nozzles' shares of the wrench are those of the allocation; valves and rotors know the
    /// factor on the thrust only.
    pub fn set_damage(&mut self, damage: Damage) {
        self.damage = damage;
    }

    /// Changes the body, robot and payload alike.
    ///
    /// # Errors
    /// [`DynamicsError`] where there would be no body any more.
    pub fn step_body(&mut self, step: &BodyStep) -> Result<(), SimulatorError> {
        let whole = self.body();
        let robot = step.of_robot(&self.robot, whole.mass);
        let held = self.held.map(|grasp| Grasp { payload: step.of_payload(&grasp.payload), ..grasp });
        for part in std::iter::once(&robot).chain(held.as_ref().map(|grasp| &grasp.payload)) {
            if part.validated()?.mass <= 0.0 {
                return Err(DynamicsError::NotRealizable { margin: part.consistency_margin() }.into());
            }
        }
        self.robot = robot;
        self.take_load(held);
        Ok(())
    }

    /// The payload as part of the body that moves: in the robot's frame, on the table what of it counts there.
    fn described(&self, grasp: &Grasp) -> InertialParameters<f64> {
        let part = grasp.payload.transformed_by(&grasp.robot_from_payload);
        if self.planar { planar_part(&part) } else { part }
    }

    fn take_load(&mut self, held: Option<Grasp>) {
        self.held = held;
        let body = self.body();
        self.flyer = FreeFlyer::new(if self.planar { planar_part(&body) } else { body });
    }

    fn push_event(&mut self, event: Event) {
        if self.events.len() < ROOM {
            self.events.push(TimedEvent { time_ns: self.time_ns, event });
        } else {
            self.events_lost += 1;
        }
    }

    /// Records what changed around the body.
    fn look_around(&mut self) {
        let RigidBodyState { world_from_body, twist_body } = &self.state;
        let position = &world_from_body.translation.vector;
        let time_s = self.time_ns as f64 * 1e-9;
        for motion in &self.obstacle_motions {
            if let Some(obstacle) = self.world.obstacles.get_mut(motion.obstacle) {
                obstacle.world_from_ellipsoid.translation.vector = motion.center_at(time_s);
            }
            if let Some(is_there) = self.obstacle_is_there.get_mut(motion.obstacle) {
                *is_there = motion.is_there(time_s);
            }
        }
        let is_there = |index: usize| self.obstacle_is_there.get(index).copied().unwrap_or(true);
        let after = Surroundings {
            too_fast: twist_body.linear.norm() > self.speed_limit_m_s,
            turning_too_fast: twist_body.angular.norm() > self.rate_limit_rad_s,
            ..Surroundings::among(&self.world, is_there, self.table_half_width_m, position, self.robot_radius_m)
        };
        let before = std::mem::replace(&mut self.around, after);
        for event in Surroundings::changes(&before, &after).into_iter().flatten() {
            self.push_event(event);
        }
    }

    /// Truth at this time while `wrench_body` acts.
    fn truth(&self, wrench_body: &Wrench<f64>) -> TrueMotion {
        let acceleration = self.flyer.forward(&self.state.twist_body, wrench_body);
        TrueMotion {
            time_ns: self.time_ns,
            state: self.state,
            acceleration_origin_body: acceleration.acceleration_origin_body,
            angular_acceleration_body: acceleration.angular_acceleration_body,
        }
    }

    /// What the world and wheels that hold so much, where there are some, add to the wrench of the propulsion in this state, in or shortly after
    /// that in which the body is; the table confines it to the plane.
    fn acting(
        &self,
        propulsion: &Wrench<f64>,
        (time_ns, state): (i64, &RigidBodyState<f64>),
        stored_body: Option<Vector3<f64>>,
    ) -> Wrench<f64> {
        let drag = self.drag.as_ref().map_or_else(Wrench::zero, |drag| drag.wrench_body(0.0, &self.state));
        let mut acting = *propulsion + drag;
        if !self.environment.is_empty() {
            acting += self.environment.wrench_on(self.flyer.parameters(), time_ns as f64 * 1e-9, state);
        }
        if let Some(momentum_body) = stored_body {
            acting += StoredMomentum { momentum_body }.wrench_body(0.0, state);
        }
        self.confined(&acting)
    }

    /// On the table: what the air bearing does not take up.
    fn confined(&self, wrench: &Wrench<f64>) -> Wrench<f64> {
        if self.planar {
            let (torque, force) = (&wrench.torque, &wrench.force);
            Wrench::new(Vector3::new(0.0, 0.0, torque.z), Vector3::new(force.x, force.y, 0.0))
        } else {
            *wrench
        }
    }

    /// One control period; leaves the body where it was when the integrator refuses, though not the propulsion.
    fn period(&mut self, wanted: &Wrench<f64>) -> Result<SimulatorMeasurement, SimulatorError> {
        let stored_before = self.stored_momentum_body();
        let made = self.actuators.step(wanted, &self.state.twist_body.angular, &self.damage)?;
        let stored = stored_before.zip(self.stored_momentum_body());
        let (start_ns, start_state) = (self.time_ns, self.state);
        let stored_at = |time_ns: i64| {
            let share = (time_ns - start_ns) as f64 / CONTROL_PERIOD_NS as f64;
            stored.map(|(before, after)| before.lerp(&after, share))
        };
        let mut start = None;
        let mut sum = Wrench::zero();
        let mut last = Wrench::zero();
        for _ in 0..SUBSTEPS {
            let now_ns = self.time_ns;
            let truth = self.truth(&self.acting(&made.realized_wrench_body, (now_ns, &self.state), stored_at(now_ns)));
            let (middle_ns, middle) = (now_ns + SUBSTEP_NS / 2, extrapolated(&truth, SUBSTEP_NS / 2));
            last = self.acting(&made.realized_wrench_body, (middle_ns, &middle), stored_at(middle_ns));
            sum += last;
            if let Some(sensors) = &mut self.sensors {
                sensors.observe(&truth);
            }
            start.get_or_insert(truth);
            match variational_step(self.flyer.parameters(), &self.state, &last, SUBSTEP_S) {
                Ok(state) => self.state = state,
                Err(error) => {
                    (self.time_ns, self.state) = (start_ns, start_state);
                    return Err(error.into());
                }
            }
            self.time_ns += SUBSTEP_NS;
        }
        if let Some(sensors) = &mut self.sensors {
            while let Some(estimate) = sensors.arrived(self.time_ns) {
                self.arrived.push(estimate);
                if self.newest.is_none_or(|newest| newest.stamp_ns < estimate.stamp_ns) {
                    self.newest = Some(estimate);
                }
            }
        }
        self.look_around();
        let end = self.truth(&last);
        Ok(SimulatorMeasurement {
            start: start.unwrap_or(end),
            end,
            estimate: self.newest,
            wanted_wrench_body: *wanted,
            believed_wrench_body: self.confined(&made.believed_wrench_body),
            believed_thrusts_n: made.believed_thrusts_n,
            realized_wrench_body: sum * (1.0 / SUBSTEPS as f64),
            stored_momentum_body: stored.map_or([Vector3::zeros(); 2], |(before, after)| [before, after]),
            command: made.command,
            saturated: made.saturated,
        })
    }
}

impl Plant for AstrobeeSimulator {
    /// Wanted wrench, body axes, torque about the body origin.
    type Input = Wrench<f64>;
    type Measurement = SimulatorMeasurement;
    type Error = AstrobeeError;

    /// A whole number of control periods; what is reported is the last of them.
    fn advance(&mut self, wanted: &Wrench<f64>, duration_s: f64) -> Result<SimulatorMeasurement, AstrobeeError> {
        let periods = libm::round(duration_s / CONTROL_PERIOD_S);
        if !(periods >= 1.0 && (duration_s - periods * CONTROL_PERIOD_S).abs() <= 1e-9 * duration_s) {
            return Err(SimulatorError::NotControlPeriods { duration_s }.into());
        }
        self.arrived.clear();
        let mut measurement = self.period(wanted)?;
        let mut done = 1.0;
        while done < periods {
            measurement = self.period(wanted)?;
            done += 1.0;
        }
        Ok(measurement)
    }
}

/// The state without what a table does not admit; what is more than rounding is an error.
fn in_plane(state: &RigidBodyState<f64>) -> Result<RigidBodyState<f64>, SimulatorError> {
    let rotation = state.world_from_body.rotation;
    let (angular, linear) = (state.twist_body.angular, state.twist_body.linear);
    let excess =
        [rotation.i, rotation.j, angular.x, angular.y, linear.z].into_iter().fold(0.0_f64, |a, b| a.max(b.abs()));
    if excess.is_nan() || excess > TILT_TOLERANCE {
        return Err(SimulatorError::OutOfPlane { excess });
    }
    let norm = libm::hypot(rotation.w, rotation.k);
    let upright = tumble_dynamics::nalgebra::Quaternion::new(rotation.w / norm, 0.0, 0.0, rotation.k / norm);
    let mut flat = *state;
    flat.world_from_body.rotation = tumble_dynamics::nalgebra::UnitQuaternion::new_unchecked(upright);
    flat.twist_body.angular = Vector3::new(0.0, 0.0, angular.z);
    flat.twist_body.linear = Vector3::new(linear.x, linear.y, 0.0);
    Ok(flat)
}

/// The pose and twist that `motion` has `after_ns` later, if its accelerations stay.
pub fn extrapolated(motion: &TrueMotion, after_ns: i64) -> RigidBodyState<f64> {
    if after_ns == 0 {
        return motion.state;
    }
    let after_s = after_ns as f64 * 1e-9;
    let twist = motion.state.twist_body;
    let rate = tumble_dynamics::BodyAcceleration {
        angular_acceleration_body: motion.angular_acceleration_body,
        acceleration_origin_body: motion.acceleration_origin_body,
    }
    .twist_rate_body(&twist);
    let increment = (twist * after_s + rate * (0.5 * after_s * after_s)).to_vector();
    let turn = <tumble_lie::Pose<f64> as LieGroup>::exp(&increment);
    RigidBodyState { world_from_body: motion.state.world_from_body * turn, twist_body: twist + rate * after_s }
}
