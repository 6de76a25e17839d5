//! SE(2) on `Isometry2` (unit complex number and translation). Tangent order `[angular; linear]`.
//!
//! | | |
//! |---|---|
//! | element | `[R t; 0 1]` |
//! | tangent | `[phi; rho]`, rad and m |
//! | exp | rotation by `phi`, translation `(sin(phi)/phi I + (1 - cos(phi))/phi E) rho`, `E = [0 -1; 1 0]` |
//! | Ad | `[1 0; -E t R]` |
//! | ad | `[w, v]`: `[0 0; -E v w E]` |
//! | Jr | `I - a ad + b ad^2`, inverse `I + ad/2 + c ad^2`, since `ad^3 = -w^2 ad` as on SO(3) |

use crate::group::{GroupAction, LieGroup};
use crate::scalar::{Scalar, real};
use crate::series;
use nalgebra::{Isometry2, Matrix3, Translation2, UnitComplex, Vector2, Vector3};

/// `I + first ad + second ad^2`
#[inline(always)]
fn polynomial_in_bracket<T: Scalar>(xi: &Vector3<T>, first: T, second: T) -> Matrix3<T> {
    let (w, x, y) = (xi.x, xi.y, xi.z);
    let (one, o) = (T::one(), T::zero());
    let diagonal = one - second * w * w;
    let turn = first * w;
    Matrix3::new(one, o, o, first * y + second * w * x, diagonal, -turn, second * w * y - first * x, turn, diagonal)
}

impl<T: Scalar> LieGroup for Isometry2<T> {
    type Scalar = T;
    type Tangent = Vector3<T>;
    type Jacobian = Matrix3<T>;
    fn identity() -> Self {
        Isometry2::identity()
    }
    #[inline]
    fn inverse(&self) -> Self {
        let rotation = self.rotation.conjugate();
        Isometry2::from_parts(Translation2::from(-rotation.act(&self.translation.vector)), rotation)
    }
    #[inline]
    fn exp(xi: &Vector3<T>) -> Self {
        let (phi, x, y) = (xi.x, xi.y, xi.z);
        let half = series::half_angle(phi * phi);
        let sinc = half.sinc * half.cos;
        let rise = half.sinc * half.sinc * phi * real(0.5);
        let rotation = UnitComplex::from_cos_sin_unchecked(T::one() - rise * phi, sinc * phi);
        Isometry2::from_parts(Translation2::new(sinc * x - rise * y, rise * x + sinc * y), rotation)
    }
    #[inline]
    fn log(&self) -> Vector3<T> {
        let phi = self.rotation.log().x;
        let t = self.translation.vector;
        let half = phi * real(0.5);
        let diagonal = T::one() - series::inverse_jacobian(phi * phi).c * phi * phi;
        Vector3::new(phi, diagonal * t.x + half * t.y, diagonal * t.y - half * t.x)
    }
    #[inline]
    fn adjoint(&self) -> Matrix3<T> {
        let (o, t, r) = (T::zero(), self.translation.vector, self.rotation);
        Matrix3::new(T::one(), o, o, t.y, r.re, -r.im, -t.x, r.im, r.re)
    }
    #[inline]
    fn coadjoint(&self) -> Matrix3<T> {
        LieGroup::inverse(self).adjoint().transpose()
    }
    #[inline]
    fn bracket(a: &Vector3<T>, b: &Vector3<T>) -> Vector3<T> {
        Vector3::new(T::zero(), b.x * a.z - a.x * b.z, a.x * b.y - b.x * a.y)
    }
    #[inline]
    fn dual_bracket(a: &Vector3<T>, mu: &Vector3<T>) -> Vector3<T> {
        Vector3::new(mu.y * a.z - mu.z * a.y, a.x * mu.z, -a.x * mu.y)
    }
    #[inline]
    fn right_jacobian(xi: &Vector3<T>) -> Matrix3<T> {
        let j = series::jacobian(xi.x * xi.x);
        polynomial_in_bracket(xi, -j.a, j.b)
    }
    #[inline]
    fn right_jacobian_inverse(xi: &Vector3<T>) -> Matrix3<T> {
        polynomial_in_bracket(xi, real(0.5), series::inverse_jacobian(xi.x * xi.x).c)
    }
}

impl<T: Scalar> GroupAction<Vector2<T>> for Isometry2<T> {
    #[inline]
    fn act(&self, point: &Vector2<T>) -> Vector2<T> {
        self.rotation.act(point) + self.translation.vector
    }
}
