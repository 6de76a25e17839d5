//! `tumble scenario`: the scenarios that come with the program.

use super::{Outcome, print};
use crate::TumbleError;
use crate::scenario::{EMBEDDED, ScenarioSource};
use clap::{Args, Subcommand};
use std::fmt::Write as _;

/// Options of `tumble scenario`.
#[derive(Args)]
pub struct ScenarioArgs {
    #[command(subcommand)]
    command: ScenarioCommand,
}

#[derive(Subcommand)]
enum ScenarioCommand {
    /// Prints the names of the embedded scenarios.
    List,
    /// Prints one as TOML, to run or to start from; a file is checked first.
    Show {
        /// Name of an embedded scenario, or a file.
        name: String,
    },
}

/// Runs the command.
///
/// # Errors
/// [`TumbleError`] for a scenario that is none.
pub fn run(args: &ScenarioArgs) -> Result<Outcome, TumbleError> {
    match &args.command {
        ScenarioCommand::List => {
            let mut text = String::new();
            for embedded in EMBEDDED {
                let scenario = ScenarioSource::find(embedded.name)?.scenario;
                let _ = writeln!(text, "{:<20}{}", embedded.name, scenario.description.unwrap_or_default());
            }
            print(&text)?;
            tell_line!(
                "next: tumble fly NAME for a mission, tumble simulate NAME for the others, or tumble scenario show NAME > my.toml"
            );
        }
        ScenarioCommand::Show { name } => {
            let source = ScenarioSource::find(name)?;
            source.flight()?;
            print(&source.text)?;
        }
    }
    Ok(Outcome::Achieved)
}
