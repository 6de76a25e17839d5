//! From a motion log to mass, centre of mass and inertia with covariance: the library's front door.
//!
//! All scalars are `f64`: decisions are made here.

mod body_change;
mod environment;
mod feedback;
mod fit;
mod flight;
mod identification;
mod judgement;
mod likelihood;
mod long;
mod merge;
mod noise;
mod parts;
mod pipeline;
mod plan;
mod plane;
mod predict;
mod problem;
mod recursion;
mod rows;
mod settings;
mod solution;
mod timeline;
mod validate;
mod verdict;
mod wander;
mod warning;

use crate::dynamics::InertialParameters;
use crate::error::IdentificationError;
use crate::estimator::{Evidence, Finding, Verdict, Why};
use crate::likelihood::Nuisances;
use crate::motion::{MotionSample, is_without_wrench};
use crate::weighted_least_squares::WrenchRow;
use crate::{BodyScale, ExcitationDiagnosis, NullDirection, Observability, WeakDirection};
pub(crate) use fit::rough_scale;
use fit::{Best, Fit, best_fit};
use identification::Marks;
use judgement::{Judgement, judge};
use likelihood::most_likely;
use nalgebra::Vector3;
use noise::SampleNoise;
use plan::{Plan, Way};
pub(crate) use plane::is_in_xy_plane;
use plane::planar_motion;
use recursion::Replaced;
use settings::AUTO;
use solution::{Solution, solve};
use timeline::Timeline;
use verdict::verdict;
use warning::FEW_NODES;

pub use environment::{identify_in, with_all_that_acts};
pub use identification::{Identification, NodeResidual, Silence, UnexplainedWrench, Validation};
pub use long::LongRecord;
pub use merge::merge;
pub use parts::{Difference, Part, PartChange, Parts, identify_parts};
pub use pipeline::{ConstrainedSolvers, Methods, Pipeline, constrained_solvers, methods};
pub use predict::{Prediction, predict};
pub use problem::{JointFilter, Problem, Regressed};
pub use rows::Regression;
pub use settings::{FLIGHT_LIKELIHOOD, MAXIMUM_LIKELIHOOD, Prior, Settings, WEAK_FORM};
pub(crate) use solution::{constrained, from_covariance};
pub use validate::validate;
pub use warning::Warning;

/// Of the torque more than this share must be explained before a force is called silent.
const FOLLOWED: f64 = 0.5;
/// A force of which the best body explains less than this share is noise.
const SILENT: f64 = 0.1;
/// Errors of poses below this share of the way that the body moves are rounding.
const EXACT: f64 = 1e-6;
/// A direction is weakly excited where one sigma is above this fraction of the body's scale.
const WEAK_STD: f64 = 0.05;
/// Discretisation is worth a warning above this share of the standard deviation and this fraction of the body's scale.
const VISIBLE_DISCRETISATION: (f64, f64) = (0.5, 1e-3);

/// The body that explains a record, by a built-in method; [`Pipeline`] takes the user's own too.
///
/// Poses alone serve; measured rates and velocities are used where the poses are too noisy. What the data do not
/// determine is not invented: below rank ten there is no estimate unless a prior is asked for, and the directions left
/// free are named.
///
/// # Errors
/// [`IdentificationError::TooFewSamples`], [`IdentificationError::MissingColumn`] where not one row can be formed;
/// [`IdentificationError::TimesNotIncreasing`], [`IdentificationError::NotFinite`] for a malformed record;
/// [`IdentificationError::UnknownMethod`]. Data that say too little are not an error but a result with its rank.
pub fn identify(record: &[MotionSample], settings: &Settings) -> Result<Identification, IdentificationError> {
    let plan = Plan::usual(settings)?;
    run(record, &plan, |fit, noise| recursed(fit, record, &plan, noise))
}

/// What a recursion, where a plan asks for one, puts in the place of the rows, beside the library's own finding.
fn recursed(
    fit: &mut Fit,
    record: &[MotionSample],
    plan: &Plan<'_>,
    noise: &SampleNoise,
) -> Result<Replaced, IdentificationError> {
    let other = reference(fit, record, plan)?;
    recursion::run(fit, record, plan, noise, other.as_ref())
}

/// From this share of feedback on a controller holds the body: it knows the body's velocity when a log begins, which the log may not tell. Where
/// the motion shows little (a standard deviation above [`WEAK_STD`]) what it knows more biases the answer by that standard deviation.
const HELD: f64 = 0.01;

/// The library's own finding that a judge holds against another's. The likelihood, which is such a finding, needs none, nor does a regression of
/// a motion without visible noise.
fn reference(fit: &Fit, record: &[MotionSample], plan: &Plan<'_>) -> Result<Option<Finding>, IdentificationError> {
    let noisy_rows = matches!(plan.way, Way::Rows(_)) && is_noisy(fit);
    if plan.way.is_recursive() || noisy_rows { second(fit, record, plan.settings) } else { Ok(None) }
}

fn is_noisy(fit: &Fit) -> bool {
    fit.poses_noisy || fit.rates_noisy
}

/// Where the motion is noisy what the library itself would answer, which knows of errors that are not white; else the regression.
fn second(fit: &Fit, record: &[MotionSample], settings: &Settings) -> Result<Option<Finding>, IdentificationError> {
    let Some(found) = &fit.least_squares else { return Ok(None) };
    let magnitudes = fit.scale().parameter_magnitudes();
    let own = Settings { method: AUTO, prior: None, lag: None, estimate: Nuisances::default(), ..*settings };
    if is_noisy(fit)
        && let Ok(likely) = identify(record, &own)
        && let (true, Some(estimate)) = (likely.verdict.is_identified(), &likely.estimate)
    {
        let parameters = estimate.parameters.to_vector();
        let information = from_covariance(&parameters, &estimate.covariance, &magnitudes)?;
        return Ok(Some(Finding::of_information(information, magnitudes).at(parameters)));
    }
    let information = from_covariance(&found.parameters, &found.covariance, &magnitudes)?;
    Ok(Some(Finding::of_information(information, magnitudes).at(found.parameters)))
}

/// The answer of a plan, doubted where the wrench answers to the noise; `replace` puts another finding in the place of that of the rows.
fn run<E: From<IdentificationError>>(
    record: &[MotionSample],
    plan: &Plan<'_>,
    replace: impl FnOnce(&mut Fit, &SampleNoise) -> Result<Replaced, E>,
) -> Result<Identification, E> {
    let mut found = found(record, plan, replace)?;
    if found.verdict.is_identified() {
        let share = feedback::share(record, &Timeline::try_new(record)?, found.scale);
        found.evidence.feedback = share;
        let widest = found.widest();
        if share > HELD && widest > WEAK_STD {
            found.evidence.held = widest;
        }
        found.verdict = plan.judge_of(found.method).again(found.verdict, &found.evidence);
        if matches!(found.verdict, Verdict::Doubtful(Why::Feedback { .. })) {
            found.warnings.push(Warning::Feedback { share });
        }
    }
    Ok(found)
}

fn found<E: From<IdentificationError>>(
    record: &[MotionSample],
    plan: &Plan<'_>,
    replace: impl FnOnce(&mut Fit, &SampleNoise) -> Result<Replaced, E>,
) -> Result<Identification, E> {
    // A table holds the body: whatever takes it for a free one is wrong. What thrusters are off by is another's to find too.
    let on_table =
        plan.way == Way::Auto && plan.flown.map_or_else(|| is_in_xy_plane(record), |told| told.is_planar(record));
    let by_thrusters = plan.way != Way::Other && plan.flown.is_some_and(|told| told.thrusters.is_some());
    let timeline = Timeline::try_new(record)?;
    if (on_table || by_thrusters)
        && let Some(found) = flight::most_likely(record, &timeline, plan)?
    {
        return Ok(found);
    }
    // Where errors plainly are not white, an answer that takes them for white comes too late.
    let wanders = plan.way == Way::Auto
        && plan.settings.lag.is_none()
        && !(on_table || by_thrusters || is_noise(record))
        && wander::is_plain(record, &timeline);
    let early = if wanders { flight::most_likely(record, &timeline, plan)? } else { None };
    let is_answer = |found: &&Identification| found.verdict.is_identified() && found.marks.leaves_noise_only;
    if let Some(found) = early.as_ref().filter(is_answer) {
        return Ok(found.clone());
    }
    let mut found = answer(record, plan, replace)?;
    if on_table || by_thrusters {
        return Ok(flight::unanswered(found, on_table));
    }
    let poor = |found: &Identification| found.explained.is_some_and(|share| share < plan.judge.poor_fit);
    let unanswered = |found: &Identification| found.silence == Silence::Nothing && (found.rank < 10 || poor(found));
    // What white errors do not explain, sensors do; and a regression that most of the record does not reach has not the last word.
    let asks_for_sensors = |found: &Identification| {
        (found.marks.errors_not_white || 2 * found.samples_used < record.len())
            && !is_noise(record)
            && !is_exact(found, record)
    };
    if plan.way == Way::Auto {
        let tried = found.method == MAXIMUM_LIKELIHOOD || found.marks.likelihood_failed;
        if !asks_for_sensors(&found) && unanswered(&found) && !tried {
            let likely = most_likely(record, &timeline, plan)?;
            let better = |likely: &Identification| {
                likely.explained > Some(plan.judge.poor_fit)
                    && likely.rank >= found.rank
                    && likely.marks.leaves_noise_only
            };
            found = likely.filter(better).unwrap_or(found);
        }
        let asks = asks_for_sensors(&found);
        // Noise may also be so large beside the motion that no row tells of it.
        if (asks || unanswered(&found) && !is_noise(record) && !is_exact(&found, record))
            && let Some(flown) = if wanders { early } else { flight::most_likely(record, &timeline, plan)? }
            && (asks || flown.verdict.is_identified())
        {
            return Ok(flown);
        }
        found = likelihood::by_poses(found, record, &timeline, plan)?;
        if asks {
            found.evidence.stand_in = true;
            found.verdict = plan.judge.again(found.verdict, &found.evidence);
        }
    }
    // Without a wrench, or with one that means something else, no motion helps.
    if found.silence == Silence::Nothing && !poor(&found) && !found.marks.is_planar {
        let weak = weak_excitation(&found);
        found.warnings.extend(weak);
    }
    Ok(found)
}

/// Directions that the motion shows badly or not at all, with the simple motion that would show each.
fn weak_excitation(found: &Identification) -> Vec<Warning> {
    if found.rank < 10 {
        let weak = |direction: &NullDirection| Warning::WeakExcitation {
            direction: WeakDirection::new(*direction, found.scale),
            std: f64::INFINITY,
        };
        return found.null_directions.iter().map(weak).collect();
    }
    // Singular values of whitened rows in units of the body are one over standard deviations.
    let values = *Observability::new(&found.information, found.scale).singular_values();
    let tolerance = (1.0 / (WEAK_STD * values[0])).min(1.0);
    let diagnosis = ExcitationDiagnosis::new(&found.information, found.scale, tolerance);
    let determined = 10 - diagnosis.weak_directions().count();
    diagnosis
        .weak_directions()
        .zip(values.iter().skip(determined))
        .map(|(direction, value)| Warning::WeakExcitation { direction: *direction, std: 1.0 / value })
        .collect()
}

fn answer<E: From<IdentificationError>>(
    record: &[MotionSample],
    plan: &Plan<'_>,
    replace: impl FnOnce(&mut Fit, &SampleNoise) -> Result<Replaced, E>,
) -> Result<Identification, E> {
    let settings = plan.settings;
    let timeline = Timeline::try_new(record)?;
    if plan.way == Way::Likelihood
        && let Some(found) = most_likely(record, &timeline, plan)?
    {
        return Ok(found);
    }
    if plan.way == Way::FlightLikelihood
        && let Some(found) = flight::most_likely(record, &timeline, plan)?
    {
        return Ok(found);
    }
    let noise = SampleNoise::estimate(record, &timeline, settings);
    let mut fit = match best_fit(record, &timeline, plan, &noise)? {
        Best::Fit(fit) => *fit,
        Best::Likelihood(found) => return Ok(*found),
    };
    let replaced = replace(&mut fit, &noise)?;
    Ok(conclude(record, &timeline, plan, &noise, &fit, &replaced)?)
}

/// Whether the motion is no more than the noise of its sensors.
fn is_at_rest(record: &[MotionSample], settings: &Settings) -> bool {
    let wrenches = || record.iter().filter_map(|sample| sample.wrench_body);
    let level = |sum: f64| (sum / wrenches().count().max(1) as f64).sqrt().max(f64::MIN_POSITIVE);
    let torque = level(wrenches().map(|wrench| wrench.torque.norm_squared()).sum());
    let force = level(wrenches().map(|wrench| wrench.force.norm_squared()).sum());
    predict(record, settings, (torque, force)).is_ok_and(|seen| seen.rank == 0)
}

/// Which part of the wrench says nothing.
fn silence_of(record: &[MotionSample], fit: &Fit) -> Silence {
    if is_without_wrench(record) {
        return Silence::Wrench;
    }
    match fit.explained() {
        Some((torque, force)) if force < SILENT && torque > FOLLOWED => {
            if is_noise(record) {
                Silence::Force
            } else {
                Silence::Unfollowed
            }
        }
        _ => Silence::Nothing,
    }
}

/// From a fit, whatever made it, to what may be said.
fn conclude(
    record: &[MotionSample],
    timeline: &Timeline,
    plan: &Plan<'_>,
    noise: &SampleNoise,
    fit: &Fit,
    replaced: &Replaced,
) -> Result<Identification, IdentificationError> {
    let (settings, diverged_ns) = (plan.settings, replaced.diverged_ns);
    let silence = silence_of(record, fit);
    let judgement = judge(fit, silence, settings.prior.as_ref())?;
    let mut warnings = warnings_of(timeline, fit, &judgement, noise);
    warnings.extend(diverged_ns.map(|time_ns| Warning::FilterDiverged { time_ns }));
    match silence {
        Silence::Wrench => warnings.push(Warning::ZeroWrench),
        Silence::Force => warnings.push(Warning::SilentForce),
        Silence::Unfollowed => {
            warnings.push(Warning::UnfollowedForce { explained: fit.explained().map_or(0.0, |(_, force)| force) });
        }
        Silence::Nothing => {}
    }
    let likelihood_failed = matches!(plan.way, Way::Likelihood | Way::FlightLikelihood)
        || plan.way == Way::Auto && settings.lag.is_none() && (fit.poses_noisy || fit.rates_noisy);
    if likelihood_failed {
        warnings.push(Warning::LikelihoodFailed);
    }
    let shift = if plan.way.is_recursive() { 0.0 } else { fit.coloured };
    if shift > 0.0 {
        warnings.push(Warning::BiasedByNoise { deviations: shift });
    }
    if settings.estimate != Nuisances::default() {
        warnings.push(Warning::NotCalibrated { rows: record.len() });
    }
    let full_rank = judgement.observability.rank() == 10;
    let information = if full_rank { judgement.determined } else { judgement.projected };
    let Solution { estimate, regularised } = solve(information, judgement.scale, full_rank, plan)?;
    let body = estimate.or(regularised);
    if estimate.is_some_and(|found| found.lmi_active) {
        warnings.push(Warning::ConstraintActive);
    }
    let residuals = body.map_or_else(Vec::new, |body| residuals(&fit.rows.all, timeline, &body.parameters));
    // Below rank ten the unconstrained fit tells whether any body could explain the log.
    let believed = estimate.map(|found| found.parameters).or_else(|| {
        let fitted = fit.least_squares.as_ref().filter(|_| silence == Silence::Nothing)?;
        Some(InertialParameters::from_vector(&fitted.parameters))
    });
    let mut evidence = believed.map_or_else(Evidence::default, |body| evidence(&fit.rows.all, &body, judgement.scale));
    let explained = believed.map(|_| evidence.explained().unwrap_or_default());
    (evidence.shift, evidence.diverged_ns) = (shift, diverged_ns);
    evidence.stand_in = likelihood_failed && fit.poses_noisy;
    let poor = explained.is_some_and(|share| share < plan.judge.poor_fit);
    if let Some(explained) = explained.filter(|_| poor) {
        let is_still = is_at_rest(record, settings);
        warnings.push(if is_still { Warning::AtRest } else { Warning::PoorFit { explained } });
    }
    let mut marks = Marks { likelihood_failed, errors_not_white: likelihood_failed, ..Marks::default() };
    if poor || silence == Silence::Unfollowed || likelihood_failed {
        let normal = planar_motion(record);
        marks.is_planar = normal.is_some();
        warnings.extend(normal.map(|normal_world| Warning::PlanarMotion { normal_world }));
    }
    if let Some(body) = estimate
        && let Some(change) = body_change::body_change(fit, &body.parameters.to_vector())
    {
        let told = Warning::of_change(record, &change, judgement.scale, explained > Some(plan.judge.poor_fit));
        marks.changed_ns = told.map(|(between, _)| between);
        warnings.extend(told.map(|(_, warning)| warning));
    }
    let beside = Some(&replaced.beside);
    let verdict = verdict(plan, judgement.scale, &information, estimate.as_ref(), &evidence, beside)?;
    let (torque_residual, force_residual) =
        fit.least_squares.as_ref().map_or((0.0, 0.0), |l| (l.torque_residual, l.force_residual));
    let wrench_gain = fit.scheme.wrench_gain().sqrt();
    Ok(Identification {
        method: if plan.way.is_recursive() && diverged_ns.is_none() {
            plan.name
        } else {
            Way::of_regression(fit.scheme.regression)
        },
        wrench_timing: settings.wrench_timing,
        lag: fit.scheme.lag,
        step_s: timeline.median_step_s(),
        samples_used: fit.rows.used,
        samples_rejected: record.len() - fit.rows.used,
        rank: judgement.observability.rank(),
        condition_number: judgement.observability.condition_number(),
        null_directions: judgement.observability.null_directions().to_vec(),
        information,
        scale: judgement.scale,
        estimate,
        regularised,
        explained,
        verdict,
        evidence,
        silence,
        noise: noise.with_wrench(torque_residual / wrench_gain, force_residual / wrench_gain),
        delay_s: None,
        calibration: Vec::new(),
        exchanges: Vec::new(),
        thrusters: None,
        age: None,
        residuals,
        warnings,
        marks,
    })
}

/// Whether the errors of the poses are rounding beside the way that the body moves.
fn is_exact(found: &Identification, record: &[MotionSample]) -> bool {
    let places: Vec<Vector3<f64>> =
        record.iter().filter_map(|sample| Some(sample.world_from_body?.translation.vector)).collect();
    let count = places.len().max(1) as f64;
    let mean = places.iter().sum::<Vector3<f64>>() / count;
    let size = places.iter().map(|place| (place - mean).norm_squared()).sum::<f64>() / count;
    let variance = found.noise.position_m.powi(2);
    // None at all of places that move: nobody looked.
    variance <= EXACT * EXACT * size && (variance > 0.0 || size == 0.0)
}

/// Whether the logged force is nothing but white noise: its change from sample to sample is as large as itself.
fn is_noise(record: &[MotionSample]) -> bool {
    let forces: Vec<Vector3<f64>> = record.iter().filter_map(|sample| Some(sample.wrench_body?.force)).collect();
    let mean_square = |sum: f64, count: usize| sum / count.max(1) as f64;
    let mean = forces.iter().sum::<Vector3<f64>>() / forces.len().max(1) as f64;
    let size = mean_square(forces.iter().map(|force| (force - mean).norm_squared()).sum(), forces.len());
    let change = mean_square(forces.windows(2).map(|pair| (pair[1] - pair[0]).norm_squared()).sum(), forces.len());
    // White noise: twice.
    change >= size
}

/// What a body leaves of the wrench of rows, torque counted at the body's own length.
fn evidence(rows: &[WrenchRow], body: &InertialParameters<f64>, scale: BodyScale) -> Evidence {
    let parameters = body.to_vector();
    let mut evidence = Evidence::default();
    for row in rows {
        evidence.count(&row.wrench, &(row.regressor * parameters - row.wrench), scale.length_m());
    }
    evidence
}

fn residuals(rows: &[WrenchRow], timeline: &Timeline, body: &InertialParameters<f64>) -> Vec<NodeResidual> {
    let parameters = body.to_vector();
    rows.iter()
        .map(|row| {
            let residual = row.regressor * parameters - row.wrench;
            NodeResidual {
                time_ns: timeline.time_ns(row.index),
                torque: residual.fixed_rows::<3>(0).into_owned(),
                force: residual.fixed_rows::<3>(3).into_owned(),
            }
        })
        .collect()
}

fn warnings_of(timeline: &Timeline, fit: &Fit, judgement: &Judgement, noise: &SampleNoise) -> Vec<Warning> {
    let mut warnings = Vec::new();
    let rows = &fit.rows;
    if timeline.gaps > 0 {
        warnings.push(Warning::Gaps { count: timeline.gaps, longest_s: timeline.longest_step_s });
    }
    if rows.skipped_unequal > 0 {
        warnings.push(Warning::UnequalSteps { skipped: rows.skipped_unequal, windows: rows.windows });
    }
    if rows.skipped_missing > 0 {
        warnings.push(Warning::MissingValues { skipped: rows.skipped_missing });
    }
    if rows.skipped_half_turn > 0 {
        warnings.push(Warning::HalfTurns { skipped: rows.skipped_half_turn });
    }
    let (noise_share, lag) = (judgement.noise_share, fit.scheme.lag);
    if fit.poses_noisy {
        let SampleNoise { position_m, attitude_rad, .. } = *noise;
        warnings.push(Warning::NoisyPoses { position_m, attitude_rad, noise_share, lag });
    }
    if fit.rates_noisy {
        let SampleNoise { rate_rad_s, velocity_m_s, .. } = *noise;
        warnings.push(Warning::NoisyRates { rate_rad_s, velocity_m_s, noise_share, lag });
    }
    if let Some(found) = &fit.least_squares {
        let magnitudes = judgement.scale.parameter_magnitudes();
        let share = (0..10)
            .filter(|&i| fit.discretisation[i].abs() > VISIBLE_DISCRETISATION.1 * magnitudes[i])
            .map(|i| fit.discretisation[i].abs() / found.covariance[(i, i)].sqrt())
            .fold(0.0, f64::max);
        if share > VISIBLE_DISCRETISATION.0 {
            warnings.push(Warning::Discretisation { share });
        }
    }
    if rows.all.len() < FEW_NODES {
        warnings.push(Warning::FewRows { rows: 6 * rows.all.len() });
    }
    warnings
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::lie::Pose;
    use crate::noise::Gaussian;
    use nalgebra::UnitQuaternion;

    /// Turns of half a radian about z with shares of it about x, moves in x and y with a share of it in z, pushed by `force`.
    fn record(tilt: f64, lift: f64, force: impl Fn(f64) -> f64) -> Vec<MotionSample> {
        let sample = |i: i32| {
            let t = 0.016 * f64::from(i);
            let turn = Vector3::new(tilt * (0.9 * t).sin(), 0.0, (0.4 * t).sin()) * 0.5;
            let place = Vector3::new((0.3 * t).sin(), (0.5 * t).cos(), lift * (0.7 * t).sin());
            MotionSample {
                time_ns: i64::from(i) * 16_000_000,
                world_from_body: Some(Pose::from_parts(place.into(), UnitQuaternion::from_scaled_axis(turn))),
                velocity_origin_world: None,
                rate_body: None,
                acceleration_origin_body: None,
                wrench_body: Some(crate::lie::Wrench::new(Vector3::zeros(), Vector3::x() * force(t))),
                ..MotionSample::default()
            }
        };
        (0..2000).map(sample).collect()
    }

    #[test]
    fn motion_on_a_table_is_planar_and_free_flight_is_not() {
        let normal = planar_motion(&record(0.01, 0.01, |_| 0.0)).unwrap();
        assert!((normal - Vector3::z()).norm() < 0.02, "{normal}");
        assert_eq!(planar_motion(&record(0.5, 0.01, |_| 0.0)), None);
        assert_eq!(planar_motion(&record(0.01, 0.5, |_| 0.0)), None);
    }

    #[test]
    fn a_force_is_noise_where_neighbours_differ_as_much_as_any_two() {
        let mut dice = Gaussian::from_seed(1);
        let white: Vec<f64> = (0..2000).map(|_| dice.uniform()).collect();
        #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)]
        let at = |t: f64| white[(t / 0.016).round() as usize];
        assert!(is_noise(&record(0.5, 0.5, at)) && is_noise(&record(0.5, 0.5, |_| 0.0)));
        assert!(!is_noise(&record(0.5, 0.5, |t| 0.4 * (2.0 * t).sin() + 0.05 * at(t))));
    }
}
