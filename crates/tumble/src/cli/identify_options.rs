//! Options of `tumble identify`, and what its folders remember of them.

use super::check::exported;
use super::identify_arm::ArmOptions;
use crate::TumbleError;
use crate::added::Added;
use crate::output::{OutputFile, OutputFolder};
use clap::builder::{PossibleValue, PossibleValuesParser};
use clap::{Args, Command, FromArgMatches as _, ValueEnum};
use std::ffi::OsString;
use std::io::Write as _;
use std::path::PathBuf;
use tumble_dynamics::InertialParameters;
use tumble_dynamics::nalgebra::Vector3;
use tumble_formats::FormatsError;
use tumble_identification::estimator::{Estimator, EstimatorError};
use tumble_identification::harmonics::HarmonicEstimator;
use tumble_identification::{
    FLIGHT_LIKELIHOOD, MAXIMUM_LIKELIHOOD, MotionSample, Nuisance, Nuisances, Problem, WrenchTiming, methods,
};

/// The flight that `--demo` shows unless told otherwise.
pub(super) const DEMO_SEED: u64 = 1;

/// Options of `tumble identify`.
#[derive(Args, Clone)]
#[allow(clippy::struct_excessive_bools)]
pub struct IdentifyArgs {
    /// The log: CSV (`--template` prints its columns), ROS 1 bag, MCAP or PX4's ULog, also packed by gzip or from a pipe; `-` is standard input.
    pub(super) log: Option<PathBuf>,
    /// Further files of the same recording, bags or MCAP files: topics of all, messages by time.
    #[arg(value_name = "MORE", requires = "log")]
    pub(super) more: Vec<PathBuf>,
    /// Simulate a flight with unknown cargo, add noise, estimate and compare with the truth.
    #[arg(long, conflicts_with = "log")]
    pub(super) demo: bool,
    /// Which simulated flight; another seed gives another cargo and other noise. Of a scenario instead of its own.
    #[arg(long, value_name = "N")]
    pub(super) seed: Option<u64>,
    /// Print a valid log header with two rows, and stop.
    #[arg(long, exclusive = true)]
    pub(super) template: bool,
    /// Equations that tie motion to parameters.
    #[arg(long, default_value = AUTO, value_parser = method_names())]
    pub(super) method: String,
    /// When the logged wrench acts: from its row to the next (held), or as a continuous wrench sampled there.
    #[arg(long, value_enum, default_value_t = TimingName::Held)]
    pub(super) wrench: TimingName,
    /// Gravitational acceleration in inertial axes, m/s^2.
    #[arg(long, value_name = "X,Y,Z", default_value = "0,0,0", value_parser = parse_vector, allow_hyphen_values = true)]
    pub(super) gravity: Vector3<f64>,
    /// Prior knowledge of the body (TOML: a body and its standard deviations); enters the estimate.
    #[arg(long, value_name = "FILE")]
    pub(super) prior: Option<PathBuf>,
    /// What the maximum likelihood estimates besides the body: delay, force-scale, torque-scale, accelerometer-bias,
    /// accelerometer-scale, accelerometer-position, bias-wrench, table-slope, actuator-lag.
    #[arg(long, value_name = "NAMES", value_delimiter = ',', value_parser = parse_nuisance)]
    pub(super) estimate: Vec<Nuisances>,
    /// The body moves on a table: z, roll and pitch say nothing, and the table takes up its part of every wrench.
    #[arg(long, conflicts_with = "no_planar")]
    pub(super) planar: bool,
    /// The body is free, however flat its motion looks.
    #[arg(long)]
    pub(super) no_planar: bool,
    /// What the columns are of the true motion: noise, wander, filters, gains, biases, delays. A name (`tumble sensing list`) or a
    /// TOML file (`tumble sensing show NAME` prints one); left out, the log tells.
    #[arg(long, value_name = "NAME|FILE")]
    pub(super) sensing: Option<String>,
    /// The log holds commands of thrusters or rotors: what each gives and where (TOML; `docs/actuators.md`). They make the wrench, their errors
    /// are found, and one that is far off is named.
    #[arg(long, value_name = "FILE")]
    pub(super) actuators: Option<PathBuf>,
    /// What acts besides the logged wrench: gravity gradient, drag, constant wrenches (TOML; `docs/log-format.md`).
    #[arg(long, value_name = "FILE")]
    pub(super) environment: Option<PathBuf>,
    /// A body to compare with (TOML or JSON).
    #[arg(long, value_name = "FILE", conflicts_with = "demo")]
    pub(super) reference: Option<PathBuf>,
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
    pub(super) holdout: Option<f64>,
    /// Where the body changed within the log, identify the parts before and after separately.
    #[arg(long)]
    pub(super) split: bool,
    /// Say what this log can answer and how well, and nothing of the body: by the model that would identify it with the same options, or where no
    /// wrench is logged by the motion alone. Also of a scenario in the place of the log, by name or file: what `tumble simulate` would write of it
    /// (`--sensing` is then flown and told).
    #[arg(long)]
    pub(super) dry_run: bool,
    /// With --dry-run: judge the motion alone, under a wrench with this noise per sample, one sigma, N m and N (1e-4,1e-3 where no wrench is
    /// logged).
    #[arg(long, value_name = "TORQUE,FORCE", value_parser = parse_noise)]
    pub(super) wrench_noise: Option<(f64, f64)>,
    /// Put late rows in order and drop repeated times instead of refusing the log.
    #[arg(long)]
    pub(super) reorder: bool,
    /// Of a bag or MCAP file with several robots: the namespace of the one to identify.
    #[arg(long, value_name = "NAMESPACE")]
    pub(super) robot: Option<String>,
    /// Print one JSON object and nothing else on stdout.
    #[arg(long)]
    pub(super) json: bool,
    /// Write report.html, residual plots, result.json, body.toml and run.json into this new folder. The page tries a body from the first three quarters
    /// of the log on the last, which takes most of the time again.
    #[arg(long, value_name = "DIR")]
    pub(super) out: Option<PathBuf>,
    /// Write the body to a file: .toml, .json, .urdf, .xml (MJCF), .yaml (geometry_msgs/Inertia) or .script (set_target_payload of a UR arm).
    #[arg(long, value_name = "FILE")]
    pub(super) export: Option<PathBuf>,
    /// Of `--export`: write this URDF or MJCF with the body in one of its links, everything else as it is.
    #[arg(long, value_name = "MODEL")]
    pub(super) patch: Option<PathBuf>,
    /// Of `--patch`: which link; without it the only one with a mass, or else the only one that is on no other.
    #[arg(long, value_name = "NAME")]
    pub(super) link: Option<String>,
    /// Replace outputs that exist.
    #[arg(long)]
    pub(super) force: bool,
    /// A wheel-driven throw instead of a log.
    #[arg(long, value_name = "THROW", conflicts_with_all = ["log", "demo"])]
    pub(super) wheel: Option<PathBuf>,
    /// Calibration of the throwing device, from `tumble calibrate-wheel`.
    #[arg(long, value_name = "CAL")]
    pub(super) calibration: Option<PathBuf>,
    /// Mass of the thrown object, kg; needed to take the device's share from the inertia.
    #[arg(long, value_name = "KG")]
    pub(super) mass: Option<f64>,
    #[command(flatten)]
    pub(super) arm: ArmOptions,
}

/// Chosen by what the log holds.
pub(super) const AUTO: &str = "auto";
/// What estimates from averaged cycles, by name.
pub(super) const OF_CYCLES: [(&str, &str, HarmonicEstimator); 2] = [
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

/// Methods of a program's own.
pub static ADDED_METHODS: Added<Problem, dyn Estimator<Record = [MotionSample]> + Send + Sync, EstimatorError> =
    Added::none();

/// The library's methods, those of the program's own, and those of averaged cycles.
fn method_names() -> PossibleValuesParser {
    let of_cycles = OF_CYCLES.iter().map(|(name, sentence, _)| (*name, *sentence));
    let methods = ADDED_METHODS.to(methods());
    let named = methods.entries().chain(of_cycles);
    PossibleValuesParser::new(named.map(|(name, sentence)| PossibleValue::new(name).help(sentence)).collect::<Vec<_>>())
}

impl IdentifyArgs {
    /// Of options as the command line takes them, the name of the program left out.
    ///
    /// # Errors
    /// [`TumbleError::BadOption`] with what the command line would say.
    pub fn parse(options: impl IntoIterator<Item = OsString>) -> Result<Self, TumbleError> {
        let command = Self::augment_args(Command::new("identify").no_binary_name(true));
        let found = command.try_get_matches_from(options).and_then(|found| Self::from_arg_matches(&found));
        found.map_err(|refusal| TumbleError::of_options(&refusal))
    }

    /// What estimates from averaged cycles.
    pub(super) fn harmonic(&self) -> Option<HarmonicEstimator> {
        let of_cycles = OF_CYCLES.iter().find(|(name, ..)| *name == self.method);
        of_cycles.map(|(.., estimator)| *estimator).or((self.method == AUTO).then_some(HarmonicEstimator::Likelihood))
    }

    /// Whether they say what the log is of a body's motion, so that only a likelihood takes it.
    pub(super) fn has_model(&self) -> bool {
        self.sensing.is_some() || self.actuators.is_some() || self.planar || self.no_planar
    }

    /// Whether a promise is asked for of a scenario that nobody has flown.
    pub(super) fn is_of_scenario(&self) -> bool {
        #[cfg(feature = "astrobee")]
        let is_named = self.log.as_deref().is_some_and(is_scenario);
        #[cfg(not(feature = "astrobee"))]
        let is_named = false;
        self.dry_run && self.more.is_empty() && is_named
    }

    /// Every file of the log.
    pub(super) fn logs(&self) -> Vec<PathBuf> {
        self.log.iter().chain(&self.more).cloned().collect()
    }

    /// The method of a log that is not averaged.
    pub(super) fn of_samples(&self) -> &'static str {
        // Only the likelihood estimates anything besides the body, and only that of flight takes sensors.
        let asked = match (self.estimate.is_empty(), self.sensing.is_some() && self.method == AUTO) {
            (false, _) => MAXIMUM_LIKELIHOOD,
            (true, true) => FLIGHT_LIKELIHOOD,
            (true, false) => &self.method,
        };
        ADDED_METHODS.to(methods()).entries().find(|(name, _)| *name == asked).map_or(AUTO, |(name, _)| name)
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
        "input_hash": super::hash_of(&args.logs()),
    })
    .to_string()
}

/// What `--out` and `--export` ask for, their names held from the start.
#[derive(Default)]
pub(super) struct Outputs {
    pub(super) folder: Option<OutputFolder>,
    export: Option<OutputFile>,
}

impl Outputs {
    pub(super) fn reserve(args: &IdentifyArgs) -> Result<Self, TumbleError> {
        Ok(Self {
            folder: args.out.as_deref().map(|path| OutputFolder::create(path, args.force)).transpose()?,
            export: args.export.as_deref().map(|path| OutputFile::create(path, args.force)).transpose()?,
        })
    }

    /// Writes what `--export` asks for, where a body was found.
    pub(super) fn export(
        &mut self,
        args: &IdentifyArgs,
        body: Option<&InertialParameters<f64>>,
    ) -> Result<(), TumbleError> {
        let (Some(path), Some(mut file)) = (&args.export, self.export.take()) else { return Ok(()) };
        let Some(body) = body else {
            tell_line!("warning: no body to export; {} is not written", path.display());
            return Ok(());
        };
        let text = exported(path, args.patch.as_deref(), args.link.as_deref(), body)?;
        file.write_all(text.as_bytes()).map_err(|source| FormatsError::Unwritable { path: path.clone(), source })?;
        tell_line!("wrote {}", file.finish()?.display());
        Ok(())
    }
}

/// Whether what stands in the place of a log is a scenario: a TOML file, or the name of an embedded one where no file has it.
#[cfg(feature = "astrobee")]
fn is_scenario(named: &std::path::Path) -> bool {
    named.extension().is_some_and(|extension| extension == "toml")
        || !named.is_file() && crate::scenario::EMBEDDED.iter().any(|embedded| named.as_os_str() == embedded.name)
}
