//! Planes along a plan in closed loop: what was feasible stays so, and the body touches nothing, whatever its mass.

use crate::fixed_planes;
use crate::obstacle_loop::{Mission, Outcome, Planes, Random, STEPS, mission};
use tumble_planning::collision::MovingObstacle;
use tumble_planning::control::GramStatus;
use tumble_planning::dynamics::ObstacleEllipsoid;
use tumble_planning::lie::Pose;
use tumble_planning::nalgebra::{UnitQuaternion, Vector3};

fn flown(missions: impl Iterator<Item = Mission>) -> Vec<Outcome> {
    missions.map(|mission| mission.fly()).filter(|outcome| outcome.started).collect()
}

fn least_clearance_m(outcomes: &[Outcome]) -> f64 {
    outcomes.iter().map(|outcome| outcome.clearance_m).fold(f64::INFINITY, f64::min)
}

#[test]
fn what_is_feasible_at_the_start_stays_so_and_touches_nothing() {
    let outcomes = flown((0..290).map(mission));
    assert!(outcomes.len() >= 200, "{}", outcomes.len());
    for outcome in &outcomes {
        assert!((outcome.failed, outcome.cut) == (0, 0), "{outcome:?}");
        assert!(outcome.clearance_m > 0.0, "{outcome:?}");
    }
    // the missions are not void: planes change, bodies fly far and come as near as their tubes allow
    let flown_m = outcomes.iter().map(|outcome| outcome.flown_m).sum::<f64>() / outcomes.len() as f64;
    assert!(flown_m > 0.4, "{flown_m}");
    assert!(outcomes.iter().map(|outcome| outcome.replaced).sum::<usize>() > 100_000);
    assert!(least_clearance_m(&outcomes) < 0.03, "{}", least_clearance_m(&outcomes));
}

/// A judge that catches nothing would be worth nothing.
#[test]
fn planted_defects_are_caught() {
    let with = |planes: Planes| flown((0..70).map(|seed| Mission { planes, ..mission(seed) }));
    let far_off = |seed: u64| Mission { attitude_error_rad: 0.4, ..mission(seed) };
    let without_tube = with(Planes::WithoutTube);
    let without_turn = flown((0..70).map(|seed| Mission { planes: Planes::WithoutTurn, ..far_off(seed) }));
    assert!(flown((0..20).map(far_off)).iter().all(|outcome| outcome.clearance_m > 0.0 && outcome.failed == 0));
    assert!(least_clearance_m(&without_tube) < -1e-3, "{}", least_clearance_m(&without_tube));
    assert!(least_clearance_m(&without_turn) < -1e-3, "{}", least_clearance_m(&without_turn));
    let failed: usize = with(Planes::AlwaysReplaced).iter().map(|outcome| outcome.failed).sum();
    assert!(failed > 0);
}

/// Of an obstacle whose motion is known only the segment that is new can be cut. Then the plan in force is safe for all others.
#[test]
fn moving_obstacles_are_kept_off_until_they_cut_what_is_kept() {
    let drifting = |seed: u64| {
        let mut random = Random::new(seed ^ 0xd21f);
        let still = mission(seed);
        let obstacles = still.obstacles.iter().map(|obstacle| obstacle.drifting(random.vector(0.025), 0.0)).collect();
        Mission { obstacles, ..still }
    };
    let outcomes = flown((1000..1110).map(drifting));
    assert!(outcomes.len() >= 60, "{}", outcomes.len());
    let (mut whole, mut cut, mut failed) = (0, 0, 0);
    for outcome in &outcomes {
        match (outcome.cut_at, outcome.failed_at) {
            (None, failure) => {
                assert!(failure.is_none(), "{outcome:?}");
                whole += 1;
            }
            (Some(_), None) => cut += 1,
            (Some(cut_at), Some(failed_at)) => {
                assert!(failed_at >= cut_at && outcome.first_failure == Some(GramStatus::Infeasible), "{outcome:?}");
                failed += 1;
            }
        }
        let is_safe = outcome.failed_at.is_none_or(|failed_at| failed_at + STEPS > outcome.decisions);
        if is_safe {
            assert!(outcome.clearance_m > 0.0, "{outcome:?}");
        }
    }

    assert!(whole > 30 && cut > 3, "{whole} {cut} {failed}");
}

/// A large one, faster than the body: first a plane is cut, then no plan is left; the last one is safe until that segment comes.
#[test]
fn an_obstacle_that_runs_the_body_down_leaves_no_plan_and_time_to_say_so() {
    let mut failures = 0;
    for seed in 0..6 {
        let still = mission(seed);
        let towards = Random::new(seed ^ 0xfa57).direction().into_inner();
        let pose = Pose::from_parts((still.start_world - towards * 3.5).into(), UnitQuaternion::identity());
        let ball = ObstacleEllipsoid { world_from_ellipsoid: pose, semi_axes: Vector3::repeat(0.8) };
        let obstacles = vec![MovingObstacle::at_rest(ball).drifting(towards * 0.3, 0.0)];
        let goal_world = still.start_world;
        let whole = Mission { obstacles, goal_world, ..still };
        let outcome = whole.fly();
        assert!(outcome.started);
        let (Some(cut_at), Some(failed_at)) = (outcome.cut_at, outcome.failed_at) else { continue };
        assert!(failed_at >= cut_at && outcome.first_failure == Some(GramStatus::Infeasible), "{outcome:?}");
        failures += 1;
        let until = Mission { decisions: whole.decisions.min(failed_at + STEPS - 1), ..whole }.fly();
        assert!(until.clearance_m > 0.0, "{until:?}");
    }
    assert!(failures > 0);
}

#[test]
fn fixed_planes_between_walls_are_kept() {
    let planes = fixed_planes::planes(3);
    let flown = fixed_planes::fly(12, 60, &planes, |_, _, _, _| {});
    assert_eq!((flown.failed, flown.steps), (0, 720));
    assert!(flown.excess_m < 0.0 && flown.speed_excess_m_s < 0.0, "{flown:?}");
}
