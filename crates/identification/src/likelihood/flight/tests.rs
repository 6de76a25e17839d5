//! The likelihood on logs of a small simulator: a rigid body under a held wrench, seen by sensors of which each error can be left out.

use super::super::flow::{Body, Input, State};
use super::{FlightEstimate, FlightLikelihood, Plane, Thrusters};
use crate::MotionSample;
use crate::dynamics::InertialParameters;
use crate::error::{Column, IdentificationError};
use crate::estimator::Estimator;
use crate::lie::{LieGroup, Pose, Wrench};
use crate::noise::Gaussian;
use crate::sensing::{Delay, LinearFilter, Sensing, Wander};
use nalgebra::{DMatrix, DVector, Matrix3, SVector, UnitQuaternion, Vector3};

/// Step of the inertial unit; a row comes every second one.
const FINE_S: f64 = 0.008;
const LEVER: [f64; 3] = [0.03, -0.02, 0.01];

/// What is simulated.
#[derive(Clone)]
struct World {
    seconds: f64,
    white: [f64; 5],
    wander: [f64; 3],
    wander_s: f64,
    filter: Option<LinearFilter>,
    scale: f64,
    bias: [f64; 2],
    late: usize,
    planar: bool,
    every: usize,
    wrench_scale: f64,
    turn_scale: f64,
    body_scale: f64,
    uneven: f64,
}

fn low_pass() -> LinearFilter {
    LinearFilter::try_new(&[0.1, 0.1], &[1.0, -0.8], FINE_S).unwrap()
}

impl World {
    fn usual() -> Self {
        Self {
            seconds: 40.0,
            white: [1e-3, 1e-3, 2e-3, 2e-4, 5e-3],
            wander: [0.02, 0.01, 2e-3],
            wander_s: 10.0,
            filter: Some(low_pass()),
            scale: 0.01,
            bias: [3e-3, 0.02],
            late: 0,
            planar: false,
            every: 2,
            wrench_scale: 1.0,
            turn_scale: 1.0,
            body_scale: 1.0,
            uneven: 0.0,
        }
    }

    /// Nothing is wrong with the sensors.
    fn exact() -> Self {
        Self { white: [0.0; 5], wander: [0.0; 3], scale: 0.0, bias: [0.0; 2], ..Self::usual() }
    }

    fn body(&self) -> InertialParameters<f64> {
        let c = if self.planar { Vector3::new(0.012, -0.007, 0.0) } else { Vector3::new(0.012, -0.007, 0.009) };
        let j = Matrix3::new(0.153, 0.004, -0.003, 0.004, 0.142, 0.006, -0.003, 0.006, 0.166);
        InertialParameters::about_com(9.6 * self.body_scale, c, j * self.body_scale)
    }

    fn sensing(&self) -> Sensing {
        let mut sensing = Sensing::default();
        for triad in [&mut sensing.rate, &mut sensing.acceleration] {
            triad.filter.clone_from(&self.filter);
            triad.delay = Delay::NONE;
            (triad.scale_sigma, triad.misalignment_sigma) = (0.01, 0.01);
        }
        (sensing.pose_delay, sensing.velocity_delay) = (Delay::NONE, Delay::NONE);
        sensing.lever_arm_body_m = LEVER;
        sensing
    }

    fn told(&self) -> FlightLikelihood {
        FlightLikelihood { sensing: self.sensing(), ..FlightLikelihood::default() }
    }

    fn wrench(&self, time_s: f64) -> ([f64; 3], [f64; 3]) {
        let wave = |i: usize| {
            let frequency = [0.11, 0.17, 0.13, 0.19, 0.23, 0.29][i] * core::f64::consts::TAU;
            (frequency * time_s).sin() + 0.7 * (2.3 * frequency * time_s + i as f64).cos()
        };
        let (t, f) = (0.01 * self.wrench_scale * self.turn_scale, 0.15 * self.wrench_scale);
        if self.planar {
            ([0.0, 0.0, t * wave(2)], [f * wave(3), f * wave(4), 0.0])
        } else {
            ([t * wave(0), t * wave(1), t * wave(2)], [f * wave(3), f * wave(4), f * wave(5)])
        }
    }

    fn log(&self, seed: u64) -> Vec<MotionSample> {
        let mut dice = Gaussian::from_seed(seed);
        let truth = self.body();
        let body = Body::new(truth.mass, truth.center_of_mass(), truth.inertia_about_com());
        let steps = crate::likelihood::whole(self.seconds / FINE_S);
        let mut gains = || Matrix3::identity() + Matrix3::from_fn(|_, _| dice.normal() * self.scale);
        let (rate_gain, acceleration_gain) = (gains(), gains());
        let biases = self.bias.map(|sigma| dice.vector(sigma));
        let mut slow = self.wander.map(|sigma| dice.vector(sigma));
        let decay = (-FINE_S * self.every as f64 / self.wander_s).exp();
        let lever = Vector3::from(LEVER);
        let mut state = State {
            world_from_body: UnitQuaternion::identity(),
            rate: Vector3::zeros(),
            center: truth.center_of_mass(),
            velocity: Vector3::zeros(),
        };
        let (mut states, mut rates, mut forces, mut wrenches) = (Vec::new(), Vec::new(), Vec::new(), Vec::new());
        let mut held = self.wrench(0.0);
        for k in 0..steps {
            if k % self.every == 0 {
                held = self.wrench(k as f64 * FINE_S);
            }
            let input = Input { torque: held.0.into(), force: held.1.into(), ..Input::default() };
            let step = body.step(&state, &input, &Vector3::zeros(), FINE_S);
            let arm = lever - body.center;
            let w = state.rate;
            let at_lever = input.force / body.mass + step.acceleration.cross(&arm) + w.cross(&w.cross(&arm));
            states.push(state);
            rates.push(w);
            forces.push(at_lever);
            wrenches.push(input);
            state = step.next;
        }
        let filtered = |series: &[Vector3<f64>]| -> Vec<Vector3<f64>> {
            let Some(filter) = &self.filter else { return series.to_vec() };
            let axes = [0, 1, 2].map(|i| filter.filtered(&series.iter().map(|v| v[i]).collect::<Vec<_>>()));
            (0..series.len()).map(|k| Vector3::new(axes[0][k], axes[1][k], axes[2][k])).collect()
        };
        // Noise comes before the filter; its level is that of a row by density.
        let fine = (self.every as f64).sqrt();
        let mut noisy = |series: Vec<Vector3<f64>>, gain: &Matrix3<f64>, sigma: f64| -> Vec<Vector3<f64>> {
            series.into_iter().map(|v| gain * v + dice.vector(sigma * fine)).collect()
        };
        let (rates, forces) = (
            filtered(&noisy(rates, &rate_gain, self.white[3])),
            filtered(&noisy(forces, &acceleration_gain, self.white[4])),
        );
        let mut log = Vec::new();
        for k in (0..steps).step_by(self.every) {
            let old = k.saturating_sub(self.late * self.every);
            let (seen, input) = (&states[old], &wrenches[k]);
            let rotation = seen.world_from_body * <UnitQuaternion<f64> as LieGroup>::exp(&(slow[1] + dice.vector(self.white[1])));
            let origin = seen.center - seen.world_from_body * body.center;
            let speed = seen.velocity - seen.world_from_body * seen.rate.cross(&body.center);
            let position = origin + slow[0] + dice.vector(self.white[0]);
            let rate = rates[old] + biases[0];
            let removed = rate.cross(&rate.cross(&lever));
            log.push(MotionSample {
                time_ns: i64::try_from(k).unwrap() * 8_000_000,
                world_from_body: Some(Pose::from_parts(position.into(), rotation)),
                velocity_origin_world: Some(speed + slow[2] + dice.vector(self.white[2])),
                rate_body: Some(rate),
                acceleration_origin_body: Some(forces[old] - removed + biases[1]),
                wrench_body: Some(Wrench::new(input.torque, input.force)),
                ..MotionSample::default()
            });
            for (slow, sigma) in slow.iter_mut().zip(self.wander) {
                *slow = *slow * decay + dice.vector(sigma * (1.0 - decay * decay).sqrt());
            }
        }
        log
    }
}

/// Error of `[ln m, c, J_C]`.
fn error(found: &FlightEstimate, truth: &InertialParameters<f64>) -> SVector<f64, 10> {
    use super::super::coordinates::Coordinates;
    Coordinates::of(&found.parameters).difference(&Coordinates::of(truth))
}

/// Free parameters, squared error of all in units of what is stated, and how many lie within 1.96.
fn judged(found: &FlightEstimate, truth: &InertialParameters<f64>) -> (usize, f64, usize) {
    let (error, std) = (error(found, truth), found.std());
    let free: Vec<usize> = (0..10).filter(|&i| std[i] > 0.0).collect();
    let n = free.len();
    let correlation =
        DMatrix::from_fn(n, n, |i, j| found.covariance[(free[i], free[j])] / (std[free[i]] * std[free[j]]));
    let z = DVector::from_fn(n, |i, _| error[free[i]] / std[free[i]]);
    let nees = correlation.cholesky().map_or(f64::INFINITY, |factor| z.dot(&factor.solve(&z)));
    (n, nees, z.iter().filter(|z| z.abs() < 1.96).count())
}

/// Mean squared error per parameter and coverage over seeds.
fn study(world: &World, told: &FlightLikelihood, seeds: core::ops::Range<u64>) -> (f64, f64) {
    let (mut free, mut nees, mut covered) = (0, 0.0, 0);
    for seed in seeds {
        let found = told.estimate(&world.log(seed)).unwrap();
        let (n, squared, inside) = judged(&found, &world.body());
        (free, nees, covered) = (free + n, nees + squared, covered + inside);
    }
    (nees / free as f64, covered as f64 / free as f64)
}

#[test]
fn scratch() {
    let world = World::exact();
    let found = world.told().estimate(&world.log(1)).unwrap();
    println!("exact {:e} {:?} {:?}", error(&found, &world.body()), found.levels, found.sweeps);
    let world = World::usual();
    println!("usual {:?}", study(&world, &world.told(), 1..13));
    let mut told = world.told();
    for e in [&mut told.sensing.position, &mut told.sensing.attitude, &mut told.sensing.velocity] { e.wander = Wander::Known { sigma: 0.0, time_s: 10.0 }; }
    println!("no wander {:?}", study(&world, &told, 1..5));
    let mut told = world.told(); (told.sensing.rate.filter, told.sensing.acceleration.filter) = (None, None);
    println!("no filter {:?}", study(&world, &told, 1..5));
    let found = told.estimate(&world.log(1)).unwrap(); println!("{:?} {:?}", found.std(), found.levels);
    let found = world.told().estimate(&world.log(1)).unwrap(); println!("{:?} {:?}", found.std(), found.levels);
    let mut told = world.told();
    for e in [&mut told.sensing.rate, &mut told.sensing.acceleration] { (e.scale_sigma, e.misalignment_sigma) = (0.0, 0.0); } told.sensing.doubted_scale_sigma = 0.0;
    println!("no gain {:?}", study(&world, &told, 1..5));
    let mut told = world.told(); (told.sensing.rate.bias_sigma, told.sensing.acceleration.bias_sigma) = (0.0, 0.0);
    println!("no bias {:?}", study(&world, &told, 1..5));
    for late in [9, 19] {
        let world = World { late, ..World::usual() };
        println!("late untold {:?}", study(&world, &world.told(), 1..5));
        let mut told = world.told(); let d = Delay::default(); (told.sensing.pose_delay, told.sensing.velocity_delay, told.sensing.rate.delay, told.sensing.acceleration.delay) = (d, d, d, d);
        println!("late told {:?}", study(&world, &told, 1..5)); println!("{:?}", told.estimate(&world.log(1)).unwrap().delays);
    }
    let world = World { planar: true, ..World::usual() };
    println!("planar {:?}", study(&world, &world.told(), 1..9));
    for b in [0.01, 100.0] { let world = World { body_scale: b, wrench_scale: b, ..World::usual() }; println!("body {b} {:?}", study(&world, &world.told(), 1..5)); }
    let _ = (Plane::Free, Thrusters::try_new(&[], &[], &[]), Column::Wrench, IdentificationError::WrenchBeside, told.estimate(&[]));
    let _: &dyn Estimator<Record = [MotionSample]> = &told;
}
