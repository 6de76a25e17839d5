//! What a throw must hold, and what can be wrong with its files.

use crate::toml_text::TomlError;
use std::path::PathBuf;
use tumble_identification::IdentificationError;

/// Columns of a throw; a file may hold them in any order, and others.
pub const THROW_COLUMNS: [&str; 8] =
    ["t_s", "wx_rad_s", "wy_rad_s", "wz_rad_s", "ax_m_s2", "ay_m_s2", "az_m_s2", "wheel_rad_s"];

/// Version of the calibration file.
pub(super) const FORMAT: u32 = 1;

/// What can be wrong with the files of a throw.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum WheelThrowError {
    /// The file cannot be read.
    #[error("{path}: {source}", path = path.display())]
    Unreadable {
        /// File.
        path: PathBuf,
        /// What the system says.
        source: std::io::Error,
    },
    /// The file is not a table of equally long rows.
    #[error("{path}: {source}", path = path.display())]
    NotATable {
        /// File.
        path: PathBuf,
        /// What the reader says, with the line.
        source: csv::Error,
    },
    /// A column is missing.
    #[error("{path}, line 1: column `{column}` is missing; a throw has {columns}", path = path.display(), columns = THROW_COLUMNS.join(", "))]
    MissingColumn {
        /// File.
        path: PathBuf,
        /// Column.
        column: &'static str,
    },
    /// A column stands twice.
    #[error("{path}, line 1: column `{column}` stands twice; keep one", path = path.display())]
    DuplicateColumn {
        /// File.
        path: PathBuf,
        /// Column.
        column: &'static str,
    },
    /// A cell holds no finite number.
    #[error("{path}, line {line}, column `{column}`: `{cell}` is not a finite number", path = path.display())]
    NotANumber {
        /// File.
        path: PathBuf,
        /// Line, from one.
        line: u64,
        /// Column.
        column: &'static str,
        /// The cell.
        cell: String,
    },
    /// A time is not after the one before.
    #[error("{path}, line {line}, column `t_s`: the time is not after the one before", path = path.display())]
    TimesNotIncreasing {
        /// File.
        path: PathBuf,
        /// Line, from one.
        line: u64,
    },
    /// A line longer than any row of a throw.
    #[error("{path}, line {line}: longer than {limit} bytes; this is no table of numbers", path = path.display())]
    LineTooLong {
        /// File.
        path: PathBuf,
        /// Line, from one.
        line: u64,
        /// Most bytes in a line.
        limit: usize,
    },
    /// More rows than any throw has.
    #[error("{path}: more than {limit} rows; cut the record to one throw", path = path.display())]
    TooLong {
        /// File.
        path: PathBuf,
        /// Most rows read.
        limit: usize,
    },
    /// A calibration file that is none.
    #[error("{path}: {source}", path = path.display())]
    NotACalibration {
        /// File.
        path: PathBuf,
        /// What the reader says, with line and key.
        source: TomlError,
    },
    /// A calibration file of another version.
    #[error("{path}, key `format`: version {found}, this program reads {FORMAT}", path = path.display())]
    UnknownFormat {
        /// File.
        path: PathBuf,
        /// Version found.
        found: u32,
    },
    /// A calibration throw whose file name says neither what was thrown.
    #[error(
        "{path}: begins with neither `cal_device` (device alone) nor `cal_proof` (with the proof block); rename it or \
         name the kind",
        path = path.display()
    )]
    UnknownKind {
        /// File.
        path: PathBuf,
    },
    /// A throw that cannot be identified.
    #[error("{path}: {source}", path = path.display())]
    NotIdentified {
        /// File.
        path: PathBuf,
        /// Why.
        source: IdentificationError,
    },
    /// Throws that do not make a calibration.
    #[error(transparent)]
    NotCalibrated(#[from] IdentificationError),
}
