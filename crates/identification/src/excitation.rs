//! Exciting motions: what a motion did not show, and motions designed to show everything.
//!
//! A motion of 20 s for a robot that may move 0.5 m and turn by 0.6 rad, at 0.1 m/s and 0.2 rad/s at most:
//!
#![cfg_attr(feature = "std", doc = "```")]
#![cfg_attr(not(feature = "std"), doc = "```ignore")]
//! use tumble_identification::DOptimality;
//! use tumble_identification::excitation::{ChannelLimits, SpaceExcitation};
//! use tumble_identification::fourier::FourierBasis;
//!
//! # fn main() -> Result<(), tumble_identification::IdentificationError> {
//! let basis = FourierBasis::try_new(20.0, 3)?;
//! let (position, angle) = (ChannelLimits::symmetric(0.5, 0.1, 0.1), ChannelLimits::symmetric(0.6, 0.2, 0.2));
//! let limits = [position, position, position, angle, angle, angle];
//! let design = SpaceExcitation::try_new(basis, &limits, 100)?.design(&DOptimality, 1, 7)?;
//! for used in &design.utilization {
//!     println!("{} {}: {:.1} %", used.channel, used.limit, 100.0 * used.share);
//! }
//! let peak = design.utilization.iter().map(|used| used.share).fold(0.0, f64::max);
//! assert!(peak > 0.99 && peak <= 1.0);
//! # Ok(())
//! # }
//! ```

mod channel;
#[cfg(feature = "argmin")]
mod cost;
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
#[cfg(feature = "argmin")]
pub use cost::ExcitationCost;
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
