//! A row of a campaign: one mission, in columns that are the same everywhere.

use super::PlannedMission;
use super::factors::value_name;
use crate::mission::{DoubtOf, MissionSummary};
use std::sync::LazyLock;

/// The table of a campaign, in its folder.
pub const ROWS: &str = "rows.csv";

/// What a column holds.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum Kind {
    /// Text.
    Text,
    /// A whole number.
    Count,
    /// A number.
    Number,
    /// `true` or `false`.
    Flag,
}

/// A column.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Column {
    /// Its name.
    pub name: String,
    /// What it holds; of a mission that was not flown it is empty.
    pub kind: Kind,
}

/// A cell; empty ones are `None`.
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
pub enum Cell {
    /// Of a [`Kind::Text`].
    Text(String),
    /// Of a [`Kind::Count`].
    Count(Option<u64>),
    /// Of a [`Kind::Number`].
    Number(Option<f64>),
    /// Of a [`Kind::Flag`].
    Flag(Option<bool>),
}

/// How a mission ended for the campaign.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum Status {
    /// Flown to its end, whatever that was.
    Flown,
    /// Refused with an error, which the row holds.
    Error,
    /// The program was at fault; the row holds what it said.
    Panic,
    /// Not flown, since only the plan was asked for.
    Planned,
}

impl Status {
    /// As rows write it.
    pub fn name(self) -> &'static str {
        match self {
            Self::Flown => "flown",
            Self::Error => "error",
            Self::Panic => "panic",
            Self::Planned => "planned",
        }
    }
}

/// Parameters in their order, about the centre of mass.
pub const PARAMETERS: [&str; 10] = [
    "mass",
    "com_x",
    "com_y",
    "com_z",
    "inertia_xx",
    "inertia_xy",
    "inertia_xz",
    "inertia_yy",
    "inertia_yz",
    "inertia_zz",
];
/// What is known of each.
const OF_A_PARAMETER: [&str; 5] = ["truth", "initial", "estimate", "sigma", "shut_off_s"];

const BEFORE: [(&str, Kind); 32] = [
    ("row", Kind::Count),
    ("k", Kind::Count),
    ("combination", Kind::Count),
    ("scenario", Kind::Text),
    ("seed", Kind::Count),
    ("weighting", Kind::Text),
    ("feedback", Kind::Text),
    ("model", Kind::Text),
    ("fault", Kind::Text),
    ("fault_severity", Kind::Count),
    ("draw", Kind::Flag),
    ("status", Kind::Text),
    ("arrived", Kind::Flag),
    ("collided", Kind::Flag),
    ("mission_s", Kind::Number),
    ("min_clearance_m", Kind::Number),
    ("limit_violations", Kind::Count),
    ("impulse_n_s", Kind::Number),
    ("angular_impulse_n_m_s", Kind::Number),
    ("rms_tracking_all_m", Kind::Number),
    ("rms_tracking_last_leg_m", Kind::Number),
    ("replans", Kind::Count),
    ("belief_revisions", Kind::Count),
    ("fallbacks", Kind::Count),
    ("faults_injected", Kind::Count),
    ("warnings", Kind::Count),
    ("doubts_at_end", Kind::Text),
    ("doubts_of_body", Kind::Count),
    ("doubts_of_map", Kind::Count),
    ("doubts_of_actuators", Kind::Count),
    ("promises_made", Kind::Count),
    ("promises_kept", Kind::Count),
];
/// What the column `doubts_at_end` holds of a mission without.
pub const NO_DOUBT: &str = "none";
/// Columns that the plan decides; so does the last.
const PLANNED: usize = 11;
const AFTER: [(&str, Kind); 2] = [("message", Kind::Text), ("replay", Kind::Text)];

/// All columns, in their order.
pub static COLUMNS: LazyLock<Vec<Column>> = LazyLock::new(|| {
    let column = |(name, kind): &(&str, Kind)| Column { name: (*name).to_owned(), kind: *kind };
    let of_parameters = PARAMETERS.iter().flat_map(|parameter| {
        OF_A_PARAMETER.iter().map(move |what| Column { name: format!("{parameter}_{what}"), kind: Kind::Number })
    });
    BEFORE.iter().map(column).chain(of_parameters).chain(AFTER.iter().map(column)).collect()
});

/// Index of a column.
pub fn column(name: &str) -> Option<usize> {
    COLUMNS.iter().position(|column| column.name == name)
}

/// First line of a table, without its end.
pub fn csv_header() -> String {
    COLUMNS.iter().map(|column| column.name.as_str()).collect::<Vec<_>>().join(",")
}

/// One mission.
#[derive(Clone, Debug, PartialEq)]
pub struct Row {
    /// Number of the row in the campaign, from zero.
    pub number: u64,
    /// One cell for each of [`COLUMNS`].
    pub cells: Vec<Cell>,
}

impl Row {
    /// Of a mission and what became of it; `message` is one line for people.
    pub fn new(mission: &PlannedMission, status: Status, summary: Option<&MissionSummary>, message: &str) -> Self {
        let count = |value: usize| Cell::Count(Some(value as u64));
        let options = &mission.options;
        let mut cells = vec![
            Cell::Count(Some(mission.row)),
            Cell::Count(Some(mission.k)),
            count(mission.combination),
            Cell::Text(one_line(&mission.scenario_name)),
            Cell::Count(Some(options.seed)),
            Cell::Text(value_name(&options.weighting)),
            Cell::Text(if options.feedback { "on" } else { "off" }.to_owned()),
            Cell::Text(value_name(&options.model)),
            Cell::Text(options.fault.map_or("none".to_owned(), |fault| value_name(&fault.name))),
            Cell::Count(options.fault.map(|fault| u64::from(fault.severity))),
            Cell::Flag(Some(mission.draw.is_some())),
            Cell::Text(status.name().to_owned()),
            Cell::Flag(summary.map(|s| s.arrived)),
            Cell::Flag(summary.map(|s| s.min_clearance_m.is_some_and(|clearance| clearance < 0.0))),
            Cell::Number(summary.map(|s| s.mission_s)),
            Cell::Number(summary.and_then(|s| s.min_clearance_m)),
            Cell::Count(summary.map(|s| s.limit_violations)),
            Cell::Number(summary.map(|s| s.impulse_n_s)),
            Cell::Number(summary.map(|s| s.angular_impulse_n_m_s)),
            Cell::Number(summary.map(|s| s.rms_tracking_m.all)),
            Cell::Number(summary.map(|s| s.rms_tracking_m.last_leg)),
            Cell::Count(summary.map(|s| s.replans)),
            Cell::Count(summary.map(|s| s.belief_revisions)),
            Cell::Count(summary.map(|s| s.fallbacks.len() as u64)),
            Cell::Count(summary.map(|s| s.faults.values().sum())),
            Cell::Count(summary.map(|s| s.warnings.len() as u64)),
            Cell::Text(summary.map_or(String::new(), doubts_at_end)),
            Cell::Count(summary.map(|s| spells(s, DoubtOf::Body))),
            Cell::Count(summary.map(|s| spells(s, DoubtOf::Map))),
            Cell::Count(summary.map(|s| spells(s, DoubtOf::Actuators))),
            Cell::Count(summary.map(|s| s.promises.made)),
            Cell::Count(summary.map(|s| s.promises.kept)),
        ];
        for name in PARAMETERS {
            let found = summary.and_then(|s| s.parameters.iter().find(|parameter| parameter.name == name));
            let shut_off = summary.and_then(|s| s.information_shut_off_s.get(name).copied());
            cells.extend(
                [
                    found.map(|p| p.truth),
                    found.map(|p| p.initial),
                    found.map(|p| p.estimate),
                    found.map(|p| p.sigma),
                    shut_off,
                ]
                .map(Cell::Number),
            );
        }
        cells.extend([Cell::Text(one_line(message)), Cell::Text(one_line(&mission.replay()))]);
        Self { number: mission.row, cells }
    }

    /// Whether this is the row of `mission`, flown or not.
    pub fn is_of(&self, mission: &PlannedMission) -> bool {
        let planned = Self::new(mission, Status::Planned, None, "");
        self.cells.len() == planned.cells.len()
            && self.cells.iter().take(PLANNED).eq(planned.cells.iter().take(PLANNED))
            && self.cells.last() == planned.cells.last()
    }

    /// A cell that holds a number or a count.
    pub fn number(&self, column: usize) -> Option<f64> {
        match self.cells.get(column)? {
            Cell::Number(value) => *value,
            Cell::Count(value) => value.map(|value| value as f64),
            Cell::Text(_) | Cell::Flag(_) => None,
        }
    }

    /// A cell that holds text; empty otherwise.
    pub fn text(&self, column: usize) -> &str {
        match self.cells.get(column) {
            Some(Cell::Text(text)) => text,
            _ => "",
        }
    }

    /// A cell that holds a flag.
    pub fn flag(&self, column: usize) -> Option<bool> {
        match self.cells.get(column)? {
            Cell::Flag(value) => *value,
            _ => None,
        }
    }

    /// As a line of CSV, without its end.
    pub fn to_csv(&self) -> String {
        let cells: Vec<String> = self.cells.iter().map(|cell| quoted(&cell.text())).collect();
        cells.join(",")
    }

    /// From a line of CSV; `None` where it is none of a campaign's.
    pub fn from_csv(line: &str) -> Option<Self> {
        let mut reader = csv::ReaderBuilder::new().has_headers(false).from_reader(line.as_bytes());
        let record = reader.records().next()?.ok()?;
        if record.len() != COLUMNS.len() {
            return None;
        }
        let cells: Vec<Cell> =
            COLUMNS.iter().zip(&record).map(|(column, text)| Cell::parse(column.kind, text)).collect::<Option<_>>()?;
        let Some(Cell::Count(Some(number))) = cells.first() else { return None };
        let row = Self { number: *number, cells };
        // also refuses what a reader of CSV is lenient with
        (row.to_csv() == line).then_some(row)
    }
}

impl Cell {
    fn parse(kind: Kind, text: &str) -> Option<Self> {
        // empty, or a value; none where it is neither
        #[allow(clippy::option_option)]
        fn value<T: std::str::FromStr>(text: &str) -> Option<Option<T>> {
            if text.is_empty() { Some(None) } else { text.parse().ok().map(Some) }
        }
        Some(match kind {
            Kind::Text => Self::Text(text.to_owned()),
            Kind::Count => Self::Count(value(text)?),
            Kind::Number => Self::Number(value(text)?),
            Kind::Flag => Self::Flag(value(text)?),
        })
    }

    fn text(&self) -> String {
        match self {
            Self::Text(text) => text.clone(),
            Self::Count(value) => value.map_or(String::new(), |value| value.to_string()),
            // The shortest text that is read as the same number.
            Self::Number(value) => value.map_or(String::new(), |value| ryu::Buffer::new().format(value).to_owned()),
            Self::Flag(value) => value.map_or(String::new(), |value| value.to_string()),
        }
    }
}

/// A cell with its quotes where it needs them (RFC 4180).
fn quoted(text: &str) -> String {
    if text.contains([',', '"']) { format!("\"{}\"", text.replace('"', "\"\"")) } else { text.to_owned() }
}

/// What is doubted at the end, with spaces between; `none` where nothing is.
fn doubts_at_end(summary: &MissionSummary) -> String {
    let names: Vec<&str> = summary.standing_doubts().into_iter().map(DoubtOf::name).collect();
    if names.is_empty() { NO_DOUBT.to_owned() } else { names.join(" ") }
}

/// How often something was doubted.
fn spells(summary: &MissionSummary, what: DoubtOf) -> u64 {
    summary.doubts.iter().filter(|doubt| doubt.what == what).count() as u64
}

/// Text without line ends and other control characters: a row is one line.
fn one_line(text: &str) -> String {
    text.chars().map(|c| if c.is_control() { ' ' } else { c }).collect()
}
