#![doc = include_str!("../README.md")]
#![forbid(unsafe_code)]
#![cfg_attr(docsrs, feature(doc_cfg))]

pub mod air_drag;
pub mod bodies;
pub mod control_presets;
mod error;
pub mod flight_controller;
pub mod flight_modes;
pub mod planning_presets;
pub mod propulsion;
pub mod sensing;
pub mod simulator;
#[cfg(feature = "testing")]
pub mod testing;
pub mod worlds;

pub use error::AstrobeeError;
