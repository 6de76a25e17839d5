//! Sensors that a command line names.

use crate::TumbleError;
use std::path::Path;
use tumble_formats::{Robots, sensing_file};
use tumble_identification::sensing::Sensing;

/// Sensors by name, or of a file.
pub(super) fn find(name: &str, robots: &Robots) -> Result<Sensing, TumbleError> {
    let path = Path::new(name);
    if path.exists() {
        return Ok(sensing_file::read(path)?);
    }
    robots
        .sensing(name)
        .map_err(|unknown| TumbleError::BadOption { message: format!("{unknown}; no file has that name") })
}
