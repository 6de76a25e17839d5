//! Tables of numbers, streamed: named columns in, rows out.

use crate::TumbleError;
use std::fs::File;
use std::io::{BufWriter, ErrorKind, Read, Write};
use std::path::{Path, PathBuf};
use tumble_formats::FormatsError;
use tumble_formats::log::{BoundedRows, Row, read_row, shortened};

/// Opens a file, or standard input where it is `-`, with its name for messages.
///
/// # Errors
/// [`FormatsError::Unreadable`].
pub(super) fn open(path: &Path) -> Result<(PathBuf, Box<dyn Read>), TumbleError> {
    if path == Path::new("-") {
        return Ok(("standard input".into(), Box::new(std::io::stdin().lock())));
    }
    let unreadable = |source| FormatsError::Unreadable { path: path.into(), source };
    let file = File::open(path).map_err(unreadable)?;
    if file.metadata().map_err(unreadable)?.is_dir() {
        return Err(unreadable(ErrorKind::IsADirectory.into()).into());
    }
    Ok((path.into(), Box::new(file)))
}

/// Reads the columns of these names from a CSV file, whatever their order and whatever stands beside them.
pub(super) struct Columns<R, const N: usize> {
    path: PathBuf,
    records: csv::Reader<BoundedRows<R>>,
    record: csv::ByteRecord,
    /// All names of the header.
    names: Vec<String>,
    /// Where the wanted columns stand.
    places: [usize; N],
    any_row: bool,
}

impl<R: Read, const N: usize> Columns<R, N> {
    /// Reads the header; columns of other names are named in `warnings` and ignored.
    ///
    /// # Errors
    /// [`TumbleError`] for an unreadable or empty file, a missing column and one that stands twice.
    pub(super) fn new(
        input: R,
        path: &Path,
        wanted: &[&str; N],
        warnings: &mut impl Write,
    ) -> Result<Self, TumbleError> {
        let mut records = csv::ReaderBuilder::new()
            .has_headers(false)
            .flexible(true)
            .quoting(false)
            .comment(Some(b'#'))
            .buffer_capacity(1 << 16)
            .from_reader(BoundedRows::new(input));
        let mut record = csv::ByteRecord::new();
        if !read_row(&mut records, &mut record, path)? {
            return Err(FormatsError::Empty { path: path.into(), what: "header" }.into());
        }
        let cells = record.iter().map(|cell| String::from_utf8_lossy(cell).trim().to_owned());
        let mut names: Vec<String> = cells.collect();
        if let Some(first) = names.first_mut() {
            *first = first.trim_start_matches('\u{feff}').trim().to_owned();
        }
        let mut places = [0; N];
        for (place, column) in places.iter_mut().zip(wanted) {
            let mut found = names.iter().enumerate().filter(|(_, name)| name == column);
            let column = (*column).to_owned();
            *place = match (found.next(), found.next()) {
                (Some((at, _)), None) => at,
                (None, _) => return Err(FormatsError::MissingColumn { path: path.into(), column, because: "" }.into()),
                _ => return Err(FormatsError::DuplicateColumn { path: path.into(), column }.into()),
            };
        }
        let others: Vec<String> = (0..names.len())
            .filter(|at| !places.contains(at))
            .filter_map(|at| names.get(at).map(|name| shortened(name)))
            .collect();
        if !others.is_empty() {
            // that nobody can be told is no reason to stop
            let _ = writeln!(warnings, "columns ignored: {}", others.join(", "));
        }
        Ok(Self { path: path.into(), records, record, names, places, any_row: false })
    }

    /// The next row, `None` at the end.
    ///
    /// # Errors
    /// [`TumbleError`] naming line and column; a file without rows.
    pub(super) fn next_row(&mut self) -> Result<Option<NumberRow<'_, N>>, TumbleError> {
        if !read_row(&mut self.records, &mut self.record, &self.path)? {
            return if self.any_row {
                Ok(None)
            } else {
                Err(FormatsError::Empty { path: self.path.clone(), what: "data rows" }.into())
            };
        }
        self.any_row = true;
        let line = self.record.position().map_or(0, csv::Position::line);
        let (found, expected) = (self.record.len() as u64, self.names.len() as u64);
        if found != expected {
            return Err(FormatsError::RowLength { path: self.path.clone(), line, found, expected }.into());
        }
        let row = Row { path: &self.path, line, record: &self.record, names: &self.names };
        let mut values = [0.0; N];
        for (value, place) in values.iter_mut().zip(self.places) {
            *value = row.number(place)?;
        }
        Ok(Some(NumberRow { values, row, places: self.places }))
    }
}

/// The numbers of one row.
pub(super) struct NumberRow<'a, const N: usize> {
    /// In the order in which the columns were asked for.
    pub(super) values: [f64; N],
    row: Row<'a>,
    places: [usize; N],
}

impl<const N: usize> NumberRow<'_, N> {
    /// The cells as they stand.
    pub(super) fn texts(&self) -> [&[u8]; N] {
        self.places.map(|place| self.row.text(place))
    }

    /// The error that the number of a column is none of the allowed ones.
    pub(super) fn out_of_range(&self, column: usize, allowed: &'static str) -> TumbleError {
        let name = self.places.get(column).and_then(|place| self.row.names.get(*place));
        FormatsError::OutOfRange {
            path: self.row.path.into(),
            line: self.row.line,
            column: name.cloned().unwrap_or_default(),
            text: self
                .places
                .get(column)
                .map_or_else(String::new, |at| shortened(&String::from_utf8_lossy(self.row.text(*at)))),
            allowed,
        }
        .into()
    }
}

/// Writes rows.
pub(super) struct Rows<W: Write> {
    out: BufWriter<W>,
    line: Vec<u8>,
    digits: ryu::Buffer,
}

impl<W: Write> Rows<W> {
    /// Starts a table with its header, which comes out with the first row.
    pub(super) fn start(out: W, header: &[String]) -> Self {
        let out = BufWriter::with_capacity(1 << 16, out);
        let mut rows = Self { out, line: Vec::new(), digits: ryu::Buffer::new() };
        for name in header {
            rows.text(name.as_bytes());
        }
        // Written with the first row: a table without rows has no header.
        rows.line.push(b'\n');
        rows
    }

    /// Adds a cell.
    pub(super) fn text(&mut self, cell: &[u8]) {
        self.separate();
        self.line.extend_from_slice(cell);
    }

    /// Adds numbers, in as few digits as tell them from their neighbours.
    pub(super) fn numbers(&mut self, values: &[f64]) {
        for value in values {
            self.separate();
            let digits = self.digits.format(*value);
            self.line.extend_from_slice(digits.strip_suffix(".0").unwrap_or(digits).as_bytes());
        }
    }

    /// A comma, but for the first cell of a row.
    fn separate(&mut self) {
        if self.line.last().is_some_and(|byte| *byte != b'\n') {
            self.line.push(b',');
        }
    }

    /// Ends the row.
    ///
    /// # Errors
    /// [`Written`].
    pub(super) fn end_row(&mut self) -> Result<(), Written> {
        self.line.push(b'\n');
        let written = self.out.write_all(&self.line);
        self.line.clear();
        written.map_err(Written::from)
    }

    /// Writes what is still held back.
    ///
    /// # Errors
    /// [`Written`].
    pub(super) fn finish(mut self) -> Result<(), Written> {
        self.out.flush().map_err(Written::from)
    }
}

/// Why a table ended early.
pub(super) enum Written {
    /// Nobody reads on (`tumble ... | head`): not an error.
    Closed,
    /// An error of input or output.
    Failed(TumbleError),
}

impl From<std::io::Error> for Written {
    fn from(source: std::io::Error) -> Self {
        if source.kind() == ErrorKind::BrokenPipe {
            Self::Closed
        } else {
            Self::Failed(FormatsError::Unwritable { path: "standard output".into(), source }.into())
        }
    }
}

impl From<TumbleError> for Written {
    fn from(error: TumbleError) -> Self {
        Self::Failed(error)
    }
}

/// How a command ends whose table ended so.
pub(super) fn outcome(written: Result<(), Written>) -> Result<(), TumbleError> {
    match written {
        Ok(()) | Err(Written::Closed) => Ok(()),
        Err(Written::Failed(error)) => Err(error),
    }
}

/// The names of numbered columns, counted from one.
pub(super) fn numbered(prefix: &str, count: usize) -> impl Iterator<Item = String> {
    (1..=count).map(move |i| format!("{prefix}{i}"))
}
