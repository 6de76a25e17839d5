//! Logs of a periodic motion tracked perfectly, with noise: loads by the thesis's distribution, motions from rest to rest within
//! its bounds, harmonics added to them.
#![allow(clippy::cast_possible_truncation)]
#![allow(dead_code)] // each user takes its part

use crate::random::Random;
use tumble_identification::dynamics::{
    FreeFlyer, InertialParameters, MuntheKaas4, PoseTracker, RigidBodyState, SimulatedBody, WrenchBox,
};
use tumble_identification::excitation::execute;
use tumble_identification::fourier::{AttitudeChart, FourierBasis, FourierMotion};
use tumble_identification::lie::{EulerZyx, Pose, Wrench};
use tumble_identification::nalgebra::{DMatrix, Matrix3, Translation3, Vector3};
use tumble_identification::{MotionSample, Noise, WrenchTiming};

/// Bounds on position and Euler angles, m and rad.
pub const BOUNDS: (f64, f64) = (0.75, 0.8);

/// Pose noise of the thesis, wrench noise of the accuracy study.
pub fn noise() -> Noise {
    Noise { position_m: 0.05, attitude_rad: 0.03, torque_n_m: 0.001, force_n: 0.01, ..Noise::default() }
}

impl Random {
    /// A load of thesis 4.5, drawn until it is a body: the print's distribution is one in sixteen times.
    pub fn load(&mut self) -> InertialParameters<f64> {
        loop {
            let mass = 7.2 + 0.5 * self.normal();
            let center = self.normal3(0.04);
            let [xy, xz, yz] = [(); 3].map(|()| 0.02 + 0.05 * self.normal());
            let [xx, yy, zz] = [(); 3].map(|()| 0.07 + 0.015 * self.normal());
            let inertia = Matrix3::new(xx, xy, xz, xy, yy, yz, xz, yz, zz);
            let body = InertialParameters::about_com(mass, center, inertia);
            if body.is_strictly_consistent() {
                return body;
            }
        }
    }

    /// A random motion from rest to rest that touches the bounds.
    pub fn motion(&mut self, period_s: f64, harmonics: usize) -> FourierMotion {
        let basis = FourierBasis::try_new(period_s, harmonics).unwrap();
        let rest = basis.rest_to_rest();
        let mut coefficients = &rest * DMatrix::from_fn(rest.ncols(), 6, |_, _| self.normal());
        let times_s: Vec<f64> = (0..400).map(|i| period_s * f64::from(i) / 400.0).collect();
        let channels = &basis.table(&times_s)[0] * &coefficients;
        for (channel, mut column) in coefficients.column_iter_mut().enumerate() {
            column *= if channel < 3 { BOUNDS.0 } else { BOUNDS.1 } / channels.column(channel).amax();
        }
        FourierMotion::try_new(basis, AttitudeChart::EulerZyx, coefficients).unwrap()
    }

    /// The motion with harmonics beyond its own up to `last`, each of this amplitude (m, rad) and random phase in each channel.
    pub fn with_harmonics(&mut self, motion: &FourierMotion, last: usize, amplitude: f64) -> FourierMotion {
        let (old, first) = (motion.basis(), motion.basis().harmonics() + 1);
        let last = last.max(old.harmonics());
        let basis = FourierBasis::try_new(old.period_s(), last).unwrap();
        let mut coefficients = DMatrix::zeros(basis.coefficients(), motion.coefficients().ncols());
        for channel in 0..coefficients.ncols() {
            coefficients[(0, channel)] = motion.coefficients()[(0, channel)];
            for k in 1..first {
                coefficients[(k, channel)] = motion.coefficients()[(k, channel)];
                coefficients[(last + k, channel)] = motion.coefficients()[(first - 1 + k, channel)];
            }
            for k in first..=last {
                let (sine, cosine) = (std::f64::consts::TAU * self.share()).sin_cos();
                let rate = amplitude * basis.frequency_rad_s(k);
                (coefficients[(k, channel)], coefficients[(last + k, channel)]) = (rate * cosine, rate * sine);
            }
        }
        FourierMotion::try_new(basis, motion.chart(), coefficients).unwrap()
    }
}

/// How a log is made.
#[derive(Clone)]
pub struct PeriodicLog {
    pub motion: FourierMotion,
    pub body: InertialParameters<f64>,
    pub cycles: usize,
    pub samples_per_cycle: usize,
    pub noise: Noise,
    pub timing: WrenchTiming,
    pub world_from_start: Pose<f64>,
    pub gravity_world: Vector3<f64>,
}

impl PeriodicLog {
    pub fn new(motion: FourierMotion, body: InertialParameters<f64>) -> Self {
        Self {
            motion,
            body,
            cycles: 10,
            samples_per_cycle: 1000,
            noise: noise(),
            timing: WrenchTiming::Sampled,
            world_from_start: Pose::identity(),
            gravity_world: Vector3::zeros(),
        }
    }

    pub fn samples(&self, seed: u64) -> Vec<MotionSample> {
        let gravity = self.world_from_start.rotation.inverse_transform_vector(&self.gravity_world);
        let period_s = self.motion.basis().period_s();
        let step_s = period_s / self.samples_per_cycle as f64;
        let lag_s = if self.timing == WrenchTiming::Held { 0.5 * step_s } else { 0.0 };
        let period: Vec<_> = (0..self.samples_per_cycle)
            .map(|i| {
                let mut later = self.motion.at(i as f64 * step_s + lag_s).unwrap();
                later.acceleration_origin_world -= gravity;
                let wrench = Wrench::from(later.regressor() * self.body.to_vector());
                (self.world_from_start * self.motion.at(i as f64 * step_s).unwrap().world_from_body, wrench)
            })
            .collect();
        let rows = period.iter().cycle().take(self.cycles * self.samples_per_cycle).enumerate();
        let exact = rows.map(|(row, (pose, wrench))| sample(row as f64 * step_s, *pose, *wrench));
        noisy(exact.collect(), &self.world_from_start, &self.noise, seed)
    }
}

fn sample(time_s: f64, world_from_body: Pose<f64>, wrench: Wrench<f64>) -> MotionSample {
    MotionSample {
        time_ns: (time_s * 1e9).round() as i64,
        world_from_body: Some(world_from_body),
        velocity_origin_world: None,
        rate_body: None,
        acceleration_origin_body: None,
        wrench_body: Some(wrench),
        ..MotionSample::default()
    }
}

/// Adds noise; that of attitudes to their Euler angles in the frame of the start.
pub fn noisy(
    mut samples: Vec<MotionSample>,
    world_from_start: &Pose<f64>,
    noise: &Noise,
    seed: u64,
) -> Vec<MotionSample> {
    let mut random = Random::new(seed);
    for sample in &mut samples {
        let pose = world_from_start.inverse() * sample.world_from_body.unwrap();
        let angles = EulerZyx::from_rotation(&pose.rotation);
        let turn = random.normal3(noise.attitude_rad);
        let rotation = EulerZyx::new(angles.roll + turn.x, angles.pitch + turn.y, angles.yaw + turn.z).to_rotation();
        let position = pose.translation.vector + random.normal3(noise.position_m);
        sample.world_from_body = Some(world_from_start * Pose::from_parts(Translation3::from(position), rotation));
        let error = Wrench::new(random.normal3(noise.torque_n_m), random.normal3(noise.force_n));
        sample.wrench_body = sample.wrench_body.map(|wrench| wrench + error);
    }
    samples
}

/// A motion flown with feedback of this bandwidth and the feedforward of an empty free flyer, by a body that carries a load; without noise. And
/// the share of time at a limit.
pub fn flown(
    motion: &FourierMotion,
    body: &InertialParameters<f64>,
    limits: &WrenchBox,
    world_from_start: &Pose<f64>,
    bandwidth_rad_s: f64,
    (cycles, samples_per_cycle): (usize, usize),
) -> (Vec<MotionSample>, f64) {
    let assumed = Matrix3::from_diagonal(&Vector3::new(0.0453, 0.0417, 0.0519));
    let assumed = FreeFlyer::new(InertialParameters::about_com(6.047, Vector3::zeros(), assumed));
    let at_start = RigidBodyState { world_from_body: *world_from_start, ..RigidBodyState::at_rest() };
    let mut plant = SimulatedBody::try_new(FreeFlyer::new(*body), MuntheKaas4, *limits, at_start, 0.02).unwrap();
    let tracker = PoseTracker::critically_damped(assumed, bandwidth_rad_s, bandwidth_rad_s);
    let step_s = motion.basis().period_s() / samples_per_cycle as f64;
    let flown = execute(motion, &tracker, &mut plant, world_from_start, cycles, step_s).unwrap();
    let rows = flown.samples.iter();
    let samples = rows.map(|row| sample(row.time_s, row.state.world_from_body, row.realized_wrench_body)).collect();
    (samples, flown.saturation.any)
}
