//! A whole mission in closed loop: way, stretches, tube, beliefs, and what holds when something fails.
//!
//! ```text
//!  measurements -> FlightEstimator -> state now, ModelBelief
//!                                          |
//!  events -> Coordinator -> actions -> way (global) -> stretch (local, informative) -> MissionMotion -> Controller -> wrench
//! ```
//!
//! The [`Coordinator`] alone decides; it sees events with their times and answers with actions, and knows nothing of geometry.

mod fault_plant;
mod motion;
mod stretch;
mod watch;

pub use fault_plant::{FaultPlant, NoFault, PlantFault};
pub use motion::{MissionMotion, StopLimits};
pub use stretch::{StretchAnswer, StretchPlanner, StretchRefusal, StretchTask};
pub use watch::{Invariant, InvariantWatch, Violation, WatchLimits, WatchedStep};
