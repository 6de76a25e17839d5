use super::Multibody;
use super::joint::{JointAxis, Placement};
use super::storage::JointStorage;
use crate::error::DynamicsError;
use crate::free_flyer::BodyAcceleration;
use crate::inertia::InertialParameters;
use tumble_lie::nalgebra::Vector3;
use tumble_lie::{Scalar, Twist, Wrench};

/// Positions, velocities and accelerations of a tree at one instant.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct GeneralizedMotion<'a, T: Scalar> {
    /// Twist of the base origin, base axes.
    pub base_twist: Twist<T>,
    /// Acceleration of the base relative to free fall (what an ideal accelerometer at its origin reads), base axes.
    pub base_acceleration: BodyAcceleration<T>,
    /// Joint positions, rad or m.
    pub positions: &'a [T],
    /// Joint rates, rad/s or m/s.
    pub rates: &'a [T],
    /// Joint accelerations, rad/s^2 or m/s^2.
    pub accelerations: &'a [T],
}

/// Wrench on the base and a force or torque in each joint.
#[derive(Clone, Debug, PartialEq)]
pub struct GeneralizedForce<T: Scalar, S: JointStorage> {
    /// On the base, base axes, torque about its origin, N m and N.
    pub base: Wrench<T>,
    /// Of the joints' motors, N m or N.
    pub joints: S::Of<T>,
}

impl<T: Scalar, S: JointStorage> GeneralizedForce<T, S> {
    /// No force, for this tree.
    pub fn zero(tree: &Multibody<T, S>) -> Self {
        Self { base: Wrench::zero(), joints: tree.filled(T::zero()) }
    }

    /// The sum of two.
    #[must_use]
    pub fn plus(mut self, other: &Self) -> Self {
        self.base += other.base;
        for (sum, more) in self.joints.as_mut().iter_mut().zip(other.joints.as_ref()) {
            *sum += *more;
        }
        self
    }
}

/// Velocity and acceleration of one body, its own axes; acceleration of the origin relative to free fall.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct BodyMotion<T: Scalar> {
    pub rate: Vector3<T>,
    pub angular_acceleration: Vector3<T>,
    pub acceleration_origin: Vector3<T>,
}

impl<T: Scalar> BodyMotion<T> {
    pub fn zero() -> Self {
        Self { rate: Vector3::zeros(), angular_acceleration: Vector3::zeros(), acceleration_origin: Vector3::zeros() }
    }

    /// Inertial acceleration of a point fixed in the body.
    #[inline(always)]
    pub fn acceleration_of(&self, point: &Vector3<T>) -> Vector3<T> {
        self.acceleration_origin + self.angular_acceleration.cross(point) + self.rate.cross(&self.rate.cross(point))
    }

    /// The wrench that moves `body` so, about its origin (4.1).
    #[inline(always)]
    pub fn wrench(&self, body: &InertialParameters<T>) -> Wrench<T> {
        let (w, h) = (&self.rate, &body.first_moment);
        Wrench::new(
            body.inertia_about_origin * self.angular_acceleration
                + w.cross(&(body.inertia_about_origin * w))
                + h.cross(&self.acceleration_origin),
            self.acceleration_origin * body.mass + self.angular_acceleration.cross(h) + w.cross(&w.cross(h)),
        )
    }
}

/// What one pass to the tips finds.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Moving<T: Scalar> {
    pub parent_from_link: Placement<T>,
    pub motion: BodyMotion<T>,
}

impl<T: Scalar, S: JointStorage> Multibody<T, S> {
    /// Motion of every link, from the base to the tips.
    #[inline(always)]
    pub(super) fn link_motions(&self, motion: &GeneralizedMotion<'_, T>) -> Result<S::Of<Moving<T>>, DynamicsError> {
        self.check_joints(&[motion.positions, motion.rates, motion.accelerations])?;
        let base = motion.base();
        let mut links = self.filled(Moving { parent_from_link: Placement::identity(), motion: BodyMotion::zero() });
        for (i, link) in self.links().iter().enumerate() {
            let (position, rate, acceleration) = (motion.positions[i], motion.rates[i], motion.accelerations[i]);
            let parent = link.parent.map_or(base, |parent| links[parent].motion);
            let parent_from_link = link.joint.placement(position);
            let turned = |v: &Vector3<T>| parent_from_link.rotation.tr_mul(v);
            let (carried_rate, axis) = (turned(&parent.rate), link.joint.axis());
            let carried_angular = turned(&parent.angular_acceleration);
            let carried_linear = turned(&parent.acceleration_of(&parent_from_link.offset));
            let along = axis * rate;
            let own = match link.joint.kind() {
                JointAxis::Revolute => BodyMotion {
                    rate: carried_rate + along,
                    angular_acceleration: carried_angular + axis * acceleration + carried_rate.cross(&along),
                    acceleration_origin: carried_linear,
                },
                JointAxis::Prismatic => BodyMotion {
                    rate: carried_rate,
                    angular_acceleration: carried_angular,
                    acceleration_origin: carried_linear + axis * acceleration + carried_rate.cross(&(along + along)),
                },
            };
            links[i] = Moving { parent_from_link, motion: own };
        }
        Ok(links)
    }

    /// Wrench on the base and forces of the motors that give this motion, springs, dampers and rotors accounted for.
    ///
    /// On a fixed base (base twist zero, base acceleration minus gravity) the wrench is what the mounting gives.
    /// # Errors
    /// [`DynamicsError::JointCount`].
    /// # Source
    /// Thesis (2.10), by the recursive Newton-Euler algorithm.
    #[inline]
    pub fn inverse_dynamics(&self, motion: &GeneralizedMotion<'_, T>) -> Result<GeneralizedForce<T, S>, DynamicsError> {
        let links = self.link_motions(motion)?;
        let mut base = motion.base().wrench(&self.base);
        let mut carried = self.filled(Wrench::<T>::zero());
        let mut joints = self.filled(T::zero());
        for (i, link) in self.tips_first() {
            let wrench = links[i].motion.wrench(&link.body) + carried[i];
            let along = match link.joint.kind() {
                JointAxis::Revolute => link.joint.axis().dot(&wrench.torque),
                JointAxis::Prismatic => link.joint.axis().dot(&wrench.force),
            };
            joints[i] = along + link.joint.rotor_inertia * motion.accelerations[i]
                - link.joint.passive_force(motion.positions[i], motion.rates[i]);
            let Placement { rotation, offset } = &links[i].parent_from_link;
            let force = rotation * wrench.force;
            let onto = Wrench::new(rotation * wrench.torque + offset.cross(&force), force);
            match link.parent {
                Some(parent) => carried[parent] += onto,
                None => base += onto,
            }
        }
        Ok(GeneralizedForce { base, joints })
    }
}

impl<T: Scalar> GeneralizedMotion<'_, T> {
    #[inline(always)]
    pub(super) fn base(&self) -> BodyMotion<T> {
        BodyMotion {
            rate: self.base_twist.angular,
            angular_acceleration: self.base_acceleration.angular_acceleration_body,
            acceleration_origin: self.base_acceleration.acceleration_origin_body,
        }
    }
}
