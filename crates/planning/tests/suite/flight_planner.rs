//! The planner: plans that hold by checks that share nothing with it, bounds, proofs, replanning, turning through a gap.
#![allow(clippy::expect_used)]

use nalgebra::{Matrix3, UnitQuaternion, Vector3};
use tumble_planning::collision::{Blocker, BodyEllipsoid, BodyShape, CollisionWorld, EllipsoidWorld, MovingObstacle};
use tumble_planning::dynamics::{AlignedBox, InertialParameters, ObstacleEllipsoid, World};
use tumble_planning::global::{
    FlightPlanner, FlightPlannerSettings, GlobalAnswer, GlobalPlanner, GlobalRequest, GoalRegion, MotionLimits,
    Objective, Obstruction, Replanning, Status, UnderWay, Until,
};
use tumble_planning::laws::{Expectation, PlannerCase, PlannerChecks, check_global_planner};
use tumble_planning::lie::Pose;
use tumble_planning::{ArcPath, ModelBelief, TranslationState, Units};

const MASS_KG: f64 = 9.58;

fn obstacle(center: [f64; 3], semi_axes: [f64; 3]) -> ObstacleEllipsoid {
    ObstacleEllipsoid {
        world_from_ellipsoid: Pose::from_parts(Vector3::from(center).into(), UnitQuaternion::identity()),
        semi_axes: semi_axes.into(),
    }
}

fn world(obstacles: Vec<ObstacleEllipsoid>) -> EllipsoidWorld {
    EllipsoidWorld::new(&World { obstacles, ..World::default() }).expect("a world")
}

/// Two walls with openings on opposite sides.
fn slalom() -> Vec<ObstacleEllipsoid> {
    vec![obstacle([10.3, -8.5, 4.9], [0.5, 0.05, 2.0]), obstacle([11.2, -9.0, 4.9], [0.5, 0.05, 2.0])]
}

fn belief() -> ModelBelief {
    ModelBelief::certain(3, InertialParameters::about_com(MASS_KG, Vector3::zeros(), Matrix3::identity() * 0.15))
}

fn request<'a>(
    world: &'a EllipsoidWorld,
    body: &'a BodyShape,
    belief: &'a ModelBelief,
) -> GlobalRequest<'a, EllipsoidWorld> {
    GlobalRequest {
        world,
        body,
        start: TranslationState::at_rest(Vector3::new(10.8, -9.6, 4.8)),
        attitude: UnitQuaternion::identity(),
        start_s: 0.0,
        goal: GoalRegion { position: Vector3::new(10.8, -7.75, 5.2), radius_m: 0.2, speed_m_s: 0.05, attitude: None },
        limits: MotionLimits {
            position: AlignedBox {
                lower_world: Vector3::new(10.3, -9.8, 4.2),
                upper_world: Vector3::new(11.2, -7.5, 5.3),
            },
            speed_m_s: Vector3::repeat(0.05),
            force_n: Vector3::repeat(0.1),
            torque_n_m: Vector3::repeat(0.01),
            rate_rad_s: 0.1,
        },
        belief,
        objective: Objective::Duration,
        margin_m: 0.0,
        until: Until::BudgetSpent,
        seed: 1,
    }
}

/// Distance of a point from an ellipsoid with axes along the world's, by bisection on the multiplier; zero inside.
fn distance_to_ellipsoid(point: &Vector3<f64>, ellipsoid: &ObstacleEllipsoid) -> f64 {
    let local = (ellipsoid.world_from_ellipsoid.inverse() * nalgebra::Point3::from(*point)).coords.abs();
    let squares = ellipsoid.semi_axes.component_mul(&ellipsoid.semi_axes);
    let foot = |t: f64| local.zip_map(&squares, |x, square| x * square / (t + square));
    let outside = |t: f64| foot(t).component_div(&ellipsoid.semi_axes).norm_squared() > 1.0;
    if !outside(0.0) {
        return 0.0;
    }
    let (mut low, mut high) = (0.0, 1e3);
    for _ in 0..200 {
        let middle = 0.5 * (low + high);
        if outside(middle) { low = middle } else { high = middle }
    }
    (local - foot(high)).norm()
}

/// Sampled densely: continuous, within the limits, from the start into the goal region. Returns the least distance to the
/// obstacles of a ball about the origin.
fn check_path(
    path: &ArcPath,
    request: &GlobalRequest<'_, EllipsoidWorld>,
    obstacles: &[ObstacleEllipsoid],
    radius_m: f64,
) -> f64 {
    let mut state = request.start;
    let mut attitude = request.attitude;
    let mut nearest = f64::INFINITY;
    let limits = &request.limits;
    let acceleration = limits.force_n / MASS_KG;
    for arc in path.arcs() {
        let (begin, _) = arc.translation(0.0);
        assert!((begin.position - state.position).norm() < 1e-9, "a jump in position");
        assert!((begin.velocity - state.velocity).norm() < 1e-9, "a jump in velocity");
        assert!(arc.attitude.angle_to(&attitude) < 1e-7, "a jump in attitude");
        for step in 0..=50 {
            let time_s = arc.duration_s * f64::from(step) / 50.0;
            let (at, pushed) = arc.translation(time_s);
            for axis in 0..3 {
                let inside = limits.position.lower_world[axis] - 1e-9..=limits.position.upper_world[axis] + 1e-9;
                assert!(inside.contains(&at.position[axis]), "outside the box: {at:?}");
                assert!(at.velocity[axis].abs() <= limits.speed_m_s[axis] * (1.0 + 1e-9), "too fast: {at:?}");
                assert!(pushed[axis].abs() <= acceleration[axis] * (1.0 + 1e-9), "too hard: {pushed:?}");
            }
            for obstacle in obstacles {
                nearest = nearest.min(distance_to_ellipsoid(&at.position, obstacle) - radius_m);
            }
        }
        state = arc.translation(arc.duration_s).0;
        attitude = arc.attitude_at(arc.duration_s);
    }
    let goal = &request.goal;
    assert!((state.position - goal.position).norm() <= goal.radius_m + 1e-9, "not arrived: {state:?}");
    assert!(state.velocity.norm() <= goal.speed_m_s + 1e-9, "arrived too fast: {state:?}");
    nearest
}

fn path(answer: &GlobalAnswer) -> &ArcPath {
    &answer.plan.as_ref().expect("a plan").trajectory
}

#[test]
fn every_seed_solves_the_slalom_and_the_plan_holds() {
    let (walls, body, belief) = (slalom(), BodyShape::sphere(0.15).expect("a body"), belief());
    let world = world(walls.clone());
    let mut planner = FlightPlanner::default();
    for seed in 0..20 {
        let request = GlobalRequest { seed, ..request(&world, &body, &belief) };
        let answer = planner.plan(&request, &mut Units::new(1500)).expect("an answer");
        let nearest_m = check_path(path(&answer), &request, &walls, 0.15);
        assert!(nearest_m >= -1e-9, "seed {seed}: {nearest_m}");
        assert_eq!(answer.plan.as_ref().map(|plan| plan.model_revision), Some(3));
        assert!((path(&answer).duration_s() - answer.cost).abs() < 1e-9);
        assert!(answer.lower_bound <= answer.cost * (1.0 + 1e-9), "seed {seed}");
        assert!(answer.history.windows(2).all(|pair| pair[1].cost < pair[0].cost), "seed {seed}");
        assert!(answer.cost < 45.0, "seed {seed}: {}", answer.cost);
    }
}

#[test]
fn the_same_seed_gives_the_same_answer_whatever_was_planned_before() {
    let (world, body, belief) = (world(slalom()), BodyShape::sphere(0.15).expect("a body"), belief());
    let request = request(&world, &body, &belief);
    let mut planner = FlightPlanner::default();
    let once = planner.plan(&request, &mut Units::new(1200)).expect("an answer");
    planner.plan(&GlobalRequest { seed: 9, ..request }, &mut Units::new(700)).expect("an answer");
    assert_eq!(planner.plan(&request, &mut Units::new(1200)).expect("an answer"), once);
}

#[test]
fn an_empty_world_is_solved_to_the_bound() {
    let (world, body, belief) = (world(Vec::new()), BodyShape::sphere(0.15).expect("a body"), belief());
    let request = request(&world, &body, &belief);
    let answer = FlightPlanner::default().plan(&request, &mut Units::new(20_000)).expect("an answer");
    assert_eq!(answer.status, Status::Optimal);
    assert!(answer.cost <= answer.lower_bound * (1.0 + 1e-6));
    check_path(path(&answer), &request, &[], 0.15);
}

#[test]
fn what_cannot_be_is_recognised_with_what_blocks() {
    let (body, belief) = (BodyShape::sphere(0.15).expect("a body"), belief());
    let closed = world(vec![obstacle([10.75, -8.5, 4.75], [3.0, 0.1, 3.0])]);
    let answer = FlightPlanner::default().plan(&request(&closed, &body, &belief), &mut Units::new(300_000));
    match answer.expect("an answer").status {
        Status::Infeasible(Obstruction::Enclosed { blockers }) => assert_eq!(blockers, [Blocker::Obstacle(0)]),
        other => panic!("{other:?}"),
    }
    // With too little work for the proof: what stood in the way.
    let answer =
        FlightPlanner::default().plan(&request(&closed, &body, &belief), &mut Units::new(50)).expect("an answer");
    assert_eq!(answer.status, Status::BudgetSpent(vec![Blocker::Obstacle(0)]));
    assert!(answer.plan.is_none() && answer.cost.is_infinite());
    let inside = world(vec![obstacle([10.8, -9.6, 4.9], [0.2; 3])]);
    let answer =
        FlightPlanner::default().plan(&request(&inside, &body, &belief), &mut Units::new(50)).expect("an answer");
    assert!(matches!(answer.status, Status::Infeasible(Obstruction::StartBlocked { .. })), "{:?}", answer.status);
}

#[test]
fn a_table_has_no_height_and_a_blocked_centre_is_no_blocked_region() {
    let (body, belief) = (BodyShape::sphere(0.15).expect("a body"), belief());
    let obstacles = vec![obstacle([0.3, 0.3, 0.0], [0.15, 0.15, 5.0]), obstacle([-0.25, -0.1, 0.0], [0.2, 0.2, 5.0])];
    let world = world(obstacles.clone());
    let mut request = request(&world, &body, &belief);
    request.start = TranslationState::at_rest(Vector3::new(0.0, 0.6, -0.76));
    request.goal.position = Vector3::new(-0.4, -0.4, -0.76);
    request.goal.radius_m = 0.167;
    request.limits.position =
        AlignedBox { lower_world: Vector3::new(-0.8, -0.8, -0.76), upper_world: Vector3::new(0.8, 0.8, -0.76) };
    let centre = Pose::from_parts(request.goal.position.into(), request.attitude);
    assert!(world.clearance(&body, &centre, 0.0).expect("a distance").distance_m < 0.0);
    let answer = FlightPlanner::default().plan(&request, &mut Units::new(2000)).expect("an answer");
    assert!(check_path(path(&answer), &request, &obstacles, 0.15) >= -1e-9);
    // It uses the speed that it may arrive with.
    assert!(answer.cost < 29.0, "{}", answer.cost);
}

#[test]
fn a_plan_under_way_is_kept_mended_or_too_late() {
    let (walls, body, belief) = (slalom(), BodyShape::sphere(0.15).expect("a body"), belief());
    let before = world(walls.clone());
    let first = request(&before, &body, &belief);
    let mut planner = FlightPlanner::default();
    let answer = planner.plan(&first, &mut Units::new(3000)).expect("an answer");
    let under_way = UnderWay { path: path(&answer), started_s: 100.0, now_s: 105.0, splice_s: 108.0 };
    let kept = planner.replan(&first, &under_way, &mut Units::new(0)).expect("an answer");
    assert_eq!(kept, Replanning::Keep);

    let at = |time_s: f64| {
        let (arc, within_s) = path(&answer).at(time_s).expect("an arc");
        arc.translation(within_s).0
    };
    let astronaut = obstacle((at(25.0).position + Vector3::new(0.1, 0.0, 0.0)).into(), [0.1, 0.1, 0.3]);
    let after = before.clone().with_obstacle(MovingObstacle::at_rest(astronaut)).expect("a world");
    let second = GlobalRequest { world: &after, ..request(&after, &body, &belief) };
    match planner.replan(&second, &under_way, &mut Units::new(3000)).expect("an answer") {
        Replanning::Replace { contact, kept, splice_s, answer: mended } => {
            assert_eq!(contact.blocker, Blocker::Obstacle(2));
            assert!((105.0 + contact.time_s) > 110.0 && (105.0 + contact.time_s) < 126.0, "{contact:?}");
            assert!((kept.duration_s() - 8.0).abs() < 1e-9 && (splice_s - 108.0).abs() < 1e-9);
            let whole = ArcPath::new(kept.arcs().iter().chain(path(&mended).arcs()).copied());
            let mut all = walls;
            all.push(astronaut);
            assert!(check_path(&whole, &first, &all, 0.15) >= -1e-9);
        }
        other => panic!("{other:?}"),
    }
    let late = UnderWay { splice_s: 127.0, ..under_way };
    let answer = planner.replan(&second, &late, &mut Units::new(3000)).expect("an answer");
    assert!(matches!(answer, Replanning::TooLate(contact) if contact.blocker == Blocker::Obstacle(2)));
}

#[test]
fn a_body_turns_through_a_gap_that_its_bounding_ball_does_not_fit() {
    let belief = belief();
    // Two pillars leave 0.4 m between them: more than the 0.3 m of the body's thin way, less than the 0.6 m of its long one.
    let pillars = vec![obstacle([10.35, -8.6, 4.75], [0.4, 0.1, 4.0]), obstacle([11.55, -8.6, 4.75], [0.4, 0.1, 4.0])];
    let world = world(pillars);
    let payload = BodyShape::try_new(vec![BodyEllipsoid {
        body_from_ellipsoid: Pose::identity(),
        semi_axes: Vector3::new(0.3, 0.15, 0.15),
    }])
    .expect("a body");
    let mut request = GlobalRequest { until: Until::FirstPlan, ..request(&world, &payload, &belief) };
    request.limits.position =
        AlignedBox { lower_world: Vector3::new(10.4, -9.8, 4.2), upper_world: Vector3::new(11.5, -7.2, 5.3) };
    request.goal.position = Vector3::new(10.95, -7.75, 4.8);
    let mut planner = FlightPlanner::default();
    for seed in 0..5 {
        let answer = planner.plan(&GlobalRequest { seed, ..request }, &mut Units::new(20_000)).expect("an answer");
        assert!(path(&answer).arcs().iter().any(|arc| !arc.is_level()), "seed {seed}");
        let mut time_s = 0.0;
        while time_s < path(&answer).duration_s() {
            let (arc, within_s) = path(&answer).at(time_s).expect("an arc");
            let clearance = world.clearance(&payload, &arc.pose(within_s), 0.0).expect("a distance");
            assert!(clearance.distance_m >= -1e-9, "seed {seed} at {time_s} s: {clearance:?}");
            time_s += 0.05;
        }
    }
    let ball = BodyShape::sphere(payload.bounding_radius_m()).expect("a body");
    let answer = planner.plan(&GlobalRequest { body: &ball, ..request }, &mut Units::new(300_000)).expect("an answer");
    assert!(matches!(answer.status, Status::Infeasible(Obstruction::Enclosed { .. })), "{:?}", answer.status);
}

/// At the limits of rate and torque this body's centre of mass would take more than the force there is to go round the origin:
/// it turns more slowly, and the force on the centre of mass stays within the limit all the way.
#[test]
fn a_body_off_its_centre_turns_as_slowly_as_it_must() {
    let offset = Vector3::new(0.036, -0.028, 0.008);
    let body = InertialParameters::about_com(12.7, offset, Matrix3::identity() * 0.2);
    let belief = ModelBelief::certain(1, body);
    let world = world(slalom());
    let ball = BodyShape::sphere(0.15).expect("a body");
    let mut request = GlobalRequest { until: Until::FirstPlan, ..request(&world, &ball, &belief) };
    let force_n = 0.0436;
    request.limits.force_n = Vector3::repeat(force_n);
    request.limits.torque_n_m = Vector3::repeat(0.0077);
    request.limits.rate_rad_s = 0.2;
    request.attitude = UnitQuaternion::from_axis_angle(&Vector3::z_axis(), -1.55);
    request.goal.attitude = Some(UnitQuaternion::identity());
    let mut planner = FlightPlanner::default();
    for seed in 0..5 {
        let answer = planner.plan(&GlobalRequest { seed, ..request }, &mut Units::new(20_000)).expect("an answer");
        let mut time_s = 0.0;
        let mut turned = false;
        while time_s < path(&answer).duration_s() {
            let (arc, within_s) = path(&answer).at(time_s).expect("an arc");
            let (_, acceleration) = arc.translation(within_s);
            let (_, rate, rate_change) = arc.turn(within_s);
            let axis = arc.axis_body.into_inner();
            let swing = axis.cross(&offset) * rate_change + axis.cross(&axis.cross(&offset)) * (rate * rate);
            let force = (acceleration + arc.attitude_at(within_s) * swing) * 12.7;
            assert!(force.abs().max() <= force_n * (1.0 + 1e-9), "seed {seed} at {time_s} s: {force}");
            turned |= rate.abs() > 0.01;
            time_s += 0.05;
        }
        assert!(turned, "seed {seed}");
    }
}

#[test]
fn least_impulse_takes_its_time_and_less_impulse() {
    let (walls, body, belief) = (slalom(), BodyShape::sphere(0.15).expect("a body"), belief());
    let world = world(walls.clone());
    let fast = request(&world, &body, &belief);
    let thrifty = GlobalRequest { objective: Objective::Impulse, ..request(&world, &body, &belief) };
    let settings = FlightPlannerSettings { longest_s: 120.0, ..FlightPlannerSettings::default() };
    let mut planner = FlightPlanner::new(settings);
    let impulse = |path: &ArcPath| {
        let push = |arc: &tumble_planning::BodyArc| arc.translation(0.0).1.abs().sum() * arc.duration_s * MASS_KG;
        path.arcs().iter().map(push).sum::<f64>()
    };
    let fast_answer = planner.plan(&fast, &mut Units::new(3000)).expect("an answer");
    let answer = planner.plan(&thrifty, &mut Units::new(3000)).expect("an answer");
    assert!(check_path(path(&answer), &thrifty, &walls, 0.15) >= -1e-9);
    assert!((impulse(path(&answer)) - answer.cost).abs() < 1e-9);
    assert!(answer.cost < 0.6 * impulse(path(&fast_answer)), "{} {}", answer.cost, impulse(path(&fast_answer)));
    assert!(path(&answer).duration_s() <= 120.0 + 1e-9);
    assert!(answer.history.windows(2).all(|pair| pair[1].cost < pair[0].cost));
    assert!(answer.lower_bound <= answer.cost);
}

/// What crosses the way at its own time is passed before or after, and the plan says so by its mission times.
#[test]
fn a_door_that_moves_is_passed_at_the_right_time() {
    let (body, belief) = (BodyShape::sphere(0.15).expect("a body"), belief());
    // A wall that slides out of the way along z: still closed when the fastest plan would pass.
    let wall = obstacle([10.75, -8.6, 4.75], [1.5, 0.05, 0.8]);
    let door = MovingObstacle::at_rest(wall).drifting(Vector3::new(0.0, 0.0, 0.03), 0.0);
    let world = EllipsoidWorld::new(&World::default()).and_then(|world| world.with_obstacle(door)).expect("a world");
    for start_s in [0.0, 500.0] {
        let request = GlobalRequest { start_s, seed: 4, ..request(&world, &body, &belief) };
        let answer = FlightPlanner::default().plan(&request, &mut Units::new(4000)).expect("an answer");
        check_path(path(&answer), &request, &[], 0.15);
        let mut time_s = 0.0;
        while time_s < path(&answer).duration_s() {
            let (arc, within_s) = path(&answer).at(time_s).expect("an arc");
            let mut there = wall;
            there.world_from_ellipsoid.translation.vector.z += 0.03 * (start_s + time_s);
            let distance_m = distance_to_ellipsoid(&arc.translation(within_s).0.position, &there);
            assert!(distance_m >= 0.15 - 1e-9, "{distance_m} at {time_s} s");
            time_s += 0.02;
        }
        if start_s > 0.0 {
            assert_eq!(answer.status, Status::Optimal);
        }
    }
}

/// A goal that is covered for longer than any edge lasts is reached by a wait at the start.
#[test]
fn a_goal_that_comes_free_late_is_waited_for() {
    let (body, belief) = (BodyShape::sphere(0.15).expect("a body"), belief());
    let cover = obstacle([10.8, -7.75, 5.2], [0.4, 0.4, 0.4]);
    for (seed, vanish_s) in [(1, 60.0), (2, 150.0), (3, 400.0)] {
        let until_then = MovingObstacle::at_rest(cover).present(0.0, vanish_s);
        let world =
            EllipsoidWorld::new(&World::default()).and_then(|world| world.with_obstacle(until_then)).expect("a world");
        let base = request(&world, &body, &belief);
        let request = GlobalRequest { seed, until: Until::FirstPlan, ..base };
        let answer = FlightPlanner::default().plan(&request, &mut Units::new(60_000)).expect("an answer");
        check_path(path(&answer), &request, &[], 0.15);
        assert!(path(&answer).duration_s() > vanish_s);
        let (start, _) = path(&answer).arcs().first().expect("an arc").translation(1.0);
        assert_eq!(start, request.start, "it waits where it is");
    }
}

#[test]
fn the_laws_of_planners_hold() {
    let (body, belief) = (BodyShape::sphere(0.15).expect("a body"), belief());
    let (open, closed) = (world(slalom()), world(vec![obstacle([10.75, -8.5, 4.75], [3.0, 0.1, 3.0])]));
    let wall = obstacle([10.75, -8.6, 4.75], [1.5, 0.05, 0.8]);
    let door = MovingObstacle::at_rest(wall).drifting(Vector3::new(0.0, 0.0, 0.03), 0.0);
    let moving = EllipsoidWorld::new(&World::default()).and_then(|world| world.with_obstacle(door)).expect("a world");
    let long = BodyShape::try_new(vec![BodyEllipsoid {
        body_from_ellipsoid: Pose::identity(),
        semi_axes: Vector3::new(0.2, 0.1, 0.1),
    }])
    .expect("a body");
    let mut cases = Vec::new();
    for seed in 0..3 {
        for (world, expectation) in
            [(&open, Expectation::Solvable), (&closed, Expectation::Unsolvable), (&moving, Expectation::Solvable)]
        {
            for objective in [Objective::Duration, Objective::Impulse] {
                for (body, units) in [(&body, 20), (&body, 3000), (&long, 3000)] {
                    let request = GlobalRequest { seed, objective, ..request(world, body, &belief) };
                    cases.push(PlannerCase { request, expectation, units });
                }
            }
        }
    }
    let checks = PlannerChecks { samples_per_arc: 20, tolerance: 1e-7, relative_tolerance: 1e-7 };
    check_global_planner(&FlightPlanner::default, &cases, &checks).expect("the laws");
}

/// Every loop spends: a budget ends the search of a problem in which nothing moves along an axis, or nothing moves at all.
#[test]
fn a_search_ends_with_its_budget_whatever_the_limits_are() {
    let (walls, body, belief) = (slalom(), BodyShape::sphere(0.15).expect("a body"), belief());
    let world = world(walls);
    let long = BodyShape::try_new(vec![BodyEllipsoid {
        body_from_ellipsoid: Pose::identity(),
        semi_axes: Vector3::new(0.2, 0.1, 0.1),
    }])
    .expect("a body");
    let everywhere =
        AlignedBox { lower_world: Vector3::repeat(f64::NEG_INFINITY), upper_world: Vector3::repeat(f64::INFINITY) };
    for objective in [Objective::Duration, Objective::Impulse] {
        for body in [&body, &long] {
            let ends = |change: &dyn Fn(&mut GlobalRequest<'_, EllipsoidWorld>)| {
                let mut request = GlobalRequest { objective, ..request(&world, body, &belief) };
                change(&mut request);
                let mut planner = FlightPlanner::default();
                planner.plan(&request, &mut Units::new(3000)).expect("an answer")
            };
            let flat = ends(&|request| {
                request.limits.speed_m_s.z = 0.0;
                request.limits.force_n.z = 0.0;
                request.goal.position.z = request.start.position.z;
            });
            assert_eq!(flat.status, Status::Feasible);
            assert!(matches!(ends(&|request| request.limits.position = everywhere).status, Status::Feasible));
            assert!(ends(&|request| request.limits.force_n = Vector3::zeros()).plan.is_none());
            let drifts = |request: &mut GlobalRequest<'_, EllipsoidWorld>| {
                request.limits.force_n = Vector3::zeros();
                request.start.velocity = Vector3::new(0.0, 0.01, 0.0);
            };
            ends(&drifts);
            ends(&|request| {
                drifts(request);
                request.goal.position = request.start.position;
                request.goal.speed_m_s = 0.0;
            });
            ends(&|request| {
                let here = request.start.position;
                request.limits.position = AlignedBox { lower_world: here, upper_world: here };
                request.goal = GoalRegion { position: here, radius_m: 0.0, speed_m_s: 0.0, attitude: None };
                request.goal.attitude = Some(UnitQuaternion::from_euler_angles(0.0, 0.0, 1.0));
            });
            for radius_m in [0.0, 0.2] {
                let there = ends(&|request| {
                    request.goal.position = request.start.position;
                    request.goal.radius_m = radius_m;
                });
                assert_eq!((there.status, there.cost), (Status::Optimal, 0.0));
            }
        }
    }
}

/// The wall covers the goal for a body that lies across, not for one that arrives lengthwise.
#[test]
fn a_goal_is_blocked_at_the_attitude_of_arrival_only() {
    let belief = belief();
    let pillars = vec![obstacle([10.35, -8.0, 4.75], [0.4, 0.4, 4.0]), obstacle([11.55, -8.0, 4.75], [0.4, 0.4, 4.0])];
    let world = world(pillars);
    let payload = BodyShape::try_new(vec![BodyEllipsoid {
        body_from_ellipsoid: Pose::identity(),
        semi_axes: Vector3::new(0.3, 0.15, 0.15),
    }])
    .expect("a body");
    let lengthwise = UnitQuaternion::from_euler_angles(0.0, 0.0, std::f64::consts::FRAC_PI_2);
    let position = Vector3::new(10.95, -8.0, 4.8);
    let room = AlignedBox { lower_world: Vector3::new(10.3, -9.8, 4.2), upper_world: Vector3::new(11.5, -7.5, 5.3) };
    let statuses = [Some(lengthwise), None, Some(UnitQuaternion::identity())].map(|attitude| {
        let usual = request(&world, &payload, &belief);
        let goal = GoalRegion { position, radius_m: 0.0, speed_m_s: 0.0, attitude };
        let request = GlobalRequest { goal, limits: MotionLimits { position: room, ..usual.limits }, ..usual };
        FlightPlanner::default().plan(&request, &mut Units::new(20_000)).expect("an answer").status
    });
    // Without a wall in between, turning takes less time than getting there.
    assert_eq!(statuses[..2], [Status::Optimal, Status::Optimal]);
    assert!(matches!(statuses[2], Status::Infeasible(Obstruction::GoalBlocked { .. })), "{:?}", statuses[2]);
}
