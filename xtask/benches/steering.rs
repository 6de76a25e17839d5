//! Steering over 1024 pairs of states; times are per sweep, divide by 1024 for one.
//!
//! Build with `RUSTFLAGS="-C target-cpu=native"`. nalgebra's exponential is the calibration: 11.6 us per sweep on an idle
//! machine of the reference measurements.
#![allow(missing_docs, clippy::unwrap_used)]

use criterion::{Criterion, Throughput, criterion_group, criterion_main};
use std::hint::black_box;
use tumble_dynamics::AlignedBox;
use tumble_planning::TranslationState;
use tumble_planning::nalgebra::{UnitQuaternion, Vector3};
use tumble_planning::steering::{TranslationLimits, least_time_s, steer, steer_in};
use uniform::uniform;

#[path = "../../crates/planning/tests/suite/uniform/mod.rs"]
mod uniform;

const N: usize = 1024;

fn steering(criterion: &mut Criterion) {
    let mut seed = 1;
    let mut vector = || Vector3::from_fn(|_, _| uniform(&mut seed));
    let limits = TranslationLimits {
        position: AlignedBox::between(Vector3::repeat(-10.0), Vector3::repeat(10.0)),
        speed_m_s: Vector3::repeat(0.1),
        acceleration_m_s2: Vector3::repeat(0.02),
    };
    let states: Vec<TranslationState> =
        (0..=N).map(|_| TranslationState { position: vector(), velocity: vector() * 0.1 }).collect();
    let rotations: Vec<Vector3<f64>> = (0..N).map(|_| vector() * 1.7).collect();

    let mut group = criterion.benchmark_group("steering");
    group.throughput(Throughput::Elements(N as u64));
    macro_rules! sweep {
        ($name:literal, $operation:expr) => {{
            let operation = $operation;
            let mut out: Vec<_> = (0..N).map(&operation).collect();
            group.bench_function($name, |bencher| {
                bencher.iter(|| {
                    for (index, slot) in out.iter_mut().enumerate() {
                        *slot = operation(index);
                    }
                    black_box(&mut out);
                })
            });
        }};
    }
    sweep!("calibration", |i: usize| UnitQuaternion::from_scaled_axis(rotations[i]));
    sweep!("least_time", |i: usize| least_time_s(&states[i], &states[i + 1], &limits));
    sweep!("steer", |i: usize| steer(&states[i], &states[i + 1], &limits));
    sweep!("steer_in", |i: usize| steer_in(&states[i], &states[i + 1], &limits, 120.0));
    group.finish();
}

criterion_group!(benches, steering);
criterion_main!(benches);
