//! The commands: options in, tables, JSON and files out.

pub mod calibrate_wheel;
pub mod identify;

/// How a command ended when nothing was wrong with its input.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Outcome {
    /// The thing asked for was achieved: exit code 0.
    Achieved,
    /// The input was fine but the thing asked for was not achieved: exit code 3.
    NotAchieved,
}

/// Prints to stdout; a closed pipe (`tumble ... | head`) is not an error.
pub(crate) fn print(text: &str) {
    use std::io::Write as _;
    // Nobody is left to tell when stdout is closed.
    let _ = std::io::stdout().lock().write_all(text.as_bytes());
}
