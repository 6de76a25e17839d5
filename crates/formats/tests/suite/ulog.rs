//! PX4's ULog, written by hand from its specification, read field by field; damaged, torn and hostile files.
#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic, clippy::indexing_slicing)]

use crate::support::largest_allocation::largest_allocation;
use std::ops::ControlFlow;
use tumble_formats::FormatsError;
use tumble_formats::log::CommandedSample;
use tumble_formats::recording::ulog::{UlogReport, scan};
use tumble_formats::recording::{ulog_flight, ulog_flight::UlogSurvey};
use tumble_formats::testing::corruption::{Damage, sweep};
use tumble_formats::testing::scratch_file;
use tumble_formats::testing::ulog_writer::{UlogWriter, floats};

/// Topic, time in ns, and every field by its path, as text.
type Kept = (String, i64, Vec<(String, f64)>);

fn try_read(bytes: &[u8]) -> Result<(UlogReport, Vec<Kept>), FormatsError> {
    let mut kept = Vec::new();
    let report = scan(bytes, &mut |message| {
        let field = |path: String| {
            let value = message.real(&path).unwrap();
            (path, value)
        };
        let fields = message.layout.paths().into_iter().map(field).collect();
        kept.push((message.topic.to_owned(), message.time_ns, fields));
        ControlFlow::Continue(())
    })?;
    assert_eq!(report.scan.messages, kept.len() as u64);
    Ok((report, kept))
}

fn read(bytes: &[u8]) -> (UlogReport, Vec<Kept>) {
    try_read(bytes).unwrap()
}

/// Every kind of message and of field, in the order of the specification.
fn everything() -> Vec<u8> {
    let mut file = UlogWriter::new();
    // A format may name one that is described behind it.
    file.format("outer:uint64_t timestamp;inner[2] pair;float after;uint8_t[4] _padding0;");
    file.format("inner:int16_t small;uint8_t[2] _padding0;float[2] part;");
    file.format(
        "plain:uint64_t timestamp;int8_t a;uint8_t b;int16_t c;uint16_t d;int32_t e;uint32_t f;int64_t g;uint64_t h;float i;double j;bool k;char[3] l;",
    );
    file.information(b'I', "char[3] sys", b"PX4");
    file.information(b'M', "char[2] note", b"ab");
    file.information(b'P', "float MASS", &floats(&[1.5]));
    file.information(b'Q', "int32_t MODE", &[2, 0, 0, 0]);
    file.subscribe(7, 0, "plain");
    file.subscribe(9, 0, "outer");
    file.subscribe(300, 2, "plain");
    let mut plain = vec![0x80, 200];
    plain.extend((-300_i16).to_le_bytes());
    plain.extend(60_000_u16.to_le_bytes());
    plain.extend((-70_000_i32).to_le_bytes());
    plain.extend(4_000_000_000_u32.to_le_bytes());
    plain.extend((-5_000_000_000_i64).to_le_bytes());
    plain.extend(1_000_000_007_u64.to_le_bytes());
    plain.extend(0.25_f32.to_le_bytes());
    plain.extend((-1.0e-300_f64).to_le_bytes());
    plain.extend([1, b'x', b'y', b'z']);
    file.data(7, 1_000_000, &plain);
    let mut outer = Vec::new();
    for (small, part) in [(-1_i16, [1.0, 2.0]), (513, [3.0, -4.0])] {
        outer.extend(small.to_le_bytes());
        outer.extend([0xee, 0xee]);
        outer.extend(floats(&part));
    }
    outer.extend(floats(&[0.5]));
    // The padding at the end is not logged.
    file.data(9, 1_000_500, &outer);
    file.message(b'L', b"6\x01\x02\x03\x04\x05\x06\x07\x08text");
    file.message(b'C', b"6\x09\x00\x01\x02\x03\x04\x05\x06\x07\x08text");
    file.synchronize();
    file.dropout(250);
    file.dropout(20);
    // A kind that no version has yet.
    file.message(b'Z', b"later");
    file.data(300, 2_000_000, &plain);
    file.message(b'R', &9_u16.to_le_bytes());
    file.finish()
}

#[test]
fn every_kind_of_field_is_read() {
    let (report, kept) = read(&everything());
    assert_eq!((report.dropouts, report.dropout_ms, report.scan.loss_count), (2, 270, 0), "{report:?}");
    assert_eq!(report.scan.bytes, everything().len() as u64);
    let [(first, time, fields), (second, later, nested), (third, last, same)] = kept.as_slice() else {
        panic!("{kept:?}")
    };
    assert_eq!((first.as_str(), *time), ("plain", 1_000_000_000));
    let expected = [
        ("timestamp", 1e6),
        ("a", -128.0),
        ("b", 200.0),
        ("c", -300.0),
        ("d", 60_000.0),
        ("e", -70_000.0),
        ("f", 4e9),
        ("g", -5e9),
        ("h", 1_000_000_007.0),
        ("i", 0.25),
        ("j", -1.0e-300),
        ("k", 1.0),
        ("l[0]", 120.0),
        ("l[1]", 121.0),
        ("l[2]", 122.0),
    ];
    let named = |pairs: &[(&str, f64)]| pairs.iter().map(|(n, v)| ((*n).to_owned(), *v)).collect::<Vec<_>>();
    assert_eq!(fields, &named(&expected));
    assert_eq!((second.as_str(), *later), ("outer", 1_000_500_000));
    let expected = [
        ("timestamp", 1_000_500.0),
        ("pair[0].small", -1.0),
        ("pair[0].part[0]", 1.0),
        ("pair[0].part[1]", 2.0),
        ("pair[1].small", 513.0),
        ("pair[1].part[0]", 3.0),
        ("pair[1].part[1]", -4.0),
        ("after", 0.5),
    ];
    assert_eq!(nested, &named(&expected));
    assert_eq!((third.as_str(), *last, same.len()), ("plain/2", 2_000_000_000, 15));
}

/// The same file read by another library, field by field.
#[test]
fn another_reader_finds_the_same() {
    assert_eq!(everything(), include_bytes!("../golden/everything.ulg"));
    let (_, kept) = read(&everything());
    let values = include_str!("../golden/everything_ulg.jsonl");
    assert_eq!(values.lines().count(), kept.len());
    for (line, (topic, _, fields)) in values.lines().zip(&kept) {
        let value: serde_json::Value = serde_json::from_str(line).unwrap();
        let instance = if value["instance"] == 0 { String::new() } else { format!("/{}", value["instance"]) };
        assert_eq!(*topic, format!("{}{instance}", value["topic"].as_str().unwrap()));
        let theirs = value["fields"].as_object().unwrap();
        assert_eq!(theirs.len(), fields.len());
        for (path, ours) in fields {
            assert_eq!(theirs[path].as_f64().unwrap().to_bits(), ours.to_bits(), "{topic}.{path}");
        }
    }
}

#[test]
fn paths_that_lead_nowhere_are_none() {
    let mut asked = 0;
    scan(everything().as_slice(), &mut |message| {
        let wrong = ["", "l", "l[3]", "l[-1]", "l[1", "a[0]", "a.b", "pair", "pair[0]", "pair.small", "pair[2].small"];
        assert!(wrong.iter().all(|path| message.number(path).is_none()));
        asked += 1;
        if asked == 2 { ControlFlow::Break(()) } else { ControlFlow::Continue(()) }
    })
    .unwrap();
    assert_eq!(asked, 2);
}

#[test]
fn a_damaged_file_is_read_up_to_the_damage() {
    let bytes = everything();
    let (_, whole) = read(&bytes);
    let ends: Vec<usize> = {
        // Where the data messages end: each is unique by its time.
        let find = |time: u64| {
            let at = bytes.windows(8).position(|window| window == time.to_le_bytes()).unwrap();
            let size = usize::from(u16::from_le_bytes([bytes[at - 5], bytes[at - 4]]));
            at - 2 + size
        };
        [1_000_000, 1_000_500, 2_000_000].map(find).into()
    };
    sweep(&bytes, |damaged, damage| {
        let Ok((report, found)) = try_read(damaged) else {
            // Header, version or flags.
            assert!(damage.intact_bytes() < 60, "{damage:?}");
            return;
        };
        let intact = ends.iter().filter(|end| **end <= damage.intact_bytes()).count();
        assert!(found.len() >= intact, "{damage:?}: {report:?}");
        assert_eq!(format!("{:?}", &found[..intact]), format!("{:?}", &whole[..intact]), "{damage:?}");
        if let Damage::Cut { length } = damage {
            assert_eq!(found.len(), intact);
            assert!(report.scan.bytes <= length as u64);
        }
    });
}

#[test]
fn behind_damage_the_next_mark_is_found() {
    let sound = everything();
    let at = sound.windows(8).position(|window| window == 1_000_500_u64.to_le_bytes()).unwrap() - 5;
    for junk in [vec![0; 7], vec![0xff; 100_000], vec![b'S'; 70_000]] {
        let damaged = [&sound[..at], &[0, 0, 0], &junk, &sound[at..]].concat();
        let (report, found) = read(&damaged);
        // The nested one stands before the mark.
        assert_eq!(found.iter().map(|(topic, ..)| topic.as_str()).collect::<Vec<_>>(), ["plain", "plain/2"]);
        assert_eq!((report.scan.loss_count, report.scan.losses[0].offset), (1, at as u64));
        assert!(!report.scan.losses[0].ends_the_scan);
    }
    let (report, found) = read(&[sound[..at].to_vec(), vec![0; 50_000]].concat());
    assert_eq!((found.len(), report.scan.losses[0].ends_the_scan), (1, true));
}

#[test]
fn appended_parts_follow_what_they_cut() {
    let mut file = UlogWriter::new();
    file.format("a:uint64_t timestamp;float x;");
    file.subscribe(1, 0, "a");
    file.data(1, 10, &floats(&[1.0]));
    file.data(1, 20, &floats(&[2.0]));
    file.append_behind_cut(5);
    file.data(1, 30, &floats(&[3.0]));
    file.append_behind_cut(0);
    file.data(1, 40, &floats(&[4.0]));
    let (report, found) = read(&file.finish());
    assert_eq!(found.iter().map(|(_, time, _)| *time).collect::<Vec<_>>(), [10_000, 30_000, 40_000]);
    assert_eq!(report.scan.loss_count, 0, "{report:?}");
}

#[test]
fn hostile_formats_are_left_out_and_take_no_memory() {
    let mut deep = UlogWriter::new();
    for i in 0..2000 {
        deep.format(&format!("n{i}:n{}[2] a;n{}[2] b;", i + 1, i + 1));
    }
    deep.format("self:uint64_t timestamp;self again;");
    deep.format("huge:uint64_t timestamp;double[65535] a;");
    deep.format("empty:");
    deep.format("untimed:float x;");
    deep.format("twice:uint64_t timestamp;");
    deep.format("twice:uint64_t timestamp;float x;");
    deep.format("bad\x1b[2J:uint64_t timestamp;");
    deep.format("zero:uint64_t timestamp;float[0] x;");
    deep.format("odd:uint64_t timestamp;float[x] x;");
    deep.format("wide:uint64_t timestamp;uint8_t[60000] x;");
    let names = ["n0", "self", "huge", "empty", "untimed", "missing", "zero", "odd", "wide"];
    for (number, name) in (0..).zip(names) {
        deep.subscribe(number, 0, name);
        deep.data(number, 1, &[0; 16]);
    }
    let bytes = deep.finish();
    let ((), most) = largest_allocation(|| {
        let (report, found) = read(&bytes);
        assert!(found.is_empty());
        assert_eq!(report.scan.loss_count, 2 + 8 + 9, "{:?}", report.scan.losses);
        assert!(report.scan.losses.iter().all(|loss| !loss.reason.contains('\x1b')));
    });
    assert!(most < 1 << 20, "{most}");
}

#[test]
fn other_versions_and_features_are_refused() {
    let mut later = everything();
    later[7] = 2;
    assert!(try_read(&later).unwrap_err().to_string().contains("version 2"));
    let mut needs = everything();
    needs[28] = 1;
    assert!(try_read(&needs).unwrap_err().to_string().contains("feature"));
    assert_eq!(try_read(b"ULog").unwrap_err().code(), "T028");
}

/// A second of a robot that turns about z at 0.5 rad/s and moves along x at 0.2 m/s, positions every 20 ms, the rest every 10 ms.
fn flight(gravity: f64) -> UlogWriter {
    let mut file = UlogWriter::new();
    file.format(
        "vehicle_local_position:uint64_t timestamp;uint64_t timestamp_sample;float x;float y;float z;float vx;float vy;float vz;uint8_t xy_reset_counter;bool xy_valid;bool z_valid;bool v_xy_valid;bool v_z_valid;uint8_t[3] _padding0;",
    );
    file.format("vehicle_attitude:uint64_t timestamp;uint64_t timestamp_sample;float[4] q;uint8_t quat_reset_counter;uint8_t[7] _padding0;");
    file.format(
        "vehicle_angular_velocity:uint64_t timestamp;uint64_t timestamp_sample;float[3] xyz;uint8_t[4] _padding0;",
    );
    file.format("vehicle_acceleration:uint64_t timestamp;uint64_t timestamp_sample;float[3] xyz;uint8_t[4] _padding0;");
    file.format("actuator_motors:uint64_t timestamp;uint64_t timestamp_sample;uint16_t reversible_flags;uint8_t[2] _padding0;float[4] control;uint8_t[4] _padding1;");
    let names = [
        "vehicle_local_position",
        "vehicle_attitude",
        "vehicle_angular_velocity",
        "vehicle_acceleration",
        "actuator_motors",
    ];
    for (number, name) in (0..).zip(names) {
        file.subscribe(number, 0, name);
    }
    file.subscribe(10, 1, "vehicle_local_position");
    for step in 0..100_u64 {
        let measured = 5_000_000 + 10_000 * step;
        let published = measured + 3000;
        let sampled = |fields: &[u8]| [&measured.to_le_bytes(), fields].concat();
        let time_s = f64::from(u32::try_from(step).unwrap()) * 0.01;
        let half = 0.25 * time_s;
        file.data(1, published, &[sampled(&floats(&[half.cos(), 0.0, 0.0, half.sin()])), vec![0]].concat());
        file.data(2, published, &sampled(&floats(&[0.0, 0.01 * time_s, 0.5])));
        file.data(3, published, &sampled(&floats(&[0.1, 0.0, -gravity])));
        if step % 2 == 1 {
            // Between two attitudes.
            let measured = measured - 5000;
            let x = 0.2 * (time_s - 0.005);
            let fields =
                [&measured.to_le_bytes()[..], &floats(&[x, 1.0, -2.0, 0.2, 0.0, 0.0]), &[0, 1, 1, 1, 1]].concat();
            file.data(0, published, &fields);
            file.data(10, published, &fields);
        }
        if step % 4 == 0 {
            let on = if step % 8 == 0 { 1.0 } else { 0.0 };
            let control = floats(&[on, 0.5, f64::NAN, f64::NAN]);
            file.data(4, measured + 5000, &[&sampled(&[0, 0, 0, 0])[..], &control].concat());
        }
    }
    file
}

fn samples(
    name: &str,
    bytes: &[u8],
    bounded: bool,
) -> Result<(UlogSurvey, Vec<CommandedSample>, Vec<String>), FormatsError> {
    let path = scratch_file(&format!("{name}.ulg"), bytes);
    let (survey, plan) = ulog_flight::open(&path, None)?;
    let mut samples = Vec::new();
    let tally = ulog_flight::read(&path, &survey, &survey.commands, bounded, &mut |sample| {
        samples.push(sample);
        ControlFlow::Continue(())
    })?;
    std::fs::remove_file(&path).unwrap();
    let said = tally.warnings(&plan, &survey.topics);
    Ok((survey, samples, said))
}

#[test]
fn a_flight_is_put_on_the_time_of_its_positions() {
    let (survey, samples, said) = samples("flight", &flight(9.806_65).finish(), true).unwrap();
    assert_eq!(survey.commands, ["actuator_motors.control[0]", "actuator_motors.control[1]"]);
    assert!(survey.feels_gravity);
    assert_eq!(samples.len(), 50);
    for (k, sample) in (0..).zip(&samples) {
        let time_s = 0.005 + 0.02 * f64::from(k);
        let motion = &sample.motion;
        assert_eq!(motion.time_ns, 5_005_000_000 + 20_000_000 * i64::from(k));
        let pose = motion.world_from_body.unwrap();
        let angle = pose.rotation.euler_angles().2;
        assert!((angle - 0.5 * time_s).abs() < 1e-6, "{k}: {angle}");
        assert!((pose.translation.vector - nalgebra_vector(0.2 * time_s, 1.0, -2.0)).norm() < 1e-6);
        assert!((motion.velocity_origin_world.unwrap() - nalgebra_vector(0.2, 0.0, 0.0)).norm() < 1e-6);
        assert!((motion.rate_body.unwrap() - nalgebra_vector(0.0, 0.01 * time_s, 0.5)).norm() < 1e-6);
        // What the accelerometer reads without gravity.
        assert!((motion.acceleration_origin_body.unwrap() - nalgebra_vector(0.1, 0.0, 0.0)).norm() < 1e-5);
    }
    // Published 5 ms behind a multiple of 40 ms, as the positions with an even number are: each command lasts two of them.
    let told: Vec<_> = samples.iter().map(|sample| sample.commands.clone()).collect();
    for (k, told) in told.iter().enumerate() {
        let on = if (k / 2) % 2 == 0 { 1.0 } else { 0.0 };
        assert_eq!(told.as_slice(), [Some(on), Some(0.5)], "{k}");
    }
    assert!(said.iter().any(|line| line.contains("gravity is in vehicle_acceleration")), "{said:?}");
}

fn nalgebra_vector(x: f64, y: f64, z: f64) -> tumble_dynamics::nalgebra::Vector3<f64> {
    tumble_dynamics::nalgebra::Vector3::new(x, y, z)
}

#[test]
fn in_free_fall_nothing_is_added_to_the_acceleration() {
    let (survey, samples, said) = samples("free", &flight(0.0).finish(), true).unwrap();
    assert!(!survey.feels_gravity && !said.iter().any(|line| line.contains("gravity")), "{said:?}");
    assert!((samples[20].motion.acceleration_origin_body.unwrap() - nalgebra_vector(0.1, 0.0, 0.0)).norm() < 1e-6);
}

#[test]
fn what_a_flight_lacks_is_said() {
    // Invalid, a reset, a gap in the attitudes, a dropout, a command that is none.
    let mut file = flight(9.806_65);
    let position = |x: f64, counter: u8, valid: u8| {
        [&0_u64.to_le_bytes()[..], &floats(&[x, 0.0, 0.0, 0.0, 0.0, 0.0]), &[counter, valid, 1, 1, 1]].concat()
    };
    file.dropout(700);
    file.data(0, 6_700_000, &position(1.0, 1, 1));
    file.data(0, 6_720_000, &position(1.0, 1, 0));
    let (_, found, said) = samples("lacks", &file.finish(), true).unwrap();
    assert_eq!(found.len(), 52);
    assert!(found[50].motion.world_from_body.is_none() && found[51].motion.world_from_body.is_none());
    let all = said.join("\n");
    for part in [
        "1 positions have no attitude",
        "1 times the estimator reset",
        "1 poses are marked lost",
        "dropped out 1 times, 0.700 s",
    ] {
        assert!(all.contains(part), "{part}: {all}");
    }

    let mut file = flight(9.806_65);
    file.data(4, 6_000_000, &[&[0; 12][..], &floats(&[-0.5, 0.0, 0.0, 0.0])].concat());
    let refused = samples("negative", &file.finish(), true).unwrap_err();
    assert!(refused.to_string().contains("`actuator_motors.control[0]` is -0.5 at 6.000 s"), "{refused}");

    let refused = samples("none", &everything(), false).unwrap_err();
    assert!(refused.to_string().contains("no vehicle_local_position is logged"), "{refused}");
}

#[test]
fn a_damaged_flight_gives_its_beginning() {
    let bytes = flight(9.806_65).finish();
    let (_, whole, _) = samples("whole", &bytes, false).unwrap();
    let poses = |samples: &[CommandedSample]| samples.iter().map(|s| s.motion.world_from_body).collect::<Vec<_>>();
    let whole = poses(&whole);
    let mut flights = 0;
    for at in (0..bytes.len()).step_by(61) {
        let mut damaged = bytes.clone();
        damaged[at] ^= 0x55;
        for file in [&bytes[..at], &damaged] {
            let Ok((_, found, _)) = samples("damaged", file, false) else { continue };
            flights += 1;
            let found = poses(&found);
            // A twentieth of a second before the end of what is there nothing can be missing.
            let sound = (found.len().saturating_sub(3)).min(whole.len());
            if file.len() < bytes.len() {
                assert_eq!(found[..sound], whole[..sound], "cut at {at}");
            }
            assert!(found.iter().flatten().all(|pose| pose.translation.vector.iter().all(|x| x.is_finite())));
        }
    }
    assert!(flights > 300, "{flights}");
}
