//! Simulated logs with known truth: bodies, multisine wrenches, noise. The plant is Runge-Kutta about the centre of mass and
//! shares nothing with the estimators.

use std::collections::VecDeque;
use std::f64::consts::TAU;

use nalgebra::{Matrix3, Quaternion, SVector, Translation3, UnitQuaternion, Vector3};
use tumble_dynamics::InertialParameters;
use tumble_identification::noise::Gaussian;
use tumble_identification::{MotionSample, WrenchTiming};
use tumble_lie::{LieGroup, Pose, Wrench};

/// A body and how it is shaken.
#[derive(Clone)]
pub struct Body {
    pub name: &'static str,
    pub parameters: InertialParameters<f64>,
    /// Amplitude of the whole multisine on each axis, N m and N.
    pub torque: f64,
    pub force: f64,
    pub step_s: f64,
}

/// The bodies of section 5.4 and table 5.1 (inertia about the origin) with the amplitudes of this study: 0.25 tr J / 3 and 0.25 m.
pub fn chapter5_bodies() -> [Body; 4] {
    let body = |name, mass: f64, c: [f64; 3], j: [f64; 6]| {
        let inertia = Matrix3::new(j[0], j[3], j[4], j[3], j[1], j[5], j[4], j[5], j[2]);
        Body {
            name,
            parameters: InertialParameters::about_origin(mass, Vector3::from(c), inertia),
            torque: 0.25 * inertia.trace() / 3.0,
            force: 0.25 * mass,
            step_s: 0.05,
        }
    };
    [
        body("D", 5.0, [0.05, 0.1, 0.05], [1.5, 2.0, 3.0, 0.1, 0.2, 0.3]),
        body("1", 10.0, [-0.08, 0.06, 0.15], [2.08, 3.19, 4.06, -0.0487, 0.0739, -0.0655]),
        body("2", 5.0, [0.1, 0.2, 0.1], [5.0, 5.0, 5.0, 0.0, 0.0, 0.0]),
        body("3", 6.047, [0.0; 3], [0.0453, 0.0417, 0.0519, 0.0, 0.0, 0.0]),
    ]
}

/// Bodies as a free-flyer meets them: a cubesat, a flat plate (the triangle inequality holds with equality), a robot with its
/// payload, a heavy satellite. Principal axes are turned at random, once for all.
pub fn free_flyers() -> [Body; 4] {
    let body = |name, seed, mass: f64, c: [f64; 3], principal: [f64; 3], force, torque, step_s| {
        let turn = Gaussian::from_seed(seed).attitude();
        let inertia = Matrix3::from_diagonal(&Vector3::from(principal));
        let inertia = turn.to_rotation_matrix() * inertia * turn.to_rotation_matrix().transpose();
        let inertia = (inertia + inertia.transpose()) * 0.5;
        Body { name, parameters: InertialParameters::about_com(mass, Vector3::from(c), inertia), torque, force, step_s }
    };
    [
        body("cubesat", 13, 9.41, [0.031, -0.017, 0.052], [0.161, 0.139, 0.172], 0.4, 0.04, 0.016),
        body("plate", 14, 6.0, [0.02, 0.03, 0.0], [0.08, 0.11, 0.19], 0.4, 0.04, 0.016),
        body("payload", 15, 13.08, [0.012, -0.117, 0.021], [0.35, 0.24, 0.47], 0.6, 0.06, 0.016),
        body("heavy", 12, 41.7, [-0.12, 0.21, 0.09], [2.9, 4.4, 5.1], 4.0, 1.5, 0.05),
    ]
}

/// What studies draw beyond what the crate's stream offers.
pub trait Draws {
    fn attitude(&mut self) -> UnitQuaternion<f64>;
}

impl Draws for Gaussian {
    fn attitude(&mut self) -> UnitQuaternion<f64> {
        UnitQuaternion::new_normalize(Quaternion::new(self.normal(), self.normal(), self.normal(), self.normal()))
    }
}

/// A sum of sines on each of the six channels of a wrench.
pub struct Multisine {
    /// Channel, amplitude, angular frequency in rad/s, phase.
    tones: Vec<(usize, f64, f64, f64)>,
}

impl Multisine {
    /// One tone a channel with the frequencies of `design/accuracy.md` 1 and phases from the seed.
    pub fn chapter5(body: &Body, random: &mut Gaussian) -> Self {
        const OMEGA: [f64; 6] = [0.6, 0.8, 1.0, 0.7, 0.9, 1.1];
        let tones = OMEGA.iter().enumerate().map(|(channel, &omega)| {
            (channel, if channel < 3 { body.torque } else { body.force }, omega, TAU * random.uniform())
        });
        Self { tones: tones.collect() }
    }

    /// Three tones a channel, frequencies between 0.05 and 0.45 Hz and phases from the seed.
    pub fn random(body: &Body, random: &mut Gaussian) -> Self {
        let mut tones = Vec::new();
        for channel in 0..6 {
            let amplitude = if channel < 3 { body.torque } else { body.force } / 3.0;
            for _ in 0..3 {
                let hz = 0.05 + 0.4 * random.uniform();
                tones.push((channel, amplitude, TAU * hz, TAU * random.uniform()));
            }
        }
        Self { tones }
    }

    pub fn at(&self, time_s: f64) -> Wrench<f64> {
        let mut wrench = SVector::<f64, 6>::zeros();
        for &(channel, amplitude, omega, phase) in &self.tones {
            wrench[channel] += amplitude * (omega * time_s + phase).sin();
        }
        Wrench::from(wrench)
    }
}

/// Standard deviations per sample; `None` where a quantity is not measured.
#[derive(Clone, Copy, Default)]
pub struct Noise {
    pub torque: f64,
    pub force: f64,
    pub position: f64,
    pub attitude: f64,
    pub velocity: Option<f64>,
    pub rate: Option<f64>,
    pub acceleration: Option<f64>,
    /// Density of the disturbance of velocity and rate in the plant, per root second.
    pub process: f64,
    /// How long before its row's time what a row says of the motion was so, in fifths of a sample.
    pub delay_fifths: usize,
}

/// One instant as it was.
#[derive(Clone, Copy)]
pub struct Instant {
    pub world_from_body: Pose<f64>,
    pub velocity_origin_world: Vector3<f64>,
    pub rate_body: Vector3<f64>,
    pub rate_derivative_body: Vector3<f64>,
    pub acceleration_origin_body: Vector3<f64>,
}

/// What happened and what was logged of it.
pub struct Flight {
    pub truth: InertialParameters<f64>,
    pub step_s: f64,
    pub instants: Vec<Instant>,
    pub record: Vec<MotionSample>,
}

/// Integration steps per sample.
const SUBSTEPS: u32 = 5;

/// Flies `body` from rest at the identity for `samples` samples.
pub fn fly(
    body: &Body,
    excitation: &Multisine,
    timing: WrenchTiming,
    noise: &Noise,
    samples: usize,
    random: &mut Gaussian,
) -> Flight {
    let mass = body.parameters.mass;
    let c = body.parameters.center_of_mass();
    let inertia = body.parameters.inertia_about_com();
    let inverse = inertia.try_inverse().unwrap_or_default();
    let step_s = body.step_s;
    let h = step_s / f64::from(SUBSTEPS);
    // Quaternion, rate, centre of mass, its velocity.
    let mut x = SVector::<f64, 13>::zeros();
    x[3] = 1.0;
    x.fixed_rows_mut::<3>(7).copy_from(&c);
    let field = |x: &SVector<f64, 13>, u: &Wrench<f64>| {
        let q = Quaternion::from_vector(x.fixed_rows::<4>(0).into_owned());
        let w: Vector3<f64> = x.fixed_rows::<3>(4).into_owned();
        let torque = u.torque - c.cross(&u.force);
        let mut rate = SVector::<f64, 13>::zeros();
        rate.fixed_rows_mut::<4>(0).copy_from(&(q * Quaternion::from_imag(w) * 0.5).coords);
        rate.fixed_rows_mut::<3>(4).copy_from(&(inverse * (torque - w.cross(&(inertia * w)))));
        rate.fixed_rows_mut::<3>(7).copy_from(&x.fixed_rows::<3>(10));
        rate.fixed_rows_mut::<3>(10).copy_from(&(UnitQuaternion::new_normalize(q) * u.force / mass));
        rate
    };
    let instant = |x: &SVector<f64, 13>, u: &Wrench<f64>| {
        let q = UnitQuaternion::new_normalize(Quaternion::from_vector(x.fixed_rows::<4>(0).into_owned()));
        let [w, r, v] = [4, 7, 10].map(|i| Vector3::new(x[i], x[i + 1], x[i + 2]));
        let rate_derivative_body: Vector3<f64> = field(x, u).fixed_rows::<3>(4).into_owned();
        Instant {
            world_from_body: Pose::from_parts(Translation3::from(r - q * c), q),
            velocity_origin_world: v - q * w.cross(&c),
            rate_body: w,
            rate_derivative_body,
            acceleration_origin_body: u.force / mass - rate_derivative_body.cross(&c) - w.cross(&w.cross(&c)),
        }
    };
    let mut flight = Flight { truth: body.parameters, step_s, instants: Vec::new(), record: Vec::new() };
    // What was so at the latest substeps, the oldest first.
    let mut past = VecDeque::new();
    for k in 0..samples {
        let t = k as f64 * step_s;
        let u = excitation.at(t);
        let now = instant(&x, &u);
        past.push_back(now);
        let seen = past.iter().rev().nth(noise.delay_fifths).or(past.front()).unwrap_or(&now);
        #[allow(clippy::cast_possible_truncation, reason = "a whole number of nanoseconds")]
        let time_ns = (t * 1e9).round() as i64;
        flight.record.push(logged(seen, &u, time_ns, noise, random));
        flight.instants.push(now);
        for i in 0..SUBSTEPS {
            let is_held = timing == WrenchTiming::Held;
            let at = |fraction: f64| if is_held { u } else { excitation.at(t + (f64::from(i) + fraction) * h) };
            let (u0, u1, u2) = (at(0.0), at(0.5), at(1.0));
            if i > 0 && noise.delay_fifths > 0 {
                past.push_back(instant(&x, &u0));
            }
            while past.len() > noise.delay_fifths + 1 {
                past.pop_front();
            }
            let k1 = field(&x, &u0);
            let k2 = field(&(x + k1 * (h / 2.0)), &u1);
            let k3 = field(&(x + k2 * (h / 2.0)), &u1);
            let k4 = field(&(x + k3 * h), &u2);
            x += (k1 + (k2 + k3) * 2.0 + k4) * (h / 6.0);
            let norm = x.fixed_rows::<4>(0).norm();
            x.fixed_rows_mut::<4>(0).scale_mut(1.0 / norm);
            if noise.process > 0.0 {
                let sigma = noise.process * h.sqrt();
                for i in [4, 10] {
                    let kick = random.vector(sigma);
                    let mut part = x.fixed_rows_mut::<3>(i);
                    part += kick;
                }
            }
        }
    }
    flight
}

fn logged(instant: &Instant, wrench: &Wrench<f64>, time_ns: i64, noise: &Noise, random: &mut Gaussian) -> MotionSample {
    let position = instant.world_from_body.translation.vector + random.vector(noise.position);
    let turn = <UnitQuaternion<f64> as LieGroup>::exp(&random.vector(noise.attitude));
    let mut measured = |truth: Vector3<f64>, sigma: Option<f64>| sigma.map(|sigma| truth + random.vector(sigma));
    MotionSample {
        time_ns,
        world_from_body: Some(Pose::from_parts(Translation3::from(position), instant.world_from_body.rotation * turn)),
        velocity_origin_world: measured(instant.velocity_origin_world, noise.velocity),
        rate_body: measured(instant.rate_body, noise.rate),
        acceleration_origin_body: measured(instant.acceleration_origin_body, noise.acceleration),
        wrench_body: Some(Wrench::new(
            wrench.torque + random.vector(noise.torque),
            wrench.force + random.vector(noise.force),
        )),
        ..MotionSample::default()
    }
}

/// The three groups of parameters in which errors are reported.
pub const GROUPS: [&str; 3] = ["inertia", "centre of mass", "mass"];

/// Errors of the inertia about the origin (six numbers), of the centre of mass and of the mass.
pub struct Errors {
    pub inertia: SVector<f64, 6>,
    pub center_of_mass: Vector3<f64>,
    pub mass: f64,
}

impl Errors {
    pub fn of(found: &SVector<f64, 10>, truth: &InertialParameters<f64>) -> Self {
        let exact = truth.to_vector();
        Self {
            inertia: (found - exact).fixed_rows::<6>(4).into_owned(),
            center_of_mass: found.fixed_rows::<3>(1) / found[0] - truth.center_of_mass(),
            mass: found[0] - exact[0],
        }
    }

    /// 2-norms, in the order of [`GROUPS`].
    ///
    /// # Source
    /// Thesis (4.20).
    pub fn norms(&self) -> [f64; 3] {
        [self.inertia.norm(), self.center_of_mass.norm(), self.mass.abs()]
    }
}

/// Covariances of the groups that follow from that of the ten parameters, to first order.
pub struct GroupCovariances {
    pub inertia: nalgebra::Matrix6<f64>,
    pub center_of_mass: Matrix3<f64>,
    pub mass: nalgebra::Matrix1<f64>,
}

impl GroupCovariances {
    pub fn of(covariance: &nalgebra::SMatrix<f64, 10, 10>, truth: &InertialParameters<f64>) -> Self {
        let c = truth.center_of_mass();
        // c = h / m.
        let slope = nalgebra::SMatrix::<f64, 3, 4>::from_fn(|i, j| {
            let change = if j == 0 { -c[i] } else { f64::from(u8::from(i + 1 == j)) };
            change / truth.mass
        });
        Self {
            inertia: covariance.fixed_view::<6, 6>(4, 4).into_owned(),
            center_of_mass: slope * covariance.fixed_view::<4, 4>(0, 0) * slope.transpose(),
            mass: nalgebra::Matrix1::new(covariance[(0, 0)]),
        }
    }

    /// Traces, in the order of [`GROUPS`].
    pub fn traces(&self) -> [f64; 3] {
        [self.inertia.trace(), self.center_of_mass.trace(), self.mass[0]]
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use tumble_dynamics::FreeFlyer;
    use tumble_lie::Twist;

    #[test]
    fn the_plant_agrees_with_newton_and_euler_about_the_origin() {
        for body in chapter5_bodies().iter().chain(&free_flyers()) {
            let mut random = Gaussian::from_seed(1);
            let excitation = Multisine::random(body, &mut random);
            let flight = fly(body, &excitation, WrenchTiming::Sampled, &Noise::default(), 300, &mut random);
            for (k, instant) in flight.instants.iter().enumerate() {
                let velocity =
                    instant.world_from_body.rotation.inverse_transform_vector(&instant.velocity_origin_world);
                let twist = Twist::new(instant.rate_body, velocity);
                let found = FreeFlyer::new(body.parameters).forward(&twist, &excitation.at(k as f64 * body.step_s));
                assert!((found.angular_acceleration_body - instant.rate_derivative_body).amax() < 1e-12);
                assert!((found.acceleration_origin_body - instant.acceleration_origin_body).amax() < 1e-12);
            }
            // Velocities are the derivatives of the poses.
            let five = &flight.instants[100..105];
            let at = |k: usize| five[k].world_from_body.translation.vector;
            let velocity = (at(0) - at(4) + (at(3) - at(1)) * 8.0) / (12.0 * body.step_s);
            assert!((velocity - five[2].velocity_origin_world).amax() < 1e-4 * body.step_s, "{}", body.name);
        }
    }

    #[test]
    fn errors_are_norms_of_the_groups() {
        let truth = chapter5_bodies()[0].parameters;
        let mut found = truth.to_vector();
        // Twice the mass with the same first moment halves the centre of mass.
        found[0] += truth.mass;
        found[4] += 3.0;
        found[9] -= 4.0;
        let [inertia, center, mass] = Errors::of(&found, &truth).norms();
        assert!((inertia - 5.0).abs() < 1e-12 && (mass - 5.0).abs() < 1e-12, "{inertia} {mass}");
        assert!((center - 0.5 * truth.center_of_mass().norm()).abs() < 1e-12, "{center}");
    }

    #[test]
    fn bodies_exist_and_seeds_are_flights() {
        for body in chapter5_bodies().iter().chain(&free_flyers()) {
            assert!(body.parameters.is_consistent(), "{}", body.name);
        }
        let body = &free_flyers()[0];
        let flight = |seed| {
            let mut random = Gaussian::from_seed(seed);
            let excitation = Multisine::random(body, &mut random);
            let noise = Noise { position: 1e-3, attitude: 1e-3, torque: 1e-4, force: 1e-3, ..Noise::default() };
            fly(body, &excitation, WrenchTiming::Held, &noise, 50, &mut random).record
        };
        assert_eq!(flight(4), flight(4));
        assert_ne!(flight(4), flight(5));
    }
}
