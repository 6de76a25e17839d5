//! The plots of a mission: what was learnt, what it was worth, how well was flown, with what.

use crate::mission::{DrawnEllipsoid, MissionRecord, Series};
use crate::page::chart::{Axis, COLORS, Chart, Layer, ellipsoid_from_above, legend, steps};
use crate::page::text::{coordinate, escaped};
use std::fmt::Write as _;
use tumble_dynamics::nalgebra::{Quaternion, UnitQuaternion, Vector3};
use tumble_lie::Pose;

const AXES: [&str; 3] = ["x", "y", "z"];

/// A column of the series against time.
fn column<T>(series: &Series, values: &[T], value: impl Fn(&T) -> f64) -> Vec<[f64; 2]> {
    series.t_s.iter().zip(values).map(|(&t, row)| [t, value(row)]).collect()
}

/// One entry of a row.
fn at<const N: usize>(row: &[f64; N], index: usize) -> f64 {
    row.get(index).copied().unwrap_or(f64::NAN)
}

/// The name of a parameter in words.
pub(super) fn title(name: &str) -> String {
    let axes = |prefix: &str| name.strip_prefix(prefix).map(str::to_owned);
    if name == "mass" {
        "Mass".into()
    } else if let Some(axis) = axes("com_") {
        format!("Centre of mass {axis}")
    } else if let Some(entry) = axes("inertia_") {
        format!("Inertia {entry}")
    } else {
        name.to_owned()
    }
}

/// A unit in print.
pub(super) fn unit(name: &str) -> String {
    name.replace("^2", "²")
}

fn section(page: &mut String, id: &str, heading: &str, about: &str, keys: &[(&'static str, &str)], plots: &[Chart]) {
    let _ = writeln!(
        page,
        "<section aria-labelledby=\"{id}\"><h2 id=\"{id}\">{heading}</h2><p class=\"about\">{about}</p>"
    );
    if !keys.is_empty() {
        let keys: Vec<_> = keys.iter().map(|(class, text)| (*class, (*text).to_owned())).collect();
        legend(page, &keys);
    }
    page.push_str("<div class=\"plots\">\n");
    for plot in plots {
        plot.write(page);
    }
    page.push_str("</div></section>\n");
}

/// How long the record goes on, s.
fn end_s(record: &MissionRecord) -> f64 {
    record.series.t_s.last().copied().unwrap_or(record.summary.mission_s)
}

/// The time of the whole mission.
fn whole(record: &MissionRecord) -> Axis {
    Axis::time(end_s(record))
}

/// All of them.
pub(super) fn write(page: &mut String, record: &MissionRecord) {
    section(
        page,
        "parameters",
        "What was learnt",
        "Estimates as the estimator reported them while it flew.",
        &[("c0", "estimate"), ("band b0", "± 2 σ"), ("truth", "truth"), ("shut-off", "information no longer wanted")],
        &estimates(record),
    );
    let mut learning = information(record);
    learning.push(weights(record, end_s(record)));
    learning.push(consistency(record));
    section(
        page,
        "information",
        "Information: gathered, and wanted",
        "Information is 1/σ². Dashed: what the planner expected to have after each stretch; circles: what it predicted for the stretch's end. \
         The weight of a quantity in the plan of a stretch is a share of its largest; where it ends for good stands a dashed line.",
        &[],
        &learning,
    );
    section(
        page,
        "tracking",
        "Tracking",
        "Where the robot truly was, less where it should have been, world axes; shaded: the tube that the controller promised.",
        &[("c0", "error"), ("band tube", "tube")],
        &tracking(record),
    );
    section(
        page,
        "inputs",
        "Force and torque",
        "What acted on the body, body axes, and the limits of the axis.",
        &[("c0", "acted"), ("limit", "limit")],
        &inputs(record),
    );
    section(
        page,
        "safety",
        "Clearance, speed and beliefs",
        "Least distance between the robot's sphere and anything, how fast it flew, and which belief was in use.",
        &[],
        &[clearance(record), speed(record), beliefs(record, end_s(record))],
    );
}

/// The two that a mission is told by, as files of their own: the way from above, and what the mass was taken for.
pub(super) fn pictures(record: &MissionRecord) -> [Chart; 2] {
    let flown = |rows: &[[f64; 3]]| -> Vec<[f64; 2]> { rows.iter().map(|row| [row[0], row[1]]).collect() };
    let series = &record.series;
    let curves = [("flown", flown(&series.position_m)), ("as the robot believed", flown(&series.believed_position_m))];
    let title = format!("{}: the way from above", record.summary.scenario);
    let mut way = Chart::of_curves("path_xy", &title, "m", Axis::named("x, m", ""), curves).with_equal_scales();
    let ends = [series.position_m.first(), Some(&record.goal_m)].into_iter().flatten().map(|end| [end[0], end[1]]);
    way.layers.push(Layer::Marks("c2", ends.collect()));
    way.legend.push(("mark c2", "start, goal".into()));
    let seen = |obstacle: &DrawnEllipsoid| {
        let [x, y, z, w] = obstacle.quaternion_xyzw;
        let rotation = UnitQuaternion::from_quaternion(Quaternion::new(w, x, y, z));
        let pose = Pose::from_parts(Vector3::from(obstacle.center_m).into(), rotation);
        Layer::Area("area", ellipsoid_from_above(&pose, &obstacle.semi_axes_m.into()))
    };
    if !record.obstacles.is_empty() {
        way.layers.splice(0..0, record.obstacles.iter().map(seen));
        way.legend.push(("area", "obstacles".into()));
    }
    let mut mass = estimates(record).into_iter().next().unwrap_or_else(|| Chart::new("", "", "", whole(record)));
    mass.id = "mass".into();
    mass.title = format!("{}: what the mass was taken for", record.summary.scenario);
    mass.legend = vec![("c0", "estimate".into()), ("band b0", "± 2 σ".into()), ("truth", "truth".into())];
    [way, mass]
}

fn shut_off(record: &MissionRecord, name: &str) -> Option<f64> {
    record.summary.information_shut_off_s.get(name).copied()
}

fn estimates(record: &MissionRecord) -> Vec<Chart> {
    let series = &record.series;
    let plots = record.summary.parameters.iter().take(10).enumerate().map(|(index, parameter)| {
        let mut plot =
            Chart::new(format!("plot-estimate-{index}"), title(&parameter.name), unit(&parameter.unit), whole(record));
        plot.cuts_bands = true;
        plot.reads = format!("estimate:{index}");
        let rows = series.t_s.iter().zip(&series.estimate).zip(&series.sigma);
        let band = rows.map(|((&t, estimate), sigma)| {
            let (center, half) = (at(estimate, index), 2.0 * at(sigma, index));
            [t, center - half, center + half]
        });
        plot.layers.push(Layer::Band("band b0", band.collect()));
        plot.layers.push(Layer::Level("truth", parameter.truth));
        plot.layers.push(Layer::Line("c0", column(series, &series.estimate, |row| at(row, index))));
        if let Some(t) = shut_off(record, &parameter.name) {
            plot.layers.push(Layer::Moment("shut-off", t));
        }
        plot
    });
    plots.collect()
}

fn information(record: &MissionRecord) -> Vec<Chart> {
    let series = &record.series;
    let groups: [(&str, &str, &[usize]); 4] = [
        ("mass", "Mass", &[0]),
        ("com", "Centre of mass", &[1, 2, 3]),
        ("principal", "Moments of inertia", &[4, 5, 6]),
        ("products", "Products of inertia", &[7, 8, 9]),
    ];
    let plots = groups.into_iter().map(|(id, heading, members)| {
        let unit = members
            .first()
            .and_then(|&first| record.summary.parameters.get(first))
            .map_or_else(String::new, |row| unit(&row.unit));
        let unit = if unit.is_empty() { String::new() } else { format!("1/({unit})²") };
        let mut plot = Chart::new(format!("plot-information-{id}"), heading, unit, whole(record));
        plot.is_logarithmic = true;
        for (&index, class) in members.iter().zip(COLORS) {
            let Some(parameter) = record.summary.parameters.get(index) else { continue };
            let of = |sigma: f64| if sigma > 0.0 { 1.0 / (sigma * sigma) } else { f64::NAN };
            plot.layers.push(Layer::Line(class, column(series, &series.sigma, |row| of(at(row, index)))));
            let (mut predicted, mut expected) = (Vec::new(), Vec::new());
            let mut sum = None;
            for stretch in &record.stretches {
                let Some(place) = stretch.quantities.iter().position(|name| *name == parameter.name) else {
                    continue;
                };
                let Some(&[before, after]) = stretch.sigma.get(place) else { continue };
                predicted.push([stretch.end_s, of(after)]);
                if let Some(&gain) = stretch.information.get(place) {
                    let start = *sum.get_or_insert_with(|| of(before));
                    expected.extend([[stretch.start_s, start], [stretch.end_s, start + gain]]);
                    sum = Some(start + gain);
                }
            }
            if !predicted.is_empty() {
                plot.layers.push(Layer::Line(dashed(class), expected));
                plot.layers.push(Layer::Marks(class, predicted));
            }
            if let Some(t) = shut_off(record, &parameter.name) {
                plot.layers.push(Layer::Moment("shut-off", t));
            }
            plot.legend.push((class, title(&parameter.name)));
        }
        let list: Vec<_> = members.iter().map(|index| format!("information:{index}")).collect();
        plot.reads = list.join(" ");
        plot
    });
    plots.collect()
}

/// The class of the same colour, dashed.
fn dashed(class: &str) -> &'static str {
    match class {
        "c0" => "c0 dashed",
        "c1" => "c1 dashed",
        "c2" => "c2 dashed",
        "c3" => "c3 dashed",
        "c4" => "c4 dashed",
        _ => "c5 dashed",
    }
}

fn weights(record: &MissionRecord, end_s: f64) -> Chart {
    let mut plot = Chart::new("plot-weights", "Information weights", "share of the largest", whole(record));
    plot.layers.push(Layer::Level("zero", 0.0));
    let mut names: Vec<&str> = Vec::new();
    for name in record.stretches.iter().flat_map(|stretch| &stretch.quantities) {
        if !names.contains(&name.as_str()) {
            names.push(name);
        }
    }
    for (name, class) in names.iter().zip(COLORS) {
        let of_stretches = record.stretches.iter().filter_map(|stretch| {
            let place = stretch.quantities.iter().position(|quantity| quantity == name)?;
            Some([stretch.start_s, stretch.weights.get(place).copied()?])
        });
        let points: Vec<[f64; 2]> = of_stretches.collect();
        let most = points.iter().map(|point| point[1]).fold(0.0, f64::max);
        let scale = if most > 0.0 { 1.0 / most } else { 1.0 };
        plot.layers.push(Layer::Line(class, steps(points.into_iter().map(|[t, value]| [t, value * scale]), end_s)));
        let shut = shut_off(record, name);
        if let Some(t) = shut {
            plot.layers.push(Layer::Moment(dashed(class), t));
        }
        plot.legend.push((class, title(name) + &shut.map(|t| format!(": until {t:.0} s")).unwrap_or_default()));
    }
    if names.is_empty() {
        plot.legend.push(("zero", "no stretch had weights".into()));
    }
    plot
}

/// How far estimates are off, by their own measure.
fn consistency(record: &MissionRecord) -> Chart {
    let series = &record.series;
    let mut plot = Chart::new("plot-consistency", "Error of the estimates", "standard deviations", whole(record));
    plot.layers.push(Layer::Level("zero", 0.0));
    plot.layers.push(Layer::Level("limit", 2.0));
    plot.layers.push(Layer::Level("limit", -2.0));
    for (index, class) in [0, 4, 5, 6].into_iter().zip(COLORS) {
        let Some(parameter) = record.summary.parameters.get(index) else { continue };
        let rows = series.t_s.iter().zip(&series.estimate).zip(&series.sigma);
        let error = rows.map(|((&t, estimate), sigma)| {
            let sigma = at(sigma, index);
            [t, if sigma > 0.0 { (at(estimate, index) - parameter.truth) / sigma } else { f64::NAN }]
        });
        plot.layers.push(Layer::Line(class, error.collect()));
        plot.legend.push((class, title(&parameter.name)));
    }
    plot.legend.push(("limit", "± 2 σ".into()));
    plot
}

fn length(of: impl Iterator<Item = f64>) -> f64 {
    of.map(|value| value * value).sum::<f64>().sqrt()
}

fn tracking(record: &MissionRecord) -> Vec<Chart> {
    let series = &record.series;
    let mut plots: Vec<Chart> = AXES
        .into_iter()
        .enumerate()
        .map(|(axis, name)| {
            let mut plot = Chart::new(format!("plot-error-{name}"), format!("Error along {name}"), "mm", whole(record));
            plot.reads = format!("error:{axis}");
            let band = column(series, &series.tube_m, |row| 1e3 * at(row, axis));
            plot.layers.push(Layer::Band("band tube", band.into_iter().map(|[t, half]| [t, -half, half]).collect()));
            plot.layers.push(Layer::Level("zero", 0.0));
            let rows = series.t_s.iter().zip(&series.position_m).zip(&series.wanted_position_m);
            let error = rows.map(|((&t, is), wanted)| [t, 1e3 * (at(is, axis) - at(wanted, axis))]);
            plot.layers.push(Layer::Line("c0", error.collect()));
            plot
        })
        .collect();
    let mut distance = Chart::new("plot-distance", "Distance", "mm", whole(record));
    distance.reads = "distance".into();
    distance.layers.push(Layer::Level("zero", 0.0));
    distance.layers.push(Layer::Line("c0", column(series, &series.tracking_error_m, |e| 1e3 * e)));
    plots.push(distance);
    let mut angle = Chart::new("plot-angle", "Attitude", "degrees", whole(record));
    angle.reads = "angle".into();
    angle.layers.push(Layer::Level("zero", 0.0));
    angle.layers.push(Layer::Line("c0", column(series, &series.attitude_error_rad, |e| e.to_degrees())));
    plots.push(angle);
    let mut belief = Chart::new("plot-localization", "Localization off by", "mm", whole(record));
    belief.layers.push(Layer::Level("zero", 0.0));
    let rows = series.t_s.iter().zip(&series.position_m).zip(&series.believed_position_m);
    let off = rows.map(|((&t, is), believed)| [t, 1e3 * length(is.iter().zip(believed).map(|(a, b)| a - b))]);
    belief.layers.push(Layer::Line("c0", off.collect()));
    plots.push(belief);
    plots
}

fn inputs(record: &MissionRecord) -> Vec<Chart> {
    let series = &record.series;
    let groups = [
        ("force", "Force", "N", &series.force_n, series.force_limit_n),
        ("torque", "Torque", "N m", &series.torque_n_m, series.torque_limit_n_m),
    ];
    let mut plots = Vec::new();
    for (id, heading, unit, values, limits) in groups {
        for ((axis, name), limit) in AXES.into_iter().enumerate().zip(limits) {
            let mut plot = Chart::new(format!("plot-{id}-{name}"), format!("{heading} {name}"), unit, whole(record));
            plot.reads = format!("{id}:{axis}");
            plot.layers.push(Layer::Level("zero", 0.0));
            if limit > 0.0 {
                plot.layers.push(Layer::Level("limit", limit));
                plot.layers.push(Layer::Level("limit", -limit));
            }
            plot.layers.push(Layer::Line("c0", column(series, values, |row| at(row, axis))));
            plots.push(plot);
        }
    }
    plots
}

fn clearance(record: &MissionRecord) -> Chart {
    let series = &record.series;
    let mut plot = Chart::new("plot-clearance", "Clearance", "m", whole(record));
    plot.reads = "clearance".into();
    plot.layers.push(Layer::Level("limit", 0.0));
    plot.layers.push(Layer::Line("c0", column(series, &series.clearance_m, |clear| clear.unwrap_or(f64::NAN))));
    plot.legend = vec![("c0", "clearance".into()), ("limit", "contact".into())];
    plot
}

fn speed(record: &MissionRecord) -> Chart {
    let series = &record.series;
    let mut plot = Chart::new("plot-speed", "Speed", "mm/s", whole(record));
    plot.reads = "speed".into();
    plot.layers.push(Layer::Level("zero", 0.0));
    let rows: Vec<_> = series.t_s.iter().zip(&series.position_m).collect();
    let speeds = rows.windows(2).filter_map(|pair| {
        let [(from_s, from), (to_s, to)] = pair else { return None };
        let step_s = *to_s - *from_s;
        let moved = length(to.iter().zip(from.iter()).map(|(a, b)| a - b));
        (step_s > 0.0).then(|| [0.5 * (*from_s + *to_s), 1e3 * moved / step_s])
    });
    plot.layers.push(Layer::Line("c0", speeds.collect()));
    plot
}

fn beliefs(record: &MissionRecord, end_s: f64) -> Chart {
    #[allow(clippy::cast_precision_loss)] // a number of revisions
    let float = |revision: u64| revision as f64;
    let series = &record.series;
    let mut plot = Chart::new("plot-beliefs", "Belief in use", "revision", whole(record));
    plot.reads = "belief".into();
    let offered = record.beliefs.iter().map(|belief| [belief.t_s, float(belief.revision)]);
    plot.layers.push(Layer::Line("offered", steps(offered, end_s)));
    let used = series.t_s.iter().zip(&series.belief_revision).map(|(&t, &revision)| [t, float(revision)]);
    plot.layers.push(Layer::Line("c0", steps(used, end_s)));
    let planned = record.stretches.iter().map(|stretch| [stretch.start_s, float(stretch.model_revision)]);
    plot.layers.push(Layer::Marks("c1", planned.collect()));
    plot.legend =
        vec![("offered", "offered".into()), ("c0", "controller".into()), ("mark c1", "plan of a stretch".into())];
    plot
}

/// The stretches, ways and events in a row: what stands below the slider of the playback.
pub(super) fn strip(page: &mut String, record: &MissionRecord) {
    let end_s = record.series.t_s.last().copied().unwrap_or(record.summary.mission_s).max(1e-9);
    let x = |t: f64| {
        let mut text = String::new();
        coordinate(&mut text, (1000.0 * t / end_s).clamp(0.0, 1000.0));
        text
    };
    let _ = write!(
        page,
        "<svg xmlns=\"http://www.w3.org/2000/svg\" id=\"strip\" class=\"strip\" viewBox=\"0 0 1000 22\" preserveAspectRatio=\"none\" \
         role=\"img\" aria-label=\"{} stretches and {} events over time\" data-inner=\"1000\" data-end=\"{end_s}\">",
        record.stretches.len(),
        record.events.len()
    );
    for (number, stretch) in record.stretches.iter().enumerate() {
        let class = if number % 2 == 0 { "even" } else { "odd" };
        let (from, to) = (x(stretch.start_s), x(stretch.end_s.max(stretch.start_s)));
        let _ = write!(page, "<path class=\"{class}\" d=\"M{from} 8H{to}V18H{from}Z\"/>");
    }
    for fallback in &record.summary.fallbacks {
        let _ = write!(page, "<path class=\"fallback\" d=\"M{} 0V22\"/>", x(fallback.t_s));
    }
    for event in &record.events {
        let _ = write!(
            page,
            "<path class=\"event\" d=\"M{} 2V22\"><title>{}</title></path>",
            x(event.t_s),
            escaped(&event.text)
        );
    }
    page.push_str("<path class=\"cursor\" d=\"M0 0V22\"/></svg>\n");
}
