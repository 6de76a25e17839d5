//! What a whole campaign writes beside its table.

use super::analysis::Analysis;
use super::folder::write_finished;
use super::row::Row;
use super::{CampaignPlan, Shard, page};
use crate::TumbleError;
use crate::output::OutputFolder;
use std::path::{Path, PathBuf};

/// `summary.json`, pictures, and `rows.parquet` where this was built with it: the same bytes however the campaign was divided.
///
/// # Errors
/// [`TumbleError`] of writing and drawing.
pub fn write_tables(
    folder: &OutputFolder,
    plan: &CampaignPlan,
    rows: &[Row],
    analysis: &Analysis,
) -> Result<(), TumbleError> {
    let summary = serde_json::to_string_pretty(analysis).unwrap_or_default();
    folder.write("summary.json", &format!("{summary}\n"))?;
    #[cfg(feature = "parquet")]
    super::parquet_file::write(&folder.file("rows.parquet"), rows)?;
    page::write(folder, plan, rows, analysis)
}

/// The folder of a whole campaign from the rows of its parts.
///
/// # Errors
/// [`TumbleError`] of writing.
pub fn write_merged(
    place: &Path,
    plan: &CampaignPlan,
    rows: &[Row],
    analysis: &Analysis,
    force: bool,
) -> Result<PathBuf, TumbleError> {
    write_finished(place, plan.configuration(), Shard::WHOLE, rows, force, |folder| {
        write_tables(folder, plan, rows, analysis)
    })
}
