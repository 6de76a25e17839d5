//! `reproduce rattle`: figures 6.7 to 6.15 and 6.25 to 6.27 and tables 6.1 to 6.4 of the thesis, flown in simulation, and the
//! defects of the research code, each switched on alone.
//!
//! The thesis's recordings are not public: a figure is reproduced where missions under its conditions show what the thesis
//! concludes from it. Every claim is one line: holds, or does not, with numbers over the seeds. What must be so, else the program
//! fails: missions arrive, touch nothing, and keep every limit.

#![allow(clippy::cast_possible_truncation)] // counts

mod defects;
mod flights;
mod flown;
mod granite;
mod module;
mod pictures;

use std::fmt::Write as _;
use std::path::Path;
use std::time::Instant;

use serde_json::json;
use tumble::output::OutputFolder;

use crate::Failure;
use crate::actuation::{Picture, Section};
use crate::arguments::Arguments;
use crate::plot::{self, Scale};

/// Sensors that are flown with; the first where `--sensing` says nothing.
const SENSORS: [&str; 3] = ["nominal", "thesis-flight", "ideal"];

/// Seeds where `--seeds` says nothing.
const SEEDS: usize = 4;

type Part = fn(&'static str, usize) -> Result<Section, Failure>;

const PARTS: [(&str, &str, Part); 4] = [
    ("module", "In the module: figures 6.8 to 6.10 and 6.14, tables 6.1 and 6.4", module::section),
    ("granite", "On the table: figures 6.7, 6.11 and 6.12, tables 6.2 and 6.3", granite::section),
    ("flights", "Flights compared: figures 6.13, 6.15 and 6.25 to 6.27", flights::section),
    ("defects", "The defects of the research code, one at a time", defects::section),
];

pub fn bad(error: impl std::fmt::Display) -> Failure {
    Failure::BadInput(format!("rattle: {error}"))
}

/// What the thesis says, and whether it is so here.
pub fn claim(section: &mut Section, place: &str, what: &str, holds: bool, found: &str) {
    let verdict = if holds { "holds" } else { "does not hold" };
    println!("{}", json!({"block": "claim", "place": place, "claim": what, "holds": holds, "found": found}));
    section.printed(verdict, &format!("{place}: {what}: {found}"));
}

/// Runs the study.
pub fn run(arguments: &Arguments) -> Result<(), Failure> {
    let seeds = arguments.number("--seeds")?.unwrap_or(SEEDS).max(1);
    let sensing = match arguments.value("--sensing") {
        None => SENSORS[0],
        Some(named) => SENSORS.into_iter().find(|sensors| *sensors == named).ok_or_else(|| {
            Failure::BadInput(format!("no sensors are called `{named}`: there are {}", SENSORS.join(", ")))
        })?,
    };
    let only = arguments.value("--only");
    if let Some(unknown) = only.filter(|only| PARTS.iter().all(|(name, ..)| name != only)) {
        return Err(Failure::BadInput(format!("no part is called `{unknown}`")));
    }
    let out = arguments.value("--out").map(Path::new);
    if let Some(out) = out {
        OutputFolder::check_place(out, false).map_err(bad)?;
    }
    let mut text = format!(
        "# Chapter 6, RATTLE in closed loop, reproduced\n\nSensors `{sensing}`, seeds 1 to {seeds} of each condition, paired; numbers are medians with least and \
         largest in brackets unless something else is said.\n"
    );
    let mut sections = Vec::new();
    for (_, title, part) in PARTS.iter().filter(|(name, ..)| only.is_none_or(|only| only == *name)) {
        let began = Instant::now();
        let section = part(sensing, seeds)?;
        eprintln!("rattle: {title}: {:.1} s", began.elapsed().as_secs_f64());
        write!(text, "\n## {title}\n\n{}", section.text).map_err(bad)?;
        for picture in &section.pictures {
            write!(text, "\n![]({})", picture.name).map_err(bad)?;
        }
        text.push('\n');
        sections.push(section);
    }
    eprint!("{text}");
    if let Some(out) = out {
        let folder = OutputFolder::create(out, false).map_err(bad)?;
        folder.write("report.md", &text).map_err(bad)?;
        for section in &sections {
            for (name, table) in &section.tables {
                folder.write(name, table).map_err(bad)?;
            }
            for Picture { name, title, labels, curves } in &section.pictures {
                plot::draw(&folder.file(name), title, *labels, Scale::Linear, curves)?;
            }
        }
        let configuration = json!({ "sensing": sensing, "seeds": seeds, "only": only });
        folder.write("run.json", &crate::run_record("reproduce rattle", &configuration)).map_err(bad)?;
        eprintln!("written: {}", folder.finish().map_err(bad)?.display());
    }
    let missed: Vec<String> = sections.into_iter().flat_map(|section| section.missed).collect();
    if missed.is_empty() { Ok(()) } else { Err(Failure::TargetMissed(missed.join("\n"))) }
}
