#![doc = include_str!("../README.md")]
#![forbid(unsafe_code)]

pub mod air_drag;
pub mod bodies;
pub mod body_file;
pub mod cli;
pub mod demo;
mod error;
pub mod excitation_file;
pub mod figure;
pub mod flight_controller;
pub mod flight_log;
pub mod flight_modes;
pub mod harmonic_report;
pub mod log;
pub mod noise;
pub mod output;
pub mod propulsion;
pub mod recording;
pub mod report;
pub mod scenario;
pub mod sensing;
pub mod simulator;
pub mod space_cobot;
pub mod spheres;
mod text_file;
pub mod wheel_throw;
pub mod worlds;

pub use error::AstrobeeError;

// The code of the workspace's README. Only rustdoc's test run reads the file, so that the published package does without.
#[cfg(doctest)]
#[doc = include_str!("../../../README.md")]
struct WorkspaceReadme;
