//! The commands: options in, tables, JSON and files out.

use crate::TumbleError;
use tumble_formats::FormatsError;

pub mod allocate;
pub mod arm;
mod arm_excite;
pub mod calibrate_wheel;
pub mod campaign;
mod columns;
pub mod convert;
pub mod excite;
pub mod fly;
mod fly_table;
pub mod identify;
mod identify_arm;
mod identify_log;
mod identify_options;
mod identify_periodic;
pub mod plan;
mod plan_blockers;
mod plan_budget;
mod plan_check;
mod plan_csv;
mod plan_figure;
mod plan_local;
mod plan_local_check;
mod plan_local_figure;
mod plan_local_report;
mod plan_local_solve;
mod plan_options;
pub mod realize;
pub mod scenario;
pub mod simulate;
mod simulate_control;

/// How a command ended when nothing was wrong with its input.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Outcome {
    /// The thing asked for was achieved: exit code 0.
    Achieved,
    /// The input was fine but the thing asked for was not achieved: exit code 3.
    NotAchieved,
}

/// Prints to stdout; a closed pipe (`tumble ... | head`) is not an error, a full disk is.
///
/// # Errors
/// [`FormatsError::Unwritable`].
pub fn print(text: &str) -> Result<(), TumbleError> {
    use std::io::Write as _;
    let mut stdout = std::io::stdout().lock();
    match stdout.write_all(text.as_bytes()).and_then(|()| stdout.flush()) {
        Err(source) if source.kind() != std::io::ErrorKind::BrokenPipe => {
            Err(FormatsError::Unwritable { path: "standard output".into(), source }.into())
        }
        _ => Ok(()),
    }
}
