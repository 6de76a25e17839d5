//! Unit quaternions (Hamilton) as a Lie group; component order appears only in the two constructors.
//!
//! | | |
//! |---|---|
//! | element | `q = w + v`, `q = world_from_body` turns body vectors into world vectors: `q o r o q*`; `q` and `-q` are one rotation |
//! | tangent | rotation vector `phi = angle * axis`, rad |
//! | exp | `w = cos(t/2)`, `v = sin(t/2) phi / t`, `t = norm(phi)` |
//! | log | of the representative with `w >= 0`: angles up to half a turn |
//! | Ad, ad, Jacobians | as SO(3) in every representation |
//!
//! Products are not normalised: rounding moves the norm by about 1e-16 each, 1e-12 after ten thousand;
//! `UnitQuaternion::renormalize_fast` restores it.
//!
//! # Source
//! (A.6)-(A.13)
//! # Deviation
//! Entry (1, 3) of the matrix in (A.13) lacks a factor two in its second product (test `golden_exponential`).

use crate::error::LieError;
use crate::group::{GroupAction, LieGroup};
use crate::scalar::{Scalar, real};
use crate::series;
use crate::so3::{rotation_jacobian, rotation_jacobian_inverse};
use nalgebra::{Matrix3, Quaternion, UnitQuaternion, Vector3};

/// A rotation from quaternion components, scalar first.
///
/// # Errors
/// [`LieError::NotUnit`] when the norm differs from one by more than `tolerance`; within it the result is normalised.
pub fn from_wxyz(w: f64, x: f64, y: f64, z: f64, tolerance: f64) -> Result<UnitQuaternion<f64>, LieError> {
    let quaternion = Quaternion::new(w, x, y, z);
    let norm = quaternion.norm();
    if !norm.is_finite() {
        return Err(LieError::NotFinite);
    }
    if (norm - 1.0).abs() > tolerance || norm == 0.0 {
        return Err(LieError::NotUnit { norm, tolerance });
    }
    Ok(UnitQuaternion::new_unchecked(quaternion / norm))
}

/// A rotation from quaternion components, scalar last.
///
/// # Errors
/// As [`from_wxyz`].
pub fn from_xyzw(x: f64, y: f64, z: f64, w: f64, tolerance: f64) -> Result<UnitQuaternion<f64>, LieError> {
    from_wxyz(w, x, y, z, tolerance)
}

/// The unit quaternion with these parts.
#[inline(always)]
pub(crate) fn unit<T: Scalar>(w: T, v: &Vector3<T>) -> UnitQuaternion<T> {
    UnitQuaternion::new_unchecked(Quaternion::new(w, v.x, v.y, v.z))
}

/// `log(q)` and the coefficient `c` of its inverse Jacobian.
///
/// One Newton step of normalisation makes the result insensitive to the rounding that products collect.
#[inline(always)]
pub(crate) fn log_with_coefficient<T: Scalar>(q: &UnitQuaternion<T>) -> (Vector3<T>, T) {
    let (x, y, z, w) = (q.i, q.j, q.k, q.w);
    let per_norm = real::<T>(1.5) - real::<T>(0.5) * (x * x + y * y + (z * z + w * w));
    let w = w * per_norm;
    // q and -q are one rotation: take the representative with a non-negative scalar part.
    let (w, per_norm) = if w < T::zero() { (-w, -per_norm) } else { (w, per_norm) };
    let series::Logarithm { g, c } = series::logarithm(w);
    (Vector3::new(x, y, z) * (g * per_norm * real(2.0)), c)
}

impl<T: Scalar> LieGroup for UnitQuaternion<T> {
    type Scalar = T;
    type Tangent = Vector3<T>;
    type Jacobian = Matrix3<T>;
    fn identity() -> Self {
        UnitQuaternion::identity()
    }
    #[inline]
    fn inverse(&self) -> Self {
        self.conjugate()
    }
    #[inline]
    fn exp(xi: &Vector3<T>) -> Self {
        let half = series::half_angle(xi.norm_squared());
        unit(half.cos, &(xi * (half.sinc * real(0.5))))
    }
    #[inline]
    fn log(&self) -> Vector3<T> {
        log_with_coefficient(self).0
    }
    #[inline]
    fn adjoint(&self) -> Matrix3<T> {
        let (x, y, z, w) = (self.i, self.j, self.k, self.w);
        let (x2, y2, z2) = (x + x, y + y, z + z);
        let (xx, yy, zz) = (x * x2, y * y2, z * z2);
        let (xy, xz, yz) = (x * y2, x * z2, y * z2);
        let (wx, wy, wz) = (w * x2, w * y2, w * z2);
        let one = T::one();
        Matrix3::new(
            one - (yy + zz),
            xy - wz,
            xz + wy,
            xy + wz,
            one - (xx + zz),
            yz - wx,
            xz - wy,
            yz + wx,
            one - (xx + yy),
        )
    }
    #[inline]
    fn coadjoint(&self) -> Matrix3<T> {
        self.adjoint()
    }
    #[inline]
    fn bracket(a: &Vector3<T>, b: &Vector3<T>) -> Vector3<T> {
        a.cross(b)
    }
    #[inline]
    fn dual_bracket(a: &Vector3<T>, mu: &Vector3<T>) -> Vector3<T> {
        mu.cross(a)
    }
    #[inline]
    fn right_jacobian(xi: &Vector3<T>) -> Matrix3<T> {
        rotation_jacobian(xi)
    }
    #[inline]
    fn right_jacobian_inverse(xi: &Vector3<T>) -> Matrix3<T> {
        rotation_jacobian_inverse(xi)
    }
}

impl<T: Scalar> GroupAction<Vector3<T>> for UnitQuaternion<T> {
    #[inline]
    fn act(&self, point: &Vector3<T>) -> Vector3<T> {
        let v = Vector3::new(self.i, self.j, self.k);
        let twice = v.cross(point) * real::<T>(2.0);
        point + twice * self.w + v.cross(&twice)
    }
}

#[cfg(test)]
#[allow(clippy::unreadable_literal)]
mod tests {
    use super::*;
    use approx::assert_relative_eq;
    use nalgebra::Rotation3;

    /// Golden rotation of the reference equations, appendix A.
    #[test]
    fn golden_exponential() {
        let phi = Vector3::new(0.3, -0.4, 0.7);
        let q = <UnitQuaternion<f64> as LieGroup>::exp(&phi);
        let golden = from_xyzw(0.145417593292156, -0.193890124389541, 0.339307717681697, 0.908917276734777, 1e-14);
        assert_relative_eq!(q, golden.unwrap(), epsilon = 1e-14);
        let matrix = Matrix3::new(
            0.694553784771693,
            -0.673195363964368,
            -0.253777544310365,
            0.560415222956993,
            0.727447992565511,
            -0.395921956944134,
            0.451142791073271,
            0.132768294594592,
            0.882520686451071,
        );
        assert_relative_eq!(q.adjoint(), matrix, epsilon = 1e-11);
        let rotation = <Rotation3<f64> as LieGroup>::exp(&phi);
        assert_relative_eq!(rotation.into_inner(), matrix, epsilon = 1e-11);
        assert_relative_eq!(UnitQuaternion::from_rotation_matrix(&rotation), q, epsilon = 1e-14);
    }

    #[test]
    fn golden_product() {
        let product =
            <UnitQuaternion<f64> as LieGroup>::exp(&Vector3::new(0.1, 0.2, -0.3))
                .compose(&<UnitQuaternion<f64> as LieGroup>::exp(&Vector3::new(-0.4, 0.25, 0.15)));
        let golden = from_wxyz(0.961224149020707, -0.120484475898974, 0.243789008759116, -0.045809885559940, 1e-14);
        assert_relative_eq!(product, golden.unwrap(), epsilon = 1e-14);
    }

    #[test]
    fn constructors_reject_what_is_not_a_rotation() {
        assert!(matches!(from_wxyz(2.0, 0.0, 0.0, 0.0, 1e-3), Err(LieError::NotUnit { .. })));
        assert!(matches!(from_wxyz(0.0, 0.0, 0.0, 0.0, 2.0), Err(LieError::NotUnit { .. })));
        assert_eq!(from_xyzw(f64::NAN, 0.0, 0.0, 1.0, 1.0), Err(LieError::NotFinite));
        assert_relative_eq!(from_wxyz(1.0005, 0.0, 0.0, 0.0, 1e-3).unwrap().norm(), 1.0);
    }
}
