//! Nanoseconds per step of a free tumble: the Ch5 body of the frozen problem 3, h = 0.01 s, no wrench.
//!
//! Budget: the variational step within 0.8 us (MuJoCo RK4 2.4 us). A thousand steps per sample, so that branch history
//! and state are those of a simulation.
#![allow(missing_docs)]

use criterion::{Criterion, Throughput, criterion_group, criterion_main};
use std::hint::black_box;
use tumble_dynamics::lie::{Twist, Wrench};
use tumble_dynamics::nalgebra::{Matrix3, Vector3};
use tumble_dynamics::{
    FreeFlyer, GaussLegendre4, InertialParameters, Integrator, LieEuler, MuntheKaas4, RigidBodyState, RungeKutta4,
    Variational, VariationalFreeFlyer,
};

const STEPS: u32 = 1000;

fn run(integrator: &impl Integrator<FreeFlyer<f64>>, body: &FreeFlyer<f64>, steps: u32) -> Option<RigidBodyState<f64>> {
    let mut state = RigidBodyState {
        twist_body: Twist::new(Vector3::new(0.5, 0.8, -0.6), Vector3::zeros()),
        ..RigidBodyState::at_rest()
    };
    for _ in 0..steps {
        state = integrator.step(black_box(body), &state, &Wrench::zero(), 0.0, black_box(0.01)).ok()?;
    }
    Some(state)
}

fn integrators(c: &mut Criterion) {
    let body = FreeFlyer::new(InertialParameters::about_origin(
        5.0,
        Vector3::new(0.05, 0.1, 0.05),
        Matrix3::new(1.5, 0.1, 0.2, 0.1, 2.0, 0.3, 0.2, 0.3, 3.0),
    ));
    let mut group = c.benchmark_group("integrator");
    group.throughput(Throughput::Elements(u64::from(STEPS)));
    group.bench_function("variational, dual quaternions", |b| b.iter(|| run(&VariationalFreeFlyer, &body, STEPS)));
    group.bench_function("Lie-Euler", |b| b.iter(|| run(&LieEuler, &body, STEPS)));
    group.bench_function("Runge-Kutta 4", |b| b.iter(|| run(&RungeKutta4, &body, STEPS)));
    group.bench_function("Munthe-Kaas 4", |b| b.iter(|| run(&MuntheKaas4, &body, STEPS)));
    group.bench_function("Gauss-Legendre 4", |b| b.iter(|| run(&GaussLegendre4, &body, STEPS)));
    group.throughput(Throughput::Elements(10));
    group.bench_function("variational, generic", |b| b.iter(|| run(&Variational, &body, 10)));
    group.finish();
}

criterion_group!(benches, integrators);
criterion_main!(benches);
