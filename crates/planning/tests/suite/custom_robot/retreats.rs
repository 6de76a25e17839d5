//! Who finds no way and stands nearer to something than one may stay goes to where more room is left, even out of a contact.

use super::{RADIUS_M, estimator, planners, room, tube, tug};
use tumble_planning::collision::{CollisionWorld, EllipsoidWorld};
use tumble_planning::global::{GlobalAnswer, GlobalPlanner, GlobalRequest, Status};
use tumble_planning::identification::estimator::Acted;
use tumble_planning::lie::{Pose, Wrench};
use tumble_planning::mission::{Ambition, Asked, Found, NoObserver, PlanRequest, serve};
use tumble_planning::nalgebra::Vector3;
use tumble_planning::{ArcPath, Budget, PlanningError};

/// Never finds a way, and proves nothing.
struct Lost;

impl GlobalPlanner<EllipsoidWorld> for Lost {
    fn plan(
        &mut self,
        _: &GlobalRequest<'_, EllipsoidWorld>,
        _: &mut dyn Budget,
    ) -> Result<GlobalAnswer, PlanningError> {
        Ok(GlobalAnswer {
            status: Status::BudgetSpent(Vec::new()),
            plan: None,
            cost: f64::INFINITY,
            lower_bound: 0.0,
            units: 7,
            history: Vec::new(),
            tree: Vec::new(),
        })
    }
}

/// What is asked where the body is so far from the post beside it, m.
fn asked(apart_m: f64) -> PlanRequest<EllipsoidWorld> {
    let mut flying = tug(tube, estimator(), &room());
    let acted = Acted { from_ns: 0, until_ns: 0, wrench_body: Wrench::zero(), stored_body: Vector3::zeros() };
    flying.step(&acted, &[], &mut NoObserver).unwrap();
    let mut request = flying.next_request().unwrap();
    request.start.world_from_body = Pose::translation(-0.2 - 0.15 - RADIUS_M - apart_m, 0.25, 0.0);
    request
}

fn clearance_m(request: &PlanRequest<EllipsoidWorld>, pose: &Pose<f64>, time_s: f64) -> f64 {
    request.scene.world.clearance(&request.settings.body, pose, time_s).unwrap().distance_m
}

/// The clearance every tenth of a second on the way out.
fn on_the_way_out(request: &PlanRequest<EllipsoidWorld>, path: &ArcPath) -> Vec<f64> {
    let times = (0..).map(|k| 0.1 * f64::from(k)).take_while(|at_s| *at_s < path.duration_s());
    let clearance = |at_s: f64| {
        let (arc, within_s) = path.at(at_s).unwrap();
        clearance_m(request, &arc.pose(within_s), at_s)
    };
    times.chain([path.duration_s()]).map(clearance).collect()
}

#[test]
fn who_stands_too_near_and_finds_no_way_goes_where_room_is_left() {
    for apart_m in [0.02, 0.001, -0.03] {
        let request = asked(apart_m);
        assert!((clearance_m(&request, &request.start.world_from_body, 0.0) - apart_m).abs() < 1e-6);
        let answer = serve(&mut (Lost, planners().1), &request);
        assert_eq!(answer.units, 7);
        let Found::Retreat(why, path, _) = answer.found else { panic!("{apart_m}: {:?}", answer.found) };
        assert_eq!(why.status, Status::BudgetSpent(Vec::new()));
        let apart = on_the_way_out(&request, &path);
        assert!(apart.windows(2).all(|two| two[1] >= two[0] - 1e-9), "{apart:?}");
        let (end, margin_m) = (apart[apart.len() - 1], request.settings.margin_m);
        // The nearest such place along a line, not one far away.
        assert!(end >= margin_m && end < margin_m + 0.011, "{end} beside {margin_m}");

        // Flown as it is, it is found to be clear.
        let stretch =
            Asked::Stretch { way: path.into(), way_start_ns: 0, ambition: Ambition::AlongWay, elapsed_s: 0.0 };
        let request = PlanRequest { asked: stretch, ..request };
        let Found::Stretch(stretch, flown) = serve(&mut (Lost, planners().1), &request).found else { panic!() };
        assert!(stretch.is_clear && stretch.is_last && !stretch.is_to_goal, "{apart_m}: {stretch:?}");
        let rest = clearance_m(&request, flown.motion.resting_pose(), flown.motion.rest_s());
        assert!((rest - end).abs() < 1e-6);
    }
}

#[test]
fn who_goes_deeper_first_is_not_clear() {
    let request = asked(-0.03);
    let Found::Retreat(_, out, _) = serve(&mut (Lost, planners().1), &request).found else { panic!() };
    let (last, _) = out.at(out.duration_s()).unwrap();
    let through =
        request.start.world_from_body.translation.vector * 2.0 - last.pose(last.duration_s).translation.vector;
    let line = tumble_planning::BodyArc::accelerated(
        9.0,
        &tumble_planning::TranslationState {
            position: request.start.world_from_body.translation.vector,
            velocity: (through - request.start.world_from_body.translation.vector) / 3.0,
        },
        Vector3::zeros(),
        request.start.world_from_body.rotation,
    );
    let way = ArcPath::new([line]).into();
    let stretch = Asked::Stretch { way, way_start_ns: 0, ambition: Ambition::AlongWay, elapsed_s: 0.0 };
    let request = PlanRequest { asked: stretch, ..request };
    let Found::Stretch(stretch, _) = serve(&mut (Lost, planners().1), &request).found else { panic!() };
    assert!(!stretch.is_clear);
}

#[test]
fn who_has_room_or_moves_is_told_that_there_is_no_way() {
    let request = asked(0.0);
    let mut far = asked(1.01 * request.settings.check_margin_m);
    assert!(matches!(serve(&mut (Lost, planners().1), &far).found, Found::Way(answer) if answer.plan.is_none()));
    far = asked(0.02);
    far.start.twist_body.linear.y = 0.01;
    assert!(matches!(serve(&mut (Lost, planners().1), &far).found, Found::Way(answer) if answer.plan.is_none()));
}

/// The same request, however fast the controller promises to follow: a way asks for no more than that.
#[test]
fn a_way_keeps_within_what_the_controller_promises_to_follow() {
    let promised = asked(0.4).followed_m_s2;
    assert!(promised.iter().all(|along| *along > 0.0 && along.is_finite()), "{promised:?}");
    let mut durations_s = Vec::new();
    for followed_m_s2 in [0.002, 0.005, f64::INFINITY] {
        let request = PlanRequest { followed_m_s2: [followed_m_s2; 3], ..asked(0.4) };
        let Found::Way(answer) = serve(&mut planners(), &request).found else { panic!("{followed_m_s2}") };
        let way = answer.plan.unwrap().trajectory;
        let pushed = way
            .arcs()
            .iter()
            .flat_map(|arc| arc.translation(0.5 * arc.duration_s).1.iter().copied().collect::<Vec<_>>());
        let hardest = pushed.fold(0.0, |most: f64, pushed| most.max(pushed.abs()));
        assert!(hardest <= followed_m_s2 * (1.0 + 1e-9) && hardest > 0.0, "{hardest} of {followed_m_s2}");
        durations_s.push(way.duration_s());
    }
    assert!(durations_s.windows(2).all(|two| two[1] < two[0]), "{durations_s:?}");
}
