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

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::{Matrix3, Rotation3, Unit, Vector3};

    fn largest_row(matrix: &Matrix3<f64>) -> f64 {
        matrix.row_iter().map(|row| row.iter().map(|entry| entry.abs()).sum()).fold(0.0, f64::max)
    }

    /// Axes all over the sphere, angles up to the one named.
    #[test]
    fn no_turn_by_less_takes_more() {
        for angle in [0.0, 0.01, 0.1, 0.5, 1.0, 1.5, FRAC_PI_2, 2.0, 3.1] {
            let (mut astray, mut row) = (0.0_f64, 0.0_f64);
            for step in 0..4000 {
                let height = 2.0 * (f64::from(step) + 0.5) / 4000.0 - 1.0;
                let (sin, cos) = f64::sin_cos(2.399_963_229_728_653 * f64::from(step));
                let radius = f64::sqrt(1.0 - height * height);
                let axis = Unit::new_normalize(Vector3::new(height, radius * cos, radius * sin));
                for share in [0.3, 0.8, 1.0] {
                    let rotation = Rotation3::from_axis_angle(&axis, share * angle).into_inner();
                    astray = astray.max(largest_row(&(rotation - Matrix3::identity())));
                    row = row.max(largest_row(&rotation));
                }
            }
            let (bound, share) = (rotation_share(angle), available_share(angle));
            assert!(astray <= bound + 1e-12 && row * share <= 1.0 + 1e-12, "{angle}: {astray} {row}");
            if angle <= FRAC_PI_2 {
                assert!(astray >= 0.995 * bound, "{angle}: {astray} of {bound}");
            }
            assert!(row * share >= 0.75, "{angle}");
        }
    }

    /// Values of the design's table: the angle whose half has the sine of the bound.
    #[test]
    fn golden_shares() {
        for (vector, share) in [(0.0377_f64, 0.109), (0.0953, 0.286), (0.0464, 0.136), (0.0223, 0.064), (0.0356, 0.103)]
        {
            assert!((rotation_share(2.0 * vector.asin()) - share).abs() < 6e-4, "{vector}");
        }
        assert!((rotation_share(0.013) - 0.018).abs() < 5e-4);
        assert!((available_share(0.1) - 1.0 / (1.0 + f64::sqrt(2.0) * f64::sin(0.1))).abs() < 1e-15);
        assert!((available_share(3.0) - 1.0 / f64::sqrt(3.0)).abs() < 1e-15);
        assert!((rotation_share(-0.1) - rotation_share(0.1)).abs() < 1e-16);
    }
}
