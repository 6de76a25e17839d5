//! Errors of this crate.

use core::error::Error;
use core::fmt;

/// What can be wrong with a body, a model or a step.
///
/// Actuators, systems and integrators from outside answer with [`Foreign`](Self::Foreign), which keeps their own error:
/// ```
/// use tumble_dynamics::DynamicsError;
///
/// #[derive(Debug)]
/// struct Seized {
///     rotor: u8,
/// }
/// impl core::fmt::Display for Seized {
///     fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
///         write!(f, "rotor {} does not turn", self.rotor)
///     }
/// }
/// impl core::error::Error for Seized {}
///
/// # #[cfg(feature = "std")]
/// let made = DynamicsError::foreign("wheel", Seized { rotor: 2 });
/// # #[cfg(feature = "std")]
/// assert_eq!(made.to_string(), "wheel: rotor 2 does not turn");
/// // Without an allocator it is a constant.
/// let fixed = DynamicsError::fixed("wheel", &Seized { rotor: 0 });
/// assert!(core::error::Error::source(&fixed).is_some_and(|source| source.is::<Seized>()));
/// ```
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
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
    /// A body that turns too far in one step for the (Phi, Psi) chart of the variational integrator.
    #[error(
        "the step of {step_s} s is too long: the body turns so far that |Phi| = {norm}, which must stay below 0.707 \
         (90 degrees)"
    )]
    StepTooLarge {
        /// Step length, s.
        step_s: f64,
        /// `|Phi|`, the sine of half the rotation angle of the step.
        norm: f64,
    },
    /// A body that travels too far in one step for the variational integrator, which couples travel and rotation.
    #[error(
        "the step of {step_s} s is too long: the body travels {travel_m} m, about twice its radius of gyration or more; \
         shorten the step or use an inertial frame in which the body is slow"
    )]
    TravelTooLong {
        /// Step length, s.
        step_s: f64,
        /// Travel of the centre of mass in the step, m.
        travel_m: f64,
    },
    /// An actuator that cannot be.
    #[error("actuator {index} has a limit or coefficient that is not positive, or a number that is not finite")]
    InvalidActuator {
        /// Its place in the set, from zero.
        index: usize,
    },
    /// Actuators that cannot give every wrench they should.
    #[error(
        "the actuators together cannot give component {component} of the wrench in both directions (0 to 2 torque x y z, \
         3 to 5 force x y z) independently of the others"
    )]
    OutOfReach {
        /// Index into `[torque; force]`.
        component: usize,
    },
    /// A list with the wrong number of joints.
    #[error("the tree has {expected} joints, {found} values were given")]
    JointCount {
        /// Joints of the tree.
        expected: usize,
        /// Values given.
        found: usize,
    },
    /// A link on itself or on a later one.
    #[error("link {link} hangs on itself or on a later link; list parents first")]
    LinkOrder {
        /// Its place in the list, from zero.
        link: usize,
    },
    /// A joint without a direction.
    #[error("the axis of a joint has no direction")]
    NoAxis,
    /// A body that the tree does not have.
    #[error("the tree has bodies 0 (the base) to {}, not {index}", bodies.saturating_sub(1))]
    NoSuchBody {
        /// The body asked for.
        index: usize,
        /// Bodies there are.
        bodies: usize,
    },
    /// A value that is not finite, or a step that is not positive where it must be.
    #[error("value is not finite")]
    NotFinite,
    /// An error of an implementation from outside. Two are equal where they are the same object.
    #[error("{by}: {source}")]
    Foreign {
        /// Its name.
        by: &'static str,
        /// What it says.
        source: ForeignError,
    },
}

impl DynamicsError {
    /// An error of somebody else's actuator, system or integrator, with numbers of its own.
    #[cfg(feature = "std")]
    pub fn foreign(by: &'static str, source: impl Error + Send + Sync + 'static) -> Self {
        Self::Foreign { by, source: ForeignError::made(source) }
    }

    /// One that lives for ever (`&MY_ERROR`), which needs no allocator.
    pub const fn fixed(by: &'static str, source: &'static (dyn Error + Send + Sync)) -> Self {
        Self::Foreign { by, source: ForeignError::fixed(source) }
    }
}

/// An error from outside, as its author made it: without an allocator one that lives for ever, with one any.
#[derive(Clone)]
pub struct ForeignError(Held);

#[derive(Clone)]
enum Held {
    Fixed(&'static (dyn Error + Send + Sync)),
    #[cfg(feature = "std")]
    Made(std::sync::Arc<dyn Error + Send + Sync>),
}

impl ForeignError {
    /// One that lives for ever.
    pub const fn fixed(error: &'static (dyn Error + Send + Sync)) -> Self {
        Self(Held::Fixed(error))
    }

    /// One that was made at run time.
    #[cfg(feature = "std")]
    pub fn made(error: impl Error + Send + Sync + 'static) -> Self {
        Self(Held::Made(std::sync::Arc::new(error)))
    }
}

impl core::ops::Deref for ForeignError {
    type Target = dyn Error + Send + Sync + 'static;

    fn deref(&self) -> &Self::Target {
        match &self.0 {
            Held::Fixed(error) => *error,
            #[cfg(feature = "std")]
            Held::Made(error) => &**error,
        }
    }
}

/// The same object, not one that says the same.
impl PartialEq for ForeignError {
    fn eq(&self, other: &Self) -> bool {
        core::ptr::addr_eq(&raw const **self, &raw const **other)
    }
}

impl fmt::Debug for ForeignError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        fmt::Debug::fmt(&**self, f)
    }
}

impl fmt::Display for ForeignError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        fmt::Display::fmt(&**self, f)
    }
}
