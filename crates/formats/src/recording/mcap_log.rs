//! Logs in MCAP: which topic carries which columns, both ways.
//!
//! Poses travel as `foxglove.PoseInFrame`, wrenches as `tumble.Wrench`, everything else under its own name in
//! `tumble.Columns`. The messages of a row share its time.

use super::foxglove::{self, Schema};
use super::mcap_reader;
use super::mcap_writer::{Channel, McapWriter};
use super::rows::{Cell, RowSink, unwritable};
use super::{Encoding, RawMessage, ScanReport};
use crate::FormatsError;
use crate::log::{ENVIRONMENT, QUATERNION_NORM_TOLERANCE, STORED};
use std::collections::HashMap;
use std::io::{Read, Write};
use std::ops::ControlFlow;
use tumble_dynamics::World;
use tumble_identification::MotionSample;
use tumble_lie::nalgebra::Vector3;
use tumble_lie::{Pose, Wrench};

/// Columns of a pose, after their prefix.
const POSE: [&str; 7] = ["p_x", "p_y", "p_z", "q_x", "q_y", "q_z", "q_w"];
/// Columns of a wrench, after their prefix, and keys of `tumble.Wrench`.
const WRENCH: [&str; 6] = ["f_x", "f_y", "f_z", "tau_x", "tau_y", "tau_z"];
/// Who says it: first part of the topic, prefix of the columns.
const SOURCES: [(&str, &str); 5] =
    [("true", "true_"), ("commanded", "cmd_"), ("estimated", "est_"), ("sigma", "sigma_"), ("measured", "")];
/// No log has more columns.
const MOST_COLUMNS: usize = 4096;

/// Topic of the measured poses.
pub const MEASURED_POSE: &str = "/measured/pose";
/// Topic of the wrench on the body, held from each stamp to the next.
pub const MEASURED_WRENCH: &str = "/measured/wrench";
/// Topic of everything else that was measured.
pub const MEASURED_COLUMNS: &str = "/measured/columns";
/// Topic of the body's frame.
pub const TRANSFORMS: &str = "/tf";
/// Topic of the robot's URDF.
pub const DESCRIPTION: &str = "/robot_description";
/// Topic of the volumes and obstacles.
pub const WORLD: &str = "/world";

/// Source and prefix of a column.
fn source(column: &str) -> (&'static str, &'static str) {
    SOURCES.into_iter().find(|(_, prefix)| column.starts_with(prefix)).unwrap_or(("measured", ""))
}

fn prefixed<const N: usize>(prefix: &str, names: [&str; N]) -> [String; N] {
    names.map(|name| format!("{prefix}{name}"))
}

/// A topic and the columns it carries.
struct Topic {
    channel: Channel,
    columns: Vec<usize>,
}

/// Writes rows as an MCAP log.
pub struct McapSink<W: Write> {
    writer: McapWriter<W>,
    columns: Vec<String>,
    poses: Vec<Topic>,
    wrenches: Vec<Topic>,
    others: Vec<(&'static str, Channel)>,
    transforms: Option<Channel>,
}

impl<W: Write> McapSink<W> {
    /// Begins a file.
    ///
    /// # Errors
    /// [`FormatsError::Unwritable`].
    pub fn new(out: W) -> Result<Self, FormatsError> {
        let writer = McapWriter::new(out).map_err(unwritable)?;
        let (poses, wrenches, others) = (Vec::new(), Vec::new(), Vec::new());
        Ok(Self { writer, columns: Vec::new(), poses, wrenches, others, transforms: None })
    }

    /// Draws the world, once, before the first row.
    ///
    /// # Errors
    /// [`FormatsError::Unwritable`].
    pub fn world(&mut self, world: &World) -> Result<(), FormatsError> {
        let channel = self.writer.channel(WORLD, &Schema::scene_update()).map_err(unwritable)?;
        self.writer.write(channel, 0, &foxglove::world_scene(0, world)).map_err(unwritable)
    }

    /// Describes the robot by a URDF, once, before the first row; its root is the link [`foxglove::BODY_FRAME`].
    ///
    /// # Errors
    /// [`FormatsError::Unwritable`].
    pub fn description(&mut self, urdf: &str) -> Result<(), FormatsError> {
        let channel = self.writer.channel(DESCRIPTION, &Schema::string()).map_err(unwritable)?;
        self.writer.write(channel, 0, &serde_json::json!({ "data": urdf }).to_string()).map_err(unwritable)
    }

    /// Ends the file and gives back what was written to.
    ///
    /// # Errors
    /// [`FormatsError::Unwritable`].
    pub fn finish(self) -> Result<W, FormatsError> {
        self.writer.finish().map_err(unwritable)
    }

    fn open(&mut self, source: &str, what: &str, schema: &Schema) -> Result<Channel, FormatsError> {
        self.writer.channel(&format!("/{source}/{what}"), schema).map_err(unwritable)
    }

    /// Where all of `names` stand, if they do.
    fn group(&self, names: &[String]) -> Option<Vec<usize>> {
        names.iter().map(|name| self.columns.iter().position(|column| column == name)).collect()
    }
}

/// The numbers in these places, where all are numbers.
fn numbers<const N: usize>(cells: &[Cell], places: &[usize]) -> Option<[f64; N]> {
    let mut numbers = [0.0; N];
    for (number, place) in numbers.iter_mut().zip(places) {
        let Some(Cell::Number(found)) = cells.get(*place) else { return None };
        *number = *found;
    }
    Some(numbers)
}

impl<W: Write> RowSink for McapSink<W> {
    fn begin(&mut self, columns: &[String]) -> Result<(), FormatsError> {
        self.columns = columns.to_vec();
        for (source, prefix) in SOURCES {
            if let Some(columns) = self.group(&prefixed(prefix, POSE)) {
                let channel = self.open(source, "pose", &Schema::pose_in_frame())?;
                self.poses.push(Topic { channel, columns });
                if prefix.is_empty() {
                    let schema = Schema::frame_transforms();
                    self.transforms = Some(self.writer.channel(TRANSFORMS, &schema).map_err(unwritable)?);
                }
            }
            if let Some(columns) = self.group(&prefixed(prefix, WRENCH)) {
                let channel = self.open(source, "wrench", &Schema::wrench())?;
                self.wrenches.push(Topic { channel, columns });
            }
        }
        Ok(())
    }

    fn row(&mut self, time_ns: i64, cells: &[Cell]) -> Result<(), FormatsError> {
        if time_ns < 0 {
            let what = "times before zero";
            return Err(FormatsError::NotHeld { path: "output".into(), format: "MCAP", what });
        }
        let poses: Vec<Option<[f64; 7]>> = self.poses.iter().map(|topic| numbers(cells, &topic.columns)).collect();
        let wrenches: Vec<Option<[f64; 6]>> =
            self.wrenches.iter().map(|topic| numbers(cells, &topic.columns)).collect();
        let mut taken = vec![false; cells.len()];
        let whole_poses = self.poses.iter().zip(&poses).filter(|(_, pose)| pose.is_some()).map(|(topic, _)| topic);
        let whole_wrenches = self.wrenches.iter().zip(&wrenches).filter(|(_, wrench)| wrench.is_some());
        for place in whole_poses.chain(whole_wrenches.map(|(topic, _)| topic)).flat_map(|topic| &topic.columns) {
            if let Some(taken) = taken.get_mut(*place) {
                *taken = true;
            }
        }
        // Before the pose, so that who reads on knows rates and accelerations when it comes.
        self.columns_of_row(time_ns, cells, &taken)?;
        let measured = self.columns.iter().position(|column| column == POSE[0]);
        for (topic, pose) in self.poses.iter().zip(poses) {
            let Some([x, y, z, xyzw @ ..]) = pose else { continue };
            let message = foxglove::pose_in_frame(time_ns, &[x, y, z], &xyzw);
            self.writer.write(topic.channel, time_ns, &message).map_err(unwritable)?;
            if let Some(channel) = self.transforms.filter(|_| topic.columns.first().copied() == measured) {
                let message = foxglove::body_transform(time_ns, &[x, y, z], &xyzw);
                self.writer.write(channel, time_ns, &message).map_err(unwritable)?;
            }
        }
        for (topic, wrench) in self.wrenches.iter().zip(wrenches) {
            let Some(wrench) = wrench else { continue };
            self.writer.write(topic.channel, time_ns, &foxglove::flat(&WRENCH, &wrench)).map_err(unwritable)?;
        }
        Ok(())
    }
}

impl<W: Write> McapSink<W> {
    /// Writes the cells of a row that are not `taken` by a pose or a wrench.
    fn columns_of_row(&mut self, time_ns: i64, cells: &[Cell], taken: &[bool]) -> Result<(), FormatsError> {
        for (of, _) in SOURCES {
            let mut message = serde_json::Map::new();
            for ((column, cell), _) in self.columns.iter().zip(cells).zip(taken).filter(|(_, taken)| !**taken) {
                if source(column).0 != of {
                    continue;
                }
                match cell {
                    Cell::Empty => {}
                    Cell::Number(number) => {
                        message.insert(column.clone(), (*number).into());
                    }
                    Cell::Text(text) => {
                        message.insert(column.clone(), text.as_str().into());
                    }
                }
            }
            if message.is_empty() {
                continue;
            }
            let known = self.others.iter().find(|(name, _)| *name == of).map(|(_, channel)| *channel);
            let channel = if let Some(channel) = known {
                channel
            } else {
                let channel = self.open(of, "columns", &Schema::columns())?;
                self.others.push((of, channel));
                channel
            };
            let message = serde_json::Value::Object(message).to_string();
            self.writer.write(channel, time_ns, &message).map_err(unwritable)?;
        }
        Ok(())
    }
}

/// Which columns a message carries, by its topic and type.
enum Carries {
    Pose(&'static str),
    Wrench(&'static str),
    Columns,
}

fn carries(message: &RawMessage<'_>) -> Option<Carries> {
    if message.encoding != Encoding::Json {
        return None;
    }
    let (of, what) = message.topic.strip_prefix('/')?.split_once('/')?;
    let (_, prefix) = SOURCES.into_iter().find(|(source, _)| *source == of)?;
    match (what, message.type_name) {
        ("pose", "foxglove.PoseInFrame") => Some(Carries::Pose(prefix)),
        ("wrench", "tumble.Wrench") => Some(Carries::Wrench(prefix)),
        ("columns", "tumble.Columns") => Some(Carries::Columns),
        _ => None,
    }
}

/// The cells of a message, `None` where it does not hold what its type says.
fn cells(message: &RawMessage<'_>, carries: &Carries) -> Option<Vec<(String, Cell)>> {
    let named = |prefix, names: &[&str], numbers: &[f64]| {
        names.iter().zip(numbers).map(|(name, number)| (format!("{prefix}{name}"), Cell::Number(*number))).collect()
    };
    match carries {
        Carries::Pose(prefix) => {
            let (position, xyzw) = foxglove::read_pose(message.payload)?;
            Some(named(prefix, &POSE, &[&position[..], &xyzw].concat()))
        }
        Carries::Wrench(prefix) => Some(named(prefix, &WRENCH, &foxglove::read_flat(message.payload, &WRENCH)?)),
        Carries::Columns => {
            let object: serde_json::Map<String, serde_json::Value> = serde_json::from_slice(message.payload).ok()?;
            let cell = |value: serde_json::Value| match value {
                serde_json::Value::String(text) => Some(Cell::Text(text)),
                other => other.as_f64().map(Cell::Number),
            };
            object.into_iter().map(|(name, value)| Some((name, cell(value)?))).collect()
        }
    }
}

/// The columns of an MCAP log of ours, from a first scan.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct McapLog {
    /// Columns but the time; empty where the file is no log of ours.
    pub columns: Vec<String>,
    /// Messages that do not hold what their type says, or come with more than 4096 columns.
    pub unread: u64,
}

impl McapLog {
    /// Looks which columns there are.
    ///
    /// # Errors
    /// As [`mcap_reader::scan`].
    pub fn survey<R: Read>(reader: R) -> Result<(Self, ScanReport), FormatsError> {
        let mut log = Self::default();
        let mut places = HashMap::new();
        let report = mcap_reader::scan(reader, &mut |message| {
            if let Some(carries) = carries(&message) {
                let Some(cells) = cells(&message, &carries) else {
                    log.unread += 1;
                    return ControlFlow::Continue(());
                };
                for (name, _) in cells {
                    if !places.contains_key(&name) && places.len() < MOST_COLUMNS {
                        places.insert(name.clone(), places.len());
                        log.columns.push(name);
                    }
                }
            }
            ControlFlow::Continue(())
        })?;
        // Measured ones first, as every log has them; within a source as they came.
        let order = |name: &String| {
            let of = source(name).0;
            (of != "measured", SOURCES.iter().position(|(known, _)| *known == of))
        };
        log.columns.sort_by_key(order);
        Ok((log, report))
    }

    /// Streams the rows; gives how many had no pose where the log has poses, and were left out.
    ///
    /// # Errors
    /// As [`mcap_reader::scan`], or from `sink`.
    pub fn rows<R: Read>(&self, reader: R, sink: &mut dyn RowSink) -> Result<u64, FormatsError> {
        let places: HashMap<&str, usize> = self.columns.iter().map(String::as_str).zip(0..).collect();
        let pose = places.get(POSE[0]).copied();
        sink.begin(&self.columns)?;
        let mut row = Row { time_ns: None, cells: vec![Cell::Empty; self.columns.len()], pose, left_out: 0 };
        let mut refused = None;
        mcap_reader::scan(reader, &mut |message| {
            let Some(cells) = carries(&message).and_then(|carries| cells(&message, &carries)) else {
                return ControlFlow::Continue(());
            };
            let cells = cells.into_iter().filter_map(|(name, cell)| Some((*places.get(name.as_str())?, cell)));
            match row.take(message.log_time_ns, cells.collect(), sink) {
                Ok(()) => ControlFlow::Continue(()),
                Err(error) => {
                    refused = Some(error);
                    ControlFlow::Break(())
                }
            }
        })?;
        match refused {
            Some(error) => Err(error),
            None => row.hand_on(sink).map(|()| row.left_out),
        }
    }
}

/// The row that is being gathered.
struct Row {
    time_ns: Option<i64>,
    cells: Vec<Cell>,
    pose: Option<usize>,
    left_out: u64,
}

impl Row {
    /// Takes cells with their places; a row ends where the time changes or a cell comes a second time.
    fn take(&mut self, time_ns: i64, cells: Vec<(usize, Cell)>, sink: &mut dyn RowSink) -> Result<(), FormatsError> {
        let comes_again =
            cells.iter().any(|(place, _)| self.cells.get(*place).is_some_and(|cell| *cell != Cell::Empty));
        if comes_again || self.time_ns.is_some_and(|current| current != time_ns) {
            self.hand_on(sink)?;
        }
        self.time_ns = Some(time_ns);
        for (place, cell) in cells {
            if let Some(slot) = self.cells.get_mut(place) {
                *slot = cell;
            }
        }
        Ok(())
    }

    fn hand_on(&mut self, sink: &mut dyn RowSink) -> Result<(), FormatsError> {
        let Some(time_ns) = self.time_ns.take() else { return Ok(()) };
        if self.pose.is_some_and(|pose| self.cells.get(pose) == Some(&Cell::Empty)) {
            self.left_out += 1;
        } else {
            sink.row(time_ns, &self.cells)?;
        }
        self.cells.fill(Cell::Empty);
        Ok(())
    }
}

/// What a log of ours says of the motion and its cause, for the assembly of a flight.
pub(crate) enum Measured {
    Motion(Box<MotionSample>),
    Wrench(Wrench<f64>),
}

/// Force before torque, as rows have them.
fn wrench([force @ .., x, y, z]: [f64; 6]) -> Wrench<f64> {
    Wrench::new(Vector3::new(x, y, z), force.into())
}

/// Rates, accelerations and what acts besides of a row, which come before its pose.
#[derive(Default)]
pub(crate) struct MeasuredColumns {
    time_ns: i64,
    velocity: Option<Vector3<f64>>,
    rate: Option<Vector3<f64>>,
    acceleration: Option<Vector3<f64>>,
    stored: Option<Vector3<f64>>,
    environment: Option<Wrench<f64>>,
}

impl MeasuredColumns {
    /// Reads a message on a measured topic: `None` for rates and the like, which wait for their pose, and for messages
    /// that do not hold what their type says; those are counted in `unread`.
    pub(crate) fn take(&mut self, message: &RawMessage<'_>, unread: &mut usize) -> Option<Measured> {
        let payload = message.payload;
        match carries(message)? {
            Carries::Pose("") => {
                let sample = foxglove::read_pose(payload).and_then(|(position, [x, y, z, w])| {
                    let rotation = tumble_lie::from_xyzw(x, y, z, w, QUATERNION_NORM_TOLERANCE).ok()?;
                    let beside = std::mem::take(self);
                    let same_row = beside.time_ns == message.log_time_ns;
                    Some(Box::new(MotionSample {
                        time_ns: message.log_time_ns,
                        world_from_body: Some(Pose::from_parts(Vector3::from(position).into(), rotation)),
                        velocity_origin_world: beside.velocity.filter(|_| same_row),
                        rate_body: beside.rate.filter(|_| same_row),
                        acceleration_origin_body: beside.acceleration.filter(|_| same_row),
                        wrench_body: None,
                        besides_body: beside.environment.filter(|_| same_row),
                        stored_momentum_body: beside.stored.filter(|_| same_row),
                    }))
                });
                *unread += usize::from(sample.is_none());
                sample.map(Measured::Motion)
            }
            Carries::Wrench("") => {
                let found = foxglove::read_flat(payload, &WRENCH);
                *unread += usize::from(found.is_none());
                found.map(|numbers| Measured::Wrench(wrench(numbers)))
            }
            Carries::Columns if message.topic == MEASURED_COLUMNS => {
                let vector = |names: [&str; 3]| foxglove::read_flat(payload, &names).map(Vector3::from);
                *self = Self {
                    time_ns: message.log_time_ns,
                    velocity: vector(["v_x", "v_y", "v_z"]),
                    rate: vector(["w_x", "w_y", "w_z"]),
                    acceleration: vector(["a_x", "a_y", "a_z"]),
                    stored: vector(STORED),
                    environment: foxglove::read_flat(payload, &ENVIRONMENT).map(wrench),
                };
                None
            }
            _ => None,
        }
    }
}
