//! `tumble plan`: a way from start to goal, and how far from the best it can be.

use super::plan_blockers::{collision_world, listed, named};
use super::plan_budget::{WatchedBudget, budget};
use super::plan_check::check;
use super::plan_csv::{Rows, rows};
use super::plan_figure::{Drawn, View, along, draw, poses};
use super::plan_options::{ObjectiveName, triple, write_run_record, xyzw};
use super::said::progress;
use super::{Outcome, plan_local, plan_page, print};
use crate::TumbleError;
use crate::mission::planners;
use crate::output::{OutputFolder, unused};
use crate::page::Tone;
use crate::page::text::number;
use crate::scenario::{PlanningProblem, ScenarioSource};
use clap::ValueEnum;
use serde_json::{Value, json};
use std::fmt::Write as _;
use std::path::Path;
use std::time::Instant;
use tumble_astrobee::simulator::planar_part;
use tumble_dynamics::World;
use tumble_dynamics::nalgebra::Vector3;
use tumble_formats::Robots;
use tumble_planning::collision::Blocker;
use tumble_planning::global::{GlobalAnswer, GlobalPlanner, GlobalRequest, Objective, Obstruction, Status, Until};
use tumble_planning::{ArcPath, BodyArc, PlanningError};

pub use super::plan_options::PlanArgs;

/// Pieces of an arc over which its way and impulse are added up.
const PIECES: usize = 64;

/// Wall times, s.
struct Times {
    total_s: f64,
    first_s: Option<f64>,
}

/// What a plan amounts to.
struct Measures {
    duration_s: f64,
    impulse_n_s: f64,
    length_m: f64,
    top_speed_m_s: f64,
    turned_rad: f64,
}

/// Runs the command.
///
/// # Errors
/// [`TumbleError`] for bad input.
pub fn run(args: &PlanArgs, robots: &Robots) -> Result<Outcome, TumbleError> {
    let mut source = ScenarioSource::find(&args.scenario)?.among(robots);
    if let Some(seed) = args.seed {
        source.scenario.seed = seed;
    }
    if let Some(set) = args.obstacle_set {
        source.scenario.obstacle_set = Some(set);
    }
    let mut budget = budget(args.budget, args.time_limit)?;
    plan_local::apply(args, &mut source)?;
    let problem = source.planning_problem()?;
    if args.local {
        source.local_problem(&problem)?;
    }
    let (name, seed) = (source.scenario.name.clone(), source.scenario.seed);
    let place = match &args.out {
        Some(path) => path.clone(),
        None => unused(
            &Path::new("tumble-out").join(format!("{}-{name}-{seed}", if args.local { "local-plan" } else { "plan" })),
        ),
    };
    let folder = OutputFolder::create(&place, args.force)?;

    progress("planning ...");
    let answer = solve(args, &problem, seed, &mut budget);
    progress("");
    let answer = answer?;
    let times = Times {
        total_s: budget.clock.elapsed().as_secs_f64(),
        first_s: answer.history.first().and_then(|first| budget.time_of(first.units)),
    };

    check(&problem, objective(args), &answer)?;
    if let (true, Some(way)) = (args.local, path_of(&answer)) {
        return plan_local::run(args, &source, &problem, way, times.total_s, folder);
    }
    let rows = path_of(&answer).map(|path| plan_rows(&problem, path));
    let summary = summary(args, &source, &problem, &answer, rows.as_ref());
    folder.write("plan.json", &format!("{summary:#}\n"))?;
    write_files(args, &folder, &source, &problem, &answer, rows.as_ref(), &times)?;
    let place = folder.finish()?;
    let told = if args.json {
        let mut printed = summary;
        printed["first_plan_wall_s"] = times.first_s.into();
        printed["wall_s"] = times.total_s.into();
        printed["folder"] = place.display().to_string().into();
        print(&format!("{printed}\n"))
    } else {
        print(&table(args, &source, &problem, &answer, rows.as_ref(), Some(&times)))
    };
    for warning in rows.iter().flat_map(|rows| torque_warnings(&problem, rows)) {
        tell_line!("{warning}");
    }
    let refused = refusal(args, &problem, &answer);
    if let Some((reason, remedy)) = &refused {
        tell_line!("no plan: {reason}\n  remedy: {remedy}");
    }
    tell_line!("wrote {}", place.display());
    told?;
    Ok(if refused.is_some() { Outcome::NotAchieved } else { Outcome::Achieved })
}

fn objective(args: &PlanArgs) -> Objective {
    match args.objective {
        ObjectiveName::Duration => Objective::Duration,
        ObjectiveName::Impulse => Objective::Impulse,
    }
}

fn plan_rows(problem: &PlanningProblem, path: &ArcPath) -> Rows {
    let body = problem.belief.parameters();
    let body = if problem.place.is_planar() { planar_part(body) } else { *body };
    let start = BodyArc::accelerated(0.0, &problem.start, Vector3::zeros(), problem.attitude);
    rows(path, &start, &body)
}

/// The planner limits the torque of the turn; what the force needs where the centre of mass is off the origin comes on top.
fn torque_warnings(problem: &PlanningProblem, rows: &Rows) -> Vec<String> {
    let both = rows.largest_torque_n_m.iter().zip(&problem.limits.torque_n_m).zip(["x", "y", "z"]);
    let beyond = both.filter(|((torque, limit), _)| **torque > **limit * (1.0 + 1e-9) + 1e-12);
    let warning = |((torque, limit), axis): ((&f64, &f64), &str)| {
        format!(
            "warning: the torque about {axis} reaches {torque:.6} N m, `torque_limit_n_m` is {limit}: it holds for the turn, not for centre \
             of mass x force\n  remedy: lower `plan.force_limit_n`"
        )
    };
    beyond.map(warning).collect()
}

fn solve(
    args: &PlanArgs,
    problem: &PlanningProblem,
    seed: u64,
    budget: &mut WatchedBudget,
) -> Result<GlobalAnswer, PlanningError> {
    let world = collision_world(problem)?;
    let request = GlobalRequest {
        world: &world,
        body: &problem.body,
        start: problem.start,
        attitude: problem.attitude,
        start_s: 0.0,
        goal: problem.goal,
        limits: problem.limits,
        belief: &problem.belief,
        objective: objective(args),
        margin_m: problem.margin_m,
        until: if args.first { Until::FirstPlan } else { Until::BudgetSpent },
        seed,
    };
    budget.clock = Instant::now();
    planners().make(&args.planner, problem)?.plan(&request, budget)
}

fn path_of(answer: &GlobalAnswer) -> Option<&ArcPath> {
    answer.plan.as_ref().map(|plan| &plan.trajectory)
}

fn measures(path: &ArcPath, mass_kg: f64) -> Measures {
    let mut found = Measures {
        duration_s: path.duration_s(),
        impulse_n_s: 0.0,
        length_m: 0.0,
        top_speed_m_s: 0.0,
        turned_rad: 0.0,
    };
    for arc in path.arcs() {
        let at = |piece: usize| arc.translation(arc.duration_s * piece as f64 / PIECES as f64).0;
        for piece in 0..PIECES {
            let (from, to) = (at(piece), at(piece + 1));
            found.length_m += (to.position - from.position).norm();
            found.impulse_n_s += mass_kg * (to.velocity - from.velocity).abs().sum();
            found.top_speed_m_s = found.top_speed_m_s.max(from.velocity.norm()).max(to.velocity.norm());
        }
        found.turned_rad += arc.turn(arc.duration_s).0.abs();
    }
    found
}

/// How far the cost may be from the least there is, as a share of the cost.
fn gap(answer: &GlobalAnswer) -> Option<f64> {
    let share = |cost: f64| if cost > 0.0 { ((cost - answer.lower_bound) / cost).max(0.0) } else { 0.0 };
    answer.plan.as_ref().map(|_| share(answer.cost))
}

/// Why there is no plan, and what can be done; `None` where there is one.
fn refusal(args: &PlanArgs, problem: &PlanningProblem, answer: &GlobalAnswer) -> Option<(String, &'static str)> {
    Some(match &answer.status {
        Status::Optimal | Status::Feasible => return None,
        Status::BudgetSpent(blockers) => (
            format!("none was found in {} units; most in the way: {}", answer.units, listed(problem, blockers)),
            if args.planner == "thesis-rrt" {
                "another `--seed` or `--planner flight`: the thesis's tree ends after 10000 iterations (70000 units), and a larger \
                 budget changes nothing; that there is no plan is not proven"
            } else {
                "more `--budget` or `--time-limit`, another `--seed`; that there is none is not proven"
            },
        ),
        Status::Infeasible(obstruction) => match obstruction {
            Obstruction::StartBlocked { blocker, clearance_m } => (
                format!("the robot starts in {} ({clearance_m:.3} m from it)", named(problem, *blocker)),
                "move `[start]` or what is in the way, or make `robot_radius_m`, `[[plan.body]]` or `plan.margin_m` smaller",
            ),
            Obstruction::GoalBlocked { blocker, clearance_m } => (
                format!("the goal lies in {} ({clearance_m:.3} m from it)", named(problem, *blocker)),
                "move `[goal]` or what is in the way, widen `plan.goal_radius_m`, or make `robot_radius_m`, `[[plan.body]]` or \
                 `plan.margin_m` smaller",
            ),
            Obstruction::Enclosed { blockers } => (
                format!("no way leads to the goal; it is walled off by: {}", listed(problem, blockers)),
                "take one of these away, widen `plan.position_lower_m` and `plan.position_upper_m`, or make the body or \
                 `plan.margin_m` smaller",
            ),
            Obstruction::OutsideLimits { .. } => {
                (obstruction.to_string(), "correct `[start]`, `[goal]` or the limit in `[plan]`")
            }
            Obstruction::LimitTooSmall { .. } => (obstruction.to_string(), "raise this limit in `[plan]`"),
            other => (other.to_string(), "correct `[plan]`, `[start]` or `[goal]`"),
        },
        other => (other.to_string(), "correct `[plan]`, `[start]` or `[goal]`"),
    })
}

fn status_name(status: &Status) -> &'static str {
    match status {
        Status::Optimal => "optimal",
        Status::Feasible => "feasible",
        Status::Infeasible(_) => "infeasible",
        Status::BudgetSpent(_) => "budget-spent",
        _ => "other",
    }
}

/// Everyone who stands in the way.
fn blockers(answer: &GlobalAnswer) -> Vec<Blocker> {
    match &answer.status {
        Status::BudgetSpent(blockers) | Status::Infeasible(Obstruction::Enclosed { blockers }) => blockers.clone(),
        Status::Infeasible(Obstruction::StartBlocked { blocker, .. } | Obstruction::GoalBlocked { blocker, .. }) => {
            vec![*blocker]
        }
        _ => Vec::new(),
    }
}

fn finite(value: f64) -> Option<f64> {
    // Minus zero is zero.
    value.is_finite().then_some(value + 0.0)
}

fn value_name(value: &impl ValueEnum) -> String {
    value.to_possible_value().map(|value| value.get_name().to_owned()).unwrap_or_default()
}

/// `plan.json`: no wall time, so that the same seed gives the same bytes.
fn summary(
    args: &PlanArgs,
    source: &ScenarioSource,
    problem: &PlanningProblem,
    answer: &GlobalAnswer,
    rows: Option<&Rows>,
) -> Value {
    let path = path_of(answer);
    let mass_kg = problem.belief.parameters().mass;
    let measured = path.map(|path| measures(path, mass_kg));
    let mut begin_s = 0.0;
    let arcs: Option<Vec<Value>> = path.map(|path| {
        let arc = |arc: &BodyArc| {
            let start_s = begin_s;
            begin_s += arc.duration_s;
            json!({
                "start_s": start_s,
                "duration_s": arc.duration_s,
                "position_m": arc.position.map(|coefficient| triple(&coefficient)),
                "quaternion_xyzw": xyzw(&arc.attitude),
                "axis_body": triple(&arc.axis_body),
                "angle_rad": arc.angle,
            })
        };
        path.arcs().iter().map(arc).collect()
    });
    let refused = refusal(args, problem, answer);
    json!({
        "format": 1,
        "scenario": source.scenario.name,
        "seed": source.scenario.seed,
        "world": problem.place.name(),
        "obstacle_set": source.scenario.obstacle_set,
        "planner": args.planner,
        "objective": value_name(&args.objective),
        "status": status_name(&answer.status),
        "reason": refused.as_ref().map(|(reason, _)| reason),
        "remedy": refused.as_ref().map(|(_, remedy)| remedy),
        "blockers": blockers(answer).iter().map(|blocker| named(problem, *blocker)).collect::<Vec<_>>(),
        "cost": finite(answer.cost),
        "lower_bound": finite(answer.lower_bound),
        "gap": gap(answer),
        "duration_s": measured.as_ref().map(|m| m.duration_s),
        "impulse_n_s": measured.as_ref().map(|m| m.impulse_n_s),
        "length_m": measured.as_ref().map(|m| m.length_m),
        "top_speed_m_s": measured.as_ref().map(|m| m.top_speed_m_s),
        "turned_rad": measured.as_ref().map(|m| m.turned_rad),
        "largest_force_n": rows.map(|rows| triple(&rows.largest_force_n)),
        "largest_torque_n_m": rows.map(|rows| triple(&rows.largest_torque_n_m)),
        "row_step_s": rows.map(|rows| rows.step_s),
        "mass_kg": mass_kg,
        "model_revision": answer.plan.as_ref().map(|plan| plan.model_revision),
        "margin_m": problem.margin_m,
        "goal": {
            "position_m": triple(&problem.goal.position),
            "radius_m": problem.goal.radius_m,
            "speed_m_s": problem.goal.speed_m_s,
            "quaternion_xyzw": problem.goal.attitude.as_ref().map(xyzw),
        },
        "limits": {
            "position_lower_m": triple(&problem.limits.position.lower_world),
            "position_upper_m": triple(&problem.limits.position.upper_world),
            "speed_m_s": triple(&problem.limits.speed_m_s),
            "force_n": triple(&problem.limits.force_n),
            "torque_n_m": triple(&problem.limits.torque_n_m),
            "rate_rad_s": problem.limits.rate_rad_s,
        },
        "units": answer.units,
        "history": answer.history.iter().map(|step| json!({ "units": step.units, "cost": step.cost })).collect::<Vec<_>>(),
        "tree_edges": answer.tree.len(),
        "arcs": arcs,
    })
}

fn write_files(
    args: &PlanArgs,
    folder: &OutputFolder,
    source: &ScenarioSource,
    problem: &PlanningProblem,
    answer: &GlobalAnswer,
    rows: Option<&Rows>,
    times: &Times,
) -> Result<(), TumbleError> {
    folder.write("scenario.toml", &source.to_toml()?)?;
    if let Some(rows) = rows {
        folder.write("plan.csv", &rows.text)?;
    }
    let title = format!("{}, seed {}: {}", source.scenario.name, source.scenario.seed, in_short(answer));
    let path = path_of(answer);
    let drawn = Drawn {
        title: &title,
        problem,
        tree: &answer.tree,
        way: &[],
        path: &path.map(along).unwrap_or_default(),
        poses: &path.map(poses).unwrap_or_default(),
        end_s: path.map_or(0.0, ArcPath::duration_s),
        target: problem.goal.position,
    };
    let views = [View::Top, View::Side].map(|view| draw(&drawn, view));
    folder.write("plan_top.svg", &views[0])?;
    folder.write("plan_side.svg", &views[1])?;
    let charts = path.map_or_else(Vec::new, |path| plan_page::charts(path, problem.belief.parameters().mass));
    let story = story(args, source, problem, answer);
    let tone = match &answer.status {
        Status::Optimal | Status::Feasible => Tone::Good,
        Status::BudgetSpent(_) => Tone::Doubted,
        _ => Tone::Bad,
    };
    let verdict = match (&answer.status, path) {
        (Status::Optimal, Some(_)) => "A plan, and none is better",
        (_, Some(_)) => "A plan, every edge checked all along",
        (Status::Infeasible(_), None) => "There is no plan, which is proved",
        (_, None) => "No plan was found; that there is none is not proved",
    };
    let shown = table(args, source, problem, answer, rows, None);
    let page = plan_page::page(source, (tone, verdict), story.each_ref().map(String::as_str), &views, &charts, &shown);
    folder.write("report.html", &page)?;
    let timings = json!({ "format": 1, "first_plan_wall_s": times.first_s, "wall_s": times.total_s });
    folder.write("timings.json", &format!("{timings:#}\n"))?;
    write_run_record(folder, source)
}

/// What was asked, how it ended, how sure that is.
fn story(args: &PlanArgs, source: &ScenarioSource, problem: &PlanningProblem, answer: &GlobalAnswer) -> [String; 3] {
    let unit = match args.objective {
        ObjectiveName::Duration => "s",
        ObjectiveName::Impulse => "N s",
    };
    let mass_kg = problem.belief.parameters().mass;
    let asked = format!(
        "A way of least {} was asked for, over {} m, past {} obstacles, for a robot that is believed to weigh {} kg (seed {}).",
        value_name(&args.objective),
        number((problem.goal.position - problem.start.position).norm(), 3),
        problem.world.obstacles.len(),
        number(mass_kg, 4),
        source.scenario.seed
    );
    let ended = match (refusal(args, problem, answer), path_of(answer)) {
        (Some((reason, remedy)), _) => format!("There is no plan to show: {reason}. Remedy: {remedy}."),
        (None, Some(path)) => {
            let found = measures(path, mass_kg);
            format!(
                "The plan takes {} s over {} m, up to {} m/s, in {} arcs, each checked against all obstacles all along.",
                number(found.duration_s, 4),
                number(found.length_m, 3),
                number(found.top_speed_m_s, 3),
                path.arcs().len()
            )
        }
        (None, None) => String::new(),
    };
    let sure = match (finite(answer.lower_bound), gap(answer)) {
        (Some(bound), Some(gap)) => format!(
            "No plan costs less than {} {unit}: this one costs {} {unit}, at most {} % more than the best there is.",
            number(bound, 4),
            number(answer.cost, 4),
            number(100.0 * gap, 2)
        ),
        (Some(bound), None) => format!("No plan costs less than {} {unit}.", number(bound, 4)),
        _ => "Nothing is known of what a plan costs at least.".to_owned(),
    };
    [asked, ended, sure]
}

fn in_short(answer: &GlobalAnswer) -> String {
    match (&answer.status, path_of(answer)) {
        (Status::Infeasible(_), _) => "there is no plan".to_owned(),
        (_, None) => "no plan was found".to_owned(),
        (_, Some(path)) => format!("{:.1} s", path.duration_s()),
    }
}

fn table(
    args: &PlanArgs,
    source: &ScenarioSource,
    problem: &PlanningProblem,
    answer: &GlobalAnswer,
    rows: Option<&Rows>,
    times: Option<&Times>,
) -> String {
    let mut text = String::new();
    let _ = writeln!(text, "plan for {}, seed {}", source.scenario.name, source.scenario.seed);
    let mut line = |what: &str, value: String| {
        let _ = writeln!(text, "  {what:<16}{value}");
    };
    let World { keep_in, keep_out, obstacles } = &problem.world;
    let set = source.scenario.obstacle_set.map_or_else(String::new, |set| format!(", obstacle set {set}"));
    let boxes = format!("{} keep-in and {} keep-out boxes", keep_in.len(), keep_out.len());
    line("world", format!("{}{set}: obstacles: {}, {boxes}", problem.place.name(), obstacles.len()));
    let mass_kg = problem.belief.parameters().mass;
    line(
        "robot",
        format!("{mass_kg:.3} kg, ellipsoids: {}, margin {} m", problem.body.parts().len(), problem.margin_m),
    );
    let unit = match args.objective {
        ObjectiveName::Duration => "s",
        ObjectiveName::Impulse => "N s",
    };
    let bound = finite(answer.lower_bound).map(|bound| format!("{bound:.3} {unit}"));
    if let Some(path) = path_of(answer) {
        let found = measures(path, mass_kg);
        let is_optimal = answer.status == Status::Optimal;
        line("plan", format!("{:.3} s in {} arcs, every edge checked all along", found.duration_s, path.arcs().len()));
        line(
            "way",
            format!(
                "{:.3} m, up to {:.3} m/s, turned by {:.3} rad",
                found.length_m, found.top_speed_m_s, found.turned_rad
            ),
        );
        line("impulse", format!("{:.3} N s", found.impulse_n_s));
        let ended = if is_optimal { "; no plan is better" } else { "" };
        line("cost", format!("{:.3} {unit} ({}){ended}", answer.cost + 0.0, value_name(&args.objective)));
        line("lower bound", format!("{}: no plan costs less", bound.unwrap_or_default()));
        line("gap", format!("{:.2} % of the cost at most", 100.0 * gap(answer).unwrap_or(0.0)));
        if let (Some(first), Some(first_s)) = (answer.history.first(), times.and_then(|times| times.first_s)) {
            line(
                "first plan",
                format!("{:.3} {unit} after {:.2} ms, {} units", first.cost, 1e3 * first_s, first.units),
            );
        }
    } else {
        line(
            "plan",
            if matches!(answer.status, Status::Infeasible(_)) { "there is none" } else { "none was found" }.to_owned(),
        );
        if let Some(bound) = bound {
            line("lower bound", format!("{bound}: no plan costs less"));
        }
    }
    // How long it took is no part of a page that the same seed makes again.
    let took = times.map_or_else(String::new, |times| format!("{:.1} ms, ", 1e3 * times.total_s));
    line("searched", format!("{took}{} units, {} edges in the tree", answer.units, answer.tree.len()));
    if let Some(rows) = rows {
        let [force, torque] =
            [rows.largest_force_n, rows.largest_torque_n_m].map(|v| format!("{:.4}, {:.4}, {:.4}", v.x, v.y, v.z));
        line("largest force", format!("({force}) N, body axes"));
        line("largest torque", format!("({torque}) N m, body axes, about the origin"));
        line("rows", format!("every {} s and at the ends of arcs (plan.csv)", rows.step_s));
    }
    text
}
