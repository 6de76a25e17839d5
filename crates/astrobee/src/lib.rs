#![doc = include_str!("../README.md")]
#![forbid(unsafe_code)]
#![cfg_attr(docsrs, feature(doc_cfg))]

pub mod air_drag;
#[cfg(feature = "cli")]
pub mod arm;
pub mod bodies;
#[cfg(feature = "cli")]
pub mod body_file;
#[cfg(feature = "cli")]
pub mod campaign;
#[cfg(feature = "cli")]
pub mod cli;
pub mod control_presets;
#[cfg(feature = "cli")]
pub mod demo;
mod error;
#[cfg(feature = "cli")]
pub mod excitation_file;
#[cfg(feature = "cli")]
pub mod figure;
pub mod flight_controller;
#[cfg(feature = "cli")]
pub mod flight_log;
pub mod flight_modes;
#[cfg(feature = "cli")]
pub mod harmonic_report;
#[cfg(feature = "cli")]
pub mod log;
#[cfg(feature = "cli")]
pub mod mission;
#[cfg(feature = "cli")]
pub mod mission_report;
pub mod noise;
#[cfg(feature = "cli")]
pub mod output;
pub mod planning_presets;
pub mod propulsion;
#[cfg(feature = "cli")]
pub mod recording;
#[cfg(feature = "cli")]
pub mod report;
#[cfg(feature = "cli")]
pub mod scenario;
pub mod sensing;
pub mod simulator;
pub mod space_cobot;
pub mod spheres;
#[cfg(feature = "cli")]
mod text_file;
#[cfg(feature = "cli")]
pub mod wheel_throw;
pub mod worlds;

pub use error::AstrobeeError;

// The code of the workspace's README. Only rustdoc's test run reads the file, so that the published package does without.
#[cfg(doctest)]
#[doc = include_str!("../../../README.md")]
struct WorkspaceReadme;
