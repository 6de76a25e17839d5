//! `tumble sample`: files to try the other commands with.

use super::Outcome;
use crate::output::write_file;
use crate::{TumbleError, demo};
use clap::{Args, ValueEnum};
use std::fs;
use std::path::{Path, PathBuf};
use tumble_dynamics::InertialParameters;
use tumble_formats::recording::rows::{Cell, CsvSink, RowSink as _};
use tumble_formats::{FormatsError, body_file};
use tumble_identification::MotionSample;

/// Options of `tumble sample`.
#[derive(Args)]
pub struct SampleArgs {
    /// What to write.
    #[arg(value_enum)]
    kind: Kind,
    /// The folder to write to; it is made where it is not there.
    #[arg(default_value = ".")]
    folder: PathBuf,
    /// Another flight for each seed.
    #[arg(long, default_value_t = 7)]
    seed: u64,
    /// Replace files that exist.
    #[arg(long)]
    force: bool,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
enum Kind {
    /// A minute of poses and wrenches, flight.csv, and the body that really flew, truth.toml: for `identify` and `convert`.
    Log,
    /// The same as a ROS 1 bag, flight.bag, with truth.toml.
    Bag,
    /// Two minutes of an arm on a free base that holds something, floating.csv, and what it holds, payload.toml: for `identify --model`.
    Arm,
    /// Throws of a device with a wheel, of a proof block and of an object, nine files, and the object, truth.toml: for `calibrate-wheel` and
    /// `identify --wheel`.
    Throw,
    /// Wanted wrenches, wrenches.csv, for `allocate`.
    Wrenches,
    /// An arm with three slips in its inertias, model.urdf, for `check`.
    Model,
}

/// Writes the files.
///
/// # Errors
/// [`TumbleError::OutputExists`] without `--force`; what cannot be written.
pub fn run(args: &SampleArgs) -> Result<Outcome, TumbleError> {
    let (files, next) = files(args)?;
    let place = |name: &str| args.folder.join(name);
    // A log and a bag of one seed have one truth, which may lie there already.
    let is_there = |(name, contents): &Named| fs::read(place(name)).is_ok_and(|found| found == *contents);
    let missing: Vec<&Named> = files.iter().filter(|file| !is_there(file)).collect();
    if let Some(taken) = missing.iter().map(|(name, _)| place(name)).find(|path| path.exists() && !args.force) {
        return Err(TumbleError::OutputExists { path: taken });
    }
    fs::create_dir_all(&args.folder)
        .map_err(|source| FormatsError::Unwritable { path: args.folder.clone(), source })?;
    for (name, contents) in missing {
        write_file(&place(name), contents, args.force)?;
    }
    let written: Vec<String> = files.iter().map(|(name, _)| place(name).display().to_string()).collect();
    tell_line!("wrote {}; next: tumble {next}", written.join(" and "));
    Ok(Outcome::Achieved)
}

/// A file's name and what it holds.
type Named = (String, Vec<u8>);

/// The files, and the command to go on with.
fn files(args: &SampleArgs) -> Result<(Vec<Named>, String), TumbleError> {
    let place = |name: &str| args.folder.join(name).display().to_string();
    let one = |name: &str, contents: Vec<u8>| vec![(name.to_owned(), contents)];
    let beside = |name: &str, contents: Vec<u8>, (truth, body): (&str, &InertialParameters<f64>)| {
        let truth = (truth.to_owned(), body_file::export(Path::new(truth), body)?.into_bytes());
        Ok::<_, TumbleError>(vec![(name.to_owned(), contents), truth])
    };
    let referred = |name: &str| format!("identify {} --reference {}", place(name), place("truth.toml"));
    Ok(match args.kind {
        Kind::Log => {
            let flight = demo::simulate(args.seed)?;
            (beside("flight.csv", log(&flight.record)?, ("truth.toml", &flight.truth))?, referred("flight.csv"))
        }
        Kind::Bag => {
            let flight = demo::simulate(args.seed)?;
            (beside("flight.bag", bag(&flight.record), ("truth.toml", &flight.truth))?, referred("flight.bag"))
        }
        Kind::Arm => {
            let flown = demo::arm::simulate(args.seed)?;
            let momentum = demo::arm::MOMENTUM.map(|number| number.to_string()).join(",");
            let next = format!(
                "identify {} --model {} --payload --momentum {momentum}",
                place("floating.csv"),
                demo::arm::ARM
            );
            (beside("floating.csv", flown.log.into_bytes(), ("payload.toml", &flown.payload))?, next)
        }
        Kind::Throw => {
            let thrown = demo::throw::simulate(args.seed)?;
            let mut files: Vec<_> = thrown.files.into_iter().map(|(name, text)| (name, text.into_bytes())).collect();
            files.push((
                "truth.toml".to_owned(),
                body_file::export(Path::new("truth.toml"), &thrown.object)?.into_bytes(),
            ));
            let calibration = place("cal.toml");
            let next = format!(
                "calibrate-wheel {} --out {calibration}, then tumble identify --wheel {} --calibration {calibration} --mass {}",
                place("cal_*.csv"),
                place("throw.csv"),
                demo::throw::OBJECT_MASS_KG
            );
            (files, next)
        }
        Kind::Wrenches => {
            (one("wrenches.csv", WRENCHES.as_bytes().to_vec()), format!("allocate {}", place("wrenches.csv")))
        }
        Kind::Model => (one("model.urdf", MODEL.as_bytes().to_vec()), format!("check {}", place("model.urdf"))),
    })
}

/// The columns of [`log`] behind the time.
const COLUMNS: [&str; 13] =
    ["p_x", "p_y", "p_z", "q_x", "q_y", "q_z", "q_w", "f_x", "f_y", "f_z", "tau_x", "tau_y", "tau_z"];

/// The record as `tumble identify` reads it.
fn log(record: &[MotionSample]) -> Result<Vec<u8>, TumbleError> {
    let mut sink = CsvSink::new(Vec::new());
    sink.begin(&COLUMNS.map(str::to_owned))?;
    for sample in record {
        let (Some(pose), Some(wrench)) = (&sample.world_from_body, &sample.wrench_body) else { continue };
        let pose = pose.translation.vector.iter().chain(pose.rotation.coords.iter());
        let cells = pose.chain(wrench.force.iter()).chain(wrench.torque.iter());
        sink.row(sample.time_ns, &cells.map(|number| Cell::Number(*number)).collect::<Vec<_>>())?;
    }
    Ok(sink.into_inner())
}

/// Topics of [`bag`], each with its type and the md5 sum of the type's definition.
const TOPICS: [(&str, &str, &str); 2] = [
    ("/pose", "geometry_msgs/PoseStamped", "d3812c3cbc69362b77dc0b19b345f8f5"),
    ("/wrench", "geometry_msgs/WrenchStamped", "d78d3cb249ce23087ade7e7d0c40cfa7"),
];

/// The record as a ROS 1 bag, version 2.0, of one chunk without an index, as a recorder leaves it that was ended before it closed the file.
fn bag(record: &[MotionSample]) -> Vec<u8> {
    let mut chunk = Vec::new();
    for ((topic, kind, md5), number) in TOPICS.iter().zip(0_u32..) {
        chunk.extend(fields(&[(b"op", &[7]), (b"conn", &number.to_le_bytes()), (b"topic", topic.as_bytes())]));
        chunk.extend(fields(&[(b"topic", topic.as_bytes()), (b"type", kind.as_bytes()), (b"md5sum", md5.as_bytes())]));
    }
    for sample in record {
        let (Some(pose), Some(wrench)) = (&sample.world_from_body, &sample.wrench_body) else { continue };
        // ROS takes the time zero for none.
        let time = stamp(sample.time_ns + FIRST_NS);
        let pose = numbers(pose.translation.vector.iter().chain(pose.rotation.coords.iter()));
        let wrench = numbers(wrench.force.iter().chain(wrench.torque.iter()));
        for (number, frame, payload) in [(0_u32, "world", pose), (1, "body", wrench)] {
            chunk.extend(fields(&[(b"op", &[2]), (b"conn", &number.to_le_bytes()), (b"time", &time)]));
            let message = [&[0; 4][..], &time, &counted(frame.as_bytes()), &payload].concat();
            chunk.extend(counted(&message));
        }
    }
    let size = length(&chunk);
    let head = fields(&[(b"op", &[5]), (b"compression", b"none"), (b"size", &size)]);
    [b"#ROSBAG V2.0\n".as_slice(), &head, &counted(&chunk)].concat()
}

/// Time of the first message of [`bag`], ns.
const FIRST_NS: i64 = 1_000_000_000;

/// A record's header: its fields, counted, behind their common length.
fn fields(fields: &[(&[u8], &[u8])]) -> Vec<u8> {
    let one = |(name, value): &(&[u8], &[u8])| counted(&[*name, b"=".as_slice(), *value].concat());
    counted(&fields.iter().flat_map(one).collect::<Vec<_>>())
}

fn numbers<'a>(numbers: impl Iterator<Item = &'a f64>) -> Vec<u8> {
    numbers.flat_map(|number| number.to_le_bytes()).collect()
}

fn counted(bytes: &[u8]) -> Vec<u8> {
    [length(bytes).as_slice(), bytes].concat()
}

/// A length as bags write it; nothing here is longer than 4 GB.
fn length(bytes: &[u8]) -> [u8; 4] {
    u32::try_from(bytes.len()).unwrap_or(u32::MAX).to_le_bytes()
}

/// Seconds, then nanoseconds.
fn stamp(time_ns: i64) -> [u8; 8] {
    let part = |number: i64| u64::try_from(number).unwrap_or(0);
    (part(time_ns / 1_000_000_000) | part(time_ns % 1_000_000_000) << 32).to_le_bytes()
}

/// Forces and torques along each axis, and more than the nozzles give.
const WRENCHES: &str = "\
mode,fx,fy,fz,tx,ty,tz,comx,comy,comz
2,0.1,0,0,0,0,0,0,0,0
2,0,0.1,0,0,0,0,0,0,0
2,0,0,0.1,0,0,0,0,0,0
2,0,0,0,0.01,0,0,0,0,0
2,0,0,0,0,0.01,0,0,0,0
2,0,0,0,0,0,0.01,0,0,0
2,0.2,-0.1,0.05,0.004,-0.002,0.01,0.01,0,0
3,1.5,0,0,0,0,0,0,0,0
";

/// Of the upper arm x and z are exchanged, the forearm cannot be, the wrist is in g mm^2.
const MODEL: &str = include_str!("sample_model.urdf");
