//! Motion of a free body from an algorithm that shares nothing with the regressors: Runge-Kutta about the centre of mass
//! in small substeps, quaternion normalised. The generator of truth for these tests.
#![allow(
    clippy::cast_possible_truncation,
    clippy::cast_sign_loss,
    clippy::cast_possible_wrap,
    clippy::neg_cmp_op_on_partial_ord
)]
#![allow(dead_code)] // each test binary uses its part

use crate::random::Random;
use tumble_identification::MotionSample;
use tumble_identification::dynamics::InertialParameters;
use tumble_identification::lie::{Pose, Wrench};
use tumble_identification::nalgebra::{Quaternion, SVector, SymmetricEigen, Translation3, UnitQuaternion, Vector3};

/// Sum of sines on each of the six channels.
pub struct Multisine {
    terms: Vec<(usize, f64, f64, f64)>,
}

impl Multisine {
    /// `tones` random tones a channel between two angular frequencies; amplitudes are those of the whole channel.
    pub fn random(random: &mut Random, torque: f64, force: f64, rates: (f64, f64), tones: usize) -> Self {
        let mut terms = Vec::new();
        for channel in 0..6 {
            let amplitude = if channel < 3 { torque } else { force } / (tones as f64).sqrt();
            for tone in 0..tones {
                let place = (tone as f64 + random.uniform(0.0, 1.0)) / tones as f64;
                let rate = rates.0 + (rates.1 - rates.0) * place;
                terms.push((channel, amplitude, rate, random.uniform(0.0, std::f64::consts::TAU)));
            }
        }
        Self { terms }
    }
    pub fn at(&self, t: f64) -> Wrench<f64> {
        let mut w = SVector::<f64, 6>::zeros();
        for &(channel, amplitude, rate, phase) in &self.terms {
            w[channel] += amplitude * (rate * t + phase).sin();
        }
        Wrench::from(w)
    }
}

/// A run to generate.
pub struct Run<'a> {
    pub body: InertialParameters<f64>,
    pub wrench: &'a dyn Fn(f64) -> Wrench<f64>,
    pub held: bool,
    pub step_ns: i64,
    pub samples: usize,
    pub substep_s: f64,
    pub start_ns: i64,
    pub start: Pose<f64>,
    pub velocity_world: Vector3<f64>,
    pub rate_body: Vector3<f64>,
    pub gravity_world: Vector3<f64>,
}

impl<'a> Run<'a> {
    pub fn new(body: InertialParameters<f64>, wrench: &'a dyn Fn(f64) -> Wrench<f64>, held: bool) -> Self {
        Self {
            body,
            wrench,
            held,
            step_ns: 50_000_000,
            samples: 201,
            substep_s: 1e-3,
            start_ns: 0,
            start: Pose::identity(),
            velocity_world: Vector3::zeros(),
            rate_body: Vector3::zeros(),
            gravity_world: Vector3::zeros(),
        }
    }

    pub fn record(&self) -> Vec<MotionSample> {
        let mass = self.body.mass;
        let c = self.body.center_of_mass();
        let inertia = self.body.inertia_about_com();
        let inverse = inertia.try_inverse().unwrap();
        let step_s = self.step_ns as f64 * 1e-9;
        let substeps = (step_s / self.substep_s).ceil().max(1.0);
        let h = step_s / substeps;
        let rotation = self.start.rotation;
        // Positions relative to the start, so that a distant origin costs the generator nothing.
        // State: quaternion (4), rate (3), centre of mass (3), its velocity (3).
        let com = rotation * c;
        let com_velocity = self.velocity_world + rotation * self.rate_body.cross(&c);
        let mut x = SVector::<f64, 13>::zeros();
        x.fixed_rows_mut::<4>(0).copy_from(&rotation.coords);
        x.fixed_rows_mut::<3>(4).copy_from(&self.rate_body);
        x.fixed_rows_mut::<3>(7).copy_from(&com);
        x.fixed_rows_mut::<3>(10).copy_from(&com_velocity);
        let field = |x: &SVector<f64, 13>, u: &Wrench<f64>| {
            let q = Quaternion::from_vector(x.fixed_rows::<4>(0).into_owned());
            let w: Vector3<f64> = x.fixed_rows::<3>(4).into_owned();
            let torque = u.torque - c.cross(&u.force);
            let mut rate = SVector::<f64, 13>::zeros();
            rate.fixed_rows_mut::<4>(0).copy_from(&(q * Quaternion::from_imag(w) * 0.5).coords);
            rate.fixed_rows_mut::<3>(4).copy_from(&(inverse * (torque - w.cross(&(inertia * w)))));
            rate.fixed_rows_mut::<3>(7).copy_from(&x.fixed_rows::<3>(10));
            let force = UnitQuaternion::new_normalize(q) * u.force;
            rate.fixed_rows_mut::<3>(10).copy_from(&(force / mass + self.gravity_world));
            rate
        };
        (0..self.samples)
            .map(|k| {
                let t = k as f64 * step_s;
                let u = (self.wrench)(t);
                let q = UnitQuaternion::new_normalize(Quaternion::from_vector(x.fixed_rows::<4>(0).into_owned()));
                let [w, r, v] = [4, 7, 10].map(|i| Vector3::new(x[i], x[i + 1], x[i + 2]));
                let wdot: Vector3<f64> = field(&x, &u).fixed_rows::<3>(4).into_owned();
                let sample = MotionSample {
                    time_ns: self.start_ns + k as i64 * self.step_ns,
                    world_from_body: Some(Pose::from_parts(
                        Translation3::from(self.start.translation.vector + (r - q * c)),
                        q,
                    )),
                    velocity_origin_world: Some(v - q * w.cross(&c)),
                    rate_body: Some(w),
                    acceleration_origin_body: Some(u.force / mass - wdot.cross(&c) - w.cross(&w.cross(&c))),
                    wrench_body: Some(u),
                    ..MotionSample::default()
                };
                for i in 0..substeps as usize {
                    let at = |fraction: f64| if self.held { u } else { (self.wrench)(t + (i as f64 + fraction) * h) };
                    let (u0, u1, u2) = (at(0.0), at(0.5), at(1.0));
                    let k1 = field(&x, &u0);
                    let k2 = field(&(x + k1 * (h / 2.0)), &u1);
                    let k3 = field(&(x + k2 * (h / 2.0)), &u1);
                    let k4 = field(&(x + k3 * h), &u2);
                    x += (k1 + (k2 + k3) * 2.0 + k4) * (h / 6.0);
                    let norm = x.fixed_rows::<4>(0).norm();
                    x.fixed_rows_mut::<4>(0).scale_mut(1.0 / norm);
                }
                sample
            })
            .collect()
    }
}

/// Relative errors of mass, centre of mass (m) and inertia about it.
pub fn errors(found: &InertialParameters<f64>, truth: &InertialParameters<f64>) -> [f64; 3] {
    let inertia = truth.inertia_about_com();
    [
        (found.mass - truth.mass).abs() / truth.mass,
        (found.center_of_mass() - truth.center_of_mass()).norm(),
        (found.inertia_about_com() - inertia).norm() / inertia.norm(),
    ]
}

/// Slope of log error over log step.
pub fn order(steps: &[f64], errors: &[f64]) -> f64 {
    let n = steps.len() as f64;
    let (x, y): (Vec<f64>, Vec<f64>) =
        (steps.iter().map(|s| s.ln()).collect(), errors.iter().map(|e| e.ln()).collect());
    let (mx, my) = (x.iter().sum::<f64>() / n, y.iter().sum::<f64>() / n);
    let (mut sxy, mut sxx) = (0.0, 0.0);
    for (a, b) in x.iter().zip(&y) {
        sxy += (a - mx) * (b - my);
        sxx += (a - mx) * (a - mx);
    }
    sxy / sxx
}

/// Whether every reported body is one: positive mass, triangle inequalities strictly.
pub fn is_consistent(body: &InertialParameters<f64>) -> bool {
    let eigen = SymmetricEigen::new(body.inertia_about_com()).eigenvalues;
    body.mass > 0.0 && eigen.min() > 0.0 && eigen.sum() - 2.0 * eigen.max() > 0.0
}
