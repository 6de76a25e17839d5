#![doc = include_str!("../README.md")]
#![cfg_attr(not(feature = "std"), no_std)]
#![forbid(unsafe_code)]

pub use tumble_lie as lie;
pub use tumble_lie::nalgebra;

mod error;
mod free_flyer;
mod inertia;
mod state;
mod system;

pub use error::DynamicsError;
pub use free_flyer::{BodyAcceleration, FreeFlyer, FreeFlyerIn};
pub use inertia::{InertialParameters, PARAMETERS, pseudo_inertia};
pub use state::RigidBodyState;
pub use system::{Integrator, MechanicalSystem, Plant, RigidBody, ScalarOf, TangentOf, WrenchModel};
