use super::Multibody;
use super::joint::Placement;
use super::kinematics::unit_twist_base;
use super::storage::JointStorage;
use crate::error::DynamicsError;
use crate::inertia::InertialParameters;
use tumble_lie::nalgebra::{Matrix3, Vector6};
use tumble_lie::{Scalar, Twist, Wrench, real};

/// The generalised inertia `M`: kinetic energy `1/2 zeta^T M zeta`.
///
/// # Source
/// Thesis (2.10).
#[derive(Clone, Debug, PartialEq)]
pub struct MassMatrix<T: Scalar, S: JointStorage> {
    /// The whole tree as one rigid body, base frame; its spatial inertia is the 6x6 block of the base.
    pub composite: InertialParameters<T>,
    /// For each joint, `[torque; force]` on the base per unit of joint acceleration: the columns beside that block.
    pub coupling: S::Of<Vector6<T>>,
    /// The block of the joints: row, column.
    pub joints: S::Pairs<T>,
}

impl<T: Scalar, S: JointStorage> MassMatrix<T, S> {
    /// Entry of `M`; the base has rows 0 to 5. `None` outside.
    pub fn get(&self, row: usize, column: usize) -> Option<T> {
        let (row, column) = (row.max(column), row.min(column));
        match (row.checked_sub(6), column.checked_sub(6)) {
            (None, _) => Some(self.composite.spatial_inertia()[(row, column)]),
            (Some(joint), None) => self.coupling.as_ref().get(joint).map(|coupling| coupling[column]),
            (Some(i), Some(j)) => (i < self.coupling.as_ref().len()).then(|| self.joints[i][j]),
        }
    }

    /// `M zeta`: on the base the momentum about its origin, in each joint the conjugate momentum.
    pub fn momentum(&self, base_twist: &Twist<T>, rates: &[T]) -> (Wrench<T>, S::Of<T>) {
        let twist = base_twist.to_vector();
        let mut base = times(&self.composite, base_twist).to_vector();
        let coupling = self.coupling.as_ref();
        let mut joints = S::filled(coupling.len(), T::zero());
        for (i, column) in coupling.iter().enumerate() {
            base += column * rates[i];
            joints[i] = column.dot(&twist);
            for (j, rate) in rates.iter().enumerate().take(coupling.len()) {
                joints[i] += self.joints[i][j] * *rate;
            }
        }
        (base.into(), joints)
    }
}

/// Spatial momentum of a body with this twist, both about the origin of one frame.
#[inline(always)]
pub(super) fn times<T: Scalar>(body: &InertialParameters<T>, twist: &Twist<T>) -> Wrench<T> {
    let (w, v, h) = (&twist.angular, &twist.linear, &body.first_moment);
    Wrench::new(body.inertia_about_origin * w + h.cross(v), v * body.mass - h.cross(w))
}

/// The body in the frame it is placed in.
#[inline(always)]
fn carried<T: Scalar>(body: &InertialParameters<T>, placement: &Placement<T>) -> InertialParameters<T> {
    let (r, p) = (&placement.rotation, &placement.offset);
    let (h, m) = (r * body.first_moment, body.mass);
    // parallel axes: (2 h.p + m p.p) I - (h p^T + p h^T + m p p^T)
    let half = h + p * (m * real::<T>(0.5));
    let along = half.dot(p) * real(2.0);
    let shift = |i: usize, j: usize| half[i] * p[j] + half[j] * p[i];
    let turned = r * body.inertia_about_origin;
    let entry = |i: usize, j: usize| {
        turned[(i, 0)] * r[(j, 0)] + turned[(i, 1)] * r[(j, 1)] + turned[(i, 2)] * r[(j, 2)] - shift(i, j)
    };
    let (xy, xz, yz) = (entry(0, 1), entry(0, 2), entry(1, 2));
    let inertia_about_origin =
        Matrix3::new(entry(0, 0) + along, xy, xz, xy, entry(1, 1) + along, yz, xz, yz, entry(2, 2) + along);
    InertialParameters { mass: m, first_moment: h + p * m, inertia_about_origin }
}

impl<T: Scalar, S: JointStorage> Multibody<T, S> {
    /// The generalised inertia at these joint positions, by the composite-rigid-body algorithm in base axes.
    ///
    /// # Errors
    /// [`DynamicsError::JointCount`].
    #[inline]
    pub fn mass_matrix(&self, positions: &[T]) -> Result<MassMatrix<T, S>, DynamicsError> {
        self.check_joints(&[positions])?;
        let mut placements = self.filled(Placement::identity());
        self.place(positions, &mut placements);
        let mut outboard = self.filled(self.base);
        let mut units = self.filled(Twist::zero());
        for (i, link) in self.links().iter().enumerate() {
            outboard[i] = carried(&link.body, &placements[i]);
            units[i] = unit_twist_base(link, &placements[i]);
        }
        let mut composite = self.base;
        let mut coupling = self.filled(Vector6::zeros());
        let mut joints = S::pairs(self.joints(), T::zero());
        for (i, link) in self.tips_first() {
            let momentum = times(&outboard[i], &units[i]);
            coupling[i] = momentum.to_vector();
            joints[i][i] = units[i].power(&momentum) + link.joint.rotor_inertia;
            let mut ancestor = link.parent;
            while let Some(j) = ancestor {
                let entry = units[j].power(&momentum);
                joints[i][j] = entry;
                joints[j][i] = entry;
                ancestor = self.links()[j].parent;
            }
            let own = outboard[i];
            let inner = link.parent.map_or(&mut composite, |parent| &mut outboard[parent]);
            *inner = *inner + own;
        }
        Ok(MassMatrix { composite, coupling, joints })
    }
}
