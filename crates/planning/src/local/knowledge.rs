//! What a belief says about chosen quantities.

use super::about_com::about_com_by_parameters;
use super::model::Knowledge;
use crate::belief::ModelBelief;
use crate::error::{PlanningError, finite, indefinite, not_negative, positive};
use nalgebra::{Cholesky, Const, SMatrix};
use tumble_dynamics::PARAMETERS;

/// What is known exactly is taken to be known to a millionth, so that it still has an information: each parameter of its size,
/// each combination of parameters of its prior standard deviations and sizes.
const LEAST_RELATIVE_SIGMA: f64 = 1e-6;

/// Names and units of mass, centre of mass and inertia about it, in the order in which they are unknown.
pub(crate) const QUANTITIES: [(&str, &str); PARAMETERS] = [
    ("mass", "kg"),
    ("center_of_mass_x", "m"),
    ("center_of_mass_y", "m"),
    ("center_of_mass_z", "m"),
    ("inertia_xx", "kg m^2"),
    ("inertia_xy", "kg m^2"),
    ("inertia_xz", "kg m^2"),
    ("inertia_yy", "kg m^2"),
    ("inertia_yz", "kg m^2"),
    ("inertia_zz", "kg m^2"),
];

/// Standard deviations of parameters of these sizes, and the information about their errors in standard deviations: the inverse
/// of the correlation. The one rule for what is known exactly: [`LEAST_RELATIVE_SIGMA`].
///
/// # Errors
/// A matrix that is no covariance; a parameter without size that is known exactly.
pub(crate) fn whitened<const P: usize>(
    covariance: &SMatrix<f64, P, P>,
    sizes: &[f64; P],
    names: &[&'static str; P],
) -> Result<([f64; P], SMatrix<f64, P, P>), PlanningError> {
    let mut sigma = [0.0; P];
    for (i, (sigma, (size, name))) in sigma.iter_mut().zip(sizes.iter().zip(names)).enumerate() {
        let least = LEAST_RELATIVE_SIGMA * finite(name, *size)?.abs();
        let variance = covariance[(i, i)];
        // less than zero by rounding
        let variance = if variance.abs() < least * least { 0.0 } else { not_negative(name, variance)? };
        *sigma = positive(name, f64::sqrt(variance).max(least))?;
    }
    let mut correlation = SMatrix::<f64, P, P>::identity();
    for i in 0..P {
        for j in 0..P {
            let scale = sigma[i] * sigma[j];
            let entry = finite("a covariance", covariance[(i, j)])?;
            let mirrored = covariance[(j, i)];
            if (entry - mirrored).abs() > 1e-9 * scale {
                return Err(PlanningError::Asymmetric { what: "the covariance of the parameters" });
            }
            if i != j {
                correlation[(i, j)] = 0.5 * (entry + mirrored) / scale;
            }
        }
    }
    let least = LEAST_RELATIVE_SIGMA * LEAST_RELATIVE_SIGMA;
    let is_open = |factor: &Cholesky<f64, Const<P>>| factor.l_dirty().diagonal().iter().all(|x| x * x >= least);
    let factor = correlation.cholesky().filter(is_open);
    let factor = factor.or_else(|| {
        // a millionth of the sizes too, where they are not what the deviation is already
        let ratio = |i: usize| if covariance[(i, i)] < least * sizes[i] * sizes[i] { 0.0 } else { sizes[i] / sigma[i] };
        let added =
            SMatrix::<f64, P, P>::from_fn(|i, j| if i == j { least * (1.0 + ratio(i) * ratio(i)) } else { 0.0 });
        (correlation + added).cholesky()
    });
    let Some(factor) = factor else {
        return Err(indefinite("the least eigenvalue of the correlation of the parameters", &correlation));
    };
    let inverse = factor.inverse();
    Ok((sigma, (inverse + inverse.transpose()) * 0.5))
}

impl<const P: usize> Knowledge<P> {
    /// Knowledge of quantities of these sizes, with this covariance; the coordinates are their errors in prior standard
    /// deviations.
    ///
    /// What is known exactly is taken to be known to a millionth: a quantity of its size, a combination of quantities of their
    /// standard deviations.
    ///
    /// # Errors
    /// A matrix that is no covariance; a quantity of no size that is known exactly.
    pub fn of_covariance(
        covariance: &SMatrix<f64, P, P>,
        sizes: &[f64; P],
        names: [&'static str; P],
        units: [&'static str; P],
    ) -> Result<Self, PlanningError> {
        let (sigma, information) = whitened(covariance, sizes, &names)?;
        let mut quantities = SMatrix::zeros();
        for (i, sigma) in sigma.iter().enumerate() {
            quantities[(i, i)] = *sigma;
        }
        Ok(Self { information, quantities, names, units })
    }

    /// The prior standard deviation of each coordinate's own quantity.
    pub fn scales(&self) -> [f64; P] {
        core::array::from_fn(|i| self.quantities[(i, i)])
    }
}

/// Covariance of mass, centre of mass and inertia about it.
///
/// # Errors
/// A belief whose body does not exist.
pub(crate) fn covariance_about_com(
    belief: &ModelBelief,
) -> Result<SMatrix<f64, PARAMETERS, PARAMETERS>, PlanningError> {
    let body = belief.parameters().validated()?;
    let by_parameters = about_com_by_parameters(&body);
    Ok(by_parameters * belief.estimate.covariance * by_parameters.transpose())
}

#[cfg(test)]
#[allow(clippy::float_cmp, reason = "the same operations give the same bits")]
mod tests {
    use super::*;

    #[test]
    fn knowledge_is_the_covariance_in_other_units() {
        let covariance = SMatrix::<f64, 2, 2>::new(4.0, 0.6, 0.6, 0.25);
        let known = Knowledge::of_covariance(&covariance, &[5.0, 0.0], ["mass", "drag"], ["kg", "kg/s"]).unwrap();
        let back = known.quantities * known.information.try_inverse().unwrap() * known.quantities.transpose();
        assert!((back - covariance).amax() < 1e-14);
        assert_eq!(known.scales(), [2.0, 0.5]);
        let refused = |matrix: [[f64; 2]; 2]| {
            let matrix = SMatrix::<f64, 2, 2>::from(matrix);
            Knowledge::of_covariance(&matrix, &[5.0, 0.0], ["mass", "drag"], ["kg", "kg/s"]).unwrap_err()
        };
        assert_eq!(
            refused([[4.0, 0.0], [0.0, 0.0]]),
            PlanningError::NotPositive { what: "drag", value: 0.0 },
            "a quantity of no size known exactly"
        );
        assert!(matches!(refused([[-1e-9, 0.0], [0.0, 1.0]]), PlanningError::Negative { .. }));
        assert!(matches!(refused([[0.0, 1.0], [1.0, 1.0]]), PlanningError::NotPositive { value, .. } if value < 0.0));
        assert!(matches!(refused([[4.0, 3.0], [3.0, 0.25]]), PlanningError::NotPositive { value, .. } if value < 0.0));
        assert!(matches!(refused([[4.0, 0.2], [0.1, 0.25]]), PlanningError::Asymmetric { .. }));
        assert!(matches!(refused([[f64::NAN, 0.0], [0.0, 1.0]]), PlanningError::NotFinite { .. }));
    }
    #[test]
    fn what_is_known_exactly_is_taken_to_be_known_to_a_millionth() {
        let of = |covariance: [[f64; 2]; 2]| {
            Knowledge::of_covariance(&covariance.into(), &[5.0, -0.2], ["mass", "drag"], ["kg", "kg/s"]).unwrap()
        };
        let certain = of([[0.0, 0.0], [0.0, 0.0]]);
        let [mass, drag] = certain.scales();
        assert!((mass - 5e-6).abs() < 1e-18 && (drag - 0.2e-6).abs() < 1e-18);
        assert_eq!(certain.information, SMatrix::<f64, 2, 2>::identity());
        let [mass, drag] = of([[4.0, 0.0], [0.0, 0.0]]).scales();
        assert!((mass - 2.0).abs() < 1e-12 && (drag - 0.2e-6).abs() < 1e-18);
        // one combination: a millionth of what is not known of the rest
        let line = of([[4.0, 1.0], [1.0, 0.25]]);
        let least = line.information.symmetric_eigen().eigenvalues.map(|x| f64::sqrt(1.0 / x));
        assert!((1e-6..5e-6).contains(&least.min()) && (least.max() - f64::sqrt(2.0)).abs() < 1e-3, "{least}");
    }
}
