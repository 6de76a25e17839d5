//! Writes ROS 1 bags.

use std::io::Write as _;

/// How chunks are packed.
#[derive(Clone, Copy, Debug)]
pub enum Compression {
    None,
    Bz2,
    Lz4,
}

impl Compression {
    pub fn name(self) -> &'static [u8] {
        match self {
            Self::None => b"none",
            Self::Bz2 => b"bz2",
            Self::Lz4 => b"lz4",
        }
    }

    pub fn compress(self, content: &[u8]) -> Vec<u8> {
        match self {
            Self::None => content.to_vec(),
            Self::Bz2 => {
                let mut writer = bzip2::write::BzEncoder::new(Vec::new(), bzip2::Compression::best());
                writer.write_all(content).unwrap();
                writer.finish().unwrap()
            }
            Self::Lz4 => {
                let mut writer = lz4_flex::frame::FrameEncoder::new(Vec::new());
                writer.write_all(content).unwrap();
                writer.finish().unwrap()
            }
        }
    }
}

/// A bag in memory.
pub struct BagWriter {
    file: Vec<u8>,
    chunk: Vec<u8>,
    compression: Compression,
    chunk_bytes: usize,
}

impl BagWriter {
    pub fn new(compression: Compression, chunk_bytes: usize) -> Self {
        Self { file: b"#ROSBAG V2.0\n".to_vec(), chunk: Vec::new(), compression, chunk_bytes }
    }

    /// A record header behind its length.
    pub fn header(fields: &[(&[u8], &[u8])]) -> Vec<u8> {
        let mut header = Vec::new();
        for (name, value) in fields {
            header.extend(u32::try_from(name.len() + 1 + value.len()).unwrap().to_le_bytes());
            header.extend(*name);
            header.push(b'=');
            header.extend(*value);
        }
        let mut counted = u32::try_from(header.len()).unwrap().to_le_bytes().to_vec();
        counted.extend(header);
        counted
    }

    pub fn bag_header(&mut self, fields: &[(&[u8], &[u8])]) {
        let mut all: Vec<(&[u8], &[u8])> = vec![(b"op", &[3]), (b"index_pos", &[0; 8])];
        all.extend(fields);
        self.file.extend(Self::header(&all));
        self.file.extend([0; 4]);
    }

    pub fn connection(&mut self, number: u32, topic: &str, type_name: &str, md5: &str) {
        self.chunk.extend(Self::header(&[
            (b"op", &[7]),
            (b"conn", &number.to_le_bytes()),
            (b"topic", topic.as_bytes()),
        ]));
        self.chunk.extend(Self::header(&[
            (b"topic", topic.as_bytes()),
            (b"type", type_name.as_bytes()),
            (b"md5sum", md5.as_bytes()),
        ]));
        self.close_long_chunk();
    }

    /// Seconds in the lower, nanoseconds in the upper half of `time`.
    pub fn message(&mut self, number: u32, time: u64, payload: &[u8]) {
        self.chunk.extend(Self::header(&[
            (b"op", &[2]),
            (b"conn", &number.to_le_bytes()),
            (b"time", &time.to_le_bytes()),
        ]));
        self.chunk.extend(u32::try_from(payload.len()).unwrap().to_le_bytes());
        self.chunk.extend(payload);
        self.close_long_chunk();
    }

    fn close_long_chunk(&mut self) {
        if self.chunk.len() >= self.chunk_bytes {
            self.close_chunk();
        }
    }

    fn close_chunk(&mut self) {
        let size = u32::try_from(self.chunk.len()).unwrap().to_le_bytes();
        let fields: [(&[u8], &[u8]); 3] = [(b"op", &[5]), (b"compression", self.compression.name()), (b"size", &size)];
        self.file.extend(Self::header(&fields));
        let packed = self.compression.compress(&self.chunk);
        self.file.extend(u32::try_from(packed.len()).unwrap().to_le_bytes());
        self.file.extend(packed);
        self.chunk.clear();
    }

    pub fn finish(mut self) -> Vec<u8> {
        if !self.chunk.is_empty() {
            self.close_chunk();
        }
        self.file
    }
}
