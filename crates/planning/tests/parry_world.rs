//! Worlds and bodies of parry's shapes: laws, closed forms, other algorithms, and a plan around a mesh.
#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic)]

use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::{Rng, SeedableRng};
use tumble_identification::noise;
use tumble_planning::collision::{
    Blocker, BodyShape, CollisionWorld, EllipsoidWorld, PARRY_TOLERANCE, ParryBody, ParryWorld,
};
use tumble_planning::dynamics::{AlignedBox, InertialParameters, ObstacleEllipsoid, World};
use tumble_planning::global::{
    FlightPlanner, GlobalPlanner, GlobalRequest, GoalRegion, MotionLimits, Objective, Until,
};
use tumble_planning::laws::{CollisionSample, check_collision_world};
use tumble_planning::lie::Pose;
use tumble_planning::nalgebra::{Matrix, Matrix3, Quaternion, UnitQuaternion, Vector3};
use tumble_planning::parry3d_f64::math::{Pose as ParryPose, Rotation, Vector};
use tumble_planning::parry3d_f64::query;
use tumble_planning::parry3d_f64::shape::{Cuboid, SharedShape};
use tumble_planning::{BodyArc, ModelBelief, PlanningError, TranslationState, Units};

struct Draws(ChaCha8Rng);

impl Draws {
    fn new(seed: u64) -> Self {
        Self(ChaCha8Rng::seed_from_u64(seed))
    }

    fn between(&mut self, lower: f64, upper: f64) -> f64 {
        noise::between(&mut self.0, lower, upper)
    }

    fn vector(&mut self, size: f64) -> Vector3<f64> {
        Vector3::from_fn(|_, _| self.between(-size, size))
    }

    fn parry_vector(&mut self, size: f64) -> Vector {
        let v = self.vector(size);
        Vector::new(v.x, v.y, v.z)
    }

    /// One in four with axes along the world's, where directions coincide.
    fn pose(&mut self, size: f64) -> Pose<f64> {
        let turn = Quaternion::new(self.between(-1.0, 1.0), self.between(-1.0, 1.0), self.between(-1.0, 1.0), 0.3);
        let is_aligned = self.between(0.0, 1.0) < 0.25;
        let rotation = if is_aligned { UnitQuaternion::identity() } else { UnitQuaternion::new_normalize(turn) };
        Pose::from_parts(self.vector(size).into(), rotation)
    }

    fn arc(&mut self, size: f64) -> BodyArc {
        let (from, to) = (self.vector(size), self.vector(size));
        let state = TranslationState { position: from, velocity: (to - from) / 10.0 };
        let mut angle = [0.0; 6];
        angle[1] = self.between(-0.3, 0.3);
        let axis = Vector3::x_axis();
        BodyArc::accelerated(10.0, &state, self.vector(0.02), self.pose(1.0).rotation).turning(axis, angle)
    }
}

fn hull() -> SharedShape {
    let mut draws = Draws::new(3);
    let points: Vec<Vector> = (0..24).map(|_| draws.parry_vector(0.4)).collect();
    SharedShape::convex_hull(&points).expect("a hull")
}

/// The surface of a box as twelve triangles.
fn box_mesh(half_extents: Vector) -> SharedShape {
    let (vertices, triangles) = Cuboid::new(half_extents).to_trimesh();
    SharedShape::trimesh(vertices, triangles).expect("a mesh")
}

fn shapes() -> Vec<(&'static str, SharedShape)> {
    let compound = vec![
        (ParryPose::from_translation(Vector::new(0.3, 0.0, 0.0)), SharedShape::ball(0.1)),
        (ParryPose::from_translation(Vector::new(-0.2, 0.1, 0.0)), SharedShape::cuboid(0.1, 0.2, 0.05)),
    ];
    vec![
        ("ball", SharedShape::ball(0.3)),
        ("cuboid", SharedShape::cuboid(0.2, 0.3, 0.1)),
        ("capsule", SharedShape::capsule_x(0.3, 0.1)),
        ("hull", hull()),
        ("mesh", box_mesh(Vector::new(0.3, 0.2, 0.25))),
        ("compound", SharedShape::compound(compound)),
        ("round cuboid", SharedShape::round_cuboid(0.2, 0.1, 0.1, 0.05)),
        ("cylinder", SharedShape::cylinder(0.2, 0.15)),
        ("cone", SharedShape::cone(0.2, 0.15)),
    ]
}

fn alone(shape: &SharedShape) -> ParryBody {
    ParryBody::try_new(&[(Pose::identity(), shape.clone())]).expect("a body")
}

fn parry_pose(pose: &Pose<f64>) -> ParryPose {
    let (t, q) = (pose.translation.vector, pose.rotation.coords);
    ParryPose::from_parts(Vector::new(t.x, t.y, t.z), Rotation::from_xyzw(q.x, q.y, q.z, q.w))
}

#[test]
fn every_kind_of_body_keeps_the_laws_among_every_kind_of_obstacle() {
    let mut draws = Draws::new(1);
    let mut placed: Vec<_> = shapes().into_iter().map(|(_, shape)| (draws.pose(1.2), shape)).collect();
    let floor = Pose::from_parts(Vector3::new(0.0, 0.0, -1.5).into(), UnitQuaternion::identity());
    placed.push((floor, SharedShape::halfspace(Vector::Z)));
    let world = ParryWorld::new(&placed).unwrap();
    for (name, shape) in shapes() {
        let samples: Vec<CollisionSample> =
            (0..12).map(|_| CollisionSample { arc: draws.arc(1.8), start_s: 0.0, margin_m: 0.01 }).collect();
        let offset = Pose::from_parts(Vector3::new(0.1, 0.0, 0.05).into(), UnitQuaternion::identity());
        let body = ParryBody::try_new(&[(offset, shape)]).unwrap();
        check_collision_world(&world, &body, &samples, 3.0 * PARRY_TOLERANCE)
            .unwrap_or_else(|broken| panic!("{name}: {broken:?}"));
    }
}

#[test]
fn balls_among_balls_and_boxes_agree_with_the_world_of_ellipsoids() {
    let mut draws = Draws::new(2);
    let mut contacts = 0;
    for _ in 0..60 {
        let (mut world, mut placed) = (World::default(), Vec::new());
        for _ in 0..4 {
            let (center, radius_m) = (draws.vector(2.0), draws.between(0.1, 0.6));
            let at = Pose::from_parts(center.into(), UnitQuaternion::identity());
            world.obstacles.push(ObstacleEllipsoid { world_from_ellipsoid: at, semi_axes: Vector3::repeat(radius_m) });
            placed.push((at, SharedShape::ball(radius_m)));
        }
        for _ in 0..4 {
            let (center, half) = (draws.vector(2.0), draws.vector(0.5).abs() + Vector3::repeat(0.05));
            world.keep_out.push(AlignedBox { lower_world: center - half, upper_world: center + half });
            let at = Pose::from_parts(center.into(), UnitQuaternion::identity());
            placed.push((at, SharedShape::cuboid(half.x, half.y, half.z)));
        }
        let (ours, theirs) = (EllipsoidWorld::new(&world).unwrap(), ParryWorld::new(&placed).unwrap());
        let (body, ball) = (BodyShape::sphere(0.2).unwrap(), alone(&SharedShape::ball(0.2)));
        for _ in 0..50 {
            let pose = draws.pose(2.5);
            let expected = ours.clearance(&body, &pose, 0.0).unwrap();
            let found = theirs.clearance(&ball, &pose, 0.0).unwrap();
            let short_m = expected.distance_m - found.distance_m;
            assert!((-1e-12..=1e-8).contains(&short_m), "{pose} {expected:?} {found:?}");
            let same = match expected.nearest {
                Some(Blocker::KeepOut(index)) => Some(Blocker::Obstacle(4 + index)),
                other => other,
            };
            assert_eq!(found.nearest, same);
            let lasting_m = theirs.lasting_clearance(&ball, &pose, 0.0).unwrap().distance_m;
            assert!((-1e-8..=1e-12).contains(&(expected.distance_m - lasting_m)));
        }
        for _ in 0..10 {
            let arc = draws.arc(2.5);
            let expected = ours.first_contact(&body, &arc, 0.0, 0.02).unwrap();
            let found = theirs.first_contact(&ball, &arc, 0.0, 0.02).unwrap();
            // Never later, and there no farther than the tolerance.
            let latest_s = expected.map_or(f64::INFINITY, |contact| contact.time_s);
            assert!(found.map_or(f64::INFINITY, |contact| contact.time_s) <= latest_s + 1e-9);
            if let Some(contact) = found {
                contacts += 1;
                let there_m = ours.clearance(&body, &arc.pose(contact.time_s), 0.0).unwrap().distance_m;
                assert!(there_m <= 0.02 + 2.0 * PARRY_TOLERANCE);
            }
        }
    }
    assert!((100..=500).contains(&contacts), "{contacts}");
}

/// The signed distance of overlapping boxes by their fifteen axes; none where they are apart.
fn depth_of_boxes(a: &Pose<f64>, half_a: &Vector3<f64>, b: &Pose<f64>, half_b: &Vector3<f64>) -> Option<f64> {
    let (ra, rb) = (a.rotation.to_rotation_matrix().into_inner(), b.rotation.to_rotation_matrix().into_inner());
    let mut axes: Vec<Vector3<f64>> = ra.column_iter().chain(rb.column_iter()).map(Matrix::into_owned).collect();
    for i in 0..3 {
        for j in 0..3 {
            axes.push(ra.column(i).cross(&rb.column(j)));
        }
    }
    let apart = b.translation.vector - a.translation.vector;
    let gap = |axis: &Vector3<f64>| {
        let reach = (ra.transpose() * axis).abs().dot(half_a) + (rb.transpose() * axis).abs().dot(half_b);
        axis.dot(&apart).abs() - reach
    };
    let units = axes.iter().filter(|axis| axis.norm() > 1e-6).map(Vector3::normalize);
    let most_m = units.map(|axis| gap(&axis)).fold(f64::NEG_INFINITY, f64::max);
    (most_m <= 0.0).then_some(most_m)
}

/// Distance of two boxes by going to and fro between the nearest points of one and the other.
fn distance_of_boxes(a: &Pose<f64>, half_a: &Vector3<f64>, b: &Pose<f64>, half_b: &Vector3<f64>) -> f64 {
    let nearest = |pose: &Pose<f64>, half: &Vector3<f64>, point: &Vector3<f64>| {
        let local = pose.inverse_transform_point(&(*point).into()).coords;
        pose.transform_point(&local.sup(&-half).inf(half).into()).coords
    };
    let mut on_b = b.translation.vector;
    let mut distance_m = f64::INFINITY;
    for _ in 0..20_000 {
        let on_a = nearest(a, half_a, &on_b);
        on_b = nearest(b, half_b, &on_a);
        distance_m = (on_b - on_a).norm();
    }
    distance_m
}

#[test]
fn turned_boxes_agree_with_other_algorithms_apart_and_overlapping() {
    let mut draws = Draws::new(5);
    let (mut apart, mut overlapping) = (0, 0);
    for case in 0..3000 {
        let sides = |draws: &mut Draws| draws.vector(0.8).abs() + Vector3::repeat(0.05);
        let (half_a, half_b) = (sides(&mut draws), sides(&mut draws));
        let (a, b) = (draws.pose(0.8), draws.pose(0.8));
        let world = ParryWorld::new(&[(a, SharedShape::cuboid(half_a.x, half_a.y, half_a.z))]).unwrap();
        let body = alone(&SharedShape::cuboid(half_b.x, half_b.y, half_b.z));
        let found_m = world.clearance(&body, &b, 0.0).unwrap().distance_m;
        if let Some(depth_m) = depth_of_boxes(&a, &half_a, &b, &half_b) {
            overlapping += 1;
            assert!((found_m - depth_m).abs() < 1e-9, "case {case}: {found_m} for {depth_m}");
        } else if apart < 100 {
            apart += 1;
            let distance_m = distance_of_boxes(&a, &half_a, &b, &half_b);
            assert!(found_m <= distance_m + 1e-12, "case {case}: {found_m} for {distance_m}");
            assert!(found_m > distance_m - 1e-6, "case {case}: {found_m} for {distance_m}");
        }
    }
    assert!(apart == 100 && overlapping > 500, "{apart} {overlapping}");
}

#[test]
fn no_clearance_is_more_than_the_distance_of_two_points() {
    let mut draws = Draws::new(7);
    let convex = |shape: &SharedShape| shape.as_support_map().is_some();
    let shapes: Vec<_> = shapes().into_iter().filter(|(_, shape)| convex(shape)).collect();
    let mut near = 0;
    for (name, obstacle) in &shapes {
        for (other, shape) in &shapes {
            for _ in 0..60 {
                let (a, b) = (draws.pose(0.5), draws.pose(0.9));
                let world = ParryWorld::new(&[(a, obstacle.clone())]).unwrap();
                let found_m = world.clearance(&alone(shape), &b, 0.0).unwrap().distance_m;
                let (a, b) = (parry_pose(&a), parry_pose(&b));
                let theirs_m = query::distance(&a, &**obstacle, &b, &**shape).unwrap().distance;
                // Theirs is that of two points, if not always the nearest ones; ours of two planes.
                assert!(found_m <= theirs_m + 1e-12, "{name} {other}: {found_m} above {theirs_m}");
                assert!(found_m >= theirs_m - 2e-5 || theirs_m <= 0.0, "{name} {other}: {found_m} below {theirs_m}");
                let point = |shape: &SharedShape, pose: &ParryPose, draws: &mut Draws| {
                    let direction = draws.parry_vector(1.0).normalize();
                    shape.as_support_map().map(|convex| convex.support_point(pose, direction)).unwrap()
                };
                for _ in 0..50 {
                    let apart = point(obstacle, &a, &mut draws) - point(shape, &b, &mut draws);
                    assert!(found_m <= apart.length() + 1e-12);
                    near += usize::from(apart.length() < found_m + 0.05);
                }
            }
        }
    }
    assert!(near > 1000, "{near}");
}

#[test]
fn a_mesh_is_a_surface_and_a_hull_a_solid() {
    let half_extents = Vector::new(1.0, 0.8, 0.6);
    let shell = ParryWorld::new(&[(Pose::identity(), box_mesh(half_extents))]).unwrap();
    let solid = ParryWorld::new(&[(Pose::identity(), SharedShape::cuboid(1.0, 0.8, 0.6))]).unwrap();
    let ball = alone(&SharedShape::ball(0.1));
    let at = |x: f64| Pose::from_parts(Vector3::new(x, 0.1, 0.05).into(), UnitQuaternion::identity());
    let clearance_m = |world: &ParryWorld, x: f64| world.clearance(&ball, &at(x), 0.0).unwrap().distance_m;
    for x in [1.05, 1.1, 1.4, -3.0] {
        assert!((clearance_m(&shell, x) - (f64::abs(x) - 1.1)).abs() < 1e-9);
        assert!((clearance_m(&solid, x) - (f64::abs(x) - 1.1)).abs() < 1e-9);
    }
    // Inside, 0.3 m from the nearest wall, at 1.
    assert!((clearance_m(&shell, 0.7) - 0.2).abs() < 1e-9);
    assert!((clearance_m(&solid, 0.7) + 0.4).abs() < 1e-9);
    // A way through the wall is none.
    let state = TranslationState { position: Vector3::zeros(), velocity: Vector3::new(0.2, 0.0, 0.0) };
    let out = BodyArc::accelerated(10.0, &state, Vector3::zeros(), UnitQuaternion::identity());
    let contact = shell.first_contact(&ball, &out, 0.0, 0.0).unwrap().unwrap();
    assert!((contact.time_s - 4.5).abs() < 1e-4 && contact.time_s <= 4.5, "{}", contact.time_s);
}

#[test]
fn layers_and_cylinders_have_their_closed_forms() {
    let world = ParryWorld::new(&[(Pose::identity(), SharedShape::cylinder(1.0, 0.5))]).unwrap();
    let body = alone(&SharedShape::capsule_y(0.2, 0.1));
    // Beside, above, off the rim, and within the wall.
    let rim_m = f64::hypot(0.3, 0.4) - 0.1;
    for (x, y, z, expected_m) in
        [(0.6, 0.3, 0.8, 0.4), (0.1, 1.5, 0.2, 0.2), (0.48, 1.6, 0.64, rim_m), (0.0, 0.1, 0.45, -0.15)]
    {
        let pose = Pose::from_parts(Vector3::new(x, y, z).into(), UnitQuaternion::identity());
        let lower_m = world.clearance(&body, &pose, 0.0).unwrap().distance_m;
        let upper_m = world.lasting_clearance(&body, &pose, 0.0).unwrap().distance_m;
        assert!(lower_m > expected_m - PARRY_TOLERANCE && lower_m <= expected_m + 1e-12, "{lower_m} {expected_m}");
        assert!(upper_m < expected_m + PARRY_TOLERANCE && upper_m >= expected_m - 1e-12, "{upper_m} {expected_m}");
    }
    let (ball, mut draws) = (alone(&SharedShape::ball(0.1)), Draws::new(8));
    for _ in 0..2000 {
        let pose = draws.pose(2.0);
        let at = pose.translation.vector;
        let (beside, above) = (f64::hypot(at.x, at.z) - 0.5, at.y.abs() - 1.0);
        let expected_m = f64::hypot(beside.max(0.0), above.max(0.0)) + beside.max(above).min(0.0) - 0.1;
        let lower_m = world.clearance(&ball, &pose, 0.0).unwrap().distance_m;
        let upper_m = world.lasting_clearance(&ball, &pose, 0.0).unwrap().distance_m;
        assert!(lower_m <= expected_m + 1e-13 && expected_m <= upper_m + 1e-13, "{lower_m} {expected_m} {upper_m}");
        assert!(upper_m - lower_m <= 2.0 * PARRY_TOLERANCE);
    }
    assert!((world.reach_m(&body) - 0.3).abs() < 1e-12);
    assert!(!world.is_round(&body) && world.is_round(&alone(&SharedShape::ball(0.1))));
}

#[test]
fn what_cannot_be_answered_is_an_error() {
    let floor = (Pose::identity(), SharedShape::halfspace(Vector::Z));
    let unsupported =
        |result: Result<ParryBody, PlanningError>| matches!(result.map(|_| ()), Err(PlanningError::Unsupported { .. }));
    assert!(unsupported(ParryBody::try_new(std::slice::from_ref(&floor))));
    assert_eq!(ParryBody::try_new(&[]).map(|_| ()), Err(PlanningError::NoBody));
    for shape in [
        SharedShape::ball(f64::NAN),
        SharedShape::ball(-1.0),
        SharedShape::cuboid(f64::INFINITY, 1.0, 1.0),
        SharedShape::triangle(Vector::X, Vector::NAN, Vector::Y),
    ] {
        let result = ParryWorld::new(&[floor.clone(), (Pose::identity(), shape.clone())]).map(|_| ());
        assert!(
            matches!(result, Err(PlanningError::InvalidWorld { index: 1, .. })),
            "{:?} {result:?}",
            shape.as_typed_shape()
        );
    }
    let world = ParryWorld::new(&[floor]).unwrap();
    let ball = alone(&SharedShape::ball(0.1));
    for z in [f64::NAN, f64::INFINITY, 1e200] {
        let pose = Pose::from_parts(Vector3::new(0.0, 0.0, z).into(), UnitQuaternion::identity());
        assert!(world.clearance(&ball, &pose, 0.0).is_err());
    }
    let arc = Draws::new(1).arc(1.0);
    assert!(world.first_contact(&ball, &arc, 0.0, -0.1).is_err());
}

#[test]
fn curved_shapes_are_answered_within_the_tolerance() {
    let mut draws = Draws::new(11);
    let (mut overlapping, mut wide) = (0, 0);
    for case in 0..20_000 {
        let mut shape = || {
            let (half, radius) = (draws.between(0.05, 1.0), draws.between(0.05, 1.0));
            match draws.0.next_u64() % 4 {
                0 => SharedShape::cone(half, radius),
                1 => SharedShape::cylinder(half, radius),
                2 => SharedShape::round_cylinder(half, radius, 0.05),
                _ => SharedShape::cuboid(half, radius, radius),
            }
        };
        let (obstacle, body) = (shape(), alone(&shape()));
        let world = ParryWorld::new(&[(draws.pose(0.5), obstacle)]).unwrap();
        let pose = draws.pose(if case % 2 == 0 { 0.5 } else { 3.0 });
        let lower_m = world.clearance(&body, &pose, 0.0).unwrap().distance_m;
        let upper_m = world.lasting_clearance(&body, &pose, 0.0).unwrap().distance_m;
        assert!(upper_m >= lower_m, "case {case}: {lower_m} {upper_m}");
        let is_wide = upper_m - lower_m > PARRY_TOLERANCE * upper_m.abs().max(1.0);
        assert!(!is_wide || upper_m <= 0.0, "case {case}: {lower_m} {upper_m}");
        overlapping += usize::from(upper_m <= 0.0);
        wide += usize::from(is_wide);
    }
    assert!(overlapping > 5000 && wide <= 4, "{overlapping} {wide}");
}

/// A wall of two meshes with a slit between them, and a hull behind it.
#[test]
fn the_planner_flies_around_meshes_and_a_hull() {
    let wall = |x: f64| {
        let at = Pose::from_parts(Vector3::new(x, 0.0, 0.0).into(), UnitQuaternion::identity());
        (at, box_mesh(Vector::new(0.7, 0.1, 3.0)))
    };
    let placed = [
        wall(-1.0),
        wall(1.0),
        (Pose::from_parts(Vector3::new(0.4, 1.0, 0.0).into(), UnitQuaternion::identity()), hull()),
    ];
    let world = ParryWorld::new(&placed).unwrap();
    let shape = SharedShape::capsule_y(0.2, 0.1);
    let (body, belief) = (
        alone(&shape),
        ModelBelief::certain(1, InertialParameters::about_com(10.0, Vector3::zeros(), Matrix3::identity() * 0.2)),
    );
    let request = GlobalRequest {
        world: &world,
        body: &body,
        start: TranslationState::at_rest(Vector3::new(-1.0, -1.0, 0.0)),
        attitude: UnitQuaternion::identity(),
        start_s: 0.0,
        goal: GoalRegion { position: Vector3::new(1.0, 1.5, 0.3), radius_m: 0.1, speed_m_s: 0.05, attitude: None },
        limits: MotionLimits {
            position: AlignedBox { lower_world: Vector3::repeat(-2.0), upper_world: Vector3::repeat(2.0) },
            speed_m_s: Vector3::repeat(0.2),
            force_n: Vector3::repeat(0.5),
            torque_n_m: Vector3::repeat(0.02),
            rate_rad_s: 0.2,
        },
        belief: &belief,
        objective: Objective::Duration,
        margin_m: 0.02,
        until: Until::FirstPlan,
        seed: 4,
    };
    let answer = FlightPlanner::default().plan(&request, &mut Units::new(200_000)).unwrap();
    let path = &answer.plan.expect("a plan").trajectory;
    let again = FlightPlanner::default().plan(&request, &mut Units::new(200_000)).unwrap();
    assert_eq!(again.plan.map(|plan| plan.trajectory).as_ref(), Some(path));
    let mut least_m = f64::INFINITY;
    for arc in path.arcs() {
        for step in 0..=2000 {
            let pose = parry_pose(&arc.pose(arc.duration_s * f64::from(step) / 2000.0));
            for (at, obstacle) in &placed {
                least_m = least_m.min(query::distance(&parry_pose(at), &**obstacle, &pose, &*shape).unwrap().distance);
            }
        }
    }
    assert!(least_m >= 0.02 - 1e-9, "{least_m}");
    let end = path.arcs().last().map(|arc| arc.pose(arc.duration_s).translation.vector).unwrap();
    assert!((end - request.goal.position).norm() <= 0.1 + 1e-9 && end.y > 1.0);
}
