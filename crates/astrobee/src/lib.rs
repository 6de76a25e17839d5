#![doc = include_str!("../README.md")]
#![forbid(unsafe_code)]

pub mod body_file;
pub mod cli;
pub mod demo;
mod error;
pub mod figure;
pub mod log;
pub mod noise;
pub mod output;
pub mod report;
pub mod wheel_throw;

pub use error::AstrobeeError;
