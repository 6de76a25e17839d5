//! What every estimator has in common, without the standard library and, but for boxed sources of errors, without an allocator.

mod error;
#[cfg(feature = "std")]
mod estimate;
mod finding;
mod judge;
#[cfg(feature = "std")]
mod state_estimator;

pub use error::{EstimatorError, Source};
pub use finding::Finding;
pub use judge::{Evidence, Judge, Verdict, Why};
#[cfg(feature = "std")]
pub use state_estimator::{Acted, Doubt, Gauss, Measurement, Sensor, StateEstimator};

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
    /// Logarithm of the probability density of the innovation.
    pub log_likelihood: f64,
    /// What the gate made of it.
    pub gate: recursive::Verdict,
}

impl<const ROWS: usize> From<recursive::Outcome<ROWS>> for Outcome {
    fn from(found: recursive::Outcome<ROWS>) -> Self {
        let recursive::Outcome { innovation, verdict: gate } = found;
        let (nis, degrees_of_freedom) = (innovation.nis, innovation.degrees_of_freedom);
        Self { nis, degrees_of_freedom, log_likelihood: innovation.log_likelihood(), gate }
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
