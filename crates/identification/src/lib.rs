//! Mass, centre of mass and inertia of a rigid body from its measured motion.
#![cfg_attr(not(feature = "std"), no_std)]
#![forbid(unsafe_code)]

pub use nalgebra;

mod body_scale;
pub mod consistency;
mod criteria;
mod error;
mod householder;
mod information;
mod jacobi;
#[cfg(feature = "testing")]
pub mod laws;
mod observability;
mod square_root_information;

pub use body_scale::{BodyScale, PARAMETER_NAMES};
#[cfg(feature = "clarabel-sdp")]
pub use consistency::ClarabelSdp;
pub use consistency::{
    Barrier, BarrierNewton, ConstrainedEstimate, ConstrainedLeastSquares, FeasibleSet, InteriorPoint, PseudoInertiaCone,
};
pub use criteria::{AOptimality, ConditionNumber, DOptimality, EOptimality, OptimalityCriterion};
pub use error::IdentificationError;
pub use information::FisherInformation;
pub use observability::{NullDirection, Observability};
pub use square_root_information::{RANK_TOLERANCE, SquareRootInformation};
