//! Folders of campaigns: unfinished ones that a killed run left and the next one goes on with, and finished ones.

use super::journal::{JOURNAL, Journal};
use super::merge::Part;
use super::plan::differing_keys;
use super::row::{ROWS, Row, csv_header};
use super::{CampaignConfiguration, Shard};
use crate::TumbleError;
use crate::output::{self, OutputFolder, RUN_RECORD};
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;
use std::fs::{self, File};
use std::path::{Path, PathBuf};
use tumble_formats::FormatsError;
use tumble_formats::{log, text_file};

/// What an unfinished folder is of.
const CAMPAIGN: &str = "campaign.json";

/// What `campaign.json` holds.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct Begun {
    configuration: CampaignConfiguration,
    shard: Shard,
}

/// Where a campaign's rows are collected before its folder `place` appears.
pub fn unfinished_place(place: &Path) -> PathBuf {
    let mut name = place.file_name().unwrap_or_default().to_os_string();
    name.push(".unfinished");
    place.with_file_name(name)
}

/// What is at a place.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Place {
    /// Nothing, or `--force` replaces what is there.
    Free,
    /// The same campaign, unfinished.
    Begun,
    /// The same part of the same campaign, complete.
    Complete,
    /// Something else.
    Taken,
}

impl Place {
    /// Looks; nothing is changed.
    pub fn look(place: &Path, configuration: &CampaignConfiguration, shard: Shard) -> Self {
        let begun = Begun { configuration: configuration.clone(), shard };
        let finished = place.symlink_metadata().is_ok();
        if finished && Part::read_record(place).is_ok_and(|found| found == (begun.configuration.clone(), begun.shard)) {
            return Self::Complete;
        }
        let unfinished = unfinished_place(place);
        match (finished, unfinished.symlink_metadata().is_ok()) {
            (false, false) => Self::Free,
            (false, true) if read_begun(&unfinished).is_ok_and(|found| found == Some(begun)) => Self::Begun,
            _ => Self::Taken,
        }
    }
}

/// What an unfinished folder is of; `None` where it is empty yet.
fn read_begun(unfinished: &Path) -> Result<Option<Begun>, TumbleError> {
    let path = unfinished.join(CAMPAIGN);
    if !path.exists() {
        return Ok(None);
    }
    let text =
        text_file::read_regular(&path).map_err(|source| FormatsError::Unreadable { path: path.clone(), source })?;
    serde_json::from_str(&text)
        .map(Some)
        .map_err(|error| TumbleError::BadCampaign { path, message: format!("no record of a campaign: {error}") })
}

/// A campaign, or a part of one, under way.
pub struct CampaignFolder {
    place: PathBuf,
    unfinished: PathBuf,
    begun: Begun,
    force: bool,
    journal: Journal,
}

impl CampaignFolder {
    /// Begins, or goes on with what was begun; the rows are those found in the journal.
    ///
    /// # Errors
    /// [`TumbleError::OutputExists`] and [`TumbleError::NotAResult`] as [`OutputFolder::check_place`];
    /// [`TumbleError::BadCampaign`] where another campaign was begun, unless `force` gives it up;
    /// [`TumbleError::CampaignInUse`]; [`FormatsError::Unwritable`].
    pub fn open(
        place: &Path,
        configuration: &CampaignConfiguration,
        shard: Shard,
        force: bool,
    ) -> Result<(Self, BTreeMap<u64, Row>), TumbleError> {
        if place.file_name().is_none() {
            let message = format!("`--out {}` is not the name of a folder", place.display());
            return Err(TumbleError::BadOption { message });
        }
        OutputFolder::check_place(place, force)?;
        let unfinished = unfinished_place(place);
        fs::create_dir_all(&unfinished)
            .map_err(|source| FormatsError::Unwritable { path: unfinished.clone(), source })?;
        let begun = Begun { configuration: configuration.clone(), shard };
        let (mut journal, mut rows) = Journal::open(&unfinished)?;
        match read_begun(&unfinished) {
            Ok(Some(found)) if found == begun => {}
            Ok(None) if rows.is_empty() => {}
            _ if force => {
                rows.clear();
                journal.restart()?;
            }
            Err(error) => return Err(error),
            Ok(found) => {
                let message = different(found.as_ref(), &begun);
                return Err(TumbleError::BadCampaign { path: unfinished, message });
            }
        }
        let text = serde_json::to_string_pretty(&begun).unwrap_or_default();
        output::write_file(&unfinished.join(CAMPAIGN), format!("{text}\n").as_bytes(), true)?;
        Ok((Self { place: place.to_path_buf(), unfinished, begun, force, journal }, rows))
    }

    /// Where rows go while they are flown.
    pub fn journal(&mut self) -> &mut Journal {
        &mut self.journal
    }

    /// Lets the finished folder appear, with all `rows` in order and what `add` writes beside them, and removes the unfinished one.
    ///
    /// # Errors
    /// [`TumbleError`] of writing; the rows are then still in the unfinished folder.
    pub fn finish(
        self,
        rows: &[Row],
        add: impl FnOnce(&OutputFolder) -> Result<(), TumbleError>,
    ) -> Result<PathBuf, TumbleError> {
        let place = write_finished(&self.place, &self.begun.configuration, self.begun.shard, rows, self.force, add)?;
        drop(self.journal);
        // Nothing but these two is ours; a folder that holds more stays.
        for name in [JOURNAL, CAMPAIGN] {
            let _ = fs::remove_file(self.unfinished.join(name));
        }
        let _ = fs::remove_dir(&self.unfinished);
        Ok(place)
    }
}

/// Writes a finished folder: table, run record, and what `add` writes.
pub(super) fn write_finished(
    place: &Path,
    configuration: &CampaignConfiguration,
    shard: Shard,
    rows: &[Row],
    force: bool,
    add: impl FnOnce(&OutputFolder) -> Result<(), TumbleError>,
) -> Result<PathBuf, TumbleError> {
    let folder = OutputFolder::create(place, force)?;
    let mut table = csv_header();
    table.push('\n');
    for row in rows {
        table.push_str(&row.to_csv());
        table.push('\n');
    }
    folder.write(ROWS, &table)?;
    let hashes: BTreeMap<&str, &str> =
        configuration.scenarios.iter().map(|scenario| (scenario.name.as_str(), scenario.hash.as_str())).collect();
    let record = serde_json::json!({
        "format": 1,
        "version": configuration.version,
        "commit": option_env!("TUMBLE_COMMIT"),
        "command": "campaign",
        "configuration": configuration,
        "shard": shard,
        "seed": configuration.master_seed,
        "input_hash": hashes,
        "rows_hash": log::hash(&folder.file(ROWS))?,
    });
    folder.write(RUN_RECORD, &format!("{record:#}\n"))?;
    add(&folder)?;
    for name in [ROWS, RUN_RECORD] {
        let path = folder.file(name);
        let synced = File::open(&path).and_then(|file| file.sync_all());
        synced.map_err(|source| FormatsError::Unwritable { path, source })?;
    }
    folder.finish()
}

/// In what another campaign differs.
fn different(found: Option<&Begun>, wanted: &Begun) -> String {
    let Some(found) = found else { return "rows of a campaign that is not named".to_owned() };
    if found.configuration != wanted.configuration {
        let names = differing_keys(&found.configuration, &wanted.configuration);
        return format!("another campaign was begun here: other {names}");
    }
    format!("here was begun {} of the campaign, not {}", found.shard.name(), wanted.shard.name())
}
