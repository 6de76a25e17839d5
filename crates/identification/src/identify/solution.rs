//! From an information to what may be said: consistent body, derived standard deviations.

use super::plan::Plan;
use super::settings::Prior;
use crate::BodyScale;
use crate::consistency::{ConstrainedLeastSquares, InteriorPoint, PseudoInertiaCone};
use crate::dynamics::InertialParameters;
use crate::error::IdentificationError;
use crate::estimator::{Estimate, standard_deviations};
use crate::square_root_information::SquareRootInformation;
use nalgebra::{ComplexField, Matrix3, SMatrix, SVector, Vector3};

/// Information of a Gaussian with this mean and covariance.
pub(crate) fn from_covariance(
    mean: &SVector<f64, 10>,
    covariance: &SMatrix<f64, 10, 10>,
    magnitudes: &SVector<f64, 10>,
) -> Result<SquareRootInformation<10>, IdentificationError> {
    let scaled = SMatrix::<f64, 10, 10>::from_fn(|i, j| covariance[(i, j)] / (magnitudes[i] * magnitudes[j]));
    // Eigenvalues that rounding made too small would claim digits nobody has.
    let eigen = scaled.symmetric_eigen();
    let floor = 1e-15 * eigen.eigenvalues.amax();
    let (mut factor, mut rhs) = (SMatrix::<f64, 10, 10>::zeros(), SVector::<f64, 10>::zeros());
    for i in 0..10 {
        let root = 1.0 / ComplexField::sqrt(eigen.eigenvalues[i].max(floor).max(f64::MIN_POSITIVE));
        for j in 0..10 {
            factor[(i, j)] = root * eigen.eigenvectors[(j, i)] / magnitudes[j];
        }
        rhs[i] = (0..10).map(|j| factor[(i, j)] * mean[j]).sum();
    }
    SquareRootInformation::from_square_root(&factor, &rhs)
}

/// The answers that an information allows.
pub(super) struct Solution {
    pub(super) estimate: Option<Estimate>,
    pub(super) regularised: Option<Estimate>,
}

/// The body where data and prior determine it; below full rank also the one that a weak physical prior completes.
pub(super) fn solve(
    mut information: SquareRootInformation<10>,
    scale: BodyScale,
    full_rank: bool,
    plan: &Plan<'_>,
) -> Result<Solution, IdentificationError> {
    let mut estimate = None;
    let prior = plan.settings.prior.as_ref();
    let constrained =
        |information: &SquareRootInformation<10>| constrained_by(&*(plan.solver)(scale), information, scale);
    if let Some(prior) = prior {
        information.add_prior(&prior.mean.to_vector(), &prior.standard_deviation)?;
    }
    if full_rank || prior.is_some() {
        estimate = match constrained(&information) {
            Err(IdentificationError::NotExcited { .. }) if !full_rank => None,
            found => Some(found?),
        };
    }
    let mut regularised = None;
    if !full_rank {
        let weak = weak_prior(scale);
        information.add_prior(&weak.mean.to_vector(), &weak.standard_deviation)?;
        regularised = Some(constrained(&information)?);
    }
    Ok(Solution { estimate, regularised })
}

/// The consistent body nearest to an information, with the covariance of the unconstrained solution.
pub(crate) fn constrained(
    information: &SquareRootInformation<10>,
    scale: BodyScale,
) -> Result<Estimate, IdentificationError> {
    constrained_by(&InteriorPoint::new(PseudoInertiaCone::new(scale)), information, scale)
}

/// The same by another solver.
fn constrained_by(
    solver: &dyn ConstrainedLeastSquares<10>,
    information: &SquareRootInformation<10>,
    scale: BodyScale,
) -> Result<Estimate, IdentificationError> {
    let found = solver.solve(information)?;
    let covariance = information.covariance(&scale.parameter_magnitudes())?;
    let std = standard_deviations(&found.parameters, &covariance);
    Ok(Estimate {
        parameters: InertialParameters::from_vector(&found.parameters),
        covariance,
        std,
        lmi_active: found.is_active(),
    })
}

/// A sphere-like body about the origin, known to twice its own size: enough to make a rank-deficient problem solvable.
pub(super) fn weak_prior(scale: BodyScale) -> Prior {
    let (mass, length) = (scale.mass_kg(), scale.length_m());
    let inertia = Matrix3::identity() * (2.0 / 3.0 * mass * length * length);
    Prior {
        mean: InertialParameters::about_origin(mass, Vector3::zeros(), inertia),
        standard_deviation: scale.parameter_magnitudes() * 2.0,
    }
}
