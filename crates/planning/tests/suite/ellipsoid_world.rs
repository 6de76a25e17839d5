//! The world of ellipsoids and boxes: clearances, times, symmetries and refusals.

use crate::sweep_oracle::{Case, Draws, Obstacle};
use tumble_planning::collision::{
    Blocker, BodyShape, CollisionWorld, EllipsoidWorld, MovingObstacle, conservative_first_contact,
};
use tumble_planning::dynamics::{AlignedBox, ObstacleEllipsoid, World};
use tumble_planning::lie::Pose;
use tumble_planning::nalgebra::{UnitQuaternion, Vector3};
use tumble_planning::{BodyArc, PlanningError, TranslationState};

fn ball(x: f64, y: f64, z: f64, radius: f64) -> ObstacleEllipsoid {
    ObstacleEllipsoid { world_from_ellipsoid: Pose::translation(x, y, z), semi_axes: Vector3::repeat(radius) }
}

fn straight(from: Vector3<f64>, velocity: Vector3<f64>, duration_s: f64) -> BodyArc {
    let start = TranslationState { position: from, velocity };
    BodyArc::accelerated(duration_s, &start, Vector3::zeros(), UnitQuaternion::identity())
}

fn room() -> AlignedBox {
    AlignedBox::between(Vector3::new(-1.0, -2.0, -3.0), Vector3::new(1.0, 2.0, 3.0))
}

#[test]
fn clearance_names_what_is_nearest() {
    let data = World {
        keep_in: vec![room()],
        keep_out: vec![AlignedBox::between(Vector3::new(-1.0, 1.0, -3.0), Vector3::new(0.0, 2.0, 3.0))],
        obstacles: vec![ball(0.5, -1.0, 0.0, 0.2), ball(0.5, -1.0, 1.0, 0.3)],
    };
    let world = EllipsoidWorld::new(&data).unwrap();
    let body = BodyShape::sphere(0.1).unwrap();
    let at = |x, y, z| {
        let clearance = world.clearance(&body, &Pose::translation(x, y, z), 0.0).unwrap();
        (clearance.distance_m, clearance.nearest.unwrap())
    };
    let close = |(found, blocker): (f64, Blocker), expected: f64, of: Blocker| {
        assert!((found - expected).abs() < 1e-14 && blocker == of, "{found} {blocker:?}: {expected} {of:?}");
    };
    close(at(0.0, -1.0, 0.0), 0.2, Blocker::Obstacle(0));
    close(at(0.0, -1.0, 1.0), 0.1, Blocker::Obstacle(1));
    close(at(0.5, -1.0, 0.05), -0.25, Blocker::Obstacle(0));
    close(at(-0.2, 0.7, 0.0), 0.2, Blocker::KeepOut(0));
    close(at(-0.5, 1.1, 0.0), -0.2, Blocker::KeepOut(0));
    close(at(0.0, 0.0, 2.85), 0.05, Blocker::KeepIn);
    close(at(0.0, 0.0, 2.95), -0.05, Blocker::KeepIn);
    close(at(0.95, 0.0, 0.0), -0.05, Blocker::KeepIn);
    assert!((world.reach_m(&body) - 0.1).abs() < 1e-15);
    let nothing = EllipsoidWorld::new(&World::default()).unwrap();
    let clearance = nothing.clearance(&body, &Pose::identity(), 0.0).unwrap();
    assert!(clearance.distance_m.is_infinite() && clearance.nearest.is_none());
}

#[test]
fn first_contact_is_where_the_closed_form_says() {
    let body = BodyShape::sphere(0.1).unwrap();
    // Accelerated towards a wall: 0.9 = 0.02 t + 0.005 t^2.
    let walls = EllipsoidWorld::new(&World { keep_in: vec![room()], ..World::default() }).unwrap();
    let start = TranslationState { position: Vector3::zeros(), velocity: Vector3::x() * 0.02 };
    let arc = BodyArc::accelerated(20.0, &start, Vector3::x() * 0.01, UnitQuaternion::identity());
    let expected_s = (-0.02 + (0.02_f64 * 0.02 + 4.0 * 0.005 * 0.9).sqrt()) / 0.01;
    let contact = walls.first_contact(&body, &arc, 5.0, 0.0).unwrap().unwrap();
    assert!((contact.time_s - expected_s).abs() < 1e-9 && contact.blocker == Blocker::KeepIn, "{contact:?}");
    // Past a ball, with its centre 0.35 m off the way: radii and margin are 0.1 + 0.2 + margin.
    let world = EllipsoidWorld::new(&World { obstacles: vec![ball(1.0, 0.35, 0.0, 0.2)], ..World::default() }).unwrap();
    let passing = straight(Vector3::zeros(), Vector3::x() * 0.1, 20.0);
    assert_eq!(world.first_contact(&body, &passing, 0.0, 0.05 - 1e-9).unwrap(), None);
    let contact = world.first_contact(&body, &passing, 0.0, 0.06).unwrap().unwrap();
    let expected_s = (1.0 - (0.36_f64 * 0.36 - 0.35 * 0.35).sqrt()) / 0.1;
    assert!((contact.time_s - expected_s).abs() < 1e-9, "{contact:?} {expected_s}");
    // A tangent is met where it touches, up to the root of the rounding.
    let contact = world.first_contact(&body, &passing, 0.0, 0.05 + 1e-12).unwrap().unwrap();
    assert!((contact.time_s - 10.0).abs() < 1e-4, "{contact:?}");
    // The first of several counts, whatever their order.
    let obstacles = vec![ball(1.5, 0.0, 0.0, 0.2), ball(0.8, 0.0, 0.0, 0.2), ball(1.1, 0.0, 0.0, 0.2)];
    let world = EllipsoidWorld::new(&World { obstacles, ..World::default() }).unwrap();
    let contact = world.first_contact(&body, &passing, 0.0, 0.0).unwrap().unwrap();
    assert!((contact.time_s - 5.0).abs() < 1e-9 && contact.blocker == Blocker::Obstacle(1), "{contact:?}");
}

#[test]
fn what_moves_and_what_appears_is_met_at_its_mission_time() {
    let body = BodyShape::sphere(0.1).unwrap();
    let waiting = straight(Vector3::zeros(), Vector3::zeros(), 10.0);
    let world = |obstacle| EllipsoidWorld::new(&World::default()).unwrap().with_obstacle(obstacle).unwrap();
    let drifting = MovingObstacle::at_rest(ball(3.0, 0.0, 0.0, 0.2)).drifting(Vector3::x() * -0.1, 100.0);
    let contact_s = |world: &EllipsoidWorld, start_s| {
        world.first_contact(&body, &waiting, start_s, 0.0).unwrap().map(|contact| contact.time_s)
    };
    // At 127 s it is 0.3 m away.
    let moving = world(drifting);
    assert_eq!(contact_s(&moving, 100.0), None);
    assert_eq!(contact_s(&moving, 116.0), None);
    assert!((contact_s(&moving, 120.0).unwrap() - 7.0).abs() < 1e-9);
    assert_eq!(contact_s(&moving, 128.0), Some(0.0));
    assert_eq!(contact_s(&moving, 134.0), None);
    let clearance = moving.clearance(&body, &Pose::identity(), 110.0).unwrap();
    assert!((clearance.distance_m - 1.7).abs() < 1e-14);
    // Only there while it is there.
    assert_eq!(contact_s(&world(drifting.present(0.0, 126.0)), 120.0), None);
    assert!((contact_s(&world(drifting.present(128.0, 129.0)), 120.0).unwrap() - 8.0).abs() < 1e-12);
    assert_eq!(contact_s(&world(drifting.present(131.0, 132.0)), 120.0), None);
    let brief = world(MovingObstacle::at_rest(ball(0.2, 0.0, 0.0, 0.2)).present(50.0, 50.0));
    assert!((contact_s(&brief, 45.0).unwrap() - 5.0).abs() < 1e-12);
    assert_eq!(contact_s(&brief, 51.0), None);
    assert!(brief.clearance(&body, &Pose::identity(), 50.0).unwrap().distance_m < 0.0);
    assert!(brief.clearance(&body, &Pose::identity(), 50.1).unwrap().distance_m.is_infinite());
    // What is known of the future.
    assert!(!brief.is_still_from(50.0) && brief.is_still_from(50.1) && !moving.is_still_from(1e9));
    let late = world(MovingObstacle::at_rest(ball(0.2, 0.0, 0.0, 0.2)).present(7.0, f64::INFINITY));
    assert!(late.is_still_from(7.0) && !late.is_still_from(6.9));
    let lasting =
        |world: &EllipsoidWorld, from_s| world.lasting_clearance(&body, &Pose::identity(), from_s).unwrap().distance_m;
    assert!(lasting(&late, 6.9).is_infinite() && lasting(&late, 7.0) < 0.0 && lasting(&moving, 0.0).is_infinite());
}

/// The same case seen in other axes, in other units of length, or at another mission time.
fn carried(case: &Case, by: &Pose<f64>, scale: f64, later_s: f64) -> Case {
    let mut carried = Case { parts: case.parts.clone(), obstacles: case.obstacles.clone(), ..*case };
    let point = |p: Vector3<f64>| (by.rotation * p + by.translation.vector) * scale;
    for (power, coefficient) in carried.arc.position.iter_mut().enumerate() {
        *coefficient = if power == 0 { point(*coefficient) } else { by.rotation * *coefficient * scale };
    }
    carried.arc.attitude = by.rotation * case.arc.attitude;
    for part in &mut carried.parts {
        part.semi_axes *= scale;
        part.body_from_part.translation.vector *= scale;
    }
    for obstacle in &mut carried.obstacles {
        match obstacle {
            Obstacle::Ellipsoid { ellipsoid, velocity, acceleration, .. } => {
                let pose = &mut ellipsoid.world_from_ellipsoid;
                pose.translation.vector = point(pose.translation.vector);
                pose.rotation = by.rotation * pose.rotation;
                ellipsoid.semi_axes *= scale;
                *velocity = by.rotation * *velocity * scale;
                *acceleration = by.rotation * *acceleration * scale;
            }
            Obstacle::Box(aligned) => {
                // Boxes stay along the axes: only moved and scaled.
                *aligned = AlignedBox::between(point(aligned.lower_world), point(aligned.upper_world));
            }
        }
    }
    carried.margin_m *= scale;
    carried.start_s += later_s;
    carried
}

#[test]
fn answers_do_not_depend_on_axes_units_or_the_clock() {
    let mut draws = Draws::new(11);
    let mut hits = 0;
    for index in 0..600 {
        let mut case = draws.case();
        let attitude = draws.attitude();
        let move_world = draws.vector(5.0);
        let first = case.first_contact();
        hits += usize::from(first.is_some());
        let agree = |other: Option<f64>, what: &str| match (first, other) {
            (None, None) => {}
            (Some(a), Some(b)) => assert!((a - b).abs() < 1e-8, "{index}, {what}: {a} {b}"),
            _ => panic!("{index}, {what}: {first:?} {other:?}"),
        };
        let shift = Pose::from_parts(move_world.into(), UnitQuaternion::identity());
        agree(carried(&case, &shift, 1.0, 0.0).first_contact(), "moved");
        for scale in [1e-3, 10.0, 1e6] {
            agree(carried(&case, &Pose::identity(), scale, 0.0).first_contact(), "scaled");
        }
        agree(carried(&case, &Pose::identity(), 1.0, 321.0).first_contact(), "later");
        case.obstacles.retain(|obstacle| matches!(obstacle, Obstacle::Ellipsoid { .. }));
        let first = case.first_contact();
        let turned = carried(&case, &Pose::from_parts(move_world.into(), attitude), 1.0, 0.0).first_contact();
        assert_eq!(first.is_some(), turned.is_some(), "{index}, turned");
        if let (Some(a), Some(b)) = (first, turned) {
            assert!((a - b).abs() < 1e-8, "{index}, turned: {a} {b}");
        }
    }
    assert!(hits > 100);
}

#[test]
fn the_fallback_for_other_worlds_agrees() {
    let mut draws = Draws::new(12);
    let mut hits = 0;
    for index in 0..300 {
        let mut case = draws.case();
        case.obstacles
            .retain(|it| !matches!(it, Obstacle::Ellipsoid { velocity, .. } if *velocity != Vector3::zeros()));
        let (world, body) = (case.world(), case.body());
        let fallback = conservative_first_contact(&world, &body, &case.arc, case.start_s, case.margin_m, 1e-9).unwrap();
        match (case.first_contact(), fallback) {
            (None, None) => {}
            // Early by what it takes to pass the tolerance.
            (Some(exact), Some(fallback)) => {
                hits += 1;
                assert!(
                    fallback.time_s <= exact + 1e-9 && fallback.time_s > exact - 1e-3,
                    "{index}: {exact} {fallback:?}"
                );
            }
            answers => panic!("{index}: {answers:?}"),
        }
    }
    assert!(hits > 50);
}

#[test]
fn impossible_worlds_and_questions_are_refused_by_index() {
    let refused = |world: World| EllipsoidWorld::new(&world).unwrap_err();
    let obstacles =
        |bad: ObstacleEllipsoid| World { obstacles: vec![ball(0.0, 0.0, 0.0, 1.0), bad], ..World::default() };
    for bad in [ball(0.0, 0.0, 0.0, 0.0), ball(0.0, 0.0, 0.0, f64::NAN), ball(f64::INFINITY, 0.0, 0.0, 1.0)] {
        let error = refused(obstacles(bad));
        assert!(matches!(error, PlanningError::InvalidWorld { part: "obstacle", index: 1, .. }), "{error}");
    }
    let upside_down = AlignedBox { lower_world: Vector3::x(), upper_world: Vector3::zeros() };
    let error = refused(World { keep_out: vec![room(), room(), upside_down], ..World::default() });
    assert_eq!(error.to_string(), "keep-out box 2: an edge's length is -1");
    let endless = AlignedBox { lower_world: Vector3::zeros(), upper_world: Vector3::repeat(f64::INFINITY) };
    let error = refused(World { keep_in: vec![room(), endless], ..World::default() });
    assert!(matches!(error, PlanningError::InvalidWorld { part: "keep-in box", index: 1, .. }), "{error}");
    let nothing = || EllipsoidWorld::new(&World::default()).unwrap();
    let still = MovingObstacle::at_rest(ball(0.0, 0.0, 0.0, 1.0));
    assert!(nothing().with_obstacle(still.present(2.0, 1.0)).is_err());
    assert!(nothing().with_obstacle(still.present(f64::NAN, 1.0)).is_err());
    assert!(nothing().with_obstacle(still.drifting(Vector3::repeat(f64::NAN), 0.0)).is_err());

    let (world, body) = (nothing(), BodyShape::sphere(0.1).unwrap());
    let arc = straight(Vector3::zeros(), Vector3::x(), 1.0);
    let first = |arc: &BodyArc, start_s, margin_m| world.first_contact(&body, arc, start_s, margin_m);
    assert!(first(&arc, f64::NAN, 0.0).is_err() && first(&arc, 0.0, f64::NAN).is_err());
    assert!(matches!(first(&arc, 0.0, -0.1), Err(PlanningError::Negative { what: "the margin", .. })));
    assert!(first(&BodyArc { duration_s: -1.0, ..arc }, 0.0, 0.0).is_err());
    assert!(first(&straight(Vector3::zeros(), Vector3::repeat(f64::NAN), 1.0), 0.0, 0.0).is_err());
    assert!(world.clearance(&body, &Pose::translation(f64::NAN, 0.0, 0.0), 0.0).is_err());
    assert!(world.clearance(&body, &Pose::identity(), f64::NAN).is_err());
}

/// A crowd of obstacles: most at rest, some moving, some there for a time, with boxes and walls.
fn crowd(draws: &mut Draws, count: usize) -> (World, Vec<MovingObstacle>) {
    let half = 3.0;
    let data = World {
        keep_in: vec![AlignedBox::between(Vector3::repeat(-half), Vector3::repeat(half))],
        keep_out: vec![AlignedBox::between(Vector3::repeat(2.0), Vector3::repeat(2.5))],
        obstacles: Vec::new(),
    };
    let obstacle = |index: usize| {
        let ellipsoid = ObstacleEllipsoid {
            world_from_ellipsoid: Pose::from_parts(draws.vector(half).into(), draws.attitude()),
            semi_axes: draws.semi_axes(0.3, 10.0),
        };
        let obstacle = MovingObstacle::at_rest(ellipsoid);
        match index % 10 {
            3 => obstacle.drifting(draws.vector(0.5), 1.0),
            7 => obstacle.present(draws.within(-2.0, 1.0), draws.within(1.0, 4.0)),
            _ => obstacle,
        }
    };
    (data, (0..count).map(obstacle).collect())
}

#[test]
fn many_obstacles_answer_as_each_alone() {
    for count in [5, 60, 500] {
        let mut draws = Draws::new(21);
        let (data, obstacles) = crowd(&mut draws, count);
        let boxes = EllipsoidWorld::new(&data).unwrap();
        let nothing = EllipsoidWorld::new(&World::default()).unwrap();
        let all = boxes.clone().with_obstacles(obstacles.iter().copied()).unwrap();
        assert_eq!(all.obstacle_count(), count);
        let alone: Vec<EllipsoidWorld> =
            obstacles.iter().map(|it| nothing.clone().with_obstacle(*it).unwrap()).collect();
        let mut hits = 0;
        for _ in 0..40 {
            let case = draws.case();
            let body = case.body();
            let pose = Pose::from_parts(draws.vector(3.0).into(), draws.attitude());
            let mut expected = boxes.clearance(&body, &pose, 1.5).unwrap();
            let mut expected_s = boxes.first_contact(&body, &case.arc, 0.0, 0.01).unwrap();
            for (index, world) in alone.iter().enumerate() {
                let clearance = world.clearance(&body, &pose, 1.5).unwrap();
                if clearance.distance_m < expected.distance_m {
                    expected.distance_m = clearance.distance_m;
                    expected.nearest = Some(Blocker::Obstacle(index));
                }
                if let Some(mut contact) = world.first_contact(&body, &case.arc, 0.0, 0.01).unwrap() {
                    contact.blocker = Blocker::Obstacle(index);
                    if expected_s.is_none_or(|it| (contact.time_s, contact.blocker) < (it.time_s, it.blocker)) {
                        expected_s = Some(contact);
                    }
                }
            }
            assert_eq!(all.clearance(&body, &pose, 1.5).unwrap(), expected);
            let found = all.first_contact(&body, &case.arc, 0.0, 0.01).unwrap();
            hits += usize::from(found.is_some());
            // The windows differ, and with them the last digits.
            match (found, expected_s) {
                (None, None) => {}
                (Some(a), Some(b)) => assert!((a.time_s - b.time_s).abs() < 1e-9, "{a:?} {b:?}"),
                answers => panic!("{answers:?}"),
            }
        }
        assert!(hits > 5, "{count}: {hits}");
    }
}

#[test]
fn batches_answer_as_single_queries() {
    let mut draws = Draws::new(22);
    for count in [0, 3, 10, 40, 100] {
        let (data, obstacles) = crowd(&mut draws, count);
        let world = EllipsoidWorld::new(&data).unwrap().with_obstacles(obstacles.iter().copied()).unwrap();
        let mut poses: Vec<Pose<f64>> =
            (0..300).map(|_| Pose::from_parts(draws.vector(3.1).into(), draws.attitude())).collect();
        // In the very middle of an obstacle as well.
        poses.extend(obstacles.iter().map(|it| it.ellipsoid.world_from_ellipsoid));
        let mut found = Vec::new();
        for body in [BodyShape::sphere(0.1).unwrap(), draws.case().body(), draws.case().body()] {
            for limit_m in [f64::INFINITY, 0.05, -0.05] {
                world.clearances(&body, &poses, 1.5, limit_m, &mut found).unwrap();
                assert_eq!(found.len(), poses.len());
                for (pose, found_m) in poses.iter().zip(&found) {
                    let alone_m = world.clearance(&body, pose, 1.5).unwrap().distance_m.min(limit_m);
                    let is_same =
                        (alone_m - found_m).abs() <= 1e-13 || (alone_m.is_infinite() && found_m.is_infinite());
                    assert!(is_same, "{alone_m} {found_m}");
                }
            }
        }
        assert!(world.clearances(&BodyShape::sphere(0.1).unwrap(), &poses, f64::NAN, 0.0, &mut found).is_err());
    }
}
