//! `tumble plan --local`: one segment of the way, planned for progress and for information.

use super::plan_budget::budget;
use super::plan_figure::{Drawn, View, along, draw};
use super::plan_local_check::{Flown, check};
use super::plan_local_page;
use super::plan_local_report::{Report, on_the_way, status_name};
use super::plan_local_solve::{Segment, Task, solve};
use super::plan_options::{PlanArgs, write_run_record};
use super::{Outcome, print};
use crate::TumbleError;
use crate::flight_log::{nanoseconds, push_numbers, push_pose, push_wrench, time_cell};
use crate::output::OutputFolder;
use crate::scenario::{LocalTable, PlanTable, PlanningProblem, ScenarioSource};
use serde_json::{Value, json};
use tumble_dynamics::nalgebra::Vector3;
use tumble_lie::{Pose, Wrench};
use tumble_planning::ArcPath;
use tumble_planning::local::Kinematics;

/// Outlines of the body along the path.
const BODIES: usize = 9;

/// Options that stand above the scenario's keys.
pub(super) fn apply(args: &PlanArgs, source: &mut ScenarioSource) -> Result<(), TumbleError> {
    let options = [
        ("--weighting", args.weighting.is_some()),
        ("--criterion", args.criterion.is_some()),
        ("--unknowns", args.unknowns.is_some()),
        ("--steps", args.steps.is_some()),
    ];
    if !args.local {
        return match options.into_iter().find(|(_, is_given)| *is_given) {
            Some((option, _)) => {
                Err(TumbleError::BadOption { message: format!("`{option}` goes with `--local` only") })
            }
            None => Ok(()),
        };
    }
    let table = source.scenario.plan.get_or_insert_with(PlanTable::default);
    let table = table.local.get_or_insert_with(LocalTable::default);
    table.weighting = args.weighting.or(table.weighting);
    table.criterion = args.criterion.or(table.criterion);
    table.unknowns = args.unknowns.or(table.unknowns);
    table.steps = args.steps.or(table.steps);
    Ok(())
}

/// Plans the segment at the start of a way, and writes and prints what comes out.
///
/// # Errors
/// [`TumbleError`] for bad input.
pub(super) fn run(
    args: &PlanArgs,
    source: &ScenarioSource,
    problem: &PlanningProblem,
    way: &ArcPath,
    way_wall_s: f64,
    folder: OutputFolder,
) -> Result<Outcome, TumbleError> {
    let local = source.local_problem(problem)?;
    let start = Kinematics {
        world_from_body: Pose::from_parts(problem.start.position.into(), problem.attitude),
        velocity_world: problem.start.velocity,
        rate_body: Vector3::zeros(),
    };
    let horizon_s = local.horizon_s();
    let is_goal = way.duration_s() <= horizon_s;
    let target = if is_goal { goal(problem, way) } else { on_the_way(way, horizon_s).unwrap_or(start) };
    let task =
        Task { problem, local: &local, start, target, way, mission_s: source.scenario.duration_s.max(horizon_s) };
    let mut budget = budget(args.budget, args.time_limit)?;
    let segment = solve(&task, &mut budget)?;
    let flown = check(&task, &segment)?;

    let budget_ended = budget.is_over;
    let report = Report { source, task: &task, segment: &segment, flown: &flown, is_goal, budget_ended };
    let summary = report.summary();
    write_files(&folder, &report, &summary, way_wall_s)?;
    let place = folder.finish()?;
    let told = if args.json {
        let mut printed = summary;
        printed["wall_s"] = segment.wall_s.into();
        printed["way_wall_s"] = way_wall_s.into();
        printed["folder"] = place.display().to_string().into();
        print(&format!("{printed}\n"))
    } else {
        print(&report.table(Some(way_wall_s)))
    };
    let refused = report.refusal();
    if let Some((reason, remedy)) = &refused {
        tell_line!("no plan: {reason}\n  remedy: {remedy}");
    }
    tell_line!("wrote {}", place.display());
    told?;
    Ok(if refused.is_some() { Outcome::NotAchieved } else { Outcome::Achieved })
}

/// The goal at rest, with the attitude asked for, or else the one in which the way ends.
fn goal(problem: &PlanningProblem, way: &ArcPath) -> Kinematics {
    let end = on_the_way(way, way.duration_s()).map_or(problem.attitude, |end| end.world_from_body.rotation);
    Kinematics {
        world_from_body: Pose::from_parts(problem.goal.position.into(), problem.goal.attitude.unwrap_or(end)),
        velocity_world: Vector3::zeros(),
        rate_body: Vector3::zeros(),
    }
}

fn write_files(
    folder: &OutputFolder,
    report: &Report<'_>,
    summary: &Value,
    way_wall_s: f64,
) -> Result<(), TumbleError> {
    let Report { source, task, segment, flown, .. } = report;
    folder.write("scenario.toml", &source.to_toml()?)?;
    folder.write("local_plan.json", &format!("{summary:#}\n"))?;
    let what = match &segment.cost {
        Some(cost) => format!("{}, cost {:.4}", status_name(&segment.status), cost.total()),
        None => "there is no plan".to_owned(),
    };
    let title = format!("{}, {:.1} s of the way: {what}", source.scenario.name, task.local.horizon_s());
    let views = views(&title, task, segment, flown);
    folder.write("local_top.svg", &views[0])?;
    folder.write("local_side.svg", &views[1])?;
    folder.write("report.html", &plan_local_page::page(report, &views, &report.table(None)))?;
    if !segment.motion.is_empty() {
        folder.write("local_plan.csv", &rows(segment))?;
    }
    let timings = json!({ "format": 1, "way_wall_s": way_wall_s, "wall_s": segment.wall_s });
    folder.write("timings.json", &format!("{timings:#}\n"))?;
    write_run_record(folder, source)
}

/// From above and from the side.
fn views(title: &str, task: &Task<'_>, segment: &Segment, flown: &Flown) -> [String; 2] {
    let nodes = segment.motion.len();
    let spread = (0..BODIES).filter_map(|index| segment.motion.get(index * nodes.saturating_sub(1) / (BODIES - 1)));
    let poses: Vec<Pose<f64>> = spread.map(|motion| motion.world_from_body).collect();
    let drawn = Drawn {
        title,
        problem: task.problem,
        tree: &[],
        way: &along(task.way),
        path: &flown.positions,
        poses: &poses,
        end_s: segment.duration_s(),
        target: task.target.world_from_body.translation.vector,
    };
    [View::Top, View::Side].map(|view| draw(&drawn, view))
}

/// A row for each node: motion, the wrench from then on (in the last row the one before), standard deviations.
fn rows(segment: &Segment) -> String {
    let mut text =
        String::from("t_s,p_x,p_y,p_z,q_x,q_y,q_z,q_w,v_x,v_y,v_z,w_x,w_y,w_z,f_x,f_y,f_z,tau_x,tau_y,tau_z");
    for quantity in &segment.quantities {
        text.push_str(",sigma_");
        text.push_str(&quantity.name.replace(' ', "_"));
    }
    text.push('\n');
    for (node, motion) in segment.motion.iter().enumerate() {
        text += &time_cell(nanoseconds(segment.time_s(node)));
        push_pose(&mut text, &motion.world_from_body);
        push_numbers(&mut text, motion.velocity_world.iter().chain(&motion.rate_body));
        let held = segment.inputs.get(node).or(segment.inputs.last()).copied().unwrap_or_else(Wrench::zero);
        push_wrench(&mut text, &held);
        push_numbers(&mut text, segment.quantities.iter().filter_map(|quantity| quantity.sigmas.get(node)));
        text.push('\n');
    }
    text
}
