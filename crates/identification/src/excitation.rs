//! Exciting motions: what a motion did not show, and motions designed to show everything.

mod diagnosis;

pub use diagnosis::{BodyAxis, ExcitationDiagnosis, Remedy, WeakDirection};
