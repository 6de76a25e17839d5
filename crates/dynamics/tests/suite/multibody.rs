//! Trees of rigid bodies obey the laws, storages agree, passive joints do what textbooks say.

use tumble_dynamics::laws::{ModelSample, check_symplectic_lagrangian};
use tumble_dynamics::laws::{TreeMotion, TreeOperations, check_multibody, check_order, check_parametric_model};
use tumble_dynamics::lie::{Pose, Product, Stacked, Twist, Wrench};
use tumble_dynamics::nalgebra::{Matrix3, SVector, Translation, Vector2, Vector3, Vector6};
use tumble_dynamics::strategies::{bodies, draws, tree_motions, trees, wrenches};
use tumble_dynamics::*;

fn obeys<const J: usize>(seed: u64, count: usize) {
    let motions: Vec<TreeMotion<J>> = draws(&tree_motions::<J>(), seed, count);
    for (tree, motion) in draws(&trees::<J>(), seed + 1, count).iter().zip(motions) {
        check_multibody(&TreeOperations::default(), tree, &[motion], 1e-9).unwrap();
    }
}

#[test]
fn every_tree_obeys_every_law() {
    obeys::<0>(1, 20);
    obeys::<1>(2, 60);
    obeys::<2>(3, 60);
    obeys::<4>(4, 60);
    obeys::<7>(5, 40);
}

#[test]
fn a_tree_without_links_is_a_free_body() {
    for (body, wrench) in draws(&bodies(), 6, 50).into_iter().zip(draws(&wrenches(1.0, 1.0), 7, 50)) {
        let tree = Multibody::<f64, Fixed<0>>::try_new(body, []).unwrap();
        let twist = Twist::new(Vector3::new(0.3, -0.2, 0.5), Vector3::new(0.1, 0.7, -0.4));
        let force = GeneralizedForce { base: wrench, joints: [] };
        let found = tree.forward_dynamics(&twist, &[], &[], &force).unwrap().base;
        let expected = FreeFlyer::new(body).forward(&twist, &wrench);
        let error = (found.angular_acceleration_body - expected.angular_acceleration_body).amax()
            + (found.acceleration_origin_body - expected.acceleration_origin_body).amax();
        assert!(error < 1e-9 * (1.0 + expected.acceleration_origin_body.amax()), "{error}");
    }
}

#[test]
fn both_storages_give_the_same_bits() {
    for (tree, motion) in draws(&trees::<3>(), 8, 30).iter().zip(draws(&tree_motions::<3>(), 9, 30)) {
        let listed = Multibody::<f64>::try_new(*tree.base(), tree.links().to_vec()).unwrap();
        let fixed = tree.inverse_dynamics(&motion.generalized()).unwrap();
        let dynamic = listed.inverse_dynamics(&motion.generalized()).unwrap();
        assert_eq!((fixed.base, fixed.joints.to_vec()), (dynamic.base, dynamic.joints));
    }
    let tree = Multibody::<f64>::try_new(draws(&bodies(), 1, 1)[0], vec![]).unwrap();
    assert_eq!(tree.placements(&[0.1]).unwrap_err(), DynamicsError::JointCount { expected: 0, found: 1 });
    assert!(matches!(
        tree.tool_jacobian(&[], 1, &Vector3::zeros()),
        Err(DynamicsError::NoSuchBody { index: 1, bodies: 1 })
    ));
    let hanging =
        Link { parent: Some(0), joint: Joint::revolute(Vector3::z(), Pose::identity()).unwrap(), body: *tree.base() };
    assert_eq!(
        Multibody::<f64>::try_new(*tree.base(), vec![hanging]).unwrap_err(),
        DynamicsError::LinkOrder { link: 0 }
    );
    assert_eq!(Joint::<f64>::revolute(Vector3::zeros(), Pose::identity()).unwrap_err(), DynamicsError::NoAxis);
}

fn ball(kg: f64, at: [f64; 3], size_m: f64) -> InertialParameters<f64> {
    InertialParameters::about_com(
        kg,
        at.into(),
        Matrix3::from_diagonal(&Vector3::new(1.0, 1.2, 0.9)) * (kg * size_m * size_m),
    )
}

/// Two links in a plane, textbook closed form: `H qdd + c + g`.
#[test]
fn a_planar_arm_equals_the_textbook() {
    let (m1, m2, l1, c1, c2, i1, i2, g) = (2.0, 1.5, 0.4, 0.17, 0.21, 0.03, 0.02, 9.81);
    let rod = |kg: f64, at: f64, about_com: f64| {
        InertialParameters::about_com(
            kg,
            Vector3::new(at, 0.0, 0.0),
            Matrix3::from_diagonal(&Vector3::new(0.0, about_com, about_com)),
        )
    };
    let hinge = |x: f64| Joint::revolute(Vector3::z(), Pose::translation(x, 0.0, 0.0)).unwrap();
    let links = [
        Link { parent: None, joint: hinge(0.0), body: rod(m1, c1, i1) },
        Link { parent: Some(0), joint: hinge(l1), body: rod(m2, c2, i2) },
    ];
    let tree = Multibody::<f64, Fixed<2>>::try_new(ball(1.0, [0.0; 3], 0.1), links).unwrap();
    let (q, w, a) = ([0.7, -1.1], [0.9, -0.4], [1.3, 0.6]);
    let held = BodyAcceleration {
        angular_acceleration_body: Vector3::zeros(),
        acceleration_origin_body: Vector3::new(0.0, g, 0.0),
    };
    let motion = GeneralizedMotion {
        base_twist: Twist::zero(),
        base_acceleration: held,
        positions: &q,
        rates: &w,
        accelerations: &a,
    };
    let found = tree.inverse_dynamics(&motion).unwrap().joints;
    let (cos, sin) = (q[1].cos(), q[1].sin());
    let h11 = i1 + m1 * c1 * c1 + i2 + m2 * (l1 * l1 + c2 * c2 + 2.0 * l1 * c2 * cos);
    let (h12, h22) = (i2 + m2 * (c2 * c2 + l1 * c2 * cos), i2 + m2 * c2 * c2);
    let h = m2 * l1 * c2 * sin;
    let first = h11 * a[0] + h12 * a[1] - h * w[1] * (2.0 * w[0] + w[1])
        + g * ((m1 * c1 + m2 * l1) * q[0].cos() + m2 * c2 * (q[0] + q[1]).cos());
    let second = h12 * a[0] + h22 * a[1] + h * w[0] * w[0] + g * m2 * c2 * (q[0] + q[1]).cos();
    assert!((found[0] - first).abs() < 1e-12 && (found[1] - second).abs() < 1e-12, "{found:?} {first} {second}");
}

/// A mass on a spring in a free hull: the reduced mass sets the frequency, the damper the decay.
#[test]
fn a_flexible_mode_has_the_frequency_and_the_damping_of_two_masses_on_a_spring() {
    let (hull_kg, mode_kg, stiffness, damping) = (9.0, 0.6, 4.0, 0.08);
    let slide = Joint::prismatic(Vector3::x(), Pose::identity()).unwrap().with_spring(stiffness, 0.0, damping);
    let links = [Link { parent: None, joint: slide, body: ball(mode_kg, [0.0; 3], 0.02) }];
    let tree = Multibody::<f64, Fixed<1>>::try_new(ball(hull_kg, [0.0; 3], 0.2), links).unwrap();
    let system = FreeMultibody { tree, gravity_world: Vector3::zeros() };
    let reduced = hull_kg * mode_kg / (hull_kg + mode_kg);
    let (decay, frequency) = (damping / (2.0 * reduced), stiffness / reduced);
    let damped = (frequency - decay * decay).sqrt();
    let mut state = GroupState {
        configuration: Product::new(Pose::identity(), Translation::from([0.05])),
        velocity: Stacked::new(Vector6::zeros(), SVector::<f64, 1>::zeros()),
    };
    let still = FreeInput { first: Vector6::zeros(), second: SVector::<f64, 1>::zeros() };
    for step in 1..=800 {
        state = RungeKutta4.step(&system, &state, &still, 0.0, 0.005).unwrap();
        let t = f64::from(step) * 0.005;
        let expected = 0.05 * (-decay * t).exp() * ((damped * t).cos() + decay / damped * (damped * t).sin());
        assert!((state.configuration.second.vector.x - expected).abs() < 1e-8, "{t}");
    }
}

/// A wheel along a principal axis takes up what the hull loses.
#[test]
fn a_reaction_wheel_is_a_joint() {
    let wheel = Link {
        parent: None,
        joint: Joint::revolute(Vector3::z(), Pose::identity()).unwrap(),
        body: ball(0.3, [0.0; 3], 0.05),
    };
    let tree = Multibody::<f64, Fixed<1>>::try_new(ball(9.0, [0.0; 3], 0.2), [wheel]).unwrap();
    let spinning = [120.0];
    let twist = tree.floating_base_twist(&[0.3], &spinning, &Wrench::zero()).unwrap();
    let (hull, rotor) = (tree.base().inertia_about_origin.m33, tree.links()[0].body.inertia_about_origin.m33);
    assert!((twist.angular.z + rotor * spinning[0] / (hull + rotor)).abs() < 1e-12, "{twist:?}");
}

type ArmState = GroupState<FreeConfiguration<f64, 2>>;

fn arm() -> (FreeMultibody<f64, 2>, ArmState) {
    let shoulder = Joint::revolute(-Vector3::y(), Pose::translation(-0.13, 0.0, -0.13)).unwrap();
    let wrist = Joint::revolute(Vector3::z(), Pose::translation(-0.1, 0.0, 0.0)).unwrap().with_spring(0.4, 0.1, 0.0);
    let links = [
        Link { parent: None, joint: shoulder, body: ball(0.9, [-0.05, 0.0, 0.02], 0.05) },
        Link { parent: Some(0), joint: wrist, body: ball(0.7, [-0.02, 0.01, 0.0], 0.04) },
    ];
    let tree = Multibody::try_new(ball(9.6, [0.01, 0.0, 0.02], 0.12), links).unwrap();
    let configuration = Product::new(Pose::translation(0.3, -0.2, 0.5), Translation::from([0.3, -0.2]));
    let velocity = Stacked::new(Vector6::new(0.25, -0.13, 0.14, 0.02, -0.1, 0.05), Vector2::new(0.5, -0.4));
    (FreeMultibody { tree, gravity_world: Vector3::zeros() }, GroupState { configuration, velocity })
}

fn push() -> FreeInput<f64, 2> {
    Stacked::new(Vector6::new(0.02, -0.01, 0.03, 0.3, -0.2, 0.1), Vector2::new(0.05, -0.03))
}

#[test]
fn integrators_move_a_floating_arm_at_their_order() {
    let (system, start) = arm();
    check_order(&RungeKutta4, &system, &start, &push(), 0.1, 8, 0.3).unwrap();
    check_order(&MuntheKaas4, &system, &start, &push(), 0.1, 8, 0.3).unwrap();
    check_order(&Variational, &system, &start, &push(), 0.05, 8, 0.3).unwrap();
    let still = Stacked::new(Vector6::zeros(), Vector2::zeros());
    check_symplectic_lagrangian(&Variational, &system, &start, &still, 0.05, 1e-6).unwrap();
}

#[test]
fn the_variational_step_keeps_the_momentum_of_a_floating_arm() {
    let (system, mut state) = arm();
    let still = Stacked::new(Vector6::zeros(), Vector2::zeros());
    let momentum = |s: &ArmState| {
        let (pose, positions) = (&s.configuration.first, &s.configuration.second.vector);
        let twist = Twist::from(s.velocity.first);
        system
            .tree
            .spatial_momentum(pose, &twist, positions.as_slice(), s.velocity.second.as_slice())
            .unwrap()
            .to_vector()
    };
    let start = momentum(&state);
    for _ in 0..300 {
        state = Variational.step(&system, &state, &still, 0.0, 0.02).unwrap();
    }
    assert!((momentum(&state) - start).norm() < 1e-12 * start.norm(), "{}", (momentum(&state) - start).norm());
}

#[test]
fn sensitivities_to_every_body_are_exact() {
    let (system, state) = arm();
    let model = MultibodyStep { system, integrator: RungeKutta4 };
    let parameters = JointedBodies::of(&system.tree);
    let size = lie::Coordinates::from_fn(|i| if i % 10 == 0 { 0.5 } else { 0.02 });
    let input_size = lie::Coordinates::from_fn(|_| 1.0);
    let sample = ModelSample { state, input: push(), input_size, parameters, parameter_size: size, step_s: 0.05 };
    check_parametric_model(&model, &sample, 1e-6).unwrap();
}
