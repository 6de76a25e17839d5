//! Campaigns: the same missions over seeds and options, one row each, on any number of cores and machines.
//!
//! ```text
//!  CampaignPlan: row i -> seed, options      (a pure function: neither worker nor shard enters)
//!       |  block of rows of a shard
//!  execute: threads -> MissionRunner -> Row  -> Journal (one line per row, at once; a killed run resumes)
//!       |
//!  rows.csv sorted by number -> merge of all shards -> Analysis: rates with intervals, medians, paired differences
//! ```

mod analysis;
mod execute;
mod factors;
mod flights;
mod folder;
mod journal;
mod merge;
mod page;
#[cfg(feature = "parquet")]
mod parquet_file;
mod plan;
mod report;
mod row;
mod seeds;
pub mod statistics;
mod write;

pub use analysis::{Analysis, Comparison, Difference, GroupSummary, ParameterSummary, Rate, Spread};
pub use execute::{Progress, execute};
pub use factors::{parse_faults, value_name};
pub use flights::SimulatedFlights;
pub use folder::{CampaignFolder, Place, unfinished_place};
pub use journal::Journal;
pub use merge::{Part, merge};
pub use plan::{CampaignConfiguration, CampaignPlan, PlannedMission, ScenarioEntry, Shard, fly_arguments};
pub use report::table;
pub use row::{COLUMNS, Cell, Column, Kind, Row, Status, csv_header};
pub use seeds::mission_seed;
pub use write::{write_merged, write_tables};

use crate::TumbleError;
use crate::mission::MissionSummary;

/// What flies missions; one of them may be asked by many threads at once.
///
/// The answer must follow from the mission alone, or merged campaigns would depend on who flew what.
///
/// # Example
/// ```
/// use std::sync::atomic::{AtomicU64, Ordering};
/// use tumble::TumbleError;
/// use tumble::campaign::{DryRun, MissionRunner, PlannedMission};
/// use tumble::mission::{FlyOptions, LayerNames, MissionSummary, ModelChoice, WeightingChoice};
///
/// /// Any runner, and how many missions it was asked for by all threads together.
/// struct Counted<R>(R, AtomicU64);
/// impl<R: MissionRunner> MissionRunner for Counted<R> {
///     fn run(&self, mission: &PlannedMission) -> Result<Option<MissionSummary>, TumbleError> {
///         self.1.fetch_add(1, Ordering::Relaxed);
///         self.0.run(mission)
///     }
/// }
/// let options = FlyOptions {
///     seed: 1,
///     weighting: WeightingChoice::Covariance,
///     feedback: true,
///     model: ModelChoice::Scenario,
///     fault: None,
///     layers: LayerNames::default(),
/// };
/// let scenario_name = "iss-cargo".to_owned();
/// let mission = PlannedMission { row: 0, k: 0, combination: 0, scenario: 0, scenario_name, draw: None, sensing: None, options };
/// let runner = Counted(DryRun, AtomicU64::new(0));
/// assert!(runner.run(&mission)?.is_none());
/// assert_eq!(runner.1.load(Ordering::Relaxed), 1);
/// # Ok::<(), TumbleError>(())
/// ```
/// Tutorial: [missions that are simulated](https://github.com/tumble-robotics/tumble/blob/main/crates/tumble/src/campaign/flights.rs).
pub trait MissionRunner: Sync {
    /// Flies one mission to its end; `None` where only the plan of the campaign is wanted.
    ///
    /// # Errors
    /// [`TumbleError`]; it becomes a row of its own, as a panic does.
    fn run(&self, mission: &PlannedMission) -> Result<Option<MissionSummary>, TumbleError>;
}

/// Flies nothing: the rows hold numbers, seeds and options.
#[derive(Clone, Copy, Debug, Default)]
pub struct DryRun;

impl MissionRunner for DryRun {
    fn run(&self, _mission: &PlannedMission) -> Result<Option<MissionSummary>, TumbleError> {
        Ok(None)
    }
}

#[cfg(test)]
mod tests;
