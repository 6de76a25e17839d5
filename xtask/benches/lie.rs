//! Every Lie operation over 1024 tangents (translations in -1..1, angles in 0..pi - 0.1); times are per sweep.
//!
//! Build with `RUSTFLAGS="-C target-cpu=native"`. nalgebra's exponential is the calibration: 11.6 us per sweep on an idle
//! machine of the reference measurements.
#![allow(missing_docs, clippy::unwrap_used)]

use criterion::{Criterion, Throughput, criterion_group, criterion_main};
use std::hint::black_box;
use tumble_lie::nalgebra::{Rotation3, UnitDualQuaternion, UnitQuaternion, Vector3, Vector6};
use tumble_lie::{GroupAction, Increment, LieGroup, Pose};

#[path = "../../crates/planning/tests/suite/uniform/mod.rs"]
mod uniform;

use uniform::uniform;

const N: usize = 1024;

fn lie(criterion: &mut Criterion) {
    let mut state = 1;
    let mut vector = || Vector3::from_fn(|_, _| uniform(&mut state));
    let rho: Vec<Vector3<f64>> = (0..N).map(|_| vector()).collect();
    let phi: Vec<Vector3<f64>> =
        (0..N).map(|_| vector().normalize() * (vector().x.abs() * (core::f64::consts::PI - 0.1))).collect();
    let xi: Vec<Vector6<f64>> = (0..N).map(|i| Vector6::from_iterator(phi[i].iter().chain(&rho[i]).copied())).collect();
    let q: Vec<UnitQuaternion<f64>> = phi.iter().map(LieGroup::exp).collect();
    let matrix: Vec<Rotation3<f64>> = phi.iter().map(LieGroup::exp).collect();
    let pose: Vec<Pose<f64>> = (0..N).map(|i| Pose::from_parts(rho[i].into(), q[i])).collect();
    let dual: Vec<UnitDualQuaternion<f64>> = pose.iter().map(UnitDualQuaternion::from_isometry).collect();
    let next = |i: usize| (i + 1) % N;
    let increment: Vec<Increment<f64>> =
        (0..N).map(|i| Increment::between(&pose[i], &pose[next(i)]).unwrap()).collect();

    let mut group = criterion.benchmark_group("lie");
    group.throughput(Throughput::Elements(N as u64));
    macro_rules! sweep {
        ($name:literal, $operation:expr) => {{
            let operation = $operation;
            let mut out: Vec<_> = (0..N).map(&operation).collect();
            group.bench_function($name, |bencher| {
                bencher.iter(|| {
                    out.iter_mut().enumerate().for_each(|(i, slot)| *slot = operation(i));
                    black_box(&mut out);
                });
            });
        }};
    }
    sweep!("calibration_nalgebra_so3_exp", |i: usize| UnitQuaternion::from_scaled_axis(phi[i]));
    sweep!("so3_exp", |i: usize| <UnitQuaternion<f64> as LieGroup>::exp(&phi[i]));
    sweep!("so3_log", |i: usize| q[i].log());
    sweep!("so3_compose", |i: usize| q[i].compose(&q[next(i)]));
    sweep!("so3_act", |i: usize| q[i].act(&rho[i]));
    sweep!("so3_jl", |i: usize| <UnitQuaternion<f64>>::left_jacobian(&phi[i]));
    sweep!("so3_jl_inverse", |i: usize| <UnitQuaternion<f64>>::left_jacobian_inverse(&phi[i]));
    sweep!("so3_matrix_exp", |i: usize| <Rotation3<f64> as LieGroup>::exp(&phi[i]));
    sweep!("so3_matrix_log", |i: usize| matrix[i].log());
    sweep!("se3_exp", |i: usize| <Pose<f64> as LieGroup>::exp(&xi[i]));
    sweep!("se3_log", |i: usize| pose[i].log());
    sweep!("se3_compose", |i: usize| pose[i].compose(&pose[next(i)]));
    sweep!("se3_inverse", |i: usize| LieGroup::inverse(&pose[i]));
    sweep!("se3_act", |i: usize| pose[i].act(&rho[i]));
    sweep!("se3_adjoint", |i: usize| pose[i].adjoint());
    sweep!("se3_jl", |i: usize| <Pose<f64>>::left_jacobian(&xi[i]));
    sweep!("se3_jl_inverse", |i: usize| <Pose<f64>>::left_jacobian_inverse(&xi[i]));
    sweep!("se3_jr_inverse", |i: usize| <Pose<f64>>::right_jacobian_inverse(&xi[i]));
    sweep!("dual_quaternion_exp", |i: usize| <UnitDualQuaternion<f64> as LieGroup>::exp(&xi[i]));
    sweep!("dual_quaternion_log", |i: usize| dual[i].log());
    sweep!("dual_quaternion_compose", |i: usize| dual[i].compose(&dual[next(i)]));
    sweep!("dual_quaternion_act", |i: usize| dual[i].act(&rho[i]));
    sweep!("increment_between", |i: usize| Increment::between(&pose[i], &pose[next(i)]));
    sweep!("increment_step", |i: usize| increment[i].step(&pose[i]));
    group.finish();
}

criterion_group!(benches, lie);
criterion_main!(benches);
