//! Exciting motions: what a motion did not show, and motions designed to show everything.

mod channel;
mod criterion;
#[cfg(feature = "std")]
mod design;
mod diagnosis;
#[cfg(feature = "std")]
mod execution;
#[cfg(feature = "std")]
mod interior_point;
#[cfg(feature = "std")]
mod limit_samples;
#[cfg(feature = "std")]
mod limits;
#[cfg(feature = "std")]
mod objective;
#[cfg(feature = "std")]
mod problem;

pub use channel::{Channel, Limit};
pub use criterion::{CriterionGradient, ExcitationCriterion, NormalizedCondition};
#[cfg(feature = "std")]
pub use design::{ExcitationDesign, Utilization};
pub use diagnosis::{BodyAxis, ExcitationDiagnosis, Remedy, WeakDirection};
#[cfg(feature = "std")]
pub use execution::{Execution, ExecutionSample, Saturation, execute, samples_per_period};
#[cfg(feature = "std")]
pub use limits::{ChannelLimits, WrenchLimits};
#[cfg(feature = "std")]
pub use problem::{ExcitationProblem, LimitsHold, PlanarExcitation, SpaceExcitation};
