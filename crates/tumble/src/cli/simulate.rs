//! `tumble simulate`: flies a scenario and writes its log.

use super::commanded_nozzles::CommandedNozzles;
use super::flown_sensing::FlownSensing;
use super::said::progress;
use super::simulate_control;
use super::simulate_flight::{Flown, fly_to_log, seconds, to_goal};
use super::simulate_page;
use super::{Outcome, print};
use crate::TumbleError;
use crate::output::{OutputFolder, RUN_RECORD, unused};
use crate::page::Page;
use crate::scenario::{Flight, LONGEST_S, ScenarioSource};
use clap::Args;
use std::fmt::Write as _;
use std::fs::File;
use std::io::BufWriter;
use std::path::{Path, PathBuf};
use std::time::Instant;
use tumble_astrobee::simulator::{CONTROL_PERIOD_S, Event, TimedEvent};
use tumble_dynamics::{InertialParameters, World};
use tumble_formats::FormatsError;
use tumble_formats::Robots;
use tumble_formats::body_file::{self, BodyFile};
use tumble_formats::environment_file;
use tumble_formats::log;
use tumble_formats::recording::mcap_log::McapSink;
use tumble_formats::recording::rows::read_csv;

/// The file beside the log that tells of the environment.
const ENVIRONMENT: &str = "environment.toml";

/// Options of `tumble simulate`.
#[derive(Args)]
#[command(after_help = "\
Exit codes: 0; 2 for an error; 3 where the flight is complete but left its volume or table, hit an obstacle or passed a limit
(the events say which and when), or where its log holds no row. docs/scenarios.md describes scenario files and what is written.

Examples:
  tumble simulate iss-excite                   then: tumble identify tumble-out/simulate-iss-excite-1/log.csv
  tumble simulate iss-hold --sensing bumble    with the sensors that Bumble had on the station
  tumble simulate iss-payload                  nozzles that are off: tumble identify FOLDER/log.csv --actuators FOLDER/actuators.toml
  tumble simulate iss-slalom --seed 7 --mcap   another draw of all errors; with a log for Foxglove
  tumble scenario show iss-excite > my.toml    a scenario to change; then: tumble simulate my.toml")]
pub struct SimulateArgs {
    /// A scenario file, or the name of an embedded one (`tumble scenario list`).
    scenario: String,
    /// All random numbers follow from it; instead of the scenario's.
    #[arg(long, value_name = "N", allow_negative_numbers = true)]
    seed: Option<u64>,
    /// Length of the flight, s, at most 86400; instead of the scenario's.
    #[arg(long, value_name = "S", allow_hyphen_values = true)]
    duration: Option<f64>,
    #[command(flatten)]
    sensing: FlownSensing,
    /// Folder to write [default: tumble-out/simulate-SCENARIO-SEED, numbered where it exists].
    #[arg(long, value_name = "DIR")]
    out: Option<PathBuf>,
    /// Replace an earlier result.
    #[arg(long)]
    force: bool,
    /// Also write log.mcap, for Foxglove and the like: the log about as large again, with the world and the robot.
    #[arg(long)]
    mcap: bool,
    /// Print one JSON object and nothing else on stdout.
    #[arg(long)]
    json: bool,
}

/// Runs the command.
///
/// # Errors
/// [`TumbleError`] for bad input.
pub fn run(args: &SimulateArgs, robots: &Robots) -> Result<Outcome, TumbleError> {
    let mut source = args.sensing.of(ScenarioSource::find(&args.scenario)?.among(robots))?;
    if let Some(seed) = args.seed {
        source.scenario.seed = seed;
    }
    if let Some(duration_s) = args.duration {
        // Without this the scenario, which may be right, would be blamed.
        if !(CONTROL_PERIOD_S..=LONGEST_S).contains(&duration_s) {
            let message = format!("`--duration {duration_s}`: at least {CONTROL_PERIOD_S} s and at most {LONGEST_S} s");
            return Err(TumbleError::BadOption { message });
        }
        source.scenario.duration_s = duration_s;
    }
    let mut flight = source.flight()?;
    let (name, seed) = (source.scenario.name.clone(), source.scenario.seed);
    let place = match &args.out {
        Some(path) => path.clone(),
        None => unused(&Path::new("tumble-out").join(format!("simulate-{name}-{seed}"))),
    };
    let folder = OutputFolder::create(&place, args.force)?;
    let log_path = folder.file("log.csv");
    let nozzles = CommandedNozzles::of(&source)?;

    let clock = Instant::now();
    let (flown, rows, left_out) = fly_to_log(&mut flight, &nozzles, &log_path)?;
    let wall_s = clock.elapsed().as_secs_f64();
    if args.mcap {
        progress("writing log.mcap ...");
        write_mcap(&log_path, &folder.file("log.mcap"), &flight.world, &source.description()?)?;
    }
    progress("");

    let truth = flight.simulator.body();
    let summary = summary(&source, &flight, &flown, rows, left_out, &truth);
    let speed = flight.duration_ns as f64 * 1e-9 / wall_s.max(1e-9);
    folder.write("scenario.toml", &source.to_toml()?)?;
    nozzles.write(&folder)?;
    write_environment(&source, &folder)?;
    folder.write("truth.toml", &body_file::export(Path::new("truth.toml"), &truth)?)?;
    folder.write("summary.json", &format!("{summary:#}\n"))?;
    let timings = serde_json::json!({ "format": 1, "wall_s": wall_s, "speed_over_real_time": speed });
    folder.write("timings.json", &format!("{timings:#}\n"))?;
    folder.write(RUN_RECORD, &run_record(&source, &folder)?)?;
    let charts = simulate_page::charts(&flight, &flown);
    Page::chart_files(&folder, &charts)?;
    folder.write("report.html", &simulate_page::page(&source, &flight, &flown, rows, &charts, &summary)?)?;
    let place = folder.finish()?;
    let told = if args.json {
        let mut printed = summary;
        printed["speed_over_real_time"] = speed.into();
        printed["folder"] = place.display().to_string().into();
        print(&format!("{printed}\n"))
    } else {
        print(&table(&source, &flight, &flown, rows, left_out, speed)?)
    };
    let outcome = ended(&source, &place, &flight, rows, left_out);
    told?;
    Ok(outcome)
}

/// Says where the result is, and whether it is as it should be.
fn ended(source: &ScenarioSource, place: &Path, flight: &Flight, rows: u64, left_out: u64) -> Outcome {
    if rows == 0 {
        tell_line!(
            "wrote {}; not as it should be: the log holds no row, since no estimate of the {left_out} or none at all arrived in time; \
             fly longer, or correct `sensing`",
            place.display()
        );
        return Outcome::NotAchieved;
    }
    say_next(place, flight, &environment_option(source, place));
    let violations: Vec<&TimedEvent> =
        flight.simulator.events().iter().filter(|event| event.event.is_violation()).collect();
    let Some(first) = violations.first() else { return Outcome::Achieved };
    let more = if violations.len() > 1 { format!(" ({} such events)", violations.len()) } else { String::new() };
    tell_line!("not as it should be: {} at {:.3} s{more}", first.event, seconds(first));
    Outcome::NotAchieved
}

/// What acts beside the actuators, where the scenario says it: what `identify --environment` takes.
pub(super) fn write_environment(source: &ScenarioSource, folder: &OutputFolder) -> Result<(), TumbleError> {
    let Some(table) = &source.scenario.environment else { return Ok(()) };
    folder.write(ENVIRONMENT, &environment_file::text(table, &folder.file(ENVIRONMENT))?)
}

/// The log as `tumble convert` writes it, the world and the robot.
pub(super) fn write_mcap(log: &Path, path: &Path, world: &World, description: &str) -> Result<(), TumbleError> {
    let unwritable = |source| FormatsError::Unwritable { path: path.into(), source };
    let file = File::create(path).map_err(unwritable)?;
    let mut sink = McapSink::new(BufWriter::with_capacity(1 << 16, file))?;
    sink.world(world)?;
    sink.description(description)?;
    read_csv(log, &mut sink)?;
    Ok(sink.finish().map(drop).map_err(|error| match error {
        FormatsError::Unwritable { source, .. } => unwritable(source),
        other => other,
    })?)
}

/// The option by which `identify` is told of the environment beside a log in this folder; nothing where there is none.
pub(super) fn environment_option(source: &ScenarioSource, folder: &Path) -> String {
    let file = source.scenario.environment.as_ref().map(|_| folder.join(ENVIRONMENT));
    file.map_or_else(String::new, |file| format!(" --environment {}", file.display()))
}

/// Says where the result is, what to do with it, and what it cannot show.
fn say_next(place: &Path, flight: &Flight, environment: &str) {
    let shown = place.display();
    let changed = flight.simulator.events().iter().any(|event| match event.event {
        Event::PayloadAttached => event.time_ns > 0,
        Event::PayloadReleased => true,
        _ => false,
    });
    let split = if changed { " --split" } else { "" };
    tell_line!(
        "wrote {shown}; next: tumble identify {shown}/log.csv --reference {shown}/truth.toml{environment}{split}"
    );
    if changed {
        tell_line!(
            "note: the body changed in flight; truth.toml is the one at the end, `--split` looks for the others"
        );
    }
    if let Some(advice) = simulate_control::advice(flight) {
        tell_line!("{advice}");
    }
    if flight.place.is_planar() {
        tell_line!(
            "note: motion on a table shows the mass, x and y of its centre and the inertia about z at most; identify says \
             that the rest is not determined"
        );
    }
}

fn summary(
    source: &ScenarioSource,
    flight: &Flight,
    flown: &Flown,
    rows: u64,
    left_out: u64,
    truth: &InertialParameters<f64>,
) -> serde_json::Value {
    let events: Vec<serde_json::Value> = flight
        .simulator
        .events()
        .iter()
        .map(|event| {
            serde_json::json!({
                "t_s": seconds(event),
                "event": event.event.to_string(),
                "violation": event.event.is_violation(),
            })
        })
        .collect();
    serde_json::json!({
        "format": 1,
        "scenario": source.scenario.name,
        "seed": source.scenario.seed,
        "world": flight.place.name(),
        "degrees_of_freedom": if flight.place.is_planar() { 3 } else { 6 },
        "duration_s": flight.duration_ns as f64 / 1e9,
        "duration_asked_s": source.scenario.duration_s,
        "rows": rows,
        "estimates_left_out": left_out,
        "distance_m": flown.distance_m,
        "top_speed_m_s": flown.top_speed_m_s,
        "impulse_n_s": flown.impulse_n_s,
        "saturated_share": flown.saturated as f64 / flown.periods as f64,
        "largest_force_error_n": flown.largest_force_error_n,
        "to_goal": to_goal(flight).map(|(distance_m, angle_rad)| {
            serde_json::json!({ "distance_m": distance_m, "angle_rad": angle_rad })
        }),
        "tracking": flown.tracked.summary(),
        "control": simulate_control::summary(flight),
        "events": events,
        "events_not_listed": flight.simulator.events_lost(),
        "truth": BodyFile::from(truth),
    })
}

fn table(
    source: &ScenarioSource,
    flight: &Flight,
    flown: &Flown,
    rows: u64,
    left_out: u64,
    speed: f64,
) -> Result<String, TumbleError> {
    let truth = flight.simulator.body();
    let mut text = String::new();
    let Flown { periods, saturated, distance_m, top_speed_m_s, impulse_n_s, largest_force_error_n, .. } = flown;
    let _ = writeln!(text, "scenario {}, seed {}", source.scenario.name, source.scenario.seed);
    let mut line = |what: &str, value: String| {
        let _ = writeln!(text, "  {what:<28}{value}");
    };
    let freedom = if flight.place.is_planar() { "x, y and yaw" } else { "six degrees of freedom" };
    line("world", format!("{} ({freedom})", flight.place.name()));
    let (asked_s, flown_s) = (source.scenario.duration_s, flight.duration_ns as f64 / 1e9);
    let rounded = if (asked_s - flown_s).abs() > 1e-9 {
        format!(" (asked for {asked_s} s; flown are whole periods of {CONTROL_PERIOD_S} s)")
    } else {
        String::new()
    };
    line("duration", format!("{flown_s:.3} s, {speed:.0} x real time{rounded}"));
    line(
        "rows of the log",
        format!("{rows}{}", if left_out > 0 { format!(" ({left_out} estimates left out)") } else { String::new() }),
    );
    line("way flown", format!("{distance_m:.3} m, up to {top_speed_m_s:.3} m/s"));
    line("impulse of the force", format!("{impulse_n_s:.3} N s"));
    line("body at the end", format!("{:.3} kg (truth.toml)", truth.mass));
    line(
        "propulsion",
        format!(
            "{} (drag: {})",
            source.describe_propulsion()?,
            if source.scenario.propulsion.drag { "yes" } else { "no" }
        ),
    );
    line("at its limits", format!("{:.1} % of the time", 100.0 * *saturated as f64 / *periods as f64));
    line(
        "largest force error",
        format!("{largest_force_error_n:.4} N, applied less what the robot believes it applied"),
    );
    if let Some((distance, angle)) = to_goal(flight) {
        line("from the goal", format!("{distance:.3} m, {angle:.3} rad"));
    }
    flown.tracked.describe(&mut text);
    simulate_control::describe(flight, &mut text);
    let mut line = |what: &str, value: String| {
        let _ = writeln!(text, "  {what:<28}{value}");
    };
    let events = flight.simulator.events();
    line("events", if events.is_empty() { "none".to_owned() } else { events.len().to_string() });
    for event in events {
        let mark = if event.event.is_violation() { "  <- should not happen" } else { "" };
        let _ = writeln!(text, "    {:>9.3} s  {}{mark}", seconds(event), event.event);
    }
    if flight.simulator.events_lost() > 0 {
        let _ = writeln!(text, "    and {} more", flight.simulator.events_lost());
    }
    Ok(text)
}

/// What is needed to repeat the run.
fn run_record(source: &ScenarioSource, folder: &OutputFolder) -> Result<String, TumbleError> {
    let options: Vec<String> = std::env::args().skip(1).collect();
    Ok(serde_json::json!({
        "format": 1,
        "version": env!("CARGO_PKG_VERSION"),
        "commit": option_env!("TUMBLE_COMMIT"),
        "command": "simulate",
        "configuration": options,
        "seed": source.scenario.seed,
        "input_hash": { "scenario": log::hash(&folder.file("scenario.toml"))? },
    })
    .to_string())
}
