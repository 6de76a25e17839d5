//! ZYX Euler angles (yaw, then pitch, then roll): `R = Rz(yaw) Ry(pitch) Rx(roll)`, and their rates.

use crate::error::LieError;
use crate::group::LieGroup;
use crate::quaternion::unit;
use crate::scalar::{Scalar, real, value};
use nalgebra::{UnitQuaternion, Vector3};

/// Roll, pitch and yaw (phi, theta, psi), rad; or their first or second time derivatives.
///
/// # Frame
/// The rotation `world_from_body` is `Rz(yaw) Ry(pitch) Rx(roll)`.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct EulerZyx<T: Scalar> {
    /// About the body x axis, rad.
    pub roll: T,
    /// About the y axis after yaw, within a quarter turn of zero, rad.
    pub pitch: T,
    /// About the world z axis, rad.
    pub yaw: T,
}

impl<T: Scalar> EulerZyx<T> {
    /// From the three angles.
    pub fn new(roll: T, pitch: T, yaw: T) -> Self {
        Self { roll, pitch, yaw }
    }

    /// The rotation `world_from_body`.
    pub fn to_rotation(&self) -> UnitQuaternion<T> {
        let half = real::<T>(0.5);
        let (sx, cx) = (self.roll * half).sin_cos();
        let (sy, cy) = (self.pitch * half).sin_cos();
        let (sz, cz) = (self.yaw * half).sin_cos();
        let z = unit(cz, &Vector3::new(T::zero(), T::zero(), sz));
        let y = unit(cy, &Vector3::new(T::zero(), sy, T::zero()));
        let x = unit(cx, &Vector3::new(sx, T::zero(), T::zero()));
        z.compose(&y).compose(&x)
    }

    /// The angles of a rotation: pitch within a quarter turn, roll and yaw within half a turn of zero.
    ///
    /// Exact to rounding up to the vertical, where only the sum or the difference of roll and yaw has a meaning.
    pub fn from_rotation(world_from_body: &UnitQuaternion<T>) -> Self {
        let (x, y, z, w) = (world_from_body.i, world_from_body.j, world_from_body.k, world_from_body.w);
        // (a, b) = (cos, sin) of half the sum, (c, d) of half the difference of yaw and roll, times functions of pitch
        let (a, b, c, d) = (w - y, x + z, w + y, z - x);
        let (half_sum, half_difference) = (b.atan2(a), d.atan2(c));
        let pitch = (c * c + d * d).sqrt().atan2((a * a + b * b).sqrt()) * real(2.0) - T::frac_pi_2();
        Self { roll: wrapped(half_sum - half_difference), pitch, yaw: wrapped(half_sum + half_difference) }
    }

    /// The body rate, when the angles change at `rates`.
    ///
    /// # Frame
    /// Body axes.
    /// # Units
    /// rad/s.
    pub fn angular_velocity_body(&self, rates: &Self) -> Vector3<T> {
        let ((sr, cr), (sp, cp)) = (self.roll.sin_cos(), self.pitch.sin_cos());
        Vector3::new(
            rates.roll - rates.yaw * sp,
            rates.pitch * cr + rates.yaw * cp * sr,
            rates.yaw * cp * cr - rates.pitch * sr,
        )
    }

    /// The derivative of the body rate, when the angles have these first and second derivatives.
    ///
    /// # Frame
    /// Body axes.
    /// # Units
    /// rad/s^2.
    pub fn angular_acceleration_body(&self, rates: &Self, accelerations: &Self) -> Vector3<T> {
        let ((sr, cr), (sp, cp)) = (self.roll.sin_cos(), self.pitch.sin_cos());
        // angular_velocity_body is linear in the rates: its value for the second derivatives plus the change of its
        // coefficients
        self.angular_velocity_body(accelerations)
            + Vector3::new(
                -(rates.yaw * rates.pitch * cp),
                rates.yaw * (rates.roll * cp * cr - rates.pitch * sp * sr) - rates.pitch * rates.roll * sr,
                -(rates.yaw * (rates.pitch * sp * cr + rates.roll * cp * sr)) - rates.pitch * rates.roll * cr,
            )
    }

    /// The rates of the angles of a body that turns at `angular_velocity_body`.
    ///
    /// # Errors
    /// [`LieError::GimbalLock`] at the vertical, where the rates do not exist.
    pub fn try_rates(&self, angular_velocity_body: &Vector3<T>) -> Result<Self, LieError> {
        let ((sr, cr), (sp, cp)) = (self.roll.sin_cos(), self.pitch.sin_cos());
        let w = angular_velocity_body;
        if cp.abs() <= T::default_epsilon() {
            return Err(LieError::GimbalLock { pitch_rad: value(self.pitch) });
        }
        let yaw = (w.y * sr + w.z * cr) / cp;
        Ok(Self { roll: w.x + yaw * sp, pitch: w.y * cr - w.z * sr, yaw })
    }
}

/// The same angle in `-pi..=pi`, for angles of at most two turns.
fn wrapped<T: Scalar>(angle: T) -> T {
    if angle > T::pi() {
        angle - T::two_pi()
    } else if angle < -T::pi() {
        angle + T::two_pi()
    } else {
        angle
    }
}

#[cfg(test)]
#[allow(clippy::unreadable_literal)]
mod tests {
    use super::*;
    use approx::assert_relative_eq;
    use core::f64::consts::FRAC_PI_2;
    use nalgebra::{Rotation3, UnitQuaternion};

    /// Golden rates of the reference equations, section e.
    #[test]
    fn golden_rates() {
        let angles = EulerZyx::new(0.3, -0.2, 0.5);
        let rates = EulerZyx::new(0.2, -0.1, 0.3);
        let w = angles.angular_velocity_body(&rates);
        assert_relative_eq!(w, Vector3::new(0.25960079923852, -0.00864480562491, 0.31044002974139), epsilon = 1e-13);
        let w_rate = angles.angular_acceleration_body(&rates, &EulerZyx::new(-0.1, 0.3, 0.15));
        let golden = Vector3::new(-0.0407976030455, 0.39037205027897, 0.04782302183485);
        assert_relative_eq!(w_rate, golden, epsilon = 1e-13);
        let back = angles.try_rates(&w).unwrap();
        assert_relative_eq!(back.roll, rates.roll, epsilon = 1e-14);
        assert_relative_eq!(back.pitch, rates.pitch, epsilon = 1e-14);
        assert_relative_eq!(back.yaw, rates.yaw, epsilon = 1e-14);
    }

    /// The body rate is `2 vec(q* o qdot)`, its derivative the dual part of the same at dual rates.
    #[test]
    fn rates_equal_dual_numbers() {
        use num_dual::Dual64;
        let at = |t: Dual64| {
            EulerZyx::new(Dual64::from(0.3) + t * 0.2, Dual64::from(-0.2) - t * 0.1, Dual64::from(0.5) + t * 0.3)
        };
        let moving = at(Dual64::new(0.0, 1.0)).to_rotation();
        let constant = at(Dual64::new(0.0, 0.0)).to_rotation();
        let w = LieGroup::log(&(constant.inverse() * moving)).map(|c| c.eps);
        let golden = EulerZyx::new(0.3, -0.2, 0.5).angular_velocity_body(&EulerZyx::new(0.2, -0.1, 0.3));
        assert_relative_eq!(w, golden, epsilon = 1e-15);
    }

    #[test]
    fn round_trip_everywhere() {
        for pitch in [-FRAC_PI_2, -FRAC_PI_2 + 1e-9, -0.7, 0.0, 1.2, FRAC_PI_2 - 1e-7, FRAC_PI_2] {
            for roll in [-3.1, -0.4, 0.0, 2.0] {
                for yaw in [-3.0, -1e-9, 0.3, 3.1] {
                    let rotation: UnitQuaternion<f64> = EulerZyx::new(roll, pitch, yaw).to_rotation();
                    let found = EulerZyx::from_rotation(&rotation);
                    assert!(
                        found.pitch.abs() <= FRAC_PI_2 + 1e-15 && found.roll.abs() <= 3.15 && found.yaw.abs() <= 3.15
                    );
                    assert_relative_eq!(
                        found.to_rotation().to_rotation_matrix(),
                        rotation.to_rotation_matrix(),
                        epsilon = 4e-15
                    );
                    assert_relative_eq!(found.pitch, pitch, epsilon = 4e-15);
                    assert_relative_eq!(
                        rotation.to_rotation_matrix(),
                        Rotation3::from_euler_angles(roll, pitch, yaw),
                        epsilon = 1e-15
                    );
                }
            }
        }
    }

    #[test]
    fn vertical_has_no_rates() {
        let vertical = EulerZyx::new(0.1, FRAC_PI_2, 0.2);
        assert!(matches!(vertical.try_rates(&Vector3::x()), Err(LieError::GimbalLock { .. })));
    }
}
