//! The body that a belief, a planner or a person reads, from a finding and back.

use super::{EstimatorError, Finding};
use crate::BodyScale;
use crate::dynamics::InertialParameters;
use nalgebra::{ComplexField, Matrix3, SMatrix, SVector, Vector3};

/// One standard deviation of each reported quantity.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct StandardDeviations {
    /// Of the mass, kg.
    pub mass_kg: f64,
    /// Of the centre of mass, body axes, m.
    pub center_of_mass_m: Vector3<f64>,
    /// Of the entries of the inertia about the centre of mass, kg m^2.
    pub inertia_about_com_kg_m2: Matrix3<f64>,
}

/// A physically consistent body with its uncertainty.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Estimate {
    /// The ten parameters about the body origin; always a body that exists.
    pub parameters: InertialParameters<f64>,
    /// Covariance of [`InertialParameters::to_vector`], of the solution before the consistency constraint.
    pub covariance: SMatrix<f64, 10, 10>,
    /// Standard deviations derived from the covariance.
    pub std: StandardDeviations,
    /// True where the consistency constraint moved the solution.
    pub lmi_active: bool,
}

impl Estimate {
    /// The same with its information, directions compared in units of a body of this scale. The covariance is kept to the bit.
    ///
    /// # Errors
    /// [`EstimatorError::Refused`] for a covariance that is none, by component and value.
    pub fn to_finding(&self, scale: BodyScale) -> Result<Finding, EstimatorError> {
        Finding::of_covariance(self.parameters.to_vector(), &self.covariance, scale.parameter_magnitudes())
    }
}

/// The body at the point of a finding, with standard deviations to first order.
impl TryFrom<&Finding> for Estimate {
    type Error = EstimatorError;

    /// # Errors
    /// [`EstimatorError::Refused`] where the point is none or no body; the finding's own where directions are free.
    fn try_from(found: &Finding) -> Result<Self, EstimatorError> {
        let covariance = found.covariance()?;
        let Some(point) = found.point() else {
            return Err(EstimatorError::Refused { what: "a finding without a point", index: 0, value: f64::NAN });
        };
        let parameters = InertialParameters::from_vector(point);
        if !parameters.is_strictly_consistent() {
            return Err(EstimatorError::Refused { what: "a point that is no body, mass", index: 0, value: point[0] });
        }
        let std = standard_deviations(point, &covariance);
        Ok(Self { parameters, covariance, std, lmi_active: false })
    }
}

/// Standard deviations of mass, centre of mass and inertia about it, to first order.
pub(crate) fn standard_deviations(
    parameters: &SVector<f64, 10>,
    covariance: &SMatrix<f64, 10, 10>,
) -> StandardDeviations {
    let body = InertialParameters::from_vector(parameters);
    let c = body.center_of_mass();
    // d c = (d h - c d m) / m;  d J_C = d J - (2 c.d h I - d h c^T - c d h^T) + (|c|^2 I - c c^T) d m
    let derived = |delta: &SVector<f64, 10>| {
        let delta = InertialParameters::from_vector(delta);
        let dh = delta.first_moment;
        let center = (dh - c * delta.mass) / body.mass;
        let about_com = delta.inertia_about_origin - Matrix3::identity() * (2.0 * c.dot(&dh))
            + dh * c.transpose()
            + c * dh.transpose()
            + (Matrix3::identity() * c.norm_squared() - c * c.transpose()) * delta.mass;
        InertialParameters { mass: delta.mass, first_moment: center, inertia_about_origin: about_com }.to_vector()
    };
    let mut jacobian = SMatrix::<f64, 10, 10>::zeros();
    for i in 0..10 {
        jacobian.set_column(i, &derived(&SVector::ith(i, 1.0)));
    }
    let variance = (jacobian * covariance * jacobian.transpose()).diagonal();
    let std = InertialParameters::from_vector(&variance.map(|v| ComplexField::sqrt(v.max(0.0))));
    StandardDeviations {
        mass_kg: std.mass,
        center_of_mass_m: std.first_moment,
        inertia_about_com_kg_m2: std.inertia_about_origin,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn ball() -> Estimate {
        let parameters = InertialParameters::about_com(3.0, Vector3::new(0.01, 0.0, 0.02), Matrix3::identity() * 0.1);
        let root = SMatrix::<f64, 10, 10>::from_fn(|i, j| if i == j { 1.0 } else { 0.1 * ((i * 7 + j) as f64).sin() });
        let covariance = (root * root.transpose() + (root * root.transpose()).transpose()) * 5e-5;
        let std = standard_deviations(&parameters.to_vector(), &covariance);
        Estimate { parameters, covariance, std, lmi_active: false }
    }

    #[test]
    fn there_and_back_to_the_bit() {
        let found = ball().to_finding(BodyScale::try_new(3.0, 0.2).unwrap()).unwrap();
        let back = Estimate::try_from(&found).unwrap();
        assert_eq!(back.covariance, ball().covariance);
        assert_eq!(back.std, ball().std);
        assert!((back.parameters.to_vector() - ball().parameters.to_vector()).amax() < 1e-14);
        let by_information = found.information().covariance(found.magnitudes()).unwrap();
        assert!((by_information - back.covariance).amax() < 1e-13);
    }

    #[test]
    fn what_is_none_is_refused_by_component() {
        let scale = BodyScale::try_new(3.0, 0.2).unwrap();
        let mut broken = ball();
        broken.covariance[(2, 2)] = f64::NAN;
        let refused = broken.to_finding(scale);
        assert!(matches!(refused, Err(EstimatorError::Refused { index: 22, .. })), "{refused:?}");
        let impossible = ball().to_finding(scale).unwrap().at(SVector::repeat(-1.0));
        let refused = Estimate::try_from(&impossible);
        assert!(matches!(refused, Err(EstimatorError::Refused { value: -1.0, .. })), "{refused:?}");
        let free = Finding::of_information(crate::SquareRootInformation::new(), scale.parameter_magnitudes());
        assert!(Estimate::try_from(&free).is_err());
    }
}
