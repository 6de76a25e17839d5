//! From a record of a periodic motion to the body.

use super::cycles::{Cycles, average_cycles};
use super::fit::FourierFit;
use super::least_squares::PeriodicLeastSquares;
use super::likelihood::{PeriodicLikelihood, require_shown};
use super::periodic_record::PeriodicRecord;
use super::saturation::saturated_share;
use super::selection::{HarmonicCandidate, likeliest_harmonics, select_harmonics};
use super::settings::{HarmonicEstimator, HarmonicSettings};
use super::warning::HarmonicWarning;
use crate::body_scale::BodyScale;
use crate::consistency::{FeasibleSet, PseudoInertiaCone};
use crate::dynamics::InertialParameters;
use crate::error::IdentificationError;
use crate::estimator::{Counted, Estimator, EstimatorError, Evidence, Finding, Judge, Verdict, standard_deviations};
use crate::identify::{MAXIMUM_LIKELIHOOD, constrained, from_covariance};
use crate::motion::MotionSample;
use crate::statistics::chi_square_quantile;
use crate::{Estimate, Identification, Noise, Settings, identify};
use core::ops::RangeInclusive;
use nalgebra::{SMatrix, SVector};

/// A residual of least squares so many times the expected one is unexpected: few coefficients make most of it, so that it scatters widely.
const UNEXPECTED: f64 = 2.0;
/// A mean square so many standard deviations above one is not chance.
const BEYOND_CHANCE: f64 = 6.0;
/// Chance that what noise leaves at the harmonics passes for more.
const FALSE_ALARM: f64 = 1e-4;
/// Cycles that differ at the harmonics by so many times the white noise are no cycles of one motion; where a transient remains, less
/// is enough.
const NO_CYCLES: [f64; 2] = [10.0, 3.0];

/// What [`identify_periodic`] found.
#[derive(Clone, Debug, PartialEq)]
pub struct HarmonicIdentification {
    /// The body.
    pub estimate: Estimate,
    /// What estimated it.
    pub estimator: HarmonicEstimator,
    /// The fitted motion, by the likelihood where that answers; its basis says the number of harmonics chosen.
    pub motion: crate::fourier::FourierMotion,
    /// The residuals of every number of harmonics tried.
    pub selection: Vec<HarmonicCandidate>,
    /// The averaged period.
    pub record: PeriodicRecord,
    /// Cycles averaged.
    pub cycles_used: usize,
    /// Leading cycles left out.
    pub cycles_dropped: usize,
    /// Noise of one sample found, or given.
    pub noise: Noise,
    /// Share of time with any component of the wrench at its limit.
    pub saturation: f64,
    /// Share of the wrench's mean square (torque counted at the body's own length) that the estimate explains: of the averaged
    /// wrench with the fitted motion, or of the whole record's where the trajectory likelihood answers.
    pub explained: f64,
    /// Whether the numbers may be used.
    pub verdict: Verdict,
    /// All that the trajectory likelihood says, its warnings too, where it answers.
    pub trajectory: Option<Identification>,
    /// What a reader must know.
    pub warnings: Vec<HarmonicWarning>,
}

impl HarmonicIdentification {
    /// Number of harmonics chosen.
    pub fn harmonics(&self) -> usize {
        self.motion.basis().harmonics()
    }
}

/// The body that explains several cycles of a periodic motion.
///
/// Cycles are averaged, a Fourier series fitted, the number of its harmonics chosen, and the parameters estimated; the answer is
/// always a body that exists. Where the likelihood of the series has no answer that chance lets expect, that of the trajectory
/// answers, and what it refuses is refused.
///
/// # Errors
/// Those of [`average_cycles`](super::average_cycles), [`select_harmonics`](super::select_harmonics),
/// [`PeriodicLeastSquares::fit`](super::PeriodicLeastSquares::fit) and, where the trajectory likelihood answers, [`identify`];
/// [`IdentificationError::NotExcited`] where it leaves a direction free.
/// # Source
/// Thesis 4.3 and 4.4; least squares is (4.12).
pub fn identify_periodic(
    samples: &[MotionSample],
    settings: &HarmonicSettings,
) -> Result<HarmonicIdentification, IdentificationError> {
    if settings.reference_harmonics == 0 {
        return Err(IdentificationError::NoHarmonics);
    }
    let cycles = average_cycles(samples, settings)?;
    let sampled = cycles.record.samples().saturating_sub(1) / 2;
    let largest = settings.largest_harmonics.min(sampled.max(settings.reference_harmonics));
    let harmonics = settings.reference_harmonics..=largest;
    let (mut fit, mut selection) = select_harmonics(&cycles.record, harmonics.clone(), settings.selection)?;
    let saturation = saturated_share(samples, settings.limits.as_ref());
    let mut warnings = warnings_of(&cycles, settings);
    if saturation > 0.0 {
        warnings.push(HarmonicWarning::Saturated { share: saturation });
    }
    let least_squares = PeriodicLeastSquares::fit(&cycles.record, &fit);
    let mut wanted = match settings.estimator {
        _ if saturation > settings.largest_saturation => HarmonicEstimator::TrajectoryLikelihood,
        HarmonicEstimator::Likelihood if are_no_cycles(&cycles) => HarmonicEstimator::TrajectoryLikelihood,
        asked_for => asked_for,
    };
    let (mut likely, mut mean_square) = (None, None);
    if wanted == HarmonicEstimator::Likelihood {
        if matches!(least_squares, Err(IdentificationError::NotExcited { .. } | IdentificationError::Indefinite { .. }))
        {
            // Noise may hide from least squares what a likelihood still sees; a direction that does not move it does not.
            require_shown(&cycles.record, settings.reference_harmonics)?;
        }
        let found = likeliest_harmonics(&cycles.record, harmonics);
        warnings.extend(unexplained(&found));
        // Where actuators were at a limit, no series need explain what is left.
        mean_square = left_over(&found).filter(|_| saturation <= 0.0);
        likely = found.ok().filter(|(found, _)| beyond_chance(found).is_none());
        if likely.is_none() {
            // A series that is too short biases the likelihood more than least squares.
            wanted = HarmonicEstimator::TrajectoryLikelihood;
        }
    }
    let trajectory = match wanted {
        HarmonicEstimator::TrajectoryLikelihood => settled(most_likely(samples, settings))?,
        _ => None,
    };
    let (estimate, estimator) = match (&trajectory, likely) {
        (Some((_, estimate)), _) => (*estimate, wanted),
        (_, Some((found, table))) => {
            for candidate in &mut selection {
                let likely = table.iter().find(|(harmonics, _)| *harmonics == candidate.harmonics);
                candidate.information_criterion = likely.map(|(_, criterion)| *criterion);
            }
            fit.motion = found.motion;
            (found.estimate, wanted)
        }
        _ => {
            let (estimate, unexplained, left) =
                judged(&least_squares?, &cycles.record, fit.motion.basis().harmonics()..=largest)?;
            mean_square = left;
            if let Some(times) = unexplained {
                warnings.retain(|warning| !matches!(warning, HarmonicWarning::ShortSeries { .. }));
                warnings.push(HarmonicWarning::ShortSeries { times });
                warnings.push(HarmonicWarning::Widened);
            }
            (estimate, HarmonicEstimator::LeastSquares)
        }
    };
    let chosen = fit.motion.basis().harmonics();
    if chosen == largest && largest > settings.reference_harmonics {
        warnings.push(HarmonicWarning::MoreHarmonics { harmonics: chosen });
    }
    if estimator == HarmonicEstimator::LeastSquares && settings.estimator != estimator {
        warnings.push(HarmonicWarning::LikelihoodFailed);
    }
    if estimator == HarmonicEstimator::TrajectoryLikelihood && settings.estimator != estimator {
        warnings.push(HarmonicWarning::TrajectoryLikelihood);
    }
    if estimate.lmi_active {
        warnings.push(HarmonicWarning::ConstraintActive);
    }
    let trajectory = trajectory.map(|(found, _)| found);
    let evidence = match trajectory.as_ref().and_then(|found| found.explained) {
        Some(share) => Evidence::of_sums(1.0, 1.0 - share),
        None => evidence(&cycles.record, &fit, &estimate.parameters)?,
    };
    let explained = match trajectory.as_ref().and_then(|found| found.explained) {
        Some(share) => share,
        None => evidence.explained().unwrap_or_default(),
    };
    let scale = BodyScale::of(&estimate.parameters.to_vector())?;
    let verdict = match &trajectory {
        Some(found) if !found.verdict.is_identified() => found.verdict,
        _ => verdict_on(&estimate, scale, &evidence, mean_square)?,
    };
    if let Verdict::NoBodyExplains { .. } = verdict {
        warnings.push(HarmonicWarning::PoorFit { explained });
    }
    Ok(HarmonicIdentification {
        estimate,
        estimator,
        motion: fit.motion,
        selection,
        record: cycles.record,
        cycles_used: cycles.used,
        cycles_dropped: cycles.dropped,
        noise: cycles.noise,
        saturation,
        explained,
        verdict,
        trajectory,
        warnings,
    })
}

/// The body that explains several cycles of a periodic motion, by [`identify_periodic`], as an estimator.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Periodic(HarmonicSettings);

impl Periodic {
    /// Of motions of this period.
    pub fn new(settings: HarmonicSettings) -> Self {
        Self(settings)
    }
}

impl Estimator for Periodic {
    type Record = [MotionSample];

    fn estimate(&self, record: &[MotionSample]) -> Result<Finding, EstimatorError> {
        let found = identify_periodic(record, &self.0)?.estimate;
        found.to_finding(BodyScale::of(&found.parameters.to_vector())?)
    }
}

/// Whether cycles differ so much that their average is no cycle.
fn are_no_cycles(cycles: &Cycles) -> bool {
    cycles.leakage.is_some_and(|ratio| ratio > NO_CYCLES[usize::from(cycles.transient_remains)])
}

/// Why the likelihood of the series does not answer, where the reader may act on it.
fn unexplained<T>(found: &Result<(PeriodicLikelihood, T), IdentificationError>) -> Option<HarmonicWarning> {
    match found {
        Ok((found, _)) => beyond_chance(found).map(|times| HarmonicWarning::ShortSeries { times }),
        Err(IdentificationError::NoSeriesExplains { reduced_chi_square, .. }) => {
            Some(HarmonicWarning::ShortSeries { times: reduced_chi_square.sqrt() })
        }
        Err(IdentificationError::SeriesTooLong { harmonics, samples, .. }) => {
            Some(HarmonicWarning::SeriesTooLong { harmonics: *harmonics, samples: *samples })
        }
        Err(_) => None,
    }
}

fn warnings_of(cycles: &Cycles, settings: &HarmonicSettings) -> Vec<HarmonicWarning> {
    let mut warnings = Vec::new();
    if settings.dropped_cycles.is_none() && cycles.dropped > 0 {
        warnings.push(HarmonicWarning::TransientDropped { cycles: cycles.dropped });
    }
    if cycles.transient_remains {
        warnings.push(HarmonicWarning::TransientRemains);
    }
    if cycles.remainder > 0 {
        warnings.push(HarmonicWarning::Remainder { samples: cycles.remainder });
    }
    if let Some(ratio) = cycles.leakage {
        warnings.push(HarmonicWarning::Leakage { ratio });
    }
    warnings
}

/// The body nearest to a solution in the measure of its covariance.
fn consistent(
    parameters: &SVector<f64, 10>,
    covariance: &SMatrix<f64, 10, 10>,
    scale: BodyScale,
) -> Result<Estimate, IdentificationError> {
    constrained(&from_covariance(parameters, covariance, &scale.parameter_magnitudes())?, scale)
}

/// The body of least squares, and by how much more than chance its harmonics leave unexplained, where they do: judged by the
/// likelihood with as many, which knows what residual to expect. Then the covariance grows by the residual of least squares and by
/// its difference from the likelihood with the harmonics that predict best, an estimate of its error
/// (`tests/suite/periodic_bounds.rs`, `least_squares_says_when_it_is_off`). Last, the mean square of what no number of harmonics explains.
fn judged(
    found: &PeriodicLeastSquares,
    record: &PeriodicRecord,
    harmonics: RangeInclusive<usize>,
) -> Result<(Estimate, Option<f64>, Option<f64>), IdentificationError> {
    let fewest = *harmonics.start();
    let with_as_many = likeliest_harmonics(record, fewest..=fewest).ok().map(|(likely, _)| likely);
    let by_residual = found.normalised_residual / found.expected_residual;
    let by_likelihood = with_as_many.as_ref().and_then(beyond_chance);
    let unexplained = by_likelihood.or(Some(by_residual).filter(|times| *times > UNEXPECTED));
    let growth = if unexplained.is_some() { by_residual.max(1.0).powi(2) } else { 1.0 };
    let mut estimate = consistent(&found.parameters, &(found.covariance * growth), found.scale)?;
    let best = match with_as_many {
        Some(likely) if unexplained.is_none() && beyond_chance_at_harmonics(&likely).is_none() => Some(likely),
        with_as_many => likeliest_harmonics(record, harmonics).ok().map(|(likely, _)| likely).or(with_as_many),
    };
    let left = best.as_ref().map_or(unexplained.map(|times| times * times), beyond_chance_at_harmonics);
    if let (Some(_), Some(likely)) = (unexplained, best) {
        let apart = estimate.parameters.to_vector() - likely.estimate.parameters.to_vector();
        estimate.covariance += apart * apart.transpose();
        estimate.std = standard_deviations(&estimate.parameters.to_vector(), &estimate.covariance);
    }
    Ok((estimate, unexplained, left))
}

/// The trajectory likelihood, which answers with a body, or is an error.
fn most_likely(
    samples: &[MotionSample],
    settings: &HarmonicSettings,
) -> Result<(Identification, Estimate), IdentificationError> {
    let likelihood = Settings {
        method: MAXIMUM_LIKELIHOOD,
        wrench_timing: settings.wrench_timing,
        gravity_world: settings.gravity_world,
        ..Settings::default()
    };
    let found = identify(samples, &likelihood)?;
    let refused = matches!(found.verdict, Verdict::NoBodyExplains { .. });
    match found.estimate {
        Some(estimate) if found.method == MAXIMUM_LIKELIHOOD || refused => Ok((found, estimate)),
        // A regression on single samples says less than one on the average.
        Some(_) => Err(IdentificationError::LikelihoodNotConverged { iterations: 0, decrement: f64::INFINITY }),
        None => {
            let smallest_singular_value = found.condition_number.recip();
            Err(IdentificationError::NotExcited { rank: found.rank, expected: 10, smallest_singular_value })
        }
    }
}

/// `None` where the likelihood does not settle, so that least squares may still answer.
fn settled<T>(found: Result<T, IdentificationError>) -> Result<Option<T>, IdentificationError> {
    match found {
        Err(IdentificationError::LikelihoodNotConverged { .. }) => Ok(None),
        found => found.map(Some),
    }
}

/// By what factor the residual of the likelihood is above what noise lets expect, where chance does not explain it.
fn beyond_chance(found: &PeriodicLikelihood) -> Option<f64> {
    let limit = 1.0 + BEYOND_CHANCE * (2.0 / found.degrees_of_freedom as f64).sqrt();
    Some(found.reduced_chi_square()).filter(|ratio| *ratio > limit).map(f64::sqrt)
}

/// The mean square of what the likelihood leaves at the harmonics, where chance does not explain it.
fn beyond_chance_at_harmonics(found: &PeriodicLikelihood) -> Option<f64> {
    let freedom = found.harmonic_degrees_of_freedom as f64;
    let limit = chi_square_quantile(freedom, 1.0 - FALSE_ALARM);
    Some(found.harmonic_cost).filter(|cost| *cost > limit).map(|cost| cost / freedom)
}

/// The mean square of what no series leaves to chance, at the harmonics or altogether.
fn left_over<T>(found: &Result<(PeriodicLikelihood, T), IdentificationError>) -> Option<f64> {
    match found {
        Ok((found, _)) => beyond_chance_at_harmonics(found).or_else(|| beyond_chance(found).map(|times| times * times)),
        Err(IdentificationError::NoSeriesExplains { reduced_chi_square, .. }) => Some(*reduced_chi_square),
        Err(_) => None,
    }
}

fn verdict_on(
    estimate: &Estimate,
    scale: BodyScale,
    evidence: &Evidence,
    mean_square: Option<f64>,
) -> Result<Verdict, IdentificationError> {
    let (parameters, magnitudes) = (estimate.parameters.to_vector(), scale.parameter_magnitudes());
    let information = from_covariance(&parameters, &estimate.covariance, &magnitudes)?;
    let found = Finding::of_information(information, magnitudes).at(parameters);
    let (judge, cone) = (Judge::new(scale), PseudoInertiaCone::new(scale));
    let counted = judge.count(&found, &magnitudes, None, |point| cone.margin(point))?;
    Ok(judge.weigh(&Counted { mean_nis: mean_square, ..counted }, evidence))
}

/// What a body leaves of the averaged wrench, torque counted at its own length.
fn evidence(
    record: &PeriodicRecord,
    fit: &FourierFit,
    body: &InertialParameters<f64>,
) -> Result<Evidence, IdentificationError> {
    let (parameters, length_m) = (body.to_vector(), BodyScale::of(&body.to_vector())?.length_m());
    let mut evidence = Evidence::default();
    let table = record.wrench_table(fit.motion.basis());
    for (i, (instant, _)) in table.instants(record.chart, fit.motion.coefficients()).enumerate() {
        let instant = instant.ok_or(IdentificationError::AttitudeUndefined { time_s: record.time_s(i) })?;
        let applied = record.wrench(i);
        evidence.count(&applied, &(instant.regressor() * parameters - applied), length_m);
    }
    Ok(evidence)
}
