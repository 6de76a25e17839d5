//! Reading a bag from memory: bytes of the file per second, nothing decoded.

use std::io::Write as _;
use std::ops::ControlFlow;

use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::{Rng, SeedableRng};
use tumble_astrobee::recording::bag;

use crate::Failure;
use crate::bench::{Bench, Goal};

const PROBLEM: &str = "recording";
/// Bytes of a message, about those of an `EkfState`.
const MESSAGE_BYTES: usize = 650;
/// Chunks as `rosbag record` writes them.
const CHUNK_BYTES: usize = 768 << 10;
const CHUNKS: usize = 40;
/// Slowest that is good enough, bytes per ns: 200 MB/s.
const TARGET_BYTES_PER_NS: f64 = 0.2;

/// Times a scan, per byte of the file.
pub fn run(bench: &mut Bench) -> Result<(), Failure> {
    for (item, compression) in [("bag scan, ns/MB", "none"), ("bag scan lz4, ns/MB", "lz4")] {
        if !bench.wants(PROBLEM, item) {
            continue;
        }
        let file = file(compression)?;
        let megabytes = file.len() as f64 * 1e-6;
        let scan = || {
            let mut bytes = 0_usize;
            let report = bag::scan(file.as_slice(), &mut |raw| {
                bytes += raw.payload.len();
                ControlFlow::Continue(())
            });
            (bytes, report.map_or(u64::MAX, |report| report.loss_count))
        };
        let (bytes, losses) = scan();
        let quality = [("payload_mb", bytes as f64 * 1e-6), ("file_mb", megabytes), ("losses", losses as f64)];
        let calibration_ns = bench.calibrate();
        let mut times: Vec<f64> = (0..21)
            .map(|_| {
                let start = std::time::Instant::now();
                std::hint::black_box(scan());
                start.elapsed().as_nanos() as f64 / megabytes
            })
            .collect();
        times.sort_by(f64::total_cmp);
        bench.report(&crate::bench::Row {
            problem: PROBLEM,
            item,
            median_ns: crate::bench::quantile(&times, 0.5),
            p99_ns: crate::bench::quantile(&times, 0.99),
            n: times.len(),
            quality: quality.to_vec(),
            goal: Goal { target_ns: Some(1e6 / TARGET_BYTES_PER_NS), peer: None },
            calibration_ns,
        });
    }
    crate::mcap_scan::run(bench);
    Ok(())
}

/// A bag of random messages: half of every payload is zeros, so that there is something to compress.
fn file(compression: &str) -> Result<Vec<u8>, Failure> {
    let mut generator = ChaCha8Rng::seed_from_u64(0);
    let mut file = bag::MAGIC.to_vec();
    for _ in 0..CHUNKS {
        let mut chunk = header(&[(b"op", &[7]), (b"conn", &[0; 4]), (b"topic", b"/gnc/ekf")]);
        chunk.extend(header(&[(b"type", b"ff_msgs/EkfState"), (b"md5sum", b"543b97822b033d7199b506ad4005f134")]));
        while chunk.len() < CHUNK_BYTES {
            let mut payload = [0; MESSAGE_BYTES];
            generator.fill_bytes(payload.get_mut(..MESSAGE_BYTES / 2).unwrap_or_default());
            chunk.extend(header(&[(b"op", &[2]), (b"conn", &[0; 4]), (b"time", &[1; 8])]));
            chunk.extend(count(MESSAGE_BYTES));
            chunk.extend(payload);
        }
        file.extend(header(&[(b"op", &[5]), (b"compression", compression.as_bytes()), (b"size", &count(chunk.len()))]));
        let data = if compression == "lz4" { lz4(&chunk)? } else { chunk };
        file.extend(count(data.len()));
        file.extend(data);
    }
    Ok(file)
}

fn lz4(content: &[u8]) -> Result<Vec<u8>, Failure> {
    let refused = |error: &dyn std::fmt::Display| Failure::BadInput(format!("lz4: {error}"));
    let mut writer = lz4_flex::frame::FrameEncoder::new(Vec::new());
    writer.write_all(content).map_err(|error| refused(&error))?;
    writer.finish().map_err(|error| refused(&error))
}

/// A record header behind its length.
fn header(fields: &[(&[u8], &[u8])]) -> Vec<u8> {
    let mut header = Vec::new();
    for (name, value) in fields {
        header.extend(count(name.len() + 1 + value.len()));
        header.extend(*name);
        header.push(b'=');
        header.extend(*value);
    }
    [count(header.len()).to_vec(), header].concat()
}

/// Four bytes; everything here is far shorter than 4 GiB.
fn count(bytes: usize) -> [u8; 4] {
    u32::try_from(bytes).unwrap_or(u32::MAX).to_le_bytes()
}
