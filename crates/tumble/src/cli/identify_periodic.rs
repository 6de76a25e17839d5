//! `tumble identify LOG --excitation FILE`: the cycles of a periodic motion, averaged.

use super::identify_log::{Log, Rows};
use super::identify_options::{IdentifyArgs, Outputs, run_record};
use super::{Outcome, print};
use crate::harmonic_report as report;
use crate::output::RUN_RECORD;
use crate::report::{Context, not_determined};
use crate::{TumbleError, space_cobot};
use std::fmt::Write as _;
use std::ops::Range;
use std::path::{Path, PathBuf};
use tumble_formats::body_file;
use tumble_formats::excitation_file::ExcitationFile;
use tumble_identification::estimator::Verdict;
use tumble_identification::fourier::FourierMotion;
use tumble_identification::harmonics::{
    HarmonicEstimator, HarmonicIdentification, HarmonicSettings, cramer_rao, identify_periodic,
};
use tumble_identification::{Noise, NullDirection};

/// Harmonics that are tried first where nothing says how many the motion has: the fewest that start and end at rest.
const FEWEST_HARMONICS: usize = 2;

/// Relative difference of sampling rates that is none.
const RATE_MISFIT: f64 = 0.01;
/// Differences from the motion above this share of its size are more than a payload's.
const OFF_COURSE: f64 = 0.3;

/// Root mean square of the difference between two motions over that of the first, in some channels and at the harmonics of
/// the first: where the channels are zero is no matter. `None` where the channels do not move.
fn relative_difference(wanted: &FourierMotion, flown: &FourierMotion, channels: Range<usize>) -> Option<f64> {
    let (few, many) = (wanted.basis().harmonics(), flown.basis().harmonics());
    let (mut size, mut difference) = (0.0, 0.0);
    for channel in channels {
        for harmonic in 1..=few.min(many) {
            // Coefficients are of the rate; of the value they are smaller with every harmonic.
            let weight = 1.0 / (harmonic * harmonic) as f64;
            for (row, flown_row) in [(harmonic, harmonic), (few + harmonic, many + harmonic)] {
                let one = wanted.coefficients()[(row, channel)];
                size += weight * one * one;
                difference += weight * (flown.coefficients()[(flown_row, channel)] - one).powi(2);
            }
        }
    }
    (size > 0.0).then(|| (difference / size).sqrt())
}

/// What is known of the motion: its file, or its period and harmonics.
pub(super) enum Motion {
    /// `--excitation`.
    File {
        /// Where it was read.
        path: PathBuf,
        /// What it says.
        file: Box<ExcitationFile>,
    },
    /// `--period` and `--harmonics`.
    Period {
        /// Period, s.
        period_s: f64,
        /// Fewest harmonics to try.
        harmonics: usize,
    },
}

impl Motion {
    /// What the options say of it; `None` where they say nothing.
    ///
    /// # Errors
    /// [`TumbleError`] for a bad file.
    pub(super) fn of(args: &IdentifyArgs) -> Result<Option<Self>, TumbleError> {
        let harmonics = args.harmonics.unwrap_or(FEWEST_HARMONICS);
        Ok(match (&args.excitation, args.period) {
            (Some(path), _) => Some(Self::File { path: path.clone(), file: Box::new(ExcitationFile::read(path)?) }),
            (None, Some(period_s)) => Some(Self::Period { period_s, harmonics }),
            (None, None) => None,
        })
    }

    fn settings(&self) -> Result<HarmonicSettings, TumbleError> {
        Ok(match self {
            Self::File { path, file } => HarmonicSettings {
                world_from_start: file.world_from_start(path)?,
                limits: Some(space_cobot::wrench_box(file.limits.force_n, file.limits.torque_n_m)),
                ..HarmonicSettings::new(file.period_s, file.harmonics)
            },
            Self::Period { period_s, harmonics } => HarmonicSettings::new(*period_s, *harmonics),
        })
    }

    /// Where the log says otherwise than the file, in words.
    fn contradictions(&self, found: &HarmonicIdentification, samples: usize) -> Result<Vec<String>, TumbleError> {
        let Self::File { path, file } = self else { return Ok(Vec::new()) };
        let mut warnings = Vec::new();
        let per_cycle = found.record.samples();
        let (rate_hz, cycles) = (per_cycle as f64 / file.period_s, samples / per_cycle.max(1));
        if (rate_hz - file.rate_hz).abs() > RATE_MISFIT * file.rate_hz || cycles != file.cycles {
            warnings.push(format!(
                "the log holds {cycles} cycles at {rate_hz:.4} Hz, {} states {} at {} Hz",
                path.display(),
                file.cycles,
                file.rate_hz
            ));
        }
        let wanted = file.motion(path)?;
        for (group, first) in [("position", 0), ("attitude", 3)] {
            if let Some(share) =
                relative_difference(&wanted, &found.motion, first..first + 3).filter(|s| *s > OFF_COURSE)
            {
                warnings.push(format!(
                    "the log does not follow this motion: the first {} harmonics of the {group} differ by {:.0} % of its size \
                     (root mean square); check the file, its `start`, where the cycles of the log begin, and whether actuators were at their limits",
                    file.harmonics,
                    100.0 * share
                ));
            }
        }
        Ok(warnings)
    }

    /// What this motion cannot show of any body, in words, where the motion is known.
    fn null_directions(&self) -> Result<Vec<NullDirection>, TumbleError> {
        let Self::File { path, file } = self else { return Ok(Vec::new()) };
        let (motion, body) = (file.motion(path)?, file.body.to_parameters(path)?);
        let noise = Noise {
            torque_n_m: file.noise.torque_n_m,
            force_n: file.noise.force_n,
            attitude_rad: file.noise.attitude_rad,
            position_m: file.noise.position_m,
            ..Noise::default()
        };
        let bound = cramer_rao(&motion, &body, 4 * file.harmonics + 1, 1, &noise)?;
        Ok(bound.observability.null_directions().to_vec())
    }
}

/// Runs the command.
///
/// # Errors
/// [`TumbleError`] for bad input; a log that cannot answer is [`Outcome::NotAchieved`].
pub(super) fn run(
    args: &IdentifyArgs,
    motion: &Motion,
    estimator: HarmonicEstimator,
    log: &Log,
    outputs: &mut Outputs,
) -> Result<Outcome, TumbleError> {
    let Rows::Memory(samples) = &log.rows else {
        return Err(TumbleError::BadOption {
            message: "a periodic motion is averaged in memory: this log is too long for that".to_owned(),
        });
    };
    let settings = HarmonicSettings {
        estimator,
        wrench_timing: args.wrench.into(),
        gravity_world: args.gravity,
        ..motion.settings()?
    };
    let found = match identify_periodic(samples, &settings) {
        Ok(found) => found,
        Err(error) => match Verdict::of_refusal(&error) {
            Some(Verdict::NotDetermined { rank, .. }) => {
                return unidentified(args, motion, &settings, log, samples.len(), rank);
            }
            _ => return Err(error.into()),
        },
    };
    let mut reader_warnings = log.warnings.clone();
    reader_warnings.extend(motion.contradictions(&found, samples.len())?);
    let context = Context {
        source: log.source.clone(),
        reference: log.reference.as_ref().map(|(name, body)| (name.clone(), body)),
        validation: None,
        reader_warnings,
        duration_s: log.duration_s,
        actuators: None,
    };
    deliver(args, &found, &settings, &context, samples.len(), outputs)
}

/// What may be wrong where nothing says that the motion leaves a parameter open.
const CONTRADICTED: &str = "nothing says that this motion leaves a parameter open: check the sign, frame and timing of the wrench, gravity, units, and \
     whether a constant wrench acts that is not logged (without `--excitation` and `--period`: `--estimate bias-wrench`)";

fn unidentified(
    args: &IdentifyArgs,
    motion: &Motion,
    settings: &HarmonicSettings,
    log: &Log,
    samples: usize,
    rank: usize,
) -> Result<Outcome, TumbleError> {
    let free = motion.null_directions()?;
    // The motion itself says more than its noisy record.
    let rank = rank.min(10 - free.len());
    let mut warnings = log.warnings.clone();
    if free.is_empty() {
        warnings.push(CONTRADICTED.to_owned());
    }
    for warning in &warnings {
        tell_line!("warning: {warning}");
    }
    if args.json {
        print(&format!("{}\n", report::unidentified_json(settings, samples, rank, &free, &warnings)))?;
    } else {
        let mut text = format!("{}\nverdict: {}\n", log.source, not_determined(rank, 10));
        for direction in free {
            let _ = writeln!(text, "  not determined: {direction}");
        }
        print(&text)?;
    }
    if args.out.is_some() || args.export.is_some() {
        tell_line!("warning: there is no body; nothing is written");
    }
    Ok(Outcome::NotAchieved)
}

fn deliver(
    args: &IdentifyArgs,
    found: &HarmonicIdentification,
    settings: &HarmonicSettings,
    context: &Context,
    samples: usize,
    outputs: &mut Outputs,
) -> Result<Outcome, TumbleError> {
    let warnings = report::warnings(found, context);
    for warning in &warnings {
        tell_line!("warning: {warning}");
    }
    let json = report::json(found, settings, context, samples).to_string();
    let table = report::table(found, settings, context, samples);
    let told = print(&if args.json { format!("{json}\n") } else { table.clone() });
    let body = &found.estimate.parameters;
    outputs.export(args, Some(body))?;
    if let Some(folder) = outputs.folder.take() {
        folder.write("result.json", &json)?;
        folder.write("body.toml", &body_file::export(Path::new("body.toml"), body)?)?;
        report::write_page(&folder, found, context, samples, &table, &json)?;
        folder.write(RUN_RECORD, &run_record(args, &context.source))?;
        tell_line!("wrote {}", folder.finish()?.join("report.html").display());
    }
    told?;
    Ok(if found.verdict.is_identified() { Outcome::Achieved } else { Outcome::NotAchieved })
}
