//! Parts into a whole.

use super::plan::differing_keys;
use super::row::{ROWS, Row, csv_header};
use super::{CampaignConfiguration, CampaignPlan, Shard};
use crate::TumbleError;
use crate::output::RUN_RECORD;
use std::collections::BTreeMap;
use std::fs;
use std::path::{Path, PathBuf};
use tumble_formats::FormatsError;
use tumble_formats::{log, text_file};

/// A finished folder of a campaign, or of a part of one.
#[derive(Clone, Debug, PartialEq)]
pub struct Part {
    /// Where.
    pub path: PathBuf,
    /// Of which campaign.
    pub configuration: CampaignConfiguration,
    /// Which part.
    pub shard: Shard,
    /// Its rows in order.
    pub rows: Vec<Row>,
}

fn bad(path: &Path, message: impl Into<String>) -> TumbleError {
    TumbleError::BadCampaign { path: path.into(), message: message.into() }
}

fn read(path: &Path) -> Result<String, TumbleError> {
    Ok(text_file::read_regular(path).map_err(|source| FormatsError::Unreadable { path: path.into(), source })?)
}

impl Part {
    /// What a folder's run record says it is.
    ///
    /// # Errors
    /// [`FormatsError::Unreadable`], [`TumbleError::BadCampaign`].
    pub fn read_record(folder: &Path) -> Result<(CampaignConfiguration, Shard), TumbleError> {
        let (configuration, shard, _) = record(folder)?;
        Ok((configuration, shard))
    }

    /// Reads a folder, and checks that nothing in its table was changed.
    ///
    /// # Errors
    /// [`FormatsError::Unreadable`], [`TumbleError::BadCampaign`].
    pub fn read(folder: &Path) -> Result<Self, TumbleError> {
        let (configuration, shard, hash) = record(folder)?;
        let path = folder.join(ROWS);
        if log::hash(&path)? != hash {
            return Err(bad(&path, "the table is not the one that was written"));
        }
        let text = read(&path)?;
        let mut lines = text.lines();
        if lines.next() != Some(csv_header().as_str()) {
            return Err(bad(&path, "line 1: other columns"));
        }
        let row = |(number, line): (usize, &str)| {
            Row::from_csv(line).ok_or_else(|| bad(&path, format!("line {number}: no row of a campaign")))
        };
        let rows = (2..).zip(lines).map(row).collect::<Result<Vec<Row>, _>>()?;
        Ok(Self { path: folder.to_path_buf(), configuration, shard, rows })
    }
}

/// Configuration, part, and hash of the table.
fn record(folder: &Path) -> Result<(CampaignConfiguration, Shard, String), TumbleError> {
    let path = folder.join(RUN_RECORD);
    let no_campaign = |error: serde_json::Error| bad(&path, format!("no run record of a campaign: {error}"));
    let mut value: serde_json::Value = serde_json::from_str(&read(&path)?).map_err(no_campaign)?;
    let mut take = |key: &str| value.get_mut(key).map(serde_json::Value::take).unwrap_or_default();
    let configuration = serde_json::from_value(take("configuration")).map_err(no_campaign)?;
    let shard = serde_json::from_value(take("shard")).map_err(no_campaign)?;
    let hash = serde_json::from_value(take("rows_hash")).map_err(no_campaign)?;
    Ok((configuration, shard, hash))
}

/// The whole campaign from its parts; each folder is a part, or holds parts.
///
/// # Errors
/// [`TumbleError::BadCampaign`] for a gap, a part that is there twice, another version or other options, rows that are not the plan's;
/// [`FormatsError::Unreadable`].
pub fn merge(folders: &[PathBuf]) -> Result<(CampaignPlan, Vec<Row>), TumbleError> {
    let mut parts: BTreeMap<u64, Part> = BTreeMap::new();
    let mut first: Option<(PathBuf, CampaignConfiguration, u64)> = None;
    for folder in part_folders(folders)? {
        let part = Part::read(&folder)?;
        match &first {
            None => first = Some((folder.clone(), part.configuration.clone(), part.shard.count)),
            Some((path, configuration, _)) if *configuration != part.configuration => {
                let keys = differing_keys(configuration, &part.configuration);
                return Err(bad(&folder, format!("not of the campaign that {} is of: other {keys}", path.display())));
            }
            Some((path, _, count)) if *count != part.shard.count => {
                let message = format!("one of {} parts, but {} is one of {count}", part.shard.count, path.display());
                return Err(bad(&folder, message));
            }
            Some(_) => {}
        }
        if let Some(other) = parts.insert(part.shard.index, part) {
            return Err(bad(&folder, format!("this part is there twice: {}", other.path.display())));
        }
    }
    let Some((path, configuration, count)) = first else {
        return Err(bad(folders.first().map_or(Path::new("."), PathBuf::as_path), "no part of a campaign"));
    };
    let missing: Vec<String> = (0..count).filter(|index| !parts.contains_key(index)).map(|i| i.to_string()).collect();
    if !missing.is_empty() {
        let shown = missing.iter().take(20).cloned().collect::<Vec<_>>().join(", ");
        let more = if missing.len() > 20 { ", ..." } else { "" };
        let beside = path.parent().unwrap_or(Path::new("."));
        return Err(bad(
            beside,
            format!("{} of {count} parts are missing or unfinished: {shown}{more}", missing.len()),
        ));
    }
    let plan = CampaignPlan::try_new(configuration)?;
    let mut rows = Vec::new();
    for part in parts.into_values() {
        check(&plan, &part)?;
        rows.extend(part.rows);
    }
    Ok((plan, rows))
}

/// That a part holds its rows, each once, in order.
fn check(plan: &CampaignPlan, part: &Part) -> Result<(), TumbleError> {
    let expected = part.shard.rows(plan.rows());
    if part.rows.len() as u64 != expected.end - expected.start {
        let message = format!("{} rows, but this part has {}", part.rows.len(), expected.end - expected.start);
        return Err(bad(&part.path.join(ROWS), message));
    }
    for (number, row) in expected.zip(&part.rows) {
        if !plan.mission(number).is_some_and(|mission| row.is_of(&mission)) {
            return Err(bad(
                &part.path.join(ROWS),
                format!("where row {number} should be is row {} or another seed", row.number),
            ));
        }
    }
    Ok(())
}

/// Folders of parts in the order of their names.
fn part_folders(folders: &[PathBuf]) -> Result<Vec<PathBuf>, TumbleError> {
    let mut found = Vec::new();
    for folder in folders {
        if folder.join(RUN_RECORD).exists() {
            found.push(folder.clone());
            continue;
        }
        let entries =
            fs::read_dir(folder).map_err(|source| FormatsError::Unreadable { path: folder.clone(), source })?;
        let mut inside: Vec<PathBuf> =
            entries.flatten().map(|entry| entry.path()).filter(|path| is_part(path)).collect();
        if inside.is_empty() {
            return Err(bad(folder, "neither a part of a campaign nor a folder of finished parts"));
        }
        inside.sort();
        found.append(&mut inside);
    }
    Ok(found)
}

/// Whether a folder has the name of a finished part.
fn is_part(path: &Path) -> bool {
    let numbers = path.file_name().and_then(|name| name.to_str()?.strip_prefix("part-")?.split_once("-of-"));
    numbers.is_some_and(|(index, count)| {
        [index, count].iter().all(|n| !n.is_empty() && n.bytes().all(|b| b.is_ascii_digit()))
    })
}
