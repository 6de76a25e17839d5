//! A whole mission in closed loop: way, stretches, tube, beliefs, and what holds when something fails.
//!
//! ```text
//!  measurements -> FlightEstimator -> state now, ModelBelief
//!                                          |
//!  events -> Coordinator -> actions -> way (global) -> stretch (local, informative) -> MissionMotion -> Controller -> wrench
//! ```
//!
//! The [`Coordinator`] alone decides; it sees events with their times and answers with actions, and knows nothing of geometry.

mod brake;
mod closed_loop;
mod coordinator;
mod event;
mod expected_loss;
mod fault_plant;
mod informative_stretch;
mod motion;
mod stretch;
mod stretch_model;
mod stretch_settings;
mod watch;
mod way_nodes;

pub use brake::BrakeLimits;
pub use closed_loop::{
    AtGoal, ClosedLoop, ComputingTime, ControllerFactory, Layer, LoopObserver, LoopSettings, NoObserver, PlannerFault,
    Scene, Sensed,
};
pub use coordinator::{Coordinator, Schedule};
pub use event::{Action, Ambition, Event, FoundStretch, Note, Standing, StartFrom, TimedEvent};
pub use expected_loss::ExpectedLoss;
pub use fault_plant::{FaultPlant, NoFault, PlantFault};
pub use informative_stretch::InformativeStretch;
pub use motion::{MissionMotion, StopLimits};
pub use stretch::{StretchAnswer, StretchPlanner, StretchRefusal, StretchTask};
pub use stretch_model::StretchModel;
pub use stretch_settings::{Arrival, StretchSettings, WayShares};
pub use watch::{Invariant, InvariantWatch, Violation, WatchLimits, WatchedStep};
