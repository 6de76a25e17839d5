//! A whole mission in closed loop: way, stretches, tube, beliefs, and what holds when something fails.
//!
//! ```text
//!  measurements -> FlightEstimator -> state now, ModelBelief
//!                                          |
//!  events -> Coordinator -> actions -> way (global) -> stretch (local, informative) -> MissionMotion -> Controller -> wrench
//! ```
//!
//! The [`Coordinator`] alone decides; it sees events with their times and answers with actions, and knows nothing of geometry.

mod informative_stretch;
mod motion;
mod stretch;
mod stretch_model;
mod stretch_settings;
mod way_nodes;

pub use informative_stretch::InformativeStretch;
pub use motion::{MissionMotion, StopLimits};
pub use stretch::{StretchAnswer, StretchPlanner, StretchRefusal, StretchTask};
pub use stretch_model::StretchModel;
pub use stretch_settings::{Arrival, StretchSettings, WayShares};
