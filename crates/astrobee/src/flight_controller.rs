//! The cascaded controller that NASA's robots fly, as a plain struct: for comparison, and to close loops as they are.
//!
//! Provenance: the controller of nasa/astrobee 0.19.1 (`gnc/ctl`), which computes the same as that of the thesis's
//! flights, generated from block diagrams. Facts only; computed here in double precision, upstream in 32 bits.

use crate::flight_modes::ControlGains;
use crate::propulsion::constants::CONTROL_PERIOD_S;
use crate::sensing::{Confidence, LocalizationEstimate};
use tumble_dynamics::InertialParameters;
use tumble_dynamics::nalgebra::{ComplexField, Quaternion, UnitQuaternion, Vector3};
use tumble_lie::{LieGroup, Pose, Wrench};

/// Factor on the velocity error under way: with the damping of 1.2 the velocity is fed back by 0.6.
pub const VELOCITY_GAIN: f64 = 0.5;
/// Largest speed and rate at which the robot counts as stopped, m/s and rad/s.
pub const STOPPED_BELOW: f64 = 0.02;
/// Largest norm of the commanded force, N; it never acts, saturation is left to the allocation.
pub const FORCE_LIMIT_N: f64 = 100.0;
/// Largest output of the position integral, per axis.
pub const POSITION_INTEGRAL_LIMIT: f64 = 0.1;
/// Largest output of the attitude integral, per axis.
pub const ATTITUDE_INTEGRAL_LIMIT: f64 = 0.5;
/// Oldest first setpoint of a plan that is accepted, s.
pub const SETPOINT_AGE_LIMIT_S: f64 = 0.5;
/// Stop commands in a row, before the present one, that the stopped status takes.
const STOPS_BEFORE_STOPPED: u8 = 4;

/// What the robot is to do, as sent to the controller.
#[derive(Clone, Copy, Debug, PartialEq)]
#[allow(clippy::large_enum_variant)] // copied, never stored in numbers
pub enum ControlOrder {
    /// No wrench.
    Idle,
    /// Brake, then hold.
    Stop,
    /// Follow a plan: the setpoint in force, and the one that replaces it when its time has come.
    Follow {
        /// Setpoint in force.
        current: Setpoint,
        /// The next one; the same again at the end of a plan.
        next: Setpoint,
    },
}

/// What the controller is doing; numbers as in its messages.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum ControlStatus {
    /// 0: no wrench.
    #[default]
    Idle,
    /// 1: braking, no position held.
    Stopping,
    /// 2: following a plan.
    Nominal,
    /// 3: holding the pose at which the robot came to rest.
    Stopped,
}

/// A state of a plan, at its time.
///
/// # Frame
/// Position, velocity and acceleration of the body origin in inertial axes; rate and angular acceleration in body axes.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Setpoint {
    /// When it holds, ns.
    pub time_ns: i64,
    /// Wanted pose.
    pub world_from_body: Pose<f64>,
    /// Wanted velocity, inertial axes, m/s.
    pub velocity_world: Vector3<f64>,
    /// Wanted angular rate, body axes, rad/s.
    pub rate_body: Vector3<f64>,
    /// Wanted acceleration, inertial axes, m/s^2.
    pub acceleration_world: Vector3<f64>,
    /// Wanted angular acceleration, body axes, rad/s^2.
    pub angular_acceleration_body: Vector3<f64>,
}

impl Setpoint {
    /// At rest in a pose.
    pub fn at_rest(time_ns: i64, world_from_body: Pose<f64>) -> Self {
        let zero = Vector3::zeros();
        Self {
            time_ns,
            world_from_body,
            velocity_world: zero,
            rate_body: zero,
            acceleration_world: zero,
            angular_acceleration_body: zero,
        }
    }

    /// The setpoint carried to another time with its accelerations held.
    ///
    /// The attitude is right to second order in the time between, with the third-order term of a rate that changes
    /// direction.
    #[must_use]
    pub fn at(&self, time_ns: i64) -> Self {
        let dt = time_ns.saturating_sub(self.time_ns) as f64 * 1e-9;
        let (omega, alpha) = (&self.rate_body, &self.angular_acceleration_body);
        let turned: UnitQuaternion<f64> = LieGroup::exp(&((omega + alpha * (0.5 * dt)) * dt));
        // upstream's commutator of 4 x 4 matrices is twice the quaternion product by omega x alpha
        let coning = Quaternion::from_imag(omega.cross(alpha) * (dt * dt * dt / 24.0));
        let rotation = shorter(UnitQuaternion::new_normalize(
            self.world_from_body.rotation.into_inner() * (turned.into_inner() + coning),
        ));
        let position =
            self.world_from_body.translation.vector + (self.velocity_world + self.acceleration_world * (0.5 * dt)) * dt;
        Self {
            time_ns,
            world_from_body: Pose::from_parts(position.into(), rotation),
            velocity_world: self.velocity_world + self.acceleration_world * dt,
            rate_body: omega + alpha * dt,
            ..*self
        }
    }
}

/// The same rotation with a scalar part that is not negative.
fn shorter(q: UnitQuaternion<f64>) -> UnitQuaternion<f64> {
    if q.w < 0.0 { UnitQuaternion::new_unchecked(-q.into_inner()) } else { q }
}

/// What the controller commands, with what led to it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FlightCommand {
    /// Commanded wrench, body axes, torque about the **centre of mass**.
    pub wrench_about_com: Wrench<f64>,
    /// What the controller is doing.
    pub status: ControlStatus,
    /// The reference that it followed.
    pub reference: Setpoint,
    /// Wanted less estimated position, inertial axes, m.
    pub position_error_world: Vector3<f64>,
    /// Output of the position integral.
    pub position_error_integrated: Vector3<f64>,
    /// Vector part of the quaternion from the estimated to the wanted attitude: half the angle.
    pub attitude_error: Vector3<f64>,
    /// Angle of that quaternion, rad.
    pub attitude_error_rad: f64,
    /// Output of the attitude integral.
    pub attitude_error_integrated: Vector3<f64>,
    /// Commanded acceleration, force per mass, body axes, m/s^2.
    pub acceleration_body: Vector3<f64>,
    /// Angular acceleration from the feedback alone, body axes, rad/s^2.
    pub angular_acceleration_body: Vector3<f64>,
}

impl FlightCommand {
    /// The commanded wrench with its torque about the body origin, as everything else in this workspace has it.
    pub fn wrench_body(&self, center_of_mass_body: &Vector3<f64>) -> Wrench<f64> {
        let Wrench { torque, force } = self.wrench_about_com;
        Wrench::new(torque + center_of_mass_body.cross(&force), force)
    }
}

/// First-order low-pass of one component: its state.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
struct LowPass(Vector3<f64>);

impl LowPass {
    const INPUT: f64 = 0.003_131_764_229_192_705_6;
    const MEMORY: f64 = 0.993_736_471_541_614_6;

    fn step(&mut self, input: &Vector3<f64>) -> Vector3<f64> {
        let previous = self.0;
        self.0 = input * Self::INPUT + previous * Self::MEMORY;
        self.0 + previous
    }
}

/// An integral whose output is limited and whose memory is not.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
struct Integral(Vector3<f64>);

impl Integral {
    fn step(&mut self, input: &Vector3<f64>, limit: f64, engaged: bool) -> Vector3<f64> {
        self.0 = if engaged { self.0 + input * CONTROL_PERIOD_S } else { Vector3::zeros() };
        self.0.map(|component| component.clamp(-limit, limit))
    }
}

/// The flown controller: position and attitude loops around velocity and rate loops.
///
/// It runs once for each localisation message, at 62.5 Hz; in the flight mode "off" it does not run.
///
/// # Deviation
/// Upstream also names limits (0.1 m^2, 10 degrees) within which a *commanded* status 3 is kept. No message can command
/// that status, so they have no counterpart here.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FlightController {
    body: InertialParameters<f64>,
    gains: ControlGains,
    position_integral: Integral,
    attitude_integral: Integral,
    velocity_filter: LowPass,
    rate_filter: LowPass,
    /// Stop commands in a row before the present one, counted up to [`STOPS_BEFORE_STOPPED`].
    stops: u8,
    /// The last estimated pose before the stopped status.
    latched: Pose<f64>,
}

/// `numerator / denominator` by component, zero where the denominator is.
fn ratio(numerator: &Vector3<f64>, denominator: &Vector3<f64>) -> Vector3<f64> {
    numerator.zip_map(denominator, |n, d| if d == 0.0 { 0.0 } else { n / d })
}

impl FlightController {
    /// A controller that believes in `body`.
    pub fn new(body: InertialParameters<f64>, gains: ControlGains) -> Self {
        Self {
            body,
            gains,
            position_integral: Integral::default(),
            attitude_integral: Integral::default(),
            velocity_filter: LowPass::default(),
            rate_filter: LowPass::default(),
            stops: 0,
            latched: Pose::identity(),
        }
    }

    /// The body that it believes in.
    pub fn body(&self) -> &InertialParameters<f64> {
        &self.body
    }

    /// Another belief, as the robot's mass service gives it in flight; integrals and filters go on.
    pub fn set_body(&mut self, body: InertialParameters<f64>) {
        self.body = body;
    }

    /// Other gains, as a change of flight mode gives them.
    pub fn set_gains(&mut self, gains: ControlGains) {
        self.gains = gains;
    }

    /// One period: the command for this estimate under this order.
    pub fn step(&mut self, estimate: &LocalizationEstimate, order: &ControlOrder) -> FlightCommand {
        let status = self.next_status(estimate, order);
        let holding = status == ControlStatus::Stopped;
        let engaged = matches!(status, ControlStatus::Nominal | ControlStatus::Stopped);
        let reference = match (order, holding) {
            (ControlOrder::Follow { current, next }, false) => {
                let due = if estimate.stamp_ns >= next.time_ns { next } else { current };
                due.at(estimate.stamp_ns)
            }
            (_, true) => Setpoint::at_rest(estimate.stamp_ns, self.latched),
            // no plan: what is estimated, at rest
            (_, false) => Setpoint::at_rest(estimate.stamp_ns, estimate.world_from_body),
        };
        let body_from_world = estimate.world_from_body.rotation.inverse();
        let gains = &self.gains;

        let position_error_world =
            reference.world_from_body.translation.vector - estimate.world_from_body.translation.vector;
        let integral_gain = ratio(&gains.position_integral, &gains.velocity_damping);
        let position_error_integrated = self.position_integral.step(
            &integral_gain.component_mul(&position_error_world),
            POSITION_INTEGRAL_LIMIT,
            engaged,
        );
        let velocity_error = if engaged {
            (reference.velocity_world - estimate.velocity_origin_world) * VELOCITY_GAIN
                + ratio(&gains.position_proportional, &gains.velocity_damping).component_mul(&position_error_world)
                + position_error_integrated
        } else {
            -estimate.velocity_origin_world
        };
        let acceleration = gains.velocity_damping.component_mul(&(body_from_world * velocity_error))
            + body_from_world * reference.acceleration_world;

        let attitude_quaternion = shorter(body_from_world * reference.world_from_body.rotation);
        let attitude_error = attitude_quaternion.imag();
        let integral_gain = ratio(&gains.attitude_integral, &gains.rate_damping);
        let attitude_error_integrated = self.attitude_integral.step(
            &integral_gain.component_mul(&attitude_error),
            ATTITUDE_INTEGRAL_LIMIT,
            engaged,
        );
        let rate_error = if engaged {
            reference.rate_body
                + attitude_error_integrated
                + ratio(&gains.attitude_proportional, &gains.rate_damping).component_mul(&attitude_error)
                - estimate.rate_body
        } else {
            -estimate.rate_body
        };
        let inertia = self.body.inertia_about_com();
        let feedback = gains.rate_damping.component_mul(&inertia.diagonal()).component_mul(&rate_error);

        let wrench_about_com = if status == ControlStatus::Idle {
            Wrench::zero()
        } else {
            let force = acceleration * self.body.mass;
            let norm = force.norm();
            let force = if norm > FORCE_LIMIT_N { force * (FORCE_LIMIT_N / norm) } else { force };
            let gyroscopic = estimate.rate_body.cross(&(inertia * estimate.rate_body));
            Wrench::new(inertia * reference.angular_acceleration_body + feedback + gyroscopic, force)
        };
        if !holding {
            self.latched = estimate.world_from_body;
        }
        FlightCommand {
            wrench_about_com,
            status,
            reference,
            position_error_world,
            position_error_integrated,
            attitude_error,
            attitude_error_rad: 2.0 * ComplexField::acos(attitude_quaternion.w.min(1.0)),
            attitude_error_integrated,
            acceleration_body: wrench_about_com.force / self.body.mass,
            angular_acceleration_body: inertia.try_inverse().map_or_else(Vector3::zeros, |inverse| inverse * feedback),
        }
    }

    /// The status of this step; filters and the count of stops move on.
    fn next_status(&mut self, estimate: &LocalizationEstimate, order: &ControlOrder) -> ControlStatus {
        let commanded = match order {
            _ if estimate.confidence != Confidence::Good => ControlStatus::Idle,
            ControlOrder::Idle => ControlStatus::Idle,
            ControlOrder::Stop => ControlStatus::Stopping,
            ControlOrder::Follow { .. } => ControlStatus::Nominal,
        };
        let threshold = STOPPED_BELOW * STOPPED_BELOW;
        let slow = self.velocity_filter.step(&estimate.velocity_origin_world).norm_squared() < threshold;
        let still = self.rate_filter.step(&estimate.rate_body).norm_squared() < threshold;
        let stopped = self.stops == STOPS_BEFORE_STOPPED && slow && still;
        self.stops = if commanded == ControlStatus::Stopping { STOPS_BEFORE_STOPPED.min(self.stops + 1) } else { 0 };
        // as flown, only past orders count: the first order after a stop is obeyed one period late
        if stopped { ControlStatus::Stopped } else { commanded }
    }
}
