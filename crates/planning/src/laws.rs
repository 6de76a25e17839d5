//! Executable laws for everyone's collision worlds (feature `testing`).
//!
//! Each `check_*` returns the first broken law by name with its inputs.

mod collision;

pub use collision::{CollisionSample, check_collision_world, reversed};
pub use tumble_lie::laws::{LawViolation, require};

/// The error of a yes or no law.
fn broken_unless(holds: bool) -> f64 {
    if holds { 0.0 } else { f64::INFINITY }
}
