//! A simulated flight as a page.

use super::simulate_control;
use super::simulate_flight::{Flown, seconds, to_goal};
use crate::TumbleError;
use crate::page::chart::{Axis, Chart, Layer, ellipsoid_from_above};
use crate::page::text::number;
use crate::page::{Page, Tone};
use crate::scenario::{Flight, ScenarioSource};
use tumble_astrobee::simulator::SimulatorMeasurement;
use tumble_dynamics::ObstacleEllipsoid;
use tumble_dynamics::nalgebra::Vector3;
use tumble_lie::LieGroup;

/// Motion, wrenches, tracking, the way in the x-y plane.
pub(super) fn charts(flight: &Flight, flown: &Flown) -> Vec<Chart> {
    let curve = |value: &dyn Fn(&SimulatorMeasurement) -> f64| -> Vec<[f64; 2]> {
        flown.drawn.iter().map(|m| [m.start.time_ns as f64 * 1e-9, value(m)]).collect()
    };
    let three = |value: &dyn Fn(&SimulatorMeasurement) -> Vector3<f64>| {
        [("x", curve(&|m| value(m).x)), ("y", curve(&|m| value(m).y)), ("z", curve(&|m| value(m).z))]
    };
    let first = flown.drawn.first().map(|m| m.start.state.world_from_body).unwrap_or_default();
    let origin = first.translation.vector;
    let travelled = |m: &SimulatorMeasurement| m.start.state.world_from_body.translation.vector - origin;
    let turned = |m: &SimulatorMeasurement| -> Vector3<f64> {
        LieGroup::log(&(first.rotation.inverse() * m.start.state.world_from_body.rotation))
    };
    let over_time =
        |id: &str, title: &str, unit: &str, curves| Chart::of_curves(id, title, unit, Axis::seconds(), curves);
    let mut charts = vec![
        over_time("position", "Position from the start, world axes", "m", three(&travelled)),
        over_time("attitude", "Rotation vector from the start", "rad", three(&turned)),
    ];
    for (index, axis) in ["x", "y", "z"].into_iter().enumerate() {
        let force = [
            ("wanted", curve(&|m| m.wanted_wrench_body.force[index])),
            ("believed", curve(&|m| m.believed_wrench_body.force[index])),
            ("applied", curve(&|m| m.realized_wrench_body.force[index])),
        ];
        charts.push(over_time(&format!("force_{axis}"), &format!("Force along body {axis}"), "N", force));
    }
    for (index, axis) in ["x", "y", "z"].into_iter().enumerate() {
        let torque = [
            ("wanted", curve(&|m| m.wanted_wrench_body.torque[index])),
            ("believed", curve(&|m| m.believed_wrench_body.torque[index])),
            ("applied", curve(&|m| m.realized_wrench_body.torque[index])),
        ];
        charts.push(over_time(&format!("torque_{axis}"), &format!("Torque about body {axis}"), "N m", torque));
    }
    charts.extend(flown.tracked.charts());
    let path = flown.drawn.iter().map(|m| [travelled(m).x, travelled(m).y]).collect();
    let mut way = Chart::of_curves(
        "path_xy",
        "Way from above, world axes: y over x",
        "m",
        Axis::named("x from the start, m", ""),
        [("body origin", path)],
    )
    .with_equal_scales();
    if !flight.world.obstacles.is_empty() {
        way.legend.push(("area", "obstacle".to_owned()));
    }
    let seen = |obstacle: &ObstacleEllipsoid| {
        let mut pose = obstacle.world_from_ellipsoid;
        pose.translation.vector -= origin;
        Layer::Area("area", ellipsoid_from_above(&pose, &obstacle.semi_axes))
    };
    let obstacles = flight.world.obstacles.iter().map(seen);
    way.layers.splice(0..0, obstacles);
    charts.push(way);
    charts
}

/// The whole page.
///
/// # Errors
/// [`TumbleError`] where the propulsion cannot be described.
pub(super) fn page(
    source: &ScenarioSource,
    flight: &Flight,
    flown: &Flown,
    rows: u64,
    charts: &[Chart],
    summary: &serde_json::Value,
) -> Result<String, TumbleError> {
    let truth = flight.simulator.body();
    let freedom = if flight.place.is_planar() { "x, y and yaw" } else { "six degrees of freedom" };
    let asked = format!(
        "A flight of {} s was asked for: {}, seed {}, in {} ({freedom}), {}.",
        number(source.scenario.duration_s, 4),
        source.scenario.name,
        source.scenario.seed,
        flight.place.name(),
        source.describe_propulsion()?
    );
    let goal = to_goal(flight).map_or_else(String::new, |(distance_m, angle_rad)| {
        format!(", {} mm and {} mrad from its goal at the end", number(1e3 * distance_m, 3), number(1e3 * angle_rad, 3))
    });
    let ended = format!(
        "It flew {} m, up to {} m/s, at its limits for {} % of the time{goal}.",
        number(flown.distance_m, 3),
        number(flown.top_speed_m_s, 3),
        number(100.0 * flown.saturated as f64 / flown.periods.max(1) as f64, 2)
    );
    let sure = format!(
        "The log holds {rows} rows; what it cannot know, the body of {} kg at the end, lies in truth.toml; the force that acted was at most {} N from \
         what the robot believes it applied.",
        number(truth.mass, 5),
        number(flown.largest_force_error_n, 2)
    );
    let events = flight.simulator.events();
    let violations = events.iter().filter(|event| event.event.is_violation()).count();
    let (tone, verdict) = match (rows, violations) {
        (0, _) => (Tone::Bad, "The log is empty: no estimate arrived in time".to_owned()),
        (_, 0) => (Tone::Good, "Flown as it should be".to_owned()),
        (_, count) => (Tone::Bad, format!("Not as it should be: {count} events that must not happen")),
    };
    let mut page = Page::new("simulated flight", &source.scenario.name, tone, &verdict, [&asked, &ended, &sure]);
    page.tiles(&[
        ("Flown", format!("{} s", number(flight.duration_ns as f64 / 1e9, 4)), String::new()),
        ("Impulse of the force", format!("{} N s", number(flown.impulse_n_s, 3)), String::new()),
        ("Rows of the log", rows.to_string(), "log.csv".into()),
        ("Body at the end", format!("{} kg", number(truth.mass, 5)), "truth.toml".into()),
    ]);
    page.section(
        "motion",
        "Motion and wrench",
        "As they truly were. Wanted: by the controller; believed: by the robot; applied: by the propulsion.",
    );
    page.charts(&[], charts);
    page.section("events-heading", "Events", "What the simulator noticed.");
    if events.is_empty() {
        page.list("events", &["none".to_owned()]);
    } else {
        let row = |event: &tumble_astrobee::simulator::TimedEvent| {
            vec![format!("{:.3} s", seconds(event)), crate::page::text::escaped(&event.event.to_string())]
        };
        page.table("events", "Time and event", &["Time", "Event"], &events.iter().map(row).collect::<Vec<_>>());
    }
    if simulate_control::is_told(flight) {
        let mut told = String::new();
        flown.tracked.describe(&mut told);
        simulate_control::describe(flight, &mut told);
        page.folded("control", "The controller, in numbers", &told);
    }
    page.folded("summary", "summary.json", &format!("{summary:#}"));
    Ok(page.finish())
}
