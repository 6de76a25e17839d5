//! What of a belief no motion improves, because the thrust is not what it is believed to be.

use crate::belief::ModelBelief;
use crate::error::{PlanningError, indefinite, not_negative};
use crate::local::{body_by_mass_center_and_inertia, covariance_about_com, sizes_about_com, whitened};
use nalgebra::{Matrix3, SMatrix, Vector3};
use tumble_dynamics::{InertialParameters, PARAMETERS};

/// Of any direction, so much of the variance is taken to be beyond learning at most: what is believed is not held against an estimator that
/// knows better.
const MOST_LASTING: f64 = 0.9;

/// How well the thrust itself is known, one standard deviation each. A body that is heavier by a hundredth moves as one does that is
/// pushed by a hundredth less: what these leave open of the body no motion tells.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct ThrustDoubt {
    /// Constant relative error of the force along each body axis, independent of the others.
    pub force_scale: f64,
    /// The same of the torque about each axis.
    pub torque_scale: f64,
    /// Place of a force's line beside where it is believed, m.
    pub line_m: f64,
}

type Matrix10 = SMatrix<f64, PARAMETERS, PARAMETERS>;

impl ThrustDoubt {
    /// None: all of a belief can be improved.
    pub const NONE: Self = Self { force_scale: 0.0, torque_scale: 0.0, line_m: 0.0 };

    /// # Errors
    /// What is negative or no number.
    pub(super) fn check(&self) -> Result<(), PlanningError> {
        for value in [self.force_scale, self.torque_scale, self.line_m] {
            not_negative("a doubt of the thrust", value)?;
        }
        Ok(())
    }

    /// Covariance of mass, centre of mass and inertia about it of a body that is known but for the thrust, pushed along so many axes.
    ///
    /// The mass errs by the mean of the factors; a moment by the factor of its torque, a product by the mean of both; a centre of mass
    /// by the line of the force that tells it.
    fn lasting(&self, body: &InertialParameters<f64>, pushed_axes: usize) -> Matrix10 {
        let independent = |mass: f64, first_moment: Vector3<f64>, inertia_about_origin: Matrix3<f64>| {
            let change = InertialParameters { mass, first_moment, inertia_about_origin }.to_vector();
            change * change.transpose()
        };
        let (none, nothing) = (Vector3::zeros(), Matrix3::zeros());
        let shared = self.force_scale / f64::sqrt(pushed_axes.max(1) as f64);
        let mut lasting = independent(body.mass * shared, none, nothing);
        let inertia = body.inertia_about_com();
        for axis in 0..3 {
            lasting += independent(0.0, Vector3::ith(axis, self.line_m), nothing);
            let mut factor = Matrix3::zeros();
            factor[(axis, axis)] = 0.5 * self.torque_scale;
            lasting += independent(0.0, none, factor * inertia + inertia * factor);
        }
        lasting
    }

    /// The belief with the covariance of what motion can still teach: along each direction less what lasts.
    ///
    /// # Errors
    /// A belief whose body does not exist, whose covariance is none.
    pub(super) fn learnable(&self, belief: &ModelBelief, pushed_axes: usize) -> Result<ModelBelief, PlanningError> {
        let mut learnable = belief.clone();
        if *self == Self::NONE {
            return Ok(learnable);
        }
        let body = belief.parameters();
        let covariance = covariance_about_com(belief)?;
        let (sigma, information) =
            whitened(&covariance, &sizes_about_com(body), &["a variance of the belief"; PARAMETERS])?;
        let what = "the least eigenvalue of the belief's information";
        let factor = information.cholesky().ok_or_else(|| indefinite(what, &information))?.l();
        let inverse = factor.try_inverse().ok_or_else(|| indefinite(what, &information))?;
        // white for the belief
        let lasting = self.lasting(body, pushed_axes);
        let scaled = Matrix10::from_fn(|i, j| lasting[(i, j)] / (sigma[i] * sigma[j]));
        let white = factor.transpose() * scaled * factor;
        let eigen = ((white + white.transpose()) * 0.5).symmetric_eigen();
        let left = Matrix10::from_diagonal(&eigen.eigenvalues.map(|share| 1.0 - share.clamp(0.0, MOST_LASTING)));
        let left = eigen.eigenvectors * left * eigen.eigenvectors.transpose();
        let left = inverse.transpose() * left * inverse;
        let left = Matrix10::from_fn(|i, j| left[(i, j)] * sigma[i] * sigma[j]);
        let by_quantities = body_by_mass_center_and_inertia(body);
        let left = by_quantities * left * by_quantities.transpose();
        learnable.estimate.covariance = (left + left.transpose()) * 0.5;
        Ok(learnable)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn body() -> InertialParameters<f64> {
        let inertia = Matrix3::new(0.15, 0.01, -0.02, 0.01, 0.14, 0.005, -0.02, 0.005, 0.16);
        InertialParameters::about_com(9.5, Vector3::new(0.05, -0.1, 0.07), inertia)
    }

    fn sigma_about_com(belief: &ModelBelief) -> SMatrix<f64, PARAMETERS, 1> {
        covariance_about_com(belief).unwrap().diagonal().map(f64::sqrt)
    }

    #[test]
    fn of_a_vague_body_nearly_all_can_be_learned_and_of_one_that_is_known_next_to_nothing() {
        let doubt = ThrustDoubt { force_scale: 0.01, torque_scale: 0.02, line_m: 1e-3 };
        let vague = ModelBelief::vague(3, body(), [0.3, 0.05, 0.3]);
        let learnable = doubt.learnable(&vague, 3).unwrap();
        assert_eq!(learnable.revision, 3);
        let (all, left) = (sigma_about_com(&vague), sigma_about_com(&learnable));
        // What is left and what lasts are the whole: a mass known to 0.3 of which a hundredth over the root of three lasts.
        let lasts = |i: usize| f64::sqrt(all[i] * all[i] - left[i] * left[i]);
        assert!((lasts(0) - 9.5 * 0.01 / f64::sqrt(3.0)).abs() < 1e-9, "{}", lasts(0));
        assert!((lasts(1) - 1e-3).abs() < 1e-9, "{}", lasts(1));
        assert!((lasts(4) - 0.02 * 0.15).abs() < 1e-9, "{}", lasts(4));
        let known = ModelBelief::vague(4, body(), [1e-4, 1e-5, 1e-4]);
        let shares = sigma_about_com(&doubt.learnable(&known, 3).unwrap()).component_div(&sigma_about_com(&known));
        assert!((shares[0] - f64::sqrt(1.0 - MOST_LASTING)).abs() < 1e-6, "{shares}");
        assert!(shares.max() < 1.0 + 1e-9, "{shares}");
    }

    #[test]
    fn without_doubt_a_belief_stays_as_it_is() {
        let belief = ModelBelief::vague(1, body(), [0.3, 0.05, 0.3]);
        assert_eq!(ThrustDoubt::NONE.learnable(&belief, 3).unwrap(), belief);
        assert!(ThrustDoubt { line_m: f64::NAN, ..ThrustDoubt::NONE }.check().is_err());
        assert!(ThrustDoubt { force_scale: -1.0, ..ThrustDoubt::NONE }.check().is_err());
    }
}
