//! MCAP in: a guarded forward scan.
//!
//! The framing is walked here and not by the `mcap` crate, whose readers panic on a file of 29 bytes and ask for
//! gigabytes when a length is damaged. An MCAP file is nothing but records of one byte of kind, eight bytes of length
//! and a body, so that walking it with every length checked takes less than guarding somebody else's walk would.
//! The crate re-reads in the tests what [`super::mcap_writer`] writes.
//!
//! No allocation follows a length that the file merely states: bodies grow as bytes arrive, and no record, and nothing
//! decompressed, grows beyond [`MOST_RECORD_BYTES`].
//! A chunk whose check sum fails is left out whole; one that the end of the file cuts short is read as far as it goes.

use super::raw_message::{Encoding, RawMessage};
use super::scan_report::{Loss, ScanReport};
use crate::FormatsError;
use crc32fast::Hasher;
use std::collections::HashMap;
use std::io::{BufRead, BufReader, ErrorKind, Read};
use std::ops::ControlFlow;
use std::panic::{AssertUnwindSafe, catch_unwind};

/// What every MCAP file begins and ends with.
pub const MAGIC: [u8; 8] = *b"\x89MCAP0\r\n";
/// No record is held, and no chunk decompressed, beyond this; larger ones are left out and said.
pub const MOST_RECORD_BYTES: u64 = 64 << 20;
/// No topic or type has a longer name.
const MOST_NAME_BYTES: usize = 1024;
/// The window that every zstd decoder must offer.
const LEAST_ZSTD_WINDOW_BYTES: u64 = 8 << 20;

/// Kinds of records.
pub(super) mod kind {
    pub const HEADER: u8 = 0x01;
    pub const FOOTER: u8 = 0x02;
    pub const SCHEMA: u8 = 0x03;
    pub const CHANNEL: u8 = 0x04;
    pub const MESSAGE: u8 = 0x05;
    pub const CHUNK: u8 = 0x06;
    pub const MESSAGE_INDEX: u8 = 0x07;
    pub const CHUNK_INDEX: u8 = 0x08;
    pub const STATISTICS: u8 = 0x0b;
    pub const SUMMARY_OFFSET: u8 = 0x0e;
    pub const DATA_END: u8 = 0x0f;
}

const CUT_SHORT: &str = "the file ends within this record";

/// Hands every message of an MCAP file on, in the order of the file, until `visit` breaks.
///
/// # Errors
/// [`FormatsError::UnknownRecording`] where the file does not begin like MCAP. Damage, and a file that the operating
/// system stops giving, are no errors: the report says them.
pub fn scan<R: Read>(
    reader: R,
    visit: &mut dyn FnMut(RawMessage<'_>) -> ControlFlow<()>,
) -> Result<ScanReport, FormatsError> {
    let mut source = Source { inner: BufReader::with_capacity(1 << 16, reader), offset: 0, data_crc: Hasher::new() };
    let mut magic = Vec::new();
    let begun = source.read(MAGIC.len() as u64, &mut magic);
    if magic != MAGIC {
        let reason = begun.err().map_or("it does not begin as MCAP files do".to_owned(), |error| error.to_string());
        return Err(FormatsError::UnknownRecording { reason });
    }
    let mut scan = Scan { topics: Topics::default(), report: ScanReport::default(), visit };
    if let Err(error) = scan.records(&mut source) {
        scan.report.lose(Loss { offset: source.offset, reason: error.to_string(), ends_the_scan: true });
    }
    scan.report.bytes = source.offset;
    Ok(scan.report)
}

/// The file, with the place and the check sum of what has been read.
struct Source<R> {
    inner: BufReader<R>,
    offset: u64,
    data_crc: Hasher,
}

impl<R: Read> Source<R> {
    /// Replaces `body` by the next `length` bytes, or by fewer where the file ends.
    fn read(&mut self, length: u64, body: &mut Vec<u8>) -> std::io::Result<bool> {
        body.clear();
        self.inner.by_ref().take(length).read_to_end(body)?;
        self.data_crc.update(body);
        self.offset += body.len() as u64;
        Ok(body.len() as u64 == length)
    }

    /// Passes over `length` bytes; `false` where the file ends before.
    fn skip(&mut self, length: u64) -> std::io::Result<bool> {
        let mut left = length;
        while left > 0 {
            let block = match self.inner.fill_buf() {
                Err(error) if error.kind() == ErrorKind::Interrupted => continue,
                block => block?,
            };
            let passed = block.get(..usize::try_from(left).unwrap_or(usize::MAX)).unwrap_or(block);
            if passed.is_empty() {
                return Ok(false);
            }
            self.data_crc.update(passed);
            let count = passed.len();
            self.inner.consume(count);
            self.offset += count as u64;
            left -= count as u64;
        }
        Ok(true)
    }
}

/// What a message needs of its channel.
#[derive(PartialEq, Eq)]
struct Topic {
    name: String,
    type_name: String,
    md5: String,
    encoding: Encoding,
}

/// The channels so far. Their numbers have two bytes, so that no file can name more than 65 536.
#[derive(Default)]
struct Topics {
    type_names: HashMap<u16, String>,
    topics: HashMap<u16, Topic>,
}

impl Topics {
    fn add_schema(&mut self, body: &[u8]) -> Result<(), &'static str> {
        let mut fields = Fields(body);
        let (Some(id), Some(name), Some(_encoding)) = (fields.u16(), fields.name(), fields.name()) else {
            return Err("a schema without number or name");
        };
        let type_name = name.replace("/msg/", "/");
        match self.type_names.get(&id) {
            Some(known) if *known != type_name => Err("a schema's number stands for two types"),
            _ => {
                self.type_names.insert(id, type_name);
                Ok(())
            }
        }
    }

    fn add_channel(&mut self, body: &[u8]) -> Result<(), &'static str> {
        const TORN: &str = "a channel without number, topic or encoding";
        let mut fields = Fields(body);
        let (Some(id), Some(schema)) = (fields.u16(), fields.u16()) else { return Err(TORN) };
        let (Some(name), Some(encoding), Some(metadata)) = (fields.name(), fields.name(), fields.block()) else {
            return Err(TORN);
        };
        let type_name = match schema {
            0 => String::new(),
            _ => self.type_names.get(&schema).ok_or("a channel of an unknown schema")?.clone(),
        };
        let encoding = match encoding {
            "ros1" => Encoding::Ros1,
            "cdr" => Encoding::Cdr,
            "json" => Encoding::Json,
            _ => Encoding::Other,
        };
        let mut pairs = Fields(metadata);
        let mut md5 = "";
        while let (Some(key), Some(value)) = (pairs.text(), pairs.text()) {
            if matches!(key, "md5sum" | "md5") && value.len() <= MOST_NAME_BYTES {
                md5 = value;
            }
        }
        let topic = Topic { name: name.to_owned(), type_name, md5: md5.to_owned(), encoding };
        match self.topics.get(&id) {
            Some(known) if *known != topic => Err("a channel's number stands for two topics"),
            _ => {
                self.topics.insert(id, topic);
                Ok(())
            }
        }
    }
}

struct Scan<'a> {
    topics: Topics,
    report: ScanReport,
    visit: &'a mut dyn FnMut(RawMessage<'_>) -> ControlFlow<()>,
}

impl Scan<'_> {
    fn lose(&mut self, offset: u64, reason: &str, ends_the_scan: bool) {
        self.report.lose(Loss { offset, reason: reason.to_owned(), ends_the_scan });
    }

    /// The records of the file, after the magic.
    fn records<R: Read>(&mut self, source: &mut Source<R>) -> std::io::Result<ControlFlow<()>> {
        let (mut body, mut expanded) = (Vec::new(), Vec::new());
        loop {
            let offset = source.offset;
            let crc_before = source.data_crc.clone().finalize();
            let complete = source.read(9, &mut body)?;
            let Some((kind, length)) = Fields(&body).header() else {
                let reason = if body.is_empty() { "the file ends without its end mark" } else { CUT_SHORT };
                self.lose(offset, reason, true);
                return Ok(ControlFlow::Continue(()));
            };
            debug_assert!(complete);
            if kind == 0 {
                self.lose(offset, "no record begins so", true);
                return Ok(ControlFlow::Continue(()));
            }
            let is_read = matches!(
                kind,
                kind::FOOTER
                    | kind::SCHEMA
                    | kind::CHANNEL
                    | kind::MESSAGE
                    | kind::CHUNK
                    | kind::STATISTICS
                    | kind::DATA_END
            );
            if !is_read || length > MOST_RECORD_BYTES {
                let complete = source.skip(length)?;
                if !complete || is_read {
                    let reason = if complete { "a record of more than 64 MiB" } else { CUT_SHORT };
                    self.lose(offset, reason, !complete);
                }
                if !complete {
                    return Ok(ControlFlow::Continue(()));
                }
                continue;
            }
            let complete = source.read(length, &mut body)?;
            let flow = match kind {
                kind::CHUNK => self.chunk(offset, &body, complete, &mut expanded),
                _ if !complete => ControlFlow::Continue(()),
                kind::DATA_END => {
                    let stated = Fields(&body).u32();
                    if stated.is_none_or(|crc| crc != 0 && crc != crc_before) {
                        self.lose(offset, "the check sum of all that stands before differs", false);
                    }
                    ControlFlow::Continue(())
                }
                // A chunk whose kind is damaged looks like a private record, which nobody need know.
                kind::STATISTICS => {
                    if self.report.loss_count == 0 && Fields(&body).u64() != Some(self.report.messages) {
                        self.lose(offset, "the file counts another number of messages", false);
                    }
                    ControlFlow::Continue(())
                }
                kind::FOOTER => {
                    let end = source.offset;
                    source.read(MAGIC.len() as u64 + 1, &mut body)?;
                    if body != MAGIC {
                        self.lose(end, "the file does not end with its end mark", true);
                    }
                    return Ok(ControlFlow::Continue(()));
                }
                _ => self.record(offset, kind, &body),
            };
            if !complete {
                self.lose(offset, CUT_SHORT, true);
            }
            if flow.is_break() || !complete {
                return Ok(flow);
            }
        }
    }

    /// A schema, a channel or a message.
    fn record(&mut self, offset: u64, kind: u8, body: &[u8]) -> ControlFlow<()> {
        let done = match kind {
            kind::SCHEMA => self.topics.add_schema(body),
            kind::CHANNEL => self.topics.add_channel(body),
            _ => return self.message(offset, body),
        };
        if let Err(reason) = done {
            self.lose(offset, reason, false);
        }
        ControlFlow::Continue(())
    }

    fn message(&mut self, offset: u64, body: &[u8]) -> ControlFlow<()> {
        let mut fields = Fields(body);
        let head = (fields.u16(), fields.u32(), fields.u64(), fields.u64());
        let (Some(channel), Some(_sequence), Some(log_time), Some(_publish_time)) = head else {
            self.lose(offset, "a message shorter than its head", false);
            return ControlFlow::Continue(());
        };
        let Some(topic) = self.topics.topics.get(&channel) else {
            self.lose(offset, "a message before its channel", false);
            return ControlFlow::Continue(());
        };
        let Ok(log_time_ns) = i64::try_from(log_time) else {
            self.lose(offset, "a message stamped after the year 2262", false);
            return ControlFlow::Continue(());
        };
        self.report.messages += 1;
        (self.visit)(RawMessage {
            topic: &topic.name,
            type_name: &topic.type_name,
            md5: &topic.md5,
            encoding: topic.encoding,
            log_time_ns,
            payload: fields.0,
        })
    }

    /// The records of a chunk; `expanded` is scratch.
    fn chunk(&mut self, offset: u64, body: &[u8], complete: bool, expanded: &mut Vec<u8>) -> ControlFlow<()> {
        let Some(chunk) = Chunk::parse(body) else {
            if complete {
                self.lose(offset, "a chunk shorter than its head", false);
            }
            return ControlFlow::Continue(());
        };
        // One that the file cuts short is said by the caller, and given as far as it goes.
        let is_whole = complete && chunk.records.len() as u64 == chunk.stated_length;
        if !chunk.compression.is_empty() && chunk.expanded_length <= MOST_RECORD_BYTES {
            let end = offset + body.len() as u64;
            if let Err(reason) = self.report.expand(end, chunk.expanded_length) {
                self.lose(offset, reason, false);
                return ControlFlow::Continue(());
            }
        }
        let records = match chunk.expand(expanded) {
            Ok(records) => records,
            Err(reason) if is_whole => {
                self.lose(offset, reason, false);
                return ControlFlow::Continue(());
            }
            Err(_) => expanded,
        };
        let has_all = records.len() as u64 == chunk.expanded_length;
        if has_all && chunk.crc != 0 && chunk.crc != crc32fast::hash(records) {
            self.lose(offset, "the check sum of this chunk differs", false);
            return ControlFlow::Continue(());
        }
        if !has_all && complete {
            self.lose(offset, "a chunk of another length than it states", false);
            return ControlFlow::Continue(());
        }
        let mut left = Fields(records);
        while let Some((kind, length)) = left.header() {
            let Some(record) = usize::try_from(length).ok().and_then(|length| left.bytes(length)) else {
                if has_all {
                    self.lose(offset, "a record that ends beyond its chunk", false);
                }
                return ControlFlow::Continue(());
            };
            match kind {
                kind::SCHEMA | kind::CHANNEL | kind::MESSAGE => self.record(offset, kind, record)?,
                kind::CHUNK => self.lose(offset, "a chunk within a chunk", false),
                _ => {}
            }
        }
        if has_all && !left.0.is_empty() {
            self.lose(offset, "a record that ends beyond its chunk", false);
        }
        ControlFlow::Continue(())
    }
}

/// The head of a chunk and what follows it.
struct Chunk<'a> {
    expanded_length: u64,
    crc: u32,
    compression: &'a str,
    stated_length: u64,
    records: &'a [u8],
}

impl<'a> Chunk<'a> {
    fn parse(body: &'a [u8]) -> Option<Self> {
        let mut fields = Fields(body);
        let (_start, _end) = (fields.u64()?, fields.u64()?);
        let (expanded_length, crc, compression) = (fields.u64()?, fields.u32()?, fields.name()?);
        let stated_length = fields.u64()?;
        let most = usize::try_from(stated_length).unwrap_or(usize::MAX).min(fields.0.len());
        Some(Self { expanded_length, crc, compression, stated_length, records: fields.bytes(most)? })
    }

    /// The records, decompressed; what came out before an error stays in `expanded`.
    fn expand<'b>(&self, expanded: &'b mut Vec<u8>) -> Result<&'b [u8], &'static str>
    where
        'a: 'b,
    {
        expanded.clear();
        if self.expanded_length > MOST_RECORD_BYTES {
            return Err("a chunk of more than 64 MiB");
        }
        // One byte more than stated shows that there is more.
        let most = self.expanded_length + 1;
        // The decoders are checked with damaged chunks, but are not ours: a panic in one must cost this chunk only.
        let done = catch_unwind(AssertUnwindSafe(|| match self.compression {
            "" => Ok(true),
            "lz4" => lz4_flex::frame::FrameDecoder::new(self.records)
                .take(most)
                .read_to_end(expanded)
                .map(|_| false)
                .map_err(|_| "a chunk that lz4 cannot decompress"),
            "zstd" => zstd(self.records, most, expanded).map(|()| false),
            _ => Err("a chunk of unknown compression"),
        }));
        match done {
            Ok(Ok(true)) => Ok(self.records),
            Ok(Ok(false)) => Ok(expanded),
            Ok(Err(reason)) => Err(reason),
            Err(_) => Err("a chunk that stops its decoder"),
        }
    }
}

fn zstd(records: &[u8], most: u64, expanded: &mut Vec<u8>) -> Result<(), &'static str> {
    const BROKEN: &str = "a chunk that zstd cannot decompress";
    let mut decoder = ruzstd::decoding::FrameDecoder::new();
    decoder.set_max_window_size(most.max(LEAST_ZSTD_WINDOW_BYTES));
    let decoder = ruzstd::decoding::StreamingDecoder::new_with_decoder(records, decoder).map_err(|_| BROKEN)?;
    decoder.take(most).read_to_end(expanded).map(|_| ()).map_err(|_| BROKEN)
}

/// Little-endian fields, taken from the front of what is left.
struct Fields<'a>(&'a [u8]);

impl<'a> Fields<'a> {
    fn bytes(&mut self, count: usize) -> Option<&'a [u8]> {
        let (taken, left) = self.0.split_at_checked(count)?;
        self.0 = left;
        Some(taken)
    }
    fn array<const N: usize>(&mut self) -> Option<[u8; N]> {
        self.bytes(N)?.try_into().ok()
    }
    fn u16(&mut self) -> Option<u16> {
        self.array().map(u16::from_le_bytes)
    }
    fn u32(&mut self) -> Option<u32> {
        self.array().map(u32::from_le_bytes)
    }
    fn u64(&mut self) -> Option<u64> {
        self.array().map(u64::from_le_bytes)
    }
    /// Kind and length of the record that follows.
    fn header(&mut self) -> Option<(u8, u64)> {
        let (head, left) = self.0.split_at_checked(9)?;
        let (kind, length) = head.split_first()?;
        self.0 = left;
        Some((*kind, u64::from_le_bytes(length.try_into().ok()?)))
    }
    /// Bytes behind their count.
    fn block(&mut self) -> Option<&'a [u8]> {
        let count = self.u32()?;
        self.bytes(usize::try_from(count).ok()?)
    }
    fn text(&mut self) -> Option<&'a str> {
        std::str::from_utf8(self.block()?).ok()
    }
    /// A text short enough to keep.
    fn name(&mut self) -> Option<&'a str> {
        self.text().filter(|text| text.len() <= MOST_NAME_BYTES)
    }
}
