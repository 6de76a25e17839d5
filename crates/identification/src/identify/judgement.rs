//! How many directions of the ten the rows of a fit determine.

use super::fit::Fit;
use super::identification::Silence;
use super::settings::Prior;
use super::solution::from_covariance;
use crate::error::IdentificationError;
use crate::jacobi::singular_values;
use crate::square_root_information::SquareRootInformation;
use crate::weighted_least_squares::whitened;
use crate::{BodyScale, Observability, RANK_TOLERANCE};
use nalgebra::{SMatrix, SVector};

/// A direction counts as determined when no more than this share of its signal is noise in the regressor.
const LARGEST_NOISE_SHARE: f64 = 0.5;

/// Below rank ten nothing is taken to be known better than one part in this many of the body's own scale: the error of
/// discretisation turns the directions left free by about so much, and must not outvote a prior in them.
const LARGEST_WEIGHT: f64 = 1e4;

/// What the data of a fit determine.
pub(super) struct Judgement {
    pub(super) scale: BodyScale,
    pub(super) observability: Observability,
    /// The determined directions only, rows taken as independent.
    pub(super) projected: SquareRootInformation<10>,
    /// Solution and full covariance of the fit as information; meaningful at rank ten.
    pub(super) determined: SquareRootInformation<10>,
    /// Largest share of noise in the signal of a determined direction.
    pub(super) noise_share: f64,
}

/// Counts the directions that data determine: above rounding, above the noise inside the regressor, and known to better
/// than the body's own scale. A record without any wrench leaves two scales free, that of the mass and that of the inertia
/// about the centre of mass; one without force (`Silence::Force`) that of the mass.
pub(super) fn judge(fit: &Fit, silence: Silence, prior: Option<&Prior>) -> Result<Judgement, IdentificationError> {
    let zero_wrench = silence == Silence::Wrench;
    let scale = match prior {
        Some(prior) => BodyScale::of(&prior.mean.to_vector())?,
        None if zero_wrench => fit.rough_scale,
        None => fit.scale(),
    };
    let magnitudes = scale.parameter_magnitudes();
    let to_scaled = SMatrix::<f64, 10, 10>::from_diagonal(&magnitudes);
    let information = match &fit.least_squares {
        Some(found) => found.information,
        None => whitened(&fit.rows.all, scale.length_m(), 1.0)?,
    };
    let (values, right) = singular_values(information.factor() * to_scaled);
    let mut rank = values.iter().take_while(|&&value| value > RANK_TOLERANCE * values[0]).count();
    let mut noise_share: f64 = 0.0;
    if let Some(found) = &fit.least_squares {
        let noise = to_scaled * found.noise_information * to_scaled;
        let covariance = SMatrix::from_fn(|i, j| found.covariance[(i, j)] / (magnitudes[i] * magnitudes[j]));
        let shares =
            right.column_iter().zip(values.iter()).map(|(v, value)| (v.transpose() * noise * v).x / (value * value));
        let variances = right.column_iter().map(|v| (v.transpose() * covariance * v).x);
        let determined = shares
            .clone()
            .zip(variances)
            .take_while(|(share, variance)| *share < LARGEST_NOISE_SHARE && (*variance < 1.0 || zero_wrench))
            .count();
        rank = rank.min(determined);
        noise_share = shares.take(rank).fold(0.0, f64::max);
    }
    rank = rank.min(match silence {
        // Rows that no weights make a fit of.
        Silence::Nothing if fit.least_squares.is_none() => 9,
        Silence::Nothing => 10,
        Silence::Force | Silence::Unfollowed => 9,
        Silence::Wrench => 8,
    });
    let tolerance =
        if rank < 10 && values[0] > 0.0 { (values[rank] / values[0]).max(RANK_TOLERANCE) } else { RANK_TOLERANCE };
    let observability = Observability::with_tolerance(&information, scale, tolerance);
    // Rows sigma_i v_i^T of the determined directions, their right-hand sides u_i^T z. Data without noise must leave a
    // weak prior its say in the others.
    let ceiling = (LARGEST_WEIGHT / values[0].max(f64::MIN_POSITIVE)).min(1.0);
    let (mut block, mut rhs) = (SMatrix::<f64, 10, 10>::zeros(), SVector::<f64, 10>::zeros());
    for i in 0..rank {
        let v = right.column(i);
        for j in 0..10 {
            block[(i, j)] = ceiling * values[i] * v[j] / magnitudes[j];
        }
        rhs[i] = ceiling * (information.factor() * to_scaled * v).dot(&information.rhs()) / values[i];
    }
    let projected = SquareRootInformation::from_square_root(&block, &rhs)?;
    let determined = match &fit.least_squares {
        Some(found) => from_covariance(&found.parameters, &found.covariance, &magnitudes)?,
        None => SquareRootInformation::new(),
    };
    Ok(Judgement { scale, observability, projected, determined, noise_share })
}
