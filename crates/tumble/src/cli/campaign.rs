//! `tumble campaign`: missions over seeds and options, and parts of a campaign into a whole.

use super::flown_layers::FlownLayers;
use super::flown_sensing::FlownSensing;
use super::fly::Switch;
use super::said::progress;
use super::{Outcome, print};
use crate::TumbleError;
use crate::campaign::{
    Analysis, CampaignConfiguration, CampaignFolder, CampaignPlan, DryRun, MissionRunner, Part, Place, Progress, Row,
    Shard, SimulatedFlights, execute, merge, parse_faults, table, write_merged, write_tables,
};
use crate::mission::{FaultChoice, ModelChoice, WeightingChoice};
use crate::output::{RUN_RECORD, unused};
use crate::scenario::LARGEST_OUTSIDE;
use clap::{Args, Subcommand};
use std::io::IsTerminal as _;
use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};
use tumble_formats::FormatsError;
use tumble_formats::Robots;
use tumble_formats::log;

/// Options of `tumble campaign`.
#[derive(Args)]
#[command(
    args_conflicts_with_subcommands = true,
    after_help = "\
Every combination of scenario, fault, model, feedback and weighting flies with the same seeds; mission K's seed follows from --seed and K
alone, so that jobs, shards and machines change nothing. A campaign that was ended goes on where it was when the same command is given
again. Each row names the `tumble fly` command that flies it again. docs/campaigns.md describes columns, clusters and statistics.

Exit codes: 0 where every mission arrived, touched nothing and kept every limit (or none was to be flown); 2 for an error; 3 otherwise.

Examples:
  tumble campaign --missions 100                          a hundred seeds of the default scenario, on all cores
  tumble campaign iss-cargo granite-cargo --missions 200 --draw --weighting covariance,none
  tumble campaign --missions 2 --fault all:1,all:2        56 missions in which something fails
  tumble campaign --missions 20 --controller lqr          another layer by name, in every mission
  tumble campaign --missions 1000 --shard 3/16 --out parts   one part of sixteen, on any machine; then:
  tumble campaign merge parts --out campaign"
)]
pub struct CampaignArgs {
    #[command(subcommand)]
    command: Option<CampaignCommand>,
    #[command(flatten)]
    fly: FlyArgs,
}

#[derive(Subcommand)]
enum CampaignCommand {
    /// Parts of a campaign, flown with `--shard`, into the whole: the same bytes as without shards.
    Merge(MergeArgs),
}

#[derive(Args)]
struct MergeArgs {
    /// Parts, or folders that hold them.
    #[arg(required = true, value_name = "DIR")]
    parts: Vec<PathBuf>,
    /// Folder to write.
    #[arg(long, value_name = "DIR")]
    out: PathBuf,
    /// Replace an earlier result.
    #[arg(long)]
    force: bool,
    /// Print one JSON object and nothing else on stdout.
    #[arg(long)]
    json: bool,
}

#[derive(Args)]
#[allow(clippy::struct_excessive_bools)] // each is an option of its own
struct FlyArgs {
    /// Scenario files, or names of embedded ones (`tumble scenario list`).
    #[arg(value_name = "SCENARIO", default_value = DEFAULT_SCENARIO)]
    scenarios: Vec<String>,
    /// Seeds; each combination of options flies with each of them.
    #[arg(long, value_name = "N", default_value_t = 40)]
    missions: u64,
    /// All seeds follow from it.
    #[arg(long, value_name = "MASTER", default_value_t = 1)]
    seed: u64,
    /// What information is worth: one or more, with commas between.
    #[arg(long, value_delimiter = ',', value_enum, default_value = "covariance")]
    weighting: Vec<WeightingChoice>,
    /// Whether estimates reach planners and controller: one or both, with a comma between.
    #[arg(long, value_delimiter = ',', value_enum, default_value = "on")]
    feedback: Vec<Switch>,
    /// What the robot is taken for at the start: one or more, with commas between.
    #[arg(long, value_delimiter = ',', value_enum, default_value = "scenario")]
    model: Vec<ModelChoice>,
    /// What goes wrong: none, NAME:SEVERITY, NAME, all:SEVERITY, all; one or more, with commas between.
    #[arg(long, value_delimiter = ',', value_name = "FAULT", default_value = "none")]
    fault: Vec<String>,
    /// Draw each mission's payload (0 to 10 kg) and belief (off by up to a factor of two) by its seed.
    #[arg(long)]
    draw: bool,
    /// With `--draw`: how far beyond the factor of two the belief may be off, as a share of it, 0 to 0.3.
    #[arg(long, value_name = "SHARE", requires = "draw", default_value_t = 0.0, allow_negative_numbers = true)]
    outside: f64,
    #[command(flatten)]
    layers: FlownLayers,
    #[command(flatten)]
    sensing: FlownSensing,
    /// Missions at a time [default: one for each core].
    #[arg(long, value_name = "N")]
    jobs: Option<usize>,
    /// Fly only part INDEX of COUNT, with the index from 0, into the folder `part-INDEX-of-COUNT` in `--out`.
    #[arg(long, value_name = "INDEX/COUNT", requires = "out")]
    shard: Option<Shard>,
    /// Folder to write [default: tumble-out/campaign-SCENARIO-SEED, numbered where it exists]; with `--shard` the one of the parts.
    #[arg(long, value_name = "DIR")]
    out: Option<PathBuf>,
    /// Replace an earlier result, and give up what another campaign has begun there.
    #[arg(long)]
    force: bool,
    /// Fly nothing: rows with seeds, options and commands only.
    #[arg(long)]
    dry_run: bool,
    /// Print one JSON object and nothing else on stdout.
    #[arg(long)]
    json: bool,
}

/// What flies unless something is named.
const DEFAULT_SCENARIO: &str = "iss-cargo";
/// Most threads.
const MOST_JOBS: usize = 1024;

/// Runs the command.
///
/// # Errors
/// [`TumbleError`] for bad input.
pub fn run(args: &CampaignArgs, robots: &Robots) -> Result<Outcome, TumbleError> {
    match &args.command {
        Some(CampaignCommand::Merge(merge)) => run_merge(merge),
        None => run_missions(&args.fly, robots),
    }
}

fn run_merge(args: &MergeArgs) -> Result<Outcome, TumbleError> {
    let (plan, rows) = merge(&args.parts)?;
    let analysis = Analysis::new(&plan, &rows);
    let place = write_merged(&args.out, &plan, &rows, &analysis, args.force)?;
    say(&plan, &analysis, &place, args.json)
}

fn run_missions(args: &FlyArgs, robots: &Robots) -> Result<Outcome, TumbleError> {
    let flights = SimulatedFlights::find(&args.scenarios, args.sensing.sensing.as_deref(), robots)?;
    let plan = CampaignPlan::try_new(configuration(args, &flights)?)?;
    if args.dry_run {
        run_with(args, &plan, flights.name(), &DryRun)
    } else {
        run_with(args, &plan, flights.name(), &flights)
    }
}

fn configuration(args: &FlyArgs, flights: &SimulatedFlights) -> Result<CampaignConfiguration, TumbleError> {
    if !(0.0..=LARGEST_OUTSIDE).contains(&args.outside) {
        return Err(TumbleError::BadOption {
            message: format!("`--outside {}`: 0 to {LARGEST_OUTSIDE}", args.outside),
        });
    }
    let faults: Vec<Vec<Option<FaultChoice>>> =
        args.fault.iter().map(|text| parse_faults(text)).collect::<Result<_, _>>()?;
    Ok(CampaignConfiguration {
        format: 1,
        version: env!("CARGO_PKG_VERSION").to_owned(),
        build: build()?,
        master_seed: args.seed,
        missions: args.missions,
        draw: args.draw.then_some(args.outside),
        layers: args.layers.names()?,
        sensing: args.sensing.sensing.clone(),
        dry_run: args.dry_run,
        scenarios: flights.entries(&args.scenarios)?,
        faults: faults.concat(),
        models: args.model.clone(),
        feedbacks: args.feedback.iter().map(|feedback| *feedback == Switch::On).collect(),
        weightings: args.weighting.clone(),
    })
}

/// What this program was built from: rows of different builds are never mixed.
fn build() -> Result<String, TumbleError> {
    if let Some(commit) = option_env!("TUMBLE_COMMIT") {
        return Ok(commit.to_owned());
    }
    let unreadable = |source| FormatsError::Unreadable { path: "the program itself".into(), source };
    Ok(format!("program {}", log::hash(&std::env::current_exe().map_err(unreadable)?)?))
}

fn run_with(
    args: &FlyArgs,
    plan: &CampaignPlan,
    name: &str,
    runner: &impl MissionRunner,
) -> Result<Outcome, TumbleError> {
    let shard = args.shard.unwrap_or(Shard::WHOLE);
    let place = match (&args.out, args.shard) {
        (Some(folder), Some(shard)) => folder.join(shard.name()),
        (Some(folder), None) => folder.clone(),
        (None, _) => free_place(&Path::new("tumble-out").join(format!("campaign-{name}-{}", args.seed)), plan),
    };
    let is_complete = || Place::look(&place, plan.configuration(), shard) == Place::Complete;
    if args.shard.is_some() && !args.force && is_complete() {
        // a task that a cluster starts again
        let rows = Part::read(&place)?.rows;
        tell_line!("{} is complete already", place.display());
        return say_part(plan, shard, &rows, &place, args.json);
    }
    let cores = || std::thread::available_parallelism().map_or(1, usize::from);
    let jobs = args.jobs.unwrap_or_else(cores).clamp(1, MOST_JOBS);
    let (mut folder, begun) = CampaignFolder::open(&place, plan.configuration(), shard, args.force)?;
    let clock = Instant::now();
    let mut teller = Teller::new(clock);
    let rows = execute(plan, shard, jobs, runner, (folder.journal(), begun), |progress| teller.tell(progress))?;
    Teller::end();
    let timings = serde_json::json!({ "format": 1, "wall_s": clock.elapsed().as_secs_f64(), "jobs": jobs, "flown": teller.flown() });
    let add_timings = |output: &crate::output::OutputFolder| output.write("timings.json", &format!("{timings:#}\n"));
    if args.shard.is_some() {
        let place = folder.finish(&rows, add_timings)?;
        return say_part(plan, shard, &rows, &place, args.json);
    }
    let analysis = Analysis::new(plan, &rows);
    let place = folder.finish(&rows, |output| {
        add_timings(output)?;
        write_tables(output, plan, &rows, &analysis)
    })?;
    say(plan, &analysis, &place, args.json)
}

/// The first of `base`, `base-2`, ... where nothing is yet, or where this campaign was begun.
fn free_place(base: &Path, plan: &CampaignPlan) -> PathBuf {
    let numbered = |number: u32| {
        let mut name = base.as_os_str().to_os_string();
        name.push(format!("-{number}"));
        PathBuf::from(name)
    };
    let is_ours =
        |path: &PathBuf| matches!(Place::look(path, plan.configuration(), Shard::WHOLE), Place::Free | Place::Begun);
    let mut candidates = std::iter::once(base.to_path_buf()).chain((2..10_000).map(numbered));
    candidates.find(is_ours).unwrap_or_else(|| unused(base))
}

/// Prints what a whole campaign showed.
fn say(plan: &CampaignPlan, analysis: &Analysis, place: &Path, json: bool) -> Result<Outcome, TumbleError> {
    if json {
        let mut printed = serde_json::to_value(analysis).unwrap_or_default();
        printed["folder"] = place.display().to_string().into();
        print(&format!("{printed}\n"))?;
    } else {
        print(&table(analysis))?;
    }
    tell_line!("wrote {}: rows.csv, summary.json, {RUN_RECORD}", place.display());
    if plan.configuration().dry_run {
        tell_line!("nothing was flown; each row's `replay` is the command that would fly it");
        return Ok(Outcome::Achieved);
    }
    if analysis.is_clean() {
        return Ok(Outcome::Achieved);
    }
    tell_line!("not as it should be: rows.csv names the missions, and in `replay` the command that flies each again");
    Ok(Outcome::NotAchieved)
}

/// Prints what a part showed.
fn say_part(plan: &CampaignPlan, shard: Shard, rows: &[Row], place: &Path, json: bool) -> Result<Outcome, TumbleError> {
    let analysis = Analysis::of_part(plan, rows);
    let all = &analysis.all;
    if json {
        let mut printed = serde_json::to_value(all).unwrap_or_default();
        printed["format"] = 1.into();
        printed["shard"] = serde_json::to_value(shard).unwrap_or_default();
        printed["folder"] = place.display().to_string().into();
        print(&format!("{printed}\n"))?;
    } else {
        print(&format!(
            "part {} of {}: {} missions, {} arrived, {} collisions, {} with violations, {} errors, {} panics\n",
            shard.index,
            shard.count,
            all.missions,
            all.arrived.count,
            all.collisions.count,
            all.violations.count,
            all.errors,
            all.panics
        ))?;
    }
    let parts = place.parent().unwrap_or(Path::new("."));
    tell_line!(
        "wrote {}; when all parts are there: tumble campaign merge {} --out DIR",
        place.display(),
        parts.display()
    );
    Ok(if plan.configuration().dry_run || analysis.is_clean() { Outcome::Achieved } else { Outcome::NotAchieved })
}

/// Time between two lines of progress where there is no terminal whose line could change.
const BETWEEN_LINES: Duration = Duration::from_secs(30);
/// Where there is one.
const BETWEEN_LOOKS: Duration = Duration::from_millis(200);

/// Says how far the campaign is.
struct Teller {
    begun: Instant,
    said: Instant,
    last: Option<Progress>,
}

impl Teller {
    fn new(begun: Instant) -> Self {
        Self { begun, said: begun, last: None }
    }

    fn flown(&self) -> u64 {
        self.last.map_or(0, |progress| progress.flown)
    }

    fn tell(&mut self, progress_now: Progress) {
        if self.last.is_none() && progress_now.resumed > 0 {
            tell_line!("going on: {} of {} missions are flown", progress_now.resumed, progress_now.all);
        }
        self.last = Some(progress_now);
        let is_terminal = std::io::stderr().is_terminal();
        if self.said.elapsed() < if is_terminal { BETWEEN_LOOKS } else { BETWEEN_LINES } {
            return;
        }
        self.said = Instant::now();
        let line = progress_line(progress_now, self.begun.elapsed());
        if is_terminal { progress(&line) } else { tell_line!("{line}") }
    }

    fn end() {
        progress("");
    }
}

/// How many are flown, how fast, and how long it will take.
fn progress_line(progress: Progress, elapsed: Duration) -> String {
    let Progress { resumed, flown, all } = progress;
    let done = resumed + flown;
    let elapsed_s = elapsed.as_secs_f64();
    if flown == 0 || elapsed_s <= 0.0 {
        return format!("{done} of {all} missions");
    }
    let rate = flown as f64 / elapsed_s;
    let left_s = all.saturating_sub(done) as f64 / rate;
    format!("{done} of {all} missions, {rate:.2} a second, {} left", duration(left_s))
}

fn duration(seconds: f64) -> String {
    #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)] // not negative
    let whole = seconds.ceil() as u64;
    match (whole / 3600, whole / 60 % 60, whole % 60) {
        (0, 0, seconds) => format!("{seconds} s"),
        (0, minutes, seconds) => format!("{minutes} min {seconds} s"),
        (hours, minutes, _) => format!("{hours} h {minutes} min"),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn progress_counts_only_what_this_run_flew() {
        let progress = Progress { resumed: 50, flown: 10, all: 100 };
        let line = progress_line(progress, Duration::from_secs(5));
        assert_eq!(line, "60 of 100 missions, 2.00 a second, 20 s left");
        assert_eq!(progress_line(Progress { flown: 0, ..progress }, Duration::from_secs(5)), "50 of 100 missions");
        assert_eq!([5.0, 65.0, 7260.0].map(duration), ["5 s", "1 min 5 s", "2 h 1 min"]);
    }
}
