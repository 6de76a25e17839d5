//! Supports of the smallest invariant sets of the frozen ninth problem, per axis and of its three axes at once, their certificates,
//! and the template of one axis.
//!
//! Build with `RUSTFLAGS="-C target-cpu=native"`. Three directions per axis: position, velocity, input; nine of all axes.
#![allow(missing_docs, clippy::unwrap_used)]

use criterion::{Criterion, criterion_group, criterion_main};
use std::hint::black_box;
use tumble_planning::control::{AxisGain, AxisTemplate, MinimalInvariantSet, SymmetricBox, Zonotope};
use tumble_planning::nalgebra::{Matrix2, Matrix2x3, Matrix6, RowVector2, SMatrix, Vector2};

const STEP_S: f64 = 0.2;
const MASS_KG: f64 = 9.5838;

fn invariant_sets(criterion: &mut Criterion) {
    let feedback = RowVector2::new(-2.91367, -7.52974);
    let by_force = Vector2::new(0.5 * STEP_S * STEP_S, STEP_S) / MASS_KG;
    let axis = Matrix2::new(1.0, STEP_S, 0.0, 1.0) + by_force * feedback;
    let widths = Vector2::new(5e-4, 1e-3);

    let set = MinimalInvariantSet::try_new(axis, SymmetricBox(widths)).unwrap();
    let directions = Matrix2x3::new(1.0, 0.0, feedback[0], 0.0, 1.0, feedback[1]);
    criterion.bench_function("axis, 3 supports", |bencher| {
        bencher.iter(|| black_box(&set).supports(black_box(&directions), 1e-6));
    });
    criterion.bench_function("axis, certificate", |bencher| {
        bencher.iter(|| MinimalInvariantSet::try_new(black_box(axis), SymmetricBox(widths)).unwrap());
    });
    let zonotope = MinimalInvariantSet::try_new(axis, Zonotope(by_force)).unwrap();
    criterion.bench_function("axis, 3 supports, matched", |bencher| {
        bencher.iter(|| black_box(&zonotope).supports(black_box(&directions), 1e-6));
    });

    let mut closed_loop = Matrix6::zeros();
    let mut directions = SMatrix::<f64, 6, 9>::zeros();
    directions.fixed_view_mut::<6, 6>(0, 0).fill_with_identity();
    for i in 0..3 {
        for (row, column) in [(0, 0), (0, 1), (1, 0), (1, 1)] {
            closed_loop[(i + 3 * row, i + 3 * column)] = axis[(row, column)];
        }
        (0..2).for_each(|row| directions[(i + 3 * row, 6 + i)] = feedback[row]);
    }
    let six = SymmetricBox(SMatrix::from_fn(|i, _| widths[i / 3]));
    let coupled = MinimalInvariantSet::try_new(closed_loop, six).unwrap();
    criterion.bench_function("6 states, 9 supports", |bencher| {
        bencher.iter(|| black_box(&coupled).supports(black_box(&directions), 1e-6));
    });
    criterion.bench_function("6 states, certificate", |bencher| {
        bencher.iter(|| MinimalInvariantSet::try_new(black_box(closed_loop), six).unwrap());
    });

    criterion.bench_function("template", |bencher| {
        bencher.iter(|| AxisTemplate::try_new(black_box(AxisGain::default()), &SymmetricBox(widths)).unwrap());
    });
}

criterion_group!(benches, invariant_sets);
criterion_main!(benches);
