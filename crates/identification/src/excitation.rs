//! Exciting motions: what a motion did not show, and motions designed to show everything.

mod criterion;
mod diagnosis;

pub use criterion::{CriterionGradient, ExcitationCriterion, NormalizedCondition};
pub use diagnosis::{BodyAxis, ExcitationDiagnosis, Remedy, WeakDirection};
