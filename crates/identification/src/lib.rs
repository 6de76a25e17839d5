#![doc = include_str!("../README.md")]
#![cfg_attr(not(feature = "std"), no_std)]
#![forbid(unsafe_code)]
#![cfg_attr(docsrs, feature(doc_cfg))]

pub use nalgebra;
pub use tumble_dynamics as dynamics;
pub use tumble_lie as lie;

#[cfg(feature = "std")]
pub mod actuators;
#[cfg(feature = "std")]
mod beside;
#[cfg(feature = "std")]
mod body_change;
mod body_scale;
#[cfg(feature = "research")]
pub mod comparison;
pub mod consistency;
mod criteria;
mod error;
pub mod estimator;
pub mod excitation;
#[cfg(feature = "std")]
pub mod fourier;
#[cfg(feature = "std")]
pub mod harmonics;
mod householder;
#[cfg(feature = "std")]
mod identify;
mod information;
mod jacobi;
#[cfg(feature = "testing")]
pub mod laws;
#[cfg(feature = "std")]
mod likelihood;
mod linear_model;
#[cfg(feature = "std")]
mod motion;
#[cfg(feature = "trees")]
pub mod multibody;
#[cfg(feature = "std")]
pub mod noise;
mod observability;
pub mod recursive;
#[cfg(feature = "std")]
mod registry;
pub mod regressors;
#[cfg(feature = "std")]
mod savitzky_golay;
#[cfg(feature = "std")]
pub mod sensing;
mod square_root_information;
#[cfg(feature = "research")]
pub mod state_space;
#[cfg(feature = "std")]
pub mod statistics;
pub mod synchronize;
#[cfg(feature = "std")]
mod units;
#[cfg(feature = "std")]
mod weighted_least_squares;
#[cfg(feature = "std")]
pub mod wheel;
mod wrench_timing;

pub use body_scale::BodyScale;
#[cfg(feature = "clarabel-sdp")]
pub use consistency::ClarabelSdp;
pub use consistency::{
    Barrier, BarrierNewton, ConstrainedEstimate, ConstrainedLeastSquares, FeasibleSet, InteriorPoint, PseudoInertiaCone,
};
pub use criteria::{AOptimality, ConditionNumber, DOptimality, EOptimality, InLikeUnits, OptimalityCriterion};
pub use error::{Column, IdentificationError};
#[cfg(feature = "std")]
pub use estimator::{Estimate, StandardDeviations};
pub use excitation::{BodyAxis, ExcitationDiagnosis, Remedy, WeakDirection};
#[cfg(feature = "std")]
pub use identify::{
    ConstrainedSolvers, Difference, FLIGHT_LIKELIHOOD, Identification, JointFilter, LongRecord, MAXIMUM_LIKELIHOOD,
    Methods, NodeResidual, Part, PartChange, Parts, Pipeline, Prediction, Prior, Problem, Regressed, Regression,
    Settings, Silence, UnexplainedWrench, Validation, WEAK_FORM, Warning, constrained_solvers, identify, identify_in,
    identify_parts, merge, methods, predict, validate, with_all_that_acts,
};
pub use information::FisherInformation;
#[cfg(feature = "argmin")]
pub use likelihood::LikelihoodCost;
#[cfg(feature = "std")]
pub use likelihood::{
    BodyChange, Exchange, FixedLag, FixedLagSettings, FixedLagStep, FlightEstimate, FlightLikelihood, FoundDelay,
    FoundFactor, FoundLevels, FoundThrusters, Halves, Innovation, Iteration, LikelihoodEstimate, MaximumLikelihood,
    Nuisance, NuisanceEstimate, NuisancePrior, Nuisances, Plane, Quantity, SegmentResidual, Thrusters, Verdict,
};
pub use linear_model::LinearModel;
#[cfg(feature = "std")]
pub use motion::{MotionSample, Noise};
pub use observability::{NullDirection, Observability};
#[cfg(feature = "std")]
pub use registry::{Registry, UnknownName};
#[cfg(feature = "std")]
pub use savitzky_golay::{SavitzkyGolay, SmoothedMotion};
pub use square_root_information::{RANK_TOLERANCE, SquareRootInformation};
#[cfg(feature = "std")]
pub use weighted_least_squares::{RowNoise, WeightedLeastSquares, WrenchRow, whitened};
pub use wrench_timing::WrenchTiming;
