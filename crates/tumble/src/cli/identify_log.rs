//! The log that is identified: rows in memory, or read again part by part.

use super::identify_options::ADDED_METHODS;
use super::identify_options::{AUTO, DEMO_SEED, IdentifyArgs};
use super::own_estimator::OwnEstimator;
use crate::{TumbleError, demo};
use std::io::IsTerminal as _;
use std::ops::ControlFlow;
use std::path::{Path, PathBuf};
use tumble_dynamics::InertialParameters;
use tumble_formats::actuator_file::{self, ActuatorFile};
use tumble_formats::environment_file;
use tumble_formats::log::{CommandedReader, CommandedSample, seconds};
use tumble_formats::recording::{Container, ulog_flight};
use tumble_formats::{FormatsError, Robots, SampleReader, body_file, recording};
use tumble_identification::sensing::{self, Sensing};
use tumble_identification::{
    FlightLikelihood, Identification, IdentificationError, LongRecord, MAXIMUM_LIKELIHOOD, MotionSample, Parts,
    Pipeline, Plane, Settings, Validation, merge,
};

/// Methods that know of no table.
const OF_FREE_BODIES: [&str; 9] = [
    "newton-euler",
    "variational",
    "variational4",
    "variational6",
    MAXIMUM_LIKELIHOOD,
    "rls",
    "recursive-sdp",
    "ekf",
    "ukf",
];
/// Rows held in memory at once; a longer log is identified part by part and the parts' information added.
pub(super) const ROWS_IN_MEMORY: usize = 200_000;
/// Where rows come from that are in no file.
const IN_MEMORY: &str = "rows in memory";
/// Residuals kept for the plots from each part of a long log.
const RESIDUALS_PER_PART: usize = 1000;

/// A log or the demo, with what the report says about it.
pub(super) struct Log {
    pub(super) source: String,
    pub(super) rows: Rows,
    /// Rows before the held-out part.
    pub(super) estimation_rows: usize,
    pub(super) reference: Option<(String, InertialParameters<f64>)>,
    pub(super) warnings: Vec<String>,
    pub(super) duration_s: f64,
    /// What its commands drive, where they make the wrench.
    pub(super) actuators: Option<ActuatorFile>,
    /// Whether more acts than it says.
    is_in_environment: bool,
    /// What identifies it, told of the sensors, of the plane and of what else acts.
    pipeline: Pipeline,
}

/// Where the samples are.
pub(super) enum Rows {
    /// All of them, in memory.
    Memory(Vec<MotionSample>),
    /// Too many for the memory: checked once, read again when needed.
    File { paths: Vec<PathBuf>, reorder: bool, robot: Option<String>, robots: Robots, count: usize },
}

impl Log {
    pub(super) fn read(args: &IdentifyArgs, robots: &Robots) -> Result<Self, TumbleError> {
        let log =
            if args.demo { Self::from_demo(args.seed.unwrap_or(DEMO_SEED))? } else { Self::from_file(args, robots)? };
        Ok(log.without_held_out(args))
    }

    /// Of rows that are in memory already.
    pub(super) fn of_record(
        args: &IdentifyArgs,
        record: Vec<MotionSample>,
        robots: &Robots,
    ) -> Result<Self, TumbleError> {
        if args.actuators.is_some() {
            let message = "`--actuators` names columns of a CSV log: rows in memory hold no commands".to_owned();
            return Err(TumbleError::BadOption { message });
        }
        let (Some(first), Some(last)) = (record.first(), record.last()) else {
            return Err(FormatsError::Empty { path: IN_MEMORY.into(), what: "data rows" }.into());
        };
        let duration_s = seconds(last.time_ns.saturating_sub(first.time_ns));
        let told = told(args, robots, false)?;
        let warnings = contradictions(args, &told, &record);
        let log = Self {
            source: IN_MEMORY.to_owned(),
            rows: Rows::Memory(record),
            estimation_rows: 0,
            reference: reference(args)?,
            warnings,
            duration_s,
            actuators: None,
            is_in_environment: args.environment.is_some(),
            pipeline: pipeline(args)?.flown_with(told),
        };
        Ok(log.without_held_out(args))
    }

    /// Lets an estimator from outside answer where its name is asked for.
    pub(super) fn take(&mut self, own: OwnEstimator) {
        let pipeline = std::mem::take(&mut self.pipeline);
        self.pipeline = pipeline.with(own.name, "an estimator from outside", own.make);
    }

    /// The same with the last part kept back that the options ask for.
    fn without_held_out(mut self, args: &IdentifyArgs) -> Self {
        let count = match &self.rows {
            Rows::Memory(record) => record.len(),
            Rows::File { count, .. } => *count,
        };
        #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)]
        let estimation_rows = args.holdout.map_or(count, |share| (count as f64 * (1.0 - share)).round() as usize);
        self.estimation_rows = estimation_rows;
        self
    }

    fn from_demo(seed: u64) -> Result<Self, TumbleError> {
        let flight = demo::simulate(seed)?;
        let source = format!(
            "demo flight {seed}: simulated robot with cargo, {} s; noise {:.0e} rad, {:.0e} m, {:.0e} N m, {:.0e} N",
            demo::DURATION_S,
            demo::POSE_NOISE.0,
            demo::POSE_NOISE.1,
            demo::WRENCH_NOISE.0,
            demo::WRENCH_NOISE.1
        );
        Ok(Self {
            source,
            rows: Rows::Memory(flight.record),
            estimation_rows: 0,
            reference: Some(("truth".to_owned(), flight.truth)),
            warnings: Vec::new(),
            duration_s: demo::DURATION_S,
            actuators: None,
            is_in_environment: false,
            pipeline: methods(),
        })
    }

    fn from_file(args: &IdentifyArgs, robots: &Robots) -> Result<Self, TumbleError> {
        let Some(path) = &args.log else {
            return Err(TumbleError::BadOption { message: "no log: name a file, or use --demo".to_owned() });
        };
        let reference = reference(args)?;
        if let Some(file) = &args.actuators {
            let FlightLikelihood { sensing, .. } = told(args, robots, false)?;
            return Self::from_commands(args, &args.logs(), actuator_file::read(file)?, sensing, reference);
        }
        let (stated, pipeline) = (told(args, robots, false)?, pipeline(args)?);
        let mut reader = SampleReader::open_all(&args.logs(), args.reorder, args.robot.as_deref(), robots)?;
        let told = FlightLikelihood { plane: plane(args, reader.is_planar()), ..stated };
        if told.plane == Plane::Planar && OF_FREE_BODIES.contains(&args.of_samples()) {
            let message = format!(
                "{} holds motion in a plane, and {} knows free bodies only: leave `--method` and `--estimate` out",
                path.display(),
                args.of_samples()
            );
            return Err(TumbleError::BadOption { message });
        }
        tell!("{}", reader.contents());
        let mut record = Vec::new();
        let mut more = reader.read_chunk(&mut record, ROWS_IN_MEMORY)?;
        let (Some(first_ns), Some(mut last_ns)) = (record.first().map(|s| s.time_ns), record.last().map(|s| s.time_ns))
        else {
            return Err(FormatsError::Empty { path: path.clone(), what: "data rows" }.into());
        };
        if let Some(reason) = reader.lacks_wrench().filter(|_| !args.dry_run || args.has_model()) {
            return Err(FormatsError::NoFlight { path: path.clone(), reason }.into());
        }
        let contradicted = contradictions(args, &told, &record);
        let mut rows = Rows::Memory(record);
        if more {
            let mut count = ROWS_IN_MEMORY;
            let mut chunk = Vec::new();
            while more {
                chunk.clear();
                more = reader.read_chunk(&mut chunk, ROWS_IN_MEMORY)?;
                count += chunk.len();
                last_ns = chunk.last().map_or(last_ns, |s| s.time_ns);
                progress(&format!("{count} rows checked"));
            }
            rows = Rows::File {
                paths: args.logs(),
                reorder: args.reorder,
                robot: args.robot.clone(),
                robots: robots.clone(),
                count,
            };
        }
        let mut warnings = reader.warnings();
        warnings.extend(contradicted);
        let duration_s = seconds(last_ns - first_ns);
        Ok(Self {
            source: path.display().to_string(),
            rows,
            estimation_rows: 0,
            reference,
            warnings,
            duration_s,
            actuators: None,
            is_in_environment: args.environment.is_some(),
            pipeline: pipeline.flown_with(told),
        })
    }

    /// A log of commands, which make its wrench.
    fn from_commands(
        args: &IdentifyArgs,
        paths: &[PathBuf],
        file: ActuatorFile,
        sensing: Sensing,
        reference: Option<(String, InertialParameters<f64>)>,
    ) -> Result<Self, TumbleError> {
        let [path] = paths else {
            let message = "`--actuators` takes one log: a CSV file or a ULog".to_owned();
            return Err(TumbleError::BadOption { message });
        };
        let pipeline = pipeline(args)?;
        let CommandedLog { mut record, commands, moves, logged, is_planar, mut warnings } =
            CommandedLog::read(path, args.reorder, &file.columns)?;
        let (Some(first), Some(last)) = (record.first(), record.last()) else {
            return Err(FormatsError::Empty { path: path.into(), what: "data rows" }.into());
        };
        let duration_s = seconds(last.time_ns - first.time_ns);
        let still = file.columns.iter().zip(&moves).filter(|(_, moves)| !**moves).map(|(name, _)| name.as_str());
        let still: Vec<&str> = still.collect();
        if !still.is_empty() {
            warnings.push(format!("never commanded, so that nothing is said of them: {}", still.join(", ")));
        }
        if logged {
            warnings.push("the wrench is that of the commands; the log's own `f_*`, `tau_*` are not used".to_owned());
        }
        let thrusters = file.actuators.drive(&mut record, &commands)?;
        let told = FlightLikelihood {
            sensing: file.actuators.aged(sensing),
            plane: plane(args, is_planar),
            thrusters: Some(thrusters),
            ..FlightLikelihood::default()
        };
        Ok(Self {
            source: path.display().to_string(),
            rows: Rows::Memory(record),
            estimation_rows: 0,
            reference,
            warnings,
            duration_s,
            actuators: Some(file),
            is_in_environment: args.environment.is_some(),
            pipeline: pipeline.flown_with(told),
        })
    }

    /// Calls `part` for each stretch of at most so many estimation rows, until it breaks off.
    pub(super) fn for_each_part(
        &self,
        rows_at_once: usize,
        mut part: impl FnMut(&[MotionSample]) -> Result<ControlFlow<()>, TumbleError>,
    ) -> Result<(), TumbleError> {
        match &self.rows {
            Rows::Memory(record) => {
                for stretch in record.get(..self.estimation_rows).unwrap_or(record).chunks(rows_at_once) {
                    if part(stretch)?.is_break() {
                        break;
                    }
                }
                Ok(())
            }
            Rows::File { paths, reorder, robot, robots, .. } => {
                let mut reader = SampleReader::open_all(paths, *reorder, robot.as_deref(), robots)?;
                let mut chunk = Vec::new();
                let mut done = 0;
                while done < self.estimation_rows {
                    chunk.clear();
                    let more = reader.read_chunk(&mut chunk, rows_at_once.min(self.estimation_rows - done))?;
                    done += chunk.len();
                    let flow = part(&chunk)?;
                    progress(&format!("{done} of {} rows", self.estimation_rows));
                    if !more || flow.is_break() {
                        break;
                    }
                }
                Ok(())
            }
        }
    }

    /// Whether any row holds a wrench.
    pub(super) fn is_driven(&self) -> Result<bool, TumbleError> {
        let mut is_driven = false;
        self.for_each_part(ROWS_IN_MEMORY, |record| {
            let driven = |row: &MotionSample| row.wrench_body.is_some_and(|wrench| wrench.to_vector().amax() > 0.0);
            is_driven |= record.iter().any(driven);
            Ok(if is_driven { ControlFlow::Break(()) } else { ControlFlow::Continue(()) })
        })?;
        Ok(is_driven)
    }

    /// The rows kept back, at most as many as fit in memory.
    pub(super) fn held_out(&self) -> Result<Vec<MotionSample>, TumbleError> {
        match &self.rows {
            Rows::Memory(record) => Ok(record.get(self.estimation_rows..).unwrap_or_default().to_vec()),
            Rows::File { paths, reorder, robot, robots, .. } => {
                let mut reader = SampleReader::open_all(paths, *reorder, robot.as_deref(), robots)?;
                let mut rest = Vec::new();
                for _ in 0..self.estimation_rows {
                    reader.next_sample()?;
                }
                reader.read_chunk(&mut rest, ROWS_IN_MEMORY)?;
                Ok(rest)
            }
        }
    }

    /// Some of the rows by themselves.
    pub(super) fn identify_rows(
        &self,
        rows: &[MotionSample],
        settings: &Settings,
    ) -> Result<Identification, TumbleError> {
        Ok(self.pipeline.identify(rows, settings)?)
    }

    /// How well what was found explains other rows.
    pub(super) fn validate(
        &self,
        found: &Identification,
        rows: &[MotionSample],
        settings: &Settings,
    ) -> Result<Validation, TumbleError> {
        Ok(self.pipeline.validate(found, rows, settings)?)
    }

    pub(super) fn identify(&self, settings: &Settings) -> Result<Identification, TumbleError> {
        if self.estimation_rows > LongRecord::LONG
            && !self.is_in_environment
            && let Some(found) = self.identify_long(settings)?
        {
            return Ok(found);
        }
        // What a likelihood holds of a row is much larger than the row.
        let likely = [AUTO, MAXIMUM_LIKELIHOOD].contains(&settings.method);
        let rows_at_once = if likely { LongRecord::LONG } else { ROWS_IN_MEMORY };
        if self.estimation_rows <= rows_at_once {
            let mut found = None;
            self.for_each_part(rows_at_once, |record| {
                found = Some(self.pipeline.identify(record, settings)?);
                Ok(ControlFlow::Continue(()))
            })?;
            return found.ok_or(FormatsError::Empty { path: PathBuf::from(&self.source), what: "data rows" }.into());
        }
        let alone = Settings { prior: None, ..*settings };
        let mut parts = Vec::new();
        self.for_each_part(rows_at_once, |record| {
            match self.pipeline.identify(record, &alone).map_err(TumbleError::from) {
                // The last few rows of a long log may be too few for a row of their own.
                Err(TumbleError::Identification(IdentificationError::TooFewSamples { .. })) if !parts.is_empty() => {}
                found => {
                    let mut found = found?;
                    let every = found.residuals.len().div_ceil(RESIDUALS_PER_PART).max(1);
                    found.residuals = found.residuals.into_iter().step_by(every).collect();
                    parts.push(found);
                }
            }
            Ok(ControlFlow::Continue(()))
        })?;
        Ok(merge(&parts, settings.prior.as_ref())?)
    }

    /// The parts between changes of the body.
    pub(super) fn in_parts(&self, record: &[MotionSample], settings: &Settings) -> Result<Parts, TumbleError> {
        Ok(self.pipeline.identify_parts(record, settings)?)
    }

    /// By likelihood in a sliding window; `None` where that has no answer.
    fn identify_long(&self, settings: &Settings) -> Result<Option<Identification>, TumbleError> {
        let mut long = None;
        let slid = self.for_each_part(ROWS_IN_MEMORY, |record| {
            if long.is_none() {
                long = LongRecord::try_new(record, settings)?;
            }
            let Some(long) = &mut long else { return Ok(ControlFlow::Break(())) };
            for row in record {
                long.push(*row)?;
            }
            Ok(ControlFlow::Continue(()))
        });
        let found = slid.and_then(|()| Ok(long.map(LongRecord::finish).transpose()?));
        match found {
            Err(TumbleError::Identification(
                IdentificationError::LikelihoodNotConverged { .. }
                | IdentificationError::NotExcited { .. }
                | IdentificationError::Indefinite { .. }
                | IdentificationError::NotKnown { .. },
            )) => Ok(None),
            found => found,
        }
    }
}

/// A log of commands, in memory: those that are empty hold what was told before.
struct CommandedLog {
    record: Vec<MotionSample>,
    /// Those of each row, one row after the other.
    commands: Vec<f64>,
    /// Which are ever given.
    moves: Vec<bool>,
    /// Whether it has a wrench of its own.
    logged: bool,
    is_planar: bool,
    warnings: Vec<String>,
}

impl CommandedLog {
    fn read(path: &Path, reorder: bool, columns: &[String]) -> Result<Self, TumbleError> {
        let mut log = Self {
            record: Vec::new(),
            commands: Vec::new(),
            moves: vec![false; columns.len()],
            logged: false,
            is_planar: false,
            warnings: Vec::new(),
        };
        let mut held = vec![0.0; columns.len()];
        match recording::container(path)? {
            None => {
                let mut reader = CommandedReader::open(path, reorder, columns)?;
                while let Some(sample) = reader.next_sample()? {
                    log.take(&sample, &mut held)?;
                }
                log.is_planar = reader.is_planar();
                log.warnings = reader.warnings();
            }
            Some(Container::Ulog) => {
                let (survey, plan) = ulog_flight::open(path, None)?;
                tell!("{}", recording::topics::table(&survey.topics, &plan));
                let mut failure = None;
                let tally = ulog_flight::read(path, &survey, columns, true, &mut |sample| match log
                    .take(&sample, &mut held)
                {
                    Ok(()) => ControlFlow::Continue(()),
                    Err(error) => {
                        failure = Some(error);
                        ControlFlow::Break(())
                    }
                })?;
                if let Some(error) = failure {
                    return Err(error);
                }
                log.warnings = tally.warnings(&plan, &survey.topics);
            }
            Some(_) => {
                let message = "`--actuators` names columns of a CSV log or fields of a ULog; `tumble convert` makes CSV of other recordings";
                return Err(TumbleError::BadOption { message: message.to_owned() });
            }
        }
        Ok(log)
    }

    fn take(&mut self, sample: &CommandedSample, held: &mut [f64]) -> Result<(), TumbleError> {
        if self.record.len() == LongRecord::LONG {
            let message = format!("`--actuators` takes a log as one: at most {} rows", LongRecord::LONG);
            return Err(TumbleError::BadOption { message });
        }
        for ((held, moves), command) in held.iter_mut().zip(&mut self.moves).zip(&sample.commands) {
            *held = command.unwrap_or(*held);
            *moves |= *held > 0.0;
        }
        self.logged |= sample.motion.wrench_body.is_some();
        self.record.push(sample.motion);
        self.commands.extend_from_slice(held);
        Ok(())
    }
}

/// The body to compare with.
fn reference(args: &IdentifyArgs) -> Result<Option<(String, InertialParameters<f64>)>, TumbleError> {
    let read = |path: &PathBuf| Ok(("reference".to_owned(), body_file::read(path)?));
    args.reference.as_ref().map(read).transpose()
}

/// What the options say of sensors and plane.
fn told(args: &IdentifyArgs, robots: &Robots, is_planar: bool) -> Result<FlightLikelihood, TumbleError> {
    let sensing = args.sensing.as_deref().map(|name| super::named_sensing::find(name, robots)).transpose()?;
    let plane = plane(args, is_planar);
    Ok(FlightLikelihood { sensing: sensing.unwrap_or_default(), plane, ..FlightLikelihood::default() })
}

/// Where the log says otherwise of its sensors than the options, in words.
fn contradictions(args: &IdentifyArgs, told: &FlightLikelihood, record: &[MotionSample]) -> Vec<String> {
    let stated = args.sensing.is_some().then_some(&told.sensing);
    let contradicted = match stated.map(|stated| (stated, sensing::check(record, args.wrench.into()))) {
        Some((stated, Ok(found))) => found.contradictions(Some(stated)),
        _ => Vec::new(),
    };
    contradicted.iter().map(|what| format!("the log contradicts what `--sensing` states: {what}")).collect()
}

/// Whether the body moves in a plane, by the options or else by the columns.
const fn plane(args: &IdentifyArgs, by_columns: bool) -> Plane {
    match () {
        () if args.no_planar => Plane::Free,
        () if args.planar || by_columns => Plane::Planar,
        () => Plane::Found,
    }
}

/// The methods, told of what else acts by the options.
fn pipeline(args: &IdentifyArgs) -> Result<Pipeline, TumbleError> {
    let environment = args.environment.as_deref().map(environment_file::read).transpose()?;
    Ok(methods().acted_on_by(environment.unwrap_or_default()))
}

/// The library's methods, and those that the program added.
fn methods() -> Pipeline {
    ADDED_METHODS.entries().into_iter().fold(Pipeline::new(), |pipeline, (name, sentence, make)| {
        pipeline.with(name, sentence, move |problem| make(problem))
    })
}

/// One line on stderr that replaces itself; silent in pipes.
fn progress(text: &str) {
    if std::io::stderr().is_terminal() {
        tell!("\r{text}   ");
    }
}
