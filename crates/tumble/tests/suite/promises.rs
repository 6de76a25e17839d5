//! What every parser promises of any bytes. The fuzz targets call these functions, and so does a test with the seeds.

use std::ops::ControlFlow;
use std::path::Path;
use tumble::TumbleError;
use tumble::cli::{allocate, realize};
use tumble::robots::shipped;
use tumble::scenario::{ScenarioSource, read_wrenches};
use tumble_astrobee::propulsion::{AreaTable, PositivityShift};
use tumble_dynamics::InertialParameters;
use tumble_formats::arm::ArmModel;
use tumble_formats::excitation_file::ExcitationFile;
use tumble_formats::log::{JointLogReader, LogReader, joint_template};
use tumble_formats::model::{Model, judge};
use tumble_formats::recording::{Encoding, RawMessage, ScanReport, bag, mcap_reader, messages, ulog};
use tumble_formats::wheel_throw::parse_throw;
use tumble_formats::{FormatsError, Robots, body_file};

/// A promise about any bytes.
pub type Target = fn(&[u8]);

/// All targets by name.
pub const TARGETS: [(&str, Target); 15] = [
    ("csv_log", csv_log),
    ("wheel_throw", wheel_throw),
    ("body_toml", body_toml),
    ("excitation_toml", excitation_toml),
    ("bag", bag),
    ("mcap", mcap),
    ("ulog", ulog_file),
    ("message", message),
    ("scenario", scenario),
    ("wrenches", wrenches),
    ("allocate", allocate_table),
    ("realize", realize_table),
    ("arm", arm),
    ("joint_log", joint_log),
    ("model", model),
];

/// An error is a message with the name of the file and no control characters but line ends.
fn is_said(message: &str, name: &str) {
    assert!(message.contains(name), "{message}");
    assert!(message.chars().all(|c| c == '\n' || !c.is_control()), "{message:?}");
}

/// The samples of a log are finite and ordered, whether or not late rows are put in order.
pub fn csv_log(data: &[u8]) {
    for reorder in [false, true] {
        let mut reader = match LogReader::from_reader(data, Path::new("log.csv"), reorder) {
            Ok(reader) => reader,
            Err(error) => return is_said(&error.to_string(), "log.csv"),
        };
        let mut last = None;
        loop {
            let sample = match reader.next_sample() {
                Ok(Some(sample)) => sample,
                Ok(None) => break,
                Err(error) => {
                    let message = error.to_string();
                    is_said(&message, "log.csv");
                    assert!(message.contains("line "), "{message}");
                    break;
                }
            };
            assert!(last.is_none_or(|last| last < sample.time_ns));
            last = Some(sample.time_ns);
            assert!(sample.world_from_body.is_none_or(|pose| (pose.rotation.norm() - 1.0).abs() < 1e-12));
            let vectors = [
                sample.world_from_body.map(|pose| pose.translation.vector),
                sample.velocity_origin_world,
                sample.rate_body,
                sample.acceleration_origin_body,
                sample.wrench_body.map(|wrench| wrench.force),
                sample.wrench_body.map(|wrench| wrench.torque),
            ];
            assert!(vectors.iter().flatten().all(|vector| vector.iter().all(|c| c.is_finite())));
        }
    }
}

/// An arm that is read is finite and is read again as it was written.
pub fn arm(data: &[u8]) {
    let Ok(text) = std::str::from_utf8(data) else { return };
    match ArmModel::parse(Path::new("arm.urdf"), text, &shipped()) {
        Ok(arm) => {
            let bodies = (0..arm.tree.bodies()).filter_map(|index| arm.tree.body(index));
            assert!(bodies.into_iter().all(|body| body.to_vector().iter().all(|number| number.is_finite())));
            assert!(!arm.to_urdf().chars().any(|c| c.is_control() && c != '\n'));
            assert_eq!(joint_template(&arm).lines().count(), 3);
            let written = arm.to_toml().expect("an arm is written");
            match ArmModel::parse(Path::new("again.toml"), &written, &Robots::none()) {
                Ok(again) => assert_eq!(again.tree.joints(), arm.tree.joints()),
                // a body on the very edge may fall off it by rounding
                Err(error) => assert!(matches!(error, FormatsError::ArmBody { .. }), "{error}"),
            }
        }
        Err(error) => is_said(&error.to_string(), "arm.urdf"),
    }
}

/// A model that is read is judged; repaired it can be, and a body goes into it, as far as a link of one name is meant.
pub fn model(data: &[u8]) {
    let Ok(text) = std::str::from_utf8(data) else { return };
    let path = Path::new("robot.urdf");
    let read = match Model::parse(path, text) {
        Ok(read) => read,
        Err(error) => return is_said(&error.to_string(), "robot.urdf"),
    };
    let verdicts = judge(&read);
    let repaired = read.repaired(&verdicts);
    let again = Model::parse(path, &repaired.text).expect("a repaired model is read");
    assert!(repaired.links.is_empty() == (repaired.text == text));
    for (verdict, before) in judge(&again).iter().zip(&verdicts) {
        assert!(verdict.physical == before.physical || verdict.physical == Some(true) || before.nearest.is_none());
    }
    let body = InertialParameters::solid_box(2.0, [0.1, 0.2, 0.3]);
    match read.with_body(path, None, &body) {
        Ok((text, name)) => {
            let again = Model::parse(path, &text).expect("a patched model is read");
            let link = again.links.iter().find(|link| link.name == name && link.inertial.is_some());
            let found = link.and_then(|link| link.inertial.as_ref()).expect("the link has the body").body();
            assert!((found.to_vector() - body.to_vector()).amax() < 1e-12);
        }
        Err(error) => is_said(&error.to_string(), "robot.urdf"),
    }
}

/// The rows of a log of an arm are finite, complete and ordered.
pub fn joint_log(data: &[u8]) {
    let arm = ArmModel::find("astrobee-arm", &shipped()).expect("an arm");
    let mut last = None;
    let mut reader = match JointLogReader::from_reader(data, Path::new("log.csv"), &arm, true) {
        Ok(reader) => reader,
        Err(error) => return is_said(&error.to_string(), "log.csv"),
    };
    loop {
        let row = match reader.next_sample() {
            Ok(Some(row)) => row,
            Ok(None) => break,
            Err(error) => return is_said(&error.to_string(), "log.csv"),
        };
        assert!(last.is_none_or(|last| last < row.time_ns));
        last = Some(row.time_ns);
        let lists = [
            Some(&row.positions),
            row.rates.as_ref(),
            row.accelerations.as_ref(),
            row.torques.as_ref(),
            row.currents.as_ref(),
        ];
        for list in lists.into_iter().flatten() {
            assert!(list.len() == 2 && list.iter().all(|number| number.is_finite()));
        }
    }
}

/// The samples of a throw are finite and ordered.
pub fn wheel_throw(data: &[u8]) {
    match parse_throw(data, Path::new("throw.csv")) {
        Ok(record) => {
            assert!(record.samples().windows(2).all(|pair| pair[0].time_s < pair[1].time_s));
            for sample in record.samples() {
                assert!(sample.rate_body.iter().chain(&sample.specific_force_body).all(|c| c.is_finite()));
                assert!(sample.time_s.is_finite() && sample.wheel_speed_rad_s.is_finite());
            }
        }
        Err(error) => is_said(&error.to_string(), "throw.csv"),
    }
}

/// A body that is read is one that can be, and is read again as it was written.
pub fn body_toml(data: &[u8]) {
    let Ok(text) = std::str::from_utf8(data) else { return };
    for name in ["body.toml", "body.json"] {
        match body_file::parse(text, Path::new(name)) {
            Ok(body) => {
                assert!(body.is_strictly_consistent());
                let written = body_file::export(Path::new(name), &body).expect("a body is written");
                let again = body_file::parse(&written, Path::new(name));
                // a body on the very edge may fall off it by rounding
                if let Ok(again) = again {
                    assert_eq!(again.mass.to_bits(), body.mass.to_bits());
                }
            }
            Err(error) => is_said(&error.to_string(), name),
        }
    }
}

/// An excitation that is read can be flown: it is a motion, and is read again as it was written.
pub fn excitation_toml(data: &[u8]) {
    let Ok(text) = std::str::from_utf8(data) else { return };
    let path = Path::new("excitation.toml");
    match ExcitationFile::parse(text, path) {
        Ok(file) => {
            file.motion(path).expect("a motion");
            file.world_from_start(path).expect("a start");
            let written = file.to_toml(path).expect("a text");
            ExcitationFile::parse(&written, path).expect("the text of an excitation is one");
        }
        Err(error) => is_said(&error.to_string(), "excitation.toml"),
    }
}

/// A recording is scanned to some place in it; what it hands on is counted, and its messages decode or say why not.
fn recording(data: &[u8], scanned: Result<ScanReport, FormatsError>, handed_on: u64) {
    match scanned {
        Ok(report) => {
            assert_eq!(report.messages, handed_on);
            assert!(report.bytes <= data.len() as u64, "{report:?}");
            assert!(report.losses.len() <= ScanReport::MOST_LOSSES && report.losses.len() as u64 <= report.loss_count);
            assert!(report.losses.iter().all(|loss| loss.offset <= data.len() as u64), "{report:?}");
        }
        Err(error) => is_said(&error.to_string(), ""),
    }
}

/// A message decodes, always to the same, or says why not.
fn decodes(raw: &RawMessage<'_>) {
    match messages::decode(raw) {
        None => {}
        // numbers may be NaN, so the text is compared
        Some(Ok(message)) => {
            let again = messages::decode(raw).and_then(Result::ok);
            assert_eq!(again.map(|again| format!("{again:?}")), Some(format!("{message:?}")));
        }
        Some(Err(error)) => is_said(&error.to_string(), ""),
    }
}

/// A ROS 1 bag.
pub fn bag(data: &[u8]) {
    let mut count = 0;
    let scanned = bag::scan(data, &mut |raw| {
        count += 1;
        decodes(&raw);
        ControlFlow::Continue(())
    });
    recording(data, scanned, count);
}

/// An MCAP file.
pub fn mcap(data: &[u8]) {
    let mut count = 0;
    let scanned = mcap_reader::scan(data, &mut |raw| {
        count += 1;
        decodes(&raw);
        ControlFlow::Continue(())
    });
    recording(data, scanned, count);
}

/// PX4's ULog: every field of every message is a number where its path says so.
pub fn ulog_file(data: &[u8]) {
    let mut count = 0;
    let scanned = ulog::scan(data, &mut |message| {
        count += 1;
        let paths = message.layout.paths();
        assert!(paths.iter().take(100).all(|path| message.real(path).is_some()), "{}", message.topic);
        assert!(message.real("q[0]").is_some() == paths.iter().any(|path| path == "q[0]"));
        ControlFlow::Continue(())
    });
    recording(data, scanned.map(|report| report.scan), count);
}

/// One message: the first byte picks its type and encoding.
pub fn message(data: &[u8]) {
    const TYPES: [&str; 11] = [
        "ff_msgs/EkfState",
        "ff_msgs/FamCommand",
        "ff_hw_msgs/PmcCommand",
        "ff_hw_msgs/PmcTelemetry",
        "ff_msgs/FlightMode",
        "geometry_msgs/InertiaStamped",
        "sensor_msgs/Imu",
        "geometry_msgs/PoseStamped",
        "geometry_msgs/TwistStamped",
        "geometry_msgs/WrenchStamped",
        "nav_msgs/Odometry",
    ];
    let Some((pick, payload)) = data.split_first() else { return };
    let pick = usize::from(*pick);
    let encoding = if (pick / TYPES.len()).is_multiple_of(2) { Encoding::Ros1 } else { Encoding::Cdr };
    let type_name = TYPES[pick % TYPES.len()];
    decodes(&RawMessage { topic: "/t", type_name, md5: "", encoding, log_time_ns: 0, payload });
}

/// A scenario is read again as it was written, and flies: what is measured are numbers.
pub fn scenario(data: &[u8]) {
    let Ok(text) = std::str::from_utf8(data) else { return };
    let source = match ScenarioSource::parse(Path::new("scenario.toml"), text) {
        Ok(source) => source,
        Err(error) => {
            let message = error.to_string();
            assert!(message.starts_with("scenario.toml, line "), "{message}");
            return is_said(&message, "scenario.toml");
        }
    };
    let told = &source.scenario;
    let bodies = [&told.body, &told.belief].into_iter().flatten().filter_map(|body| body.file.as_ref());
    let payload = told.payload.as_ref().and_then(|payload| payload.file.as_ref());
    if bodies.chain(payload).chain(&told.drive.excitation).chain(&told.drive.wrenches).next().is_some() {
        // this program's own files are none of a scenario's business
        return;
    }
    let written = source.to_toml().expect("a scenario is written");
    let again = ScenarioSource::parse(Path::new("scenario.toml"), &written).expect("what is written is a scenario");
    // numbers may be NaN, so the text is compared
    assert_eq!(again.to_toml().expect("a scenario is written"), written);
    let flown = source.flight().and_then(|mut flight| {
        for _ in 0..3 {
            let Some(measured) = flight.step()? else { break };
            let (pose, twist) = (measured.end.state.world_from_body, measured.end.state.twist_body);
            assert!(pose.translation.vector.iter().chain(twist.to_vector().iter()).all(|c| c.is_finite()));
        }
        Ok(())
    });
    if let Err(error) = flown {
        is_said(&error.to_string(), "");
    }
}

/// The wrenches of a table are finite, ordered and before the end.
pub fn wrenches(data: &[u8]) {
    let end_ns = 100_000_000_000;
    match read_wrenches(data, Path::new("wrenches.csv"), end_ns) {
        Ok(rows) => {
            assert!(rows.windows(2).all(|pair| pair[0].0 < pair[1].0));
            assert!(rows.iter().all(|(time_ns, wrench)| {
                *time_ns < end_ns && wrench.force.iter().chain(&wrench.torque).all(|c| c.is_finite())
            }));
        }
        Err(error) => is_said(&error.to_string(), "wrenches.csv"),
    }
}

/// Every row of a table is answered by one of finite numbers, up to the first that cannot be.
fn table(data: &[u8], run: impl Fn(&Path, &[u8], &mut Vec<u8>, &mut Vec<u8>) -> Result<(), TumbleError>) {
    let (mut output, mut warnings) = (Vec::new(), Vec::new());
    if let Err(error) = run(Path::new("table.csv"), data, &mut output, &mut warnings) {
        is_said(&error.to_string(), "table.csv");
    }
    is_said(&String::from_utf8_lossy(&warnings), "");
    let output = String::from_utf8(output).expect("text");
    let mut lines = output.lines();
    let columns = lines.next().map_or(0, |header| header.split(',').count());
    for line in lines {
        assert_eq!(line.split(',').count(), columns, "{line}");
        assert!(line.split(',').all(|cell| cell.parse().is_ok_and(f64::is_finite)), "{line}");
    }
}

/// Wanted wrenches.
pub fn allocate_table(data: &[u8]) {
    for (shift, areas) in [(PositivityShift::AxisGroups, AreaTable::Full), (PositivityShift::Thesis, AreaTable::Thesis)]
    {
        table(data, |path, input, output, warnings| allocate::table(shift, areas, path, input, output, warnings));
    }
}

/// Impeller speeds and flap angles.
pub fn realize_table(data: &[u8]) {
    for areas in [AreaTable::Full, AreaTable::Thesis] {
        table(data, |path, input, output, warnings| realize::table(areas, path, input, output, warnings));
    }
}
