//! What a plan takes the robot for.

use crate::local::body_by_mass_center_and_inertia;
use nalgebra::{Matrix3, SMatrix, Vector3};
use tumble_dynamics::InertialParameters;
use tumble_identification::{Estimate, StandardDeviations};

/// An estimate of the body with the number of its revision. Every plan names the revision it was made with, so that no
/// update can be lost unseen.
#[derive(Clone, Debug, PartialEq)]
pub struct ModelBelief {
    /// Grows with each update.
    pub revision: u64,
    /// The body and its covariance.
    pub estimate: Estimate,
}

/// What was planned, and with which revision of the belief.
#[derive(Clone, Debug, PartialEq)]
pub struct Plan<T> {
    /// The motion.
    pub trajectory: T,
    /// [`ModelBelief::revision`] of the belief used.
    pub model_revision: u64,
}

impl ModelBelief {
    /// A body known exactly.
    pub fn certain(revision: u64, parameters: InertialParameters<f64>) -> Self {
        let std = StandardDeviations {
            mass_kg: 0.0,
            center_of_mass_m: Vector3::zeros(),
            inertia_about_com_kg_m2: Matrix3::zeros(),
        };
        let estimate = Estimate { parameters, covariance: SMatrix::zeros(), std, lmi_active: false };
        Self { revision, estimate }
    }

    /// A body of which little is known: standard deviations of the mass as a share of it, of the centre of mass along each axis (m),
    /// and of the inertia as a share of it, a product's as that of the moments beside it.
    pub fn vague(
        revision: u64,
        parameters: InertialParameters<f64>,
        [mass_share, center_m, inertia_share]: [f64; 3],
    ) -> Self {
        let std = StandardDeviations {
            mass_kg: mass_share * parameters.mass,
            center_of_mass_m: Vector3::repeat(center_m),
            inertia_about_com_kg_m2: inertia_share * inertia_sizes(&parameters),
        };
        Self::independent(revision, parameters, std)
    }

    /// A body whose mass, centre of mass and inertia about it err independently of one another, by these standard deviations.
    pub fn independent(revision: u64, parameters: InertialParameters<f64>, std: StandardDeviations) -> Self {
        // in the order of the ten parameters
        let sigma = InertialParameters {
            mass: std.mass_kg,
            first_moment: std.center_of_mass_m,
            inertia_about_origin: std.inertia_about_com_kg_m2,
        };
        let mut scaled = body_by_mass_center_and_inertia(&parameters);
        for (mut column, sigma) in scaled.column_iter_mut().zip(&sigma.to_vector()) {
            column *= *sigma;
        }
        let covariance = scaled * scaled.transpose();
        Self { revision, estimate: Estimate { parameters, covariance, std, lmi_active: false } }
    }

    /// The body as it is believed to be.
    pub fn parameters(&self) -> &InertialParameters<f64> {
        &self.estimate.parameters
    }

    /// Mass (kg) and largest moment about the centre of mass (kg m^2) of a body so many standard deviations heavier.
    pub(crate) fn heaviest(&self, sigmas: f64) -> [f64; 2] {
        let Estimate { parameters, std, .. } = &self.estimate;
        let moments = (parameters.inertia_about_com() + std.inertia_about_com_kg_m2 * sigmas).diagonal();
        [parameters.mass + sigmas * std.mass_kg, moments.max()]
    }
}

/// What shares of an inertia about the centre of mass are of, kg m^2: the moments, and for a product the geometric mean of the
/// moments beside it.
pub fn inertia_sizes(body: &InertialParameters<f64>) -> Matrix3<f64> {
    let moments = body.inertia_about_com().diagonal();
    Matrix3::from_fn(|row, column| libm::sqrt(moments[row] * moments[column]))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The first moment is mass times centre: its variance is that of a product, and it varies with the mass.
    #[test]
    fn a_vague_belief_is_as_vague_as_it_says() {
        let center = Vector3::new(0.1, 0.0, -0.2);
        let body = InertialParameters::about_com(4.0, center, Matrix3::from_diagonal(&Vector3::new(0.2, 0.3, 0.4)));
        let ModelBelief { estimate: Estimate { covariance, std, .. }, .. } =
            ModelBelief::vague(3, body, [0.5, 0.02, 0.1]);
        let near = |a: f64, b: f64| assert!((a - b).abs() < 1e-12, "{a} {b}");
        near(covariance[(0, 0)], 4.0);
        for axis in 0..3 {
            near(covariance[(1 + axis, 1 + axis)], (2.0 * center[axis]).powi(2) + (4.0 * 0.02_f64).powi(2));
            near(covariance[(0, 1 + axis)], 4.0 * center[axis]);
        }
        near(std.inertia_about_com_kg_m2[(0, 2)].powi(2), 0.01 * 0.2 * 0.4);
        // the same body about its centre: nothing but its own inertia is left
        let centred = InertialParameters {
            first_moment: Vector3::zeros(),
            inertia_about_origin: body.inertia_about_com(),
            ..body
        };
        let covariance = ModelBelief::vague(3, centred, [0.5, 0.0, 0.1]).estimate.covariance;
        let moments = centred.to_vector();
        for place in 4..10 {
            let (sigma, moment) = (covariance[(place, place)].sqrt(), moments[place]);
            assert!(moment == 0.0 || (sigma - 0.1 * moment).abs() < 1e-12, "{sigma} {moment}");
        }
    }

    #[test]
    fn the_covariance_gives_back_the_standard_deviations() {
        let inertia = Matrix3::from_diagonal(&Vector3::new(0.15, 0.14, 0.16));
        let body = InertialParameters::about_com(9.5, Vector3::new(0.02, -0.03, 0.01), inertia);
        let std = StandardDeviations {
            mass_kg: 0.4,
            center_of_mass_m: Vector3::repeat(0.01),
            inertia_about_com_kg_m2: Matrix3::repeat(0.02),
        };
        let covariance = ModelBelief::independent(0, body, std).estimate.covariance;
        let back = body_by_mass_center_and_inertia(&body).try_inverse().unwrap();
        let central = back * covariance * back.transpose();
        for (index, sigma) in [0.4, 0.01, 0.01, 0.01, 0.02, 0.02, 0.02, 0.02, 0.02, 0.02].into_iter().enumerate() {
            assert!((central[(index, index)].sqrt() / sigma - 1.0).abs() < 1e-9, "{index}");
        }
    }
}
