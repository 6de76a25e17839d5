//! The record inside the page, and out of it again.

use crate::error::AstrobeeError;
use crate::mission::MissionRecord;

/// How the element that holds the record begins.
const OPENING: &str = "<script type=\"application/json\" id=\"mission-record\">";
const CLOSING: &str = "</script>";

/// The element that holds the record.
///
/// Inside, `<`, `>`, `&` and the two line separators of Unicode are written as escapes, so that no text of the record can
/// end the element, open a comment or break a script.
///
/// # Errors
/// [`AstrobeeError::NotHeld`]: a number that is not finite.
pub(super) fn script(record: &MissionRecord) -> Result<String, AstrobeeError> {
    let refused = |what| AstrobeeError::NotHeld { path: "report.html".into(), format: "a report", what };
    let json = serde_json::to_string(record).map_err(|_| refused("this record"))?;
    // JSON writes a number that is not finite as `null`, which no number reads back.
    if serde_json::from_str::<MissionRecord>(&json).is_err() {
        return Err(refused("numbers that are not finite"));
    }
    let mut page = String::with_capacity(json.len() + 128);
    page.push_str(OPENING);
    for character in json.chars() {
        match character {
            '<' => page.push_str("\\u003c"),
            '>' => page.push_str("\\u003e"),
            '&' => page.push_str("\\u0026"),
            '\u{2028}' => page.push_str("\\u2028"),
            '\u{2029}' => page.push_str("\\u2029"),
            other => page.push(other),
        }
    }
    page.push_str(CLOSING);
    Ok(page)
}

/// The record inside a report.
///
/// # Errors
/// [`AstrobeeError::BadReport`]: no report, or one that was damaged.
pub fn record_of(html: &str) -> Result<MissionRecord, AstrobeeError> {
    let bad = |line: usize, message: String| AstrobeeError::BadReport { line, message };
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
    if record.summary.format != 1 {
        return Err(bad(line, format!("format {} of a mission record, only 1 is known", record.summary.format)));
    }
    Ok(record)
}
