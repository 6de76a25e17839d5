//! Tutorial: your own arm on your own robot.
//!
//! Say where each joint sits, how it moves and what hangs on it; run the laws; then let the robot float, ask for the tool's
//! velocity, for the forces of a motion and for what is linear in the unknown bodies. If you have dynamics of your own,
//! hand them to the laws operation by operation.

use tumble_dynamics::laws::{TreeOperations, check_multibody};
use tumble_dynamics::lie::{Pose, Product, Stacked, Twist, Wrench};
use tumble_dynamics::nalgebra::{Matrix3, SVector, Translation, Vector2, Vector3, Vector6};
use tumble_dynamics::strategies::{draws, tree_motions};
use tumble_dynamics::*;

/// A satellite with a telescope on a hinge: a boom that swings about y and a tube that slides out of it.
fn satellite() -> Multibody<f64, Fixed<2>> {
    let hull = InertialParameters::solid_box(40.0, [0.5, 0.5, 0.6]);
    // Each link frame lies on its joint. At position zero the boom points along x of the hull.
    let boom = Joint::revolute(Vector3::y(), Pose::translation(0.25, 0.0, 0.2)).unwrap();
    let boom_body = InertialParameters::about_com(
        2.0,
        Vector3::x() * 0.3,
        Matrix3::from_diagonal(&Vector3::new(0.002, 0.06, 0.06)),
    );
    // The tube is held by a spring and slowed by a damper.
    let tube = Joint::prismatic(Vector3::x(), Pose::translation(0.5, 0.0, 0.0)).unwrap().with_spring(30.0, 0.0, 2.0);
    let tube_body = InertialParameters::solid_sphere(1.5, 0.08);
    let links =
        [Link { parent: None, joint: boom, body: boom_body }, Link { parent: Some(0), joint: tube, body: tube_body }];
    Multibody::try_new(hull, links).unwrap()
}

#[test]
fn it_obeys_the_laws() {
    check_multibody(&TreeOperations::default(), &satellite(), &draws(&tree_motions(), 1, 100), 1e-9).unwrap();
}

/// Dynamics of your own: here the inverse dynamics by the generalised inertia, forgetting what velocities do.
#[test]
fn the_laws_name_what_is_wrong_with_mine() {
    let mine = TreeOperations {
        inverse_dynamics: |tree, motion| {
            let at_rest = GeneralizedMotion { base_twist: Twist::zero(), rates: &[0.0; 2], ..*motion };
            tree.inverse_dynamics(&at_rest)
        },
        ..TreeOperations::default()
    };
    let violation = check_multibody(&mine, &satellite(), &draws(&tree_motions(), 2, 5), 1e-9).unwrap_err();
    assert_eq!(violation.law, "power");
}

#[test]
fn it_floats() {
    let tree = satellite();
    let system = FreeMultibody { tree, gravity_world: Vector3::zeros() };
    let mut state = GroupState {
        configuration: Product::new(Pose::identity(), Translation::from([0.4, 0.05])),
        velocity: Stacked::new(Vector6::zeros(), Vector2::zeros()),
    };
    // the hinge's motor swings the boom one way, the hull turns the other way, and nothing else is gained
    let motors = Stacked::new(Vector6::zeros(), Vector2::new(0.2, 0.0));
    for _ in 0..200 {
        state = MuntheKaas4.step(&system, &state, &motors, 0.0, 0.01).unwrap();
    }
    let (positions, rates) = (state.configuration.second.vector, state.velocity.second);
    let twist = Twist::from(state.velocity.first);
    assert!(rates.x > 0.3 && twist.angular.y < -0.01, "{rates} {twist:?}");
    let momentum =
        tree.spatial_momentum(&state.configuration.first, &twist, positions.as_slice(), rates.as_slice()).unwrap();
    assert!(momentum.to_vector().norm() < 1e-9);
    // without momentum, joint rates alone say how the base moves, and how the tip of the tube does
    let follows = tree.floating_base_twist(positions.as_slice(), rates.as_slice(), &Wrench::zero()).unwrap();
    assert!((follows.to_vector() - twist.to_vector()).norm() < 1e-8);
    let tip = Vector3::x() * 0.1;
    let floating = tree.free_floating_jacobian(positions.as_slice(), 2, &tip).unwrap();
    let held = tree.tool_jacobian(positions.as_slice(), 2, &tip).unwrap();
    let (by_rates, whole) = (floating.twist(&Twist::zero(), rates.as_slice()), held.twist(&twist, rates.as_slice()));
    assert!((by_rates.to_vector() - whole.to_vector()).norm() < 1e-8);
}

#[test]
fn forces_and_momentum_are_linear_in_its_bodies() {
    let tree = satellite();
    let (twist, positions, rates) =
        (Twist::new(Vector3::new(0.1, 0.0, 0.2), Vector3::x() * 0.05), [0.4, 0.05], [0.2, -0.1]);
    let bodies: Vec<SVector<f64, 10>> = (0..3).map(|body| tree.body(body).unwrap().to_vector()).collect();
    let regressor = tree.momentum_regressor(&Pose::identity(), &twist, &positions, &rates).unwrap();
    let linear: Vector6<f64> = bodies.iter().enumerate().map(|(body, p)| regressor.body(body).unwrap() * p).sum();
    let momentum = tree.spatial_momentum(&Pose::identity(), &twist, &positions, &rates).unwrap();
    assert!((linear - momentum.to_vector()).norm() < 1e-12);
    // `tumble-identification` turns rows like these into bodies: `multibody::TreeEstimator`
}
