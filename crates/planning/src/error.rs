//! Errors of this crate.

/// What can be wrong with a planning problem. That a well-posed problem has no solution is an answer, not an error.
#[derive(Debug, Clone, Copy, PartialEq, thiserror::Error)]
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
    /// A body without parts.
    #[error("the body has no parts: nothing can be checked for collision")]
    NoBody,
    /// The back end cannot answer this query.
    #[error("this collision world cannot {query}")]
    Unsupported {
        /// What was asked for.
        query: &'static str,
    },
}

/// `value` where it is finite.
///
/// # Errors
/// [`PlanningError::NotFinite`].
pub fn finite(what: &'static str, value: f64) -> Result<f64, PlanningError> {
    if value.is_finite() { Ok(value) } else { Err(PlanningError::NotFinite { what, value }) }
}

/// `value` where it is finite and positive.
///
/// # Errors
/// [`PlanningError::NotFinite`], [`PlanningError::NotPositive`].
pub fn positive(what: &'static str, value: f64) -> Result<f64, PlanningError> {
    if finite(what, value)? > 0.0 { Ok(value) } else { Err(PlanningError::NotPositive { what, value }) }
}
