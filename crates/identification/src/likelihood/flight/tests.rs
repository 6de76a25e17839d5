//! The likelihood on logs of a small simulator: a rigid body under a held wrench, seen by sensors of which each error can be left out.

use super::super::flow::{Body, Input, State};
use super::fit::Fit;
use super::grid::Grid;
use super::{FlightEstimate, FlightLikelihood, Plane, Thrusters};
use crate::MotionSample;
use crate::dynamics::InertialParameters;
use crate::error::{Column, IdentificationError};
use crate::estimator::Estimator;
use crate::lie::{LieGroup, Pose, Wrench};
use crate::noise::Gaussian;
use crate::sensing::{Delay, LinearFilter, Sensing, Wander};
use crate::units::Units;
use nalgebra::{Matrix3, UnitQuaternion, Vector3};

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
    /// Factor on the frequencies of the wrench.
    speed: f64,
    /// Cargo, and the second at which it is taken.
    cargo: Option<(f64, InertialParameters<f64>)>,
    /// Wrenches per thrust, and what the thrusts really are of those logged.
    thrusters: Option<([[f64; 6]; 12], [f64; 12])>,
    /// One of them that also gives this whatever it is told, N.
    open: Option<(usize, f64)>,
    /// Momentum of wheels at the start, N m s; half of the torque is theirs.
    wheels: Option<Vector3<f64>>,
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
            speed: 1.0,
            cargo: None,
            thrusters: None,
            open: None,
            wheels: None,
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
            (triad.delay, triad.unknown_filter_s) = (Delay::NONE, 0.0);
            (triad.scale_sigma, triad.misalignment_sigma) = (0.01, 0.01);
        }
        (sensing.pose_delay, sensing.velocity_delay) = (Delay::NONE, Some(Delay::NONE));
        (sensing.lever_arm_sigma_m, sensing.lever_arm_taken_out_sigma_m) = (0.0, 0.0);
        sensing.lever_arm_body_m = LEVER;
        sensing
    }

    fn told(&self) -> FlightLikelihood {
        FlightLikelihood { sensing: self.sensing(), ..FlightLikelihood::default() }
    }

    fn wrench(&self, time_s: f64) -> ([f64; 3], [f64; 3]) {
        let wave = |i: usize| {
            let frequency = [0.11, 0.17, 0.13, 0.19, 0.23, 0.29][i] * core::f64::consts::TAU * self.speed;
            (frequency * time_s).sin() + 0.7 * (2.3 * frequency * time_s + i as f64).cos()
        };
        let (t, f) = (0.01 * self.wrench_scale * self.turn_scale, 0.15 * self.wrench_scale);
        if self.planar {
            ([0.0, 0.0, t * wave(2)], [f * wave(3), f * wave(4), 0.0])
        } else {
            ([t * wave(0), t * wave(1), t * wave(2)], [f * wave(3), f * wave(4), f * wave(5)])
        }
    }

    /// Thrusts of twelve thrusters, none negative.
    fn thrusts(time_s: f64) -> [f64; 12] {
        core::array::from_fn(|i| {
            let frequency = (0.09 + 0.017 * i as f64) * core::f64::consts::TAU;
            (0.15 * (frequency * time_s + i as f64).sin()).max(0.0)
        })
    }

    /// Rows: samples of the unit at which one is published.
    fn rows(&self, steps: usize, dice: &mut Gaussian) -> Vec<usize> {
        let (mut rows, mut k) = (Vec::new(), 0);
        while k < steps {
            rows.push(k);
            k += self.every;
            if self.uneven > 0.0 {
                k = k - 1 + crate::likelihood::whole(2.0 * dice.uniform());
            }
        }
        rows
    }

    fn log(&self, seed: u64) -> Vec<MotionSample> {
        let mut dice = Gaussian::from_seed(seed);
        let truth = self.body();
        let of = |body: &InertialParameters<f64>| Body::new(body.mass, body.center_of_mass(), body.inertia_about_com());
        let mut body = of(&truth);
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
        let rows = self.rows(steps, &mut dice);
        let (mut input, mut told) = (Input::default(), Input::default());
        let mut stored = self.wheels;
        let mut wheels = Vec::new();
        let mut centers = Vec::new();
        for k in 0..steps {
            if let Some((_, cargo)) = self.cargo.filter(|(taken_s, _)| k == crate::likelihood::whole(taken_s / FINE_S))
            {
                // Held at rest relative to the robot: neither place nor motion of its origin jumps.
                let before = body.center;
                body = of(&InertialParameters::from_vector(&(truth.to_vector() + cargo.to_vector())));
                let moved = state.world_from_body * (body.center - before);
                let turning = state.world_from_body * state.rate.cross(&(body.center - before));
                (state.center, state.velocity) = (state.center + moved, state.velocity + turning);
            }
            if rows.binary_search(&k).is_ok() {
                let time_s = k as f64 * FINE_S;
                let (torque, force) = self.wrench(time_s);
                input = Input { torque: torque.into(), force: force.into(), ..Input::default() };
                told = input;
                if let Some((columns, scales)) = &self.thrusters {
                    let thrusts = Self::thrusts(time_s);
                    let sum = |of: &dyn Fn(usize) -> f64| {
                        let part = |c: usize| (0..12).map(|i| columns[i][c] * of(i)).sum::<f64>();
                        let (torque, force) = ([0, 1, 2].map(part), [3, 4, 5].map(part));
                        Input { torque: torque.into(), force: force.into(), ..Input::default() }
                    };
                    told = sum(&|i| thrusts[i]);
                    let constant =
                        |i: usize| self.open.filter(|(open, _)| *open == i).map_or(0.0, |(_, thrust)| thrust);
                    input = sum(&|i| thrusts[i] * scales[i] + constant(i));
                }
            }
            wheels.push(stored);
            if let Some(stored) = &mut stored {
                let taken = input.torque * (-0.5 * FINE_S);
                input.stored = *stored + taken * 0.5;
                *stored += taken;
            }
            let step = body.step(&state, &input, &Vector3::zeros(), FINE_S);
            let arm = lever - body.center;
            let w = state.rate;
            let at_lever = input.force / body.mass + step.acceleration.cross(&arm) + w.cross(&w.cross(&arm));
            states.push(state);
            centers.push(body.center);
            rates.push(w);
            forces.push(at_lever);
            wrenches.push(told);
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
        for k in rows {
            let old = k.saturating_sub(self.late * self.every);
            let (seen, input) = (&states[old], &wrenches[k]);
            let rotation =
                seen.world_from_body * <UnitQuaternion<f64> as LieGroup>::exp(&(slow[1] + dice.vector(self.white[1])));
            let origin = seen.center - seen.world_from_body * centers[old];
            let speed = seen.velocity - seen.world_from_body * seen.rate.cross(&centers[old]);
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
                stored_momentum_body: wheels[k],
                ..MotionSample::default()
            });
            for (slow, sigma) in slow.iter_mut().zip(self.wander) {
                *slow = *slow * decay + dice.vector(sigma * (1.0 - decay * decay).sqrt());
            }
        }
        log
    }
}

/// Free parameters, squared error of all in units of what is stated, and how many lie within 1.96.
fn judged(found: &FlightEstimate, truth: &InertialParameters<f64>) -> (usize, f64, usize) {
    let (squared, n) = found.squared_error(truth);
    let z = found.error(truth).zip_map(&found.std(), |error, std| if std > 0.0 { error / std } else { f64::INFINITY });
    (n, squared, z.iter().filter(|z| z.abs() < 1.96).count())
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

/// A model without one of its terms has errors that it does not cover, or says by wider ones that something is amiss.
fn is_caught_without(change: fn(&mut Sensing)) {
    let world = World::usual();
    let complete = world.told();
    let mut told = complete.clone();
    change(&mut told.sensing);
    let (nees, covered) = study(&world, &told, 1..5);
    let widths = (1..5).map(|seed| {
        let [less, all] = [&told, &complete].map(|told| told.estimate(&world.log(seed)).unwrap().std());
        less.component_div(&all).max()
    });
    let wider = widths.sum::<f64>() / 4.0;
    println!("squared error {nees:.1}, covered {covered:.3}, widest sigma {wider:.1} times as wide");
    assert!(nees > 3.0 || wider > 3.0, "{nees} {covered} {wider}");
}

#[test]
fn exact_logs_give_the_exact_body() {
    let world = World::exact();
    let found = world.told().estimate(&world.log(1)).unwrap();
    let apart = found.error(&world.body());
    println!("ln m {:.1e}, c {:.1e} m, J {:.1e}", apart[0], apart.rows(1, 3).amax(), apart.rows(4, 6).amax());
    assert!(apart[0].abs() < 1e-6 && apart.rows(1, 3).amax() < 1e-7, "{apart}");
    assert!(apart.rows(4, 6).amax() < 1e-5 * 0.15, "{apart}");
    assert!(found.is_determined() && !found.planar && found.explained > 0.999_999);
}

/// So much that its torque is twice that of the wrench, where the body turns.
#[test]
fn what_wheels_hold_turns_the_body_along() {
    let wheels = Some(Vector3::new(0.04, -0.03, 0.05));
    let world = World { wheels, ..World::exact() };
    let apart = world.told().estimate(&world.log(1)).unwrap().error(&world.body());
    println!("ln m {:.1e}, c {:.1e} m, J {:.1e}", apart[0], apart.rows(1, 3).amax(), apart.rows(4, 6).amax());
    assert!(apart[0].abs() < 1e-6 && apart.rows(1, 3).amax() < 1e-6, "{apart}");
    assert!(apart.rows(4, 6).amax() < 1e-5 * 0.15, "{apart}");
    let world = World { wheels, ..World::usual() };
    let (nees, covered) = study(&world, &world.told(), 1..13);
    println!("squared error {nees:.2}, covered {covered:.3}");
    assert!((0.6..1.4).contains(&nees) && covered > 0.88, "{nees} {covered}");
    // untold it says so by errors of the wrench that are as large as the torque of the wheels
    let untold: Vec<_> = world.log(1).iter().map(|row| MotionSample { stored_momentum_body: None, ..*row }).collect();
    let [told, untold] = [&world.log(1), &untold].map(|log| {
        let levels = world.told().estimate(log).unwrap().levels;
        levels.wrench[0].hypot(levels.lasting[0])
    });
    println!("errors of the torque {told:.1e}, untold {untold:.1e} N m");
    assert!(untold > 30.0 * told, "{told} {untold}");
}

#[test]
fn what_is_stated_is_what_is_missed() {
    let world = World::usual();
    let (nees, covered) = study(&world, &world.told(), 1..13);
    // Mean of 12 times 10 squares of normal numbers, and their share within 1.96: both at three sigmas of chance.
    println!("squared error {nees:.2}, covered {covered:.3}");
    assert!((0.6..1.4).contains(&nees) && covered > 0.88, "{nees} {covered}");
}

/// Errors of a told wrench that change within seconds, N m and N: their level is found, and what they hide of the body is stated.
#[test]
fn errors_of_the_wrench_that_last_are_found() {
    const LASTING: [f64; 2] = [3e-4, 1.5e-2];
    let world = World::usual();
    let step_s = 0.016_f64;
    let decay = (-step_s / 4.0).exp();
    let (mut nees, mut free, mut covered) = (0.0, 0, 0);
    for seed in 1..13 {
        let mut dice = Gaussian::from_seed(900 + seed);
        let mut draw = |sigma: f64| Vector3::from_fn(|_, _| sigma * dice.normal());
        let mut errors = LASTING.map(&mut draw);
        let log: Vec<_> = world
            .log(seed)
            .into_iter()
            .map(|row| {
                let told = row.wrench_body.map(|w| Wrench::new(w.torque + errors[0], w.force + errors[1]));
                for (error, sigma) in errors.iter_mut().zip(LASTING) {
                    *error = *error * decay + draw(sigma * (1.0 - decay * decay).sqrt());
                }
                MotionSample { wrench_body: told, ..row }
            })
            .collect();
        let found = world.told().estimate(&log).unwrap();
        for (found, is) in found.levels.lasting.into_iter().zip(LASTING) {
            assert!((0.5..2.0).contains(&(found / is)), "{found:.1e} N m or N where it is {is:.1e}");
        }
        let (n, squared, inside) = judged(&found, &world.body());
        (free, nees, covered) = (free + n, nees + squared, covered + inside);
        // An exact wrench has none that would hide anything.
        let exact = world.told().estimate(&world.log(seed)).unwrap().levels.lasting;
        assert!(exact[0] < 0.01 * LASTING[0] && exact[1] < 0.01 * LASTING[1], "{exact:?}");
    }
    let (nees, covered) = (nees / free as f64, covered as f64 / free as f64);
    println!("squared error {nees:.2}, covered {covered:.3}");
    // Stated wider than missed: what shows of them may be of thrusts, whose gains would hide more.
    assert!((0.15..1.4).contains(&nees) && covered > 0.88, "{nees} {covered}");
}

#[test]
fn levels_delays_and_halves_are_those_of_the_log() {
    let world = World::usual();
    let found = world.told().estimate(&world.log(3)).unwrap();
    for (found, true_value) in found.levels.white.iter().zip(world.white) {
        assert!((found / true_value - 1.0).abs() < 0.15, "{found:?}");
    }
    for ((sigma, time_s), true_sigma) in found.levels.wander.iter().zip(world.wander) {
        let (rate, true_rate) = (sigma * sigma / time_s, true_sigma * true_sigma / world.wander_s);
        assert!((0.5..2.0).contains(&(rate / true_rate)), "{rate} {true_rate}");
    }
    assert!(found.halves.unwrap().chance() > 1e-3 && found.explained > 0.99);
    assert!(!found.acceleration_gain_sane || found.acceleration_gain_chi_square < 16.27);
}

/// Each term of the model is needed: left out, a named check of the study fails.
#[test]
fn without_its_wander_the_errors_show() {
    is_caught_without(|sensing| {
        for errors in [&mut sensing.position, &mut sensing.attitude, &mut sensing.velocity] {
            errors.wander = Wander::Known { sigma: 0.0, time_s: 10.0 };
        }
    });
}

#[test]
fn without_its_gains_the_errors_show() {
    is_caught_without(|sensing| {
        for triad in [&mut sensing.rate, &mut sensing.acceleration] {
            (triad.scale_sigma, triad.misalignment_sigma) = (0.0, 0.0);
        }
        sensing.doubted_scale_sigma = 0.0;
    });
}

#[test]
fn without_its_biases_the_errors_show() {
    is_caught_without(|sensing| (sensing.rate.bias_sigma, sensing.acceleration.bias_sigma) = (0.0, 0.0));
}

/// A filter that is neither described nor allowed for; allowed for, its delay and its width are found.
#[test]
fn without_its_filter_the_errors_are_not_covered_or_it_is_found() {
    let world = World { speed: 3.0, ..World::usual() };
    let mut told = world.told();
    (told.sensing.rate.filter, told.sensing.acceleration.filter) = (None, None);
    let (nees, covered) = study(&world, &told, 1..5);
    println!("not allowed for: squared error {nees:.1}, covered {covered:.3}");
    let right = world.told().estimate(&world.log(1)).unwrap().levels.white[3];
    let wrong = told.estimate(&world.log(1)).unwrap().levels.white[3];
    println!("level of the rate {wrong:.2e}, {right:.2e} with the filter");
    assert!(nees > 3.0 || wrong > 2.0 * right, "{nees} {wrong} {right}");
    for triad in [&mut told.sensing.rate, &mut told.sensing.acceleration] {
        (triad.unknown_filter_s, triad.delay) = (0.1, Delay::default());
    }
    let (nees, covered) = study(&world, &told, 1..7);
    let found = told.estimate(&world.log(1)).unwrap();
    println!("allowed for: squared error {nees:.2}, covered {covered:.3}, {:?}", found.delays);
    assert!((0.4..1.6).contains(&nees) && covered > 0.85, "{nees} {covered}");
    // The filter's delay, and half a step for the wrench that is held from the row on.
    let delay = low_pass().delay_samples() * FINE_S;
    let late = found.delays[2].unwrap();
    assert!((late.value_s - delay).abs() < 0.006, "{late:?} {delay}");
}

#[test]
fn late_streams_are_found_and_untold_are_not_covered() {
    for (late_rows, late_s) in [(9, 0.144), (19, 0.304)] {
        let world = World { late: late_rows, speed: 3.0, ..World::usual() };
        let mut told = world.told();
        let (nees, covered) = study(&world, &told, 1..4);
        println!("{late_s} s untold: squared error {nees:.1}, covered {covered:.3}");
        assert!(nees > 3.0 && covered < 0.85, "{nees} {covered}");
        told.sensing.pose_delay = Delay::default();
        told.sensing.velocity_delay = None;
        told.sensing.rate.delay = Delay::default();
        told.sensing.acceleration.delay = Delay::default();
        let (nees, covered) = study(&world, &told, 1..6);
        println!("{late_s} s told: squared error {nees:.2}, covered {covered:.3}");
        assert!((0.4..1.6).contains(&nees) && covered > 0.85, "{nees} {covered}");
        let found = told.estimate(&world.log(1)).unwrap();
        for delay in found.delays.into_iter().flatten() {
            assert!((delay.value_s - late_s).abs() < 4.0 * delay.std_s + 1e-4, "{delay:?}");
        }
    }
}

/// Before anything is known of the body, and of sensors of which nothing is said.
#[test]
fn late_streams_begin_where_they_answer_the_wrench() {
    for (late, seed) in [(0, 41), (6, 42), (15, 43)] {
        let world = World { late, filter: None, speed: 3.0, ..World::usual() };
        let told = FlightLikelihood::default();
        let grid = Grid::try_new(&world.log(seed), told.wrench_timing, &Vector3::zeros(), None).unwrap();
        let fit = Fit::aligned(&told, grid, false).unwrap();
        for stream in 1..4 {
            let (found, truth) = (fit.delay_s(stream), late as f64 * 2.0 * FINE_S);
            println!("{late} late, stream {stream}: {found} for {truth}");
            // The noise of velocities hides more.
            let near = if stream == 1 { 0.05 } else { 0.02 };
            assert!((found - truth).abs() < near, "{late}, {stream}: {found}");
        }
    }
}

#[test]
fn in_the_plane_four_are_answered_and_six_are_not_determined() {
    let world = World { planar: true, ..World::usual() };
    let told = world.told();
    let white = FlightLikelihood { wrench_noise: Some([1e-6, 1e-5]), ..told.clone() };
    let (nees, covered) = study(&world, &white, 1..9);
    println!("squared error {nees:.2}, covered {covered:.3}");
    assert!((0.4..1.8).contains(&nees) && covered > 0.84, "{nees} {covered}");
    // Untold of its wrench it allows for thrusts that look like another body, which this motion hardly tells apart.
    let (open, covered) = study(&world, &told, 1..9);
    println!("untold of the wrench: squared error {open:.2}, covered {covered:.3}");
    assert!((0.2..nees).contains(&open) && covered > 0.84, "{open} {covered}");
    let found = told.estimate(&world.log(1)).unwrap();
    assert!(found.planar);
    assert_eq!(found.determined, [true, true, true, false, false, false, false, false, false, true]);
    let finding = Estimator::estimate(&told, &world.log(1)).unwrap();
    assert!(finding.point().is_none());
}

/// Streams left out of a log.
fn keep(log: &[MotionSample], keep: [bool; 4]) -> Vec<MotionSample> {
    let kept = |sample: &MotionSample| MotionSample {
        world_from_body: sample.world_from_body.filter(|_| keep[0]),
        velocity_origin_world: sample.velocity_origin_world.filter(|_| keep[1]),
        rate_body: sample.rate_body.filter(|_| keep[2]),
        acceleration_origin_body: sample.acceleration_origin_body.filter(|_| keep[3]),
        ..*sample
    };
    log.iter().map(kept).collect()
}

#[test]
fn missing_streams_are_answered_at_their_own_bound() {
    let world = World::usual();
    let told = world.told();
    let all = told.estimate(&world.log(1)).unwrap().std()[0];
    for streams in [
        [true, true, true, false],
        [true, true, false, true],
        [true, false, true, true],
        [false, true, true, true],
        [true, true, false, false],
        [true, false, false, false],
        [false, false, true, true],
    ] {
        let (mut nees, mut free, mut sigma) = (0.0, 0, 0.0);
        for seed in 1..4 {
            let found = told.estimate(&keep(&world.log(seed), streams)).unwrap();
            let (n, squared, _) = judged(&found, &world.body());
            (nees, free, sigma) = (nees + squared, free + n, found.std()[0]);
        }
        println!(
            "{streams:?}: squared error {:.2}, sigma of mass {:.2} %, {:.2} % with all",
            nees / free as f64,
            100.0 * sigma,
            100.0 * all
        );
        assert!(nees / (free as f64) < 2.0 && sigma > 0.99 * all, "{streams:?}: {nees} {sigma} {all}");
    }
}

#[test]
fn bodies_rates_and_steps_of_any_size() {
    for change in [
        |world: &mut World| (world.body_scale, world.wrench_scale) = (0.01, 0.01),
        |world: &mut World| (world.body_scale, world.wrench_scale) = (100.0, 100.0),
        |world: &mut World| world.every = 6,
        |world: &mut World| world.every = 1,
        |world: &mut World| world.uneven = 1.0,
    ] {
        let mut world = World { seconds: 30.0, ..World::usual() };
        change(&mut world);
        let (nees, covered) = study(&world, &world.told(), 1..4);
        println!(
            "{} {} {}: squared error {nees:.2}, covered {covered:.3}",
            world.body_scale, world.every, world.uneven
        );
        assert!((0.3..1.8).contains(&nees), "{nees} {covered}");
    }
}

/// Poses at 6 Hz beside the rest at 62.5 Hz, rows lost, and a jump of the localisation.
#[test]
fn seldom_poses_gaps_and_jumps_are_taken_as_they_are() {
    let world = World::usual();
    let (mut nees, mut free) = (0.0, 0);
    for seed in 1..4 {
        let mut log = world.log(seed);
        for (k, sample) in log.iter_mut().enumerate() {
            if k % 10 != 0 {
                sample.world_from_body = None;
            }
        }
        let mut k = 0;
        log.retain(|_| {
            k += 1;
            k % 13 != 0 && !(600..650).contains(&k)
        });
        let found = world.told().estimate(&log).unwrap();
        let (n, squared, _) = judged(&found, &world.body());
        (nees, free) = (nees + squared, free + n);
    }
    println!("squared error {:.2}", nees / free as f64);
    assert!(nees / (free as f64) < 2.0);
    let mut log = world.log(1);
    for sample in &mut log[900..930] {
        sample.world_from_body = sample.world_from_body.map(|pose| {
            Pose::from_parts((pose.translation.vector + Vector3::new(0.3, -0.2, 0.1)).into(), pose.rotation)
        });
    }
    let found = world.told().estimate(&log).unwrap();
    let (n, squared, _) = judged(&found, &world.body());
    println!("with a jump: squared error {:.2}", squared / n as f64);
    assert!(squared / (n as f64) < 2.5);
}

#[test]
fn a_log_at_rest_determines_nothing() {
    let world = World { wrench_scale: 0.0, ..World::usual() };
    for plane in [Plane::Found, Plane::Planar] {
        let told = FlightLikelihood { plane, ..world.told() };
        let found = told.estimate(&world.log(1));
        println!("{:?}", found.as_ref().map(|found| (found.determined, found.parameters.mass, found.std()[0])));
        let found = found.unwrap();
        assert_eq!(found.determined, [false; 10]);
        assert!(found.parameters.to_vector().iter().all(|x| x.is_finite()));
        assert!(Estimator::estimate(&told, &world.log(1)).unwrap().point().is_none());
    }
}

/// Torque and force per thrust of twelve thrusters around a body.
fn twelve() -> [[f64; 6]; 12] {
    core::array::from_fn(|i| {
        let (axis, sign) = (i % 3, if i < 6 { 1.0 } else { -1.0 });
        let side = if (i / 3) % 2 == 0 { 1.0 } else { -1.0 };
        let direction: Vector3<f64> = Vector3::ith(axis, sign);
        let place: Vector3<f64> = Vector3::ith((axis + 1) % 3, 0.1 * side) + Vector3::ith((axis + 2) % 3, 0.03 * sign);
        let torque = place.cross(&direction);
        [torque.x, torque.y, torque.z, direction.x, direction.y, direction.z]
    })
}

/// Twelve thrusters, all off by a per cent, one by thirty: it is named, freed, and none else.
#[test]
fn a_weak_thruster_is_named_and_freed() {
    let columns = twelve();
    for (weak, factor) in [(None, 1.0), (Some(4), 0.7), (Some(9), 0.0)] {
        let mut world = World::usual();
        let mut dice = Gaussian::from_seed(11);
        let mut scales: [f64; 12] = core::array::from_fn(|_| 1.0 + 0.01 * dice.normal());
        if let Some(weak) = weak {
            scales[weak] = factor;
        }
        world.thrusters = Some((columns, scales));
        let log = world.log(2);
        let thrusts: Vec<f64> = log.iter().flat_map(|sample| World::thrusts(sample.time_ns as f64 * 1e-9)).collect();
        let mut told = world.told();
        told.thrusters = Some(Thrusters::try_new(&columns, &[0.01; 12], &thrusts).unwrap());
        let found = told.estimate(&log).unwrap();
        let thrusters = found.thrusters.as_ref().unwrap();
        let (n, squared, _) = judged(&found, &world.body());
        println!("{weak:?}: {:?}, squared error {:.2}", thrusters.suspects, squared / n as f64);
        assert_eq!(thrusters.suspects, weak.into_iter().collect::<Vec<_>>());
        assert!(squared / (n as f64) < 2.5);
        for (i, scale) in thrusters.scale.iter().enumerate() {
            assert!((scale - scales[i]).abs() < 4.0 * thrusters.std[i], "{i}: {scale} {}", scales[i]);
        }
    }
}

/// What a plain log has of it, poses and rates alone, the delay unknown: one is dead, one is open whatever it is told, none is anything.
#[test]
fn a_dead_and_a_stuck_thruster_are_named_on_a_plain_log() {
    let columns = twelve();
    for (bad, stuck) in [(None, false), (Some(3), false), (Some(6), true)] {
        for seed in 1..=2 {
            let mut world = World { white: [1e-3, 1e-3, 0.0, 2e-3, 0.0], seconds: 60.0, ..World::exact() };
            world.filter = None;
            let mut dice = Gaussian::from_seed(30 + seed);
            let mut scales: [f64; 12] = core::array::from_fn(|_| 1.0 + 0.01 * dice.normal());
            if let Some(bad) = bad {
                scales[bad] = 0.0;
                world.open = stuck.then_some((bad, 0.15));
            }
            world.thrusters = Some((columns, scales));
            let log = keep(&world.log(seed), [true, false, true, false]);
            let thrusts: Vec<f64> =
                log.iter().flat_map(|sample| World::thrusts(sample.time_ns as f64 * 1e-9)).collect();
            let told = FlightLikelihood {
                thrusters: Some(Thrusters::try_new(&columns, &[0.01; 12], &thrusts).unwrap()),
                ..FlightLikelihood::default()
            };
            let found = told.estimate(&log).unwrap();
            let thrusters = found.thrusters.as_ref().unwrap();
            let apart = (found.parameters.mass / world.body().mass).ln() / found.std()[0];
            println!("{bad:?} {seed}: {:?}, mass off by {apart:.1} sigma", thrusters.suspects);
            assert_eq!(thrusters.suspects, bad.into_iter().collect::<Vec<_>>());
            assert!(apart.abs() < 3.0);
            let constant = bad.and_then(|bad| thrusters.constant_n[bad]);
            assert_eq!(constant.is_some(), stuck);
            if let (Some(bad), Some(constant)) = (bad, constant) {
                assert!((constant.value - 0.15).abs() < 4.0 * constant.std + 0.003, "{constant:?}");
                assert!(thrusters.scale[bad].abs() < 4.0 * thrusters.std[bad]);
            }
        }
    }
}

/// The same thrusters, all off by two per cent, where nobody tells of them: what is stated of the body still covers it.
#[test]
fn thrusters_that_nobody_tells_of_are_doubted() {
    let (mut count, mut all, mut worst) = (0, 0.0, 0.0_f64);
    for seed in 1..=6 {
        let mut world = World::usual();
        let mut dice = Gaussian::from_seed(70 + seed);
        world.thrusters = Some((twelve(), core::array::from_fn(|_| 1.0 + 0.02 * dice.normal())));
        let found = world.told().estimate(&world.log(seed)).unwrap();
        let (n, squared, _) = judged(&found, &world.body());
        let largest = found.error(&world.body()).component_div(&found.std()).amax();
        println!("{seed}: squared error {:.2}, largest {largest:.1} sigma", squared / n as f64);
        (count, all, worst) = (count + n, all + squared, worst.max(largest));
    }
    assert!(all / (count as f64) < 1.3, "{}", all / count as f64);
    assert!(worst < 4.0, "{worst}");
}

#[test]
fn records_and_sensors_that_cannot_be_are_refused() {
    let world = World { seconds: 5.0, ..World::usual() };
    let told = world.told();
    let log = world.log(1);
    let changed = |change: fn(&mut Vec<MotionSample>)| {
        let mut log = log.clone();
        change(&mut log);
        told.estimate(&log).map(|found| found.sweeps)
    };
    assert!(matches!(changed(|log| log.truncate(20)), Err(IdentificationError::TooFewSamples { .. })));
    assert_eq!(
        changed(|log| log[7].rate_body = Some(Vector3::repeat(f64::NAN))),
        Err(IdentificationError::NotFinite { row: 7 })
    );
    assert_eq!(
        changed(|log| log[7].time_ns = log[6].time_ns),
        Err(IdentificationError::TimesNotIncreasing { index: 7 })
    );
    assert_eq!(
        changed(|log| log.iter_mut().for_each(|s| s.wrench_body = None)),
        Err(IdentificationError::MissingColumn(Column::Wrench))
    );
    assert_eq!(
        changed(|log| log.iter_mut().for_each(|s| (s.world_from_body, s.rate_body) = (None, None))),
        Err(IdentificationError::MissingColumn(Column::Attitude))
    );
    let impossible =
        |told: FlightLikelihood| matches!(told.estimate(&log), Err(IdentificationError::ImpossibleSensing { .. }));
    assert!(impossible(FlightLikelihood { segment_s: 0.0, ..told.clone() }));
    assert!(impossible(FlightLikelihood { wrench_noise: Some([1e-5, -1.0]), ..told.clone() }));
    let mut sensing = told.sensing.clone();
    sensing.pose_delay.sigma_s = f64::NAN;
    assert!(impossible(FlightLikelihood { sensing, ..told.clone() }));
    let few = Thrusters::try_new(&[[1.0; 6]], &[0.01], &[0.0; 3]).unwrap();
    let told = FlightLikelihood { thrusters: Some(few), ..told };
    assert!(matches!(told.estimate(&log), Err(IdentificationError::RecordShape { .. })));
    assert!(Thrusters::try_new(&[[1.0; 6]; 2], &[0.01; 2], &[0.0; 3]).is_err());
    assert!(Thrusters::try_new(&[[1.0; 6]], &[-0.01], &[0.0; 3]).is_err());
    assert!(Thrusters::try_new(&[], &[], &[]).is_err());
}

/// Two kilograms at arm's length, taken after forty seconds of eighty.
fn with_cargo(factor: f64) -> World {
    let cargo = InertialParameters::about_com(2.0, Vector3::new(0.2, 0.05, -0.02), Matrix3::identity() * 0.01);
    let cargo = InertialParameters::from_vector(&(cargo.to_vector() * factor));
    World { seconds: 80.0, cargo: Some((40.0, cargo)), ..World::usual() }
}

#[test]
fn cargo_is_weighed_by_the_bodies_before_and_after() {
    let world = with_cargo(1.0);
    let (_, cargo) = world.cargo.unwrap();
    let (mut square, mut seeds) = (0.0, 0);
    for seed in 200..206 {
        let log = world.log(seed);
        let stages = world.told().stages(&log).unwrap();
        let [place] = &stages.changes[..] else { panic!("{:?}", stages.changes) };
        let time_s = |sample: usize| log[sample].time_ns as f64 * 1e-9;
        let [before, likeliest, after] = [place.last_before, place.likeliest, place.first_after].map(time_s);
        assert!(before < 40.0 && 40.0 < after && (likeliest - 40.0).abs() < 0.2, "{before} {likeliest} {after}");
        let (difference, covariance) = stages.difference(0);
        let z = (difference[0] - cargo.mass) / covariance[(0, 0)].sqrt();
        let alone = stages.covariance[(0, 0)] + stages.covariance[(10, 10)];
        println!("{seed}: {likeliest:.2} s, {:.3} +- {:.3} kg", difference[0], covariance[(0, 0)].sqrt());
        // Gains of the accelerometer are those of one instrument.
        assert!(z.abs() < 3.5 && covariance[(0, 0)] < 0.7 * alone, "{z} {} {alone}", covariance[(0, 0)]);
        (square, seeds) = (square + z * z, seeds + 1);
    }
    // Chi squared of six: beyond these bounds by chance once in a thousand on either side.
    assert!((0.3..22.5).contains(&square) && seeds == 6, "{square}");
}

#[test]
fn a_change_within_a_gap_is_placed_nowhere_in_it() {
    let world = with_cargo(1.0);
    let time_s = |sample: &MotionSample| sample.time_ns as f64 * 1e-9;
    let log: Vec<MotionSample> =
        world.log(213).into_iter().filter(|sample| !(38.0..42.5).contains(&time_s(sample))).collect();
    let stages = world.told().stages(&log).unwrap();
    let [place] = &stages.changes[..] else { panic!("{:?}", stages.changes) };
    let (before, after) = (time_s(&log[place.last_before]), time_s(&log[place.first_after]));
    assert!(before < 38.0 && 42.5 <= after && after - before < 6.0, "{before} {after}");
    let (difference, covariance) = stages.difference(0);
    assert!((difference[0] - 2.0).abs() < 3.5 * covariance[(0, 0)].sqrt(), "{} {}", difference[0], covariance[(0, 0)]);
}

/// A body of ten tons that takes two, of whose sensors nobody says anything: the record is taken in other units.
#[test]
fn heavy_bodies_are_told_apart_in_their_own_units() {
    let usual = with_cargo(1000.0);
    let world = World { body_scale: 1000.0, wrench_scale: 1000.0, ..usual };
    let log = world.log(215);
    assert!(Units::of_record(&log).record(&log).is_some());
    let stages = FlightLikelihood::default().stages(&log).unwrap();
    let [place] = &stages.changes[..] else { panic!("{:?}", stages.changes) };
    assert!((log[place.likeliest].time_ns as f64 * 1e-9 - 40.0).abs() < 0.5, "{place:?}");
    let (difference, covariance) = stages.difference(0);
    let sigma = covariance[(0, 0)].sqrt();
    println!("{} +- {sigma}, {}", difference[0], stages.bodies[0].mass);
    assert!((difference[0] - 2000.0).abs() < 3.5 * sigma && sigma < 400.0, "{} +- {sigma}", difference[0]);
    assert!((stages.bodies[0].mass / 9600.0 - 1.0).abs() < 0.1, "{}", stages.bodies[0].mass);
}

#[test]
fn cargo_that_nobody_would_notice_is_no_change() {
    assert!(with_cargo(0.0).told().stages(&with_cargo(0.0).log(210)).is_none());
    assert!(with_cargo(0.005).told().stages(&with_cargo(0.005).log(211)).is_none());
}

#[test]
fn a_part_too_short_says_nothing_of_changes() {
    let log = with_cargo(1.0).log(212);
    let told = World::usual().told();
    assert!(told.stages(&[]).is_none() && told.stages(&log[..40]).is_none());
    assert!(told.stages(&log[..log.len() / 2 - 200]).is_none());
}
