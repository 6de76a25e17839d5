//! Executable laws for everyone's groups (feature `testing`).
//!
//! Each `check_*` function takes samples and a tolerance, which it multiplies by the size of what it compares, and says
//! in a [`LawViolation`] which law broke on which input. [`group_laws!`](crate::group_laws) turns them into one test per
//! law. Groups are compared through `log(a^-1 b)`, so [`check_exp_log`] is the law to read first when many break.

use crate::group::{GroupAction, LieGroup};
use crate::scalar::Coordinates;
use crate::spatial::{Twist, Wrench};
use num_dual::Dual64;
use proptest::strategy::Strategy;
use proptest::test_runner::{Config, RngAlgorithm, TestCaseError, TestError, TestRng, TestRunner};
use std::fmt;

/// A law that an implementation breaks: which one, on what, by how much.
#[derive(Clone, Debug, PartialEq)]
pub struct LawViolation {
    /// Name of the law.
    pub law: &'static str,
    /// The inputs that break it.
    pub inputs: String,
    /// What the law demands.
    pub expected: String,
    /// What the implementation gave.
    pub found: String,
    /// Size of the difference.
    pub error: f64,
    /// Largest accepted difference.
    pub tolerance: f64,
}

impl fmt::Display for LawViolation {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        // Three lines: of matrices and long lists the beginning.
        write!(f, "law '{}' broken on {}", self.law, Line(&self.inputs))?;
        write!(f, "\n  expected {}", Line(&self.expected))?;
        write!(f, "\n  found {}, error {:e} > {:e}", Line(&self.found), self.error, self.tolerance)
    }
}

/// The beginning of a text, in one line that fits on a screen.
struct Line<'a>(&'a str);

impl fmt::Display for Line<'_> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        const LONGEST: usize = 100;
        let mut left = LONGEST;
        for (index, word) in self.0.split_whitespace().enumerate() {
            let length = word.chars().count() + usize::from(index > 0);
            if length > left {
                // Numbers without a space between them are one word.
                let most = if index > 0 { 0 } else { left };
                let end = word.char_indices().nth(most).map_or(word.len(), |(end, _)| end);
                return write!(f, "{} ..", &word[..end]);
            }
            left -= length;
            write!(f, "{}{word}", if index > 0 { " " } else { "" })?;
        }
        Ok(())
    }
}

impl std::error::Error for LawViolation {}

/// `Ok` when `error <= tolerance` (a NaN error is a violation), else the violation.
///
/// # Errors
/// The violation.
pub fn require(
    law: &'static str,
    inputs: &dyn fmt::Debug,
    expected: &dyn fmt::Debug,
    found: &dyn fmt::Debug,
    error: f64,
    tolerance: f64,
) -> Result<(), LawViolation> {
    if error <= tolerance {
        return Ok(());
    }
    Err(LawViolation {
        law,
        inputs: format!("{inputs:?}"),
        expected: format!("{expected:?}"),
        found: format!("{found:?}"),
        error,
        tolerance,
    })
}

/// Checks `law` on values of `strategy`: always the same values, shrunk when one breaks the law.
///
/// # Errors
/// The smallest input found that breaks the law, and how.
pub fn for_all<S: Strategy>(strategy: &S, law: impl Fn(S::Value) -> Result<(), LawViolation>) -> Result<(), String> {
    let config = Config { failure_persistence: None, ..Config::default() };
    let outcome = TestRunner::new_with_rng(config, TestRng::deterministic_rng(RngAlgorithm::ChaCha))
        .run(strategy, |input| law(input).map_err(|violation| TestCaseError::fail(violation.to_string())));
    match outcome {
        Err(TestError::Fail(reason, input)) => Err(format!("{reason}; smallest input {}", Line(&format!("{input:?}")))),
        Err(TestError::Abort(reason)) => Err(reason.to_string()),
        Ok(()) => Ok(()),
    }
}

fn dot<V: Coordinates<f64>>(a: &V, b: &V) -> f64 {
    (0..V::DIM).map(|i| a[i] * b[i]).sum()
}

fn basis<V: Coordinates<f64>>() -> impl Iterator<Item = V> {
    (0..V::DIM).map(|i| V::from_fn(|j| if i == j { 1.0 } else { 0.0 }))
}

/// Each sample with the two that follow it.
fn triples<X: Copy>(samples: &[X]) -> impl Iterator<Item = (X, X, X)> {
    let following = |k: usize| samples.iter().cycle().skip(k);
    samples.iter().zip(following(1)).zip(following(2)).map(|((a, b), c)| (*a, *b, *c))
}

fn require_vector<V: Coordinates<f64>>(
    law: &'static str,
    inputs: &dyn fmt::Debug,
    expected: &V,
    found: &V,
    tolerance: f64,
) -> Result<(), LawViolation> {
    let error = (*found - *expected).euclidean_norm();
    require(law, inputs, expected, found, error, tolerance * (1.0 + expected.euclidean_norm()))
}

fn require_element<G: LieGroup<Scalar = f64>>(
    law: &'static str,
    inputs: &dyn fmt::Debug,
    expected: &G,
    found: &G,
    tolerance: f64,
) -> Result<(), LawViolation> {
    let error = expected.between(found).log().euclidean_norm();
    let size = expected.log().euclidean_norm();
    require(law, inputs, expected, found, error, tolerance * (1.0 + size))
}

/// Derivative at zero by a difference quotient of fourth order.
fn derivative<V: Coordinates<f64>>(f: impl Fn(f64) -> V) -> V {
    const STEP: f64 = 1e-3;
    let symmetric = |h: f64| (f(h) - f(-h)) * (0.5 / h);
    symmetric(STEP) * (4.0 / 3.0) - symmetric(2.0 * STEP) * (1.0 / 3.0)
}

/// Number of products after which [`check_group_axioms`] looks for drift.
const CLOSURE_PRODUCTS: usize = 10_000;

/// Identity, inverse, associativity; closure: no drift off the group (unit norms) in 10 000 products.
///
/// # Errors
/// `group_axioms/...`
pub fn check_group_axioms<G: LieGroup<Scalar = f64>>(elements: &[G], tolerance: f64) -> Result<(), LawViolation> {
    let e = G::identity();
    for (a, b, c) in triples(elements) {
        require_element("group_axioms/left_identity", &a, &a, &e.compose(&a), tolerance)?;
        require_element("group_axioms/right_identity", &a, &a, &a.compose(&e), tolerance)?;
        require_element("group_axioms/right_inverse", &a, &e, &a.compose(&a.inverse()), tolerance)?;
        require_element("group_axioms/left_inverse", &a, &e, &a.inverse().compose(&a), tolerance)?;
        let (left, right) = (a.compose(&b).compose(&c), a.compose(&b.compose(&c)));
        require_element("group_axioms/associativity", &(a, b, c), &left, &right, tolerance)?;
        require_element("group_axioms/operator", &(a, b), &a.compose(&b), &(a * b), tolerance)?;

        let mut product = a;
        for _ in 0..CLOSURE_PRODUCTS / 2 {
            product = product.compose(&b).compose(&b.inverse());
        }
        // not `product = a`, which rounding forbids, but: still an element with an inverse and an adjoint
        let inverse = product.inverse();
        require_element("group_axioms/closure", &(a, b), &e, &product.compose(&inverse), tolerance)?;
        for direction in basis::<G::Tangent>() {
            let same = product.adjoint() * (inverse.adjoint() * direction);
            require_vector("group_axioms/closure", &(a, b), &direction, &same, tolerance)?;
        }
    }
    Ok(())
}

/// `log(exp(xi)) = xi` (for tangents inside the injectivity radius), `exp(log(g)) = g`, one-parameter subgroups.
///
/// # Errors
/// `exp_log/...`
pub fn check_exp_log<G: LieGroup<Scalar = f64>>(tangents: &[G::Tangent], tolerance: f64) -> Result<(), LawViolation> {
    let zero = G::Tangent::zero();
    require_vector("exp_log/zero", &"identity", &zero, &G::identity().log(), 0.0)?;
    require_vector("exp_log/zero", &"exp(0)", &zero, &G::exp(&zero).log(), 0.0)?;
    for xi in tangents {
        let g = G::exp(xi);
        // relative, so that the smallest tangents count too
        let error = (g.log() - *xi).euclidean_norm();
        require("exp_log/log_of_exp", xi, xi, &g.log(), error, tolerance * xi.euclidean_norm())?;
        require_element("exp_log/exp_of_log", xi, &g, &G::exp(&g.log()), tolerance)?;
        require_element("exp_log/inverse", xi, &g.inverse(), &G::exp(&-*xi), tolerance)?;
        let (part, rest) = (G::exp(&(*xi * 0.3)), G::exp(&(*xi * 0.7)));
        require_element("exp_log/subgroup", xi, &g, &part.compose(&rest), tolerance)?;
    }
    Ok(())
}

/// Dual-number derivatives of exp, log and the Jacobians, at every tangent: `D` is the group `G` over dual numbers.
///
/// Compared with difference quotients of the values, so a branch that gives the right value and the wrong derivative
/// (the classic at zero) is found.
///
/// # Errors
/// `regimes/...`
pub fn check_regimes<G, D>(tangents: &[G::Tangent], tolerance: f64) -> Result<(), LawViolation>
where
    G: LieGroup<Scalar = f64>,
    D: LieGroup<Scalar = Dual64>,
{
    let lift = |value: &G::Tangent, rate: &G::Tangent| D::Tangent::from_fn(|i| Dual64::new(value[i], rate[i]));
    let rate_of = |dual: &D::Tangent| G::Tangent::from_fn(|i| dual[i].eps);
    let zero = G::Tangent::zero();
    for xi in tangents {
        let (at, dual_at) = (G::exp(xi), D::exp(&lift(xi, &zero)));
        for direction in basis::<G::Tangent>() {
            let inputs = (xi, direction);
            let moving = lift(xi, &direction);
            let along = |h: f64| *xi + direction * h;

            let found = rate_of(&dual_at.between(&D::exp(&moving)).log());
            let expected = derivative(|h| at.between(&G::exp(&along(h))).log());
            require_vector("regimes/derivative_of_exp", &inputs, &expected, &found, tolerance)?;

            let found = rate_of(&D::exp(&moving).log());
            require_vector("regimes/derivative_of_log", &inputs, &direction, &found, tolerance)?;

            for image_of in basis::<G::Tangent>() {
                let fixed = lift(&image_of, &zero);
                let found = rate_of(&(D::right_jacobian(&moving) * fixed));
                let expected = derivative(|h| G::right_jacobian(&along(h)) * image_of);
                require_vector("regimes/derivative_of_jacobian", &inputs, &expected, &found, tolerance)?;
                let found = rate_of(&(D::right_jacobian_inverse(&moving) * fixed));
                let expected = derivative(|h| G::right_jacobian_inverse(&along(h)) * image_of);
                require_vector("regimes/derivative_of_inverse_jacobian", &inputs, &expected, &found, tolerance)?;
            }
        }
    }
    Ok(())
}

/// Two representatives of one element (`q` and `-q`) have one logarithm and one adjoint.
///
/// # Errors
/// `double_cover/...`
pub fn check_double_cover<G: LieGroup<Scalar = f64>>(pairs: &[(G, G)], tolerance: f64) -> Result<(), LawViolation> {
    for (a, b) in pairs {
        require_vector("double_cover/log", &(a, b), &a.log(), &b.log(), tolerance)?;
        for direction in basis::<G::Tangent>() {
            let (first, second) = (a.adjoint() * direction, b.adjoint() * direction);
            require_vector("double_cover/adjoint", &(a, b), &first, &second, tolerance)?;
        }
    }
    Ok(())
}

/// `g exp(xi) g^-1 = exp(Ad_g xi)` and `Ad_(g h) = Ad_g Ad_h`.
///
/// # Errors
/// `adjoint/...`
pub fn check_adjoint<G: LieGroup<Scalar = f64>>(
    elements: &[G],
    tangents: &[G::Tangent],
    tolerance: f64,
) -> Result<(), LawViolation> {
    for (g, h, _) in triples(elements) {
        for xi in tangents {
            let expected = g.compose(&G::exp(xi)).compose(&g.inverse());
            require_element("adjoint/conjugation", &(g, xi), &expected, &G::exp(&(g.adjoint() * *xi)), tolerance)?;
            let (product, chain) = (g.compose(&h).adjoint() * *xi, g.adjoint() * (h.adjoint() * *xi));
            require_vector("adjoint/homomorphism", &(g, h, xi), &product, &chain, tolerance)?;
        }
    }
    Ok(())
}

/// `<Ad*_g mu, Ad_g xi> = <mu, xi>`.
///
/// # Errors
/// `coadjoint/pairing`
pub fn check_coadjoint<G: LieGroup<Scalar = f64>>(
    elements: &[G],
    tangents: &[G::Tangent],
    tolerance: f64,
) -> Result<(), LawViolation> {
    for g in elements {
        for (mu, xi, _) in triples(tangents) {
            let (momentum, velocity) = (g.coadjoint() * mu, g.adjoint() * xi);
            let (expected, found) = (dot(&mu, &xi), dot(&momentum, &velocity));
            let size = 1.0 + momentum.euclidean_norm() * velocity.euclidean_norm();
            let error = (found - expected).abs();
            require("coadjoint/pairing", &(g, mu, xi), &expected, &found, error, tolerance * size)?;
        }
    }
    Ok(())
}

/// Antisymmetry, Jacobi identity, `[a, b]` as the derivative of conjugation, and the dual bracket.
///
/// # Errors
/// `bracket/...`
pub fn check_bracket<G: LieGroup<Scalar = f64>>(tangents: &[G::Tangent], tolerance: f64) -> Result<(), LawViolation> {
    for (a, b, c) in triples(tangents) {
        let ab = G::bracket(&a, &b);
        let sizes = [a, b, c].map(|x| 1.0 + x.euclidean_norm());
        let size: f64 = sizes.iter().product();
        require_vector("bracket/antisymmetry", &(a, b), &-ab, &G::bracket(&b, &a), tolerance)?;
        let cyclic = G::bracket(&a, &G::bracket(&b, &c)) + G::bracket(&b, &G::bracket(&c, &a)) + G::bracket(&c, &ab);
        require_vector("bracket/jacobi", &(a, b, c), &G::Tangent::zero(), &cyclic, tolerance * size)?;
        // the derivative needs a short b (injectivity) and is linear in both
        let (unit_a, short_b) = (a * (1.0 / sizes[0]), b * (1.0 / sizes[1]));
        let rate = derivative(|h| {
            let g = G::exp(&(unit_a * h));
            g.compose(&G::exp(&short_b)).compose(&g.inverse()).log()
        });
        require_vector("bracket/derivative", &(a, b), &rate, &G::bracket(&unit_a, &short_b), tolerance)?;
        let (expected, found) = (dot(&c, &ab), dot(&G::dual_bracket(&a, &c), &b));
        require("bracket/dual", &(a, b, c), &expected, &found, (found - expected).abs(), tolerance * size)?;
    }
    Ok(())
}

/// `exp(xi + d) = exp(xi) exp(Jr d) + O(d^2)`, the left Jacobian likewise, and their inverses.
///
/// # Errors
/// `right_jacobian/...`
pub fn check_right_jacobian<G: LieGroup<Scalar = f64>>(
    tangents: &[G::Tangent],
    tolerance: f64,
) -> Result<(), LawViolation> {
    for xi in tangents {
        let at = G::exp(xi);
        for d in basis::<G::Tangent>() {
            let right = derivative(|h| at.between(&G::exp(&(*xi + d * h))).log());
            require_vector("right_jacobian/right", &(xi, d), &right, &(G::right_jacobian(xi) * d), tolerance)?;
            let left = derivative(|h| G::exp(&(*xi + d * h)).compose(&at.inverse()).log());
            require_vector("right_jacobian/left", &(xi, d), &left, &(G::left_jacobian(xi) * d), tolerance)?;
            let same = G::right_jacobian(xi) * (G::right_jacobian_inverse(xi) * d);
            require_vector("right_jacobian/right_inverse", &(xi, d), &d, &same, tolerance)?;
            let same = G::left_jacobian(xi) * (G::left_jacobian_inverse(xi) * d);
            require_vector("right_jacobian/left_inverse", &(xi, d), &d, &same, tolerance)?;
        }
    }
    Ok(())
}

/// `e.p = p` and `(g h).p = g.(h.p)`.
///
/// # Errors
/// `action/...`
pub fn check_action<G, P>(elements: &[G], points: &[P], tolerance: f64) -> Result<(), LawViolation>
where
    G: GroupAction<P> + LieGroup<Scalar = f64>,
    P: Coordinates<f64>,
{
    for p in points {
        require_vector("action/identity", p, p, &G::identity().act(p), tolerance)?;
        for (g, h, _) in triples(elements) {
            let (product, chain) = (g.compose(&h).act(p), g.act(&h.act(p)));
            require_vector("action/compatibility", &(g, h, p), &product, &chain, tolerance)?;
        }
    }
    Ok(())
}

/// Rigid groups keep distances.
///
/// # Errors
/// `isometric_action/distance`
pub fn check_isometric_action<G, P>(elements: &[G], points: &[P], tolerance: f64) -> Result<(), LawViolation>
where
    G: GroupAction<P> + LieGroup<Scalar = f64>,
    P: Coordinates<f64>,
{
    for g in elements {
        for (p, q, _) in triples(points) {
            let (before, after) = ((p - q).euclidean_norm(), (g.act(&p) - g.act(&q)).euclidean_norm());
            let size = 1.0 + g.act(&p).euclidean_norm() + g.act(&q).euclidean_norm();
            let error = (after - before).abs();
            require("isometric_action/distance", &(g, p, q), &before, &after, error, tolerance * size)?;
        }
    }
    Ok(())
}

/// The power of a wrench on a twist is the same in every frame; `change_twist` and `change_wrench` describe both in
/// another frame.
///
/// # Errors
/// `power_pairing/invariance`
pub fn check_power_pairing(
    twist: &Twist<f64>,
    wrench: &Wrench<f64>,
    change_twist: impl Fn(&Twist<f64>) -> Twist<f64>,
    change_wrench: impl Fn(&Wrench<f64>) -> Wrench<f64>,
    tolerance: f64,
) -> Result<(), LawViolation> {
    let (other_twist, other_wrench) = (change_twist(twist), change_wrench(wrench));
    let (expected, found) = (twist.power(wrench), other_twist.power(&other_wrench));
    let size = 1.0 + other_twist.to_vector().norm() * other_wrench.to_vector().norm();
    let error = (found - expected).abs();
    require("power_pairing/invariance", &(twist, wrench), &expected, &found, error, tolerance * size)
}

/// Interpolation starts at the first element, ends at the second, has constant velocity and does not depend on where
/// the world frame is.
///
/// # Errors
/// `interpolation/...`
pub fn check_interpolation<G: LieGroup<Scalar = f64>>(
    start: &G,
    displacement: &G::Tangent,
    world: &G,
    tolerance: f64,
) -> Result<(), LawViolation> {
    let end = start.compose(&G::exp(displacement));
    let inputs = (start, displacement, world);
    require_element("interpolation/start", &inputs, start, &start.interpolate(&end, 0.0), tolerance)?;
    require_element("interpolation/end", &inputs, &end, &start.interpolate(&end, 1.0), tolerance)?;
    for fraction in [0.25, 0.5, 0.9] {
        let point = start.interpolate(&end, fraction);
        let expected = start.compose(&G::exp(&(*displacement * fraction)));
        require_element("interpolation/velocity", &inputs, &expected, &point, tolerance)?;
        let moved = world.compose(start).interpolate(&world.compose(&end), fraction);
        require_element("interpolation/invariance", &inputs, &world.compose(&point), &moved, tolerance)?;
    }
    Ok(())
}

/// Expands to a module with one named test per law: `group_laws!(name, Group, tangents)`, where `tangents` is a proptest
/// strategy of tangents inside the injectivity radius. `dual = DualGroup` adds the laws of derivatives,
/// `points = strategy` those of the action.
#[macro_export]
macro_rules! group_laws {
    ($name:ident, $group:ty, $tangents:expr $(, dual = $dual:ty)? $(, points = $points:expr)? $(,)?) => {
        mod $name {
            #[allow(unused_imports)]
            use super::*;
            use $crate::LieGroup as _;
            use $crate::laws;
            const TOLERANCE: f64 = 1e-9;
            type Group = $group;
            type Tangent = <Group as $crate::LieGroup>::Tangent;
            fn exp(xi: &Tangent) -> Group {
                <Group as $crate::LieGroup>::exp(xi)
            }
            #[test]
            fn group_axioms() -> Result<(), String> {
                laws::for_all(&($tangents, $tangents, $tangents), |(a, b, c)| {
                    laws::check_group_axioms(&[exp(&a), exp(&b), exp(&c)], TOLERANCE)
                })
            }
            #[test]
            fn exp_log() -> Result<(), String> {
                laws::for_all(&$tangents, |xi| laws::check_exp_log::<Group>(&[xi], TOLERANCE))
            }
            #[test]
            fn adjoint() -> Result<(), String> {
                laws::for_all(&($tangents, $tangents, $tangents), |(a, b, c)| {
                    laws::check_adjoint(&[exp(&a), exp(&b)], &[c], TOLERANCE)
                })
            }
            #[test]
            fn coadjoint() -> Result<(), String> {
                laws::for_all(&($tangents, $tangents, $tangents), |(a, b, c)| {
                    laws::check_coadjoint(&[exp(&a)], &[b, c], TOLERANCE)
                })
            }
            #[test]
            fn bracket() -> Result<(), String> {
                laws::for_all(&($tangents, $tangents, $tangents), |(a, b, c)| {
                    laws::check_bracket::<Group>(&[a, b, c], TOLERANCE)
                })
            }
            #[test]
            fn right_jacobian() -> Result<(), String> {
                laws::for_all(&$tangents, |xi| laws::check_right_jacobian::<Group>(&[xi], TOLERANCE))
            }
            #[test]
            fn interpolation() -> Result<(), String> {
                laws::for_all(&($tangents, $tangents, $tangents), |(a, b, c)| {
                    laws::check_interpolation(&exp(&a), &b, &exp(&c), TOLERANCE)
                })
            }
            $(
                #[test]
                fn regimes() -> Result<(), String> {
                    laws::for_all(&$tangents, |xi| laws::check_regimes::<Group, $dual>(&[xi], TOLERANCE))
                }
            )?
            $(
                #[test]
                fn action() -> Result<(), String> {
                    laws::for_all(&($tangents, $tangents, $points), |(a, b, p)| {
                        laws::check_action(&[exp(&a), exp(&b)], &[p], TOLERANCE)
                    })
                }
            )?
        }
    };
}

/// The allocator of a test program of its own, which counts what each thread asks for: expands to a module `counting` with the thread's
/// `ALLOCATIONS` so far and `allocations(inputs, calls, path)`, how often so many calls of a path allocate, after one on each input.
///
/// Implementing an allocator is unsafe; a program that uses this one says so by `#![allow(unsafe_code)]`.
///
/// # Example
/// ```
/// tumble_lie::counting_allocator!();
///
/// # fn main() {
/// assert_eq!(counting::allocations(2, 10, |_| 1.5_f64.sin()), 0);
/// assert_eq!(counting::allocations(2, 10, Box::new), 10);
/// # }
/// ```
#[macro_export]
macro_rules! counting_allocator {
    () => {
        mod counting {
            use ::std::alloc::{GlobalAlloc, Layout, System};
            use ::std::cell::Cell;
            use ::std::hint::black_box;

            struct Counting;

            ::std::thread_local! {
                // Of this thread only, so that what the test harness does beside it does not count.
                pub static ALLOCATIONS: Cell<usize> = const { Cell::new(0) };
            }

            // SAFETY: both calls go to the system's allocator unchanged. `realloc` and `alloc_zeroed` are provided in terms of them.
            unsafe impl GlobalAlloc for Counting {
                unsafe fn alloc(&self, layout: Layout) -> *mut u8 {
                    ALLOCATIONS.with(|count| count.set(count.get() + 1));
                    unsafe { System.alloc(layout) }
                }
                unsafe fn dealloc(&self, pointer: *mut u8, layout: Layout) {
                    unsafe { System.dealloc(pointer, layout) }
                }
            }

            #[global_allocator]
            static ALLOCATOR: Counting = Counting;

            #[allow(dead_code)] // a program may count by itself
            pub fn allocations<T>(inputs: usize, calls: usize, mut path: impl FnMut(usize) -> T) -> usize {
                (0..inputs).for_each(|input| drop(black_box(path(input))));
                let before = ALLOCATIONS.get();
                (0..calls).for_each(|call| drop(black_box(path(black_box(call % inputs)))));
                ALLOCATIONS.get() - before
            }
        }
    };
}
