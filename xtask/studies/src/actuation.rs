//! `reproduce actuation`: figures 6.16 to 6.18 and 6.22 to 6.24 and tables 6.5 to 6.7 of the thesis, on simulated flights.
//!
//! The thesis's recordings are not public: sizes that it shows in pictures only are settings of the simulation, and a figure is
//! reproduced where the effect and what the thesis concludes from it appear in flights that have its stated cause.

mod delays;
mod flight;
mod limits;
mod messages;
mod outliers;
mod saturation;
mod scale;
mod tables;

use std::fmt::{self, Write as _};
use std::path::Path;
use std::time::Instant;

use serde_json::json;
use tumble::output::OutputFolder;

use crate::Failure;
use crate::arguments::Arguments;
use crate::plot::{self, Curve, Scale};

/// Flights of each condition where `--flights` says nothing.
const FLIGHTS: usize = 48;
/// Draws for each mean over random wrenches, per flight.
const DRAWS_PER_FLIGHT: usize = 2_500;

/// A picture of curves.
pub struct Picture {
    pub name: &'static str,
    pub title: &'static str,
    pub labels: [&'static str; 2],
    pub curves: Vec<Curve>,
}

/// What one part of the study says.
#[derive(Default)]
pub struct Section {
    pub text: String,
    /// Claims that should hold and do not.
    pub missed: Vec<String>,
    /// CSV files: name and contents.
    pub tables: Vec<(&'static str, String)>,
    pub pictures: Vec<Picture>,
}

impl Section {
    pub fn line(&mut self, text: impl AsRef<str>) {
        self.text.push_str(text.as_ref());
        self.text.push('\n');
    }

    /// Header of a table.
    pub fn columns(&mut self, names: &[&str]) {
        self.line(format!("\n| {} |\n|{}", names.join(" | "), "---|".repeat(names.len())));
    }

    pub fn row(&mut self, cells: &[String]) {
        self.line(format!("| {} |", cells.join(" | ")));
    }

    /// Something that must be so here; the run fails where it is not.
    pub fn must(&mut self, holds: bool, what: &str) {
        self.line(format!("- {}: {what}", if holds { "**met**" } else { "**missed**" }));
        if !holds {
            self.missed.push(what.to_owned());
        }
    }

    /// Something the thesis says.
    pub fn printed(&mut self, verdict: &str, what: &str) {
        self.line(format!("- thesis, **{verdict}**: {what}"));
    }

    pub fn draw(&mut self, name: &'static str, title: &'static str, labels: [&'static str; 2], curves: Vec<Curve>) {
        self.pictures.push(Picture { name, title, labels, curves });
    }
}

/// Mean and spread of one number over flights.
#[derive(Clone, Copy)]
pub struct Spread {
    pub mean: f64,
    /// Standard deviation of one flight.
    pub sigma: f64,
    pub count: usize,
}

impl Spread {
    pub fn of(values: impl IntoIterator<Item = f64>) -> Self {
        let values: Vec<f64> = values.into_iter().collect();
        let n = values.len() as f64;
        let mean = values.iter().sum::<f64>() / n;
        let squares: f64 = values.iter().map(|x| (x - mean) * (x - mean)).sum();
        Self { mean, sigma: (squares / (n - 1.0).max(1.0)).sqrt(), count: values.len() }
    }

    /// Standard deviation of the mean.
    pub fn sigma_of_mean(&self) -> f64 {
        self.sigma / (self.count as f64).sqrt()
    }

    /// The same in other units.
    pub fn times(self, factor: f64) -> Self {
        Self { mean: self.mean * factor, sigma: self.sigma * factor.abs(), ..self }
    }
}

impl fmt::Display for Spread {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let digits = f.precision().unwrap_or(3);
        write!(f, "{:.digits$} ± {:.digits$}", self.mean, self.sigma)
    }
}

/// `x, y` rows under a header.
pub fn csv(header: &str, rows: impl IntoIterator<Item = Vec<f64>>) -> String {
    let mut text = format!("{header}\n");
    for row in rows {
        let cells: Vec<String> = row.iter().map(|value| format!("{value:.9e}")).collect();
        text.push_str(&cells.join(","));
        text.push('\n');
    }
    text
}

pub fn curve(name: &str, points: impl IntoIterator<Item = (f64, f64)>) -> Curve {
    Curve { name: name.to_owned(), points: points.into_iter().collect() }
}

pub fn study(error: impl fmt::Display) -> Failure {
    Failure::BadInput(error.to_string())
}

/// How much is flown and drawn.
#[derive(Clone, Copy)]
pub struct Size {
    pub flights: usize,
    pub draws: usize,
}

type Part = fn(Size) -> Result<Section, Failure>;

const PARTS: [(&str, Part); 7] = [
    ("Figure 6.16, Algorithm 2: messages per second and their order", messages::section),
    ("Figure 6.18: the delay", delays::section),
    ("Figure 6.17, table 6.5: projected and measured acceleration", scale::section),
    ("Figure 6.22, table 6.6: the tables of the inverse allocation", tables::section),
    ("Table 6.7: limits", limits::section),
    ("Figure 6.23: torque after saturation, and what it costs the estimates", saturation::section),
    ("Figure 6.24: outliers and the gate", outliers::section),
];

/// Runs the study.
pub fn run(arguments: &Arguments) -> Result<(), Failure> {
    let start = Instant::now();
    let flights = arguments.number("--flights")?.unwrap_or(FLIGHTS).max(2);
    let size = Size { flights, draws: flights * DRAWS_PER_FLIGHT };
    let out = arguments.value("--out").map(Path::new);
    if let Some(out) = out {
        OutputFolder::check_place(out, false).map_err(study)?;
    }
    let mut text = format!(
        "# Chapter 6, actuation and sensing, reproduced\n\n{flights} flights of each condition, seeds 0 to {}; numbers are mean ± \
         standard deviation of one flight unless something else is said.\n",
        flights - 1
    );
    let mut sections = Vec::new();
    for (title, part) in PARTS {
        let began = Instant::now();
        let section = part(size)?;
        eprintln!("actuation: {title}: {:.1} s", began.elapsed().as_secs_f64());
        write!(text, "\n## {title}\n\n{}", section.text).map_err(study)?;
        for picture in &section.pictures {
            write!(text, "\n![]({})", picture.name).map_err(study)?;
        }
        text.push('\n');
        sections.push(section);
    }
    print!("{text}");
    if let Some(out) = out {
        let folder = OutputFolder::create(out, false).map_err(study)?;
        folder.write("report.md", &text).map_err(study)?;
        for section in &sections {
            for (name, table) in &section.tables {
                folder.write(name, table).map_err(study)?;
            }
            for Picture { name, title, labels, curves } in &section.pictures {
                plot::draw(&folder.file(name), title, *labels, Scale::Linear, curves)?;
            }
        }
        let configuration = json!({ "flights": flights, "seconds": start.elapsed().as_secs_f64().round() });
        folder.write("run.json", &crate::run_record("reproduce actuation", &configuration)).map_err(study)?;
        eprintln!("written: {}", folder.finish().map_err(study)?.display());
    }
    let missed: Vec<String> = sections.into_iter().flat_map(|section| section.missed).collect();
    if missed.is_empty() { Ok(()) } else { Err(Failure::TargetMissed(missed.join("\n"))) }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_spread_by_hand() {
        let spread = Spread::of([1.0, 2.0, 3.0, 4.0]);
        assert!((spread.mean - 2.5).abs() < 1e-15);
        assert!((spread.sigma - (5.0_f64 / 3.0).sqrt()).abs() < 1e-15);
        assert!((spread.sigma_of_mean() - (5.0_f64 / 12.0).sqrt()).abs() < 1e-15);
        assert_eq!(format!("{:.1}", spread.times(-2.0)), "-5.0 ± 2.6");
    }

    #[test]
    fn what_must_hold_and_does_not_is_missed() {
        let mut section = Section::default();
        section.must(true, "one");
        section.must(false, "two");
        section.printed("does not hold", "three");
        assert_eq!(section.missed, ["two"]);
    }
}
