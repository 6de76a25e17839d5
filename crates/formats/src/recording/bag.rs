//! ROS 1 bags, version 2.0, read from front to back: neither the index at the end nor the whole file is needed.
//!
//! A bag is a line of text and records; a record is a header of `name=value` fields and data, each behind its length.
//! Chunks hold records of their own, compressed as a whole. Every length is held against a limit and against what is
//! there before memory is taken for it, so a bag takes no more than two chunks of memory whatever it says.

use super::raw_message::{Encoding, RawMessage};
use super::scan_report::{Loss, ScanReport};
use crate::FormatsError;
use std::collections::HashMap;
use std::io::{BufReader, Read};
use std::ops::ControlFlow;

/// What every bag begins with.
pub const MAGIC: &[u8] = b"#ROSBAG V2.0\n";
/// What bags of every version begin with.
const ANY_VERSION: &[u8] = b"#ROSBAG V";

/// Longest chunk, compressed or not, and longest message, bytes.
const MOST_DATA_BYTES: u64 = 128 << 20;
/// Longest record header, bytes; those that are written have some fifty.
const MOST_HEADER_BYTES: u64 = 64 << 10;
/// Longest message definition with topic and type, bytes.
const MOST_CONNECTION_BYTES: u64 = 4 << 20;
/// Most connections, that is publishers and topics.
const MOST_CONNECTIONS: usize = 65_536;
/// Most text of all topics and types together, bytes.
const MOST_NAME_BYTES: usize = 16 << 20;
/// Bytes read from the file at once.
const BUFFER_BYTES: usize = 256 << 10;

/// Kinds of records, by their `op` field.
mod op {
    pub const MESSAGE: u8 = 2;
    pub const BAG_HEADER: u8 = 3;
    pub const INDEX: u8 = 4;
    pub const CHUNK: u8 = 5;
    pub const CHUNK_INFO: u8 = 6;
    pub const CONNECTION: u8 = 7;
}

/// Hands every message of a bag on, in the order of the file, until `visit` breaks.
///
/// A damaged record, or a chunk that does not decompress, is left out and the scan goes on behind it; where a length cannot
/// be believed nothing behind it can be found, and the scan ends. Of a torn file everything before the tear is handed on.
///
/// # Errors
/// [`FormatsError::UnknownRecording`] where the file does not begin like a bag, for other versions and encrypted bags.
/// Damage, and a file that the operating system stops giving, are no errors: the report says them.
pub fn scan<R: Read>(
    reader: R,
    visit: &mut dyn FnMut(RawMessage<'_>) -> ControlFlow<()>,
) -> Result<ScanReport, FormatsError> {
    let mut source = Source { reader: BufReader::with_capacity(BUFFER_BYTES, reader), at: 0, failure: None };
    let mut first = Vec::new();
    source.fill(&mut first, MAGIC.len() as u64);
    if first != MAGIC {
        return Err(match first.strip_prefix(ANY_VERSION) {
            Some(version) => FormatsError::UnknownRecording {
                reason: format!(
                    "a ROS bag of version {}; version 2.0 is read (ROS writes it since 2010: `rosbag fix OLD NEW`)",
                    version.escape_ascii().to_string().trim_end_matches("\\n")
                ),
            },
            None => FormatsError::UnknownRecording { reason: "it does not begin as ROS 1 bags do".to_owned() },
        });
    }
    let mut scan = Scan { report: ScanReport::default(), connections: Connections::default(), visit, stopped: false };
    let (mut header, mut data, mut content) = (Vec::new(), Vec::new(), Vec::new());
    let mut doubtful_before = false;
    while !scan.stopped {
        let offset = source.at;
        let read = source.record(&mut header, &mut data);
        let doubt = match read {
            Ok(Found::End) => break,
            Ok(Found::Whole) => None,
            Ok(Found::Doubtful(reason)) => Some(reason),
            Ok(Found::TooLong { bytes }) => {
                scan.lose(offset, format!("a record of {bytes} bytes; at most {MOST_DATA_BYTES} are read"), false);
                continue;
            }
            Err(reason) => {
                scan.lose(offset, reason, true);
                // Empty unless the header was read.
                if let (false, Some(fields)) = (data.is_empty(), Fields::of(&header)) {
                    scan.torn_chunk(offset, &fields, &data, &mut content);
                }
                break;
            }
        };
        if let Some(reason) = doubt {
            // One header may be damaged and its lengths good; two in a row, and this is no longer the edge of a record.
            scan.lose(offset, reason.to_owned(), doubtful_before);
            if doubtful_before {
                break;
            }
            doubtful_before = true;
            continue;
        }
        doubtful_before = false;
        let Some(fields) = Fields::of(&header) else { continue };
        match fields.op() {
            Some(op::CHUNK) => scan.chunk(offset, &fields, &data, &mut content),
            Some(op::BAG_HEADER) => {
                if let Some(encryptor) = fields.get(b"encryptor").filter(|name| !name.is_empty()) {
                    return Err(FormatsError::UnknownRecording {
                        reason: format!(
                            "an encrypted bag ({}); decrypt it with `rosbag decrypt`",
                            encryptor.escape_ascii()
                        ),
                    });
                }
            }
            Some(op::INDEX | op::CHUNK_INFO) => {}
            _ => scan.record(offset, &fields, &data),
        }
    }
    scan.report.bytes = source.at;
    Ok(scan.report)
}

/// What stands at the place reached.
enum Found {
    /// A record, or one that no one reads (the index), passed over.
    Whole,
    /// The clean end of the file.
    End,
    /// Something whose lengths are good but whose header says nothing known.
    Doubtful(&'static str),
    /// A record longer than is read, passed over.
    TooLong { bytes: u64 },
}

/// The file, with the place reached.
struct Source<R> {
    reader: BufReader<R>,
    at: u64,
    failure: Option<std::io::Error>,
}

impl<R: Read> Source<R> {
    /// Replaces the content of `buffer` by the next `count` bytes, fewer at the end; grows with what is there, not with `count`.
    fn fill(&mut self, buffer: &mut Vec<u8>, count: u64) -> bool {
        buffer.clear();
        if let Err(error) = self.reader.by_ref().take(count).read_to_end(buffer) {
            self.failure = Some(error);
        }
        self.at += buffer.len() as u64;
        buffer.len() as u64 == count
    }

    fn skip(&mut self, count: u64) -> bool {
        match std::io::copy(&mut self.reader.by_ref().take(count), &mut std::io::sink()) {
            Ok(skipped) => {
                self.at += skipped;
                skipped == count
            }
            Err(error) => {
                self.failure = Some(error);
                false
            }
        }
    }

    /// A length of four bytes; `None` at the clean end of the file.
    fn length(&mut self) -> Result<Option<u64>, String> {
        let mut bytes = Vec::with_capacity(4);
        self.fill(&mut bytes, 4);
        match <[u8; 4]>::try_from(bytes.as_slice()) {
            Ok(bytes) => Ok(Some(u64::from(u32::from_le_bytes(bytes)))),
            Err(_) if bytes.is_empty() && self.failure.is_none() => Ok(None),
            Err(_) => Err(self.torn()),
        }
    }

    /// Reads the next record.
    ///
    /// # Errors
    /// Why the file ends within it; `data` then holds what there is of them.
    fn record(&mut self, header: &mut Vec<u8>, data: &mut Vec<u8>) -> Result<Found, String> {
        data.clear();
        let Some(length) = self.length()? else { return Ok(Found::End) };
        header.clear();
        let read_header = length <= MOST_HEADER_BYTES;
        if !(if read_header { self.fill(header, length) } else { self.skip(length) }) {
            return Err(self.torn());
        }
        let Some(bytes) = self.length()? else { return Err(self.torn()) };
        let fields = Fields::of(header).filter(|_| read_header);
        let kind = fields.as_ref().and_then(Fields::op);
        let most = match kind {
            Some(op::CHUNK | op::MESSAGE) => MOST_DATA_BYTES,
            Some(op::CONNECTION) => MOST_CONNECTION_BYTES,
            _ => 0,
        };
        if !(if bytes <= most { self.fill(data, bytes) } else { self.skip(bytes) }) {
            return Err(self.torn());
        }
        Ok(match kind {
            Some(op::CHUNK | op::MESSAGE | op::CONNECTION) if bytes > most => Found::TooLong { bytes },
            Some(op::CHUNK | op::MESSAGE | op::CONNECTION) => Found::Whole,
            Some(_) if fields.is_some_and(|fields| fields.are_passed_over()) => Found::Whole,
            Some(_) => Found::Doubtful("a record of an unknown kind"),
            None => Found::Doubtful("a record header that is no list of fields with a kind"),
        })
    }

    fn torn(&mut self) -> String {
        match self.failure.take() {
            Some(error) => format!("cannot be read: {error}"),
            None => "the file ends within this record".to_owned(),
        }
    }
}

/// The fields of a record header, checked to fill it exactly.
struct Fields<'a>(&'a [u8]);

impl<'a> Fields<'a> {
    fn of(header: &'a [u8]) -> Option<Self> {
        let mut rest = header;
        while !rest.is_empty() {
            let (field, behind) = split_counted(rest)?;
            field.contains(&b'=').then_some(())?;
            rest = behind;
        }
        Some(Self(header))
    }

    fn get(&self, name: &[u8]) -> Option<&'a [u8]> {
        let mut rest = self.0;
        while let Some((field, behind)) = split_counted(rest) {
            if let Some(value) = field.strip_prefix(name).and_then(|value| value.strip_prefix(b"=")) {
                return Some(value);
            }
            rest = behind;
        }
        None
    }

    fn op(&self) -> Option<u8> {
        match self.get(b"op") {
            Some([op]) => Some(*op),
            _ => None,
        }
    }

    /// Whether this is really one of the records that nobody reads, and no other whose kind is damaged.
    fn are_passed_over(&self) -> bool {
        let own = match self.op() {
            Some(op::BAG_HEADER) => "index_pos",
            Some(op::INDEX) => "count",
            Some(op::CHUNK_INFO) => "chunk_pos",
            _ => return false,
        };
        self.get(own.as_bytes()).is_some()
    }

    fn u32(&self, name: &[u8]) -> Option<u32> {
        Some(u32::from_le_bytes(self.get(name)?.try_into().ok()?))
    }

    fn text(&self, name: &[u8]) -> Option<&'a str> {
        std::str::from_utf8(self.get(name)?).ok()
    }

    /// Seconds and nanoseconds, each unsigned.
    fn time_ns(&self, name: &[u8]) -> Option<i64> {
        let (seconds, nanoseconds) = self.get(name)?.split_first_chunk::<4>()?;
        let nanoseconds = u32::from_le_bytes(nanoseconds.try_into().ok()?);
        Some(i64::from(u32::from_le_bytes(*seconds)) * 1_000_000_000 + i64::from(nanoseconds))
    }
}

/// What stands behind a count of its bytes, and what follows.
fn split_counted(bytes: &[u8]) -> Option<(&[u8], &[u8])> {
    let (count, rest) = bytes.split_first_chunk::<4>()?;
    rest.split_at_checked(usize::try_from(u32::from_le_bytes(*count)).ok()?)
}

/// Who published what.
struct Connection {
    topic: String,
    type_name: String,
    md5: String,
}

#[derive(Default)]
struct Connections {
    by_number: HashMap<u32, Connection>,
    name_bytes: usize,
}

impl Connections {
    /// Notes a connection; the index repeats those seen already.
    fn note(&mut self, fields: &Fields<'_>, data: &[u8]) -> Result<(), &'static str> {
        const INCOMPLETE: &str = "a connection without number, topic, type or md5 sum";
        let number = fields.u32(b"conn").ok_or(INCOMPLETE)?;
        let topic = fields.text(b"topic").ok_or(INCOMPLETE)?;
        let described = Fields::of(data).ok_or("a connection that is no list of fields")?;
        let type_name = described.text(b"type").ok_or(INCOMPLETE)?;
        let md5 = described.text(b"md5sum").ok_or(INCOMPLETE)?;
        if self.by_number.contains_key(&number) {
            return Ok(());
        }
        self.name_bytes = self.name_bytes.saturating_add(topic.len() + type_name.len() + md5.len());
        if self.by_number.len() >= MOST_CONNECTIONS || self.name_bytes > MOST_NAME_BYTES {
            return Err("more connections than are read (65536, 16 MiB of names)");
        }
        let connection = Connection { topic: topic.to_owned(), type_name: type_name.to_owned(), md5: md5.to_owned() };
        self.by_number.insert(number, connection);
        Ok(())
    }
}

/// What has been found, and who is told.
struct Scan<'v> {
    report: ScanReport,
    connections: Connections,
    visit: &'v mut dyn FnMut(RawMessage<'_>) -> ControlFlow<()>,
    stopped: bool,
}

impl Scan<'_> {
    fn lose(&mut self, offset: u64, reason: String, ends_the_scan: bool) {
        self.report.lose(Loss { offset, reason, ends_the_scan });
    }

    /// A connection or a message, in a chunk or outside.
    fn record(&mut self, offset: u64, fields: &Fields<'_>, data: &[u8]) {
        match fields.op() {
            Some(op::CONNECTION) => {
                if let Err(reason) = self.connections.note(fields, data) {
                    self.lose(offset, reason.to_owned(), false);
                }
            }
            Some(op::MESSAGE) => {
                let (Some(number), Some(log_time_ns)) = (fields.u32(b"conn"), fields.time_ns(b"time")) else {
                    return self.lose(offset, "a message without connection or time".to_owned(), false);
                };
                let Some(connection) = self.connections.by_number.get(&number) else {
                    return self.lose(offset, format!("a message of the unknown connection {number}"), false);
                };
                let message = RawMessage {
                    topic: &connection.topic,
                    type_name: &connection.type_name,
                    md5: &connection.md5,
                    encoding: Encoding::Ros1,
                    log_time_ns,
                    payload: data,
                };
                self.report.messages += 1;
                self.stopped = (self.visit)(message).is_break();
            }
            _ => self.lose(offset, "a record of a kind that does not belong here".to_owned(), false),
        }
    }

    fn chunk(&mut self, offset: u64, fields: &Fields<'_>, data: &[u8], content: &mut Vec<u8>) {
        if fields.get(b"compression") == Some(b"none") {
            return self.records(offset, data);
        }
        match self.decompress(offset, fields, data, content) {
            Ok(()) => self.records(offset, content),
            Err(reason) => self.lose(offset, reason, false),
        }
    }

    /// The first part of a chunk: what of it is complete is handed on; where the file ends has been said.
    fn torn_chunk(&mut self, offset: u64, fields: &Fields<'_>, data: &[u8], content: &mut Vec<u8>) {
        if fields.op() != Some(op::CHUNK) {
            return;
        }
        let said = (self.report.losses.len(), self.report.loss_count);
        if fields.get(b"compression") == Some(b"none") {
            self.records(offset, data);
        } else {
            // It must end too early; blocks come out whole, so that what comes out is good.
            let _ = self.decompress(offset, fields, data, content);
            self.records(offset, content);
        }
        self.report.losses.truncate(said.0);
        self.report.loss_count = said.1;
    }

    /// As [`decompress`], unless the file has become too much already.
    fn decompress(
        &mut self,
        offset: u64,
        fields: &Fields<'_>,
        data: &[u8],
        content: &mut Vec<u8>,
    ) -> Result<(), String> {
        content.clear();
        let declared = fields.u32(b"size").map(u64::from).filter(|bytes| *bytes <= MOST_DATA_BYTES);
        self.report.expand(offset + data.len() as u64, declared.unwrap_or(0))?;
        decompress(fields, data, content)
    }

    /// The records of a chunk.
    fn records(&mut self, offset: u64, content: &[u8]) {
        let mut rest = content;
        let mut doubtful_before = false;
        while !rest.is_empty() && !self.stopped {
            let at = content.len() - rest.len();
            let record = split_counted(rest).and_then(|(header, behind)| Some((header, split_counted(behind)?)));
            let Some((header, (data, behind))) = record else {
                return self.lose(
                    offset,
                    format!("byte {at} of the chunk: this record reaches beyond the chunk"),
                    false,
                );
            };
            rest = behind;
            let fields = Fields::of(header);
            let doubtful = fields.as_ref().and_then(Fields::op).is_none();
            match fields {
                Some(fields) if !doubtful => self.record(offset, &fields, data),
                _ => self.lose(offset, format!("byte {at} of the chunk: no list of fields with a kind"), false),
            }
            if doubtful && doubtful_before {
                return;
            }
            doubtful_before = doubtful;
        }
    }
}

/// Fills `content` with what a compressed chunk holds, which must be as long as the chunk says.
fn decompress(fields: &Fields<'_>, data: &[u8], content: &mut Vec<u8>) -> Result<(), String> {
    content.clear();
    let declared = fields.u32(b"size").map(u64::from).ok_or("a chunk that does not say its size")?;
    if declared > MOST_DATA_BYTES {
        return Err(format!("a chunk of {declared} bytes; at most {MOST_DATA_BYTES} are read"));
    }
    // One byte more than declared shows that there are more.
    let read = match fields.get(b"compression") {
        Some(b"bz2") => bzip2::read::BzDecoder::new(data).take(declared + 1).read_to_end(content),
        Some(b"lz4") => lz4_flex::frame::FrameDecoder::new(data).take(declared + 1).read_to_end(content),
        Some(other) => {
            return Err(format!("a chunk compressed by `{}`; none, bz2 and lz4 are read", other.escape_ascii()));
        }
        None => return Err("a chunk that does not say how it is compressed".to_owned()),
    };
    let name = fields.text(b"compression").unwrap_or_default();
    match read {
        Err(error) => Err(format!("the chunk does not decompress as {name}: {error}")),
        Ok(_) if content.len() as u64 != declared => Err(format!(
            "the chunk is said to hold {declared} bytes, its {name} data hold {}",
            more(content.len(), declared)
        )),
        Ok(_) => Ok(()),
    }
}

fn more(found: usize, declared: u64) -> String {
    if found as u64 > declared { "more".to_owned() } else { found.to_string() }
}
