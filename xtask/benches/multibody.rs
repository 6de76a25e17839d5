//! Trees: a base with an arm of two and of seven joints, the bodies of the frozen problem 2, states of seed 2.
#![allow(clippy::unwrap_used, missing_docs)]

use criterion::{Criterion, criterion_group, criterion_main};
use std::hint::black_box;
use tumble_dynamics::lie::{Pose, Twist, Wrench};
use tumble_dynamics::nalgebra::{Matrix3, Vector3};
use tumble_dynamics::strategies::{draws, states, wrenches};
use tumble_dynamics::{
    BodyAcceleration, Fixed, GeneralizedForce, GeneralizedMotion, InertialParameters, Joint, Link, Multibody,
};

fn arm<const J: usize>(axes: [Vector3<f64>; J], link_kg: f64) -> Multibody<f64, Fixed<J>> {
    let diagonal = |x, y, z| Matrix3::from_diagonal(&Vector3::new(x, y, z));
    let base = InertialParameters::about_com(9.5838, Vector3::zeros(), diagonal(0.1534, 0.1427, 0.1623));
    let length_m = 0.12;
    let (across, along) = (link_kg * length_m * length_m / 12.0, link_kg * 0.02 * 0.02 / 2.0);
    let body =
        InertialParameters::about_com(link_kg, -Vector3::z() * (0.5 * length_m), diagonal(across, across, along));
    let links = std::array::from_fn(|i| {
        let drop_m = if i == 0 { 0.15 } else { length_m };
        let joint = Joint::revolute(axes[i], Pose::translation(0.0, 0.0, -drop_m)).unwrap();
        Link { parent: i.checked_sub(1), joint, body }
    });
    Multibody::try_new(base, links).unwrap()
}

fn measure<const J: usize>(criterion: &mut Criterion, name: &str, tree: &Multibody<f64, Fixed<J>>) {
    let mut group = criterion.benchmark_group(name);
    let numbers: Vec<f64> =
        draws(&wrenches(1.0, 1.0), 2, 64 * 8).iter().flat_map(|w| w.to_vector().as_slice().to_vec()).collect();
    let joints = |k: usize, shift: usize| -> [f64; J] {
        std::array::from_fn(|i| numbers[(k * 31 + shift * 7 + i) % numbers.len()])
    };
    let twists: Vec<Twist<f64>> = draws(&states(), 3, 64).iter().map(|s| s.twist_body).collect();
    let cases: Vec<_> = (0..64).map(|k| (twists[k], joints(k, 0), joints(k, 1), joints(k, 2), joints(k, 3))).collect();
    let still = BodyAcceleration { angular_acceleration_body: Vector3::x(), acceleration_origin_body: Vector3::y() };
    let motion = |k: usize| {
        let (base_twist, positions, rates, accelerations, _) = &cases[k % 64];
        GeneralizedMotion { base_twist: *base_twist, base_acceleration: still, positions, rates, accelerations }
    };
    let mut k = 0;
    let mut next = move || {
        k += 1;
        k
    };
    group.bench_function("inverse_dynamics", |b| b.iter(|| black_box(tree.inverse_dynamics(&motion(next())).unwrap())));
    group.bench_function("mass_matrix", |b| b.iter(|| black_box(tree.mass_matrix(&cases[next() % 64].1).unwrap())));
    group.bench_function("forward_dynamics", |b| {
        b.iter(|| {
            let (twist, positions, rates, _, torques) = &cases[next() % 64];
            let force = GeneralizedForce { base: Wrench::zero(), joints: *torques };
            black_box(tree.forward_dynamics(twist, positions, rates, &force).unwrap())
        });
    });
    group.bench_function("torque_regressor", |b| b.iter(|| black_box(tree.torque_regressor(&motion(next())).unwrap())));
    group.finish();
}

fn trees(criterion: &mut Criterion) {
    let (y, z) = (Vector3::y(), Vector3::z());
    measure(criterion, "arm2", &arm([y, y], 0.3));
    measure(criterion, "arm7", &arm([z, y, z, y, z, y, z], 0.5));
}

criterion_group!(benches, trees);
criterion_main!(benches);
