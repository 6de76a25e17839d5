//! The ten inertial parameters of a rigid body and what makes them physical.

use tumble_lie::nalgebra::{Matrix3, Matrix4, SVector, Vector3};
use tumble_lie::{Scalar, real};

/// Number of inertial parameters of a rigid body.
pub const PARAMETERS: usize = 10;

/// Mass, first moment and inertia of a rigid body about the origin of its body frame.
///
/// # Frame
/// Body axes; the origin is any body-fixed point, not necessarily the centre of mass.
/// # Units
/// kg, kg m, kg m^2.
/// # Source
/// Thesis (4.9).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct InertialParameters<T: Scalar> {
    /// Mass, kg.
    pub mass: T,
    /// First moment `m c`, kg m.
    pub first_moment: Vector3<T>,
    /// Inertia tensor about the body origin (off-diagonals are minus the products of inertia), kg m^2.
    pub inertia_about_origin: Matrix3<T>,
}

impl<T: Scalar> InertialParameters<T> {
    /// From mass, centre of mass (body axes) and inertia about the body origin.
    pub fn about_origin(mass: T, center_of_mass: Vector3<T>, inertia_about_origin: Matrix3<T>) -> Self {
        Self { mass, first_moment: center_of_mass * mass, inertia_about_origin }
    }

    /// From mass, centre of mass (body axes) and inertia about the centre of mass (body axes).
    pub fn about_com(mass: T, center_of_mass: Vector3<T>, inertia_about_com: Matrix3<T>) -> Self {
        Self::about_origin(mass, center_of_mass, inertia_about_com + point_inertia(mass, &center_of_mass))
    }

    /// Centre of mass, body axes, m. Not finite for a massless body.
    pub fn center_of_mass(&self) -> Vector3<T> {
        self.first_moment / self.mass
    }

    /// Inertia about the centre of mass, body axes, kg m^2.
    pub fn inertia_about_com(&self) -> Matrix3<T> {
        self.inertia_about_origin - point_inertia(self.mass, &self.center_of_mass())
    }

    /// The packing order of the Newton-Euler regressor, `[m, h_x, h_y, h_z, J11, J12, J13, J22, J23, J33]`.
    ///
    /// # Source
    /// Thesis (4.9).
    #[inline]
    pub fn to_vector(&self) -> SVector<T, PARAMETERS> {
        let (h, j) = (&self.first_moment, &self.inertia_about_origin);
        SVector::from([self.mass, h.x, h.y, h.z, j.m11, j.m12, j.m13, j.m22, j.m23, j.m33])
    }

    /// Inverse of [`InertialParameters::to_vector`].
    #[inline]
    pub fn from_vector(p: &SVector<T, PARAMETERS>) -> Self {
        Self {
            mass: p[0],
            first_moment: Vector3::new(p[1], p[2], p[3]),
            inertia_about_origin: Matrix3::new(p[4], p[5], p[6], p[5], p[7], p[8], p[6], p[8], p[9]),
        }
    }
}

/// `m (|c|^2 I - c c^T)`: inertia about the origin of a point mass at `position`.
pub(crate) fn point_inertia<T: Scalar>(mass: T, position: &Vector3<T>) -> Matrix3<T> {
    (Matrix3::identity() * position.norm_squared() - position * position.transpose()) * mass
}

/// The pseudo-inertia `[[1/2 tr(J) I - J, m c], [m c^T, m]]`, J about the origin.
///
/// A body exists exactly when it is positive semidefinite.
/// # Source
/// Thesis (5.36)-(5.38).
/// # Deviation
/// (5.38) prints the inertia about the centre of mass; only the one about the origin is linear in the parameters and
/// agrees with the definition.
pub fn pseudo_inertia<T: Scalar>(p: &InertialParameters<T>) -> Matrix4<T> {
    let j = &p.inertia_about_origin;
    let half_trace = j.trace() * real(0.5);
    let h = &p.first_moment;
    Matrix4::new(
        half_trace - j.m11,
        -j.m12,
        -j.m13,
        h.x,
        -j.m12,
        half_trace - j.m22,
        -j.m23,
        h.y,
        -j.m13,
        -j.m23,
        half_trace - j.m33,
        h.z,
        h.x,
        h.y,
        h.z,
        p.mass,
    )
}
