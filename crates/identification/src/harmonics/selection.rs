//! How many harmonics the executed motion has.

use super::fit::FourierFit;
use super::least_squares::PeriodicLeastSquares;
use super::likelihood::{Guess, PeriodicLikelihood, Problem, step_work};
use super::periodic_record::PeriodicRecord;
use crate::error::IdentificationError;
use core::ops::RangeInclusive;
use num_traits::AsPrimitive;

/// A residual that is less by this share of the wrench or the power only is not less.
const ROUNDING: f64 = 1e-9;
/// Numbers of harmonics in a row that must not help before the likelihood stops to look for more: a motion may have odd ones only.
const PATIENCE: usize = 4;
/// Channels in which one more harmonic is free to move: three of position and three of rotation, however many the chart has.
const FREE_CHANNELS: usize = 6;

/// Multiplications after which [`likeliest_harmonics`] gives up: about three seconds of one core.
pub const LARGEST_WORK: f64 = 1.2e10;
/// Steps that must be affordable for a number of harmonics to be tried.
const AFFORDABLE_STEPS: f64 = 4.0;
/// Fewest and most iterations from the best of the scan, which is within a tenth of its least cost.
const FINAL_ITERATIONS: [f64; 2] = [8.0, 40.0];
/// A cost per degree of freedom above this is unexplained beyond doubt.
const UNEXPLAINED: f64 = 4.0;

/// What the number of harmonics is chosen by: the least of one of two residuals.
///
/// Both work for the same reason: a harmonic that the motion has and the fit lacks leaves its wrench in the residual; one that
/// the motion lacks adds the noise of the poses, multiplied by the square of its frequency. Where the poses are so good that
/// this noise drowns in that of the wrench, too many harmonics cost nothing.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Default)]
#[non_exhaustive]
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
    /// Akaike's criterion of the likelihood with this number, where [`likeliest_harmonics`] looked at it.
    pub information_criterion: Option<f64>,
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
            information_criterion: None,
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

/// The likelihood whose number of harmonics predicts best: least Akaike's criterion, the weighted squares of all residuals plus
/// two for each free coefficient. With it the criterion of each number tried, in ascending order of harmonics.
///
/// Least squares asks how many harmonics the poses alone can show, since each one brings their noise into the regressor. Here
/// the wrenches correct the motion, a harmonic too many costs nearly nothing, and one too few biases the body: the motion that
/// tracking a reference with the wrong body leaves has many small ones
/// (`tests/suite/periodic_tracking.rs`, `the_likelihood_needs_the_harmonics_that_tracking_adds`). Looks no further after four in a row that
/// do not help.
///
/// Each number starts from the solution of the one before and stops where the criterion is known to about a tenth; the best is then
/// solved to the end (`the_scan_of_harmonics_finds_what_each_alone_finds`).
///
/// The work of a step grows with the samples and with the square of the harmonics. The scan ends without an answer before it has
/// spent [`LARGEST_WORK`], and where the cost falls so slowly that at this pace the last number would not explain the record either.
/// # Errors
/// [`IdentificationError::HarmonicRange`] for an empty range; [`IdentificationError::SeriesTooLong`] and
/// [`IdentificationError::NoSeriesExplains`] for a scan that ended early; those of
/// [`maximum_likelihood`](super::maximum_likelihood) where no number has an answer, or the best has none.
pub fn likeliest_harmonics(
    record: &PeriodicRecord,
    harmonics: RangeInclusive<usize>,
) -> Result<(PeriodicLikelihood, Vec<(usize, f64)>), IdentificationError> {
    let last = *harmonics.end();
    let mut failure = IdentificationError::HarmonicRange { first: *harmonics.start(), last };
    let (mut best, mut fewer, mut table) = (None::<(usize, f64, Problem, Guess)>, None::<Guess>, Vec::new());
    let (mut work, mut costs) = (0.0, Vec::new());
    for harmonics in harmonics {
        if best.as_ref().is_some_and(|(chosen, ..)| harmonics > chosen + PATIENCE) {
            break;
        }
        if work + AFFORDABLE_STEPS * step_work(record, harmonics) > LARGEST_WORK {
            return Err(IdentificationError::SeriesTooLong { harmonics, samples: record.samples(), work });
        }
        let problem = match Problem::new(record, harmonics) {
            Ok(problem) => problem,
            Err(error) => {
                failure = error;
                continue;
            }
        };
        match problem.scout(fewer.as_ref(), &mut work) {
            Ok(found) => {
                let reduced_chi_square = problem.reduced_chi_square(&found);
                costs.push(reduced_chi_square);
                if remains_unexplained(&costs, last - harmonics) {
                    return Err(IdentificationError::NoSeriesExplains { harmonics, reduced_chi_square, work });
                }
                let criterion = found.cost + (2 * FREE_CHANNELS * (2 * harmonics + 1)) as f64;
                table.push((harmonics, criterion));
                fewer = Some(found.clone());
                if best.as_ref().is_none_or(|(_, least, ..)| criterion < *least) {
                    best = Some((harmonics, criterion, problem, found));
                }
            }
            Err(error) => failure = error,
        }
    }
    let (chosen, _, problem, start) = best.ok_or(failure)?;
    let left = (LARGEST_WORK - work) / step_work(record, chosen);
    let iterations = left.clamp(FINAL_ITERATIONS[0], FINAL_ITERATIONS[1]).as_();
    Ok((problem.settle(start, iterations)?, table))
}

/// Whether costs per degree of freedom that go on to fall as over the last numbers of harmonics stay too large.
fn remains_unexplained(costs: &[f64], left: usize) -> bool {
    let [.., before, _, _, _, now] = costs else { return false };
    let expected = now * (now / before).min(1.0).powf(left as f64 / PATIENCE as f64);
    expected > UNEXPLAINED
}
