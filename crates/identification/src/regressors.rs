//! Regressors of one rigid body: matrices that turn ten inertial parameters into a wrench.
//!
//! All give rows `[torque; force]` in body axes about the body origin and columns in Newton-Euler order
//! ([`InertialParameters::to_vector`](crate::dynamics::InertialParameters::to_vector)); chapter 5 of the thesis orders its
//! columns as [`ParameterOrder::DualQuaternion`](crate::dynamics::ParameterOrder::DualQuaternion).

#[cfg(feature = "research")]
mod finite_difference;
mod newton_euler;
mod variational;

#[cfg(feature = "research")]
pub use finite_difference::{FiniteDifference, StateSample};
pub use newton_euler::{NewtonEuler, NewtonEulerSample, newton_euler};
pub use variational::{
    Extrapolation, ObserverFrame, PoseTriple, Variational, VariationalSample, variational, variational_extrapolated,
};

use crate::lie::Scalar;
use nalgebra::{ArrayStorage, SMatrix, Vector3};

/// A 6x10 regressor: rows `[torque; force]`, columns `[m, h, J11, J12, J13, J22, J23, J33]`.
pub type Regressor<T> = SMatrix<T, 6, 10>;

/// What of a motion enters a regressor: all of them share one pattern of columns and differ in these terms only.
#[derive(Clone, Copy)]
struct MotionTerms<T: Scalar> {
    /// `wdot`, which multiplies the inertia and the first moment.
    rate_derivative: Vector3<T>,
    /// `w w^T`: xx, yy, zz, xy, xz, yz.
    rate_products: [T; 6],
    /// Acceleration of the origin, which multiplies the mass.
    acceleration: Vector3<T>,
    /// Acceleration that, crossed with the first moment, gives torque; equal to `acceleration` but for discretisation.
    lever_acceleration: Vector3<T>,
    /// Torque of a unit mass at the origin; zero but for discretisation.
    mass_torque: Vector3<T>,
}

impl<T: Scalar> MotionTerms<T> {
    #[inline]
    fn regressor(&self) -> Regressor<T> {
        let (d, a, l, t, o) =
            (&self.rate_derivative, &self.acceleration, &self.lever_acceleration, &self.mass_torque, T::zero());
        let [xx, yy, zz, xy, xz, yz] = self.rate_products;
        // Columns in memory order. First moment: S(wdot) + S(w) S(w). Inertia: G(wdot) + S(w) G(w).
        Regressor::from_array_storage(ArrayStorage([
            [t.x, t.y, t.z, a.x, a.y, a.z],
            [o, -l.z, l.y, -(yy + zz), xy + d.z, xz - d.y],
            [l.z, o, -l.x, xy - d.z, -(xx + zz), yz + d.x],
            [-l.y, l.x, o, xz + d.y, yz - d.x, -(xx + yy)],
            [d.x, xz, -xy, o, o, o],
            [d.y - xz, d.x + yz, xx - yy, o, o, o],
            [d.z + xy, zz - xx, d.x - yz, o, o, o],
            [-yz, d.y, xy, o, o, o],
            [yy - zz, d.z - xy, d.y + xz, o, o, o],
            [yz, -xz, d.z, o, o, o],
        ]))
    }
}
