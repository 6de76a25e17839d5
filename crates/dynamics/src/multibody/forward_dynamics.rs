use super::inverse_dynamics::GeneralizedForce;
use super::joint::{JointAxis, Placement, congruent};
use super::storage::JointStorage;
use super::{Link, Multibody};
use crate::error::DynamicsError;
use crate::free_flyer::{BodyAcceleration, inverse_of_symmetric};
use crate::inertia::InertialParameters;
use tumble_lie::nalgebra::{Matrix3, Vector3};
use tumble_lie::{Scalar, Twist, Wrench, skew};

/// Accelerations of the base and of the joints.
#[derive(Clone, Debug, PartialEq)]
pub struct GeneralizedAcceleration<T: Scalar, S: JointStorage> {
    /// Of the base relative to free fall, base axes.
    pub base: BodyAcceleration<T>,
    /// Of the joints, rad/s^2 or m/s^2.
    pub joints: S::Of<T>,
}

/// What a body and all it carries resist an acceleration of its origin with: `wrench = inertia A + bias`.
///
/// Blocks of the symmetric 6x6 matrix `[rotary coupling; coupling^T linear]`.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Articulated<T: Scalar> {
    rotary: Matrix3<T>,
    coupling: Matrix3<T>,
    linear: Matrix3<T>,
    bias: Wrench<T>,
}

impl<T: Scalar> Articulated<T> {
    /// One rigid body that turns at `rate`.
    #[inline(always)]
    fn rigid(body: &InertialParameters<T>, rate: &Vector3<T>) -> Self {
        let h = &body.first_moment;
        Self {
            rotary: body.inertia_about_origin,
            coupling: skew(h),
            linear: Matrix3::from_diagonal_element(body.mass),
            bias: Wrench::new(rate.cross(&(body.inertia_about_origin * rate)), rate.cross(&rate.cross(h))),
        }
    }

    #[inline(always)]
    fn add(&mut self, other: &Self) {
        self.rotary += other.rotary;
        self.coupling += other.coupling;
        self.linear += other.linear;
        self.bias += other.bias;
    }

    /// Inertia times an acceleration.
    #[inline(always)]
    fn times(&self, angular: &Vector3<T>, linear: &Vector3<T>) -> Wrench<T> {
        Wrench::new(
            self.rotary * angular + self.coupling * linear,
            self.coupling.tr_mul(angular) + self.linear * linear,
        )
    }

    /// The acceleration of the origin under this wrench; not finite for a singular inertia.
    #[inline(always)]
    fn accelerated_by(&self, wrench: &Wrench<T>) -> BodyAcceleration<T> {
        let compliance = inverse_of_symmetric(&self.linear);
        let free = *wrench - self.bias;
        let lever = self.coupling * compliance;
        let rotary = inverse_of_symmetric(&(self.rotary - lever * self.coupling.transpose()));
        let angular = rotary * (free.torque - lever * free.force);
        BodyAcceleration {
            angular_acceleration_body: angular,
            acceleration_origin_body: compliance * (free.force - self.coupling.tr_mul(&angular)),
        }
    }

    /// The same seen from the parent's origin and axes.
    #[inline(always)]
    fn seen_from_parent(&self, placement: &Placement<T>) -> Self {
        let (r, p) = (&placement.rotation, &placement.offset);
        let (linear, coupling) = (congruent(r, &self.linear), r * self.coupling * r.transpose());
        // H + S(p) M, and J + S(p) H^T + (S(p) H^T)^T - S(p) M S(p), of which the middle is `lever + lever^T`
        let moved_coupling = coupling + arm(p, &linear);
        let lever = arm(p, &coupling.transpose());
        let rotary = congruent(r, &self.rotary) + lever.transpose() + arm(p, &moved_coupling.transpose());
        let force = r * self.bias.force;
        Self {
            rotary,
            coupling: moved_coupling,
            linear,
            bias: Wrench::new(r * self.bias.torque + p.cross(&force), force),
        }
    }
}

/// `S(p) M`
#[inline(always)]
fn arm<T: Scalar>(p: &Vector3<T>, m: &Matrix3<T>) -> Matrix3<T> {
    let column = |k: usize| p.cross(&m.column(k));
    Matrix3::from_columns(&[column(0), column(1), column(2)])
}

/// What the second pass of the articulated-body algorithm leaves for the third.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Hinge<T: Scalar> {
    /// Inertia times the unit acceleration of the joint.
    column: Wrench<T>,
    /// One over the inertia that the motor feels.
    inverse: T,
    /// The motor's force less what the bias asks for.
    surplus: T,
}

impl<T: Scalar, S: JointStorage> Multibody<T, S> {
    /// Accelerations that these forces of motors and wrench on the base give a free tree.
    ///
    /// Springs, dampers and rotors act besides. Linear in the number of joints (articulated-body algorithm).
    /// # Errors
    /// [`DynamicsError::JointCount`]; [`DynamicsError::NotFinite`] for bodies without inertia.
    /// # Source
    /// Thesis (2.10).
    #[inline]
    pub fn forward_dynamics(
        &self,
        base_twist: &Twist<T>,
        positions: &[T],
        rates: &[T],
        force: &GeneralizedForce<T, S>,
    ) -> Result<GeneralizedAcceleration<T, S>, DynamicsError> {
        self.articulated(base_twist, positions, rates, force, |whole| whole.accelerated_by(&force.base))
    }

    /// Accelerations of the joints on a base whose acceleration (relative to free fall) is given: on a fixed base minus
    /// gravity, base axes. The wrench on the base in `force` is not used.
    ///
    /// # Errors
    /// [`DynamicsError::JointCount`]; [`DynamicsError::NotFinite`] for bodies without inertia.
    #[inline]
    pub fn forward_dynamics_on_base(
        &self,
        base_twist: &Twist<T>,
        base_acceleration: &BodyAcceleration<T>,
        positions: &[T],
        rates: &[T],
        force: &GeneralizedForce<T, S>,
    ) -> Result<GeneralizedAcceleration<T, S>, DynamicsError> {
        self.articulated(base_twist, positions, rates, force, |_| *base_acceleration)
    }

    #[inline(always)]
    fn articulated(
        &self,
        base_twist: &Twist<T>,
        positions: &[T],
        rates: &[T],
        force: &GeneralizedForce<T, S>,
        base_acceleration: impl FnOnce(&Articulated<T>) -> BodyAcceleration<T>,
    ) -> Result<GeneralizedAcceleration<T, S>, DynamicsError> {
        self.check_joints(&[positions, rates, force.joints.as_ref()])?;
        let drifts = self.drifts(&base_twist.angular, positions, rates);
        let mut whole = Articulated::rigid(&self.base, &base_twist.angular);
        let mut bodies = self.filled(whole);
        for (i, link) in self.links().iter().enumerate() {
            bodies[i] = Articulated::rigid(&link.body, &drifts[i].rate);
        }
        let nothing = Hinge { column: Wrench::zero(), inverse: T::zero(), surplus: T::zero() };
        let mut hinges = self.filled(nothing);
        for (i, link) in self.tips_first() {
            let mut body = bodies[i];
            let hinge = unlocked(link, &body, force.joints[i] + link.joint.passive_force(positions[i], rates[i]));
            hinges[i] = hinge;
            let Drift { parent_from_link, angular, linear, .. } = &drifts[i];
            let Hinge { column, inverse, surplus } = hinge;
            body.rotary -= column.torque * (column.torque * inverse).transpose();
            body.coupling -= column.torque * (column.force * inverse).transpose();
            body.linear -= column.force * (column.force * inverse).transpose();
            body.bias += body.times(angular, linear) + column * (inverse * surplus);
            let seen = body.seen_from_parent(parent_from_link);
            link.parent.map_or(&mut whole, |parent| &mut bodies[parent]).add(&seen);
        }
        let base = base_acceleration(&whole);
        let mut accelerations = self.filled((Vector3::zeros(), Vector3::zeros()));
        let mut joints = self.filled(T::zero());
        for (i, link) in self.links().iter().enumerate() {
            let (parent_angular, parent_linear) = match link.parent {
                Some(parent) => accelerations[parent],
                None => (base.angular_acceleration_body, base.acceleration_origin_body),
            };
            let Drift { parent_from_link: Placement { rotation, offset }, angular, linear, .. } = &drifts[i];
            let angular = rotation.tr_mul(&parent_angular) + angular;
            let linear = rotation.tr_mul(&(parent_linear + parent_angular.cross(offset))) + linear;
            let Hinge { column, inverse, surplus } = hinges[i];
            let felt = column.torque.dot(&angular) + column.force.dot(&linear);
            joints[i] = (surplus - felt) * inverse;
            let own = link.joint.axis() * joints[i];
            accelerations[i] = match link.joint.kind() {
                JointAxis::Revolute => (angular + own, linear),
                JointAxis::Prismatic => (angular, linear + own),
            };
        }
        let sum = joints.as_ref().iter().fold(base.angular_acceleration_body.sum(), |sum, joint| sum + *joint)
            + base.acceleration_origin_body.sum();
        if sum.is_finite() { Ok(GeneralizedAcceleration { base, joints }) } else { Err(DynamicsError::NotFinite) }
    }
}

/// The joint of a body with this articulated inertia, driven by `force`.
#[inline(always)]
fn unlocked<T: Scalar>(link: &Link<T>, body: &Articulated<T>, force: T) -> Hinge<T> {
    let axis = link.joint.axis();
    let (column, own, bias) = match link.joint.kind() {
        JointAxis::Revolute => {
            let column = Wrench::new(body.rotary * axis, body.coupling.tr_mul(axis));
            (column, axis.dot(&column.torque), axis.dot(&body.bias.torque))
        }
        JointAxis::Prismatic => {
            let column = Wrench::new(body.coupling * axis, body.linear * axis);
            (column, axis.dot(&column.force), axis.dot(&body.bias.force))
        }
    };
    Hinge { column, inverse: T::one() / (own + link.joint.rotor_inertia), surplus: force - bias }
}

/// How a link turns, and the accelerations of its origin that velocities alone make, link axes.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Drift<T: Scalar> {
    parent_from_link: Placement<T>,
    rate: Vector3<T>,
    angular: Vector3<T>,
    linear: Vector3<T>,
}

impl<T: Scalar, S: JointStorage> Multibody<T, S> {
    #[inline(always)]
    fn drifts(&self, base_rate: &Vector3<T>, positions: &[T], rates: &[T]) -> S::Of<Drift<T>> {
        let zero = Vector3::zeros();
        let mut drifts =
            self.filled(Drift { parent_from_link: Placement::identity(), rate: zero, angular: zero, linear: zero });
        for (i, link) in self.links().iter().enumerate() {
            let parent_rate = link.parent.map_or(*base_rate, |parent| drifts[parent].rate);
            let parent_from_link = link.joint.placement(positions[i]);
            let Placement { rotation, offset } = &parent_from_link;
            let carried = rotation.tr_mul(&parent_rate);
            let centripetal = rotation.tr_mul(&parent_rate.cross(&parent_rate.cross(offset)));
            let along = link.joint.axis() * rates[i];
            let (rate, angular, linear) = match link.joint.kind() {
                JointAxis::Revolute => (carried + along, carried.cross(&along), centripetal),
                JointAxis::Prismatic => (carried, zero, centripetal + carried.cross(&(along + along))),
            };
            drifts[i] = Drift { parent_from_link, rate, angular, linear };
        }
        drifts
    }
}
