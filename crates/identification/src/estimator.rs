//! What every estimator has in common, without the standard library and, but for boxed sources of errors, without an allocator.

mod error;
#[cfg(feature = "std")]
mod estimate;
mod finding;
#[cfg(feature = "std")]
mod in_environment;
mod judge;
#[cfg(feature = "std")]
mod state_estimator;

pub use error::{EstimatorError, Source};
pub use finding::Finding;
#[cfg(feature = "std")]
pub use in_environment::InEnvironment;
pub use judge::{Evidence, Judge, Verdict, Why};
#[cfg(feature = "std")]
pub use state_estimator::{Acted, Doubt, Gauss, Measurement, Sensor, StateEstimator};

use crate::consistency::ConstrainedLeastSquares;
use crate::recursive;

/// A record in, what it says of `P` parameters out. Object safe: `dyn Estimator<Record = [MotionSample]>`.
pub trait Estimator<const P: usize = 10> {
    /// What one estimate needs.
    type Record: ?Sized;

    /// What the record says. Undetermined directions are an answer, not an error.
    fn estimate(&self, record: &Self::Record) -> Result<Finding<P>, EstimatorError>;
}

/// Observation after observation in, the same noun out at any time. `ROWS` is nobody's business outside: object safe.
pub trait RecursiveEstimator<const P: usize = 10> {
    /// What one update needs.
    type Observation: ?Sized;

    /// Judges the observation and, unless it is rejected, learns from it; after an error nothing has changed.
    fn update(&mut self, observation: &Self::Observation) -> Result<Outcome, EstimatorError>;

    /// What is known now, the prior told apart.
    fn finding(&self) -> Result<Finding<P>, EstimatorError>;
}

/// What an update did, free of the number of rows; matrices stay with the concrete filters.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Outcome {
    /// Normalised innovation squared.
    pub nis: f64,
    /// Rows measured.
    pub degrees_of_freedom: usize,
    /// Logarithm of the probability density of the innovation; none where the estimator does not know it.
    pub log_likelihood: Option<f64>,
    /// What the gate made of it.
    pub gate: recursive::Verdict,
}

impl<const ROWS: usize> From<recursive::RowsOutcome<ROWS>> for Outcome {
    fn from(found: recursive::RowsOutcome<ROWS>) -> Self {
        let recursive::RowsOutcome { innovation, verdict: gate } = found;
        let (nis, degrees_of_freedom) = (innovation.nis, innovation.degrees_of_freedom);
        Self { nis, degrees_of_freedom, log_likelihood: Some(innovation.log_likelihood()), gate }
    }
}

impl Outcome {
    /// Whether the observation entered the estimate.
    pub fn is_accepted(&self) -> bool {
        !matches!(self.gate, recursive::Verdict::Rejected { .. })
    }
}

/// Makes observations of a record, in the order of time: rows of a regression, steps of a motion filter.
pub trait Observe<Record: ?Sized, const P: usize = 10> {
    /// What a filter takes.
    type Observation: ?Sized;

    /// Hands on one after the other; stops at the first error of `take`.
    fn each(
        &self,
        record: &Record,
        take: &mut dyn FnMut(&Self::Observation) -> Result<(), EstimatorError>,
    ) -> Result<(), EstimatorError>;

    /// The part of the information of all observations that is noise in their regressors.
    fn noise(&self, _record: &Record) -> Result<nalgebra::SMatrix<f64, P, P>, EstimatorError> {
        Ok(nalgebra::SMatrix::zeros())
    }
}

/// Any recursive estimator with a maker of observations is an estimator. The filter is begun anew for each record, by a constructor that
/// may look at it: nothing need be `Clone`, and a boxed filter replays as well as a concrete one.
pub struct Replay<R: ?Sized, S, O> {
    begin: S,
    observe: O,
    record: core::marker::PhantomData<fn(&R)>,
}

impl<R: ?Sized, S, O> Replay<R, S, O> {
    /// Observations by `observe` into what `begin` begins.
    pub fn new<F, const P: usize>(observe: O, begin: S) -> Self
    where
        O: Observe<R, P>,
        F: RecursiveEstimator<P, Observation = O::Observation>,
        S: Fn(&R) -> Result<F, EstimatorError>,
    {
        Self { begin, observe, record: core::marker::PhantomData }
    }
}

impl<R: ?Sized, S, O, F, const P: usize> Estimator<P> for Replay<R, S, O>
where
    O: Observe<R, P>,
    F: RecursiveEstimator<P, Observation = O::Observation>,
    S: Fn(&R) -> Result<F, EstimatorError>,
{
    type Record = R;

    fn estimate(&self, record: &R) -> Result<Finding<P>, EstimatorError> {
        let mut filter = (self.begin)(record)?;
        let (mut nis, mut freedom) = (0.0, 0);
        self.observe.each(record, &mut |observation| {
            let outcome = filter.update(observation)?;
            (nis, freedom) = (nis + outcome.nis, freedom + outcome.degrees_of_freedom);
            Ok(())
        })?;
        Ok(filter.finding()?.with_noise(self.observe.noise(record)?).with_surprise(nis, freedom))
    }
}

/// Any estimator, batch or recursive, under any constraint: the point moves into the set of the solver, the information stays.
///
/// # Errors
/// Beside those of the estimator [`IdentificationError::NotExcited`](crate::IdentificationError::NotExcited) where it leaves directions
/// free and the nearest point of the set is not unique.
#[derive(Clone, Copy, Debug)]
pub struct Constrained<E, S> {
    estimator: E,
    solver: S,
}

impl<E, S> Constrained<E, S> {
    /// What `estimator` finds, in the set of `solver`.
    pub fn new(estimator: E, solver: S) -> Self {
        Self { estimator, solver }
    }

    fn inside<const P: usize>(&self, found: Finding<P>) -> Result<Finding<P>, EstimatorError>
    where
        S: ConstrainedLeastSquares<P>,
    {
        Ok(found.at(self.solver.solve(found.information())?.parameters))
    }
}

impl<E: Estimator<P>, S: ConstrainedLeastSquares<P>, const P: usize> Estimator<P> for Constrained<E, S> {
    type Record = E::Record;

    fn estimate(&self, record: &E::Record) -> Result<Finding<P>, EstimatorError> {
        self.inside(self.estimator.estimate(record)?)
    }
}

impl<E: RecursiveEstimator<P>, S: ConstrainedLeastSquares<P>, const P: usize> RecursiveEstimator<P>
    for Constrained<E, S>
{
    type Observation = E::Observation;

    fn update(&mut self, observation: &E::Observation) -> Result<Outcome, EstimatorError> {
        self.estimator.update(observation)
    }

    fn finding(&self) -> Result<Finding<P>, EstimatorError> {
        self.inside(self.estimator.finding()?)
    }
}

#[cfg(feature = "std")]
impl<T: Estimator<P> + ?Sized, const P: usize> Estimator<P> for std::boxed::Box<T> {
    type Record = T::Record;
    fn estimate(&self, record: &T::Record) -> Result<Finding<P>, EstimatorError> {
        (**self).estimate(record)
    }
}

#[cfg(feature = "std")]
impl<T: RecursiveEstimator<P> + ?Sized, const P: usize> RecursiveEstimator<P> for std::boxed::Box<T> {
    type Observation = T::Observation;
    fn update(&mut self, observation: &T::Observation) -> Result<Outcome, EstimatorError> {
        (**self).update(observation)
    }
    fn finding(&self) -> Result<Finding<P>, EstimatorError> {
        (**self).finding()
    }
}
