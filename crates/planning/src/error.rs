//! Errors of this crate.

use nalgebra::{DMatrix, SMatrix, UnitQuaternion, Vector3};
use tumble_dynamics::ForeignError;
use tumble_identification::estimator::EstimatorError;
use tumble_lie::Pose;

/// What can be wrong with a planning problem. That a well-posed problem has no solution is an answer, not an error.
///
/// Worlds, models, planners and controllers from outside answer with [`Foreign`](Self::Foreign), which keeps their own error:
/// ```
/// use tumble_planning::PlanningError;
/// let error = PlanningError::foreign("octree", std::io::Error::other("map 7 is not loaded"));
/// assert_eq!(error.to_string(), "octree: map 7 is not loaded");
/// assert!(std::error::Error::source(&error).is_some_and(|source| source.is::<std::io::Error>()));
/// ```
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum PlanningError {
    /// An error of the body or its motion.
    #[error(transparent)]
    Dynamics(#[from] tumble_dynamics::DynamicsError),
    /// A number that must be finite is not.
    #[error("{what} is {value}, not a finite number")]
    NotFinite {
        /// Which number.
        what: &'static str,
        /// Its value.
        value: f64,
    },
    /// A number that must be positive is not.
    #[error("{what} is {value}, not positive")]
    NotPositive {
        /// Which number.
        what: &'static str,
        /// Its value.
        value: f64,
    },
    /// A number that must not be negative is.
    #[error("{what} is {value}, which is negative")]
    Negative {
        /// Which number.
        what: &'static str,
        /// Its value.
        value: f64,
    },
    /// A number outside the range it must lie in.
    #[error("{what} is {value}, not between {lower} and {upper}")]
    OutOfRange {
        /// Which number.
        what: &'static str,
        /// Its value.
        value: f64,
        /// Least accepted value.
        lower: f64,
        /// Largest accepted value.
        upper: f64,
    },
    /// A box whose least coordinate is beyond its largest.
    #[error("{what} has its least coordinate {lower} beyond its largest {upper} on axis {axis}")]
    EmptyBox {
        /// Which box.
        what: &'static str,
        /// 0 to 2.
        axis: usize,
        /// Least coordinate, m.
        lower: f64,
        /// Largest coordinate, m.
        upper: f64,
    },
    /// A model that has not been told yet what to believe.
    #[error("nothing is believed of the body yet")]
    NoBelief,
    /// A feedback that lets errors grow, so that no bounded invariant set exists.
    #[error("the closed loop is not contractive: its spectral radius is {spectral_radius}, which must be below one")]
    NotContractive {
        /// Largest modulus of an eigenvalue; infinite where a number is not finite.
        spectral_radius: f64,
    },
    /// A part of a world that cannot be.
    #[error("{part} {index}: {what} is {value}")]
    InvalidWorld {
        /// Obstacle, keep-out or keep-in box.
        part: &'static str,
        /// Its index in its list.
        index: usize,
        /// Which of its numbers.
        what: &'static str,
        /// Its value.
        value: f64,
    },
    /// A list of another length than it must have.
    #[error("{given} {what}, not {expected}")]
    WrongCount {
        /// What is listed.
        what: &'static str,
        /// How many there are.
        given: usize,
        /// How many there must be.
        expected: usize,
    },
    /// A matrix that must be symmetric is not.
    #[error("{what} is not symmetric")]
    Asymmetric {
        /// Which matrix.
        what: &'static str,
    },
    /// A body without parts.
    #[error("the body has no parts: nothing can be checked for collision")]
    NoBody,
    /// An ellipsoid so thin that no answer could be certified.
    #[error("semi-axes {smallest} and {largest} m differ by more than the factor {factor} that can be certified")]
    TooUnlike {
        /// Smallest semi-axis, m.
        smallest: f64,
        /// Largest semi-axis, m.
        largest: f64,
        /// Largest accepted ratio.
        factor: f64,
    },
    /// The back end cannot answer this query.
    #[error("this collision world cannot {query}")]
    Unsupported {
        /// What was asked for.
        query: &'static str,
    },
    /// A feedback of one axis under which errors swing, or nearly do.
    #[error("the closed loop has not two different real eigenvalues: its discriminant is {discriminant}")]
    Oscillating {
        /// Square of half the difference of its eigenvalues.
        discriminant: f64,
    },
    /// An error of the estimator.
    #[error(transparent)]
    Identification(#[from] tumble_identification::IdentificationError),
    /// An error of an estimator behind its trait.
    #[error(transparent)]
    Estimator(#[from] EstimatorError),
    /// A layer that no registry has.
    #[error(transparent)]
    Unknown(#[from] tumble_identification::UnknownName),
    /// An error of an implementation from outside. Two are equal where they are the same object.
    #[error("{by}: {source}")]
    Foreign {
        /// Its name.
        by: &'static str,
        /// What it says.
        source: ForeignError,
    },
}

impl PlanningError {
    /// An error of somebody else's world, model, planner or controller.
    pub fn foreign(by: &'static str, source: impl std::error::Error + Send + Sync + 'static) -> Self {
        Self::Foreign { by, source: ForeignError::made(source) }
    }
}

/// `value` where it is finite.
///
/// # Errors
/// [`PlanningError::NotFinite`].
pub fn finite(what: &'static str, value: f64) -> Result<f64, PlanningError> {
    if value.is_finite() { Ok(value) } else { Err(PlanningError::NotFinite { what, value }) }
}

/// `value` where it is finite and not negative.
///
/// # Errors
/// [`PlanningError::NotFinite`], [`PlanningError::Negative`].
pub fn not_negative(what: &'static str, value: f64) -> Result<f64, PlanningError> {
    if finite(what, value)? >= 0.0 { Ok(value) } else { Err(PlanningError::Negative { what, value }) }
}

/// `value` where it is finite and positive.
///
/// # Errors
/// [`PlanningError::NotFinite`], [`PlanningError::NotPositive`].
pub fn positive(what: &'static str, value: f64) -> Result<f64, PlanningError> {
    if finite(what, value)? > 0.0 { Ok(value) } else { Err(PlanningError::NotPositive { what, value }) }
}

/// What is wrong with a symmetric matrix that has no Cholesky factor: a number that is none, or its least eigenvalue.
pub(crate) fn indefinite<const N: usize>(what: &'static str, matrix: &SMatrix<f64, N, N>) -> PlanningError {
    if let Some(value) = matrix.iter().find(|number| !number.is_finite()) {
        PlanningError::NotFinite { what, value: *value }
    } else {
        let dynamic = DMatrix::from_iterator(N, N, matrix.iter().copied());
        PlanningError::NotPositive { what, value: dynamic.symmetric_eigenvalues().min() }
    }
}

/// Largest number accepted, in SI units; one over it is the smallest length. Far beyond every scene, and small enough that no
/// product or quotient here leaves the floating-point numbers.
pub const LARGEST: f64 = 1e20;

/// How far the squared norm of an attitude may be from one.
const UNIT: f64 = 1e-3;

fn between(what: &'static str, value: f64, least: f64, largest: f64) -> Result<f64, PlanningError> {
    let is_between = value >= least && value <= largest;
    if is_between { Ok(value) } else { Err(PlanningError::OutOfRange { what, value, lower: least, upper: largest }) }
}

/// `value` where it is finite and not huge.
///
/// # Errors
/// [`PlanningError::NotFinite`], [`PlanningError::OutOfRange`].
pub fn moderate(what: &'static str, value: f64) -> Result<f64, PlanningError> {
    between(what, finite(what, value)?, -LARGEST, LARGEST)
}

/// `value` where it is a length of something solid: positive, neither huge nor tiny.
///
/// # Errors
/// [`PlanningError::NotFinite`], [`PlanningError::NotPositive`], [`PlanningError::OutOfRange`].
pub fn length(what: &'static str, value: f64) -> Result<f64, PlanningError> {
    between(what, positive(what, value)?, 1.0 / LARGEST, LARGEST)
}

/// Largest ratio of the semi-axes of one solid: beyond, 53 bits do not hold the squares of both.
const THINNEST: f64 = 1e4;

/// Checks that semi-axes are those of a solid that can be computed with.
///
/// # Errors
/// Those of [`length`]; [`PlanningError::TooUnlike`].
pub fn semi_axes(what: &'static str, semi_axes: &Vector3<f64>) -> Result<(), PlanningError> {
    for semi_axis in semi_axes {
        length(what, *semi_axis)?;
    }
    let (smallest, largest) = (semi_axes.min(), semi_axes.max());
    let is_alike = largest <= smallest * THINNEST;
    if is_alike { Ok(()) } else { Err(PlanningError::TooUnlike { smallest, largest, factor: THINNEST }) }
}

/// `value` where it is zero, or finite and neither huge nor tiny.
///
/// # Errors
/// [`PlanningError::NotFinite`], [`PlanningError::OutOfRange`].
pub fn zero_or_moderate(what: &'static str, value: f64) -> Result<f64, PlanningError> {
    if value == 0.0 { Ok(value) } else { between(what, finite(what, value)?, 1.0 / LARGEST, LARGEST) }
}

/// Checks that a pose is one, and not beyond what can be computed with.
///
/// # Errors
/// [`PlanningError::NotFinite`], [`PlanningError::OutOfRange`].
#[inline]
pub fn pose(pose: &Pose<f64>) -> Result<(), PlanningError> {
    attitude(&pose.rotation)?;
    let sum_of_squares = pose.translation.vector.norm_squared();
    moderate("the distance of a pose from the origin", f64::sqrt(sum_of_squares)).map(|_| ())
}

/// Checks that an attitude is one.
///
/// # Errors
/// [`PlanningError::NotFinite`], [`PlanningError::OutOfRange`].
#[inline]
pub fn attitude(attitude: &UnitQuaternion<f64>) -> Result<(), PlanningError> {
    let what = "the squared norm of an attitude";
    between(what, finite(what, attitude.coords.norm_squared())?, 1.0 - UNIT, 1.0 + UNIT).map(|_| ())
}
