//! A message as it stands in a recording.

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
