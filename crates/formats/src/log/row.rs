//! Rows of a CSV file of any size, one at a time, each with the line it stands in.

use super::cell::{QUATERNION_NORM_TOLERANCE, parse_time_ns, shortened};
use crate::FormatsError;
use crate::text_file::open_regular;
use std::collections::{HashSet, VecDeque};
use std::io::{BufRead as _, BufReader, Read, Seek as _, SeekFrom};
use std::path::{Path, PathBuf};
use tumble_dynamics::nalgebra::{Vector3, Vector6};
use tumble_lie::{Pose, Wrench, from_xyzw};

/// No row of numbers is longer than this; a file without line ends must not fill the memory.
pub const ROW_LIMIT_BYTES: usize = 65_536;

/// The names of a header.
pub struct Header {
    path: PathBuf,
    /// As they stand, without spaces around them.
    pub names: Vec<String>,
}

impl Header {
    /// The first row as names.
    ///
    /// # Errors
    /// [`FormatsError::Empty`], [`FormatsError::DuplicateColumn`].
    pub fn read<R: Read>(
        records: &mut csv::Reader<BoundedRows<R>>,
        record: &mut csv::ByteRecord,
        path: &Path,
    ) -> Result<Self, FormatsError> {
        if !read_row(records, record, path)? {
            return Err(FormatsError::Empty { path: path.into(), what: "header" });
        }
        let cell = |(at, cell): (usize, &[u8])| {
            let marked = cell.strip_prefix("\u{feff}".as_bytes()).filter(|_| at == 0);
            String::from_utf8_lossy(marked.unwrap_or(cell)).trim().to_owned()
        };
        let names: Vec<String> = record.iter().enumerate().map(cell).collect();
        if names.iter().all(String::is_empty) {
            return Err(FormatsError::Empty { path: path.into(), what: "header" });
        }
        // a set: a header may have tens of thousands of columns
        let mut seen = HashSet::new();
        for name in &names {
            if !name.is_empty() && !seen.insert(name.as_str()) {
                return Err(FormatsError::DuplicateColumn { path: path.into(), column: shortened(name) });
            }
        }
        Ok(Self { path: path.into(), names })
    }

    /// That a column stands there twice.
    pub fn twice(&self, column: &str) -> FormatsError {
        FormatsError::DuplicateColumn { path: self.path.clone(), column: column.to_owned() }
    }

    /// Where a column stands.
    pub fn position(&self, column: &str) -> Option<usize> {
        self.names.iter().position(|name| name == column)
    }

    /// Where a column stands that must be there.
    ///
    /// # Errors
    /// [`FormatsError::MissingColumn`].
    pub fn required(&self, column: &str, because: &'static str) -> Result<usize, FormatsError> {
        let missing = |path| FormatsError::MissingColumn { path, column: column.to_owned(), because };
        self.position(column).ok_or_else(|| missing(self.path.clone()))
    }

    /// That a column is missing.
    pub fn lacks(&self, column: &str) -> FormatsError {
        FormatsError::MissingColumn { path: self.path.clone(), column: column.to_owned(), because: "" }
    }

    /// An optional group of columns: all of it or none of it.
    ///
    /// # Errors
    /// [`FormatsError::MissingColumn`].
    pub fn group<const N: usize>(&self, columns: [&str; N]) -> Result<Option<[usize; N]>, FormatsError> {
        if !columns.iter().any(|column| self.position(column).is_some()) {
            return Ok(None);
        }
        let mut indices = [0; N];
        for (slot, column) in indices.iter_mut().zip(columns) {
            *slot = self.required(column, PART_OF_A_GROUP)?;
        }
        Ok(Some(indices))
    }
}

/// Why a column of a group must be there.
pub const PART_OF_A_GROUP: &str = ", but others of its group are there";

/// One row with what an error message needs.
pub struct Row<'a> {
    /// The file.
    pub path: &'a Path,
    /// Line, counted from one.
    pub line: u64,
    /// The cells.
    pub record: &'a csv::ByteRecord,
    /// The columns of the header.
    pub names: &'a [String],
}

impl Row<'_> {
    /// What stands in a cell, without blanks around it; nothing beyond the end of the row.
    pub fn text(&self, column: usize) -> &[u8] {
        self.record.get(column).unwrap_or_default().trim_ascii()
    }
    fn bad_cell(&self, column: usize) -> FormatsError {
        FormatsError::BadCell {
            path: self.path.into(),
            line: self.line,
            column: self.names.get(column).cloned().unwrap_or_default(),
            text: shortened(&String::from_utf8_lossy(self.text(column))),
        }
    }

    /// That a cell holds a number that its column cannot hold.
    pub fn out_of_range(&self, column: usize, allowed: &'static str) -> FormatsError {
        FormatsError::OutOfRange {
            path: self.path.into(),
            line: self.line,
            column: self.names.get(column).cloned().unwrap_or_default(),
            text: shortened(&String::from_utf8_lossy(self.text(column))),
            allowed,
        }
    }

    /// A finite number.
    ///
    /// # Errors
    /// [`FormatsError::BadCell`].
    pub fn number(&self, column: usize) -> Result<f64, FormatsError> {
        std::str::from_utf8(self.text(column))
            .ok()
            .and_then(|text| text.parse::<f64>().ok())
            .filter(|value| value.is_finite())
            .ok_or_else(|| self.bad_cell(column))
    }

    /// A time in seconds, as whole nanoseconds: it never passes through a float.
    ///
    /// # Errors
    /// [`FormatsError::BadCell`].
    pub fn time_ns(&self, column: usize) -> Result<i64, FormatsError> {
        std::str::from_utf8(self.text(column)).ok().and_then(parse_time_ns).ok_or_else(|| self.bad_cell(column))
    }
    /// An optional vector: `None` where any of its cells is empty.
    pub fn vector(&self, columns: Option<[Option<usize>; 3]>) -> Result<Option<Vector3<f64>>, FormatsError> {
        Ok(self.optional(columns)?.map(Vector3::from))
    }
    /// A wrench, torque first.
    pub fn wrench(&self, columns: Option<[Option<usize>; 6]>) -> Result<Option<Wrench<f64>>, FormatsError> {
        Ok(self.optional(columns)?.map(|w| Vector6::from(w).into()))
    }
    /// A pose: position, then the quaternion, scalar last.
    pub fn pose(&self, [px, py, pz, x, y, z, w]: [f64; 7]) -> Result<Pose<f64>, FormatsError> {
        let rotation = from_xyzw(x, y, z, w, QUATERNION_NORM_TOLERANCE).map_err(|_| FormatsError::NotUnit {
            path: self.path.into(),
            line: self.line,
            norm: [x, y, z, w].iter().map(|c| c * c).sum::<f64>().sqrt(),
            tolerance: QUATERNION_NORM_TOLERANCE,
        })?;
        Ok(Pose::from_parts(Vector3::new(px, py, pz).into(), rotation))
    }
    /// An optional list: `None` where any of its cells is empty.
    pub fn optional_list(&self, columns: Option<&[usize]>) -> Result<Option<Vec<f64>>, FormatsError> {
        let Some(columns) = columns.filter(|columns| columns.iter().all(|column| !self.text(*column).is_empty()))
        else {
            return Ok(None);
        };
        columns.iter().map(|column| self.number(*column)).collect::<Result<_, _>>().map(Some)
    }
    /// An optional group: `None` where any of its cells is empty, zero where it has no column.
    pub fn optional<const N: usize>(
        &self,
        columns: Option<[Option<usize>; N]>,
    ) -> Result<Option<[f64; N]>, FormatsError> {
        let Some(columns) = columns else { return Ok(None) };
        if columns.iter().flatten().any(|column| self.text(*column).is_empty()) {
            return Ok(None);
        }
        let mut values = [0.0; N];
        for (value, column) in values.iter_mut().zip(columns) {
            if let Some(column) = column {
                *value = self.number(column)?;
            }
        }
        Ok(Some(values))
    }
}

/// The next row, at the line it stands in; `false` at the end.
pub fn read_row<R: Read>(
    records: &mut csv::Reader<BoundedRows<R>>,
    record: &mut csv::ByteRecord,
    path: &Path,
) -> Result<bool, FormatsError> {
    let found = records.read_byte_record(record);
    if let Some(line) = records.get_ref().too_long {
        return Err(FormatsError::RowTooLong { path: path.into(), line, limit: ROW_LIMIT_BYTES });
    }
    let line = line_read(records);
    if let Some(position) = record.position().cloned().as_mut() {
        record.set_position(Some(position.set_line(line).clone()));
    }
    found.map_err(|error| FormatsError::Unreadable { path: path.into(), source: error.into() })
}

/// The line of the row read last. The reader's own count is that of the comments and empty lines before it, and one too small
/// behind `\r\n`.
pub fn line_read<R: Read>(records: &mut csv::Reader<BoundedRows<R>>) -> u64 {
    let end = records.position().byte();
    records.get_mut().line_before(end)
}

/// Cells as one dialect of CSV has them, whichever of its dialects they were written in. Places and lengths stay as they are.
///
/// What stands between the names of the header separates cells: commas, semicolons or tabs. Beside the others a comma is a decimal point, as a
/// German spreadsheet writes it. Quotation marks become blanks, and so do separators within them, up to the end of the line at most.
#[derive(Default)]
struct Dialect {
    separator: Option<u8>,
    is_within_line: bool,
    is_comment: bool,
    is_quoted: bool,
}

impl Dialect {
    fn plain(&mut self, byte: &mut u8) {
        if !self.is_within_line {
            (self.is_comment, self.is_quoted) = (*byte == b'#', false);
        }
        self.is_within_line = *byte != b'\n';
        if self.is_comment {
            return;
        }
        *byte = match (*byte, self.separator) {
            (b'"', _) => {
                self.is_quoted = !self.is_quoted;
                b' '
            }
            (b',' | b';' | b'\t', None) if self.is_quoted => b' ',
            (separator @ (b',' | b';' | b'\t'), None) => {
                self.separator = Some(separator);
                b','
            }
            (separator, Some(found)) if separator == found => {
                if self.is_quoted {
                    b' '
                } else {
                    b','
                }
            }
            (b',', Some(_)) => b'.',
            (other, _) => other,
        };
    }
}

/// Counts lines, and ends the stream when one grows beyond [`ROW_LIMIT_BYTES`], so that no line can fill the memory. Tells the dialects of CSV apart.
pub struct BoundedRows<R> {
    inner: R,
    dialect: Dialect,
    /// The first two bytes.
    head: [u8; 2],
    bytes_in_line: usize,
    bytes: u64,
    /// Where the line ends are that were handed on and not asked about yet.
    line_ends: VecDeque<u64>,
    /// How many line ends there were before these.
    lines: u64,
    /// A line was too long, this one, and the stream has ended there.
    pub too_long: Option<u64>,
}
impl<R> BoundedRows<R> {
    /// Nothing read yet.
    pub fn new(inner: R) -> Self {
        let (dialect, head) = (Dialect::default(), [0; 2]);
        Self { inner, dialect, head, bytes_in_line: 0, bytes: 0, line_ends: VecDeque::new(), lines: 0, too_long: None }
    }
    /// Line of the row that ends, line end and all, before this byte; none before that is asked about again.
    fn line_before(&mut self, end: u64) -> u64 {
        while self.line_ends.front().is_some_and(|at| *at + 1 < end) {
            self.line_ends.pop_front();
            self.lines += 1;
        }
        self.lines + 1
    }
}
impl<R: Read> Read for BoundedRows<R> {
    fn read(&mut self, buffer: &mut [u8]) -> std::io::Result<usize> {
        if self.too_long.is_some() {
            return Ok(0);
        }
        let count = self.inner.read(buffer)?;
        let read = buffer.get_mut(..count).unwrap_or_default();
        let begun = usize::try_from(self.bytes).unwrap_or(usize::MAX);
        for (head, byte) in self.head.iter_mut().skip(begun).zip(&*read) {
            *head = *byte;
        }
        if matches!(self.head, [0xff, 0xfe] | [0xfe, 0xff]) {
            let why = "UTF-16 text; save it as UTF-8";
            return Err(std::io::Error::new(std::io::ErrorKind::InvalidData, why));
        }
        for byte in read {
            self.dialect.plain(byte);
        }
        for line in buffer.get(..count).unwrap_or_default().split_inclusive(|byte| *byte == b'\n') {
            self.bytes += line.len() as u64;
            self.bytes_in_line += line.len();
            if self.bytes_in_line > ROW_LIMIT_BYTES {
                self.too_long.get_or_insert(self.lines + self.line_ends.len() as u64 + 1);
            }
            if line.ends_with(b"\n") {
                self.bytes_in_line = 0;
                self.line_ends.push_back(self.bytes - 1);
            }
        }
        Ok(count)
    }
}

impl<R> BoundedRows<R> {
    /// Whether what has been handed on ends without a line end.
    pub fn ends_within_a_line(&self) -> bool {
        self.bytes_in_line > 0
    }
}

/// That the last line may have been cut.
pub fn cut(line: u64) -> String {
    format!("line {line} has no line end: the file may be cut there, and its last number be shorter than it was")
}

/// The same of a file of lines, where it is so.
pub fn cut_warning(path: &Path) -> Option<String> {
    let mut file = open_regular(path).ok()?;
    file.seek(SeekFrom::End(-1)).ok()?;
    let mut last = [0];
    file.read_exact(&mut last).ok()?;
    if last == *b"\n" {
        return None;
    }
    file.rewind().ok()?;
    let mut reader = BufReader::new(file);
    let mut line = 1;
    loop {
        let block = reader.fill_buf().ok().filter(|block| !block.is_empty());
        let Some(block) = block else { return Some(cut(line)) };
        for byte in block {
            line += u64::from(*byte == b'\n');
        }
        let count = block.len();
        reader.consume(count);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn table(text: &str, capacity: usize) -> csv::Reader<BoundedRows<&[u8]>> {
        csv::ReaderBuilder::new()
            .has_headers(false)
            .quoting(false)
            .comment(Some(b'#'))
            .buffer_capacity(capacity)
            .from_reader(BoundedRows::new(text.as_bytes()))
    }

    #[test]
    fn dialects_are_told_apart() {
        let plain = [["t_s", "p_x", "note"], ["0.016", "-1.5e-3", "a b"]];
        for text in [
            "# x;y\nt_s,p_x,note\n0.016,-1.5e-3,a b\n",
            "t_s;p_x;note\r\n0,016;-1,5e-3;a b\r\n",
            "t_s\tp_x\tnote\n0.016\t-1.5e-3\ta b\n",
            "\u{feff}\"t_s\",\"p_x\",\"note\"\n0.016,-1.5e-3,\"a,b\"\n",
            "\"t_s\";\"p_x\";\"note\"\n\"0,016\";-1,5e-3;\"a;b\n",
        ] {
            for capacity in [4, 7, 64] {
                let (mut records, mut record) = (table(text, capacity), csv::ByteRecord::new());
                for row in plain {
                    assert!(read_row(&mut records, &mut record, Path::new("rows.csv")).unwrap(), "{text}");
                    let cells: Vec<String> = record
                        .iter()
                        .map(|cell| String::from_utf8_lossy(cell).trim_start_matches('\u{feff}').trim().to_owned())
                        .collect();
                    assert_eq!(cells, row, "{text}");
                }
            }
        }
        let wide: Vec<u8> = "\u{feff}t_s,p_x\n".encode_utf16().flat_map(u16::to_le_bytes).collect();
        let mut rows = BoundedRows::new(wide.as_slice());
        assert!(rows.read_to_end(&mut Vec::new()).unwrap_err().to_string().contains("UTF-16"));
    }

    #[test]
    fn rows_are_named_by_the_line_they_stand_in() {
        for (text, stand_in) in [
            ("a,b\n1,2\n3,4\n", [1, 2, 3]),
            ("a,b\r\n1,2\r\n3,4", [1, 2, 3]),
            ("\n# what\n\na,b\n# why\n# how\n1,2\n\n\n3,4", [4, 7, 10]),
            ("\r\n# what\r\n\r\na,b\r\n# why\r\n# how\r\n1,2\r\n\r\n\r\n3,4\r\n\r\n", [4, 7, 10]),
        ] {
            for capacity in [1, 2, 3, 7, 64] {
                let mut records = table(text, capacity);
                let (mut record, mut lines) = (csv::ByteRecord::new(), Vec::new());
                while read_row(&mut records, &mut record, Path::new("rows.csv")).unwrap() {
                    lines.push(record.position().unwrap().line());
                }
                assert_eq!(lines, stand_in, "{text:?} in steps of {capacity}");
                assert!(records.get_ref().line_ends.len() <= capacity + 2);
            }
        }
    }
}
