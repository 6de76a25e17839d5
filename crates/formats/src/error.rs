//! Errors of files: each with a code, the place and the remedy. All codes stand in `docs/errors.md`.

use std::path::{Path, PathBuf};
use tumble_dynamics::ForeignError;

/// What can be wrong with a file that is read or written.
///
/// Replays of commands, layouts and sinks of rows from outside answer with [`Foreign`](Self::Foreign), which keeps their own error (the other
/// errors of this crate tell of bytes and text, where nothing from outside is called):
/// ```
/// use tumble_formats::FormatsError;
/// let error = FormatsError::foreign("jets", std::io::Error::other("no table of valve 3"));
/// assert_eq!(error.to_string(), "jets: no table of valve 3");
/// assert!(std::error::Error::source(&error).is_some_and(|source| source.is::<std::io::Error>()));
/// ```
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum FormatsError {
    /// T001: a file cannot be read.
    #[error("cannot read {path}: {source}")]
    Unreadable {
        /// The file.
        path: PathBuf,
        /// What the operating system said.
        source: std::io::Error,
    },
    /// T002: a file without a header or without data rows.
    #[error("{path}: the file holds no {what}")]
    Empty {
        /// The file.
        path: PathBuf,
        /// What is missing: a header or data rows.
        what: &'static str,
    },
    /// T003: a required column, or part of an optional group, is missing.
    #[error("{path}: column `{column}` is missing{because}")]
    MissingColumn {
        /// The file.
        path: PathBuf,
        /// Missing column.
        column: String,
        /// Why it is needed.
        because: &'static str,
    },
    /// T004: a column name stands twice in the header.
    #[error("{path}: column `{column}` stands twice in the header")]
    DuplicateColumn {
        /// The file.
        path: PathBuf,
        /// Column name.
        column: String,
    },
    /// T005: a cell that is not a finite number.
    #[error("{path}, line {line}, column `{column}`: `{text}` is not a finite number")]
    BadCell {
        /// The file.
        path: PathBuf,
        /// Line, counted from one.
        line: u64,
        /// Column name.
        column: String,
        /// What stands there (shortened).
        text: String,
    },
    /// T022: a number that its column cannot hold.
    #[error("{path}, line {line}, column `{column}`: {text}, but {allowed}")]
    OutOfRange {
        /// The file.
        path: PathBuf,
        /// Line, counted from one.
        line: u64,
        /// Column name.
        column: String,
        /// What stands there.
        text: String,
        /// What the column holds.
        allowed: &'static str,
    },
    /// T006: a row with another number of cells than the header.
    #[error("{path}, line {line}: {found} cells, the header has {expected}")]
    RowLength {
        /// The file.
        path: PathBuf,
        /// Line, counted from one.
        line: u64,
        /// Cells found.
        found: u64,
        /// Cells in the header.
        expected: u64,
    },
    /// T007: a quaternion that is not of unit norm.
    #[error("{path}, line {line}, columns `q_*`: norm {norm} differs from 1 by more than {tolerance}")]
    NotUnit {
        /// The file.
        path: PathBuf,
        /// Line, counted from one.
        line: u64,
        /// Norm found.
        norm: f64,
        /// Largest accepted difference.
        tolerance: f64,
    },
    /// T008: a time that does not increase.
    #[error("{path}, line {line}, column `t_s`: time {found_s} s does not come after {previous_s} s")]
    TimeNotIncreasing {
        /// The file.
        path: PathBuf,
        /// Line, counted from one.
        line: u64,
        /// Time of the row before.
        previous_s: f64,
        /// Time of this row.
        found_s: f64,
    },
    /// T009: a line longer than any sensible row.
    #[error("{path}, line {line}: more than {limit} bytes in one row")]
    RowTooLong {
        /// The file.
        path: PathBuf,
        /// Line, counted from one.
        line: u64,
        /// Largest accepted row.
        limit: usize,
    },
    /// T011: an output that cannot be written.
    #[error("cannot write {path}: {source}")]
    Unwritable {
        /// The file or folder.
        path: PathBuf,
        /// What the operating system said.
        source: std::io::Error,
    },
    /// T012: an `excitation.toml` that does not parse or does not describe a motion.
    #[error("{path}: {message}")]
    BadExcitation {
        /// The file.
        path: PathBuf,
        /// What is wrong: a key, or what the parser said.
        message: String,
    },
    /// T012: a body, calibration or other TOML file that does not parse.
    #[error("{path}: {message}")]
    BadToml {
        /// The file.
        path: PathBuf,
        /// Line, key and reason, as the parser says them.
        message: String,
    },
    /// T013: a body that no mass distribution has.
    #[error("{path}: no body has these parameters ({source})")]
    ImpossibleBody {
        /// The file.
        path: PathBuf,
        /// The margin missed.
        source: tumble_dynamics::DynamicsError,
    },
    /// T014: an option that does not fit the file.
    #[error("{message}")]
    BadOption {
        /// Which option, and why.
        message: String,
    },
    /// T018: a file format that is not supported.
    #[error("{path}: unknown format; {known}")]
    UnknownFormat {
        /// The file.
        path: PathBuf,
        /// What is supported.
        known: &'static str,
    },
    /// T019: a wheel throw that cannot be used.
    #[error(transparent)]
    Throw(#[from] crate::wheel_throw::WheelThrowError),
    /// T028: a recording of a kind that is not read.
    #[error("no recording that can be read: {reason}")]
    UnknownRecording {
        /// What it is, or what it is not.
        reason: String,
    },
    /// T029: a message that the flight needs and that is not decoded.
    #[error("topic {topic}: {source}")]
    BadMessage {
        /// Topic.
        topic: String,
        /// What is wrong with it.
        source: crate::recording::messages::MessageError,
    },
    /// T030: a recording that holds no flight, or several.
    #[error("{path}: {reason}")]
    NoFlight {
        /// The file.
        path: PathBuf,
        /// What was found and what is missing.
        reason: String,
    },
    /// T030: a damaged recording of which no flight is left.
    #[error("{path}: {reason}; {}", report.summary().unwrap_or_default())]
    Damaged {
        /// The file.
        path: PathBuf,
        /// What is missing.
        reason: String,
        /// What was lost.
        report: Box<crate::recording::ScanReport>,
    },
    /// T050: a model of an arm that does not parse, or says something impossible.
    #[error("{path}, line {line}, column {column}: {message}")]
    BadArm {
        /// The file, or the name of an embedded arm.
        path: PathBuf,
        /// Line, counted from one.
        line: usize,
        /// Column, counted from one.
        column: usize,
        /// The link, joint or key, and what is wrong with it.
        message: String,
    },
    /// T050: an arm that neither exists as a file nor is embedded.
    #[error("there is no arm `{name}`, neither as a file nor embedded{nearest}")]
    NoSuchArm {
        /// What was asked for.
        name: String,
        /// "; did you mean ...", or nothing.
        nearest: String,
    },
    /// T051: links and joints that make no tree.
    #[error("{path}, line {line}, column {column}: {message}")]
    ArmStructure {
        /// The file.
        path: PathBuf,
        /// Line, counted from one.
        line: usize,
        /// Column, counted from one.
        column: usize,
        /// The link or joint, and what keeps it from a tree.
        message: String,
    },
    /// T052: a joint of a kind that is not modelled.
    #[error(
        "{path}, line {line}, column {column}: joint `{joint}` is {kind}; revolute, continuous, prismatic and fixed joints are read"
    )]
    ArmJointKind {
        /// The file.
        path: PathBuf,
        /// Line, counted from one.
        line: usize,
        /// Column, counted from one.
        column: usize,
        /// Its name.
        joint: String,
        /// What it is.
        kind: String,
    },
    /// T053: a link that no body can be.
    #[error("{path}, line {line}, column {column}: link `{link}`: {source}")]
    ArmBody {
        /// The file.
        path: PathBuf,
        /// Line, counted from one.
        line: usize,
        /// Column, counted from one.
        column: usize,
        /// Its name.
        link: String,
        /// What is wrong with its numbers.
        source: tumble_dynamics::DynamicsError,
    },
    /// T054: a column of a joint that the arm does not have.
    #[error("{path}: column `{column}`, but `{arm}` has joints 1 to {joints}")]
    JointColumn {
        /// The log.
        path: PathBuf,
        /// Column name.
        column: String,
        /// The arm.
        arm: String,
        /// Its number of joints.
        joints: usize,
    },
    /// T055: a model of a robot that does not parse, or says something impossible.
    #[error("{path}, line {line}, column {column}: {message}")]
    BadModel {
        /// The file.
        path: PathBuf,
        /// Line, counted from one.
        line: usize,
        /// Column, counted from one.
        column: usize,
        /// What is wrong.
        message: String,
    },
    /// T031: something that the format asked for cannot hold.
    #[error("{path}: {format} cannot hold {what}")]
    NotHeld {
        /// The file that was to be written.
        path: PathBuf,
        /// Its format.
        format: &'static str,
        /// What does not go in.
        what: &'static str,
    },
    /// T032: a ROS 2 database.
    #[error(
        "{path}: a ROS 2 database (.db3) is not read; up to Humble it holds no message definitions, since Iron it does"
    )]
    Database {
        /// The file.
        path: PathBuf,
    },
    /// T037: an implementation from outside refuses.
    #[error("{by}: {source}")]
    Foreign {
        /// Its name.
        by: &'static str,
        /// What it says.
        source: ForeignError,
    },
}

impl FormatsError {
    /// An error of somebody else's replay of commands, layout or sink of rows.
    pub fn foreign(by: &'static str, source: impl std::error::Error + Send + Sync + 'static) -> Self {
        Self::Foreign { by, source: ForeignError::made(source) }
    }

    /// The same of the log that was named, where this tells of a copy of it.
    #[must_use]
    pub(crate) fn naming(mut self, copy: &Path, named: &Path) -> Self {
        if let Self::Unreadable { path, .. }
        | Self::Empty { path, .. }
        | Self::MissingColumn { path, .. }
        | Self::DuplicateColumn { path, .. }
        | Self::BadCell { path, .. }
        | Self::OutOfRange { path, .. }
        | Self::RowLength { path, .. }
        | Self::NotUnit { path, .. }
        | Self::TimeNotIncreasing { path, .. }
        | Self::RowTooLong { path, .. }
        | Self::NoFlight { path, .. }
        | Self::Damaged { path, .. }
        | Self::JointColumn { path, .. }
        | Self::Database { path, .. } = &mut self
            && path == copy
        {
            *path = named.into();
        }
        self
    }

    /// The code under which `docs/errors.md` explains this error.
    pub fn code(&self) -> &'static str {
        match self {
            Self::Unreadable { .. } => "T001",
            Self::Empty { .. } => "T002",
            Self::MissingColumn { .. } => "T003",
            Self::DuplicateColumn { .. } => "T004",
            Self::BadCell { .. } => "T005",
            Self::RowLength { .. } => "T006",
            Self::OutOfRange { .. } => "T022",
            Self::NotUnit { .. } => "T007",
            Self::TimeNotIncreasing { .. } => "T008",
            Self::RowTooLong { .. } => "T009",
            Self::Unwritable { .. } => "T011",
            Self::BadToml { .. } | Self::BadExcitation { .. } => "T012",
            Self::ImpossibleBody { .. } => "T013",
            Self::BadOption { .. } => "T014",
            Self::UnknownFormat { .. } => "T018",
            Self::Throw(_) => "T019",
            Self::BadArm { .. } | Self::NoSuchArm { .. } => "T050",
            Self::ArmStructure { .. } => "T051",
            Self::ArmJointKind { .. } => "T052",
            Self::ArmBody { .. } => "T053",
            Self::JointColumn { .. } => "T054",
            Self::BadModel { .. } => "T055",
            Self::UnknownRecording { .. } => "T028",
            Self::BadMessage { .. } => "T029",
            Self::NoFlight { .. } | Self::Damaged { .. } => "T030",
            Self::NotHeld { .. } => "T031",
            Self::Database { .. } => "T032",
            Self::Foreign { .. } => "T037",
        }
    }

    /// What the user can do about it.
    pub fn remedy(&self) -> &'static str {
        match self {
            Self::Unreadable { source, .. } if source.kind() == std::io::ErrorKind::FileTooLarge => {
                "name the file that was meant: what people write by hand has at most 1 MiB, long tables are CSV"
            }
            Self::Unreadable { .. } => "check the path and that you may read it",
            Self::Empty { .. } => {
                "write a header and rows: `tumble identify --template` prints those of a log, `tumble arm show NAME --as log-template` those of an arm's, the `--help` of `allocate` and `realize` \
                 theirs"
            }
            Self::MissingColumn { .. } => {
                "rename or add the missing one: `tumble identify --template` prints every column of a log, `tumble arm show NAME --as \
                 log-template` those of an arm's, the `--help` of `allocate` and `realize` theirs"
            }
            Self::DuplicateColumn { .. } => "rename or remove one of the two columns",
            Self::BadCell { .. } => "write a finite decimal number; leave the cell empty only in optional columns",
            Self::RowLength { .. } => "the row may be torn: complete or remove it",
            Self::OutOfRange { .. } => {
                "correct the row; the command's `--help` says what each column holds, and its units"
            }
            Self::NotUnit { .. } => "quaternions are Hamilton, scalar last (q_x q_y q_z q_w), of norm one",
            Self::TimeNotIncreasing { .. } => {
                "sort the log, or let `--reorder` put late rows in order and drop repeats"
            }
            Self::RowTooLong { .. } => "this does not look like a CSV log: check the file and its line ends",
            Self::Unwritable { .. } => "check that the folder exists and that you may write there",
            Self::BadToml { .. } => "correct the named key; `docs/log-format.md` shows body and prior files",
            Self::BadExcitation { .. } => "correct the named key; `docs/excitation.md` shows an excitation file",
            Self::ImpossibleBody { .. } => {
                "mass must be positive and the principal inertias about the centre of mass must satisfy the triangle inequality"
            }
            Self::BadOption { .. } => "correct or leave out the option named; `tumble help COMMAND` explains each",
            Self::UnknownFormat { .. } => "choose one of the named formats",
            Self::UnknownRecording { .. } => {
                "ROS 1 bags of version 2.0, MCAP files and ULog up to version 1 are read; `rosbag fix` and `ros2 bag convert` make bags and MCAP of others"
            }
            Self::BadMessage { .. } => {
                "record with message definitions that `docs/recordings.md` lists, or convert the log to CSV"
            }
            Self::Damaged { .. } => {
                "copy the recording again from where it was made; `rosbag reindex` or `mcap recover` may save more of a bag or an MCAP file"
            }
            Self::NoFlight { .. } => {
                "`docs/recordings.md` says which topics make a flight, and how each must be encoded"
            }
            Self::BadArm { .. } => "correct what is named; `docs/arms.md` describes every key and what is read of URDF",
            Self::NoSuchArm { .. } => "`tumble arm list` prints the embedded ones; a file is TOML or URDF",
            Self::ArmStructure { .. } => {
                "one base, every other link on one joint, no ring of joints, no name twice; `docs/arms.md` describes the files"
            }
            Self::ArmJointKind { .. } => {
                "write a floating base as the root link, a planar joint as three joints with massless links, and hold a joint that mimics \
                 another as `fixed`"
            }
            Self::ArmBody { .. } => {
                "mass must be positive and the principal inertias about the centre of mass must satisfy the triangle inequality; leave a \
                 body out that is not known"
            }
            Self::JointColumn { .. } => {
                "name the arm that the log is of, or remove the column; `tumble arm show NAME --as log-template` prints every column"
            }
            Self::BadModel { .. } => "correct what is named; `docs/models.md` says what is read of URDF and MJCF",
            Self::NotHeld { .. } => "choose another format with `--to`; CSV holds everything",
            Self::Database { .. } => {
                "make MCAP of it where ROS 2 is installed (up to Humble, with the packages of its messages): `ros2 bag convert -i log.db3 -o mcap.yaml`, \
                 with `output_bags: [{uri: log, storage_id: mcap, all: true}]` in mcap.yaml"
            }
            Self::Foreign { .. } => "the part named says what it lacks: correct that, or do without it",
            Self::Throw(_) => "check the throw against the column description in `docs/wheel-throws.md`",
        }
    }
}
