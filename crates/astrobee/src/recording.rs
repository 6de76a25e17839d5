//! Recordings of robots: ROS 1 bags and MCAP files in, MCAP, CSV and TUM out.
//!
//! A reader scans forward, chunk by chunk, and hands every message on as a [`RawMessage`]; what it says is decoded by
//! those who know the type. Damage ends or interrupts a scan but never loses what stands before it: the
//! [`ScanReport`] says what was left out and where.

pub mod bag;
pub mod foxglove;
pub mod mcap_log;
pub mod mcap_reader;
pub mod mcap_writer;
pub mod messages;
pub mod rows;
pub mod tum;
pub mod wire;

/// How the payload of a message is encoded.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
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
    /// What was lost, in the order of the file; at most [`ScanReport::MOST_LOSSES`] are kept.
    pub losses: Vec<Loss>,
    /// How many losses there were.
    pub loss_count: u64,
}

impl ScanReport {
    /// Losses kept with their place; more are only counted.
    pub const MOST_LOSSES: usize = 16;

    /// Notes a loss.
    pub fn lose(&mut self, loss: Loss) {
        self.loss_count += 1;
        if self.losses.len() < Self::MOST_LOSSES {
            self.losses.push(loss);
        }
    }
}
