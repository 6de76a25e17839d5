//! Hot paths of regression: 6x10 regressors, alone and from poses. Budget of the Newton-Euler one: 15 ns.
#![allow(clippy::expect_used, missing_docs)]

use criterion::{Criterion, criterion_group, criterion_main};
use nalgebra::{UnitQuaternion, Vector3};
use std::hint::black_box;
use tumble_identification::lie::{LieGroup, Pose};
use tumble_identification::regressors::{
    ObserverFrame, PoseTriple, newton_euler, variational, variational_extrapolated,
};

fn benches(criterion: &mut Criterion) {
    let (w, d, a) = (Vector3::new(0.3, -0.2, 0.5), Vector3::new(0.1, 0.4, -0.3), Vector3::new(0.25, -0.15, 0.35));
    let poses: Vec<Pose<f64>> = (0..7)
        .map(|k| {
            let t = 0.05 * f64::from(k);
            let rotation = <UnitQuaternion<f64> as LieGroup>::exp(&(w * t + d * (0.5 * t * t)));
            Pose::from_parts((a * (0.5 * t * t)).into(), rotation)
        })
        .collect();
    let observer = ObserverFrame::inertial();
    let triple = |lag: usize| {
        let step_s = 0.05 * lag as f64;
        PoseTriple::try_new([&poses[3 - lag], &poses[3], &poses[3 + lag]], step_s, step_s, &observer).expect("small")
    };
    let (one, two, three) = ([triple(1)], [triple(1), triple(2)], [triple(1), triple(2), triple(3)]);
    criterion.bench_function("newton_euler", |b| {
        b.iter(|| newton_euler(black_box(&w), black_box(&d), black_box(&a)));
    });
    criterion.bench_function("variational", |b| b.iter(|| variational(black_box(&one[0]))));
    criterion.bench_function("variational_order_4", |b| b.iter(|| variational_extrapolated(black_box(&two))));
    criterion.bench_function("variational_order_6", |b| b.iter(|| variational_extrapolated(black_box(&three))));
    criterion.bench_function("variational_from_poses", |b| {
        b.iter(|| {
            let poses = black_box(&poses);
            PoseTriple::try_new([&poses[2], &poses[3], &poses[4]], 0.05, 0.05, &observer).map(|t| variational(&t))
        });
    });
}

criterion_group!(regressors, benches);
criterion_main!(regressors);
