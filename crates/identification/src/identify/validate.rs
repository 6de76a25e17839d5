//! How well a finding explains another record of the same body.

use super::identification::{Identification, UnexplainedWrench, Validation};
use super::likelihood;
use super::pipeline::Pipeline;
use super::plan::Way;
use super::rows::{Regression, Scheme};
use super::settings::{FLIGHT_LIKELIHOOD, MAXIMUM_LIKELIHOOD, Settings, WEAK_FORM};
use super::timeline::Timeline;
use crate::Observability;
use crate::error::IdentificationError;
use crate::estimator::EstimatorError;
use crate::motion::MotionSample;
use nalgebra::Vector6;

/// How well `found` explains another record of the same body.
///
/// # Errors
/// As [`identify`](super::identify); also [`IdentificationError::NoEstimate`], of the finding or of the other record.
pub fn validate(
    found: &Identification,
    record: &[MotionSample],
    settings: &Settings,
) -> Result<Validation, EstimatorError> {
    Pipeline::new().validate(found, record, settings)
}

impl Pipeline {
    /// [`validate`](crate::validate) with the user's own. What was found from sensors that wander and filter is held against what they find in the
    /// other record, for no rows of theirs hold a wrench.
    ///
    /// # Errors
    /// As [`validate`](crate::validate).
    pub fn validate(
        &self,
        found: &Identification,
        record: &[MotionSample],
        settings: &Settings,
    ) -> Result<Validation, EstimatorError> {
        if [FLIGHT_LIKELIHOOD, WEAK_FORM].contains(&found.method) {
            let settings = Settings { method: FLIGHT_LIKELIHOOD, prior: None, ..*settings };
            return Ok(found.beside(&self.identify(record, &settings)?)?);
        }
        let estimate = found.estimate.ok_or(IdentificationError::NoEstimate { rank: found.rank })?;
        let acted = self.acted(record, Some(&estimate.parameters))?;
        let record = acted.as_ref();
        if found.method == MAXIMUM_LIKELIHOOD {
            return Ok(likelihood::validated(found, &estimate, record, settings)?);
        }
        let timeline = Timeline::try_new(record)?;
        let regression = Way::named(found.method).map_or(Regression::Variational4, Way::regression);
        let scheme = Scheme::new(settings, regression, found.lag);
        let rows = scheme.rows(record, &timeline)?;
        let parameters = estimate.parameters.to_vector();
        let gain = scheme.wrench_gain().sqrt();
        let (torque_sigma, force_sigma) = (found.noise.torque_n_m * gain, found.noise.force_n * gain);
        let (mut torque, mut force, mut normalised, mut applied) = (0.0, 0.0, 0.0, 0.0);
        let whiten = Vector6::new(torque_sigma, torque_sigma, torque_sigma, force_sigma, force_sigma, force_sigma);
        for row in &rows.all {
            let residual = row.regressor * parameters - row.wrench;
            let spread = row.regressor * estimate.covariance * row.regressor.transpose();
            torque += residual.fixed_rows::<3>(0).norm_squared();
            force += residual.fixed_rows::<3>(3).norm_squared();
            for i in 0..6 {
                let variance = whiten[i] * whiten[i] + spread[(i, i)];
                normalised += residual[i] * residual[i] / variance.max(f64::MIN_POSITIVE);
                applied += row.wrench[i] * row.wrench[i] / variance.max(f64::MIN_POSITIVE);
            }
        }
        let count = rows.all.len() as f64;
        Ok(Validation {
            nodes: rows.all.len(),
            normalised_rms: (normalised / (6.0 * count)).sqrt(),
            wrench: Some(UnexplainedWrench {
                torque_rms_n_m: (torque / (3.0 * count)).sqrt(),
                force_rms_n: (force / (3.0 * count)).sqrt(),
                explained: 1.0 - normalised / applied,
            }),
        })
    }
}

impl Identification {
    /// What another record of the same body says beside this: by how much both together are less likely than each by itself.
    fn beside(&self, other: &Self) -> Result<Validation, IdentificationError> {
        let mut both = self.information;
        both.merge(&other.information);
        let apart = |of: &Self| of.information.residual_sum_of_squares();
        let chi_square = (both.residual_sum_of_squares() - apart(self) - apart(other)).max(0.0);
        let shared = (self.rank + other.rank).saturating_sub(Observability::new(&both, self.scale).rank());
        if shared == 0 {
            return Err(IdentificationError::NoEstimate { rank: other.rank });
        }
        let normalised_rms = (chi_square / shared as f64).sqrt();
        Ok(Validation { nodes: other.samples_used, normalised_rms, wrench: None })
    }
}
