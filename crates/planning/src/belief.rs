//! What a plan takes the robot for.

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

    /// The body as it is believed to be.
    pub fn parameters(&self) -> &InertialParameters<f64> {
        &self.estimate.parameters
    }
}
