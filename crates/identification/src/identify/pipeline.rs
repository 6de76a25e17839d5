//! Identification by any estimator, constrained by any solver.

use super::environment::{in_environment, with_all_that_acts};
use super::identification::Identification;
use super::parts::{Parts, in_parts};
use super::plan::{BUILT_IN, Plan, Way, interior_point};
use super::problem::{Chosen, JointFilter, Problem, Regressed};
use super::recursion::{self, Replaced};
use super::settings::Settings;
use super::verdict::Beside;
use super::{recursed, reference, run};
use crate::BodyScale;
use crate::consistency::{BarrierNewton, ConstrainedLeastSquares, FeasibleSet, InteriorPoint, PseudoInertiaCone};
use crate::dynamics::{Environment, InertialParameters};
use crate::error::IdentificationError;
use crate::estimator::{Estimator, EstimatorError, Finding, Judge, Replay};
use crate::likelihood::{FlightLikelihood, MaximumLikelihood};
use crate::motion::MotionSample;
use crate::recursive::{RecursiveLeastSquares, RecursiveSdp};
use crate::registry::Registry;
use nalgebra::SMatrix;
use std::borrow::Cow;

/// Standard deviations of the vague start of a recursion, in units of the body's own scale.
const VAGUE: f64 = 30.0;

/// Estimators of a motion record by name, each made for a [`Problem`].
pub type Methods = Registry<Problem, dyn Estimator<Record = [MotionSample]> + Send + Sync, EstimatorError>;

/// Constrained solvers by name, each made for a body of some size.
pub type ConstrainedSolvers = Registry<BodyScale, dyn ConstrainedLeastSquares<10> + Send + Sync, EstimatorError>;

/// The library's own methods, each an estimator: `auto`, `newton-euler`, `variational`, `variational4`, `variational6`,
/// `maximum-likelihood`, `flight-likelihood`, `rls`, `recursive-sdp`, `ekf`, `ukf`.
pub fn methods() -> Methods {
    BUILT_IN.iter().fold(Methods::new("method"), |methods, (name, sentence, way)| {
        let way = *way;
        methods.with(name, sentence, move |problem: &Problem| Ok(made(way, *problem)))
    })
}

fn made(way: Way, problem: Problem) -> Box<dyn Estimator<Record = [MotionSample]> + Send + Sync> {
    match way {
        Way::Auto | Way::Other => Box::new(Chosen(problem)),
        Way::Rows(regression) => Box::new(Regressed::new(Problem { regression, ..problem })),
        Way::Likelihood => Box::new(MaximumLikelihood {
            wrench_timing: problem.wrench_timing,
            gravity_world: problem.gravity_world,
            nuisances: problem.estimate.iter().collect(),
            ..MaximumLikelihood::default()
        }),
        Way::FlightLikelihood => Box::new(FlightLikelihood {
            wrench_timing: problem.wrench_timing,
            gravity_world: problem.gravity_world,
            ..FlightLikelihood::default()
        }),
        Way::Rls => Box::new(Replay::new(problem, move |_: &[MotionSample]| {
            let deviation = problem.scale.parameter_magnitudes() * VAGUE;
            let covariance = SMatrix::from_diagonal(&deviation.map(|s| s * s));
            let ball = PseudoInertiaCone::new(problem.scale).interior_point();
            Ok(RecursiveLeastSquares::<10, 6>::new(ball, covariance))
        })),
        Way::RecursiveSdp => Box::new(Replay::new(problem, move |_: &[MotionSample]| {
            Ok(RecursiveSdp::<_, 10, 6>::try_new(PseudoInertiaCone::new(problem.scale), VAGUE)?)
        })),
        Way::Ekf => Box::new(JointFilter::extended(problem)),
        Way::Ukf => Box::new(JointFilter::unscented(problem)),
    }
}

/// The library's constrained solvers: `interior-point`, `barrier-newton`, and with the feature `clarabel-sdp` `clarabel`.
pub fn constrained_solvers() -> ConstrainedSolvers {
    let solvers = ConstrainedSolvers::new("constrained solver")
        .with("interior-point", "Primal-dual interior point of fixed size for the pseudo-inertia cone", |scale| {
            Ok(Box::new(InteriorPoint::new(PseudoInertiaCone::new(*scale))))
        })
        .with("barrier-newton", "Path following on the barrier of any set", |scale| {
            Ok(Box::new(BarrierNewton::new(PseudoInertiaCone::new(*scale))))
        });
    #[cfg(feature = "clarabel-sdp")]
    let solvers = solvers.with("clarabel", "The general conic solver Clarabel", |scale| {
        Ok(Box::new(crate::consistency::ClarabelSdp::new(PseudoInertiaCone::new(*scale), 1e-9)))
    });
    solvers
}

/// [`identify`](crate::identify) with the user's own: estimators by name, the constrained solver, the levels of the judge.
///
/// An estimator from outside answers in the place of the rows of its [`Problem`]; its point is moved into the set of the constrained solver,
/// and the judge holds it against a finding of the library's own.
///
/// # Example
/// ```
/// use tumble_identification::{BarrierNewton, Pipeline, PseudoInertiaCone, Regressed, Settings};
///
/// let pipeline = Pipeline::new()
///     .with("mine", "weighted least squares under another name", |problem| Ok(Box::new(Regressed::new(*problem))))
///     .constrained_by(|scale| Box::new(BarrierNewton::new(PseudoInertiaCone::new(scale))));
/// let found = pipeline.identify(&[], &Settings { method: "mien", ..Settings::default() });
/// assert!(found.unwrap_err().to_string().contains("ukf, mine"));
/// ```
///
/// Tutorial: [an estimator of your own](https://github.com/tumble-robotics/tumble/blob/main/crates/identification/tests/suite/custom_estimator.rs).
pub struct Pipeline {
    methods: Methods,
    /// Names that are the user's.
    own: Vec<&'static str>,
    solver: Box<dyn Fn(BodyScale) -> Box<dyn ConstrainedLeastSquares<10>> + Send + Sync>,
    levels: Option<Judge>,
    environment: Environment,
    flown: Option<FlightLikelihood>,
}

impl Default for Pipeline {
    fn default() -> Self {
        Self::new()
    }
}

impl Pipeline {
    /// The built-in methods, the interior point, the usual judge.
    pub fn new() -> Self {
        Self {
            methods: methods(),
            own: Vec::new(),
            solver: Box::new(interior_point),
            levels: None,
            environment: Environment::default(),
            flown: None,
        }
    }

    /// Adds an estimator, made anew for the problem of each record; one of the same name is replaced, a built-in one too.
    #[must_use]
    pub fn with(
        mut self,
        name: &'static str,
        sentence: &'static str,
        make: impl Fn(&Problem) -> Result<Box<dyn Estimator<Record = [MotionSample]> + Send + Sync>, EstimatorError>
        + Send
        + Sync
        + 'static,
    ) -> Self {
        self.methods = self.methods.with(name, sentence, make);
        self.own.push(name);
        self
    }

    /// Another solver, over another set perhaps, for a body of the size that the record shows.
    #[must_use]
    pub fn constrained_by(
        mut self,
        make: impl Fn(BodyScale) -> Box<dyn ConstrainedLeastSquares<10>> + Send + Sync + 'static,
    ) -> Self {
        self.solver = Box::new(make);
        self
    }

    /// Other levels; the scale of this judge is replaced by that of the body of each record.
    #[must_use]
    pub fn judged_by(mut self, levels: Judge) -> Self {
        self.levels = Some(levels);
        self
    }

    /// What `flight-likelihood` is told beside the [`Settings`]: sensors, thrusters, whether the motion is one in the plane. Timing and gravity
    /// are those of the settings.
    #[must_use]
    pub fn flown_with(mut self, told: FlightLikelihood) -> Self {
        self.flown = Some(told);
        self
    }

    /// What acts on the body beside the logged wrench, as in [`identify_in`](crate::identify_in).
    #[must_use]
    pub fn acted_on_by(mut self, environment: Environment) -> Self {
        self.environment = environment;
        self
    }

    /// What can be asked for by name.
    pub fn methods(&self) -> &Methods {
        &self.methods
    }

    /// The body that explains a record, by [`Settings::method`].
    ///
    /// # Errors
    /// [`EstimatorError::Unknown`], which lists the known; those of [`identify`](crate::identify); those of an estimator from outside, and
    /// what it hands over that cannot be, with its name.
    pub fn identify(&self, record: &[MotionSample], settings: &Settings) -> Result<Identification, EstimatorError> {
        self.methods.check(settings.method)?;
        if !self.environment.is_empty() {
            let levels = self.levels.unwrap_or(Judge::new(BodyScale::try_new(1.0, 1.0).map_err(EstimatorError::from)?));
            let identified = |record: &[MotionSample], settings: &Settings| self.under_logged(record, settings);
            return in_environment(record, settings, &self.environment, levels, identified);
        }
        self.under_logged(record, settings)
    }

    /// The parts of a record between changes of the body, as [`identify_parts`](crate::identify_parts) takes them.
    ///
    /// # Errors
    /// Those of [`Pipeline::identify`] of the whole record.
    pub fn identify_parts(&self, record: &[MotionSample], settings: &Settings) -> Result<Parts, EstimatorError> {
        let usual = FlightLikelihood::default();
        let flown = self.flown.as_ref().unwrap_or(&usual);
        let acted = |found: &Identification| {
            let body = found.estimate.or(found.regularised);
            self.acted(record, body.as_ref().map(|body| &body.parameters))
        };
        in_parts(record, settings, flown, acted, |record, settings| self.identify(record, settings))
    }

    /// The record with what the environment does to this body.
    pub(super) fn acted<'a>(
        &self,
        record: &'a [MotionSample],
        body: Option<&InertialParameters<f64>>,
    ) -> Result<Cow<'a, [MotionSample]>, IdentificationError> {
        if self.environment.is_empty() {
            return Ok(Cow::Borrowed(record));
        }
        with_all_that_acts(record, &self.environment, body).map(Cow::Owned)
    }

    /// Where the logged wrench is all that acts.
    fn under_logged(&self, record: &[MotionSample], settings: &Settings) -> Result<Identification, EstimatorError> {
        let solver = |scale: BodyScale| (self.solver)(scale);
        let own = self.own.contains(&settings.method);
        let known = Settings { method: if own { super::AUTO } else { settings.method }, ..*settings };
        let usual = Plan::usual(&known)?;
        let way = if own { Way::Other } else { usual.way };
        let judge = self.levels.unwrap_or(usual.judge);
        let plan = Plan { name: settings.method, way, solver: &solver, judge, flown: self.flown.as_ref(), ..usual };
        if !own {
            return Ok(run(record, &plan, |fit, noise| recursed(fit, record, &plan, noise))?);
        }
        run(record, &plan, |fit, noise| {
            let other = reference(fit, record, &plan)?;
            let problem = Problem::of_fit(fit, &known, noise);
            let found = self
                .methods
                .make(plan.name, &problem)
                .and_then(|estimator| estimator.estimate(record))
                .and_then(|found| checked(&found).map(|()| found))
                .map_err(|error| named(plan.name, error))?;
            let surprise = recursion::replaced_by(fit, &found)?;
            Ok(Replaced { diverged_ns: None, beside: Beside { surprise, other } })
        })
    }
}

/// Refuses a point that no constraint makes a body.
fn checked(found: &Finding) -> Result<(), EstimatorError> {
    let Some(point) = found.point() else { return Ok(()) };
    let refused = |what, index: usize| Err(EstimatorError::Refused { what, index, value: point[index] });
    match point.iter().position(|number| !number.is_finite()) {
        Some(index) => refused("estimate", index),
        None if BodyScale::of(point).is_err() => refused("a point that is no body, mass", 0),
        None => Ok(()),
    }
}

/// An error with the name of the estimator.
fn named(by: &'static str, error: EstimatorError) -> EstimatorError {
    match error {
        foreign @ EstimatorError::Foreign { .. } => foreign,
        error => EstimatorError::foreign(by, error),
    }
}
