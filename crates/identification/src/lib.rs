#![doc = include_str!("../README.md")]
//! Mass, centre of mass and inertia of a rigid body from its measured motion.
#![cfg_attr(not(feature = "std"), no_std)]
#![forbid(unsafe_code)]

pub use nalgebra;
pub use tumble_dynamics as dynamics;
pub use tumble_lie as lie;

mod error;
#[cfg(feature = "std")]
mod identify;
mod linear_model;
#[cfg(feature = "std")]
mod motion;
pub mod regressors;
#[cfg(feature = "std")]
pub mod wheel;
mod wrench_timing;

pub use error::{Column, IdentificationError};
#[cfg(feature = "std")]
pub use identify::{
    Estimate, Identification, Method, NodeResidual, Noise, Prediction, Prior, Settings, StandardDeviations, Validation,
    Warning, identify, predict, validate,
};
pub use linear_model::LinearModel;
#[cfg(feature = "std")]
pub use motion::MotionSample;
pub use wrench_timing::WrenchTiming;

mod body_scale;
pub mod consistency;
mod householder;
mod jacobi;
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
