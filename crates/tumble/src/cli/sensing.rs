//! `tumble sensing`: what is known of the sensors of robots.

use super::named_sensing::find;
use super::sensing_check::{self, CheckArgs};
use super::{Outcome, print};
use crate::TumbleError;
use clap::{Args, Subcommand};
use std::fmt::Write as _;
use tumble_formats::{Robots, sensing_file};

/// Options of `tumble sensing`.
#[derive(Args)]
pub struct SensingArgs {
    #[command(subcommand)]
    command: SensingCommand,
}

#[derive(Subcommand)]
enum SensingCommand {
    /// Prints the names of sensors that come with the program.
    List,
    /// Prints such sensors, or those of a file, with every key: a file to start from.
    Show {
        /// Name of sensors, or a TOML file.
        name: String,
    },
    /// What a log shows of its own sensors: noise, slow errors, ages, biases, gains, each with its standard deviation.
    Check(Box<CheckArgs>),
}

/// Runs the command.
///
/// # Errors
/// [`TumbleError`] for a name that nobody bears and for a file of impossible sensors.
pub fn run(args: &SensingArgs, robots: &Robots) -> Result<Outcome, TumbleError> {
    match &args.command {
        SensingCommand::List => {
            let mut text = String::new();
            for preset in robots.sensors() {
                let _ = writeln!(text, "{:<20}{}", preset.name, preset.sentence);
            }
            print(&text)?;
        }
        SensingCommand::Check(check) => return sensing_check::run(check, robots),
        SensingCommand::Show { name } => print(&sensing_file::text(&find(name, robots)?))?,
    }
    Ok(Outcome::Achieved)
}
