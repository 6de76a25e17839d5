//! An MCAP file without its chunks: other readers see what the chunks held, where they do not decompress.

use std::io::Read as _;

/// The same messages in a file of plain records, without a summary. The check sum of each chunk must hold.
pub fn unpacked_mcap(bytes: &[u8]) -> Vec<u8> {
    const MAGIC: usize = 8;
    let number = |at: usize| usize::try_from(u64::from_le_bytes(bytes[at..at + 8].try_into().unwrap())).unwrap();
    let mut plain = bytes[..MAGIC].to_vec();
    let mut at = MAGIC;
    loop {
        let (kind, begin) = (bytes[at], at + 9);
        let end = begin + number(at + 1);
        match kind {
            0x06 => {
                let (size, crc) = (number(begin + 16), &bytes[begin + 24..begin + 28]);
                assert_eq!(&bytes[begin + 28..begin + 35], b"\x03\0\0\0lz4");
                let mut records = Vec::new();
                lz4_flex::frame::FrameDecoder::new(&bytes[begin + 43..end]).read_to_end(&mut records).unwrap();
                assert_eq!((records.len(), &crc32fast::hash(&records).to_le_bytes()[..]), (size, crc));
                plain.extend(records);
            }
            0x07 => {}
            // The end of the data, and a footer that names no summary.
            0x0f => {
                plain.extend(
                    [&[0x0f, 4, 0, 0, 0, 0, 0, 0, 0][..], &[0; 4], &[0x02, 20, 0, 0, 0, 0, 0, 0, 0], &[0; 20]].concat(),
                );
                plain.extend(&bytes[..MAGIC]);
                return plain;
            }
            _ => plain.extend(&bytes[at..end]),
        }
        at = end;
    }
}
