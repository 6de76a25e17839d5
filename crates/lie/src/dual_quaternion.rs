//! Unit dual quaternions as a Lie group: `p = q + (eps/2) l o q`, rotation `q`, position `l` in the outer frame.
//!
//! Tangent order `[angular; linear]`: `exp` is the exponential of the dual quaternion `(w + eps v) / 2`, so a unit dual
//! quaternion and the [`Pose`](crate::Pose) it stands for have the same tangents, adjoints and Jacobians.

use crate::group::{GroupAction, LieGroup};
use crate::scalar::{Scalar, real};
use crate::se3::Pose;
use crate::spatial::Twist;
use nalgebra::{DualQuaternion, Isometry3, Matrix6, Quaternion, UnitDualQuaternion, Vector3, Vector6};

/// The velocity of the body that moves along `pose(t)` with the time derivative `pose_rate`: `2 p* o pdot = w + eps v`.
///
/// # Frame
/// Both halves in body axes; `linear` is the velocity of the body origin.
/// # Source
/// (5.8)
pub fn twist_body_from_rate<T: Scalar>(pose: &UnitDualQuaternion<T>, pose_rate: &DualQuaternion<T>) -> Twist<T> {
    let twist = pose.conjugate().into_inner() * *pose_rate;
    let two = real::<T>(2.0);
    Twist::new(twist.real.imag() * two, twist.dual.imag() * two)
}

/// The time derivative of `pose(t)` for a body with velocity `twist_body`: `pdot = p o (w + eps v) / 2`.
///
/// # Source
/// (5.8)
pub fn rate_from_twist_body<T: Scalar>(pose: &UnitDualQuaternion<T>, twist_body: &Twist<T>) -> DualQuaternion<T> {
    let half = real::<T>(0.5);
    **pose
        * DualQuaternion::from_real_and_dual(
            Quaternion::from_imag(twist_body.angular * half),
            Quaternion::from_imag(twist_body.linear * half),
        )
}

impl<T: Scalar> LieGroup for UnitDualQuaternion<T> {
    type Scalar = T;
    type Tangent = Vector6<T>;
    type Jacobian = Matrix6<T>;
    fn identity() -> Self {
        UnitDualQuaternion::identity()
    }
    fn inverse(&self) -> Self {
        self.conjugate()
    }
    fn exp(xi: &Vector6<T>) -> Self {
        UnitDualQuaternion::from_isometry(&<Isometry3<T> as LieGroup>::exp(xi))
    }
    fn log(&self) -> Vector6<T> {
        LieGroup::log(&self.to_isometry())
    }
    fn adjoint(&self) -> Matrix6<T> {
        self.to_isometry().adjoint()
    }
    fn coadjoint(&self) -> Matrix6<T> {
        self.to_isometry().coadjoint()
    }
    fn bracket(a: &Vector6<T>, b: &Vector6<T>) -> Vector6<T> {
        Pose::bracket(a, b)
    }
    fn dual_bracket(a: &Vector6<T>, mu: &Vector6<T>) -> Vector6<T> {
        Pose::dual_bracket(a, mu)
    }
    fn right_jacobian(xi: &Vector6<T>) -> Matrix6<T> {
        Pose::right_jacobian(xi)
    }
    fn right_jacobian_inverse(xi: &Vector6<T>) -> Matrix6<T> {
        Pose::right_jacobian_inverse(xi)
    }
}

impl<T: Scalar> GroupAction<Vector3<T>> for UnitDualQuaternion<T> {
    fn act(&self, point: &Vector3<T>) -> Vector3<T> {
        self.rotation() * point + self.translation().vector
    }
}
