//! The forward scan of MCAP files: bytes of records per second, without compression and with lz4.

use std::ops::ControlFlow;

use tumble_astrobee::recording::mcap_reader::{MAGIC, scan};

use crate::bench::{Bench, Goal};

/// What a chunk holds, and how many there are.
const CHUNK_BYTES: usize = 1 << 20;
const CHUNKS: usize = 16;
/// About an odometry message with its covariances.
const PAYLOAD_BYTES: usize = 720;
/// 200 MB/s.
const MOST_NS_PER_BYTE: f64 = 5.0;

fn record(file: &mut Vec<u8>, kind: u8, body: &[&[u8]]) {
    file.push(kind);
    let length: usize = body.iter().map(|part| part.len()).sum();
    file.extend((length as u64).to_le_bytes());
    for part in body {
        file.extend(*part);
    }
}

/// A file whose payloads, like flown ones, are half zeros; bytes of records in its chunks, and their messages.
fn file(compression: &str) -> (Vec<u8>, usize, u64) {
    let mut records = Vec::new();
    record(&mut records, 3, &[&1_u16.to_le_bytes(), &[1, 0, 0, 0, b'T', 0, 0, 0, 0, 0, 0, 0, 0]]);
    let channel: [&[u8]; 4] = [&1_u16.to_le_bytes(), &1_u16.to_le_bytes(), &[2, 0, 0, 0, b'/', b'a'], &[0; 8]];
    record(&mut records, 4, &channel);
    let (mut number, mut messages) = (0_u64, 0);
    while records.len() < CHUNK_BYTES {
        let mut payload = [0; PAYLOAD_BYTES];
        for part in payload.chunks_exact_mut(8).step_by(2) {
            number = number.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1);
            part.copy_from_slice(&number.to_be_bytes());
        }
        record(&mut records, 5, &[&1_u16.to_le_bytes(), &[0; 20], &payload]);
        messages += 1;
    }
    let packed = if compression == "lz4" {
        let mut encoder = lz4_flex::frame::FrameEncoder::new(Vec::new());
        // Writing to memory never fails.
        let _ = std::io::Write::write_all(&mut encoder, &records);
        encoder.finish().unwrap_or_default()
    } else {
        records.clone()
    };
    let mut bytes = MAGIC.to_vec();
    for _ in 0..CHUNKS {
        let lengths = ((records.len() as u64).to_le_bytes(), (packed.len() as u64).to_le_bytes());
        let name = (u32::try_from(compression.len()).unwrap_or_default().to_le_bytes(), compression.as_bytes());
        let crc = crc32fast::hash(&records).to_le_bytes();
        record(&mut bytes, 6, &[&[0; 16], &lengths.0, &crc, &name.0, name.1, &lengths.1, &packed]);
    }
    record(&mut bytes, 15, &[&[0; 4]]);
    record(&mut bytes, 2, &[&[0; 20]]);
    bytes.extend(MAGIC);
    (bytes, records.len() * CHUNKS, messages * CHUNKS as u64)
}

/// Runs the items.
pub fn run(bench: &mut Bench) {
    for (compression, item) in [("", "MCAP scan, 16 MiB plain"), ("lz4", "MCAP scan, 16 MiB lz4")] {
        if !bench.wants("recording", item) {
            continue;
        }
        let (bytes, content, messages) = file(compression);
        let count = || {
            let mut count = 0_u64;
            let report = scan(&bytes[..], &mut |_| {
                count += 1;
                ControlFlow::Continue(())
            });
            (count, report.map_or(u64::MAX, |report| report.loss_count))
        };
        let (found, lost) = count();
        let goal = Goal { target_ns: Some(content as f64 * MOST_NS_PER_BYTE), peer: None };
        let quality = [("missing", messages as f64 - found as f64), ("losses", lost as f64)];
        bench.each("recording", item, goal, 1, &quality, |_| count());
    }
}
