use super::inverse_dynamics::GeneralizedForce;
use super::joint::{JointAxis, Placement};
use super::storage::JointStorage;
use super::{Link, Multibody};
use crate::error::DynamicsError;
use tumble_lie::nalgebra::{Matrix6, Rotation3, UnitQuaternion, Vector3, Vector6};
use tumble_lie::{Pose, Scalar, Twist, Wrench, skew};

/// Where every link is in the base frame.
#[derive(Clone, Debug, PartialEq)]
pub struct LinkPlacements<T: Scalar, S: JointStorage> {
    pub(super) base_from_link: S::Of<Placement<T>>,
}

impl<T: Scalar, S: JointStorage> LinkPlacements<T, S> {
    /// Pose of body `index` in the base frame; 0 is the base itself.
    pub fn base_from_body(&self, index: usize) -> Option<Pose<T>> {
        let placement = self.of_body(index)?;
        let rotation = Rotation3::from_matrix_unchecked(placement.rotation);
        Some(Pose::from_parts(placement.offset.into(), UnitQuaternion::from_rotation_matrix(&rotation)))
    }

    pub(super) fn of_body(&self, index: usize) -> Option<Placement<T>> {
        match index.checked_sub(1) {
            None => Some(Placement::identity()),
            Some(link) => self.base_from_link.as_ref().get(link).copied(),
        }
    }
}

/// The twist of a point of a body per unit of generalised velocity.
///
/// # Frame
/// The point's velocity and the body's rate in base axes.
/// # Source
/// Thesis (2.9): `chi_e = J_b chi_b + J_m phidot`.
#[derive(Clone, Debug, PartialEq)]
pub struct ToolJacobian<T: Scalar, S: JointStorage> {
    /// `J_b = [I 0; -S(p) I]`, `p` the point in the base frame.
    pub base: Matrix6<T>,
    /// Columns of `J_m`, one for each joint; zero for joints that do not carry the body.
    pub joints: S::Of<Vector6<T>>,
}

impl<T: Scalar, S: JointStorage> ToolJacobian<T, S> {
    /// Twist of the point at this generalised velocity, base axes.
    pub fn twist(&self, base_twist: &Twist<T>, rates: &[T]) -> Twist<T> {
        let joints = self.joints.as_ref().iter().zip(rates);
        joints.fold(self.base * base_twist.to_vector(), |sum, (column, rate)| sum + column * *rate).into()
    }

    /// The generalised force of a wrench on the body at the point, base axes: the transposed Jacobian.
    pub fn generalized_force(&self, wrench_base: &Wrench<T>) -> GeneralizedForce<T, S> {
        let wrench = wrench_base.to_vector();
        let mut joints = S::filled(self.joints.as_ref().len(), T::zero());
        for (force, column) in joints.as_mut().iter_mut().zip(self.joints.as_ref()) {
            *force = column.dot(&wrench);
        }
        GeneralizedForce { base: (self.base.transpose() * wrench).into(), joints }
    }
}

/// Angular half of a joint's unit twist and the velocity it gives the base frame's origin, base axes.
#[inline(always)]
pub(super) fn unit_twist_base<T: Scalar>(link: &Link<T>, placement: &Placement<T>) -> Twist<T> {
    let axis = placement.rotation * link.joint.axis();
    match link.joint.kind() {
        JointAxis::Revolute => Twist::new(axis, placement.offset.cross(&axis)),
        JointAxis::Prismatic => Twist::new(Vector3::zeros(), axis),
    }
}

impl<T: Scalar, S: JointStorage> Multibody<T, S> {
    /// Where every link is at these joint positions.
    ///
    /// # Errors
    /// [`DynamicsError::JointCount`].
    #[inline]
    pub fn placements(&self, positions: &[T]) -> Result<LinkPlacements<T, S>, DynamicsError> {
        self.check_joints(&[positions])?;
        let mut base_from_link = self.filled(Placement::identity());
        self.place(positions, &mut base_from_link);
        Ok(LinkPlacements { base_from_link })
    }

    #[inline(always)]
    pub(super) fn place(&self, positions: &[T], base_from_link: &mut S::Of<Placement<T>>) {
        for (i, link) in self.links().iter().enumerate() {
            let in_parent = link.joint.placement(positions[i]);
            base_from_link[i] = match link.parent {
                Some(parent) => base_from_link[parent].then(&in_parent),
                None => in_parent,
            };
        }
    }

    /// Jacobian of a point fixed to body `index` (0 the base), given in that body's frame.
    ///
    /// # Errors
    /// [`DynamicsError::JointCount`]; [`DynamicsError::NoSuchBody`].
    pub fn tool_jacobian(
        &self,
        positions: &[T],
        index: usize,
        point_body: &Vector3<T>,
    ) -> Result<ToolJacobian<T, S>, DynamicsError> {
        let placements = self.placements(positions)?;
        let no_such_body = DynamicsError::NoSuchBody { index, bodies: self.bodies() };
        let carrier = placements.of_body(index).ok_or(no_such_body)?;
        let point = carrier.rotation * point_body + carrier.offset;
        let mut base = Matrix6::identity();
        base.fixed_view_mut::<3, 3>(3, 0).copy_from(&-skew(&point));
        let mut joints = self.filled(Vector6::zeros());
        let mut next = index.checked_sub(1);
        while let Some(i) = next {
            let link = &self.links.as_ref()[i];
            let unit = unit_twist_base(link, &placements.base_from_link[i]);
            joints[i] = Twist::new(unit.angular, unit.linear + unit.angular.cross(&point)).to_vector();
            next = link.parent;
        }
        Ok(ToolJacobian { base, joints })
    }

    /// First moment of the whole tree about the base origin, base axes, kg m.
    ///
    /// # Errors
    /// [`DynamicsError::JointCount`].
    pub fn first_moment(&self, positions: &[T]) -> Result<Vector3<T>, DynamicsError> {
        let placements = self.placements(positions)?;
        let links = self.links().iter().zip(placements.base_from_link.as_ref());
        Ok(links.fold(self.base.first_moment, |sum, (link, placement)| {
            sum + placement.rotation * link.body.first_moment + placement.offset * link.body.mass
        }))
    }
}
