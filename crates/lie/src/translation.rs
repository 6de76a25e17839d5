//! The additive group of N coordinates, `Translation`: exp and log are the identity map, Ad = Jr = I, ad = 0.

use crate::group::{GroupAction, LieGroup};
use crate::scalar::Scalar;
use nalgebra::{SMatrix, SVector, Translation};

impl<T: Scalar, const N: usize> LieGroup for Translation<T, N> {
    type Scalar = T;
    type Tangent = SVector<T, N>;
    type Jacobian = SMatrix<T, N, N>;
    fn identity() -> Self {
        Translation::identity()
    }
    #[inline]
    fn inverse(&self) -> Self {
        Translation::from(-self.vector)
    }
    #[inline]
    fn exp(xi: &SVector<T, N>) -> Self {
        Translation::from(*xi)
    }
    #[inline]
    fn log(&self) -> SVector<T, N> {
        self.vector
    }
    fn adjoint(&self) -> SMatrix<T, N, N> {
        SMatrix::identity()
    }
    fn coadjoint(&self) -> SMatrix<T, N, N> {
        SMatrix::identity()
    }
    fn bracket(_: &SVector<T, N>, _: &SVector<T, N>) -> SVector<T, N> {
        SVector::zeros()
    }
    fn dual_bracket(_: &SVector<T, N>, _: &SVector<T, N>) -> SVector<T, N> {
        SVector::zeros()
    }
    fn right_jacobian(_: &SVector<T, N>) -> SMatrix<T, N, N> {
        SMatrix::identity()
    }
    fn right_jacobian_inverse(_: &SVector<T, N>) -> SMatrix<T, N, N> {
        SMatrix::identity()
    }
}

impl<T: Scalar, const N: usize> GroupAction<SVector<T, N>> for Translation<T, N> {
    #[inline]
    fn act(&self, point: &SVector<T, N>) -> SVector<T, N> {
        self.vector + point
    }
}
