//! A last look at a plan before anyone sees it: that it holds what it promises.

use crate::TumbleError;
use crate::scenario::PlanningProblem;
use tumble_dynamics::nalgebra::Vector3;
use tumble_planning::global::{GlobalAnswer, Objective};
use tumble_planning::{ArcPath, TranslationState};

/// Rounding that is forgiven, as a share.
const SHARE: f64 = 1e-6;
/// The same between cost and bound.
const BOUND_SHARE: f64 = 1e-9;
/// Rounding of a speed and of a rate near zero, m/s and rad/s.
const STILL: f64 = 1e-12;
/// Pieces of an arc at whose ends the limits are looked at.
const PIECES: u32 = 16;

/// Refuses a plan that costs less than its bound, whose arcs do not join, or that passes a limit; without a plan there is
/// nothing to refuse. Obstacles are not looked at.
///
/// # Errors
/// [`TumbleError::PlanContradiction`].
pub(super) fn check(problem: &PlanningProblem, objective: Objective, answer: &GlobalAnswer) -> Result<(), TumbleError> {
    let Some(plan) = &answer.plan else { return Ok(()) };
    let (cost, bound, path) = (answer.cost, answer.lower_bound, &plan.trajectory);
    let found = if !(cost.is_finite() && cost >= bound - BOUND_SHARE * bound.abs()) {
        Some(format!("the plan costs {cost}, no plan costs less than {bound}"))
    } else if objective == Objective::Duration && (cost - path.duration_s()).abs() > SHARE * cost {
        Some(format!("the plan costs {cost} s and takes {} s", path.duration_s()))
    } else {
        joints(problem, path).or_else(|| limits(problem, path))
    };
    found.map_or(Ok(()), |reason| Err(TumbleError::PlanContradiction { reason }))
}

/// Where start, arcs and goal do not join.
fn joints(problem: &PlanningProblem, path: &ArcPath) -> Option<String> {
    let arcs = path.arcs();
    let begins = arcs.iter().map(|arc| arc.translation(0.0).0);
    let top = begins.map(|state| state.velocity.norm()).fold(problem.start.velocity.norm(), f64::max);
    let size = |position: &Vector3<f64>| 1.0 + position.norm();
    let mut last = TranslationState { ..problem.start };
    let mut attitude = problem.attitude;
    for (index, arc) in arcs.iter().enumerate() {
        let begin = arc.translation(0.0).0;
        let (apart_m, jump_m_s) = ((begin.position - last.position).norm(), (begin.velocity - last.velocity).norm());
        let turned_rad = arc.attitude.angle_to(&attitude);
        let is_joined =
            apart_m <= SHARE * size(&last.position) && jump_m_s <= SHARE * top + STILL && turned_rad <= SHARE;
        if !is_joined {
            return Some(format!("arc {index} begins {apart_m:e} m, {jump_m_s:e} m/s, {turned_rad:e} rad off"));
        }
        last = arc.translation(arc.duration_s).0;
        attitude = arc.attitude_at(arc.duration_s);
    }
    let away_m = (last.position - problem.goal.position).norm();
    let speed_m_s = last.velocity.norm();
    let is_there = away_m <= problem.goal.radius_m + SHARE * size(&last.position)
        && speed_m_s <= problem.goal.speed_m_s + SHARE * top + STILL;
    (!is_there).then(|| format!("the plan ends {away_m} m from the goal at {speed_m_s} m/s"))
}

/// Which limit is passed.
fn limits(problem: &PlanningProblem, path: &ArcPath) -> Option<String> {
    let limits = &problem.limits;
    let mass_kg = problem.belief.parameters().mass;
    for (index, arc) in path.arcs().iter().enumerate() {
        for piece in 0..=PIECES {
            let time_s = arc.duration_s * f64::from(piece) / f64::from(PIECES);
            let (state, acceleration) = arc.translation(time_s);
            let rate_rad_s = arc.turn(time_s).1.abs();
            let most = |limit: f64| limit * (1.0 + SHARE) + STILL;
            for axis in 0..3 {
                let (lower, upper) = (limits.position.lower_world[axis], limits.position.upper_world[axis]);
                let hair_m = SHARE * (1.0 + lower.abs().max(upper.abs()));
                let (position, speed, force) =
                    (state.position[axis], state.velocity[axis].abs(), mass_kg * acceleration[axis].abs());
                let is_kept = (lower - hair_m..=upper + hair_m).contains(&position)
                    && speed <= most(limits.speed_m_s[axis])
                    && force <= most(limits.force_n[axis]);
                if !is_kept {
                    return Some(format!(
                        "arc {index} passes a limit along {}: {position} m, {speed} m/s, {force} N",
                        ["x", "y", "z"][axis]
                    ));
                }
            }
            // Not a number passes no limit, so the question is whether it is kept.
            let is_kept = rate_rad_s <= most(limits.rate_rad_s);
            if !is_kept {
                return Some(format!("arc {index} turns at {rate_rad_s} rad/s, the limit is {}", limits.rate_rad_s));
            }
        }
    }
    None
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scenario::ScenarioSource;
    use std::path::Path;
    use tumble_dynamics::nalgebra::UnitQuaternion;
    use tumble_planning::global::Status;
    use tumble_planning::{BodyArc, Plan};

    const SCENARIO: &str = "format = 1\nname = \"b\"\nworld = \"open\"\nduration_s = 10.0\n[body]\nmass_kg = 10.0\n\
        inertia_about_com_kg_m2 = [[0.2,0.0,0.0],[0.0,0.2,0.0],[0.0,0.0,0.2]]\n\
        [start]\nposition_m = [0.0,-1.0,0.0]\n[goal]\nposition_m = [0.0,1.0,0.0]\n\
        [plan]\nposition_lower_m = [-2.0,-2.0,-2.0]\nposition_upper_m = [2.0,2.0,2.0]\n";

    /// Accelerates, coasts and brakes, by `scale` times the force, all moved by `offset` from the second arc on.
    fn answer(scale: f64, offset: Vector3<f64>) -> GlobalAnswer {
        let push = Vector3::new(0.0, 0.01 * scale, 0.0);
        let (ramp_s, speed) = (5.0 / scale, 0.05);
        let coast_s = (2.0 - speed * ramp_s) / speed;
        let level = UnitQuaternion::identity();
        let start = TranslationState::at_rest(Vector3::new(0.0, -1.0, 0.0));
        let first = BodyArc::accelerated(ramp_s, &start, push, level);
        let mut next = first.translation(ramp_s).0;
        next.position += offset;
        let second = BodyArc::accelerated(coast_s, &next, Vector3::zeros(), level);
        let third = BodyArc::accelerated(ramp_s, &second.translation(coast_s).0, -push, level);
        let trajectory = ArcPath::new([first, second, third]);
        let cost = trajectory.duration_s();
        GlobalAnswer {
            status: Status::Feasible,
            plan: Some(Plan { trajectory, model_revision: 0 }),
            cost,
            lower_bound: cost,
            units: 1,
            history: Vec::new(),
            tree: Vec::new(),
        }
    }

    #[test]
    fn a_plan_that_breaks_its_promise_is_refused() {
        let problem = ScenarioSource::parse(Path::new("b.toml"), SCENARIO).unwrap().planning_problem().unwrap();
        let said = |answer: GlobalAnswer| {
            check(&problem, Objective::Duration, &answer).err().map(|error| (error.code(), error.to_string()))
        };
        let none = Vector3::zeros();
        assert_eq!(said(answer(1.0, none)), None);
        let good = || answer(1.0, none);
        for (wrong, says) in [
            (GlobalAnswer { lower_bound: 45.0 * (1.0 + 1e-8), ..good() }, "no plan costs less"),
            (GlobalAnswer { cost: f64::NAN, ..good() }, "no plan costs less"),
            (GlobalAnswer { cost: 46.0, ..good() }, "takes 45"),
            (answer(1.00001, none), "passes a limit along y"),
            (answer(1.0, Vector3::new(1e-5, 0.0, 0.0)), "arc 1 begins"),
        ] {
            let (code, message) = said(wrong).unwrap();
            assert!(code == "T034" && message.contains(says), "{says}: {message}");
        }
    }
}
