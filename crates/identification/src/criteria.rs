//! Scalar measures of an information matrix, smaller being better.

use nalgebra::{ComplexField, SMatrix, SVector};

use crate::jacobi::singular_values;

/// A cost to minimise over experiments.
///
/// Only [`DOptimality`] ranks experiments equally in all units; put the parameters of the others into like units with
/// [`InLikeUnits`].
///
/// # Source
/// Thesis 2.3.1, (6.9).
///
/// # Deviation
/// 2.3.1 maximises the trace of the inverse; A-optimality minimises it, as (6.9) does. Section 4.2 and the footnote of
/// chapter 6 swap the names D and E; here D is the determinant and E the extreme eigenvalue (test `by_hand`).
///
/// # Example
/// ```
/// use tumble_identification::OptimalityCriterion;
/// use tumble_identification::nalgebra::{SMatrix, SVector};
///
/// /// The variance of the first parameter, and nothing else.
/// struct MassVariance;
/// impl<const P: usize> OptimalityCriterion<P> for MassVariance {
///     fn cost_and_gradient(&self, information: &SMatrix<f64, P, P>) -> Option<(f64, SMatrix<f64, P, P>)> {
///         let mass = SVector::from_fn(|i, _| if i == 0 { 1.0 } else { 0.0 });
///         let column = information.cholesky()?.solve(&mass);
///         Some((column[0], -(column * column.transpose())))
///     }
/// }
/// assert_eq!(MassVariance.cost(&SMatrix::<f64, 2, 2>::from([[4.0, 0.0], [0.0, 100.0]])), Some(0.25));
/// assert_eq!(MassVariance.cost(&SMatrix::<f64, 2, 2>::zeros()), None);
/// ```
/// Tutorial: [a criterion of your own](https://github.com/tumble-robotics/tumble/blob/main/crates/identification/tests/suite/custom_criterion.rs).
pub trait OptimalityCriterion<const P: usize> {
    /// Cost of a symmetric positive semidefinite information matrix, and its derivative: the symmetric matrix `G` with
    /// `d cost = trace(G dF)` for every symmetric `dF`. `None` where the information is singular.
    ///
    /// Where the cost has a kink, as costs of extreme eigenvalues have where these are repeated, any one generalised
    /// gradient: the cost need not fall along `-G`.
    fn cost_and_gradient(&self, information: &SMatrix<f64, P, P>) -> Option<(f64, SMatrix<f64, P, P>)>;

    /// The cost alone.
    fn cost(&self, information: &SMatrix<f64, P, P>) -> Option<f64> {
        Some(self.cost_and_gradient(information)?.0)
    }
}

/// Trace of the covariance: the mean squared error.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct AOptimality;

/// Minus the logarithm of the determinant of the information: the log-volume of the confidence ellipsoid, twice.
///
/// # Source
/// Thesis (4.15), there V2.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct DOptimality;

/// Largest eigenvalue of the covariance: the worst direction.
///
/// Differentiable where the smallest eigenvalue of the information is simple; convex, and elsewhere the gradient is the
/// subgradient of one of its eigenvectors.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct EOptimality;

/// Ratio of the largest to the smallest eigenvalue of the information.
///
/// Differentiable where both are simple; elsewhere the gradient belongs to one eigenvector of each. More information can
/// cost more: the ratio grows with information about what is known best.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct ConditionNumber;

/// A criterion for parameters in multiples of their typical sizes, whatever units the information is in.
///
/// The place where units are chosen: the information itself stays in SI units everywhere.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct InLikeUnits<C, const P: usize> {
    /// Of the information about the multiples.
    pub criterion: C,
    /// Typical sizes, such as [`BodyScale::parameter_magnitudes`](crate::BodyScale::parameter_magnitudes).
    pub magnitudes: SVector<f64, P>,
}

/// Eigenvalues in descending order and the eigenvectors as columns, from the Cholesky factor so that small ones stay
/// accurate; `None` where the matrix is singular.
fn spectrum<const P: usize>(information: &SMatrix<f64, P, P>) -> Option<(SVector<f64, P>, SMatrix<f64, P, P>)> {
    let lower = information.cholesky()?.unpack();
    let (singular, vectors) = singular_values(lower.transpose());
    let values = singular.map(|s| s * s);
    // A quotient of rounding errors is not information.
    (values[P - 1] > P as f64 * f64::EPSILON * values[0]).then_some((values, vectors))
}

/// `f` of a symmetric matrix.
fn of_spectrum<const P: usize>(
    (values, vectors): &(SVector<f64, P>, SMatrix<f64, P, P>),
    f: impl Fn(f64) -> f64,
) -> SMatrix<f64, P, P> {
    let scaled = SMatrix::from_fn(|i, j| vectors[(i, j)] * f(values[j]));
    scaled * vectors.transpose()
}

impl<const P: usize> OptimalityCriterion<P> for AOptimality {
    fn cost_and_gradient(&self, information: &SMatrix<f64, P, P>) -> Option<(f64, SMatrix<f64, P, P>)> {
        let spectrum = spectrum(information)?;
        let cost = spectrum.0.iter().map(|value| 1.0 / value).sum();
        Some((cost, of_spectrum(&spectrum, |value| -1.0 / (value * value))))
    }
}

impl<const P: usize> OptimalityCriterion<P> for DOptimality {
    fn cost_and_gradient(&self, information: &SMatrix<f64, P, P>) -> Option<(f64, SMatrix<f64, P, P>)> {
        let spectrum = spectrum(information)?;
        let cost = -spectrum.0.iter().map(|&value| ComplexField::ln(value)).sum::<f64>();
        Some((cost, of_spectrum(&spectrum, |value| -1.0 / value)))
    }
}

impl<const P: usize> OptimalityCriterion<P> for EOptimality {
    fn cost_and_gradient(&self, information: &SMatrix<f64, P, P>) -> Option<(f64, SMatrix<f64, P, P>)> {
        let (values, vectors) = spectrum(information)?;
        let (cost, worst) = (1.0 / values[P - 1], vectors.column(P - 1));
        Some((cost, worst * worst.transpose() * (-cost * cost)))
    }
}

impl<const P: usize> OptimalityCriterion<P> for ConditionNumber {
    fn cost_and_gradient(&self, information: &SMatrix<f64, P, P>) -> Option<(f64, SMatrix<f64, P, P>)> {
        let (values, vectors) = spectrum(information)?;
        let (best, worst) = (vectors.column(0), vectors.column(P - 1));
        let cost = values[0] / values[P - 1];
        Some((cost, (best * best.transpose() - worst * worst.transpose() * cost) / values[P - 1]))
    }
}

impl<C: OptimalityCriterion<P>, const P: usize> OptimalityCriterion<P> for InLikeUnits<C, P> {
    fn cost_and_gradient(&self, information: &SMatrix<f64, P, P>) -> Option<(f64, SMatrix<f64, P, P>)> {
        let sizes = self.magnitudes * self.magnitudes.transpose();
        let (cost, gradient) = self.criterion.cost_and_gradient(&information.component_mul(&sizes))?;
        Some((cost, gradient.component_mul(&sizes)))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn by_hand() {
        // Eigenvalues 8 along (1, 1) and 2 along (1, -1).
        let information = SMatrix::<f64, 2, 2>::new(5.0, 3.0, 3.0, 5.0);
        let gradient = |along: f64, across: f64| {
            let (same, other) = (0.5 * (along + across), 0.5 * (along - across));
            SMatrix::<f64, 2, 2>::new(same, other, other, same)
        };
        let cases: [(&dyn OptimalityCriterion<2>, f64, SMatrix<f64, 2, 2>); 4] = [
            (&AOptimality, 0.625, gradient(-1.0 / 64.0, -0.25)),
            (&DOptimality, -(16.0_f64.ln()), gradient(-0.125, -0.5)),
            (&EOptimality, 0.5, gradient(0.0, -0.25)),
            (&ConditionNumber, 4.0, gradient(0.5, -2.0)),
        ];
        for (criterion, cost, gradient) in cases {
            let found = criterion.cost_and_gradient(&information).unwrap();
            assert!((found.0 - cost).abs() < 1e-14, "{} {cost}", found.0);
            assert!((found.1 - gradient).amax() < 1e-14, "{} {gradient}", found.1);
            assert_eq!(criterion.cost(&information), Some(found.0));
            assert_eq!(criterion.cost(&SMatrix::<f64, 2, 2>::new(1.0, 1.0, 1.0, 1.0)), None);
        }
        // In units of 2 and 1 the same experiment informs otherwise.
        let scaled = InLikeUnits { criterion: AOptimality, magnitudes: SVector::<f64, 2>::new(2.0, 1.0) };
        let expected = AOptimality.cost(&SMatrix::<f64, 2, 2>::new(20.0, 6.0, 6.0, 5.0));
        assert_eq!(scaled.cost(&information), expected);
    }

    /// A subgradient of a convex cost lies below it, kink or not.
    #[test]
    fn a_repeated_eigenvalue_leaves_a_subgradient() {
        let base = SMatrix::<f64, 3, 3>::from_diagonal(&SVector::<f64, 3>::new(4.0, 2.0, 2.0));
        let (cost, gradient) = EOptimality.cost_and_gradient(&base).unwrap();
        for step in [-0.5, 0.5] {
            for (i, j) in [(0, 1), (1, 1), (1, 2), (2, 2)] {
                let mut change = SMatrix::<f64, 3, 3>::zeros();
                change[(i, j)] = step;
                change[(j, i)] = step;
                let above = EOptimality.cost(&(base + change)).unwrap() - cost - gradient.dot(&change);
                assert!(above >= -1e-14, "{i} {j} {step}: {above}");
            }
        }
    }
}
