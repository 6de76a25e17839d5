//! A campaign as a page: how errors and clearances are distributed, and which missions to look at.

use super::analysis::{Analysis, GroupSummary};
use super::report::shown_rate;
use super::row::{PARAMETERS, Row, Status, column};
use super::{CampaignPlan, table};
use crate::TumbleError;
use crate::output::OutputFolder;
use crate::page::chart::{Axis, Chart, Layer};
use crate::page::text::{escaped, number};
use crate::page::{Page, Tone};

/// Curves that a picture holds.
const CURVES: usize = 3;
/// Points of a curve.
const POINTS: usize = 400;
/// Missions that are listed to be looked at, of each kind.
const LISTED: usize = 10;

/// Name, title, axis, unit, column, factor.
const PICTURES: [(&str, &str, &str, &str, &str, f64); 4] = [
    ("clearance", "Share that came nearer than this to anything", "least clearance", "m", "min_clearance_m", 1.0),
    (
        "tracking_error",
        "Share that tracked better than this",
        "tracking error, RMS",
        "mm",
        "rms_tracking_all_m",
        1000.0,
    ),
    ("mission_time", "Share that was over sooner", "mission time", "s", "mission_s", 1.0),
    ("impulse", "Share that spent less", "impulse of the force", "N s", "impulse_n_s", 1.0),
];

/// Distributions, one curve for each of up to three levels of the first factor that varies.
fn charts(plan: &CampaignPlan, rows: &[Row]) -> Vec<Chart> {
    let levels = plan.drawn_levels();
    let names: Vec<&str> = levels.iter().map(|(name, _)| name.as_str()).take(CURVES).collect();
    let level_of = |row: &Row| {
        let combination = plan.mission(row.number)?.combination;
        levels.iter().position(|(_, members)| members.contains(&combination))
    };
    let of_level: Vec<Option<usize>> = rows.iter().map(level_of).collect();
    let drawn = |id: &str, title: &str, axis: &str, unit: &str, value: &dyn Fn(&Row) -> Option<f64>| {
        let mut chart = Chart::new(id, title, "of all", Axis::named(axis, unit));
        for (level, (name, class)) in names.iter().zip(crate::page::chart::COLORS).enumerate() {
            let values = rows.iter().zip(&of_level).filter(|(_, of)| **of == Some(level));
            let points = distribution(values.filter_map(|(row, _)| value(row)).collect());
            if !points.is_empty() {
                chart.layers.push(Layer::Line(class, points));
                chart.legend.push((class, (*name).to_owned()));
            }
        }
        chart
    };
    let pictures = PICTURES.into_iter().filter_map(|(id, title, axis, unit, name, factor)| {
        let index = column(name)?;
        Some(drawn(id, title, axis, unit, &|row| Some(row.number(index)? * factor)))
    });
    let errors = ["mass", "inertia_zz"].into_iter().map(|name| {
        let title =
            if name == "mass" { "Share whose mass is nearer than this" } else { "Share whose inertia zz is nearer" };
        drawn(&format!("error_{name}"), title, "error", "%", &|row| relative_error(row, name))
    });
    pictures.chain(errors).filter(|chart| !chart.layers.is_empty()).collect()
}

fn of_parameter(row: &Row, name: &str, what: &str) -> Option<f64> {
    row.number(column(&format!("{name}_{what}"))?)
}

/// Of a parameter that cannot be zero, percent.
fn relative_error(row: &Row, name: &str) -> Option<f64> {
    let (truth, estimate) = (of_parameter(row, name, "truth")?, of_parameter(row, name, "estimate")?);
    Some(100.0 * ((estimate - truth) / truth).abs())
}

/// The largest error of a parameter by its own measure, and whose.
fn most_misled(row: &Row) -> Option<(f64, &'static str)> {
    let sigmas = PARAMETERS.into_iter().filter_map(|name| {
        let error = of_parameter(row, name, "estimate")? - of_parameter(row, name, "truth")?;
        let sigma = of_parameter(row, name, "sigma")?;
        (sigma > 0.0).then(|| ((error / sigma).abs(), name))
    });
    sigmas.max_by(|a, b| a.0.total_cmp(&b.0))
}

/// Why a mission is one to look at, where it is not as it should be.
fn trouble(row: &Row) -> Option<String> {
    let text = |name: &str| column(name).map_or("", |index| row.text(index));
    let flag = |name: &str| column(name).and_then(|index| row.flag(index));
    let count = |name: &str| column(name).and_then(|index| row.number(index)).unwrap_or(0.0);
    let status = text("status");
    if status == Status::Error.name() || status == Status::Panic.name() {
        return Some(format!("{status}: {}", text("message")));
    }
    if flag("collided") == Some(true) {
        return Some("hit something".to_owned());
    }
    if count("limit_violations") > 0.0 {
        return Some(format!("beyond its limits in {} control periods", count("limit_violations")));
    }
    (flag("arrived") == Some(false)).then(|| "did not arrive".to_owned())
}

/// Name, why, and the command that flies it again.
fn to_look_at(rows: &[Row]) -> Vec<Vec<String>> {
    let replay = |row: &Row| {
        column("replay").map_or(String::new(), |index| format!("<code>{}</code>", escaped(row.text(index))))
    };
    let listed = |row: &Row, why: &str| vec![row.number.to_string(), escaped(why), replay(row)];
    let mut list: Vec<Vec<String>> =
        rows.iter().filter_map(|row| Some(listed(row, &trouble(row)?))).take(LISTED).collect();
    let mut misled: Vec<(f64, &str, &Row)> =
        rows.iter().filter_map(|row| most_misled(row).map(|(sigmas, name)| (sigmas, name, row))).collect();
    misled.sort_by(|a, b| b.0.total_cmp(&a.0));
    list.extend(
        misled
            .iter()
            .take(LISTED / 2)
            .map(|(sigmas, name, row)| listed(row, &format!("{name} is {} of its σ off", number(*sigmas, 2)))),
    );
    let clearance = column("min_clearance_m");
    let mut near: Vec<(f64, &Row)> =
        rows.iter().filter_map(|row| Some((row.number(clearance?)?, row))).filter(|(clear, _)| *clear >= 0.0).collect();
    near.sort_by(|a, b| a.0.total_cmp(&b.0));
    list.extend(
        near.iter()
            .take(LISTED / 2)
            .map(|(clear, row)| listed(row, &format!("came within {} mm of something", number(1e3 * clear, 3)))),
    );
    list
}

fn group(group: &GroupSummary) -> Vec<String> {
    let median = |value: Option<super::Spread>, factor: f64| {
        value.map_or("–".to_owned(), |spread| number(factor * spread.median, 3))
    };
    vec![
        escaped(&group.label),
        shown_rate(&group.arrived),
        shown_rate(&group.collisions),
        shown_rate(&group.violations),
        group.min_clearance_m.map_or("–".to_owned(), |clear| number(1e3 * clear.min, 3)),
        median(group.mission_s, 1.0),
        median(group.mass_error_percent, 1.0),
        median(group.inertia_error_percent, 1.0),
        median(group.com_error_mm, 1.0),
    ]
}

fn story(analysis: &Analysis, plan: &CampaignPlan) -> [String; 3] {
    let all = &analysis.all;
    let scenarios: Vec<&str> = plan.configuration().scenarios.iter().map(|scenario| scenario.name.as_str()).collect();
    let asked = format!(
        "{} missions were asked for: {}, in {} combinations of options, all seeds from {}.",
        all.missions,
        scenarios.join(", "),
        analysis.combinations.len(),
        analysis.seed
    );
    let ended = format!(
        "{} arrived; {} hit something, {} were beyond their limits, {} ended with an error and {} with a panic.",
        shown_rate(&all.arrived),
        all.collisions.count,
        all.violations.count,
        all.errors,
        all.panics
    );
    let [body, map, actuators] = all.alarms;
    let sure = format!(
        "In {} hours of flight the body was doubted {body} times, the map {map} times and the actuators {actuators} times; plans kept {} of the {} standard \
         deviations that they promised.",
        number(all.flown_h, 3),
        all.promises_kept.count,
        all.promises_kept.of
    );
    [asked, ended, sure]
}

/// Writes the page, and its charts as files.
///
/// # Errors
/// [`TumbleError`] of writing.
pub(super) fn write(
    folder: &OutputFolder,
    plan: &CampaignPlan,
    rows: &[Row],
    analysis: &Analysis,
) -> Result<(), TumbleError> {
    let (tone, verdict) = match (analysis.all.flown, analysis.is_clean()) {
        (0, _) => (Tone::Doubted, "Nothing was flown"),
        (_, true) => (Tone::Good, "Every mission as it should be"),
        (_, false) => (Tone::Bad, "Not every mission as it should be"),
    };
    let name: Vec<&str> = plan.configuration().scenarios.iter().map(|scenario| scenario.name.as_str()).collect();
    let [asked, ended, sure] = story(analysis, plan);
    let mut page = Page::new("campaign", &name.join(", "), tone, verdict, [&asked, &ended, &sure]);
    page.section("groups-heading", "By option", "Rates with their 95 % intervals, medians of the rest.");
    let mut groups: Vec<&GroupSummary> = analysis.combinations.iter().collect();
    if groups.len() > 1 {
        groups.push(&analysis.all);
    }
    let columns = [
        "Option",
        "Arrived",
        "Hit something",
        "Beyond limits",
        "Least clearance, mm",
        "Time, s",
        "Mass error, %",
        "Inertia error, %",
        "Centre of mass error, mm",
    ];
    page.table(
        "groups",
        "Medians unless it says otherwise",
        &columns,
        &groups.into_iter().map(group).collect::<Vec<_>>(),
    );
    let charts = charts(plan, rows);
    page.section("distributions", "Distributions", "The share of missions below each value, by option.");
    page.charts(&[], &charts);
    let list = to_look_at(rows);
    if !list.is_empty() {
        page.section("look-heading", "Missions to look at", "What went wrong first, then what was furthest off and nearest to something; each with the command that flies it again.");
        page.table("look", "Row of rows.csv, why, and how to see it", &["Row", "Why", "Again"], &list);
    }
    page.folded("table", "In numbers, as the command prints them", &table(analysis));
    Page::chart_files(folder, &charts)?;
    folder.write("report.html", &page.finish())
}

/// The empirical distribution: steps, thinned where there are very many.
fn distribution(mut values: Vec<f64>) -> Vec<[f64; 2]> {
    values.retain(|value| value.is_finite());
    values.sort_unstable_by(f64::total_cmp);
    let count = values.len();
    let stride = count / POINTS + 1;
    let mut points = Vec::new();
    for (index, value) in values.iter().enumerate() {
        if index % stride == 0 || index + 1 == count {
            let before = points.last().map_or(0.0, |point: &[f64; 2]| point[1]);
            points.push([*value, before]);
            points.push([*value, (index + 1) as f64 / count as f64]);
        }
    }
    points
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_distribution_rises_from_nothing_to_one() {
        assert_eq!(distribution(vec![3.0, 1.0, f64::NAN]), [[1.0, 0.0], [1.0, 0.5], [3.0, 0.5], [3.0, 1.0]]);
        let many = distribution((0..10_001).map(f64::from).collect());
        assert!(many.len() <= 2 * POINTS + 2);
        assert_eq!((many.first().copied(), many.last().copied()), (Some([0.0, 0.0]), Some([10_000.0, 1.0])));
        assert!(many.windows(2).all(|pair| pair[0][0] <= pair[1][0] && pair[0][1] <= pair[1][1]));
        assert!(distribution(Vec::new()).is_empty());
    }
}
