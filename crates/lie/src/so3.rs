//! SO(3): the Jacobians shared by every representation of rotations, and the group of rotation matrices (`Rotation3`).
//!
//! | | |
//! |---|---|
//! | element | `R`, 3x3, columns are the body axes in the outer frame |
//! | tangent | rotation vector `phi = angle * axis`, rad |
//! | exp | `I + sin(t)/t S + (1 - cos(t))/t^2 S^2`, `S = S(phi)`, `t = norm(phi)` |
//! | Ad, Ad* | `R`, `R` |
//! | ad | `[a, b] = a x b`, dual `mu x a` |
//! | Jr | `I - a S + b S^2`, inverse `I + S/2 + c S^2` (coefficients: [`series`]) |

use crate::group::{GroupAction, LieGroup};
use crate::scalar::{Scalar, real};
use crate::series;
use nalgebra::{Matrix3, Rotation3, UnitQuaternion, Vector3};

/// Right Jacobian of the exponential of rotations: `exp(phi + d) = exp(phi) exp(Jr(phi) d) + O(d^2)`.
#[inline]
pub fn rotation_jacobian<T: Scalar>(phi: &Vector3<T>) -> Matrix3<T> {
    let j = series::jacobian(phi.norm_squared());
    Matrix3::from(identity_plus(&(phi * -j.a), phi, &(phi * (j.b * real(0.5)))))
}

/// Inverse of [`rotation_jacobian`]; it does not exist at whole turns.
#[inline]
pub fn rotation_jacobian_inverse<T: Scalar>(phi: &Vector3<T>) -> Matrix3<T> {
    let c = series::inverse_jacobian(phi.norm_squared()).c;
    let half = real::<T>(0.5);
    Matrix3::from(identity_plus(&(phi * half), phi, &(phi * (c * half))))
}

/// Columns of `S(y) + phi z^T + z phi^T - 2 (phi.z) I`.
///
/// With `y = f phi` and `z = g/2 phi` this is `f S(phi) + g S(phi)^2`.
#[inline(always)]
pub(crate) fn skew_plus_symmetric<T: Scalar>(y: &Vector3<T>, phi: &Vector3<T>, z: &Vector3<T>) -> [[T; 3]; 3] {
    let two = real::<T>(2.0);
    let (xx, yy, zz) = (phi.x * z.x * two, phi.y * z.y * two, phi.z * z.z * two);
    let xy = phi.x * z.y + phi.y * z.x;
    let xz = phi.x * z.z + phi.z * z.x;
    let yz = phi.y * z.z + phi.z * z.y;
    [[-(yy + zz), xy + y.z, xz - y.y], [xy - y.z, -(xx + zz), yz + y.x], [xz + y.y, yz - y.x, -(xx + yy)]]
}

/// Columns of `I + skew_plus_symmetric(y, phi, z)`.
#[inline(always)]
pub(crate) fn identity_plus<T: Scalar>(y: &Vector3<T>, phi: &Vector3<T>, z: &Vector3<T>) -> [[T; 3]; 3] {
    let [[a, b, c], [d, e, f], [g, h, i]] = skew_plus_symmetric(y, phi, z);
    [[a + T::one(), b, c], [d, e + T::one(), f], [g, h, i + T::one()]]
}

impl<T: Scalar> LieGroup for Rotation3<T> {
    type Scalar = T;
    type Tangent = Vector3<T>;
    type Jacobian = Matrix3<T>;
    fn identity() -> Self {
        Rotation3::identity()
    }
    #[inline]
    fn inverse(&self) -> Self {
        self.transpose()
    }
    #[inline]
    fn exp(xi: &Vector3<T>) -> Self {
        Rotation3::from_matrix_unchecked(<UnitQuaternion<T> as LieGroup>::exp(xi).adjoint())
    }
    #[inline]
    fn log(&self) -> Vector3<T> {
        LieGroup::log(&UnitQuaternion::from_rotation_matrix(self))
    }
    #[inline]
    fn adjoint(&self) -> Matrix3<T> {
        self.into_inner()
    }
    #[inline]
    fn coadjoint(&self) -> Matrix3<T> {
        self.into_inner()
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

impl<T: Scalar> GroupAction<Vector3<T>> for Rotation3<T> {
    #[inline]
    fn act(&self, point: &Vector3<T>) -> Vector3<T> {
        self * point
    }
}
