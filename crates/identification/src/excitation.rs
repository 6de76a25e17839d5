//! Exciting motions: what a motion did not show, and motions designed to show everything.

mod diagnosis;
#[cfg(feature = "std")]
mod execution;

pub use diagnosis::{BodyAxis, ExcitationDiagnosis, Remedy, WeakDirection};
#[cfg(feature = "std")]
pub use execution::{Execution, ExecutionSample, Saturation, execute, samples_per_period};
