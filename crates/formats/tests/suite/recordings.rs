//! Bags and messages written by another library, read field by field; damaged, torn and hostile files.
#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic, clippy::indexing_slicing)]

use serde_json::{Value, json};
use std::ops::ControlFlow;
use tumble_dynamics::nalgebra::{Quaternion, Vector3};
use tumble_formats::FormatsError;
use tumble_formats::recording::messages::{Header, KNOWN, Message, MessageError, Pose, Twist, WrenchMessage, decode};
use tumble_formats::recording::{Encoding, RawMessage, ScanReport, bag};

use crate::support::largest_allocation::largest_allocation;
use tumble_formats::testing::bag_writer::{BagWriter, Compression};
use tumble_formats::testing::corruption::{Damage, sweep};

const PLAIN: &[u8] = include_bytes!("../golden/messages_none.bag");
const BZ2: &[u8] = include_bytes!("../golden/messages_bz2.bag");
const LZ4: &[u8] = include_bytes!("../golden/messages_lz4.bag");
const VALUES: &str = include_str!("../golden/messages.jsonl");
const CDR: &str = include_str!("../golden/messages_cdr.jsonl");

/// A message that outlives its scan.
#[derive(Clone, Debug, PartialEq)]
struct Kept {
    topic: String,
    type_name: String,
    md5: String,
    log_time_ns: i64,
    payload: Vec<u8>,
}

impl Kept {
    fn raw(&self) -> RawMessage<'_> {
        RawMessage {
            topic: &self.topic,
            type_name: &self.type_name,
            md5: &self.md5,
            encoding: Encoding::Ros1,
            log_time_ns: self.log_time_ns,
            payload: &self.payload,
        }
    }
}

fn try_scan(bytes: &[u8]) -> Result<(ScanReport, Vec<Kept>), FormatsError> {
    let mut kept = Vec::new();
    let report = bag::scan(bytes, &mut |raw| {
        assert_eq!(raw.encoding, Encoding::Ros1);
        kept.push(Kept {
            topic: raw.topic.to_owned(),
            type_name: raw.type_name.to_owned(),
            md5: raw.md5.to_owned(),
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

/// The lines behind the provenance.
fn lines(text: &str) -> Vec<Value> {
    text.lines().skip(1).map(|line| serde_json::from_str(line).unwrap()).collect()
}

/// The values of a message one after the other, in the order of the definition.
#[derive(Default)]
struct Values(Vec<Value>);

impl Values {
    fn number(&mut self, number: impl Into<Value>) -> &mut Self {
        self.0.push(number.into());
        self
    }
    fn numbers<T: Copy + Into<f64>>(&mut self, numbers: impl IntoIterator<Item = T>) -> &mut Self {
        for number in numbers {
            self.0.push(json!(number.into()));
        }
        self
    }
    fn header(&mut self, header: &Header<'_>) -> &mut Self {
        if let Some(sequence) = header.sequence {
            self.number(sequence);
        }
        self.number(header.stamp_ns.to_string()).number(header.frame_id)
    }
    fn vector(&mut self, v: &Vector3<f64>) -> &mut Self {
        self.numbers([v.x, v.y, v.z])
    }
    fn quaternion(&mut self, q: &Quaternion<f64>) -> &mut Self {
        self.numbers([q.i, q.j, q.k, q.w])
    }
    fn pose(&mut self, pose: &Pose) -> &mut Self {
        self.vector(&pose.position).quaternion(&pose.orientation)
    }
    fn twist(&mut self, twist: &Twist) -> &mut Self {
        self.vector(&twist.linear).vector(&twist.angular)
    }
    fn wrench(&mut self, wrench: &WrenchMessage) -> &mut Self {
        self.vector(&wrench.force).vector(&wrench.torque)
    }

    fn of(message: &Message<'_>) -> Vec<Value> {
        let mut values = Self::default();
        let v = values.header(message.header());
        match message {
            Message::EkfState(m) => {
                v.number(m.child_frame_id).pose(&m.pose).vector(&m.velocity).vector(&m.omega).vector(&m.gyro_bias);
                v.vector(&m.accel).vector(&m.accel_bias).numbers(m.cov_diag);
                v.numbers([m.confidence, m.aug_state_enum, m.status, m.of_count, m.ml_count]);
                v.pose(&m.hr_global_pose).numbers(m.ml_mahal_dists).number(m.estimating_bias);
            }
            Message::FamCommand(m) => {
                v.wrench(&m.wrench).vector(&m.accel).vector(&m.alpha).number(m.status);
                v.vector(&m.position_error).vector(&m.position_error_integrated);
                v.vector(&m.attitude_error).vector(&m.attitude_error_integrated);
                v.numbers([m.attitude_error_mag]).number(m.control_mode);
            }
            Message::PmcCommand(m) => {
                v.number(m.goals.len());
                for goal in &m.goals {
                    v.number(goal.motor_speed).numbers(goal.nozzle_positions);
                }
            }
            Message::PmcTelemetry(m) => {
                v.number(m.statuses.len());
                for s in &m.statuses {
                    v.numbers([s.motor_speed, s.motor_current, s.v6_current]).number(s.pressure);
                    v.number(s.temperatures.len()).numbers(s.temperatures.iter().copied());
                    v.numbers([s.status_1, s.status_2, s.command_id]);
                }
            }
            Message::FlightMode(m) => {
                v.number(m.name).number(m.control_enabled).numbers(m.collision_radius);
                v.numbers(m.tolerance_pos_endpoint).numbers(m.tolerances);
                for gain in [&m.att_kp, &m.att_ki, &m.omega_kd, &m.pos_kp, &m.pos_ki, &m.vel_kd] {
                    v.vector(gain);
                }
                v.numbers(m.hard_limits).number(m.speed);
            }
            Message::InertiaStamped(m) => {
                v.numbers([m.mass]).vector(&m.center_of_mass).numbers(m.inertia);
            }
            Message::Imu(m) => {
                v.quaternion(&m.orientation).numbers(m.orientation_covariance);
                v.vector(&m.angular_velocity).numbers(m.angular_velocity_covariance);
                v.vector(&m.linear_acceleration).numbers(m.linear_acceleration_covariance);
            }
            Message::PoseStamped(m) => {
                v.pose(&m.pose);
            }
            Message::TwistStamped(m) => {
                v.twist(&m.twist);
            }
            Message::WrenchStamped(m) => {
                v.wrench(&m.wrench);
            }
            Message::Odometry(m) => {
                v.number(m.child_frame_id).pose(&m.pose).numbers(m.pose_covariance);
                v.twist(&m.twist).numbers(m.twist_covariance);
            }
            other => panic!("a message of this kind is not compared: {other:?}"),
        }
        values.0
    }
}

/// Numbers by value (floats are written as text), everything else as it is.
fn same(found: &[Value], expected: &Value, name: &str) {
    let expected = expected.as_array().unwrap();
    for (i, (f, e)) in found.iter().zip(expected).enumerate() {
        let equal = match (f.as_f64(), e.as_f64().or_else(|| e.as_str()?.parse().ok())) {
            (Some(f), Some(e)) => f.to_bits() == e.to_bits(),
            _ => f == e,
        };
        assert!(equal, "{name}, value {i}: {f} read, {e} written");
    }
    assert_eq!(found.len(), expected.len(), "{name}");
}

#[test]
fn bags_of_another_library_are_read_field_by_field() {
    for (name, bytes, every) in [("none", PLAIN, 1), ("bz2", BZ2, 5), ("lz4", LZ4, 5)] {
        let (report, kept) = scan(bytes);
        assert_eq!((report.loss_count, report.bytes), (0, bytes.len() as u64), "{name}: {:?}", report.losses);
        let expected: Vec<Value> = lines(VALUES).into_iter().step_by(every).collect();
        assert_eq!(kept.len(), expected.len(), "{name}");
        for (found, expected) in kept.iter().zip(&expected) {
            assert_eq!(found.topic, expected["topic"]);
            assert_eq!(found.type_name, expected["type"]);
            assert_eq!(found.md5, expected["md5"]);
            assert_eq!(found.log_time_ns, expected["log_time_ns"]);
            match decode(&found.raw()) {
                Some(message) => same(&Values::of(&message.unwrap()), &expected["values"], &found.type_name),
                None => assert_eq!(found.type_name, "std_msgs/String"),
            }
        }
    }
}

/// The sums in the reference are computed by rosbags from the definitions: each of ours is among them.
#[test]
fn md5_sums_are_those_of_another_implementation() {
    let written = lines(VALUES);
    for (type_name, sums) in KNOWN {
        for sum in sums {
            let is_there = written.iter().any(|line| line["type"] == type_name && line["md5"] == *sum);
            assert!(is_there, "{type_name} {sum}");
        }
    }
}

#[test]
fn cdr_of_another_library_is_read_field_by_field() {
    let mut orders = [0; 2];
    for line in lines(CDR) {
        let type_name = line["type"].as_str().unwrap();
        let hex = line["payload"].as_str().unwrap();
        let payload: Vec<u8> =
            (0..hex.len()).step_by(2).map(|i| u8::from_str_radix(&hex[i..i + 2], 16).unwrap()).collect();
        orders[usize::from(payload[1])] += 1;
        let raw =
            RawMessage { topic: "/t", type_name, md5: "", encoding: Encoding::Cdr, log_time_ns: 0, payload: &payload };
        same(&Values::of(&decode(&raw).unwrap().unwrap()), &line["values"], type_name);
        // Every shorter payload is torn, never a shorter message.
        for length in 0..payload.len() {
            let torn = RawMessage { payload: &payload[..length], ..raw };
            let last_is_text = length + 1 == payload.len();
            assert!(decode(&torn).unwrap().is_err() || last_is_text, "{type_name} cut to {length}");
        }
    }
    assert!(orders.iter().all(|count| *count > 3), "{orders:?}");
}

#[test]
fn a_listed_type_with_another_definition_is_refused_by_name() {
    let (_, kept) = scan(PLAIN);
    let mut refused = 0;
    for mut message in kept {
        if message.type_name == "std_msgs/String" {
            continue;
        }
        message.md5 = "0123456789abcdef0123456789abcdef".to_owned();
        match decode(&message.raw()).unwrap() {
            Err(MessageError::UnknownDefinition { type_name, md5, .. }) => {
                assert_eq!((type_name, md5), (message.type_name.as_str(), message.md5.clone()));
            }
            other => panic!("{other:?}"),
        }
        // Without a sum the newest definition must fit: of three flight modes, the one with a field more does not.
        message.md5.clear();
        refused += usize::from(decode(&message.raw()).unwrap().is_err());
    }
    assert_eq!(refused, 1);
}

#[test]
fn other_files_are_refused_with_what_they_are() {
    for (bytes, code, says) in [
        (&b""[..], "T028", "does not begin"),
        (b"t_s,p_x\n", "T028", "does not begin"),
        (b"#ROSBAG V1.2\n", "T028", "version 1.2"),
        (b"#ROSBAG V1.1\n\x00\x01", "T028", "version 1.1"),
    ] {
        let error = try_scan(bytes).unwrap_err();
        assert_eq!(error.code(), code, "{error}");
        assert!(error.to_string().contains(says), "{error}");
    }
    let mut writer = BagWriter::new(Compression::None, 1000);
    writer.bag_header(&[(b"encryptor", b"rosbag/AesCbcEncryptor")]);
    let error = try_scan(&writer.finish()).unwrap_err();
    assert!(error.code() == "T028" && error.to_string().contains("encrypted"), "{error}");
}

/// How many messages are complete before each byte of the bag; of a compressed bag, in the chunks before.
fn complete_before(bytes: &[u8], messages: &[Kept], compressed: bool) -> Vec<usize> {
    if compressed {
        let mut count = 0;
        let after_chunks = |at| {
            // Index records stand behind their chunk.
            if bytes[..at].ends_with(b"op=\x04") {
                count = scan(&bytes[..at]).1.len();
            }
            count
        };
        return (0..=bytes.len()).map(after_chunks).collect();
    }
    let mut from = 0;
    let mut ends = Vec::new();
    for message in messages {
        let mut record = u32::try_from(message.payload.len()).unwrap().to_le_bytes().to_vec();
        record.extend(&message.payload);
        from += bytes[from..].windows(record.len()).position(|w| w == record).unwrap() + record.len();
        ends.push(from);
    }
    (0..=bytes.len()).map(|at| ends.iter().filter(|end| **end <= at).count()).collect()
}

/// What is complete before a cut or a damaged byte is there, nothing else is invented, and the loss is said.
#[test]
fn every_cut_and_every_damaged_byte_leave_the_intact_prefix() {
    for (name, bytes) in [("none", PLAIN), ("bz2", BZ2), ("lz4", LZ4)] {
        let (_, whole) = scan(bytes);
        let complete = complete_before(bytes, &whole, name != "none");
        assert!(complete.windows(2).filter(|pair| pair[0] < pair[1]).count() > 1, "several steps");
        let checked = sweep(bytes, |damaged, damage| {
            let at = damage.intact_bytes();
            let Ok((report, kept)) = try_scan(damaged) else {
                return assert!(at < bag::MAGIC.len());
            };
            let intact = complete[at];
            assert!(kept.len() >= intact && kept[..intact] == whole[..intact], "{name}: {} of {intact}", kept.len());
            if let Damage::Cut { .. } = damage {
                assert_eq!(kept, whole[..kept.len()]);
                assert!(name != "none" || kept.len() == intact, "{name}: {} of {intact}", kept.len());
                // Between two records a file may end; within one it may not.
                let is_said = report.losses.iter().any(|l| l.ends_the_scan && l.reason.contains("ends within"));
                assert_eq!(is_said, report.loss_count > 0, "{report:?}");
            }
            if kept.len() < whole.len() && matches!(damage, Damage::Byte { .. }) {
                assert!(report.loss_count > 0, "{name}: loses without a word");
            }
        });
        assert!(checked > 3 * bytes.len());
    }
}

#[test]
fn a_damaged_chunk_is_left_out_and_the_scan_goes_on() {
    for (name, bytes) in [("bz2", BZ2), ("lz4", LZ4)] {
        let (_, whole) = scan(bytes);
        let magic: &[u8] = if name == "bz2" { b"BZh9" } else { &[0x04, 0x22, 0x4d, 0x18] };
        let chunk = bytes.windows(4).position(|w| w == magic).unwrap();
        let mut damaged = bytes.to_vec();
        damaged[chunk + 1] ^= 0xff;
        let (report, kept) = scan(&damaged);
        assert!(kept.len() < whole.len() && !kept.is_empty(), "{name}: {}", kept.len());
        assert_eq!(kept, whole[whole.len() - kept.len()..], "{name}");
        assert!(report.losses[0].reason.contains(name) && !report.losses[0].ends_the_scan, "{report:?}");
    }
}

#[test]
fn a_reader_stops_when_told() {
    let mut seen = 0;
    let report = bag::scan(PLAIN, &mut |_| {
        seen += 1;
        if seen == 3 { ControlFlow::Break(()) } else { ControlFlow::Continue(()) }
    })
    .unwrap();
    assert_eq!((seen, report.messages, report.loss_count), (3, 3, 0));
}

/// Scans a hostile bag without large allocations.
fn hostile(bytes: &[u8], most_bytes: usize) -> (ScanReport, usize) {
    let mut count = 0;
    let (report, largest) = largest_allocation(|| {
        bag::scan(bytes, &mut |raw| {
            count += 1;
            let _ = decode(&raw);
            ControlFlow::Continue(())
        })
        .unwrap()
    });
    assert!(largest <= most_bytes, "{largest} bytes at once, for a file of {}", bytes.len());
    (report, count)
}

#[test]
fn hostile_lengths_take_no_memory() {
    // A header, a chunk, a field and the data behind them that claim 4 GiB.
    let mut huge_header = bag::MAGIC.to_vec();
    huge_header.extend([0xff; 40]);
    let mut huge_field = bag::MAGIC.to_vec();
    huge_field.extend(12_u32.to_le_bytes());
    huge_field.extend([0xff; 12]);
    huge_field.extend([0; 4]);
    let huge_data = |length: u32| {
        let mut bytes = bag::MAGIC.to_vec();
        bytes.extend(BagWriter::header(&[(b"op", &[5]), (b"compression", b"none"), (b"size", &[0xff; 4])]));
        bytes.extend(length.to_le_bytes());
        bytes.extend([7; 100]);
        bytes
    };
    for bytes in [huge_header, huge_field, huge_data(u32::MAX), huge_data((128 << 20) - 1)] {
        let (report, count) = hostile(&bytes, 1 << 20);
        assert_eq!(count, 0);
        assert!(report.loss_count >= 1, "{report:?}");
    }
}

#[test]
fn zip_bombs_stop_at_the_size_that_the_chunk_declares() {
    let bomb = vec![0; 200 << 20];
    for compression in [Compression::Bz2, Compression::Lz4] {
        let packed = compression.compress(&bomb);
        let chunk = |declared: u32| {
            let mut bytes = bag::MAGIC.to_vec();
            let fields: [(&[u8], &[u8]); 3] =
                [(b"op", &[5]), (b"compression", compression.name()), (b"size", &declared.to_le_bytes())];
            bytes.extend(BagWriter::header(&fields));
            bytes.extend(u32::try_from(packed.len()).unwrap().to_le_bytes());
            bytes.extend(&packed);
            bytes
        };
        // 200 MiB behind 1000 bytes; and said so, which is beyond what is read. A lz4 block has up to 4 MiB.
        for declared in [1000, 200 << 20] {
            let (report, count) = hostile(&chunk(declared), 10 << 20);
            assert_eq!((count, report.loss_count), (0, 1), "{report:?}");
        }
    }
}

#[test]
fn many_small_zip_bombs_are_no_large_one() {
    let packed = Compression::Bz2.compress(&vec![0; 32 << 20]);
    let mut bytes = bag::MAGIC.to_vec();
    for _ in 0..100 {
        let fields: [(&[u8], &[u8]); 3] =
            [(b"op", &[5]), (b"compression", b"bz2"), (b"size", &(32_u32 << 20).to_le_bytes())];
        bytes.extend(BagWriter::header(&fields));
        bytes.extend(u32::try_from(packed.len()).unwrap().to_le_bytes());
        bytes.extend(&packed);
    }
    let (report, _) = hostile(&bytes, 65 << 20);
    // 128 MiB, and 200 times the file, which is next to nothing.
    assert_eq!(report.expanded_bytes, 128 << 20);
    let left_out = report.losses.iter().filter(|loss| loss.reason.contains("200 times")).count();
    // Of the four chunks that were decompressed, two records each are none.
    assert_eq!((left_out, report.loss_count), (ScanReport::MOST_LOSSES - 8, 8 + 96), "{report:?}");
    assert!(!report.losses[15].ends_the_scan);
}

#[test]
fn a_million_topics_take_bounded_memory() {
    let mut writer = BagWriter::new(Compression::Lz4, 1 << 20);
    for number in 0..1_000_000 {
        writer.connection(number, &format!("/topic/{number}"), "a/B", "0123456789abcdef0123456789abcdef");
    }
    writer.message(999_999, 5, b"x");
    writer.message(3, 5, b"x");
    let (report, count) = hostile(&writer.finish(), 16 << 20);
    assert_eq!(count, 1);
    assert_eq!(report.loss_count, 1_000_000 - 65_536 + 1);
    assert_eq!(report.losses.len(), ScanReport::MOST_LOSSES);
}

#[test]
fn huge_text_and_counts_in_messages_take_no_memory() {
    let mut payload = vec![0; 12];
    payload.extend(u32::MAX.to_le_bytes());
    payload.extend([b'x'; 64]);
    let mut sequence = vec![0; 16];
    sequence.extend(u32::MAX.to_le_bytes());
    sequence.extend([0; 64]);
    let raw = |type_name, payload| RawMessage {
        topic: "/t",
        type_name,
        md5: "",
        encoding: Encoding::Ros1,
        log_time_ns: 0,
        payload,
    };
    let ((), largest) = largest_allocation(|| {
        for (type_name, _) in KNOWN {
            assert!(decode(&raw(type_name, &payload)).unwrap().is_err());
            assert!(decode(&raw(type_name, &sequence)).unwrap().is_err());
        }
    });
    assert!(largest < 4096, "{largest}");

    let mut writer = BagWriter::new(Compression::None, 1 << 20);
    writer.connection(0, &"t".repeat(8 << 20), "a/B", "");
    writer.message(0, 5, b"x");
    hostile(&writer.finish(), 64 << 20);
}

#[test]
fn times_run_from_before_1970_to_the_end_of_ros() {
    let mut writer = BagWriter::new(Compression::None, 1000);
    writer.connection(0, "/t", "a/B", "");
    writer.message(0, u64::MAX, b"x");
    let (report, kept) = scan(&writer.finish());
    assert_eq!(report.loss_count, 0);
    assert_eq!(kept[0].log_time_ns, 4_294_967_295 * 1_000_000_000 + 4_294_967_295);
    // CDR, little-endian: minus five seconds and half a second.
    let mut payload = vec![0, 1, 0, 0];
    payload.extend((-5_i32).to_le_bytes());
    payload.extend(500_000_000_u32.to_le_bytes());
    payload.extend(1_u32.to_le_bytes());
    payload.resize(4 + 13 + 3 + 4 + 7 * 8, 0);
    let raw = RawMessage {
        topic: "/t",
        type_name: "geometry_msgs/PoseStamped",
        md5: "",
        encoding: Encoding::Cdr,
        log_time_ns: 0,
        payload: &payload,
    };
    assert_eq!(decode(&raw).unwrap().unwrap().header().stamp_ns, -4_500_000_000);
}
