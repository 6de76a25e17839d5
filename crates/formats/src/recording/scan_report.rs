//! What a scan found and what it lost.

use std::fmt::Write as _;
use std::path::Path;

/// A place from which something could not be read.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Loss {
    /// Byte of the file at which the damaged record begins.
    pub offset: u64,
    /// What is wrong there.
    pub reason: String,
    /// Whether everything after it is lost as well.
    pub ends_the_scan: bool,
}

/// What a scan found.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct ScanReport {
    /// Messages handed on.
    pub messages: u64,
    /// Bytes of the file scanned.
    pub bytes: u64,
    /// Bytes that its compressed chunks are said to hold, of those that were decompressed: never more came out.
    pub expanded_bytes: u64,
    /// What was lost, in the order of the file; at most [`ScanReport::MOST_LOSSES`] are kept.
    pub losses: Vec<Loss>,
    /// How many losses there were.
    pub loss_count: u64,
}

impl ScanReport {
    /// Losses kept with their place; more are only counted.
    pub const MOST_LOSSES: usize = 16;

    /// Chunks may become this much whatever the size of the file, bytes: as much as the longest single one.
    const FREE_EXPANSION_BYTES: u64 = 128 << 20;
    /// Beyond that they may become this many times the bytes of the file before them. Recordings of robots compress to a
    /// twentieth at best; zip bombs, which would take minutes, to a hundred-thousandth.
    const MOST_EXPANSION: u64 = 200;

    /// Notes that a chunk which ends at this byte of the file becomes so many bytes.
    ///
    /// # Errors
    /// That the file has become too much already; then nothing is noted.
    pub(super) fn expand(&mut self, end: u64, bytes: u64) -> Result<(), &'static str> {
        let most = end.saturating_mul(Self::MOST_EXPANSION).saturating_add(Self::FREE_EXPANSION_BYTES);
        let expanded = self.expanded_bytes.saturating_add(bytes);
        if expanded > most {
            return Err("a chunk left out: decompressed, the file would be over 200 times its size, as zip bombs are");
        }
        self.expanded_bytes = expanded;
        Ok(())
    }

    /// How many places are damaged, the first of them and why; `None` where none is.
    pub fn summary(&self) -> Option<String> {
        let places = match self.loss_count {
            0 => return None,
            1 => "one place".to_owned(),
            count => format!("{count} places, the first"),
        };
        let first = self.losses.first()?;
        let behind = if first.ends_the_scan { "; everything behind is lost" } else { "" };
        Some(format!("the file is damaged in {places}: byte {}: {}{behind}", first.offset, first.reason))
    }

    /// Every loss kept, a line each, for people.
    pub fn table(&self, path: &Path) -> String {
        let mut text = String::new();
        for loss in &self.losses {
            let end = if loss.ends_the_scan { "; nothing after it is read" } else { "" };
            let _ = writeln!(text, "warning: {}, byte {}: {}{end}", path.display(), loss.offset, loss.reason);
        }
        let more = self.loss_count.saturating_sub(self.losses.len() as u64);
        if more > 0 {
            let _ = writeln!(text, "warning: {}: {more} more places", path.display());
        }
        text
    }

    /// Notes a loss.
    pub fn lose(&mut self, loss: Loss) {
        self.loss_count += 1;
        if self.losses.len() < Self::MOST_LOSSES {
            self.losses.push(loss);
        }
    }
}
