//! What the force limits of a body that turns leave to axes that do not.

use nalgebra::{Matrix3, UnitQuaternion, Vector3};

/// The attitudes at which forces may be asked for.
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
pub enum AttitudeSpan {
    /// Any.
    Any,
    /// Those within an angle of one, the error of the attitude control included.
    Near {
        /// The one, seen from the axes of the tube.
        axes_from_body: UnitQuaternion<f64>,
        /// The angle, rad; below a right angle.
        angle_rad: f64,
    },
}

impl AttitudeSpan {
    /// Half-widths of a box, in the axes, whose every force is inside of the body's box at every attitude of the span; the
    /// shares of its sides are those that the middle attitude gives.
    ///
    /// # Source
    /// The force along a body axis is the product with that axis, which an angle takes at most `sin(angle)` of its length off its place.
    pub fn inner_box(&self, limit_body: &Vector3<f64>) -> Vector3<f64> {
        match self {
            // a force in the ball of the least limit is inside at any attitude
            Self::Any => Vector3::repeat(limit_body.min() / f64::sqrt(3.0)),
            Self::Near { axes_from_body, angle_rad } => {
                let shares: Matrix3<f64> = axes_from_body.to_rotation_matrix().into_inner().map(f64::abs);
                let shape = shares * limit_body;
                let aside = if *angle_rad < core::f64::consts::FRAC_PI_2 { libm::sin(*angle_rad) } else { 1.0 };
                let turned = shape + across(&shape) * aside;
                let asked = shares.transpose() * turned;
                shape * limit_body.component_div(&asked).min()
            }
        }
    }
}

/// For each axis the length of what points along the other two.
pub(super) fn across(v: &Vector3<f64>) -> Vector3<f64> {
    let square = v.component_mul(v);
    Vector3::new(square.y + square.z, square.x + square.z, square.x + square.y).map(f64::sqrt)
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand_chacha::ChaCha8Rng;
    use rand_chacha::rand_core::SeedableRng;
    use tumble_identification::noise::signed_unit;

    #[test]
    fn no_force_of_the_box_leaves_the_body_s_box_at_any_attitude_of_the_span() {
        let mut random = ChaCha8Rng::seed_from_u64(8);
        let mut unit = || signed_unit(&mut random);
        let (mut fullest, limit) = (0.0_f64, Vector3::new(0.452, 0.216, 0.257));
        for _ in 0..2000 {
            let axes_from_body = UnitQuaternion::new(Vector3::new(unit(), unit(), unit()) * 3.0);
            let angle_rad = 0.3 * unit().abs();
            let span = AttitudeSpan::Near { axes_from_body, angle_rad };
            let inner = span.inner_box(&limit);
            let turn = UnitQuaternion::new(Vector3::new(unit(), unit(), unit()).normalize() * angle_rad);
            for (span, attitude) in [(span, turn * axes_from_body), (AttitudeSpan::Any, axes_from_body)] {
                let inner = if span == AttitudeSpan::Any { span.inner_box(&limit) } else { inner };
                for corner in 0..8 {
                    let sign = |bit: i32| if corner & bit == 0 { 1.0 } else { -1.0 };
                    let force = inner.component_mul(&Vector3::new(sign(1), sign(2), sign(4)));
                    let share = (attitude.inverse() * force).abs().component_div(&limit).max();
                    assert!(share <= 1.0 + 1e-12, "{share}");
                    fullest = fullest.max(share);
                }
            }
        }
        assert!(fullest > 0.99, "{fullest}");
        // along the axes nothing is lost, whichever axis is which
        let quarter = UnitQuaternion::new(Vector3::new(0.0, 0.0, core::f64::consts::FRAC_PI_2));
        let span = AttitudeSpan::Near { axes_from_body: quarter, angle_rad: 0.0 };
        assert!((span.inner_box(&limit) - Vector3::new(0.216, 0.452, 0.257)).amax() < 1e-12);
        // equal limits and an angle: the share of design
        let span = AttitudeSpan::Near { axes_from_body: UnitQuaternion::identity(), angle_rad: 0.1 };
        let share = 1.0 / (1.0 + f64::sqrt(2.0) * libm::sin(0.1));
        assert!((span.inner_box(&Vector3::repeat(0.15)) - Vector3::repeat(0.15 * share)).amax() < 1e-15);
    }
}
