//! Errors of this crate.

/// What can be wrong with a body, a model or a step.
#[derive(Debug, Clone, Copy, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum DynamicsError {
    /// A geometric error.
    #[error(transparent)]
    Lie(#[from] tumble_lie::LieError),
    /// No mass distribution has these parameters.
    #[error("no body has these inertial parameters: relative margin of the pseudo-inertia {margin:e}")]
    NotRealizable {
        /// Smallest eigenvalue of the normalised pseudo-inertia; positive inside.
        margin: f64,
    },
    /// The implicit equations of a step did not converge.
    #[error(
        "the step of {step_s} s did not converge: residual {residual:e} after {iterations} iterations; shorten the step"
    )]
    StepNotConverged {
        /// Step length, s.
        step_s: f64,
        /// Residual reached.
        residual: f64,
        /// Iterations done.
        iterations: u32,
    },
    /// A value that is not finite, or a step that is not positive where it must be.
    #[error("value is not finite")]
    NotFinite,
}
