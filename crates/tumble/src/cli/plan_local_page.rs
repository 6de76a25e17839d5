//! A local plan as a page.

use super::plan_local_report::{Report, status_name};
use super::plan_local_solve::Segment;
use crate::page::chart::{Axis, Chart, Layer};
use crate::page::text::number;
use crate::page::{Page, Tone};
use tumble_dynamics::nalgebra::Vector3;
use tumble_planning::local::LocalStatus;

/// Position, velocity, turn and rate over time.
fn motion(segment: &Segment) -> Vec<Chart> {
    let axes = |id: &str, title: &str, unit: &str, of: &dyn Fn(usize) -> Vector3<f64>| {
        let curve =
            |axis: usize| (0..segment.motion.len()).map(|node| [segment.time_s(node), of(node)[axis]]).collect();
        let curves = [("x", curve(0)), ("y", curve(1)), ("z", curve(2))];
        Chart::of_curves(id, title, unit, Axis::time(segment.duration_s()), curves)
    };
    let Some(first) = segment.motion.first().map(|motion| motion.world_from_body) else { return Vec::new() };
    let pose = |node: usize| segment.motion.get(node).map_or(first, |motion| motion.world_from_body);
    let moved = |node: usize| pose(node).translation.vector - first.translation.vector;
    let turned = |node: usize| (first.rotation.inverse() * pose(node).rotation).scaled_axis();
    let velocity = |node: usize| segment.motion.get(node).map_or_else(Vector3::zeros, |motion| motion.velocity_world);
    let rate = |node: usize| segment.motion.get(node).map_or_else(Vector3::zeros, |motion| motion.rate_body);
    vec![
        axes("position", "Position from the start, world axes", "m", &moved),
        axes("velocity", "Velocity, world axes", "m/s", &velocity),
        axes("turn", "Turn from the start", "rad", &turned),
        axes("rate", "Rate, body axes", "rad/s", &rate),
    ]
}

/// Forces and torques with their limits.
fn inputs(segment: &Segment, limit: &[f64; 6]) -> Vec<Chart> {
    let names = [("torque", "x"), ("torque", "y"), ("torque", "z"), ("force", "x"), ("force", "y"), ("force", "z")];
    let chart = |(index, (what, axis)): (usize, (&str, &str))| {
        let step = |(step, wrench): (usize, &tumble_lie::Wrench<f64>)| {
            let value = wrench.to_vector()[index];
            [[segment.time_s(step), value], [segment.time_s(step + 1), value]]
        };
        let points = segment.inputs.iter().enumerate().flat_map(step).collect();
        let (title, unit) = (
            if what == "force" { format!("Force {axis}") } else { format!("Torque {axis}") },
            if what == "force" { "N" } else { "N m" },
        );
        Chart::of_curves(
            &format!("{what}_{axis}"),
            &title,
            unit,
            Axis::time(segment.duration_s()),
            [("planned", points)],
        )
        .within(limit.get(index).copied(), "limit")
    };
    let mut charts: Vec<Chart> = names.into_iter().enumerate().map(chart).collect();
    charts.rotate_left(3);
    charts
}

/// Standard deviation of each quantity, and what it was before.
fn sigmas(segment: &Segment) -> Vec<Chart> {
    let chart = |(index, quantity): (usize, &super::plan_local_solve::Quantity)| {
        let points = quantity.sigmas.iter().enumerate().map(|(node, sigma)| [segment.time_s(node), *sigma]).collect();
        let mut chart = Chart::of_curves(
            &format!("sigma-{index}"),
            &format!("σ of {}", quantity.name),
            &quantity.unit.replace("^2", "²"),
            Axis::time(segment.duration_s()),
            [("predicted", points)],
        );
        chart.layers.push(Layer::Level("truth", quantity.prior_sigma));
        chart.legend.push(("truth", "before".to_owned()));
        chart
    };
    segment.quantities.iter().enumerate().map(chart).collect()
}

/// The whole page; `views` are pictures from above and from the side.
pub(super) fn page(report: &Report<'_>, views: &[String; 2], table: &str) -> String {
    let Report { source, task, segment, .. } = report;
    let asked = format!(
        "The next {} s of the way of {} were asked for, with {} steps, towards {}.",
        number(task.local.horizon_s(), 3),
        source.scenario.name,
        task.local.steps,
        if report.is_goal { "the goal" } else { "a point on the way" }
    );
    let ended = match (report.refusal(), &segment.cost) {
        (Some((reason, remedy)), _) => format!("There is no plan: {reason}. Remedy: {remedy}."),
        (None, Some(cost)) => format!(
            "The search ended {} after {} iterations with a cost of {} (tracking {}, effort {}, information {}).",
            status_name(&segment.status),
            segment.iterations,
            number(cost.total(), 4),
            number(cost.tracking, 3),
            number(cost.effort, 3),
            number(cost.information, 3)
        ),
        (None, None) => format!("The search ended {}.", status_name(&segment.status)),
    };
    let learnt: Vec<String> = segment
        .quantities
        .iter()
        .filter_map(|quantity| {
            let last = quantity.last_sigma()?;
            let unit = if quantity.unit.is_empty() {
                String::new()
            } else {
                format!(" {}", quantity.unit.replace("^2", "²"))
            };
            Some(format!("{} from {} to {}{unit}", quantity.name, number(quantity.prior_sigma, 2), number(last, 2)))
        })
        .collect();
    let sure = if learnt.is_empty() {
        "It promises to teach nothing.".to_owned()
    } else {
        format!("It promises these standard deviations: {}.", learnt.join(", "))
    };
    let (tone, verdict) = match segment.status {
        LocalStatus::Infeasible { .. } => (Tone::Bad, "There is no plan"),
        _ if report.budget_ended => (Tone::Doubted, "A plan; the budget ended the search"),
        _ => (Tone::Good, "A plan inside all limits"),
    };
    let mut page = Page::new("local plan", &source.scenario.name, tone, verdict, [&asked, &ended, &sure]);
    page.section("views", "From above and from the side", "The way is dashed.");
    page.picture("The plan from above", &views[0]);
    page.picture("The plan from the side", &views[1]);
    if !segment.motion.is_empty() {
        page.section(
            "sigmas",
            "What it will teach",
            "Predicted standard deviation of each quantity, and what it was before.",
        );
        page.charts(&[], &sigmas(segment));
        page.section("motion", "Motion", "Where the body goes, how fast, and how it turns.");
        page.charts(&[], &motion(segment));
        page.section("inputs", "Force and torque", "Body axes, about the body origin, with their limits.");
        page.charts(&[], &inputs(segment, &task.local.wrench.limit));
    }
    page.folded("table", "In numbers, as the command prints them", table);
    page.finish()
}
