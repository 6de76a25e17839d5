#![doc = include_str!("../README.md")]
#![forbid(unsafe_code)]
#![cfg_attr(docsrs, feature(doc_cfg))]

pub mod actuator_file;
pub mod arm;
pub mod body_file;
mod embedded;
pub mod environment_file;
mod error;
pub mod excitation_file;
pub mod log;
mod log_file;
pub mod model;
pub mod place;
pub mod recording;
mod robot;
mod sample_reader;
pub mod sensing_file;
#[cfg(feature = "testing")]
pub mod testing;
pub mod text_file;
pub mod toml_text;
pub mod wheel_throw;

pub use embedded::Embedded;
pub use error::FormatsError;
pub use log_file::LogFile;
pub use robot::{
    ActuatorBytes, ActuatorPreset, ActuatorReplay, BodyPreset, Robot, Robots, SensorPreset, UnknownPreset,
};
pub use sample_reader::SampleReader;
