//! Trees of rigid bodies: a base and links, each on one revolute or prismatic joint, on a free or a fixed base.
//!
//! Generalised velocity `[omega_base; v_base; joint rates]`: the twist of the base origin in base axes, then one number
//! a joint. Generalised acceleration `[omega'; R^T d2l/dt2; joint accelerations]` with the *inertial* acceleration of the
//! base origin in base axes, as everywhere in this crate; the bias then does not depend on the velocity of the base.
//!
//! A free base accelerates and gravity pulls in the same way: wherever a base acceleration enters or leaves, it is
//! the one *relative to free fall*, what an ideal accelerometer at the base origin reads. Without gravity that is the
//! inertial acceleration.
//!
//! # Source
//! Thesis (2.9), (2.10), (3.2).

mod forward_dynamics;
mod free_floating;
mod inverse_dynamics;
mod joint;
mod kinematics;
mod mass_matrix;
mod momentum;
mod regressor;
mod storage;
#[cfg(feature = "dual")]
mod system;

pub use forward_dynamics::GeneralizedAcceleration;
pub use inverse_dynamics::{GeneralizedForce, GeneralizedMotion};
pub use joint::{Joint, JointAxis};
pub use kinematics::{LinkPlacements, ToolJacobian};
pub use mass_matrix::MassMatrix;
pub use regressor::{MomentumRegressor, TorqueRegressor};
pub use storage::{Dynamic, Fixed, JointStorage};
#[cfg(feature = "dual")]
pub use system::{FixedMultibody, FreeConfiguration, FreeInput, FreeMultibody, JointedBodies, MultibodyStep};

use crate::error::DynamicsError;
use crate::inertia::InertialParameters;
use core::fmt::Debug;
use tumble_lie::nalgebra::Vector3;
use tumble_lie::{Scalar, real};

/// A body of a tree and the joint that carries it.
///
/// # Frame
/// The link frame has its origin on the joint and moves with the link; `body` is about that origin.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Link<T: Scalar> {
    /// What the joint sits on: an earlier link, or the base.
    pub parent: Option<usize>,
    /// The joint.
    pub joint: Joint<T>,
    /// The ten parameters, link frame.
    pub body: InertialParameters<T>,
}

/// A base and the links on it.
///
/// With [`Fixed`] storage the number of joints is part of the type, nothing is allocated, and the tree is `Copy`; with
/// [`Dynamic`] storage (the default) it is read from a file.
///
/// ```
/// use tumble_dynamics::lie::{Pose, Twist};
/// use tumble_dynamics::nalgebra::{Matrix3, Vector3};
/// use tumble_dynamics::{Fixed, GeneralizedForce, InertialParameters, Joint, Link, Multibody};
/// let ball = |kg: f64, at: f64| {
///     InertialParameters::about_com(kg, Vector3::new(at, 0.0, 0.0), Matrix3::identity() * (0.01 * kg))
/// };
/// let elbow = Joint::revolute(Vector3::z(), Pose::translation(0.2, 0.0, 0.0))?;
/// let arm = Multibody::<f64, Fixed<1>>::try_new(
///     ball(9.0, 0.0), [Link { parent: None, joint: elbow, body: ball(1.0, 0.3) }])?;
/// // a torque in the joint turns the base the other way
/// let mut force = GeneralizedForce::zero(&arm);
/// force.joints[0] = 0.1;
/// let acceleration = arm.forward_dynamics(&Twist::zero(), &[0.0], &[0.0], &force)?;
/// assert!(acceleration.joints[0] > 0.0 && acceleration.base.angular_acceleration_body.z < 0.0);
/// # Ok::<(), tumble_dynamics::DynamicsError>(())
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Multibody<T: Scalar, S: JointStorage = Dynamic> {
    base: InertialParameters<T>,
    links: S::Of<Link<T>>,
}

impl<T: Scalar, S: JointStorage> Multibody<T, S> {
    /// The tree of these bodies.
    ///
    /// Bodies need not be consistent here: an estimator may ask what a tree of its best numbers would do.
    /// # Errors
    /// [`DynamicsError::LinkOrder`] where a link hangs on itself or a later one.
    pub fn try_new(base: InertialParameters<T>, links: S::Of<Link<T>>) -> Result<Self, DynamicsError> {
        let misplaced = links.as_ref().iter().enumerate().find(|(i, link)| link.parent.is_some_and(|p| p >= *i));
        match misplaced {
            Some((link, _)) => Err(DynamicsError::LinkOrder { link }),
            None => Ok(Self { base, links }),
        }
    }

    /// The base body, base frame.
    pub fn base(&self) -> &InertialParameters<T> {
        &self.base
    }

    /// The links, parents first.
    pub fn links(&self) -> &[Link<T>] {
        self.links.as_ref()
    }

    /// Number of joints, and of links.
    pub fn joints(&self) -> usize {
        self.links().len()
    }

    /// Number of bodies: the base and the links. Body 0 is the base, body `i + 1` is link `i`.
    pub fn bodies(&self) -> usize {
        self.joints() + 1
    }

    /// The parameters of body `index`; 0 is the base.
    pub fn body(&self, index: usize) -> Option<&InertialParameters<T>> {
        match index.checked_sub(1) {
            None => Some(&self.base),
            Some(link) => self.links().get(link).map(|link| &link.body),
        }
    }

    /// The same tree with another body; `index` 0 is the base, a larger one than [`Multibody::joints`] changes nothing.
    #[must_use]
    pub fn with_body(mut self, index: usize, body: InertialParameters<T>) -> Self {
        match index.checked_sub(1) {
            None => self.base = body,
            Some(link) => {
                if let Some(link) = self.links.as_mut().get_mut(link) {
                    link.body = body;
                }
            }
        }
        self
    }

    /// Total mass, kg.
    pub fn mass(&self) -> T {
        self.links().iter().fold(self.base.mass, |sum, link| sum + link.body.mass)
    }

    /// The links with their indices, tips first.
    fn tips_first(&self) -> impl Iterator<Item = (usize, &Link<T>)> {
        self.links().iter().enumerate().rev()
    }

    /// One value a joint.
    fn filled<X: Copy + Debug + PartialEq>(&self, value: X) -> S::Of<X> {
        S::filled(self.joints(), value)
    }

    /// An error unless each list has one number a joint.
    fn check_joints(&self, lists: &[&[T]]) -> Result<(), DynamicsError> {
        let expected = self.joints();
        match lists.iter().find(|list| list.len() != expected) {
            Some(list) => Err(DynamicsError::JointCount { expected, found: list.len() }),
            None => Ok(()),
        }
    }

    /// Energy of gravity and of the springs, zero with the base origin at the inertial origin and springs at rest, J.
    ///
    /// # Errors
    /// [`DynamicsError::JointCount`].
    pub fn potential_energy(
        &self,
        world_from_base: &tumble_lie::Pose<T>,
        positions: &[T],
        gravity_world: &Vector3<T>,
    ) -> Result<T, DynamicsError> {
        let first_moment_world =
            world_from_base.rotation * self.first_moment(positions)? + world_from_base.translation.vector * self.mass();
        let springs = self.links().iter().zip(positions).fold(T::zero(), |sum, (link, q)| {
            let stretch = *q - link.joint.rest_position;
            sum + link.joint.stiffness * stretch * stretch * real(0.5)
        });
        Ok(springs - gravity_world.dot(&first_moment_world))
    }
}

#[cfg(test)]
mod golden;
