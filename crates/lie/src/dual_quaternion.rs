//! Unit dual quaternions as a Lie group: `p = q + (eps/2) l o q`, rotation `q`, position `l` in the outer frame.
//!
//! Tangent order `[angular; linear]`: `exp` is the exponential of the dual quaternion `(w + eps v) / 2`, so a unit dual
//! quaternion and the [`Pose`] it stands for have the same tangents, adjoints and Jacobians.
//!
//! # Source
//! (5.1)-(5.6)
//! # Deviation
//! The first term of the product (5.3) is `q1a o q2a`, not the square of `q1a` (test `representations_agree`).

use crate::group::{GroupAction, LieGroup};
use crate::scalar::{Scalar, real};
use crate::se3::{Pose, exponential};
use crate::spatial::Twist;
use nalgebra::{
    DualQuaternion, Isometry3, Matrix6, Quaternion, Translation3, UnitDualQuaternion, UnitQuaternion, Vector3, Vector6,
};

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

/// The pose `p` stands for: `l = 2 vec(p_dual o p_real*)`.
#[inline(always)]
fn pose_of<T: Scalar>(p: &UnitDualQuaternion<T>) -> Pose<T> {
    let (q, d) = (&p.real, &p.dual);
    let (v, psi) = (Vector3::new(q.i, q.j, q.k), Vector3::new(d.i, d.j, d.k));
    let l = psi * q.w - v * d.w + v.cross(&psi);
    Isometry3::from_parts(Translation3::from(l * real::<T>(2.0)), UnitQuaternion::new_unchecked(*q))
}

impl<T: Scalar> LieGroup for UnitDualQuaternion<T> {
    type Scalar = T;
    type Tangent = Vector6<T>;
    type Jacobian = Matrix6<T>;
    fn identity() -> Self {
        UnitDualQuaternion::identity()
    }
    #[inline]
    fn inverse(&self) -> Self {
        self.conjugate()
    }
    #[inline]
    fn exp(xi: &Vector6<T>) -> Self {
        let ((w, phi), (f_b0, psi)) = exponential(xi);
        UnitDualQuaternion::new_unchecked(DualQuaternion::from_real_and_dual(
            Quaternion::new(w, phi.x, phi.y, phi.z),
            Quaternion::new(f_b0, psi.x, psi.y, psi.z),
        ))
    }
    #[inline]
    fn log(&self) -> Vector6<T> {
        pose_of(self).log()
    }
    #[inline]
    fn adjoint(&self) -> Matrix6<T> {
        pose_of(self).adjoint()
    }
    #[inline]
    fn coadjoint(&self) -> Matrix6<T> {
        pose_of(self).coadjoint()
    }
    #[inline]
    fn bracket(a: &Vector6<T>, b: &Vector6<T>) -> Vector6<T> {
        Pose::bracket(a, b)
    }
    #[inline]
    fn dual_bracket(a: &Vector6<T>, mu: &Vector6<T>) -> Vector6<T> {
        Pose::dual_bracket(a, mu)
    }
    #[inline]
    fn right_jacobian(xi: &Vector6<T>) -> Matrix6<T> {
        Pose::right_jacobian(xi)
    }
    #[inline]
    fn right_jacobian_inverse(xi: &Vector6<T>) -> Matrix6<T> {
        Pose::right_jacobian_inverse(xi)
    }
}

impl<T: Scalar> GroupAction<Vector3<T>> for UnitDualQuaternion<T> {
    #[inline]
    fn act(&self, point: &Vector3<T>) -> Vector3<T> {
        pose_of(self).act(point)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use approx::assert_relative_eq;
    use num_dual::Dual64;

    /// (5.4) from its own terms: `p = q + (eps/2) l o q`.
    #[test]
    fn pose_is_rotation_and_half_the_position() {
        let xi = Vector6::new(0.3, -0.4, 0.7, 1.0, -2.0, 0.5);
        let p = <UnitDualQuaternion<f64> as LieGroup>::exp(&xi);
        let pose = <Isometry3<f64> as LieGroup>::exp(&xi);
        assert_relative_eq!(p.real, pose.rotation.into_inner(), epsilon = 1e-15);
        let l = Quaternion::from_imag(pose.translation.vector);
        assert_relative_eq!(p.dual, l * pose.rotation.into_inner() * 0.5, epsilon = 1e-15);
        assert_relative_eq!(p.to_isometry(), pose, epsilon = 1e-15);
    }

    /// (5.8): along `l(t)`, `q(t)` the twist is the body rate and the velocity of the origin in body axes.
    #[test]
    fn twist_of_a_moving_pose() {
        let (w, v_world) = (Vector3::new(0.3, -0.2, 0.5), Vector3::new(0.1, 0.7, -0.4));
        let q = <UnitQuaternion<f64> as LieGroup>::exp(&Vector3::new(0.4, 0.9, -1.2));
        let l = Vector3::new(1.0, -2.0, 3.0);
        let t = Dual64::new(0.0, 1.0);
        let moving = Isometry3::from_parts(
            Translation3::from(l.zip_map(&v_world, |x, v| Dual64::from(x) + t * v)),
            q.cast::<Dual64>() * <UnitQuaternion<Dual64> as LieGroup>::exp(&w.map(|x| t * x)),
        );
        let p = UnitDualQuaternion::from_isometry(&moving);
        let derivative = |q: &Quaternion<Dual64>| Quaternion::from_vector(q.coords.map(|c| c.eps));
        let rate = DualQuaternion::from_real_and_dual(derivative(&p.real), derivative(&p.dual));
        let pose = UnitDualQuaternion::from_isometry(&Isometry3::from_parts(Translation3::from(l), q));
        let twist = twist_body_from_rate(&pose, &rate);
        assert_relative_eq!(twist.angular, w, epsilon = 1e-15);
        assert_relative_eq!(twist.linear, q.inverse() * v_world, epsilon = 1e-15);
        let back = rate_from_twist_body(&pose, &twist);
        assert_relative_eq!(back, rate, epsilon = 1e-15);
    }
}
