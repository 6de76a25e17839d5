//! Published numbers: a base with a z hinge and a y hinge.

#![allow(clippy::unreadable_literal, reason = "as printed")]

use super::*;
use crate::free_flyer::BodyAcceleration;
use tumble_lie::nalgebra::{Matrix3, SVector};
use tumble_lie::{Pose, Twist, Wrench};

fn body(mass: f64, com: [f64; 3], j: [f64; 6]) -> InertialParameters<f64> {
    let inertia = Matrix3::new(j[0], j[1], j[2], j[1], j[3], j[4], j[2], j[4], j[5]);
    InertialParameters::about_origin(mass, com.into(), inertia)
}

pub(super) fn arm() -> Multibody<f64, Fixed<2>> {
    let base = body(10.0, [0.02, -0.01, 0.03], [0.5, 0.01, -0.02, 0.6, 0.03, 0.7]);
    let upper = body(1.5, [0.15, 0.01, 0.0], [0.01, -0.002, 0.001, 0.06, 0.0005, 0.062]);
    let fore = body(1.0, [0.12, 0.0, 0.01], [0.005, 0.0003, -0.001, 0.03, 0.0002, 0.031]);
    let shoulder = Joint::revolute(Vector3::z(), Pose::translation(0.2, 0.05, 0.1)).unwrap();
    let elbow = Joint::revolute(Vector3::y(), Pose::translation(0.3, 0.0, 0.02)).unwrap();
    let links =
        [Link { parent: None, joint: shoulder, body: upper }, Link { parent: Some(0), joint: elbow, body: fore }];
    Multibody::try_new(base, links).unwrap()
}

const POSITIONS: [f64; 2] = [0.7, -0.5];
const RATES: [f64; 2] = [0.6, -0.9];

fn twist() -> Twist<f64> {
    Twist::new(Vector3::new(0.2, -0.3, 0.1), Vector3::new(0.05, 0.02, -0.04))
}

fn close(found: &[f64], golden: &[f64]) {
    assert_eq!(found.len(), golden.len());
    for (found, golden) in found.iter().zip(golden) {
        assert!((found - golden).abs() <= 1e-10, "{found} {golden}");
    }
}

#[test]
fn golden_mass_matrix() {
    let m = arm().mass_matrix(&POSITIONS).unwrap();
    let diagonal: [f64; 8] = core::array::from_fn(|i| m.get(i, i).unwrap());
    let golden = [0.7073089353, 1.0806423898, 1.2716889358, 12.5, 12.5, 12.5, 0.2364918502, 0.03];
    close(&diagonal, &golden);
}

#[test]
fn golden_bias() {
    let still =
        BodyAcceleration { angular_acceleration_body: Vector3::zeros(), acceleration_origin_body: Vector3::zeros() };
    let motion = GeneralizedMotion {
        base_twist: twist(),
        base_acceleration: still,
        positions: &POSITIONS,
        rates: &RATES,
        accelerations: &[0.0, 0.0],
    };
    let bias = arm().inverse_dynamics(&motion).unwrap();
    let golden = [0.0265633415, 0.0151546214, -0.1088580596, -0.4182475387, -0.4626546923, -0.2056969829];
    close(bias.base.to_vector().as_slice(), &golden);
    close(&bias.joints, &[-0.0335394981, -0.015836944]);
}

#[test]
fn golden_end_effector_and_forward_dynamics() {
    let jacobian = arm().tool_jacobian(&POSITIONS, 2, &Vector3::new(0.25, 0.0, 0.0)).unwrap();
    let golden = [0.7797959185, -0.9883579686, 0.7, -0.3436837136, 0.2006154688, 0.4135535574];
    close(jacobian.twist(&twist(), &RATES).to_vector().as_slice(), &golden);
    let at_tool = Wrench::new(Vector3::new(0.01, 0.02, -0.015), Vector3::new(0.3, -0.1, 0.2));
    let on_base = Wrench::new(Vector3::new(0.02, -0.03, 0.05), Vector3::new(0.4, -0.2, 0.1));
    let force = GeneralizedForce { base: on_base, joints: [0.05, -0.04] }.plus(&jacobian.generalized_force(&at_tool));
    let a = arm().forward_dynamics(&twist(), &POSITIONS, &RATES, &force).unwrap();
    close(a.base.angular_acceleration_body.as_slice(), &[0.0440048011, -0.0046669625, 0.077972905]);
    close(a.base.acceleration_origin_body.as_slice(), &[0.0880317741, 0.0236229028, 0.0277489066]);
    close(&a.joints, &[-0.2960977355, -1.3335594131]);
}

#[test]
fn regressors_times_parameters_are_forces_and_momentum() {
    let arm = arm();
    let acceleration = BodyAcceleration {
        angular_acceleration_body: Vector3::new(0.3, -0.7, 0.2),
        acceleration_origin_body: Vector3::new(-0.1, 0.4, 0.25),
    };
    let motion = GeneralizedMotion {
        base_twist: twist(),
        base_acceleration: acceleration,
        positions: &POSITIONS,
        rates: &RATES,
        accelerations: &[0.8, -0.4],
    };
    let force = arm.inverse_dynamics(&motion).unwrap();
    let regressor = arm.torque_regressor(&motion).unwrap();
    let rows = force.base.to_vector().iter().copied().chain(force.joints).collect::<alloc::vec::Vec<f64>>();
    for (row, expected) in rows.iter().enumerate() {
        let sum: f64 = (0..arm.bodies())
            .map(|b| SVector::from(regressor.block(row, b).unwrap()).dot(&arm.body(b).unwrap().to_vector()))
            .sum();
        assert!((sum - expected).abs() < 1e-14, "{row} {sum} {expected}");
    }
    let world_from_base = Pose::from_parts(
        Vector3::new(1.0, -2.0, 0.5).into(),
        tumble_lie::nalgebra::UnitQuaternion::from_scaled_axis(Vector3::new(0.2, -0.6, 0.5)),
    );
    let momentum = arm.spatial_momentum(&world_from_base, &twist(), &POSITIONS, &RATES).unwrap().to_vector();
    let regressor = arm.momentum_regressor(&world_from_base, &twist(), &POSITIONS, &RATES).unwrap();
    let sum = (0..arm.bodies())
        .map(|b| regressor.body(b).unwrap() * arm.body(b).unwrap().to_vector())
        .sum::<SVector<f64, 6>>();
    assert!((sum - momentum).amax() < 1e-14, "{sum} {momentum}");
    // the momentum of the mass matrix is the same
    let (base, _) = arm.mass_matrix(&POSITIONS).unwrap().momentum(&twist(), &RATES);
    assert!((base.transformed_by(&world_from_base).to_vector() - momentum).amax() < 1e-14);
}
