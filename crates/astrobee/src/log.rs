//! The CSV log: pose, optional rates and accelerations, wrench, against time.
//!
//! Rows are streamed; a log of any size is read in bounded memory.

use crate::error::AstrobeeError;
use crate::recording::{self, flight::FlightReader};
use crate::text_file::printable;
use std::collections::{HashSet, VecDeque};
use std::fs::File;
use std::io::{BufRead as _, BufReader, Read, Seek as _, SeekFrom};
use std::path::{Path, PathBuf};
use tumble_dynamics::nalgebra::{Isometry3, Translation3, Vector3};
use tumble_identification::MotionSample;
use tumble_identification::synchronize::{Held, TimeOrdering};
use tumble_lie::Wrench;

/// Largest accepted difference of a logged quaternion's norm from one; within it the quaternion is normalised.
pub const QUATERNION_NORM_TOLERANCE: f64 = 0.01;
/// No row of numbers is longer than this; a file without line ends must not fill the memory.
pub(crate) const ROW_LIMIT_BYTES: usize = 65_536;
/// How many rows `--reorder` holds back to put late ones in order.
const REORDER_ROWS: usize = 4096;

pub(crate) const REQUIRED: [&str; 8] = ["t_s", "p_x", "p_y", "p_z", "q_x", "q_y", "q_z", "q_w"];
const VELOCITY: [&str; 3] = ["v_x", "v_y", "v_z"];
const RATE: [&str; 3] = ["w_x", "w_y", "w_z"];
const ACCELERATION: [&str; 3] = ["a_x", "a_y", "a_z"];
const FORCE: [&str; 3] = ["f_x", "f_y", "f_z"];
const TORQUE: [&str; 3] = ["tau_x", "tau_y", "tau_z"];

/// Columns that a simulated flight adds for comparison; no estimate reads them.
const SIMULATED: [&str; 6] = ["true_", "cmd_", "est_", "sigma_", "plan_revision", "belief_revision"];

/// What `tumble identify --template` prints: a header with every column and two valid rows.
pub const TEMPLATE: &str = "\
t_s,p_x,p_y,p_z,q_x,q_y,q_z,q_w,v_x,v_y,v_z,w_x,w_y,w_z,a_x,a_y,a_z,f_x,f_y,f_z,tau_x,tau_y,tau_z
0.000,0,0,0,0,0,0,1,0,0,0,0,0,0,0.0104,0,0,0.1,0,0,0,0.002,0
0.016,1.33e-6,0,0,0,0,0,1,0.000167,0,0,0,0.000208,0,0.0104,0,0,0.1,0,0,0,0.002,0
";

/// How the columns of one file are laid out.
struct Layout {
    required: [usize; 8],
    velocity: Option<[usize; 3]>,
    rate: Option<[usize; 3]>,
    acceleration: Option<[usize; 3]>,
    wrench: Option<[usize; 6]>,
    names: Vec<String>,
}

impl Layout {
    fn from_header(header: &csv::ByteRecord, path: &Path) -> Result<(Self, Vec<String>), AstrobeeError> {
        let names: Vec<String> = header.iter().map(|cell| String::from_utf8_lossy(cell).trim().to_owned()).collect();
        if names.iter().all(String::is_empty) {
            return Err(AstrobeeError::Empty { path: path.into(), what: "header" });
        }
        // a set: a header may have tens of thousands of columns
        let mut seen = HashSet::new();
        for name in &names {
            if !name.is_empty() && !seen.insert(name.as_str()) {
                return Err(AstrobeeError::DuplicateColumn { path: path.into(), column: shortened(name) });
            }
        }
        let find = |column: &str, because: &'static str| {
            names.iter().position(|name| name == column).ok_or_else(|| AstrobeeError::MissingColumn {
                path: path.into(),
                column: column.to_owned(),
                because,
            })
        };
        let mut required = [0; 8];
        for (slot, column) in required.iter_mut().zip(REQUIRED) {
            *slot = find(column, "")?;
        }
        let velocity = group(&names, VELOCITY, &find)?;
        let rate = group(&names, RATE, &find)?;
        let acceleration = group(&names, ACCELERATION, &find)?;
        let wrench = group(&names, [TORQUE[0], TORQUE[1], TORQUE[2], FORCE[0], FORCE[1], FORCE[2]], &find)?;
        let known: Vec<&str> = [REQUIRED.as_slice(), &VELOCITY, &RATE, &ACCELERATION, &FORCE, &TORQUE].concat();
        let of_the_format =
            |name: &str| known.contains(&name) || SIMULATED.iter().any(|prefix| name.starts_with(prefix));
        let ignored = names.iter().filter(|name| !of_the_format(name)).map(|name| shortened(name)).collect();
        Ok((Self { required, velocity, rate, acceleration, wrench, names }, ignored))
    }
}

/// An optional group of columns: all of it or none of it.
fn group<const N: usize>(
    names: &[String],
    columns: [&str; N],
    find: &dyn Fn(&str, &'static str) -> Result<usize, AstrobeeError>,
) -> Result<Option<[usize; N]>, AstrobeeError> {
    if !columns.iter().any(|column| names.iter().any(|name| name == column)) {
        return Ok(None);
    }
    let mut indices = [0; N];
    for (slot, column) in indices.iter_mut().zip(columns) {
        *slot = find(column, ", but others of its group are there")?;
    }
    Ok(Some(indices))
}

/// A cell as a message may quote it.
pub(crate) fn shortened(text: &str) -> String {
    const KEEP: usize = 40;
    let text = printable(text);
    if text.chars().count() <= KEEP { text } else { text.chars().take(KEEP).chain("...".chars()).collect() }
}

/// Streams the samples of one log.
pub struct LogReader<R = File> {
    path: PathBuf,
    records: csv::Reader<BoundedRows<BufReader<R>>>,
    record: csv::ByteRecord,
    layout: Layout,
    /// Columns that are not part of the format.
    pub ignored_columns: Vec<String>,
    reorder: Option<Reorder>,
    previous_ns: Option<i64>,
    /// Of the row read last.
    line: u64,
    ended: bool,
}

/// A sample and the line it stood in.
struct Stamped {
    line: u64,
    sample: MotionSample,
}

/// Late rows put in order, repeats of a time dropped.
struct Reorder {
    ordering: TimeOrdering<Stamped, Vec<Option<Held<Stamped>>>>,
    repeated: usize,
}

impl Default for Reorder {
    fn default() -> Self {
        let places = std::iter::repeat_with(|| None).take(REORDER_ROWS).collect();
        Self { ordering: TimeOrdering::new(places), repeated: 0 }
    }
}

impl LogReader<File> {
    /// Opens a log and reads its header.
    ///
    /// # Errors
    /// [`AstrobeeError`] for an unreadable or empty file and for missing or duplicate columns.
    pub fn open(path: &Path, reorder: bool) -> Result<Self, AstrobeeError> {
        let unreadable = |source| AstrobeeError::Unreadable { path: path.into(), source };
        let file = File::open(path).map_err(unreadable)?;
        if file.metadata().map_err(unreadable)?.is_dir() {
            return Err(unreadable(std::io::Error::from(std::io::ErrorKind::IsADirectory)));
        }
        Self::from_reader(file, path, reorder)
    }
}

impl<R: Read> LogReader<R> {
    /// Reads the header of the log that `source` yields; `path` is its name in errors.
    ///
    /// # Errors
    /// As [`LogReader::open`].
    pub fn from_reader(source: R, path: &Path, reorder: bool) -> Result<Self, AstrobeeError> {
        let mut records = csv::ReaderBuilder::new()
            .has_headers(false)
            .flexible(true)
            .quoting(false)
            .comment(Some(b'#'))
            .from_reader(BoundedRows::new(BufReader::new(source)));
        let mut record = csv::ByteRecord::new();
        if !read_row(&mut records, &mut record, path)? {
            return Err(AstrobeeError::Empty { path: path.into(), what: "header" });
        }
        if let Some(first) = record.get(0).and_then(|cell| cell.strip_prefix("\u{feff}".as_bytes())) {
            let cells: Vec<Vec<u8>> =
                std::iter::once(first.to_vec()).chain(record.iter().skip(1).map(<[u8]>::to_vec)).collect();
            record = csv::ByteRecord::from(cells);
        }
        let (layout, ignored_columns) = Layout::from_header(&record, path)?;
        let reorder = reorder.then(Reorder::default);
        Ok(Self {
            path: path.into(),
            records,
            record,
            layout,
            ignored_columns,
            reorder,
            previous_ns: None,
            line: 1,
            ended: false,
        })
    }

    /// Rows that came late and were put in order, rows with a repeated time that were dropped.
    pub fn reordered(&self) -> (usize, usize) {
        self.reorder.as_ref().map_or((0, 0), |r| (r.ordering.late(), r.repeated))
    }

    /// The next sample in time, `None` at the end.
    ///
    /// # Errors
    /// [`AstrobeeError`] naming line and column.
    pub fn next_sample(&mut self) -> Result<Option<MotionSample>, AstrobeeError> {
        loop {
            let Some(stamped) = self.next_in_order()? else { return Ok(None) };
            let time_ns = stamped.sample.time_ns;
            if let Some(previous_ns) = self.previous_ns.filter(|previous| time_ns <= *previous) {
                if let Some(reorder) = self.reorder.as_mut().filter(|_| time_ns == previous_ns) {
                    reorder.repeated += 1;
                    continue;
                }
                return Err(AstrobeeError::TimeNotIncreasing {
                    path: self.path.clone(),
                    line: stamped.line,
                    previous_s: seconds(previous_ns),
                    found_s: seconds(time_ns),
                });
            }
            self.previous_ns = Some(time_ns);
            return Ok(Some(stamped.sample));
        }
    }

    fn next_in_order(&mut self) -> Result<Option<Stamped>, AstrobeeError> {
        loop {
            let row = if self.ended { None } else { self.next_row()? };
            self.ended = row.is_none();
            let Some(reorder) = self.reorder.as_mut() else { return Ok(row) };
            let released = match row {
                Some(stamped) => reorder.ordering.push(stamped.sample.time_ns, stamped),
                None => reorder.ordering.flush(),
            };
            if released.is_some() || self.ended {
                return Ok(released.map(|released| released.sample));
            }
        }
    }

    fn next_row(&mut self) -> Result<Option<Stamped>, AstrobeeError> {
        if !read_row(&mut self.records, &mut self.record, &self.path)? {
            return Ok(None);
        }
        let line = self.record.position().map_or(0, csv::Position::line);
        self.line = line;
        let expected = self.layout.names.len() as u64;
        let found = self.record.len() as u64;
        if found != expected {
            return Err(AstrobeeError::RowLength { path: self.path.clone(), line, found, expected });
        }
        let row = Row { path: &self.path, line, record: &self.record, names: &self.layout.names };
        let at = &self.layout.required;
        let time_ns = row.time_ns(at[0])?;
        let position = Vector3::new(row.number(at[1])?, row.number(at[2])?, row.number(at[3])?);
        let q = [row.number(at[4])?, row.number(at[5])?, row.number(at[6])?, row.number(at[7])?];
        let world_from_body_rotation = tumble_lie::from_xyzw(q[0], q[1], q[2], q[3], QUATERNION_NORM_TOLERANCE)
            .map_err(|_| AstrobeeError::NotUnit {
                path: self.path.clone(),
                line,
                norm: q.iter().map(|c| c * c).sum::<f64>().sqrt(),
                tolerance: QUATERNION_NORM_TOLERANCE,
            })?;
        let wrench = row.optional(self.layout.wrench)?;
        let sample = MotionSample {
            time_ns,
            world_from_body: Isometry3::from_parts(Translation3::from(position), world_from_body_rotation),
            velocity_origin_world: row.optional(self.layout.velocity)?.map(Vector3::from),
            rate_body: row.optional(self.layout.rate)?.map(Vector3::from),
            acceleration_origin_body: row.optional(self.layout.acceleration)?.map(Vector3::from),
            wrench_body: wrench.map(|w| Wrench::new(Vector3::new(w[0], w[1], w[2]), Vector3::new(w[3], w[4], w[5]))),
        };
        Ok(Some(Stamped { line, sample }))
    }

    /// The line at whose end the file ends without ending the line, once it has been read.
    fn cut_line(&self) -> Option<u64> {
        (self.ended && self.records.get_ref().ends_within_a_line()).then_some(self.line)
    }

    /// What a user should know about the rows read so far.
    fn warnings(&self) -> Vec<String> {
        let mut warnings = Vec::new();
        if let Some(line) = self.cut_line() {
            warnings.push(cut(line));
        }
        if !self.ignored_columns.is_empty() {
            warnings.push(format!("columns ignored: {}", self.ignored_columns.join(", ")));
        }
        let (late, repeated) = self.reordered();
        if late + repeated > 0 {
            warnings.push(format!("{late} rows came late and were put in order, {repeated} repeated times dropped"));
        }
        warnings
    }
}

/// Streams the samples of a log of any kind.
pub enum SampleReader {
    /// Rows of a CSV log.
    Rows(Box<LogReader>),
    /// A robot's flight in a bag or an MCAP file.
    Flight(Box<FlightReader>),
}

impl SampleReader {
    /// Opens a log; what kind it is, its first bytes say. `reorder` is for rows (recordings are always put in order),
    /// `robot` for recordings.
    ///
    /// # Errors
    /// As [`LogReader::open`] and [`FlightReader::open`].
    pub fn open(path: &Path, reorder: bool, robot: Option<&str>) -> Result<Self, AstrobeeError> {
        Ok(match (recording::container(path)?, robot) {
            (Some(_), _) => Self::Flight(Box::new(FlightReader::open(path, robot)?)),
            (None, None) => Self::Rows(Box::new(LogReader::open(path, reorder)?)),
            (None, Some(_)) => {
                let message = "`--robot` chooses among the robots of a bag or an MCAP file".to_owned();
                return Err(AstrobeeError::BadOption { message });
            }
        })
    }

    /// The next sample in time, `None` at the end.
    ///
    /// # Errors
    /// As [`LogReader::next_sample`] and [`FlightReader::next_sample`].
    pub fn next_sample(&mut self) -> Result<Option<MotionSample>, AstrobeeError> {
        match self {
            Self::Rows(rows) => rows.next_sample(),
            Self::Flight(flight) => flight.next_sample(),
        }
    }

    /// Appends up to `limit` samples to `samples`; `false` when the log has ended.
    ///
    /// # Errors
    /// As [`SampleReader::next_sample`].
    pub fn read_chunk(&mut self, samples: &mut Vec<MotionSample>, limit: usize) -> Result<bool, AstrobeeError> {
        for _ in 0..limit {
            match self.next_sample()? {
                Some(sample) => samples.push(sample),
                None => return Ok(false),
            }
        }
        Ok(true)
    }

    /// Whether it is a recording without any wrench of its robot.
    pub fn lacks_wrench(&self) -> bool {
        matches!(self, Self::Flight(flight) if flight.plan.wrench.is_none())
    }

    /// What a recording holds and what of it is used, for people; empty for rows.
    pub fn contents(&self) -> String {
        match self {
            Self::Rows(_) => String::new(),
            Self::Flight(flight) => recording::flight::table(&flight.topics, &flight.plan),
        }
    }

    /// What a user should know about what has been read, complete at the end.
    pub fn warnings(&self) -> Vec<String> {
        match self {
            Self::Rows(rows) => rows.warnings(),
            Self::Flight(flight) => {
                flight.tally().map_or_else(Vec::new, |tally| tally.warnings(&flight.plan, &flight.topics))
            }
        }
    }
}

/// One row with what an error message needs.
pub(crate) struct Row<'a> {
    pub(crate) path: &'a Path,
    pub(crate) line: u64,
    pub(crate) record: &'a csv::ByteRecord,
    pub(crate) names: &'a [String],
}

impl Row<'_> {
    pub(crate) fn text(&self, column: usize) -> &[u8] {
        self.record.get(column).unwrap_or_default().trim_ascii()
    }
    fn bad_cell(&self, column: usize) -> AstrobeeError {
        AstrobeeError::BadCell {
            path: self.path.into(),
            line: self.line,
            column: self.names.get(column).cloned().unwrap_or_default(),
            text: shortened(&String::from_utf8_lossy(self.text(column))),
        }
    }
    pub(crate) fn number(&self, column: usize) -> Result<f64, AstrobeeError> {
        std::str::from_utf8(self.text(column))
            .ok()
            .and_then(|text| text.parse::<f64>().ok())
            .filter(|value| value.is_finite())
            .ok_or_else(|| self.bad_cell(column))
    }
    pub(crate) fn time_ns(&self, column: usize) -> Result<i64, AstrobeeError> {
        std::str::from_utf8(self.text(column)).ok().and_then(parse_time_ns).ok_or_else(|| self.bad_cell(column))
    }
    /// An optional group: `None` where any of its cells is empty.
    fn optional<const N: usize>(&self, columns: Option<[usize; N]>) -> Result<Option<[f64; N]>, AstrobeeError> {
        let Some(columns) = columns else { return Ok(None) };
        if columns.iter().any(|column| self.text(*column).is_empty()) {
            return Ok(None);
        }
        let mut values = [0.0; N];
        for (value, column) in values.iter_mut().zip(columns) {
            *value = self.number(column)?;
        }
        Ok(Some(values))
    }
}

/// The next row, at the line it stands in; `false` at the end.
pub(crate) fn read_row<R: Read>(
    records: &mut csv::Reader<BoundedRows<R>>,
    record: &mut csv::ByteRecord,
    path: &Path,
) -> Result<bool, AstrobeeError> {
    let found = records.read_byte_record(record);
    if let Some(line) = records.get_ref().too_long {
        return Err(AstrobeeError::RowTooLong { path: path.into(), line, limit: ROW_LIMIT_BYTES });
    }
    let line = line_read(records);
    if let Some(position) = record.position().cloned().as_mut() {
        record.set_position(Some(position.set_line(line).clone()));
    }
    found.map_err(|error| AstrobeeError::Unreadable { path: path.into(), source: error.into() })
}

/// The line of the row read last. The reader's own count is that of the comments and empty lines before it, and one too small
/// behind `\r\n`.
pub(crate) fn line_read<R: Read>(records: &mut csv::Reader<BoundedRows<R>>) -> u64 {
    let end = records.position().byte();
    records.get_mut().line_before(end)
}

/// Counts lines, and ends the stream when one grows beyond [`ROW_LIMIT_BYTES`], so that no line can fill the memory.
pub(crate) struct BoundedRows<R> {
    inner: R,
    bytes_in_line: usize,
    bytes: u64,
    /// Where the line ends are that were handed on and not asked about yet.
    line_ends: VecDeque<u64>,
    /// How many line ends there were before these.
    lines: u64,
    /// A line was too long, this one, and the stream has ended there.
    pub(crate) too_long: Option<u64>,
}
impl<R> BoundedRows<R> {
    pub(crate) fn new(inner: R) -> Self {
        Self { inner, bytes_in_line: 0, bytes: 0, line_ends: VecDeque::new(), lines: 0, too_long: None }
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
    pub(crate) fn ends_within_a_line(&self) -> bool {
        self.bytes_in_line > 0
    }
}

/// That the last line may have been cut.
fn cut(line: u64) -> String {
    format!("line {line} has no line end: the file may be cut there, and its last number be shorter than it was")
}

/// The same of a file of lines, where it is so.
pub(crate) fn cut_warning(path: &Path) -> Option<String> {
    let mut file = File::open(path).ok()?;
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
        line += block.iter().filter(|byte| **byte == b'\n').count() as u64;
        let count = block.len();
        reader.consume(count);
    }
}

/// A 64-bit FNV-1a hash of a file's bytes, hexadecimal: tells whether two runs read the same log.
///
/// # Errors
/// [`AstrobeeError::Unreadable`].
pub fn hash(path: &Path) -> Result<String, AstrobeeError> {
    let unreadable = |source| AstrobeeError::Unreadable { path: path.into(), source };
    let mut file = BufReader::new(File::open(path).map_err(unreadable)?);
    let mut buffer = [0; 8192];
    let mut hash: u64 = 0xcbf2_9ce4_8422_2325;
    loop {
        let count = file.read(&mut buffer).map_err(unreadable)?;
        if count == 0 {
            return Ok(format!("fnv1a64:{hash:016x}"));
        }
        for byte in buffer.iter().take(count) {
            hash = (hash ^ u64::from(*byte)).wrapping_mul(0x0000_0100_0000_01b3);
        }
    }
}

/// Seconds for people; never used for differences.
#[allow(clippy::cast_precision_loss)]
pub fn seconds(time_ns: i64) -> f64 {
    time_ns as f64 * 1e-9
}

/// Decimal seconds to nanoseconds without a detour through a float; digits beyond the ninth are rounded.
///
/// `None` for anything that is not a decimal number or does not fit in 64 bits.
pub fn parse_time_ns(text: &str) -> Option<i64> {
    let (mantissa, exponent) = match text.find(['e', 'E']) {
        Some(at) => (text.get(..at)?, text.get(at + 1..)?.parse::<i32>().ok()?),
        None => (text, 0),
    };
    let (negative, digits) = match mantissa.strip_prefix('-') {
        Some(rest) => (true, rest),
        None => (false, mantissa.strip_prefix('+').unwrap_or(mantissa)),
    };
    let (whole, fraction) = digits.split_once('.').unwrap_or((digits, ""));
    if (whole.is_empty() && fraction.is_empty()) || !whole.bytes().chain(fraction.bytes()).all(|b| b.is_ascii_digit()) {
        return None;
    }
    // value = digits * 10^-scale nanoseconds
    let mut value: i128 = 0;
    let mut scale = i64::try_from(fraction.len()).ok()? - i64::from(exponent) - 9;
    for digit in whole.bytes().chain(fraction.bytes()) {
        if value > i128::MAX / 100 {
            // More than 36 significant digits: the rest is below a nanosecond or beyond 64 bits.
            scale -= 1;
            continue;
        }
        value = value * 10 + i128::from(digit - b'0');
    }
    if value == 0 {
        return Some(0);
    }
    while scale < 0 {
        value = value.checked_mul(10)?;
        scale += 1;
    }
    let mut round_up = false;
    while scale > 0 && value > 0 {
        round_up = value % 10 >= 5;
        value /= 10;
        scale -= 1;
    }
    value += i128::from(round_up && scale == 0);
    i64::try_from(if negative { -value } else { value }).ok()
}

#[cfg(test)]
mod tests {
    use super::*;
    use tumble_lie::nalgebra::Vector4;

    #[test]
    fn every_cell_lands_where_its_column_says() {
        let path = std::env::temp_dir().join(format!("tumble-log-columns-{}.csv", std::process::id()));
        let text = "f_z,q_w,q_x,q_y,q_z,t_s,p_z,p_x,p_y,tau_x,tau_y,tau_z,f_x,f_y,w_x,w_y,w_z\n\
                    6,0.5,0.1,-0.7,0.5,1700000000.000000001,13,11,12,1,2,3,4,5,7,8,9\n";
        std::fs::write(&path, text).unwrap();
        let sample = LogReader::open(&path, false).unwrap().next_sample().unwrap().unwrap();
        std::fs::remove_file(&path).unwrap();
        assert_eq!(sample.time_ns, 1_700_000_000_000_000_001);
        let pose = sample.world_from_body;
        assert_eq!(pose.translation.vector, Vector3::new(11.0, 12.0, 13.0));
        let (q, expected) = (pose.rotation.coords, Vector4::new(0.1, -0.7, 0.5, 0.5));
        assert!((q - expected).amax() < 1e-15, "{q:?}");
        let wrench = sample.wrench_body.unwrap();
        assert_eq!((wrench.torque, wrench.force), (Vector3::new(1.0, 2.0, 3.0), Vector3::new(4.0, 5.0, 6.0)));
        assert_eq!(sample.rate_body, Some(Vector3::new(7.0, 8.0, 9.0)));
        assert_eq!((sample.velocity_origin_world, sample.acceleration_origin_body), (None, None));
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
                let mut records = csv::ReaderBuilder::new()
                    .has_headers(false)
                    .quoting(false)
                    .comment(Some(b'#'))
                    .buffer_capacity(capacity)
                    .from_reader(BoundedRows::new(text.as_bytes()));
                let (mut record, mut lines) = (csv::ByteRecord::new(), Vec::new());
                while read_row(&mut records, &mut record, Path::new("rows.csv")).unwrap() {
                    lines.push(record.position().unwrap().line());
                }
                assert_eq!(lines, stand_in, "{text:?} in steps of {capacity}");
                assert!(records.get_ref().line_ends.len() <= capacity + 2);
            }
        }
    }

    #[test]
    fn times_are_exact_to_the_nanosecond() {
        for (text, ns) in [
            ("0", 0),
            ("1700000000.123456789", 1_700_000_000_123_456_789),
            ("-0.5", -500_000_000),
            (".25", 250_000_000),
            ("3.", 3_000_000_000),
            ("1.5e-3", 1_500_000),
            ("1.7e9", 1_700_000_000_000_000_000),
            ("0.0000000005", 1),
            ("0.0000000004999", 0),
            ("0.99999999999999999999999999999999999999999999", 1_000_000_000),
            ("+2", 2_000_000_000),
        ] {
            assert_eq!(parse_time_ns(text), Some(ns), "{text}");
        }
        for text in ["", ".", "-", "1e", "nan", "inf", "1e30", "99999999999", "1,5", "0x10", "1e-", "--1"] {
            assert_eq!(parse_time_ns(text), None, "{text}");
        }
    }
}
