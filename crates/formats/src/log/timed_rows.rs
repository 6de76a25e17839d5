//! Rows against time: a header, then samples that a layout makes of the rows, late ones put in order where that is asked for.

use super::cell::{seconds, shortened};
use super::row::{BoundedRows, Header, Row, cut, read_row};
use crate::FormatsError;
use std::fs::File;
use std::io::{BufReader, Read};
use std::path::{Path, PathBuf};
use tumble_identification::synchronize::{Held, TimeOrdering};

/// How many rows `--reorder` holds back to put late ones in order.
const REORDER_ROWS: usize = 4096;

/// What the columns of a log mean.
///
/// # Example
/// ```
/// use std::path::Path;
/// use tumble_formats::FormatsError;
/// use tumble_formats::log::{Row, RowLayout, TimedRows};
///
/// /// Voltage of a battery against time.
/// struct Battery {
///     time: usize,
///     voltage: usize,
/// }
/// impl RowLayout for Battery {
///     type Sample = (i64, f64);
///     fn time_column(&self) -> usize {
///         self.time
///     }
///     fn knows(&self, column: &str) -> bool {
///         ["t_s", "voltage_v"].contains(&column)
///     }
///     fn sample(&self, row: &Row, time_ns: i64) -> Result<(i64, f64), FormatsError> {
///         Ok((time_ns, row.number(self.voltage)?))
///     }
/// }
/// let log = "t_s,voltage_v,note\n0.0,14.1,full\n0.5,low,\n";
/// let mut rows = TimedRows::start(log.as_bytes(), Path::new("battery.csv"), false, |header| {
///     Ok(Battery { time: header.required("t_s", "")?, voltage: header.required("voltage_v", "")? })
/// })?;
/// assert_eq!(rows.next_sample()?, Some((0, 14.1)));
/// assert!(rows.next_sample().unwrap_err().to_string().contains("line 3"));
/// assert_eq!(rows.ignored_columns, ["note"]);
/// # Ok::<(), FormatsError>(())
/// ```
/// Tutorial: [the columns of an arm's joints](https://github.com/tumble-robotics/tumble/blob/main/crates/formats/src/log/joints.rs).
pub trait RowLayout {
    /// What a row is.
    type Sample;
    /// Where the time stands.
    fn time_column(&self) -> usize;
    /// Whether the format has a column of this name.
    fn knows(&self, column: &str) -> bool;
    /// The sample of a row.
    ///
    /// # Errors
    /// [`FormatsError`] naming line and column.
    fn sample(&self, row: &Row, time_ns: i64) -> Result<Self::Sample, FormatsError>;
}

/// Streams the samples of one log.
pub struct TimedRows<R, L: RowLayout> {
    path: PathBuf,
    records: csv::Reader<BoundedRows<BufReader<R>>>,
    record: csv::ByteRecord,
    names: Vec<String>,
    layout: L,
    /// Columns that are not part of the format.
    pub ignored_columns: Vec<String>,
    reorder: Option<Reorder<L::Sample>>,
    previous_ns: Option<i64>,
    /// Of the row read last.
    line: u64,
    ended: bool,
}

/// A sample, when it is of and the line it stood in.
struct Stamped<X> {
    line: u64,
    time_ns: i64,
    sample: X,
}

/// Where late rows wait for their turn.
type Places<X> = Vec<Option<Held<Stamped<X>>>>;

/// Late rows put in order, repeats of a time dropped.
struct Reorder<X> {
    ordering: TimeOrdering<Stamped<X>, Places<X>>,
    repeated: usize,
}

impl<X> Default for Reorder<X> {
    fn default() -> Self {
        let places = std::iter::repeat_with(|| None).take(REORDER_ROWS).collect();
        Self { ordering: TimeOrdering::new(places), repeated: 0 }
    }
}

/// Opens a log.
///
/// # Errors
/// [`FormatsError::Unreadable`].
pub fn open_file(path: &Path) -> Result<File, FormatsError> {
    let unreadable = |source| FormatsError::Unreadable { path: path.into(), source };
    let file = File::open(path).map_err(unreadable)?;
    if file.metadata().map_err(unreadable)?.is_dir() {
        return Err(unreadable(std::io::Error::from(std::io::ErrorKind::IsADirectory)));
    }
    Ok(file)
}

impl<R: Read, L: RowLayout> TimedRows<R, L> {
    /// Reads the header of the log that `source` yields; `path` is its name in errors.
    ///
    /// # Errors
    /// [`FormatsError`] for an empty file, and what the layout says of the header.
    pub fn start(
        source: R,
        path: &Path,
        reorder: bool,
        layout: impl FnOnce(&Header) -> Result<L, FormatsError>,
    ) -> Result<Self, FormatsError> {
        let mut records = csv::ReaderBuilder::new()
            .has_headers(false)
            .flexible(true)
            .quoting(false)
            .comment(Some(b'#'))
            .from_reader(BoundedRows::new(BufReader::new(source)));
        let mut record = csv::ByteRecord::new();
        let header = Header::read(&mut records, &mut record, path)?;
        let layout = layout(&header)?;
        let names = header.names;
        Ok(Self {
            path: path.into(),
            records,
            record,
            ignored_columns: names.iter().filter(|name| !layout.knows(name)).map(|name| shortened(name)).collect(),
            names,
            layout,
            reorder: reorder.then(Reorder::default),
            previous_ns: None,
            line: 1,
            ended: false,
        })
    }

    /// What the columns mean.
    pub(super) const fn layout(&self) -> &L {
        &self.layout
    }

    /// Rows that came late and were put in order, rows with a repeated time that were dropped.
    pub fn reordered(&self) -> (usize, usize) {
        self.reorder.as_ref().map_or((0, 0), |r| (r.ordering.late(), r.repeated))
    }

    /// The next sample in time, `None` at the end.
    ///
    /// # Errors
    /// [`FormatsError`] naming line and column.
    pub fn next_sample(&mut self) -> Result<Option<L::Sample>, FormatsError> {
        loop {
            let Some(Stamped { line, time_ns, sample }) = self.next_in_order()? else { return Ok(None) };
            if let Some(previous_ns) = self.previous_ns.filter(|previous| time_ns <= *previous) {
                if let Some(reorder) = self.reorder.as_mut().filter(|_| time_ns == previous_ns) {
                    reorder.repeated += 1;
                    continue;
                }
                return Err(FormatsError::TimeNotIncreasing {
                    path: self.path.clone(),
                    line,
                    previous_s: seconds(previous_ns),
                    found_s: seconds(time_ns),
                });
            }
            self.previous_ns = Some(time_ns);
            return Ok(Some(sample));
        }
    }

    fn next_in_order(&mut self) -> Result<Option<Stamped<L::Sample>>, FormatsError> {
        loop {
            let row = if self.ended { None } else { self.next_row()? };
            self.ended = row.is_none();
            let Some(reorder) = self.reorder.as_mut() else { return Ok(row) };
            let released = match row {
                Some(stamped) => reorder.ordering.push(stamped.time_ns, stamped),
                None => reorder.ordering.flush(),
            };
            if released.is_some() || self.ended {
                return Ok(released.map(|released| released.sample));
            }
        }
    }

    fn next_row(&mut self) -> Result<Option<Stamped<L::Sample>>, FormatsError> {
        if !read_row(&mut self.records, &mut self.record, &self.path)? {
            return Ok(None);
        }
        let line = self.record.position().map_or(0, csv::Position::line);
        self.line = line;
        let expected = self.names.len() as u64;
        let found = self.record.len() as u64;
        if found != expected {
            return Err(FormatsError::RowLength { path: self.path.clone(), line, found, expected });
        }
        let row = Row { path: &self.path, line, record: &self.record, names: &self.names };
        let time_ns = row.time_ns(self.layout.time_column())?;
        Ok(Some(Stamped { line, time_ns, sample: self.layout.sample(&row, time_ns)? }))
    }

    /// The line at whose end the file ends without ending the line, once it has been read.
    fn cut_line(&self) -> Option<u64> {
        (self.ended && self.records.get_ref().ends_within_a_line()).then_some(self.line)
    }

    /// What a user should know about the rows read so far.
    pub fn warnings(&self) -> Vec<String> {
        let mut warnings = Vec::new();
        if !self.ignored_columns.is_empty() {
            warnings.push(format!("columns ignored: {}", self.ignored_columns.join(", ")));
        }
        let (late, repeated) = self.reordered();
        if late + repeated > 0 {
            warnings.push(format!("{late} rows came late and were put in order, {repeated} repeated times dropped"));
        }
        warnings.extend(self.cut_line().map(cut));
        warnings
    }
}
