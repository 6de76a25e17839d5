//! Verdict, facts and tables.

use super::plots::{title, unit};
use super::story::{self, doubted, is_hidden};
use crate::mission::{BROKEN_INVARIANT, MissionRecord, MissionSummary, MissionVerdict, ParameterRow};
use crate::page::text::{escaped, number, with_sigma};
use serde::Serialize;
use std::fmt::Write as _;

/// What a choice is called on the command line.
fn name_of(choice: &impl Serialize) -> String {
    match serde_json::to_value(choice) {
        Ok(serde_json::Value::String(name)) => name,
        _ => "–".into(),
    }
}

/// A distance, clearly negative where it is.
fn clearance(summary: &MissionSummary) -> String {
    summary.min_clearance_m.map_or_else(|| "nothing around".into(), |clear| format!("{} m", number(clear, 3)))
}

/// What held and what did not.
fn verdict(summary: &MissionSummary) -> Vec<(bool, String)> {
    let has_collided = summary.min_clearance_m.is_some_and(|clear| clear < 0.0);
    let violations = summary.limit_violations;
    let broken = summary.warnings.iter().filter(|warning| warning.starts_with(BROKEN_INVARIANT));
    let mut parts = vec![
        (
            summary.arrived,
            match &summary.no_way {
                Some(why) => format!("no way leads to the goal: {why}"),
                None => if summary.arrived { "arrived" } else { "did not arrive" }.into(),
            },
        ),
        (!has_collided, if has_collided { "collided".into() } else { "no contact".into() }),
        (
            violations == 0,
            if violations == 0 { "all limits kept".into() } else { format!("limits passed in {violations} periods") },
        ),
    ];
    parts.extend(broken.map(|warning| (false, warning.clone())));
    parts
}

/// Class and words of the verdict.
fn headline(summary: &MissionSummary) -> (&'static str, String) {
    match summary.verdict() {
        MissionVerdict::Accomplished => ("good", "Mission accomplished".to_owned()),
        MissionVerdict::Doubted => {
            ("doubted", format!("? Arrived, but the robot doubts {}", doubted(&summary.standing_doubts())))
        }
        MissionVerdict::NotAccomplished => ("bad", "Mission not accomplished".to_owned()),
    }
}

/// What the robot doubted, when, and why.
fn doubts(page: &mut String, summary: &MissionSummary) {
    if summary.doubts.is_empty() {
        page.push_str("<p id=\"doubts\" class=\"about\">The robot doubted nothing.</p>\n");
        return;
    }
    page.push_str("<ul id=\"doubts\" class=\"doubts\">");
    for doubt in &summary.doubts {
        let (sign, until) = match doubt.until_s {
            None => ("?", "still at the end".to_owned()),
            Some(until_s) => ("–", format!("until {until_s:.1} s")),
        };
        let _ = write!(
            page,
            "<li>{sign} <b>{}</b> in doubt from {:.1} s, {until}: {}</li>",
            doubt.what.name(),
            doubt.since_s,
            escaped(&doubt.text)
        );
    }
    page.push_str("</ul>\n");
}

/// Title, verdict and what was chosen.
pub(super) fn header(page: &mut String, record: &MissionRecord) {
    let summary = &record.summary;
    let parts = verdict(summary);
    let (class, words) = headline(summary);
    let _ = write!(
        page,
        "<header><p class=\"kicker\">Mission report</p><h1>{}</h1>\n<p id=\"verdict\" class=\"verdict {class}\"><b>{words}</b>",
        escaped(&summary.scenario),
    );
    for (holds, text) in parts {
        let _ = write!(page, " <span>{} {}</span>", if holds { "✓" } else { "✗" }, escaped(&text));
    }
    let _ =
        writeln!(page, "</p>\n<p id=\"story\" class=\"story\">{}</p>", escaped(&story::sentences(record).join(" ")));
    doubts(page, summary);
    page.push_str("<dl class=\"facts\" id=\"options\">");
    let options = &summary.options;
    let fault =
        options.fault.map_or_else(|| "none".into(), |fault| format!("{}:{}", name_of(&fault.name), fault.severity));
    let facts = [
        ("Seed", summary.seed.to_string()),
        ("Weighting", name_of(&options.weighting)),
        ("Feedback", if options.feedback { "on".into() } else { "off".into() }),
        ("Model at the start", name_of(&options.model)),
        ("Fault", fault),
        ("Program", record.version.clone()),
    ];
    for (name, value) in facts {
        let _ = write!(page, "<div><dt>{name}</dt><dd>{}</dd></div>", escaped(&value));
    }
    page.push_str("</dl></header>\n");
}

/// The numbers of the whole mission.
pub(super) fn tiles(page: &mut String, record: &MissionRecord) {
    let summary = &record.summary;
    let tracking = summary.rms_tracking_m;
    let arrival = if summary.arrived { "Arrival" } else { "Ended after" };
    let tiles = [
        (arrival, format!("{} s", number(summary.mission_s, 4)), String::new()),
        ("Least clearance", clearance(summary), String::new()),
        (
            "Impulse",
            format!("{} N s", number(summary.impulse_n_s, 3)),
            format!("{} N m s of torque", number(summary.angular_impulse_n_m_s, 3)),
        ),
        (
            "Tracking, RMS",
            format!("{} mm", number(1e3 * tracking.all, 3)),
            format!("{} mm in the last quarter", number(1e3 * tracking.last_leg, 3)),
        ),
        ("Replans", summary.replans.to_string(), format!("{} stretches", record.stretches.len())),
        (
            "Beliefs",
            summary.belief_revisions.to_string(),
            format!("{} used", record.beliefs.iter().filter(|b| b.used_from_s.is_some()).count()),
        ),
        ("Fallbacks", summary.fallbacks.len().to_string(), String::new()),
        ("Limit violations", summary.limit_violations.to_string(), "control periods".into()),
    ];
    page.push_str("<dl class=\"tiles\" id=\"numbers\">");
    for (name, value, note) in tiles {
        let _ = write!(page, "<div><dt>{name}</dt><dd><b>{value}</b><small>{note}</small></dd></div>");
    }
    page.push_str("</dl>\n");
}

/// How far a value is from the truth: mass and inertia in percent of their size, lengths in millimetres.
fn error(summary: &MissionSummary, row: &ParameterRow, value: f64) -> String {
    let moments =
        summary.parameters.iter().filter(|of| ["inertia_xx", "inertia_yy", "inertia_zz"].contains(&of.name.as_str()));
    let (scale, unit) = match row.name.as_str() {
        "mass" => (100.0 / row.truth, "%"),
        name if name.starts_with("com_") => (1e3, "mm"),
        _ => (300.0 / moments.map(|of| of.truth).sum::<f64>(), "%"),
    };
    let off = number((value - row.truth) * scale, 2);
    if off.starts_with('\u{2212}') || off.starts_with('–') {
        format!("{off} {unit}")
    } else {
        format!("+{off} {unit}")
    }
}

/// What each parameter was believed to be, was found to be, and is.
pub(super) fn parameters(page: &mut String, record: &MissionRecord) {
    let summary = &record.summary;
    page.push_str(
        "<section aria-labelledby=\"table-heading\"><h2 id=\"table-heading\">Believed, learnt, true</h2>\n\
         <table id=\"table-parameters\"><caption>About the centre of mass. Small: how far from the truth, moments and products of inertia in percent \
         of the mean moment</caption>\
         <thead><tr><th scope=\"col\">Parameter</th><th scope=\"col\">Believed</th><th scope=\"col\">Learnt</th>\
         <th scope=\"col\">Truth</th><th scope=\"col\">σ</th><th scope=\"col\">Error, σ</th></tr></thead><tbody>\n",
    );
    for row in &summary.parameters {
        let in_sigmas = if row.sigma > 0.0 { number((row.estimate - row.truth) / row.sigma, 2) } else { "–".into() };
        let is_off = row.sigma > 0.0 && (row.estimate - row.truth).abs() > 2.0 * row.sigma;
        let class = if is_off { " class=\"off\"" } else { "" };
        let (estimate, sigma) = with_sigma(row.estimate, row.sigma);
        let learnt = if is_hidden(record, &row.name) {
            format!("{estimate}<small>not shown by a table</small>")
        } else {
            format!("{estimate}<small>{}</small>", error(summary, row, row.estimate))
        };
        let _ = writeln!(
            page,
            "<tr><th scope=\"row\">{} <span class=\"unit\">{}</span></th><td>{}<small>{}</small></td><td>{learnt}</td><td>{}</td><td>{sigma}</td>\
             <td{class}>{in_sigmas}</td></tr>",
            escaped(&title(&row.name)),
            escaped(&unit(&row.unit)),
            number(row.initial, 5),
            error(summary, row, row.initial),
            number(row.truth, 5),
        );
    }
    page.push_str("</tbody></table></section>\n");
}

/// A button that takes the playback to a time.
fn time_button(t_s: f64) -> String {
    format!("<button type=\"button\" class=\"seek\" data-seek=\"{t_s}\">{t_s:.1} s</button>")
}

/// What happened, what went wrong, and the scenario itself.
pub(super) fn happenings(page: &mut String, record: &MissionRecord) {
    let summary = &record.summary;
    page.push_str("<section aria-labelledby=\"events-heading\"><h2 id=\"events-heading\">What happened</h2>\n");
    for warning in &summary.warnings {
        let _ = writeln!(page, "<p class=\"warning\">{}</p>", escaped(warning));
    }
    table(page, "table-events", "Events", ["Time", "Kind", "Event"], &record.events, |event| {
        [time_button(event.t_s), escaped(&event.kind), escaped(&event.text)]
    });
    table(page, "table-fallbacks", "Fallbacks", ["Time", "Reason"], &summary.fallbacks, |fallback| {
        [time_button(fallback.t_s), escaped(&fallback.reason)]
    });
    let faults: Vec<_> = summary.faults.iter().collect();
    table(page, "table-faults", "Faults on purpose", ["Fault", "Times"], &faults, |(name, count)| {
        [escaped(name), count.to_string()]
    });
    table(page, "table-ways", "Ways", ["Adopted", "Belief", "Points", "Edges of the tree"], &record.ways, |way| {
        [
            time_button(way.t_s),
            way.model_revision.to_string(),
            way.points_m.len().to_string(),
            way.tree_m.len().to_string(),
        ]
    });
    let _ = writeln!(
        page,
        "<details id=\"scenario\"><summary>The scenario, with which <code>tumble replay report.html</code> flies again</summary>\
         <pre>{}</pre></details></section>",
        escaped(&record.scenario_toml)
    );
}

fn table<T, const N: usize>(
    page: &mut String,
    id: &str,
    caption: &str,
    columns: [&str; N],
    rows: &[T],
    cells: impl Fn(&T) -> [String; N],
) {
    if rows.is_empty() {
        let _ = writeln!(page, "<p id=\"{id}\" class=\"about\">{caption}: none.</p>");
        return;
    }
    let _ = write!(page, "<table id=\"{id}\"><caption>{caption}</caption><thead><tr>");
    for column in columns {
        let _ = write!(page, "<th scope=\"col\">{column}</th>");
    }
    page.push_str("</tr></thead><tbody>\n");
    for row in rows {
        page.push_str("<tr>");
        for cell in cells(row) {
            let _ = write!(page, "<td>{cell}</td>");
        }
        page.push_str("</tr>\n");
    }
    page.push_str("</tbody></table>\n");
}
