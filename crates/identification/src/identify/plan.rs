//! What to do, and by what.

use super::rows::Regression;
use super::settings::{AUTO, FLIGHT_LIKELIHOOD, MAXIMUM_LIKELIHOOD, Settings};
use crate::BodyScale;
use crate::consistency::{ConstrainedLeastSquares, InteriorPoint, PseudoInertiaCone};
use crate::error::IdentificationError;
use crate::estimator::Judge;
use crate::likelihood::FlightLikelihood;

/// Share of feedback that segments shorter than what a loop takes to answer bear, in units of what others do: up to there masses show no bias.
const SHORT_SEGMENTS: f64 = 1.25;

/// Every built-in method: its name, what it is in a sentence, and how it comes to an answer.
pub(super) const BUILT_IN: [(&str, &str, Way); 11] = [
    (AUTO, "Chosen from the columns and the noise found", Way::Auto),
    (
        "newton-euler",
        "Newton-Euler with measured rates, velocities or accelerations",
        Way::Rows(Regression::NewtonEuler),
    ),
    ("variational", "Variational regressor, order 2, poses only", Way::Rows(Regression::Variational)),
    ("variational4", "Extrapolated variational regressor, order 4, poses only", Way::Rows(Regression::Variational4)),
    ("variational6", "Extrapolated variational regressor, order 6, poses only", Way::Rows(Regression::Variational6)),
    (MAXIMUM_LIKELIHOOD, "Maximum likelihood from noisy poses and wrenches", Way::Likelihood),
    (
        FLIGHT_LIKELIHOOD,
        "Maximum likelihood with sensors that wander, filter, lag, are off in scale and bias",
        Way::FlightLikelihood,
    ),
    ("rls", "Recursive least squares in covariance form", Way::Rls),
    ("recursive-sdp", "Recursive least squares whose every answer is a body", Way::RecursiveSdp),
    ("ekf", "Extended Kalman filter of motion and parameters", Way::Ekf),
    ("ukf", "Unscented Kalman filter of motion and parameters", Way::Ukf),
];

/// How an answer comes about.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Way {
    Auto,
    Rows(Regression),
    Likelihood,
    FlightLikelihood,
    Rls,
    RecursiveSdp,
    Ekf,
    Ukf,
    /// An estimator from outside; its finding takes the place of that of the rows.
    Other,
}

impl Way {
    pub(super) fn named(name: &'static str) -> Result<Self, IdentificationError> {
        let known = BUILT_IN.iter().find(|(known, ..)| *known == name);
        known.map(|(_, _, way)| *way).ok_or(IdentificationError::UnknownMethod { asked: name })
    }

    /// Has no rows of its own, and is judged by those of order 4.
    pub(super) fn is_recursive(self) -> bool {
        matches!(self, Self::Rls | Self::RecursiveSdp | Self::Ekf | Self::Ukf | Self::Other)
    }

    /// Rows of a way that has or needs some.
    pub(super) fn regression(self) -> Regression {
        match self {
            Self::Rows(regression) => regression,
            _ => Regression::Variational4,
        }
    }

    pub(super) fn of_regression(regression: Regression) -> &'static str {
        let found = BUILT_IN.iter().find(|(_, _, way)| *way == Self::Rows(regression));
        found.map_or(AUTO, |(name, ..)| *name)
    }
}

/// A solver for a body of this size.
pub(crate) type SolverFor<'a> = &'a dyn Fn(BodyScale) -> Box<dyn ConstrainedLeastSquares<10>>;

/// What to do, and by what: settings, constrained solver and judge are one.
#[derive(Clone, Copy)]
pub(crate) struct Plan<'a> {
    pub(crate) settings: &'a Settings,
    /// What [`Identification::method`](super::Identification::method) says.
    pub(super) name: &'static str,
    pub(super) way: Way,
    pub(super) solver: SolverFor<'a>,
    pub(super) judge: Judge,
    /// What the likelihood of flight is told beside the settings.
    pub(super) flown: Option<&'a FlightLikelihood>,
}

impl<'a> Plan<'a> {
    /// A built-in method with the usual solver and the usual judge.
    pub(super) fn usual(settings: &'a Settings) -> Result<Self, IdentificationError> {
        // The judge of a record takes the units of its body.
        let judge = Judge::new(BodyScale::try_new(1.0, 1.0)?);
        let way = Way::named(settings.method)?;
        Ok(Self { settings, name: settings.method, way, solver: &interior_point, judge, flown: None })
    }

    /// The judge of what a method found.
    pub(super) fn judge_of(&self, method: &str) -> Judge {
        let segments = if method == FLIGHT_LIKELIHOOD { SHORT_SEGMENTS } else { 1.0 };
        Judge { feedback: segments * self.judge.feedback, ..self.judge }
    }
}

pub(super) fn interior_point(scale: BodyScale) -> Box<dyn ConstrainedLeastSquares<10>> {
    Box::new(InteriorPoint::new(PseudoInertiaCone::new(scale)))
}
