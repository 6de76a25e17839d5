//! The state of one free rigid body.

use tumble_lie::nalgebra::{SVector, Vector6};
use tumble_lie::{LieGroup, Manifold, Pose, Scalar, Twist};

/// Pose and velocity of a rigid body.
///
/// # Frame
/// `world_from_body` maps body to inertial; the twist is that of the body origin in body axes.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RigidBodyState<T: Scalar> {
    /// Pose of the body frame in the inertial frame.
    pub world_from_body: Pose<T>,
    /// `[omega; v_origin]`, body axes, rad/s and m/s.
    pub twist_body: Twist<T>,
}

impl<T: Scalar> RigidBodyState<T> {
    /// At the inertial origin, at rest.
    pub fn at_rest() -> Self {
        Self { world_from_body: Pose::identity(), twist_body: Twist::zero() }
    }
}

impl<T: Scalar> Manifold for RigidBodyState<T> {
    type Scalar = T;
    /// `[pose increment (angular, linear); twist increment (angular, linear)]`.
    type Tangent = SVector<T, 12>;
    fn oplus(&self, xi: &SVector<T, 12>) -> Self {
        let pose = Vector6::from_fn(|i, _| xi[i]);
        let twist = Vector6::from_fn(|i, _| xi[6 + i]);
        Self { world_from_body: self.world_from_body.oplus(&pose), twist_body: self.twist_body + Twist::from(twist) }
    }
    fn ominus(&self, base: &Self) -> SVector<T, 12> {
        let pose = LieGroup::log(&base.world_from_body.between(&self.world_from_body));
        let twist = (self.twist_body - base.twist_body).to_vector();
        SVector::from_fn(|i, _| if i < 6 { pose[i] } else { twist[i - 6] })
    }
    fn increment_rate(xi: &SVector<T, 12>, velocity: &SVector<T, 12>) -> SVector<T, 12> {
        let pose = Pose::increment_rate(&Vector6::from_fn(|i, _| xi[i]), &Vector6::from_fn(|i, _| velocity[i]));
        SVector::from_fn(|i, _| if i < 6 { pose[i] } else { velocity[i] })
    }
}
