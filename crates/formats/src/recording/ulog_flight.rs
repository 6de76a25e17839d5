//! From a ULog to the motion of the robot and what its actuators were told.
//!
//! Every `vehicle_local_position` gives a sample. Attitude, rate and acceleration come at other times: they are taken between the
//! messages before and behind it. A command holds until the next; a sample's is the mean of what was told from it to the next one.

use super::topics::{HeldColumns, Plan, Tally, Topics, ULOG_POSITION, count, damaged};
use super::ulog::{self, UlogMessage, UlogReport};
use crate::FormatsError;
use crate::log::{CommandedSample, NAMED_BY_THE_ACTUATORS, QUATERNION_NORM_TOLERANCE, seconds, shortened};
use std::collections::{BTreeMap, VecDeque};
use std::fs::File;
use std::ops::ControlFlow;
use std::path::Path;
use tumble_dynamics::nalgebra::{Isometry3, UnitQuaternion, Vector3};
use tumble_identification::MotionSample;
use tumble_identification::synchronize::{Held, TimeOrdering};

/// Body to world, scalar first.
const ATTITUDE: &str = "vehicle_attitude";
const RATE: &str = "vehicle_angular_velocity";
const ACCELERATION: &str = "vehicle_acceleration";
/// Arrays of commands, which become columns of their own.
const COMMANDS: [(&str, &str); 2] = [("actuator_motors", "control"), ("actuator_outputs", "output")];

/// What is said where a wrench is needed and nobody says what the commands give.
pub const WRENCH_OF_COMMANDS: &str = "a ULog holds commands and no wrench: `--actuators FILE` says what each gives \
    (vehicle_thrust_setpoint and vehicle_torque_setpoint are shares of a largest wrench that no log holds)";

/// Messages held back to put late ones in order: some four seconds of a robot that logs all at full rate.
const REORDER_MESSAGES: usize = 4096;
/// Nothing is taken between messages farther apart than this.
const LONGEST_GAP_NS: i64 = 250_000_000;
/// A measurement is published no later than this after it was made.
const LONGEST_DELAY_NS: i64 = 1_000_000_000;
/// Samples that wait for what lies behind them.
const MOST_PENDING: usize = 4096;
/// What PX4 calls one g, m/s^2.
const GRAVITY: f64 = 9.806_65;

/// What a ULog holds.
#[derive(Clone, Debug, PartialEq)]
pub struct UlogSurvey {
    /// By topic.
    pub topics: Topics,
    /// Columns of commands that were ever given: `actuator_motors.control[0]` and so on.
    pub commands: Vec<String>,
    /// Whether accelerometers felt the ground, so that gravity is in what they read.
    pub feels_gravity: bool,
    /// What the file lost, and what the logger.
    pub report: UlogReport,
}

impl UlogSurvey {
    /// What of it makes the flight.
    ///
    /// # Errors
    /// [`FormatsError::NoFlight`] without positions or without attitudes.
    pub fn plan(&self, path: &Path) -> Result<Plan, FormatsError> {
        if let Some(missing) = [ULOG_POSITION, ATTITUDE].into_iter().find(|topic| !self.topics.contains_key(*topic)) {
            let reason = format!("no {missing} is logged");
            return Err(FormatsError::NoFlight { path: path.into(), reason });
        }
        let parts = [(ATTITUDE, "attitude"), (RATE, "rate"), (ACCELERATION, "acceleration")];
        let commands = COMMANDS.map(|(topic, _)| (topic, "commands"));
        let beside = parts.into_iter().chain(commands).map(|(topic, part)| (topic.to_owned(), part));
        Ok(Plan { motion: ULOG_POSITION.to_owned(), beside: beside.collect(), ..Plan::default() })
    }
}

/// What a ULog holds and what of it makes the flight; `robot` is there to be refused.
///
/// # Errors
/// As [`survey`] and [`UlogSurvey::plan`], with what the file lost; [`FormatsError::BadOption`] for a robot.
pub fn open(path: &Path, robot: Option<&str>) -> Result<(UlogSurvey, Plan), FormatsError> {
    if robot.is_some() {
        let message = "`--robot` chooses among the robots of a bag or an MCAP file; a ULog is of one".to_owned();
        return Err(FormatsError::BadOption { message });
    }
    let survey = survey(path)?;
    let plan = survey.plan(path).map_err(|error| damaged(error, &[(path.into(), survey.report.scan.clone())]))?;
    Ok((survey, plan))
}

/// What its samples can hold besides the pose.
pub(super) fn columns(topics: &Topics) -> HeldColumns {
    HeldColumns {
        velocity: true,
        rate: topics.contains_key(RATE),
        acceleration: topics.contains_key(ACCELERATION),
        wrench: false,
    }
}

fn file(path: &Path) -> Result<File, FormatsError> {
    File::open(path).map_err(|source| FormatsError::Unreadable { path: path.into(), source })
}

/// Counts what a ULog holds.
///
/// # Errors
/// [`FormatsError`] for a file that is no ULog.
pub fn survey(path: &Path) -> Result<UlogSurvey, FormatsError> {
    let mut topics = Topics::new();
    let mut given: [Vec<bool>; COMMANDS.len()] = Default::default();
    let (mut felt, mut accelerations) = (0.0, 0.0_f64);
    let report = ulog::scan(file(path)?, &mut |message| {
        count(&mut topics, message.topic, message.name, message.time_ns);
        if message.topic == ACCELERATION
            && let Some(read) = vector(message, ["xyz[0]", "xyz[1]", "xyz[2]"]).filter(is_finite)
        {
            felt += read.norm();
            accelerations += 1.0;
        }
        for ((topic, field), given) in COMMANDS.iter().zip(&mut given) {
            if message.topic == *topic {
                // Outputs that no driver has say how many there are; motors that are not there are no numbers.
                let count = message.layout.elements(field).unwrap_or_default();
                let used = message.real("noutputs").unwrap_or(f64::INFINITY);
                given.resize(count.max(given.len()), false);
                for (index, given) in given.iter_mut().enumerate().take(count) {
                    let value = message.real(&format!("{field}[{index}]"));
                    *given |= (index as f64) < used && value.is_some_and(f64::is_finite);
                }
            }
        }
        ControlFlow::Continue(())
    })?;
    let columns = |((topic, field), given): (&(&str, &str), &Vec<bool>)| {
        let of = |(index, _)| format!("{topic}.{field}[{index}]");
        given.iter().enumerate().filter(|(_, given)| **given).map(of).collect::<Vec<_>>()
    };
    let commands = COMMANDS.iter().zip(&given).flat_map(columns).collect();
    Ok(UlogSurvey { topics, commands, feels_gravity: felt > 0.5 * GRAVITY * accelerations, report })
}

/// Hands the samples of a ULog on, in order of time, until `visit` breaks; gives what a user should know about it.
///
/// World axes are PX4's north, east, down, body axes its front, right, down. `columns` name fields whose values are commands, such as
/// `actuator_motors.control[0]`; what is no number is a motor that is off. With `bounded` they must lie between 0 and 1.
///
/// # Errors
/// [`FormatsError::NoFlight`] where not one pose can be used or a command is out of bounds, [`FormatsError::MissingColumn`] for a
/// command that is nowhere.
pub fn read(
    path: &Path,
    survey: &UlogSurvey,
    columns: &[String],
    bounded: bool,
    visit: &mut dyn FnMut(CommandedSample) -> ControlFlow<()>,
) -> Result<Tally, FormatsError> {
    let missing = |column: &String| FormatsError::MissingColumn {
        path: path.into(),
        column: shortened(column),
        because: NAMED_BY_THE_ACTUATORS,
    };
    let mut by_topic: BTreeMap<&str, Vec<(usize, &str)>> = BTreeMap::new();
    for (place, column) in columns.iter().enumerate() {
        let (topic, field) = column.split_once('.').ok_or_else(|| missing(column))?;
        by_topic.entry(topic).or_default().push((place, field));
    }
    let mut seen = vec![false; columns.len()];
    let mut assembler = Assembler::new(survey, columns.len());
    let mut out_of_bounds = None;
    let report = ulog::scan(file(path)?, &mut |message| {
        for (place, field) in by_topic.get(message.topic).into_iter().flatten() {
            let Some(value) = message.real(field) else { continue };
            if let Some(seen) = seen.get_mut(*place) {
                *seen = true;
            }
            let command = if value.is_nan() { 0.0 } else { value };
            if bounded && !(0.0..=1.0).contains(&command) {
                out_of_bounds = columns.get(*place).map(|column| (column, command, message.time_ns));
                return ControlFlow::Break(());
            }
            if !command.is_finite() {
                assembler.tally.undecoded += 1;
                continue;
            }
            if assembler.push(message.time_ns, Event::Command(*place, command), visit).is_break() {
                return ControlFlow::Break(());
            }
        }
        match assembler.event(message) {
            Some((time_ns, event)) => assembler.push(time_ns, event, visit),
            None => ControlFlow::Continue(()),
        }
    })?;
    if let Some((column, command, time_ns)) = out_of_bounds {
        let reason = format!(
            "`{}` is {command} at {:.3} s; a command lies between 0 and 1",
            shortened(column),
            seconds(time_ns)
        );
        return Err(FormatsError::NoFlight { path: path.into(), reason });
    }
    if !assembler.stopped {
        if let Some((_, column)) = seen.iter().zip(columns).find(|(seen, _)| !**seen) {
            return Err(missing(column));
        }
        assembler.finish(visit);
    }
    assembler.tally(path, report)
}

fn vector(message: &UlogMessage<'_>, fields: [&str; 3]) -> Option<Vector3<f64>> {
    let [x, y, z] = fields.map(|field| message.real(field));
    Some(Vector3::new(x?, y?, z?))
}

fn is_finite(v: &Vector3<f64>) -> bool {
    v.iter().all(|x| x.is_finite())
}

/// A message in its place in time.
#[derive(Clone, Copy)]
enum Event {
    /// Of the origin, and its velocity, where they are said to be valid.
    Position(Option<Vector3<f64>>, Option<Vector3<f64>>),
    Attitude(UnitQuaternion<f64>),
    Rate(Vector3<f64>),
    Acceleration(Vector3<f64>),
    /// Which column, and its value.
    Command(usize, f64),
}

/// A stream at the time of a sample.
#[derive(Clone, Copy)]
enum Between<T> {
    /// For the message behind; the one before, where there is one.
    Waits(Option<(i64, T)>),
    Known(Option<T>),
}

impl<T: Copy> Between<T> {
    /// At a time at which the newest message is `last`.
    fn at(time_ns: i64, last: Option<(i64, T)>, is_logged: bool) -> Self {
        match last {
            _ if !is_logged => Self::Known(None),
            Some((at, value)) if at == time_ns => Self::Known(Some(value)),
            last => Self::Waits(last.filter(|(at, _)| time_ns.saturating_sub(*at) <= LONGEST_GAP_NS)),
        }
    }

    /// Takes the message behind `time_ns`; `false` where nothing waited for it.
    fn take(&mut self, time_ns: i64, behind: (i64, T), mix: impl Fn(&T, &T, f64) -> T) -> bool {
        let Self::Waits(before) = self else { return false };
        let (at, value) = behind;
        let known = match before {
            _ if at == time_ns => Some(value),
            Some((from, earlier)) if at.saturating_sub(*from) <= LONGEST_GAP_NS => {
                Some(mix(earlier, &value, seconds(time_ns - *from) / seconds(at - *from)))
            }
            _ => None,
        };
        *self = Self::Known(known);
        true
    }

    fn known(&self) -> Option<T> {
        match self {
            Self::Known(known) => *known,
            Self::Waits(_) => None,
        }
    }

    fn is_known(&self) -> bool {
        matches!(self, Self::Known(_))
    }
}

/// A sample that is being put together.
struct Pending {
    time_ns: i64,
    position: Option<Vector3<f64>>,
    velocity: Option<Vector3<f64>>,
    attitude: Between<UnitQuaternion<f64>>,
    rate: Between<Vector3<f64>>,
    acceleration: Between<Vector3<f64>>,
    /// Once the next sample has come.
    commands: Option<Vec<Option<f64>>>,
}

/// What one actuator is told.
#[derive(Clone, Copy, Default)]
struct Told {
    value: Option<f64>,
    /// Its integral since the last sample, and how long of that it was told anything.
    integral: f64,
    covered_ns: i64,
}

struct Assembler<'s> {
    survey: &'s UlogSurvey,
    ordering: TimeOrdering<Event, Vec<Option<Held<Event>>>>,
    pending: VecDeque<Pending>,
    told: Vec<Told>,
    told_until_ns: i64,
    attitude: Option<(i64, UnitQuaternion<f64>)>,
    rate: Option<(i64, Vector3<f64>)>,
    acceleration: Option<(i64, Vector3<f64>)>,
    /// How often positions, velocities and attitude were reset so far, as they count themselves.
    resets: BTreeMap<&'static str, f64>,
    tally: Tally,
    jumps: usize,
    without_attitude: usize,
    without_command: usize,
    poses: usize,
    stopped: bool,
}

type Visit<'v> = dyn FnMut(CommandedSample) -> ControlFlow<()> + 'v;

impl<'s> Assembler<'s> {
    fn new(survey: &'s UlogSurvey, commands: usize) -> Self {
        Self {
            survey,
            ordering: TimeOrdering::new(std::iter::repeat_with(|| None).take(REORDER_MESSAGES).collect()),
            pending: VecDeque::new(),
            told: vec![Told::default(); commands],
            told_until_ns: 0,
            attitude: None,
            rate: None,
            acceleration: None,
            resets: BTreeMap::new(),
            tally: Tally::default(),
            jumps: 0,
            without_attitude: 0,
            without_command: 0,
            poses: 0,
            stopped: false,
        }
    }

    /// What a message says of the motion, and when.
    fn event(&mut self, message: &UlogMessage<'_>) -> Option<(i64, Event)> {
        let event = match message.topic {
            ULOG_POSITION => {
                let says = |field: &str| message.real(field).is_none_or(|flag| flag != 0.0);
                let (is_valid, moves_valid) =
                    (says("xy_valid") && says("z_valid"), says("v_xy_valid") && says("v_z_valid"));
                let position = vector(message, ["x", "y", "z"]).filter(is_finite);
                self.tally.impossible += usize::from(position.is_none());
                self.tally.invalid += usize::from(position.is_some() && !is_valid);
                for field in ["xy_reset_counter", "z_reset_counter", "vxy_reset_counter", "vz_reset_counter"] {
                    self.count_resets(field, message);
                }
                let velocity = vector(message, ["vx", "vy", "vz"]).filter(is_finite);
                Event::Position(position.filter(|_| is_valid), velocity.filter(|_| moves_valid))
            }
            ATTITUDE => {
                self.count_resets("quat_reset_counter", message);
                let [w, x, y, z] = ["q[0]", "q[1]", "q[2]", "q[3]"].map(|field| message.real(field));
                let turn = tumble_lie::from_xyzw(x?, y?, z?, w?, QUATERNION_NORM_TOLERANCE);
                self.tally.impossible += usize::from(turn.is_err());
                Event::Attitude(turn.ok()?)
            }
            RATE => Event::Rate(vector(message, ["xyz[0]", "xyz[1]", "xyz[2]"]).filter(is_finite)?),
            ACCELERATION => Event::Acceleration(vector(message, ["xyz[0]", "xyz[1]", "xyz[2]"]).filter(is_finite)?),
            _ => return None,
        };
        // When it was measured, where that is told.
        let published_ns = message.time_ns;
        let measured_ns = match message.number("timestamp_sample") {
            Some(ulog::Number::Unsigned(us)) => i64::try_from(us).ok().and_then(|us| us.checked_mul(1000)),
            _ => None,
        };
        let is_likely = |at: &i64| *at <= published_ns && published_ns - *at <= LONGEST_DELAY_NS;
        Some((measured_ns.filter(is_likely).unwrap_or(published_ns), event))
    }

    fn count_resets(&mut self, field: &'static str, message: &UlogMessage<'_>) {
        if let Some(count) = message.real(field)
            && self.resets.insert(field, count).is_some_and(|before| before.to_bits() != count.to_bits())
        {
            self.jumps += 1;
        }
    }

    fn push(&mut self, time_ns: i64, event: Event, visit: &mut Visit<'_>) -> ControlFlow<()> {
        match self.ordering.push(time_ns, event) {
            Some(released) if released.in_order => self.advance(released.time_ns, released.sample, visit),
            Some(_) => {
                self.tally.too_late += 1;
                ControlFlow::Continue(())
            }
            None => ControlFlow::Continue(()),
        }
    }

    /// Goes on to an event, in order of time.
    fn advance(&mut self, time_ns: i64, event: Event, visit: &mut Visit<'_>) -> ControlFlow<()> {
        let linear = |a: &Vector3<f64>, b: &Vector3<f64>, share: f64| a.lerp(b, share);
        // What waits is behind what is known: the newest come last.
        match event {
            Event::Position(position, velocity) => self.begin(time_ns, position, velocity),
            Event::Attitude(turn) => {
                let turned = |a: &UnitQuaternion<f64>, b: &UnitQuaternion<f64>, share: f64| {
                    a.try_slerp(b, share, 1e-9).unwrap_or(*b)
                };
                let behind = (time_ns, turn);
                let _ = self.pending.iter_mut().rev().all(|p| p.attitude.take(p.time_ns, behind, turned));
                self.attitude = Some(behind);
            }
            Event::Rate(rate) => {
                let behind = (time_ns, rate);
                let _ = self.pending.iter_mut().rev().all(|p| p.rate.take(p.time_ns, behind, linear));
                self.rate = Some(behind);
            }
            Event::Acceleration(read) => {
                let behind = (time_ns, read);
                let _ = self.pending.iter_mut().rev().all(|p| p.acceleration.take(p.time_ns, behind, linear));
                self.acceleration = Some(behind);
            }
            Event::Command(place, command) => {
                self.add_up(time_ns);
                if let Some(told) = self.told.get_mut(place) {
                    told.value = Some(command);
                }
            }
        }
        while let Some(first) = self.pending.front() {
            let waited = time_ns.saturating_sub(first.time_ns) > LONGEST_GAP_NS || self.pending.len() > MOST_PENDING;
            let is_known = first.attitude.is_known() && first.rate.is_known() && first.acceleration.is_known();
            if first.commands.is_none() || !(is_known || waited) {
                break;
            }
            self.hand_out(visit)?;
        }
        ControlFlow::Continue(())
    }

    fn begin(&mut self, time_ns: i64, position: Option<Vector3<f64>>, velocity: Option<Vector3<f64>>) {
        self.add_up(time_ns);
        if let Some(last) = self.pending.back_mut().filter(|last| last.commands.is_none()) {
            if last.time_ns == time_ns {
                self.tally.repeated += 1;
                return;
            }
            let interval_ns = time_ns - last.time_ns;
            let mean = |told: &Told| (told.covered_ns == interval_ns).then(|| told.integral / seconds(interval_ns));
            let commands: Vec<_> = self.told.iter().map(mean).collect();
            self.without_command += usize::from(commands.iter().any(Option::is_none));
            last.commands = Some(commands);
        }
        for told in &mut self.told {
            *told = Told { value: told.value, ..Told::default() };
        }
        let held = columns(&self.survey.topics);
        self.pending.push_back(Pending {
            time_ns,
            position,
            velocity,
            attitude: Between::at(time_ns, self.attitude, true),
            rate: Between::at(time_ns, self.rate, held.rate),
            acceleration: Between::at(time_ns, self.acceleration, held.acceleration),
            commands: None,
        });
    }

    /// Adds what is told to the integrals, up to a time.
    fn add_up(&mut self, time_ns: i64) {
        let step_ns = time_ns - self.told_until_ns;
        for told in &mut self.told {
            if let Some(value) = told.value {
                told.integral += value * seconds(step_ns);
                told.covered_ns += step_ns;
            }
        }
        self.told_until_ns = time_ns;
    }

    fn hand_out(&mut self, visit: &mut Visit<'_>) -> ControlFlow<()> {
        let Some(first) = self.pending.pop_front() else { return ControlFlow::Continue(()) };
        let turn = first.attitude.known();
        self.without_attitude += usize::from(turn.is_none() && first.position.is_some());
        let felt = if self.survey.feels_gravity { GRAVITY } else { 0.0 };
        let world_from_body = first.position.zip(turn).map(|(at, turn)| Isometry3::from_parts(at.into(), turn));
        let motion = MotionSample {
            time_ns: first.time_ns,
            world_from_body,
            velocity_origin_world: first.velocity,
            rate_body: first.rate.known(),
            acceleration_origin_body: first
                .acceleration
                .known()
                .zip(turn)
                .map(|(read, turn)| read + turn.inverse() * Vector3::new(0.0, 0.0, felt)),
            ..MotionSample::default()
        };
        self.poses += usize::from(world_from_body.is_some());
        self.tally.samples += 1;
        let flow = visit(CommandedSample { motion, commands: first.commands.unwrap_or_default() });
        self.stopped = flow.is_break();
        flow
    }

    /// The samples behind the last message.
    fn finish(&mut self, visit: &mut Visit<'_>) {
        while let Some(released) = self.ordering.flush() {
            if self.advance(released.time_ns, released.sample, visit).is_break() {
                return;
            }
        }
        // What was told at the beginning of the last sample's interval, which has no end.
        let told: Vec<_> = self.told.iter().map(|told| told.value).collect();
        if let Some(last) = self.pending.back_mut() {
            last.commands.get_or_insert(told);
        }
        while !self.pending.is_empty() && self.hand_out(visit).is_continue() {}
    }

    fn tally(mut self, path: &Path, report: UlogReport) -> Result<Tally, FormatsError> {
        let mut tally = std::mem::take(&mut self.tally);
        if self.poses == 0 && !self.stopped {
            let why = match (self.without_attitude, tally.invalid) {
                (0, 0) => "none is finite".to_owned(),
                (0, invalid) => format!("{invalid} say of themselves that they are not valid"),
                (without, _) => format!("{without} have no {ATTITUDE} beside them"),
            };
            let error =
                FormatsError::NoFlight { path: path.into(), reason: format!("no {ULOG_POSITION} can be used: {why}") };
            return Err(damaged(error, &[(path.into(), report.scan)]));
        }
        tally.notes = self.notes_of(&report);
        tally.reports = vec![(path.into(), report.scan)];
        Ok(tally)
    }
}

impl Assembler<'_> {
    fn notes_of(&self, report: &UlogReport) -> Vec<String> {
        let mut notes = Vec::new();
        let counts = [
            (self.without_attitude, "positions have no attitude within 0.25 s and make no pose"),
            (self.jumps, "times the estimator reset itself (its reset counters): there the pose or the velocity jumps"),
            (self.without_command, "samples have an actuator without a command; it is taken to do what it did before"),
        ];
        notes.extend(counts.iter().filter(|(n, _)| *n > 0).map(|(n, what)| format!("{n} {what}")));
        if report.dropouts > 0 {
            let lost_s = std::time::Duration::from_millis(report.dropout_ms).as_secs_f64();
            notes.push(format!("the logger dropped out {} times, {lost_s:.3} s in all", report.dropouts));
        }
        if self.survey.feels_gravity && self.survey.topics.contains_key(ACCELERATION) {
            notes.push(format!(
                "gravity is in {ACCELERATION}: {GRAVITY} m/s^2 downward are added to it; a body that no table holds needs `--gravity 0,0,9.80665`"
            ));
        }
        notes
    }
}
