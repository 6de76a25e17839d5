//! Maximum likelihood of whole records: poses and wrenches, noise levels not given.
#![allow(missing_docs, clippy::unwrap_used, clippy::expect_used)]
#![allow(clippy::cast_possible_truncation, clippy::cast_sign_loss, clippy::cast_possible_wrap)]

#[path = "../tests/exact_motion/mod.rs"]
mod exact_motion;

use criterion::{Criterion, criterion_group, criterion_main};
use exact_motion::{Multisine, Random, Run};
use std::hint::black_box;
use std::time::{Duration, Instant};
use tumble_identification::dynamics::InertialParameters;
use tumble_identification::lie::{LieGroup, Wrench};
use tumble_identification::nalgebra::{Matrix3, UnitQuaternion, Vector3};
use tumble_identification::{FixedLag, FixedLagSettings, MaximumLikelihood, MotionSample};

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
        sample.world_from_body.translation.vector += random.normal3(1e-3);
        sample.world_from_body.rotation *= <UnitQuaternion<f64> as LieGroup>::exp(&random.normal3(1e-3));
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

criterion_group!(benches, estimate, window);
criterion_main!(benches);
