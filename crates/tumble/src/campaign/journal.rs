//! The journal of a campaign under way: each row is on file before the next is counted.

use super::row::{Row, csv_header};
use crate::TumbleError;
use std::collections::BTreeMap;
use std::fs::{File, OpenOptions, TryLockError};
use std::io::{Read as _, Write as _};
use std::path::{Path, PathBuf};
use tumble_formats::{FormatsError, text_file};

/// The file of a journal.
pub const JOURNAL: &str = "journal.csv";

/// An open journal, for one process alone.
pub struct Journal {
    path: PathBuf,
    file: File,
}

impl Journal {
    /// Opens the journal in `folder`, begun or not, and reads the rows that are whole: a torn one is dropped, and flown again.
    ///
    /// # Errors
    /// [`TumbleError::CampaignInUse`] while another process holds it; [`FormatsError::Unwritable`], [`FormatsError::Unreadable`].
    pub fn open(folder: &Path) -> Result<(Self, BTreeMap<u64, Row>), TumbleError> {
        let path = folder.join(JOURNAL);
        let unwritable = |source| FormatsError::Unwritable { path: path.clone(), source };
        if path.exists() {
            text_file::open_regular(&path).map_err(|source| FormatsError::Unreadable { path: path.clone(), source })?;
        }
        let mut file = OpenOptions::new().read(true).append(true).create(true).open(&path).map_err(unwritable)?;
        match file.try_lock() {
            Err(TryLockError::WouldBlock) => return Err(TumbleError::CampaignInUse { path: folder.into() }),
            // a file system without locks: nothing worse than rows flown twice
            Ok(()) | Err(TryLockError::Error(_)) => {}
        }
        let mut bytes = Vec::new();
        file.read_to_end(&mut bytes).map_err(|source| FormatsError::Unreadable { path: path.clone(), source })?;
        let rows: BTreeMap<u64, Row> =
            bytes.split(|byte| *byte == b'\n').filter_map(entry).map(|row| (row.number, row)).collect();
        let mut journal = Self { path, file };
        let whole = bytes.is_empty() || bytes.ends_with(b"\n");
        if !whole {
            // what follows must not become part of the torn line
            journal.append(b"\n")?;
        }
        if bytes.is_empty() {
            journal.append(first_line().as_bytes())?;
        }
        Ok((journal, rows))
    }

    /// Writes a row down.
    ///
    /// # Errors
    /// [`FormatsError::Unwritable`].
    pub fn write(&mut self, row: &Row) -> Result<(), TumbleError> {
        let line = row.to_csv();
        self.append(format!("{line},{:08x}\n", crc32fast::hash(line.as_bytes())).as_bytes())
    }

    /// Forgets everything.
    ///
    /// # Errors
    /// [`FormatsError::Unwritable`].
    pub fn restart(&mut self) -> Result<(), TumbleError> {
        self.file.set_len(0).map_err(|source| FormatsError::Unwritable { path: self.path.clone(), source })?;
        self.append(first_line().as_bytes())
    }

    fn append(&mut self, bytes: &[u8]) -> Result<(), TumbleError> {
        Ok(self.file.write_all(bytes).map_err(|source| FormatsError::Unwritable { path: self.path.clone(), source })?)
    }

    /// Waits until all rows are on the disk.
    ///
    /// # Errors
    /// [`FormatsError::Unwritable`].
    pub fn sync(&self) -> Result<(), TumbleError> {
        Ok(self.file.sync_all().map_err(|source| FormatsError::Unwritable { path: self.path.clone(), source })?)
    }
}

/// The row of a line whose checksum holds.
fn entry(line: &[u8]) -> Option<Row> {
    let (row, checksum) = std::str::from_utf8(line).ok()?.rsplit_once(',')?;
    (checksum == format!("{:08x}", crc32fast::hash(row.as_bytes()))).then(|| Row::from_csv(row))?
}

fn first_line() -> String {
    format!("{},crc32\n", csv_header())
}
