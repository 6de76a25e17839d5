//! Flights of a body that is off by up to a factor of two, thrust that errs, sensors that are late.
//! Shared by the tests and by the long study.
#![allow(dead_code)] // each user takes its part
#![allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)] // ticks of a minute

use std::f64::consts::{FRAC_PI_2, TAU};

use crate::random::Random;
use tumble_identification::dynamics::{
    FreeFlyer, InertialParameters, Integrator, MuntheKaas4, PoseReference, PoseTracker, RigidBodyState,
};
use tumble_identification::lie::{Pose, Twist, Wrench};
use tumble_identification::nalgebra::{Matrix3, SMatrix, SVector, Translation3, UnitQuaternion, Vector3, Vector6};
use tumble_identification::recursive::{FlightEstimator, FlightEstimatorSettings, FlightMeasurement, MotionNoise};
use tumble_identification::{Estimate, StandardDeviations};

/// Control period: 62.5 Hz.
pub const STEP_NS: i64 = 16_000_000;
pub const STEP_S: f64 = 0.016;
pub const LEG_S: f64 = 24.0;
/// Mass and moments that are believed at first.
const MASS_KG: f64 = 9.5838;
const INERTIA: [f64; 3] = [0.1534, 0.1427, 0.1623];
/// The believed body is taken over this often.
const REVISION_TICKS: u32 = 125;
const LIMITS: [f64; 2] = [0.05, 0.5];

/// What is varied between series of flights.
#[derive(Clone, Copy, Debug)]
pub struct Conditions {
    pub ticks_per_measurement: u32,
    /// Truth of the drift of the wrench.
    pub drift_time_s: f64,
    /// Relative error of each nozzle.
    pub nozzle: f64,
    /// Additive errors: torque, force.
    pub drift: [f64; 2],
    pub wiggle_rad: f64,
    pub latency_s: [f64; 2],
    /// Whether the truth is drawn about the belief; otherwise it is the belief.
    pub off: bool,
    pub planar: bool,
}

impl Conditions {
    pub fn usual() -> Self {
        Self {
            ticks_per_measurement: 1,
            drift_time_s: 30.0,
            nozzle: 0.01,
            drift: [2e-4, 2e-3],
            wiggle_rad: 5.0_f64.to_radians(),
            latency_s: [0.1, 0.2],
            off: true,
            planar: false,
        }
    }
}

pub fn noise() -> MotionNoise {
    MotionNoise {
        attitude_rad: 4e-3,
        position_m: 2e-3,
        rate_rad_s: 1e-3,
        velocity_m_s: 1e-3,
        acceleration_m_s2: 1.0,
        torque_n_m: 1e-5,
        force_n: 1e-4,
        drift: SVector::zeros(),
    }
}

pub fn settings() -> FlightEstimatorSettings {
    FlightEstimatorSettings::new(noise())
}

/// The belief before a flight: spread as the truth is drawn.
pub fn prior() -> Estimate {
    let parameters =
        InertialParameters::about_com(MASS_KG, Vector3::zeros(), Matrix3::from_diagonal(&Vector3::from(INERTIA)));
    let [x, y, z] = INERTIA;
    let (relative, product) = (0.55, 0.03);
    let deviation = SVector::<f64, 10>::from([
        0.4 * MASS_KG,
        0.05 * MASS_KG,
        0.05 * MASS_KG,
        0.05 * MASS_KG,
        relative * x,
        product,
        product,
        relative * y,
        product,
        relative * z,
    ]);
    let std = StandardDeviations {
        mass_kg: deviation[0],
        center_of_mass_m: Vector3::repeat(0.05),
        inertia_about_com_kg_m2: Matrix3::zeros(),
    };
    Estimate { parameters, covariance: SMatrix::from_diagonal(&deviation.map(|s| s * s)), std, lmi_active: false }
}

fn body(random: &mut Random, planar: bool) -> InertialParameters<f64> {
    let mass = MASS_KG * random.magnitude(0.5, 2.0);
    let mut center = random.direction() * random.uniform(0.0, 0.15);
    let moments = loop {
        let [x, y, z] = INERTIA.map(|moment| moment * random.magnitude(0.5, 3.0));
        if x + y > z && y + z > x && z + x > y {
            break Vector3::new(x, y, z);
        }
    };
    let mut tilt = UnitQuaternion::from_scaled_axis(random.direction() * random.uniform(0.0, 0.3));
    if planar {
        center.z = 0.0;
        tilt = UnitQuaternion::identity();
    }
    let turn = tilt.to_rotation_matrix().into_inner();
    InertialParameters::about_com(mass, center, turn * Matrix3::from_diagonal(&moments) * turn.transpose())
}

/// Six pairs of nozzles, one pair along each axis on each side of it; each nozzle has its own factor.
struct Nozzles {
    factors: [[f64; 2]; 6],
}

/// Arm of the nozzles about the axis they turn, m.
const ARM_M: f64 = 0.1;

impl Nozzles {
    /// What comes of a wrench: the thrusts of the six places are determined by it.
    fn realized(&self, wanted: &Wrench<f64>) -> Wrench<f64> {
        let (mut force, mut torque) = (Vector3::zeros(), Vector3::zeros());
        for axis in 0..3 {
            // Thrust along `axis` at an arm along the next axis turns about the one after that, negatively.
            let about = (axis + 2) % 3;
            let (f, t) = (wanted.force[axis], -wanted.torque[about] / ARM_M);
            for (side, sign) in [(0, 1.0), (1, -1.0)] {
                let thrust = 0.5 * (f + sign * t);
                let [forward, backward] = self.factors[2 * axis + side];
                let thrust = thrust * if thrust > 0.0 { forward } else { backward };
                force[axis] += thrust;
                torque[about] -= sign * thrust * ARM_M;
            }
        }
        Wrench::new(torque, force)
    }
}

/// Rest to rest from place to place, turning about z, with a wiggle about all axes that begins and ends at rest.
struct Reference {
    places: Vec<Vector3<f64>>,
    yaw: Vec<f64>,
    wiggle: f64,
    planar: bool,
}

impl Reference {
    fn pose(&self, t: f64) -> Pose<f64> {
        let leg = ((t / LEG_S).max(0.0) as usize).min(self.places.len() - 2);
        let s = (t / LEG_S - leg as f64).clamp(0.0, 1.0);
        let blend = s * s * s * (10.0 - 15.0 * s + 6.0 * s * s);
        let place = self.places[leg] * (1.0 - blend) + self.places[leg + 1] * blend;
        let yaw = self.yaw[leg] * (1.0 - blend) + self.yaw[leg + 1] * blend;
        // 8 s, and half a turn apart in phase by thirds.
        let window = (16.0 * s * s * (1.0 - s) * (1.0 - s)).min(1.0);
        let w = |phase: f64, period: f64| self.wiggle * window * (TAU * (t / period + phase)).sin();
        let tilt = if self.planar {
            Vector3::new(0.0, 0.0, w(0.0, 8.0))
        } else {
            Vector3::new(w(0.0, 8.0), w(0.33, 7.0), w(0.67, 9.0))
        };
        let rotation =
            UnitQuaternion::from_axis_angle(&Vector3::z_axis(), yaw) * UnitQuaternion::from_scaled_axis(tilt);
        Pose::from_parts(Translation3::from(place), rotation)
    }

    /// By differences: the reference need not be exact, only smooth.
    fn at(&self, t: f64) -> PoseReference {
        let h = 1e-3;
        let twist = |t: f64| {
            let (before, after) = (self.pose(t - h), self.pose(t + h));
            let turn = (before.rotation.inverse() * after.rotation).scaled_axis() / (2.0 * h);
            let velocity = (after.translation.vector - before.translation.vector) / (2.0 * h);
            (turn, velocity)
        };
        let pose = self.pose(t);
        let body_from_world = pose.rotation.inverse();
        let (turn, velocity) = twist(t);
        let ((turn0, velocity0), (turn1, velocity1)) = (twist(t - h), twist(t + h));
        PoseReference {
            state: RigidBodyState { world_from_body: pose, twist_body: Twist::new(turn, body_from_world * velocity) },
            acceleration: tumble_identification::dynamics::BodyAcceleration {
                angular_acceleration_body: (turn1 - turn0) / (2.0 * h),
                acceleration_origin_body: body_from_world * ((velocity1 - velocity0) / (2.0 * h)),
            },
        }
    }
}

/// A measurement under way.
#[derive(Clone, Copy, Debug)]
pub struct Underway {
    pub arrives_ns: i64,
    pub measurement: FlightMeasurement,
}

/// A flight and its estimator.
pub struct Flight {
    random: Random,
    conditions: Conditions,
    nozzles: Nozzles,
    reference: Reference,
    drift: Vector6<f64>,
    pub body: InertialParameters<f64>,
    pub state: RigidBodyState<f64>,
    believed: InertialParameters<f64>,
    pub tick: u32,
    pub underway: Vec<Underway>,
    pub estimator: FlightEstimator,
    /// The true motion at the ticks.
    pub truth: Vec<RigidBodyState<f64>>,
    pub measured: Vec<FlightMeasurement>,
    pub acted: Vec<Wrench<f64>>,
}

impl Flight {
    pub fn new(seed: u64, conditions: Conditions) -> Self {
        Self::with(seed, conditions, settings())
    }

    pub fn with(seed: u64, conditions: Conditions, mut settings: FlightEstimatorSettings) -> Self {
        let mut random = Random::new(seed);
        let drawn = body(&mut random, conditions.planar);
        let body = if conditions.off { drawn } else { prior().parameters };
        let nozzle = conditions.nozzle;
        let factors = [[0.0; 2]; 6].map(|pair| pair.map(|_| 1.0 + nozzle * random.normal()));
        let mut places = vec![Vector3::zeros()];
        let mut yaw = vec![0.0];
        for leg in 0..5 {
            let mut direction = random.direction();
            if conditions.planar {
                direction.z = 0.0;
                direction = direction.normalize();
            }
            places.push(places[leg] + direction * random.uniform(0.8, 1.2));
            yaw.push(if leg % 2 == 0 { FRAC_PI_2 } else { 0.0 });
        }
        let reference = Reference { places, yaw, wiggle: conditions.wiggle_rad, planar: conditions.planar };
        let [torque, force] = conditions.drift;
        let drift = stacked(random.normal3(torque), random.normal3(force));
        let start = RigidBodyState { world_from_body: reference.pose(0.0), twist_body: Twist::zero() };
        settings.planar = conditions.planar;
        let estimator = FlightEstimator::try_new(settings, start, 0, &prior()).unwrap();
        Self {
            random,
            conditions,
            nozzles: Nozzles { factors },
            reference,
            drift,
            body,
            state: start,
            believed: prior().parameters,
            tick: 0,
            underway: Vec::new(),
            estimator,
            truth: vec![start],
            measured: Vec::new(),
            acted: Vec::new(),
        }
    }

    pub fn now_ns(&self) -> i64 {
        i64::from(self.tick) * STEP_NS
    }

    /// One nozzle gives nothing from now on.
    pub fn lose_a_nozzle(&mut self) {
        self.nozzles.factors[2][0] = 0.0;
    }

    /// One control period: what has arrived is taken, a wrench is chosen and acts.
    pub fn step(&mut self) {
        let now_ns = self.now_ns();
        if self.tick.is_multiple_of(self.conditions.ticks_per_measurement) {
            let measurement = self.measure();
            let [low, high] = self.conditions.latency_s;
            let latency_s = self.random.uniform(low, high);
            self.measured.push(measurement);
            self.underway.push(Underway { arrives_ns: now_ns + (latency_s * 1e9) as i64, measurement });
        }
        // In the order of arrival.
        self.underway.sort_by_key(|underway| underway.arrives_ns);
        while self.underway.first().is_some_and(|first| first.arrives_ns <= now_ns) {
            let Underway { measurement, .. } = self.underway.remove(0);
            self.estimator.measured(&measurement);
        }
        if self.tick.is_multiple_of(REVISION_TICKS) {
            self.believed = self.estimator.estimate().parameters;
        }
        let tracker = PoseTracker::critically_damped(FreeFlyer::new(self.believed), 0.6, 0.3);
        let wanted = tracker.wrench_body(&self.estimator.state_at(now_ns), &self.reference.at(now_ns as f64 * 1e-9));
        let mut commanded = wanted.to_vector();
        for (i, component) in commanded.iter_mut().enumerate() {
            *component = component.clamp(-LIMITS[i / 3], LIMITS[i / 3]);
            if self.conditions.planar && [0, 1, 5].contains(&i) {
                *component = 0.0;
            }
        }
        self.act(&commanded.into());
    }

    /// The truth under a believed wrench for one period.
    pub fn act(&mut self, commanded: &Wrench<f64>) {
        let now_ns = self.now_ns();
        let mut applied = self.nozzles.realized(commanded).to_vector() + self.drift;
        let mut body = self.body;
        if self.conditions.planar {
            for i in [0, 1, 5] {
                applied[i] = 0.0;
            }
            body.first_moment.z = 0.0;
        }
        self.state = MuntheKaas4.step(&FreeFlyer::new(body), &self.state, &applied.into(), 0.0, STEP_S).unwrap();
        let keep = (-STEP_S / self.conditions.drift_time_s).exp();
        let [torque, force] = self.conditions.drift.map(|deviation| deviation * (1.0 - keep * keep).sqrt());
        self.drift = self.drift * keep + stacked(self.random.normal3(torque), self.random.normal3(force));
        self.estimator.acted(now_ns, now_ns + STEP_NS, commanded);
        self.acted.push(*commanded);
        self.tick += 1;
        self.truth.push(self.state);
    }

    fn measure(&mut self) -> FlightMeasurement {
        let noise = noise();
        let pose = &self.state.world_from_body;
        let turn = UnitQuaternion::from_scaled_axis(self.random.normal3(noise.attitude_rad));
        let place = pose.translation.vector + self.random.normal3(noise.position_m);
        FlightMeasurement {
            stamp_ns: self.now_ns(),
            world_from_body: Pose::from_parts(place.into(), pose.rotation * turn),
            rate_body: Some(self.state.twist_body.angular + self.random.normal3(noise.rate_rad_s)),
            velocity_origin_world: Some(
                pose.rotation * self.state.twist_body.linear + self.random.normal3(noise.velocity_m_s),
            ),
        }
    }

    /// Flies until this time.
    pub fn fly_until(&mut self, seconds: f64) {
        while self.now_ns() as f64 * 1e-9 < seconds {
            self.step();
        }
    }

    /// Estimated less true parameters with their covariance.
    pub fn account(&self) -> Account {
        self.account_of(&self.estimator.estimate())
    }

    /// The same of anybody's estimate.
    pub fn account_of(&self, estimate: &Estimate) -> Account {
        let estimate = *estimate;
        let (found, truth) = (estimate.parameters, self.body);
        let (found_inertia, inertia) = (found.inertia_about_com(), truth.inertia_about_com());
        let center = found.center_of_mass() - truth.center_of_mass();
        let entries = [(0, 0), (1, 1), (2, 2), (0, 1), (0, 2), (1, 2)];
        let mut errors = [0.0; 10];
        let mut deviations = [0.0; 10];
        errors[0] = (found.mass - truth.mass) / truth.mass;
        deviations[0] = estimate.std.mass_kg / truth.mass;
        for i in 0..3 {
            errors[1 + i] = center[i];
            deviations[1 + i] = estimate.std.center_of_mass_m[i];
        }
        for (k, (i, j)) in entries.into_iter().enumerate() {
            let unit = (inertia[(i, i)] * inertia[(j, j)]).sqrt();
            errors[4 + k] = (found_inertia[(i, j)] - inertia[(i, j)]) / unit;
            deviations[4 + k] = estimate.std.inertia_about_com_kg_m2[(i, j)] / unit;
        }
        let error = found.to_vector() - truth.to_vector();
        let nees = tumble_identification::statistics::normalized_squared_error(&error, &estimate.covariance);
        Account { errors, deviations, nees: nees.unwrap_or(f64::INFINITY), estimate }
    }
}

/// Errors of mass (relative), centre of mass (m), inertia about it (relative): xx, yy, zz, xy, xz, yz.
#[derive(Clone, Copy, Debug)]
pub struct Account {
    pub errors: [f64; 10],
    pub deviations: [f64; 10],
    pub nees: f64,
    pub estimate: Estimate,
}

fn stacked(torque: Vector3<f64>, force: Vector3<f64>) -> Vector6<f64> {
    Wrench::new(torque, force).to_vector()
}
