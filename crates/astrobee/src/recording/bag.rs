//! ROS 1 bags, version 2.0, read from front to back.

use super::{RawMessage, ScanReport};
use crate::AstrobeeError;
use std::io::Read;
use std::ops::ControlFlow;

/// Reads a bag.
///
/// # Errors
/// [`AstrobeeError::UnknownRecording`].
pub fn scan<R: Read>(
    reader: R,
    visit: &mut dyn FnMut(RawMessage<'_>) -> ControlFlow<()>,
) -> Result<ScanReport, AstrobeeError> {
    let _ = (reader, visit);
    Err(AstrobeeError::UnknownRecording { reason: String::new() })
}
