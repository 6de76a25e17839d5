//! From a plan and a measured state to a wrench, with a bound on the error that holds.
//!
//! The way through: a [`Controller`] adopts a belief and answers each [`ControlRequest`] with a [`ControlCommand`].
//!
//! # Source
//! Thesis 2.4.2, 6.2.3.

mod believed_body;
mod cascade;
mod controller;
mod feedback;
mod mass_interval;
mod pose_tracking;

pub use cascade::{Cascade, RotationGains, TranslationDecision, TranslationLaw, TranslationRequest};
pub use controller::{Adoption, ControlCommand, ControlRequest, Controller, Fallback, FallbackReason, ReferenceMotion};
pub use feedback::{LinearFeedback, LqrController, TranslationWeights};
pub use mass_interval::MassInterval;
pub use pose_tracking::PoseTracking;
