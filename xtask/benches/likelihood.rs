//! Maximum likelihood of whole records: poses and wrenches, noise levels not given.
#![allow(missing_docs, clippy::unwrap_used, clippy::expect_used)]
#![allow(clippy::cast_possible_truncation, clippy::cast_sign_loss, clippy::cast_possible_wrap)]

#[path = "../../crates/identification/tests/suite/exact_motion/mod.rs"]
mod exact_motion;
#[path = "../../crates/identification/tests/suite/random.rs"]
mod random;

use crate::random::Random;
use criterion::{Criterion, criterion_group, criterion_main};
use exact_motion::{Multisine, Run};
use std::hint::black_box;
use std::time::{Duration, Instant};
use tumble_identification::dynamics::InertialParameters;
use tumble_identification::fourier::{AttitudeChart, FourierBasis, FourierMotion};
use tumble_identification::harmonics::{PeriodicRecord, cramer_rao, maximum_likelihood};
use tumble_identification::lie::{LieGroup, Wrench};
use tumble_identification::nalgebra::{DMatrix, Matrix3, SVector, UnitQuaternion, Vector3};
use tumble_identification::{FixedLag, FixedLagSettings, MaximumLikelihood, MotionSample, Noise};

fn record(samples: usize) -> Vec<MotionSample> {
    let mut random = Random::new(7);
    let inertia = Matrix3::new(0.160, 0.004, -0.003, 0.004, 0.142, 0.006, -0.003, 0.006, 0.170);
    let body = InertialParameters::about_com(9.41, Vector3::new(0.031, -0.017, 0.052), inertia);
    let signal = Multisine::random(&mut random, 0.028, 0.28, (0.3, 2.8), 6);
    let wrench = |t: f64| signal.at(t);
    let mut run = Run::new(body, &wrench, true);
    (run.step_ns, run.samples, run.substep_s) = (16_000_000, samples, 8e-3);
    let mut record = run.record();
    for sample in &mut record {
        sample.world_from_body.as_mut().unwrap().translation.vector += random.normal3(1e-3);
        sample.world_from_body.as_mut().unwrap().rotation *=
            <UnitQuaternion<f64> as LieGroup>::exp(&random.normal3(1e-3));
        sample.wrench_body =
            sample.wrench_body.map(|w| Wrench::new(w.torque + random.normal3(1e-4), w.force + random.normal3(1e-3)));
        (sample.rate_body, sample.velocity_origin_world, sample.acceleration_origin_body) = (None, None, None);
    }
    record
}

fn estimate(criterion: &mut Criterion) {
    let mut group = criterion.benchmark_group("maximum likelihood");
    group.sample_size(10);
    for samples in [600, 20_000] {
        let record = record(samples);
        group.bench_function(format!("{samples} poses"), |bencher| {
            bencher.iter(|| MaximumLikelihood::default().estimate(black_box(&record)).unwrap());
        });
    }
    group.finish();
}

/// Rows before the first step that is timed.
const BOOTSTRAP: usize = 1000;

/// One step of the window: the segments of 16 samples it holds, iterated, and the oldest summed up.
fn window(criterion: &mut Criterion) {
    let record = record(8000);
    let mut group = criterion.benchmark_group("fixed lag");
    for (segments, iterations) in [(4, 2), (1, 1)] {
        let likelihood = MaximumLikelihood { segment_samples: Some(16), ..MaximumLikelihood::default() };
        let settings = FixedLagSettings { likelihood, segments, iterations, ..FixedLagSettings::default() };
        group.bench_function(format!("step of {segments} segments, {iterations} iterations"), |bencher| {
            bencher.iter_custom(|steps| {
                let (mut took, mut done) = (Duration::ZERO, 0);
                while done < steps {
                    let mut window = FixedLag::new(settings.clone());
                    for row in &record[..BOOTSTRAP] {
                        window.push(*row).unwrap();
                    }
                    let begin = Instant::now();
                    for row in record[BOOTSTRAP..].iter().take(16 * (steps - done) as usize) {
                        done += u64::from(black_box(window.push(*row).unwrap()).is_some());
                    }
                    took += begin.elapsed();
                }
                took
            });
        });
    }
    group.finish();
}

/// One averaged period, all coefficients of the motion and the parameters at once.
fn periodic(criterion: &mut Criterion) {
    let body = InertialParameters::about_com(
        7.2,
        Vector3::new(0.03, -0.02, 0.04),
        Matrix3::new(0.075, 0.012, -0.008, 0.012, 0.062, 0.015, -0.008, 0.015, 0.081),
    );
    let noise = Noise { torque_n_m: 0.001, force_n: 0.01, attitude_rad: 0.03, position_m: 0.05, ..Noise::default() };
    let mut group = criterion.benchmark_group("one period");
    group.sample_size(10);
    for (samples, harmonics) in [(1000, 3), (6000, 10)] {
        let mut random = Random::new(7);
        let basis = FourierBasis::try_new(10.0, 3).unwrap();
        let rest = basis.rest_to_rest();
        let coefficients = &rest * DMatrix::from_fn(rest.ncols(), 6, |_, _| 0.3 * random.normal());
        let motion = FourierMotion::try_new(basis, AttitudeChart::EulerZyx, coefficients).unwrap();
        let channel_std = vec![0.016, 0.016, 0.016, 0.01, 0.01, 0.01];
        let wrench_std = SVector::from([3e-4, 3e-4, 3e-4, 3e-3, 3e-3, 3e-3]);
        let mut record = PeriodicRecord {
            period_s: 10.0,
            chart: motion.chart(),
            channels: DMatrix::zeros(samples, 6),
            wrenches: DMatrix::zeros(samples, 6),
            gravity: Vector3::zeros(),
            wrench_offset_s: 0.0,
            channel_std,
            wrench_std,
        };
        for (i, time_s) in record.times_s().into_iter().enumerate() {
            let [values, ..] = basis.at(time_s);
            let wrench = motion.at(time_s).unwrap().regressor() * body.to_vector();
            for c in 0..6 {
                let channel: f64 = values.iter().zip(motion.coefficients().column(c).iter()).map(|(f, x)| f * x).sum();
                record.channels[(i, c)] = channel + record.channel_std[c] * random.normal();
                record.wrenches[(i, c)] = wrench[c] + record.wrench_std[c] * random.normal();
            }
        }
        group.bench_function(format!("{samples} samples, {harmonics} harmonics"), |bencher| {
            bencher.iter(|| maximum_likelihood(black_box(&record), harmonics).unwrap());
        });
        group.bench_function(format!("bound, {samples} samples"), |bencher| {
            bencher.iter(|| cramer_rao(black_box(&motion), &body, samples, 9, &noise).unwrap());
        });
    }
    group.finish();
}

criterion_group!(benches, estimate, window, periodic);
criterion_main!(benches);
