//! For tests of readers: files damaged in every simple way, bags and ULogs written by hand, recordings of another library, places to write to.
#![allow(
    clippy::unwrap_used,
    clippy::indexing_slicing,
    clippy::missing_panics_doc,
    clippy::cast_possible_truncation,
    missing_docs,
    reason = "helpers of tests: a failed one is a failed test"
)]

pub mod bag_writer;
pub mod corruption;
mod scratch;
pub mod ulog_writer;
mod unpacked_mcap;

pub use scratch::{scratch, scratch_file};
pub use unpacked_mcap::unpacked_mcap;

/// A ROS 2 recording, as `rosbag2` writes it with LZ4.
pub const ROS2_LZ4: &[u8] = include_bytes!("../tests/golden/ros2_lz4.mcap");
/// What its messages hold, one line of JSON each.
pub const ROS2_MESSAGES: &str = include_str!("../tests/golden/ros2_messages.jsonl");
