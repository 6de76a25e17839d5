//! SE(3) on `Isometry3` (unit quaternion and translation). Tangent order `[angular; linear]`.
//!
//! | | |
//! |---|---|
//! | element | `[R t; 0 1]` |
//! | tangent | `[phi; rho]`, rad and m |
//! | exp | rotation `exp(phi)`, translation `Jl(phi) rho` |
//! | Ad, Ad* | `[R 0; S(t)R R]`, `[R S(t)R; 0 R]` |
//! | ad | `[S(w) 0; S(v) S(w)]`, dual `[torque x w + force x v; force x w]` |
//! | Jr | `[A 0; B A]`, `A` the right Jacobian of SO(3), `B` its derivative along `rho` |
//!
//! SE(3) is SO(3) over the dual numbers `phi + eps rho`: that gives the exponential and the lower left blocks.
//!
//! # Source
//! (A.14), (A.15)

use crate::group::{GroupAction, LieGroup};
use crate::quaternion::{log_with_coefficient, unit};
use crate::scalar::{Scalar, real};
use crate::series;
use crate::so3::{identity_plus, skew_plus_symmetric};
use crate::spatial::halves;
use nalgebra::{Isometry3, Matrix3, Matrix6, Translation3, Vector3, Vector6};

/// A rigid displacement; named by its frames, `world_from_body`.
pub type Pose<T> = Isometry3<T>;

/// The tangent with these halves.
#[inline(always)]
pub(crate) fn joined<T: Scalar>(angular: &Vector3<T>, linear: &Vector3<T>) -> Vector6<T> {
    Vector6::new(angular.x, angular.y, angular.z, linear.x, linear.y, linear.z)
}

/// Scalar and vector part of the real, then of the dual half of `exp((phi + eps rho) / 2)`.
///
/// The dual half is the derivative of the real half along `rho`.
#[inline(always)]
pub(crate) fn exponential<T: Scalar>(xi: &Vector6<T>) -> ((T, Vector3<T>), (T, Vector3<T>)) {
    let (phi, rho) = halves(xi);
    let half = series::half_angle(phi.norm_squared());
    let (k, dot) = (half.sinc * real(0.5), phi.dot(&rho));
    ((half.cos, phi * k), (-(k * dot * real(0.5)), rho * k + phi * (half.sinc_rate * dot)))
}

/// `[diagonal 0; lower diagonal]`, blocks given by columns.
#[inline(always)]
fn block_lower<T: Scalar>(diagonal: &[[T; 3]; 3], lower: &[[T; 3]; 3]) -> Matrix6<T> {
    let o = T::zero();
    let [[a, b, c], [d, e, f], [g, h, i]] = *diagonal;
    let [[j, k, l], [m, n, p], [q, r, s]] = *lower;
    Matrix6::from([
        [a, b, c, j, k, l],
        [d, e, f, m, n, p],
        [g, h, i, q, r, s],
        [o, o, o, a, b, c],
        [o, o, o, d, e, f],
        [o, o, o, g, h, i],
    ])
}

/// `[diagonal upper; 0 diagonal]`, blocks given by columns.
#[inline(always)]
fn block_upper<T: Scalar>(diagonal: &[[T; 3]; 3], upper: &[[T; 3]; 3]) -> Matrix6<T> {
    let o = T::zero();
    let [[a, b, c], [d, e, f], [g, h, i]] = *diagonal;
    let [[j, k, l], [m, n, p], [q, r, s]] = *upper;
    Matrix6::from([
        [a, b, c, o, o, o],
        [d, e, f, o, o, o],
        [g, h, i, o, o, o],
        [j, k, l, a, b, c],
        [m, n, p, d, e, f],
        [q, r, s, g, h, i],
    ])
}

/// Columns of `S(t) R`.
#[inline(always)]
fn moment_of<T: Scalar>(t: &Vector3<T>, rotation: &Matrix3<T>) -> [[T; 3]; 3] {
    rotation.data.0.map(|[x, y, z]| [t.y * z - t.z * y, t.z * x - t.x * z, t.x * y - t.y * x])
}

/// The matrix `[A 0; B A]`, `A = I + f S + g S^2`, `B` the derivative of `A` along `rho`; `(f, f')`, `(g, g')` with the
/// derivatives in `norm(phi)^2`.
#[inline(always)]
fn jacobian<T: Scalar>(phi: &Vector3<T>, rho: &Vector3<T>, f: (T, T), g: (T, T)) -> Matrix6<T> {
    let half = real::<T>(0.5);
    let dot = phi.dot(rho);
    block_lower(
        &identity_plus(&(phi * f.0), phi, &(phi * (g.0 * half))),
        &skew_plus_symmetric(&(rho * f.0 + phi * (dot * f.1 * real(2.0))), phi, &(rho * g.0 + phi * (dot * g.1))),
    )
}

impl<T: Scalar> LieGroup for Isometry3<T> {
    type Scalar = T;
    type Tangent = Vector6<T>;
    type Jacobian = Matrix6<T>;
    fn identity() -> Self {
        Isometry3::identity()
    }
    #[inline]
    fn inverse(&self) -> Self {
        let rotation = self.rotation.conjugate();
        Isometry3::from_parts(Translation3::from(-rotation.act(&self.translation.vector)), rotation)
    }
    #[inline]
    fn exp(xi: &Vector6<T>) -> Self {
        let ((w, phi), (f_b0, psi)) = exponential(xi);
        let translation = psi * w - phi * f_b0 + phi.cross(&psi);
        Isometry3::from_parts(Translation3::from(translation * real::<T>(2.0)), unit(w, &phi))
    }
    #[inline]
    fn log(&self) -> Vector6<T> {
        let (phi, c) = log_with_coefficient(&self.rotation);
        let t = self.translation.vector;
        let turned = phi.cross(&t);
        joined(&phi, &(t - turned * real::<T>(0.5) + phi.cross(&turned) * c))
    }
    #[inline]
    fn adjoint(&self) -> Matrix6<T> {
        let rotation = self.rotation.adjoint();
        block_lower(&rotation.data.0, &moment_of(&self.translation.vector, &rotation))
    }
    #[inline]
    fn coadjoint(&self) -> Matrix6<T> {
        let rotation = self.rotation.adjoint();
        block_upper(&rotation.data.0, &moment_of(&self.translation.vector, &rotation))
    }
    #[inline]
    fn bracket(a: &Vector6<T>, b: &Vector6<T>) -> Vector6<T> {
        let ((wa, va), (wb, vb)) = (halves(a), halves(b));
        joined(&wa.cross(&wb), &(wa.cross(&vb) + va.cross(&wb)))
    }
    #[inline]
    fn dual_bracket(a: &Vector6<T>, mu: &Vector6<T>) -> Vector6<T> {
        let ((w, v), (torque, force)) = (halves(a), halves(mu));
        joined(&(torque.cross(&w) + force.cross(&v)), &force.cross(&w))
    }
    #[inline]
    fn right_jacobian(xi: &Vector6<T>) -> Matrix6<T> {
        let (phi, rho) = halves(xi);
        let j = series::jacobian(phi.norm_squared());
        jacobian(&phi, &rho, (-j.a, -j.a_rate), (j.b, j.b_rate))
    }
    #[inline]
    fn right_jacobian_inverse(xi: &Vector6<T>) -> Matrix6<T> {
        let (phi, rho) = halves(xi);
        let series::InverseJacobian { c, c_rate } = series::inverse_jacobian(phi.norm_squared());
        jacobian(&phi, &rho, (real(0.5), T::zero()), (c, c_rate))
    }
}

impl<T: Scalar> GroupAction<Vector3<T>> for Isometry3<T> {
    #[inline]
    fn act(&self, point: &Vector3<T>) -> Vector3<T> {
        self.rotation.act(point) + self.translation.vector
    }
}
