//! MCAP out: JSON messages in compressed chunks of at most a second.
//!
//! The bytes follow from the messages alone, and nothing is sought back to: whatever has been handed on stays readable
//! when the power fails, but for the last second. Written here and not by the `mcap` crate, whose compressors are C; the crate
//! reads what is written in the tests.

use super::foxglove::Schema;
use super::mcap_reader::{MAGIC, kind};
use crc32fast::Hasher;
use std::collections::BTreeMap;
use std::io::{self, ErrorKind, Write};

/// Longest time that one chunk spans.
pub const LONGEST_CHUNK_NS: i64 = 1_000_000_000;
/// A chunk is closed when it has grown beyond this.
const MOST_CHUNK_BYTES: usize = 4 << 20;
const COMPRESSION: &str = "lz4";

/// A topic opened in one [`McapWriter`].
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Channel(u16);

/// Writes an MCAP file to anything that takes bytes.
pub struct McapWriter<W: Write> {
    out: Out<W>,
    chunk: Chunk,
    /// Records of the schemas and channels, which the summary says again.
    schemas: Vec<Vec<u8>>,
    channels: Vec<Vec<u8>>,
    /// Records about the chunks so far.
    chunks: Vec<Vec<u8>>,
    times: Times,
    messages: BTreeMap<u16, u64>,
}

/// What was handed on, with its length and check sum.
struct Out<W: Write> {
    inner: W,
    bytes: u64,
    crc: Hasher,
}

/// Messages that wait for the end of their chunk, uncompressed.
#[derive(Default)]
struct Chunk {
    records: Vec<u8>,
    times: Times,
    /// Per channel the time and the place of each message.
    index: BTreeMap<u16, Vec<u8>>,
}

/// The first and the last, ns.
#[derive(Clone, Copy, Default)]
struct Times(Option<(u64, u64)>);

impl Times {
    fn count(&mut self, time: u64) {
        self.0 = Some(self.0.map_or((time, time), |(first, last)| (first.min(time), last.max(time))));
    }

    fn bytes(self) -> [u8; 16] {
        let (first, last) = self.0.unwrap_or_default();
        let mut bytes = [0; 16];
        bytes[..8].copy_from_slice(&first.to_le_bytes());
        bytes[8..].copy_from_slice(&last.to_le_bytes());
        bytes
    }
}

impl<W: Write> Out<W> {
    fn write(&mut self, bytes: &[u8]) -> io::Result<()> {
        self.inner.write_all(bytes)?;
        self.crc.update(bytes);
        self.bytes += bytes.len() as u64;
        Ok(())
    }
}

impl<W: Write> McapWriter<W> {
    /// Begins a file.
    ///
    /// # Errors
    /// What `out` refuses.
    pub fn new(out: W) -> io::Result<Self> {
        let mut out = Out { inner: out, bytes: 0, crc: Hasher::new() };
        out.write(&MAGIC)?;
        out.write(&record(kind::HEADER, &[&text("")?, &text("tumble")?]))?;
        let (schemas, channels, chunks) = (Vec::new(), Vec::new(), Vec::new());
        let (chunk, times, messages) = (Chunk::default(), Times::default(), BTreeMap::new());
        Ok(Self { out, chunk, schemas, channels, chunks, times, messages })
    }

    /// Opens a topic.
    ///
    /// # Errors
    /// What `out` refuses; more than 65 535 topics.
    pub fn channel(&mut self, topic: &str, schema: &Schema) -> io::Result<Channel> {
        let numbered =
            |known: &[Vec<u8>]| u16::try_from(known.len() + 1).map_err(|_| refused("more than 65 535 topics"));
        let content = [text(schema.name)?, text("jsonschema")?, text(&schema.text)?].concat();
        let known = self.schemas.iter().position(|known| known.ends_with(&content));
        let schema = if let Some(known) = known { numbered(&self.schemas[..known])? } else { numbered(&self.schemas)? };
        if known.is_none() {
            self.schemas.push(record(kind::SCHEMA, &[&schema.to_le_bytes(), &content]));
            self.chunk.records.extend(self.schemas.last().into_iter().flatten());
        }
        let channel = numbered(&self.channels)?;
        let (topic, encoding, metadata) = (text(topic)?, text("json")?, length(&[])?);
        let numbers = [channel.to_le_bytes(), schema.to_le_bytes()];
        self.channels.push(record(kind::CHANNEL, &[numbers.as_flattened(), &topic, &encoding, &metadata]));
        self.chunk.records.extend(self.channels.last().into_iter().flatten());
        Ok(Channel(channel))
    }

    /// Writes one message; a stamp before zero, which the format does not have, is refused as invalid input.
    ///
    /// # Errors
    /// What `out` refuses.
    pub fn write(&mut self, channel: Channel, time_ns: i64, json: &str) -> io::Result<()> {
        let time = u64::try_from(time_ns).map_err(|_| io::Error::from(ErrorKind::InvalidInput))?;
        let is_over = |(first, _): (u64, u64)| time.abs_diff(first) >= LONGEST_CHUNK_NS.unsigned_abs();
        if self.chunk.times.0.is_some_and(is_over) || self.chunk.records.len() > MOST_CHUNK_BYTES {
            self.end_chunk()?;
        }
        let place = self.chunk.records.len() as u64;
        let index = self.chunk.index.entry(channel.0).or_default();
        index.extend([time.to_le_bytes(), place.to_le_bytes()].as_flattened());
        let stamp = time.to_le_bytes();
        let header: [&[u8]; 5] = [&channel.0.to_le_bytes(), &0_u32.to_le_bytes(), &stamp, &stamp, json.as_bytes()];
        self.chunk.records.extend(record(kind::MESSAGE, &header));
        self.chunk.times.count(time);
        self.times.count(time);
        *self.messages.entry(channel.0).or_default() += 1;
        Ok(())
    }

    /// Hands the chunk on, and after it where in it the messages of each channel are.
    fn end_chunk(&mut self) -> io::Result<()> {
        let Chunk { records, times, index } = std::mem::take(&mut self.chunk);
        if records.is_empty() {
            return Ok(());
        }
        let mut encoder = lz4_flex::frame::FrameEncoder::new(Vec::new());
        encoder.write_all(&records)?;
        let compressed = encoder.finish().map_err(io::Error::other)?;
        let (size, crc) = ((records.len() as u64).to_le_bytes(), crc32fast::hash(&records).to_le_bytes());
        let (compression, stored) = (text(COMPRESSION)?, (compressed.len() as u64).to_le_bytes());
        let chunk_at = self.out.bytes;
        self.out.write(&record(kind::CHUNK, &[&times.bytes(), &size, &crc, &compression, &stored, &compressed]))?;
        let indexes_at = self.out.bytes;
        let mut places = Vec::new();
        for (channel, entries) in index {
            places.extend(channel.to_le_bytes());
            places.extend(self.out.bytes.to_le_bytes());
            let content = [&channel.to_le_bytes()[..], &length(&entries)?, &entries];
            self.out.write(&record(kind::MESSAGE_INDEX, &content))?;
        }
        let place = [chunk_at.to_le_bytes(), (indexes_at - chunk_at).to_le_bytes()];
        let index_bytes = (self.out.bytes - indexes_at).to_le_bytes();
        self.chunks.push(record(
            kind::CHUNK_INDEX,
            &[
                &times.bytes(),
                place.as_flattened(),
                &length(&places)?,
                &places,
                &index_bytes,
                &compression,
                &stored,
                &size,
            ],
        ));
        Ok(())
    }

    /// Closes the last chunk and writes the index; gives back what was written to.
    ///
    /// # Errors
    /// What `out` refuses.
    pub fn finish(mut self) -> io::Result<W> {
        self.end_chunk()?;
        let crc = std::mem::take(&mut self.out.crc).finalize();
        self.out.write(&record(kind::DATA_END, &[&crc.to_le_bytes()]))?;
        self.out.crc = Hasher::new();
        let summary_at = self.out.bytes;
        let statistics = vec![self.statistics()?];
        let groups = [
            (kind::SCHEMA, &self.schemas),
            (kind::CHANNEL, &self.channels),
            (kind::STATISTICS, &statistics),
            (kind::CHUNK_INDEX, &self.chunks),
        ];
        let mut offsets = Vec::new();
        for (of, records) in groups.into_iter().filter(|(_, records)| !records.is_empty()) {
            let begin = self.out.bytes;
            self.out.write(&records.concat())?;
            let place = [begin.to_le_bytes(), (self.out.bytes - begin).to_le_bytes()];
            offsets.extend(record(kind::SUMMARY_OFFSET, &[&[of], place.as_flattened()]));
        }
        let offsets_at = self.out.bytes;
        self.out.write(&offsets)?;
        // The check sum counts the footer in as far as it.
        let mut footer = record(kind::FOOTER, &[&summary_at.to_le_bytes(), &offsets_at.to_le_bytes(), &[0; 4]]);
        footer.truncate(footer.len() - 4);
        self.out.write(&footer)?;
        let crc = std::mem::take(&mut self.out.crc).finalize();
        self.out.write(&crc.to_le_bytes())?;
        self.out.write(&MAGIC)?;
        self.out.inner.flush()?;
        Ok(self.out.inner)
    }

    fn statistics(&self) -> io::Result<Vec<u8>> {
        let count = |records: &[Vec<u8>]| u32::try_from(records.len()).map_err(|_| refused("too many records"));
        let schemas = u16::try_from(self.schemas.len()).map_err(|_| refused("more than 65 535 types"))?;
        let per_channel = self
            .messages
            .iter()
            .flat_map(|(channel, messages)| [&channel.to_le_bytes()[..], &messages.to_le_bytes()].concat());
        let per_channel: Vec<u8> = per_channel.collect();
        let (attachments, metadata) = (0_u32, 0_u32);
        Ok(record(
            kind::STATISTICS,
            &[
                &self.messages.values().sum::<u64>().to_le_bytes(),
                &schemas.to_le_bytes(),
                &count(&self.channels)?.to_le_bytes(),
                &attachments.to_le_bytes(),
                &metadata.to_le_bytes(),
                &count(&self.chunks)?.to_le_bytes(),
                &self.times.bytes(),
                &length(&per_channel)?,
                &per_channel,
            ],
        ))
    }
}

/// A record: its kind, its length, its content.
fn record(kind: u8, content: &[&[u8]]) -> Vec<u8> {
    let length: usize = content.iter().map(|part| part.len()).sum();
    let mut record = Vec::with_capacity(9 + length);
    record.push(kind);
    record.extend((length as u64).to_le_bytes());
    for part in content {
        record.extend(*part);
    }
    record
}

/// A length of four bytes.
fn length(content: &[u8]) -> io::Result<[u8; 4]> {
    u32::try_from(content.len()).map(u32::to_le_bytes).map_err(|_| refused("more than 4 GB in one field"))
}

/// A text with its length before it.
fn text(text: &str) -> io::Result<Vec<u8>> {
    Ok([&length(text.as_bytes())?, text.as_bytes()].concat())
}

fn refused(reason: &'static str) -> io::Error {
    io::Error::new(ErrorKind::InvalidInput, reason)
}
