//! The mission report: one file, nothing from outside, the record inside, every plot there; and each check bites.
#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic)]

use crate::support::page_checks::{CHECKS, findings, findings_of_any};
use crate::support::sample_record::{planar_sample, sample};
use std::path::Path;
use std::sync::LazyLock;
use tumble::TumbleError;
use tumble::mission::{
    DoubtOf, DoubtRow, LayerNames, MissionEvent, MissionRecord, MissionSummary, Series, StretchRow, WayRow,
};
use tumble::mission_report::{html, record_of};
use tumble_formats::FormatsError;

static PAGE: LazyLock<String> = LazyLock::new(|| html(&sample()).unwrap());

fn read(page: &str) -> Result<MissionRecord, TumbleError> {
    record_of(page, Path::new("copy.html"))
}

/// What someone might call a scenario, or an event.
const HOSTILE: [&str; 9] = [
    "</script><script>alert(1)</script>",
    "<!--<script>",
    "-->\" onmouseover=\"alert(1)",
    "'><img src=x onerror=alert(1)>",
    "]]>&lt;&amp;{{x}}",
    "a\u{2028}b\u{2029}c",
    "\u{202e}gnp.exe",
    "nul \u{0} bell \u{7} escape \u{1b}[31m delete \u{7f}",
    "</title><svg/onload=alert(1)>",
];

#[test]
fn the_page_passes_every_check() {
    assert_eq!(findings(&PAGE), Vec::<String>::new());
    assert_eq!(findings(&html(&planar_sample()).unwrap()), Vec::<String>::new());
}

#[test]
fn the_embedded_record_is_the_record() {
    for record in [sample(), planar_sample(), bare()] {
        assert_eq!(read(&html(&record).unwrap()).unwrap(), record);
    }
}

#[test]
fn the_same_record_gives_the_same_bytes() {
    assert!(html(&sample()).unwrap() == *PAGE);
}

#[test]
fn a_mission_of_150_s_takes_less_than_3_mb() {
    assert!(PAGE.len() < 3_000_000, "{} bytes", PAGE.len());
}

/// A mission that ended before it began.
fn bare() -> MissionRecord {
    let mut record = sample();
    record.series = Series::default();
    record.ways.clear();
    record.stretches.clear();
    record.beliefs.clear();
    record.events.clear();
    record.obstacles.clear();
    record.keep_in.clear();
    record.keep_out.clear();
    record.summary.parameters.clear();
    record.summary.fallbacks.clear();
    record.summary.information_shut_off_s.clear();
    record.summary.arrived = false;
    record.summary.min_clearance_m = Some(-0.01);
    record.summary.limit_violations = 3;
    record
}

#[test]
fn the_verdict_is_that_of_the_summary() {
    assert!(PAGE.contains("Mission accomplished"));
    let page = html(&bare()).unwrap();
    assert_eq!(findings(&page), Vec::<String>::new().into_iter().chain(missing_estimates()).collect::<Vec<_>>());
    for text in ["Mission not accomplished", "✗ did not arrive", "✗ collided", "✗ limits passed in 3 periods"] {
        assert!(page.contains(text), "{text}");
    }
}

fn doubt(what: DoubtOf, until_s: Option<f64>) -> DoubtRow {
    DoubtRow { what, since_s: 12.5, until_s, text: "a <reason>".into() }
}

#[test]
fn a_doubt_that_stands_is_told_first_and_is_not_green() {
    let mut record = sample();
    record.summary.doubts = vec![doubt(DoubtOf::Map, Some(20.0))];
    let lifted = html(&record).unwrap();
    assert!(lifted.contains("class=\"verdict good\"><b>Mission accomplished</b>"));
    assert!(lifted.contains("– <b>map</b> in doubt from 12.5 s, until 20.0 s: a &lt;reason&gt;"));
    record.summary.doubts.extend([doubt(DoubtOf::Actuators, None), doubt(DoubtOf::Body, None)]);
    let page = html(&record).unwrap();
    assert_eq!(findings(&page), Vec::<String>::new());
    assert!(
        page.contains("class=\"verdict doubted\"><b>? Arrived, but the robot doubts its body and its actuators</b>")
    );
    assert!(page.contains("? <b>body</b> in doubt from 12.5 s, still at the end"));
    assert!(!page.contains("Mission accomplished"));
    record.summary.arrived = false;
    assert!(html(&record).unwrap().contains("class=\"verdict bad\"><b>Mission not accomplished</b>"));
}

#[test]
fn a_summary_of_before_there_were_doubts_and_names_of_layers_is_read() {
    let mut summary = sample().summary;
    summary.doubts = vec![doubt(DoubtOf::Body, None)];
    let mut written = serde_json::to_value(&summary).unwrap();
    assert_eq!(
        written["doubts"],
        serde_json::json!([{ "what": "body", "since_s": 12.5, "until_s": null, "text": "a <reason>" }])
    );
    for later in ["doubts", "layers"] {
        assert!(written.as_object_mut().unwrap().remove(later).is_some());
    }
    let read: MissionSummary = serde_json::from_value(written).unwrap();
    assert_eq!(read, MissionSummary { doubts: Vec::new(), layers: LayerNames::default(), ..summary });
}

/// Without parameters there is nothing to plot of them.
fn missing_estimates() -> Vec<String> {
    (0..10).map(|index| format!("plot: no `plot-estimate-{index}`")).collect()
}

#[test]
fn errors_are_told_in_standard_deviations() {
    let mut record = sample();
    let row = &mut record.summary.parameters[0];
    (row.truth, row.estimate, row.sigma) = (11.0, 11.5, 0.2);
    let page = html(&record).unwrap();
    let told = "<td>20.000<small>+82 %</small></td><td>11.50<small>+4.5 %</small></td><td>11.000</td><td>0.20</td><td class=\"off\">2.5</td>";
    assert!(page.contains(told));
}

#[test]
fn predicted_information_follows_the_stretches() {
    let mut record = sample();
    record.series.sigma.iter_mut().for_each(|row| row[0] = 0.1);
    record.stretches = vec![StretchRow {
        start_s: 0.0,
        end_s: 75.0,
        quantities: vec!["mass".into()],
        weights: vec![1.0],
        sigma: vec![[0.1, 0.01]],
        information: vec![9900.0],
        ..StretchRow::default()
    }];
    let page = html(&record).unwrap();
    let figure = page.split("id=\"plot-information-mass\"").nth(1).unwrap().split("</figure>").next().unwrap();
    // From 1/0.1^2 = 100 to 1/0.01^2 = 100 + 9900: two decades of 168/2.3 each, with room of 0.15 at both ends.
    assert!(figure.contains("d=\"M152 11h0\""), "{figure}");
    assert!(figure.contains("c0 dashed\" d=\"M0 157L152 11\""), "{figure}");
}

#[test]
fn hostile_names_stay_texts() {
    for name in HOSTILE {
        let mut record = sample();
        record.summary.scenario = name.into();
        record.scenario_toml = name.into();
        record.version = name.into();
        record.events.push(MissionEvent { t_s: 1.0, kind: name.into(), text: name.into() });
        record.summary.warnings.push(name.into());
        record.summary.fallbacks[0].reason = name.into();
        record.summary.faults.insert(name.into(), 1);
        record.summary.parameters[0].name = name.into();
        record.summary.parameters[0].unit = name.into();
        record.summary.information_shut_off_s.insert(name.into(), 3.0);
        record.stretches[0].quantities[0] = name.into();
        record.ways.push(WayRow::default());
        let page = html(&record).unwrap();
        assert_eq!(findings(&page), Vec::<String>::new(), "{name}");
        assert_eq!(read(&page).unwrap(), record, "{name}");
        assert_eq!(page.matches("<script").count(), 2, "{name}");
        assert_eq!(page.matches("</script").count(), 2, "{name}");
        assert!(!page.contains("<!--") && !page.contains("<img") && !page.contains("<svg/"), "{name}");
        assert!(!page.contains(['\u{0}', '\u{7}', '\u{1b}', '\u{2028}', '\u{2029}', '\u{202e}']), "{name}");
    }
}

#[test]
fn a_number_that_is_none_is_refused() {
    let mut record = sample();
    record.series.force_n[3][1] = f64::NAN;
    assert!(matches!(html(&record), Err(TumbleError::File(FormatsError::NotHeld { .. }))));
}

#[test]
fn pages_that_are_no_reports_are_refused() {
    let cut = &PAGE[..PAGE.find("\"robot_radius_m\"").unwrap()];
    let torn = PAGE.replace("\"robot_radius_m\":", "\"robot_radius\":");
    let newer = PAGE.replace("{\"summary\":{\"format\":1", "{\"summary\":{\"format\":2");
    let ragged = {
        let mut record = sample();
        record.series.clearance_m.pop();
        html(&record)
    };
    assert!(matches!(ragged, Err(TumbleError::File(FormatsError::NotHeld { .. }))), "columns of unequal length");
    for (page, reason) in [
        ("", "no mission record"),
        ("<html></html>", "no mission record"),
        (cut, "cut off"),
        (&torn, "robot_radius_m"),
        (&newer, "only 1 is known"),
    ] {
        let error = read(page).unwrap_err();
        assert_eq!(error.code(), "T036");
        assert!(error.to_string().contains(reason), "{error}");
        assert!(error.to_string().contains("copy.html, line ") && !error.remedy().is_empty());
    }
}

#[test]
fn no_cut_of_a_report_is_a_panic() {
    let start = PAGE.find("id=\"mission-record\"").unwrap() - 40;
    let end = PAGE.rfind("</script>").unwrap();
    for k in 0..60 {
        let mut at = start + (end - start) * k / 60;
        while !PAGE.is_char_boundary(at) {
            at += 1;
        }
        let complete = PAGE[start..].find("</script>").unwrap() + start;
        assert_eq!(read(&PAGE[..at]).is_err(), at < complete + 9, "{at}");
    }
}

#[test]
fn what_every_page_must_have_is_missed() {
    let sound = "<p id=\"story\" class=\"story\">";
    let said = "What was asked for stands here. How it ended stands here, and in some more words. How sure that is stands here, too, at last.";
    let page = |story: &str, chart: &str| {
        PAGE.replacen("</main>", &format!("{chart}</main>"), 1).replacen(
            PAGE.split(sound).nth(1).unwrap().split("</p>").next().unwrap(),
            story,
            1,
        )
    };
    let of = |page: &str, what: &str| findings_of_any(page).iter().any(|found| found.starts_with(what));
    assert!(!of(&page(said, ""), "story"));
    assert!(of(&page("It worked.", ""), "story"));
    let chart = |line: &str| format!("<figure class=\"plot\" id=\"more\"><svg aria-label=\"x\">{line}</svg></figure>");
    assert!(!of(&page(said, &chart("<path class=\"line c0\" d=\"M0 0L1 1\"/>")), "chart: id=\"more\""));
    assert!(of(&page(said, &chart("")), "chart: id=\"more\""));
    assert!(of(&page(said, &chart("<path class=\"line c0\" d=\"M0 NaN\"/>")), "chart: id=\"more\""));
    assert!(of(&page(said, &" ".repeat(1_600_000)), "size"));
}

/// A defect in the page, and the check that must see it.
#[test]
fn each_check_bites() {
    let after = |mark: &str, text: &str| PAGE.replacen(mark, &format!("{mark}{text}"), 1);
    let main = "<main>";
    let defects: Vec<(&str, String)> = vec![
        ("outside", after(main, "<img alt=\"\" src=\"a.png\"/>")),
        ("outside", after(main, "<a href=\"other.html\">x</a>")),
        ("outside", after("<style>", "p { background: url(a.png) }")),
        ("outside", after("<style>", "@import 'a.css';")),
        ("outside", after("'use strict';", "fetch('a');")),
        ("outside", after("'use strict';", "import('a');")),
        ("outside", after("'use strict';", "new XMLHttpRequest();")),
        ("outside", after("'use strict';", "// see //example.org/a")),
        ("outside", after(main, "http://example.org")),
        ("outside", after(main, "<iframe></iframe>")),
        ("policy", PAGE.replacen("default-src 'none'", "default-src *", 1)),
        ("ids", after(main, "<p id=\"strip\"></p>")),
        ("tags", after(main, "<div>")),
        ("tags", after(main, "</p>")),
        ("tags", after(main, "<b><i></b></i>")),
        ("tags", after(main, "<p class=a></p>")),
        ("tags", after(main, "a < b")),
        ("tags", after(main, "a & b")),
        ("plot", PAGE.replacen("id=\"plot-clearance\"", "id=\"plot-clear\"", 1)),
        (
            "plot",
            PAGE.replacen("<figcaption><b>Force x</b>", "<b>Force x</b>", 1).replace("id=\"plot-force-x\"", "id=\"x\""),
        ),
        ("accessible", after(main, "<table id=\"t\"><tbody><tr><td>1</td></tr></tbody></table>")),
        ("accessible", after(main, "<svg xmlns=\"http://www.w3.org/2000/svg\"></svg>")),
        ("accessible", after(main, "<button type=\"button\"></button>")),
        ("accessible", PAGE.replacen("<html lang=\"en\">", "<html>", 1)),
        ("script", after("'use strict';", "eval('1');")),
        ("script", after("'use strict';", "document.body.innerHTML = '';")),
        ("script", after(main, "<p onclick=\"x()\">x</p>")),
        ("record", PAGE.replacen("\"format\":1", "\"format\":9", 1)),
        ("record", PAGE.replacen("id=\"mission-record\"", "id=\"mission-records\"", 1)),
    ];
    for (check, page) in &defects {
        assert_ne!(*page, *PAGE, "{check}: the defect was not planted");
        let found = findings(page);
        assert!(found.iter().any(|finding| finding.starts_with(&format!("{check}: "))), "{check}: {found:?}");
    }
    for (name, _) in CHECKS {
        assert!(defects.iter().any(|(check, _)| *check == name), "no defect for `{name}`");
    }
}
