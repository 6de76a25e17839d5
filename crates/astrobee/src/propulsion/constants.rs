//! The numbers of the propulsion system, each with its unit, in one place.
//!
//! Provenance: nasa/astrobee (Apache-2.0), release 0.19.1, commit `bf30648a`: the constants of its force allocation
//! and of its propulsion simulation (`gnc/pmc`), facts only. Lengths are given there in inches and angles in degrees;
//! they are converted here, never rounded.
//!
//! In dispute upstream, and what is used here:
//! - The leak area differs between the modules. The allocation uses module 0's for both
//!   ([`LEAK_AREAS_M2`]`[0]`); the propulsion model, each module's own.
//! - Fully open is byte 254 in the present flight software (a 32-bit 254.999985, truncated) and 255 in that of 2021.
//! - The simulation multiplies thrust by 1.25, a tuning factor; the physical model does not.
//! - Drag upstream uses an air density of 1.225 kg/m^3, propulsion 1.2.

use super::ImpellerMode;

/// Metres in an inch.
pub const INCH_M: f64 = 0.0254;
/// Air density, kg/m^3.
pub const AIR_DENSITY_KG_M3: f64 = 1.2;
/// Impeller diameter, m (5.5 in).
pub const IMPELLER_DIAMETER_M: f64 = 5.5 * INCH_M;
/// Height of the impeller's trailing edge, m (1.6742 in).
pub const IMPELLER_HEIGHT_M: f64 = 1.6742 * INCH_M;
/// Area through which a plenum leaks with every nozzle closed, of each module, m^2.
pub const LEAK_AREAS_M2: [f64; 2] = [0.004_466_7, 0.004_227_3];
/// Height of the intake above each flap, m (0.5154 in).
pub const FLAP_INTAKE_HEIGHT_M: f64 = 0.5154 * INCH_M;
/// Length of a flap, m (0.5353 in).
pub const FLAP_LENGTH_M: f64 = 0.5353 * INCH_M;
/// Angle of a closed flap, rad (15.68 degrees).
pub const FLAP_CLOSED_RAD: f64 = 15.68 * DEGREE_RAD;
/// Angle of an open flap, rad (79.91 degrees).
pub const FLAP_OPEN_RAD: f64 = 79.91 * DEGREE_RAD;
/// Travel of a flap from its closed to its open stop, rad.
pub const FLAP_TRAVEL_RAD: f64 = FLAP_OPEN_RAD - FLAP_CLOSED_RAD;
/// Flaps of one nozzle.
pub const FLAPS_PER_NOZZLE: f64 = 2.0;
/// Counts of the impeller's speed command per rad/s.
pub const SPEED_COUNTS_PER_RAD_S: f64 = 0.792_095;
/// Counts of a nozzle's command at its open stop.
pub const NOZZLE_COUNTS: f64 = 255.0;
/// Period of flight software and of the propulsion model, s.
pub const CONTROL_PERIOD_S: f64 = 0.016;

/// Radians in a degree.
const DEGREE_RAD: f64 = core::f64::consts::PI / 180.0;

/// One nozzle: two flaps over one opening in the wall of a plenum.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Nozzle {
    /// Name in the flight software's documents.
    pub name: &'static str,
    /// Centre of the opening, body axes, m.
    pub position_body_m: [f64; 3],
    /// Direction in which the air leaves, body axes; the thrust points the other way.
    pub outflow_body: [f64; 3],
    /// Width of the opening, m.
    pub width_m: f64,
    /// Discharge coefficient, measured.
    pub discharge_coefficient: f64,
}

/// Position and width in inches.
const fn nozzle(
    name: &'static str,
    [x, y, z]: [f64; 3],
    outflow_body: [f64; 3],
    width: f64,
    discharge_coefficient: f64,
) -> Nozzle {
    let position_body_m = [x * INCH_M, y * INCH_M, z * INCH_M];
    Nozzle { name, position_body_m, outflow_body, width_m: width * INCH_M, discharge_coefficient }
}

const PLUS_X: [f64; 3] = [1.0, 0.0, 0.0];
const MINUS_X: [f64; 3] = [-1.0, 0.0, 0.0];
const PLUS_Y: [f64; 3] = [0.0, 1.0, 0.0];
const MINUS_Y: [f64; 3] = [0.0, -1.0, 0.0];
const PLUS_Z: [f64; 3] = [0.0, 0.0, 1.0];
const MINUS_Z: [f64; 3] = [0.0, 0.0, -1.0];

/// The twelve nozzles: 0 to 5 on module 0 (starboard), 6 to 11 on module 1 (port).
pub const NOZZLES: [Nozzle; 12] = [
    nozzle("Rx+", [6.00, 4.01, -1.56], PLUS_X, 5.0, 0.914_971_062),
    nozzle("Rx-", [-6.00, 4.01, 1.56], MINUS_X, 5.0, 0.755_778_254),
    nozzle("Fy+", [2.83, 6.00, 2.83], PLUS_Y, 2.8, 0.940_762_925),
    nozzle("Ay+", [-2.83, 6.00, -2.83], PLUS_Y, 2.8, 0.792_109_779),
    nozzle("Rz+", [-2.66, 4.01, 6.00], PLUS_Z, 2.8, 0.924_018_81),
    nozzle("Rz-", [2.66, 4.01, -6.00], MINUS_Z, 2.8, 0.930_319_765),
    nozzle("Lx-", [-6.00, -4.01, -1.56], MINUS_X, 5.0, 0.947_114_008),
    nozzle("Lx+", [6.00, -4.01, 1.56], PLUS_X, 5.0, 0.764_468_916),
    nozzle("Ay-", [-2.83, -6.00, 2.83], MINUS_Y, 2.8, 1.0),
    nozzle("Fy-", [2.83, -6.00, -2.83], MINUS_Y, 2.8, 0.904_809_43),
    nozzle("Lz+", [2.66, -4.01, 6.00], PLUS_Z, 2.8, 0.936_555_627),
    nozzle("Lz-", [-2.66, -4.01, -6.00], MINUS_Z, 2.8, 0.893_794_766),
];

/// Nozzles along each body axis. Equal thrust from the four of a group cancels, whatever the centre of mass.
pub const AXIS_GROUPS: [[usize; 4]; 3] = [[0, 1, 6, 7], [2, 3, 8, 9], [4, 5, 10, 11]];

/// Coefficients of the impeller's pressure coefficient as a polynomial of the flow coefficient, constant term first.
pub const PRESSURE_POLYNOMIAL: [f64; 6] = [0.0825, 0.1278, -2.1758, 11.782, -45.013, 58.72];

/// Impeller speed that a speed byte really asks for, rad/s.
pub fn speed_of_byte_rad_s(byte: u8) -> f64 {
    f64::from(byte) / SPEED_COUNTS_PER_RAD_S
}

/// Impeller speed of a mode after its byte, rad/s: what the hardware turns at, 0.06 to 0.2 % off what allocation assumes.
pub fn quantized_speed_rad_s(mode: ImpellerMode) -> f64 {
    speed_of_byte_rad_s(mode.speed_byte())
}
