//! How many harmonics the executed motion has.

use super::fit::FourierFit;
use super::least_squares::PeriodicLeastSquares;
use super::periodic_record::PeriodicRecord;
use crate::error::IdentificationError;
use core::ops::RangeInclusive;

/// A residual that is less by this share of the wrench or the power only is not less.
const ROUNDING: f64 = 1e-9;

/// What the number of harmonics is chosen by: the least of one of two residuals.
///
/// Both work for the same reason: a harmonic that the motion has and the fit lacks leaves its wrench in the residual; one that
/// the motion lacks adds the noise of the poses, multiplied by the square of its frequency. Where the poses are so good that
/// this noise drowns in that of the wrench, too many harmonics cost nothing.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Default)]
pub enum SelectionRule {
    /// Least residual of the wrench, each component in units of its noise.
    ///
    /// # Source
    /// Thesis (4.16).
    /// # Deviation
    /// The residual is that of all 6N rows, not of six, and torque and force are made comparable by their noise.
    #[default]
    LeastSquaresResidual,
    /// Least residual between input power and rate of kinetic energy.
    ///
    /// # Source
    /// Thesis (4.17)-(4.19).
    /// # Deviation
    /// Velocity and acceleration in (4.18) and on the right of (4.19) must be those of the centre of mass, and (4.18)
    /// multiplies one by the other; input power needs the velocity of the origin. Evaluated as `[w; v]^T` times the wrench of
    /// the body, which needs no centre of mass (`power_of_the_wrench_is_the_rate_of_kinetic_energy`).
    EnergyBalance,
}

/// One number of harmonics and its residuals.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct HarmonicCandidate {
    /// Number of harmonics.
    pub harmonics: usize,
    /// Root mean square of the wrench's residual in units of the noise of the averaged wrench.
    pub normalised_residual: f64,
    /// Root mean square of input power less rate of kinetic energy, W.
    pub power_residual_w: f64,
}

impl HarmonicCandidate {
    /// The residual that a rule compares.
    pub fn residual(&self, rule: SelectionRule) -> f64 {
        match rule {
            SelectionRule::LeastSquaresResidual => self.normalised_residual,
            SelectionRule::EnergyBalance => self.power_residual_w,
        }
    }
}

/// The fit with the least residual, of equal ones that with the fewest harmonics, and the residuals of all numbers of harmonics.
///
/// # Errors
/// [`IdentificationError::HarmonicRange`] for an empty range, and those of [`FourierFit::new`] and
/// [`PeriodicLeastSquares::fit`].
/// # Source
/// Thesis 4.4.
pub fn select_harmonics(
    record: &PeriodicRecord,
    harmonics: RangeInclusive<usize>,
    rule: SelectionRule,
) -> Result<(FourierFit, Vec<HarmonicCandidate>), IdentificationError> {
    let (first, last) = (*harmonics.start(), *harmonics.end());
    let (mut best, mut table) = (None::<(f64, FourierFit)>, Vec::new());
    for harmonics in harmonics {
        let fit = FourierFit::new(record, harmonics)?;
        let found = PeriodicLeastSquares::compare(record, &fit)?;
        let candidate = HarmonicCandidate {
            harmonics,
            normalised_residual: found.normalised_residual,
            power_residual_w: found.power_residual_w,
        };
        let residual = candidate.residual(rule);
        let rounding = ROUNDING
            * match rule {
                SelectionRule::LeastSquaresResidual => found.without_body[0],
                SelectionRule::EnergyBalance => found.without_body[1],
            };
        if best.as_ref().is_none_or(|(least, _)| residual + rounding < *least) {
            best = Some((residual, fit));
        }
        table.push(candidate);
    }
    best.map(|(_, fit)| (fit, table)).ok_or(IdentificationError::HarmonicRange { first, last })
}
