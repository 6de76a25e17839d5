//! Logs of a body whose sensors are late, displaced and scaled and whose actuators lag. The motion is by Runge-Kutta in
//! inertial axes between all breakpoints of the wrench; nothing is shared with the estimator.
#![allow(
    clippy::cast_possible_truncation,
    clippy::cast_sign_loss,
    clippy::cast_possible_wrap,
    clippy::neg_cmp_op_on_partial_ord
)]
#![allow(dead_code)] // each user takes its part

use crate::random::Random;
use tumble_identification::dynamics::InertialParameters;
use tumble_identification::lie::{LieGroup, Pose, Wrench};
use tumble_identification::nalgebra::{Matrix3, Quaternion, Translation3, UnitQuaternion, Vector3};
use tumble_identification::{LikelihoodEstimate, MotionSample, Noise, Nuisance};

pub const STEP_S: f64 = 0.016;
/// Fewest steps before the first row, so that a delayed first row has something to describe.
const BEFORE: usize = 16;

/// What is wrong with a log, and how it is made.
#[derive(Clone, Debug)]
pub struct Faulty {
    pub body: InertialParameters<f64>,
    pub duration_s: f64,
    /// Highest frequency of the wrench, Hz.
    pub band_hz: f64,
    /// Rates, velocities and accelerations besides poses.
    pub all_columns: bool,
    /// 1e-3 m and rad, 1e-4 N m, 1e-3 N; rates and velocities 1e-3, accelerations 1e-2; times this.
    pub noise: f64,
    pub delay_s: f64,
    pub lag_s: f64,
    pub torque_scale: Vector3<f64>,
    pub force_scale: Vector3<f64>,
    pub bias_torque: Vector3<f64>,
    pub bias_force: Vector3<f64>,
    pub table_slope: Vector3<f64>,
    pub accelerometer_bias: Vector3<f64>,
    pub accelerometer_scale: Vector3<f64>,
    pub accelerometer_position: Vector3<f64>,
}

/// A free flyer of 9.41 kg.
pub fn cubesat() -> InertialParameters<f64> {
    let inertia = Matrix3::new(0.160, 0.004, -0.003, 0.004, 0.142, 0.006, -0.003, 0.006, 0.170);
    InertialParameters::about_com(9.41, Vector3::new(0.031, -0.017, 0.052), inertia)
}

impl Faulty {
    /// Nothing wrong but white noise.
    pub fn sound(duration_s: f64) -> Self {
        let (zero, one) = (Vector3::zeros(), Vector3::repeat(1.0));
        Self {
            body: cubesat(),
            duration_s,
            band_hz: 0.45,
            all_columns: false,
            noise: 1.0,
            delay_s: 0.0,
            lag_s: 0.0,
            torque_scale: one,
            force_scale: one,
            bias_torque: zero,
            bias_force: zero,
            table_slope: zero,
            accelerometer_bias: zero,
            accelerometer_scale: one,
            accelerometer_position: zero,
        }
    }

    pub fn noise_levels(&self) -> Noise {
        let (level, columns) = (1e-3 * self.noise, if self.all_columns { 1e-3 * self.noise } else { 0.0 });
        Noise {
            position_m: level,
            attitude_rad: level,
            torque_n_m: 0.1 * level,
            force_n: level,
            rate_rad_s: columns,
            velocity_m_s: columns,
            acceleration_m_s2: 10.0 * columns,
        }
    }

    /// True value of a nuisance.
    pub fn truth(&self, nuisance: Nuisance) -> f64 {
        match nuisance {
            Nuisance::Delay => self.delay_s,
            Nuisance::ForceScale(i) => self.force_scale[i],
            Nuisance::TorqueScale(i) => self.torque_scale[i],
            Nuisance::AccelerometerBias(i) => self.accelerometer_bias[i],
            Nuisance::AccelerometerScale(i) => self.accelerometer_scale[i],
            Nuisance::AccelerometerPosition(i) => self.accelerometer_position[i],
            Nuisance::BiasTorque(i) => self.bias_torque[i],
            Nuisance::BiasForce(i) => self.bias_force[i],
            Nuisance::TableSlope(i) => self.table_slope[i],
            Nuisance::ActuatorLag => self.lag_s,
            _ => f64::NAN,
        }
    }

    pub fn record(&self, seed: u64) -> Vec<MotionSample> {
        let mut random = Random::new(seed);
        let signal = Multisine::new(&mut random, self.band_hz);
        let count = (self.duration_s / STEP_S) as usize;
        let mut body = Motion::at_rest(self);
        let before = BEFORE.max((self.delay_s / STEP_S) as usize + 2);
        let start_s = -(before as f64) * STEP_S;
        let command = |k: usize| signal.at(start_s + k as f64 * STEP_S);
        let mut reached = command(0);
        let (mut rows, mut next) = (Vec::with_capacity(count), 0);
        for k in 0..count + before {
            let from_s = start_s + k as f64 * STEP_S;
            let acts = Acting { faulty: self, command: command(k), reached, from_s };
            let mut now_s = from_s;
            loop {
                let row_s = next as f64 * STEP_S - self.delay_s;
                if next >= count || row_s >= from_s + STEP_S - 1e-12 {
                    body.advance(&acts, now_s, from_s + STEP_S);
                    break;
                }
                body.advance(&acts, now_s, row_s);
                now_s = row_s.max(from_s);
                rows.push(body.row(&acts, now_s, next));
                next += 1;
            }
            reached = acts.after_lag(from_s + STEP_S);
        }
        for (k, row) in rows.iter_mut().enumerate() {
            let logged = command(k + before);
            let level = 1e-3 * self.noise;
            row.world_from_body.as_mut().unwrap().translation.vector += random.normal3(level);
            row.world_from_body.as_mut().unwrap().rotation *=
                <UnitQuaternion<f64> as LieGroup>::exp(&random.normal3(level));
            row.wrench_body =
                Some(Wrench::new(logged.0 + random.normal3(0.1 * level), logged.1 + random.normal3(level)));
            if self.all_columns {
                row.rate_body = row.rate_body.map(|w| w + random.normal3(level));
                row.velocity_origin_world = row.velocity_origin_world.map(|v| v + random.normal3(level));
                row.acceleration_origin_body = row.acceleration_origin_body.map(|a| a + random.normal3(10.0 * level));
            } else {
                (row.rate_body, row.velocity_origin_world, row.acceleration_origin_body) = (None, None, None);
            }
        }
        rows
    }
}

/// Error of a nuisance over its standard deviation, and both; NaN where it was not determined.
pub fn judged(found: &LikelihoodEstimate, nuisance: Nuisance, truth: f64) -> (f64, f64) {
    let estimate = found.nuisances.iter().find(|estimate| estimate.nuisance == nuisance);
    let value = estimate.and_then(|estimate| estimate.value).unwrap_or(f64::NAN);
    (value - truth, estimate.and_then(|estimate| estimate.std).unwrap_or(f64::NAN))
}

/// The wrench over one step.
struct Acting<'a> {
    faulty: &'a Faulty,
    command: (Vector3<f64>, Vector3<f64>),
    reached: (Vector3<f64>, Vector3<f64>),
    from_s: f64,
}

impl Acting<'_> {
    fn after_lag(&self, time_s: f64) -> (Vector3<f64>, Vector3<f64>) {
        if self.faulty.lag_s == 0.0 {
            return self.command;
        }
        let left = (-(time_s - self.from_s) / self.faulty.lag_s).exp();
        let between = |to: Vector3<f64>, from: Vector3<f64>| to + (from - to) * left;
        (between(self.command.0, self.reached.0), between(self.command.1, self.reached.1))
    }

    fn wrench(&self, time_s: f64) -> (Vector3<f64>, Vector3<f64>) {
        let (torque, force) = self.after_lag(time_s);
        let f = self.faulty;
        (torque.component_mul(&f.torque_scale) + f.bias_torque, force.component_mul(&f.force_scale) + f.bias_force)
    }
}

/// Centre of mass, its velocity, attitude, body rate.
#[derive(Clone, Copy)]
struct State {
    center: Vector3<f64>,
    velocity: Vector3<f64>,
    attitude: Quaternion<f64>,
    rate: Vector3<f64>,
}

impl State {
    fn plus(&self, d: &Self, h: f64) -> Self {
        Self {
            center: self.center + d.center * h,
            velocity: self.velocity + d.velocity * h,
            attitude: self.attitude + d.attitude * h,
            rate: self.rate + d.rate * h,
        }
    }
}

struct Motion {
    mass: f64,
    arm: Vector3<f64>,
    inertia: Matrix3<f64>,
    inverse: Matrix3<f64>,
    state: State,
}

impl Motion {
    fn at_rest(faulty: &Faulty) -> Self {
        let inertia = faulty.body.inertia_about_com();
        let arm = faulty.body.center_of_mass();
        let state =
            State { center: arm, velocity: Vector3::zeros(), attitude: Quaternion::identity(), rate: Vector3::zeros() };
        Self { mass: faulty.body.mass, arm, inertia, inverse: inertia.try_inverse().unwrap(), state }
    }

    fn derivative(&self, x: &State, acts: &Acting<'_>, time_s: f64) -> State {
        let (torque, force) = acts.wrench(time_s);
        let attitude = UnitQuaternion::new_normalize(x.attitude);
        let momentum = self.inertia * x.rate;
        State {
            center: x.velocity,
            velocity: attitude * force / self.mass + acts.faulty.table_slope,
            attitude: x.attitude * Quaternion::from_imag(x.rate) * 0.5,
            rate: self.inverse * (torque - self.arm.cross(&force) - x.rate.cross(&momentum)),
        }
    }

    fn advance(&mut self, acts: &Acting<'_>, from_s: f64, to_s: f64) {
        let parts = ((to_s - from_s) / 4e-3).ceil();
        let h = (to_s - from_s) / parts;
        if !(h > 1e-9) {
            return;
        }
        for i in 0..parts as usize {
            let (x, t) = (self.state, from_s + i as f64 * h);
            let k1 = self.derivative(&x, acts, t);
            let k2 = self.derivative(&x.plus(&k1, h / 2.0), acts, t + h / 2.0);
            let k3 = self.derivative(&x.plus(&k2, h / 2.0), acts, t + h / 2.0);
            let k4 = self.derivative(&x.plus(&k3, h), acts, t + h);
            let mut x = x.plus(&k1, h / 6.0).plus(&k2, h / 3.0).plus(&k3, h / 3.0).plus(&k4, h / 6.0);
            x.attitude = x.attitude.normalize();
            self.state = x;
        }
    }

    fn row(&self, acts: &Acting<'_>, time_s: f64, k: usize) -> MotionSample {
        let x = &self.state;
        let q = UnitQuaternion::new_normalize(x.attitude);
        let d = self.derivative(x, acts, time_s);
        let f = acts.faulty;
        let at = |point: Vector3<f64>| {
            let lever = point - self.arm;
            q.inverse() * d.velocity + d.rate.cross(&lever) + x.rate.cross(&x.rate.cross(&lever))
        };
        let felt = at(f.accelerometer_position).component_mul(&f.accelerometer_scale) + f.accelerometer_bias;
        MotionSample {
            time_ns: (k as f64 * STEP_S * 1e9).round() as i64,
            world_from_body: Some(Pose::from_parts(Translation3::from(x.center - q * self.arm), q)),
            velocity_origin_world: Some(x.velocity - q * x.rate.cross(&self.arm)),
            rate_body: Some(x.rate),
            acceleration_origin_body: Some(felt),
            wrench_body: None,
            ..MotionSample::default()
        }
    }
}

/// Three tones on each channel.
struct Multisine {
    tones: Vec<(usize, f64, f64, f64)>,
}

impl Multisine {
    fn new(random: &mut Random, band_hz: f64) -> Self {
        let mut tones = Vec::new();
        for channel in 0..6 {
            let amplitude = if channel < 3 { 0.04 } else { 0.4 } / 3.0;
            for tone in 0..3 {
                let share = (f64::from(tone) + random.share()) / 3.0;
                let rate = std::f64::consts::TAU * (0.05 + (band_hz - 0.05) * share);
                tones.push((channel, amplitude, rate, std::f64::consts::TAU * random.share()));
            }
        }
        Self { tones }
    }

    fn at(&self, t: f64) -> (Vector3<f64>, Vector3<f64>) {
        let mut wrench = (Vector3::zeros(), Vector3::zeros());
        for &(channel, amplitude, rate, phase) in &self.tones {
            let part = if channel < 3 { &mut wrench.0 } else { &mut wrench.1 };
            part[channel % 3] += amplitude * (rate * t + phase).sin();
        }
        wrench
    }
}
