//! An identified body as a page.

use crate::TumbleError;
use crate::output::OutputFolder;
use crate::page::chart::{Axis, Chart};
use crate::page::text::{coordinate, escaped, number, with_sigma};
use crate::page::{Page, Tone};
use crate::quantities::{Context, Quantity, quantities, relative_std};
use std::fmt::Write as _;
use tumble_dynamics::PARAMETER_NAMES;
use tumble_formats::log::seconds;
use tumble_identification::{Estimate, Identification, MotionSample, NodeResidual, Validation};
use tumble_lie::Wrench;

/// Lags of the autocorrelation, at most.
const LAGS: usize = 60;
/// Components of a wrench, with their place in `[torque; force]`.
const COMPONENTS: [(&str, &str, &str, usize); 6] = [
    ("force_x", "Force x", "N", 3),
    ("force_y", "Force y", "N", 4),
    ("force_z", "Force z", "N", 5),
    ("torque_x", "Torque x", "N m", 0),
    ("torque_y", "Torque y", "N m", 1),
    ("torque_z", "Torque z", "N m", 2),
];

/// What a page shows of a finding, however it came about.
pub struct Shown<'a> {
    /// How the verdict is to be taken.
    pub(crate) tone: Tone,
    /// The verdict in a line.
    pub(crate) verdict: String,
    /// The method's name.
    pub(crate) method: &'a str,
    /// Samples behind the answer.
    pub(crate) samples: usize,
    /// The body found, and which of its ten numbers the log determines.
    pub(crate) body: Option<(&'a Estimate, Vec<bool>)>,
    /// Share of the wrench that it explains.
    pub(crate) explained: Option<f64>,
    /// What is left of the wrench.
    pub(crate) residuals: &'a [NodeResidual],
    /// The wrench applied there, as logged; empty where it is not at hand.
    pub(crate) applied: Vec<Option<Wrench<f64>>>,
    /// What the log leaves open, in words.
    pub(crate) open: Vec<String>,
    /// What a reader must know.
    pub(crate) warnings: Vec<String>,
    /// Charts of this method alone.
    pub(crate) more: Vec<Chart>,
    /// How a body from the first part of the log does on the rest.
    pub(crate) trial: Option<Trial>,
}

/// A body from the first part of a log, tried on the rest of it.
pub struct Trial {
    /// Share of the log that it was found from.
    pub(crate) share: f64,
    /// How it does on the rest.
    pub(crate) validation: Validation,
    /// By how many of its standard deviations each of the ten numbers changes when the rest is used too; none of what either leaves open.
    pub(crate) moved: Vec<Option<f64>>,
}

impl Trial {
    /// Of the finding from a part and the one from all.
    pub(crate) fn new(
        share: f64,
        part: &Identification,
        whole: &Identification,
        validation: Validation,
    ) -> Option<Self> {
        let known: Vec<bool> = part.determined().iter().zip(whole.determined()).map(|(a, b)| *a && b).collect();
        let body = |of: &Identification| of.estimate.or(of.regularised);
        let (part, whole) = (body(part)?, body(whole)?);
        let numbers = |of: &Estimate| quantities(&of.parameters, &part.std);
        let pairs = numbers(&part).into_iter().zip(numbers(&whole)).zip(known);
        let moved = pairs.map(|((a, b), known)| known.then_some((b.value - a.value) / a.std)).collect();
        Some(Self { share, validation, moved })
    }
}

/// The mean wrench applied from each node to the next, as the record holds it.
pub(crate) fn applied(record: &[MotionSample], residuals: &[NodeResidual]) -> Vec<Option<Wrench<f64>>> {
    let mut rows = record.iter().peekable();
    let next_ns = |index: usize| residuals.get(index + 1).map_or(i64::MAX, |node| node.time_ns);
    let mut means = Vec::with_capacity(residuals.len());
    let mut held = None;
    for (index, node) in residuals.iter().enumerate() {
        while rows.next_if(|row| row.time_ns < node.time_ns).is_some() {}
        let (mut sum, mut count) = (Wrench::zero(), 0.0);
        // The last node has no next one: its own row counts.
        let end_ns = next_ns(index).min(if index + 1 == residuals.len() { node.time_ns + 1 } else { i64::MAX });
        while let Some(row) = rows.next_if(|row| row.time_ns < end_ns) {
            held = row.wrench_body.or(held);
            if let Some(wrench) = held {
                sum = Wrench::new(sum.torque + wrench.torque, sum.force + wrench.force);
                count += 1.0;
            }
        }
        means.push((count > 0.0).then(|| Wrench::new(sum.torque / count, sum.force / count)));
    }
    means
}

fn component(
    torque: &tumble_dynamics::nalgebra::Vector3<f64>,
    force: &tumble_dynamics::nalgebra::Vector3<f64>,
    place: usize,
) -> f64 {
    if place < 3 { torque[place] } else { force[place - 3] }
}

/// Time of a node since the first, s.
fn since_start(residuals: &[NodeResidual], node: &NodeResidual) -> f64 {
    seconds(node.time_ns - residuals.first().map_or(0, |first| first.time_ns))
}

/// The wrench as logged, and as the body that was found makes it of the motion.
fn fit(shown: &Shown) -> Vec<Chart> {
    let residuals = shown.residuals;
    let chart = |(id, title, unit, place): (&str, &str, &str, usize)| {
        let rows = || residuals.iter().zip(&shown.applied);
        let measured = rows().filter_map(|(node, applied)| {
            let applied = applied.as_ref()?;
            Some([since_start(residuals, node), component(&applied.torque, &applied.force, place)])
        });
        let predicted = rows().filter_map(|(node, applied)| {
            let applied = applied.as_ref()?;
            let sum = component(&applied.torque, &applied.force, place) + component(&node.torque, &node.force, place);
            Some([since_start(residuals, node), sum])
        });
        let curves = [("of the motion", predicted.collect()), ("logged", measured.collect())];
        Chart::of_curves(&format!("fit_{id}"), title, unit, Axis::seconds(), curves)
    };
    if shown.applied.iter().all(Option::is_none) { Vec::new() } else { COMPONENTS.map(chart).into() }
}

/// What is left over time, force and torque.
fn left(residuals: &[NodeResidual]) -> Vec<Chart> {
    [("residual_force", "Force left", "N", 3), ("residual_torque", "Torque left", "N m", 0)]
        .map(|(id, title, unit, first)| {
            let of = |node: &NodeResidual, axis: usize| component(&node.torque, &node.force, first + axis);
            let squares: f64 = residuals.iter().flat_map(|node| (0..3).map(|axis| of(node, axis).powi(2))).sum();
            let rms = (squares / (3 * residuals.len().max(1)) as f64).sqrt();
            let curve =
                |axis: usize| residuals.iter().map(|node| [since_start(residuals, node), of(node, axis)]).collect();
            let curves = [("x", curve(0)), ("y", curve(1)), ("z", curve(2))];
            Chart::of_curves(id, title, unit, Axis::seconds(), curves).within(Some(2.0 * rms), "± 2 root mean squares")
        })
        .into()
}

/// How much what is left at one node says of what is left some nodes later; white where it says nothing.
fn autocorrelation(residuals: &[NodeResidual]) -> Vec<Chart> {
    let lags = LAGS.min(residuals.len() / 4);
    if lags < 2 {
        return Vec::new();
    }
    let correlated = |place: usize| -> Vec<[f64; 2]> {
        let values: Vec<f64> = residuals.iter().map(|node| component(&node.torque, &node.force, place)).collect();
        let mean = values.iter().sum::<f64>() / values.len() as f64;
        let product = |lag: usize| -> f64 {
            values.iter().zip(values.iter().skip(lag)).map(|(a, b)| (a - mean) * (b - mean)).sum()
        };
        let variance = product(0);
        (0..=lags).map(|lag| [lag as f64, if variance > 0.0 { product(lag) / variance } else { 0.0 }]).collect()
    };
    let bound = 2.0 / (residuals.len() as f64).sqrt();
    [("autocorrelation_force", "Autocorrelation, force", 3), ("autocorrelation_torque", "Autocorrelation, torque", 0)]
        .map(|(id, title, first)| {
            let curves = [("x", correlated(first)), ("y", correlated(first + 1)), ("z", correlated(first + 2))];
            Chart::of_curves(id, title, "", Axis::named("nodes apart", ""), curves)
                .within(Some(bound), "± 2 σ where it is white")
        })
        .into()
}

/// An interval of two standard deviations, and a value to compare with, drawn 150 by 16 px: four standard deviations to each side.
fn interval(quantity: &Quantity, other: Option<f64>) -> String {
    let mut svg = String::from(
        "<svg class=\"interval\" viewBox=\"0 0 150 16\" aria-hidden=\"true\"><path class=\"axis\" d=\"M0 8h150\"/><path class=\"two\" d=\"M37.5 8h75\"/>\
         <path class=\"is\" d=\"M75 3v10\"/>",
    );
    if let Some(other) = other.filter(|_| quantity.std > 0.0) {
        let sigmas = ((other - quantity.value) / quantity.std).clamp(-3.9, 3.9);
        let mut x = String::new();
        coordinate(&mut x, 75.0 + 18.75 * sigmas);
        let _ = write!(svg, "<path class=\"other\" d=\"M{x} 1v14\"/>");
    }
    svg + "</svg>"
}

/// Ten numbers with intervals, and the reference where there is one.
fn table(page: &mut Page, estimate: &Estimate, determined: &[bool], context: &Context) {
    let reference = context.reference.as_ref().map(|(name, body)| (name, quantities(body, &estimate.std)));
    let mut columns = vec!["Quantity", "Estimate", "1 σ", "Of its size"];
    if let Some((name, _)) = &reference {
        columns.extend([name.as_str(), "Error, σ"]);
    }
    columns.push("± 2 σ");
    let found = quantities(&estimate.parameters, &estimate.std);
    let row = |(index, quantity): (usize, &Quantity)| {
        let truth = reference.as_ref().and_then(|(_, numbers)| numbers.get(index)).map(|truth| truth.value);
        let mut cells =
            vec![format!("{} <span class=\"unit\">{}</span>", quantity.name, quantity.unit.replace("^2", "²"))];
        if !determined.get(index).copied().unwrap_or(true) {
            cells.extend(["not determined", "–", "–"].map(str::to_owned));
            if let Some(truth) = truth {
                cells.extend([number(truth, 5), "–".to_owned()]);
            }
            cells.push(String::new());
            return cells;
        }
        let (value, std) = with_sigma(quantity.value, quantity.std);
        cells.extend([value, std, format!("{} %", number(100.0 * relative_std(&estimate.parameters, quantity), 2))]);
        if let Some(truth) = truth {
            cells.extend([number(truth, 5), number((quantity.value - truth) / quantity.std, 2)]);
        }
        cells.push(interval(quantity, truth));
        cells
    };
    let rows: Vec<Vec<String>> = found.iter().enumerate().map(row).collect();
    page.table(
        "parameters",
        "Inertia about the centre of mass, body axes; off-diagonals are minus the products of inertia",
        &columns,
        &rows,
    );
}

/// The correlation of each parameter with each other, as colours and in hundredths.
fn correlation(estimate: &Estimate, determined: &[bool]) -> Option<String> {
    if !determined.iter().all(|is| *is) {
        return None;
    }
    let covariance = &estimate.covariance;
    let mut svg = String::from(
        "<svg class=\"heat\" viewBox=\"0 0 360 336\" role=\"img\" aria-label=\"Correlation of the ten parameters\">",
    );
    for (i, name) in PARAMETER_NAMES.iter().enumerate() {
        let at = 30.0 * i as f64;
        let _ = write!(svg, "<text class=\"row\" x=\"50\" y=\"{}\">{}</text>", at + 20.0, escaped(name));
        let _ = write!(svg, "<text class=\"col\" x=\"{}\" y=\"320\">{}</text>", at + 71.0, escaped(name));
        for j in 0..10 {
            let value = covariance[(i, j)] / (covariance[(i, i)] * covariance[(j, j)]).sqrt();
            let (class, strength) = (if value < 0.0 { "minus" } else { "plus" }, value.abs().min(1.0));
            let (x, y) = (56.0 + 30.0 * j as f64, at);
            let _ = write!(
                svg,
                "<rect class=\"{class}\" x=\"{x}\" y=\"{y}\" width=\"29\" height=\"29\" opacity=\"{:.2}\"/>",
                0.75 * strength
            );
            if i != j {
                let _ = write!(
                    svg,
                    "<text x=\"{}\" y=\"{}\">{}</text>",
                    x + 14.5,
                    y + 19.0,
                    number((100.0 * value).round() + 0.0, 2).trim_end_matches(".0")
                );
            }
        }
    }
    Some(svg + "</svg>")
}

fn story(shown: &Shown, context: &Context) -> [String; 3] {
    let asked = format!(
        "The mass, centre of mass and inertia of a body were asked for, from {} s of {}.",
        number(context.duration_s, 4),
        context.source
    );
    let ended = match &shown.body {
        Some((estimate, determined)) => {
            let found = quantities(&estimate.parameters, &estimate.std);
            let known = determined.iter().filter(|is| **is).count();
            let mass = found.first().filter(|_| determined.first() == Some(&true)).map(|mass| {
                let (value, std) = with_sigma(mass.value, mass.std);
                format!(": the mass is {value} ± {std} kg (one σ)")
            });
            format!(
                "{} samples determine {known} of 10 numbers by the method {}{}.",
                shown.samples,
                shown.method,
                mass.unwrap_or_default()
            )
        }
        None => format!("The method {} found no body in {} samples.", shown.method, shown.samples),
    };
    let explained =
        shown.explained.map(|share| format!("The body explains {} % of the wrench", number(100.0 * share, 4)));
    let trial = shown.trial.as_ref().map(|trial| {
        let (share, ratio) = (number(100.0 * trial.share, 2), number(trial.validation.normalised_rms, 2));
        match &trial.validation.wrench {
            Some(left) => format!(
                "one found from the first {share} % of the log explains {} % of the rest, where its errors are {ratio} times what its own σ and the noise predict",
                number(100.0 * left.explained, 3)
            ),
            None => format!(
                "one found from the first {share} % of the log and one found from the rest are {ratio} times as far apart as their σ predict"
            ),
        }
    });
    let sure = [explained, trial].into_iter().flatten().collect::<Vec<_>>().join("; ");
    [asked, ended, if sure.is_empty() { String::new() } else { format!("{sure}.") }]
}

/// Writes the page and the charts that are files too.
///
/// # Errors
/// [`TumbleError`] when a file cannot be written.
pub(crate) fn write(
    folder: &OutputFolder,
    shown: Shown,
    context: &Context,
    table_text: &str,
    json: &str,
) -> Result<(), TumbleError> {
    let [asked, ended, sure] = story(&shown, context);
    let mut page = Page::new("identification", &context.source, shown.tone, &shown.verdict, [&asked, &ended, &sure]);
    page.warnings(&shown.warnings);
    if let Some((estimate, determined)) = &shown.body {
        page.section(
            "parameters-heading",
            "What was found",
            "One standard deviation counts what the noise of this log allows, and what was estimated beside the body.",
        );
        table(&mut page, estimate, determined, context);
    }
    if !shown.open.is_empty() {
        page.section(
            "open-heading",
            "What this log cannot tell",
            "Directions in which the body may change without a trace in these data.",
        );
        page.list("open", &shown.open);
    }
    if let Some(trial) = &shown.trial {
        page.section(
            "trial-heading",
            "Trained on a part, tried on the rest",
            "A body from the first part of the log alone, and by how many of its own σ each number moves when the rest is used as well. About one is chance, \
             beyond three something changes within the log.",
        );
        let names = shown.body.iter().flat_map(|(estimate, _)| quantities(&estimate.parameters, &estimate.std));
        let rows: Vec<Vec<String>> = names
            .zip(&trial.moved)
            .filter_map(|(quantity, moved)| Some(vec![quantity.name.to_owned(), number((*moved)?, 2)]))
            .collect();
        page.table("trial", "Change of each number, in σ of the first part", &["Quantity", "Change, σ"], &rows);
    }
    let fit = fit(&shown);
    if !fit.is_empty() {
        page.section("fit", "The wrench, logged and of the motion", "What the log says was applied, and what the motion asks of the body that was found; body axes, about the body origin.");
        page.charts(&[], &fit);
    }
    let mut files = left(shown.residuals);
    files.extend(shown.more);
    let autocorrelation = autocorrelation(shown.residuals);
    page.section("left", "What is left", "The wrench of the motion less the one logged. Where it is white, nothing that matters was left out of the model.");
    page.charts(&[], &files);
    page.charts(&[], &autocorrelation);
    if let Some(svg) = shown.body.as_ref().and_then(|(estimate, determined)| correlation(estimate, determined)) {
        page.section("correlation-heading", "How the errors go together", "Correlation of the ten parameters about the body origin, in hundredths; blue: together, orange: against each other.");
        page.drawing(&svg);
    }
    page.folded("table", "In numbers, as the command prints them", table_text);
    page.folded("result", "For programs: result.json", json);
    Page::chart_files(folder, &files)?;
    folder.write("report.html", &page.finish())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::page::chart::Layer;
    use tumble_dynamics::nalgebra::Vector3;

    fn node(time_ns: i64, force: f64) -> NodeResidual {
        NodeResidual { time_ns, torque: Vector3::zeros(), force: Vector3::x() * force }
    }

    #[test]
    fn the_wrench_of_a_node_is_the_mean_until_the_next() {
        let row = |time_ns: i64, force: Option<f64>| {
            let wrench_body = force.map(|force| Wrench::new(Vector3::zeros(), Vector3::x() * force));
            MotionSample { time_ns, wrench_body, ..MotionSample::default() }
        };
        let record = [row(0, Some(9.0)), row(10, Some(1.0)), row(20, None), row(30, Some(4.0)), row(40, Some(8.0))];
        let means = applied(&record, &[node(10, 0.0), node(40, 0.0)]);
        let forces: Vec<f64> = means.iter().flatten().map(|wrench| wrench.force.x).collect();
        assert_eq!(forces, [2.0, 8.0]);
    }

    #[test]
    fn what_is_left_of_alternating_signs_is_told_apart_from_white() {
        let residuals: Vec<NodeResidual> = (0..400).map(|k| node(k, if k % 2 == 0 { 1.0 } else { -1.0 })).collect();
        let charts = autocorrelation(&residuals);
        let Some(Layer::Line(_, points)) = charts[0].layers.first() else { panic!("a curve") };
        assert_eq!(points.len(), LAGS + 1);
        assert!((points[0][1] - 1.0).abs() < 1e-12 && points[1][1] < -0.98, "{points:?}");
    }
}
