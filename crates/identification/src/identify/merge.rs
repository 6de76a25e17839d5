//! One result from the stretches of a record that is too long to be taken at once.

use super::identification::{Identification, Marks, Silence};
use super::plan::Plan;
use super::settings::{Prior, Settings};
use super::solution::{Solution, solve};
use super::verdict::verdict;
use super::warning::Warning;
use super::{WEAK_STD, weak_excitation};
use crate::error::IdentificationError;
use crate::likelihood::{Nuisance, NuisanceEstimate, Verdict};
use crate::motion::Noise;
use crate::{Observability, SquareRootInformation};

/// The result of a whole record from the results of its stretches: their information adds up.
///
/// What was estimated beside the body is averaged, each stretch weighted by its own variance. Each stretch is identified without
/// a prior; the prior enters here, once. Method, lag and step are those of the stretch
/// with the most samples; rows that would reach across a cut are lost, as across a gap. Warnings of a kind become one, with the worse number;
/// what the motion does not show is judged of the whole.
///
/// # Errors
/// [`IdentificationError::TooFewSamples`] without any stretch; [`IdentificationError::NotConverged`] of the constrained
/// solution.
pub fn merge(parts: &[Identification], prior: Option<&Prior>) -> Result<Identification, IdentificationError> {
    let Some(main) = parts.iter().max_by_key(|part| (part.rank, part.samples_used)) else {
        return Err(IdentificationError::TooFewSamples { samples: 0, needed: 3 });
    };
    // A stretch without any wrench has no noise level of its own to be weighted by.
    let silent = |part: &Identification| part.silence == Silence::Wrench;
    let all_silent = parts.iter().all(silent);
    let mut information = SquareRootInformation::new();
    for part in parts.iter().filter(|part| all_silent || !silent(part)) {
        information.merge(&part.information);
    }
    let scale = main.scale;
    let observability = Observability::new(&information, scale);
    let rank = observability.rank();
    let settings = Settings { prior: prior.copied(), ..Settings::default() };
    let plan = Plan::usual(&settings)?;
    let plan = Plan { judge: plan.judge_of(main.method), ..plan };
    let Solution { estimate, regularised } = solve(information, scale, rank == 10, &plan)?;
    let samples = |count: fn(&Identification) -> usize| parts.iter().map(count).sum::<usize>();
    let mut warnings: Vec<Warning> = Vec::new();
    let of_motion = |warning: &Warning| matches!(warning, Warning::WeakExcitation { .. });
    for warning in parts.iter().flat_map(|part| &part.warnings) {
        // What one stretch does not show another may: that is judged of the whole, below.
        if *warning == Warning::ConstraintActive
            || (*warning == Warning::ZeroWrench && !all_silent)
            || of_motion(warning)
        {
            continue;
        }
        if !warnings.iter_mut().any(|known| known.absorb(warning)) {
            warnings.push(*warning);
        }
    }
    if estimate.is_some_and(|found| found.lmi_active) {
        warnings.push(Warning::ConstraintActive);
    }
    let (calibration, stretches) = averaged(parts, main);
    if stretches > 1 {
        warnings.push(Warning::CalibratedInStretches { stretches });
    }
    let explained = estimate.and_then(|_| parts.iter().filter_map(|part| part.explained).reduce(f64::min));
    let least = parts.iter().filter_map(|part| Some((part.explained?, part.evidence)));
    let least = least.reduce(|a, b| if b.0 < a.0 { b } else { a }).map(|(_, evidence)| evidence);
    let mut evidence = least.filter(|_| explained.is_some()).unwrap_or_default();
    for part in parts {
        evidence.shift = evidence.shift.max(part.evidence.shift);
        evidence.colour = evidence.colour.max(part.evidence.colour);
        evidence.diverged_ns = evidence.diverged_ns.or(part.evidence.diverged_ns);
        evidence.stand_in |= part.evidence.stand_in;
        evidence.feedback = evidence.feedback.max(part.evidence.feedback);
        evidence.halves = evidence.halves.max(part.evidence.halves);
    }
    evidence.exchangeable = main.evidence.exchangeable;
    evidence.on_table = parts.iter().any(|part| part.evidence.on_table) && parts.iter().all(|part| part.marks.on_table);
    // How well the whole is known follows below.
    evidence.held = 0.0;
    let verdict = verdict(&plan, scale, &information, estimate.as_ref(), &evidence, None)?;
    let silence = if all_silent { Silence::Wrench } else { main.silence };
    let mean_square = |level: fn(&Noise) -> f64| {
        let weighted: f64 = parts.iter().map(|part| part.samples_used as f64 * level(&part.noise).powi(2)).sum();
        (weighted / (samples(|part| part.samples_used) as f64).max(1.0)).sqrt()
    };
    let mut found = Identification {
        method: main.method,
        wrench_timing: main.wrench_timing,
        lag: main.lag,
        step_s: main.step_s,
        samples_used: samples(|part| part.samples_used),
        samples_rejected: samples(|part| part.samples_rejected),
        rank,
        condition_number: observability.condition_number(),
        null_directions: observability.null_directions().to_vec(),
        information,
        scale,
        estimate,
        regularised,
        explained,
        verdict,
        evidence,
        silence,
        noise: Noise {
            torque_n_m: mean_square(|noise| noise.torque_n_m),
            force_n: mean_square(|noise| noise.force_n),
            attitude_rad: mean_square(|noise| noise.attitude_rad),
            position_m: mean_square(|noise| noise.position_m),
            rate_rad_s: mean_square(|noise| noise.rate_rad_s),
            velocity_m_s: mean_square(|noise| noise.velocity_m_s),
            acceleration_m_s2: mean_square(|noise| noise.acceleration_m_s2),
        },
        delay_s: calibration.iter().find(|found| found.nuisance == Nuisance::Delay).and_then(|found| found.value),
        calibration,
        exchanges: main.exchanges.clone(),
        thrusters: main.thrusters.clone(),
        age: main.age,
        residuals: parts.iter().flat_map(|part| part.residuals.iter().copied()).collect(),
        warnings,
        marks: Marks { is_planar: main.marks.is_planar, on_table: main.marks.on_table, ..Marks::default() },
    };
    let widest = found.widest();
    if parts.iter().any(|part| part.evidence.held > 0.0) && widest > WEAK_STD {
        found.evidence.held = widest;
        found.verdict = plan.judge.again(found.verdict, &found.evidence);
    }
    if parts.iter().any(|part| part.warnings.iter().any(of_motion)) {
        let weak = weak_excitation(&found);
        found.warnings.extend(weak);
    }
    Ok(found)
}

/// The calibration of all stretches, and how many of them have one.
fn averaged(parts: &[Identification], main: &Identification) -> (Vec<NuisanceEstimate>, usize) {
    let calibrated = || parts.iter().filter(|part| !part.calibration.is_empty());
    let Some(like) = [main].into_iter().chain(calibrated()).find(|part| !part.calibration.is_empty()) else {
        return (Vec::new(), 0);
    };
    let mean = |like: &NuisanceEstimate| {
        let known = calibrated()
            .filter_map(|part| part.calibration.iter().find(|found| found.nuisance == like.nuisance))
            .filter_map(|found| found.value.zip(found.std));
        let (weights, sum) = known.fold((0.0, 0.0), |(weights, sum), (value, std)| {
            let weight = std.powi(-2);
            (weights + weight, sum + weight * value)
        });
        if weights > 0.0 {
            NuisanceEstimate {
                value: Some(sum / weights),
                std: Some(weights.sqrt().recip()),
                verdict: Verdict::Identifiable,
                ..like.clone()
            }
        } else {
            like.clone()
        }
    };
    (like.calibration.iter().map(mean).collect(), calibrated().count())
}

impl Warning {
    /// Takes up another stretch's warning of the same kind: counts add, the worse number stays. `false` for other kinds.
    fn absorb(&mut self, other: &Self) -> bool {
        match (self, other) {
            (Self::Gaps { count, longest_s }, Self::Gaps { count: more, longest_s: longer }) => {
                *count += more;
                *longest_s = longest_s.max(*longer);
            }
            (
                Self::UnequalSteps { skipped, windows },
                Self::UnequalSteps { skipped: more_skipped, windows: more_windows },
            ) => {
                *skipped += more_skipped;
                *windows += more_windows;
            }
            (Self::MissingValues { skipped }, Self::MissingValues { skipped: more })
            | (Self::HalfTurns { skipped }, Self::HalfTurns { skipped: more }) => *skipped += more,
            (Self::NoisyPoses { noise_share, .. }, Self::NoisyPoses { noise_share: worse, .. })
            | (Self::NoisyRates { noise_share, .. }, Self::NoisyRates { noise_share: worse, .. }) => {
                *noise_share = noise_share.max(*worse);
            }
            (Self::Discretisation { share }, Self::Discretisation { share: worse })
            | (Self::Feedback { share }, Self::Feedback { share: worse }) => *share = share.max(*worse),
            (Self::HeldWrenches { samples }, Self::HeldWrenches { samples: more }) => *samples += more,
            (Self::FewRows { rows }, Self::FewRows { rows: more })
            | (Self::NotCalibrated { rows }, Self::NotCalibrated { rows: more }) => *rows += more,
            (Self::PoorFit { explained }, Self::PoorFit { explained: worse }) => *explained = explained.min(*worse),
            (Self::UnfollowedForce { explained }, Self::UnfollowedForce { explained: worse }) => {
                *explained = explained.min(*worse);
            }
            (Self::BiasedByNoise { deviations }, Self::BiasedByNoise { deviations: worse }) => {
                *deviations = deviations.max(*worse);
            }
            (Self::ManyOutliers { rejected, rows }, Self::ManyOutliers { rejected: more, rows: more_rows }) => {
                *rejected += more;
                *rows += more_rows;
            }
            (
                Self::UnmodelledWrench { torque_n_m, force_n, times },
                Self::UnmodelledWrench { torque_n_m: more_torque, force_n: more_force, times: worse },
            ) => {
                *torque_n_m = torque_n_m.max(*more_torque);
                *force_n = force_n.max(*more_force);
                *times = times.max(*worse);
            }
            (
                Self::ColouredNoise { column, sigma_inflation },
                Self::ColouredNoise { column: same, sigma_inflation: worse },
            ) if column == same => *sigma_inflation = sigma_inflation.max(*worse),
            (Self::WidenedSigma { factor }, Self::WidenedSigma { factor: worse }) => *factor = factor.max(*worse),
            (Self::PosesAlone { column }, Self::PosesAlone { column: same }) if column == same => {}
            (Self::FilterDiverged { .. }, Self::FilterDiverged { .. })
            | (Self::PlanarMotion { .. }, Self::PlanarMotion { .. })
            | (Self::OnTable, Self::OnTable)
            | (Self::NoAnswer, Self::NoAnswer)
            | (Self::AtRest, Self::AtRest)
            | (Self::LikelihoodFailed, Self::LikelihoodFailed)
            | (Self::ZeroWrench, Self::ZeroWrench)
            | (Self::SilentForce, Self::SilentForce) => {}
            _ => return false,
        }
        true
    }
}
