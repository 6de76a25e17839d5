//! Problem `recording`: bytes of a file per second through the readers. Bags and MCAP files are scanned, nothing decoded; rows of CSV
//! are read into samples.
//!
//! The files are never in memory: a few bytes are given out again and again, and `peak_mb` is by how much the peak memory of the
//! process grew meanwhile.

use std::io::{Read, Write as _};
use std::ops::ControlFlow;
use std::path::Path;
use std::time::Instant;

use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::{Rng, SeedableRng};
use tumble::flight_log::{push_numbers, time_cell};
use tumble_formats::log::LogReader;
use tumble_formats::recording::{ScanReport, bag, mcap_reader};
use tumble_formats::{FormatsError, recording::RawMessage};

use crate::Failure;
use crate::bench::{Bench, Goal, Row, quantile};

const PROBLEM: &str = "recording";
/// Bytes of a message, about those of an `EkfState` or an odometry message with its covariances.
const MESSAGE_BYTES: usize = 700;
/// Chunks as `rosbag record` and `ros2 bag record` write them.
const CHUNK_BYTES: usize = 768 << 10;
const CHUNKS: usize = 96;
/// Rows of a log of 66 minutes, each with as many numbers as a simulated flight's.
const ROWS: usize = 10_000;
const NUMBERS: usize = 22;
const LOGS: usize = 21;
/// Slowest that is good enough: 200 MB/s of a recording, 60 MB/s of rows.
const TARGETS_NS_PER_MB: (f64, f64) = (1e9 / 200.0, 1e9 / 60.0);

/// A file: `head`, then `part` so many times, then `tail`.
struct Repeated<'a> {
    head: &'a [u8],
    part: &'a [u8],
    times: usize,
    tail: &'a [u8],
    /// What is left of the piece at hand.
    rest: &'a [u8],
}

impl<'a> Repeated<'a> {
    fn new(head: &'a [u8], part: &'a [u8], tail: &'a [u8]) -> Self {
        Self { head, part, times: CHUNKS, tail, rest: head }
    }

    fn megabytes(&self) -> f64 {
        (self.head.len() + self.part.len() * self.times + self.tail.len()) as f64 * 1e-6
    }
}

impl Read for Repeated<'_> {
    fn read(&mut self, buffer: &mut [u8]) -> std::io::Result<usize> {
        if self.rest.is_empty() {
            if self.times > 0 {
                self.times -= 1;
                self.rest = self.part;
            } else {
                self.rest = std::mem::take(&mut self.tail);
            }
        }
        self.rest.read(buffer)
    }
}

/// The shape of both scans.
type Scan = fn(Repeated, &mut dyn FnMut(RawMessage) -> ControlFlow<()>) -> Result<ScanReport, FormatsError>;

/// A part of a file and how many messages it holds.
type Part = (Vec<u8>, usize);

/// Times all readers, per MB of the file.
pub fn run(bench: &mut Bench) -> Result<(), Failure> {
    let bag: Scan = |file, visit| bag::scan(file, visit);
    let mcap: Scan = |file, visit| mcap_reader::scan(file, visit);
    scan(bench, "bag_scan", bag, bag::MAGIC, || bag_chunk(false), &[])?;
    scan(bench, "bag_scan_lz4", bag, bag::MAGIC, || bag_chunk(true), &[])?;
    let mut end = Vec::new();
    record(&mut end, 15, &[&[0; 4]]);
    record(&mut end, 2, &[&[0; 20]]);
    end.extend(mcap_reader::MAGIC);
    scan(bench, "mcap_scan", mcap, &mcap_reader::MAGIC, || mcap_chunk(false), &end)?;
    scan(bench, "mcap_scan_lz4", mcap, &mcap_reader::MAGIC, || mcap_chunk(true), &end)?;
    rows(bench)
}

fn scan(
    bench: &Bench,
    item: &'static str,
    scan: Scan,
    head: &[u8],
    part: impl Fn() -> Result<Part, Failure>,
    tail: &[u8],
) -> Result<(), Failure> {
    if !bench.wants(PROBLEM, item) {
        return Ok(());
    }
    let (part, messages) = part()?;
    let mut found = 0;
    timed(bench, item, Repeated::new(head, &part, tail).megabytes(), TARGETS_NS_PER_MB.0, CHUNKS * messages, || {
        found = 0;
        let report = scan(Repeated::new(head, &part, tail), &mut |_| {
            found += 1;
            ControlFlow::Continue(())
        });
        report.ok().filter(|report| report.loss_count == 0).map(|_| found)
    })
}

/// Rows of numbers with all their digits.
fn rows(bench: &Bench) -> Result<(), Failure> {
    let item = "csv_samples";
    if !bench.wants(PROBLEM, item) {
        return Ok(());
    }
    let mut generator = ChaCha8Rng::seed_from_u64(1);
    let mut text = tumble_formats::log::TEMPLATE.lines().next().unwrap_or_default().to_owned();
    for time_ns in (0..).step_by(16_000_000).take(ROWS) {
        let mut numbers: [f64; NUMBERS] =
            std::array::from_fn(|_| tumble_identification::noise::signed_unit(&mut generator));
        // a unit quaternion behind the position
        numbers[3..7].copy_from_slice(&[0.6, 0.0, 0.8, 0.0]);
        text.push('\n');
        text += &time_cell(time_ns);
        push_numbers(&mut text, &numbers);
    }
    text.push('\n');
    timed(bench, item, text.len() as f64 * 1e-6, TARGETS_NS_PER_MB.1, ROWS, || {
        let mut reader = LogReader::from_reader(text.as_bytes(), Path::new("log.csv"), false).ok()?;
        let mut found = 0;
        while reader.next_sample().ok()?.is_some() {
            found += 1;
        }
        Some(found)
    })
}

/// Times one reader that finds `expected` messages or rows, each time.
fn timed(
    bench: &Bench,
    item: &'static str,
    megabytes: f64,
    target_ns: f64,
    expected: usize,
    mut read: impl FnMut() -> Option<usize>,
) -> Result<(), Failure> {
    let calibration_ns = bench.calibrate();
    let peak_kb = peak_kb();
    let mut times = Vec::with_capacity(LOGS);
    for _ in 0..LOGS {
        let clock = Instant::now();
        let found = read();
        times.push(clock.elapsed().as_nanos() as f64 / megabytes);
        if found != Some(expected) {
            return Err(Failure::TargetMissed(format!("{item}: found {found:?}, expected {expected}")));
        }
    }
    let peak_mb = (self::peak_kb() - peak_kb) * 1e-3;
    times.sort_by(f64::total_cmp);
    let median_ns = quantile(&times, 0.5);
    bench.report(&Row {
        problem: PROBLEM,
        item,
        median_ns,
        p99_ns: quantile(&times, 0.99),
        n: times.len(),
        quality: vec![("mb_per_s", 1e9 / median_ns), ("file_mb", megabytes), ("peak_mb", peak_mb)],
        goal: Goal { target_ns: Some(target_ns), peer: None },
        calibration_ns,
    });
    Ok(())
}

/// Largest memory that this process ever had, where the system says so.
fn peak_kb() -> f64 {
    let status = std::fs::read_to_string("/proc/self/status").unwrap_or_default();
    let peak = status.lines().find_map(|line| line.strip_prefix("VmHWM:"));
    peak.and_then(|line| line.split_whitespace().next()?.parse().ok()).unwrap_or(f64::NAN)
}

/// Half of it random, half zeros, so that there is something to compress.
fn payload(generator: &mut ChaCha8Rng) -> [u8; MESSAGE_BYTES] {
    let mut payload = [0; MESSAGE_BYTES];
    generator.fill_bytes(&mut payload[..MESSAGE_BYTES / 2]);
    payload
}

fn packed(content: &[u8], lz4: bool) -> Result<Vec<u8>, Failure> {
    if !lz4 {
        return Ok(content.to_vec());
    }
    let refused = |error: &dyn std::fmt::Display| Failure::BadInput(format!("lz4: {error}"));
    let mut writer = lz4_flex::frame::FrameEncoder::new(Vec::new());
    writer.write_all(content).map_err(|error| refused(&error))?;
    writer.finish().map_err(|error| refused(&error))
}

fn bag_chunk(lz4: bool) -> Result<Part, Failure> {
    let mut generator = ChaCha8Rng::seed_from_u64(0);
    let mut chunk = header(&[(b"op", &[7]), (b"conn", &[0; 4]), (b"topic", b"/gnc/ekf")]);
    chunk.extend(header(&[(b"type", b"ff_msgs/EkfState"), (b"md5sum", b"543b97822b033d7199b506ad4005f134")]));
    let mut messages = 0;
    while chunk.len() < CHUNK_BYTES {
        chunk.extend(header(&[(b"op", &[2]), (b"conn", &[0; 4]), (b"time", &[1; 8])]));
        chunk.extend(count(MESSAGE_BYTES));
        chunk.extend(payload(&mut generator));
        messages += 1;
    }
    let compression: &[u8] = if lz4 { b"lz4" } else { b"none" };
    let mut file = header(&[(b"op", &[5]), (b"compression", compression), (b"size", &count(chunk.len()))]);
    let data = packed(&chunk, lz4)?;
    file.extend(count(data.len()));
    file.extend(data);
    Ok((file, messages))
}

/// A record header of a bag behind its length.
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

fn mcap_chunk(lz4: bool) -> Result<Part, Failure> {
    let mut generator = ChaCha8Rng::seed_from_u64(0);
    let mut chunk = Vec::new();
    record(&mut chunk, 3, &[&1_u16.to_le_bytes(), &[1, 0, 0, 0, b'T', 0, 0, 0, 0, 0, 0, 0, 0]]);
    let channel: [&[u8]; 4] = [&1_u16.to_le_bytes(), &1_u16.to_le_bytes(), &[2, 0, 0, 0, b'/', b'a'], &[0; 8]];
    record(&mut chunk, 4, &channel);
    let mut messages = 0;
    while chunk.len() < CHUNK_BYTES {
        record(&mut chunk, 5, &[&1_u16.to_le_bytes(), &[0; 20], &payload(&mut generator)]);
        messages += 1;
    }
    let compression: &[u8] = if lz4 { b"lz4" } else { b"" };
    let data = packed(&chunk, lz4)?;
    let lengths = ((chunk.len() as u64).to_le_bytes(), (data.len() as u64).to_le_bytes());
    let (crc, name) = (crc32fast::hash(&chunk).to_le_bytes(), count(compression.len()));
    let mut file = Vec::new();
    record(&mut file, 6, &[&[0; 16], &lengths.0, &crc, &name, compression, &lengths.1, &data]);
    Ok((file, messages))
}

/// A record of an MCAP file.
fn record(file: &mut Vec<u8>, kind: u8, body: &[&[u8]]) {
    file.push(kind);
    let length: usize = body.iter().map(|part| part.len()).sum();
    file.extend((length as u64).to_le_bytes());
    for part in body {
        file.extend(*part);
    }
}
