//! SE(3) on `Isometry3` (unit quaternion and translation). Tangent order `[angular; linear]`.

use crate::group::{GroupAction, LieGroup};
use crate::quaternion::{polynomial_in_skew, rotation_jacobian};
use crate::scalar::{Scalar, real};
use crate::series;
use crate::skew::skew;
use nalgebra::{Isometry3, Matrix3, Matrix6, Translation3, UnitQuaternion, Vector3, Vector6};

/// A rigid displacement; named by its frames, `world_from_body`.
pub type Pose<T> = Isometry3<T>;

#[inline(always)]
fn halves<T: Scalar>(xi: &Vector6<T>) -> (Vector3<T>, Vector3<T>) {
    (Vector3::new(xi[0], xi[1], xi[2]), Vector3::new(xi[3], xi[4], xi[5]))
}

#[inline(always)]
fn joined<T: Scalar>(angular: &Vector3<T>, linear: &Vector3<T>) -> Vector6<T> {
    Vector6::new(angular.x, angular.y, angular.z, linear.x, linear.y, linear.z)
}

/// `[[diagonal, 0], [lower, diagonal]]`
#[inline(always)]
fn block_lower<T: Scalar>(diagonal: &Matrix3<T>, lower: &Matrix3<T>) -> Matrix6<T> {
    let mut m = Matrix6::zeros();
    m.fixed_view_mut::<3, 3>(0, 0).copy_from(diagonal);
    m.fixed_view_mut::<3, 3>(3, 3).copy_from(diagonal);
    m.fixed_view_mut::<3, 3>(3, 0).copy_from(lower);
    m
}

/// Directional derivative along `rho` of `unit I + f(s) S(phi) + g(s) S(phi)^2`, `s = |phi|^2`.
///
/// SE(3) is SO(3) over the dual numbers, so this is the lower left block of the Jacobians of SE(3).
#[inline(always)]
fn derivative_of_polynomial<T: Scalar>(phi: &Vector3<T>, rho: &Vector3<T>, f: (T, T), g: (T, T)) -> Matrix3<T> {
    let dot = phi.dot(rho);
    let s_rate = dot * real(2.0);
    let outer = phi * rho.transpose();
    let mut m = polynomial_in_skew(phi, -g.0 * s_rate, f.1 * s_rate, g.1 * s_rate) + (outer + outer.transpose()) * g.0;
    m += skew(rho) * f.0;
    m
}

impl<T: Scalar> LieGroup for Isometry3<T> {
    type Scalar = T;
    type Tangent = Vector6<T>;
    type Jacobian = Matrix6<T>;
    fn identity() -> Self {
        Isometry3::identity()
    }
    fn inverse(&self) -> Self {
        Isometry3::inverse(self)
    }
    fn exp(xi: &Vector6<T>) -> Self {
        let (phi, rho) = halves(xi);
        let rotation = <UnitQuaternion<T> as LieGroup>::exp(&phi);
        Isometry3::from_parts(Translation3::from(rotation_jacobian(&-phi) * rho), rotation)
    }
    fn log(&self) -> Vector6<T> {
        let phi = LieGroup::log(&self.rotation);
        joined(&phi, &(crate::quaternion::rotation_jacobian_inverse(&-phi) * self.translation.vector))
    }
    fn adjoint(&self) -> Matrix6<T> {
        let rotation = self.rotation.to_rotation_matrix().into_inner();
        block_lower(&rotation, &(skew(&self.translation.vector) * rotation))
    }
    fn coadjoint(&self) -> Matrix6<T> {
        let rotation = self.rotation.to_rotation_matrix().into_inner();
        block_lower(&rotation, &(skew(&self.translation.vector) * rotation)).transpose_blocks()
    }
    fn bracket(a: &Vector6<T>, b: &Vector6<T>) -> Vector6<T> {
        let ((wa, va), (wb, vb)) = (halves(a), halves(b));
        joined(&wa.cross(&wb), &(wa.cross(&vb) + va.cross(&wb)))
    }
    fn dual_bracket(a: &Vector6<T>, mu: &Vector6<T>) -> Vector6<T> {
        let ((w, v), (torque, force)) = (halves(a), halves(mu));
        joined(&(torque.cross(&w) + force.cross(&v)), &force.cross(&w))
    }
    fn right_jacobian(xi: &Vector6<T>) -> Matrix6<T> {
        let (phi, rho) = halves(xi);
        let ((a, b), (a_rate, b_rate)) = series::jacobian_with_rates(phi.norm_squared());
        block_lower(
            &polynomial_in_skew(&phi, T::one(), -a, b),
            &derivative_of_polynomial(&phi, &rho, (-a, -a_rate), (b, b_rate)),
        )
    }
    fn right_jacobian_inverse(xi: &Vector6<T>) -> Matrix6<T> {
        let (phi, rho) = halves(xi);
        let c = series::inverse_jacobian_with_rate(phi.norm_squared());
        let half = real::<T>(0.5);
        block_lower(
            &polynomial_in_skew(&phi, T::one(), half, c.0),
            &derivative_of_polynomial(&phi, &rho, (half, T::zero()), c),
        )
    }
}

/// Swaps the off-diagonal 3x3 blocks: `Ad* = [[R, S(t) R], [0, R]]` from `Ad = [[R, 0], [S(t) R, R]]`.
trait TransposeBlocks {
    fn transpose_blocks(self) -> Self;
}
impl<T: Scalar> TransposeBlocks for Matrix6<T> {
    fn transpose_blocks(mut self) -> Self {
        let lower = self.fixed_view::<3, 3>(3, 0).into_owned();
        let upper = self.fixed_view::<3, 3>(0, 3).into_owned();
        self.fixed_view_mut::<3, 3>(0, 3).copy_from(&lower);
        self.fixed_view_mut::<3, 3>(3, 0).copy_from(&upper);
        self
    }
}

impl<T: Scalar> GroupAction<Vector3<T>> for Isometry3<T> {
    fn act(&self, point: &Vector3<T>) -> Vector3<T> {
        self.rotation * point + self.translation.vector
    }
}
