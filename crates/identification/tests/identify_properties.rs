//! `identify` as a user meets it: fresh bodies, clocks, frames and noise; what it says when it cannot know.
#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic)]

mod exact_motion;

use exact_motion::{Multisine, Random, Run, body_d, errors, is_consistent};
use tumble_identification::dynamics::InertialParameters;
use tumble_identification::lie::{LieGroup, Pose, Wrench};
use tumble_identification::nalgebra::{Matrix3, Translation3, UnitQuaternion, Vector3};
use tumble_identification::{
    Column, Identification, IdentificationError, Method, MotionSample, Prior, Settings, Warning, WrenchTiming,
    identify, predict, validate,
};

/// Mass 0.05 to 500 kg, centre of mass to 0.5 m, ratio of principal inertias to 50, any axes.
fn fresh_body(random: &mut Random) -> (InertialParameters<f64>, f64) {
    let mass = random.magnitude(0.05, 500.0);
    let length = random.magnitude(0.1, 1.0) * mass.powf(1.0 / 3.0) / 2.0;
    // Second moments of mass with a spread of fifty bound the ratio of inertias by fifty too.
    let moments = Vector3::from_fn(|_, _| random.magnitude(1.0 / 50.0, 1.0)) * (mass * length * length);
    let inertia = Matrix3::from_diagonal(&(Vector3::repeat(moments.sum()) - moments));
    let axes = random.attitude().to_rotation_matrix().into_inner();
    let center = random.direction() * random.uniform(0.0, 0.5);
    (InertialParameters::about_com(mass, center, axes * inertia * axes.transpose()), length)
}

struct Scenario {
    body: InertialParameters<f64>,
    record: Vec<MotionSample>,
    settings: Settings,
    step_s: f64,
}

/// A tumbling body somewhere within 100 m of the origin on a clock that counts from 1970.
fn scenario(seed: u64) -> Scenario {
    let mut random = Random::new(seed);
    let (body, length) = fresh_body(&mut random);
    let rate_hz = random.magnitude(5.0, 1000.0);
    let step_ns = (1e9 / rate_hz).round() as i64;
    let step_s = step_ns as f64 * 1e-9;
    let held = seed.is_multiple_of(2);
    // Forces act about the centre of mass with a lever of the body's own size.
    let smallest = body.inertia_about_com().symmetric_eigenvalues().min();
    let force = 0.3 * body.mass;
    let torque = 0.6 * smallest;
    let signal = Multisine::random(&mut random, torque, force, (0.5, 3.0), 4);
    let center = body.center_of_mass();
    let wrench = move |t: f64| {
        let w = signal.at(t);
        Wrench::new(w.torque + center.cross(&w.force), w.force)
    };
    let mut run = Run::new(body, &wrench, held);
    run.step_ns = step_ns;
    run.samples = ((20.0 / step_s) as usize).clamp(200, 4000);
    run.substep_s = 5e-3;
    run.start_ns = 1_700_000_000_123_456_789;
    run.start = Pose::from_parts(Translation3::from(random.direction() * 100.0), random.attitude());
    run.velocity_world = random.normal3(0.3);
    run.rate_body = random.normal3(0.2);
    if seed.is_multiple_of(3) {
        run.gravity_world = random.direction() * 1.6;
    }
    let _ = length;
    let settings = Settings {
        wrench_timing: if held { WrenchTiming::Held } else { WrenchTiming::Sampled },
        gravity_world: run.gravity_world,
        ..Settings::default()
    };
    Scenario { body, record: run.record(), settings, step_s }
}

fn poses_only(record: &mut [MotionSample]) {
    for sample in record {
        (sample.velocity_origin_world, sample.rate_body, sample.acceleration_origin_body) = (None, None, None);
    }
}

fn check_consistent(found: &Identification) {
    for estimate in [found.estimate, found.regularised].into_iter().flatten() {
        assert!(is_consistent(&estimate.parameters), "{:?}", estimate.parameters);
        assert!(estimate.covariance.symmetric_eigenvalues().min() >= -1e-12 * estimate.covariance.amax());
    }
}

#[test]
fn fresh_bodies_are_recovered() {
    for seed in 0..40 {
        let Scenario { body, mut record, settings, step_s } = scenario(seed);
        poses_only(&mut record);
        let found = identify(&record, &settings).unwrap();
        check_consistent(&found);
        let e = errors(&found.estimate.map_or(found.regularised.unwrap().parameters, |e| e.parameters), &body);
        println!("{seed}: {:.1} Hz m {:.2} rank {} {:?} lag {} {e:?} {:?}", 1.0 / step_s, body.mass, found.rank, found.method, found.lag, found.warnings);
        assert_eq!(found.rank, 10, "seed {seed}: {:?}", found.null_directions);
    }
}

#[test]
fn monte_carlo_nees() {
    for held in [false, true] {
        for method in [Method::Variational, Method::Variational4, Method::Variational6] {
            let (mut nees, mut coverage, mut runs) = (0.0, 0, 0);
            for seed in 0..40 {
                let body = body_d();
                let mut random = Random::new(1000 + seed);
                let signal = Multisine::random(&mut random, 0.5, 1.2, (0.5, 1.2), 2);
                let wrench = |t: f64| signal.at(t);
                let mut run = Run::new(body, &wrench, held);
                run.samples = 601;
                run.substep_s = 1e-2;
                let mut record = run.record();
                for s in &mut record {
                    let w = s.wrench_body.unwrap();
                    s.wrench_body = Some(Wrench::new(w.torque + random.normal3(4.5e-3), w.force + random.normal3(4.5e-3)));
                }
                let settings = Settings {
                    method,
                    wrench_timing: if held { WrenchTiming::Held } else { WrenchTiming::Sampled },
                    ..Settings::default()
                };
                let found = identify(&record, &settings).unwrap();
                let estimate = found.estimate.unwrap();
                let error = estimate.parameters.to_vector() - body.to_vector();
                let q = (error.transpose() * estimate.covariance.try_inverse().unwrap() * error).x;
                nees += q;
                runs += 1;
                for i in 0..10 {
                    coverage += usize::from(error[i].abs() < 1.96 * estimate.covariance[(i, i)].sqrt());
                }
                if seed == 0 { println!("{:?} {:?}", found.noise, found.warnings); }
            }
            println!("held {held} {method:?}: NEES {} coverage {}", nees / f64::from(runs), coverage as f64 / f64::from(10 * runs));
        }
    }
}

#[test]
fn noisy_poses() {
    let body = InertialParameters::about_com(
        9.41,
        Vector3::new(0.031, -0.017, 0.052),
        Matrix3::new(0.153, 0.004, -0.006, 0.004, 0.143, 0.003, -0.006, 0.003, 0.162),
    );
    for (columns, method) in [(false, Method::Auto), (false, Method::Variational), (true, Method::Auto), (true, Method::NewtonEuler)] {
        for seed in 0..4 {
            let mut random = Random::new(50 + seed);
            let signal = Multisine::random(&mut random, 0.028, 0.28, (0.3, 2.8), 8);
            let wrench = |t: f64| signal.at(t);
            let mut run = Run::new(body, &wrench, true);
            (run.step_ns, run.samples, run.substep_s) = (16_000_000, 7500, 0.016);
            let mut record = run.record();
            for s in &mut record {
                s.world_from_body.translation.vector += random.normal3(1e-3);
                s.world_from_body.rotation *= <UnitQuaternion<f64> as LieGroup>::exp(&random.normal3(1e-3));
                s.rate_body = s.rate_body.map(|w| w + random.normal3(1e-3));
                s.velocity_origin_world = s.velocity_origin_world.map(|v| v + random.normal3(1e-3));
                s.wrench_body = s.wrench_body.map(|w| Wrench::new(w.torque + random.normal3(1e-4), w.force + random.normal3(1e-3)));
            }
            if !columns { poses_only(&mut record); }
            let settings = Settings { method, ..Settings::default() };
            let found = identify(&record, &settings).unwrap();
            check_consistent(&found);
            let body_found = found.estimate.or(found.regularised).unwrap();
            let error = body_found.parameters.to_vector() - body.to_vector();
            let q = (error.transpose() * body_found.covariance.try_inverse().unwrap() * error).x;
            println!("{columns} {method:?} {seed}: {:?} lag {} rank {} m {:.3} errors {:?} NEES {q:.1} {:?}", found.method, found.lag, found.rank, body_found.parameters.mass, errors(&body_found.parameters, &body), found.warnings);
        }
    }
}
