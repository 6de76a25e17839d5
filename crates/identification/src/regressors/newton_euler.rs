//! The Newton-Euler regressor: instantaneous rates and accelerations.

use super::{MotionTerms, Regressor};
use crate::dynamics::PARAMETERS;
use crate::lie::{Scalar, Wrench};
use crate::linear_model::LinearModel;
use nalgebra::{SMatrix, SVector, Vector3};

/// `wrench = newton_euler(w, wdot, a) * parameters`.
///
/// # Shape
/// 6x10, rows `[torque; force]`, columns `[m, h, J11, J12, J13, J22, J23, J33]`.
/// # Frame
/// Body axes, about the body origin. `acceleration_origin` is the inertial acceleration of the origin in body axes (less
/// gravity, where there is some), not the derivative of the body components of its velocity.
/// # Source
/// Thesis (4.1)-(4.8).
/// # Deviation
/// The print writes `vdot`; read as the component derivative it is wrong by `omega x v` (test
/// `component_derivative_is_not_the_acceleration`).
#[inline]
pub fn newton_euler<T: Scalar>(
    rate: &Vector3<T>,
    rate_derivative: &Vector3<T>,
    acceleration_origin: &Vector3<T>,
) -> Regressor<T> {
    let w = rate;
    MotionTerms {
        rate_derivative: *rate_derivative,
        rate_products: [w.x * w.x, w.y * w.y, w.z * w.z, w.x * w.y, w.x * w.z, w.y * w.z],
        acceleration: *acceleration_origin,
        lever_acceleration: *acceleration_origin,
        mass_torque: Vector3::zeros(),
    }
    .regressor()
}

/// One instant of a motion and the wrench then.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct NewtonEulerSample<T: Scalar> {
    /// Angular velocity, body axes, rad/s.
    pub rate: Vector3<T>,
    /// Its derivative, rad/s^2.
    pub rate_derivative: Vector3<T>,
    /// Inertial acceleration of the origin less gravity, body axes, m/s^2.
    pub acceleration_origin: Vector3<T>,
    /// Wrench on the body except gravity.
    pub wrench: Wrench<T>,
}

/// [`newton_euler`] as a [`LinearModel`].
#[derive(Clone, Copy, Debug, Default)]
pub struct NewtonEuler;

impl<T: Scalar> LinearModel<T, 6, PARAMETERS> for NewtonEuler {
    type Sample = NewtonEulerSample<T>;
    fn regressor(&self, sample: &Self::Sample) -> SMatrix<T, 6, PARAMETERS> {
        newton_euler(&sample.rate, &sample.rate_derivative, &sample.acceleration_origin)
    }
    fn output(&self, sample: &Self::Sample) -> SVector<T, 6> {
        sample.wrench.to_vector()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::dynamics::strategies::body_d;
    use crate::dynamics::{BodyAcceleration, FreeFlyer};
    use crate::lie::Twist;

    #[test]
    fn golden_values_of_section_a() {
        let gamma = newton_euler(
            &Vector3::new(0.3, -0.2, 0.5),
            &Vector3::new(0.1, 0.4, -0.3),
            &Vector3::new(0.25, -0.15, 0.35),
        );
        let wrench = gamma * body_d().to_vector();
        let golden = [0.1525, 0.51, -0.8825, 1.435, -1.06, 1.655];
        for (found, expected) in wrench.iter().zip(golden) {
            assert!((found - expected).abs() < 1e-14, "{found} {expected}");
        }
        let rows = [
            (0, [0.0, 0.0, 0.35, 0.15, 0.1, 0.25, -0.36, 0.1, -0.21, -0.1]),
            (3, [0.25, -0.29, 0.24, 0.55, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0]),
        ];
        for (row, expected) in rows {
            for j in 0..10 {
                assert!((gamma[(row, j)] - expected[j]).abs() < 1e-15, "row {row} column {j}");
            }
        }
    }

    #[test]
    fn component_derivative_is_not_the_acceleration() {
        let parameters = body_d();
        let twist = Twist::new(Vector3::new(0.3, -0.2, 0.5), Vector3::new(1.0, 2.0, -0.5));
        let acceleration = BodyAcceleration {
            angular_acceleration_body: Vector3::new(0.1, 0.4, -0.3),
            acceleration_origin_body: Vector3::new(0.25, -0.15, 0.35),
        };
        let truth = FreeFlyer::new(parameters).inverse(&twist, &acceleration).to_vector();
        let found = newton_euler(
            &twist.angular,
            &acceleration.angular_acceleration_body,
            &acceleration.acceleration_origin_body,
        ) * parameters.to_vector();
        assert!((truth - found).amax() < 1e-13);
        let component_derivative = acceleration.acceleration_origin_body - twist.angular.cross(&twist.linear);
        let wrong = newton_euler(&twist.angular, &acceleration.angular_acceleration_body, &component_derivative)
            * parameters.to_vector();
        assert!((truth - wrong).amax() > 1.0);
    }
}
