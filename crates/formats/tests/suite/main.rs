//! One program for all tests of this crate.
#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic)]

mod joint_log;
mod mcap;
mod recordings;
mod support;
mod ulog;
