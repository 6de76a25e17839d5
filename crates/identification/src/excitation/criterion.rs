//! What a designed motion is judged by.

use crate::criteria::{ConditionNumber, OptimalityCriterion};
use nalgebra::{ComplexField, SMatrix, SVector};

/// The cost of a motion and its derivatives by what the cost depends on.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct CriterionGradient<const P: usize> {
    /// Smaller is better.
    pub cost: f64,
    /// By the information, as [`OptimalityCriterion::cost_and_gradient`] has it.
    pub by_information: SMatrix<f64, P, P>,
    /// By the root mean squares of the channels.
    pub by_rms: [f64; 6],
}

/// A cost to minimise over motions: of the information they give, and of how far they go.
///
/// Every [`OptimalityCriterion`] is one that does not look at the distances; wrap those that depend on units in
/// [`InLikeUnits`](crate::InLikeUnits). Designs hand over the information in SI units.
///
/// # Example
/// ```
/// use tumble_identification::excitation::{CriterionGradient, ExcitationCriterion};
/// use tumble_identification::nalgebra::{Matrix2, SMatrix};
/// use tumble_identification::{DOptimality, OptimalityCriterion};
///
/// /// What D-optimality asks for, at a price per metre of travel along x.
/// struct Thrifty;
/// impl<const P: usize> ExcitationCriterion<P> for Thrifty {
///     fn gradient(&self, information: &SMatrix<f64, P, P>, rms: &[f64; 6]) -> Option<CriterionGradient<P>> {
///         let (cost, by_information) = DOptimality.cost_and_gradient(information)?;
///         let mut by_rms = [0.0; 6];
///         by_rms[0] = 3.0;
///         Some(CriterionGradient { cost: cost + 3.0 * rms[0], by_information, by_rms })
///     }
/// }
/// let far = Thrifty.gradient(&Matrix2::identity(), &[2.0, 0.0, 0.0, 0.0, 0.0, 0.0]).ok_or("singular")?;
/// assert_eq!(far.cost, 6.0);
/// # Ok::<(), &str>(())
/// ```
/// Tutorial: [a criterion of your own](https://github.com/tumble-robotics/tumble/blob/main/crates/identification/tests/suite/custom_criterion.rs).
pub trait ExcitationCriterion<const P: usize> {
    /// Cost and derivatives from the information and the root mean squares over a period of the channels
    /// `[x, y, z, roll, pitch, yaw]`, m and rad; `None` where the information is singular.
    fn gradient(&self, information: &SMatrix<f64, P, P>, rms: &[f64; 6]) -> Option<CriterionGradient<P>>;
}

impl<C: OptimalityCriterion<P> + ?Sized, const P: usize> ExcitationCriterion<P> for C {
    fn gradient(&self, information: &SMatrix<f64, P, P>, _rms: &[f64; 6]) -> Option<CriterionGradient<P>> {
        let (cost, by_information) = self.cost_and_gradient(information)?;
        Some(CriterionGradient { cost, by_information, by_rms: [0.0; 6] })
    }
}

/// Condition number of the whitened regressor with columns of unit length, minus a reward for large motions.
///
/// Blind to the units of the parameters, and to how much they are excited in all: the reward makes up for that.
///
/// # Source
/// Thesis (4.14), there V1.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct NormalizedCondition {
    /// Reward per root mean square of the channels `[x, y, z, roll, pitch, yaw]`, 1/m and 1/rad.
    pub rms_weights: [f64; 6],
}

impl<const P: usize> ExcitationCriterion<P> for NormalizedCondition {
    fn gradient(&self, information: &SMatrix<f64, P, P>, rms: &[f64; 6]) -> Option<CriterionGradient<P>> {
        let squares = information.diagonal();
        if !squares.iter().all(|&square| square > 0.0) {
            return None;
        }
        // Information with ones on the diagonal: its condition number is the square of the regressor's.
        let inverse = squares.map(|square| 1.0 / ComplexField::sqrt(square));
        let scale: SMatrix<f64, P, P> = inverse * inverse.transpose();
        let normalized = information.component_mul(&scale);
        let (square, by_normalized) = ConditionNumber.cost_and_gradient(&normalized)?;
        let condition = ComplexField::sqrt(square);
        let by_normalized = by_normalized / (2.0 * condition);
        // More of one parameter's information also lengthens its column.
        let by_length = SVector::<f64, P>::from_fn(|i, _| normalized.column(i).dot(&by_normalized.column(i)));
        let by_information =
            by_normalized.component_mul(&scale) - SMatrix::from_diagonal(&by_length.component_div(&squares));
        let reward: f64 = self.rms_weights.iter().zip(rms).map(|(weight, rms)| weight * rms).sum();
        Some(CriterionGradient { cost: condition - reward, by_information, by_rms: self.rms_weights.map(|q| -q) })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::criteria::DOptimality;

    /// Regressor columns (3, 0) and (4, 4): unit columns with the cosine 1/sqrt 2.
    #[test]
    fn by_hand() {
        let information = SMatrix::<f64, 2, 2>::new(9.0, 12.0, 12.0, 32.0);
        let half = core::f64::consts::FRAC_1_SQRT_2;
        let expected = ((1.0 + half) / (1.0 - half)).sqrt();
        let criterion = NormalizedCondition { rms_weights: [1.0, 0.0, 2.0, 0.0, 0.0, 3.0] };
        let found = criterion.gradient(&information, &[0.1, 5.0, 0.2, 5.0, 5.0, 0.3]).unwrap();
        assert!((found.cost - (expected - 1.4)).abs() < 1e-14, "{} {expected}", found.cost);
        let expected = [-1.0, 0.0, -2.0, 0.0, 0.0, -3.0_f64];
        assert!(found.by_rms.iter().zip(expected).all(|(by_rms, expected)| (by_rms - expected).abs() < f64::EPSILON));
        assert_eq!(criterion.gradient(&SMatrix::<f64, 2, 2>::new(0.0, 0.0, 0.0, 1.0), &[0.0; 6]), None);
    }

    #[test]
    fn optimality_criteria_do_not_look_at_distances() {
        let information = SMatrix::<f64, 2, 2>::new(9.0, 12.0, 12.0, 32.0);
        let (cost, by_information) = DOptimality.cost_and_gradient(&information).unwrap();
        let expected = CriterionGradient { cost, by_information, by_rms: [0.0; 6] };
        assert_eq!(DOptimality.gradient(&information, &[1.0; 6]), Some(expected));
    }
}
