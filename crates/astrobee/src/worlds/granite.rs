//! The granite table of the laboratory, and RATTLE's obstacle sets on it.

use super::listed::{Listed, NamedPose};
use std::f64::consts::FRAC_1_SQRT_2;

/// Provenance: thesis 6.4, "1.5 x 1.5 m".
pub const TABLE_HALF_WIDTH_M: f64 = 0.75;

/// Keep-in box, least then largest coordinates, m.
///
/// Provenance: `astrobee/resources/zones`, granite. The walls of the simulated room stand at x = +-3, y = +-6, beyond it.
pub const KEEP_IN: [f64; 6] = [-1.0, -1.0, -2.0, 1.0, 1.0, 0.0];

/// Provenance of all sets: rattle-iros-2022 (93d2f99), as tabulated for its granite mode.
pub const DEFAULT_OBSTACLES: [Listed; 3] =
    [([0.15, 0.15, 5.0], [0.3, 0.3, 0.0]), ([0.2, 0.2, 5.0], [-0.25, -0.1, 0.0]), ([0.2, 0.05, 5.0], [0.5, 0.5, 0.0])];
/// The set of the full runs.
pub const ROOM: [Listed; 4] = [
    ([0.7, 0.1, 5.0], [-0.3, 0.0, 0.0]),
    ([0.2, 0.2, 5.0], [-0.75, -0.3, 0.0]),
    ([0.2, 0.2, 5.0], [0.75, -0.75, 0.0]),
    ([0.2, 0.2, 5.0], [-0.05, -0.8, 0.0]),
];
/// The set of the comparison of weightings.
pub const WALLS: [Listed; 2] = [([0.3, 0.3, 5.0], [-0.6, 0.2, 0.0]), ([0.05, 0.8, 5.0], [0.5, -0.35, 0.0])];
/// Joins [`ROOM`] half-way.
pub const ASTRONAUT: [Listed; 1] = [([0.1, 0.1, 5.0], [0.4, -0.45, 0.0])];

/// Minus a quarter turn about z; the source writes 0.7071.
const TO_MINUS_Y: [f64; 4] = [0.0, 0.0, -FRAC_1_SQRT_2, FRAC_1_SQRT_2];
const LEVEL: [f64; 4] = [0.0, 0.0, 0.0, 1.0];

/// A, B, C and `regulation`: rattle-iros-2022. `start`: the simulation's launch file. `berth`: a docked robot, 0.1 m along
/// x from the first berth of the dock at (-0.825, 0.288, -0.675).
pub const POSES: [NamedPose; 6] = [
    NamedPose { name: "A", position_m: [0.0, 0.6, -0.76], quaternion_xyzw: TO_MINUS_Y },
    NamedPose { name: "B", position_m: [-0.4, -0.4, -0.76], quaternion_xyzw: LEVEL },
    NamedPose { name: "C", position_m: [0.4, -0.4, -0.76], quaternion_xyzw: [0.0, 0.0, 1.0, 0.0] },
    NamedPose { name: "regulation", position_m: [0.0, 0.6, -0.7], quaternion_xyzw: TO_MINUS_Y },
    NamedPose { name: "start", position_m: [0.0, 0.0, -0.7], quaternion_xyzw: LEVEL },
    NamedPose {
        name: "berth",
        position_m: [-0.825 + 0.099_263_2 + 0.1, 0.288 + 0.254, -0.675],
        quaternion_xyzw: LEVEL,
    },
];
