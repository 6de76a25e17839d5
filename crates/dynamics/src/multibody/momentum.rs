use super::Multibody;
use super::joint::Placement;
use super::kinematics::unit_twist_base;
use super::mass_matrix::times;
use super::storage::JointStorage;
use crate::error::DynamicsError;
use tumble_lie::{Pose, Scalar, Twist, Wrench, real};

impl<T: Scalar, S: JointStorage> Multibody<T, S> {
    /// Twist of every body in its own axes, about its own origin; body 0 is the base and not in the list.
    ///
    /// # Errors
    /// [`DynamicsError::JointCount`].
    #[inline]
    pub fn link_twists(
        &self,
        base_twist: &Twist<T>,
        positions: &[T],
        rates: &[T],
    ) -> Result<S::Of<Twist<T>>, DynamicsError> {
        let placements = self.placements(positions)?.base_from_link;
        self.check_joints(&[rates])?;
        let mut twists_base = self.filled(Twist::zero());
        let mut twists = self.filled(Twist::zero());
        for (i, link) in self.links().iter().enumerate() {
            let Placement { rotation, offset } = &placements[i];
            let parent = link.parent.map_or(*base_twist, |parent| twists_base[parent]);
            let whole = parent + unit_twist_base(link, &placements[i]) * rates[i];
            twists_base[i] = whole;
            let at_joint = whole.linear + whole.angular.cross(offset);
            twists[i] = Twist::new(rotation.tr_mul(&whole.angular), rotation.tr_mul(&at_joint));
        }
        Ok(twists)
    }

    /// Kinetic energy, rotors included, J.
    ///
    /// # Errors
    /// [`DynamicsError::JointCount`].
    pub fn kinetic_energy(&self, base_twist: &Twist<T>, positions: &[T], rates: &[T]) -> Result<T, DynamicsError> {
        let twists = self.link_twists(base_twist, positions, rates)?;
        let mut twice = base_twist.power(&times(&self.base, base_twist));
        for (i, link) in self.links().iter().enumerate() {
            twice += twists[i].power(&times(&link.body, &twists[i])) + link.joint.rotor_inertia * rates[i] * rates[i];
        }
        Ok(twice * real(0.5))
    }

    /// Momentum of the whole tree about the base origin, base axes, `[angular; linear]`, N m s and N s.
    ///
    /// # Errors
    /// [`DynamicsError::JointCount`].
    pub fn base_momentum(
        &self,
        base_twist: &Twist<T>,
        positions: &[T],
        rates: &[T],
    ) -> Result<Wrench<T>, DynamicsError> {
        let placements = self.placements(positions)?.base_from_link;
        let twists = self.link_twists(base_twist, positions, rates)?;
        let mut sum = times(&self.base, base_twist);
        for (i, link) in self.links().iter().enumerate() {
            let momentum = times(&link.body, &twists[i]);
            let Placement { rotation, offset } = &placements[i];
            let linear = rotation * momentum.force;
            sum += Wrench::new(rotation * momentum.torque + offset.cross(&linear), linear);
        }
        Ok(sum)
    }

    /// Momentum about the inertial origin, inertial axes: constant while nothing acts on the tree.
    ///
    /// # Errors
    /// [`DynamicsError::JointCount`].
    /// # Source
    /// Thesis (3.2).
    /// # Deviation
    /// The thesis writes the momentum about the centre of mass of the system, which is not linear in the parameters
    /// because they place that point; about a fixed point it is.
    pub fn spatial_momentum(
        &self,
        world_from_base: &Pose<T>,
        base_twist: &Twist<T>,
        positions: &[T],
        rates: &[T],
    ) -> Result<Wrench<T>, DynamicsError> {
        Ok(self.base_momentum(base_twist, positions, rates)?.transformed_by(world_from_base))
    }
}
