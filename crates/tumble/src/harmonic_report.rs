//! The result of identification from a periodic motion, as people and programs read it.

use crate::TumbleError;
use crate::flight_log::nanoseconds;
use crate::output::OutputFolder;
use crate::page::chart::{Axis, Chart};
use crate::report::{
    self, Context, JsonBody, body_table, json_body, pseudo_inertia_min_eigenvalue, reference_json, words, worst_std,
};
use crate::report_page::{self, Shown};
use std::fmt::Write as _;
use tumble_dynamics::nalgebra::{SMatrix, Vector6};
use tumble_identification::harmonics::{
    HarmonicCandidate, HarmonicEstimator, HarmonicIdentification, HarmonicSettings, HarmonicWarning,
};
use tumble_identification::{BodyScale, Estimate, NodeResidual, NullDirection};
use tumble_lie::Wrench;

/// The name of an estimator on the command line and in JSON.
pub fn estimator_name(estimator: HarmonicEstimator) -> &'static str {
    match estimator {
        HarmonicEstimator::LeastSquares => "fourier",
        HarmonicEstimator::Likelihood => "fourier-likelihood",
        HarmonicEstimator::TrajectoryLikelihood => "maximum-likelihood",
        _ => "other",
    }
}

/// All warnings in one list.
pub fn warnings(found: &HarmonicIdentification, context: &Context) -> Vec<String> {
    // A single sample closes the last cycle.
    let closing = |warning: &&HarmonicWarning| **warning == HarmonicWarning::Remainder { samples: 1 };
    let own = found.warnings.iter().filter(|warning| !closing(warning)).map(ToString::to_string);
    let of_trajectory = found.trajectory.iter().flat_map(|found| &found.warnings).map(ToString::to_string);
    context.reader_warnings.iter().cloned().chain(own).chain(of_trajectory).collect()
}

/// Samples behind the estimate.
fn samples_used(found: &HarmonicIdentification, samples: usize) -> usize {
    match found.estimator {
        HarmonicEstimator::TrajectoryLikelihood => samples,
        _ => found.cycles_used * found.record.samples(),
    }
}

/// Of the ten parameters in like units, as their covariance has it; infinite where that is not positive definite.
fn condition_number(estimate: &Estimate) -> f64 {
    let Ok(scale) = BodyScale::of(&estimate.parameters.to_vector()) else { return f64::INFINITY };
    let inverse = SMatrix::<f64, 10, 10>::from_diagonal(&scale.parameter_magnitudes().map(|size| 1.0 / size));
    let squares = (inverse * estimate.covariance * inverse).symmetric_eigenvalues();
    if squares.min() > 0.0 { (squares.max() / squares.min()).sqrt() } else { f64::INFINITY }
}

/// The readable table with one sigma, harmonics and a verdict; `samples` are those of the log.
pub fn table(found: &HarmonicIdentification, settings: &HarmonicSettings, context: &Context, samples: usize) -> String {
    let mut text = String::new();
    let noise = &found.noise;
    let used = samples_used(found, samples);
    let _ = writeln!(
        text,
        "{}\n  method {}, wrench {}; {used} samples used, {} rejected; {:.1} s",
        context.source,
        estimator_name(found.estimator),
        settings.wrench_timing.name(),
        samples - used,
        context.duration_s,
    );
    let _ = writeln!(
        text,
        "  {} cycles of {} s averaged, the first {} left out; {} harmonics; at a limit of the actuators for {:.1} % of the time",
        found.cycles_used,
        settings.period_s,
        found.cycles_dropped,
        found.harmonics(),
        100.0 * found.saturation
    );
    let _ = writeln!(
        text,
        "  noise of one sample {:.1e} m, {:.1e} rad, {:.1e} N m, {:.1e} N\n",
        noise.position_m, noise.attitude_rad, noise.torque_n_m, noise.force_n
    );
    text += &body_table(&found.estimate, &[true; 10], context);
    let criteria = || found.selection.iter().filter_map(|candidate| candidate.information_criterion);
    let least = criteria().fold(f64::INFINITY, f64::min);
    let _ = writeln!(
        text,
        "  {:<12}{:>22}{:>20}{:>24}",
        "harmonics", "wrench residual/noise", "power residual, W", "criterion above least"
    );
    for candidate in &found.selection {
        let chosen = if candidate.harmonics == found.harmonics() { "  chosen" } else { "" };
        let above = candidate.information_criterion.map_or("-".to_owned(), |value| format!("{:.1}", value - least));
        let _ = writeln!(
            text,
            "  {:<12}{:>22.4}{:>20.3e}{above:>24}{chosen}",
            candidate.harmonics, candidate.normalised_residual, candidate.power_residual_w
        );
    }
    text.push('\n');
    text + &verdict(found)
}

fn verdict(found: &HarmonicIdentification) -> String {
    let (share, name) = worst_std(&found.estimate);
    let identified = report::identified(condition_number(&found.estimate), (share, name));
    let mut text = format!("verdict: {}\n", report::said(found.verdict, identified, name));
    let constraint = if found.estimate.lmi_active { ", the consistency constraint is active" } else { "" };
    let _ = writeln!(
        text,
        "  the body explains {:.3} % of the wrench\n  \
         physically consistent: smallest pseudo-inertia eigenvalue {:.3e}{constraint}",
        100.0 * found.explained,
        pseudo_inertia_min_eigenvalue(&found.estimate.parameters)
    );
    text
}

/// The object that `--json` prints: the keys of every method, and `fourier`.
pub fn json(
    found: &HarmonicIdentification,
    settings: &HarmonicSettings,
    context: &Context,
    samples: usize,
) -> serde_json::Value {
    let used = samples_used(found, samples);
    let selection: Vec<serde_json::Value> = found
        .selection
        .iter()
        .map(|candidate| {
            serde_json::json!({
                "harmonics": candidate.harmonics,
                "normalised_residual": candidate.normalised_residual,
                "power_residual_w": candidate.power_residual_w,
                "information_criterion": candidate.information_criterion,
            })
        })
        .collect();
    let mut all = serde_json::json!({
        "format": 1,
        "method": estimator_name(found.estimator),
        "wrench_timing": settings.wrench_timing.name(),
        "samples_used": used,
        "samples_rejected": samples - used,
        "identified": found.verdict.is_identified(),
        "doubt": report::doubted(found.verdict),
        "rank": 10,
        "condition_number": condition_number(&found.estimate),
        "null_directions": [],
        "regularised": null,
        "explained": found.explained,
        "noise": {
            "torque_n_m": found.noise.torque_n_m,
            "force_n": found.noise.force_n,
            "position_m": found.noise.position_m,
            "attitude_rad": found.noise.attitude_rad,
            "rate_rad_s": null,
            "velocity_m_s": null,
            "acceleration_m_s2": null,
        },
        "delay_s": null,
        "calibration": [],
        "fourier": {
            "period_s": settings.period_s,
            "harmonics": found.harmonics(),
            "cycles_used": found.cycles_used,
            "cycles_dropped": found.cycles_dropped,
            "saturation": found.saturation,
            "selection": selection,
        },
        "warnings": warnings(found, context),
    });
    add(&mut all, serde_json::to_value(json_body(&found.estimate, &report::Shown::ALL)).unwrap_or_default());
    if let Some(reference) = reference_json(&found.estimate, &[true; 10], context) {
        all["reference"] = serde_json::to_value(reference).unwrap_or_default();
    }
    all
}

/// Adds the keys of one object to another.
fn add(all: &mut serde_json::Value, more: serde_json::Value) {
    if let (Some(all), serde_json::Value::Object(more)) = (all.as_object_mut(), more) {
        all.extend(more);
    }
}

/// The object of a motion that does not show the body: what `--json` prints beside exit code 3.
pub fn unidentified_json(
    settings: &HarmonicSettings,
    samples: usize,
    rank: usize,
    null_directions: &[NullDirection],
    reader_warnings: &[String],
) -> serde_json::Value {
    let mut all = serde_json::json!({
        "format": 1,
        "method": estimator_name(settings.estimator),
        "wrench_timing": settings.wrench_timing.name(),
        "samples_used": 0,
        "samples_rejected": samples,
        "identified": false,
        "doubt": null,
        "rank": rank,
        "condition_number": null,
        "null_directions": words(null_directions),
        "regularised": null,
        "explained": null,
        "noise": null,
        "delay_s": null,
        "calibration": [],
        "warnings": reader_warnings,
    });
    add(&mut all, serde_json::to_value(JsonBody::default()).unwrap_or_default());
    all
}

/// Writes the page, and the charts that are files too.
///
/// # Errors
/// [`TumbleError`] when a file cannot be written.
pub fn write_page(
    folder: &OutputFolder,
    found: &HarmonicIdentification,
    context: &Context,
    samples: usize,
    table: &str,
    json: &str,
) -> Result<(), TumbleError> {
    let curve = |name: &'static str, pick: &dyn Fn(&HarmonicCandidate) -> f64| -> (_, Vec<[f64; 2]>) {
        let least = found.selection.iter().map(pick).fold(f64::INFINITY, f64::min).max(f64::MIN_POSITIVE);
        (name, found.selection.iter().map(|candidate| [candidate.harmonics as f64, pick(candidate) / least]).collect())
    };
    let curves = [curve("wrench", &|of| of.normalised_residual), curve("power", &|of| of.power_residual_w)];
    let selection =
        Chart::of_curves("harmonics", "Residual over its least", "", Axis::named("number of harmonics", ""), curves);
    let residuals = residuals(found);
    let said = verdict(found);
    let first = said.lines().next().unwrap_or_default().trim_start_matches("verdict: ");
    let shown = Shown {
        tone: report::tone(found.verdict),
        verdict: first.to_owned(),
        method: estimator_name(found.estimator),
        samples: samples_used(found, samples),
        body: Some((&found.estimate, vec![true; 10])),
        explained: Some(found.explained),
        applied: found
            .record
            .times_s()
            .iter()
            .enumerate()
            .map(|(i, _)| Some(wrench(&found.record.wrench(i))))
            .collect(),
        residuals: &residuals,
        open: Vec::new(),
        warnings: warnings(found, context),
        more: vec![selection],
        trial: None,
    };
    report_page::write(folder, shown, context, table, json)
}

/// `[torque; force]` as a wrench.
fn wrench(stacked: &Vector6<f64>) -> Wrench<f64> {
    Wrench::new(stacked.fixed_rows::<3>(0).into_owned(), stacked.fixed_rows::<3>(3).into_owned())
}

/// What the body leaves unexplained of the averaged wrench, sample by sample of one period.
fn residuals(found: &HarmonicIdentification) -> Vec<NodeResidual> {
    let (record, parameters) = (&found.record, found.estimate.parameters.to_vector());
    let residual = |(i, time_s): (usize, f64)| {
        let mut instant = found.motion.at(time_s + record.wrench_offset_s)?;
        // Gravity is no part of the logged wrench.
        instant.acceleration_origin_world -= record.gravity;
        let left = instant.regressor() * parameters - record.wrench(i);
        Some(NodeResidual {
            time_ns: nanoseconds(time_s),
            torque: left.fixed_rows::<3>(0).into_owned(),
            force: left.fixed_rows::<3>(3).into_owned(),
        })
    };
    record.times_s().into_iter().enumerate().filter_map(residual).collect()
}
