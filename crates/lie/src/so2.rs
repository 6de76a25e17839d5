//! SO(2) on `UnitComplex`: `exp(phi) = cos(phi) + i sin(phi)`, `phi` in rad; Ad = Jr = 1, ad = 0.

use crate::group::{GroupAction, LieGroup};
use crate::scalar::Scalar;
use nalgebra::{Matrix1, UnitComplex, Vector1, Vector2};

impl<T: Scalar> LieGroup for UnitComplex<T> {
    type Scalar = T;
    type Tangent = Vector1<T>;
    type Jacobian = Matrix1<T>;
    fn identity() -> Self {
        UnitComplex::identity()
    }
    #[inline]
    fn inverse(&self) -> Self {
        self.conjugate()
    }
    #[inline]
    fn exp(xi: &Vector1<T>) -> Self {
        UnitComplex::new(xi.x)
    }
    #[inline]
    fn log(&self) -> Vector1<T> {
        Vector1::new(self.im.atan2(self.re))
    }
    fn adjoint(&self) -> Matrix1<T> {
        Matrix1::identity()
    }
    fn coadjoint(&self) -> Matrix1<T> {
        Matrix1::identity()
    }
    fn bracket(_: &Vector1<T>, _: &Vector1<T>) -> Vector1<T> {
        Vector1::zeros()
    }
    fn dual_bracket(_: &Vector1<T>, _: &Vector1<T>) -> Vector1<T> {
        Vector1::zeros()
    }
    fn right_jacobian(_: &Vector1<T>) -> Matrix1<T> {
        Matrix1::identity()
    }
    fn right_jacobian_inverse(_: &Vector1<T>) -> Matrix1<T> {
        Matrix1::identity()
    }
}

impl<T: Scalar> GroupAction<Vector2<T>> for UnitComplex<T> {
    #[inline]
    fn act(&self, point: &Vector2<T>) -> Vector2<T> {
        Vector2::new(self.re * point.x - self.im * point.y, self.im * point.x + self.re * point.y)
    }
}
