//! What a Lie group, a manifold and a group action are.

use crate::scalar::{Coordinates, Scalar};
use core::fmt::Debug;
use core::ops::{Mul, Sub};
use nalgebra::SVector;

/// A space with a local right increment; what integrators and estimators step on.
///
/// Every [`LieGroup`] is one, with `x.oplus(xi) = x exp(xi)`.
///
/// # Example
/// What is written with increments works on vectors and on attitudes alike.
/// ```
/// use tumble_lie::Manifold;
/// use tumble_lie::nalgebra::{UnitQuaternion, Vector3};
///
/// fn halfway<M: Manifold<Scalar = f64>>(from: &M, to: &M) -> M {
///     from.oplus(&(to.ominus(from) * 0.5))
/// }
/// assert_eq!(halfway(&Vector3::zeros(), &Vector3::x()), Vector3::x() * 0.5);
/// let turn = |angle_rad| UnitQuaternion::from_axis_angle(&Vector3::z_axis(), angle_rad);
/// assert!(halfway(&turn(0.2), &turn(1.0)).angle_to(&turn(0.6)) < 1e-12);
/// ```
/// Tutorial: [a body as a state of which every point can be](https://github.com/tumble-robotics/tumble/blob/main/crates/identification/src/recursive/principal_body.rs).
pub trait Manifold: Clone + Debug {
    /// Scalar type of the coordinates.
    type Scalar: Scalar;
    /// Increment vector.
    type Tangent: Coordinates<Self::Scalar>;
    /// The point reached from `self` by the increment `xi`.
    #[must_use]
    fn oplus(&self, xi: &Self::Tangent) -> Self;
    /// The increment that leads from `base` to `self`.
    fn ominus(&self, base: &Self) -> Self::Tangent;
    /// The rate of `xi` at which `base.oplus(xi)` moves with the right-trivialised velocity `velocity`:
    /// `base.oplus(xi + dt rate) = base.oplus(xi).oplus(dt velocity)` to first order, for every base.
    fn increment_rate(xi: &Self::Tangent, velocity: &Self::Tangent) -> Self::Tangent;
}

/// A finite-dimensional Lie group with an exponential chart.
///
/// Laws (`crate::laws`): group axioms; `log(exp(xi)) = xi` inside the injectivity radius;
/// `g exp(xi) g^-1 = exp(Ad_g xi)`; `exp(xi + d) = exp(xi) exp(Jr(xi) d) + O(d^2)`.
///
/// # Example
/// ```
/// use tumble_lie::nalgebra::Vector6;
/// use tumble_lie::{Coordinates, LieGroup, Pose};
///
/// /// How far `g exp(xi) g^-1` and `exp(Ad_g xi)` are apart, in any group.
/// fn defect<G: LieGroup<Scalar = f64>>(g: G, xi: G::Tangent) -> f64 {
///     let carried = g * G::exp(&xi) * g.inverse();
///     carried.between(&G::exp(&(g.adjoint() * xi))).log().euclidean_norm()
/// }
/// let pose = Pose::exp(&Vector6::new(0.4, -0.9, 0.2, 1.0, 2.0, 3.0));
/// assert!(defect(pose, Vector6::new(0.1, 0.2, -0.3, 0.5, 0.0, -1.0)) < 1e-12);
/// ```
/// Tutorial: [a group of your own, and its laws](https://github.com/tumble-robotics/tumble/blob/main/crates/lie/tests/suite/custom_group.rs).
pub trait LieGroup: Copy + Debug + Mul<Output = Self> {
    /// Scalar type.
    type Scalar: Scalar;
    /// Lie algebra coordinates.
    type Tangent: Coordinates<Self::Scalar>;
    /// Linear maps of the Lie algebra.
    type Jacobian: Copy
        + Debug
        + Mul<Output = Self::Jacobian>
        + Sub<Output = Self::Jacobian>
        + Mul<Self::Tangent, Output = Self::Tangent>;

    /// The neutral element.
    fn identity() -> Self;
    /// The inverse element.
    #[must_use]
    fn inverse(&self) -> Self;
    /// The product `self other`.
    #[must_use]
    fn compose(&self, other: &Self) -> Self {
        *self * *other
    }
    /// The exponential map.
    fn exp(xi: &Self::Tangent) -> Self;
    /// The principal logarithm.
    fn log(&self) -> Self::Tangent;
    /// `Ad_g`: `g exp(xi) g^-1 = exp(Ad_g xi)`.
    fn adjoint(&self) -> Self::Jacobian;
    /// `Ad*_g = (Ad_{g^-1})^T`, the action on momenta: `<Ad*_g mu, Ad_g xi> = <mu, xi>`.
    fn coadjoint(&self) -> Self::Jacobian;
    /// The Lie bracket `[a, b] = ad_a b`.
    fn bracket(a: &Self::Tangent, b: &Self::Tangent) -> Self::Tangent;
    /// The dual of the bracket: `<ad*_a mu, b> = <mu, [a, b]>`.
    fn dual_bracket(a: &Self::Tangent, mu: &Self::Tangent) -> Self::Tangent {
        Self::Tangent::from_fn(|i| {
            let basis = Self::Tangent::from_fn(|j| if i == j { nalgebra::one() } else { nalgebra::zero() });
            let image = Self::bracket(a, &basis);
            let mut sum: Self::Scalar = nalgebra::zero();
            for j in 0..Self::Tangent::DIM {
                sum += mu[j] * image[j];
            }
            sum
        })
    }
    /// `Jr`: `exp(xi + d) = exp(xi) exp(Jr(xi) d) + O(d^2)`.
    fn right_jacobian(xi: &Self::Tangent) -> Self::Jacobian;
    /// Inverse of [`LieGroup::right_jacobian`].
    fn right_jacobian_inverse(xi: &Self::Tangent) -> Self::Jacobian;
    /// `Jl(xi) = Jr(-xi)`: `exp(xi + d) = exp(Jl(xi) d) exp(xi) + O(d^2)`.
    fn left_jacobian(xi: &Self::Tangent) -> Self::Jacobian {
        Self::right_jacobian(&-*xi)
    }
    /// Inverse of [`LieGroup::left_jacobian`].
    fn left_jacobian_inverse(xi: &Self::Tangent) -> Self::Jacobian {
        Self::right_jacobian_inverse(&-*xi)
    }
    /// `self^-1 other`: the displacement from `self` to `other`, seen from `self`.
    #[must_use]
    fn between(&self, other: &Self) -> Self {
        self.inverse().compose(other)
    }
    /// The point at `fraction` of the geodesic from `self` (0) to `other` (1).
    #[must_use]
    fn interpolate(&self, other: &Self, fraction: Self::Scalar) -> Self {
        self.compose(&Self::exp(&(self.between(other).log() * fraction)))
    }
}

impl<G: LieGroup> Manifold for G {
    type Scalar = G::Scalar;
    type Tangent = G::Tangent;
    fn oplus(&self, xi: &Self::Tangent) -> Self {
        self.compose(&G::exp(xi))
    }
    fn ominus(&self, base: &Self) -> Self::Tangent {
        base.between(self).log()
    }
    fn increment_rate(xi: &Self::Tangent, velocity: &Self::Tangent) -> Self::Tangent {
        G::right_jacobian_inverse(xi) * *velocity
    }
}

impl<T: Scalar, const N: usize> Manifold for SVector<T, N> {
    type Scalar = T;
    type Tangent = Self;
    fn oplus(&self, xi: &Self) -> Self {
        self + xi
    }
    fn ominus(&self, base: &Self) -> Self {
        self - base
    }
    fn increment_rate(_xi: &Self, velocity: &Self) -> Self {
        *velocity
    }
}

/// A group that moves points: `(g h).p = g.(h.p)`.
///
/// # Example
/// ```
/// use tumble_lie::nalgebra::{UnitQuaternion, Vector3};
/// use tumble_lie::{GroupAction, LieGroup};
///
/// let quarter = UnitQuaternion::from_axis_angle(&Vector3::z_axis(), core::f64::consts::FRAC_PI_2);
/// assert!((quarter.act(&Vector3::x()) - Vector3::y()).norm() < 1e-15);
/// assert!((quarter.compose(&quarter).act(&Vector3::x()) + Vector3::x()).norm() < 1e-15);
/// ```
/// Tutorial: [a group of your own](https://github.com/tumble-robotics/tumble/blob/main/crates/lie/tests/suite/custom_group.rs), which acts on points.
pub trait GroupAction<P>: LieGroup {
    /// The image of `point`.
    fn act(&self, point: &P) -> P;
}
