//! Scalar measures of an information matrix, smaller being better.

use nalgebra::{ComplexField, SMatrix, SVector};

use crate::jacobi::singular_values;

/// A cost to minimise over experiments.
///
/// Put the parameters into like units first (rows and columns times
/// [`BodyScale::parameter_magnitudes`](crate::BodyScale::parameter_magnitudes)); only [`DOptimality`] ranks experiments
/// equally in all units.
///
/// # Source
/// Thesis 2.3.1, (6.9).
///
/// # Deviation
/// 2.3.1 maximises the trace of the inverse; A-optimality minimises it, as (6.9) does. Section 4.2 and the footnote of
/// chapter 6 swap the names D and E; here D is the determinant and E the extreme eigenvalue (test `by_hand`).
pub trait OptimalityCriterion<const P: usize> {
    /// Cost of a symmetric positive semidefinite information matrix; `None` where it is singular.
    fn cost(&self, information: &SMatrix<f64, P, P>) -> Option<f64>;
}

/// Trace of the covariance: the mean squared error.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct AOptimality;

/// Minus the logarithm of the determinant of the information: the log-volume of the confidence ellipsoid, twice.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct DOptimality;

/// Largest eigenvalue of the covariance: the worst direction.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct EOptimality;

/// Ratio of the largest to the smallest eigenvalue of the information.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct ConditionNumber;

/// Eigenvalues in descending order, from the Cholesky factor so that small ones stay accurate.
fn eigenvalues<const P: usize>(information: &SMatrix<f64, P, P>) -> Option<SVector<f64, P>> {
    let lower = information.cholesky()?.unpack();
    let values = singular_values(lower.transpose()).0.map(|s| s * s);
    // A quotient of rounding errors is not information.
    (values[P - 1] > P as f64 * f64::EPSILON * values[0]).then_some(values)
}

impl<const P: usize> OptimalityCriterion<P> for AOptimality {
    fn cost(&self, information: &SMatrix<f64, P, P>) -> Option<f64> {
        Some(eigenvalues(information)?.iter().map(|value| 1.0 / value).sum())
    }
}

impl<const P: usize> OptimalityCriterion<P> for DOptimality {
    fn cost(&self, information: &SMatrix<f64, P, P>) -> Option<f64> {
        // Of the eigenvalues only for the test of singularity.
        eigenvalues(information)?;
        let lower = information.cholesky()?.unpack();
        Some(-2.0 * (0..P).map(|i| ComplexField::ln(lower[(i, i)])).sum::<f64>())
    }
}

impl<const P: usize> OptimalityCriterion<P> for EOptimality {
    fn cost(&self, information: &SMatrix<f64, P, P>) -> Option<f64> {
        Some(1.0 / eigenvalues(information)?[P - 1])
    }
}

impl<const P: usize> OptimalityCriterion<P> for ConditionNumber {
    fn cost(&self, information: &SMatrix<f64, P, P>) -> Option<f64> {
        let values = eigenvalues(information)?;
        Some(values[0] / values[P - 1])
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn by_hand() {
        // Eigenvalues 8 and 2.
        let information = SMatrix::<f64, 2, 2>::new(5.0, 3.0, 3.0, 5.0);
        let cases: [(&dyn OptimalityCriterion<2>, f64); 4] =
            [(&AOptimality, 0.625), (&DOptimality, -(16.0_f64.ln())), (&EOptimality, 0.5), (&ConditionNumber, 4.0)];
        for (criterion, expected) in cases {
            assert!((criterion.cost(&information).unwrap() - expected).abs() < 1e-14);
            assert_eq!(criterion.cost(&SMatrix::<f64, 2, 2>::new(1.0, 1.0, 1.0, 1.0)), None);
        }
    }
}
