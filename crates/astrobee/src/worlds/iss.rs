//! The International Space Station: volumes of 2020-09-04 and the obstacle sets of RATTLE.
// Numbers as the files write them.
#![allow(clippy::unreadable_literal)]

use super::listed::{Listed, NamedPose};
use std::f64::consts::FRAC_1_SQRT_2;

/// Keep-out boxes, `x1 y1 z1 x2 y2 z2`, m; corners in the file's order.
///
/// Provenance: `astrobee/resources/zones` (JEM occupation of 2020-09-04), text form `astrobee/gds_configs/IssWorld`.
pub const KEEP_OUT: [[f64; 6]; 4] = [
    [12.3539, -10.5727, 4.4233, 11.8722, -9.6330, 5.6942],
    [10.2721, -11.9284, 4.0808, 11.5956, -10.5859, 3.6015],
    [9.5142, -10.5559, 5.8497, 9.82404, -9.6458, 4.5099],
    [10.1819, -5.3350, 4.6383, 9.8428, -5.7243, 4.0600],
];

/// Keep-in boxes, least then largest coordinates, m. 6 is the Japanese module, 7 its end with the dock, 5 and 18 its
/// hatch.
///
/// Provenance: as [`KEEP_OUT`].
pub const KEEP_IN: [[f64; 6]; 26] = [
    [-2.39202, -0.638923, 4.19049, -0.975833, 0.681877, 5.42647],
    [-0.975833, -1.04493, 3.79248, 5.89236, 1.08518, 5.91565],
    [5.89236, -0.653923, 4.19049, 6.80855, 0.666877, 5.42647],
    [10.2722, 1.85097, 4.18947, 11.593, 2.76546, 5.42544],
    [9.85887, 2.76546, 3.7868, 11.989, 7.33508, 5.91632],
    [10.2755, -2.7532, 4.19094, 11.5963, -1.83647, 5.51173],
    [9.8594838, -9.2364698, 3.7831272, 11.9950038, -2.7531998, 5.9180472],
    [9.5358938, -11.6364698, 3.7505872, 12.3358938, -9.2364698, 5.9505872],
    [-3.12927, -0.663143, 4.19047, -2.21308, 0.657657, 5.42645],
    [-3.81824, -1.0684, 3.87459, -3.12927, 1.0652, 5.80819],
    [-5.15514, -1.58915, 3.54331, -3.81824, 1.51304, 6.10187],
    [-6.99118, -1.10947, 3.76341, -5.15514, 1.04604, 5.91843],
    [-7.40737, -0.707083, 4.15686, -6.99118, 0.660937, 5.43314],
    [-5.12169, -2.18761, 4.26149, -3.84534, -1.58915, 5.45759],
    [6.73442, -0.649656, 4.1955, 7.65061, 0.671144, 5.43148],
    [7.65061, -1.05837, 3.79114, 10.5572, 1.08444, 5.92066],
    [10.2926, -1.22397, 3.61501, 11.6016, 1.21866, 6.05764],
    [10.2926, 1.21866, 4.1299, 11.6016, 2.69272, 5.49792],
    [10.2926, -2.7575, 4.22382, 11.6016, -1.22397, 5.45957],
    [11.6016, -0.789256, 4.1559, 12.0844, 0.810744, 5.5559],
    [-5.11901, -2.86189, 4.18302, -3.79821, -1.9457, 5.419],
    [-5.52231, -6.02246, 3.76596, -3.3922, -2.86189, 5.90818],
    [-5.70062, -7.29246, 3.60253, -3.25799, -6.02246, 6.04516],
    [-5.05609, -7.2446, 4.84342, -3.9035, -6.07032, 7.12076],
    [-5.10232, -7.47946, 6.79861, -3.8149, -6.19194, 7.50094],
    [-4.83125, -7.20837, 7.32751, -4.08597, -6.46303, 8.07282],
];

/// Provenance of all sets: rattle-iros-2022 (93d2f99), as tabulated for its ISS mode.
pub const DEFAULT_OBSTACLES: [Listed; 3] = [
    ([0.2, 0.2, 0.65], [10.8, -9.0, 4.9]),
    ([0.2, 0.2, 0.65], [10.4, -8.5, 4.3]),
    ([0.2, 0.2, 0.2], [11.1, -8.0, 5.0]),
];
/// Two walls to be flown around; the set of the full runs.
pub const SLALOM: [Listed; 2] = [([0.5, 0.05, 2.0], [10.3, -8.5, 4.9]), ([0.5, 0.05, 2.0], [11.2, -9.0, 4.9])];
/// Ten ellipsoids that spell three letters.
pub const LETTERS: [Listed; 10] = [
    ([0.15, 0.15, 0.75], [10.2, -9.1, 4.8]),
    ([0.2, 0.2, 0.3], [10.5, -9.1, 4.7]),
    ([0.15, 0.15, 0.75], [10.8, -9.1, 4.8]),
    ([0.2, 0.2, 0.3], [11.1, -9.1, 4.7]),
    ([0.15, 0.15, 0.75], [11.4, -9.1, 4.8]),
    ([0.75, 0.15, 0.15], [10.8, -8.6, 4.1]),
    ([0.15, 0.15, 0.75], [10.8, -8.6, 4.7]),
    ([0.75, 0.15, 0.15], [10.8, -8.6, 5.3]),
    ([0.75, 0.15, 0.15], [10.8, -8.1, 4.7]),
    ([0.15, 0.15, 0.75], [10.8, -8.1, 5.3]),
];
/// Joins [`SLALOM`] half-way.
pub const ASTRONAUT: [Listed; 1] = [([0.2, 0.2, 0.6], [11.4, -8.3, 4.7])];

/// Minus a quarter turn about z; the source writes 0.7071.
const TO_MINUS_Y: [f64; 4] = [0.0, 0.0, -FRAC_1_SQRT_2, FRAC_1_SQRT_2];
const LEVEL: [f64; 4] = [0.0, 0.0, 0.0, 1.0];
const ROLLED_OVER: [f64; 4] = [1.0, 0.0, 0.0, 0.0];

/// A, B, C and `regulation`: rattle-iros-2022. The others: dock at (9.5868938, -10.0604698, 4.2955872), berths at
/// (0.0992632, +-0.254, 0) from it, a docked robot 0.1 m and an approaching one 0.6 m along x from its berth; start poses
/// of the simulation's launch files.
pub const POSES: [NamedPose; 12] = [
    NamedPose { name: "A", position_m: [10.8, -9.6, 4.8], quaternion_xyzw: TO_MINUS_Y },
    NamedPose { name: "B", position_m: [10.8, -7.75, 5.2], quaternion_xyzw: TO_MINUS_Y },
    NamedPose { name: "C", position_m: [10.8, -7.75, 4.3], quaternion_xyzw: TO_MINUS_Y },
    NamedPose { name: "regulation", position_m: [10.8, -9.75, 4.8], quaternion_xyzw: TO_MINUS_Y },
    NamedPose {
        name: "berth-1",
        position_m: [9.5868938 + 0.0992632 + 0.1, -10.0604698 + 0.254, 4.2955872],
        quaternion_xyzw: LEVEL,
    },
    NamedPose {
        name: "berth-1-approach",
        position_m: [9.5868938 + 0.0992632 + 0.6, -10.0604698 + 0.254, 4.2955872],
        quaternion_xyzw: LEVEL,
    },
    NamedPose {
        name: "berth-2",
        position_m: [9.5868938 + 0.0992632 + 0.1, -10.0604698 - 0.254, 4.2955872],
        quaternion_xyzw: ROLLED_OVER,
    },
    NamedPose {
        name: "berth-2-approach",
        position_m: [9.5868938 + 0.0992632 + 0.6, -10.0604698 - 0.254, 4.2955872],
        quaternion_xyzw: ROLLED_OVER,
    },
    NamedPose { name: "perch", position_m: [10.7, -8.3, 5.1], quaternion_xyzw: [0.707, 0.0, -0.707, 0.0] },
    NamedPose { name: "honey", position_m: [11.0, -7.0, 4.8], quaternion_xyzw: LEVEL },
    NamedPose { name: "bumble", position_m: [11.0, -4.0, 4.8], quaternion_xyzw: LEVEL },
    NamedPose { name: "queen", position_m: [11.0, -10.0, 4.8], quaternion_xyzw: LEVEL },
];
