//! Maximum likelihood on simulated logs: accuracy, honesty, robustness, from any start.
#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic)]
#![allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)]

mod exact_motion;

use exact_motion::{Multisine, Random, Run, errors};
use tumble_identification::dynamics::InertialParameters;
use tumble_identification::lie::{LieGroup, Pose, Wrench};
use tumble_identification::nalgebra::{Matrix3, SVector, UnitQuaternion, Vector3};
use tumble_identification::{LikelihoodEstimate, MaximumLikelihood, MotionSample};

/// One standard deviation per sample and axis.
#[derive(Clone, Copy)]
struct Levels {
    pose: f64,
    torque: f64,
    force: f64,
    all_columns: bool,
}

const REALISTIC: Levels = Levels { pose: 1e-3, torque: 1e-4, force: 1e-3, all_columns: false };

fn cubesat() -> InertialParameters<f64> {
    let axes = Random::new(13).attitude().to_rotation_matrix().into_inner();
    let inertia = axes * Matrix3::from_diagonal(&Vector3::new(0.161, 0.139, 0.172)) * axes.transpose();
    InertialParameters::about_com(9.41, Vector3::new(0.031, -0.017, 0.052), inertia)
}

fn plate() -> InertialParameters<f64> {
    let axes = Random::new(14).attitude().to_rotation_matrix().into_inner();
    let inertia = axes * Matrix3::from_diagonal(&Vector3::new(0.08, 0.11, 0.19)) * axes.transpose();
    InertialParameters::about_com(6.0, Vector3::new(0.02, 0.03, 0.0), inertia)
}

/// Held multisine at 62.5 Hz, every column noisy; without `all_columns` poses and wrench only.
fn log(body: InertialParameters<f64>, duration_s: f64, levels: Levels, seed: u64) -> Vec<MotionSample> {
    let mut random = Random::new(seed);
    let signal = Multisine::random(&mut random, 0.04 / 1.7, 0.4 / 1.7, (0.31, 2.83), 3);
    let wrench = |t: f64| signal.at(t);
    let mut run = Run::new(body, &wrench, true);
    run.step_ns = 16_000_000;
    run.substep_s = 4e-3;
    run.samples = (duration_s / 0.016) as usize;
    let mut record = run.record();
    for sample in &mut record {
        let Levels { pose, torque, force, all_columns } = levels;
        sample.world_from_body.translation.vector += random.normal3(pose);
        sample.world_from_body.rotation *= <UnitQuaternion<f64> as LieGroup>::exp(&random.normal3(pose));
        sample.wrench_body =
            sample.wrench_body.map(|w| Wrench::new(w.torque + random.normal3(torque), w.force + random.normal3(force)));
        if all_columns {
            sample.rate_body = sample.rate_body.map(|w| w + random.normal3(pose));
            sample.velocity_origin_world = sample.velocity_origin_world.map(|v| v + random.normal3(pose));
            sample.acceleration_origin_body = sample.acceleration_origin_body.map(|a| a + random.normal3(10.0 * pose));
        } else {
            (sample.rate_body, sample.velocity_origin_world, sample.acceleration_origin_body) = (None, None, None);
        }
    }
    record
}

fn nees(found: &LikelihoodEstimate, truth: &InertialParameters<f64>) -> f64 {
    let error: SVector<f64, 10> = found.unconstrained - truth.to_vector();
    let scale = found.covariance.diagonal().map(|v| 1.0 / v.sqrt());
    let scaled = error.component_mul(&scale);
    let correlation = found.covariance.map_with_location(|i, j, v| v * scale[i] * scale[j]);
    scaled.dot(&correlation.cholesky().unwrap().solve(&scaled))
}

#[test]
fn realistic_logs() {
    for (name, body, duration_s, levels, runs) in [
        ("cubesat", cubesat(), 120.0, REALISTIC, 4),
        ("cubesat, all columns", cubesat(), 120.0, Levels { all_columns: true, ..REALISTIC }, 2),
        ("plate", plate(), 60.0, Levels { torque: 1e-3, force: 1e-2, ..REALISTIC }, 4),
        ("cubesat", cubesat(), 30.0, REALISTIC, 20),
    ] {
        let mut sum = 0.0;
        for seed in 0..runs {
            let record = log(body, duration_s, levels, 100 + seed);
            let start = std::time::Instant::now();
            let found = MaximumLikelihood::default().estimate(&record).unwrap();
            for i in &found.iterations {
                println!("   {:.3e} {:.3e} {:.3e}", i.cost, i.decrement, i.largest_defect);
            }
            let [mass, center, inertia] = errors(&found.parameters, &body);
            let nees = nees(&found, &body);
            sum += nees;
            println!(
                "{name} {seed}: mass {:.4} % center {:.4} mm inertia {:.4} % NEES {nees:.2} iterations {} M {} active {:?} {:.0} ms {:?}",
                100.0 * mass,
                1e3 * center,
                100.0 * inertia,
                found.iterations.len(),
                found.segment_samples,
                found.active_axis.is_some(),
                1e3 * start.elapsed().as_secs_f64(),
                found.noise
            );
        }
        println!("mean NEES {}", sum / runs as f64);
    }
}
