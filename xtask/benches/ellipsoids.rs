//! Pairs of ellipsoids, 1000 of about robot size and 1000 at a gap of 1e-9; times are per sweep of the thousand.
//!
//! Build with `RUSTFLAGS="-C target-cpu=native"`.
#![allow(missing_docs, clippy::unwrap_used)]

use criterion::{Criterion, Throughput, criterion_group, criterion_main};
use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::SeedableRng;
use std::hint::black_box;
use tumble_planning::collision::{Ellipsoid, overlap, scaling_margin, separation};
use tumble_planning::nalgebra::Vector3;

#[path = "../../crates/planning/tests/suite/known_gap/mod.rs"]
mod known_gap;

fn ellipsoids(criterion: &mut Criterion) {
    let mut generator = ChaCha8Rng::seed_from_u64(10);
    let mut solid = || {
        let center: Vector3<f64> = known_gap::vector(&mut generator);
        known_gap::solid(&mut generator, center, 0.5, 5.0)
    };
    let ordinary: Vec<(Ellipsoid, Ellipsoid)> = (0..1000).map(|_| (solid(), solid())).collect();
    let near: Vec<(Ellipsoid, Ellipsoid)> = (0..1000)
        .map(|i| known_gap::known(&mut generator, 30.0, 100.0, if i % 2 == 0 { 1e-9 } else { -1e-9 }))
        .map(|pair| (pair.a, pair.b))
        .collect();

    let mut group = criterion.benchmark_group("ellipsoids");
    for (name, pairs) in [("ordinary", &ordinary), ("near", &near)] {
        group.throughput(Throughput::Elements(pairs.len() as u64));
        group.bench_function(format!("overlap/{name}"), |bencher| {
            bencher.iter(|| black_box(pairs).iter().filter(|(a, b)| overlap(a, b)).count());
        });
        group.bench_function(format!("separation/{name}"), |bencher| {
            bencher.iter(|| {
                for (a, b) in black_box(pairs) {
                    black_box(separation(a, b));
                }
            });
        });
        group.bench_function(format!("scaling_margin/{name}"), |bencher| {
            bencher.iter(|| {
                for (a, b) in black_box(pairs) {
                    black_box(scaling_margin(a, b));
                }
            });
        });
    }
    group.finish();
}

criterion_group!(benches, ellipsoids);
criterion_main!(benches);
