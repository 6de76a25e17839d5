//! Factorisation of the curvature of a local plan and solution with it, both routes, bodies in space and in the plane.
//!
//! Build with `RUSTFLAGS="-C target-cpu=native"`. The calibration is a Cholesky factorisation of 144 unknowns by nalgebra.
#![allow(missing_docs, clippy::unwrap_used)]

use criterion::{BenchmarkId, Criterion, criterion_group, criterion_main};
use std::hint::black_box;
use tumble_planning::local::{Curvature, Factorisation, Stages};
use tumble_planning::nalgebra::DMatrix;
use uniform::uniform;

#[path = "../../crates/planning/tests/suite/uniform/mod.rs"]
mod uniform;

/// Positions that follow velocities; attitude and rate, the last half, turn the forces.
fn stages<const X: usize, const U: usize>(steps: usize, columns: usize) -> Stages<X, U> {
    let mut stages = Stages::new(steps, columns);
    let mut seed = 1;
    for step in 0..steps {
        for i in 0..X {
            for j in 0..X {
                stages.by_state[step][i][j] = if i == j {
                    1.0
                } else if i < X / 4 && j == i + X / 4 {
                    0.3
                } else if j < X / 2 {
                    0.0
                } else {
                    0.1 * uniform(&mut seed)
                };
            }
            stages.by_input[step][i] = core::array::from_fn(|_| 0.1 * uniform(&mut seed));
            stages.state_curvature[step][i][i] = 1.0;
        }
        (0..U).for_each(|i| stages.input_curvature[step][i][i] = 0.1);
    }
    stages.arrow.extend((0..columns * steps * U).map(|_| uniform(&mut seed)));
    stages
}

fn routes<const X: usize, const U: usize>(criterion: &mut Criterion, body: &str, columns: &[usize]) {
    for route in [Factorisation::Riccati, Factorisation::Dense] {
        let mut group = criterion.benchmark_group(format!("{body} {route:?}"));
        for steps in [24, 40, 120] {
            for columns in columns {
                let stages = stages::<X, U>(steps, *columns);
                let mut curvature = Curvature::new(route, steps, *columns);
                let name = |what| BenchmarkId::new(what, format!("N {steps} q {columns}"));
                group.bench_function(name("factorise"), |bencher| {
                    bencher.iter(|| assert!(curvature.factorise(black_box(&stages), 0.01)));
                });
                let right_hand_side: Vec<f64> = (0..stages.unknowns()).map(|i| f64::sin(i as f64)).collect();
                let mut x = right_hand_side.clone();
                group.bench_function(name("solve"), |bencher| {
                    bencher.iter(|| {
                        x.copy_from_slice(&right_hand_side);
                        curvature.solve(&stages, black_box(&mut x));
                    });
                });
                group.bench_function(name("times"), |bencher| {
                    bencher.iter(|| curvature.times(&stages, black_box(&right_hand_side), black_box(&mut x)));
                });
            }
        }
        group.finish();
    }
}

fn local_curvature(criterion: &mut Criterion) {
    let matrix = DMatrix::from_fn(144, 144, |i, j| if i == j { 144.0 } else { f64::sin((i + j) as f64) });
    criterion.bench_function("calibration", |bencher| bencher.iter(|| black_box(matrix.clone()).cholesky().unwrap()));
    routes::<12, 6>(criterion, "space", &[0, 10, 55]);
    routes::<6, 3>(criterion, "plane", &[0, 3, 10]);
}

criterion_group!(benches, local_curvature);
criterion_main!(benches);
