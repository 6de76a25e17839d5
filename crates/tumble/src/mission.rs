//! A mission: RATTLE's layers around the simulated robot, from a scenario to a record of what happened.

mod assembly;
mod doubts;
mod faults;
mod flight;
mod hooks;
mod invariants;
mod layer_names;
mod layers;
mod options;
mod record;
mod registries;
mod weighting;

pub use assembly::{AstrobeeLoop, MissionPlanners, closed_loop};
pub use faults::{
    BodyStep, Fault, FaultChoiceError, Faults, LateObstacle, PlannerFault, PlantChange, Sabotage, replay_line,
};
pub use flight::{fly, measurement};
pub use hooks::{FlownPeriod, MissionHooks, NoHooks};
pub use layer_names::{LayerNames, WrittenNames};
pub use layers::{computing_time, estimator, loop_settings, scene, stretch_planner, tube_controllers};
pub use options::{FaultChoice, FaultName, FlyOptions, ModelChoice};
pub use record::{
    BROKEN_INVARIANT, BeliefRow, DoubtOf, DoubtRow, DrawnBox, DrawnEllipsoid, DrawnPayload, FallbackRow, MissionEvent,
    MissionRecord, MissionSummary, MissionVerdict, PROMISED, ParameterRow, Promises, Series, StretchRow, TrackingRms,
    UNAVOIDABLE, WayRow,
};
pub use registries::{
    ADDED_CONTROLLERS, ADDED_ESTIMATORS, ADDED_LOCAL_PLANNERS, ADDED_PLANNERS, ControlledBody, NewController,
    NewStretchPlanner, controllers, estimators, laws, local_planners, planners,
};
pub use weighting::WeightingChoice;
