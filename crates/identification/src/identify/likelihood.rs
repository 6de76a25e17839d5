//! The likelihood behind [`identify`](super::identify): used where poses are noisy, believed where all ten directions are
//! determined.

use super::identification::{Identification, Marks, NodeResidual, Silence, UnexplainedWrench, Validation};
use super::plan::{Plan, Way};
use super::settings::{MAXIMUM_LIKELIHOOD, Settings};
use super::solution::{Solution, from_covariance, solve};
use super::timeline::Timeline;
use super::verdict::verdict;
use super::warning::{FEW_NODES, Warning};
use crate::error::{Column, IdentificationError};
use crate::estimator::{Estimate, Evidence};
use crate::likelihood::{Exchange, LikelihoodEstimate, MaximumLikelihood, Nuisances, SegmentResidual};
use crate::motion::MotionSample;
use crate::motion::Noise;
use crate::statistics::Whiteness;
use crate::{BodyScale, Observability, SquareRootInformation};
use nalgebra::SMatrix;

/// A direction is determined where one sigma is below this fraction of the body's scale: nearer to it, noise of the wrench
/// that the body does not feel passes for excitation.
pub(super) const DETERMINED: f64 = 0.2;
/// A wrench whose noise is above this share of it is nothing but noise.
const NOISE_ALONE: f64 = 0.5;
/// More outliers than this share are not outliers.
pub(super) const MANY_OUTLIERS: f64 = 0.05;
/// Colour of the noise is worth a warning above this inflation of sigma, and where chance does so less often than this.
const VISIBLE_COLOUR: (f64, f64) = (1.2, 1e-4);
/// Wrench that the motion asks for, in units of the noise that the logged wrench shows, beyond which something is unmodelled.
const UNMODELLED: f64 = 4.0;

pub(super) fn estimator(settings: &Settings) -> MaximumLikelihood {
    MaximumLikelihood {
        wrench_timing: settings.wrench_timing,
        gravity_world: settings.gravity_world,
        nuisances: settings.estimate.iter().collect(),
        ..MaximumLikelihood::default()
    }
}

/// `None` where the likelihood does not settle or explains too little: the regressions then answer.
pub(super) fn most_likely(
    record: &[MotionSample],
    timeline: &Timeline,
    plan: &Plan<'_>,
) -> Result<Option<Identification>, IdentificationError> {
    let settings = plan.settings;
    let whole = match estimator(settings).estimate(record) {
        Ok(found) => {
            let left_out = left_out(&found, settings);
            // Poses alone stand in where no model of the sensors does, which is asked after this.
            let alone = if plan.way == Way::Auto { None } else { left_out.and_then(|_| of_poses(record, settings)) };
            let is_alone = alone.is_some();
            answered(alone.unwrap_or(found), plan)?.map(|(found, answer)| (found, answer, left_out, is_alone))
        }
        Err(error) if is_about_the_data(&error) => None,
        Err(error) => return Err(error),
    };
    let whole = match whole {
        Some(whole) => Some(whole),
        // What was asked for beside the body needs all ten directions.
        None if settings.estimate != Nuisances::default() => None,
        None => match estimator(settings).partial(record) {
            Ok((found, _)) if is_noise(record, &found) || !has_settled(&found) => None,
            Ok((found, information)) => {
                Answer::of_part(&found, &information, plan)?.map(|answer| (found, answer, None, false))
            }
            Err(error) if is_about_the_data(&error) => None,
            Err(error) => return Err(error),
        },
    };
    let Some((found, answer, left_out, is_alone)) = whole else { return Ok(None) };
    let mut found = identification(found, &answer, record, timeline, plan)?;
    found.marks.poses_without = left_out;
    if is_alone {
        found = alone(found);
    }
    let trusted = found.explained >= Some(plan.judge.poor_fit) && found.marks.leaves_noise_only;
    Ok((found.rank == 10 || trusted).then_some(found))
}

/// Whether a column leaves noise unexplained that is visibly not white.
fn is_coloured(whiteness: &Whiteness) -> bool {
    let (inflation, chance) = VISIBLE_COLOUR;
    whiteness.sigma_inflation() > inflation && !whiteness.is_white(chance)
}

/// The same, found from the poses alone, with the column on whose account.
fn alone(mut found: Identification) -> Identification {
    found.warnings.extend(found.marks.poses_without.take().map(|column| Warning::PosesAlone { column }));
    found.marks.errors_not_white = true;
    found
}

const fn is_of_poses(column: Column) -> bool {
    matches!(column, Column::Position | Column::Attitude)
}

/// A column beside the poses whose noise is visibly not white, without which the poses may tell more.
///
/// Filters, biases and errors of scale make measured rates and accelerations wrong in ways that no noise level describes.
/// What was asked for beside the body may be about just these, and keeps them.
fn left_out(found: &LikelihoodEstimate, settings: &Settings) -> Option<Column> {
    let beside = |whiteness: &&(Column, Whiteness)| !is_of_poses(whiteness.0) && is_coloured(&whiteness.1);
    let coloured = found.whiteness.iter().find(beside).map(|(column, _)| *column);
    coloured.filter(|_| settings.estimate == Nuisances::default())
}

/// What the poses alone say, where their noise is white.
fn of_poses(record: &[MotionSample], settings: &Settings) -> Option<LikelihoodEstimate> {
    let poses = |sample: &MotionSample| MotionSample {
        velocity_origin_world: None,
        rate_body: None,
        acceleration_origin_body: None,
        ..*sample
    };
    let poses: Vec<MotionSample> = record.iter().map(poses).collect();
    let alone = estimator(settings).estimate(&poses).ok()?;
    (is_known(&alone, DETERMINED) && !alone.whiteness.iter().any(|(_, w)| is_coloured(w))).then_some(alone)
}

/// An answer of the likelihood, or of the poses alone in its place where a column beside them is not white.
pub(super) fn by_poses(
    found: Identification,
    record: &[MotionSample],
    timeline: &Timeline,
    plan: &Plan<'_>,
) -> Result<Identification, IdentificationError> {
    if found.marks.poses_without.is_none() {
        return Ok(found);
    }
    let by_poses = of_poses(record, plan.settings).map(|by_poses| answered(by_poses, plan)).transpose()?.flatten();
    let Some((by_poses, answer)) = by_poses else { return Ok(found) };
    let poses_without = found.marks.poses_without;
    let mut found = identification(by_poses, &answer, record, timeline, plan)?;
    found.marks.poses_without = poses_without;
    Ok(alone(found))
}

/// With sigmas as wide as the parts of the record contradict each other; `None` where a direction is left free.
fn answered(
    mut found: LikelihoodEstimate,
    plan: &Plan<'_>,
) -> Result<Option<(LikelihoodEstimate, Answer)>, IdentificationError> {
    widen(&mut found);
    Ok(Answer::of(&found, plan)?.map(|answer| (found, answer)))
}

/// Widens what is stated where the parts of the record contradict each other beyond it.
fn widen(found: &mut LikelihoodEstimate) {
    found.covariance *= found.scatter * found.scatter;
    found.std *= found.scatter;
}

/// Whether the logged wrench is nothing but noise, torque and force.
fn is_noise(record: &[MotionSample], found: &LikelihoodEstimate) -> bool {
    let wrenches: Vec<_> = record.iter().filter_map(|sample| sample.wrench_body).collect();
    let rms = |squares: f64| (squares / (3 * wrenches.len().max(1)) as f64).sqrt();
    let torque = rms(wrenches.iter().map(|wrench| wrench.torque.norm_squared()).sum());
    let force = rms(wrenches.iter().map(|wrench| wrench.force.norm_squared()).sum());
    let seen = found.visible_wrench_noise.map(|level| if level.is_finite() { level } else { 0.0 });
    seen[0] >= NOISE_ALONE * torque && seen[1] >= NOISE_ALONE * force
}

/// Whether the parameters had come to rest when a weak prior let the iterations end: within the scatter of ten, so that only
/// what is not determined still drifts.
fn has_settled(found: &LikelihoodEstimate) -> bool {
    found.iterations.last().is_some_and(|last| last.decrement < 10.0)
}

/// Whether another method may still answer.
fn is_about_the_data(error: &IdentificationError) -> bool {
    matches!(
        error,
        IdentificationError::NotExcited { .. }
            | IdentificationError::Indefinite { .. }
            | IdentificationError::LikelihoodNotConverged { .. }
            | IdentificationError::TooFewSamples { .. }
    )
}

fn identification(
    found: LikelihoodEstimate,
    answer: &Answer,
    record: &[MotionSample],
    timeline: &Timeline,
    plan: &Plan<'_>,
) -> Result<Identification, IdentificationError> {
    let settings = plan.settings;
    let Answer { scale, information, estimate, regularised } = *answer;
    let observability = Observability::new(&information, scale);
    let residuals = residuals(&found, timeline);
    let mut evidence = evidence(&found.residuals, record, scale);
    let explained = evidence.explained().unwrap_or_default();
    let coloured = || found.whiteness.iter().filter(|(_, whiteness)| is_coloured(whiteness));
    let of_poses =
        coloured().filter(|(column, _)| is_of_poses(*column)).map(|(_, whiteness)| whiteness.sigma_inflation());
    evidence.colour = of_poses.fold(0.0, f64::max);
    evidence.exchangeable = exchanges_the_body(&found.exchanges);
    let many_outliers = found.outliers as f64 > MANY_OUTLIERS * record.len() as f64;
    let errors_not_white = coloured().next().is_some();
    let mut marks =
        Marks { leaves_noise_only: !many_outliers && !errors_not_white, errors_not_white, ..Marks::default() };
    let verdict = verdict(plan, scale, &information, estimate.as_ref(), &evidence, None)?;
    let mut warnings = Vec::new();
    if timeline.gaps > 0 {
        warnings.push(Warning::Gaps { count: timeline.gaps, longest_s: timeline.longest_step_s });
    }
    let missing = record.iter().filter(|sample| sample.wrench_body.is_none()).count();
    if missing > 0 {
        warnings.push(Warning::HeldWrenches { samples: missing });
    }
    if many_outliers {
        warnings.push(Warning::ManyOutliers { rejected: found.outliers, rows: record.len() });
    }
    if estimate.is_some_and(|found| found.lmi_active) {
        warnings.push(Warning::ConstraintActive);
    }
    if explained < plan.judge.poor_fit {
        warnings.push(Warning::PoorFit { explained });
    }
    for (column, whiteness) in &found.whiteness {
        if is_coloured(whiteness) {
            warnings.push(Warning::ColouredNoise { column: *column, sigma_inflation: whiteness.sigma_inflation() });
        }
    }
    if found.scatter > 1.0 {
        warnings.push(Warning::WidenedSigma { factor: found.scatter });
    }
    let Noise { torque_n_m, force_n, .. } = found.noise;
    let beyond = [torque_n_m, force_n].into_iter().zip(found.visible_wrench_noise).map(|(asked, seen)| asked / seen);
    let times = beyond.fold(0.0, f64::max);
    if times > UNMODELLED {
        warnings.push(Warning::UnmodelledWrench { torque_n_m, force_n, times });
    }
    if let Some(change) = &found.body_change {
        let told = Warning::of_change(record, change, scale, explained >= plan.judge.poor_fit);
        marks.changed_ns = told.map(|(between, _)| between);
        warnings.extend(told.map(|(_, warning)| warning));
    }
    if record.len() < FEW_NODES {
        warnings.push(Warning::FewRows { rows: 6 * record.len() });
    }
    Ok(Identification {
        method: MAXIMUM_LIKELIHOOD,
        wrench_timing: settings.wrench_timing,
        lag: found.segment_samples,
        step_s: timeline.median_step_s(),
        samples_used: record.len().saturating_sub(found.outliers),
        samples_rejected: found.outliers,
        rank: observability.rank(),
        condition_number: observability.condition_number(),
        null_directions: observability.null_directions().to_vec(),
        information,
        scale,
        estimate,
        regularised,
        explained: Some(explained),
        verdict,
        evidence,
        silence: Silence::Nothing,
        noise: found.noise,
        delay_s: found.delay_s(),
        calibration: found.nuisances,
        exchanges: found.exchanges,
        thrusters: None,
        age: None,
        residuals,
        warnings,
        marks,
    })
}

/// Whether one of the ten quantities of the body has a part in an exchange.
pub(super) fn exchanges_the_body(exchanges: &[Exchange]) -> bool {
    exchanges
        .iter()
        .flat_map(|exchange| &exchange.parts)
        .any(|(quantity, _)| super::verdict::place(*quantity).is_some())
}

/// Whether one sigma of every direction is below a fraction of the body's scale.
pub(super) fn is_known(found: &LikelihoodEstimate, fraction: f64) -> bool {
    let Ok(scale) = BodyScale::of(&found.parameters.to_vector()) else { return false };
    let magnitudes = scale.parameter_magnitudes();
    let like = SMatrix::<f64, 10, 10>::from_fn(|i, j| found.covariance[(i, j)] / (magnitudes[i] * magnitudes[j]));
    like.symmetric_eigenvalues().max() < fraction * fraction
}

/// A likelihood's optimum in the terms of an [`Identification`].
pub(super) struct Answer {
    pub(super) scale: BodyScale,
    pub(super) information: SquareRootInformation<10>,
    pub(super) estimate: Option<Estimate>,
    pub(super) regularised: Option<Estimate>,
}

impl Answer {
    /// `None` where a direction is left free.
    pub(super) fn of(found: &LikelihoodEstimate, plan: &Plan<'_>) -> Result<Option<Self>, IdentificationError> {
        let prior = plan.settings.prior.as_ref();
        let Ok(scale) = BodyScale::of(&found.parameters.to_vector()) else { return Ok(None) };
        let magnitudes = scale.parameter_magnitudes();
        if !is_known(found, DETERMINED) {
            return Ok(None);
        }
        let information = from_covariance(&found.unconstrained, &found.covariance, &magnitudes)?;
        let Solution { mut estimate, regularised } = solve(information, scale, true, plan)?;
        if let (Some(estimate), None) = (&mut estimate, prior) {
            // The likelihood has met the constraint where it is not linear.
            estimate.parameters = found.parameters;
            estimate.lmi_active = found.active_axis.is_some();
        }
        Ok(Some(Self { scale, information, estimate, regularised }))
    }

    /// The same where `information`, that of the record alone, leaves directions free; these are dropped from it.
    fn of_part(
        found: &LikelihoodEstimate,
        information: &SMatrix<f64, 10, 10>,
        plan: &Plan<'_>,
    ) -> Result<Option<Self>, IdentificationError> {
        let Ok(scale) = BodyScale::of(&found.parameters.to_vector()) else { return Ok(None) };
        let magnitudes = scale.parameter_magnitudes();
        let scaled = SMatrix::<f64, 10, 10>::from_fn(|i, j| information[(i, j)] * magnitudes[i] * magnitudes[j]);
        let eigen = (0.5 * (scaled + scaled.transpose())).symmetric_eigen();
        let (mut factor, mut rank) = (SMatrix::<f64, 10, 10>::zeros(), 0);
        for i in 0..10 {
            let value = eigen.eigenvalues[i];
            if value > DETERMINED.powi(-2) {
                let row = eigen.eigenvectors.column(i).component_div(&magnitudes) * value.sqrt();
                factor.set_row(i, &row.transpose());
                rank += 1;
            }
        }
        let information = SquareRootInformation::from_square_root(&factor, &(factor * found.unconstrained))?;
        let Solution { estimate, regularised } = solve(information, scale, rank == 10, plan)?;
        Ok((rank > 0).then_some(Self { scale, information, estimate, regularised }))
    }
}

/// The wrench that the motion asks for beyond the one applied, segment by segment.
fn residuals(found: &LikelihoodEstimate, timeline: &Timeline) -> Vec<NodeResidual> {
    let node = |residual: &SegmentResidual| NodeResidual {
        time_ns: timeline.time_ns(residual.first_sample),
        torque: residual.wrench.torque,
        force: residual.wrench.force,
    };
    found.residuals.iter().map(node).collect()
}

/// What the body leaves of the wrench, torque counted at its own length.
fn evidence(residuals: &[SegmentResidual], record: &[MotionSample], scale: BodyScale) -> Evidence {
    let size = |torque: f64, force: f64| torque / scale.length_m().powi(2) + force;
    let applied: f64 = record
        .iter()
        .filter_map(|sample| sample.wrench_body)
        .map(|wrench| size(wrench.torque.norm_squared(), wrench.force.norm_squared()))
        .sum();
    let (torque, force) = mean_squares(residuals, record.len());
    let left = size(torque, force) * record.len() as f64;
    Evidence::of_sums(applied, left)
}

/// Squares of the torque and force residual, averaged over samples.
fn mean_squares(residuals: &[SegmentResidual], samples: usize) -> (f64, f64) {
    let (mut torque, mut force) = (0.0, 0.0);
    for (i, residual) in residuals.iter().enumerate() {
        let end = residuals.get(i + 1).map_or(samples, |next| next.first_sample);
        let length = (end - residual.first_sample) as f64;
        torque += length * residual.wrench.torque.norm_squared();
        force += length * residual.wrench.force.norm_squared();
    }
    (torque / samples as f64, force / samples as f64)
}

/// How well a body found by likelihood fits another record.
pub(super) fn validated(
    found: &Identification,
    estimate: &Estimate,
    record: &[MotionSample],
    settings: &Settings,
) -> Result<Validation, IdentificationError> {
    let judged = estimator(settings).judge(record, &estimate.parameters, &estimate.covariance, &found.noise)?;
    let (torque, force) = mean_squares(&judged.residuals, record.len());
    Ok(Validation {
        nodes: judged.residuals.len(),
        normalised_rms: judged.misfit,
        wrench: Some(UnexplainedWrench {
            torque_rms_n_m: (torque / 3.0).sqrt(),
            force_rms_n: (force / 3.0).sqrt(),
            explained: evidence(&judged.residuals, record, found.scale).explained().unwrap_or_default(),
        }),
    })
}
