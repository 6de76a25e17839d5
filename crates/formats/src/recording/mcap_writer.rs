//! MCAP out: JSON messages in chunks of at most a second.
//!
//! The bytes follow from the messages alone, and nothing is sought back to: whatever has been handed on stays readable
//! when the power fails, but for the last second.

use super::foxglove::Schema;
use mcap::records::MessageHeader;
use mcap::write::{NoSeek, WriteOptions};
use std::collections::BTreeMap;
use std::io::{self, Write};

/// Longest time that one chunk spans.
pub const LONGEST_CHUNK_NS: i64 = 1_000_000_000;
/// A chunk is closed when it has grown beyond this.
const MOST_CHUNK_BYTES: u64 = 4 << 20;

/// A topic opened in one [`McapWriter`].
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Channel(u16);

/// Writes an MCAP file to anything that takes bytes.
pub struct McapWriter<W: Write> {
    inner: mcap::Writer<NoSeek<W>>,
    chunk_began_ns: Option<i64>,
}

impl<W: Write> McapWriter<W> {
    /// Begins a file.
    ///
    /// # Errors
    /// What `out` refuses.
    pub fn new(out: W) -> io::Result<Self> {
        let options = WriteOptions::new()
            .compression(None)
            .chunk_size(Some(MOST_CHUNK_BYTES))
            .disable_seeking(true)
            .library("tumble");
        let inner = options.create(NoSeek::new(out)).map_err(refused)?;
        Ok(Self { inner, chunk_began_ns: None })
    }

    /// Opens a topic.
    ///
    /// # Errors
    /// What `out` refuses; more than 65 534 topics.
    pub fn channel(&mut self, topic: &str, schema: &Schema) -> io::Result<Channel> {
        let schema = self.inner.add_schema(schema.name, "jsonschema", schema.text.as_bytes()).map_err(refused)?;
        self.inner.add_channel(schema, topic, "json", &BTreeMap::new()).map(Channel).map_err(refused)
    }

    /// Writes one message; a stamp before zero, which the format does not have, is refused as invalid input.
    ///
    /// # Errors
    /// What `out` refuses.
    pub fn write(&mut self, channel: Channel, time_ns: i64, json: &str) -> io::Result<()> {
        let time = u64::try_from(time_ns).map_err(|_| io::Error::from(io::ErrorKind::InvalidInput))?;
        let began_ns = *self.chunk_began_ns.get_or_insert(time_ns);
        if time_ns.abs_diff(began_ns) >= LONGEST_CHUNK_NS.unsigned_abs() {
            self.inner.flush().map_err(refused)?;
            self.chunk_began_ns = Some(time_ns);
        }
        let header = MessageHeader { channel_id: channel.0, sequence: 0, log_time: time, publish_time: time };
        self.inner.write_to_known_channel(&header, json.as_bytes()).map_err(refused)
    }

    /// Closes the last chunk and writes the index; gives back what was written to.
    ///
    /// # Errors
    /// What `out` refuses.
    pub fn finish(mut self) -> io::Result<W> {
        self.inner.finish().map_err(refused)?;
        let mut out = self.inner.into_inner().into_inner();
        out.flush()?;
        Ok(out)
    }
}

fn refused(error: mcap::McapError) -> io::Error {
    match error {
        mcap::McapError::Io(error) => error,
        other => io::Error::other(other),
    }
}
