//! Arms that come with the program.

use crate::scenario::Embedded;

/// All of them.
pub const EMBEDDED: [Embedded; 2] = [
    Embedded { name: "astrobee-arm", text: include_str!("astrobee-arm.toml") },
    Embedded { name: "ur10e", text: include_str!("ur10e.toml") },
];
