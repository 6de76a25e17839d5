//! What every estimator has in common: a record or observations in, a [`Finding`] out, and a [`Judge`] who believes none on its word.
//!
//! | yours | trait | laws | tutorial |
//! |---|---|---|---|
//! | takes a whole record | [`Estimator`] | `laws::check_estimator` | [tutorial](https://github.com/tumble-robotics/tumble/blob/main/crates/identification/tests/suite/custom_estimator.rs) |
//! | takes one observation after the other | [`RecursiveEstimator`] | `laws::check_recursive_estimator` | [tutorial](https://github.com/tumble-robotics/tumble/blob/main/crates/identification/tests/suite/custom_recursive_estimator.rs) |
//! | makes observations of a record | [`Observe`]; with [`Replay`] every recursive estimator takes records | | |
//! | stays in a set | a [`FeasibleSet`](crate::FeasibleSet) or a [`ConstrainedLeastSquares`]; [`Constrained`] puts it around any estimator | `laws::check_feasible_set` | [tutorial](https://github.com/tumble-robotics/tumble/blob/main/crates/identification/tests/suite/custom_feasible_set.rs) |
//!
//! Works without the standard library and, but for boxed sources of errors, without an allocator.

mod error;
#[cfg(feature = "std")]
mod estimate;
mod finding;
#[cfg(feature = "std")]
mod in_environment;
mod judge;
#[cfg(feature = "std")]
mod measurement;
#[cfg(feature = "std")]
mod state_estimator;

pub use error::EstimatorError;
#[cfg(feature = "std")]
pub(crate) use estimate::standard_deviations;
#[cfg(feature = "std")]
pub use estimate::{Estimate, StandardDeviations};
pub use finding::Finding;
#[cfg(feature = "std")]
pub use in_environment::InEnvironment;
#[cfg(feature = "std")]
pub(crate) use judge::Counted;
pub use judge::{Evidence, Judge, Verdict, Why};
#[cfg(feature = "std")]
pub use measurement::{Gauss, Measurement, Sensor};
#[cfg(feature = "std")]
pub use state_estimator::{Acted, Doubt, StateEstimator};

use crate::consistency::ConstrainedLeastSquares;
use crate::linear_model::LinearModel;
use crate::recursive;
use nalgebra::SVector;

/// A record in, what it says of `P` parameters out. Object safe: `dyn Estimator<Record = [MotionSample]>`.
///
/// What the estimator must be told beside the record (timing, gravity, noise, size of the body) goes to its constructor.
///
/// # Shape
/// `P` parameters; for a body the ten of [`InertialParameters::to_vector`](crate::dynamics::InertialParameters::to_vector), SI units, body
/// axes about the body's origin.
///
/// # Example
/// The mean of a record of numbers with noise of one sigma 0.1:
/// ```
/// use tumble_identification::estimator::{Estimator, EstimatorError, Finding};
/// use tumble_identification::nalgebra::{SMatrix, SVector};
///
/// struct Mean;
///
/// impl Estimator<1> for Mean {
///     type Record = [f64];
///     fn estimate(&self, record: &[f64]) -> Result<Finding<1>, EstimatorError> {
///         let count = record.len() as f64;
///         let mean = record.iter().sum::<f64>() / count;
///         Finding::of_covariance(SVector::from([mean]), &SMatrix::from([[0.01 / count]]), SVector::from([1.0]))
///     }
/// }
///
/// let found = Mean.estimate(&[1.1, 0.9, 1.0, 1.0])?;
/// assert_eq!(found.point().map(|point| point[0]), Some(1.0));
/// // An empty record has no mean, and no covariance: it is refused by component and value.
/// assert_eq!(Mean.estimate(&[]).unwrap_err().to_string(), "estimate: component 0 is NaN");
/// # Ok::<(), EstimatorError>(())
/// ```
///
/// Laws: `laws::check_estimator`. Tutorial: [tutorial](https://github.com/tumble-robotics/tumble/blob/main/crates/identification/tests/suite/custom_estimator.rs).
pub trait Estimator<const P: usize = 10> {
    /// What one estimate needs.
    type Record: ?Sized;

    /// What the record says. Undetermined directions are an answer, not an error.
    ///
    /// # Errors
    /// A malformed record; those of the implementation, as [`EstimatorError::foreign`].
    fn estimate(&self, record: &Self::Record) -> Result<Finding<P>, EstimatorError>;
}

/// Observation after observation in, the same [`Finding`] out at any time. Object safe: how many rows an observation has is not in the type.
///
/// Every implementation knows something from the start, if only roughly, so that every observation is judged from the first one on; that
/// start is the prior of its findings.
///
/// # Shape
/// `P` parameters, units as in [`Estimator`].
///
/// # Example
/// Any of the library's behind one type:
/// ```
/// use tumble_identification::estimator::{EstimatorError, RecursiveEstimator};
/// use tumble_identification::nalgebra::{SMatrix, SVector};
/// use tumble_identification::recursive::{LinearObservation, RecursiveLeastSquares, SquareRootFilter};
///
/// type Row = LinearObservation<1, 2>;
/// let (mean, sigma) = (SVector::<f64, 2>::zeros(), SVector::<f64, 2>::repeat(10.0));
/// let filters: [Box<dyn RecursiveEstimator<2, Observation = Row>>; 2] = [
///     Box::new(RecursiveLeastSquares::new(mean, SMatrix::from_diagonal(&sigma.component_mul(&sigma)))),
///     Box::new(SquareRootFilter::try_new(mean, sigma)?),
/// ];
/// for mut filter in filters {
///     for (regressor, output) in [([1.0, 0.0], 3.0), ([0.0, 1.0], 4.0)] {
///         let (regressor, output) = (SMatrix::from_row_slice(&regressor), SVector::from([output]));
///         filter.update(&Row { regressor, output, standard_deviation: SVector::from([0.01]) })?;
///     }
///     let found = filter.finding()?;
///     assert!((found.point().unwrap() - SVector::from([3.0, 4.0])).amax() < 1e-3);
/// }
/// # Ok::<(), EstimatorError>(())
/// ```
///
/// Laws: `laws::check_recursive_estimator` and its neighbours. Tutorial: [tutorial](https://github.com/tumble-robotics/tumble/blob/main/crates/identification/tests/suite/custom_recursive_estimator.rs).
pub trait RecursiveEstimator<const P: usize = 10> {
    /// What one update needs.
    type Observation: ?Sized;

    /// Judges the observation and, unless it is rejected, learns from it.
    ///
    /// # Errors
    /// A malformed observation; nothing is changed then.
    fn update(&mut self, observation: &Self::Observation) -> Result<Outcome, EstimatorError>;

    /// What is known now, the prior told apart.
    ///
    /// # Errors
    /// [`EstimatorError::Refused`] where the covariance is none any more.
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
///
/// [`Problem`](crate::Problem) makes the rows of a motion record; [`Rows`] makes those of any [`LinearModel`].
///
/// # Example
/// ```
/// use tumble_identification::estimator::{EstimatorError, Observe};
/// use tumble_identification::nalgebra::{SMatrix, SVector};
/// use tumble_identification::recursive::LinearObservation;
///
/// /// Readings of a scale, each known to 20 g.
/// struct Scale;
/// impl Observe<[f64], 1> for Scale {
///     type Observation = LinearObservation<1, 1>;
///     fn each(
///         &self,
///         record: &[f64],
///         take: &mut dyn FnMut(&LinearObservation<1, 1>) -> Result<(), EstimatorError>,
///     ) -> Result<(), EstimatorError> {
///         record.iter().try_for_each(|reading_kg| {
///             take(&LinearObservation {
///                 regressor: SMatrix::from([[1.0]]),
///                 output: SVector::from([*reading_kg]),
///                 standard_deviation: SVector::from([0.02]),
///             })
///         })
///     }
/// }
/// let mut sum = 0.0;
/// Scale.each(&[1.0, 2.0], &mut |reading| {
///     sum += reading.output[0];
///     Ok(())
/// })?;
/// assert_eq!(sum, 3.0);
/// # Ok::<(), EstimatorError>(())
/// ```
/// Tutorial: [steps of a record, one by one](https://github.com/tumble-robotics/tumble/blob/main/crates/identification/tests/suite/estimator_laws.rs).
pub trait Observe<Record: ?Sized, const P: usize = 10> {
    /// What a filter takes.
    type Observation: ?Sized;

    /// Hands on one after the other.
    ///
    /// # Errors
    /// Those of making an observation, and the first of `take`, at which it stops.
    fn each(
        &self,
        record: &Record,
        take: &mut dyn FnMut(&Self::Observation) -> Result<(), EstimatorError>,
    ) -> Result<(), EstimatorError>;

    /// The part of the information of all observations that is noise in their regressors, in units of one over the parameters squared.
    ///
    /// # Errors
    /// As [`each`](Self::each).
    fn noise(&self, _record: &Record) -> Result<nalgebra::SMatrix<f64, P, P>, EstimatorError> {
        Ok(nalgebra::SMatrix::zeros())
    }
}

/// A [`LinearModel`] as a maker of rows: the record is a list of its samples, the noise of a row the same throughout.
///
/// # Example
/// ```
/// use tumble_identification::estimator::{Estimator, EstimatorError, Replay, Rows};
/// use tumble_identification::nalgebra::{SMatrix, SVector};
/// use tumble_identification::{LinearModel, recursive::SquareRootFilter};
///
/// /// Drag: force = coefficient * speed.
/// struct Drag;
/// impl LinearModel<f64, 1, 1> for Drag {
///     type Sample = (f64, f64);
///     fn regressor(&self, sample: &(f64, f64)) -> SMatrix<f64, 1, 1> {
///         SMatrix::from([[sample.0]])
///     }
///     fn output(&self, sample: &(f64, f64)) -> SVector<f64, 1> {
///         SVector::from([sample.1])
///     }
/// }
///
/// let rows = Rows::new(Drag, SVector::from([0.01]));
/// let begin = |_: &[(f64, f64)]| Ok(SquareRootFilter::<1, 1>::try_new(SVector::zeros(), SVector::from([100.0]))?);
/// let found = Replay::new(rows, begin).estimate(&[(1.0, 0.3), (2.0, 0.6)])?;
/// assert!((found.point().unwrap()[0] - 0.3).abs() < 1e-4);
/// # Ok::<(), EstimatorError>(())
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Rows<M, const ROWS: usize> {
    model: M,
    standard_deviation: SVector<f64, ROWS>,
}

impl<M, const ROWS: usize> Rows<M, ROWS> {
    /// Of this model, with the standard deviation of each of its rows, in units of the output.
    pub fn new(model: M, standard_deviation: SVector<f64, ROWS>) -> Self {
        Self { model, standard_deviation }
    }
}

impl<M, const ROWS: usize, const P: usize> Observe<[M::Sample], P> for Rows<M, ROWS>
where
    M: LinearModel<f64, ROWS, P>,
{
    type Observation = recursive::LinearObservation<ROWS, P>;

    fn each(
        &self,
        record: &[M::Sample],
        take: &mut dyn FnMut(&Self::Observation) -> Result<(), EstimatorError>,
    ) -> Result<(), EstimatorError> {
        record.iter().try_for_each(|sample| {
            let (regressor, output) = (self.model.regressor(sample), self.model.output(sample));
            take(&recursive::LinearObservation { regressor, output, standard_deviation: self.standard_deviation })
        })
    }
}

/// Any recursive estimator with a maker of observations is an estimator. The filter is begun anew for each record, by a constructor that
/// may look at it: nothing need be `Clone`, and a boxed filter replays as well as a concrete one.
///
/// Recursions over rows of several samples (`rls`, `recursive-sdp`) overstate their standard deviations, by up to 1.8: they take the samples
/// of a row for as alike as if they were one (the band of the test `stated_covariances_hold`).
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
