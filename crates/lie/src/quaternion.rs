//! Unit quaternions (Hamilton) as a Lie group; component order appears only in the two constructors.

use crate::error::LieError;
use crate::group::{GroupAction, LieGroup};
use crate::scalar::{Scalar, real};
use crate::series;
use crate::skew::skew;
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

/// Right Jacobian of the exponential of rotations, `I - a S + b S^2`.
#[inline]
pub fn rotation_jacobian<T: Scalar>(phi: &Vector3<T>) -> Matrix3<T> {
    let (a, b) = series::jacobian(phi.norm_squared());
    polynomial_in_skew(phi, T::one(), -a, b)
}

/// Inverse right Jacobian of the exponential of rotations, `I + S/2 + c S^2`.
#[inline]
pub fn rotation_jacobian_inverse<T: Scalar>(phi: &Vector3<T>) -> Matrix3<T> {
    let (c, _) = series::inverse_jacobian_with_rate(phi.norm_squared());
    polynomial_in_skew(phi, T::one(), real(0.5), c)
}

/// `unit I + first S(phi) + second S(phi)^2`.
#[inline(always)]
pub(crate) fn polynomial_in_skew<T: Scalar>(phi: &Vector3<T>, unit: T, first: T, second: T) -> Matrix3<T> {
    let diagonal = unit - second * phi.norm_squared();
    let mut m = phi * phi.transpose() * second + skew(phi) * first;
    m.m11 += diagonal;
    m.m22 += diagonal;
    m.m33 += diagonal;
    m
}

impl<T: Scalar> LieGroup for UnitQuaternion<T> {
    type Scalar = T;
    type Tangent = Vector3<T>;
    type Jacobian = Matrix3<T>;
    fn identity() -> Self {
        UnitQuaternion::identity()
    }
    fn inverse(&self) -> Self {
        UnitQuaternion::inverse(self)
    }
    #[inline]
    fn exp(xi: &Vector3<T>) -> Self {
        let (sinc, cos) = series::sinc_cos(xi.norm_squared() * real(0.25));
        let v = xi * (sinc * real(0.5));
        UnitQuaternion::new_unchecked(Quaternion::new(cos, v.x, v.y, v.z))
    }
    #[inline]
    fn log(&self) -> Vector3<T> {
        let (v, w) = (self.imag(), self.w);
        // q and -q are one rotation: take the representative with a non-negative scalar part.
        let (v, w) = if w < T::zero() { (-v, -w) } else { (v, w) };
        let n2 = v.norm_squared();
        if n2 < real(1e-3) {
            // 2 atan(n / w) / n
            let x = n2 / (w * w);
            let mut sum = T::zero();
            for k in (0..8).rev() {
                let c = if k % 2 == 0 { 1.0 } else { -1.0 } / f64::from(2 * k + 1);
                sum = sum * x + real(c);
            }
            v * (sum * real(2.0) / w)
        } else {
            let n = n2.sqrt();
            v * (n.atan2(w) * real(2.0) / n)
        }
    }
    fn adjoint(&self) -> Matrix3<T> {
        self.to_rotation_matrix().into_inner()
    }
    fn coadjoint(&self) -> Matrix3<T> {
        self.adjoint()
    }
    fn bracket(a: &Vector3<T>, b: &Vector3<T>) -> Vector3<T> {
        a.cross(b)
    }
    fn dual_bracket(a: &Vector3<T>, mu: &Vector3<T>) -> Vector3<T> {
        mu.cross(a)
    }
    fn right_jacobian(xi: &Vector3<T>) -> Matrix3<T> {
        rotation_jacobian(xi)
    }
    fn right_jacobian_inverse(xi: &Vector3<T>) -> Matrix3<T> {
        rotation_jacobian_inverse(xi)
    }
}

impl<T: Scalar> GroupAction<Vector3<T>> for UnitQuaternion<T> {
    fn act(&self, point: &Vector3<T>) -> Vector3<T> {
        self * point
    }
}
