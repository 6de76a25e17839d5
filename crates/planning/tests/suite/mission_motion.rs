//! Motions of missions: what they hit is found, and only that; they never jump.

use tumble_planning::collision::{BodyShape, EllipsoidWorld, MovingObstacle};
use tumble_planning::control::ReferenceMotion;
use tumble_planning::dynamics::{InertialParameters, ObstacleEllipsoid, RigidBodyState, World};
use tumble_planning::lie::{Pose, Twist};
use tumble_planning::local::{Kinematics, LocalTrajectory, PlanarState};
use tumble_planning::mission::{MissionMotion, StopLimits};
use tumble_planning::nalgebra::{Matrix3, SMatrix, UnitQuaternion, Vector2, Vector3};
use tumble_planning::{ArcPath, BodyArc};

use crate::sweep_oracle::{Draws, TOLERANCE_M, clearance};

/// Farthest that a contact found may be from one, m: what planned parts keep off farther by.
const KEPT_OFF_M: f64 = 2e-3;

fn body(draws: &mut Draws) -> InertialParameters<f64> {
    let turn = *draws.attitude().to_rotation_matrix().matrix();
    let moments = Vector3::new(draws.within(0.14, 0.2), draws.within(0.14, 0.2), draws.within(0.14, 0.2));
    let inertia = turn * Matrix3::from_diagonal(&moments) * turn.transpose();
    InertialParameters::about_com(draws.within(8.0, 20.0), draws.vector(0.08), inertia)
}

fn plan<S, const U: usize>(start: S, start_s: f64, step_s: f64, inputs: Vec<[f64; U]>) -> LocalTrajectory<S, U, 4> {
    LocalTrajectory {
        start_s,
        step_s,
        states: vec![start],
        inputs,
        covariances: Vec::new(),
        gathered: SMatrix::zeros(),
    }
}

fn limits(draws: &mut Draws) -> StopLimits {
    StopLimits { acceleration_m_s2: draws.within(0.01, 0.1), angular_acceleration_rad_s2: draws.within(0.02, 0.2) }
}

/// A plan in space that wanders about the origin.
fn in_space(draws: &mut Draws, start_s: f64) -> MissionMotion {
    let start = Kinematics {
        world_from_body: Pose::from_parts(draws.vector(1.0).into(), draws.attitude()),
        velocity_world: draws.vector(0.2),
        rate_body: draws.vector(0.3),
    };
    let steps = 4 + draws.one_of(12);
    let inputs = (0..steps)
        .map(|_| {
            let (torque, force) = (draws.vector(0.04), draws.vector(0.6));
            [torque.x, torque.y, torque.z, force.x, force.y, force.z]
        })
        .collect();
    let plan = plan(start, start_s, draws.within(0.2, 0.6), inputs);
    MissionMotion::planned(&plan, &body(draws))
}

fn in_a_plane(draws: &mut Draws, start_s: f64) -> MissionMotion {
    let start = PlanarState {
        position_world: Vector2::new(draws.within(-1.0, 1.0), draws.within(-1.0, 1.0)),
        velocity_world: Vector2::new(draws.within(-0.2, 0.2), draws.within(-0.2, 0.2)),
        heading_rad: draws.within(-9.0, 9.0),
        rate_rad_s: draws.within(-0.4, 0.4),
    };
    let steps = 4 + draws.one_of(12);
    let inputs =
        (0..steps).map(|_| [draws.within(-0.04, 0.04), draws.within(-0.6, 0.6), draws.within(-0.6, 0.6)]).collect();
    let plan = plan(start, start_s, draws.within(0.2, 0.6), inputs);
    MissionMotion::planned_in_plane(&plan, draws.within(-1.0, 1.0), &body(draws))
}

/// A part of two arcs.
fn along(draws: &mut Draws, start_s: f64) -> MissionMotion {
    let case = draws.case();
    let first = case.arc;
    let end = first.translation(first.duration_s).0;
    let rate = first.turn(first.duration_s).1;
    let attitude = first.attitude_at(first.duration_s);
    let second = BodyArc::accelerated(draws.within(0.5, 3.0), &end, draws.vector(0.1), attitude)
        .turning(first.axis_body, [0.0, rate, draws.within(-0.1, 0.1), 0.0, 0.0, 0.0]);
    let way = ArcPath::new([first, second]);
    let from_s = draws.within(0.0, 0.7) * way.duration_s();
    let until_s = draws.within(from_s, way.duration_s());
    MissionMotion::along(&way, start_s - from_s, start_s, start_s - from_s + until_s)
}

fn at_once(draws: &mut Draws, start_s: f64) -> MissionMotion {
    let state = RigidBodyState {
        world_from_body: Pose::from_parts(draws.vector(1.0).into(), draws.attitude()),
        twist_body: Twist::new(draws.vector(0.6), draws.vector(0.3)),
    };
    let limits = limits(draws);
    MissionMotion::stopping_from(&state, start_s, &limits)
}

fn motion(draws: &mut Draws, start_s: f64) -> MissionMotion {
    let planned = match draws.one_of(4) {
        0 => in_space(draws, start_s),
        1 => in_a_plane(draws, start_s),
        2 => along(draws, start_s),
        _ => return at_once(draws, start_s),
    };
    let limits = limits(draws);
    planned.with_stop(&limits)
}

/// Dense samples of the motion itself, by distances that share no code with the world's.
#[test]
fn no_contact_is_missed_and_none_is_far_from_one() {
    let mut draws = Draws::new(9);
    let (mut free, mut hit, mut late) = (0, 0, 0);
    for index in 0..1500 {
        let case = draws.case();
        let motion = motion(&mut draws, case.start_s);
        let (start_s, rest_s) = (motion.start_s(), motion.rest_s());
        assert!((start_s - case.start_s).abs() < 1e-12 && rest_s >= start_s, "{index}");
        let from_s = if draws.one_of(3) == 0 { draws.within(start_s, rest_s) } else { start_s };
        let found = motion.first_contact(&case.world(), &case.body(), from_s, case.margin_m).unwrap();
        let until_s = found.unwrap_or(rest_s);
        assert!(until_s >= from_s && until_s <= rest_s + 1e-12, "{index} {from_s} {until_s} {rest_s}");

        let clear_at = |time_s: f64| {
            let pose = motion.state_at(time_s).world_from_body;
            let pairs = case.parts.iter().flat_map(|part| case.obstacles.iter().map(move |it| (part, it)));
            pairs
                .map(|(part, it)| clearance(part, it, &pose, time_s - case.start_s, case.margin_m))
                .fold(f64::INFINITY, f64::min)
        };
        // what appears is there at once, up to the rounding of mission times
        let before_s = until_s - if found.is_some() { 1e-12 } else { 0.0 };
        for sample in 0..=400 {
            let time_s = from_s + (before_s - from_s) * f64::from(sample) / 400.0;
            if before_s >= from_s {
                let clear_m = clear_at(time_s);
                assert!(clear_m > -TOLERANCE_M, "{index}: {clear_m} at {time_s} of {from_s} to {found:?}");
            }
        }
        if let Some(contact_s) = found {
            let clear_m = clear_at(contact_s).min(clear_at(contact_s + 1e-9));
            assert!(clear_m < KEPT_OFF_M, "{index}: {clear_m} is no contact");
            hit += 1;
            late += usize::from(contact_s > motion.end_s());
        } else {
            free += 1;
        }
    }
    println!("{free} free, {hit} hit, {late} in the stop");
    assert!(free > 1000 && hit > 150 && late > 40, "{free} {hit} {late}");
}

fn ball(center: Vector3<f64>, radius_m: f64) -> ObstacleEllipsoid {
    ObstacleEllipsoid {
        world_from_ellipsoid: Pose::from_parts(center.into(), UnitQuaternion::identity()),
        semi_axes: Vector3::repeat(radius_m),
    }
}

fn world(obstacle: MovingObstacle) -> EllipsoidWorld {
    EllipsoidWorld::new(&World::default()).unwrap().with_obstacle(obstacle).unwrap()
}

/// A ball of 0.2 m that coasts along x at 0.1 m/s from the mission time 50 on, for 10 s, and brakes at 0.02 m/s^2.
fn coasting() -> MissionMotion {
    let mut start = Kinematics::at_rest(Pose::identity());
    start.velocity_world = Vector3::new(0.1, 0.0, 0.0);
    let point = InertialParameters::solid_box(10.0, [0.3; 3]);
    let stop = StopLimits { acceleration_m_s2: 0.02, angular_acceleration_rad_s2: 0.1 };
    MissionMotion::planned(&plan(start, 50.0, 0.5, vec![[0.0; 6]; 20]), &point).with_stop(&stop)
}

#[test]
fn what_moves_is_met_where_it_is_then() {
    let (motion, body) = (coasting(), BodyShape::sphere(0.2).unwrap());
    assert!((motion.rest_s() - 65.0).abs() < 1e-9);
    assert!((motion.resting_pose().translation.x - 1.25).abs() < 1e-9);
    // head on, at 3.05 m when the motion begins: the gap of 3.05 - 0.2 - 0.3 - 0.05 closes at 0.25 m/s
    let oncoming =
        MovingObstacle::at_rest(ball(Vector3::new(3.05, 0.0, 0.0), 0.3)).drifting(Vector3::new(-0.15, 0.0, 0.0), 50.0);
    let found = motion.first_contact(&world(oncoming), &body, 50.0, 0.05).unwrap().unwrap();
    assert!((found - 60.0).abs() < 1e-6, "{found}");
    // with less margin it is met while it brakes: 0.05 m of the gap are left at the end of the plan
    let found = motion.first_contact(&world(oncoming), &body, 57.3, 0.0).unwrap().unwrap();
    let closing_s = (0.25 - f64::sqrt(0.25 * 0.25 - 2.0 * 0.02 * 0.05)) / 0.02;
    assert!((found - 60.0 - closing_s).abs() < 1e-6, "{found}");
    // across the way, ahead of it and behind it
    let crossing = |since_s: f64| {
        MovingObstacle::at_rest(ball(Vector3::new(0.6, 0.0, 0.0), 0.3)).drifting(Vector3::new(0.0, 0.4, 0.0), since_s)
    };
    assert!(motion.first_contact(&world(crossing(56.0)), &body, 50.0, 0.0).unwrap().is_some());
    assert_eq!(motion.first_contact(&world(crossing(46.0)), &body, 50.0, 0.0), Ok(None));
    assert_eq!(motion.first_contact(&world(crossing(56.0)), &body, 59.0, 0.0), Ok(None));
    // gone before it comes
    assert_eq!(motion.first_contact(&world(oncoming.present(0.0, 59.9)), &body, 50.0, 0.05), Ok(None));
}

#[test]
fn rest_is_looked_at_as_long_as_is_asked() {
    let (motion, body) = (coasting(), BodyShape::sphere(0.2).unwrap());
    // at 0.1 m/s from 4.75 m it meets the body at rest at 1.25 m at the mission time 80
    let late = world(
        MovingObstacle::at_rest(ball(Vector3::new(4.75, 0.0, 0.0), 0.3)).drifting(Vector3::new(-0.1, 0.0, 0.0), 50.0),
    );
    assert_eq!(motion.first_contact(&late, &body, 50.0, 0.0), Ok(None));
    assert_eq!(motion.first_contact_until(&late, &body, 50.0, 79.99, 0.0), Ok(None));
    let found = motion.first_contact_until(&late, &body, 50.0, 90.0, 0.0).unwrap().unwrap();
    assert!((found - 80.0).abs() < 1e-6, "{found}");
    let resting = MissionMotion::resting(*motion.resting_pose(), 65.0);
    for from_s in [50.0, 65.0, 70.0] {
        let found = resting.first_contact_until(&late, &body, from_s, 90.0, 0.0).unwrap().unwrap();
        assert!((found - 80.0).abs() < 1e-6, "{found}");
    }
    // what is there already, at rest
    let there = world(MovingObstacle::at_rest(ball(Vector3::new(1.7, 0.0, 0.0), 0.3)));
    assert_eq!(resting.first_contact(&there, &body, 70.0, 0.0), Ok(Some(70.0)));
    let beside = world(MovingObstacle::at_rest(ball(Vector3::new(1.76, 0.0, 0.0), 0.3)));
    assert_eq!(resting.first_contact(&beside, &body, 70.0, 0.0), Ok(None));
    assert_eq!(resting.first_contact(&beside, &body, 70.0, 0.02), Ok(Some(70.0)));
    // numbers that are none are errors, never free
    for hostile in [f64::NAN, f64::INFINITY, f64::NEG_INFINITY] {
        assert!(motion.first_contact(&beside, &body, hostile, 0.0).is_err());
        assert!(resting.first_contact(&beside, &body, hostile, 0.0).is_err());
        assert!(resting.first_contact_until(&beside, &body, 70.0, hostile, 0.0).is_err());
    }
    assert!(motion.first_contact(&beside, &body, 50.0, -1.0).is_err());
}

/// Whatever the motion, it is one: what it says of its twist and acceleration is what its poses do.
#[test]
fn motions_of_any_kind_never_jump() {
    let mut draws = Draws::new(4);
    for index in 0..200 {
        let motion = motion(&mut draws, 12.0);
        let (from_s, length_s) = (motion.start_s(), motion.rest_s() - motion.start_s());
        let mut fastest = 0.0_f64;
        for sample in 0..100 {
            let time_s = from_s + length_s * (f64::from(sample) + draws.within(0.0, 0.5)) / 100.0;
            // over a jump of the acceleration, velocities change by no more than it allows
            let step_s = 1e-5;
            let (before, after) = (motion.at(time_s), motion.at(time_s + step_s));
            let [from, to] = [before, after].map(|at| at.state.world_from_body);
            let twists = [before, after].map(|at| at.state.twist_body);
            let velocities = [from.rotation * twists[0].linear, to.rotation * twists[1].linear];
            let push = f64::max(
                before.acceleration.acceleration_origin_body.norm(),
                after.acceleration.acceleration_origin_body.norm(),
            );
            let spin = f64::max(
                before.acceleration.angular_acceleration_body.norm(),
                after.acceleration.angular_acceleration_body.norm(),
            );
            let slack = 1e-3 * step_s;
            assert!((velocities[1] - velocities[0]).norm() <= push * step_s + slack, "{index} {time_s}");
            assert!((twists[1].angular - twists[0].angular).norm() <= spin * step_s + slack, "{index} {time_s}");
            let moved = to.translation.vector - from.translation.vector;
            let mean = (velocities[0] + velocities[1]) * 0.5;
            assert!((moved - mean * step_s).norm() <= (push + 0.01) * step_s * step_s + 1e-13, "{index} {time_s}");
            fastest = fastest.max(velocities[0].norm());
        }
        assert!(fastest > 0.0, "{index}");
    }
}
