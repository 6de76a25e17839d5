//! A mission as one page: verdict, tables, plots and a playback in a single file that opens offline.

mod data;

use crate::error::AstrobeeError;
use crate::mission::MissionRecord;

pub use data::record_of;

/// The report of a mission: one self-contained page that holds the record itself.
///
/// The same record gives the same bytes.
///
/// # Errors
/// [`AstrobeeError::NotHeld`]: a number that is not finite, which the embedded data cannot hold.
pub fn html(record: &MissionRecord) -> Result<String, AstrobeeError> {
    data::script(record)
}
