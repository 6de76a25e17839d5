//! The slalom of the station on a fixed reference, with the estimator in the loop: one flight.
//!
//! Rest-to-rest quintics of 24 s through four places, a quarter turn during the last leg, 8 s of holding. The translation law is
//! written here: acceleration of the reference less feedback, at the believed centre of mass, times the believed mass; the torque
//! is that of [`AttitudeController`]. Both take all they know of the body from the belief.

use tumble_dynamics::{
    BodyAcceleration, FreeFlyer, InertialParameters, Integrator, MuntheKaas4, PoseReference, RigidBodyState,
};
use tumble_identification::Estimate;
use tumble_identification::recursive::{FlightEstimator, FlightEstimatorSettings, FlightMeasurement, MotionNoise};
use tumble_identification::statistics::normalized_squared_error;
use tumble_lie::{Pose, Twist, Wrench};
use tumble_planning::control::{AttitudeController, AttitudeGains, AttitudeLaw};

use crate::Failure;
use crate::flight_estimator::flight_scenario;
use crate::random::Random;
use nalgebra::{Matrix3, Translation3, UnitQuaternion, Vector3};
use std::f64::consts::FRAC_PI_2;

pub const LEG_S: f64 = 24.0;
pub const PLACES: [[f64; 3]; 4] = [[10.8, -9.6, 4.8], [10.44, -9.0, 4.8], [11.06, -8.5, 5.0], [10.8, -7.75, 5.2]];
pub const LEGS: usize = PLACES.len() - 1;
pub const HOLD_S: f64 = 8.0;
/// Attitude is controlled at 50 Hz, translation at 5 Hz, where measurements come, too.
pub const STEP_NS: i64 = 20_000_000;
pub const STEP_S: f64 = 0.02;
pub const STEPS_PER_DECISION: usize = 10;
pub const STEPS_PER_BELIEF: usize = 100;
pub const MASS_KG: f64 = 9.58;
pub const INERTIA: [f64; 3] = [0.153, 0.143, 0.162];
const STIFFNESS: f64 = 0.25;
const DAMPING: f64 = 2.0;
pub const ATTITUDE: AttitudeGains = AttitudeGains { stiffness_n_m: 0.1, damping_n_m_s: 0.2 };
/// Share of a drifting disturbance that is left after 0.2 s, and its sizes, N and N m.
const KEPT: f64 = 0.99;
const DRIFT: [f64; 2] = [2e-3, 2e-4];

/// What the controller knows of the body.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Knowledge {
    /// What was believed at the start.
    Prior,
    /// What the estimator says, offered every 2 s from the second leg on.
    Learned,
    /// The same from the start.
    LearnedAtOnce,
    /// All.
    True,
}

/// Which state the controller sees.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Seen {
    /// The true one and the error of the last measurement.
    Measured,
    /// The estimator's.
    Filtered,
}

/// One standard deviation per axis: m, m/s, rad, rad/s.
pub type Sensing = [f64; 4];

/// What became of a flight: of the last leg, the holding left out.
#[derive(Clone, Copy, Debug)]
pub struct Flown {
    /// Root mean square distance, m, and angle, rad.
    pub position_m: f64,
    pub attitude_rad: f64,
    pub impulse_n_s: f64,
    /// Root mean square error of the state shown, of position, m, and velocity, m/s.
    pub shown: [f64; 2],
    /// Errors at its start: mass as a share, centre of mass m, largest error of a moment as a share.
    pub errors: [f64; 3],
    /// Standard deviation of the mass then, as a share, and the estimate of it, kg.
    pub mass: [f64; 2],
    /// Of the ten parameters, at its end.
    pub nees: f64,
    pub diverged: bool,
    /// Whether the estimator ever doubted that the body is the one it was; here nobody answers.
    pub doubtful: bool,
}

/// The true body of a seed, and the random numbers that follow.
pub fn drawn(seed: u64) -> (InertialParameters<f64>, Random) {
    let mut random = Random::new(1000 + seed);
    let mass = MASS_KG * random.magnitude(0.5, 2.0);
    let center = random.direction() * random.uniform(0.0, 0.15);
    let moments = loop {
        let moments = INERTIA.map(|moment| moment * random.magnitude(0.5, 3.0));
        if 2.0 * moments.iter().copied().fold(0.0, f64::max) <= moments.iter().sum::<f64>() {
            break Vector3::from(moments);
        }
    };
    let tilt = random.direction() * random.uniform(0.0, 0.3);
    let turn = UnitQuaternion::from_scaled_axis(tilt).to_rotation_matrix().into_inner();
    let inertia = turn * Matrix3::from_diagonal(&moments) * turn.transpose();
    (InertialParameters::about_com(mass, center, inertia), random)
}

/// What is believed at the start: spread as the truth is drawn.
pub fn prior() -> Estimate {
    let parameters =
        InertialParameters::about_com(MASS_KG, Vector3::zeros(), Matrix3::from_diagonal(&Vector3::from(INERTIA)));
    Estimate { parameters, ..flight_scenario::prior() }
}

/// Share of a leg of so many seconds at a time, and its derivatives, 1/s and 1/s^2.
pub fn quintic(t: f64, leg_s: f64) -> [f64; 3] {
    let s = (t / leg_s).clamp(0.0, 1.0);
    [
        s * s * s * (10.0 - 15.0 * s + 6.0 * s * s),
        30.0 * s * s * (1.0 - s) * (1.0 - s) / leg_s,
        60.0 * s * (1.0 - s) * (1.0 - 2.0 * s) / (leg_s * leg_s),
    ]
}

/// Which leg it is at a time, and how long since it began, s; legs that are over are the last one.
pub fn leg_at(t: f64, leg_s: f64) -> (usize, f64) {
    let leg = ((t / leg_s) as usize).min(LEGS - 1);
    (leg, t - leg as f64 * leg_s)
}

/// Where the body should be at shares of a leg's way and of its turn, each with its derivatives.
pub fn on_leg(leg: usize, way: [f64; 3], turned: [f64; 3]) -> PoseReference {
    let (from, to) = (Vector3::from(PLACES[leg]), Vector3::from(PLACES[leg + 1]));
    let [angle, rate, turning] = turned.map(|share| if leg == LEGS - 1 { FRAC_PI_2 * share } else { 0.0 });
    let rotation = UnitQuaternion::from_axis_angle(&Vector3::z_axis(), angle - FRAC_PI_2);
    let body_from_world = rotation.inverse();
    let [share, speed, acceleration] = way;
    PoseReference {
        state: RigidBodyState {
            world_from_body: Pose::from_parts(Translation3::from(from + (to - from) * share), rotation),
            twist_body: Twist::new(Vector3::z() * rate, body_from_world * ((to - from) * speed)),
        },
        acceleration: BodyAcceleration {
            angular_acceleration_body: Vector3::z() * turning,
            acceleration_origin_body: body_from_world * ((to - from) * acceleration),
        },
    }
}

/// Where the body should be.
pub fn reference(t: f64) -> PoseReference {
    let (leg, t) = leg_at(t, LEG_S);
    let share = quintic(t, LEG_S);
    on_leg(leg, share, share)
}

/// A component within its limit.
pub fn cut(component: f64, limit: f64) -> f64 {
    component.clamp(-limit, limit)
}

/// Position and velocity of a point of the body, world axes.
fn point(state: &RigidBodyState<f64>, point_body: &Vector3<f64>) -> [Vector3<f64>; 2] {
    let pose = &state.world_from_body;
    let velocity = state.twist_body.linear + state.twist_body.angular.cross(point_body);
    [pose.translation.vector + pose.rotation * point_body, pose.rotation * velocity]
}

/// The force of the translation law, world axes.
fn force(body: &InertialParameters<f64>, state: &RigidBodyState<f64>, wanted: &PoseReference) -> Vector3<f64> {
    let center = body.center_of_mass();
    let [position, velocity] = point(state, &center);
    let [wanted_position, wanted_velocity] = point(&wanted.state, &center);
    let (rate, acceleration) = (&wanted.state.twist_body.angular, &wanted.acceleration);
    let of_center = acceleration.acceleration_origin_body
        + acceleration.angular_acceleration_body.cross(&center)
        + rate.cross(&rate.cross(&center));
    let wanted_acceleration = wanted.state.world_from_body.rotation * of_center;
    (wanted_acceleration + (wanted_position - position) * STIFFNESS + (wanted_velocity - velocity) * DAMPING)
        * body.mass
}

/// A measurement's error: position, velocity, rotation vector, rate.
struct Errors([Vector3<f64>; 4]);

impl Errors {
    fn of(&self, state: &RigidBodyState<f64>) -> RigidBodyState<f64> {
        let [position, velocity, turn, rate] = &self.0;
        let pose = &state.world_from_body;
        let rotation = pose.rotation * UnitQuaternion::from_scaled_axis(*turn);
        let world_velocity = pose.rotation * state.twist_body.linear + velocity;
        RigidBodyState {
            world_from_body: Pose::from_parts((pose.translation.vector + position).into(), rotation),
            twist_body: Twist::new(state.twist_body.angular + rate, rotation.inverse() * world_velocity),
        }
    }
}

fn estimator(sensing: &Sensing, start: RigidBodyState<f64>) -> Result<FlightEstimator, Failure> {
    let [position_m, velocity_m_s, attitude_rad, rate_rad_s] = *sensing;
    let noise = MotionNoise { position_m, velocity_m_s, attitude_rad, rate_rad_s, ..flight_scenario::noise() };
    let mut settings = FlightEstimatorSettings::new(noise);
    settings.wrench.period_s = STEP_S;
    FlightEstimator::try_new(settings, start, 0, &prior()).map_err(|error| Failure::BadInput(error.to_string()))
}

/// The true body with what pushes and measures it, and the estimator that looks on.
pub struct Flight {
    pub body: InertialParameters<f64>,
    pub state: RigidBodyState<f64>,
    pub estimator: FlightEstimator,
    sensing: Sensing,
    random: Random,
    errors: Errors,
    disturbance: [Vector3<f64>; 2],
}

impl Flight {
    /// Of a seed, from a state.
    pub fn begin(seed: u64, sensing: &Sensing, state: RigidBodyState<f64>) -> Result<Self, Failure> {
        let (body, random) = drawn(seed);
        let errors = Errors([Vector3::zeros(); 4]);
        let estimator = estimator(sensing, state)?;
        Ok(Self { body, state, estimator, sensing: *sensing, random, errors, disturbance: [Vector3::zeros(); 2] })
    }

    /// A new measurement reaches the estimator, and what disturbs drifts on.
    pub fn look(&mut self, now_ns: i64) {
        self.errors = Errors(self.sensing.map(|deviation| self.random.normal3(deviation)));
        for (part, deviation) in self.disturbance.iter_mut().zip(DRIFT) {
            *part = *part * KEPT + self.random.normal3(deviation * (1.0 - KEPT * KEPT).sqrt());
        }
        let measured = self.measured();
        self.estimator.measured(&FlightMeasurement {
            stamp_ns: now_ns,
            world_from_body: measured.world_from_body,
            rate_body: Some(measured.twist_body.angular),
            velocity_origin_world: Some(measured.world_from_body.rotation * measured.twist_body.linear),
        });
    }

    /// The true state with the error of the last measurement.
    pub fn measured(&self) -> RigidBodyState<f64> {
        self.errors.of(&self.state)
    }

    /// A step under a wrench of the body's own.
    pub fn act(&mut self, now_ns: i64, wrench: &Wrench<f64>) -> Result<(), Failure> {
        self.estimator.acted(now_ns, now_ns + STEP_NS, wrench);
        // the force that drifts acts at the centre of mass
        let [force_outside, torque_outside] = &self.disturbance;
        let push = self.state.world_from_body.rotation.inverse() * force_outside;
        let outside = Wrench::new(torque_outside + self.body.center_of_mass().cross(&push), push);
        let flyer = FreeFlyer::new(self.body);
        self.state = MuntheKaas4
            .step(&flyer, &self.state, &(*wrench + outside), now_ns as f64 * 1e-9, STEP_S)
            .map_err(|error| Failure::BadInput(error.to_string()))?;
        Ok(())
    }
}

/// Flies a seed.
pub fn fly(
    seed: u64,
    sensing: &Sensing,
    knowledge: Knowledge,
    seen: Seen,
    limits: &[Vector3<f64>; 2],
) -> Result<Flown, Failure> {
    let mut flight = Flight::begin(seed, sensing, reference(0.0).state)?;
    let body = flight.body;
    let mut believed = if knowledge == Knowledge::True { body } else { prior().parameters };
    let mut force_world = Vector3::zeros();
    let (mut squares, mut shown_squares, mut count, mut impulse_n_s) = ([0.0; 2], [0.0; 2], 0.0, 0.0);
    let (mut at_leg, mut nees, mut diverged, mut doubtful) = (None, f64::NAN, false, false);
    let last = [(LEGS - 1) as f64 * LEG_S, LEGS as f64 * LEG_S];
    let steps = ((last[1] + HOLD_S) / STEP_S).round() as usize;
    for k in 0..steps {
        let (now_ns, t) = (k as i64 * STEP_NS, k as f64 * STEP_S);
        let wanted = reference(t);
        if k % STEPS_PER_DECISION == 0 {
            flight.look(now_ns);
        }
        let is_offered = match knowledge {
            Knowledge::Prior | Knowledge::True => false,
            Knowledge::Learned => t >= LEG_S,
            Knowledge::LearnedAtOnce => true,
        };
        if is_offered && k % STEPS_PER_BELIEF == 0 {
            believed = flight.estimator.estimate().parameters;
        }
        let shown = match seen {
            Seen::Measured => flight.measured(),
            Seen::Filtered => flight.estimator.state_at(now_ns),
        };
        let misses = {
            let [truth, shown] = [&flight.state, &shown].map(|state| point(state, &Vector3::zeros()));
            [(shown[0] - truth[0]).norm_squared(), (shown[1] - truth[1]).norm_squared()]
        };
        if k % STEPS_PER_DECISION == 0 {
            force_world = force(&believed, &shown, &wanted);
        }
        let force_body = (shown.world_from_body.rotation.inverse() * force_world).zip_map(&limits[0], cut);
        let attitude = AttitudeController {
            law: AttitudeLaw::Geometric,
            gains: ATTITUDE,
            body: believed,
            torque_limit_n_m: f64::INFINITY,
        };
        let torque = attitude.torque_body(&shown, &wanted, &force_body).torque_n_m.zip_map(&limits[1], cut);
        flight.act(now_ns, &Wrench::new(torque, force_body))?;
        let (state, health) = (&flight.state, flight.estimator.health());
        diverged |= health.diverged;
        doubtful |= health.body_doubtful;
        if t >= last[0] && t < last[1] {
            if at_leg.is_none() {
                at_leg = Some(account(&flight.estimator.estimate(), &body));
            }
            let next = reference(t + STEP_S).state.world_from_body;
            let away = state.world_from_body.translation.vector - next.translation.vector;
            let angle = state.world_from_body.rotation.angle_to(&next.rotation);
            squares = [squares[0] + away.norm_squared(), squares[1] + angle * angle];
            shown_squares = [shown_squares[0] + misses[0], shown_squares[1] + misses[1]];
            impulse_n_s += force_body.abs().sum() * STEP_S;
            count += 1.0;
            if t + STEP_S >= last[1] - 0.5 * STEP_S {
                let estimate = flight.estimator.estimate();
                let error = estimate.parameters.to_vector() - body.to_vector();
                nees = normalized_squared_error(&error, &estimate.covariance).unwrap_or(f64::INFINITY);
            }
        }
    }
    let (errors, mass) = at_leg.unwrap_or(([f64::NAN; 3], [f64::NAN; 2]));
    let [position_m, attitude_rad] = squares.map(|sum: f64| (sum / count).sqrt());
    let shown = shown_squares.map(|sum: f64| (sum / count).sqrt());
    Ok(Flown { position_m, attitude_rad, impulse_n_s, shown, errors, mass, nees, diverged, doubtful })
}

/// What is known.
fn account(estimate: &Estimate, body: &InertialParameters<f64>) -> ([f64; 3], [f64; 2]) {
    let found = &estimate.parameters;
    let (inertia, truth) = (found.inertia_about_com(), body.inertia_about_com());
    let moments = (0..3).map(|i| (inertia[(i, i)] / truth[(i, i)] - 1.0).abs()).fold(0.0, f64::max);
    let center = (found.center_of_mass() - body.center_of_mass()).norm();
    let mass = (found.mass / body.mass - 1.0).abs();
    ([mass, center, moments], [estimate.std.mass_kg / found.mass, found.mass])
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Velocity and acceleration are the slopes of place and velocity.
    #[test]
    fn the_reference_is_consistent_and_rests_at_its_places() {
        let h = 1e-4;
        for k in 0..160 {
            let t = 0.51 + 0.5 * f64::from(k);
            let [before, at, after] = [reference(t - h), reference(t), reference(t + h)];
            let world = |r: &PoseReference| point(&r.state, &Vector3::zeros())[1];
            let place = |r: &PoseReference| r.state.world_from_body.translation.vector;
            assert!(((place(&after) - place(&before)) / (2.0 * h) - world(&at)).norm() < 1e-8, "{t}");
            let slope = (world(&after) - world(&before)) / (2.0 * h);
            let acceleration = at.state.world_from_body.rotation * at.acceleration.acceleration_origin_body;
            assert!((slope - acceleration).norm() < 1e-7, "{t} {slope} {acceleration}");
            let turned = before.state.world_from_body.rotation.rotation_to(&after.state.world_from_body.rotation);
            assert!((turned.scaled_axis() / (2.0 * h) - at.state.twist_body.angular).norm() < 1e-7, "{t}");
        }
        for (k, place) in PLACES.iter().enumerate() {
            let there = reference(LEG_S * k as f64).state;
            assert!((there.world_from_body.translation.vector - Vector3::from(*place)).norm() < 1e-12);
            assert!(there.twist_body.to_vector().norm() < 1e-12);
        }
    }

    /// On the reference, force and torque of the true body are its inverse dynamics.
    #[test]
    fn the_law_of_the_true_body_is_its_inverse_dynamics() {
        let (body, _) = drawn(3);
        let wanted = reference(61.0);
        let needed = FreeFlyer::new(body).inverse(&wanted.state.twist_body, &wanted.acceleration);
        let found = wanted.state.world_from_body.rotation.inverse() * force(&body, &wanted.state, &wanted);
        // the acceleration of the origin is the inertial one
        assert!((found - needed.force).norm() < 1e-12, "{found} {}", needed.force);
    }
}
