//! Laws of criteria.

use crate::criteria::OptimalityCriterion;
use crate::excitation::{CriterionGradient, ExcitationCriterion};
use nalgebra::{SMatrix, SVector};
use tumble_lie::laws::{LawViolation, require};

/// Relative step of the central differences.
const STEP: f64 = 1e-5;

/// Laws of an [`OptimalityCriterion`], tried at `informations`, symmetric, positive definite, of two parameters or
/// more, and without repeated extreme eigenvalues.
///
/// `tolerance` is relative; 1e-6 suits well-conditioned matrices, for the derivatives are checked by central differences.
///
/// # Errors
/// The first broken law: `information without a direction has no cost`, `information has a cost`,
/// `cost is that of the gradient`, `gradient is symmetric`, `gradient is the derivative`.
pub fn check_optimality_criterion<const P: usize>(
    criterion: &dyn OptimalityCriterion<P>,
    informations: &[SMatrix<f64, P, P>],
    tolerance: f64,
) -> Result<(), LawViolation> {
    for information in informations {
        for singular in without_a_direction(information) {
            let found = criterion.cost_and_gradient(&singular);
            let cost = criterion.cost(&singular);
            let error = if found.is_none() && cost.is_none() { 0.0 } else { f64::INFINITY };
            require("information without a direction has no cost", &singular, &"none", &(found, cost), error, 0.0)?;
        }
        let Some((cost, gradient)) = criterion.cost_and_gradient(information) else {
            return require("information has a cost", information, &"a cost", &"none", f64::INFINITY, 0.0);
        };
        let alone = criterion.cost(information).unwrap_or(f64::NAN);
        let error = (alone - cost).abs();
        require("cost is that of the gradient", information, &cost, &alone, error, 1e-12 * (1.0 + cost.abs()))?;
        check_by_information(&|information| criterion.cost(information), information, &gradient, tolerance)?;
    }
    Ok(())
}

/// Laws of an [`ExcitationCriterion`], tried at pairs of an information, as
/// [`check_optimality_criterion`] takes it, and root mean squares of the channels.
///
/// # Errors
/// The first broken law: those of [`check_optimality_criterion`] and `gradient by distances is the derivative`.
pub fn check_excitation_criterion<const P: usize>(
    criterion: &dyn ExcitationCriterion<P>,
    motions: &[(SMatrix<f64, P, P>, [f64; 6])],
    tolerance: f64,
) -> Result<(), LawViolation> {
    for (information, rms) in motions {
        // The rest are the laws of a criterion that knows the distances.
        let still = AtDistances { criterion, rms: *rms };
        check_optimality_criterion(&still, core::slice::from_ref(information), tolerance)?;
        let Some(found) = criterion.gradient(information, rms) else { continue };
        for (channel, stated) in found.by_rms.iter().enumerate() {
            let step = STEP * (rms[channel].abs() + 1.0);
            let at = |offset: f64| {
                let mut moved = *rms;
                moved[channel] += offset;
                criterion.gradient(information, &moved).map_or(f64::NAN, |found| found.cost)
            };
            let slope = (at(step) - at(-step)) / (2.0 * step);
            let size = 1.0 + found.cost.abs() + slope.abs();
            let law = "gradient by distances is the derivative";
            require(law, &(information, rms, channel), &slope, stated, (slope - stated).abs(), tolerance * size)?;
        }
    }
    Ok(())
}

/// The law `more information never costs more`, tried by adding each of `more`, positive semidefinite, to each of
/// `informations`.
///
/// Of A-, D- and E-optimality it holds, of ratios such as a condition number it does not.
///
/// # Errors
/// That law.
pub fn check_more_information<const P: usize>(
    criterion: &dyn OptimalityCriterion<P>,
    informations: &[SMatrix<f64, P, P>],
    more: &[SMatrix<f64, P, P>],
) -> Result<(), LawViolation> {
    for before in informations {
        for more in more {
            let (cost, lower) = (criterion.cost(before), criterion.cost(&(before + more)));
            let rise = lower.unwrap_or(f64::NAN) - cost.unwrap_or(f64::NAN);
            let rounding = 1e-12 * (1.0 + cost.unwrap_or(0.0).abs());
            require("more information never costs more", &(before, more), &cost, &lower, rise, rounding)?;
        }
    }
    Ok(())
}

/// The law `units change the cost by a constant`: whatever the experiment, parameters in multiples of `magnitudes` cost the
/// same amount more. Of D-optimality it holds, the amount being minus twice the sum of the logarithms; of
/// [`NormalizedCondition`](crate::excitation::NormalizedCondition) too, with none.
///
/// # Errors
/// That law.
pub fn check_change_of_units<const P: usize>(
    criterion: &dyn ExcitationCriterion<P>,
    informations: &[SMatrix<f64, P, P>],
    magnitudes: &SVector<f64, P>,
    tolerance: f64,
) -> Result<(), LawViolation> {
    let sizes = magnitudes * magnitudes.transpose();
    let cost = |information: &SMatrix<f64, P, P>| {
        criterion.gradient(information, &[0.0; 6]).map_or(f64::NAN, |found| found.cost)
    };
    let mut constant = None;
    for information in informations {
        let (before, after) = (cost(information), cost(&information.component_mul(&sizes)));
        let expected = *constant.get_or_insert(after - before);
        let error = (after - before - expected).abs();
        let size = 1.0 + before.abs() + after.abs();
        let law = "units change the cost by a constant";
        require(law, &(information, magnitudes), &expected, &(after - before), error, tolerance * size)?;
    }
    Ok(())
}

/// The same information without that about one parameter, and without that about one eigenvector.
fn without_a_direction<const P: usize>(information: &SMatrix<f64, P, P>) -> [SMatrix<f64, P, P>; 2] {
    let mut without_a_parameter = *information;
    without_a_parameter.fill_row(P - 1, 0.0);
    without_a_parameter.fill_column(P - 1, 0.0);
    // Of rank one.
    let row = information.row(0).into_owned();
    [without_a_parameter, row.transpose() * row]
}

fn check_by_information<const P: usize>(
    cost: &dyn Fn(&SMatrix<f64, P, P>) -> Option<f64>,
    information: &SMatrix<f64, P, P>,
    gradient: &SMatrix<f64, P, P>,
    tolerance: f64,
) -> Result<(), LawViolation> {
    let asymmetry = (gradient - gradient.transpose()).amax();
    let size = gradient.amax();
    require("gradient is symmetric", information, &"G = G^T", gradient, asymmetry, 1e-12 * size)?;
    for i in 0..P {
        for j in i..P {
            // Of symmetric changes, in proportion to what the entries are about.
            let mut change = SMatrix::<f64, P, P>::zeros();
            change[(i, j)] = (information[(i, i)] * information[(j, j)]).sqrt();
            change[(j, i)] = change[(i, j)];
            // Small beside the least informed direction.
            let Some(cholesky) = information.cholesky() else { continue };
            let step = STEP / cholesky.solve(&change).norm();
            let at = |offset: f64| cost(&(information + change * offset)).unwrap_or(f64::NAN);
            let slope = (at(step) - at(-step)) / (2.0 * step);
            let stated = gradient.dot(&change);
            // What the cost would change by if the information did by as much as the step is small beside it.
            let size = cost(information).unwrap_or(f64::NAN).abs().max(1.0) * cholesky.solve(&change).norm();
            let error = (slope - stated).abs();
            require("gradient is the derivative", &(information, i, j), &slope, &stated, error, tolerance * size)?;
        }
    }
    Ok(())
}

/// An excitation criterion as one of information alone.
struct AtDistances<'a, const P: usize> {
    criterion: &'a dyn ExcitationCriterion<P>,
    rms: [f64; 6],
}

impl<const P: usize> OptimalityCriterion<P> for AtDistances<'_, P> {
    fn cost_and_gradient(&self, information: &SMatrix<f64, P, P>) -> Option<(f64, SMatrix<f64, P, P>)> {
        let CriterionGradient { cost, by_information, .. } = self.criterion.gradient(information, &self.rms)?;
        Some((cost, by_information))
    }
}
