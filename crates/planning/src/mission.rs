//! A whole mission in closed loop: way, stretches, tube, beliefs, and what holds when something fails.
//!
//! ```text
//!  measurements -> StateEstimator -> state now, ModelBelief
//!                                         |
//!  events -> Coordinator -> PlanRequest ~~> Office: way (global), stretch (local, informative) ~~> PlanAnswer
//!                                         |
//!                                   MissionMotion -> Controller -> wrench
//! ```
//!
//! The [`Coordinator`] alone decides; it sees events with their times and answers with actions, and knows nothing of geometry.
//! [`ClosedLoop`] senses, decides and controls; what is to be planned it asks for, and an [`Office`] answers: beside the loop with
//! the time it takes simulated ([`Simulated`]), in a thread of the user's ([`Thread`]), or wherever [`serve`] is called.

mod beside;
mod brake;
mod chosen_model;
mod closed_loop;
mod coordinator;
mod event;
mod expected_loss;
mod fault_plant;
mod foreseen;
mod informative_stretch;
mod last_motion;
mod lasting_errors;
mod loop_settings;
mod motion;
mod office;
mod plan_request;
mod retreat;
mod serve;
mod stretch;
mod stretch_model;
mod stretch_settings;
mod watch;
mod way_nodes;

pub use brake::BrakeLimits;
pub use chosen_model::ChosenModel;
pub use closed_loop::{ClosedLoop, End, LoopObserver, NoObserver};
pub use coordinator::{Coordinator, Schedule};
pub use event::{Action, Ambition, Event, FoundStretch, Note, Standing, StartFrom, TimedEvent};
pub use expected_loss::ExpectedLoss;
pub use fault_plant::{FaultPlant, NoFault, PlantFault};
pub use informative_stretch::InformativeStretch;
pub use loop_settings::{AtGoal, LoopSettings, Scene};
pub use motion::{MissionMotion, StopLimits};
pub use office::{ComputingTime, Office, PlannerFault, PlannerThread, Simulated, Thread};
pub use plan_request::{Asked, Found, Layer, PlanAnswer, PlanRequest};
pub use serve::serve;
pub use stretch::{AlongWay, StretchAnswer, StretchOutcome, StretchPlanner, StretchRefusal, StretchTask};
pub use stretch_model::StretchModel;
pub use stretch_settings::{Arrival, StretchSettings, WayShares};
pub use watch::{Invariant, InvariantWatch, Violation, WatchLimits, WatchedStep};
