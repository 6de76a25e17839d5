//! The command line as a function: a program of one's own calls it with its robots.

#[cfg(feature = "astrobee")]
mod flying;

use crate::TumbleError;
use crate::cli::{
    Outcome, Said, arm, calibrate_wheel, captured, check, convert, excite, identify, print, sample, sensing,
};
#[cfg(feature = "astrobee")]
use crate::cli::{allocate, realize};
use clap::{Parser, Subcommand};
use std::ffi::OsString;
use std::io::IsTerminal as _;
use std::process::ExitCode;
use tumble_formats::{FormatsError, Robots};

const EXAMPLES: &str = "\
Examples:
  tumble fly                                   a robot with cargo it does not know: learn it on the way, arrive, report
  tumble campaign --missions 100 --draw        a hundred such robots, each another: how many arrive, how well
  tumble identify --demo                       simulate a flight, estimate, compare with the truth
  tumble sample log                            a log to try: flight.csv, and truth.toml to compare with
  tumble identify flight.csv                   mass, centre of mass and inertia from a log
  tumble identify flight.csv --dry-run         what could this log tell, and how well?
  tumble identify --template                   the columns of a log, with two valid rows
  tumble excite --fly                          design a motion that shows everything, and simulate its flight
  tumble identify log.csv --excitation excitation.toml
  tumble simulate iss-excite                   fly a scenario; `tumble scenario list` names them
  tumble plan iss-slalom                       a way around obstacles, and how far from the best it can be
  tumble sensing show nominal                  what a log of Astrobee is of its true motion; a file for `--sensing`
  tumble sensing check flight.csv              what a log shows of its own sensors: noise, delays, biases, gains
  tumble arm show astrobee-arm                 joints and bodies of an arm; also of a TOML or URDF file
  tumble check robot.urdf                      can the masses of a model be? also MJCF
  tumble calibrate-wheel cal_*.csv --out cal.toml
  tumble identify --wheel throw.csv --calibration cal.toml
  tumble convert flight.csv flight.mcap        a log for Foxglove and PlotJuggler
  tumble allocate wrenches.csv                 wanted wrenches to nozzle bytes, and what these give";

/// What the examples show of the feature `astrobee`.
const FLYING: [&str; 7] =
    ["fly", "campaign", "simulate", "plan", "allocate", "arm show astrobee-arm", "sensing show nominal"];

/// Examples of the commands that there are.
fn examples() -> String {
    let is_there = |line: &&str| {
        cfg!(feature = "astrobee") || !FLYING.iter().any(|name| line.starts_with(&format!("  tumble {name} ")))
    };
    EXAMPLES.lines().filter(is_there).collect::<Vec<_>>().join("\n")
}

/// Mass, centre of mass and inertia of a free-flying robot, from its logs.
#[derive(Parser)]
#[command(name = "tumble", version, after_help = examples(), arg_required_else_help = false)]
struct Tumble {
    #[command(subcommand)]
    command: Option<Command>,
}

#[derive(Subcommand)]
enum Command {
    /// Inertial parameters from a log of poses and wrenches, or from a wheel-driven throw.
    Identify(Box<identify::IdentifyArgs>),
    /// Designs a periodic motion that shows all inertial parameters, and simulates its flight.
    Excite(Box<excite::ExciteArgs>),
    #[cfg(feature = "astrobee")]
    #[command(flatten)]
    Flying(flying::Command),
    /// Lists and shows arms: those that come with the program, TOML and URDF files.
    Arm(arm::ArmArgs),
    /// Looks whether the masses and inertias of a robot model (URDF, MJCF) can be, and repairs what cannot.
    Check(check::CheckArgs),
    /// Calibrates the wheel-driven throwing device from throws of itself and of a proof block.
    CalibrateWheel(calibrate_wheel::CalibrateWheelArgs),
    #[cfg(feature = "astrobee")]
    /// Allocates wanted wrenches to Astrobee's twelve nozzles as its flight software does.
    Allocate(allocate::AllocateArgs),
    #[cfg(feature = "astrobee")]
    /// Computes the thrust and wrench that a propulsion module of Astrobee gives at its flap angles.
    Realize(realize::RealizeArgs),
    /// Lists and shows sensors: noise, wander, filters, gains, biases, delays.
    Sensing(sensing::SensingArgs),
    /// Writes files to try the other commands with: a log, a bag, an arm, throws, wrenches, a model.
    Sample(sample::SampleArgs),
    /// One log format into another: CSV, TUM, MCAP, and ROS 1 bags and PX4's ULog into these.
    Convert(convert::ConvertArgs),
}

/// Runs the command line with these arguments, the name of the program first, among these robots; what a shell is to be told.
///
/// A program with a robot of its own is this, and gets log reader, reports, scenarios, missions and campaigns:
///
/// ```no_run
/// use tumble::robots::shipped;
/// use tumble_dynamics::InertialParameters;
/// use tumble_formats::{BodyPreset, Robot};
///
/// struct Kite;
///
/// impl Robot for Kite {
///     fn name(&self) -> &'static str {
///         "kite"
///     }
///     fn sentence(&self) -> &'static str {
///         "a satellite of 40 kg"
///     }
///     fn bodies(&self) -> Vec<BodyPreset> {
///         vec![BodyPreset { name: "kite", body: InertialParameters::solid_box(40.0, [0.6, 0.6, 0.8]) }]
///     }
/// }
///
/// fn main() -> std::process::ExitCode {
///     tumble::run(std::env::args_os(), &shipped().with(Kite))
/// }
/// ```
pub fn run(arguments: impl IntoIterator<Item = OsString>, robots: &Robots) -> ExitCode {
    let parsed = match Tumble::try_parse_from(arguments) {
        Ok(parsed) => parsed,
        Err(refusal) if refusal.use_stderr() => {
            // Where nobody reads the refusal, the exit code still tells.
            let _ = refusal.print();
            return ExitCode::from(2);
        }
        // Help and version, which clap would print without a word of a full disk.
        Err(help) => {
            let text = help.render();
            let text = if std::io::stdout().is_terminal() { text.ansi().to_string() } else { text.to_string() };
            return ended(print(&text).map(|()| Outcome::Achieved));
        }
    };
    ended(parsed.run(robots))
}

/// What a command had to say, and whether what it was asked for was achieved.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Answer {
    /// How it ended.
    pub outcome: Outcome,
    /// What it printed.
    pub said: Said,
}

/// The same for a program that reads the answer itself: nothing is printed.
///
/// ```
/// use tumble::robots::shipped;
///
/// let listed = tumble::answer(["tumble", "arm", "list"].map(Into::into), &shipped())?;
/// assert!(listed.said.stdout.contains("ur10e"));
/// let refused = tumble::answer(["tumble", "fly", "--seed", "x"].map(Into::into), &shipped());
/// assert_eq!(refused.unwrap_err().code(), "T014");
/// # Ok::<(), tumble::TumbleError>(())
/// ```
///
/// # Errors
/// What the command ends with, and [`TumbleError::BadOption`] for arguments that are none.
pub fn answer(arguments: impl IntoIterator<Item = OsString>, robots: &Robots) -> Result<Answer, TumbleError> {
    let parsed = Tumble::try_parse_from(arguments).map_err(|refusal| TumbleError::of_options(&refusal))?;
    let (outcome, said) = captured(|| parsed.run(robots));
    Ok(Answer { outcome: outcome?, said })
}

impl Tumble {
    fn run(self, robots: &Robots) -> Result<Outcome, TumbleError> {
        match self.command {
            None => print(&format!(
                "tumble: what is this robot carrying?\n\n{}\n\n`tumble help COMMAND` lists the options of a command.\n",
                examples()
            ))
            .map(|()| Outcome::Achieved),
            Some(Command::Identify(args)) => identify::run(&args, robots),
            Some(Command::Excite(args)) => excite::run(&args),
            #[cfg(feature = "astrobee")]
            Some(Command::Flying(command)) => command.run(robots),
            Some(Command::Arm(args)) => arm::run(&args, robots),
            Some(Command::Check(args)) => check::run(&args),
            Some(Command::CalibrateWheel(args)) => calibrate_wheel::run(&args),
            #[cfg(feature = "astrobee")]
            Some(Command::Allocate(args)) => allocate::run(&args),
            #[cfg(feature = "astrobee")]
            Some(Command::Realize(args)) => realize::run(&args),
            Some(Command::Sensing(args)) => sensing::run(&args, robots),
            Some(Command::Sample(args)) => sample::run(&args),
            Some(Command::Convert(args)) => convert::run(&args, robots),
        }
    }
}

fn ended(outcome: Result<Outcome, TumbleError>) -> ExitCode {
    match outcome {
        Ok(Outcome::Achieved) => ExitCode::SUCCESS,
        Ok(Outcome::NotAchieved) => ExitCode::from(3),
        Err(error) => {
            report(&error);
            ExitCode::from(2)
        }
    }
}

fn report(error: &TumbleError) {
    if let TumbleError::File(FormatsError::Damaged { path, report, .. }) = error {
        tell!("{}", report.table(path));
    }
    tell_line!("error[{}]: {}\n  remedy: {}", error.code(), in_full(error), error.remedy());
}

/// An error with what lies beneath it, where its own text does not say so. Those of files say what they should of what lies beneath, which may
/// be all of the file.
fn in_full(error: &TumbleError) -> String {
    if matches!(error, TumbleError::File(_)) {
        return error.to_string();
    }
    let sources = std::iter::successors(std::error::Error::source(error), |error| error.source());
    sources
        .map(ToString::to_string)
        .fold(error.to_string(), |text, source| if text.contains(&source) { text } else { format!("{text}: {source}") })
}
