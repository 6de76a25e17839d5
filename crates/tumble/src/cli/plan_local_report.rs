//! What a local plan is, for people and for programs.

use super::plan_blockers::named;
use super::plan_local_check::{Flown, TOUCH_M};
use super::plan_local_solve::{Quantity, Segment, Task};
use super::plan_options::{triple, xyzw};
use crate::scenario::{PlanningProblem, ScenarioSource};
use serde_json::{Value, json};
use std::fmt::Write as _;
use tumble_dynamics::nalgebra::Vector3;
use tumble_planning::ArcPath;
use tumble_planning::collision::Blocker;
use tumble_planning::local::{Criterion, Kinematics, LocalStatus};

/// Everything that is reported.
pub(super) struct Report<'a> {
    pub source: &'a ScenarioSource,
    pub task: &'a Task<'a>,
    pub segment: &'a Segment,
    pub flown: &'a Flown,
    /// Whether the target is the goal itself.
    pub is_goal: bool,
    /// Whether the budget ended the search.
    pub budget_ended: bool,
}

impl Report<'_> {
    fn problem(&self) -> &PlanningProblem {
        self.task.problem
    }

    /// Distance of the end from the target, m, and angle, rad.
    fn goal_error(&self) -> Option<(f64, f64)> {
        self.segment.motion.last().map(|last| apart(last, &self.task.target))
    }

    /// Why there is no plan and what can be done; none where there is one.
    pub fn refusal(&self) -> Option<(String, &'static str)> {
        let LocalStatus::Infeasible { violation, blocker } = self.segment.status else { return None };
        let beyond =
            if violation.is_finite() { format!("{violation:.2e} of its limit") } else { "without end".to_owned() };
        let margin_m = self.task.local.margin_m;
        let begins = |(distance_m, _, blocker): (f64, f64, Option<Blocker>)| {
            let what = named(self.problem(), blocker?);
            let reason = format!("the segment begins {distance_m:.4} m from {what}, the margin is {margin_m} m");
            (distance_m < margin_m - TOUCH_M).then_some(reason)
        };
        if let Some(reason) = self.flown.nearest.and_then(begins) {
            return Some((
                reason,
                "move `[start]` or what is in the way, or make `robot_radius_m`, `[[plan.body]]` or `plan.local.margin_m` smaller",
            ));
        }
        if let Some(reason) = self.begins_too_fast() {
            return Some((reason, "slow `[start]` down, or raise `plan.local.speed_limit_m_s`"));
        }
        Some(match blocker {
            Some(blocker) => (
                format!(
                    "no motion found keeps every limit; most in the way: {} ({beyond})",
                    named(self.problem(), blocker)
                ),
                "move what is in the way, make `robot_radius_m`, `[[plan.body]]` or `plan.local.margin_m` smaller, or allow more \
                 force, steps or `--budget`; where steps are long, a shorter `plan.local.step_s`",
            ),
            None => (
                format!(
                    "no motion found keeps every limit; a limit of inputs, speeds, rates or of the end is passed by {beyond}"
                ),
                "raise the limits in `[plan.local]`, widen `terminal_radius_m`, take more steps, or raise `--budget`",
            ),
        })
    }

    /// Along which axis it begins faster than it may be.
    fn begins_too_fast(&self) -> Option<String> {
        let limits = self.task.local.speed.speed_m_s;
        let velocity = self.task.start.velocity_world;
        let axis = (0..3).find(|axis| velocity[*axis].abs() > limits[*axis])?;
        let (name, speed, limit) = (["x", "y", "z"][axis], velocity[axis], limits[axis]);
        Some(format!(
            "the segment begins with {speed} m/s along {name}, the limit is {limit} m/s and a step is too short to brake"
        ))
    }

    /// What is printed of how the search ended.
    fn ending(&self) -> String {
        let name = status_name(&self.segment.status);
        if self.segment.status == LocalStatus::Feasible && self.budget_ended {
            return format!("{name}: the budget ended the search, more `--budget` may find a better plan");
        }
        name.to_owned()
    }

    /// `local_plan.json`: no wall time, so that the same scenario gives the same bytes.
    pub fn summary(&self) -> Value {
        let Self { source, task, segment, flown, .. } = self;
        let (local, problem) = (task.local, self.problem());
        let refused = self.refusal();
        let quantity = |quantity: &Quantity| {
            let last = quantity.last_sigma();
            json!({
                "name": quantity.name,
                "unit": quantity.unit,
                "believed": quantity.believed,
                "weight": quantity.weight,
                "prior_sigma": quantity.prior_sigma,
                "predicted_sigma": last,
                "prior_relative": quantity.relative(quantity.prior_sigma),
                "predicted_relative": last.and_then(|sigma| quantity.relative(sigma)),
                "sigmas": quantity.sigmas,
            })
        };
        let unobservable = |(direction, left): &(Vec<f64>, f64)| json!({ "direction": direction, "left": left });
        let error = self.goal_error();
        let blocker = match segment.status {
            LocalStatus::Infeasible { blocker, .. } => blocker.map(|blocker| named(problem, blocker)),
            _ => None,
        };
        json!({
            "format": 1,
            "scenario": source.scenario.name,
            "seed": source.scenario.seed,
            "world": problem.place.name(),
            "obstacle_set": source.scenario.obstacle_set,
            "status": status_name(&segment.status),
            "reason": refused.as_ref().map(|(reason, _)| reason),
            "remedy": refused.as_ref().map(|(_, remedy)| remedy),
            "blocker": blocker,
            "cost": segment.cost.map(|cost| json!({
                "total": cost.total(),
                "tracking": cost.tracking,
                "effort": cost.effort,
                "information": cost.information,
            })),
            "optimality": finite(segment.optimality),
            "violation": finite(segment.violation),
            "iterations": segment.iterations,
            "units": segment.units,
            "steps": local.steps,
            "step_s": local.step_s,
            "unknowns": local.unknowns,
            "weighting": local.weighting,
            "criterion": criterion_name(local.criterion),
            "budget_ended": self.budget_ended,
            "target": {
                "is_goal": self.is_goal,
                "position_m": triple(&task.target.world_from_body.translation.vector),
                "quaternion_xyzw": xyzw(&task.target.world_from_body.rotation),
                "velocity_m_s": triple(&task.target.velocity_world),
                "rate_rad_s": triple(&task.target.rate_body),
            },
            "target_error_m": error.map(|(away_m, _)| away_m),
            "target_error_rad": error.map(|(_, angle_rad)| angle_rad),
            "way_duration_s": task.way.duration_s(),
            "quantities": segment.quantities.iter().map(quantity).collect::<Vec<_>>(),
            "unobservable": segment.unobservable.iter().map(unobservable).collect::<Vec<_>>(),
            "nearest": flown.nearest.map(|(distance_m, time_s, blocker)| json!({
                "distance_m": finite(distance_m),
                "t_s": time_s,
                "what": blocker.map(|blocker| named(problem, blocker)),
            })),
            "limits": {
                "torque_n_m": local.wrench.limit[..3],
                "force_n": local.wrench.limit[3..],
                "half_spaces": local.wrench.half_spaces.len(),
                "speed_m_s": finite_each(&local.speed.speed_m_s),
                "rate_rad_s": finite_each(&local.speed.rate_rad_s),
                "margin_m": local.margin_m,
                "on_segments": local.on_segments,
            },
            "mass_kg": local.belief.parameters().mass,
            "model_revision": segment.model_revision,
        })
    }

    /// What is printed.
    pub fn table(&self, way_wall_s: Option<f64>) -> String {
        let Self { source, task, segment, flown, .. } = self;
        let (local, problem) = (task.local, self.problem());
        let mut text = String::new();
        let _ = writeln!(text, "local plan for {}", source.scenario.name);
        let mut line = |what: &str, value: String| {
            let _ = writeln!(text, "  {what:<16}{value}");
        };
        line("world", format!("{}: obstacles: {}", problem.place.name(), problem.world.obstacles.len()));
        line("horizon", format!("{} steps of {} s, {:.2} s", local.steps, local.step_s, local.horizon_s()));
        // How long it took is no part of a page that the same scenario makes again.
        let took = way_wall_s.map_or_else(String::new, |wall_s| format!(", {:.1} ms to find", 1e3 * wall_s));
        line("way", format!("{:.3} s{took}", task.way.duration_s()));
        let [x, y, z]: [f64; 3] = task.target.world_from_body.translation.vector.into();
        let what = if self.is_goal { "the goal" } else { "a point on the way" };
        line("target", format!("{what}, ({x:.3}, {y:.3}, {z:.3}) m"));
        line("status", self.ending());
        if let Some(cost) = &segment.cost {
            line(
                "cost",
                format!(
                    "{:.6} = tracking {:.6} + effort {:.6} + information {:.6}",
                    cost.total(),
                    cost.tracking,
                    cost.effort,
                    cost.information
                ),
            );
        }
        line("optimality", format!("{:.1e}, violation {:.1e}", segment.optimality, segment.violation));
        let took = way_wall_s.map_or_else(String::new, |_| format!("{:.1} ms, ", 1e3 * segment.wall_s));
        line("searched", format!("{took}{} iterations, {} units", segment.iterations, segment.units));
        if let Some((away_m, angle_rad)) = self.goal_error() {
            line("target missed", format!("by {away_m:.4} m, {angle_rad:.4} rad"));
        }
        if let Some((distance_m, time_s, blocker)) = flown.nearest.filter(|(distance_m, ..)| distance_m.is_finite()) {
            let what = blocker.map_or_else(|| "something".to_owned(), |blocker| named(problem, blocker));
            line("nearest", format!("{distance_m:.4} m at {time_s:.2} s: {what}"));
        }
        text += &quantities(segment);
        text
    }
}

/// Standard deviations before and after.
fn quantities(segment: &Segment) -> String {
    let mut text = String::from("  what is known of the body, one standard deviation:\n");
    let share = |share: Option<f64>| share.map_or_else(String::new, |share| format!("{:.2} %", 100.0 * share));
    for quantity in &segment.quantities {
        let (name, unit) = (quantity.name, quantity.unit);
        let _ = write!(
            text,
            "    {name:<18}{:>11.4e} {:>9}",
            quantity.prior_sigma,
            share(quantity.relative(quantity.prior_sigma))
        );
        if let Some(last) = quantity.last_sigma() {
            let _ = write!(text, " -> {last:>11.4e} {:>9}", share(quantity.relative(last)));
        }
        let _ = writeln!(text, " {unit}");
    }
    for (direction, left) in &segment.unobservable {
        let parts = direction.iter().zip(&segment.quantities).filter(|(part, _)| part.abs() >= 0.1);
        let parts: Vec<String> = parts.map(|(part, quantity)| format!("{part:+.2} {}", quantity.name)).collect();
        let _ = writeln!(text, "    nothing is learned about {} ({:.1} % is left)", parts.join(" "), 100.0 * left);
    }
    text
}

pub(super) fn status_name(status: &LocalStatus) -> &'static str {
    match status {
        LocalStatus::Converged => "converged",
        LocalStatus::Feasible => "feasible",
        LocalStatus::Infeasible { .. } => "infeasible",
        _ => "other",
    }
}

fn criterion_name(criterion: Criterion) -> &'static str {
    match criterion {
        Criterion::A => "a",
        Criterion::D => "d",
        Criterion::E => "e",
        _ => "other",
    }
}

/// Distance, m, and angle, rad.
fn apart(a: &Kinematics, b: &Kinematics) -> (f64, f64) {
    let away = a.world_from_body.translation.vector - b.world_from_body.translation.vector;
    (away.norm(), a.world_from_body.rotation.angle_to(&b.world_from_body.rotation))
}

fn finite(value: f64) -> Option<f64> {
    value.is_finite().then_some(value)
}

fn finite_each(values: &Vector3<f64>) -> [Option<f64>; 3] {
    [values.x, values.y, values.z].map(finite)
}

/// Where the way is at a time; at its end where it is over.
pub(super) fn on_the_way(way: &ArcPath, time_s: f64) -> Option<Kinematics> {
    let (arc, within_s) = way.at(time_s)?;
    let (state, _) = arc.translation(within_s);
    let (_, rate, _) = arc.turn(within_s);
    Some(Kinematics {
        world_from_body: arc.pose(within_s),
        velocity_world: state.velocity,
        rate_body: arc.axis_body.into_inner() * rate,
    })
}
