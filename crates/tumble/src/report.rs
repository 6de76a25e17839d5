//! A result as people and programs read it: table, JSON, residual plots, one offline page.

use crate::TumbleError;
use crate::output::OutputFolder;
use crate::page::Tone;
pub use crate::quantities::Context;
use crate::quantities::{quantities, relative_std};
use crate::report_page::{self, Trial};
use serde::Serialize;
use std::fmt::Write as _;
use tumble_dynamics::nalgebra::{Matrix3, Vector3};
use tumble_dynamics::{InertialParameters, PARAMETER_NAMES, PARAMETER_UNITS};
use tumble_formats::body_file::BodyFile;
use tumble_formats::log::seconds;
use tumble_identification::estimator::{Verdict, Why};
use tumble_identification::{
    Difference, Estimate, FoundFactor, FoundThrusters, Identification, MAXIMUM_LIKELIHOOD, NuisanceEstimate,
    NullDirection, PartChange, Prediction, StandardDeviations, WEAK_FORM,
};
use tumble_lie::Wrench;

/// Where each entry of the inertia about the centre of mass stands among the ten numbers that people compare.
const INERTIA_PLACES: [[usize; 3]; 3] = [[4, 7, 8], [7, 5, 9], [8, 9, 6]];

/// `value` and `std` with two significant digits of the standard deviation.
fn with_digits_of(value: f64, std: f64) -> (String, String) {
    if !(std.is_finite() && std > 0.0) {
        return (format!("{value:.6}"), "-".to_owned());
    }
    #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)]
    let decimals = (1.0 - std.log10().floor()).clamp(0.0, 12.0) as usize;
    (format!("{value:.decimals$}"), format!("{std:.decimals$}"))
}

/// All warnings in one list.
pub fn warnings(found: &Identification, context: &Context) -> Vec<String> {
    let exchanges = found.exchanges.iter().map(ToString::to_string);
    let suspects = Actuated::of(found, context).into_iter().flat_map(|actuated| actuated.accused());
    let own = found.warnings.iter().map(ToString::to_string).chain(exchanges).chain(suspects);
    context.reader_warnings.iter().cloned().chain(own).collect()
}

/// The readable table with one-sigma and a verdict.
pub fn table(found: &Identification, context: &Context) -> String {
    let mut text = String::new();
    let _ = writeln!(text, "{}", context.source);
    let _ = writeln!(
        text,
        "  method {}, wrench {}, {} {}; {} samples used, {} rejected; {:.4} s steps, {:.1} s",
        found.method,
        found.wrench_timing.name(),
        if found.method == MAXIMUM_LIKELIHOOD { "samples in a segment" } else { "lag" },
        found.lag,
        found.samples_used,
        found.samples_rejected,
        found.step_s,
        context.duration_s,
    );
    let noise = &found.noise;
    let _ = match found.method {
        WEAK_FORM => writeln!(
            text,
            "  sigmas by the scatter of windows: no level of noise describes what acts beside the wrench\n"
        ),
        _ => writeln!(
            text,
            "  residual like wrench noise of {:.1e} N m, {:.1e} N per sample; pose noise about {:.1e} m, {:.1e} rad\n",
            noise.torque_n_m, noise.force_n, noise.position_m, noise.attitude_rad
        ),
    };
    match (&found.estimate, &found.regularised) {
        (Some(estimate), _) => text += &body_table(estimate, &found.determined(), context),
        (None, Some(completed)) => text += &body_table(completed, &found.determined(), context),
        (None, None) => {}
    }
    if let Some(actuated) = Actuated::of(found, context) {
        text += &actuated.table();
    }
    text += &calibration_table(&found.calibration);
    let _ = write!(text, "{}", verdict(found, context));
    text
}

/// What was found of the actuators, by their columns.
struct Actuated<'a> {
    columns: &'a [String],
    found: &'a FoundThrusters,
    /// From command to what the sensors say, s, and one standard deviation.
    delay_s: Option<[f64; 2]>,
}

impl<'a> Actuated<'a> {
    fn of(found: &'a Identification, context: &Context<'a>) -> Option<Self> {
        let file = context.actuators?;
        let told_s = file.actuators.common.delay_s;
        let delay_s = found.age.map(|age| [told_s + age.value_s, age.std_s]);
        Some(Self { columns: &file.columns, found: found.thrusters.as_ref()?, delay_s })
    }

    /// Column, scale, one standard deviation, by how many of them it is off without its prior.
    fn each(&self) -> impl Iterator<Item = (&'a str, f64, f64, f64)> {
        let found = self.found;
        let numbers = found.scale.iter().zip(&found.std).zip(&found.deviations);
        self.columns.iter().zip(numbers).map(|(name, ((scale, std), off))| (name.as_str(), *scale, *std, *off))
    }

    fn suspects(&self) -> Vec<&'a str> {
        let name = |index: &usize| self.columns.get(*index).map(String::as_str);
        self.found.suspects.iter().filter_map(name).collect()
    }

    /// What a reader must know of those that are far off.
    fn accused(&self) -> Vec<String> {
        let suspects = self.suspects();
        let sentence = |((name, scale, std, _), constant): ((&str, f64, f64, f64), &Option<FoundFactor>)| {
            let (scale, std) = with_digits_of(scale, std);
            let open = constant.map_or_else(String::new, |constant| {
                let (value, std) = with_digits_of(constant.value, constant.std);
                format!("{value} +- {std} N whatever it is told, and beside that ")
            });
            format!(
                "the thruster of `{name}` gives {open}{scale} +- {std} of its thrust: it was freed, and the body is the one without its prior"
            )
        };
        let all = self.each().zip(&self.found.constant_n);
        all.filter(|((name, ..), _)| suspects.contains(name)).map(sentence).collect()
    }

    fn table(&self) -> String {
        let mut text = String::new();
        let suspects = self.suspects();
        let _ = writeln!(text, "  {:<18}{:>16}{:>14}", "actuator", "scale", "1 sigma");
        for (name, scale, std, _) in self.each() {
            if std > 0.0 {
                let (scale, std) = with_digits_of(scale, std);
                let word = if suspects.contains(&name) { "  suspect" } else { "" };
                let _ = writeln!(text, "  {name:<18}{scale:>16}{std:>14}{word}");
            } else {
                let _ = writeln!(text, "  {name:<18}{scale:>16.6}{:>14}", "-");
            }
        }
        for (name, constant) in self.columns.iter().zip(&self.found.constant_n) {
            if let Some(constant) = constant {
                let (value, std) = with_digits_of(constant.value, constant.std);
                let _ = writeln!(text, "  {:<18}{value:>16}{std:>14}  N", format!("{name} constant"));
            }
        }
        let shared = [("all alike", self.found.common), ("sag per further", self.found.sag)];
        for (name, found) in shared {
            if let Some(found) = found {
                let (value, std) = with_digits_of(found.value, found.std);
                let _ = writeln!(text, "  {name:<18}{value:>16}{std:>14}");
            }
        }
        if let Some([delay_s, std_s]) = self.delay_s {
            let (delay, std) = with_digits_of(delay_s, std_s);
            let _ = writeln!(text, "  {:<18}{delay:>16}{std:>14}  s", "delay");
        }
        text.push('\n');
        text
    }

    fn json(&self) -> JsonActuators {
        let shared = |found: Option<FoundFactor>| found.map(|found| JsonFound { value: found.value, std: found.std });
        let one = |((column, scale, std, deviations), constant): ((&str, f64, f64, f64), &Option<FoundFactor>)| {
            JsonActuator {
                column: column.to_owned(),
                scale: (std > 0.0).then_some(scale),
                std: (std > 0.0).then_some(std),
                deviations: (std > 0.0).then_some(deviations),
                constant_n: shared(*constant),
            }
        };
        JsonActuators {
            thrusters: self.each().zip(&self.found.constant_n).map(one).collect(),
            common_scale: shared(self.found.common),
            sag: shared(self.found.sag),
            delay_s: self.delay_s.map(|[value, std]| JsonFound { value, std }),
            suspects: self.suspects().into_iter().map(str::to_owned).collect(),
        }
    }
}

/// What was found of the actuators; `null` where a thruster was never commanded.
#[derive(Serialize)]
struct JsonActuators {
    thrusters: Vec<JsonActuator>,
    common_scale: Option<JsonFound>,
    sag: Option<JsonFound>,
    delay_s: Option<JsonFound>,
    suspects: Vec<String>,
}

#[derive(Serialize)]
struct JsonActuator {
    column: String,
    scale: Option<f64>,
    std: Option<f64>,
    deviations: Option<f64>,
    #[serde(skip_serializing_if = "Option::is_none")]
    constant_n: Option<JsonFound>,
}

#[derive(Serialize)]
struct JsonFound {
    value: f64,
    std: f64,
}

fn calibration_table(calibration: &[NuisanceEstimate]) -> String {
    let mut text = String::new();
    for found in calibration {
        let name = found.nuisance.to_string();
        let (value, std) = match (found.value, found.std) {
            (Some(value), Some(std)) => with_digits_of(value, std),
            _ => ("-".to_owned(), "-".to_owned()),
        };
        let unit = found.nuisance.unit();
        let _ = writeln!(text, "  {name:<26}{value:>14}{std:>14}  {unit:<7}{}", found.verdict);
    }
    if !text.is_empty() {
        text.push('\n');
    }
    text
}

pub(crate) fn body_table(estimate: &Estimate, determined: &[bool], context: &Context) -> String {
    let mut text = String::new();
    let reference = context.reference.as_ref().map(|(name, body)| (name, quantities(body, &estimate.std)));
    let _ = write!(text, "  {:<18}{:>16}{:>14}  {:<7}", "quantity", "estimate", "1 sigma", "unit");
    if let Some((name, _)) = &reference {
        let _ = write!(text, "{name:>14}{:>12}{:>14}", "error", "error/sigma");
    }
    let _ = writeln!(text);
    for (i, q) in quantities(&estimate.parameters, &estimate.std).iter().enumerate() {
        if !determined[i] {
            let _ = writeln!(text, "  {:<18}{:>16}{:>14}  {:<7}", q.name, "not determined", "-", q.unit);
            continue;
        }
        let (value, std) = with_digits_of(q.value, q.std);
        let _ = write!(text, "  {:<18}{value:>16}{std:>14}  {:<7}", q.name, q.unit);
        if let Some((_, truth)) = &reference {
            let error = q.value - truth[i].value;
            let (truth, _) = with_digits_of(truth[i].value, q.std);
            let _ = write!(text, "{truth:>14}{error:>12.2e}{:>14.2}", error / q.std);
        }
        let _ = writeln!(text);
    }
    let _ = writeln!(
        text,
        "  inertia about the centre of mass, body axes; off-diagonals are minus the products of inertia\n"
    );
    text
}

/// The quantity known worst, relative to the body's own scale.
pub(crate) fn worst_std(estimate: &Estimate) -> (f64, &'static str) {
    quantities(&estimate.parameters, &estimate.std)
        .into_iter()
        .map(|q| (relative_std(&estimate.parameters, &q), q.name))
        .fold((0.0, ""), |a, b| if b.0 > a.0 || b.0.is_nan() { b } else { a })
}

/// A verdict on numbers that are shown, in words; `identified` where nothing speaks against them, `widest` names the quantity known worst.
pub(crate) fn said(verdict: Verdict, identified: String, widest: &str) -> String {
    match verdict {
        Verdict::Identified => identified,
        Verdict::NoBodyExplains { .. } => "no body explains this log; do not use the numbers above".to_owned(),
        Verdict::Doubtful(why) => format!("not identified; {}", doubt(why, widest)),
        Verdict::NotDetermined { rank, asked } => not_determined(rank, asked),
        _ => "not identified".to_owned(),
    }
}

/// What is said of ten parameters that are identified, `worst` being the quantity known worst and how well.
pub(crate) fn identified(condition_number: f64, (share, name): (f64, &str)) -> String {
    format!(
        "all ten parameters identified (condition number {condition_number:.0}); weakest: {name} to {:.2} % of the body's scale",
        100.0 * share
    )
}

/// What is said of a log that leaves directions free.
pub(crate) fn not_determined(rank: usize, asked: usize) -> String {
    format!("this log does not determine the body: {rank} of {asked} parameter directions")
}

/// How a page shows a verdict.
pub(crate) fn tone(verdict: Verdict) -> Tone {
    match verdict {
        Verdict::Identified => Tone::Good,
        Verdict::NoBodyExplains { .. } => Tone::Bad,
        _ => Tone::Doubted,
    }
}

/// Why numbers may not be used, as `--json` says it; `None` where they may, or where the log does not determine them.
pub(crate) fn doubted(verdict: Verdict) -> Option<String> {
    match verdict {
        Verdict::Doubtful(why) => Some(doubt(why, "a quantity")),
        Verdict::NoBodyExplains { .. } => Some("no body explains this log".to_owned()),
        _ => None,
    }
}

/// What speaks against numbers, in words; `widest` names the quantity known worst.
fn doubt(why: Why, widest: &str) -> String {
    match why {
        Why::Diverged { .. } => "the filter asked for diverged, the numbers above are a regression's".to_owned(),
        Why::Biased { .. } | Why::Wandering { .. } | Why::StandIn => {
            "the numbers above are an answer with an error beyond the sigma of its noise (see the warnings): \
             record a stronger excitation, or try `--method maximum-likelihood --estimate delay,actuator-lag`"
                .to_owned()
        }
        Why::Exchangeable => {
            "what was asked for beside the body is exchangeable with it (see the warnings): ask for less".to_owned()
        }
        Why::Wide { .. } => format!("{widest} is not known to better than the body's own scale"),
        Why::Surprised { mean_nis } => {
            format!(
                "what the answer leaves of its observations is {mean_nis:.2} times what their noise allows on average"
            )
        }
        Why::Alone { rank } => format!("another way to the same parameters sees {rank} of 10 directions only"),
        Why::Disagrees { chi_square } => {
            format!("another way to the same parameters comes to others, {:.1} sigma apart", chi_square.sqrt())
        }
        Why::Feedback { share } => format!(
            "{:.0} % of the wrench answers to the noise of the measurements, and the numbers above follow that noise",
            100.0 * share
        ),
        Why::Held { relative } => format!(
            "a controller holds the body so still that little shows ({:.0} % of the body's scale), and what the controller knows beside the log \
             biases that: log the velocities that it is told, or fly an excitation",
            100.0 * relative
        ),
        Why::NoBody { .. } => "the numbers above are no body".to_owned(),
        _ => "the judge has a doubt that this program has no words for".to_owned(),
    }
}

pub(crate) fn verdict(found: &Identification, context: &Context) -> String {
    let mut text = String::new();
    if let Some(estimate) = &found.estimate {
        let margin = pseudo_inertia_min_eigenvalue(&estimate.parameters);
        let worst = worst_std(estimate);
        let said = match found.verdict {
            Verdict::NotDetermined { .. } => "not identified by the data alone".to_owned(),
            verdict => said(verdict, identified(found.condition_number, worst), worst.1),
        };
        let _ = writeln!(text, "verdict: {said}");
        if let Some(share) = found.explained {
            let _ = writeln!(text, "  the body explains {:.3} % of the wrench", 100.0 * share);
        }
        if found.rank < 10 {
            let _ = writeln!(text, "  with the prior's help: the data alone determine {} of 10 directions", found.rank);
        }
        let constraint = if estimate.lmi_active { ", the consistency constraint is active" } else { "" };
        let _ = writeln!(text, "  physically consistent: smallest pseudo-inertia eigenvalue {margin:.3e}{constraint}");
    } else if let Verdict::NoBodyExplains { .. } = found.verdict {
        let _ = writeln!(text, "verdict: no body explains this log; see the warnings");
    } else if found.is_on_table() && found.verdict.is_identified() {
        let said = "mass, centre of mass in the plane and inertia about its normal identified";
        let _ = writeln!(text, "verdict: {said}; a table shows no more");
        if let Some(share) = found.explained {
            let _ = writeln!(text, "  the body explains {:.3} % of the wrench in the plane", 100.0 * share);
        }
    } else if let (true, Verdict::Doubtful(why)) = (found.is_on_table(), found.verdict) {
        let said = match found.regularised {
            Some(_) if why == Why::StandIn => "on a table what acts beside the wrench comes and goes with the places that the robot visits, and nothing in so short a log \
                 confirms the numbers above: record a minute or more"
                .to_owned(),
            Some(_) => doubt(why, "a quantity"),
            None => "the likelihood of a body on a table did not settle on this log".to_owned(),
        };
        let _ = writeln!(text, "verdict: not identified; {said}");
    } else if let (Some(_), Verdict::Doubtful(Why::StandIn)) = (context.actuators, found.verdict) {
        let said = "these thrusters do not explain the motion, nor do they with any one of them dead or stuck";
        let _ = writeln!(text, "verdict: not identified; {said}: the likelihood did not settle");
    } else {
        let _ = writeln!(text, "verdict: {}", not_determined(found.rank, 10));
        for direction in &found.null_directions {
            let _ = writeln!(text, "  not determined: {direction}");
        }
        if let Some(completed) = &found.regularised {
            let _ = writeln!(
                text,
                "  completed by a weak physical prior (not knowledge from this log): mass {:.3} kg; --json prints all of it",
                completed.parameters.mass
            );
        }
    }
    if let Some(v) = &context.validation {
        let _ = match &v.wrench {
            Some(left) => writeln!(
                text,
                "  held-out part: {} nodes, residual {:.2e} N m, {:.2e} N; {:.2} times what noise and covariance predict; {:.2} % of the wrench explained",
                v.nodes,
                left.torque_rms_n_m,
                left.force_rms_n,
                v.normalised_rms,
                100.0 * left.explained
            ),
            None => writeln!(
                text,
                "  held-out part: {} samples, whose own body is {:.2} times as far away as both covariances predict",
                v.nodes, v.normalised_rms
            ),
        };
    }
    text
}

pub(crate) fn words(directions: &[NullDirection]) -> Vec<String> {
    directions.iter().map(ToString::to_string).collect()
}

/// One sigma of each quantity, a column for each account of it with its heading; what is not determined stands so.
pub fn sigma_table(columns: &[(&str, &StandardDeviations)]) -> String {
    let unit_body = InertialParameters::about_com(1.0, Vector3::zeros(), Matrix3::identity());
    let widths: Vec<usize> = columns.iter().map(|(heading, _)| 14.max(heading.len() + 2)).collect();
    let mut text = format!("  {:<18}", "quantity");
    for ((heading, _), width) in columns.iter().zip(&widths) {
        let _ = write!(text, "{heading:>width$}");
    }
    text.push('\n');
    let columns: Vec<_> = columns.iter().map(|(_, std)| quantities(&unit_body, std)).collect();
    for (row, quantity) in columns.first().into_iter().flatten().enumerate() {
        let _ = write!(text, "  {:<18}", quantity.name);
        let mut unit = "";
        for (column, width) in columns.iter().zip(&widths) {
            let std = column[row].std;
            let _ = if std.is_finite() {
                unit = quantity.unit;
                write!(text, "{std:>width$.2e}")
            } else {
                write!(text, "{:>width$}", "not determined")
            };
        }
        let _ = writeln!(text, " {unit}");
    }
    text
}

/// One sigma of each quantity as `--json` has it; `null` for what is not determined.
pub fn sigma_json(std: &StandardDeviations) -> serde_json::Value {
    // A structure of numbers always has a JSON form.
    serde_json::to_value(json_std(std, &Shown::ALL)).unwrap_or_default()
}

/// One sigma of each quantity, infinite where the log does not determine it.
fn promised(found: &Identification) -> Option<StandardDeviations> {
    let body = found.estimate.as_ref().or(found.regularised.as_ref())?;
    let determined = found.determined();
    let known = |place: usize, sigma: f64| if determined[place] { sigma } else { f64::INFINITY };
    let std = &body.std;
    Some(StandardDeviations {
        mass_kg: known(0, std.mass_kg),
        center_of_mass_m: Vector3::from_fn(|i, _| known(1 + i, std.center_of_mass_m[i])),
        inertia_about_com_kg_m2: Matrix3::from_fn(|i, j| {
            known(INERTIA_PLACES[i][j], std.inertia_about_com_kg_m2[(i, j)])
        }),
    })
}

/// What `--dry-run` prints of a log with wrenches.
pub fn promise_table(found: &Identification, context: &Context) -> String {
    let mut text = format!("{}: what this log can answer\n", context.source);
    let _ = writeln!(
        text,
        "  by the model of `--method {}`, with the errors of sensors and wrench that this log shows; rank {} of 10:\n",
        found.method, found.rank
    );
    match (promised(found), found.verdict) {
        (None, _) | (_, Verdict::NoBodyExplains { .. }) => {
            text += "verdict: nothing can be promised, no body explains this log; see the warnings\n";
            return text;
        }
        (Some(std), _) => text += &sigma_table(&[("1 sigma", &std)]),
    }
    text.push('\n');
    text + &verdict(found, context)
}

/// The object that `--dry-run --json` prints of a log with wrenches.
pub fn promise_json(found: &Identification) -> serde_json::Value {
    let promised = promised(found).filter(|_| !matches!(found.verdict, Verdict::NoBodyExplains { .. }));
    serde_json::json!({
        "format": 1,
        "method": found.method,
        "rank": found.rank,
        "condition_number": Some(found.condition_number).filter(|c| c.is_finite()),
        "null_directions": words(&found.null_directions),
        "std": promised.map(|std| json_std(&std, &Shown(&found.determined()))),
        "identified": found.verdict.is_identified(),
    })
}

/// What `--dry-run` prints of a motion.
pub fn prediction_table(prediction: &Prediction, source: &str, wrench_noise: (f64, f64)) -> String {
    let mut text = String::new();
    let _ = writeln!(text, "{source}: what this log can answer");
    let _ = writeln!(
        text,
        "  {} equations at lag {}, rank {} of 10, condition number {:.1}; noise of the poses {:.1e} m, {:.1e} rad, which makes up to {:.1} % of a \
         direction; of the wrench {:.1e} N m, {:.1e} N per sample:\n",
        prediction.rows,
        prediction.lag,
        prediction.rank,
        prediction.condition_number,
        prediction.noise.position_m,
        prediction.noise.attitude_rad,
        100.0 * prediction.noise_share,
        wrench_noise.0,
        wrench_noise.1
    );
    if let Some(std) = &prediction.std {
        text += &sigma_table(&[("1 sigma", std)]);
        text.push('\n');
    }
    if let (None, Some(covariance)) = (&prediction.std, &prediction.covariance) {
        let _ = writeln!(
            text,
            "  {:<18}{:>14}   (no wrench and no prior: the body's size is not known)",
            "parameter", "1 sigma"
        );
        for i in 0..10 {
            let _ = writeln!(
                text,
                "  {:<18}{:>14.2e} {}",
                PARAMETER_NAMES[i],
                covariance[(i, i)].sqrt(),
                PARAMETER_UNITS[i]
            );
        }
        text.push('\n');
    }
    if prediction.rank == 10 {
        let _ = writeln!(
            text,
            "verdict: the motion of this log can determine all ten parameters, if it is motion: that a localisation wanders shows beside wrenches only"
        );
    } else if prediction.planar {
        let can = "mass, centre of mass in the plane and inertia about its normal";
        let _ = writeln!(text, "verdict: the motion stays in the xy plane: it can determine {can} at most");
    } else {
        let _ = writeln!(text, "verdict: this log cannot determine the body");
        for direction in &prediction.null_directions {
            let _ = writeln!(text, "  not determined: {direction}");
        }
    }
    text
}

/// The object that `--dry-run --json` prints.
pub fn prediction_json(prediction: &Prediction, wrench_noise: (f64, f64)) -> String {
    serde_json::json!({
        "format": 1,
        "rows": prediction.rows,
        "rank": prediction.rank,
        "condition_number": Some(prediction.condition_number).filter(|c| c.is_finite()),
        "null_directions": words(&prediction.null_directions),
        "noise": { "position_m": prediction.noise.position_m, "attitude_rad": prediction.noise.attitude_rad },
        "assumed_noise": { "torque_n_m": wrench_noise.0, "force_n": wrench_noise.1 },
        "planar": prediction.planar,
        "std": prediction.std.as_ref().map(|std| json_std(std, &Shown::ALL)),
        "parameter_std": prediction.covariance.map(|covariance| covariance.diagonal().map(f64::sqrt).as_slice().to_vec()),
    })
    .to_string()
}

fn json_std(std: &StandardDeviations, shown: &Shown) -> JsonStd {
    JsonStd {
        mass_kg: shown.mass(std.mass_kg),
        com_m: shown.com(&std.center_of_mass_m),
        inertia_about_com_kg_m2: shown.inertia(&std.inertia_about_com_kg_m2),
    }
}

/// Smallest eigenvalue of the pseudo-inertia, mixed units (kg m^2, kg m, kg) as the thesis has it.
pub(crate) fn pseudo_inertia_min_eigenvalue(body: &InertialParameters<f64>) -> f64 {
    tumble_dynamics::pseudo_inertia(body).symmetric_eigenvalues().min()
}

/// The object that `--json` prints; `docs/identify-json.md` describes it.
#[derive(Serialize)]
pub struct Json {
    format: u32,
    method: &'static str,
    wrench_timing: &'static str,
    samples_used: usize,
    samples_rejected: usize,
    identified: bool,
    doubt: Option<String>,
    #[serde(flatten)]
    body: Option<JsonBody>,
    rank: usize,
    condition_number: Option<f64>,
    null_directions: Vec<String>,
    #[serde(skip_serializing_if = "std::ops::Not::not")]
    planar: bool,
    regularised: Option<JsonBody>,
    explained: Option<f64>,
    noise: JsonNoise,
    delay_s: Option<f64>,
    calibration: Vec<JsonCalibration>,
    #[serde(skip_serializing_if = "Option::is_none")]
    actuators: Option<JsonActuators>,
    #[serde(skip_serializing_if = "Option::is_none")]
    reference: Option<JsonReference>,
    #[serde(skip_serializing_if = "Option::is_none")]
    holdout: Option<JsonHoldout>,
    warnings: Vec<String>,
}

type NumberRows = [[Option<f64>; 3]; 3];

/// A body; numbers that the data do not determine are `null`.
#[derive(Serialize, Default)]
pub(crate) struct JsonBody {
    mass_kg: Option<f64>,
    com_m: [Option<f64>; 3],
    inertia_about_com_kg_m2: NumberRows,
    inertia_about_origin_kg_m2: NumberRows,
    std: JsonStd,
    pseudo_inertia_min_eigenvalue: Option<f64>,
    lmi_active: bool,
}

#[derive(Serialize, Default)]
struct JsonStd {
    mass_kg: Option<f64>,
    com_m: [Option<f64>; 3],
    inertia_about_com_kg_m2: NumberRows,
}

#[derive(Serialize)]
struct JsonNoise {
    torque_n_m: f64,
    force_n: f64,
    position_m: f64,
    attitude_rad: f64,
    rate_rad_s: Option<f64>,
    velocity_m_s: Option<f64>,
    acceleration_m_s2: Option<f64>,
}

#[derive(Serialize)]
pub(crate) struct JsonReference {
    name: String,
    body: BodyFile,
    error_over_sigma: Vec<Option<f64>>,
}

#[derive(Serialize)]
struct JsonHoldout {
    nodes: usize,
    torque_rms_n_m: Option<f64>,
    force_rms_n: Option<f64>,
    normalised_rms: f64,
    explained: Option<f64>,
}

/// A noise level is zero where its column was not used.
fn used(noise: f64) -> Option<f64> {
    (noise > 0.0).then_some(noise)
}

#[derive(Serialize)]
struct JsonCalibration {
    quantity: &'static str,
    axis: Option<&'static str>,
    unit: &'static str,
    value: Option<f64>,
    sigma: Option<f64>,
    verdict: String,
}

fn json_calibration(found: &NuisanceEstimate) -> JsonCalibration {
    JsonCalibration {
        quantity: found.nuisance.name(),
        axis: found.nuisance.axis().and_then(|axis| ["x", "y", "z"].get(axis).copied()),
        unit: found.nuisance.unit(),
        value: found.value,
        sigma: found.std,
        verdict: found.verdict.to_string(),
    }
}

/// Which numbers of a body may be shown: mass, centre of mass, inertia entries in the order of [`quantities`].
pub(crate) struct Shown<'a>(&'a [bool]);

impl Shown<'_> {
    pub(crate) const ALL: Shown<'static> = Shown(&[true; 10]);
    fn mass(&self, value: f64) -> Option<f64> {
        Some(value).filter(|_| self.0[0])
    }
    fn com(&self, value: &Vector3<f64>) -> [Option<f64>; 3] {
        std::array::from_fn(|i| Some(value[i]).filter(|_| self.0[1 + i]))
    }
    fn inertia(&self, value: &Matrix3<f64>) -> NumberRows {
        std::array::from_fn(|i| std::array::from_fn(|j| Some(value[(i, j)]).filter(|_| self.0[INERTIA_PLACES[i][j]])))
    }
    fn all(&self) -> bool {
        self.0.iter().all(|shown| *shown)
    }
}

pub(crate) fn json_body(estimate: &Estimate, shown: &Shown) -> JsonBody {
    let body = &estimate.parameters;
    let about_origin = if shown.all() { shown.inertia(&body.inertia_about_origin) } else { NumberRows::default() };
    JsonBody {
        mass_kg: shown.mass(body.mass),
        com_m: shown.com(&body.center_of_mass()),
        inertia_about_com_kg_m2: shown.inertia(&body.inertia_about_com()),
        inertia_about_origin_kg_m2: about_origin,
        std: json_std(&estimate.std, shown),
        pseudo_inertia_min_eigenvalue: Some(pseudo_inertia_min_eigenvalue(body)).filter(|_| shown.all()),
        lmi_active: estimate.lmi_active,
    }
}

/// A difference of two bodies with a positive mass, and whether it was taken.
fn cargo(difference: &Difference) -> (Estimate, bool) {
    let taken = difference.parameters.mass > 0.0;
    let sign = if taken { 1.0 } else { -1.0 };
    let parameters = InertialParameters::from_vector(&(difference.parameters.to_vector() * sign));
    let (covariance, std) = (difference.covariance, difference.std);
    (Estimate { parameters, covariance, std, lmi_active: false }, taken)
}

/// What `--split` prints of a change of the body.
pub fn change_table(change: &PartChange) -> String {
    let [time_s, earliest_s, latest_s] = [change.time_ns, change.earliest_ns, change.latest_ns].map(seconds);
    let mut text = format!("change at {time_s:.2} s, between {earliest_s:.2} and {latest_s:.2} s: ");
    let Some(difference) = &change.difference else {
        return text + "one of the two bodies is not identified\n\n";
    };
    let (cargo, taken) = cargo(difference);
    let _ = writeln!(text, "what the robot {}", if taken { "took" } else { "let go" });
    text + &body_table(&cargo, &difference.determined, &Context::default())
}

/// The same as programs read it.
pub fn change_json(change: &PartChange) -> serde_json::Value {
    let [time_s, earliest_s, latest_s] = [change.time_ns, change.earliest_ns, change.latest_ns].map(seconds);
    let payload = change.difference.as_ref().map(|difference| {
        let (cargo, taken) = cargo(difference);
        let shown = Shown(&difference.determined);
        let body = &cargo.parameters;
        serde_json::json!({
            "taken": taken,
            "mass_kg": shown.mass(body.mass),
            "com_m": shown.com(&body.center_of_mass()),
            "inertia_about_com_kg_m2": shown.inertia(&body.inertia_about_com()),
            "std": json_std(&cargo.std, &shown),
        })
    });
    serde_json::json!({ "time_s": time_s, "earliest_s": earliest_s, "latest_s": latest_s, "payload": payload })
}

/// The body compared with, and the errors in sigmas of what the data determine.
pub(crate) fn reference_json(estimate: &Estimate, determined: &[bool], context: &Context) -> Option<JsonReference> {
    let (name, body) = context.reference.as_ref()?;
    let truth = quantities(body, &estimate.std);
    let found = quantities(&estimate.parameters, &estimate.std);
    let errors = found.iter().zip(&truth).map(|(q, t)| (q.value - t.value) / q.std);
    let error_over_sigma = errors.zip(determined).map(|(error, determined)| determined.then_some(error)).collect();
    Some(JsonReference { name: name.clone(), body: BodyFile::from(*body), error_over_sigma })
}

/// The result as programs read it.
pub fn json(found: &Identification, context: &Context) -> Json {
    Json {
        format: 1,
        method: found.method,
        wrench_timing: found.wrench_timing.name(),
        samples_used: found.samples_used,
        samples_rejected: found.samples_rejected,
        identified: found.verdict.is_identified(),
        doubt: doubted(found.verdict),
        body: match (&found.estimate, &found.regularised) {
            (Some(estimate), _) => Some(json_body(estimate, &Shown(&found.determined()))),
            (None, Some(completed)) => Some(json_body(completed, &Shown(&found.determined()))),
            (None, None) => None,
        },
        rank: found.rank,
        condition_number: Some(found.condition_number).filter(|c| c.is_finite()),
        null_directions: words(&found.null_directions),
        planar: found.is_on_table(),
        regularised: found.regularised.as_ref().map(|body| json_body(body, &Shown::ALL)),
        explained: found.explained,
        noise: JsonNoise {
            torque_n_m: found.noise.torque_n_m,
            force_n: found.noise.force_n,
            position_m: found.noise.position_m,
            attitude_rad: found.noise.attitude_rad,
            rate_rad_s: used(found.noise.rate_rad_s),
            velocity_m_s: used(found.noise.velocity_m_s),
            acceleration_m_s2: used(found.noise.acceleration_m_s2),
        },
        delay_s: found.delay_s,
        actuators: Actuated::of(found, context).map(|actuated| actuated.json()),
        calibration: found.calibration.iter().map(json_calibration).collect(),
        reference: found
            .estimate
            .as_ref()
            .or(found.regularised.as_ref())
            .and_then(|body| reference_json(body, &found.determined(), context)),
        holdout: context.validation.map(|v| JsonHoldout {
            nodes: v.nodes,
            torque_rms_n_m: v.wrench.map(|left| left.torque_rms_n_m),
            force_rms_n: v.wrench.map(|left| left.force_rms_n),
            normalised_rms: v.normalised_rms,
            explained: v.wrench.map(|left| left.explained),
        }),
        warnings: warnings(found, context),
    }
}

/// Writes the page, and the charts that are files too; `applied` is the logged wrench at the residuals' nodes.
///
/// # Errors
/// [`TumbleError`] when a file cannot be written.
pub(crate) fn write_page(
    folder: &OutputFolder,
    found: &Identification,
    context: &Context,
    applied: Vec<Option<Wrench<f64>>>,
    trial: Option<Trial>,
    json_text: &str,
) -> Result<(), TumbleError> {
    let said = verdict(found, context);
    let first = said.lines().next().unwrap_or_default().trim_start_matches("verdict: ");
    let body = found.estimate.as_ref().or(found.regularised.as_ref()).map(|body| (body, found.determined().to_vec()));
    let shown = report_page::Shown {
        tone: tone(found.verdict),
        verdict: first.to_owned(),
        method: found.method,
        samples: found.samples_used,
        body,
        explained: found.explained,
        residuals: &found.residuals,
        applied,
        open: words(&found.null_directions),
        warnings: warnings(found, context),
        more: Vec::new(),
        trial,
    };
    report_page::write(folder, shown, context, &table(found, context), json_text)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn two_digits_of_sigma() {
        assert_eq!(with_digits_of(9.581_234, 0.002_34), ("9.5812".into(), "0.0023".into()));
        assert_eq!(with_digits_of(123.456, 12.0), ("123".into(), "12".into()));
        assert_eq!(with_digits_of(1.0, f64::NAN).1, "-");
    }
}
