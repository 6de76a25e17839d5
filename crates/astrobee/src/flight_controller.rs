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
/// Stop commands in a row, before the present one, that the stopped status takes.
const STOPS_BEFORE_STOPPED: u8 = 4;

/// What the robot is to do, as sent to the controller.
#[derive(Clone, Copy, Debug, PartialEq)]
#[allow(clippy::large_enum_variant)] // copied, never stored in numbers
#[non_exhaustive]
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
#[non_exhaustive]
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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::bodies::BodyConfiguration;
    use crate::flight_modes::FlightSite;
    use tumble_dynamics::nalgebra::Translation3;
    use tumble_dynamics::{FreeFlyer, Integrator, MuntheKaas4, RigidBodyState};

    const PERIOD_NS: i64 = 16_000_000;

    fn pose(position: [f64; 3], [x, y, z, w]: [f64; 4]) -> Pose<f64> {
        Pose::from_parts(Translation3::from(position), UnitQuaternion::new_normalize(Quaternion::new(w, x, y, z)))
    }

    fn iss_controller() -> FlightController {
        FlightController::new(BodyConfiguration::Iss.parameters(), ControlGains::of(FlightSite::Iss))
    }

    fn setpoint() -> Setpoint {
        Setpoint {
            time_ns: 0,
            world_from_body: pose([0.1, -0.2, 0.3], [0.1, -0.2, 0.3, 0.9]),
            velocity_world: Vector3::new(0.02, -0.01, 0.03),
            rate_body: Vector3::new(0.5, -0.3, 0.2),
            acceleration_world: Vector3::new(0.01, 0.005, -0.015),
            angular_acceleration_body: Vector3::new(-0.4, 0.6, 0.1),
        }
    }

    fn estimate(stamp_ns: i64) -> LocalizationEstimate {
        LocalizationEstimate {
            stamp_ns,
            arrival_ns: stamp_ns,
            world_from_body: pose([0.15, -0.1, 0.2], [0.05, 0.1, -0.1, 0.95]),
            velocity_origin_world: Vector3::new(0.01, 0.03, -0.02),
            rate_body: Vector3::new(0.02, -0.05, 0.04),
            acceleration_origin_body: Vector3::zeros(),
            confidence: Confidence::Good,
        }
    }

    fn near(actual: &Vector3<f64>, expected: [f64; 3]) {
        assert!((actual - Vector3::from(expected)).norm() < 1e-14, "{actual} instead of {expected:?}");
    }

    /// Expected numbers: the equations on 4 x 4 matrices (a power series for their exponential), outside this program.
    #[test]
    fn two_steps_give_the_wrench_of_the_equations() {
        let mut controller = iss_controller();
        let follow = ControlOrder::Follow { current: setpoint(), next: Setpoint { time_ns: i64::MAX, ..setpoint() } };
        let first = controller.step(&estimate(500_000_000), &follow);
        assert_eq!(first.status, ControlStatus::Nominal);
        let q = first.reference.world_from_body.rotation;
        near(&q.imag(), [0.193_259_735_331_930, -0.214_259_454_660_854, 0.374_635_237_652_532]);
        near(&first.wrench_about_com.force, [-0.051_947_356_909_331, -0.695_052_867_143_079, 0.818_373_141_455_661]);
        near(&first.wrench_about_com.torque, [0.154_869_663_152_563, -0.042_070_503_644_571, 0.445_306_779_875_525]);
        assert!((first.attitude_error_rad - 1.221_683_905_615_181).abs() < 1e-14);
        let second = controller.step(&estimate(516_000_000), &follow);
        near(&second.wrench_about_com.force, [-0.048_962_805_167_247, -0.694_521_731_767_121, 0.819_691_755_544_696]);
        near(&second.wrench_about_com.torque, [0.152_585_260_352_778, -0.037_147_355_819_714, 0.447_616_655_101_528]);
        let stopping = controller.step(&estimate(532_000_000), &ControlOrder::Stop);
        assert_eq!(stopping.status, ControlStatus::Stopping);
        near(&stopping.wrench_about_com.force, [-0.092_626_022_369_643, -0.341_908_136_263_784, 0.244_308_904_639_395]);
        near(&stopping.wrench_about_com.torque, [-0.009_858_569_098, 0.022_827_148_188_8, -0.020_764_039_207]);
        assert_eq!(stopping.attitude_error_integrated, Vector3::zeros(), "integrals let go");
    }

    #[test]
    fn the_torque_moves_to_the_body_origin_with_the_force() {
        let command = iss_controller().step(&estimate(0), &ControlOrder::Stop);
        let center_of_mass = Vector3::new(0.1, -0.2, 0.3);
        let wrench = command.wrench_body(&center_of_mass);
        let shift = Pose::from_parts(Translation3::from(center_of_mass), UnitQuaternion::identity());
        let expected = command.wrench_about_com.transformed_by(&shift);
        assert!((wrench.to_vector() - expected.to_vector()).norm() < 1e-15);
        assert!((wrench.torque - command.wrench_about_com.torque).norm() > 0.01);
    }

    #[test]
    fn the_next_setpoint_takes_over_at_its_time() {
        let next = Setpoint::at_rest(100, pose([1.0, 0.0, 0.0], [0.0, 0.0, 0.0, 1.0]));
        let follow = ControlOrder::Follow { current: setpoint(), next };
        let x = |stamp_ns| iss_controller().step(&estimate(stamp_ns), &follow).reference.world_from_body.translation.x;
        assert!(x(99) < 0.2);
        assert!(x(100) > 0.9);
    }

    #[test]
    fn a_setpoint_under_angular_acceleration_turns_as_the_kinematics_say() {
        let setpoint = setpoint();
        // the kinematics in steps of 10 us
        let steps = 50_000;
        let step_s = 0.5 / f64::from(steps);
        let mut rotation = setpoint.world_from_body.rotation;
        for step in 0..steps {
            let middle_s = (f64::from(step) + 0.5) * step_s;
            let rate = setpoint.rate_body + setpoint.angular_acceleration_body * middle_s;
            rotation *= UnitQuaternion::from_scaled_axis(rate * step_s);
        }
        let error = setpoint.at(500_000_000).world_from_body.rotation.angle_to(&rotation);
        assert!(error < 1e-4, "{error}");
    }

    /// Integrals of the flown controller and a body until the time runs out; poses step by step.
    fn fly(
        controller: &mut FlightController,
        body: InertialParameters<f64>,
        order: &ControlOrder,
        seconds: f64,
    ) -> Vec<RigidBodyState<f64>> {
        let system = FreeFlyer::new(body);
        let mut state = RigidBodyState::at_rest();
        let mut time_ns = 0;
        let mut states = Vec::new();
        while time_ns as f64 * 1e-9 < seconds {
            let estimate = LocalizationEstimate {
                stamp_ns: time_ns,
                arrival_ns: time_ns,
                world_from_body: state.world_from_body,
                velocity_origin_world: state.world_from_body.rotation * state.twist_body.linear,
                rate_body: state.twist_body.angular,
                acceleration_origin_body: Vector3::zeros(),
                confidence: Confidence::Good,
            };
            let wrench = controller.step(&estimate, order).wrench_body(&body.center_of_mass());
            state = MuntheKaas4.step(&system, &state, &wrench, 0.0, CONTROL_PERIOD_S).unwrap();
            time_ns += PERIOD_NS;
            states.push(state);
        }
        states
    }

    fn hold(position: [f64; 3], quaternion: [f64; 4]) -> ControlOrder {
        let setpoint = Setpoint::at_rest(0, pose(position, quaternion));
        ControlOrder::Follow { current: setpoint, next: setpoint }
    }

    #[test]
    fn translation_rings_with_a_damping_of_0_39() {
        let states = fly(
            &mut iss_controller(),
            BodyConfiguration::Iss.parameters(),
            &hold([0.2, 0.0, 0.0], [0.0, 0.0, 0.0, 1.0]),
            20.0,
        );
        let xs: Vec<f64> = states.iter().map(|state| state.world_from_body.translation.x / 0.2).collect();
        let (peak, share) =
            xs.iter().enumerate().fold((0, 0.0), |best, (i, x)| if *x > best.1 { (i, *x) } else { best });
        let peak_s = (peak + 1) as f64 * CONTROL_PERIOD_S;
        let (omega, damping) = (0.6_f64.sqrt(), 0.6 / (2.0 * 0.6_f64.sqrt()));
        assert!((omega - 0.775).abs() < 1e-3 && (damping - 0.39).abs() < 5e-3);
        let damped = omega * (1.0 - damping * damping).sqrt();
        let overshoot = (-damping * omega * core::f64::consts::PI / damped).exp();
        assert!((peak_s - core::f64::consts::PI / damped).abs() < 0.05, "{peak_s} s");
        assert!((share - 1.0 - overshoot).abs() < 0.005, "{share}");
    }

    #[test]
    fn rotation_settles_without_overshoot_as_of_damping_1_13() {
        let angle = 0.1_f64;
        let goal = [0.0, 0.0, (0.5 * angle).sin(), (0.5 * angle).cos()];
        let body = InertialParameters {
            first_moment: Vector3::zeros(),
            inertia_about_origin: BodyConfiguration::Iss.parameters().inertia_about_com(),
            ..BodyConfiguration::Iss.parameters()
        };
        let states = fly(&mut iss_controller(), body, &hold([0.0; 3], goal), 8.0);
        let (omega, damping) = (2.0_f64.sqrt(), 3.2 / (2.0 * 2.0_f64.sqrt()));
        let root = omega * (damping * damping - 1.0).sqrt();
        for (i, state) in states.iter().enumerate() {
            let t = (i + 1) as f64 * CONTROL_PERIOD_S;
            let decay = damping * omega;
            let analytic = 1.0 - (-decay * t).exp() * ((root * t).cosh() + decay / root * (root * t).sinh());
            let turned = state.world_from_body.rotation.angle() / angle;
            assert!((turned - analytic).abs() < 0.015, "at {t} s: {turned}, {analytic}");
        }
    }

    #[test]
    fn a_large_turn_and_move_settle_with_the_true_centre_of_mass() {
        let goal = pose([0.5, -0.3, 0.2], [0.3, -0.5, 0.4, 0.6]);
        let order = hold([0.5, -0.3, 0.2], [0.3, -0.5, 0.4, 0.6]);
        let states = fly(&mut iss_controller(), BodyConfiguration::Iss.parameters(), &order, 60.0);
        let last = states.last().unwrap();
        let error = goal.inv_mul(&last.world_from_body);
        // the integrals, with time constants of half an hour and more, hold what the way there has left in them: about a fixed
        // axis, ki / kp of the integral of the half-angle
        assert!(error.translation.vector.norm() < 1e-3, "{error}");
        let half_angle =
            |state: &RigidBodyState<f64>| goal.rotation.rotation_to(&state.world_from_body.rotation).imag().norm();
        let gathered: f64 = states.iter().map(|state| half_angle(state) * CONTROL_PERIOD_S).sum();
        let left = 2.0 * 0.002 / 4.0 * gathered;
        assert!((error.rotation.angle() - left).abs() < 0.1 * left, "{error}, {left}");
        assert!(last.twist_body.to_vector().norm() < 1e-4);
    }

    fn moving(stamp_ns: i64, speed: f64) -> LocalizationEstimate {
        LocalizationEstimate {
            world_from_body: pose([stamp_ns as f64 * 1e-9 * speed, 0.0, 0.0], [0.0, 0.0, 0.0, 1.0]),
            velocity_origin_world: Vector3::new(speed, 0.0, 0.0),
            rate_body: Vector3::zeros(),
            ..estimate(stamp_ns)
        }
    }

    #[test]
    fn a_stop_holds_the_pose_where_the_low_pass_calls_the_robot_at_rest() {
        let mut controller = iss_controller();
        let follow = hold([0.0; 3], [0.0, 0.0, 0.0, 1.0]);
        let mut time_ns = 0;
        let mut step = |controller: &mut FlightController, speed: f64, order: &ControlOrder| {
            time_ns += PERIOD_NS;
            controller.step(&moving(time_ns, speed), order)
        };
        for _ in 0..2_000 {
            assert_eq!(step(&mut controller, 0.1, &follow).status, ControlStatus::Nominal);
        }
        for _ in 0..1_000 {
            assert_eq!(step(&mut controller, 0.1, &ControlOrder::Stop).status, ControlStatus::Stopping, "moving");
        }
        // from 0.1 to 0.02 m/s the low-pass takes ln 5 time constants
        let mut waited = 0;
        let mut last = step(&mut controller, 0.0, &ControlOrder::Stop);
        while last.status == ControlStatus::Stopping {
            waited += 1;
            last = step(&mut controller, 0.0, &ControlOrder::Stop);
        }
        assert_eq!(last.status, ControlStatus::Stopped);
        let expected = -5.0_f64.ln() * CONTROL_PERIOD_S / LowPass::MEMORY.ln();
        let waited_s = f64::from(waited) * CONTROL_PERIOD_S;
        assert!((waited_s - expected).abs() < 0.05, "{waited_s} s, {expected} s");
        // held where it was, though the robot is pushed away slowly
        let latched = last.reference.world_from_body;
        for _ in 0..10 {
            let pushed = step(&mut controller, 0.001, &ControlOrder::Stop);
            assert_eq!(pushed.status, ControlStatus::Stopped);
            assert_eq!(pushed.reference.world_from_body, latched);
            assert!(pushed.position_error_world.norm() > 0.0 && pushed.wrench_about_com.force.norm() > 0.0);
        }
        // the next order is obeyed one period late, as flown
        assert_eq!(step(&mut controller, 0.0, &follow).status, ControlStatus::Stopped);
        assert_eq!(step(&mut controller, 0.0, &follow).status, ControlStatus::Nominal);
    }

    #[test]
    fn four_stops_come_before_the_stopped_status() {
        let mut controller = iss_controller();
        let statuses: Vec<ControlStatus> =
            (0..6).map(|k| controller.step(&moving(k * PERIOD_NS, 0.0), &ControlOrder::Stop).status).collect();
        assert!(statuses[..4].iter().all(|status| *status == ControlStatus::Stopping), "{statuses:?}");
        assert!(statuses[4..].iter().all(|status| *status == ControlStatus::Stopped), "{statuses:?}");
    }

    #[test]
    fn lost_confidence_idles_and_forgets() {
        let mut controller = iss_controller();
        let follow = hold([0.5, 0.0, 0.0], [0.0, 0.0, 0.0, 1.0]);
        for _ in 0..100 {
            controller.step(&estimate(0), &follow);
        }
        assert!(controller.step(&estimate(0), &follow).position_error_integrated.norm() > 1e-6);
        for confidence in [Confidence::Poor, Confidence::Lost] {
            let command = controller.step(&LocalizationEstimate { confidence, ..estimate(0) }, &follow);
            assert_eq!(command.status, ControlStatus::Idle);
            assert_eq!(command.wrench_about_com, Wrench::zero());
            assert_eq!(command.position_error_integrated, Vector3::zeros());
            assert_eq!(command.acceleration_body, Vector3::zeros());
        }
        assert_eq!(controller.step(&estimate(0), &ControlOrder::Idle).status, ControlStatus::Idle);
    }

    #[test]
    fn integrals_saturate_in_their_output_and_zero_gains_divide_to_zero() {
        let mut integral = Integral::default();
        for _ in 0..1_000 {
            assert!(integral.step(&Vector3::new(1.0, -1.0, 0.0), 0.1, true).amax() <= 0.1);
        }
        assert!((integral.0.x - 16.0).abs() < 1e-9, "the memory winds up, as flown");
        // granite: no position gains along z, no attitude gains about x and y
        let mut controller =
            FlightController::new(BodyConfiguration::Granite.parameters(), ControlGains::of(FlightSite::Granite));
        let follow = hold([0.0, 0.0, 5.0], [0.3, 0.3, 0.0, 0.9]);
        let still = LocalizationEstimate { rate_body: Vector3::zeros(), ..moving(0, 0.0) };
        let wrench = controller.step(&still, &follow).wrench_about_com;
        assert_eq!(
            wrench.to_vector().map(|entry| entry.abs() < 1e-15),
            tumble_dynamics::nalgebra::Vector6::repeat(true)
        );
    }
}
