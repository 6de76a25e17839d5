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
mod raw_message;
pub mod rows;
mod scan_report;
pub mod topics;
pub mod tum;
pub mod ulog;
pub mod ulog_flight;
pub mod wire;

pub use flight_rows::read_flight;
pub use raw_message::{Encoding, RawMessage};
pub use scan_report::{Loss, ScanReport};

use crate::FormatsError;
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
