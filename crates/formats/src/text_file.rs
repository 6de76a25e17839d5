//! Small text files, read without trusting their size.

use std::fs::File;
use std::io::{Error, ErrorKind, Read, Result};
use std::path::Path;

/// No file that a person writes is longer; one that is (a log, a device) must not fill the memory.
pub const LIMIT_BYTES: usize = 1 << 20;

/// The text of a file of at most [`LIMIT_BYTES`].
///
/// # Errors
/// What the system says; [`ErrorKind::FileTooLarge`]; [`ErrorKind::InvalidData`] with the place of what is not UTF-8.
pub fn read(path: &Path) -> Result<String> {
    let mut bytes = Vec::new();
    File::open(path)?.take(LIMIT_BYTES as u64 + 1).read_to_end(&mut bytes)?;
    if bytes.len() > LIMIT_BYTES {
        let message = format!("longer than {LIMIT_BYTES} bytes, which no file of this kind is");
        return Err(Error::new(ErrorKind::FileTooLarge, message));
    }
    String::from_utf8(bytes).map_err(|error| {
        let intact = error.utf8_error().valid_up_to();
        let line = error.as_bytes().iter().take(intact).filter(|byte| **byte == b'\n').count() + 1;
        Error::new(ErrorKind::InvalidData, format!("line {line} is not UTF-8 text"))
    })
}

/// Opens a file that is neither a pipe nor a device, which could be without end.
///
/// # Errors
/// What the system says; [`ErrorKind::InvalidInput`].
pub fn open_regular(path: &Path) -> Result<File> {
    let kind = std::fs::metadata(path)?.file_type();
    if kind.is_dir() {
        return Err(ErrorKind::IsADirectory.into());
    }
    if !kind.is_file() {
        return Err(Error::new(ErrorKind::InvalidInput, "a pipe or a device, where a file is needed"));
    }
    File::open(path)
}

/// The text of such a file, however long it is.
///
/// # Errors
/// As [`open_regular`]; [`ErrorKind::InvalidData`] for what is not UTF-8.
pub fn read_regular(path: &Path) -> Result<String> {
    let mut text = String::new();
    open_regular(path)?.read_to_string(&mut text)?;
    Ok(text)
}

/// Text of a file as a message may quote it: control characters must not reach a terminal, line ends may.
pub fn printable(text: &str) -> String {
    text.chars().map(|c| if c.is_control() && c != '\n' { '\u{fffd}' } else { c }).collect()
}
