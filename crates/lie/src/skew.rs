//! The cross-product matrix and its inverse.

use crate::scalar::Scalar;
use nalgebra::{Matrix3, Vector3};

/// `S(a)` with `S(a) b = a x b`.
///
/// # Source
/// (2.5)
#[inline(always)]
pub fn skew<T: Scalar>(a: &Vector3<T>) -> Matrix3<T> {
    let o = T::zero();
    Matrix3::new(o, -a.z, a.y, a.z, o, -a.x, -a.y, a.x, o)
}

/// The vector of the skew-symmetric part of `matrix`: `vee(S(a)) = a`.
#[inline(always)]
pub fn vee<T: Scalar>(matrix: &Matrix3<T>) -> Vector3<T> {
    let half = crate::real::<T>(0.5);
    Vector3::new(matrix.m32 - matrix.m23, matrix.m13 - matrix.m31, matrix.m21 - matrix.m12) * half
}
