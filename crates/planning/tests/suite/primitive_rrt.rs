//! The thesis's planner of primitives among ellipsoids: what moves with time, what blocks, what is asked for in vain.
#![allow(clippy::unwrap_used)]

use tumble_planning::collision::{Blocker, BodyShape, EllipsoidWorld, MovingObstacle};
use tumble_planning::dynamics::{AlignedBox, InertialParameters, ObstacleEllipsoid, World};
use tumble_planning::global::{
    EdgeCheck, GlobalPlanner, GlobalRequest, GoalRegion, MotionLimits, Objective, Obstruction, PrimitiveRrt,
    PrimitiveRrtSettings, Status, Until,
};
use tumble_planning::laws::{Expectation, PlannerCase, PlannerChecks, check_global_planner};
use tumble_planning::lie::Pose;
use tumble_planning::nalgebra::{Matrix3, UnitQuaternion, Vector3};
use tumble_planning::{DoubleIntegrator, ModelBelief, PlanningError, Propagation, TranslationState, Units};

fn cube() -> AlignedBox {
    AlignedBox::between(Vector3::repeat(-1.0), Vector3::repeat(1.0))
}

fn planner(goal_bias: f64) -> Result<PrimitiveRrt<DoubleIntegrator>, PlanningError> {
    let model = DoubleIntegrator::try_new(cube(), Vector3::repeat(0.1), Vector3::repeat(0.2), 2.0, Propagation::Exact)?;
    let settings = PrimitiveRrtSettings {
        goal_bias,
        iterations: 10_000,
        position_weight: 1.0,
        velocity_weight: 0.01,
        goal_tolerance: 0.2,
        edge_check: EdgeCheck::default(),
    };
    PrimitiveRrt::try_new(model, settings)
}

fn ellipsoid(x: f64, semi_axes: [f64; 3]) -> ObstacleEllipsoid {
    ObstacleEllipsoid { world_from_ellipsoid: Pose::translation(x, 0.0, 0.0), semi_axes: semi_axes.into() }
}

fn request<'a>(
    world: &'a EllipsoidWorld,
    body: &'a BodyShape,
    belief: &'a ModelBelief,
) -> GlobalRequest<'a, EllipsoidWorld> {
    GlobalRequest {
        world,
        body,
        start: TranslationState::at_rest(Vector3::new(-0.7, 0.0, 0.0)),
        attitude: UnitQuaternion::identity(),
        start_s: 100.0,
        goal: GoalRegion { position: Vector3::new(0.7, 0.0, 0.0), radius_m: 0.2, speed_m_s: 0.2, attitude: None },
        limits: MotionLimits {
            position: cube(),
            speed_m_s: Vector3::repeat(0.1),
            force_n: Vector3::repeat(0.2),
            torque_n_m: Vector3::repeat(0.01),
            rate_rad_s: 0.1,
        },
        belief,
        objective: Objective::Duration,
        margin_m: 0.0,
        until: Until::FirstPlan,
        seed: 1,
    }
}

fn belief() -> ModelBelief {
    ModelBelief::certain(1, InertialParameters::about_origin(9.0, Vector3::zeros(), Matrix3::identity() * 0.1))
}

/// A ball in the way from some moment of the mission on, and one that crosses: the plan is free at its own times.
#[test]
fn obstacles_are_met_at_their_times() {
    let appearing = MovingObstacle::at_rest(ellipsoid(0.1, [0.3; 3])).present(108.0, f64::INFINITY);
    let crossing = MovingObstacle::at_rest(ellipsoid(0.4, [0.2; 3])).drifting(Vector3::new(0.0, 0.03, 0.0), 115.0);
    let world = EllipsoidWorld::new(&World::default()).unwrap().with_obstacles([appearing, crossing]).unwrap();
    let (body, belief) = (BodyShape::sphere(0.1).unwrap(), belief());
    let cases: Vec<_> = (0..10)
        .map(|seed| PlannerCase {
            request: GlobalRequest { seed, ..request(&world, &body, &belief) },
            expectation: Expectation::Solvable,
            units: 100_000,
        })
        .collect();
    let checks = PlannerChecks { samples_per_arc: 100, tolerance: 1e-9, relative_tolerance: 1e-9 };
    check_global_planner(&|| planner(0.05).unwrap(), &cases, &checks).unwrap();
    let answer = planner(0.05).unwrap().plan(&cases[0].request, &mut Units::new(100_000)).unwrap();
    assert_eq!(answer.status, Status::Feasible);
    assert!(answer.lower_bound > 10.0, "{}", answer.lower_bound);
}

/// Behind a wall that spans the box no plan is found, and the wall is what stood most in the way.
#[test]
fn what_stands_in_the_way_is_named() {
    let obstacles = vec![ellipsoid(-0.2, [0.05, 5.0, 5.0]), ellipsoid(0.9, [0.1; 3])];
    let world = EllipsoidWorld::new(&World { obstacles, ..World::default() }).unwrap();
    let (body, belief) = (BodyShape::sphere(0.1).unwrap(), belief());
    let request = request(&world, &body, &belief);
    let answer = planner(0.05).unwrap().plan(&request, &mut Units::new(5_000)).unwrap();
    assert_eq!(answer.status, Status::BudgetSpent(vec![Blocker::Obstacle(0)]));
    assert!(answer.plan.is_none() && answer.cost == f64::INFINITY && answer.lower_bound.is_finite());
    assert_eq!(answer.units, 5_000);
    assert!(!answer.tree.is_empty());
}

#[test]
fn a_start_or_goal_that_cannot_be_is_infeasible() {
    let obstacles = vec![ellipsoid(-0.7, [0.15; 3]), ellipsoid(0.7, [0.15; 3])];
    let world = EllipsoidWorld::new(&World { obstacles, ..World::default() }).unwrap();
    let (body, belief) = (BodyShape::sphere(0.1).unwrap(), belief());
    let from = |start: Vector3<f64>, goal_radius_m: f64| {
        let sound = request(&world, &body, &belief);
        let goal = GoalRegion { radius_m: goal_radius_m, ..sound.goal };
        let request = GlobalRequest { start: TranslationState::at_rest(start), goal, ..sound };
        planner(0.05).unwrap().plan(&request, &mut Units::new(1_000)).unwrap().status
    };
    let blocked = from(Vector3::new(-0.7, 0.1, 0.0), 0.3);
    let blocker = Blocker::Obstacle(0);
    assert!(
        matches!(blocked, Status::Infeasible(Obstruction::StartBlocked { blocker: found, .. }) if found == blocker)
    );
    let blocked = from(Vector3::zeros(), 0.1);
    let blocker = Blocker::Obstacle(1);
    assert!(matches!(blocked, Status::Infeasible(Obstruction::GoalBlocked { blocker: found, .. }) if found == blocker));
    let outside = from(Vector3::new(0.0, 1.5, 0.0), 0.3);
    assert!(matches!(outside, Status::Infeasible(Obstruction::OutsideLimits { .. })));
}

/// A start in the goal region needs no motion; one that is there in another attitude does.
#[test]
fn being_there_is_optimal() {
    let world = EllipsoidWorld::new(&World::default()).unwrap();
    let (body, belief) = (BodyShape::sphere(0.1).unwrap(), belief());
    let sound = request(&world, &body, &belief);
    let there = GlobalRequest { start: TranslationState::at_rest(sound.goal.position), ..sound };
    let answer = planner(0.05).unwrap().plan(&there, &mut Units::new(100)).unwrap();
    assert_eq!((answer.status, answer.cost, answer.units), (Status::Optimal, 0.0, 0));
    let turned = GoalRegion { attitude: Some(UnitQuaternion::from_euler_angles(0.0, 0.0, 0.1)), ..there.goal };
    let answer = planner(0.05).unwrap().plan(&GlobalRequest { goal: turned, ..there }, &mut Units::new(100)).unwrap();
    assert!(answer.plan.is_none());
}

#[test]
fn settings_and_requests_that_cannot_be_are_errors() {
    assert!(matches!(planner(1.5), Err(PlanningError::OutOfRange { .. })));
    assert!(matches!(planner(f64::NAN), Err(PlanningError::OutOfRange { .. })));
    let world = EllipsoidWorld::new(&World::default()).unwrap();
    let (body, belief) = (BodyShape::sphere(0.1).unwrap(), belief());
    let sound = request(&world, &body, &belief);
    let ask = |request| planner(0.05).unwrap().plan(&request, &mut Units::new(10)).is_err();
    assert!(ask(GlobalRequest { start_s: f64::NAN, ..request(&world, &body, &belief) }));
    assert!(ask(GlobalRequest { margin_m: f64::INFINITY, ..request(&world, &body, &belief) }));
    let goal = GoalRegion { radius_m: -1.0, ..sound.goal };
    assert!(ask(GlobalRequest { goal, ..sound }));
}
