//! Hot paths of the estimation kernel: square-root update, constrained solution inactive and binding.
#![allow(clippy::expect_used, missing_docs)]

use criterion::{Criterion, criterion_group, criterion_main};
use nalgebra::{SMatrix, SVector};
use rand_chacha::ChaCha8Rng;
use rand_core::SeedableRng;
use std::hint::black_box;
use tumble_identification::noise::signed_unit;
use tumble_identification::{
    BodyScale, ConstrainedLeastSquares, InteriorPoint, PseudoInertiaCone, SquareRootInformation,
};

#[path = "../../crates/identification/tests/suite/golden/problem4_hard.rs"]
mod problem4_hard;

fn benches(criterion: &mut Criterion) {
    let mut rng = ChaCha8Rng::seed_from_u64(1);
    let mut information = SquareRootInformation::<10>::new();
    let blocks: Vec<_> = (0..64)
        .map(|_| {
            let block = SMatrix::<f64, 6, 10>::from_fn(|_, _| signed_unit(&mut rng));
            (block, SVector::<f64, 6>::from_fn(|_, _| signed_unit(&mut rng)))
        })
        .collect();
    for (block, rhs) in &blocks {
        information.update(block, rhs).expect("finite");
    }
    let mut next = 0;
    criterion.bench_function("square_root_update_6x10", |bench| {
        bench.iter(|| {
            next = (next + 1) % blocks.len();
            let (block, rhs) = &blocks[next];
            black_box(information.update(black_box(block), black_box(rhs)))
        });
    });

    let body = SVector::from([5.0, 0.25, 0.5, 0.25, 1.5, 0.1, 0.2, 2.0, 0.3, 3.0]);
    let mut inactive = SquareRootInformation::<10>::new();
    for (block, _) in &blocks {
        inactive.update(block, &(block * body)).expect("finite");
    }
    let solver = InteriorPoint::new(PseudoInertiaCone::new(BodyScale::of(&body).expect("a body")));
    criterion.bench_function("constrained_solution_inactive", |bench| {
        bench.iter(|| black_box(solver.solve(black_box(&inactive))));
    });

    let problems = problem4_hard::problems();
    let solver = InteriorPoint::new(problem4_hard::cone());
    let mut next = 0;
    criterion.bench_function("constrained_solution_problem4_hard", |bench| {
        bench.iter(|| {
            next = (next + 1) % problems.len();
            black_box(solver.solve(black_box(&problems[next])))
        });
    });
}

criterion_group!(kernels, benches);
criterion_main!(kernels);
