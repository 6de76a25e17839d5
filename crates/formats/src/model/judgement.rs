//! What is wrong with the masses of a model, as far as that can be told: what cannot be at all, and what is clearly not what was meant.
//!
//! A link is accused only where no distribution of its mass inside its shapes, taken a quarter larger, can have the inertia written, or
//! where the inertia is to half a percent that of the shapes under another reading and not under the one written. A body whose mass lies
//! inside its shapes is never accused by the first; the second is a coincidence of several numbers.

mod evidence;
mod finding;
mod hypotheses;
mod units;

pub use finding::{Finding, FindingKind, Severity};

use super::links::{Inertial, Model, ModelLink};
use super::solid::Filled;
use evidence::{Evidence, SLACK, excess, spread};
use finding::{digits, digits_of, percent};
use hypotheses::{Hypothesis, hypotheses};
use tumble_dynamics::nalgebra::{Matrix3, SymmetricEigen, Vector3};
use tumble_dynamics::{DynamicsError, InertialParameters};

/// As near as that to filled shapes, relative, a reading must be to explain what cannot be as written.
const NEAR: f64 = 0.3;
/// As near as that it is theirs.
const SAME: f64 = 0.005;
/// As far as that it is not.
const OTHER: f64 = 0.05;
/// A triangle inequality missed by less, relative, is kept: plates and rods are bodies.
const ROUNDING: f64 = 1e-9;
/// What of a tensor is lost when it is taken from the origin to the centre of mass, relative to mass times distance squared.
const LOST: f64 = 1e-14;
/// Least second moment along any axis of a nearest body, relative to the largest principal inertia: simulators refuse the very edge.
const CORE: f64 = 1e-6;

/// Inertia by mass beyond which nothing is compared, m^2: a mass that is as good as none.
const LARGEST_M2: f64 = 1e60;

/// The nearest inertia that a body can have: least sum of the squares of the changes of all nine entries, mass and centre of mass kept.
#[derive(Clone, Debug, PartialEq)]
pub struct NearestBody {
    /// About the centre of mass, axes in which the file writes the tensor, kg m^2.
    pub inertia: Matrix3<f64>,
    /// How much it changes, relative to the tensor written.
    pub change: f64,
}

/// What is to be said of a link.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Verdict {
    /// Whether a body can have the numbers written; `None` where nothing is written.
    pub physical: Option<bool>,
    /// Where none can.
    pub nearest: Option<NearestBody>,
    /// The worst first.
    pub findings: Vec<Finding>,
}

impl Verdict {
    /// Whether something is wrong, or clearly not meant.
    pub fn is_wrong(&self) -> bool {
        self.findings.iter().any(|finding| finding.severity > Severity::Note)
    }
}

/// A verdict on every link of the model, in its order.
pub fn judge(model: &Model) -> Vec<Verdict> {
    let masses = units::Masses::of(model);
    let scale_m = units::scale_m(model);
    let mut verdicts: Vec<Verdict> = model.links.iter().map(|link| of_link(model, link, scale_m, &masses)).collect();
    for (index, verdict) in verdicts.iter_mut().enumerate() {
        verdict.findings.extend(masses.missing(model, index));
        if model.from_shapes {
            // what is written is not used
            for finding in &mut verdict.findings {
                finding.severity = Severity::Note;
            }
        }
        verdict.findings.sort_by_key(|finding| std::cmp::Reverse(finding.severity));
    }
    verdicts
}

fn of_link(model: &Model, link: &ModelLink, scale_m: f64, masses: &units::Masses) -> Verdict {
    let Some(inertial) = &link.inertial else { return Verdict::default() };
    if let Some(reason) = impossible(inertial) {
        let nearest = if inertial.mass > 0.0 { nearest(&inertial.inertia).ok() } else { None };
        let order = hypotheses(inertial)
            .into_iter()
            .find(|other| other.kind == FindingKind::Order && is_possible(&other.inertia));
        let mut message = reason;
        if let Some(other) = order {
            message = format!("{message}; {} it could be", other.reading);
        }
        if model.balanced {
            message.push_str("; the simulator makes all three equal");
        }
        let findings = vec![Finding::new(Severity::Wrong, FindingKind::Impossible, message)];
        return Verdict { physical: Some(false), nearest, findings };
    }
    let mut verdict = Verdict { physical: Some(true), ..Verdict::default() };
    let size = inertial.inertia.amax() / inertial.mass;
    if inertial.mass == 0.0 || size > LARGEST_M2 {
        return verdict;
    }
    let evidence = Evidence::of(link);
    let about_size =
        units::placeholder(inertial, &evidence, masses).or_else(|| units::units(inertial, &evidence, scale_m));
    verdict.findings.extend(about_size.or_else(|| other_reading(inertial, &evidence)));
    verdict
}

/// Why no body has these numbers.
fn impossible(inertial: &Inertial) -> Option<String> {
    let (mass, inertia) = (inertial.mass, &inertial.inertia);
    if mass < 0.0 {
        return Some(format!("the mass is negative, {mass} kg"));
    }
    if mass == 0.0 {
        return (inertia.amax() > 0.0).then(|| "an inertia without mass".to_owned());
    }
    if is_possible(inertia) {
        return None;
    }
    let [least, middle, largest] = principal(inertia);
    let missed = (-least).max(largest - least - middle);
    if missed <= LOST * mass * inertial.center_of_mass().norm_squared() {
        return None;
    }
    let reason = if least < -ROUNDING * inertia.amax() {
        format!("the principal inertia {} kg m^2 is negative", digits(least))
    } else {
        format!(
            "the largest principal inertia {} is more than the other two together, {} + {} kg m^2 (by {} %)",
            digits(largest),
            digits(least),
            digits(middle),
            digits(100.0 * (largest - least - middle) / (least + middle))
        )
    };
    // all eigenvalues together move no farther than by the nuclear norm of a change
    let is_digits = missed <= 3_f64.sqrt() * inertial.rounding;
    Some(if is_digits { format!("{reason}, which the rounding of its digits may have done") } else { reason })
}

/// Whether a body of some mass can have this inertia about its centre of mass.
fn is_possible(inertia: &Matrix3<f64>) -> bool {
    let [least, middle, largest] = principal(inertia);
    let slack = ROUNDING * inertia.amax();
    least >= -slack && largest <= least + middle + slack
}

/// Principal inertias, the least first.
fn principal(inertia: &Matrix3<f64>) -> [f64; 3] {
    let mut values: [f64; 3] = inertia.symmetric_eigenvalues().into();
    values.sort_by(f64::total_cmp);
    values
}

/// The nearest inertia of a body, see [`NearestBody`]: in principal axes, where the projection keeps the tensor diagonal.
fn nearest(inertia: &Matrix3<f64>) -> Result<NearestBody, DynamicsError> {
    let size = inertia.amax();
    let axes = SymmetricEigen::new(inertia / size);
    // off-diagonals of a tensor in its principal axes are zero, and those of the nearest one too
    let written = InertialParameters::about_com(1.0, Vector3::zeros(), Matrix3::from_diagonal(&axes.eigenvalues));
    let core = InertialParameters::about_com(0.0, Vector3::zeros(), Matrix3::identity() * (2.0 * CORE));
    let found = (written - core).nearest_consistent()? + core;
    let diagonal = Matrix3::from_diagonal(&found.inertia_about_origin.diagonal());
    let nearest = axes.eigenvectors * diagonal * axes.eigenvectors.transpose();
    let nearest = (nearest + nearest.transpose()) * 0.5;
    let change = (nearest - inertia / size).norm() / (inertia / size).norm();
    Ok(NearestBody { inertia: nearest * size, change })
}

/// Relative difference from filled shapes.
fn difference(filled: &Filled, spread: &Matrix3<f64>) -> f64 {
    (spread - filled.spread).norm() / filled.spread.norm()
}

/// Another reading of the tensor that fits the shapes where the one written does not.
fn other_reading(inertial: &Inertial, evidence: &Evidence) -> Option<Finding> {
    let center_of_mass = inertial.center_of_mass();
    let written = spread(&inertial.in_link_axes(&inertial.inertia), inertial.mass);
    let mut outside = None;
    let mut accusation: Option<(f64, Finding)> = None;
    for (name, filled) in &evidence.sets {
        let own = difference(filled, &written);
        let too_wide = excess(filled, &center_of_mass, &written, SLACK);
        if too_wide.is_none() && own <= NEAR.min(OTHER) {
            // these shapes agree with what is written
            return None;
        }
        let best = hypotheses(inertial)
            .into_iter()
            .filter(|other| is_possible(&other.inertia))
            .map(|other| (spread(&other.inertia, inertial.mass), other))
            .filter(|(spread, _)| too_wide.is_none() || excess(filled, &center_of_mass, spread, SLACK).is_none())
            .map(|(spread, other)| (difference(filled, &spread), other))
            .min_by(|(a, _), (b, _)| a.total_cmp(b));
        let width = too_wide.map(|(direction, found, allowed)| {
            let [x, y, z]: [f64; 3] = direction.map(digits_of).into();
            format!(
                "no mass inside its {name} shapes spreads so far: {} m (standard deviation) along ({x}, {y}, {z}), where they allow {} m",
                digits(found.sqrt()),
                digits(allowed.sqrt())
            )
        });
        let found = best.and_then(|(near, other)| explained(near, own, &other, width.as_deref(), name));
        match (found, width) {
            (Some((near, finding)), _) => {
                if accusation.as_ref().is_none_or(|(before, _)| near < *before) {
                    accusation = Some((near, finding));
                }
            }
            (None, Some(width)) => {
                let message = format!("{width}; shapes that leave out a part of the link, or a wrong inertia");
                outside = Some(Finding::new(Severity::Note, FindingKind::OutsideShapes, message));
            }
            // these shapes allow what is written
            (None, None) => return None,
        }
    }
    accusation.map(|(_, finding)| finding).or(outside)
}

/// The accusation that another reading makes, with how near it is to filled shapes.
fn explained(near: f64, own: f64, other: &Hypothesis, width: Option<&str>, name: &str) -> Option<(f64, Finding)> {
    let reading = &other.reading;
    let message = match width {
        Some(width) if near <= NEAR && own >= OTHER.max(2.0 * near) => {
            format!("{width}; {reading} it is that of the filled shapes to {}", percent(near))
        }
        _ if near <= SAME && own >= OTHER => format!(
            "{reading} it is that of its filled {name} shapes to {}, as written it differs by {} %",
            percent(near),
            digits(100.0 * own)
        ),
        _ => return None,
    };
    Some((near, Finding::new(Severity::Suspect, other.kind, message)))
}

#[cfg(test)]
mod tests;
