//! The wheel-driven free fall as linear models.

use tumble_lie::nalgebra::{Matrix3, SMatrix, SVector, Vector3};
use tumble_lie::{Scalar, skew};

/// Regressor of the angular momentum `X w`, linear in `X = [X11, X12, X13, X22, X23, X33]`.
///
/// # Shape
/// 3x6.
/// # Source
/// Thesis (4.9), the rotational part.
pub fn momentum_regressor<T: Scalar>(rate_body: &Vector3<T>) -> SMatrix<T, 3, 6> {
    let (o, [x, y, z]) = (T::zero(), [rate_body.x, rate_body.y, rate_body.z]);
    SMatrix::from_row_slice(&[x, y, z, o, o, o, o, x, o, y, z, o, o, o, x, o, y, z])
}

/// Regressor of the torque of free fall in units of the wheel's inertia: `L(dw) + S(w) L(w)`, `L` the
/// [`momentum_regressor`]; times the inertia it equals [`wheel_torque`].
///
/// # Shape
/// 3x6.
/// # Source
/// The model of arXiv 2503.13137, `I dw + w x (I w) = -j (dw + e_z dW + w x (w + e_z W))`, with `X = I / j + 1`.
/// # Deviation
/// The source keeps the wheel's own inertia `j dw` on the right; as part of `X` it cancels between throw and device.
pub fn torque_regressor<T: Scalar>(rate_body: &Vector3<T>, rate_derivative: &Vector3<T>) -> SMatrix<T, 3, 6> {
    momentum_regressor(rate_derivative) + skew(rate_body) * momentum_regressor(rate_body)
}

/// What the wheel does to the body, in units of its inertia: `-(e_z dW + w x e_z W)`.
pub fn wheel_torque<T: Scalar>(rate_body: &Vector3<T>, wheel_speed: T, wheel_acceleration: T) -> Vector3<T> {
    -(Vector3::z() * wheel_acceleration + rate_body.cross(&(Vector3::z() * wheel_speed)))
}

/// What an accelerometer reads in free fall, linear in the vector `r` from it to the centre of mass:
/// `-(S(dw) + S(w)^2) r`.
///
/// # Shape
/// 3x3.
pub fn lever_arm_regressor<T: Scalar>(rate_body: &Vector3<T>, rate_derivative: &Vector3<T>) -> Matrix3<T> {
    let rate = skew(rate_body);
    -(skew(rate_derivative) + rate * rate)
}

/// The symmetric matrix of `[X11, X12, X13, X22, X23, X33]`.
pub(super) fn symmetric_matrix(x: &SVector<f64, 6>) -> Matrix3<f64> {
    Matrix3::new(x[0], x[1], x[2], x[1], x[3], x[4], x[2], x[4], x[5])
}

/// Inverse of [`symmetric_matrix`].
pub(super) fn symmetric_entries(matrix: &Matrix3<f64>) -> SVector<f64, 6> {
    SVector::from([matrix.m11, matrix.m12, matrix.m13, matrix.m22, matrix.m23, matrix.m33])
}

/// Device and object as two masses on one line: the reduced mass `m_device m / M`, kg, and by how much the offset between
/// their centres of mass exceeds that from the device's to the common one, `M / m`.
pub(super) fn two_bodies(device_mass_kg: f64, object_mass_kg: f64) -> (f64, f64) {
    let total_kg = device_mass_kg + object_mass_kg;
    (device_mass_kg * object_mass_kg / total_kg, total_kg / object_mass_kg)
}

/// What two point masses joined along `offset` add to the inertia about their common centre of mass, per reduced mass:
/// `|d|^2 1 - d d^T`.
pub(super) fn parallel_axis(offset: &Vector3<f64>) -> SVector<f64, 6> {
    symmetric_entries(&(Matrix3::identity() * offset.norm_squared() - offset * offset.transpose()))
}

/// Derivative of [`parallel_axis`] by the offset.
pub(super) fn parallel_axis_derivative(offset: &Vector3<f64>) -> SMatrix<f64, 6, 3> {
    SMatrix::from_columns(&[0, 1, 2].map(|axis| {
        let change = Vector3::ith(axis, 1.0);
        let crossed = offset * change.transpose();
        symmetric_entries(&(Matrix3::identity() * (2.0 * offset[axis]) - crossed - crossed.transpose()))
    }))
}
