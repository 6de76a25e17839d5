//! A log of any format as rows of named columns: what `tumble convert` hands from a reader to a writer.

use crate::FormatsError;
use crate::log::{BoundedRows, parse_time_ns, read_row, shortened};
use std::fs::File;
use std::io::{BufReader, Write};
use std::path::Path;

/// One cell of a row.
#[derive(Clone, Debug, Default, PartialEq)]
#[non_exhaustive]
pub enum Cell {
    /// No sample then.
    #[default]
    Empty,
    /// A finite number.
    Number(f64),
    /// Anything else.
    Text(String),
}

/// What takes the rows of a log.
///
/// # Example
/// ```
/// use tumble_formats::FormatsError;
/// use tumble_formats::recording::rows::{Cell, RowSink, read_csv};
///
/// /// The largest number of each column.
/// #[derive(Default)]
/// struct Largest(Vec<(String, f64)>);
/// impl RowSink for Largest {
///     fn begin(&mut self, columns: &[String]) -> Result<(), FormatsError> {
///         self.0 = columns.iter().map(|name| (name.clone(), f64::NEG_INFINITY)).collect();
///         Ok(())
///     }
///     fn row(&mut self, _time_ns: i64, cells: &[Cell]) -> Result<(), FormatsError> {
///         for ((_, largest), cell) in self.0.iter_mut().zip(cells) {
///             if let Cell::Number(number) = cell {
///                 *largest = largest.max(*number);
///             }
///         }
///         Ok(())
///     }
/// }
/// let path = std::env::temp_dir().join(format!("tumble-rows-{}.csv", std::process::id()));
/// std::fs::write(&path, "t_s,w_x,note\n0.0,0.1,begun\n0.1,0.3,\n")?;
/// let mut largest = Largest::default();
/// read_csv(&path, &mut largest)?;
/// std::fs::remove_file(&path)?;
/// assert_eq!(largest.0[0], ("w_x".to_owned(), 0.3));
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
/// Tutorial: [rows in memory](https://github.com/tumble-robotics/tumble/blob/main/crates/formats/tests/suite/mcap.rs).
pub trait RowSink {
    /// Takes the names of all columns but the time, once, before the first row.
    ///
    /// # Errors
    /// Where they cannot be held or written.
    fn begin(&mut self, columns: &[String]) -> Result<(), FormatsError>;
    /// Takes a row with as many cells as there are columns.
    ///
    /// # Errors
    /// Where it cannot be held or written.
    fn row(&mut self, time_ns: i64, cells: &[Cell]) -> Result<(), FormatsError>;
}

/// Streams a CSV log; every number keeps its bits, and the times their nanoseconds and their order.
///
/// # Errors
/// [`FormatsError`] naming line and column, or from `sink`.
pub fn read_csv(path: &Path, sink: &mut dyn RowSink) -> Result<(), FormatsError> {
    let file = File::open(path).map_err(|source| FormatsError::Unreadable { path: path.into(), source })?;
    let mut records = csv::ReaderBuilder::new()
        .has_headers(false)
        .flexible(true)
        .quoting(false)
        .comment(Some(b'#'))
        .from_reader(BoundedRows::new(BufReader::new(file)));
    let mut record = csv::ByteRecord::new();
    if !read_row(&mut records, &mut record, path)? {
        return Err(FormatsError::Empty { path: path.into(), what: "header" });
    }
    let mut names: Vec<String> = record.iter().map(|cell| String::from_utf8_lossy(cell).trim().to_owned()).collect();
    if let Some(first) = names.first_mut() {
        *first = first.trim_start_matches('\u{feff}').trim().to_owned();
    }
    for (i, name) in names.iter().enumerate() {
        if names.iter().take(i).any(|earlier| earlier == name) {
            return Err(FormatsError::DuplicateColumn { path: path.into(), column: shortened(name) });
        }
    }
    let Some(time_column) = names.iter().position(|name| name == "t_s") else {
        return Err(FormatsError::MissingColumn { path: path.into(), column: "t_s".to_owned(), because: "" });
    };
    names.remove(time_column);
    sink.begin(&names)?;
    let mut cells = Vec::new();
    while read_row(&mut records, &mut record, path)? {
        let line = record.position().map_or(0, csv::Position::line);
        let (found, expected) = (record.len() as u64, names.len() as u64 + 1);
        if found != expected {
            return Err(FormatsError::RowLength { path: path.into(), line, found, expected });
        }
        cells.clear();
        let mut time_ns = None;
        for (column, bytes) in record.iter().enumerate() {
            let text = String::from_utf8_lossy(bytes.trim_ascii());
            if column == time_column {
                time_ns = Some(parse_time_ns(&text).ok_or_else(|| FormatsError::BadCell {
                    path: path.into(),
                    line,
                    column: "t_s".to_owned(),
                    text: shortened(&text),
                })?);
                continue;
            }
            let number = || text.parse::<f64>().ok().filter(|number| number.is_finite());
            cells.push(if text.is_empty() {
                Cell::Empty
            } else {
                number().map_or_else(|| Cell::Text(text.clone().into_owned()), Cell::Number)
            });
        }
        sink.row(time_ns.unwrap_or_default(), &cells)?;
    }
    Ok(())
}

/// Writes a CSV log, `t_s` first.
pub struct CsvSink<W: Write> {
    out: W,
    line: String,
}

impl<W: Write> CsvSink<W> {
    /// Writes to `out`.
    pub fn new(out: W) -> Self {
        Self { out, line: String::new() }
    }
    /// What was written to.
    pub fn into_inner(self) -> W {
        self.out
    }
}

impl<W: Write> RowSink for CsvSink<W> {
    fn begin(&mut self, columns: &[String]) -> Result<(), FormatsError> {
        let names = columns.iter().map(|name| plain(name));
        let header: Vec<String> = std::iter::once("t_s".to_owned()).chain(names).collect();
        writeln!(self.out, "{}", header.join(",")).map_err(unwritable)
    }
    fn row(&mut self, time_ns: i64, cells: &[Cell]) -> Result<(), FormatsError> {
        use std::fmt::Write as _;
        self.line = seconds_text(time_ns);
        for cell in cells {
            // Writing to a string never fails.
            let _ = match cell {
                Cell::Empty => write!(self.line, ","),
                Cell::Number(number) => write!(self.line, ",{number:?}"),
                Cell::Text(text) => write!(self.line, ",{}", plain(text)),
            };
        }
        writeln!(self.out, "{}", self.line).map_err(unwritable)
    }
}

/// A text without what would end a cell.
fn plain(text: &str) -> String {
    text.chars().map(|c| if c == ',' || c.is_control() { '_' } else { c }).collect()
}

/// Decimal seconds, exact to the nanosecond.
pub fn seconds_text(time_ns: i64) -> String {
    let sign = if time_ns < 0 { "-" } else { "" };
    let time_ns = time_ns.unsigned_abs();
    format!("{sign}{}.{:09}", time_ns / 1_000_000_000, time_ns % 1_000_000_000)
}

/// What a sink says of its output; the command puts the name of the file in its place.
pub(crate) fn unwritable(source: std::io::Error) -> FormatsError {
    FormatsError::Unwritable { path: "output".into(), source }
}
