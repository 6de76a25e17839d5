//! A plan of the whole way as a page.

use super::plan_figure::Point;
use crate::page::chart::{Axis, Chart};
use crate::page::{Page, Tone};
use crate::scenario::ScenarioSource;
use tumble_dynamics::nalgebra::Vector3;
use tumble_planning::ArcPath;

/// Points over the duration of a path.
const POINTS: u32 = 600;

/// A moment of a path: time, s, position, m, velocity, m/s, acceleration, m/s^2, world axes.
struct Moment {
    time_s: f64,
    position: Vector3<f64>,
    velocity: Vector3<f64>,
    acceleration: Vector3<f64>,
}

/// Position, speed and force along the path; `mass_kg` is the one believed.
pub(super) fn charts(path: &ArcPath, mass_kg: f64) -> Vec<Chart> {
    let duration_s = path.duration_s();
    let moments: Vec<Moment> = (0..=POINTS)
        .filter_map(|index| {
            let time_s = duration_s * f64::from(index) / f64::from(POINTS);
            let (arc, within_s) = path.at(time_s)?;
            let (state, acceleration) = arc.translation(within_s);
            Some(Moment { time_s, position: state.position, velocity: state.velocity, acceleration })
        })
        .collect();
    let Some(start) = moments.first().map(|moment| moment.position) else { return Vec::new() };
    let three = |of: &dyn Fn(&Moment) -> Vector3<f64>| {
        let curve =
            |axis: usize| -> Vec<Point> { moments.iter().map(|moment| [moment.time_s, of(moment)[axis]]).collect() };
        [("x", curve(0)), ("y", curve(1)), ("z", curve(2))]
    };
    let over =
        |id: &str, title: &str, unit: &str, curves| Chart::of_curves(id, title, unit, Axis::time(duration_s), curves);
    vec![
        over("position", "Position from the start, world axes", "m", three(&|moment| moment.position - start)),
        over("velocity", "Velocity, world axes", "m/s", three(&|moment| moment.velocity)),
        over("force", "Force for the mass believed, world axes", "N", three(&|moment| moment.acceleration * mass_kg)),
    ]
}

/// The whole page; `views` are pictures from above and from the side.
pub(super) fn page(
    source: &ScenarioSource,
    outcome: (Tone, &str),
    story: [&str; 3],
    views: &[String; 2],
    charts: &[Chart],
    table: &str,
) -> String {
    let mut page = Page::new("plan", &source.scenario.name, outcome.0, outcome.1, story);
    page.section(
        "views",
        "From above and from the side",
        "The body along its path, what is in its way, and the tree of the search.",
    );
    page.picture("The plan from above", &views[0]);
    page.picture("The plan from the side", &views[1]);
    if !charts.is_empty() {
        page.section("motion", "Motion", "What the plan asks for over time.");
        page.charts(&[], charts);
    }
    page.folded("table", "In numbers, as the command prints them", table);
    page.finish()
}
