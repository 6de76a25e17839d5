//! `tumble identify`: from a log to mass, centre of mass and inertia.

use super::identify_arm::Files;
use super::identify_log::{Log, ROWS_IN_MEMORY, Rows};
use super::identify_options::{AUTO, OF_CYCLES, Outputs, run_record};
use super::identify_periodic::{self, Motion};
pub use super::own_estimator::{MakeEstimator, OwnEstimator};
use super::{Outcome, by_name, log_files, named_together, paths_of, print};
use crate::output::RUN_RECORD;
use crate::report::{self, Context};
use crate::report_page::{self, Trial};
use crate::{TumbleError, demo};
use std::ops::ControlFlow;
use std::path::{Path, PathBuf};
use tumble_dynamics::InertialParameters;
use tumble_dynamics::nalgebra::Vector3;
use tumble_formats::FormatsError;
use tumble_formats::Robots;
use tumble_formats::actuator_file::ActuatorFile;
use tumble_formats::body_file;
use tumble_formats::log::{TEMPLATE, seconds};
use tumble_identification::estimator::Verdict;
use tumble_identification::harmonics::HarmonicEstimator;
use tumble_identification::{
    FLIGHT_LIKELIHOOD, Identification, IdentificationError, LongRecord, MAXIMUM_LIKELIHOOD, MotionSample, Nuisances,
    Part, Parts, Settings, Validation, predict,
};

pub use super::identify_options::{ADDED_METHODS, IdentifyArgs};

/// Runs the command.
///
/// # Errors
/// [`TumbleError`] for bad input; a log that cannot answer is [`Outcome::NotAchieved`].
pub fn run(args: &IdentifyArgs, robots: &Robots) -> Result<Outcome, TumbleError> {
    if args.template {
        print(TEMPLATE)?;
        return Ok(Outcome::Achieved);
    }
    check_options(args)?;
    let mut outputs = Outputs::default();
    if !args.arm.is_asked() {
        if let (Some(throw), Some(calibration)) = (&args.wheel, &args.calibration) {
            return super::calibrate_wheel::identify_throw(throw, calibration, args.mass, args.json);
        }
        // Before a pipe is waited for, and by the names that were given: a copy of the log is not the log.
        check_outputs(args)?;
        outputs = Outputs::reserve(args)?;
    }
    let named = args.logs();
    #[cfg(feature = "astrobee")]
    let files = super::unflown::logs_of(args, &named, robots)?;
    #[cfg(not(feature = "astrobee"))]
    let files = log_files(&named)?;
    let mut paths = paths_of(&files).into_iter();
    let at_hand = IdentifyArgs { log: paths.next(), more: paths.collect(), ..args.clone() };
    answer(&at_hand, &named, robots, outputs).map_err(|error| by_name(&files, error))
}

/// Of logs that are at hand, under the names that were given.
fn answer(
    args: &IdentifyArgs,
    named: &[PathBuf],
    robots: &Robots,
    mut outputs: Outputs,
) -> Result<Outcome, TumbleError> {
    if args.arm.is_asked() {
        return identify_arm(args, robots);
    }
    let settings = settings(args)?;
    let motion = Motion::of(args)?;
    let mut log = Log::read(args, robots)?;
    if !named.is_empty() {
        log.source = named_together(named);
    }
    if let (Some(motion), Some(estimator)) = (&motion, args.harmonic()) {
        match identify_periodic::run(args, motion, estimator, &log, &mut outputs) {
            Err(TumbleError::Identification(reason)) if without_cycles(estimator, &reason) => {
                log.warnings.push(format!(
                    "the cycles of this log cannot be averaged ({reason}): the whole log answers, as without a period"
                ));
            }
            answered => return answered,
        }
    }
    if args.dry_run {
        return dry_run(args, &log, &settings);
    }
    if args.split {
        return split(args, &log, &settings);
    }
    let found = Found::of(&log, &settings, args.holdout.is_some())?;
    deliver(args, &found, &log, &settings, outputs)
}

/// Of so many parts of a log a page trains on all but the last, where nothing else was asked for; on that the body is tried.
const PARTS: usize = 4;

/// A body from the first part of the log, tried on the rest; none where the log has too few rows, or too many for a second look.
fn trial(args: &IdentifyArgs, found: &Identification, log: &Log, settings: &Settings) -> Option<Trial> {
    let Rows::Memory(record) = &log.rows else { return None };
    if args.holdout.is_some() || log.actuators.is_some() || !has_numbers(found) || record.len() > LongRecord::LONG {
        return None;
    }
    let (part, rest) = record.split_at_checked(record.len() - record.len() / PARTS)?;
    let alone = log.identify_rows(part, settings).ok()?;
    Trial::new(part.len() as f64 / record.len() as f64, &alone, found, log.validate(&alone, rest, settings).ok()?)
}

/// Whether some of the ten numbers were found.
fn has_numbers(found: &Identification) -> bool {
    let in_part = found.method == FLIGHT_LIKELIHOOD && found.regularised.is_some();
    (found.estimate.is_some() || in_part) && found.determined().contains(&true)
}

/// What the options say of the record as a whole.
fn settings(args: &IdentifyArgs) -> Result<Settings, TumbleError> {
    Ok(Settings {
        method: args.of_samples(),
        wrench_timing: args.wrench.into(),
        gravity_world: args.gravity,
        estimate: args.estimate.iter().fold(Nuisances::default(), |all, some| all.and(*some)),
        prior: args.prior.as_deref().map(body_file::read_prior).transpose()?,
        ..Settings::default()
    })
}

/// The body of one log, before anything is printed or written.
pub struct Found {
    /// What was found.
    pub identification: Identification,
    source: String,
    reference: Option<(String, InertialParameters<f64>)>,
    reader_warnings: Vec<String>,
    duration_s: f64,
    actuators: Option<ActuatorFile>,
    validation: Option<Validation>,
}

impl Found {
    /// Of the log that the options name, as `tumble identify` finds it.
    ///
    /// # Errors
    /// [`TumbleError`] for bad input, and for options that ask for something other than the body of one log.
    pub fn of_log(args: &IdentifyArgs, robots: &Robots, own: Option<OwnEstimator>) -> Result<Self, TumbleError> {
        check_options(args)?;
        one_body(args)?;
        let named = args.logs();
        let files = log_files(&named)?;
        let mut paths = paths_of(&files).into_iter();
        let at_hand = IdentifyArgs { log: paths.next(), more: paths.collect(), ..args.clone() };
        let mut log = Log::read(&at_hand, robots).map_err(|error| by_name(&files, error))?;
        if !named.is_empty() {
            log.source = named_together(&named);
        }
        Self::by(args, log, own)
    }

    /// Of a record in memory, as `tumble identify` finds it of a log with these rows.
    ///
    /// # Errors
    /// As [`Self::of_log`].
    pub fn of_record(
        args: &IdentifyArgs,
        record: Vec<MotionSample>,
        robots: &Robots,
        own: Option<OwnEstimator>,
    ) -> Result<Self, TumbleError> {
        check_options(args)?;
        one_body(args)?;
        Self::by(args, Log::of_record(args, record, robots)?, own)
    }

    fn by(args: &IdentifyArgs, mut log: Log, own: Option<OwnEstimator>) -> Result<Self, TumbleError> {
        let mut settings = settings(args)?;
        if let Some(own) = own {
            settings.method = own.name;
            log.take(own);
        }
        Self::of(&log, &settings, args.holdout.is_some())
    }

    fn of(log: &Log, settings: &Settings, is_held_out: bool) -> Result<Self, TumbleError> {
        let identification = log.identify(settings)?;
        let has_another = is_held_out && has_numbers(&identification);
        let validation =
            if has_another { Some(log.validate(&identification, &log.held_out()?, settings)?) } else { None };
        Ok(Self {
            identification,
            source: log.source.clone(),
            reference: log.reference.clone(),
            reader_warnings: log.warnings.clone(),
            duration_s: log.duration_s,
            actuators: log.actuators.clone(),
            validation,
        })
    }

    /// What the report says beside the body.
    pub fn context(&self) -> Context<'_> {
        Context {
            source: self.source.clone(),
            reference: self.reference.as_ref().map(|(name, body)| (name.clone(), body)),
            validation: self.validation,
            reader_warnings: self.reader_warnings.clone(),
            duration_s: self.duration_s,
            actuators: self.actuators.as_ref(),
        }
    }

    /// The object that `tumble identify --json` prints, without the end of the line.
    ///
    /// # Errors
    /// [`FormatsError::BadToml`] where a number has no JSON form.
    pub fn json(&self) -> Result<String, TumbleError> {
        let object = report::json(&self.identification, &self.context());
        let bad =
            |error: serde_json::Error| FormatsError::BadToml { path: "result.json".into(), message: error.to_string() };
        Ok(serde_json::to_string(&object).map_err(bad)?)
    }
}

/// Refuses what has another answer than one body.
fn one_body(args: &IdentifyArgs) -> Result<(), TumbleError> {
    let other = [
        (args.template, "--template"),
        (args.arm.is_asked(), "--model"),
        (args.wheel.is_some(), "--wheel"),
        (args.split, "--split"),
        (args.dry_run, "--dry-run"),
        (args.excitation.is_some(), "--excitation"),
        (args.period.is_some(), "--period"),
    ];
    match other.iter().find(|(is_asked, _)| *is_asked) {
        Some((_, option)) => {
            Err(TumbleError::BadOption { message: format!("`{option}` has another answer than the body of one log") })
        }
        None => check_holdout(args),
    }
}

/// A log of an arm's joints.
fn identify_arm(args: &IdentifyArgs, robots: &Robots) -> Result<Outcome, TumbleError> {
    let Some(log) = &args.log else {
        let message = "`--model` needs a log of the arm's joints; `tumble arm show ARM --as log-template` prints one";
        return Err(TumbleError::BadOption { message: message.to_owned() });
    };
    let (json, force, reorder) = (args.json, args.force, args.reorder);
    super::identify_arm::run(&args.arm, &Files { log, reorder, json, out: args.out.as_deref(), force }, robots)
}

/// Whether a log with cycles that cannot be averaged, for this reason, may still answer sample by sample.
///
/// A period that does not fit the log is a wrong statement, and least squares needs the averages: these stay errors.
fn without_cycles(estimator: HarmonicEstimator, reason: &IdentificationError) -> bool {
    estimator == HarmonicEstimator::Likelihood
        && matches!(
            reason,
            IdentificationError::NotPeriodic { .. }
                | IdentificationError::UnequalSteps { .. }
                | IdentificationError::WrenchMissing { .. }
                | IdentificationError::NotConverged { .. }
                | IdentificationError::LikelihoodNotConverged { .. }
        )
}

/// Refuses options that would be ignored.
fn check_options(args: &IdentifyArgs) -> Result<(), TumbleError> {
    let output = args.out.is_some() || args.export.is_some();
    let of_log = args.sensing.is_some()
        || args.actuators.is_some()
        || args.environment.is_some()
        || args.planar
        || args.no_planar
        || args.reference.is_some()
        || args.prior.is_some()
        || args.holdout.is_some()
        || args.dry_run
        || args.split
        || args.reorder
        || args.robot.is_some()
        || args.excitation.is_some()
        || args.period.is_some()
        || args.gravity != Vector3::zeros();
    let of_sensors = args.has_model();
    let of_one_body = of_sensors
        || args.environment.is_some()
        || args.reference.is_some()
        || args.prior.is_some()
        || args.holdout.is_some()
        || args.dry_run
        || args.split
        || args.robot.is_some()
        || args.excitation.is_some()
        || args.period.is_some()
        || args.wheel.is_some()
        || args.demo
        || args.export.is_some()
        || !args.estimate.is_empty()
        || args.method != AUTO
        || args.gravity != Vector3::zeros();
    let periodic = args.excitation.is_some() || args.period.is_some();
    let averages = OF_CYCLES.iter().any(|(name, ..)| *name == args.method);
    let clash = [
        (
            args.arm.is_asked() && of_one_body,
            "with `--model` the log is of an arm: besides its own options it takes `--reorder`, `--json`, `--out` and `--force` only (gravity is the model's)",
        ),
        (averages && !periodic, "`--method fourier` and `fourier-likelihood` need `--excitation` or `--period`"),
        (
            periodic && args.harmonic().is_none(),
            "`--excitation` and `--period` belong to `--method fourier`, `fourier-likelihood` or auto; leave them out for another method",
        ),
        (
            !args.more.is_empty() && args.arm.is_asked(),
            "with `--model` the log is one CSV file; several files are one recording of bags or MCAP files",
        ),
        (args.harmonics == Some(0), "`--harmonics 0`: a motion has one at least"),
        (periodic && args.demo, "`--demo` is no periodic motion: leave out `--excitation` or `--period`"),
        (
            periodic && args.dry_run,
            "averaged cycles take no `--dry-run`; it works without `--excitation` or `--period`",
        ),
        (periodic && args.split, "averaged cycles take no `--split`; it works without `--excitation` or `--period`"),
        (
            periodic && args.environment.is_some(),
            "averaged cycles take no `--environment`; it works without `--excitation` or `--period`",
        ),
        (
            args.environment.is_some() && args.demo,
            "in the flight of `--demo` nothing else acts: leave out `--environment`",
        ),
        (
            periodic && args.prior.is_some(),
            "averaged cycles take no `--prior`; it works without `--excitation` or `--period`",
        ),
        (
            periodic && args.holdout.is_some(),
            "averaged cycles take no `--holdout`; it works without `--excitation` or `--period`",
        ),
        (
            periodic && !args.estimate.is_empty(),
            "averaged cycles take no `--estimate`; without `--excitation` or `--period` it works, as in `--estimate bias-wrench`",
        ),
        (args.robot.is_some() && args.log.is_none(), "`--robot` chooses among the robots of a bag or an MCAP file"),
        (
            args.seed.is_some() && !(args.demo || args.is_of_scenario()),
            "`--seed` belongs to `--demo`, and to the scenario of a `--dry-run`",
        ),
        (args.wheel.is_none() && args.calibration.is_some(), "`--calibration` belongs to `--wheel`"),
        (args.wheel.is_none() && args.mass.is_some(), "`--mass` belongs to `--wheel`"),
        (args.wheel.is_some() && args.calibration.is_none(), "`--wheel` needs `--calibration`"),
        (args.wheel.is_some() && (output || of_log), "`--wheel` takes `--calibration`, `--mass` and `--json` only"),
        (
            args.dry_run && (output || args.holdout.is_some()),
            "`--dry-run` estimates no body: no `--out`, `--export`, `--holdout`",
        ),
        (
            !args.estimate.is_empty() && ![AUTO, MAXIMUM_LIKELIHOOD].contains(&args.method.as_str()),
            "`--estimate` belongs to `--method maximum-likelihood` (or auto)",
        ),
        (
            of_sensors && ![AUTO, FLIGHT_LIKELIHOOD].contains(&args.method.as_str()),
            "`--sensing`, `--actuators`, `--planar` and `--no-planar` belong to `--method flight-likelihood` (or auto)",
        ),
        (
            of_sensors && (args.demo || periodic || !args.estimate.is_empty()),
            "`--sensing`, `--actuators`, `--planar` and `--no-planar` are for a log: no `--demo`, `--excitation`, `--period`, `--estimate`",
        ),
        (
            of_sensors && args.wrench_noise.is_some(),
            "`--wrench-noise` judges the motion alone: no `--sensing`, `--actuators`, `--planar`, `--no-planar`",
        ),
        (
            args.actuators.is_some() && (args.split || args.holdout.is_some() || args.robot.is_some()),
            "`--actuators` takes the rows of one log as one: no `--split`, `--holdout`, `--robot`",
        ),
        (!args.estimate.is_empty() && args.dry_run, "`--dry-run` estimates nothing: no `--estimate`"),
        (
            args.split && (output || args.holdout.is_some() || args.dry_run),
            "`--split` may find several bodies: no `--out`, `--export`, `--holdout`, `--dry-run`",
        ),
        (args.patch.is_some() && args.export.is_none(), "`--patch` needs `--export FILE`: the model with the new body"),
        (args.link.is_some() && args.patch.is_none(), "`--link` belongs to `--patch`"),
        (args.wrench_noise.is_some() && !args.dry_run, "`--wrench-noise` belongs to `--dry-run`"),
    ];
    match clash.iter().find(|(clashes, _)| *clashes) {
        Some((_, message)) => Err(TumbleError::BadOption { message: (*message).to_owned() }),
        None => Ok(()),
    }
}

/// Refuses outputs that could not be written before any long work is done.
fn check_outputs(args: &IdentifyArgs) -> Result<(), TumbleError> {
    for path in [&args.out, &args.export].into_iter().flatten() {
        let inputs = [&args.log, &args.reference, &args.prior, &args.excitation, &args.actuators, &args.environment];
        let inputs = inputs.into_iter().flatten().chain(&args.more);
        let same =
            |input: &PathBuf| input.canonicalize().is_ok_and(|real| path.canonicalize().is_ok_and(|p| p == real));
        if inputs.into_iter().any(same) {
            return Err(TumbleError::BadOption {
                message: format!("{} is an input of this run; write the result somewhere else", path.display()),
            });
        }
    }
    if let Some(model) = &args.patch {
        // the link must be there before the log is read
        let any = InertialParameters::solid_sphere(1.0, 0.1);
        super::check::patched(model, args.link.as_deref(), &any)?;
    }
    check_holdout(args)
}

/// Refuses a share that is none.
fn check_holdout(args: &IdentifyArgs) -> Result<(), TumbleError> {
    if let Some(share) = args.holdout.filter(|share| !(0.0 < *share && *share < 1.0)) {
        return Err(TumbleError::BadOption {
            message: format!("`--holdout {share}`: the share kept back lies between 0 and 1, such as 0.25"),
        });
    }
    Ok(())
}

fn deliver(
    args: &IdentifyArgs,
    answer: &Found,
    log: &Log,
    settings: &Settings,
    mut outputs: Outputs,
) -> Result<Outcome, TumbleError> {
    let (found, context) = (&answer.identification, &answer.context());
    for warning in report::warnings(found, context) {
        tell_line!("warning: {warning}");
    }
    let json = answer.json()?;
    // What cannot be printed is written all the same.
    let told = print(&if args.json { format!("{json}\n") } else { report::table(found, context) });
    outputs.export(args, found.estimate.as_ref().map(|estimate| &estimate.parameters))?;
    if let Some(folder) = outputs.folder {
        folder.write("result.json", &json)?;
        if let Some(estimate) = &found.estimate {
            folder.write("body.toml", &body_file::export(Path::new("body.toml"), &estimate.parameters)?)?;
        }
        let applied = match &log.rows {
            Rows::Memory(record) => report_page::applied(record, &found.residuals),
            Rows::File { .. } => Vec::new(),
        };
        let trial = trial(args, found, log, settings);
        report::write_page(&folder, found, context, applied, trial, &json)?;
        folder.write(RUN_RECORD, &run_record(args, &context.source))?;
        tell_line!("wrote {}", folder.finish()?.join("report.html").display());
    }
    if matches!(found.verdict, Verdict::NoBodyExplains { .. }) {
        tell_line!(
            "note: where the robot grasped or released something meanwhile, `--split` looks for the parts of the log"
        );
    }
    told?;
    Ok(if found.verdict.is_identified() { Outcome::Achieved } else { Outcome::NotAchieved })
}

/// Each part between changes of the body by itself.
fn split(args: &IdentifyArgs, log: &Log, settings: &Settings) -> Result<Outcome, TumbleError> {
    let Rows::Memory(record) = &log.rows else {
        return Err(TumbleError::BadOption {
            message: format!("`--split` holds the whole log in memory: at most {ROWS_IN_MEMORY} rows"),
        });
    };
    let Parts { parts, changes } = log.in_parts(record, settings)?;
    let (mut shown, mut identified) = (Vec::new(), true);
    for (index, Part { samples, found }) in parts.iter().enumerate() {
        let time_s = |sample: usize| record.get(sample).map_or(0.0, |row| seconds(row.time_ns));
        let (start_s, end_s) = (time_s(samples.start), time_s(samples.end.saturating_sub(1)));
        let context = Context {
            source: format!("{}: part {} of {}, {start_s:.2} to {end_s:.2} s", log.source, index + 1, parts.len()),
            reference: log.reference.as_ref().map(|(name, body)| (name.clone(), body)),
            validation: None,
            reader_warnings: if index == 0 { log.warnings.clone() } else { Vec::new() },
            duration_s: end_s - start_s,
            actuators: None,
        };
        for warning in report::warnings(found, &context) {
            tell_line!("warning: part {}: {warning}", index + 1);
        }
        identified &= found.verdict.is_identified();
        if args.json {
            shown.push(
                serde_json::json!({ "start_s": start_s, "end_s": end_s, "result": report::json(found, &context) }),
            );
        } else {
            print(&report::table(found, &context))?;
        }
    }
    if args.json {
        let changes: Vec<_> = changes.iter().map(report::change_json).collect();
        print(&format!("{}\n", serde_json::json!({ "format": 1, "parts": shown, "changes": changes })))?;
    } else {
        for change in &changes {
            print(&report::change_table(change))?;
        }
    }
    Ok(if identified { Outcome::Achieved } else { Outcome::NotAchieved })
}

/// What a log can answer: by the model that identifies it where it holds wrenches, else by its motion alone.
fn dry_run(args: &IdentifyArgs, log: &Log, settings: &Settings) -> Result<Outcome, TumbleError> {
    for warning in &log.warnings {
        tell_line!("warning: {warning}");
    }
    if args.has_model() || args.wrench_noise.is_none() && log.is_driven()? {
        return promise(args, log, settings);
    }
    let wrench_noise = args.wrench_noise.unwrap_or(demo::WRENCH_NOISE);
    let mut prediction = None;
    log.for_each_part(ROWS_IN_MEMORY, |record| {
        prediction = Some(predict(record, settings, wrench_noise)?);
        Ok(ControlFlow::Break(()))
    })?;
    let Some(prediction) = prediction else {
        return Err(FormatsError::Empty { path: PathBuf::from(&log.source), what: "data rows" }.into());
    };
    if args.json {
        print(&format!("{}\n", report::prediction_json(&prediction, wrench_noise)))?;
    } else {
        print(&report::prediction_table(&prediction, &log.source, wrench_noise))?;
    }
    Ok(if prediction.rank == 10 { Outcome::Achieved } else { Outcome::NotAchieved })
}

/// The standard deviations that identification of this log states, and nothing of the body.
fn promise(args: &IdentifyArgs, log: &Log, settings: &Settings) -> Result<Outcome, TumbleError> {
    let found = log.identify(settings)?;
    let context = Context {
        source: log.source.clone(),
        reader_warnings: Vec::new(),
        duration_s: log.duration_s,
        actuators: log.actuators.as_ref(),
        ..Context::default()
    };
    for warning in report::warnings(&found, &context) {
        tell_line!("warning: {warning}");
    }
    if args.json {
        print(&format!("{}\n", report::promise_json(&found)))?;
    } else {
        print(&report::promise_table(&found, &context))?;
    }
    Ok(if found.verdict.is_identified() { Outcome::Achieved } else { Outcome::NotAchieved })
}
