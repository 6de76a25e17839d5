//! The commands that fly in Astrobee's simulator.

use crate::TumbleError;
use crate::cli::{Outcome, campaign, fly, plan, scenario, simulate};
use clap::Subcommand;
use tumble_formats::Robots;

#[derive(Subcommand)]
pub enum Command {
    /// Flies a scenario and writes its log: measured, true and commanded.
    Simulate(simulate::SimulateArgs),
    /// Flies a mission by what the robot learns of itself: plans, controls, estimates, replans; with a report to open.
    Fly(fly::FlyArgs),
    /// Flies the mission of a report again, and compares.
    Replay(fly::ReplayArgs),
    /// Plans a scenario's way from start to goal around its obstacles, with a bound on what any plan costs.
    Plan(plan::PlanArgs),
    /// Flies missions over seeds and options on all cores, one row each; parts of it on many machines.
    Campaign(Box<campaign::CampaignArgs>),
    /// Lists and shows the scenarios that come with the program.
    Scenario(scenario::ScenarioArgs),
}

impl Command {
    /// Runs the command.
    pub fn run(&self, robots: &Robots) -> Result<Outcome, TumbleError> {
        match self {
            Self::Simulate(args) => simulate::run(args, robots),
            Self::Fly(args) => fly::run(args, robots),
            Self::Replay(args) => fly::replay(args, robots),
            Self::Plan(args) => plan::run(args, robots),
            Self::Campaign(args) => campaign::run(args, robots),
            Self::Scenario(args) => scenario::run(args),
        }
    }
}
