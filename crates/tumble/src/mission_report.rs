//! A mission as one page: verdict, tables, plots and a playback in a single file that opens offline.
//!
//! Tables and plots are drawn here and need no script; the script turns the playback and moves the cursors. The page holds the
//! record itself, from which [`record_of`] reads it back.

mod data;
mod plot;
mod plots;
mod tables;
mod text;

use crate::TumbleError;
use crate::mission::MissionRecord;

pub use data::record_of;

const STYLE: &str = include_str!("mission_report/page.css");
const SCRIPT: &str = include_str!("mission_report/page.js");
const SELF_TEST: &str = include_str!("mission_report/self_test.js");
const VIEWER: &str = include_str!("mission_report/viewer.html");

/// The report of a mission: one self-contained page that holds the record itself.
///
/// The same record gives the same bytes.
///
/// # Errors
/// [`FormatsError::NotHeld`](tumble_formats::FormatsError::NotHeld): a number that is not finite, which the embedded data cannot hold.
pub fn html(record: &MissionRecord) -> Result<String, TumbleError> {
    let data = data::script(record)?;
    let name = text::escaped(&record.summary.scenario);
    let mut page = String::with_capacity(data.len() + (1 << 20));
    page.push_str("<!DOCTYPE html>\n<html lang=\"en\"><head><meta charset=\"utf-8\"/>\n<title>");
    page.push_str(&name);
    page.push_str(
        " – mission report</title>\n<meta name=\"viewport\" content=\"width=device-width, initial-scale=1\"/>\n\
         <meta name=\"color-scheme\" content=\"light dark\"/>\n\
         <meta http-equiv=\"Content-Security-Policy\" content=\"default-src 'none'; style-src 'unsafe-inline'; script-src 'unsafe-inline'\"/>\n\
         <style>\n",
    );
    page.push_str(STYLE);
    page.push_str("</style></head>\n<body>\n<main>\n");
    tables::header(&mut page, record);
    tables::tiles(&mut page, record);
    let (before, after) = VIEWER.split_once("<!--strip-->").unwrap_or((VIEWER, ""));
    page.push_str(before);
    plots::strip(&mut page, record);
    page.push_str(after);
    tables::parameters(&mut page, &record.summary);
    plots::write(&mut page, record);
    tables::happenings(&mut page, record);
    page.push_str("</main>\n");
    page.push_str(&data);
    page.push_str("\n<script>\n");
    page.push_str(SCRIPT);
    page.push_str(SELF_TEST);
    page.push_str("</script>\n</body></html>\n");
    Ok(page)
}
