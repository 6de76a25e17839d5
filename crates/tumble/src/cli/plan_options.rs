//! Options of `tumble plan`, and what its commands write alike.

use super::flown_layers::possible;
use crate::TumbleError;
use crate::mission::planners;
use crate::output::{OutputFolder, RUN_RECORD};
use crate::scenario::{CriterionName, ScenarioSource, UnknownsName, WeightingName};
use clap::{Args, ValueEnum};
use serde_json::json;
use std::path::PathBuf;
use tumble_dynamics::nalgebra::{UnitQuaternion, Vector3};
use tumble_formats::log;

/// Options of `tumble plan`.
#[derive(Args)]
#[command(after_help = "\
Exit codes: 0 for a plan; 2 for an error; 3 where there is no plan, or none was found: what blocks is named.
docs/planning.md describes the answer and the files, docs/scenarios.md the scenario.

Examples:
  tumble plan iss-slalom                        a plan, a bound on what any plan costs, and pictures
  tumble plan granite-room --obstacle-set 2     other obstacles of the same place
  tumble plan iss-gap --first --seed 7          end with the first plan that holds
  tumble plan my.toml --objective impulse --time-limit 10
  tumble plan infoplan --local                  the first seconds of the way, moved so that the body becomes known
  tumble plan iss-slalom --local --weighting none --steps 30")]
#[allow(clippy::struct_excessive_bools, reason = "each is a flag of the command line")]
pub struct PlanArgs {
    /// A scenario file, or the name of an embedded one (`tumble scenario list`).
    pub(super) scenario: String,
    /// Obstacles of the place, 0 to 4; instead of the scenario's.
    #[arg(long, value_name = "N", allow_negative_numbers = true)]
    pub(super) obstacle_set: Option<u8>,
    /// All chance follows from it; instead of the scenario's.
    #[arg(long, value_name = "N", allow_negative_numbers = true)]
    pub(super) seed: Option<u64>,
    /// What is to be least.
    #[arg(long, value_enum, default_value_t = ObjectiveName::Duration)]
    pub(super) objective: ObjectiveName,
    /// How it is looked for.
    #[arg(long, value_name = "NAME", value_parser = possible(&planners()), default_value = "flight")]
    pub(super) planner: String,
    /// Work to be done: one unit is about one check of one edge [default: 100000, about a second].
    #[arg(long, value_name = "UNITS", allow_negative_numbers = true, conflicts_with = "time_limit")]
    pub(super) budget: Option<u64>,
    /// Time to be spent instead, s, at most 86400: the answer then depends on the machine.
    #[arg(long, value_name = "S", allow_hyphen_values = true)]
    pub(super) time_limit: Option<f64>,
    /// End with the first plan that holds.
    #[arg(long)]
    pub(super) first: bool,
    /// Plan one segment of the way, for progress and for information (`[plan.local]`).
    #[arg(long)]
    pub(super) local: bool,
    /// With `--local`: how much information weighs.
    #[arg(long, value_enum)]
    pub(super) weighting: Option<WeightingName>,
    /// With `--local`: what is to be small of the predicted covariance.
    #[arg(long, value_enum)]
    pub(super) criterion: Option<CriterionName>,
    /// With `--local`: what is not known of the body.
    #[arg(long, value_enum)]
    pub(super) unknowns: Option<UnknownsName>,
    /// With `--local`: steps of the horizon.
    #[arg(long, value_name = "N", allow_negative_numbers = true)]
    pub(super) steps: Option<usize>,
    /// Folder to write [default: tumble-out/plan-SCENARIO-SEED, with `--local` local-plan-SCENARIO-SEED, numbered where it exists].
    #[arg(long, value_name = "DIR")]
    pub(super) out: Option<PathBuf>,
    /// Replace an earlier result.
    #[arg(long)]
    pub(super) force: bool,
    /// Print one JSON object and nothing else on stdout.
    #[arg(long)]
    pub(super) json: bool,
}

/// See [`Objective`].
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub(super) enum ObjectiveName {
    /// The duration, s.
    Duration,
    /// The impulse, N s: the integral of the sum of the force's absolute components.
    Impulse,
}

pub(super) fn triple(vector: &Vector3<f64>) -> [f64; 3] {
    (*vector).into()
}

pub(super) fn xyzw(rotation: &UnitQuaternion<f64>) -> [f64; 4] {
    [rotation.i, rotation.j, rotation.k, rotation.w]
}

/// What made the folder's content; its scenario is there already.
pub(super) fn write_run_record(folder: &OutputFolder, source: &ScenarioSource) -> Result<(), TumbleError> {
    let options: Vec<String> = std::env::args().skip(1).collect();
    let run = json!({
        "format": 1,
        "version": env!("CARGO_PKG_VERSION"),
        "commit": option_env!("TUMBLE_COMMIT"),
        "command": "plan",
        "configuration": options,
        "seed": source.scenario.seed,
        "input_hash": { "scenario": log::hash(&folder.file("scenario.toml"))? },
    });
    folder.write(RUN_RECORD, &run.to_string())
}
