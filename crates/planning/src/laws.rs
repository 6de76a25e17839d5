//! Executable laws for everyone's collision worlds, state spaces, models and planners (feature `testing`).
//!
//! Each `check_*` returns the first broken law by name with its inputs.

mod account;
mod collision;
mod controller;
mod controller_flight;
mod controller_requests;
mod free_body;
mod global_planner;
mod informative_model;
mod invariant_set;
mod local_planner;
mod local_requests;
mod state_space;
mod weighting;

pub use collision::{CollisionSample, check_collision_world, reversed};
pub use controller::{ControllerPromise, broken_controller_laws, check_controller, other_worlds};
pub use controller_flight::{ControllerCase, ControllerStep, Sensor, TrackingError, fly_controller};
pub use global_planner::{Expectation, PlannerCase, PlannerChecks, check_global_planner};
pub use informative_model::{ModelSample, StepAt, check_informative_model};
pub use invariant_set::{check_invariant_set, check_supports};
pub use local_planner::{LocalCase, LocalChecks, LocalExpectation, check_local_planner};
pub use state_space::{check_body_motion, check_kinodynamic_model, check_state_space};
pub use tumble_lie::laws::{LawViolation, require};
pub use weighting::{WeightingPromise, check_information_weighting};

/// The error of a yes or no law.
fn broken_unless(holds: bool) -> f64 {
    if holds { 0.0 } else { f64::INFINITY }
}
