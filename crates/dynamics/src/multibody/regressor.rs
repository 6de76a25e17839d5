use super::Multibody;
use super::inverse_dynamics::{BodyMotion, GeneralizedMotion};
use super::joint::Placement;
use super::kinematics::unit_twist_base;
use super::storage::JointStorage;
use crate::error::DynamicsError;
use crate::parameter_vector::PARAMETERS;
use tumble_lie::nalgebra::{SMatrix, Vector3};
use tumble_lie::{Pose, Scalar, Twist, Wrench};

/// Coefficients of the ten parameters of one body in a wrench or a momentum.
type Block<T> = SMatrix<T, 6, PARAMETERS>;

/// Generalised forces as linear functions of the bodies' parameters.
///
/// Columns: ten for each body in the order of [`InertialParameters::to_vector`](crate::InertialParameters::to_vector).
/// Springs, dampers and rotors are not among them; they add to the joints' rows.
/// # Source
/// Thesis (4.8) for each body, carried to the joints by the transposed Jacobians.
#[derive(Clone, Debug, PartialEq)]
pub struct TorqueRegressor<T: Scalar, S: JointStorage> {
    /// Wrench on the base, base axes: columns of the base body.
    pub base_of_base: Block<T>,
    /// Wrench on the base, base axes: columns of each link.
    pub base_of_link: S::Of<Block<T>>,
    /// Force of joint `i`: coefficients of link `j` in `[i][j]`; zero unless joint `i` carries link `j`.
    pub joint_of_link: S::Pairs<[T; PARAMETERS]>,
}

impl<T: Scalar, S: JointStorage> TorqueRegressor<T, S> {
    /// Coefficients of body `body` (0 the base) in generalised force `row` (0 to 5 the base); `None` outside.
    pub fn block(&self, row: usize, body: usize) -> Option<[T; PARAMETERS]> {
        let count = self.base_of_link.as_ref().len();
        match (row.checked_sub(6), body.checked_sub(1)) {
            (None, None) => Some(core::array::from_fn(|k| self.base_of_base[(row, k)])),
            (None, Some(link)) => {
                let block = self.base_of_link.as_ref().get(link)?;
                Some(core::array::from_fn(|k| block[(row, k)]))
            }
            (Some(joint), None) => (joint < count).then_some([T::zero(); PARAMETERS]),
            (Some(joint), Some(link)) => (joint < count && link < count).then(|| self.joint_of_link[joint][link]),
        }
    }
}

/// Momentum about the inertial origin, inertial axes, as a linear function of the bodies' parameters.
///
/// # Source
/// Thesis (3.2), about a fixed point instead of the centre of mass.
#[derive(Clone, Debug, PartialEq)]
pub struct MomentumRegressor<T: Scalar, S: JointStorage> {
    /// Columns of the base body; rows `[angular; linear]`.
    pub base: Block<T>,
    /// Columns of each link.
    pub links: S::Of<Block<T>>,
}

impl<T: Scalar, S: JointStorage> MomentumRegressor<T, S> {
    /// Coefficients of body `index`, 0 the base.
    pub fn body(&self, index: usize) -> Option<&Block<T>> {
        match index.checked_sub(1) {
            None => Some(&self.base),
            Some(link) => self.links.as_ref().get(link),
        }
    }
}

/// `G(w)`: `J w = G(w) [J11, J12, J13, J22, J23, J33]`, by columns.
#[inline(always)]
fn inertia_columns<T: Scalar>(w: &Vector3<T>) -> [Vector3<T>; 6] {
    let o = T::zero();
    [
        Vector3::new(w.x, o, o),
        Vector3::new(w.y, w.x, o),
        Vector3::new(w.z, o, w.x),
        Vector3::new(o, w.y, o),
        Vector3::new(o, w.z, w.y),
        Vector3::new(o, o, w.z),
    ]
}

/// Wrench of a moving body about its own origin, per unit of each parameter (4.8).
#[inline(always)]
fn wrench_columns<T: Scalar>(motion: &BodyMotion<T>) -> [(Vector3<T>, Vector3<T>); PARAMETERS] {
    let (w, u, a) = (&motion.rate, &motion.angular_acceleration, &motion.acceleration_origin);
    let (xx, yy, zz) = (w.x * w.x, w.y * w.y, w.z * w.z);
    let (xy, xz, yz) = (w.x * w.y, w.x * w.z, w.y * w.z);
    let (o, zero) = (T::zero(), Vector3::zeros());
    [
        (zero, *a),
        // -S(a) over S(u) + S(w) S(w)
        (Vector3::new(o, -a.z, a.y), Vector3::new(-(yy + zz), xy + u.z, xz - u.y)),
        (Vector3::new(a.z, o, -a.x), Vector3::new(xy - u.z, -(xx + zz), yz + u.x)),
        (Vector3::new(-a.y, a.x, o), Vector3::new(xz + u.y, yz - u.x, -(xx + yy))),
        // G(u) + S(w) G(w)
        (Vector3::new(u.x, xz, -xy), zero),
        (Vector3::new(u.y - xz, u.x + yz, xx - yy), zero),
        (Vector3::new(u.z + xy, zz - xx, u.x - yz), zero),
        (Vector3::new(-yz, u.y, xy), zero),
        (Vector3::new(yy - zz, u.z - xy, u.y + xz), zero),
        (Vector3::new(yz, -xz, u.z), zero),
    ]
}

/// The block of these columns.
#[inline(always)]
fn block<T: Scalar>(columns: &[(Vector3<T>, Vector3<T>); PARAMETERS]) -> Block<T> {
    Block::from_fn(|row, k| {
        let (torque, force) = &columns[k];
        if row < 3 { torque[row] } else { force[row - 3] }
    })
}

/// The columns in the frame the body is placed in; only the first four hold a force.
#[inline(always)]
fn placed<T: Scalar>(
    columns: &[(Vector3<T>, Vector3<T>); PARAMETERS],
    placement: &Placement<T>,
) -> [(Vector3<T>, Vector3<T>); PARAMETERS] {
    let Placement { rotation, offset } = placement;
    let mut placed = *columns;
    for (k, (torque, force)) in placed.iter_mut().enumerate() {
        *torque = rotation * *torque;
        if k < 4 {
            *force = rotation * *force;
            *torque += offset.cross(force);
        }
    }
    placed
}

/// Momentum of a body in the frame it is placed in, per unit of each parameter; its twist in its own axes.
fn momentum_columns<T: Scalar>(twist: &Twist<T>, placement: &Placement<T>) -> Block<T> {
    let Placement { rotation, offset } = placement;
    let (w, v) = (&twist.angular, &twist.linear);
    let mut block = Block::zeros();
    let mut set = |column: usize, angular: Vector3<T>, linear: Vector3<T>| {
        let linear = rotation * linear;
        let whole = Wrench::new(rotation * angular + offset.cross(&linear), linear);
        block.column_mut(column).copy_from(&whole.to_vector());
    };
    set(0, Vector3::zeros(), *v);
    for (k, unit) in [Vector3::x(), Vector3::y(), Vector3::z()].iter().enumerate() {
        set(1 + k, unit.cross(v), w.cross(unit));
    }
    for (k, column) in inertia_columns(w).into_iter().enumerate() {
        set(4 + k, column, Vector3::zeros());
    }
    block
}

impl<T: Scalar, S: JointStorage> Multibody<T, S> {
    /// The regressor of [`Multibody::inverse_dynamics`]: forces of the bodies alone, without springs, dampers, rotors.
    ///
    /// # Errors
    /// [`DynamicsError::JointCount`].
    #[inline]
    pub fn torque_regressor(&self, motion: &GeneralizedMotion<'_, T>) -> Result<TorqueRegressor<T, S>, DynamicsError> {
        let links = self.link_motions(motion)?;
        let mut placements = self.filled(Placement::identity());
        let mut units = self.filled(Twist::zero());
        let mut base_of_link = self.filled(Block::zeros());
        let mut joint_of_link = S::pairs(self.joints(), [T::zero(); PARAMETERS]);
        for (i, link) in self.links().iter().enumerate() {
            let in_parent = &links[i].parent_from_link;
            placements[i] = match link.parent {
                Some(parent) => placements[parent].then(in_parent),
                None => *in_parent,
            };
            units[i] = unit_twist_base(link, &placements[i]);
            let columns = placed(&wrench_columns(&links[i].motion), &placements[i]);
            let mut carrier = Some(i);
            while let Some(j) = carrier {
                let Twist { angular, linear } = &units[j];
                for (k, (entry, (torque, force))) in joint_of_link[j][i].iter_mut().zip(&columns).enumerate() {
                    *entry = angular.dot(torque);
                    if k < 4 {
                        *entry += linear.dot(force);
                    }
                }
                carrier = self.links()[j].parent;
            }
            base_of_link[i] = block(&columns);
        }
        let base_of_base = block(&wrench_columns(&motion.base()));
        Ok(TorqueRegressor { base_of_base, base_of_link, joint_of_link })
    }

    /// The regressor of [`Multibody::spatial_momentum`].
    ///
    /// # Errors
    /// [`DynamicsError::JointCount`].
    pub fn momentum_regressor(
        &self,
        world_from_base: &Pose<T>,
        base_twist: &Twist<T>,
        positions: &[T],
        rates: &[T],
    ) -> Result<MomentumRegressor<T, S>, DynamicsError> {
        let placements = self.placements(positions)?.base_from_link;
        let twists = self.link_twists(base_twist, positions, rates)?;
        let world = Placement {
            rotation: world_from_base.rotation.to_rotation_matrix().into_inner(),
            offset: world_from_base.translation.vector,
        };
        let mut links = self.filled(Block::zeros());
        for i in 0..self.joints() {
            links[i] = momentum_columns(&twists[i], &world.then(&placements[i]));
        }
        Ok(MomentumRegressor { base: momentum_columns(base_twist, &world), links })
    }
}
