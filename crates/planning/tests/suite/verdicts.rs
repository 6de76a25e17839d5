//! Verdicts on bodies that turn, and on numbers that are none: what is called impossible is.
#![allow(clippy::unwrap_used)]

use tumble_planning::collision::{BodyEllipsoid, BodyShape, EllipsoidWorld};
use tumble_planning::dynamics::{AlignedBox, InertialParameters, World};
use tumble_planning::global::{
    FlightPlanner, GlobalPlanner, GlobalRequest, GoalRegion, MotionLimits, Objective, Obstruction, UnderWay, Until,
    diagnose,
};
use tumble_planning::lie::Pose;
use tumble_planning::nalgebra::{Quaternion, UnitQuaternion, Vector3};
use tumble_planning::{ArcPath, ModelBelief, PlanningError, TranslationState, Units};

/// Two walls with a slit of 0.24 m between them, across x.
fn slit() -> EllipsoidWorld {
    let wall = |from: f64, to: f64| AlignedBox::between(Vector3::new(-0.05, from, -2.0), Vector3::new(0.05, to, 2.0));
    EllipsoidWorld::new(&World { keep_out: vec![wall(-2.0, -0.12), wall(0.12, 2.0)], ..World::default() }).unwrap()
}

/// Long along its y axis: it fits through the slit only turned.
fn plank() -> BodyShape {
    let semi_axes = Vector3::new(0.08, 0.3, 0.08);
    BodyShape::try_new(vec![BodyEllipsoid { body_from_ellipsoid: Pose::identity(), semi_axes }]).unwrap()
}

fn belief() -> ModelBelief {
    ModelBelief::certain(1, InertialParameters::solid_box(2.0, [0.3, 0.3, 0.1]))
}

/// On a table: z is fixed, and the body turns about z alone.
fn on_a_table<'a>(
    world: &'a EllipsoidWorld,
    body: &'a BodyShape,
    belief: &'a ModelBelief,
) -> GlobalRequest<'a, EllipsoidWorld> {
    GlobalRequest {
        world,
        body,
        start: TranslationState::at_rest(Vector3::new(-1.1, -0.5, 0.0)),
        attitude: UnitQuaternion::identity(),
        start_s: 0.0,
        goal: GoalRegion { position: Vector3::new(1.1, -0.5, 0.0), radius_m: 0.0, speed_m_s: 0.0, attitude: None },
        limits: MotionLimits {
            position: AlignedBox::between(Vector3::new(-1.5, -1.5, 0.0), Vector3::new(1.5, 1.5, 0.0)),
            speed_m_s: Vector3::new(0.5, 0.4, 0.0),
            force_n: Vector3::new(0.4, 0.4, 0.0),
            torque_n_m: Vector3::new(0.0, 0.0, 0.02),
            rate_rad_s: 0.5,
        },
        belief,
        objective: Objective::Duration,
        margin_m: 0.01,
        until: Until::FirstPlan,
        seed: 3,
    }
}

#[test]
fn a_table_robot_turns_upright_through_a_slit_that_is_closed_to_one_that_cannot_turn() {
    let (world, body, belief) = (slit(), plank(), belief());
    let request = on_a_table(&world, &body, &belief);
    let answer = FlightPlanner::default().plan(&request, &mut Units::new(60_000)).unwrap();
    let path = answer.plan.unwrap().trajectory;
    for step in 0..=2000 {
        let time_s = path.duration_s() * f64::from(step) / 2000.0;
        let (arc, within_s) = path.at(time_s).unwrap();
        let up = arc.attitude_at(within_s) * Vector3::z();
        assert!((up - Vector3::z()).norm() < 1e-12, "tilted at {time_s} s");
    }
    let mut held = request;
    held.limits.rate_rad_s = 0.0;
    let answer = FlightPlanner::default().plan(&held, &mut Units::new(60_000)).unwrap();
    assert!(matches!(answer.status, tumble_planning::global::Status::Infeasible(Obstruction::Enclosed { .. })));
}

#[test]
fn a_goal_that_only_another_attitude_reaches_is_not_called_blocked() {
    let (world, body, belief) = (slit(), plank(), belief());
    let quarter = UnitQuaternion::from_axis_angle(&Vector3::z_axis(), std::f64::consts::FRAC_PI_2);
    let mut request = on_a_table(&world, &body, &belief);
    request.goal.position = Vector3::zeros();
    for attitude in [None, Some(quarter)] {
        request.goal.attitude = attitude;
        assert_eq!(diagnose(&request).unwrap(), None);
        let answer = FlightPlanner::default().plan(&request, &mut Units::new(60_000)).unwrap();
        assert!(answer.plan.is_some(), "{attitude:?}");
    }
    request.goal.attitude = Some(request.attitude);
    assert!(matches!(diagnose(&request).unwrap(), Some(Obstruction::GoalBlocked { .. })));
    (request.goal.attitude, request.limits.rate_rad_s) = (None, 0.0);
    assert!(matches!(diagnose(&request).unwrap(), Some(Obstruction::GoalBlocked { .. })));
}

#[test]
fn numbers_that_are_none_are_errors_and_never_free() {
    let nowhere = UnitQuaternion::new_unchecked(Quaternion::new(f64::NAN, 0.0, 0.0, 0.0));
    let body_from_ellipsoid = Pose::from_parts(Vector3::zeros().into(), nowhere);
    let part = BodyEllipsoid { body_from_ellipsoid, semi_axes: Vector3::new(0.1, 0.3, 0.1) };
    assert!(matches!(BodyShape::try_new(vec![part]), Err(PlanningError::NotFinite { .. })));

    let (world, body, belief) = (slit(), plank(), belief());
    let request = on_a_table(&world, &body, &belief);
    let path = ArcPath::default();
    assert_eq!(path.duration_s().to_bits(), 0.0_f64.to_bits());
    let replan = |started_s: f64, now_s: f64, splice_s: f64| {
        let under_way = UnderWay { path: &path, started_s, now_s, splice_s };
        FlightPlanner::default().replan(&request, &under_way, &mut Units::new(100))
    };
    for (started_s, now_s, splice_s) in [(f64::NAN, 1.0, 2.0), (0.0, f64::NAN, 2.0), (0.0, 1.0, f64::NAN)] {
        assert!(matches!(replan(started_s, now_s, splice_s), Err(PlanningError::NotFinite { .. })));
    }
    assert!(matches!(replan(0.0, 3.0, 1.0), Err(PlanningError::OutOfRange { .. })));
}
