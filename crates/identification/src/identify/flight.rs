//! The likelihood with a model of the sensors behind [`identify`](super::identify).

use super::identification::{Identification, Marks, NodeResidual, Silence};
use super::likelihood::MANY_OUTLIERS;
use super::plan::Plan;
use super::settings::{FLIGHT_LIKELIHOOD, Settings, WEAK_FORM};
use super::solution::{Solution, solve};
use super::timeline::Timeline;
use super::verdict::verdict;
use super::warning::{FEW_NODES, Warning};
use crate::error::{Column, IdentificationError};
use crate::estimator::{Evidence, Verdict, Why};
use crate::likelihood::{FlightEstimate, FlightLikelihood, FoundDelay};
use crate::motion::{MotionSample, Noise, is_without_wrench};
use crate::{BodyScale, Observability};

/// Chance below which the halves of a record are not of one body, or not of these sensors.
const CHANCE: f64 = 1e-5;
/// Colour of what is left of the inertial rows beyond which the sensors are not as described: the filters known leave up to 1.6.
const COLOURED: f64 = 2.0;
/// Misfit of levels below which colour is of no consequence.
const VISIBLE: f64 = 1e-4;

/// A shorter log on a table says by windows what nothing confirms, s: half a minute of a real one is off by up to five standard deviations.
const SHORTEST_S: f64 = 55.0;
/// Masses further apart than so many joint standard deviations are not of one body.
const APART: f64 = 2.5;

/// Places of ln m, c_x, c_y and J_C33.
const IN_PLANE: [usize; 4] = [0, 1, 2, 9];

impl FlightLikelihood {
    /// The same with the timing and gravity of the settings.
    pub(super) fn under(&self, settings: &Settings) -> Self {
        Self { wrench_timing: settings.wrench_timing, gravity_world: settings.gravity_world, ..self.clone() }
    }
}

/// `None` where the likelihood does not settle: a regression then answers.
pub(super) fn most_likely(
    record: &[MotionSample],
    timeline: &Timeline,
    plan: &Plan<'_>,
) -> Result<Option<Identification>, IdentificationError> {
    let settings = plan.settings;
    let estimator = plan.flown.map_or_else(|| FlightLikelihood::default().under(settings), |told| told.under(settings));
    let found = estimator.estimate(record).and_then(|found| identification(&found, record, timeline, plan));
    let found = match found {
        Ok(found) => Some(found),
        // Also a body so far from all bodies that nothing consistent is near it.
        Err(
            IdentificationError::Indefinite { .. }
            | IdentificationError::LikelihoodNotConverged { .. }
            | IdentificationError::NotConverged { .. }
            | IdentificationError::NotExcited { .. }
            | IdentificationError::TooFewSamples { .. }
            | IdentificationError::WrenchBeside,
        ) => None,
        Err(error) => return Err(error),
    };
    if !estimator.is_planar(record) {
        return Ok(found);
    }
    // A table has what no white error of the wrench describes.
    let Some(weak) = estimator.weak_form(record)? else { return Ok(found) };
    let mut weak = Identification { method: WEAK_FORM, ..identification(&weak, record, timeline, plan)? };
    if timeline.duration_s() < SHORTEST_S {
        weak.verdict = Verdict::Doubtful(Why::StandIn);
    }
    let Some(found) = found else { return Ok(Some(weak)) };
    let agrees = found.verdict.is_identified() && !are_apart(&found, &weak);
    let is_better = weak.verdict.is_identified() && !agrees;
    // What thrusters leave on a table no white error of theirs describes.
    Ok(Some(if is_better || estimator.thrusters.is_some() { weak } else { found }))
}

/// Whether the masses that two ways come to are further apart than both allow.
fn are_apart(one: &Identification, other: &Identification) -> bool {
    let of = |found: &Identification| {
        found.estimate.or(found.regularised).map(|found| (found.parameters.mass, found.std.mass_kg))
    };
    of(one).zip(of(other)).is_some_and(|(a, b)| (a.0 - b.0).abs() > APART * a.1.hypot(b.1))
}

fn identification(
    found: &FlightEstimate,
    record: &[MotionSample],
    timeline: &Timeline,
    plan: &Plan<'_>,
) -> Result<Identification, IdentificationError> {
    let settings = plan.settings;
    let scale = BodyScale::of(&found.parameters.to_vector())?;
    let information = found.information;
    let observability = Observability::new(&information, scale);
    let full_rank = found.is_determined();
    let Solution { mut estimate, regularised } = solve(information, scale, full_rank, plan)?;
    if let (Some(estimate), None) = (&mut estimate, settings.prior.as_ref()) {
        // The likelihood has met the constraint where it is not linear.
        estimate.parameters = found.parameters;
    }
    let mut evidence = applied(found, record, scale);
    let colours = [(Column::Rate, &found.whiteness[0]), (Column::Acceleration, &found.whiteness[1])];
    let coloured = colours.into_iter().filter_map(|(column, whiteness)| {
        let whiteness = whiteness.as_ref()?;
        let inflation = whiteness.sigma_inflation();
        (inflation > COLOURED && !whiteness.is_white(VISIBLE)).then_some((column, inflation))
    });
    let mut warnings = Vec::new();
    for (column, sigma_inflation) in coloured {
        evidence.colour = evidence.colour.max(sigma_inflation);
        warnings.push(Warning::ColouredNoise { column, sigma_inflation });
    }
    let in_plane = IN_PLANE.iter().all(|place| found.determined.get(*place).is_some_and(|determined| *determined));
    evidence.on_table = found.planar && in_plane;
    if let Some(halves) = found.halves.filter(|halves| halves.chance() < CHANCE) {
        evidence.halves = halves.chi_square / halves.degrees_of_freedom.max(1) as f64;
    }
    let verdict = verdict(plan, scale, &information, estimate.as_ref(), &evidence, None)?;
    let gated = found.gated.iter().copied().max().unwrap_or(0) * found.segment_samples;
    let many_outliers = gated as f64 > MANY_OUTLIERS * record.len() as f64;
    if many_outliers {
        warnings.push(Warning::ManyOutliers { rejected: gated, rows: record.len() });
    }
    if timeline.gaps > 0 {
        warnings.push(Warning::Gaps { count: timeline.gaps, longest_s: timeline.longest_step_s });
    }
    let missing = record.iter().filter(|sample| sample.wrench_body.is_none()).count();
    if missing > 0 {
        warnings.push(Warning::HeldWrenches { samples: missing });
    }
    if estimate.is_some_and(|found| found.lmi_active) {
        warnings.push(Warning::ConstraintActive);
    }
    let silence = if is_without_wrench(record) { Silence::Wrench } else { Silence::Nothing };
    if silence == Silence::Wrench {
        warnings.push(Warning::ZeroWrench);
    } else if found.explained < plan.judge.poor_fit {
        warnings.push(Warning::PoorFit { explained: found.explained });
    }
    if found.planar {
        warnings.push(Warning::OnTable);
    }
    if record.len() < FEW_NODES {
        warnings.push(Warning::FewRows { rows: 6 * record.len() });
    }
    let levels = &found.levels;
    let [position_m, attitude_rad, velocity_m_s, rate_rad_s, acceleration_m_s2] = levels.white;
    let [torque_n_m, force_n] = levels.wrench;
    let noise = Noise { torque_n_m, force_n, attitude_rad, position_m, rate_rad_s, velocity_m_s, acceleration_m_s2 };
    let residuals = found
        .wrench_errors
        .iter()
        .map(|(sample, torque, force)| NodeResidual {
            time_ns: timeline.time_ns(*sample),
            torque: *torque,
            force: *force,
        })
        .collect();
    Ok(Identification {
        method: FLIGHT_LIKELIHOOD,
        wrench_timing: settings.wrench_timing,
        lag: found.segment_samples,
        step_s: timeline.median_step_s(),
        samples_used: record.len().saturating_sub(gated),
        samples_rejected: gated.min(record.len()),
        rank: observability.rank(),
        condition_number: observability.condition_number(),
        null_directions: observability.null_directions().to_vec(),
        information,
        scale,
        estimate,
        regularised,
        explained: Some(found.explained),
        verdict,
        evidence,
        silence,
        noise,
        delay_s: None,
        calibration: Vec::new(),
        exchanges: Vec::new(),
        thrusters: found.thrusters.clone(),
        age: found.thrusters.as_ref().and(found.delays[2].or(found.delays[0])).map(|age| held(age, timeline)),
        residuals,
        warnings,
        marks: Marks {
            leaves_noise_only: !many_outliers,
            is_planar: found.planar,
            on_table: found.planar,
            ..Marks::default()
        },
    })
}

/// The delay of commands that are held from row to row, of which no log says when within a row each was taken up.
fn held(age: FoundDelay, timeline: &Timeline) -> FoundDelay {
    FoundDelay { std_s: age.std_s.hypot(timeline.median_step_s() / 12.0_f64.sqrt()), ..age }
}

/// A record on a table, or of thrusters that may be off, on which the likelihood did not settle: what a free body under a wrench without
/// errors would have to be says nothing.
pub(super) fn unanswered(free: Identification, on_table: bool) -> Identification {
    let mut warnings: Vec<Warning> =
        free.warnings.into_iter().filter(|warning| matches!(warning, Warning::Gaps { .. })).collect();
    warnings.extend(on_table.then_some(Warning::OnTable));
    warnings.push(Warning::NoAnswer);
    Identification {
        method: FLIGHT_LIKELIHOOD,
        estimate: None,
        regularised: None,
        explained: None,
        verdict: Verdict::Doubtful(Why::StandIn),
        residuals: Vec::new(),
        warnings,
        marks: Marks { likelihood_failed: true, is_planar: on_table, on_table, ..free.marks },
        ..free
    }
}

/// What the body leaves of the wrench, torque counted at its own length.
fn applied(found: &FlightEstimate, record: &[MotionSample], scale: BodyScale) -> Evidence {
    let size = |torque: f64, force: f64| torque / scale.length_m().powi(2) + force;
    let all: f64 = record
        .iter()
        .filter_map(|sample| sample.wrench_body)
        .map(|wrench| size(wrench.torque.norm_squared(), wrench.force.norm_squared()))
        .sum();
    Evidence::of_sums(all, all * (1.0 - found.explained))
}
