//! Recursive least squares whose every answer lies in a set.

use super::{ChiSquareGate, LinearObservation, RowsOutcome, SquareRootFilter};
use crate::consistency::{ConstrainedEstimate, ConstrainedLeastSquares, FeasibleSet, InteriorPoint, PseudoInertiaCone};
use crate::error::IdentificationError;
use crate::estimator::{EstimatorError, Finding, Outcome, RecursiveEstimator};
use nalgebra::{SMatrix, SVector};

/// `P` parameters under a constraint after every update, the first one included: the ten under that of the pseudo-inertia, or any others
/// in the set of any [`ConstrainedLeastSquares`].
///
/// What is learned is learned without the constraint, in a [`SquareRootFilter`]: innovations, gate and covariance are its
/// own, and white where the model holds. What is reported is the best body for that information. Where the unconstrained
/// optimum is a body the two agree and cost a microsecond together; where not, the solver starts afresh, as interior-point
/// methods gain nothing from the neighbourhood of the last answer on the boundary.
///
/// # Source
/// Thesis (5.39), (5.34)-(5.37).
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct RecursiveSdp<S, const P: usize, const ROWS: usize> {
    filter: SquareRootFilter<P, ROWS>,
    solver: S,
    estimate: ConstrainedEstimate<P>,
}

impl<const ROWS: usize> RecursiveSdp<InteriorPoint, 10, ROWS> {
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
        Self::over(InteriorPoint::new(cone), SquareRootFilter::try_new(mean, standard_deviation)?)
    }
}

impl<S: ConstrainedLeastSquares<P>, const P: usize, const ROWS: usize> RecursiveSdp<S, P, ROWS> {
    /// What `filter` learns, in the set of `solver`.
    ///
    /// # Errors
    /// Those of the solver.
    pub fn over(solver: S, filter: SquareRootFilter<P, ROWS>) -> Result<Self, IdentificationError> {
        let estimate = solver.solve(filter.information())?;
        Ok(Self { filter, solver, estimate })
    }

    /// The same behind a gate.
    pub fn with_gate(self, gate: ChiSquareGate) -> Self {
        Self { filter: self.filter.with_gate(gate), ..self }
    }

    /// The reported point with the proof of its quality.
    pub fn estimate(&self) -> &ConstrainedEstimate<P> {
        &self.estimate
    }

    /// The unconstrained filter beneath.
    pub fn unconstrained(&self) -> &SquareRootFilter<P, ROWS> {
        &self.filter
    }

    /// Judges the rows and, unless they are rejected, learns from them.
    ///
    /// # Errors
    /// Those of the filter, and [`IdentificationError::NotExcited`], [`IdentificationError::NotConverged`] of the solver;
    /// nothing is changed then.
    pub fn update_rows(
        &mut self,
        observation: &LinearObservation<ROWS, P>,
    ) -> Result<RowsOutcome<ROWS>, IdentificationError> {
        let mut filter = self.filter;
        let outcome = filter.update_rows(observation)?;
        if outcome.is_accepted() {
            self.estimate = self.solver.solve(filter.information())?;
        }
        self.filter = filter;
        Ok(outcome)
    }

    /// Strictly inside the set, always.
    pub fn parameters(&self) -> SVector<f64, P> {
        self.estimate.parameters
    }

    /// Of the solution before the constraint.
    pub fn covariance(&self) -> SMatrix<f64, P, P> {
        self.filter.covariance()
    }
}

impl<S: ConstrainedLeastSquares<P>, const P: usize, const ROWS: usize> RecursiveEstimator<P>
    for RecursiveSdp<S, P, ROWS>
{
    type Observation = LinearObservation<ROWS, P>;

    fn update(&mut self, observation: &Self::Observation) -> Result<Outcome, EstimatorError> {
        Ok(self.update_rows(observation)?.into())
    }

    fn finding(&self) -> Result<Finding<P>, EstimatorError> {
        Ok(self.filter.finding()?.at(self.estimate.parameters))
    }
}
