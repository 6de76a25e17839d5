//! Least squares under physical consistency: the estimate is the best body, not the best ten numbers.
//!
//! All scalars are `f64`: decisions are made here, derivatives do not flow through.

mod barrier_newton;
#[cfg(feature = "clarabel-sdp")]
mod clarabel;
pub(crate) mod interior_point;
mod pseudo_inertia_cone;

pub use barrier_newton::BarrierNewton;
#[cfg(feature = "clarabel-sdp")]
pub use clarabel::ClarabelSdp;
pub use interior_point::InteriorPoint;
pub use pseudo_inertia_cone::PseudoInertiaCone;

use crate::error::IdentificationError;
use crate::square_root_information::SquareRootInformation;
use nalgebra::{SMatrix, SVector};

/// Value and derivatives of a self-concordant barrier.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Barrier<const P: usize> {
    /// φ(p), growing without bound towards the boundary.
    pub value: f64,
    /// ∂φ/∂p.
    pub gradient: SVector<f64, P>,
    /// ∂²φ/∂p².
    pub hessian: SMatrix<f64, P, P>,
}

/// A closed convex set of parameters with a non-empty interior.
///
/// The pseudo-inertia cone, a box, or a set of yours; [`laws::check_feasible_set`](crate::laws::check_feasible_set)
/// tells whether an implementation keeps its promises.
///
/// # Example
/// ```
/// use tumble_identification::nalgebra::{SMatrix, SVector};
/// use tumble_identification::{Barrier, BarrierNewton, ConstrainedLeastSquares, FeasibleSet, SquareRootInformation};
///
/// /// One number that cannot be negative.
/// struct Positive;
/// impl FeasibleSet<1> for Positive {
///     fn margin(&self, p: &SVector<f64, 1>) -> f64 {
///         p[0]
///     }
///     fn barrier(&self, p: &SVector<f64, 1>) -> Option<Barrier<1>> {
///         (p[0] > 0.0).then(|| Barrier {
///             value: -p[0].ln(),
///             gradient: SVector::from([-1.0 / p[0]]),
///             hessian: SMatrix::from([[1.0 / p[0].powi(2)]]),
///         })
///     }
///     fn barrier_parameter(&self) -> f64 {
///         1.0
///     }
///     fn interior_point(&self) -> SVector<f64, 1> {
///         SVector::from([1.0])
///     }
///     fn magnitudes(&self) -> SVector<f64, 1> {
///         SVector::from([1.0])
///     }
/// }
/// let mut information = SquareRootInformation::<1>::new();
/// information.add_prior(&SVector::from([-0.2]), &SVector::from([0.1]))?; // a measurement that cannot be
/// let found = BarrierNewton::new(&Positive).solve(&information)?;
/// assert!(found.is_active() && found.parameters[0] > 0.0 && found.parameters[0] < 1e-3);
/// # Ok::<(), tumble_identification::IdentificationError>(())
/// ```
/// Tutorial: [a set of your own](https://github.com/tumble-robotics/tumble/blob/main/crates/identification/tests/suite/custom_feasible_set.rs).
pub trait FeasibleSet<const P: usize> {
    /// Signed distance-like number, free of units: positive strictly inside, zero on the boundary, concave.
    fn margin(&self, parameters: &SVector<f64, P>) -> f64;

    /// Barrier and derivatives, `None` unless strictly inside.
    fn barrier(&self, parameters: &SVector<f64, P>) -> Option<Barrier<P>>;

    /// Bound ν on the squared Newton decrement of the barrier alone: the rank of the cone, the number of half-spaces.
    fn barrier_parameter(&self) -> f64;

    /// Some point well inside.
    fn interior_point(&self) -> SVector<f64, P>;

    /// Typical sizes of the parameters, to compare directions in like units.
    fn magnitudes(&self) -> SVector<f64, P>;
}

impl<S: FeasibleSet<P> + ?Sized, const P: usize> FeasibleSet<P> for &S {
    fn margin(&self, parameters: &SVector<f64, P>) -> f64 {
        (**self).margin(parameters)
    }
    fn barrier(&self, parameters: &SVector<f64, P>) -> Option<Barrier<P>> {
        (**self).barrier(parameters)
    }
    fn barrier_parameter(&self) -> f64 {
        (**self).barrier_parameter()
    }
    fn interior_point(&self) -> SVector<f64, P> {
        (**self).interior_point()
    }
    fn magnitudes(&self) -> SVector<f64, P> {
        (**self).magnitudes()
    }
}

/// The minimiser of ½|R p − z|² over a feasible set, with the proof of its quality.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ConstrainedEstimate<const P: usize> {
    /// The estimate, strictly inside the set.
    pub parameters: SVector<f64, P>,
    /// [`FeasibleSet::margin`] of the estimate: positive.
    pub margin: f64,
    /// ½|R p − z|², the price of consistency in units of half a chi-square; zero where the constraint is inactive.
    pub objective: f64,
    /// Proven bound on `objective` minus the smallest possible one.
    pub duality_gap: f64,
    /// Iterations; zero where the unconstrained solution is inside.
    pub iterations: usize,
}

impl<const P: usize> ConstrainedEstimate<P> {
    /// Whether the set cut off the unconstrained solution.
    pub fn is_active(&self) -> bool {
        self.iterations > 0
    }
}

/// A solver of min ½|R p − z|² over a convex set.
///
/// # Example
/// ```
/// use tumble_identification::nalgebra::SVector;
/// use tumble_identification::{ConstrainedEstimate, ConstrainedLeastSquares, IdentificationError, SquareRootInformation};
///
/// /// One number that cannot be below one: the unconstrained minimiser, or the bound.
/// struct AtLeastOne;
/// impl ConstrainedLeastSquares<1> for AtLeastOne {
///     fn solve(&self, information: &SquareRootInformation<1>) -> Result<ConstrainedEstimate<1>, IdentificationError> {
///         let free = information.solve(&SVector::from([1.0]))?;
///         let parameters = free.map(|x| x.max(1.0 + 1e-12));
///         let (margin, objective) = (parameters[0] - 1.0, 0.5 * information.residual(&parameters).norm_squared());
///         let iterations = usize::from(free != parameters);
///         Ok(ConstrainedEstimate { parameters, margin, objective, duality_gap: 1e-9, iterations })
///     }
/// }
/// let mut information = SquareRootInformation::<1>::new();
/// information.add_prior(&SVector::from([0.4]), &SVector::from([0.1]))?;
/// let found = AtLeastOne.solve(&information)?;
/// assert!(found.is_active() && (found.parameters[0] - 1.0).abs() < 1e-9);
/// # Ok::<(), IdentificationError>(())
/// ```
/// Tutorial: [another solver behind the trait](https://github.com/tumble-robotics/tumble/blob/main/crates/identification/src/consistency/clarabel.rs).
pub trait ConstrainedLeastSquares<const P: usize> {
    /// The constrained minimiser.
    ///
    /// # Errors
    /// [`IdentificationError::NotExcited`] where R is singular: the minimiser is then not unique, and a solver would
    /// invent the missing digits. State a prior. [`IdentificationError::NotConverged`] where the gap is not reached.
    fn solve(&self, information: &SquareRootInformation<P>) -> Result<ConstrainedEstimate<P>, IdentificationError>;
}

impl<S: ConstrainedLeastSquares<P> + ?Sized, const P: usize> ConstrainedLeastSquares<P> for &S {
    fn solve(&self, information: &SquareRootInformation<P>) -> Result<ConstrainedEstimate<P>, IdentificationError> {
        (**self).solve(information)
    }
}

#[cfg(feature = "std")]
impl<S: ConstrainedLeastSquares<P> + ?Sized, const P: usize> ConstrainedLeastSquares<P> for std::boxed::Box<S> {
    fn solve(&self, information: &SquareRootInformation<P>) -> Result<ConstrainedEstimate<P>, IdentificationError> {
        (**self).solve(information)
    }
}

/// Moves `parameters` towards `inside` by the smallest of a few tiny fractions that makes the margin positive.
///
/// An interior iterate can round onto the boundary when it is converted to parameters; this undoes it.
pub(crate) fn pulled_inside<const P: usize>(
    set: &dyn FeasibleSet<P>,
    parameters: SVector<f64, P>,
) -> (SVector<f64, P>, f64) {
    let margin = set.margin(&parameters);
    if margin > 0.0 {
        return (parameters, margin);
    }
    let inside = set.interior_point();
    let mut fraction = 1e-16;
    loop {
        let candidate = parameters + (inside - parameters) * fraction;
        let margin = set.margin(&candidate);
        if margin > 0.0 || fraction >= 1.0 {
            return (candidate, margin);
        }
        fraction *= 4.0;
    }
}
