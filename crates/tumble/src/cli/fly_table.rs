//! What a mission came to, for people, and what it cost to compute.

use crate::mission::MissionRecord;
use serde_json::{Value, json};
use std::collections::BTreeMap;
use std::fmt::Write as _;
use std::time::Duration;
use tumble_planning::mission::Layer;

/// Measured computing times of each layer.
#[derive(Default)]
pub(super) struct Costs {
    of: BTreeMap<Layer, Vec<Duration>>,
}

impl Costs {
    pub fn took(&mut self, layer: Layer, time: Duration) {
        self.of.entry(layer).or_default().push(time);
    }

    /// How often, median, 99th percentile, in ms.
    fn rows(&self) -> impl Iterator<Item = (Layer, usize, f64, f64)> {
        self.of.iter().map(|(layer, times)| {
            let mut sorted = times.clone();
            sorted.sort_unstable();
            let at = |share: usize| {
                let index = (sorted.len() * share / 100).min(sorted.len().saturating_sub(1));
                sorted.get(index).map_or(0.0, |time| time.as_secs_f64() * 1e3)
            };
            (*layer, sorted.len(), at(50), at(99))
        })
    }

    pub fn json(&self, wall_s: f64) -> Value {
        let layers: serde_json::Map<String, Value> = self
            .rows()
            .map(|(layer, count, median_ms, p99_ms)| {
                (name(layer).to_owned(), json!({ "count": count, "median_ms": median_ms, "p99_ms": p99_ms }))
            })
            .collect();
        json!({ "format": 1, "wall_s": wall_s, "layers": layers })
    }
}

fn name(layer: Layer) -> &'static str {
    match layer {
        Layer::Way => "global plan",
        Layer::NewWay => "global replan",
        Layer::Stretch => "local plan",
        Layer::Control => "control step",
        Layer::Estimator => "estimator update",
        _ => "other",
    }
}

/// The table that `tumble fly` prints.
pub(super) fn table(record: &MissionRecord, costs: &Costs, wall_s: f64) -> String {
    let summary = &record.summary;
    let mut text = format!("mission {}, seed {}\n", summary.scenario, summary.seed);
    let mut line = |what: &str, value: String| {
        let _ = writeln!(text, "  {what:<26}{value}");
    };
    let arrived = if summary.arrived { "yes" } else { "no" };
    line(
        "arrived",
        format!("{arrived}, after {:.1} s ({:.0} x real time)", summary.mission_s, summary.mission_s / wall_s),
    );
    if let Some(why) = &summary.no_way {
        line("no way leads there", why.clone());
    }
    let clearance = summary.min_clearance_m.map_or_else(|| "nothing around".to_owned(), |m| format!("{m:.3} m"));
    line("least clearance", clearance);
    line("limits passed", format!("{} control periods", summary.limit_violations));
    line("impulse", format!("{:.2} N s, {:.3} N m s", summary.impulse_n_s, summary.angular_impulse_n_m_s));
    let rms = &summary.rms_tracking_m;
    line("tracking", format!("{:.1} mm RMS, {:.1} mm in the last quarter", 1e3 * rms.all, 1e3 * rms.last_leg));
    line("plans", format!("{} stretches; {} new ways", record.stretches.len(), summary.replans));
    line("beliefs", format!("{}, used up to {}", summary.belief_revisions, last_used(record)));
    line("fallbacks", format!("{}", summary.fallbacks.len()));
    if summary.doubts.is_empty() {
        line("doubts", "none".to_owned());
    }
    for doubt in &summary.doubts {
        let until =
            doubt.until_s.map_or_else(|| "still at the end".to_owned(), |until_s| format!("until {until_s:.1} s"));
        line("doubts", format!("{}, from {:.1} s {until}: {}", doubt.what.name(), doubt.since_s, doubt.text));
    }
    let _ = writeln!(text, "\n  parameter        truth      at first   estimate   sigma      error/sigma");
    for row in &summary.parameters {
        let off = (row.estimate - row.truth) / row.sigma;
        let off = if row.sigma > 0.0 { format!("{off:>8.2}") } else { "       -".to_owned() };
        let _ = writeln!(
            text,
            "  {:<15}{:>10.5} {:>10.5} {:>10.5} {:>9.5} {off}  {}",
            row.name, row.truth, row.initial, row.estimate, row.sigma, row.unit
        );
    }
    let _ = writeln!(text, "\n  layer              count   median ms    p99 ms");
    for (layer, count, median_ms, p99_ms) in costs.rows() {
        let _ = writeln!(text, "  {:<17}{count:>7} {median_ms:>11.4} {p99_ms:>9.4}", name(layer));
    }
    let told: Vec<_> = record.events.iter().filter(|event| event.kind != "way").collect();
    if !told.is_empty() {
        let _ = writeln!(text, "\n  events");
    }
    for event in told.iter().take(20) {
        let _ = writeln!(text, "  {:>8.2} s  {}: {}", event.t_s, event.kind, event.text);
    }
    if told.len() > 20 {
        let _ = writeln!(text, "  and {} more, in report.html", told.len() - 20);
    }
    for warning in &summary.warnings {
        let _ = writeln!(text, "  note: {warning}");
    }
    text
}

fn last_used(record: &MissionRecord) -> u64 {
    record.beliefs.iter().rev().find(|belief| belief.used_from_s.is_some()).map_or(0, |belief| belief.revision)
}
