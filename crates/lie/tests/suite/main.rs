//! Groups and their laws, in one program.
#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic)]

mod custom_group;
mod groups;
mod planted_defects;
