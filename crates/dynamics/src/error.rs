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
        /// [`InertialParameters::consistency_margin`](crate::InertialParameters::consistency_margin); positive inside.
        margin: f64,
    },
    /// An inertia tensor that is not symmetric.
    #[error("inertia tensor is not symmetric: opposite entries differ by {difference} kg m^2")]
    AsymmetricInertia {
        /// Largest difference of opposite entries, kg m^2.
        difference: f64,
    },
    /// A duration that is not positive.
    #[error("duration of {duration_s} s is not positive")]
    NotPositive {
        /// Duration, s.
        duration_s: f64,
    },
    /// The nearest consistent body was not found to full precision.
    #[error("projection onto the consistent bodies stopped after {iterations} iterations at relative gap {gap:e}")]
    ProjectionNotConverged {
        /// Relative duality gap reached.
        gap: f64,
        /// Iterations done.
        iterations: u32,
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
