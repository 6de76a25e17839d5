//! The sliding window against the batch, against the truth, and on logs with dropouts and spikes.
#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic)]
#![allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)]

mod exact_motion;

use exact_motion::{Multisine, Random, Run};
use tumble_identification::dynamics::InertialParameters;
use tumble_identification::lie::{LieGroup, Wrench};
use tumble_identification::nalgebra::{Matrix3, SVector, UnitQuaternion, Vector3};
use tumble_identification::{
    FixedLag, FixedLagSettings, FixedLagStep, LikelihoodEstimate, MaximumLikelihood, MotionSample, Noise,
};

const POSE: f64 = 1e-3;
const TORQUE: f64 = 1e-4;
const FORCE: f64 = 1e-3;

fn cubesat() -> InertialParameters<f64> {
    let axes = Random::new(13).attitude().to_rotation_matrix().into_inner();
    let inertia = axes * Matrix3::from_diagonal(&Vector3::new(0.161, 0.139, 0.172)) * axes.transpose();
    InertialParameters::about_com(9.41, Vector3::new(0.031, -0.017, 0.052), inertia)
}

/// Held multisine at 62.5 Hz; noisy poses and wrenches.
fn log(duration_s: f64, seed: u64) -> Vec<MotionSample> {
    let mut random = Random::new(seed);
    let signal = Multisine::random(&mut random, 0.04 / 1.7, 0.4 / 1.7, (0.31, 2.83), 3);
    let wrench = |t: f64| signal.at(t);
    let mut run = Run::new(cubesat(), &wrench, true);
    run.step_ns = 16_000_000;
    run.substep_s = 4e-3;
    run.samples = (duration_s / 0.016) as usize;
    let mut record = run.record();
    for sample in &mut record {
        sample.world_from_body.translation.vector += random.normal3(POSE);
        sample.world_from_body.rotation *= <UnitQuaternion<f64> as LieGroup>::exp(&random.normal3(POSE));
        sample.wrench_body =
            sample.wrench_body.map(|w| Wrench::new(w.torque + random.normal3(TORQUE), w.force + random.normal3(FORCE)));
        (sample.rate_body, sample.velocity_origin_world, sample.acceleration_origin_body) = (None, None, None);
    }
    record
}

fn known() -> Noise {
    Noise { position_m: POSE, attitude_rad: POSE, torque_n_m: TORQUE, force_n: FORCE, ..Noise::default() }
}

fn settings() -> FixedLagSettings {
    let likelihood =
        MaximumLikelihood { noise: Some(known()), segment_samples: Some(16), ..MaximumLikelihood::default() };
    FixedLagSettings { likelihood, ..FixedLagSettings::default() }
}

fn slide(settings: FixedLagSettings, record: &[MotionSample]) -> (Vec<FixedLagStep>, LikelihoodEstimate) {
    let mut window = FixedLag::new(settings);
    let steps = record.iter().filter_map(|row| window.push(*row).unwrap()).collect();
    (steps, window.finish().unwrap())
}

/// `[ln m, c, J_C]`.
fn eta(body: &InertialParameters<f64>) -> SVector<f64, 10> {
    let (c, j) = (body.center_of_mass(), body.inertia_about_com());
    SVector::from([
        body.mass.ln(), c.x, c.y, c.z, j[(0, 0)], j[(0, 1)], j[(0, 2)], j[(1, 1)], j[(1, 2)], j[(2, 2)],
    ])
}

fn in_sigmas(a: &LikelihoodEstimate, b: &LikelihoodEstimate) -> f64 {
    (eta(&a.parameters) - eta(&b.parameters)).component_div(&b.std).amax()
}

fn nees(found: &LikelihoodEstimate, truth: &InertialParameters<f64>) -> f64 {
    let error: SVector<f64, 10> = found.unconstrained - truth.to_vector();
    let scale = found.covariance.diagonal().map(|v| 1.0 / v.sqrt());
    let scaled = error.component_mul(&scale);
    let correlation = found.covariance.map_with_location(|i, j, v| v * scale[i] * scale[j]);
    scaled.dot(&correlation.cholesky().unwrap().solve(&scaled))
}

#[test]
fn explore() {
    let (mut sum, mut sums1) = (0.0, 0.0);
    for seed in 0..16 {
        let record = log(60.0, 500 + seed);
        let batch = settings().likelihood.estimate(&record).unwrap();
        let start = std::time::Instant::now();
        let (steps, last) = slide(settings(), &record);
        let took = start.elapsed().as_secs_f64();
        let (_, one) = slide(FixedLagSettings { segments: 1, iterations: 1, ..settings() }, &record);
        sum += nees(&last, &cubesat());
        sums1 += nees(&one, &cubesat());
        let ratio = (eta(&last.parameters) - eta(&cubesat())).component_div(&batch.std);
        let nis: f64 = steps.iter().filter_map(|s| s.innovation).map(|i| i.nis / i.degrees as f64).sum::<f64>() / (steps.len() - 1) as f64;
        println!(
            "{seed}: batch nees {:.2} window {:.2} one {:.2}; away {:.3} {:.3}; rms ratio {:.2}; steps {} first {} nis {nis:.3} {:.3} ms",
            nees(&batch, &cubesat()), nees(&last, &cubesat()), nees(&one, &cubesat()),
            in_sigmas(&last, &batch), in_sigmas(&one, &batch), (ratio.norm_squared() / 10.0).sqrt(), steps.len(), steps[0].time_ns as f64 * 1e-9,
            1e3 * took / steps.len() as f64,
        );
    }
    println!("mean {} {}", sum / 16.0, sums1 / 16.0);
}

#[test]
fn a_window_over_everything_is_the_batch() {
    let record = log(20.0, 7);
    let likelihood = MaximumLikelihood { robust: false, ..settings().likelihood };
    let batch = likelihood.estimate(&record).unwrap();
    let wide = FixedLagSettings { segments: 1000, likelihood, ..settings() };
    let (_, found) = slide(wide, &record);
    println!("{:e} {} {}", in_sigmas(&found, &batch), found.cost, batch.cost);
    assert!(in_sigmas(&found, &batch) < 1e-6);
}
