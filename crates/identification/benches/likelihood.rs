//! Maximum likelihood of whole records: poses and wrenches, noise levels not given.
#![allow(missing_docs, clippy::unwrap_used, clippy::expect_used)]
#![allow(clippy::cast_possible_truncation, clippy::cast_sign_loss, clippy::cast_possible_wrap)]

#[path = "../tests/exact_motion/mod.rs"]
mod exact_motion;

use criterion::{Criterion, criterion_group, criterion_main};
use exact_motion::{Multisine, Random, Run};
use std::hint::black_box;
use tumble_identification::dynamics::InertialParameters;
use tumble_identification::lie::{LieGroup, Wrench};
use tumble_identification::nalgebra::{Matrix3, UnitQuaternion, Vector3};
use tumble_identification::{MaximumLikelihood, MotionSample};

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

criterion_group!(benches, estimate);
criterion_main!(benches);
