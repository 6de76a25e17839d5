#![doc = include_str!("../README.md")]
#![forbid(unsafe_code)]
#![cfg_attr(docsrs, feature(doc_cfg))]

pub use nalgebra;
#[cfg(feature = "parry")]
pub use parry3d_f64;
pub use rand_core;
pub use tumble_dynamics as dynamics;
pub use tumble_identification as identification;
pub use tumble_lie as lie;

mod belief;
mod budget;
pub mod collision;
pub mod control;
mod error;
pub mod global;
pub mod kinodynamic;
#[cfg(feature = "testing")]
pub mod laws;
pub mod local;
pub mod mission;
mod motion;
mod state_space;
pub mod steering;
mod vectors;

pub use belief::{ModelBelief, Plan, inertia_sizes};
pub use budget::{Budget, Units};
pub use error::PlanningError;
pub use kinodynamic::{BodyMotion, DoubleIntegrator, KinodynamicModel, Primitive, Propagation};
pub use motion::{ArcPath, BodyArc, COEFFICIENTS, TranslationState};
pub use state_space::StateSpace;
pub use tumble_identification::noise::unit_interval;
