//! Time, scale and comparison methods on exact motion of whole bodies.
#![allow(clippy::cast_possible_truncation, clippy::cast_possible_wrap, clippy::cast_sign_loss)]

use crate::exact_motion::{Multisine, Run};
use crate::random::Random;
use tumble_identification::Verdict;
use tumble_identification::comparison::instrumental_variables;
use tumble_identification::dynamics::InertialParameters;
use tumble_identification::dynamics::strategies::body_d;
use tumble_identification::lie::{LieGroup, Pose};
use tumble_identification::nalgebra::{Matrix3, SVector, Translation3, UnitQuaternion, Vector3};
use tumble_identification::regressors::{ObserverFrame, PoseTriple, Regressor, variational};
use tumble_identification::synchronize::{Signals, delay};
use tumble_identification::{BodyScale, MotionSample, WrenchRow, WrenchTiming, whitened};

/// The record as a localisation reports it that is `delay_samples` late (whole samples move, the wrench stays).
fn late(record: &[MotionSample], delay_samples: usize) -> Vec<MotionSample> {
    record
        .windows(delay_samples + 1)
        .map(|window| MotionSample {
            wrench_body: window[delay_samples].wrench_body,
            time_ns: window[delay_samples].time_ns,
            ..window[0]
        })
        .collect()
}

fn without(record: &[MotionSample], rates: bool, velocities: bool, accelerations: bool) -> Vec<MotionSample> {
    let mut record = record.to_vec();
    for sample in &mut record {
        sample.rate_body = sample.rate_body.filter(|_| !rates);
        sample.velocity_origin_world = sample.velocity_origin_world.filter(|_| !velocities);
        sample.acceleration_origin_body = sample.acceleration_origin_body.filter(|_| !accelerations);
    }
    record
}

#[test]
fn the_delay_of_a_record_is_found_from_whatever_it_holds() {
    let mut random = Random::new(3);
    let signal = Multisine::random(&mut random, 0.02, 0.2, (0.3, 2.5), 6);
    let wrench = |t: f64| signal.at(t);
    let body = InertialParameters::about_com(9.4, Vector3::new(0.02, -0.01, 0.03), diagonal(0.15, 0.14, 0.16));
    for held in [true, false] {
        let mut run = Run::new(body, &wrench, held);
        (run.step_ns, run.samples, run.substep_s) = (16_000_000, 1900, 0.004);
        let record = run.record();
        let timing = if held { WrenchTiming::Held } else { WrenchTiming::Sampled };
        for samples in [0, 3] {
            for (rates, velocities, accelerations) in [(false, false, false), (false, false, true), (true, true, true)]
            {
                let record = without(&late(&record, samples), rates, velocities, accelerations);
                let signals = Signals::from_record(&record, timing, &Vector3::zeros()).unwrap();
                let found = delay(&signals, 0.2).unwrap();
                // Sampling and differentiation, far below the noise of any record.
                let error = found.delay_s - samples as f64 * 0.016;
                assert!(
                    error.abs() < 5e-6,
                    "held {held}, {samples} samples, {rates} {velocities} {accelerations}: {error:e} {found:?}"
                );
                assert_eq!(found.verdict, Verdict::Identifiable);
            }
        }
    }
}

fn diagonal(x: f64, y: f64, z: f64) -> Matrix3<f64> {
    Matrix3::from_diagonal(&Vector3::new(x, y, z))
}

/// Rows of the plain variational regressor, sampled wrench.
fn rows(record: &[MotionSample], poses: &[Pose<f64>], step_s: f64) -> Vec<WrenchRow> {
    (1..record.len() - 1)
        .map(|k| {
            let triple = [&poses[k - 1], &poses[k], &poses[k + 1]];
            let triple = PoseTriple::try_new(triple, step_s, step_s, &ObserverFrame::inertial()).unwrap();
            let wrench = record[k].wrench_body.unwrap().to_vector();
            WrenchRow { index: k, regressor: variational(&triple), wrench }
        })
        .collect()
}

#[test]
fn instruments_remove_the_attenuation_of_noisy_poses() {
    let body = body_d();
    let scale = BodyScale::of(&body.to_vector()).unwrap();
    let mut random = Random::new(11);
    let signal = Multisine::random(&mut random, 0.6, 1.25, (0.5, 1.1), 3);
    let wrench = |t: f64| signal.at(t);
    let mut run = Run::new(body, &wrench, false);
    (run.samples, run.substep_s) = (601, 0.01);
    let record = run.record();
    let poses: Vec<_> = record.iter().map(|sample| sample.world_from_body.unwrap()).collect();
    let exact = rows(&record, &poses, 0.05);
    let noisy = |random: &mut Random| -> Vec<Pose<f64>> {
        let sigma = 1e-4;
        poses
            .iter()
            .map(|pose| {
                let turn = <UnitQuaternion<f64> as LieGroup>::exp(&random.normal3(sigma));
                Pose::from_parts(
                    Translation3::from(pose.translation.vector + random.normal3(sigma)),
                    pose.rotation * turn,
                )
            })
            .collect()
    };
    // Instruments: the motion of a body whose mass and inertia are 15 % and more off, under the same wrench.
    let rough = InertialParameters::about_com(5.8, Vector3::zeros(), diagonal(1.2, 2.3, 2.5));
    let mut simulation = Run::new(rough, &wrench, false);
    (simulation.samples, simulation.substep_s) = (601, 0.01);
    let simulated: Vec<_> = simulation.record().iter().map(|sample| sample.world_from_body.unwrap()).collect();
    let instruments: Vec<Regressor<f64>> = rows(&record, &simulated, 0.05).iter().map(|row| row.regressor).collect();

    // With its own regressors as instruments the method is least squares.
    let own: Vec<Regressor<f64>> = exact.iter().map(|row| row.regressor).collect();
    let same = instrumental_variables(&exact, &own, (0.6, 1.0), scale).unwrap();
    let plain = whitened(&exact, 0.6, 1.0).unwrap().solve(&scale.parameter_magnitudes()).unwrap();
    assert!((same - plain).component_div(&scale.parameter_magnitudes()).amax() < 1e-9);

    let exact = instrumental_variables(&exact, &instruments, (0.6, 1.0), scale).unwrap();
    let runs = 40;
    let (mut attenuated, mut mean, mut square) = (0.0, SVector::<f64, 10>::zeros(), SVector::<f64, 10>::zeros());
    for _ in 0..runs {
        let rows = rows(&record, &noisy(&mut random), 0.05);
        let least = whitened(&rows, 0.6, 1.0).unwrap().solve(&scale.parameter_magnitudes()).unwrap();
        attenuated += (least[0] / body.mass - 1.0) / f64::from(runs);
        let found = instrumental_variables(&rows, &instruments, (0.6, 1.0), scale).unwrap();
        let error = (found - exact).component_div(&scale.parameter_magnitudes());
        mean += error / f64::from(runs);
        square += error.component_mul(&error) / f64::from(runs);
    }
    println!("mass: least squares {attenuated:.3}, instruments {:.5} +- {:.5}", mean[0], square[0].sqrt());
    assert!(attenuated < -0.1, "{attenuated}");
    // No bias that 40 runs could see: four standard errors, ten parameters.
    for (mean, square) in mean.iter().zip(&square) {
        assert!(
            mean.abs() < 4.0 * (square / f64::from(runs)).sqrt() && square.sqrt() < 0.01,
            "{mean} {}",
            square.sqrt()
        );
    }
}
