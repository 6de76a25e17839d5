//! The likelihood in units in which a record is ordinary: its iterations begin from a body of some size and with stretches of some seconds.

use super::{BodyChange, LikelihoodEstimate, MaximumLikelihood, SegmentResidual};
use crate::dynamics::InertialParameters;
use crate::units::Units;
use nalgebra::{SMatrix, SVector};

impl MaximumLikelihood {
    /// The same in these units. What is left at its default is for an ordinary record and stays as it is.
    pub(super) fn in_units(&self, units: &Units) -> Self {
        let usual = Self::default();
        let start = if self.start == usual.start {
            self.start
        } else {
            InertialParameters::from_vector(&self.start.to_vector().component_mul(&units.parameter_factors()))
        };
        #[allow(clippy::float_cmp)] // the default itself
        let node_window_s = if self.node_window_s == usual.node_window_s {
            self.node_window_s
        } else {
            self.node_window_s * units.time()
        };
        Self {
            gravity_world: units.gravity(&self.gravity_world),
            noise: self.noise.map(|noise| units.noise(&noise)),
            start,
            node_window_s,
            ..self.clone()
        }
    }
}

impl LikelihoodEstimate {
    /// An estimate without nuisances in other units: from those of a record to `units`.
    pub(super) fn in_units(self, units: &Units) -> Self {
        let factors = units.parameter_factors();
        let scaled = |parameters: &SVector<f64, 10>| parameters.component_mul(&factors);
        // ln m, c, J_C
        let by_mass = SVector::<f64, 10>::from_fn(|i, _| match i {
            0 => 1.0,
            1..=3 => units.length(),
            _ => factors[i],
        });
        let [torque, force] = self.visible_wrench_noise;
        Self {
            parameters: InertialParameters::from_vector(&scaled(&self.parameters.to_vector())),
            unconstrained: scaled(&self.unconstrained),
            covariance: SMatrix::from_fn(|i, j| self.covariance[(i, j)] * factors[i] * factors[j]),
            std: self.std.component_mul(&by_mass),
            noise: units.noise(&self.noise),
            visible_wrench_noise: [torque * units.force() * units.length(), force * units.force()],
            residuals: self
                .residuals
                .iter()
                .map(|residual| SegmentResidual { wrench: units.wrench(&residual.wrench), ..*residual })
                .collect(),
            body_change: self.body_change.map(|change| BodyChange {
                before: scaled(&change.before),
                after: scaled(&change.after),
                deviation: scaled(&change.deviation),
                ..change
            }),
            ..self
        }
    }
}
