//! Recordings of robots: ROS 1 bags, MCAP files and PX4's ULog in, MCAP, CSV and TUM out.
//!
//! A reader scans forward, chunk by chunk, and hands every message on as a [`RawMessage`]; what it says is decoded by
//! those who know the type. Damage ends or interrupts a scan but never loses what stands before it: the
//! [`ScanReport`] says what was left out and where.

pub mod bag;
pub mod flight;
mod flight_rows;
pub mod foxglove;
pub mod mcap_log;
pub mod mcap_reader;
pub mod mcap_writer;
mod merged;
pub mod messages;
pub mod rows;
pub mod topics;
pub mod tum;
pub mod ulog;
pub mod ulog_flight;
pub mod wire;

pub use flight_rows::read_flight;

use crate::FormatsError;
use std::fmt::Write as _;
use std::fs::File;
use std::io::{Read as _, Seek as _};
use std::ops::ControlFlow;
use std::path::Path;

/// A kind of recording, told by the first bytes of the file and not by its name.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum Container {
    /// ROS 1 bag, of any version.
    Bag,
    /// MCAP.
    Mcap,
    /// PX4's ULog.
    Ulog,
}

/// The kind of recording that begins with these bytes (sixteen are enough); `None` for everything else, such as CSV.
///
/// # Errors
/// [`FormatsError::Database`] for a ROS 2 database.
fn container_of(head: &[u8], path: &Path) -> Result<Option<Container>, FormatsError> {
    if head.starts_with(b"SQLite format 3\0") {
        return Err(FormatsError::Database { path: path.into() });
    }
    Ok(if head.starts_with(b"#ROSBAG ") {
        Some(Container::Bag)
    } else if head.starts_with(&mcap_reader::MAGIC) {
        Some(Container::Mcap)
    } else if head.starts_with(&ulog::MAGIC) {
        Some(Container::Ulog)
    } else {
        None
    })
}

/// Opens a file and tells what it is, from its beginning.
fn open(path: &Path) -> Result<(File, Option<Container>), FormatsError> {
    let unreadable = |source| FormatsError::Unreadable { path: path.into(), source };
    let mut file = File::open(path).map_err(unreadable)?;
    if file.metadata().map_err(unreadable)?.is_dir() {
        return Err(unreadable(std::io::ErrorKind::IsADirectory.into()));
    }
    let mut head = Vec::new();
    file.by_ref().take(16).read_to_end(&mut head).map_err(unreadable)?;
    file.rewind().map_err(unreadable)?;
    Ok((file, container_of(&head, path)?))
}

/// The kind of recording that a file is; `None` for everything else, such as CSV and what cannot be read twice.
///
/// # Errors
/// [`FormatsError::Database`] for a ROS 2 database.
pub fn container(path: &Path) -> Result<Option<Container>, FormatsError> {
    match open(path) {
        Ok((_, container)) => Ok(container),
        // Whoever opens it as something else says why it cannot be read.
        Err(FormatsError::Unreadable { .. }) => Ok(None),
        Err(error) => Err(error),
    }
}

/// Hands every message of a bag, an MCAP file or a ULog on, in the order of the file, until `visit` breaks.
///
/// # Errors
/// [`FormatsError`] for a file that cannot be opened or is no recording; damage is said in the report.
pub fn scan_file(
    path: &Path,
    visit: &mut dyn FnMut(RawMessage<'_>) -> ControlFlow<()>,
) -> Result<ScanReport, FormatsError> {
    match open(path)? {
        (file, Some(Container::Bag)) => bag::scan(file, visit),
        (file, Some(Container::Mcap)) => mcap_reader::scan(file, visit),
        (file, Some(Container::Ulog)) => {
            let scanned = ulog::scan(file, &mut |message| {
                visit(RawMessage {
                    topic: message.topic,
                    type_name: message.name,
                    md5: "",
                    encoding: Encoding::Other,
                    log_time_ns: message.time_ns,
                    payload: message.data,
                })
            });
            scanned.map(|report| report.scan)
        }
        (_, None) => {
            Err(FormatsError::UnknownRecording { reason: format!("{} is no bag, MCAP or ULog", path.display()) })
        }
    }
}

/// How the payload of a message is encoded.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
#[non_exhaustive]
pub enum Encoding {
    /// ROS 1: little-endian, packed.
    Ros1,
    /// ROS 2: OMG CDR, with its four-byte header.
    Cdr,
    /// JSON text.
    Json,
    /// Anything else: counted, not decoded.
    Other,
}

/// One message as it stands in a recording.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct RawMessage<'a> {
    /// Topic, as recorded.
    pub topic: &'a str,
    /// Type, without the `msg/` of ROS 2: `package/Name`.
    pub type_name: &'a str,
    /// md5 sum of the ROS 1 definition; empty in MCAP files of ROS 2.
    pub md5: &'a str,
    /// Encoding of `payload`.
    pub encoding: Encoding,
    /// Time at which it was recorded, ns.
    pub log_time_ns: i64,
    /// The message itself.
    pub payload: &'a [u8],
}

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
    fn expand(&mut self, end: u64, bytes: u64) -> Result<(), &'static str> {
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
