//! A free flyer that picks up mass in flight, as a filter sees it. Shared by the test and by the long study.
#![allow(dead_code)] // each user takes its part

use crate::random::Random;
use tumble_identification::dynamics::{
    FreeFlyer, InertialParameters, Integrator, LogCholesky, MuntheKaas4, RigidBodyState,
};
use tumble_identification::estimator::EstimatorError;
use tumble_identification::lie::{Manifold, Pose, Wrench};
use tumble_identification::nalgebra::{Matrix3, SMatrix, SVector, UnitQuaternion, Vector3};
use tumble_identification::recursive::{
    ChangeDetector, ChangeSettings, ExtendedKalmanFilter, JointMotion, JointObservation, JointState, MotionNoise, Watch,
};

/// 62.5 Hz.
pub const STEP_S: f64 = 0.016;

fn noise() -> MotionNoise {
    MotionNoise {
        attitude_rad: 1e-3,
        position_m: 1e-3,
        rate_rad_s: 1e-3,
        velocity_m_s: 1e-3,
        acceleration_m_s2: 1e-2,
        torque_n_m: 1e-4,
        force_n: 1e-3,
        // A filter that believed in its body for ever would in the end take its own linearisation for a change.
        drift: SVector::from([3e-4, 1e-5, 1e-5, 1e-5, 3e-4, 3e-4, 3e-4, 1e-5, 1e-5, 1e-5]),
    }
}

pub type Filter = ExtendedKalmanFilter<JointMotion, JointState, 22, 15, 10>;
pub type Widen = fn(&Filter, u32) -> Result<Filter, EstimatorError>;
/// A window of nearly three seconds.
pub type Detector = ChangeDetector<Filter, Widen, 10, 36>;

/// Mostly a change of the mass alone, which is what a grasp at the centre looks like first; every fourth one of everything.
#[allow(clippy::unnecessary_wraps)] // a constructor may fail
fn widened(filter: &Filter, candidate: u32) -> Result<Filter, EstimatorError> {
    if !candidate.is_multiple_of(4) {
        return Ok(filter.after_a_jump_of_mass(0.1));
    }
    Ok(filter.after_a_jump(&SVector::from([0.1, 5e-3, 5e-3, 5e-3, 0.05, 0.05, 0.05, 5e-3, 5e-3, 5e-3])))
}

pub struct Flight {
    random: Random,
    body: InertialParameters<f64>,
    state: RigidBodyState<f64>,
    updates: u32,
    /// Of the force; the torque is a tenth of it, in metres.
    pub force_n: f64,
    pub detector: Detector,
}

impl Flight {
    /// A body of 9.4 kg, known to some parts in a thousand.
    pub fn new(seed: u64, force_n: f64) -> Self {
        let mut random = Random::new(seed);
        let inertia = Matrix3::new(0.153, 0.004, -0.006, 0.004, 0.143, 0.003, -0.006, 0.003, 0.162);
        let body = InertialParameters::about_com(9.4, Vector3::new(0.031, -0.017, 0.052), inertia);
        let motion = RigidBodyState::at_rest();
        let truth = JointState { motion, body: LogCholesky::try_from_parameters(&body).unwrap() };
        let deviation = SVector::<f64, 22>::from_fn(|i, _| match i {
            0..=11 => 1e-3,
            12 | 16..=18 => 3e-3,
            _ => 3e-4,
        });
        let off = SVector::from_fn(|i, _| deviation[i] * random.normal());
        let covariance = SMatrix::from_diagonal(&deviation.map(|s| s * s));
        let model = JointMotion { noise: noise(), gravity_world: Vector3::zeros() };
        let filter = ExtendedKalmanFilter::new(model, truth.oplus(&off), covariance);
        // Four hours.
        let settings = ChangeSettings { spacing: 5, updates_between_false_alarms: 900_000.0 };
        let detector = ChangeDetector::try_new(filter, widened as Widen, settings).unwrap();
        Self { random, body, state: motion, updates: 0, force_n, detector }
    }

    /// The mass is multiplied; centre of mass and inertia about it stay.
    pub fn grasp(&mut self, factor: f64) {
        let (center, inertia) = (self.body.center_of_mass(), self.body.inertia_about_com());
        self.body = InertialParameters::about_com(self.body.mass * factor, center, inertia);
    }

    /// Mass of the body as it is.
    pub fn mass_kg(&self) -> f64 {
        self.body.mass
    }

    /// One sample later.
    pub fn step(&mut self) -> Watch<10> {
        let observation = self.observe();
        self.detector.update(&observation).unwrap().1
    }

    /// The next sample.
    pub fn observe(&mut self) -> JointObservation {
        // A force of constant size whose direction in the world wanders.
        let t = f64::from(self.updates) * STEP_S;
        let (slow, fast) = (0.2 * t, 0.3 * t);
        let direction = Vector3::new(slow.cos() * fast.sin(), slow.sin() * fast.sin(), fast.cos());
        let turning = Vector3::new((0.7 * t).sin(), (1.1 * t).cos(), (0.8 * t).sin());
        let direction = self.state.world_from_body.rotation.inverse() * direction;
        let commanded = Wrench::new(turning * (0.1 * self.force_n), direction * self.force_n);
        let (torque, force) = (self.random.normal3(1e-4), self.random.normal3(1e-3));
        let applied = commanded + Wrench::new(torque, force);
        let flyer = FreeFlyer::new(self.body);
        self.state = MuntheKaas4.step(&flyer, &self.state, &applied, 0.0, STEP_S).unwrap();
        self.updates += 1;
        let acceleration = flyer.forward(&self.state.twist_body, &applied).acceleration_origin_body;
        let turn = UnitQuaternion::from_scaled_axis(self.random.normal3(1e-3));
        let pose = &self.state.world_from_body;
        let place = pose.translation.vector;
        let attitude = pose.rotation * turn;
        let position = place + self.random.normal3(1e-3);
        JointObservation {
            step_s: STEP_S,
            wrench_body: commanded,
            stored_body: Vector3::zeros(),
            world_from_body: Some(Pose::from_parts(position.into(), attitude)),
            rate_body: Some(self.state.twist_body.angular + self.random.normal3(1e-3)),
            velocity_origin_world: None,
            acceleration_origin_body: Some((acceleration + self.random.normal3(1e-2), commanded)),
        }
    }
}
