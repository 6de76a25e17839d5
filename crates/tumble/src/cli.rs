//! The commands: options in, tables, JSON and files out.

use crate::TumbleError;
use std::path::{Path, PathBuf};
use tumble_formats::{FormatsError, LogFile};

/// Says on stderr what `format!` would give. Where nobody listens, the pipe closed or the disk full, the work goes on: results and the exit
/// code tell as much.
macro_rules! tell {
    ($($text:tt)*) => {
        $crate::cli::said::told(format_args!($($text)*))
    };
}

/// The same with an end of line.
macro_rules! tell_line {
    ($($text:tt)*) => {
        $crate::cli::said::told(format_args!("{}\n", format_args!($($text)*)))
    };
}

#[cfg(feature = "astrobee")]
pub mod allocate;
pub mod arm;
mod arm_excite;
pub mod calibrate_wheel;
#[cfg(feature = "astrobee")]
pub mod campaign;
pub mod check;
#[cfg(feature = "astrobee")]
mod columns;
#[cfg(feature = "astrobee")]
mod commanded_nozzles;
pub mod convert;
pub mod excite;
mod excite_motion;
mod excite_options;
mod excite_page;
#[cfg(feature = "astrobee")]
mod flown_layers;
#[cfg(feature = "astrobee")]
mod flown_sensing;
#[cfg(feature = "astrobee")]
pub mod fly;
#[cfg(feature = "astrobee")]
mod fly_table;
pub mod identify;
mod identify_arm;
mod identify_log;
mod identify_options;
mod identify_periodic;
mod named_sensing;
mod own_estimator;
#[cfg(feature = "astrobee")]
pub mod plan;
#[cfg(feature = "astrobee")]
mod plan_blockers;
#[cfg(feature = "astrobee")]
mod plan_budget;
#[cfg(feature = "astrobee")]
mod plan_check;
#[cfg(feature = "astrobee")]
mod plan_csv;
#[cfg(feature = "astrobee")]
mod plan_figure;
#[cfg(feature = "astrobee")]
mod plan_local;
#[cfg(feature = "astrobee")]
mod plan_local_check;
#[cfg(feature = "astrobee")]
mod plan_local_page;
#[cfg(feature = "astrobee")]
mod plan_local_report;
#[cfg(feature = "astrobee")]
mod plan_local_solve;
#[cfg(feature = "astrobee")]
mod plan_options;
#[cfg(feature = "astrobee")]
mod plan_page;
#[cfg(feature = "astrobee")]
pub mod realize;
pub(crate) mod said;
pub mod sample;
#[cfg(feature = "astrobee")]
pub mod scenario;
pub mod sensing;
mod sensing_check;
#[cfg(feature = "astrobee")]
pub mod simulate;
#[cfg(feature = "astrobee")]
mod simulate_control;
#[cfg(feature = "astrobee")]
mod simulate_flight;
#[cfg(feature = "astrobee")]
mod simulate_page;
#[cfg(feature = "astrobee")]
mod unflown;

pub use said::{Said, captured};

/// How a command ended when nothing was wrong with its input.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Outcome {
    /// The thing asked for was achieved: exit code 0.
    Achieved,
    /// The input was fine but the thing asked for was not achieved: exit code 3.
    NotAchieved,
}

/// The log that was named, as a file; a pipe is read to its end.
pub(crate) fn log_file(named: &Path) -> Result<LogFile, TumbleError> {
    let mut told = false;
    let file = LogFile::of(named, &mut |bytes| {
        if bytes == 0 {
            tell_line!("reading {} to its end ...", named.display());
        } else {
            told = true;
            said::progress(&format!("{} MB ...", bytes / 1_000_000));
        }
    });
    if told {
        said::progress("");
    }
    Ok(file?)
}

/// The logs that were named, as files.
pub(crate) fn log_files(named: &[PathBuf]) -> Result<Vec<LogFile>, TumbleError> {
    named.iter().map(|named| log_file(named)).collect()
}

/// An error about one of them by the name that was given.
pub(crate) fn by_name(files: &[LogFile], error: TumbleError) -> TumbleError {
    match error {
        TumbleError::File(error) => files.iter().fold(error, |error, file| file.by_name(error)).into(),
        other => other,
    }
}

/// Where they lie.
pub(crate) fn paths_of(files: &[LogFile]) -> Vec<PathBuf> {
    files.iter().map(|file| file.path().to_owned()).collect()
}

/// Several names as one.
pub(crate) fn named_together(named: &[PathBuf]) -> String {
    named.iter().map(|path| path.display().to_string()).collect::<Vec<_>>().join(" with ")
}

/// What tells whether two runs read the same logs: the hash of each. `None` where one cannot be read again.
pub(crate) fn hash_of(paths: &[PathBuf]) -> Option<String> {
    let hashes: Result<Vec<_>, _> = paths.iter().map(|path| tumble_formats::log::hash(path)).collect();
    hashes.ok().filter(|hashes| !hashes.is_empty()).map(|hashes| hashes.join(" "))
}

/// Prints to stdout; a closed pipe (`tumble ... | head`) is not an error, a full disk is.
///
/// # Errors
/// [`FormatsError::Unwritable`].
pub fn print(text: &str) -> Result<(), TumbleError> {
    use std::io::Write as _;
    if said::kept(text) {
        return Ok(());
    }
    let mut stdout = std::io::stdout().lock();
    match stdout.write_all(text.as_bytes()).and_then(|()| stdout.flush()) {
        Err(source) if source.kind() != std::io::ErrorKind::BrokenPipe => {
            Err(FormatsError::Unwritable { path: "standard output".into(), source }.into())
        }
        _ => Ok(()),
    }
}
