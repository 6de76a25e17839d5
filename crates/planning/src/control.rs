//! From a plan and a measured state to a wrench, with a bound on the error that holds.
//!
//! The way through: a [`Controller`] adopts a belief and answers each [`ControlRequest`] with a [`ControlCommand`].
//!
//! # Source
//! Thesis 2.4.2, 6.2.3.

mod axis_template;
mod believed_body;
mod cascade;
mod contraction;
mod controller;
mod convex_set;
mod feedback;
mod invariant_set;
mod mass_interval;
mod polygon;
mod pose_tracking;
mod rakovic;
mod riccati;
mod small_matrix;

pub use axis_template::{AxisGain, AxisTemplate, TEMPLATE_ROWS};
pub use cascade::{Cascade, RotationGains, TranslationDecision, TranslationLaw, TranslationRequest};
pub use contraction::Contraction;
pub use controller::{Adoption, ControlCommand, ControlRequest, Controller, Fallback, FallbackReason, ReferenceMotion};
pub use convex_set::{ConvexSet, MinkowskiSum, SymmetricBox, SymmetricEllipsoid, Zonotope};
pub use feedback::{LinearFeedback, LqrController, TranslationWeights};
pub use invariant_set::{MinimalInvariantSet, Support};
pub use mass_interval::MassInterval;
pub use polygon::{Polygon, Strips};
pub use pose_tracking::PoseTracking;
pub use rakovic::RakovicSet;
pub use riccati::discrete_lqr;
