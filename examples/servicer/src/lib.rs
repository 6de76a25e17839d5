#![doc = include_str!("../README.md")]
#![forbid(unsafe_code)]

pub mod cauchy;
pub mod cautious;
pub mod dogleg;
pub mod drifting_pose;
pub mod robot;
