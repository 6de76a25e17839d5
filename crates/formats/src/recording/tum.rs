//! TUM trajectories: lines of `t x y z qx qy qz qw`, seconds and metres, in and out.

use super::rows::{Cell, RowSink, seconds_text, unwritable};
use crate::FormatsError;
use crate::log::{REQUIRED, parse_time_ns, shortened};
use std::fs::File;
use std::io::{BufRead, BufReader, Read as _, Write};
use std::path::Path;

/// No line of eight numbers is longer.
const LINE_LIMIT_BYTES: usize = 4096;

/// Streams a trajectory as rows of poses.
///
/// # Errors
/// [`FormatsError`] naming line and column, or from `sink`.
pub fn read(path: &Path, sink: &mut dyn RowSink) -> Result<(), FormatsError> {
    let unreadable = |source| FormatsError::Unreadable { path: path.into(), source };
    let mut reader = BufReader::new(File::open(path).map_err(unreadable)?);
    let columns: Vec<String> = REQUIRED.iter().skip(1).map(|&name| name.to_owned()).collect();
    sink.begin(&columns)?;
    let (mut bytes, mut line) = (Vec::new(), 0);
    loop {
        bytes.clear();
        line += 1;
        let mut bounded = reader.by_ref().take(LINE_LIMIT_BYTES as u64 + 1);
        if bounded.read_until(b'\n', &mut bytes).map_err(unreadable)? == 0 {
            return Ok(());
        }
        if bytes.len() > LINE_LIMIT_BYTES {
            return Err(FormatsError::RowTooLong { path: path.into(), line, limit: LINE_LIMIT_BYTES });
        }
        let text = String::from_utf8_lossy(&bytes);
        let text = text.trim();
        if text.is_empty() || text.starts_with('#') {
            continue;
        }
        let words: Vec<&str> = text.split_ascii_whitespace().collect();
        let bad = |column: usize| FormatsError::BadCell {
            path: path.into(),
            line,
            column: REQUIRED.get(column).copied().unwrap_or_default().to_owned(),
            text: shortened(words.get(column).copied().unwrap_or_default()),
        };
        let (found, expected) = (words.len() as u64, REQUIRED.len() as u64);
        let Some((time, numbers)) = words.split_first().filter(|_| found == expected) else {
            return Err(FormatsError::RowLength { path: path.into(), line, found, expected });
        };
        let time_ns = parse_time_ns(time).ok_or_else(|| bad(0))?;
        let mut cells = Vec::with_capacity(numbers.len());
        for (i, word) in numbers.iter().enumerate() {
            let number = word.parse::<f64>().ok().filter(|number| number.is_finite());
            cells.push(Cell::Number(number.ok_or_else(|| bad(i + 1))?));
        }
        sink.row(time_ns, &cells)?;
    }
}

/// Whether this is the first line with something in it of a trajectory.
pub fn is_first_line(line: &str) -> bool {
    let mut words = line.split_ascii_whitespace();
    words.clone().count() == REQUIRED.len() && words.all(|word| word.parse::<f64>().is_ok())
}

/// Writes the measured poses; everything else does not go in, and [`TumSink::left_out`] says what.
pub struct TumSink<W: Write> {
    out: W,
    pose: [usize; 7],
    left_out: Vec<String>,
    rows_left_out: u64,
}

impl<W: Write> TumSink<W> {
    /// Writes to `out`.
    pub fn new(out: W) -> Self {
        Self { out, pose: [0; 7], left_out: Vec::new(), rows_left_out: 0 }
    }
    /// Columns that a trajectory cannot hold, and rows without a pose.
    pub fn left_out(&self) -> (&[String], u64) {
        (&self.left_out, self.rows_left_out)
    }
    /// What was written to.
    pub fn into_inner(self) -> W {
        self.out
    }
}

impl<W: Write> RowSink for TumSink<W> {
    fn begin(&mut self, columns: &[String]) -> Result<(), FormatsError> {
        for (place, name) in self.pose.iter_mut().zip(REQUIRED.iter().skip(1)) {
            *place = columns.iter().position(|column| column == name).ok_or(FormatsError::NotHeld {
                path: "output".into(),
                format: "TUM",
                what: "a log without poses",
            })?;
        }
        self.left_out = columns.iter().filter(|column| !REQUIRED.contains(&column.as_str())).cloned().collect();
        Ok(())
    }
    fn row(&mut self, time_ns: i64, cells: &[Cell]) -> Result<(), FormatsError> {
        use std::fmt::Write as _;
        let mut line = seconds_text(time_ns);
        for place in self.pose {
            let Some(Cell::Number(number)) = cells.get(place) else {
                self.rows_left_out += 1;
                return Ok(());
            };
            let _ = write!(line, " {number:?}");
        }
        writeln!(self.out, "{line}").map_err(unwritable)
    }
}
