//! From a recording, in one file or several, to the motion of one robot and the wrench on it.
//!
//! Two passes over the file: the first counts what is there and decides what is used, the second decodes it, puts it in
//! order of its stamps and hands out one [`MotionSample`] for every pose. Memory is bounded, whatever the file's size.

use super::mcap_log::{MEASURED_POSE, Measured, MeasuredColumns};
use super::merged::{Seen, scan_files};
use super::messages::{self, Message, MessageError, PmcCommand};
use super::topics::{HeldColumns, Plan, Tally, Topics, ULOG_POSITION, WRENCH_TOPICS, damaged, is_listed, survey_all};
use super::{Container, RawMessage, container, ulog_flight};
use crate::FormatsError;
use crate::log::{QUATERNION_NORM_TOLERANCE, shortened};
use crate::{ActuatorBytes, ActuatorReplay, Robots};
use std::ops::ControlFlow;
use std::path::{Path, PathBuf};
use std::sync::mpsc::{Receiver, SyncSender, sync_channel};
use tumble_dynamics::nalgebra::{Isometry3, Quaternion, Vector3};
use tumble_identification::MotionSample;
use tumble_identification::synchronize::{Held, TimeOrdering};
use tumble_lie::Wrench;

/// How many messages are held back to put late ones in order: about twenty seconds of a robot.
const REORDER_MESSAGES: usize = 4096;
/// A command holds no longer than this: a robot that hears nothing more stops its impellers.
const LONGEST_HOLD_NS: i64 = 500_000_000;
/// Samples that travel from the reading thread at once, and how many such batches wait.
const BATCH: usize = 1024;
const BATCHES: usize = 4;
/// A decoded message in its place in time.
enum Event {
    Motion(Box<MotionSample>),
    /// Body axes, about the origin.
    Wrench(Wrench<f64>),
    Bytes(ActuatorBytes),
    /// Impeller speeds, counts.
    Speeds([u8; 2]),
    CenterOfMass(Vector3<f64>),
    /// Body axes, about the centre of mass that the robot believes in.
    WrenchAboutCenterOfMass(Wrench<f64>),
}

/// Turns messages into samples: decoding, order, and the wrench's impulse over each interval.
struct Assembler<'p> {
    plan: &'p Plan,
    path: &'p Path,
    ordering: TimeOrdering<Event, Vec<Option<Held<Event>>>>,
    tally: Tally,
    motion_frame: String,
    columns: MeasuredColumns,
    newest_motion_ns: Option<i64>,
    center_of_mass: Vector3<f64>,
    actuators: Option<Box<dyn ActuatorReplay>>,
    /// Of several files, which messages came lately.
    seen: Option<Seen>,
    speeds: Option<[u8; 2]>,
    /// The wrench that acts, and until when.
    acting: Option<(Wrench<f64>, i64)>,
    /// The sample whose interval runs, its impulse so far, how much of it is covered and until when it is added up.
    pending: Option<(MotionSample, Wrench<f64>, i64, i64)>,
}

impl<'p> Assembler<'p> {
    fn new(plan: &'p Plan, paths: &'p [PathBuf], actuators: Option<Box<dyn ActuatorReplay>>) -> Self {
        Self {
            plan,
            path: paths.first().map_or(Path::new(""), PathBuf::as_path),
            ordering: TimeOrdering::new(std::iter::repeat_with(|| None).take(REORDER_MESSAGES).collect()),
            tally: Tally::default(),
            motion_frame: String::new(),
            columns: MeasuredColumns::default(),
            newest_motion_ns: None,
            center_of_mass: Vector3::zeros(),
            actuators,
            seen: (paths.len() > 1).then(Seen::default),
            speeds: None,
            acting: None,
            pending: None,
        }
    }

    /// Whether another file has had this message of this stamp; it is counted.
    fn is_doubled(&mut self, file: usize, time_ns: i64, raw: &RawMessage<'_>) -> bool {
        let is_doubled = self.seen.as_mut().is_some_and(|seen| seen.in_another(file, time_ns, raw));
        self.tally.doubled += usize::from(is_doubled);
        is_doubled
    }

    /// Takes a message of a file; hands out a sample when one is complete.
    fn take(&mut self, file: usize, raw: &RawMessage<'_>) -> Result<Option<MotionSample>, FormatsError> {
        if self.plan.motion == MEASURED_POSE {
            if self.is_doubled(file, raw.log_time_ns, raw) {
                return Ok(None);
            }
            let event = match self.columns.take(raw, &mut self.tally.undecoded) {
                Some(Measured::Motion(sample)) => Event::Motion(sample),
                Some(Measured::Wrench(wrench)) => Event::Wrench(wrench),
                None => return Ok(None),
            };
            return self.push(raw.log_time_ns, event);
        }
        if self.plan.part(raw.topic).is_none() {
            return Ok(None);
        }
        if let Some(replay) =
            self.actuators.as_ref().filter(|replay| replay.command_type() == raw.type_name && !is_listed(raw.type_name))
        {
            let Some(command) = replay.decode(raw)? else {
                self.tally.undecoded += 1;
                return Ok(None);
            };
            if self.is_doubled(file, raw.log_time_ns, raw) {
                return Ok(None);
            }
            return self.push(raw.log_time_ns, Event::Bytes(command));
        }
        let message = match messages::decode(raw) {
            Some(Ok(message)) => message,
            Some(Err(source @ MessageError::UnknownDefinition { .. })) => {
                return Err(FormatsError::BadMessage { topic: shortened(raw.topic), source });
            }
            Some(Err(_)) => {
                self.tally.undecoded += 1;
                return Ok(None);
            }
            None => return Ok(None),
        };
        let mut time_ns = message.header().stamp_ns;
        if time_ns == 0 {
            self.tally.unstamped += 1;
            time_ns = raw.log_time_ns;
        }
        if self.is_doubled(file, time_ns, raw) {
            return Ok(None);
        }
        let Some(event) = self.event(&message, time_ns)? else { return Ok(None) };
        self.push(time_ns, event)
    }

    /// Puts an event in its place; hands out a sample when one is complete.
    fn push(&mut self, time_ns: i64, event: Event) -> Result<Option<MotionSample>, FormatsError> {
        if let Event::Motion(_) = event {
            self.tally.late += usize::from(self.newest_motion_ns.is_some_and(|newest| time_ns < newest));
            self.newest_motion_ns = self.newest_motion_ns.max(Some(time_ns));
        }
        match self.ordering.push(time_ns, event) {
            Some(released) if released.in_order => self.advance(released.time_ns, released.sample),
            Some(_) => {
                self.tally.too_late += 1;
                Ok(None)
            }
            None => Ok(None),
        }
    }

    /// The next sample after the last message, until `None`.
    fn finish(&mut self) -> Result<Option<MotionSample>, FormatsError> {
        while let Some(released) = self.ordering.flush() {
            if let Some(sample) = self.advance(released.time_ns, released.sample)? {
                return Ok(Some(sample));
            }
        }
        // The last sample's interval has no end: what acted at its beginning is its wrench.
        let Some((mut sample, ..)) = self.pending.take() else { return Ok(None) };
        sample.wrench_body = self.acting.filter(|(_, until)| *until >= sample.time_ns).map(|(wrench, _)| wrench);
        self.tally.samples += 1;
        Ok(Some(sample))
    }

    fn event(&mut self, message: &Message<'_>, time_ns: i64) -> Result<Option<Event>, FormatsError> {
        let motion = match message {
            Message::EkfState(state) if state.confidence == CONFIDENCE_LOST || state.status == STATUS_INVALID => {
                self.tally.invalid += 1;
                return Ok(None);
            }
            Message::EkfState(state) => {
                pose(time_ns, &state.pose.position, &state.pose.orientation).map(|sample| MotionSample {
                    velocity_origin_world: Some(state.velocity),
                    rate_body: Some(state.omega),
                    acceleration_origin_body: Some(state.accel),
                    ..sample
                })
            }
            Message::Odometry(m) => {
                m.header.frame_id.clone_into(&mut self.motion_frame);
                let sample = pose(time_ns, &m.pose.position, &m.pose.orientation);
                sample.map(|sample| MotionSample {
                    velocity_origin_world: sample.world_from_body.map(|pose| pose.rotation * m.twist.linear),
                    rate_body: Some(m.twist.angular),
                    ..sample
                })
            }
            Message::PoseStamped(m) => {
                m.header.frame_id.clone_into(&mut self.motion_frame);
                pose(time_ns, &m.pose.position, &m.pose.orientation)
            }
            other => return self.other_event(other),
        };
        let finite = |v: &Option<Vector3<f64>>| v.as_ref().is_none_or(is_finite);
        let motion = motion.filter(|sample| {
            finite(&sample.velocity_origin_world)
                && finite(&sample.rate_body)
                && finite(&sample.acceleration_origin_body)
        });
        self.tally.impossible += usize::from(motion.is_none());
        Ok(motion.map(|sample| Event::Motion(Box::new(sample))))
    }

    fn other_event(&mut self, message: &Message<'_>) -> Result<Option<Event>, FormatsError> {
        Ok(match message {
            Message::PmcCommand(command) => {
                let bytes = command_bytes(command);
                self.tally.other_modules += usize::from(bytes.is_none());
                bytes.map(Event::Bytes)
            }
            Message::PmcTelemetry(telemetry) => match telemetry.statuses.as_slice() {
                [starboard, port] => Some(Event::Speeds([starboard.motor_speed, port.motor_speed])),
                _ => None,
            },
            Message::InertiaStamped(m) => {
                Some(Event::CenterOfMass(m.center_of_mass)).filter(|_| is_finite(&m.center_of_mass))
            }
            Message::FamCommand(m) => wrench(&m.wrench).map(Event::WrenchAboutCenterOfMass),
            Message::WrenchStamped(m) => {
                let frame = m.header.frame_id;
                if !frame.is_empty() && frame == self.motion_frame {
                    return Err(FormatsError::NoFlight {
                        path: self.path.into(),
                        reason: format!(
                            "the wrench speaks in frame `{}`, as the pose does; one in body axes about the body origin is needed",
                            shortened(frame)
                        ),
                    });
                }
                wrench(&m.wrench).map(Event::Wrench)
            }
            _ => None,
        })
    }

    /// Goes on to an event, in order of time; hands out the sample whose interval it ends.
    fn advance(&mut self, time_ns: i64, event: Event) -> Result<Option<MotionSample>, FormatsError> {
        self.replay_until(time_ns)?;
        if let Event::Motion(sample) = event {
            if self.pending.as_ref().is_some_and(|(pending, ..)| pending.time_ns == time_ns) {
                self.tally.repeated += 1;
                return Ok(None);
            }
            self.add_up(time_ns);
            let finished = self.pending.replace((*sample, Wrench::zero(), 0, time_ns));
            return Ok(finished.map(|(mut sample, impulse, covered_ns, _)| {
                let interval_ns = time_ns - sample.time_ns;
                if covered_ns > 0 && covered_ns == interval_ns {
                    let mean = 1.0 / interval_ns as f64;
                    sample.wrench_body = Some(Wrench::new(impulse.torque * mean, impulse.force * mean));
                } else {
                    self.tally.without_wrench += 1;
                }
                self.tally.samples += 1;
                sample
            }));
        }
        self.add_up(time_ns);
        match event {
            Event::Wrench(wrench) => self.hold(wrench, time_ns),
            Event::WrenchAboutCenterOfMass(wrench) => {
                let torque = wrench.torque + self.center_of_mass.cross(&wrench.force);
                self.hold(Wrench::new(torque, wrench.force), time_ns);
            }
            Event::CenterOfMass(center_of_mass) => self.center_of_mass = center_of_mass,
            Event::Bytes(bytes) => {
                let acting =
                    self.actuators.as_mut().map(|replay| replay.take(time_ns, &bytes, self.speeds)).transpose()?;
                let acting = acting.flatten();
                if let Some(wrench) = acting.or(self.acting.map(|(wrench, _)| wrench)) {
                    self.hold(wrench, time_ns);
                }
            }
            Event::Speeds(speeds) => {
                // The simulator's telemetry stays at zero; a robot's does not.
                if self.speeds.is_some() || speeds.iter().any(|speed| *speed > 0) {
                    self.speeds = Some(speeds);
                    self.tally.measured_speed = true;
                }
            }
            Event::Motion(_) => {}
        }
        Ok(None)
    }

    fn hold(&mut self, wrench: Wrench<f64>, time_ns: i64) {
        self.acting = Some((wrench, time_ns.saturating_add(LONGEST_HOLD_NS)));
    }

    /// What the servos do by themselves while commands hold.
    fn replay_until(&mut self, time_ns: i64) -> Result<(), FormatsError> {
        let overdue_ns =
            |replay: &Option<Box<dyn ActuatorReplay>>| replay.as_ref().and_then(|replay| replay.overdue_ns());
        while let (Some((_, until)), Some(overdue_ns)) = (self.acting, overdue_ns(&self.actuators)) {
            if overdue_ns > time_ns.min(until) {
                if until < time_ns
                    && let Some(replay) = &mut self.actuators
                {
                    replay.silence();
                }
                return Ok(());
            }
            self.add_up(overdue_ns);
            let wrench = self.actuators.as_mut().map(|replay| replay.go_on(self.speeds)).transpose()?;
            self.acting = wrench.flatten().map(|wrench| (wrench, until));
        }
        Ok(())
    }

    /// Adds what acts to the impulse of the running interval, up to a time.
    fn add_up(&mut self, time_ns: i64) {
        let Some((_, impulse, covered_ns, reached_ns)) = &mut self.pending else { return };
        if let Some((wrench, until)) = &self.acting {
            let step_ns = time_ns.min(*until).saturating_sub(*reached_ns).max(0);
            let step = step_ns as f64;
            *impulse = Wrench::new(impulse.torque + wrench.torque * step, impulse.force + wrench.force * step);
            *covered_ns = covered_ns.saturating_add(step_ns);
        }
        *reached_ns = time_ns;
    }
}

/// `EkfState.confidence` of a robot that does not know where it is.
const CONFIDENCE_LOST: u8 = 2;
/// `EkfState.status` of an estimate that is none.
const STATUS_INVALID: u8 = 255;

fn is_finite(v: &Vector3<f64>) -> bool {
    v.iter().all(|x| x.is_finite())
}

fn pose(time_ns: i64, position: &Vector3<f64>, q: &Quaternion<f64>) -> Option<MotionSample> {
    let rotation = tumble_lie::from_xyzw(q.i, q.j, q.k, q.w, QUATERNION_NORM_TOLERANCE).ok()?;
    is_finite(position).then(|| MotionSample {
        time_ns,
        world_from_body: Some(Isometry3::from_parts((*position).into(), rotation)),
        ..MotionSample::default()
    })
}

fn wrench(message: &messages::WrenchMessage) -> Option<Wrench<f64>> {
    (is_finite(&message.force) && is_finite(&message.torque)).then(|| Wrench::new(message.torque, message.force))
}

/// What replays the commands of the robot whose flight is read.
fn replay_of(topics: &Topics, plan: &Plan, robots: &Robots) -> Option<Box<dyn ActuatorReplay>> {
    let commands = topics.get(plan.wrench.as_ref()?)?;
    robots.replays().find(|replay| replay.command_type() == commands.type_name)
}

/// Impeller speeds of both modules, then the flaps of their nozzles.
fn command_bytes(command: &PmcCommand<'_>) -> Option<ActuatorBytes> {
    let [starboard, port] = command.goals.as_slice() else { return None };
    let speeds = [starboard.motor_speed, port.motor_speed];
    ActuatorBytes::new(&[&speeds[..], &starboard.nozzle_positions, &port.nozzle_positions].concat())
}

/// What the reading thread sends.
enum Sent {
    Samples(Vec<MotionSample>),
    End(Box<Result<Tally, FormatsError>>),
}

/// Streams the samples of one robot's flight from a recording, in order of time.
pub struct FlightReader {
    /// What the file holds.
    pub topics: Topics,
    /// What of it is used.
    pub plan: Plan,
    receiver: Receiver<Sent>,
    batch: std::vec::IntoIter<MotionSample>,
    tally: Option<Tally>,
}

impl FlightReader {
    /// Surveys a recording, chooses the streams of a robot and begins to read them.
    ///
    /// # Errors
    /// [`FormatsError`] for a file that is no recording, holds no flight, or several without a robot being named.
    pub fn open(path: &Path, robot: Option<&str>, robots: &Robots) -> Result<Self, FormatsError> {
        Self::open_all(&[path.into()], robot, robots)
    }

    /// As [`FlightReader::open`], of one recording in several files: bags and MCAP files of whatever times and topics.
    ///
    /// # Errors
    /// As [`FlightReader::open`]; [`FormatsError::BadOption`] for more than sixteen files and for what is no part of a recording.
    pub fn open_all(paths: &[PathBuf], robot: Option<&str>, robots: &Robots) -> Result<Self, FormatsError> {
        if let [path] = paths
            && container(path)? == Some(Container::Ulog)
        {
            return Self::open_ulog(path, robot);
        }
        let (topics, reports) = survey_all(paths)?;
        let plan = Plan::of(&topics, robot, robots, &named(paths)).map_err(|error| damaged(error, &reports))?;
        let (used, actuators, paths) = (plan.clone(), replay_of(&topics, &plan, robots), paths.to_vec());
        Ok(Self::reading(topics, plan, move |sender| stream(&paths, &used, actuators, sender)))
    }

    fn open_ulog(path: &Path, robot: Option<&str>) -> Result<Self, FormatsError> {
        let (survey, plan) = ulog_flight::open(path, robot)?;
        let (topics, path) = (survey.topics.clone(), PathBuf::from(path));
        Ok(Self::reading(topics, plan, move |sender| {
            let mut batches = Batches::new(sender);
            let tally = ulog_flight::read(&path, &survey, &[], false, &mut |sample| batches.take(&sample.motion))?;
            batches.finish();
            Ok(tally)
        }))
    }

    /// A scan hands out and a reader asks: a thread between them, a few batches ahead.
    fn reading(
        topics: Topics,
        plan: Plan,
        read: impl FnOnce(&SyncSender<Sent>) -> Result<Tally, FormatsError> + Send + 'static,
    ) -> Self {
        let (sender, receiver) = sync_channel(BATCHES);
        std::thread::spawn(move || {
            let end = read(&sender);
            // A reader that has gone wants no end.
            let _ = sender.send(Sent::End(Box::new(end)));
        });
        Self { topics, plan, receiver, batch: Vec::new().into_iter(), tally: None }
    }

    /// What its samples can hold besides the pose, as the types of its topics say.
    pub fn columns(&self) -> HeldColumns {
        let motion = self.topics.get(&self.plan.motion).map_or("", |topic| topic.type_name.as_str());
        if motion == ULOG_POSITION {
            return ulog_flight::columns(&self.topics);
        }
        let is_pose_only = motion == "geometry_msgs/PoseStamped";
        HeldColumns {
            velocity: !is_pose_only,
            rate: !is_pose_only,
            acceleration: !matches!(motion, "geometry_msgs/PoseStamped" | "nav_msgs/Odometry"),
            wrench: self.plan.wrench.is_some(),
        }
    }

    /// What would give a wrench, where none is recorded.
    pub fn lacks_wrench(&self) -> Option<String> {
        match &self.plan {
            plan if plan.motion == ULOG_POSITION => Some(ulog_flight::WRENCH_OF_COMMANDS.to_owned()),
            Plan { wrench: None, .. } => Some(format!("no wrench is recorded for this robot: {WRENCH_TOPICS}")),
            Plan { .. } => None,
        }
    }

    /// The next sample in time, `None` at the end.
    ///
    /// # Errors
    /// [`FormatsError::BadMessage`] for a definition that is not known, what the robot's replay of commands refuses, [`FormatsError::NoFlight`] for a wrench in a frame
    /// that is not the body's, and at the end where not one pose could be used; then [`FormatsError::Damaged`] if the file is.
    pub fn next_sample(&mut self) -> Result<Option<MotionSample>, FormatsError> {
        loop {
            if let Some(sample) = self.batch.next() {
                return Ok(Some(sample));
            }
            if self.tally.is_some() {
                return Ok(None);
            }
            match self.receiver.recv() {
                Ok(Sent::Samples(batch)) => self.batch = batch.into_iter(),
                Ok(Sent::End(end)) => self.tally = Some((*end)?),
                Err(_) => return Ok(None),
            }
        }
    }

    /// What a user should know about what has been read; empty before the end.
    pub fn warnings(&self) -> Vec<String> {
        self.tally().map_or_else(Vec::new, |tally| tally.warnings(&self.plan, &self.topics))
    }

    /// What happened on the way, once the end has been reached.
    pub fn tally(&self) -> Option<&Tally> {
        self.tally.as_ref()
    }
}

/// Samples on their way to the reader.
struct Batches<'s> {
    sender: &'s SyncSender<Sent>,
    batch: Vec<MotionSample>,
}

impl<'s> Batches<'s> {
    fn new(sender: &'s SyncSender<Sent>) -> Self {
        Self { sender, batch: Vec::with_capacity(BATCH) }
    }

    /// Breaks where nobody listens.
    fn take(&mut self, sample: &MotionSample) -> ControlFlow<()> {
        self.batch.push(*sample);
        if self.batch.len() < BATCH {
            return ControlFlow::Continue(());
        }
        let full = std::mem::replace(&mut self.batch, Vec::with_capacity(BATCH));
        if self.sender.send(Sent::Samples(full)).is_ok() { ControlFlow::Continue(()) } else { ControlFlow::Break(()) }
    }

    fn finish(self) {
        // A reader that has gone wants no rest.
        let _ = self.sender.send(Sent::Samples(self.batch));
    }
}

/// Reads, assembles and sends until the files end or nobody listens.
fn stream(
    paths: &[PathBuf],
    plan: &Plan,
    actuators: Option<Box<dyn ActuatorReplay>>,
    sender: &SyncSender<Sent>,
) -> Result<Tally, FormatsError> {
    let mut assembler = Assembler::new(plan, paths, actuators);
    let mut batches = Batches::new(sender);
    let mut failure = None;
    let reports = scan_files(paths, &|topic| plan.uses(topic), &mut |file, raw| match assembler.take(file, &raw) {
        Ok(Some(sample)) => batches.take(&sample),
        Ok(None) => ControlFlow::Continue(()),
        Err(error) => {
            failure = Some(error);
            ControlFlow::Break(())
        }
    })?;
    if let Some(error) = failure {
        return Err(error);
    }
    while let Some(sample) = assembler.finish()? {
        if batches.take(&sample).is_break() {
            break;
        }
    }
    batches.finish();
    let tally = assembler.tally;
    let reports: Vec<_> = paths.iter().cloned().zip(reports).collect();
    if tally.samples == 0 {
        let why: Vec<String> = tally.left_out().collect();
        let why = if why.is_empty() { "their encoding is not known".to_owned() } else { why.join("; ") };
        let reason = format!("no pose on {} that can be used: {why}", shortened(&plan.motion));
        return Err(damaged(FormatsError::NoFlight { path: named(paths), reason }, &reports));
    }
    Ok(Tally { reports, ..tally })
}

/// What the files are called in an error of them all.
fn named(paths: &[PathBuf]) -> PathBuf {
    let names: Vec<String> = paths.iter().map(|path| path.display().to_string()).collect();
    match paths {
        [only] => only.clone(),
        _ => names.join(" with ").into(),
    }
}
