//! Arms that belong to no robot.

use crate::Embedded;

/// All of them.
pub const EMBEDDED: [Embedded; 1] = [Embedded { name: "ur10e", text: include_str!("ur10e.toml") }];
