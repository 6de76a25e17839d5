//! MCAP files of another library read field by field, ours read by another reader; damaged, torn and hostile files.
#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic, clippy::indexing_slicing)]

use serde_json::{Value, json};
use std::ops::ControlFlow;
use tumble_dynamics::nalgebra::{Quaternion, Vector3};
use tumble_dynamics::{AlignedBox, ObstacleEllipsoid, World};
use tumble_formats::recording::flight::FlightReader;
use tumble_formats::recording::mcap_log::{McapLog, McapSink};
use tumble_formats::recording::mcap_reader::{self, MAGIC};
use tumble_formats::recording::mcap_writer::McapWriter;
use tumble_formats::recording::messages::{Message, Pose, decode};
use tumble_formats::recording::rows::{Cell, RowSink};
use tumble_formats::recording::{Encoding, RawMessage, ScanReport, foxglove};
use tumble_formats::testing::{scratch_file, unpacked_mcap};
use tumble_formats::{FormatsError, Robots};
use tumble_lie::Pose as RigidPose;

use crate::support::largest_allocation::largest_allocation;
use tumble_formats::testing::corruption::{Damage, sweep};

const PLAIN: &[u8] = include_bytes!("../golden/ros2_none.mcap");
const LZ4: &[u8] = include_bytes!("../golden/ros2_lz4.mcap");
const ZSTD: &[u8] = include_bytes!("../golden/ros2_zstd.mcap");
const UNCHUNKED: &[u8] = include_bytes!("../golden/ros2_unchunked.mcap");
const VALUES: &str = include_str!("../golden/ros2_messages.jsonl");

/// A message that outlives its scan.
#[derive(Clone, Debug, PartialEq)]
struct Kept {
    topic: String,
    type_name: String,
    md5: String,
    encoding: Encoding,
    log_time_ns: i64,
    payload: Vec<u8>,
}

impl Kept {
    fn raw(&self) -> RawMessage<'_> {
        RawMessage {
            topic: &self.topic,
            type_name: &self.type_name,
            md5: &self.md5,
            encoding: self.encoding,
            log_time_ns: self.log_time_ns,
            payload: &self.payload,
        }
    }
}

fn try_scan(bytes: &[u8]) -> Result<(ScanReport, Vec<Kept>), FormatsError> {
    let mut kept = Vec::new();
    let report = mcap_reader::scan(bytes, &mut |raw| {
        kept.push(Kept {
            topic: raw.topic.to_owned(),
            type_name: raw.type_name.to_owned(),
            md5: raw.md5.to_owned(),
            encoding: raw.encoding,
            log_time_ns: raw.log_time_ns,
            payload: raw.payload.to_vec(),
        });
        ControlFlow::Continue(())
    })?;
    assert_eq!(report.messages, kept.len() as u64);
    Ok((report, kept))
}

fn scan(bytes: &[u8]) -> (ScanReport, Vec<Kept>) {
    try_scan(bytes).unwrap()
}

/// Numbers and texts of a message in the order of its definition; floats as text, to the bit.
fn values(message: &Message<'_>) -> Vec<Value> {
    let mut values = vec![json!(message.header().stamp_ns.to_string()), json!(message.header().frame_id)];
    let mut numbers = |numbers: &[f64]| values.extend(numbers.iter().map(|number| json!(number.to_bits())));
    let vector = |v: &Vector3<f64>| [v.x, v.y, v.z];
    let quaternion = |q: &Quaternion<f64>| [q.i, q.j, q.k, q.w];
    let pose = |p: &Pose| [&vector(&p.position)[..], &quaternion(&p.orientation)].concat();
    match message {
        Message::PoseStamped(m) => numbers(&pose(&m.pose)),
        Message::WrenchStamped(m) => numbers(&[vector(&m.wrench.force), vector(&m.wrench.torque)].concat()),
        Message::Imu(m) => {
            numbers(&quaternion(&m.orientation));
            numbers(&m.orientation_covariance);
            numbers(&vector(&m.angular_velocity));
            numbers(&m.angular_velocity_covariance);
            numbers(&vector(&m.linear_acceleration));
            numbers(&m.linear_acceleration_covariance);
        }
        Message::Odometry(m) => {
            numbers(&pose(&m.pose));
            numbers(&m.pose_covariance);
            numbers(&[vector(&m.twist.linear), vector(&m.twist.angular)].concat());
            numbers(&m.twist_covariance);
            values.insert(2, json!(m.child_frame_id));
        }
        other => panic!("{other:?}"),
    }
    values
}

/// What the other library put in; floats, which stand there as text, as their bits.
fn expected() -> Vec<Value> {
    let bits = |value: &Value, is_number: bool| match value.as_str().filter(|_| is_number) {
        Some(text) => text.parse::<f64>().map_or(value.clone(), |number| json!(number.to_bits())),
        None => value.clone(),
    };
    let lines = VALUES.lines().skip(1).map(|line| serde_json::from_str::<Value>(line).unwrap());
    lines
        .map(|mut line| {
            let values = line["values"].as_array().unwrap();
            line["values"] = values.iter().enumerate().map(|(i, value)| bits(value, i > 1)).collect();
            line
        })
        .collect()
}

#[test]
fn files_of_another_library_are_read_field_by_field() {
    for (name, bytes, count) in [("none", PLAIN, 15), ("lz4", LZ4, 15), ("zstd", ZSTD, 5), ("unchunked", UNCHUNKED, 5)]
    {
        let (report, kept) = scan(bytes);
        assert_eq!((report.loss_count, report.bytes), (0, bytes.len() as u64), "{name}: {:?}", report.losses);
        assert_eq!(kept.len(), count, "{name}");
        let mut decoded = 0;
        for (found, expected) in kept.iter().zip(expected()) {
            assert_eq!(found.topic, expected["topic"]);
            assert_eq!(found.type_name, expected["type"]);
            assert_eq!(found.log_time_ns, expected["log_time_ns"]);
            assert_eq!((found.encoding, found.md5.as_str()), (Encoding::Cdr, ""));
            match decode(&found.raw()) {
                Some(message) => {
                    assert_eq!(json!(values(&message.unwrap())), expected["values"], "{name}, {}", found.topic);
                    decoded += 1;
                }
                None => assert_eq!(found.type_name, "std_msgs/String"),
            }
        }
        assert_eq!(decoded, count * 4 / 5);
        // Stamps are out of order, and handed on as they come.
        assert!(!kept.is_sorted_by_key(|message| message.log_time_ns));
    }
}

/// For each byte, how many messages are complete before it: by their payloads, or by whole chunks, counted by the index
/// that the other library wrote behind each.
fn complete_before(bytes: &[u8], messages: &[Kept], by_chunk: bool) -> Vec<usize> {
    let mut ends = Vec::new();
    if by_chunk {
        let (mut at, mut chunk_end) = (MAGIC.len(), 0);
        while at + 9 < bytes.len() {
            let length = usize::try_from(u64::from_le_bytes(bytes[at + 1..at + 9].try_into().unwrap())).unwrap();
            let body = &bytes[at + 9..at + 9 + length];
            match bytes[at] {
                0x06 => chunk_end = at + 9 + length,
                0x07 => {
                    let count = u32::from_le_bytes(body[2..6].try_into().unwrap()) / 16;
                    ends.extend(std::iter::repeat_n(chunk_end, count as usize));
                }
                0x02 => break,
                _ => {}
            }
            at += 9 + length;
        }
    } else {
        let mut from = 0;
        for message in messages {
            let place = bytes[from..].windows(message.payload.len()).position(|part| part == message.payload);
            from += place.unwrap() + message.payload.len();
            ends.push(from);
        }
    }
    assert_eq!(ends.len(), messages.len());
    (0..=bytes.len()).map(|at| ends.iter().filter(|end| **end <= at).count()).collect()
}

/// Whether `part` is `whole` with some left out.
fn is_subsequence(part: &[Kept], whole: &[Kept]) -> bool {
    let mut rest = whole.iter();
    part.iter().all(|message| rest.any(|other| other == message))
}

/// What is complete before a cut or a damaged byte is there, nothing else is invented, and the loss is said.
#[test]
fn every_cut_and_every_damaged_byte_leave_the_intact_prefix() {
    for (name, bytes) in [("none", PLAIN), ("lz4", LZ4), ("zstd", ZSTD), ("unchunked", UNCHUNKED)] {
        let (_, whole) = scan(bytes);
        // What a compressed chunk holds is found as its blocks are; of one whose check sum fails, no message can be trusted.
        let after_cut = complete_before(bytes, &whole, matches!(name, "lz4" | "zstd"));
        let after_damage = complete_before(bytes, &whole, name != "unchunked");
        assert!(after_damage.windows(2).filter(|pair| pair[0] < pair[1]).count() > 1, "several steps");
        let checked = sweep(bytes, |damaged, damage| {
            let at = damage.intact_bytes();
            let Ok((report, kept)) = try_scan(damaged) else { return assert!(at < MAGIC.len()) };
            let intact = if matches!(damage, Damage::Cut { .. }) { after_cut[at] } else { after_damage[at] };
            assert!(kept.len() >= intact && kept[..intact] == whole[..intact], "{name}: {} of {intact}", kept.len());
            let is_said = report.loss_count > 0;
            match damage {
                Damage::Cut { .. } => {
                    assert_eq!(kept, whole[..kept.len()], "{name}");
                    assert!(is_said && report.losses.iter().any(|loss| loss.ends_the_scan), "{report:?}");
                }
                Damage::Byte { .. } => {
                    assert!(kept == whole || is_said, "{name}: loses or changes without a word");
                    // Without chunks there is but one check sum, at the end.
                    assert!(name == "unchunked" || is_subsequence(&kept, &whole), "{name}: invents");
                }
            }
        });
        assert!(checked > 3 * bytes.len());
    }
}

/// A record: kind, length, body.
fn record(kind: u8, body: &[u8]) -> Vec<u8> {
    [&[kind], &(body.len() as u64).to_le_bytes()[..], body].concat()
}
fn text(text: &str) -> Vec<u8> {
    [&u32::try_from(text.len()).unwrap().to_le_bytes(), text.as_bytes()].concat()
}
fn schema(id: u16, name: &str, encoding: &str) -> Vec<u8> {
    record(3, &[&id.to_le_bytes(), &text(name)[..], &text(encoding), &text("definition")].concat())
}
fn channel(id: u16, schema: u16, topic: &str, encoding: &str, metadata: &[(&str, &str)]) -> Vec<u8> {
    let pairs: Vec<u8> = metadata.iter().flat_map(|(key, value)| [text(key), text(value)].concat()).collect();
    let length = u32::try_from(pairs.len()).unwrap().to_le_bytes();
    let ids = [id.to_le_bytes(), schema.to_le_bytes()].concat();
    record(4, &[&ids[..], &text(topic), &text(encoding), &length, &pairs].concat())
}
fn message(channel: u16, time: u64, payload: &[u8]) -> Vec<u8> {
    let (time, sequence) = (time.to_le_bytes(), [0; 4]);
    record(5, &[&channel.to_le_bytes()[..], &sequence, &time, &time, payload].concat())
}
/// A chunk that states `expanded` bytes with this check sum.
fn chunk(compression: &str, expanded: u64, crc: u32, records: &[u8]) -> Vec<u8> {
    let lengths = (expanded.to_le_bytes(), (records.len() as u64).to_le_bytes());
    let head = [&[0; 16][..], &lengths.0, &crc.to_le_bytes(), &text(compression), &lengths.1].concat();
    record(6, &[&head[..], records].concat())
}
fn file(records: &[Vec<u8>]) -> Vec<u8> {
    [&MAGIC[..], &record(1, &[text("x"), text("y")].concat()), &records.concat()].concat()
}
fn finished(records: &[Vec<u8>]) -> Vec<u8> {
    [&file(records)[..], &record(15, &[0; 4]), &record(2, &[0; 20]), &MAGIC].concat()
}
fn json_channel() -> Vec<u8> {
    [schema(1, "a.B", "jsonschema"), channel(1, 1, "/a", "json", &[])].concat()
}

#[test]
fn ros_1_in_mcap_keeps_type_and_sum() {
    let sum = "d3812c3cbc69362b77dc0b19b345f8f5";
    let bytes = finished(&[
        schema(7, "geometry_msgs/PoseStamped", "ros1msg"),
        channel(3, 7, "/loc/pose", "ros1", &[("callerid", "/loc"), ("md5sum", sum)]),
        message(3, 5, b"payload"),
    ]);
    let (report, kept) = scan(&bytes);
    assert_eq!(report.loss_count, 0, "{report:?}");
    let expected = Kept {
        topic: "/loc/pose".into(),
        type_name: "geometry_msgs/PoseStamped".into(),
        md5: sum.into(),
        encoding: Encoding::Ros1,
        log_time_ns: 5,
        payload: b"payload".to_vec(),
    };
    assert_eq!(kept, [expected]);
}

#[test]
fn a_reader_stops_when_told() {
    for bytes in [PLAIN, UNCHUNKED] {
        let mut seen = 0;
        let report = mcap_reader::scan(bytes, &mut |_| {
            seen += 1;
            if seen == 3 { ControlFlow::Break(()) } else { ControlFlow::Continue(()) }
        });
        let report = report.unwrap();
        assert_eq!((seen, report.messages, report.loss_count), (3, 3, 0));
    }
}

#[test]
fn other_files_are_refused() {
    for bytes in [&b""[..], b"\x89MCAP1\r\n", b"#ROSBAG V2.0\n", b"t_s,p_x\n"] {
        let error = try_scan(bytes).unwrap_err();
        assert_eq!(error.code(), "T028", "{error}");
    }
}

/// One reason, said without ending the scan, and the message behind it read.
fn passed_over(records: &[Vec<u8>], reason: &str) {
    let all = [records, &[message(1, 9, b"last")]].concat();
    let (report, kept) = scan(&finished(&all));
    assert!(report.losses[0].reason.contains(reason), "{report:?}");
    assert!(report.losses.iter().all(|loss| !loss.ends_the_scan), "{report:?}");
    assert_eq!(kept.last().map(|message| message.payload.as_slice()), Some(&b"last"[..]), "{reason}");
}

#[test]
fn what_cannot_be_read_is_said_and_passed_over() {
    let inner = message(1, 1, b"inner");
    let crc = crc32fast::hash(&inner);
    let length = inner.len() as u64;
    passed_over(&[message(1, 1, b"early"), json_channel()], "before its channel");
    passed_over(&[json_channel(), message(1, u64::MAX, b"late")], "2262");
    passed_over(&[json_channel(), record(5, &[1, 0, 0])], "shorter than its head");
    passed_over(&[json_channel(), channel(2, 9, "/b", "json", &[])], "unknown schema");
    passed_over(&[json_channel(), channel(1, 1, "/other", "json", &[])], "two topics");
    passed_over(&[json_channel(), schema(1, "c.D", "jsonschema")], "two types");
    passed_over(&[json_channel(), channel(2, 1, &"x".repeat(1025), "json", &[])], "without number, topic");
    passed_over(&[json_channel(), chunk("", length, crc ^ 1, &inner)], "check sum");
    passed_over(&[json_channel(), chunk("", length + 1, 0, &inner)], "another length");
    passed_over(&[json_channel(), chunk("brotli", length, crc, &inner)], "unknown compression");
    passed_over(&[json_channel(), chunk("lz4", length, crc, &inner)], "lz4");
    passed_over(&[json_channel(), chunk("zstd", length, crc, &inner)], "zstd");
    passed_over(&[json_channel(), chunk("", 5, 0, &inner[..5])], "ends beyond its chunk");
    passed_over(&[json_channel(), chunk("", length - 1, 0, &inner[..inner.len() - 1])], "ends beyond its chunk");
    // The check sum over all is that of this very file, damaged in a private record that nobody reads.
    let mut bytes = file(&[json_channel(), record(0x90, b"private"), message(1, 1, b"x")]);
    let sum = crc32fast::hash(&bytes).to_le_bytes();
    bytes.extend([record(15, &sum), record(2, &[0; 20]), MAGIC.to_vec()].concat());
    assert_eq!(scan(&bytes).0.loss_count, 0);
    let place = bytes.windows(7).position(|part| part == b"private").unwrap();
    bytes[place] ^= 1;
    let (report, kept) = scan(&bytes);
    assert!(kept.len() == 1 && report.losses[0].reason.contains("check sum of all"), "{report:?}");
}

#[test]
fn kinds_of_records_that_come_later_are_passed_over() {
    let unknown = [record(0x10, b"future"), record(0xff, b"private")].concat();
    let records = [unknown.clone(), message(1, 1, b"inner")].concat();
    let bytes = finished(&[json_channel(), unknown, chunk("", records.len() as u64, 0, &records)]);
    let (report, kept) = scan(&bytes);
    assert_eq!((report.loss_count, kept.len()), (0, 1), "{report:?}");
}

#[test]
fn a_missing_end_is_said_and_harms_nothing() {
    let records = [json_channel(), message(1, 1, b"x")];
    let whole = finished(&records);
    let marred = [&whole[..whole.len() - 1], b"!"].concat();
    let longer = [&whole[..], b"more"].concat();
    for bytes in [file(&records), whole[..whole.len() - 8].to_vec(), marred, longer] {
        let (report, kept) = scan(&bytes);
        assert_eq!((report.loss_count, kept.len()), (1, 1), "{report:?}");
        assert!(report.losses[0].reason.contains("end mark"), "{report:?}");
    }
}

#[test]
fn a_reader_that_fails_leaves_what_it_gave() {
    struct Failing<'a>(&'a [u8]);
    impl std::io::Read for Failing<'_> {
        fn read(&mut self, buffer: &mut [u8]) -> std::io::Result<usize> {
            if self.0.is_empty() { Err(std::io::Error::other("cable pulled")) } else { self.0.read(buffer) }
        }
    }
    let bytes = file(&[json_channel(), message(1, 1, b"x")]);
    let report = mcap_reader::scan(Failing(&bytes), &mut |_| ControlFlow::Continue(())).unwrap();
    assert_eq!(report.messages, 1);
    assert!(report.losses[0].ends_the_scan && report.losses[0].reason.contains("cable pulled"), "{report:?}");
}

/// Scans a hostile file without large allocations.
fn hostile(bytes: &[u8], most_bytes: usize) -> ScanReport {
    let (report, largest) =
        largest_allocation(|| mcap_reader::scan(bytes, &mut |_| ControlFlow::Continue(())).unwrap());
    assert!(largest <= most_bytes, "{largest} bytes at once, for a file of {}", bytes.len());
    report
}

/// Found by a fuzzer: stops the `mcap` crate's own reader.
#[test]
fn twenty_nine_bytes_do_no_harm() {
    let bytes = [&MAGIC[..], &[0xff; 21]].concat();
    let report = hostile(&bytes, 1 << 17);
    assert!(report.losses[0].ends_the_scan && report.losses[0].offset == 8, "{report:?}");
}

#[test]
fn lengths_of_64_bits_take_no_memory() {
    for kind in 1..=16 {
        for length in [u64::MAX, u64::MAX - 8, 1 << 63, 4080 << 20, (64 << 20) + 1, 64 << 20] {
            let mut bytes = file(&[json_channel()]);
            bytes.push(kind);
            bytes.extend(length.to_le_bytes());
            bytes.extend([0xff; 100]);
            let report = hostile(&bytes, 1 << 17);
            assert!(report.losses.last().unwrap().ends_the_scan, "{report:?}");
        }
    }
    // Counts within records: every four bytes of each claim the largest number.
    let inner = [json_channel(), message(1, 1, b"inner")].concat();
    let whole =
        [schema(2, "c.D", "e"), channel(2, 2, "/c", "json", &[("k", "v")]), chunk("", inner.len() as u64, 0, &inner)];
    for n in 0..whole.len() {
        for at in 9..whole[n].len() - 4 {
            let mut records = whole.to_vec();
            records[n][at..at + 4].fill(0xff);
            hostile(&finished(&records), 1 << 17);
        }
    }
}

/// That large, and really there.
#[test]
fn records_beyond_the_limit_are_passed_over() {
    let huge = vec![0; (64 << 20) + 1];
    for records in [message(1, 1, &huge), chunk("", huge.len() as u64, 0, &huge)] {
        let bytes = finished(&[json_channel(), records, message(1, 2, b"next")]);
        let report = hostile(&bytes, 1 << 17);
        assert_eq!((report.messages, report.loss_count), (1, 1), "{report:?}");
        assert!(report.losses[0].reason.contains("more than 64 MiB"), "{report:?}");
    }
}

#[test]
fn four_gigabytes_asked_for_by_a_chunk_are_refused() {
    for compression in ["", "lz4", "zstd"] {
        let bytes = finished(&[json_channel(), chunk(compression, 4080 << 20, 0, &[7; 100])]);
        let report = hostile(&bytes, 1 << 17);
        assert_eq!((report.loss_count, report.losses[0].ends_the_scan), (1, false), "{report:?}");
    }
}

/// Zstandard: `blocks` blocks of 128 KiB of zeros, four bytes each, in a window of 2^(10 + `window`) bytes.
fn zstd_bomb(blocks: usize, window: u8) -> Vec<u8> {
    let mut bytes = vec![0x28, 0xb5, 0x2f, 0xfd, 0x00, window << 3];
    for n in 1..=blocks {
        let head = ((128_u32 << 10) << 3) | 2 | u32::from(n == blocks);
        bytes.extend(&head.to_le_bytes()[..3]);
        bytes.push(0);
    }
    bytes
}

fn lz4_bomb(bytes: usize) -> Vec<u8> {
    let mut encoder = lz4_flex::frame::FrameEncoder::new(Vec::new());
    std::io::copy(&mut std::io::Read::take(std::io::repeat(0), bytes as u64), &mut encoder).unwrap();
    encoder.finish().unwrap()
}

#[test]
fn zip_bombs_stop_at_the_size_that_the_chunk_states() {
    const BOMB_BYTES: usize = 100 << 20;
    for (compression, packed) in [("zstd", zstd_bomb(BOMB_BYTES >> 17, 10)), ("lz4", lz4_bomb(BOMB_BYTES))] {
        assert!(packed.len() < BOMB_BYTES / 200);
        // Stated too small; stated as it is, which is beyond what is read.
        for (stated, most_bytes) in [(1000, 9 << 20), (BOMB_BYTES as u64, 1 << 20)] {
            let report = hostile(&finished(&[chunk(compression, stated, 0, &packed)]), most_bytes);
            assert_eq!((report.loss_count, report.messages), (1, 0), "{compression}, {stated}: {report:?}");
        }
    }
    // A window of two terabytes for nothing.
    let report = hostile(&finished(&[chunk("zstd", 1000, 0, &zstd_bomb(1, 31))]), 1 << 17);
    assert!(report.losses[0].reason.contains("zstd"), "{report:?}");
    // Largest that is read: 64 MiB of zeros, which are no records.
    let report = hostile(&finished(&[chunk("zstd", 64 << 20, 0, &zstd_bomb(512, 10))]), 128 << 20);
    assert_eq!(report.messages, 0);
}

#[test]
fn many_small_zip_bombs_are_no_large_one() {
    let bombs: Vec<Vec<u8>> = (0..100).map(|_| chunk("zstd", 16 << 20, 0, &zstd_bomb(128, 10))).collect();
    let bytes = finished(&bombs);
    let report = hostile(&bytes, 33 << 20);
    // 128 MiB, and 200 times the file.
    let most = (128 << 20) + 200 * bytes.len() as u64;
    assert!(report.expanded_bytes <= most && report.expanded_bytes >= 128 << 20, "{report:?}");
    let read = report.expanded_bytes >> 24;
    assert!(read <= 14, "{read}");
    assert_eq!(report.losses[usize::try_from(read).unwrap()].reason.matches("200 times").count(), 1, "{report:?}");
}

#[test]
fn a_million_channels_and_schemas_take_bounded_memory() {
    let mut bytes = file(&[]);
    for n in 0..1_000_000_u32 {
        let id = u16::try_from(n % 65_536).unwrap();
        bytes.extend(schema(id, &format!("s/{n}"), ""));
        bytes.extend(channel(id, id, &format!("/{n}"), "json", &[]));
    }
    // Tables of 65 536 numbers, not of a million.
    let report = hostile(&bytes, 32 << 20);
    assert!(report.loss_count > 1_800_000 && report.losses.len() == ScanReport::MOST_LOSSES);
}

#[test]
fn a_chunk_in_a_chunk_is_not_opened() {
    let mut nested = [json_channel(), message(1, 1, b"deep")].concat();
    for _ in 0..1000 {
        nested = chunk("", nested.len() as u64, 0, &nested);
    }
    let report = hostile(&finished(&[nested]), 1 << 18);
    assert_eq!((report.messages, report.loss_count), (0, 1), "{report:?}");
    assert!(report.losses[0].reason.contains("within a chunk"));
}

/// Rows in memory.
#[derive(Default, Debug, PartialEq)]
struct Rows {
    columns: Vec<String>,
    rows: Vec<(i64, Vec<Cell>)>,
}

impl RowSink for Rows {
    fn begin(&mut self, columns: &[String]) -> Result<(), FormatsError> {
        self.columns = columns.to_vec();
        Ok(())
    }
    fn row(&mut self, time_ns: i64, cells: &[Cell]) -> Result<(), FormatsError> {
        self.rows.push((time_ns, cells.to_vec()));
        Ok(())
    }
}

/// A log with every kind of column and cell, 40 rows 0.1 s apart.
fn log() -> Rows {
    let measured = ["p_x", "p_y", "p_z", "q_x", "q_y", "q_z", "q_w", "f_x", "f_y", "f_z", "tau_x", "tau_y", "tau_z"];
    let more = ["w_x", "note", "true_p_x", "true_p_y", "true_p_z", "true_q_x", "true_q_y", "true_q_z", "true_q_w"];
    let last = ["cmd_f_x", "est_mass", "sigma_mass"];
    let columns: Vec<String> = [&measured[..], &more, &last].concat().into_iter().map(String::from).collect();
    let row = |n: u32| {
        let number = |column: u32| match (n + column) % 5 {
            0 => -0.0,
            1 => f64::from(n) * 1e-300,
            2 => f64::MAX / f64::from(column + 1),
            3 => 0.1 + f64::from(column),
            _ => f64::from(n * 100 + column) / 7.0,
        };
        let mut cells: Vec<Cell> = (0..).take(columns.len()).map(|column| Cell::Number(number(column))).collect();
        cells[14] = if n.is_multiple_of(3) { Cell::Text("\"quoted\" µ".into()) } else { Cell::Empty };
        if n.is_multiple_of(4) {
            // A wrench with a hole.
            cells[9] = Cell::Empty;
        }
        (1_700_000_000_000_000_001 + i64::from(n) * 100_000_000, cells)
    };
    Rows { rows: (0..40).map(row).collect(), columns }
}

fn write(rows: &Rows) -> Vec<u8> {
    let mut sink = McapSink::new(Vec::new()).unwrap();
    sink.begin(&rows.columns).unwrap();
    for (time_ns, cells) in &rows.rows {
        sink.row(*time_ns, cells).unwrap();
    }
    sink.finish().unwrap()
}

fn read(bytes: &[u8]) -> (Rows, u64) {
    let mut rows = Rows::default();
    let (log, _) = McapLog::survey(bytes).unwrap();
    let left_out = log.rows(bytes, &mut rows).unwrap();
    (rows, left_out)
}

#[test]
fn a_log_comes_back_to_the_bit() {
    let mut log = log();
    // Late and repeated stamps keep their places.
    log.rows.swap(3, 9);
    log.rows[20].0 = log.rows[19].0;
    let (found, left_out) = read(&write(&log));
    assert_eq!((left_out, found.rows.len()), (0, log.rows.len()));
    let bits = |cell: &Cell| match cell {
        Cell::Number(number) => Cell::Text(number.to_bits().to_string()),
        other => other.clone(),
    };
    for ((found_ns, found_cells), (time_ns, cells)) in found.rows.iter().zip(&log.rows) {
        assert_eq!(found_ns, time_ns);
        for (name, cell) in log.columns.iter().zip(cells) {
            let place = found.columns.iter().position(|column| column == name).unwrap();
            assert_eq!(bits(&found_cells[place]), bits(cell), "{name} at {time_ns}");
        }
    }
    assert_eq!(found.columns.len(), log.columns.len());
}

/// Poses, wrenches, rates and accelerations, each in its place.
#[test]
fn a_log_of_ours_is_a_flight() {
    let names = "p_x,p_y,p_z,q_x,q_y,q_z,q_w,v_x,v_y,v_z,w_x,w_y,w_z,a_x,a_y,a_z,f_x,f_y,f_z,tau_x,tau_y,tau_z";
    let columns: Vec<String> = names.split(',').map(String::from).collect();
    let mut rows = Rows { columns, rows: Vec::new() };
    for n in 0..3_u32 {
        let mut cells: Vec<Cell> = (0..22).map(|column| Cell::Number(f64::from(100 * n + column))).collect();
        cells[3..7].clone_from_slice(&[0.0, 0.6, 0.0, 0.8].map(Cell::Number));
        if n == 1 {
            cells[7..16].fill(Cell::Empty);
        }
        rows.rows.push((i64::from(n) * 16_000_000, cells));
    }
    let path = scratch_file("flight.mcap", write(&rows));
    let mut flight = FlightReader::open(&path, None, &Robots::none()).unwrap();
    let samples: Vec<_> = std::iter::from_fn(|| flight.next_sample().unwrap()).collect();
    std::fs::remove_file(&path).unwrap();
    assert_eq!(samples.len(), 3);
    let vector = |n: u32, column: u32| Vector3::new(0.0, 1.0, 2.0).add_scalar(f64::from(100 * n + column));
    for (n, sample) in (0..).zip(&samples) {
        assert_eq!(sample.time_ns, i64::from(n) * 16_000_000);
        assert_eq!(sample.world_from_body.unwrap().translation.vector, vector(n, 0));
        assert!((sample.world_from_body.unwrap().rotation.coords.y - 0.6).abs() < 1e-15);
        let beside = [sample.velocity_origin_world, sample.rate_body, sample.acceleration_origin_body];
        assert_eq!(beside, [7, 10, 13].map(|column| (n != 1).then(|| vector(n, column))), "{n}");
        let wrench = sample.wrench_body.unwrap();
        assert!(
            (wrench.force - vector(n, 16)).amax() < 1e-9 && (wrench.torque - vector(n, 19)).amax() < 1e-9,
            "{wrench:?}"
        );
    }
}

/// The reader of the `mcap` crate, which shares nothing with ours, on what we wrote.
#[test]
fn another_reader_reads_what_we_write() {
    let log = log();
    let bytes = write(&log);
    let summary = mcap::Summary::read(&bytes).unwrap().unwrap();
    let plain = unpacked_mcap(&bytes);
    let messages: Vec<_> = mcap::MessageStream::new(&plain).unwrap().map(Result::unwrap).collect();
    // Each record as it lies in the file, and the indexes of messages, found by the summary.
    assert!(mcap::read::LinearReader::new(&bytes).unwrap().all(|record| record.is_ok()));
    let indexed = summary.chunk_indexes.iter().map(|chunk| {
        let indexes = summary.read_message_indexes(&bytes, chunk).unwrap();
        assert!(
            indexes
                .values()
                .flatten()
                .all(|entry| { (chunk.message_start_time..=chunk.message_end_time).contains(&entry.log_time) })
        );
        indexes.values().map(Vec::len).sum::<usize>()
    });
    assert_eq!(indexed.sum::<usize>(), messages.len());
    assert_eq!(summary.stats.unwrap().message_count, messages.len() as u64);
    let longest = summary.chunk_indexes.iter().map(|chunk| chunk.message_end_time - chunk.message_start_time).max();
    assert!(longest < Some(1_000_000_000) && summary.chunk_indexes.len() == 4, "{longest:?}");
    let mut poses = log.rows.iter();
    for message in &messages {
        let content: Value = serde_json::from_slice(&message.data).unwrap();
        let schema = message.channel.schema.as_ref().unwrap();
        assert_eq!((schema.encoding.as_str(), message.channel.message_encoding.as_str()), ("jsonschema", "json"));
        let definition: Value = serde_json::from_slice(&schema.data).unwrap();
        assert_eq!(definition["title"], schema.name);
        check_fields(&content, &definition, &message.channel.topic);
        if message.channel.topic == "/measured/pose" {
            let (time_ns, cells) = poses.next().unwrap();
            assert_eq!(i64::try_from(message.log_time).unwrap(), *time_ns);
            let stamp = content["timestamp"]["sec"].as_i64().unwrap() * 1_000_000_000;
            assert_eq!(stamp + content["timestamp"]["nsec"].as_i64().unwrap(), *time_ns);
            let numbers = [&content["pose"]["position"], &content["pose"]["orientation"]]
                .into_iter()
                .zip([&["x", "y", "z"][..], &["x", "y", "z", "w"]]);
            let numbers = numbers.flat_map(|(object, names)| names.iter().map(|name| object[*name].as_f64().unwrap()));
            assert_eq!(numbers.map(Cell::Number).collect::<Vec<_>>(), cells[..7]);
        }
    }
    assert!(poses.next().is_none());
    let topics: std::collections::BTreeSet<&str> =
        messages.iter().map(|message| message.channel.topic.as_str()).collect();
    let expected =
        ["/commanded/columns", "/estimated/columns", "/measured/columns", "/measured/pose", "/measured/wrench"];
    assert!(topics.into_iter().eq([&expected[..], &["/sigma/columns", "/tf", "/true/pose"]].concat()));
}

/// Every object holds the fields that its schema lists, no others, of the kinds it says.
fn check_fields(value: &Value, schema: &Value, place: &str) {
    match schema["type"].as_str() {
        Some("object") if schema.get("properties").is_some() => {
            let (fields, listed) = (value.as_object().unwrap(), schema["properties"].as_object().unwrap());
            assert!(fields.keys().eq(listed.keys()), "{place}: {:?} against {:?}", fields.keys(), listed.keys());
            fields.iter().for_each(|(name, value)| check_fields(value, &listed[name], &format!("{place}.{name}")));
        }
        Some("array") => value.as_array().unwrap().iter().for_each(|item| check_fields(item, &schema["items"], place)),
        Some("number") => assert!(value.is_number(), "{place}"),
        Some("integer") => assert!(value.is_i64() || value.is_u64(), "{place}"),
        Some("string") => assert!(value.is_string(), "{place}"),
        Some("boolean") => assert!(value.is_boolean(), "{place}"),
        _ => {}
    }
}

/// Equal in every process, on every machine.
#[test]
fn the_bytes_of_a_log_follow_from_its_rows() {
    assert_eq!(crc32fast::hash(&write(&log())), 4_288_394_940);
}

/// Players seek by the index: every offset in it is of the record that it says.
#[test]
fn the_index_points_at_chunks_and_at_their_messages() {
    const CHUNK: u8 = 0x06;
    const MESSAGE_INDEX: u8 = 0x07;
    let bytes = write(&log());
    let at = |offset: u64| bytes[usize::try_from(offset).unwrap()];
    let summary = mcap::Summary::read(&bytes).unwrap().unwrap();
    assert!(summary.chunk_indexes.len() > 3);
    for chunk in &summary.chunk_indexes {
        let offsets: Vec<u64> = chunk.message_index_offsets.values().copied().collect();
        assert_eq!(at(chunk.chunk_start_offset), CHUNK);
        assert!(offsets.iter().all(|offset| at(*offset) == MESSAGE_INDEX), "{offsets:?}");
        assert_eq!(offsets.iter().min(), Some(&(chunk.chunk_start_offset + chunk.chunk_length)));
    }
}

#[test]
fn power_cuts_cost_at_most_the_last_second() {
    let log = log();
    let bytes = write(&log);
    let complete = scan(&bytes).1.len();
    let mut last = 0;
    for cut in (MAGIC.len()..bytes.len()).step_by(211).chain([bytes.len()]) {
        let (rows, _) = read(&bytes[..cut]);
        assert!(rows.rows.len() >= last, "rows are only gained");
        last = rows.rows.len();
    }
    assert_eq!((last, complete), (log.rows.len(), scan(&bytes).1.len()));
    // Of a file without its last chunk, everything but its last second is there.
    let summary = mcap::Summary::read(&bytes).unwrap().unwrap();
    let third = usize::try_from(summary.chunk_indexes[3].chunk_start_offset).unwrap();
    assert_eq!(read(&bytes[..third]).0.rows.len(), 30);
}

/// Of a flight whose second chunk is damaged, the rows of the others are there.
#[test]
fn a_damaged_second_costs_this_second() {
    let log = log();
    let mut bytes = write(&log);
    let summary = mcap::Summary::read(&bytes).unwrap().unwrap();
    let middle = &summary.chunk_indexes[1];
    bytes[usize::try_from(middle.chunk_start_offset + middle.chunk_length / 2).unwrap()] ^= 1;
    let (rows, _) = read(&bytes);
    let times: Vec<i64> = rows.rows.iter().map(|row| row.0).collect();
    let expected = log.rows.iter().map(|row| row.0).enumerate().filter(|(n, _)| !(10..20).contains(n));
    assert_eq!(times, expected.map(|(_, time)| time).collect::<Vec<_>>());
}

#[test]
fn worlds_are_drawn_as_boxes_and_ellipsoids() {
    let obstacle = RigidPose::new(Vector3::new(1.0, 2.0, 3.0), Vector3::new(0.0, 0.0, std::f64::consts::FRAC_PI_2));
    let world = World {
        keep_in: vec![AlignedBox {
            lower_world: Vector3::new(-1.0, -2.0, 0.0),
            upper_world: Vector3::new(3.0, 2.0, 1.0),
        }],
        keep_out: vec![AlignedBox { lower_world: Vector3::zeros(), upper_world: Vector3::new(0.5, 1.0, 2.0) }],
        obstacles: vec![ObstacleEllipsoid { world_from_ellipsoid: obstacle, semi_axes: Vector3::new(0.1, 0.2, 0.3) }],
    };
    let schema = foxglove::Schema::scene_update();
    let mut writer = McapWriter::new(Vec::new()).unwrap();
    let channel = writer.channel("/world", &schema).unwrap();
    writer.write(channel, 7, &foxglove::world_scene(7, &world)).unwrap();
    let bytes = writer.finish().unwrap();
    let plain = unpacked_mcap(&bytes);
    let message = mcap::MessageStream::new(&plain).unwrap().next().unwrap().unwrap();
    let scene: Value = serde_json::from_slice(&message.data).unwrap();
    check_fields(&scene, &serde_json::from_str(&schema.text).unwrap(), "scene");
    let ids = [0, 1, 2].map(|entity| scene["entities"][entity]["id"].as_str().unwrap().to_owned());
    assert_eq!(ids, ["keep_in", "keep_out", "obstacles"]);
    let (cube, sphere) = (&scene["entities"][0]["cubes"][0], &scene["entities"][2]["spheres"][0]);
    let forbidden = &scene["entities"][1]["cubes"][0];
    assert_eq!(forbidden["pose"]["position"], json!({"x": 0.25, "y": 0.5, "z": 1.0}));
    assert_eq!(forbidden["size"], json!({"x": 0.5, "y": 1.0, "z": 2.0}));
    assert_ne!(forbidden["color"], cube["color"]);
    assert_eq!(cube["pose"]["position"], json!({"x": 1.0, "y": 0.0, "z": 0.5}));
    assert_eq!(cube["size"], json!({"x": 4.0, "y": 4.0, "z": 1.0}));
    assert_eq!(sphere["pose"]["position"], json!({"x": 1.0, "y": 2.0, "z": 3.0}));
    assert_eq!(sphere["size"], json!({"x": 0.2, "y": 0.4, "z": 0.6}));
    let half = std::f64::consts::FRAC_1_SQRT_2;
    let turned = &sphere["pose"]["orientation"];
    assert!(
        (turned["z"].as_f64().unwrap() - half).abs() < 1e-15 && (turned["w"].as_f64().unwrap() - half).abs() < 1e-15
    );
}

/// Nothing is lost silently when the disk is full, at whichever write it happens.
#[test]
fn every_refused_write_is_an_error() {
    struct Full(usize);
    impl std::io::Write for Full {
        fn write(&mut self, bytes: &[u8]) -> std::io::Result<usize> {
            self.0 = self.0.checked_sub(1).ok_or(std::io::ErrorKind::StorageFull)?;
            Ok(bytes.len())
        }
        fn flush(&mut self) -> std::io::Result<()> {
            Ok(())
        }
    }
    let log = log();
    let attempt = |writes: usize| -> Result<Full, FormatsError> {
        let mut sink = McapSink::new(Full(writes))?;
        sink.begin(&log.columns)?;
        for (time_ns, cells) in &log.rows {
            sink.row(*time_ns, cells)?;
        }
        sink.finish()
    };
    let needed = 1_000_000 - attempt(1_000_000).unwrap().0;
    assert!(needed > 20);
    for writes in 0..needed {
        let error = attempt(writes).err().expect("a full disk");
        assert_eq!(error.code(), "T011", "{error}");
    }
}
