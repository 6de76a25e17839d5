//! `tumble identify`: from a log to mass, centre of mass and inertia.

use tumble_formats::Robots;
use super::identify_arm::{ArmOptions, Files};
use super::identify_periodic::{self, Motion};
use super::{Outcome, print};
use crate::output::{OutputFolder, RUN_RECORD, write_file};
use crate::report::{self, Context};
use crate::{TumbleError, demo};
use clap::builder::{PossibleValue, PossibleValuesParser};
use clap::{Args, ValueEnum};
use std::io::IsTerminal as _;
use std::ops::ControlFlow;
use std::path::{Path, PathBuf};
use tumble_dynamics::InertialParameters;
use tumble_dynamics::nalgebra::Vector3;
use tumble_formats::FormatsError;
use tumble_formats::log::{SampleReader, TEMPLATE, seconds};
use tumble_formats::{body_file, recording};
use tumble_identification::harmonics::HarmonicEstimator;
use tumble_identification::{
    Identification, IdentificationError, LongRecord, MAXIMUM_LIKELIHOOD, MotionSample, Nuisance, Nuisances, Part,
    Settings, WrenchTiming, identify, identify_parts, merge, methods, predict, validate,
};

/// Options of `tumble identify`.
#[derive(Args)]
#[allow(clippy::struct_excessive_bools)]
pub struct IdentifyArgs {
    /// The log: CSV (`--template` prints its columns), ROS 1 bag or MCAP.
    log: Option<PathBuf>,
    /// Simulate a flight with unknown cargo, add noise, estimate and compare with the truth.
    #[arg(long, conflicts_with = "log")]
    demo: bool,
    /// Which simulated flight; another seed gives another cargo and other noise.
    #[arg(long, value_name = "N")]
    seed: Option<u64>,
    /// Print a valid log header with two rows, and stop.
    #[arg(long, exclusive = true)]
    template: bool,
    /// Equations that tie motion to parameters.
    #[arg(long, default_value = AUTO, value_parser = method_names())]
    method: String,
    /// When the logged wrench acts: from its row to the next (held), or as a continuous wrench sampled there.
    #[arg(long, value_enum, default_value_t = TimingName::Held)]
    pub(super) wrench: TimingName,
    /// Gravitational acceleration in inertial axes, m/s^2.
    #[arg(long, value_name = "X,Y,Z", default_value = "0,0,0", value_parser = parse_vector, allow_hyphen_values = true)]
    pub(super) gravity: Vector3<f64>,
    /// Prior knowledge of the body (TOML: a body and its standard deviations); enters the estimate.
    #[arg(long, value_name = "FILE")]
    prior: Option<PathBuf>,
    /// What the maximum likelihood estimates besides the body: delay, force-scale, torque-scale, accelerometer-bias,
    /// accelerometer-scale, accelerometer-position, bias-wrench, table-slope, actuator-lag.
    #[arg(long, value_name = "NAMES", value_delimiter = ',', value_parser = parse_nuisance)]
    estimate: Vec<Nuisances>,
    /// A body to compare with (TOML or JSON).
    #[arg(long, value_name = "FILE", conflicts_with = "demo")]
    reference: Option<PathBuf>,
    /// The log holds cycles of this motion (excitation.toml of `tumble excite`): average them.
    #[arg(long, value_name = "FILE", conflicts_with = "period")]
    pub(super) excitation: Option<PathBuf>,
    /// The log holds cycles of a motion of this period, s: average them.
    #[arg(long, value_name = "S", allow_hyphen_values = true)]
    pub(super) period: Option<f64>,
    /// With --period: fewest harmonics to try (default 2).
    #[arg(long, value_name = "N", requires = "period")]
    pub(super) harmonics: Option<usize>,
    /// Keep back the last part of the log and judge the estimate on it.
    #[arg(long, value_name = "SHARE", num_args = 0..=1, default_missing_value = "0.25")]
    holdout: Option<f64>,
    /// Where the body changed within the log, identify the parts before and after separately.
    #[arg(long)]
    split: bool,
    /// Say what this log can answer and how well, without believing its wrench.
    #[arg(long)]
    dry_run: bool,
    /// With --dry-run: noise of the wrench per sample, one sigma, N m and N (default 1e-4,1e-3).
    #[arg(long, value_name = "TORQUE,FORCE", value_parser = parse_noise)]
    wrench_noise: Option<(f64, f64)>,
    /// Put late rows in order and drop repeated times instead of refusing the log.
    #[arg(long)]
    reorder: bool,
    /// Of a bag or MCAP file with several robots: the namespace of the one to identify.
    #[arg(long, value_name = "NAMESPACE")]
    robot: Option<String>,
    /// Print one JSON object and nothing else on stdout.
    #[arg(long)]
    pub(super) json: bool,
    /// Write report.html, residual plots, result.json, body.toml and run.json into this new folder.
    #[arg(long, value_name = "DIR")]
    pub(super) out: Option<PathBuf>,
    /// Write the body to a file: .toml, .json, .urdf or .xml (MJCF).
    #[arg(long, value_name = "FILE")]
    pub(super) export: Option<PathBuf>,
    /// Replace outputs that exist.
    #[arg(long)]
    pub(super) force: bool,
    /// A wheel-driven throw instead of a log.
    #[arg(long, value_name = "THROW", conflicts_with_all = ["log", "demo"])]
    wheel: Option<PathBuf>,
    /// Calibration of the throwing device, from `tumble calibrate-wheel`.
    #[arg(long, value_name = "CAL")]
    calibration: Option<PathBuf>,
    /// Mass of the thrown object, kg; needed to take the device's share from the inertia.
    #[arg(long, value_name = "KG")]
    mass: Option<f64>,
    #[command(flatten)]
    arm: ArmOptions,
}

/// Chosen by what the log holds.
const AUTO: &str = "auto";
/// What estimates from averaged cycles, by name.
const OF_CYCLES: [(&str, &str, HarmonicEstimator); 2] = [
    (
        "fourier",
        "Averaged cycles of a periodic motion, weighted least squares with the derivatives of its Fourier series",
        HarmonicEstimator::LeastSquares,
    ),
    (
        "fourier-likelihood",
        "The same, maximum likelihood of the series and the parameters together",
        HarmonicEstimator::Likelihood,
    ),
];

/// The library's methods, and those of averaged cycles.
fn method_names() -> PossibleValuesParser {
    let of_cycles = OF_CYCLES.iter().map(|(name, sentence, _)| (*name, *sentence));
    let methods = methods();
    let named = methods.entries().chain(of_cycles);
    PossibleValuesParser::new(named.map(|(name, sentence)| PossibleValue::new(name).help(sentence)).collect::<Vec<_>>())
}

impl IdentifyArgs {
    /// What estimates from averaged cycles.
    fn harmonic(&self) -> Option<HarmonicEstimator> {
        let of_cycles = OF_CYCLES.iter().find(|(name, ..)| *name == self.method);
        of_cycles.map(|(.., estimator)| *estimator).or((self.method == AUTO).then_some(HarmonicEstimator::Likelihood))
    }

    /// The method of a log that is not averaged.
    fn of_samples(&self) -> &'static str {
        // Only the likelihood estimates anything besides the body.
        let asked = if self.estimate.is_empty() { &self.method } else { MAXIMUM_LIKELIHOOD };
        methods().entries().find(|(name, _)| *name == asked).map_or(AUTO, |(name, _)| name)
    }
}

#[derive(Clone, Copy, Debug, ValueEnum)]
pub(super) enum TimingName {
    /// Constant in body axes until the next row.
    Held,
    /// A continuous wrench, sampled.
    Sampled,
}

impl From<TimingName> for WrenchTiming {
    fn from(name: TimingName) -> Self {
        match name {
            TimingName::Held => Self::Held,
            TimingName::Sampled => Self::Sampled,
        }
    }
}

fn parse_vector(text: &str) -> Result<Vector3<f64>, String> {
    let numbers: Option<Vec<f64>> =
        text.split(',').map(|part| part.trim().parse().ok().filter(|x: &f64| x.is_finite())).collect();
    match numbers.as_deref() {
        Some([x, y, z]) => Ok(Vector3::new(*x, *y, *z)),
        _ => Err("three numbers are needed, such as 0,0,-9.81".to_owned()),
    }
}

fn parse_nuisance(text: &str) -> Result<Nuisances, String> {
    let named = Nuisance::named(text.trim()).ok_or_else(|| format!("nothing called `{text}` can be estimated"))?;
    Ok(Nuisances::of(named))
}

fn parse_noise(text: &str) -> Result<(f64, f64), String> {
    let positive = |part: &str| part.trim().parse().ok().filter(|x: &f64| *x > 0.0 && x.is_finite());
    text.split_once(',')
        .and_then(|(torque, force)| Some((positive(torque)?, positive(force)?)))
        .ok_or_else(|| "two positive numbers are needed, such as 1e-4,1e-3".to_owned())
}

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
    if args.arm.is_asked() {
        return identify_arm(args, robots);
    }
    if let (Some(throw), Some(calibration)) = (&args.wheel, &args.calibration) {
        return super::calibrate_wheel::identify_throw(throw, calibration, args.mass, args.json);
    }
    check_outputs(args)?;
    let settings = Settings {
        method: args.of_samples(),
        wrench_timing: args.wrench.into(),
        gravity_world: args.gravity,
        estimate: args.estimate.iter().fold(Nuisances::default(), |all, some| all.and(*some)),
        prior: args.prior.as_deref().map(body_file::read_prior).transpose()?,
        ..Settings::default()
    };
    let motion = Motion::of(args)?;
    let mut log = Log::read(args, robots)?;
    if let (Some(motion), Some(estimator)) = (&motion, args.harmonic()) {
        match identify_periodic::run(args, motion, estimator, &log) {
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
    let found = log.identify(&settings)?;
    let validation = match args.holdout {
        Some(_) if found.estimate.is_some() => Some(validate(&found, &log.held_out()?, &settings)?),
        _ => None,
    };
    let context = Context {
        source: log.source.clone(),
        reference: log.reference.as_ref().map(|(name, body)| (name.clone(), body)),
        validation,
        reader_warnings: log.warnings.clone(),
        duration_s: log.duration_s,
    };
    deliver(args, &found, &context)
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
    let of_log = args.reference.is_some()
        || args.prior.is_some()
        || args.holdout.is_some()
        || args.dry_run
        || args.split
        || args.reorder
        || args.robot.is_some()
        || args.excitation.is_some()
        || args.period.is_some()
        || args.gravity != Vector3::zeros();
    let of_one_body = args.reference.is_some()
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
        (args.harmonics == Some(0), "`--harmonics 0`: a motion has one at least"),
        (periodic && args.demo, "`--demo` is no periodic motion: leave out `--excitation` or `--period`"),
        (
            periodic && args.dry_run,
            "averaged cycles take no `--dry-run`; it works without `--excitation` or `--period`",
        ),
        (periodic && args.split, "averaged cycles take no `--split`; it works without `--excitation` or `--period`"),
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
        (args.seed.is_some() && !args.demo, "`--seed` belongs to `--demo`"),
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
        (!args.estimate.is_empty() && args.dry_run, "`--dry-run` estimates nothing: no `--estimate`"),
        (
            args.split && (output || args.holdout.is_some() || args.dry_run),
            "`--split` may find several bodies: no `--out`, `--export`, `--holdout`, `--dry-run`",
        ),
        (args.wrench_noise.is_some() && !args.dry_run, "`--wrench-noise` belongs to `--dry-run`"),
    ];
    match clash.iter().find(|(clashes, _)| *clashes) {
        Some((_, message)) => Err(TumbleError::BadOption { message: (*message).to_owned() }),
        None => Ok(()),
    }
}

/// Refuses outputs that could not be written before any long work is done.
fn check_outputs(args: &IdentifyArgs) -> Result<(), TumbleError> {
    if let Some(path) = &args.out {
        OutputFolder::check_place(path, args.force)?;
    }
    for path in [&args.out, &args.export].into_iter().flatten() {
        if path.exists() && !args.force {
            return Err(TumbleError::OutputExists { path: path.clone() });
        }
        let inputs = [&args.log, &args.reference, &args.prior, &args.excitation];
        let same =
            |input: &PathBuf| input.canonicalize().is_ok_and(|real| path.canonicalize().is_ok_and(|p| p == real));
        if inputs.into_iter().flatten().any(same) {
            return Err(TumbleError::BadOption {
                message: format!("{} is an input of this run; write the result somewhere else", path.display()),
            });
        }
    }
    if let Some(share) = args.holdout.filter(|share| !(0.0 < *share && *share < 1.0)) {
        return Err(TumbleError::BadOption {
            message: format!("`--holdout {share}`: the share kept back lies between 0 and 1, such as 0.25"),
        });
    }
    Ok(())
}

fn deliver(args: &IdentifyArgs, found: &Identification, context: &Context) -> Result<Outcome, TumbleError> {
    for warning in report::warnings(found, context) {
        eprintln!("warning: {warning}");
    }
    let json = serde_json::to_string(&report::json(found, context))
        .map_err(|error| FormatsError::BadToml { path: PathBuf::from("result.json"), message: error.to_string() })?;
    if args.json {
        print(&format!("{json}\n"))?;
    } else {
        print(&report::table(found, context))?;
    }
    match (&args.export, &found.estimate) {
        (Some(path), Some(estimate)) => {
            write_file(path, body_file::export(path, &estimate.parameters)?.as_bytes(), args.force)?;
            eprintln!("wrote {}", path.display());
        }
        (Some(path), None) => eprintln!("warning: no body to export; {} is not written", path.display()),
        (None, _) => {}
    }
    if let Some(path) = &args.out {
        let folder = OutputFolder::create(path, args.force)?;
        folder.write("result.json", &json)?;
        if let Some(estimate) = &found.estimate {
            folder.write("body.toml", &body_file::export(Path::new("body.toml"), &estimate.parameters)?)?;
        }
        report::write_page(&folder, found, context, &json)?;
        folder.write(RUN_RECORD, &run_record(args, &context.source))?;
        eprintln!("wrote {}", folder.finish()?.join("report.html").display());
    }
    Ok(if found.verdict.is_identified() { Outcome::Achieved } else { Outcome::NotAchieved })
}

/// Each part between changes of the body by itself.
fn split(args: &IdentifyArgs, log: &Log, settings: &Settings) -> Result<Outcome, TumbleError> {
    let Rows::Memory(record) = &log.rows else {
        return Err(TumbleError::BadOption {
            message: format!("`--split` holds the whole log in memory: at most {ROWS_IN_MEMORY} rows"),
        });
    };
    let parts = identify_parts(record, settings)?;
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
        };
        for warning in report::warnings(found, &context) {
            eprintln!("warning: part {}: {warning}", index + 1);
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
        print(&format!("{}\n", serde_json::json!({ "format": 1, "parts": shown })))?;
    }
    Ok(if identified { Outcome::Achieved } else { Outcome::NotAchieved })
}

/// What is needed to repeat the run.
pub(super) fn run_record(args: &IdentifyArgs, source: &str) -> String {
    let options: Vec<String> = std::env::args().skip(1).collect();
    serde_json::json!({
        "format": 1,
        "version": env!("CARGO_PKG_VERSION"),
        "commit": option_env!("TUMBLE_COMMIT"),
        "command": "identify",
        "configuration": options,
        "seed": args.demo.then(|| args.seed.unwrap_or(DEMO_SEED)),
        "input": source,
        "input_hash": args.log.as_deref().and_then(|path| tumble_formats::log::hash(path).ok()),
    })
    .to_string()
}

fn dry_run(args: &IdentifyArgs, log: &Log, settings: &Settings) -> Result<Outcome, TumbleError> {
    let wrench_noise = args.wrench_noise.unwrap_or(demo::WRENCH_NOISE);
    let mut prediction = None;
    log.for_each_part(ROWS_IN_MEMORY, |record| {
        prediction = Some(predict(record, settings, wrench_noise)?);
        Ok(ControlFlow::Break(()))
    })?;
    let Some(prediction) = prediction else {
        return Err(FormatsError::Empty { path: PathBuf::from(&log.source), what: "data rows" }.into());
    };
    for warning in &log.warnings {
        eprintln!("warning: {warning}");
    }
    if args.json {
        print(&format!("{}\n", report::prediction_json(&prediction, wrench_noise)))?;
    } else {
        print(&report::prediction_table(&prediction, &log.source, wrench_noise))?;
    }
    Ok(if prediction.rank == 10 { Outcome::Achieved } else { Outcome::NotAchieved })
}

/// The flight that `--demo` shows unless told otherwise.
const DEMO_SEED: u64 = 1;

/// Rows held in memory at once; a longer log is identified part by part and the parts' information added.
const ROWS_IN_MEMORY: usize = 200_000;
/// Residuals kept for the plots from each part of a long log.
const RESIDUALS_PER_PART: usize = 1000;

/// A log or the demo, with what the report says about it.
pub(super) struct Log {
    pub(super) source: String,
    pub(super) rows: Rows,
    /// Rows before the held-out part.
    estimation_rows: usize,
    pub(super) reference: Option<(String, InertialParameters<f64>)>,
    pub(super) warnings: Vec<String>,
    pub(super) duration_s: f64,
}

/// Where the samples are.
pub(super) enum Rows {
    /// All of them, in memory.
    Memory(Vec<MotionSample>),
    /// Too many for the memory: checked once, read again when needed.
    File { path: PathBuf, reorder: bool, robot: Option<String>, robots: Robots, count: usize },
}

impl Log {
    fn read(args: &IdentifyArgs, robots: &Robots) -> Result<Self, TumbleError> {
        let mut log = if args.demo { Self::from_demo(args.seed.unwrap_or(DEMO_SEED))? } else { Self::from_file(args, robots)? };
        let count = match &log.rows {
            Rows::Memory(record) => record.len(),
            Rows::File { count, .. } => *count,
        };
        #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)]
        let estimation_rows = args.holdout.map_or(count, |share| (count as f64 * (1.0 - share)).round() as usize);
        log.estimation_rows = estimation_rows;
        Ok(log)
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
        })
    }

    fn from_file(args: &IdentifyArgs, robots: &Robots) -> Result<Self, TumbleError> {
        let Some(path) = &args.log else {
            return Err(TumbleError::BadOption { message: "no log: name a file, or use --demo".to_owned() });
        };
        let reference = match &args.reference {
            Some(path) => Some(("reference".to_owned(), body_file::read(path)?)),
            None => None,
        };
        let mut reader = SampleReader::open(path, args.reorder, args.robot.as_deref(), robots)?;
        eprint!("{}", reader.contents());
        let mut record = Vec::new();
        let mut more = reader.read_chunk(&mut record, ROWS_IN_MEMORY)?;
        let (Some(first_ns), Some(mut last_ns)) = (record.first().map(|s| s.time_ns), record.last().map(|s| s.time_ns))
        else {
            return Err(FormatsError::Empty { path: path.clone(), what: "data rows" }.into());
        };
        if reader.lacks_wrench() && !args.dry_run {
            let reason = format!("no wrench is recorded for this robot: {}", recording::flight::WRENCH_TOPICS);
            return Err(FormatsError::NoFlight { path: path.clone(), reason }.into());
        }
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
            rows = Rows::File { path: path.clone(), reorder: args.reorder, robot: args.robot.clone(), robots: robots.clone(), count };
        }
        let warnings = reader.warnings();
        let duration_s = seconds(last_ns - first_ns);
        Ok(Self { source: path.display().to_string(), rows, estimation_rows: 0, reference, warnings, duration_s })
    }

    /// Calls `part` for each stretch of at most so many estimation rows, until it breaks off.
    fn for_each_part(
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
            Rows::File { path, reorder, robot, robots, .. } => {
                let mut reader = SampleReader::open(path, *reorder, robot.as_deref(), robots)?;
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

    /// The rows kept back, at most as many as fit in memory.
    fn held_out(&self) -> Result<Vec<MotionSample>, TumbleError> {
        match &self.rows {
            Rows::Memory(record) => Ok(record.get(self.estimation_rows..).unwrap_or_default().to_vec()),
            Rows::File { path, reorder, robot, robots, .. } => {
                let mut reader = SampleReader::open(path, *reorder, robot.as_deref(), robots)?;
                let mut rest = Vec::new();
                for _ in 0..self.estimation_rows {
                    reader.next_sample()?;
                }
                reader.read_chunk(&mut rest, ROWS_IN_MEMORY)?;
                Ok(rest)
            }
        }
    }

    fn identify(&self, settings: &Settings) -> Result<Identification, TumbleError> {
        if self.estimation_rows > LongRecord::LONG
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
                found = Some(identify(record, settings)?);
                Ok(ControlFlow::Continue(()))
            })?;
            return found.ok_or(FormatsError::Empty { path: PathBuf::from(&self.source), what: "data rows" }.into());
        }
        let alone = Settings { prior: None, ..*settings };
        let mut parts = Vec::new();
        self.for_each_part(rows_at_once, |record| {
            match identify(record, &alone) {
                // The last few rows of a long log may be too few for a row of their own.
                Err(IdentificationError::TooFewSamples { .. }) if !parts.is_empty() => {}
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

/// One line on stderr that replaces itself; silent in pipes.
fn progress(text: &str) {
    if std::io::stderr().is_terminal() {
        eprint!("\r{text}   ");
    }
}
