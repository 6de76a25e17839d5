//! Speed of inertial parameters and of one body's dynamics.
//!
//! Budgets: inverse dynamics at most 38 ns (Pinocchio, C++, direct); everything here is far below the 16 ms of an
//! estimate update at 62.5 Hz. `cargo bench --package benches --bench bodies`.
#![allow(clippy::unwrap_used, missing_docs)]

use criterion::{BatchSize, Criterion, criterion_group, criterion_main};
use std::hint::black_box;
use tumble_dynamics::lie::{Pose, Twist, Wrench};
use tumble_dynamics::strategies::{
    bodies, draws, impossible_bodies, judged_bodies, near_boundary_bodies, poses, twists, wrenches,
};
use tumble_dynamics::{FreeFlyer, InertialParameters, LogCholesky};

type Body = InertialParameters<f64>;

/// One call per input, inputs taken in turn.
fn in_turn<I, O>(c: &mut Criterion, name: &str, inputs: &[I], call: impl Fn(&I) -> O) {
    let mut next = inputs.iter().cycle();
    c.bench_function(name, |b| {
        b.iter_batched(|| next.next().unwrap(), |input| call(black_box(input)), BatchSize::SmallInput);
    });
}

fn benches(c: &mut Criterion) {
    let body = draws(&bodies(), 1, 1)[0];
    let flyer = FreeFlyer::new(body);
    let motions: Vec<(Twist<f64>, Wrench<f64>)> =
        draws(&twists(2.0, 2.0), 2, 64).into_iter().zip(draws(&wrenches(1.0, 1.0), 3, 64)).collect();
    // the whole set per iteration, so that the loop of the bench does not drown a dozen nanoseconds
    c.bench_function("inverse_dynamics_x64", |b| {
        let cases: Vec<_> = motions.iter().map(|(twist, wrench)| (*twist, flyer.forward(twist, wrench))).collect();
        b.iter(|| {
            for (twist, acceleration) in &cases {
                black_box(flyer.inverse(black_box(twist), black_box(acceleration)));
            }
        });
    });
    c.bench_function("forward_dynamics_x64", |b| {
        b.iter(|| {
            for (twist, wrench) in &motions {
                black_box(flyer.forward(black_box(twist), black_box(wrench)));
            }
        });
    });
    in_turn(c, "free_flyer_new", &draws(&bodies(), 4, 64), |body| FreeFlyer::new(*body));
    let grasps: Vec<(Body, Pose<f64>)> = draws(&bodies(), 5, 64).into_iter().zip(draws(&poses(1.0), 6, 64)).collect();
    in_turn(c, "with_payload", &grasps, |(payload, grasp)| body.with_payload(payload, grasp));
    let judged: Vec<Body> = draws(&judged_bodies(), 7, 1024).iter().map(|judged| judged.parameters).collect();
    in_turn(c, "consistency_margin", &judged, Body::consistency_margin);
    in_turn(c, "log_cholesky", &draws(&bodies(), 8, 64), |body| LogCholesky::try_from_parameters(body).unwrap());
    let impossible: Vec<Body> = draws(&impossible_bodies(), 9, 256).iter().map(|judged| judged.parameters).collect();
    in_turn(c, "nearest_consistent_far", &impossible, |body| body.nearest_consistent().unwrap());
    let near: Vec<Body> = draws(&near_boundary_bodies(), 10, 256)
        .iter()
        .filter(|judged| judged.margin < 0.0)
        .map(|judged| judged.parameters)
        .collect();
    in_turn(c, "nearest_consistent_near", &near, |body| body.nearest_consistent().unwrap());
}

criterion_group!(group, benches);
criterion_main!(group);
