//! Mass and principal moments from measured accelerations: the small nonlinear model.

use super::extended_kalman::{DifferentiableModel, FilterModel};
use crate::error::IdentificationError;
use crate::householder::sqrt;
use crate::lie::{Manifold, Wrench};
use nalgebra::{Matrix4, SMatrix, Vector3, Vector4, Vector6};

/// A body about its centre of mass in principal axes; as a state, any point of it exists.
///
/// Increments x multiply the mass and the three second moments Σx = ∫x² dm (Ixx = Σy + Σz and so on) by x + √(1 + x²), which
/// is exp x to second order, costs a root, and is never zero or negative: masses stay positive and moments keep the triangle
/// inequalities, whatever a filter does.
///
/// # Units
/// kg, kg m^2.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct PrincipalBody {
    /// `[m, Σx, Σy, Σz]`.
    moments: Vector4<f64>,
}

impl PrincipalBody {
    /// From the mass and the principal moments of inertia.
    ///
    /// # Errors
    /// [`IdentificationError::NotPositive`] where the mass (index 0) or a second moment (1 to 3) is not: no such body exists.
    pub fn try_new(mass_kg: f64, principal_inertia: Vector3<f64>) -> Result<Self, IdentificationError> {
        let half_trace = 0.5 * principal_inertia.sum();
        let second = principal_inertia.map(|inertia| half_trace - inertia);
        let moments = Vector4::new(mass_kg, second.x, second.y, second.z);
        match moments.iter().position(|x| !(x.is_finite() && *x > 0.0)) {
            Some(index) => Err(IdentificationError::NotPositive { index, value: moments[index] }),
            None => Ok(Self { moments }),
        }
    }

    /// `[m, Ixx, Iyy, Izz]`.
    pub fn parameters(&self) -> Vector4<f64> {
        let [[m, x, y, z]] = self.moments.data.0;
        Vector4::new(m, y + z, z + x, x + y)
    }

    /// Derivative of [`parameters`](Self::parameters) along an increment.
    pub fn parameter_jacobian(&self) -> Matrix4<f64> {
        let ([[m, x, y, z]], o) = (self.moments.data.0, 0.0);
        Matrix4::new(m, o, o, o, o, o, y, z, o, x, o, z, o, x, y, o)
    }

    /// Covariance of an increment, from that of [`parameters`](Self::parameters).
    pub fn increment_covariance(&self, of_parameters: &Matrix4<f64>) -> Matrix4<f64> {
        let ([[m, x, y, z]], o, h) = (self.moments.data.0, 0.0, 0.5);
        // The inverse of the Jacobian.
        let rows =
            Matrix4::new(1.0 / m, o, o, o, o, -h / x, h / x, h / x, o, h / y, -h / y, h / y, o, h / z, h / z, -h / z);
        rows * of_parameters * rows.transpose()
    }

    /// `[angular; linear]` acceleration under a wrench.
    #[inline]
    fn acceleration(&self, rate: &Vector3<f64>, wrench: &Wrench<f64>) -> Vector6<f64> {
        let ([[m, x, y, z]], w, t) = (self.moments.data.0, rate, &wrench.torque);
        let linear = wrench.force * (1.0 / m);
        Vector6::new(
            (t.x - (y - z) * w.y * w.z) / (y + z),
            (t.y - (z - x) * w.z * w.x) / (z + x),
            (t.z - (x - y) * w.x * w.y) / (x + y),
            linear.x,
            linear.y,
            linear.z,
        )
    }
}

impl Manifold for PrincipalBody {
    type Scalar = f64;
    type Tangent = Vector4<f64>;

    #[inline]
    fn oplus(&self, xi: &Vector4<f64>) -> Self {
        Self { moments: self.moments.component_mul(&xi.map(growth)) }
    }

    fn ominus(&self, base: &Self) -> Vector4<f64> {
        self.moments.zip_map(&base.moments, |a, b| 0.5 * (a / b - b / a))
    }

    fn increment_rate(xi: &Vector4<f64>, velocity: &Vector4<f64>) -> Vector4<f64> {
        xi.zip_map(velocity, |x, v| v * sqrt(1.0 + x * x))
    }
}

/// x + √(1 + x²), whose inverse is that of −x.
#[inline(always)]
fn growth(x: f64) -> f64 {
    let up = x.abs() + sqrt(1.0 + x * x);
    if x < 0.0 { 1.0 / up } else { up }
}

/// Accelerations measured under a known wrench.
///
/// # Frame
/// Principal body axes, about the centre of mass.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct AccelerationObservation {
    /// Angular velocity, rad/s.
    pub rate_body: Vector3<f64>,
    /// Wrench about the centre of mass, N m and N.
    pub wrench_body: Wrench<f64>,
    /// `[angular; linear]` acceleration of the centre of mass, rad/s^2 and m/s^2.
    pub acceleration_body: Vector6<f64>,
    /// Standard deviation of each; infinite where not measured.
    pub standard_deviation: Vector6<f64>,
}

/// [`PrincipalBody`] as the state of a filter; its parameters drift.
///
/// # Source
/// Thesis (6.10), (6.11), with the model of (2.4) about the centre of mass.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct PrincipalMotion {
    /// Variance of an increment of the body that each update adds.
    pub drift: Vector4<f64>,
}

impl FilterModel<4, 6, 4> for PrincipalMotion {
    type State = PrincipalBody;
    type Observation = AccelerationObservation;

    #[inline]
    fn propagate(
        &self,
        state: &PrincipalBody,
        _observation: &AccelerationObservation,
    ) -> Result<PrincipalBody, IdentificationError> {
        Ok(*state)
    }

    #[inline]
    fn process_noise(&self, _state: &PrincipalBody, _observation: &AccelerationObservation) -> Matrix4<f64> {
        Matrix4::from_diagonal(&self.drift)
    }

    #[inline]
    fn residual(&self, state: &PrincipalBody, observation: &AccelerationObservation) -> Vector6<f64> {
        observation.acceleration_body - state.acceleration(&observation.rate_body, &observation.wrench_body)
    }

    #[inline]
    fn standard_deviation(&self, observation: &AccelerationObservation) -> Vector6<f64> {
        observation.standard_deviation
    }

    fn parameters(&self, state: &PrincipalBody) -> Vector4<f64> {
        state.parameters()
    }

    fn parameter_jacobian(&self, state: &PrincipalBody) -> Matrix4<f64> {
        state.parameter_jacobian()
    }
}

impl DifferentiableModel<4, 6, 4> for PrincipalMotion {
    #[inline]
    fn predicted_covariance(
        &self,
        _state: &PrincipalBody,
        _observation: &AccelerationObservation,
        covariance: &Matrix4<f64>,
    ) -> Matrix4<f64> {
        let mut predicted = *covariance;
        for i in 0..4 {
            predicted[(i, i)] += self.drift[i];
        }
        predicted
    }

    #[inline]
    fn sensitivity(&self, state: &PrincipalBody, observation: &AccelerationObservation) -> SMatrix<f64, 6, 4> {
        let ([[m, x, y, z]], w) = (state.moments.data.0, &observation.rate_body);
        let f = observation.wrench_body.force * (-1.0 / m);
        let a = state.acceleration(w, &observation.wrench_body);
        let (yz, zx, xy) = (w.y * w.z, w.z * w.x, w.x * w.y);
        let (i, j, k, o) = (1.0 / (y + z), 1.0 / (z + x), 1.0 / (x + y), 0.0);
        SMatrix::from([
            [o, o, o, f.x, f.y, f.z],
            [o, (zx - a[1]) * x * j, (-xy - a[2]) * x * k, o, o, o],
            [(-yz - a[0]) * y * i, o, (xy - a[2]) * y * k, o, o, o],
            [(yz - a[0]) * z * i, (-zx - a[1]) * z * j, o, o, o, o],
        ])
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn observation() -> AccelerationObservation {
        AccelerationObservation {
            rate_body: Vector3::new(0.3, -0.2, 0.5),
            wrench_body: Wrench::new(Vector3::new(0.02, -0.01, 0.03), Vector3::new(0.1, -0.05, 0.08)),
            acceleration_body: Vector6::zeros(),
            standard_deviation: Vector6::repeat(1.0),
        }
    }

    #[test]
    fn accelerations_are_those_of_the_free_flyer() {
        use crate::dynamics::{FreeFlyer, InertialParameters};
        use crate::lie::Twist;
        use nalgebra::Matrix3;
        let moments = Vector3::new(0.153, 0.143, 0.162);
        let body = PrincipalBody::try_new(9.58, moments).unwrap();
        let flyer =
            FreeFlyer::new(InertialParameters::about_com(9.58, Vector3::zeros(), Matrix3::from_diagonal(&moments)));
        let seen = observation();
        let expected = flyer.forward(&Twist::new(seen.rate_body, Vector3::zeros()), &seen.wrench_body);
        let found = body.acceleration(&seen.rate_body, &seen.wrench_body);
        assert!((found.fixed_rows::<3>(0) - expected.angular_acceleration_body).amax() < 1e-15);
        assert!((found.fixed_rows::<3>(3) - expected.acceleration_origin_body).amax() < 1e-15);
        assert!((body.parameters() - Vector4::new(9.58, 0.153, 0.143, 0.162)).amax() < 1e-15);
    }

    #[test]
    fn derivatives_equal_difference_quotients() {
        let model = PrincipalMotion { drift: Vector4::zeros() };
        let body = PrincipalBody::try_new(9.58, Vector3::new(0.153, 0.143, 0.162)).unwrap();
        let (sensitivity, jacobian) = (model.sensitivity(&body, &observation()), body.parameter_jacobian());
        for j in 0..4 {
            let step = Vector4::ith(j, 1e-5);
            let (ahead, behind) = (body.oplus(&step), body.oplus(&-step));
            let slope = (model.residual(&behind, &observation()) - model.residual(&ahead, &observation())) / 2e-5;
            assert!((sensitivity.column(j) - slope).amax() < 1e-9, "{j}");
            let slope = (ahead.parameters() - behind.parameters()) / 2e-5;
            assert!((jacobian.column(j) - slope).amax() < 1e-8, "{j}");
            assert!((ahead.ominus(&body) - step).amax() < 1e-14);
        }
        let covariance = Matrix4::from_diagonal(&Vector4::new(9.0, 2.5e-3, 1e-3, 4e-3));
        let back = jacobian * body.increment_covariance(&covariance) * jacobian.transpose();
        assert!((back - covariance).amax() < 1e-14);
    }

    #[test]
    fn increments_of_any_size_lead_to_a_body_and_back() {
        let body = PrincipalBody::try_new(9.58, Vector3::new(0.153, 0.143, 0.162)).unwrap();
        for size in [1e-9, 0.3, 5.0, 1e9] {
            let xi = Vector4::new(size, -size, 0.5 * size, -0.1 * size);
            let there = body.oplus(&xi);
            assert!(there.moments.iter().all(|x| *x > 0.0 && x.is_finite()), "{size}");
            assert!((there.ominus(&body) - xi).amax() < 1e-14 * size.max(1.0), "{size}");
        }
        // Moving on from the increment is moving the increment at the stated rate.
        let (xi, velocity) = (Vector4::new(0.4, -0.7, 0.1, 0.0), Vector4::new(0.3, 0.2, -0.5, 1.0));
        let ahead = |time: f64| body.oplus(&xi).oplus(&(velocity * time)).ominus(&body);
        let slope = (ahead(1e-5) - ahead(-1e-5)) / 2e-5;
        assert!((slope - PrincipalBody::increment_rate(&xi, &velocity)).amax() < 1e-9);
    }

    #[test]
    fn bodies_that_do_not_exist_are_refused() {
        assert!(PrincipalBody::try_new(1.0, Vector3::new(1.0, 1.0, 1.9)).is_ok());
        for (mass, inertia) in [(0.0, [1.0; 3]), (1.0, [1.0, 1.0, 2.1]), (1.0, [f64::NAN; 3])] {
            assert!(matches!(
                PrincipalBody::try_new(mass, Vector3::from(inertia)),
                Err(IdentificationError::NotPositive { .. })
            ));
        }
    }
}
