//! What a turn by at most an angle costs a box of forces.

use core::f64::consts::FRAC_PI_2;
use nalgebra::ComplexField;

/// Largest sum of a row of `|R - I|`, `R` any rotation by at most this angle: the share of a force within a cube that goes astray.
///
/// Row `i` of `R - I` about the axis `n` has the sum `(1 - cos)(1 - n_i^2)` and two entries whose sizes add up to at most
/// `sqrt(1 - n_i^2) sqrt(2 sin^2 + 2 (1 - cos)^2 n_i^2)`: up to a right angle most at `n_i = 0`. Beyond, no row exceeds `1 + sqrt(3)`.
///
/// # Units
/// rad.
pub fn rotation_share(angle_rad: f64) -> f64 {
    let angle = angle_rad.abs();
    if angle <= FRAC_PI_2 {
        core::f64::consts::SQRT_2 * ComplexField::sin(angle) + 1.0 - ComplexField::cos(angle)
    } else {
        1.0 + f64::sqrt(3.0)
    }
}

/// The cube inside a cube that is turned by at most this angle, as a share of its size.
///
/// # Units
/// rad.
pub fn available_share(angle_rad: f64) -> f64 {
    let angle = angle_rad.abs();
    // no row of a rotation sums to more than the square root of three
    let most = f64::sqrt(3.0);
    let row = if angle <= FRAC_PI_2 { 1.0 + core::f64::consts::SQRT_2 * ComplexField::sin(angle) } else { most };
    1.0 / row.min(most)
}
