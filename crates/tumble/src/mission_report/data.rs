//! The record inside the page, and out of it again.

use crate::TumbleError;
use crate::mission::{MissionRecord, Series};
use std::fmt::Write as _;
use std::path::Path;
use tumble_formats::FormatsError;

/// How the element that holds the record begins.
const OPENING: &str = "<script type=\"application/json\" id=\"mission-record\">";
const CLOSING: &str = "</script>";

/// The element that holds the record.
///
/// Inside, `<`, `>`, `&`, controls, the line separators of Unicode and marks of direction are written as escapes, so that no
/// text of the record can end the element, open a comment, break a script or look like something else.
///
/// # Errors
/// [`FormatsError::NotHeld`]: a number that is not finite.
pub(super) fn script(record: &MissionRecord) -> Result<String, TumbleError> {
    let refused = |what| FormatsError::NotHeld { path: "report.html".into(), format: "a report", what };
    if !has_equal_columns(&record.series) {
        return Err(refused("series of unequal length").into());
    }
    let json = serde_json::to_string(record).map_err(|_| refused("this record"))?;
    // JSON writes a number that is not finite as `null`, which no number reads back.
    if serde_json::from_str::<MissionRecord>(&json).is_err() {
        return Err(refused("numbers that are not finite").into());
    }
    let mut page = String::with_capacity(json.len() + 128);
    page.push_str(OPENING);
    for character in json.chars() {
        match character {
            '<' | '>' | '&' | '\u{7f}'..='\u{9f}' | '\u{2028}'..='\u{202e}' | '\u{2066}'..='\u{2069}' => {
                let _ = write!(page, "\\u{:04x}", u32::from(character));
            }
            other => page.push(other),
        }
    }
    page.push_str(CLOSING);
    Ok(page)
}

/// The record inside a report, which errors call `path`.
///
/// # Errors
/// [`TumbleError::BadReport`]: no report, or one that was damaged.
pub fn record_of(html: &str, path: &Path) -> Result<MissionRecord, TumbleError> {
    let bad = |line: usize, message: String| TumbleError::BadReport { path: path.to_owned(), line, message };
    let Some((before, rest)) = html.split_once(OPENING) else {
        return Err(bad(1, "the page holds no mission record".into()));
    };
    let line = before.matches('\n').count() + 1;
    let Some((json, _)) = rest.split_once(CLOSING) else {
        return Err(bad(line, "the mission record is cut off".into()));
    };
    let record: MissionRecord = serde_json::from_str(json).map_err(|error| {
        bad(line + error.line().saturating_sub(1), format!("the mission record is damaged: {error}"))
    })?;
    if !has_equal_columns(&record.series) {
        return Err(bad(line, "the series of the mission record are of unequal length".into()));
    }
    if record.summary.format != 1 {
        return Err(bad(line, format!("format {} of a mission record, only 1 is known", record.summary.format)));
    }
    Ok(record)
}

fn has_equal_columns(series: &Series) -> bool {
    let lengths = [
        series.position_m.len(),
        series.quaternion_xyzw.len(),
        series.wanted_position_m.len(),
        series.wanted_quaternion_xyzw.len(),
        series.believed_position_m.len(),
        series.tracking_error_m.len(),
        series.attitude_error_rad.len(),
        series.tube_m.len(),
        series.force_n.len(),
        series.torque_n_m.len(),
        series.clearance_m.len(),
        series.estimate.len(),
        series.sigma.len(),
        series.belief_revision.len(),
        series.plan_revision.len(),
    ];
    lengths.iter().all(|&length| length == series.t_s.len())
}
