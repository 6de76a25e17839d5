//! A last look at a local plan before anyone sees it: its inputs flown again, by other means.

use super::plan_blockers::collision_world;
use super::plan_local_solve::{Segment, Task};
use crate::TumbleError;
use tumble_astrobee::simulator::planar_part;
use tumble_dynamics::nalgebra::Vector3;
use tumble_dynamics::{FreeFlyer, GaussLegendre4, Integrator as _, RigidBodyState};
use tumble_lie::{Pose, Twist, Wrench};
use tumble_planning::collision::{Blocker, CollisionWorld as _};
use tumble_planning::local::Kinematics;

/// Pieces of a step at whose ends everything is looked at.
const PIECES: usize = 20;
/// How far the plan's nodes may be from those flown again: the planner's steps are coarse. m, m/s, rad, rad/s, each times one
/// plus the size of the number.
const NODE: f64 = 2e-4;
/// The longest steps, s, that this holds for. The planner's are of fourth order: beyond, it grows with their fourth power.
const NODE_STEP_S: f64 = 0.5;
/// No plan may be farther off.
const MOST_NODE: f64 = 5e-3;
/// How deep an obstacle may be touched, m; half of what a node may be off where that is more.
pub(super) const TOUCH_M: f64 = 1e-4;
/// Rounding that is forgiven of a limit, as a share.
const SHARE: f64 = 1e-5;

/// What was found on the way.
pub(super) struct Flown {
    /// Positions, a twentieth of a step apart.
    pub positions: Vec<Vector3<f64>>,
    /// The nearest obstacle: distance to the body, m, when, s, and which; at the start where there is no plan.
    pub nearest: Option<(f64, f64, Option<Blocker>)>,
}

/// What a node may be off with steps of this length.
fn node_tolerance(step_s: f64) -> f64 {
    let longer = (step_s / NODE_STEP_S).max(1.0);
    (NODE * longer * longer * longer * longer).min(MOST_NODE)
}

/// Flies the plan's inputs with another integrator and looks at limits and obstacles on a finer grid; nothing without a plan.
///
/// # Errors
/// [`TumbleError::PlanContradiction`] for a plan that is not what it says; those of the collision world.
pub(super) fn check(task: &Task<'_>, segment: &Segment) -> Result<Flown, TumbleError> {
    let contradiction = |reason: String| Err(TumbleError::PlanContradiction { reason });
    if let Some(reason) = inputs(task, segment) {
        return contradiction(reason);
    }
    let (local, problem) = (task.local, task.problem);
    let world = collision_world(problem)?;
    let mut flown = Flown { positions: Vec::new(), nearest: None };
    if segment.motion.is_empty() {
        let clearance = world.clearance(&problem.body, &task.start.world_from_body, 0.0)?;
        flown.nearest = Some((clearance.distance_m, 0.0, clearance.nearest));
        return Ok(flown);
    }
    let tolerance = node_tolerance(segment.step_s);
    let touch_m = TOUCH_M.max(0.5 * tolerance);
    let body = local.belief.parameters();
    let flyer = FreeFlyer::new(if problem.place.is_planar() { planar_part(body) } else { *body });
    let mut state = rigid(&task.start);
    for (step, wrench) in std::iter::once(&Wrench::zero()).chain(&segment.inputs).enumerate() {
        let node_s = segment.time_s(step);
        let pieces = if step == 0 { 1 } else { PIECES };
        for piece in 1..=pieces {
            let time_s = node_s - segment.step_s * (pieces - piece) as f64 / pieces as f64;
            if step > 0 {
                let piece_s = segment.step_s / PIECES as f64;
                state = GaussLegendre4.step(&flyer, &state, wrench, 0.0, piece_s)?;
            }
            let is_node = piece == pieces;
            let pose = state.world_from_body;
            flown.positions.push(pose.translation.vector);
            let clearance = world.clearance(&problem.body, &pose, time_s)?;
            if flown.nearest.is_none_or(|(nearest_m, ..)| clearance.distance_m < nearest_m) {
                flown.nearest = Some((clearance.distance_m, time_s, clearance.nearest));
            }
            if (is_node || local.on_segments) && clearance.distance_m < local.margin_m - touch_m {
                let (distance_m, margin_m) = (clearance.distance_m, local.margin_m);
                return contradiction(format!("at {time_s} s an obstacle is {distance_m} m off, not {margin_m} m"));
            }
            if let Some(reason) = speeds(task, &state, tolerance) {
                return contradiction(format!("at {time_s} s {reason}"));
            }
        }
        if let Some(apart) =
            segment.motion.get(step).map(|planned| apart(planned, &state)).filter(|apart| *apart > tolerance)
        {
            return contradiction(format!(
                "flown again, the plan is {apart:.1e} off at {node_s} s, {tolerance:.1e} is allowed (a shorter `plan.local.step_s` helps)"
            ));
        }
    }
    if let (Some((radius_m, speed_m_s)), Some(last)) = (local.terminal_region, segment.motion.last()) {
        let away_m = (last.world_from_body.translation.vector - task.target.world_from_body.translation.vector).norm();
        let speed = last.velocity_world.norm();
        if away_m > radius_m * (1.0 + SHARE) || speed > speed_m_s * (1.0 + SHARE) {
            return contradiction(format!("the plan ends {away_m} m from its region's centre at {speed} m/s"));
        }
    }
    Ok(flown)
}

/// In body axes, as the dynamics have it.
fn rigid(motion: &Kinematics) -> RigidBodyState<f64> {
    let into_body = motion.world_from_body.rotation.inverse();
    RigidBodyState {
        world_from_body: motion.world_from_body,
        twist_body: Twist::new(motion.rate_body, into_body * motion.velocity_world),
    }
}

/// Largest difference of a node, m, m/s, rad or rad/s.
fn apart(planned: &Kinematics, flown: &RigidBodyState<f64>) -> f64 {
    let velocity_world = flown.world_from_body.rotation * flown.twist_body.linear;
    let Pose { rotation, translation } = planned.world_from_body;
    let (position, size) =
        (translation.vector - flown.world_from_body.translation.vector, 1.0 + translation.vector.amax());
    (position.amax() / size)
        .max((planned.velocity_world - velocity_world).amax())
        .max(rotation.angle_to(&flown.world_from_body.rotation))
        .max((planned.rate_body - flown.twist_body.angular).amax())
}

/// Which input passes a limit.
fn inputs(task: &Task<'_>, segment: &Segment) -> Option<String> {
    let set = &task.local.wrench;
    let names = ["torque x", "torque y", "torque z", "force x", "force y", "force z"];
    for (step, wrench) in segment.inputs.iter().enumerate() {
        let components = wrench.to_vector();
        for ((value, limit), name) in components.iter().zip(set.limit).zip(names) {
            // Not a number passes no limit, so the question is whether it is kept.
            let is_kept = value.abs() <= limit * (1.0 + SHARE);
            if !is_kept {
                return Some(format!("in step {step} {name} is {value}, the limit is {limit}"));
            }
        }
        for (normal, offset) in &set.half_spaces {
            let along: f64 = normal.iter().zip(&components).map(|(n, u)| n * u).sum();
            let is_kept = along <= offset * (1.0 + SHARE);
            if !is_kept {
                return Some(format!("in step {step} the nozzles cannot give the wrench: {along} of {offset} N"));
            }
        }
    }
    None
}

/// Which speed passes its limit.
fn speeds(task: &Task<'_>, state: &RigidBodyState<f64>, tolerance: f64) -> Option<String> {
    let limits = &task.local.speed;
    let velocity = state.world_from_body.rotation * state.twist_body.linear;
    let rate = state.twist_body.angular;
    for axis in 0..3 {
        // Where it begins too fast it has to slow down first.
        let speed_m_s = limits.speed_m_s[axis].max(task.start.velocity_world[axis].abs());
        let rate_rad_s = limits.rate_rad_s[axis].max(task.start.rate_body[axis].abs());
        let is_kept = velocity[axis].abs() <= speed_m_s * (1.0 + SHARE) + tolerance
            && rate[axis].abs() <= rate_rad_s * (1.0 + SHARE) + tolerance;
        if !is_kept {
            let name = ["x", "y", "z"][axis];
            return Some(format!("speed and rate along {name} are {} m/s, {} rad/s", velocity[axis], rate[axis]));
        }
    }
    None
}

#[cfg(test)]
mod tests {
    use super::super::plan_budget::WatchedBudget;
    use super::super::plan_local_solve::solve;
    use super::*;
    use crate::scenario::{LocalProblem, PlanningProblem, ScenarioSource};
    use std::path::Path;
    use tumble_dynamics::nalgebra::UnitQuaternion;
    use tumble_planning::ArcPath;

    const SCENARIO: &str = "format = 1\nname = \"b\"\nworld = \"open\"\nduration_s = 10.0\nrobot_radius_m = 0.1\n\
        [body]\nmass_kg = 10.0\ninertia_about_com_kg_m2 = [[0.2,0.0,0.0],[0.0,0.15,0.0],[0.0,0.0,0.18]]\n\
        [start]\nposition_m = [0.0,0.0,0.0]\n[goal]\nposition_m = [0.04,0.0,0.0]\n[propulsion]\nkind = \"exact\"\n\
        [plan]\nposition_lower_m = [-2.0,-2.0,-2.0]\nposition_upper_m = [2.0,2.0,2.0]\n\
        [plan.local]\nsteps = 8\nstep_s = 0.5\n";

    fn problems(more: &str) -> (PlanningProblem, LocalProblem) {
        let source = ScenarioSource::parse(Path::new("b.toml"), &format!("{SCENARIO}{more}")).unwrap();
        let problem = source.planning_problem().unwrap();
        let local = source.local_problem(&problem).unwrap();
        (problem, local)
    }

    /// What is said of a plan.
    fn said(
        (problem, local): &(PlanningProblem, LocalProblem),
        change: impl Fn(&mut Segment),
        segment: &Segment,
    ) -> String {
        let mut segment = segment.clone();
        change(&mut segment);
        let found = with_task(problem, local, |task| check(task, &segment).map(|_| ()));
        found.map_or_else(|error| error.to_string(), |()| "nothing".to_owned())
    }

    fn with_task<R>(problem: &PlanningProblem, local: &LocalProblem, then: impl Fn(&Task<'_>) -> R) -> R {
        let at = |position: Vector3<f64>| Kinematics {
            world_from_body: Pose::from_parts(position.into(), UnitQuaternion::identity()),
            velocity_world: Vector3::zeros(),
            rate_body: Vector3::zeros(),
        };
        let way = ArcPath::default();
        let (start, target) = (at(Vector3::zeros()), at(Vector3::x() * 0.04));
        then(&Task { problem, local, start, target, way: &way, mission_s: 10.0 })
    }

    #[test]
    fn a_plan_that_is_not_what_it_says_is_caught() {
        let right = problems("");
        let solved =
            with_task(&right.0, &right.1, |task| solve(task, &mut WatchedBudget::new(Some(100_000), None)).unwrap());
        let plan = |change: &dyn Fn(&mut Segment)| said(&right, change, &solved);
        assert_eq!(plan(&|_| ()), "nothing");
        // Nodes elsewhere: position, velocity, attitude, rate; no numbers.
        assert!(plan(&|s| s.motion[3].world_from_body.translation.vector.y += 5e-4).contains("off at 1.5 s"));
        assert!(plan(&|s| s.motion[8].velocity_world.z += 5e-4).contains("off at 4 s"));
        assert!(plan(&|s| s.motion[5].rate_body.x -= 5e-4).contains("off at 2.5 s"));
        let turned = |s: &mut Segment| s.motion[2].world_from_body.rotation *= UnitQuaternion::new(Vector3::z() * 5e-4);
        assert!(plan(&turned).contains("off at 1 s"));
        // Inputs: others than those that lead there, beyond a limit, beyond the nozzles, no numbers.
        assert!(plan(&|s| s.inputs[0].force.x -= 0.02).contains("off at "));
        assert!(plan(&|s| s.inputs[4].force.y = -0.1001).contains("in step 4 force y"));
        assert!(plan(&|s| s.inputs[7].torque.z = f64::NAN).contains("in step 7 torque z"));
        let mut narrow = problems("");
        narrow.1.wrench.half_spaces.push(([0.0, 0.0, 0.0, 1.0, 0.0, 0.0], 1e-3));
        assert!(said(&narrow, |_| (), &solved).contains("nozzles"));
        // Speed, rate, the end.
        let slow = problems("speed_limit_m_s = [0.003,0.003,0.003]\n");
        assert!(said(&slow, |_| (), &solved).contains("speed and rate along x"));
        let stiff = problems("rate_limit_rad_s = [0.001,0.001,0.001]\n");
        assert!(said(&stiff, |_| (), &solved).contains("speed and rate along"));
        let near = problems("terminal_radius_m = 1e-6\nterminal_speed_m_s = 1.0\n");
        assert!(said(&near, |_| (), &solved).contains("ends "));
        // An obstacle: 0.2 m from the start with a body of 0.1 m, nearer as it moves.
        let wall = "[[obstacles]]\ncenter_m = [0.31,0.0,0.0]\nsemi_axes_m = [0.2,0.2,0.2]\n";
        assert!(said(&problems(wall), |_| (), &solved).contains("an obstacle is"));
        let far = wall.replace("0.31", "0.4");
        assert_eq!(said(&problems(&far), |_| (), &solved), "nothing");
        assert!(said(&problems(&format!("margin_m = 0.1\n{far}")), |_| (), &solved).contains("not 0.1 m"));
    }

    /// Fourth order: from twice the step on sixteen times as much, but never more than may be.
    #[test]
    fn longer_steps_may_be_farther_off() {
        for (step_s, tolerance) in [(0.1, NODE), (0.5, NODE), (1.0, 16.0 * NODE), (60.0, MOST_NODE)] {
            assert!((node_tolerance(step_s) - tolerance).abs() < 1e-15, "{step_s}");
        }
    }
}
