//! A finding as the body that a belief, a planner or a person reads, and back.

use super::{EstimatorError, Finding};
use crate::dynamics::InertialParameters;
use crate::identify::standard_deviations;
use crate::{BodyScale, Estimate};

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

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::{Matrix3, SMatrix, SVector, Vector3};

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
