//! A mission as one page: verdict, tables, plots and a playback in a single file that opens offline.
//!
//! Tables and plots are drawn here and need no script; the script turns the playback and moves the cursors. The page holds the
//! record itself, from which [`record_of`] reads it back.

mod data;
mod plots;
mod story;
mod tables;

use crate::TumbleError;
use crate::mission::MissionRecord;
use crate::page;

pub use data::record_of;

const PLAYBACK: &str = include_str!("mission_report/playback.js");
const PLAYBACK_TEST: &str = include_str!("mission_report/playback_test.js");
const VIEWER: &str = include_str!("mission_report/viewer.html");

/// The report of a mission: one self-contained page that holds the record itself.
///
/// The same record gives the same bytes.
///
/// # Errors
/// [`FormatsError::NotHeld`](tumble_formats::FormatsError::NotHeld): a number that is not finite, which the embedded data cannot hold.
pub fn html(record: &MissionRecord) -> Result<String, TumbleError> {
    let data = data::script(record)?;
    let mut page = page::opened(&format!("{} – mission report", record.summary.scenario));
    tables::header(&mut page, record);
    tables::tiles(&mut page, record);
    let (before, after) = VIEWER.split_once("<!--strip-->").unwrap_or((VIEWER, ""));
    page.push_str(before);
    plots::strip(&mut page, record);
    page.push_str(after);
    tables::parameters(&mut page, record);
    plots::write(&mut page, record);
    tables::happenings(&mut page, record);
    page::closed(&mut page, &data, &[PLAYBACK, PLAYBACK_TEST].concat());
    Ok(page)
}

/// Pictures of a mission as files of their own, with their names: the way from above, and what the mass was taken for.
pub fn pictures(record: &MissionRecord) -> [(String, String); 2] {
    plots::pictures(record).map(|chart| (format!("{}.svg", chart.id), chart.file()))
}
