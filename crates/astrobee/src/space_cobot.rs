//! Space CoBot, the free-flyer of thesis chapter 4: the robot that is meant where none is named.

use tumble_dynamics::nalgebra::{Matrix3, Vector3};
use tumble_dynamics::{InertialParameters, WrenchBox};

/// Its body without payload.
///
/// # Source
/// Thesis 4.5.
pub fn body() -> InertialParameters<f64> {
    let inertia = Matrix3::from_diagonal(&Vector3::new(0.0453, 0.0417, 0.0519));
    InertialParameters::about_com(6.047, Vector3::zeros(), inertia)
}

/// The largest force along each axis that is assumed of it, N.
///
/// # Deviation
/// Thesis 4.5 has limits and does not state them. These let a laden robot follow motions of 0.4 m/s^2 along all axes.
pub const FORCE_LIMIT_N: f64 = 6.0;
/// The largest torque about each axis that is assumed of it, N m; not the thesis's either.
pub const TORQUE_LIMIT_N_M: f64 = 0.5;

/// The same limits on all axes.
pub fn wrench_box(force_limit_n: f64, torque_limit_n_m: f64) -> WrenchBox {
    WrenchBox { torque_limit: Vector3::repeat(torque_limit_n_m), force_limit: Vector3::repeat(force_limit_n) }
}
