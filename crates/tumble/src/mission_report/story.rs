//! A mission in three sentences: what was asked, how it ended, how sure what was learnt is.

use crate::mission::{DoubtOf, MissionRecord, MissionSummary};
use crate::page::text::{number, with_sigma};

/// Parameters that the motion on a table does not show, by their names.
const HIDDEN_ON_TABLE: [&str; 6] = ["com_z", "inertia_xx", "inertia_yy", "inertia_xy", "inertia_xz", "inertia_yz"];

/// Whether no flight of this robot can show the parameter.
pub(super) fn is_hidden(record: &MissionRecord, name: &str) -> bool {
    record.planar && HIDDEN_ON_TABLE.contains(&name)
}

/// What a doubt that stands is about, in words.
pub(super) fn doubted(standing: &[DoubtOf]) -> String {
    let names: Vec<&str> = standing
        .iter()
        .map(|what| match what {
            DoubtOf::Body => "its body",
            DoubtOf::Map => "its map",
            DoubtOf::Actuators => "its actuators",
        })
        .collect();
    names.join(" and ")
}

/// What was asked.
fn asked(record: &MissionRecord) -> String {
    let summary = &record.summary;
    let start = record.series.position_m.first().copied().unwrap_or(record.goal_m);
    let way_m = start.iter().zip(record.goal_m).map(|(a, b)| (a - b) * (a - b)).sum::<f64>().sqrt();
    let around = match record.obstacles.len() {
        0 => "with nothing in its way".to_owned(),
        1 => "around one obstacle".to_owned(),
        several => format!("around {several} obstacles"),
    };
    let place = if record.planar { "on a table" } else { "in free flight" };
    let mass = summary.parameters.first().map_or_else(String::new, |mass| {
        let [believed, truth] = [mass.initial, mass.truth].map(|value| number(value, 4));
        format!("; it took itself for {believed} kg and weighed {truth} kg at the end")
    });
    format!("The robot was to come to rest {} m away {around}, {place}{mass}.", number(way_m, 3))
}

/// How it ended.
fn ended(summary: &MissionSummary) -> String {
    let time = format!("{:.1} s", summary.mission_s);
    let end = match (&summary.no_way, summary.arrived) {
        (Some(why), _) => format!("It found after {time} that no way leads to the goal: {why}"),
        (None, true) => format!("It arrived after {time}"),
        (None, false) => format!("It had not arrived when the flight was ended after {time}"),
    };
    let clearance = match summary.min_clearance_m {
        Some(clear) if clear < 0.0 => format!(", hit something on the way ({} mm deep)", number(-1e3 * clear, 3)),
        Some(clear) => format!(", came no nearer than {} mm to anything", number(1e3 * clear, 3)),
        None => String::new(),
    };
    let limits = match summary.limit_violations {
        0 => " and kept all limits".to_owned(),
        some => format!(" and was beyond its limits in {some} control periods"),
    };
    format!("{end}{clearance}{limits}.")
}

/// How sure it is of itself.
fn sure(record: &MissionRecord) -> String {
    let summary = &record.summary;
    let Some(mass) = summary.parameters.first() else { return String::new() };
    let shown: Vec<_> = summary.parameters.iter().filter(|row| !is_hidden(record, &row.name)).collect();
    let within = shown.iter().filter(|row| (row.estimate - row.truth).abs() <= 2.0 * row.sigma).count();
    let (estimate, sigma) = with_sigma(mass.estimate, mass.sigma);
    let hidden = if record.planar { " that a table can show" } else { "" };
    let doubts = match summary.standing_doubts().as_slice() {
        [] => "it doubts nothing".to_owned(),
        standing => format!("it doubts {}", doubted(standing)),
    };
    format!(
        "It now takes itself for {estimate} ± {sigma} kg (one σ); {within} of the {} parameters{hidden} lie within two of their σ of the truth, and \
         {doubts}.",
        shown.len()
    )
}

/// All three.
pub(super) fn sentences(record: &MissionRecord) -> [String; 3] {
    [asked(record), ended(&record.summary), sure(record)]
}
