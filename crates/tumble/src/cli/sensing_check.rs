//! `tumble sensing check`: what a log shows of its own sensors.

use super::identify_log::ROWS_IN_MEMORY;
use super::identify_options::TimingName;
use super::{Outcome, by_name, log_files, named_together, paths_of, print};
use crate::TumbleError;
use crate::output::{OutputFolder, RUN_RECORD};
use crate::page::Page;
use crate::page::chart::{Axis, Chart};
use clap::Args;
use serde_json::{Map, Value, json};
use std::fmt::Write as _;
use std::path::PathBuf;
use tumble_formats::{FormatsError, Robots, SampleReader};
use tumble_identification::MotionSample;
use tumble_identification::sensing::{Contradiction, Found, SensingCheck, StreamCheck, StreamName, check};

/// Options of `tumble sensing check`.
#[derive(Args)]
pub struct CheckArgs {
    /// CSV log, bag, MCAP file or ULog, also packed by gzip or from a pipe; `-` is standard input. Several bags or MCAP files are one recording.
    /// No wrench is needed.
    #[arg(required = true, value_name = "LOG")]
    logs: Vec<PathBuf>,
    /// What is stated of the sensors, a name or a TOML file: what the log contradicts is said.
    #[arg(long, value_name = "NAME|FILE")]
    sensing: Option<String>,
    /// When the wrench of a row acts.
    #[arg(long, value_enum, default_value_t = TimingName::Held)]
    wrench: TimingName,
    /// Whose flight a recording of several robots is.
    #[arg(long)]
    robot: Option<String>,
    /// Puts rows whose times go back in order.
    #[arg(long)]
    reorder: bool,
    /// Prints one JSON object.
    #[arg(long)]
    json: bool,
    /// Folder for `sensing.json`, `run.json` and a picture of the attitude errors.
    #[arg(long, value_name = "DIR")]
    out: Option<PathBuf>,
    /// Replaces a folder that exists.
    #[arg(long, requires = "out")]
    force: bool,
}

/// Runs the command; [`Outcome::NotAchieved`] where the log tells nothing.
///
/// # Errors
/// [`TumbleError`] for bad input.
pub(super) fn run(args: &CheckArgs, robots: &Robots) -> Result<Outcome, TumbleError> {
    let folder = args.out.as_deref().map(|path| OutputFolder::create(path, args.force)).transpose()?;
    let stated = args.sensing.as_deref().map(|name| super::named_sensing::find(name, robots)).transpose()?;
    let record = read(args, robots)?;
    let found = check(&record, args.wrench.into())?;
    let contradictions = found.contradictions(stated.as_ref());
    let text = serde_json::to_string(&object(&found, &contradictions))
        .map_err(|error| FormatsError::BadToml { path: PathBuf::from("sensing.json"), message: error.to_string() })?;
    let told = if args.json { print(&format!("{text}\n")) } else { print(&table(&found, &contradictions)) };
    if let Some(folder) = folder {
        write(args, folder, &found, &text)?;
    }
    told?;
    Ok(if found.tells() { Outcome::Achieved } else { Outcome::NotAchieved })
}

fn read(args: &CheckArgs, robots: &Robots) -> Result<Vec<MotionSample>, TumbleError> {
    let files = log_files(&args.logs)?;
    rows(args, &paths_of(&files), robots).map_err(|error| by_name(&files, error))
}

fn rows(args: &CheckArgs, paths: &[PathBuf], robots: &Robots) -> Result<Vec<MotionSample>, TumbleError> {
    let mut reader = SampleReader::open_all(paths, args.reorder, args.robot.as_deref(), robots)?;
    let mut record = Vec::new();
    if reader.read_chunk(&mut record, ROWS_IN_MEMORY)? {
        tell_line!("warning: the first {ROWS_IN_MEMORY} rows are looked at, not those behind");
    }
    if record.is_empty() {
        return Err(FormatsError::Empty { path: named_together(&args.logs).into(), what: "data rows" }.into());
    }
    for warning in reader.warnings() {
        tell_line!("warning: {warning}");
    }
    Ok(record)
}

fn write(args: &CheckArgs, folder: OutputFolder, found: &SensingCheck, text: &str) -> Result<(), TumbleError> {
    folder.write("sensing.json", text)?;
    if !found.attitude_errors.is_empty() {
        let curve = |(axis, name): (usize, &'static str)| -> (_, Vec<[f64; 2]>) {
            (name, found.attitude_errors.iter().map(|(t, error)| [*t, error[axis]]).collect())
        };
        let curves = ["x", "y", "z"].into_iter().enumerate().map(curve);
        let title = "Attitude against the integrated rate";
        Page::chart_files(&folder, &[Chart::of_curves("attitude_error", title, "rad", Axis::seconds(), curves)])?;
    }
    let options: Vec<String> = std::env::args().skip(1).collect();
    let record = json!({
        "format": 1,
        "version": env!("CARGO_PKG_VERSION"),
        "commit": option_env!("TUMBLE_COMMIT"),
        "command": "sensing check",
        "configuration": options,
        "seed": null,
        "input": named_together(&args.logs),
        "input_hash": super::hash_of(&args.logs),
    });
    folder.write(RUN_RECORD, &record.to_string())?;
    tell_line!("wrote {}", folder.finish()?.display());
    Ok(())
}

/// A number and its standard deviation under `name` and `name` with `_sigma` before its unit.
fn insert(into: &mut Map<String, Value>, name: &str, sigma: &str, found: Option<Found>) {
    into.insert(name.to_owned(), json!(found.map(|f| f.value)));
    into.insert(sigma.to_owned(), json!(found.map(|f| f.sigma)));
}

/// Three numbers; `null` where none could be told.
fn insert_three(into: &mut Map<String, Value>, name: &str, three: Option<[Option<Found>; 3]>) {
    let three = three.filter(|t| t.iter().any(Option::is_some));
    into.insert(name.to_owned(), json!(three.map(|t| t.map(|f| f.map(|f| f.value)))));
    into.insert(format!("{name}_sigma"), json!(three.map(|t| t.map(|f| f.map(|f| f.sigma)))));
}

/// The object of `--json`.
fn object(found: &SensingCheck, contradictions: &[Contradiction]) -> Value {
    let pose = found.pose.map(|pose| {
        let mut object = Map::new();
        for (name, sigma, value) in [
            ("position_white_m", "position_white_sigma_m", pose.position_white_m),
            ("position_wander_m", "position_wander_sigma_m", pose.position_wander_m),
            ("position_wander_time_s", "position_wander_time_sigma_s", pose.position_wander_time_s),
            ("attitude_white_rad", "attitude_white_sigma_rad", pose.attitude_white_rad),
            ("attitude_wander_rad", "attitude_wander_sigma_rad", pose.attitude_wander_rad),
            ("attitude_wander_time_s", "attitude_wander_time_sigma_s", pose.attitude_wander_time_s),
            ("wander_time_s", "wander_time_sigma_s", pose.wander_time_s()),
        ] {
            insert(&mut object, name, sigma, value);
        }
        object
    });
    let streams: Vec<Map<String, Value>> = found.streams.iter().map(stream).collect();
    let said: Vec<Value> = contradictions
        .iter()
        .map(|c| {
            json!({
                "key": c.key,
                "what": c.what,
                "stated": c.stated,
                "stated_sigma": c.stated_sigma,
                "found": c.found.value,
                "found_sigma": c.found.sigma,
                "message": c.to_string(),
            })
        })
        .collect();
    json!({
        "format": 1,
        "pose": pose,
        "streams": streams,
        "reference": found.reference.map(StreamName::name),
        "alignment": found.alignment.map(|a| {
            let q = a.pose_from_rate.coords;
            json!({ "pose_from_rate_quaternion_xyzw": [q.x, q.y, q.z, q.w], "sigma_rad": a.sigma_rad })
        }),
        "lever_arm_m": found.lever_arm_m.map(|arm| arm.map(|f| f.value)),
        "lever_arm_sigma_m": found.lever_arm_m.map(|arm| arm.map(|f| f.sigma)),
        "gravity_added_m_s2": found.gravity_added_m_s2.map(|g| g.value),
        "gravity_added_sigma_m_s2": found.gravity_added_m_s2.map(|g| g.sigma),
        "contradictions": said,
    })
}

fn stream(check: &StreamCheck) -> Map<String, Value> {
    let mut object = Map::new();
    object.insert("name".to_owned(), json!(check.stream.name()));
    object.insert("samples".to_owned(), json!(check.samples));
    object.insert("interval_s".to_owned(), json!(check.interval_s));
    insert(&mut object, "offset_s", "offset_sigma_s", check.offset_s);
    insert(&mut object, "white", "white_sigma", check.white);
    insert(&mut object, "wander", "wander_sigma", check.wander);
    insert(&mut object, "wander_time_s", "wander_time_sigma_s", check.wander_time_s);
    insert_three(&mut object, "bias", check.bias);
    insert_three(&mut object, "gain", check.gain);
    object
}

/// `value +- sigma` with the digits that the standard deviation leaves.
fn text(found: Option<Found>) -> String {
    let Some(Found { value, sigma }) = found else { return "not told".to_owned() };
    if !(sigma > 0.0 && sigma.is_finite()) {
        return format!("{value}");
    }
    #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "between 0 and 12")]
    let digits = (1.0 - sigma.log10().floor()).clamp(0.0, 12.0) as usize;
    format!("{value:.digits$} +- {sigma:.digits$}")
}

fn table(found: &SensingCheck, contradictions: &[Contradiction]) -> String {
    let mut out = String::new();
    let mut line = |name: &str, value: &str, unit: &str| {
        let _ = writeln!(out, "  {name:<24}{value:<30}{unit}");
    };
    for check in &found.streams {
        let header = format!("{} samples, one every {:.4} s", check.samples, check.interval_s);
        line(check.stream.name(), &header, "");
        let whose = found.reference.map_or("", StreamName::name);
        let age =
            if Some(check.stream) == found.reference { "ages count from it".to_owned() } else { text(check.offset_s) };
        line("  age", &age, &format!("s, by the clock of the {whose}"));
        if check.stream == StreamName::Pose {
            let pose = found.pose.unwrap_or_default();
            for (name, value, unit) in [
                ("  position, white", pose.position_white_m, "m"),
                ("  position, slow", pose.position_wander_m, "m"),
                ("  position, slow, time", pose.position_wander_time_s, "s"),
                ("  attitude, white", pose.attitude_white_rad, "rad"),
                ("  attitude, slow", pose.attitude_wander_rad, "rad"),
                ("  attitude, slow, time", pose.attitude_wander_time_s, "s"),
            ] {
                line(name, &text(value), unit);
            }
            continue;
        }
        for (name, value) in [("  white", check.white), ("  slow", check.wander), ("  slow, time", check.wander_time_s)]
        {
            if value.is_some() {
                line(name, &text(value), "");
            }
        }
        for (name, three) in [("  bias", check.bias), ("  gain", check.gain)] {
            for (axis, value) in ["x", "y", "z"].into_iter().zip(three.iter().flatten()) {
                line(&format!("{name} {axis}"), &text(*value), "");
            }
        }
        if check.stream == StreamName::Acceleration {
            line("  gravity added", &text(found.gravity_added_m_s2), "m/s^2 along the world's z");
        }
    }
    for contradiction in contradictions {
        let _ = writeln!(out, "contradicted: {contradiction}");
    }
    out
}
