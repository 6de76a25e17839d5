//! What a recording holds, what of it makes the flight of one robot, and what happened on the way.

use super::mcap_log::{MEASURED_POSE, MEASURED_WRENCH};
use super::{ScanReport, merged, messages, scan_file};
use crate::FormatsError;
use crate::Robots;
use crate::log::{seconds, shortened};
use std::collections::BTreeMap;
use std::fmt::Write as _;
use std::ops::ControlFlow;
use std::path::{Path, PathBuf};

/// Topics listed in a table.
const MOST_TOPICS_SHOWN: usize = 40;

/// The time base of a ULog.
pub const ULOG_POSITION: &str = "vehicle_local_position";
/// What gives a wrench.
pub const WRENCH_TOPICS: &str = "of an Astrobee (ff_msgs/EkfState) ff_hw_msgs/PmcCommand on hw/pmc/command or ff_msgs/FamCommand on \
                                        gnc/ctl/command is needed, of others geometry_msgs/WrenchStamped";

/// One topic of a recording.
#[derive(Clone, Debug, PartialEq)]
pub struct Topic {
    /// `package/Name`.
    pub type_name: String,
    /// Messages on it.
    pub messages: u64,
    /// Earliest and latest time of recording, ns.
    pub times_ns: (i64, i64),
}

/// What a recording holds, by topic.
pub type Topics = BTreeMap<String, Topic>;

/// What makes the flight: topics by the part they play.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Plan {
    /// Poses: the time base.
    pub motion: String,
    /// Bytes to the nozzles, else a commanded or measured wrench.
    pub wrench: Option<String>,
    /// Impeller speeds.
    pub telemetry: Option<String>,
    /// The centre of mass about which a commanded torque is meant.
    pub inertia: Option<String>,
    /// Further topics of a ULog, and the part that each plays.
    pub beside: Vec<(String, &'static str)>,
}

impl Plan {
    pub(super) fn part(&self, topic: &str) -> Option<&'static str> {
        let is = |part: &Option<String>| part.as_deref() == Some(topic);
        if topic == self.motion {
            Some("motion")
        } else if is(&self.wrench) {
            Some("wrench")
        } else if is(&self.telemetry) {
            Some("impeller speed")
        } else if is(&self.inertia) {
            Some("centre of mass")
        } else {
            self.beside.iter().find(|(name, _)| name == topic).map(|(_, part)| *part)
        }
    }

    /// Whether a message of this topic is used.
    pub(super) fn uses(&self, topic: &str) -> bool {
        self.motion == MEASURED_POSE || self.part(topic).is_some()
    }

    /// Chooses the streams of one robot.
    ///
    /// # Errors
    /// [`FormatsError::NoFlight`] where nothing moves, or several robots do and none is named.
    pub fn of(topics: &Topics, robot: Option<&str>, robots: &Robots, path: &Path) -> Result<Self, FormatsError> {
        // A log of ours holds one robot.
        let is = |topic: &str, type_name: &str| topics.get(topic).is_some_and(|found| found.type_name == type_name);
        if is(MEASURED_POSE, "foxglove.PoseInFrame") {
            let wrench = is(MEASURED_WRENCH, "tumble.Wrench").then(|| MEASURED_WRENCH.to_owned());
            return Ok(Self { motion: MEASURED_POSE.to_owned(), wrench, ..Self::default() });
        }
        let robot = robot.map(|name| name.trim_matches('/'));
        let named = |topic: &str| robot.is_none_or(|robot| namespace(topic) == robot);
        let of_type = |type_name: &str| -> Vec<&String> {
            topics
                .iter()
                .filter(|(topic, t)| t.type_name == type_name && named(topic))
                .map(|(topic, _)| topic)
                .collect()
        };
        let nothing = |reason: String| FormatsError::NoFlight { path: path.into(), reason };
        let motions = ["ff_msgs/EkfState", "nav_msgs/Odometry", "geometry_msgs/PoseStamped"].into_iter().map(of_type);
        let Some(motions) = motions.into_iter().find(|found| !found.is_empty()) else {
            let whose = robot.map_or(String::new(), |robot| format!(" of a robot `{}`", shortened(robot)));
            return Err(nothing(format!(
                "no topic{whose} of type ff_msgs/EkfState, nav_msgs/Odometry or geometry_msgs/PoseStamped"
            )));
        };
        let motion = match motions.as_slice() {
            [only] => (*only).clone(),
            several => {
                let names: Vec<String> =
                    several.iter().map(|t| format!("{} ({})", shortened(t), namespace(t))).collect();
                return Err(nothing(format!(
                    "several motions: {}; `--robot NAMESPACE` (in brackets) chooses one",
                    names.join(", ")
                )));
            }
        };
        let own = namespace(&motion);
        let one = |type_name: &str| -> Result<Option<String>, FormatsError> {
            let found = of_type(type_name);
            // The robot's own, else the only one.
            let own_ones: Vec<&&String> = found.iter().filter(|topic| namespace(topic) == own).collect();
            match (own_ones.as_slice(), found.as_slice()) {
                ([topic], _) => Ok(Some((**topic).clone())),
                ([], []) => Ok(None),
                ([], [topic]) => Ok(Some((*topic).clone())),
                _ => Err(nothing(format!("several topics of type {type_name}; `--robot NAMESPACE` chooses one"))),
            }
        };
        let is_astrobee = topics.get(&motion).is_some_and(|topic| topic.type_name == "ff_msgs/EkfState");
        if !is_astrobee {
            // What its own actuators were told, else a wrench, else the only commands that there are.
            let is_own = |topic: &&String| namespace(topic) == own;
            let told =
                robots.replays().find_map(|replay| of_type(replay.command_type()).into_iter().find(is_own).cloned());
            let mut wrench = told.map_or_else(|| one("geometry_msgs/WrenchStamped"), |commands| Ok(Some(commands)))?;
            for replay in robots.replays() {
                wrench = wrench.map_or_else(|| one(replay.command_type()), |found| Ok(Some(found)))?;
            }
            return Ok(Self { motion, wrench, ..Self::default() });
        }
        // Astrobee's other streams are those of the same robot.
        let beside = |type_name: &str, relative: &str| {
            let stands = |topic: &&String| {
                topic.trim_start_matches('/').strip_suffix(relative).map(|own| own.trim_end_matches('/')) == Some(own)
            };
            of_type(type_name).into_iter().find(stands).cloned()
        };
        let bytes = beside("ff_hw_msgs/PmcCommand", "hw/pmc/command");
        let telemetry = bytes.as_ref().and_then(|_| beside("ff_hw_msgs/PmcTelemetry", "hw/pmc/telemetry"));
        // Bytes give the wrench about the origin; a commanded one needs the centre of mass.
        let inertia = if bytes.is_some() { None } else { beside("geometry_msgs/InertiaStamped", "mob/inertia") };
        let wrench = bytes.or_else(|| beside("ff_msgs/FamCommand", "gnc/ctl/command"));
        Ok(Self { motion, wrench, telemetry, inertia, beside: Vec::new() })
    }
}

/// The robot of a topic: what stands before the names that Astrobee gives, or before the last part; empty for a lone robot.
fn namespace(topic: &str) -> &str {
    let topic = topic.trim_start_matches('/');
    let relative = [
        "gnc/ekf",
        "gnc/ctl/command",
        "hw/pmc/command",
        "hw/pmc/telemetry",
        "mob/inertia",
        "loc/pose",
        "loc/truth/pose",
    ];
    let before = |name: &str| topic.strip_suffix(name).filter(|rest| rest.is_empty() || rest.ends_with('/'));
    let rest = relative.into_iter().find_map(before).or_else(|| topic.rsplit_once('/').map(|(rest, _)| rest));
    rest.unwrap_or_default().trim_end_matches('/')
}

/// Counts what a recording holds.
///
/// # Errors
/// [`FormatsError`] for a file that is no recording.
pub fn survey(path: &Path) -> Result<(Topics, ScanReport), FormatsError> {
    let mut topics = Topics::new();
    let report = scan_file(path, &mut |raw| {
        count(&mut topics, raw.topic, raw.type_name, raw.log_time_ns);
        ControlFlow::Continue(())
    })?;
    Ok((topics, report))
}

/// Counts one message of a topic.
pub(super) fn count(topics: &mut Topics, name: &str, type_name: &str, time_ns: i64) {
    if let Some(topic) = topics.get_mut(name) {
        topic.messages += 1;
        topic.times_ns = (topic.times_ns.0.min(time_ns), topic.times_ns.1.max(time_ns));
    } else {
        let topic = Topic { type_name: type_name.to_owned(), messages: 1, times_ns: (time_ns, time_ns) };
        topics.insert(name.to_owned(), topic);
    }
}

/// What several files hold together, and what each lost.
pub(super) fn survey_all(paths: &[PathBuf]) -> Result<(Topics, Vec<(PathBuf, ScanReport)>), FormatsError> {
    merged::check(paths)?;
    let mut all = Topics::new();
    let mut reports = Vec::new();
    for path in paths {
        let (topics, report) = survey(path)?;
        for (name, topic) in topics {
            match all.get_mut(&name) {
                Some(known) if known.type_name != topic.type_name => {
                    let reason = format!(
                        "{} is of type {} here and {} in a file before",
                        shortened(&name),
                        shortened(&topic.type_name),
                        shortened(&known.type_name)
                    );
                    return Err(FormatsError::NoFlight { path: path.clone(), reason });
                }
                Some(known) => {
                    known.messages += topic.messages;
                    known.times_ns.0 = known.times_ns.0.min(topic.times_ns.0);
                    known.times_ns.1 = known.times_ns.1.max(topic.times_ns.1);
                }
                None => {
                    all.insert(name, topic);
                }
            }
        }
        reports.push((path.clone(), report));
    }
    Ok((all, reports))
}

/// What was found and what part it plays, for people.
pub fn table(topics: &Topics, plan: &Plan) -> String {
    let mut text = String::new();
    let known = |topic: &Topic| is_listed(&topic.type_name);
    let mut order: Vec<(&String, &Topic)> = topics.iter().collect();
    order.sort_by_key(|(name, topic)| (plan.part(name).is_none(), !known(topic)));
    for (name, topic) in order.iter().take(MOST_TOPICS_SHOWN) {
        let span_s = seconds(topic.times_ns.1.saturating_sub(topic.times_ns.0));
        let rate = if span_s > 0.0 { (topic.messages - 1) as f64 / span_s } else { 0.0 };
        let part = plan.part(name).unwrap_or("-");
        let (name, type_name) = (shortened(name), shortened(&topic.type_name));
        let _ = writeln!(text, "{name:<32} {type_name:<28} {:>9} messages {rate:>7.1} Hz  {part}", topic.messages);
    }
    if order.len() > MOST_TOPICS_SHOWN {
        let _ = writeln!(text, "and {} topics more", order.len() - MOST_TOPICS_SHOWN);
    }
    text
}

/// What happened on the way from messages to samples.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Tally {
    /// Poses that came after one of a later stamp and were put in order.
    pub late: usize,
    /// Messages too late for that, left out.
    pub too_late: usize,
    /// Poses with the stamp of the one before, left out.
    pub repeated: usize,
    /// Poses said to be lost or invalid, left out.
    pub invalid: usize,
    /// Poses that are not finite or not of unit norm, left out.
    pub impossible: usize,
    /// Payloads that do not hold their fields, left out.
    pub undecoded: usize,
    /// Messages without a stamp, taken at the time of recording.
    pub unstamped: usize,
    /// Samples whose interval no command covers.
    pub without_wrench: usize,
    /// Commands for another number of modules than two, left out.
    pub other_modules: usize,
    /// Whether impeller speeds were measured, not taken from the command.
    pub measured_speed: bool,
    /// Messages that two files hold, taken once.
    pub doubled: usize,
    /// Samples handed out.
    pub samples: usize,
    /// What only a ULog has to say.
    pub notes: Vec<String>,
    /// What each file itself lost.
    pub reports: Vec<(PathBuf, ScanReport)>,
}

impl Tally {
    /// What a user should know, one sentence each.
    pub fn warnings(&self, plan: &Plan, topics: &Topics) -> Vec<String> {
        let mut said = Vec::new();
        said.extend(self.left_out());
        let counts = [
            (self.late, "poses came late and were put in order"),
            (self.unstamped, "messages have no stamp and were taken at the time of recording"),
            (self.other_modules, "commands are not for two modules and were left out"),
            (self.doubled, "messages stand in two files and were taken once"),
        ];
        said.extend(counts.iter().filter(|(n, _)| *n > 0).map(|(n, what)| format!("{n} {what}")));
        let type_of = |topic: &Option<String>| {
            topic.as_ref().and_then(|topic| topics.get(topic)).map_or("", |topic| topic.type_name.as_str())
        };
        if plan.motion == ULOG_POSITION {
            said.extend(self.notes.iter().cloned());
        } else if plan.wrench.is_none() {
            said.push(format!("no wrench is recorded for this robot: {WRENCH_TOPICS}"));
        } else if self.without_wrench > 0 {
            said.push(format!("{} samples have no command of their interval, and no wrench", self.without_wrench));
        }
        match type_of(&plan.wrench) {
            "ff_hw_msgs/PmcCommand" if !self.measured_speed => {
                said.push("no impeller speed is measured: it is taken from the command".to_owned());
            }
            "ff_msgs/FamCommand" => {
                let about = if plan.inertia.is_some() {
                    "the centre of mass that the robot reports"
                } else {
                    "the body origin, for want of mob/inertia"
                };
                said.push(format!(
                    "the wrench is the commanded one, about {about}: what saturation takes away is not seen"
                ));
            }
            _ => {}
        }
        let several = self.reports.len() > 1;
        said.extend(self.reports.iter().filter_map(|(path, report)| {
            let said = report.summary()?;
            Some(if several { format!("{}: {said}", path.display()) } else { said })
        }));
        said
    }

    /// Messages left out, and why.
    pub(super) fn left_out(&self) -> impl Iterator<Item = String> {
        let counts = [
            (self.too_late, "messages came too late to be put in order and were left out"),
            (self.repeated, "poses repeated a time and were dropped"),
            (self.invalid, "poses are marked lost or invalid and were left out"),
            (self.impossible, "poses are not finite or not of unit norm and were left out"),
            (self.undecoded, "messages do not hold their fields and were left out"),
        ];
        counts.into_iter().filter(|(n, _)| *n > 0).map(|(n, what)| format!("{n} {what}"))
    }
}

/// Whether [`messages::decode`] knows the type.
pub(super) fn is_listed(type_name: &str) -> bool {
    messages::KNOWN.iter().any(|(name, _)| *name == type_name)
}

/// What the samples of a flight can hold besides the pose.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[allow(clippy::struct_excessive_bools)]
pub struct HeldColumns {
    /// Velocity of the body origin.
    pub velocity: bool,
    /// Angular rate.
    pub rate: bool,
    /// Acceleration of the body origin.
    pub acceleration: bool,
    /// A wrench.
    pub wrench: bool,
}

/// That there is no flight, with what the first damaged file lost.
pub(super) fn damaged(error: FormatsError, reports: &[(PathBuf, ScanReport)]) -> FormatsError {
    match (error, reports.iter().find(|(_, report)| report.loss_count > 0)) {
        (FormatsError::NoFlight { reason, .. }, Some((path, report))) => {
            FormatsError::Damaged { path: path.clone(), reason, report: Box::new(report.clone()) }
        }
        (error, _) => error,
    }
}
