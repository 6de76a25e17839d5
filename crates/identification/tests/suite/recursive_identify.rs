//! The recursive methods of `identify` on whole records.
#![allow(clippy::cast_possible_truncation, clippy::cast_sign_loss, clippy::cast_possible_wrap)]

use crate::exact_motion::{Multisine, Run, errors, is_consistent};
use crate::random::Random;
use tumble_identification::dynamics::strategies::body_d;
use tumble_identification::dynamics::{InertialParameters, LogCholesky, RigidBodyState};
use tumble_identification::lie::{Manifold, Pose, Wrench};
use tumble_identification::nalgebra::{Matrix3, SMatrix, SVector, UnitQuaternion, Vector3, Vector6};
use tumble_identification::recursive::{
    ChiSquareGate, ExtendedKalmanFilter, JointMotion, JointObservation, JointState, MotionNoise,
};
use tumble_identification::{BodyScale, Estimate, MotionSample, Settings, WrenchTiming, identify};

fn cube_flyer() -> InertialParameters<f64> {
    InertialParameters::about_com(
        9.4,
        Vector3::new(0.031, -0.017, 0.052),
        Matrix3::new(0.153, 0.004, -0.006, 0.004, 0.143, 0.003, -0.006, 0.003, 0.162),
    )
}

/// The realistic log of chapter 7 of the accuracy study: 62.5 Hz, held multisine, everything noisy.
fn realistic(seed: u64, seconds: usize) -> Vec<MotionSample> {
    let mut random = Random::new(seed);
    let signal = Multisine::random(&mut random, 0.04, 0.4, (0.3, 3.0), 5);
    let wrench = |t: f64| signal.at(t);
    let mut run = Run::new(cube_flyer(), &wrench, true);
    run.step_ns = 16_000_000;
    run.samples = seconds * 125 / 2;
    let mut record = run.record();
    for sample in &mut record {
        let noise = |random: &mut Random, sigma: f64| random.normal3(sigma);
        let (turn, shift) = (noise(&mut random, 1e-3), noise(&mut random, 1e-3));
        let attitude = sample.world_from_body.unwrap().rotation * UnitQuaternion::from_scaled_axis(turn);
        sample.world_from_body =
            Some(Pose::from_parts((sample.world_from_body.unwrap().translation.vector + shift).into(), attitude));
        sample.rate_body = sample.rate_body.map(|w| w + noise(&mut random, 1e-3));
        sample.velocity_origin_world = sample.velocity_origin_world.map(|v| v + noise(&mut random, 1e-3));
        sample.acceleration_origin_body = sample.acceleration_origin_body.map(|a| a + noise(&mut random, 1e-2));
        sample.wrench_body = sample
            .wrench_body
            .map(|w| Wrench::new(w.torque + noise(&mut random, 1e-4), w.force + noise(&mut random, 1e-3)));
    }
    record
}

fn nees(estimate: &Estimate, truth: &InertialParameters<f64>) -> f64 {
    let size = BodyScale::of(&truth.to_vector()).unwrap().parameter_magnitudes();
    let error = (estimate.parameters.to_vector() - truth.to_vector()).component_div(&size);
    let scaled = SMatrix::<f64, 10, 10>::from_fn(|i, j| estimate.covariance[(i, j)] / (size[i] * size[j]));
    (error.transpose() * scaled.try_inverse().unwrap() * error).x
}

#[test]
fn rows_in_the_order_of_time_give_what_the_batch_gives() {
    for seed in 0..4 {
        let mut random = Random::new(seed);
        let signal = Multisine::random(&mut random, 0.5, 1.0, (0.5, 3.0), 4);
        let wrench = |t: f64| signal.at(t);
        let mut run = Run::new(body_d(), &wrench, seed % 2 == 0);
        run.step_ns = 50_000_000;
        run.samples = 400;
        let mut record = run.record();
        if seed > 1 {
            for sample in &mut record {
                let noise = Vector6::from_fn(|_, _| 1e-3 * random.normal());
                sample.wrench_body = sample.wrench_body.map(|w| w + noise.into());
            }
        }
        let wrench_timing = if run.held { WrenchTiming::Held } else { WrenchTiming::Sampled };
        let settings = Settings { wrench_timing, ..Settings::default() };
        let batch = identify(&record, &settings).unwrap().estimate.unwrap();
        for method in ["rls", "recursive-sdp"] {
            let found = identify(&record, &Settings { method, ..settings }).unwrap();
            assert_eq!((found.method, found.rank), (method, 10));
            let estimate = found.estimate.unwrap();
            let size = BodyScale::of(&body_d().to_vector()).unwrap().parameter_magnitudes();
            let apart = (estimate.parameters.to_vector() - batch.parameters.to_vector()).component_div(&size);
            assert!(apart.amax() < 1e-6, "seed {seed} {method:?}: {apart}");
        }
    }
}

#[test]
fn filters_of_the_joint_state_are_honest_on_a_realistic_log() {
    let truth = cube_flyer();
    for method in ["ekf", "ukf"] {
        let (mut sum, mut worst) = (0.0, [0.0_f64; 3]);
        // The sigma points cost ten times as much.
        let runs = if method == "ukf" { 1 } else { 2 };
        for seed in 0..runs {
            let record = realistic(seed, 20);
            let found = identify(&record, &Settings { method, ..Settings::default() }).unwrap();
            assert_eq!((found.method, found.rank), (method, 10), "seed {seed} {:?}", found.warnings);
            let estimate = found.estimate.unwrap();
            assert!(is_consistent(&estimate.parameters));
            let errors = errors(&estimate.parameters, &truth);
            println!("{method:?} {seed}: {errors:?} nees {}", nees(&estimate, &truth));
            worst = std::array::from_fn(|i| worst[i].max(errors[i]));
            sum += nees(&estimate, &truth);
        }
        let mean = sum / runs as f64;
        println!("{method:?}: mean nees {mean:.2}, worst {worst:?}");
        // 99.9 % of the mean of two chi-squares of ten degrees: 45.3 / 2; of one 29.6.
        assert!(mean < if runs == 1 { 29.6 } else { 22.7 }, "{mean}");
        assert!(worst[0] < 5e-3 && worst[1] < 5e-4 && worst[2] < 5e-3, "{worst:?}");
    }
}

#[test]
fn nothing_is_invented_without_a_wrench() {
    let mut record = realistic(9, 20);
    for sample in &mut record {
        sample.wrench_body = Some(Wrench::zero());
    }
    for method in ["rls", "recursive-sdp", "ekf", "ukf"] {
        let found = identify(&record, &Settings { method, ..Settings::default() }).unwrap();
        assert!(found.estimate.is_none() && found.rank < 10, "{method:?} {}", found.rank);
    }
}

/// Ten parameters by the joint filter on poses alone, from a start that knows the body to a part in a hundred.
fn tracked(
    record: &[MotionSample],
    seed: u64,
    gate: Option<ChiSquareGate>,
) -> (SVector<f64, 10>, SMatrix<f64, 10, 10>) {
    let noise = MotionNoise {
        attitude_rad: 1e-3,
        position_m: 1e-3,
        rate_rad_s: 1e-3,
        velocity_m_s: 1e-3,
        acceleration_m_s2: 1e-2,
        torque_n_m: 1e-4,
        force_n: 1e-3,
        drift: SVector::zeros(),
    };
    let body = LogCholesky::try_from_parameters(&cube_flyer()).unwrap();
    let deviation = SVector::<f64, 22>::from_fn(|i, _| match i {
        0..=11 => 1e-4,
        12 | 16..=18 => 0.01,
        _ => 1e-3,
    });
    let mut random = Random::new(1000 + seed);
    let off = deviation.map(|s| s * random.normal());
    let truth = JointState { motion: RigidBodyState::at_rest(), body };
    let model = JointMotion { noise, gravity_world: Vector3::zeros() };
    let covariance = SMatrix::from_diagonal(&deviation.map(|s| s * s));
    let mut filter = ExtendedKalmanFilter::new(model, truth.oplus(&off), covariance);
    if let Some(gate) = gate {
        filter = filter.with_gate(gate);
    }
    for pair in record.windows(2) {
        filter
            .update_rows(&JointObservation {
                step_s: 0.016,
                wrench_body: pair[0].wrench_body.unwrap(),
                stored_body: Vector3::zeros(),
                world_from_body: pair[1].world_from_body,
                rate_body: None,
                velocity_origin_world: None,
                acceleration_origin_body: None,
            })
            .unwrap();
    }
    (filter.parameters(), filter.covariance())
}

/// Errors in standard deviations of the clean run, root mean square over runs and parameters: clean, spiked and gated,
/// spiked without a gate.
#[test]
fn the_gate_keeps_pose_spikes_out_of_the_joint_filter() {
    const RUNS: u64 = 32;
    let truth = cube_flyer().to_vector();
    let gate = ChiSquareGate::try_new(0.99).unwrap();
    let mut sums = [0.0; 3];
    for seed in 0..RUNS {
        let clean = realistic(100 + seed, 30);
        let mut random = Random::new(2000 + seed);
        let mut spiked = clean.clone();
        for sample in &mut spiked {
            if random.uniform(0.0, 1.0) < 0.01 {
                let mut spike = || Vector3::from_fn(|_, _| random.uniform(-1.0, 1.0).signum() * 1e-2);
                let (turn, shift) = (spike(), spike());
                let pose = sample.world_from_body.unwrap();
                let attitude = pose.rotation * UnitQuaternion::from_scaled_axis(turn);
                sample.world_from_body = Some(Pose::from_parts((pose.translation.vector + shift).into(), attitude));
            }
        }
        let (found, covariance) = tracked(&clean, seed, None);
        let deviation = covariance.diagonal().map(f64::sqrt);
        let square = |found: SVector<f64, 10>| (found - truth).component_div(&deviation).norm_squared();
        sums[0] += square(found);
        sums[1] += square(tracked(&spiked, seed, Some(gate)).0);
        sums[2] += square(tracked(&spiked, seed, None).0);
    }
    let [clean, gated, open] = sums.map(|sum| (sum / (10 * RUNS) as f64).sqrt());
    println!("rms in standard deviations: clean {clean:.3}, gated {gated:.3}, without a gate {open:.3}");
    assert!(gated < 1.1 * clean, "{gated} {clean}");
    assert!(open > 1.2 * clean, "spikes that do no harm test nothing: {open} {clean}");
}
