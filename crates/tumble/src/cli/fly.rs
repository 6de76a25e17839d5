//! `tumble fly`: a mission in closed loop; `tumble replay`: the mission of a report, flown again.

use super::commanded_nozzles::CommandedNozzles;
use super::flown_layers::FlownLayers;
use super::flown_sensing::FlownSensing;
use super::fly_table::{Costs, table};
use super::said::progress;
use super::simulate::{environment_option, write_environment, write_mcap};
use super::{Outcome, print};
use crate::flight_log::{MoreColumns, Recorder};
use crate::mission::{
    self, FaultChoice, FlownPeriod, FlyOptions, MissionHooks, MissionRecord, ModelChoice, WeightingChoice,
};
use crate::output::{OutputFolder, RUN_RECORD, unused};
use crate::scenario::{ScenarioSource, draw_mission};
use crate::{TumbleError, mission_report};
use clap::{Args, ValueEnum};
use std::fs::File;
use std::io::BufWriter;
use std::path::{Path, PathBuf};
use std::time::Instant;
use tumble_formats::FormatsError;
use tumble_formats::Robots;
use tumble_formats::{body_file, log, text_file};
use tumble_planning::mission::Layer;

/// The scenario that is flown unless one is named.
const DEFAULT: &str = "iss-cargo";

/// Options of `tumble fly`.
#[derive(Args)]
#[command(after_help = "\
Exit codes: 0 where the robot arrived, hit nothing and passed no limit; 2 for an error; 3 otherwise (the table says why).
docs/missions.md describes what is flown, and every file that is written; report.html opens in any browser, offline.

Examples:
  tumble fly                                     the slalom on the station with cargo that the robot does not know of
  tumble fly granite-cargo --seed 7              three degrees of freedom; another draw of all errors
  tumble fly --weighting none --feedback off     the same mission without learning for its own sake, and without using it
  tumble fly --draw --seed 3                     another payload, another belief: the missions of `tumble campaign --draw`
  tumble fly --fault drop:3                      with half of the measurements lost; docs/missions.md lists the faults
  tumble fly my.toml --out there                 a scenario of your own (`tumble scenario show iss-cargo > my.toml`)")]
pub struct FlyArgs {
    /// A scenario file, or the name of an embedded one (`tumble scenario list`).
    #[arg(default_value = DEFAULT)]
    scenario: String,
    /// All random numbers follow from it; instead of the scenario's.
    #[arg(long, value_name = "N", allow_negative_numbers = true)]
    seed: Option<u64>,
    /// What information is worth to the local planner.
    #[arg(long, value_enum, default_value_t)]
    weighting: WeightingChoice,
    /// Whether planners and controller use what is learned.
    #[arg(long, value_enum, default_value_t)]
    feedback: Switch,
    /// What the robot is taken for at the start.
    #[arg(long, value_enum, default_value_t)]
    model: ModelChoice,
    #[command(flatten)]
    layers: FlownLayers,
    #[command(flatten)]
    sensing: FlownSensing,
    /// What goes wrong, and how badly: NAME or NAME:SEVERITY, severity 1 to 3.
    #[arg(long, value_name = "FAULT")]
    fault: Option<FaultChoice>,
    /// Draw payload (0 to 10 kg) and belief (off by up to a factor of two) by the seed, as a campaign does.
    #[arg(long)]
    draw: bool,
    /// With `--draw`: how far beyond the factor of two the belief may be off, as a share of it, 0 to 0.3.
    #[arg(long, value_name = "SHARE", requires = "draw", default_value_t = 0.0, allow_negative_numbers = true)]
    outside: f64,
    /// Folder to write [default: tumble-out/fly-SCENARIO-SEED, numbered where it exists].
    #[arg(long, value_name = "DIR")]
    out: Option<PathBuf>,
    /// Replace an earlier result.
    #[arg(long)]
    force: bool,
    /// Print one JSON object and nothing else on stdout.
    #[arg(long)]
    json: bool,
}

/// On or off.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, ValueEnum)]
pub enum Switch {
    /// Yes.
    #[default]
    On,
    /// No.
    Off,
}

/// Options of `tumble replay`.
#[derive(Args)]
#[command(after_help = "\
Exit codes: 0 where the mission came out the same, to the last digit; 2 for an error; 3 where it did not.

Example:
  tumble replay tumble-out/fly-iss-cargo-1/report.html")]
pub struct ReplayArgs {
    /// A report of `tumble fly`.
    report: PathBuf,
}

/// Looks on: shows progress, writes the log, measures what the layers cost.
struct Watch {
    recorder: Recorder<BufWriter<File>>,
    log: PathBuf,
    costs: Costs,
    since: Instant,
}

impl MissionHooks for Watch {
    fn progress(&mut self, time_s: f64, longest_s: f64) {
        progress(&format!("flying: {time_s:.0} s of at most {longest_s:.0} s ..."));
    }

    fn begins(&mut self, _layer: Layer) {
        self.since = Instant::now();
    }

    fn ends(&mut self, layer: Layer) {
        self.costs.took(layer, self.since.elapsed());
    }

    fn period(&mut self, period: &FlownPeriod<'_>) -> Result<(), TumbleError> {
        self.recorder.revise(period.plan_revision, period.belief_revision);
        self.recorder.estimated(&[period.estimate.0, period.estimate.1]);
        let written = self.recorder.record(period.measured, period.estimates);
        Ok(written.map_err(|source| FormatsError::Unwritable { path: self.log.clone(), source })?)
    }
}

/// Runs the command.
///
/// # Errors
/// [`TumbleError`] for bad input.
pub fn run(args: &FlyArgs, robots: &Robots) -> Result<Outcome, TumbleError> {
    let source = args.sensing.of(ScenarioSource::find(&args.scenario)?.among(robots))?;
    let options = FlyOptions {
        seed: args.seed.unwrap_or(source.scenario.seed),
        weighting: args.weighting,
        feedback: args.feedback == Switch::On,
        model: args.model,
        fault: args.fault,
        layers: args.layers.names()?,
    };
    let source = if args.draw { draw_mission(&source, options.seed, args.outside)? } else { source };
    let (name, seed) = (&source.scenario.name, options.seed);
    let place = match &args.out {
        Some(path) => path.clone(),
        None => unused(&Path::new("tumble-out").join(format!("fly-{name}-{seed}"))),
    };
    let folder = OutputFolder::create(&place, args.force)?;
    let log_path = folder.file("log.csv");
    let unwritable = |source| FormatsError::Unwritable { path: log_path.clone(), source };
    let file = File::create(&log_path).map_err(unwritable)?;
    let (nozzles, problem) = (CommandedNozzles::of(&source)?, source.mission(&options)?);
    let more = MoreColumns {
        nozzles: nozzles.largest_thrusts_n(),
        estimate: true,
        revisions: true,
        stored: problem.flight.simulator.stored_momentum_body().is_some(),
    };
    let recorder = Recorder::with(BufWriter::with_capacity(1 << 16, file), more).map_err(unwritable)?;
    let mut watch = Watch { recorder, log: log_path.clone(), costs: Costs::default(), since: Instant::now() };
    let clock = Instant::now();
    let record = mission::fly(&source, &options, &mut watch)?;
    let wall_s = clock.elapsed().as_secs_f64();
    let Watch { recorder, costs, .. } = watch;
    recorder.finish().map_err(unwritable)?;
    progress("writing the report ...");
    write_mcap(&log_path, &folder.file("log.mcap"), &problem.planning.world, &source.description()?)?;
    folder.write("scenario.toml", &record.scenario_toml)?;
    nozzles.write(&folder)?;
    write_environment(&source, &folder)?;
    folder.write("truth.toml", &body_file::export(Path::new("truth.toml"), &record.summary.body_at_end())?)?;
    folder.write("summary.json", &format!("{}\n", pretty(&record)?))?;
    folder.write("report.html", &mission_report::html(&record)?)?;
    for (name, picture) in mission_report::pictures(&record) {
        folder.write(&name, &picture)?;
    }
    folder.write("timings.json", &format!("{:#}\n", costs.json(wall_s)))?;
    folder.write(RUN_RECORD, &run_record(&options, &folder)?)?;
    let place = folder.finish()?;
    progress("");
    let told = if args.json {
        let mut printed = serde_json::to_value(&record.summary).map_err(unprintable)?;
        printed["folder"] = place.display().to_string().into();
        print(&format!("{printed}\n"))
    } else {
        print(&table(&record, &costs, wall_s))
    };
    let shown = place.display();
    let changed = record.payload.is_some_and(|held| held.held_s[0] > 0.0 || held.held_s[1] < record.summary.mission_s);
    let split = if changed { " --split" } else { "" };
    let environment = environment_option(&source, &place);
    tell_line!(
        "wrote {shown}; open {shown}/report.html, or: tumble identify {shown}/log.csv --reference {shown}/truth.toml{environment}{split}"
    );
    told?;
    Ok(verdict(&record))
}

fn verdict(record: &MissionRecord) -> Outcome {
    let Some(failed) = failure(record) else { return Outcome::Achieved };
    tell_line!("not as it should be: {failed}");
    Outcome::NotAchieved
}

/// What is not as it should be.
fn failure(record: &MissionRecord) -> Option<String> {
    let summary = &record.summary;
    if let Some(reason) = summary.unsafe_because() {
        let unavoidable = summary.unavoidable().map_or_else(String::new, |why| format!(" ({why})"));
        return Some(reason + &unavoidable);
    }
    if let Some(why) = &summary.no_way {
        return Some(format!("no way leads to the goal: {why}"));
    }
    (!summary.arrived).then(|| format!("the robot did not arrive within {:.0} s", summary.mission_s))
}

fn pretty(record: &MissionRecord) -> Result<String, TumbleError> {
    serde_json::to_string_pretty(&record.summary).map_err(unprintable)
}

fn unprintable(error: serde_json::Error) -> TumbleError {
    FormatsError::Unwritable { path: "summary.json".into(), source: error.into() }.into()
}

/// What is needed to repeat the run.
fn run_record(options: &FlyOptions, folder: &OutputFolder) -> Result<String, TumbleError> {
    Ok(serde_json::json!({
        "format": 1,
        "version": env!("CARGO_PKG_VERSION"),
        "commit": option_env!("TUMBLE_COMMIT"),
        "command": "fly",
        "configuration": serde_json::to_value(options).map_err(unprintable)?,
        "seed": options.seed,
        "input_hash": { "scenario": log::hash(&folder.file("scenario.toml"))? },
    })
    .to_string())
}

/// Flies the mission of a report again.
///
/// # Errors
/// [`TumbleError`] for a file that is no report.
pub fn replay(args: &ReplayArgs, robots: &Robots) -> Result<Outcome, TumbleError> {
    let text = text_file::read_regular(&args.report)
        .map_err(|source| FormatsError::Unreadable { path: args.report.clone(), source })?;
    let before = mission_report::record_of(&text, &args.report)?;
    let source = ScenarioSource::parse(&args.report, &before.scenario_toml)?.among(robots);
    if let Some(file) = source.files().first() {
        let message = format!("the mission record names the file {}, and no such record is written", file.display());
        return Err(TumbleError::BadReport { path: args.report.clone(), line: 1, message });
    }
    let mut silent = mission::NoHooks;
    let after = mission::fly(&source, &before.summary.options, &mut silent)?;
    let is_same = after == before;
    let word = if is_same { "the same, to the last digit" } else { "not the same" };
    print(&format!("{}: {word}\n", before.summary.scenario))?;
    if !is_same {
        let version = if after.version == before.version { "" } else { " (another version of the program)" };
        tell_line!("not as it should be: the mission came out differently{version}");
        return Ok(Outcome::NotAchieved);
    }
    Ok(Outcome::Achieved)
}
