#![allow(
    clippy::float_cmp,
    clippy::cast_possible_truncation,
    clippy::cast_sign_loss,
    reason = "what stays exactly, and counts of samples"
)]

use super::*;
use crate::belief::ModelBelief;
use crate::local::{InformativeModel, PlanarBodyModel, RigidBodyModel};
use crate::motion::{BodyArc, TranslationState};
use nalgebra::{SMatrix, Unit, Vector2};

const START_S: f64 = 17.3;
const LIMITS: StopLimits = StopLimits { acceleration_m_s2: 0.02, angular_acceleration_rad_s2: 0.05 };

fn body() -> InertialParameters<f64> {
    let inertia = Matrix3::new(0.16, 0.01, -0.005, 0.01, 0.21, 0.008, -0.005, 0.008, 0.19);
    InertialParameters::about_com(11.3, Vector3::new(0.03, -0.02, 0.05), inertia)
}

/// Numbers between -1 and 1 without structure.
fn wave(k: usize, i: usize) -> f64 {
    libm::sin(1.0 + 1.7 * k as f64 + 2.9 * i as f64 + 0.13 * (k * k) as f64)
}

fn in_space(step_s: f64, torque_n_m: f64) -> LocalTrajectory<Kinematics, 6, 10> {
    let inputs: Vec<[f64; 6]> =
        (0..24).map(|k| core::array::from_fn(|i| wave(k, i) * if i < 3 { torque_n_m } else { 0.3 })).collect();
    let mut model = RigidBodyModel::full();
    model.adopt(&ModelBelief::certain(1, body())).unwrap();
    let start = Kinematics {
        world_from_body: Pose::from_parts(
            Vector3::new(1.0, -2.0, 0.5).into(),
            UnitQuaternion::from_euler_angles(0.3, -1.1, 2.0),
        ),
        velocity_world: Vector3::new(0.1, 0.05, -0.08),
        rate_body: Vector3::new(0.05, -0.1, 0.08),
    };
    let mut states = vec![start];
    for input in &inputs {
        states.push(model.step(states.last().unwrap(), &[[0.0; 12]; 10], input, step_s).unwrap().0);
    }
    let (covariances, gathered) = (Vec::new(), SMatrix::zeros());
    LocalTrajectory { start_s: START_S, step_s, states, inputs, covariances, gathered }
}

fn on_a_table() -> LocalTrajectory<PlanarState, 3, 4> {
    let inputs: Vec<[f64; 3]> = (0..24).map(|k| [0.02 * wave(k, 0), 0.3 * wave(k, 1), 0.3 * wave(k, 2)]).collect();
    let mut model = PlanarBodyModel::full();
    model.adopt(&ModelBelief::certain(1, body())).unwrap();
    let start = PlanarState {
        position_world: Vector2::new(0.4, -0.7),
        velocity_world: Vector2::new(-0.05, 0.1),
        heading_rad: 7.0,
        rate_rad_s: 0.15,
    };
    let mut states = vec![start];
    for input in &inputs {
        states.push(model.step(states.last().unwrap(), &[[0.0; 6]; 4], input, 0.5).unwrap().0);
    }
    let (covariances, gathered) = (Vec::new(), SMatrix::zeros());
    LocalTrajectory { start_s: START_S, step_s: 0.5, states, inputs, covariances, gathered }
}

fn way() -> ArcPath {
    let start = TranslationState { position: Vector3::new(0.2, 0.1, -0.3), velocity: Vector3::new(0.1, 0.0, 0.05) };
    let first = BodyArc::accelerated(3.0, &start, Vector3::new(0.0, 0.03, -0.01), UnitQuaternion::identity())
        .turning(Unit::new_normalize(Vector3::new(1.0, -2.0, 0.5)), [0.0, 0.0, 0.03, -0.004, 0.0, 0.0]);
    let rate = first.turn(3.0).1;
    let second =
        BodyArc::accelerated(2.0, &first.translation(3.0).0, Vector3::new(0.02, 0.0, 0.0), first.attitude_at(3.0))
            .turning(first.axis_body, [0.0, rate, -0.01, 0.0, 0.0, 0.0]);
    ArcPath::new([first, second])
}

fn motions() -> [MissionMotion; 4] {
    [
        MissionMotion::planned(&in_space(0.5, 0.02), &body()).with_stop(&LIMITS),
        MissionMotion::planned_in_plane(&on_a_table(), 0.35, &body()).with_stop(&LIMITS),
        MissionMotion::along(&way(), START_S - 1.0, START_S, START_S + 3.5).with_stop(&LIMITS),
        MissionMotion::stopping_from(
            &RigidBodyState {
                world_from_body: Pose::from_parts(
                    Vector3::new(0.5, 0.0, 1.0).into(),
                    UnitQuaternion::from_euler_angles(1.0, 0.2, -0.7),
                ),
                twist_body: tumble_lie::Twist::new(Vector3::new(0.2, -0.1, 0.3), Vector3::new(0.1, -0.05, 0.2)),
            },
            START_S,
            &LIMITS,
        ),
    ]
}

/// Largest differences of position, attitude, velocity of the origin, and rate.
fn apart(one: &RigidBodyState<f64>, other: &RigidBodyState<f64>) -> [f64; 4] {
    let [p, q] = [one, other].map(|state| state.world_from_body.translation.vector);
    let [v, w] = [one, other].map(|state| state.world_from_body.rotation * state.twist_body.linear);
    let turned = one.world_from_body.rotation.inverse() * other.world_from_body.rotation;
    let rate = one.twist_body.angular - other.twist_body.angular;
    [(p - q).norm(), LieGroup::log(&turned).norm(), (v - w).norm(), rate.norm()]
}

/// The motion is one where position, attitude, velocity and rate are within what it can do in the time between.
#[test]
fn nothing_jumps_at_any_time() {
    for (index, motion) in motions().iter().enumerate() {
        let (from_s, to_s) = (motion.start_s() + 1e-9, motion.rest_s() + 1.0);
        assert!(motion.start_s() >= START_S && motion.end_s() >= motion.start_s());
        assert!(motion.rest_s() > motion.end_s() + 1.0, "{index}");
        let step_s = 1e-4;
        let steps = ((to_s - from_s) / step_s) as u32;
        let mut last = motion.state_at(from_s);
        for k in 1..=steps {
            let next = motion.state_at(from_s + step_s * f64::from(k));
            let [moved, turned, faster, turning] = apart(&last, &next);
            assert!(moved < 1.0 * step_s && turned < 1.0 * step_s, "{index} {k} {moved} {turned}");
            assert!(faster < 0.2 * step_s && turning < 0.4 * step_s, "{index} {k} {faster} {turning}");
            last = next;
        }
        assert_eq!(last.twist_body, tumble_lie::Twist::zero());
    }
}

#[test]
fn twist_and_acceleration_are_the_rates_of_change() {
    for (index, motion) in motions().iter().enumerate() {
        let width_s = 1e-4;
        let (mut checked, mut worst) = (0, 0.0);
        for k in 0..400 {
            // away from the times at which the acceleration jumps
            let time_s = motion.start_s() + 0.05 + 0.0713 * f64::from(k);
            let [before, at, after] = [-width_s, 0.0, width_s].map(|shift_s| motion.at(time_s + shift_s));
            let jump = after.acceleration.acceleration_origin_body - before.acceleration.acceleration_origin_body;
            if time_s + 0.1 > motion.rest_s() || jump.norm() > 1e-4 {
                continue;
            }
            checked += 1;
            let of = |reference: &PoseReference| {
                let RigidBodyState { world_from_body, twist_body } = reference.state;
                (world_from_body.translation.vector, world_from_body.rotation * twist_body.linear)
            };
            let [(p0, v0), (_, v), (p1, v1)] = [of(&before), of(&at), of(&after)];
            let attitude = at.state.world_from_body.rotation;
            worst = f64::max(worst, ((p1 - p0) / (2.0 * width_s) - v).norm());
            let acceleration = attitude * at.acceleration.acceleration_origin_body;
            worst = f64::max(worst, ((v1 - v0) / (2.0 * width_s) - acceleration).norm());
            let turned = before.state.world_from_body.rotation.inverse() * after.state.world_from_body.rotation;
            let rate = LieGroup::log(&turned) / (2.0 * width_s);
            worst = f64::max(worst, (rate - at.state.twist_body.angular).norm());
            let faster = (after.state.twist_body.angular - before.state.twist_body.angular) / (2.0 * width_s);
            worst = f64::max(worst, (faster - at.acceleration.angular_acceleration_body).norm());
        }
        println!("{index} {worst:e}");
        assert!(worst < 1e-7, "{index} {worst:e}");
        assert!(checked > 30, "{index} {checked}");
    }
}

/// The wrench that the believed body needs is the input that is held.
#[test]
fn a_planned_motion_is_that_of_the_body_under_its_inputs() {
    let plan = in_space(0.5, 0.02);
    let (motion, flyer) = (MissionMotion::planned(&plan, &body()), tumble_dynamics::FreeFlyer::new(body()));
    for (k, [t0, t1, t2, f0, f1, f2]) in plan.inputs.iter().enumerate() {
        for share in [0.01, 0.37, 0.99] {
            let reference = motion.at(START_S + 0.5 * (k as f64 + share));
            let wrench = flyer.inverse(&reference.state.twist_body, &reference.acceleration);
            assert!((wrench.torque - Vector3::new(*t0, *t1, *t2)).norm() < 1e-13, "{k}");
            assert!((wrench.force - Vector3::new(*f0, *f1, *f2)).norm() < 1e-13, "{k}");
        }
    }
}

/// Largest difference of a motion from the nodes of its plan, m, rad, m/s or rad/s.
fn from_nodes(motion: &MissionMotion, nodes: &[RigidBodyState<f64>], step_s: f64) -> f64 {
    let differences = nodes.iter().enumerate().map(|(k, node)| {
        let found = motion.state_at(START_S + step_s * k as f64);
        apart(&found, node).into_iter().fold(0.0, f64::max)
    });
    differences.fold(0.0, f64::max)
}

/// Another integrator with steps 32 times shorter: on the centre of mass and the quaternion.
#[test]
fn it_is_where_the_inputs_take_the_body() {
    let plan = in_space(0.5, 0.02);
    let mut model = RigidBodyModel::full();
    model.adopt(&ModelBelief::certain(1, body())).unwrap();
    let mut state = plan.states[0];
    let mut exact = vec![(&state).into()];
    for input in &plan.inputs {
        for _ in 0..32 {
            state = model.step(&state, &[[0.0; 12]; 10], input, 0.5 / 32.0).unwrap().0;
        }
        exact.push((&state).into());
    }
    let motion = MissionMotion::planned(&plan, &body());
    let error = from_nodes(&motion, &exact, 0.5);
    assert!(error < 1e-7, "{error:e}");
    assert!((motion.end_s() - START_S - 12.0).abs() < 1e-12 && motion.rest_s() == motion.end_s());
}

/// What it differs from the plan's nodes by is the error of the plan's longer steps: of fourth order.
#[test]
fn it_passes_the_nodes_of_the_plan_as_near_as_those_are_exact() {
    let apart_of = |step_s: f64| {
        let plan = in_space(step_s, 0.02);
        let nodes: Vec<_> = plan.states.iter().map(RigidBodyState::from).collect();
        from_nodes(&MissionMotion::planned(&plan, &body()), &nodes, step_s)
    };
    let [long, short] = [0.5, 0.25].map(apart_of);
    assert!(long < 1e-5 && short < 1e-6 && long / short > 10.0, "{long:e} {short:e}");
}

#[test]
fn a_plan_on_a_table_stays_on_it() {
    let plan = on_a_table();
    let motion = MissionMotion::planned_in_plane(&plan, 0.35, &body()).with_stop(&LIMITS);
    let nodes = plan.states.iter().map(|node| {
        let attitude = UnitQuaternion::from_axis_angle(&Vector3::z_axis(), node.heading_rad);
        let velocity = attitude.inverse() * node.velocity_world.push(0.0);
        RigidBodyState {
            world_from_body: Pose::from_parts(node.position_world.push(0.35).into(), attitude),
            twist_body: tumble_lie::Twist::new(Vector3::z() * node.rate_rad_s, velocity),
        }
    });
    let error = from_nodes(&motion, &nodes.collect::<Vec<_>>(), 0.5);
    assert!(error < 2e-6, "{error:e}");
    for k in 0..2000 {
        let PoseReference { state, acceleration } = motion.at(START_S - 0.1 + 0.01 * f64::from(k));
        let RigidBodyState { world_from_body: Pose { rotation, translation }, twist_body } = state;
        assert_eq!([translation.z, rotation.i, rotation.j], [0.35, 0.0, 0.0], "{k}");
        assert_eq!([twist_body.angular.x, twist_body.angular.y, twist_body.linear.z], [0.0; 3], "{k}");
        assert_eq!(acceleration.angular_acceleration_body.xy().amax(), 0.0, "{k}");
        assert_eq!(acceleration.acceleration_origin_body.z, 0.0, "{k}");
    }
}

#[test]
fn a_stop_is_as_long_as_it_must_be() {
    for motion in motions() {
        let end = motion.state_at(motion.end_s());
        let RigidBodyState { world_from_body, twist_body } = end;
        let (speed, rate) = (twist_body.linear.norm(), twist_body.angular.norm());
        let longest_s = f64::max(speed / LIMITS.acceleration_m_s2, rate / LIMITS.angular_acceleration_rad_s2);
        assert!((motion.rest_s() - motion.end_s() - longest_s).abs() < 1e-9);
        let resting = motion.resting_pose();
        let way = resting.translation.vector - world_from_body.translation.vector;
        let ahead = world_from_body.rotation * twist_body.linear / speed;
        assert!((way - ahead * (speed * speed / (2.0 * LIMITS.acceleration_m_s2))).norm() < 1e-12);
        let turned = LieGroup::log(&(world_from_body.rotation.inverse() * resting.rotation));
        let angle = rate * rate / (2.0 * LIMITS.angular_acceleration_rad_s2);
        assert!((turned - twist_body.angular / rate * angle).norm() < 1e-12);
        // a share of the way into it: what is left of speed and rate
        for share in [0.1, 0.3, 0.6, 0.9] {
            let since_s = share * longest_s;
            let at = motion.at(motion.end_s() + since_s);
            let left = f64::max(0.0, speed - LIMITS.acceleration_m_s2 * since_s);
            assert!((at.state.twist_body.linear.norm() - left).abs() < 1e-12);
            let left = f64::max(0.0, rate - LIMITS.angular_acceleration_rad_s2 * since_s);
            assert!((at.state.twist_body.angular.norm() - left).abs() < 1e-12);
        }
    }
}

#[test]
fn what_ends_at_rest_needs_no_stop_and_a_second_stop_is_the_first() {
    let resting = MissionMotion::resting(Pose::translation(1.0, 2.0, 3.0), 4.0).with_stop(&LIMITS);
    assert_eq!((resting.start_s(), resting.end_s(), resting.rest_s()), (4.0, 4.0, 4.0));
    let mut plan = in_space(0.5, 0.02);
    (plan.inputs, plan.states) = (vec![[0.0; 6]; 4], vec![Kinematics::at_rest(Pose::translation(1.0, 2.0, 3.0))]);
    let still = MissionMotion::planned(&plan, &body()).with_stop(&LIMITS);
    assert_eq!((still.end_s(), still.rest_s()), (START_S + 2.0, START_S + 2.0));
    for motion in motions() {
        let again = motion.clone().with_stop(&LIMITS);
        assert_eq!((again.rest_s(), again.resting_pose()), (motion.rest_s(), motion.resting_pose()));
        let without = motion.clone().with_stop(&StopLimits { acceleration_m_s2: 0.0, ..LIMITS });
        assert!(without.rest_s() <= motion.rest_s() && without.rest_s().is_finite());
    }
}

#[test]
fn before_and_after_it_rests() {
    for motion in motions() {
        let still = |time_s: f64| {
            let at = motion.at(time_s);
            assert_eq!(at, arcs::at_rest(at.state.world_from_body));
            at.state.world_from_body
        };
        let first = motion.state_at(motion.start_s()).world_from_body;
        for time_s in [motion.start_s() - 1e-6, -1e9, f64::NEG_INFINITY] {
            let found = still(time_s);
            assert!((found.translation.vector - first.translation.vector).norm() < 1e-15);
        }
        for time_s in [motion.rest_s() + 1e-6, 1e9, f64::INFINITY, f64::NAN] {
            assert_eq!(still(time_s), *motion.resting_pose());
        }
    }
}

#[test]
fn a_part_of_a_way_is_the_way() {
    let (way, way_start_s) = (way(), 100.0);
    let motion = MissionMotion::along(&way, way_start_s, 101.3, 104.1);
    assert_eq!((motion.start_s(), motion.rest_s()), (101.3, motion.end_s()));
    assert!((motion.end_s() - 104.1).abs() < 1e-12);
    for k in 0..=100 {
        let time_s = (101.3 + 0.028 * f64::from(k)).min(motion.end_s());
        let (arc, within_s) = way.at(time_s - way_start_s).unwrap();
        let (expected, found) = (arcs::reference(arc, within_s), motion.at(time_s));
        assert!(apart(&expected.state, &found.state).iter().all(|apart| *apart < 1e-12), "{k}");
        let pose = arc.pose(within_s);
        assert!((pose.translation.vector - found.state.world_from_body.translation.vector).norm() < 1e-12);
    }
    // beyond the way there is nothing
    let whole = MissionMotion::along(&way, way_start_s, 90.0, 200.0);
    assert_eq!((whole.start_s(), whole.end_s()), (way_start_s, way_start_s + 5.0));
    for nothing in [
        MissionMotion::along(&way, way_start_s, 106.0, 110.0),
        MissionMotion::along(&way, way_start_s, 103.0, 102.0),
        MissionMotion::along(&ArcPath::default(), way_start_s, 103.0, 104.0),
    ] {
        assert!(nothing.with_stop(&LIMITS).stop.arcs().is_empty());
    }
}

/// The bound holds at every time, and is not idle.
#[test]
fn pieces_are_no_farther_from_the_motion_than_they_say() {
    let (mut largest, mut of_bound) = ([0.0_f64; 2], [0.0_f64; 2]);
    for (step_s, torque_n_m) in [(0.5, 0.02), (0.3, 0.3), (0.09, 1.0)] {
        let plan = in_space(step_s, torque_n_m);
        let motion = MissionMotion::planned(&plan, &body());
        let Planned::Held(held) = &motion.planned else { panic!() };
        for (since_s, piece) in held.arcs(0) {
            let mut worst = [0.0_f64; 2];
            for k in 0..=16 {
                let within_s = piece.arc.duration_s * f64::from(k) / 16.0;
                let there = held.at(since_s + within_s).unwrap().state.world_from_body;
                let pose = piece.arc.pose(within_s);
                worst[0] = worst[0].max((there.translation.vector - pose.translation.vector).norm());
                worst[1] = worst[1].max(LieGroup::log(&(there.rotation.inverse() * pose.rotation)).norm());
            }
            // rounding, and the error of one step of a tenth of a second
            assert!(worst[0] <= piece.apart_m + 1e-9, "{worst:?} {}", piece.apart_m);
            assert!(worst[1] <= piece.apart_rad + 1e-12, "{worst:?} {}", piece.apart_rad);
            let shares = [worst[0] / piece.apart_m, worst[1] / piece.apart_rad];
            of_bound = core::array::from_fn(|i| of_bound[i].max(shares[i]));
            if torque_n_m < 0.1 {
                largest = core::array::from_fn(|i| largest[i].max([piece.apart_m, piece.apart_rad][i]));
            }
        }
    }
    println!("bounds {largest:?}, used {of_bound:?}");
    assert!(largest[0] < 1e-7 && largest[1] < 1e-3, "{largest:?}");
    assert!(of_bound.iter().all(|share| *share > 0.2), "{of_bound:?}");
}

/// A body that spins faster than the bound can follow is anywhere it can reach.
#[test]
fn nothing_is_said_of_pieces_that_turn_too_far() {
    let mut plan = in_space(0.5, 0.02);
    plan.states[0].rate_body = Vector3::new(4.0, 0.0, 0.0);
    let fast = MissionMotion::planned(&plan, &body());
    plan.states[0].rate_body = Vector3::new(600.0, 1.0, 0.0);
    let faster = MissionMotion::planned(&plan, &body());
    let first = |motion: &MissionMotion| match &motion.planned {
        Planned::Held(held) => held.arcs(0).map(|(_, piece)| [piece.apart_m, piece.apart_rad]).next().unwrap(),
        _ => panic!(),
    };
    assert_eq!(first(&fast)[1], core::f64::consts::PI);
    assert_eq!(first(&faster), [f64::INFINITY, core::f64::consts::PI]);
    let world = crate::collision::EllipsoidWorld::new(&tumble_dynamics::World::default()).unwrap();
    let shape = crate::collision::BodyShape::sphere(0.2).unwrap();
    assert_eq!(fast.first_contact(&world, &shape, START_S, 0.1), Ok(None));
    assert_eq!(faster.first_contact(&world, &shape, START_S, 0.1), Ok(Some(START_S)));
}

#[test]
fn a_plan_without_a_motion_is_rest() {
    let mut plan = in_space(0.5, 0.02);
    for step_s in [0.0, -1.0, f64::NAN, f64::INFINITY] {
        let motion = MissionMotion::planned(&LocalTrajectory { step_s, ..plan.clone() }, &body());
        assert_eq!((motion.end_s(), motion.rest_s()), (START_S, START_S), "{step_s}");
        assert_eq!(motion.resting_pose(), &plan.states[0].world_from_body);
    }
    plan.inputs[1][2] = f64::NAN;
    let motion = MissionMotion::planned(&plan, &body());
    assert!((motion.end_s() - START_S - 0.5).abs() < 1e-12);
    plan.states.clear();
    assert_eq!(MissionMotion::planned(&plan, &body()).state_at(0.0), RigidBodyState::at_rest());
}

#[test]
fn points_are_on_the_way() {
    for motion in motions() {
        let points = motion.points(0.25);
        let count = ((motion.rest_s() - motion.start_s()) / 0.25).ceil() as usize + 1;
        assert_eq!(points.len(), count);
        for (k, point) in points.iter().enumerate().take(count - 1) {
            let there = motion.state_at(motion.start_s() + 0.25 * k as f64).world_from_body;
            assert_eq!(*point, there.translation.vector);
        }
        assert_eq!(points.last(), Some(&motion.resting_pose().translation.vector));
        assert_eq!(motion.points(f64::NAN).len(), 2);
        assert_eq!(motion.points(-1.0).len(), 2);
        assert_eq!(motion.points(1e-9).len(), 100_001);
    }
    assert_eq!(MissionMotion::resting(Pose::identity(), 1.0).points(0.1), [Vector3::zeros()]);
}

/// A stop asks for no more than the force and the torque it was made for, about the axis that is hardest to brake.
#[test]
fn a_stop_is_as_hard_as_the_heaviest_body_can() {
    let body =
        InertialParameters::about_com(5.0, Vector3::zeros(), Matrix3::from_diagonal(&Vector3::new(0.1, 0.4, 0.2)));
    let stop = StopLimits::for_body(&body, 0.2, 0.01);
    assert!((stop.acceleration_m_s2 * 5.0 - 0.2).abs() < 1e-15);
    assert!((stop.angular_acceleration_rad_s2 * 0.4 - 0.01).abs() < 1e-15);
}
