#![doc = include_str!("../README.md")]
#![forbid(unsafe_code)]

pub mod campaign;
pub mod cli;
pub mod demo;
mod error;
pub mod figure;
pub mod flight_log;
pub mod harmonic_report;
pub mod mission;
pub mod mission_report;
pub mod output;
mod program;
pub mod report;
pub mod robots;
pub mod scenario;
pub mod space_cobot;
pub mod spheres;

pub use error::TumbleError;
pub use program::run;

// The code of the workspace's README. Only rustdoc's test run reads the file, so that the published package does without.
#[cfg(doctest)]
#[doc = include_str!("../../../README.md")]
struct WorkspaceReadme;
