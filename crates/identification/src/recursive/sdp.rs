//! Recursive least squares whose every answer is a body.

use super::{ChiSquareGate, LinearObservation, Outcome, RecursiveEstimator, SquareRootFilter};
use crate::consistency::{ConstrainedEstimate, ConstrainedLeastSquares, FeasibleSet, InteriorPoint, PseudoInertiaCone};
use crate::error::IdentificationError;
use nalgebra::{SMatrix, SVector};

/// The ten parameters under the pseudo-inertia constraint after every update, the first one included.
///
/// What is learned is learned without the constraint, in a [`SquareRootFilter`]: innovations, gate and covariance are its
/// own, and white where the model holds. What is reported is the best body for that information. Where the unconstrained
/// optimum is a body the two agree and cost a microsecond together; where not, the solver starts afresh, as interior-point
/// methods gain nothing from the neighbourhood of the last answer on the boundary.
///
/// # Source
/// Thesis (5.39), (5.34)-(5.37).
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct RecursiveSdp<const ROWS: usize> {
    filter: SquareRootFilter<10, ROWS>,
    cone: PseudoInertiaCone,
    estimate: ConstrainedEstimate<10>,
}

/// Duality gap that must do, relative to |z|², where the absolute one is out of reach of rounding.
const RELATIVE_GAP: f64 = 1e-9;

impl<const ROWS: usize> RecursiveSdp<ROWS> {
    /// Starts from the cone's own interior point, a uniform ball of its scale, with these standard deviations in units of
    /// [`BodyScale::parameter_magnitudes`](crate::BodyScale::parameter_magnitudes): 10 is vague.
    ///
    /// # Errors
    /// [`IdentificationError::NotPositive`].
    pub fn try_new(cone: PseudoInertiaCone, relative_deviation: f64) -> Result<Self, IdentificationError> {
        Self::try_with_prior(cone, cone.interior_point(), cone.magnitudes() * relative_deviation)
    }

    /// Starts from independent knowledge of every parameter; the mean need not be a body.
    ///
    /// # Errors
    /// As [`SquareRootFilter::try_new`]; [`IdentificationError::NotConverged`].
    pub fn try_with_prior(
        cone: PseudoInertiaCone,
        mean: SVector<f64, 10>,
        standard_deviation: SVector<f64, 10>,
    ) -> Result<Self, IdentificationError> {
        let filter = SquareRootFilter::try_new(mean, standard_deviation)?;
        Ok(Self { filter, cone, estimate: best_body(&cone, &filter)? })
    }

    /// The same behind a gate.
    pub fn with_gate(self, gate: ChiSquareGate) -> Self {
        Self { filter: self.filter.with_gate(gate), ..self }
    }

    /// The reported body with the proof of its quality.
    pub fn estimate(&self) -> &ConstrainedEstimate<10> {
        &self.estimate
    }

    /// The unconstrained filter beneath.
    pub fn unconstrained(&self) -> &SquareRootFilter<10, ROWS> {
        &self.filter
    }
}

fn best_body<const ROWS: usize>(
    cone: &PseudoInertiaCone,
    filter: &SquareRootFilter<10, ROWS>,
) -> Result<ConstrainedEstimate<10>, IdentificationError> {
    let information = filter.information();
    match InteriorPoint::new(*cone).solve(information) {
        Err(IdentificationError::NotConverged { .. }) => {
            let relative = RELATIVE_GAP * information.rhs().norm_squared();
            InteriorPoint::with_gap_tolerance(*cone, relative).solve(information)
        }
        found => found,
    }
}

impl<const ROWS: usize> RecursiveEstimator<10, ROWS> for RecursiveSdp<ROWS> {
    type Observation = LinearObservation<ROWS, 10>;

    /// # Errors
    /// Those of the filter, and [`IdentificationError::NotExcited`], [`IdentificationError::NotConverged`] of the solver;
    /// nothing is changed then.
    fn update(&mut self, observation: &Self::Observation) -> Result<Outcome<ROWS>, IdentificationError> {
        let mut filter = self.filter;
        let outcome = filter.update(observation)?;
        if outcome.is_accepted() {
            self.estimate = best_body(&self.cone, &filter)?;
        }
        self.filter = filter;
        Ok(outcome)
    }

    /// Strictly inside the cone, always.
    fn parameters(&self) -> SVector<f64, 10> {
        self.estimate.parameters
    }

    /// Of the solution before the constraint.
    fn covariance(&self) -> SMatrix<f64, 10, 10> {
        self.filter.covariance()
    }
}
