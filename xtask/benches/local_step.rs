//! Steps of the local planner's rigid body over a horizon of 24; times are per sweep, divide by 24 for one step.
//!
//! Build with `RUSTFLAGS="-C target-cpu=native"`. nalgebra's exponential of 1024 rotations is the calibration: 11.6 us per
//! sweep on an idle machine of the reference measurements.
#![allow(missing_docs, clippy::unwrap_used)]

use criterion::{BenchmarkGroup, Criterion, criterion_group, criterion_main, measurement::WallTime};
use std::hint::black_box;
use tumble_dynamics::InertialParameters;
use tumble_planning::ModelBelief;
use tumble_planning::local::{InformativeModel, Kinematics, RigidBodyModel, StepDerivatives};
use tumble_planning::nalgebra::{Matrix3, UnitQuaternion, Vector3};
use uniform::uniform;

#[path = "../../crates/planning/tests/suite/uniform/mod.rs"]
mod uniform;

const STEPS: usize = 24;
const STEP_S: f64 = 0.5;

fn sweeps<const P: usize>(group: &mut BenchmarkGroup<'_, WallTime>, mut model: RigidBodyModel<P>, offset_m: f64) {
    let mut seed = 1;
    let inertia = Matrix3::new(0.1534, 0.003, -0.002, 0.003, 0.1427, 0.001, -0.002, 0.001, 0.1623);
    let body = InertialParameters::about_com(9.5838, Vector3::repeat(offset_m), inertia);
    let mut belief = ModelBelief::certain(1, body);
    for (place, size) in body.to_vector().iter().enumerate() {
        belief.estimate.covariance[(place, place)] = (0.1 * size.abs() + 0.01) * (0.1 * size.abs() + 0.01);
    }
    model.adopt(&belief).unwrap();
    let limit = [0.045, 0.022, 0.026, 0.452, 0.216, 0.257];
    let inputs: Vec<[f64; 6]> = (0..STEPS).map(|_| limit.map(|limit| limit * uniform(&mut seed))).collect();
    let start = Kinematics {
        world_from_body: tumble_planning::lie::Pose::identity(),
        velocity_world: Vector3::zeros(),
        rate_body: Vector3::new(0.1, -0.05, 0.2),
    };
    let name = |what: &str| format!("{what} p {P} com {offset_m} m");
    group.bench_function(name("value"), |bencher| {
        bencher.iter(|| {
            let (mut state, mut sensitivity) = (start, [[0.0; 12]; P]);
            for input in black_box(&inputs) {
                (state, sensitivity) = model.step(&state, &sensitivity, input, STEP_S).unwrap();
            }
            (state, sensitivity)
        });
    });
    let mut derivatives: Vec<StepDerivatives<12, 6, P>> = (0..STEPS).map(|_| StepDerivatives::zeros()).collect();
    group.bench_function(name("differentiate"), |bencher| {
        bencher.iter(|| {
            let (mut state, mut sensitivity) = (start, [[0.0; 12]; P]);
            for (input, derivatives) in black_box(&inputs).iter().zip(&mut derivatives) {
                (state, sensitivity) = model.differentiate(&state, &sensitivity, input, STEP_S, derivatives).unwrap();
            }
            (state, sensitivity)
        });
    });
}

fn local_step(criterion: &mut Criterion) {
    let mut seed = 1;
    let rotations: Vec<Vector3<f64>> = (0..1024).map(|_| Vector3::from_fn(|_, _| 1.7 * uniform(&mut seed))).collect();
    let mut group = criterion.benchmark_group("local_step");
    let mut out: Vec<_> = rotations.iter().map(|x| UnitQuaternion::from_scaled_axis(*x)).collect();
    group.bench_function("calibration", |bencher| {
        bencher.iter(|| {
            for (slot, rotation) in out.iter_mut().zip(&rotations) {
                *slot = UnitQuaternion::from_scaled_axis(*rotation);
            }
            black_box(&mut out);
        });
    });
    for offset_m in [0.0, 0.05] {
        sweeps(&mut group, RigidBodyModel::principal(), offset_m);
        sweeps(&mut group, RigidBodyModel::full(), offset_m);
    }
    group.finish();
}

criterion_group!(benches, local_step);
criterion_main!(benches);
