#![doc = include_str!("../README.md")]
#![forbid(unsafe_code)]
// They panic where nobody listens.
#![deny(clippy::print_stderr, clippy::print_stdout)]
#![cfg_attr(docsrs, feature(doc_cfg))]

mod added;
#[cfg(feature = "astrobee")]
pub mod campaign;
#[macro_use]
pub mod cli;
pub mod demo;
mod error;
pub mod flight_log;
pub mod harmonic_report;
#[cfg(feature = "astrobee")]
pub mod mission;
#[cfg(feature = "astrobee")]
pub mod mission_report;
pub mod output;
#[cfg_attr(not(feature = "astrobee"), allow(dead_code, reason = "some of it is drawn for flights only"))]
mod page;
mod program;
mod quantities;
pub mod report;
mod report_page;
pub mod robots;
#[cfg(feature = "astrobee")]
pub mod scenario;
pub mod space_cobot;
pub mod spheres;

pub use added::Added;
pub use error::TumbleError;
pub use program::{Answer, answer, run};

// The code of the workspace's README, by a link that the published package holds as a file.
#[cfg(doctest)]
#[doc = include_str!("../WORKSPACE.md")]
struct WorkspaceReadme;
