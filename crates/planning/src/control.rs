//! From a plan and a measured state to a wrench, with a bound on the error that holds.
//!
//! The way through: a [`Controller`] adopts a belief and answers each [`ControlRequest`] with a [`ControlCommand`].
//!
//! # Source
//! Thesis 2.4.2, 6.2.3.

mod controller;
mod gram_program;
mod mass_interval;

pub use controller::{Adoption, ControlCommand, ControlRequest, Controller, Fallback, FallbackReason, ReferenceMotion};
#[cfg(feature = "clarabel")]
pub use gram_program::{GramOptimum, solve_gram_with_clarabel};
pub use gram_program::{GramProgram, GramSettings, GramStatus, GramWorkspace};
pub use mass_interval::MassInterval;
