//! Writes the report of a mission that was never flown: `cargo run --example sample_report -- FILE [planar]`.
//!
//! For looking at the page, and for `cargo xtask report-check`.

#[path = "../tests/suite/support/sample_record.rs"]
mod sample_record;

use std::io::Write as _;
use tumble::TumbleError;
use tumble::mission_report;
use tumble::output::OutputFile;
use tumble_formats::FormatsError;

fn main() -> Result<(), TumbleError> {
    let mut arguments = std::env::args().skip(1);
    let record = |kind: Option<String>| match kind.as_deref() {
        Some("planar") => sample_record::planar_sample(),
        _ => sample_record::sample(),
    };
    let Some(path) = arguments.next() else {
        println!("{} bytes", mission_report::html(&sample_record::sample())?.len());
        return Ok(());
    };
    let page = mission_report::html(&record(arguments.next()))?;
    let mut file = OutputFile::create(path.as_ref(), true)?;
    file.write_all(page.as_bytes()).map_err(|source| FormatsError::Unwritable { path: path.into(), source })?;
    file.finish().map(drop)
}
