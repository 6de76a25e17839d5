//! `tumble calibrate-wheel` and `tumble identify --wheel`.

use super::Outcome;
use crate::AstrobeeError;
use clap::Args;
use std::path::{Path, PathBuf};

/// Options of `tumble calibrate-wheel`.
#[derive(Args)]
pub struct CalibrateWheelArgs {
    /// Throws of the device alone and of device with proof block.
    #[arg(required = true)]
    throws: Vec<PathBuf>,
    /// Calibration file to write.
    #[arg(long, value_name = "FILE")]
    out: PathBuf,
}

/// Runs the command.
///
/// # Errors
/// [`AstrobeeError`] for bad input.
pub fn run(args: &CalibrateWheelArgs) -> Result<Outcome, AstrobeeError> {
    Err(AstrobeeError::OutputExists { path: args.out.clone() })
}

/// Identifies one throw.
///
/// # Errors
/// [`AstrobeeError`] for bad input.
pub fn identify_throw(
    throw: &Path,
    _calibration: &Path,
    _mass: Option<f64>,
    _json: bool,
) -> Result<Outcome, AstrobeeError> {
    Err(AstrobeeError::OutputExists { path: throw.into() })
}
