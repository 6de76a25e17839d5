//! From a record of a periodic motion to the body.

use super::cycles::{Cycles, average_cycles};
use super::fit::FourierFit;
use super::least_squares::PeriodicLeastSquares;
use super::likelihood::PeriodicLikelihood;
use super::periodic_record::PeriodicRecord;
use super::saturation::saturated_share;
use super::selection::{HarmonicCandidate, SelectionRule, likeliest_harmonics, select_harmonics};
use super::warning::HarmonicWarning;
use crate::body_scale::BodyScale;
use crate::dynamics::{InertialParameters, WrenchBox};
use crate::error::IdentificationError;
use crate::fourier::AttitudeChart;
use crate::identify::{constrained, from_covariance};
use crate::lie::Pose;
use crate::likelihood::MaximumLikelihood;
use crate::motion::MotionSample;
use crate::{Estimate, Noise, POOR_FIT, WrenchTiming};
use nalgebra::{SMatrix, SVector, Vector3};

/// Harmonics tried beyond those of the reference unless told otherwise.
const HARMONICS_BEYOND: usize = 17;
/// Share of time at a limit beyond which the motion counts as no short Fourier series.
const SATURATED: f64 = 0.01;
/// A residual of least squares so many times the expected one is unexpected.
const UNEXPECTED: f64 = 2.0;
/// A mean square so many standard deviations above one is not chance.
const BEYOND_CHANCE: f64 = 6.0;

/// What turns an averaged period, or the record behind it, into parameters.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Default)]
pub enum HarmonicEstimator {
    /// Weighted least squares with the regressor of the fitted motion: the thesis's.
    LeastSquares,
    /// Maximum likelihood of coefficients and parameters together: far more accurate where the noise of the poses limits. Where
    /// the wrench asks for more harmonics than the series has, the trajectory likelihood answers.
    #[default]
    Likelihood,
    /// [`MaximumLikelihood`] on the whole record, sample by sample, with the wrench that acted; needs no periodic motion.
    TrajectoryLikelihood,
}

/// How [`identify_periodic`] works.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct HarmonicSettings {
    /// Period of the motion, s.
    pub period_s: f64,
    /// Time from the first sample to the start of the first cycle, s; taken at the nearest sample.
    pub start_s: f64,
    /// Pose in whose frame the motion's coordinates are. A motion designed in Euler angles is band-limited in this frame only.
    pub world_from_start: Pose<f64>,
    /// Coordinates of the attitude.
    pub chart: AttitudeChart,
    /// When the logged wrench acts.
    pub wrench_timing: WrenchTiming,
    /// Gravitational acceleration, inertial axes, m/s^2.
    pub gravity_world: Vector3<f64>,
    /// Harmonics of the reference motion: the fewest tried.
    pub reference_harmonics: usize,
    /// The most harmonics tried, where the sampling allows so many.
    pub largest_harmonics: usize,
    /// What least squares chooses the number of harmonics by; the likelihoods have their own, see [`likeliest_harmonics`].
    pub selection: SelectionRule,
    /// Leading cycles to leave out; `None` finds the transient.
    pub dropped_cycles: Option<usize>,
    /// Noise of one sample where it is known (position, attitude, torque, force); `None` takes the scatter between cycles.
    pub noise: Option<Noise>,
    /// Limits of the actuators where they are known; `None` looks for them.
    pub limits: Option<WrenchBox>,
    /// Share of time at a limit above which the trajectory likelihood takes over; one leaves the estimator as asked for.
    pub largest_saturation: f64,
    /// What estimates the parameters.
    pub estimator: HarmonicEstimator,
}

impl HarmonicSettings {
    /// For a reference motion of this period with this many harmonics; up to seventeen more are tried.
    pub fn new(period_s: f64, reference_harmonics: usize) -> Self {
        Self {
            period_s,
            start_s: 0.0,
            world_from_start: Pose::identity(),
            chart: AttitudeChart::default(),
            wrench_timing: WrenchTiming::default(),
            gravity_world: Vector3::zeros(),
            reference_harmonics,
            largest_harmonics: reference_harmonics + HARMONICS_BEYOND,
            selection: SelectionRule::default(),
            dropped_cycles: None,
            noise: None,
            limits: None,
            largest_saturation: SATURATED,
            estimator: HarmonicEstimator::default(),
        }
    }
}

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
    /// Share of the averaged wrench's mean square (torque counted at the body's own length) that the estimate explains with the
    /// fitted motion.
    pub explained: f64,
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
/// always a body that exists.
///
/// # Errors
/// Those of [`average_cycles`](super::average_cycles), [`select_harmonics`](super::select_harmonics) and
/// [`PeriodicLeastSquares::fit`](super::PeriodicLeastSquares::fit).
/// # Source
/// Thesis 4.3 and 4.4; least squares is (4.12).
pub fn identify_periodic(
    samples: &[MotionSample],
    settings: &HarmonicSettings,
) -> Result<HarmonicIdentification, IdentificationError> {
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
    let saturated = saturation > settings.largest_saturation;
    let likely = match settings.estimator {
        HarmonicEstimator::Likelihood if !saturated => settled(likeliest_harmonics(&cycles.record, harmonics))?,
        _ => None,
    };
    let unexplained = match &likely {
        Some((found, _)) => beyond_chance(found),
        None => beyond_noise(least_squares.as_ref().ok()),
    };
    warnings.extend(unexplained.map(|times| HarmonicWarning::ShortSeries { times }));
    let plain = least_squares.and_then(|found| {
        let times = beyond_noise(Some(&found)).unwrap_or(1.0);
        consistent(&found.parameters, &(found.covariance * (times * times)), found.scale)
    });
    // A series that is too short biases the likelihood more than least squares.
    let wanted = match settings.estimator {
        _ if saturated => HarmonicEstimator::TrajectoryLikelihood,
        HarmonicEstimator::Likelihood if likely.is_none() || unexplained.is_some() => {
            HarmonicEstimator::TrajectoryLikelihood
        }
        asked_for => asked_for,
    };
    let trajectory = match wanted {
        HarmonicEstimator::TrajectoryLikelihood => settled(most_likely(samples, settings, plain.as_ref().ok()))?,
        _ => None,
    };
    let (estimate, estimator) = match (wanted, trajectory, likely) {
        (HarmonicEstimator::TrajectoryLikelihood, Some(estimate), _) => (estimate, wanted),
        (HarmonicEstimator::Likelihood, _, Some((found, table))) => {
            for candidate in &mut selection {
                let likely = table.iter().find(|(harmonics, _)| *harmonics == candidate.harmonics);
                candidate.information_criterion = likely.map(|(_, criterion)| *criterion);
            }
            fit.motion = found.motion;
            (found.estimate, wanted)
        }
        _ => (plain?, HarmonicEstimator::LeastSquares),
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
    let explained = explained(&cycles.record, &fit, &estimate.parameters)?;
    if explained < POOR_FIT && estimator != HarmonicEstimator::TrajectoryLikelihood {
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
        warnings,
    })
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

/// The trajectory likelihood, from the body that least squares found.
fn most_likely(
    samples: &[MotionSample],
    settings: &HarmonicSettings,
    start: Option<&Estimate>,
) -> Result<Estimate, IdentificationError> {
    let mut likelihood = MaximumLikelihood {
        wrench_timing: settings.wrench_timing,
        gravity_world: settings.gravity_world,
        ..MaximumLikelihood::default()
    };
    if let Some(start) = start {
        likelihood.start = start.parameters;
    }
    let found = likelihood.estimate(samples)?;
    let scale = BodyScale::of(&found.parameters.to_vector())?;
    let mut estimate = consistent(&found.unconstrained, &found.covariance, scale)?;
    // The likelihood has met the constraint where it is not linear.
    estimate.parameters = found.parameters;
    estimate.lmi_active = found.active_axis.is_some();
    Ok(estimate)
}

/// `None` where the data do not let a likelihood settle, so that least squares may still answer.
fn settled<T>(found: Result<T, IdentificationError>) -> Result<Option<T>, IdentificationError> {
    match found {
        Err(IdentificationError::NotExcited { .. } | IdentificationError::LikelihoodNotConverged { .. }) => Ok(None),
        found => found.map(Some),
    }
}

/// By what factor the residual of least squares is above what noise lets expect, where it visibly is. Few coefficients make most of
/// it, so that it scatters widely.
fn beyond_noise(found: Option<&PeriodicLeastSquares>) -> Option<f64> {
    found.map(|found| found.normalised_residual / found.expected_residual).filter(|times| *times > UNEXPECTED)
}

/// The same of the likelihood, where chance does not explain it.
fn beyond_chance(found: &PeriodicLikelihood) -> Option<f64> {
    let limit = 1.0 + BEYOND_CHANCE * (2.0 / found.degrees_of_freedom as f64).sqrt();
    Some(found.reduced_chi_square()).filter(|ratio| *ratio > limit).map(f64::sqrt)
}

/// Share of the wrench's mean square that a body explains, torque counted at its own length.
fn explained(
    record: &PeriodicRecord,
    fit: &FourierFit,
    body: &InertialParameters<f64>,
) -> Result<f64, IdentificationError> {
    let (parameters, length_m) = (body.to_vector(), BodyScale::of(&body.to_vector())?.length_m());
    let size = |wrench: &SVector<f64, 6>| {
        wrench.fixed_rows::<3>(0).norm_squared() / (length_m * length_m) + wrench.fixed_rows::<3>(3).norm_squared()
    };
    let (mut left, mut applied) = (0.0, 0.0);
    let table = record.wrench_table(fit.motion.basis());
    for (i, (instant, _)) in table.instants(record.chart, fit.motion.coefficients()).enumerate() {
        let instant = instant.ok_or(IdentificationError::AttitudeUndefined { time_s: record.time_s(i) })?;
        left += size(&(instant.regressor() * parameters - record.wrench(i)));
        applied += size(&record.wrench(i));
    }
    Ok(1.0 - left / applied)
}
