//! Scenarios: one TOML format for everything that flies.
//!
//! `docs/scenarios.md` describes every key.

mod build;
mod control;
mod control_table;
mod description;
mod embedded;
mod flight;
mod fly;
mod mission_problem;
mod nozzles;
mod plan;
mod plan_local;
mod plan_local_table;
mod plan_table;
mod planning_problem;
mod sensed;
mod source;
mod written;

pub use build::read_wrenches;
pub use control_table::{BeliefTable, ControlTable};
pub use embedded::EMBEDDED;
use flight::NONE;
pub(crate) use flight::{FLOWN, TRACKER};
pub use flight::{Flight, PayloadChange, Steering};
pub use fly::{
    ArrivalTable, ComputingTable, EstimatorTable, FlyTable, InformationTable, LARGEST_OUTSIDE, draw_mission,
};
pub use mission_problem::{
    ArrivalTolerance, ComputingSettings, Margins, MissionProblem, PlannedMotion, WeightingSettings,
};
pub use plan_local::LocalProblem;
pub use plan_local_table::{
    CriterionName, EffortTable, LocalTable, MeasurementTable, NuisanceTable, PriorTable, TrackingTable, UnknownsName,
    WeightingName,
};
pub use plan_table::{PlanBodyTable, PlanTable};
pub use planning_problem::PlanningProblem;
pub use source::ScenarioSource;
pub use written::{
    BodyTable, DriveTable, FORMAT, KeepOutTable, LONGEST_S, LimitsTable, MultisineTable, ObstacleTable,
    PayloadMotionName, PayloadTable, PoseTable, PropulsionName, PropulsionTable, Scenario, SensingTable, StartTable,
    WaypointTable, WrenchTable,
};
