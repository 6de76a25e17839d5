//! Sizes that cannot be meant: grams, millimetres, numbers to be replaced later, no mass at all.

use super::evidence::{Evidence, SLACK, excess, spread};
use super::finding::{Finding, FindingKind, Severity, digits};
use crate::model::links::{Inertial, Model, ModelKind, ModelLink};
use tumble_dynamics::nalgebra::Matrix3;

/// Denser than osmium by far, kg/m^3: shapes leave something out, but not that much.
const TOO_DENSE: f64 = 100_000.0;
/// What links are made of, hollow ones too, kg/m^3.
const USUAL_DENSITY: std::ops::RangeInclusive<f64> = 20.0..=23_000.0;
/// Radius of gyration of a link by half the diagonal of the box around it.
const USUAL_SHARE: std::ops::RangeInclusive<f64> = 0.1..=1.0;
/// Without shapes no link is taken to be smaller than that, m.
const SMALL_M: f64 = 20.0;

/// Units that an inertia is mistaken in, as many of them as make one kg m^2.
const UNITS: [(f64, &str); 4] =
    [(1e4, "kg cm^2"), (1e6, "kg mm^2 (or mass in g and inertia in g mm^2)"), (1e7, "g cm^2"), (1e9, "g mm^2")];

/// An upper bound on the size of everything, m.
pub(super) fn scale_m(model: &Model) -> f64 {
    let reach = |link: &ModelLink| {
        let com = link.inertial.as_ref().map_or(0.0, |inertial| inertial.center_of_mass().norm());
        let shapes = Evidence::of(link).sets.iter().map(|(_, filled)| filled.radius()).fold(0.0, f64::max);
        com.max(shapes)
    };
    let offsets: f64 = model.links.iter().map(|link| link.offset_m).sum();
    offsets + model.links.iter().map(reach).fold(0.0, f64::max)
}

/// The accusation that a size makes.
pub(super) fn units(inertial: &Inertial, evidence: &Evidence, scale_m: f64) -> Option<Finding> {
    let suspect = |message: String| Some(Finding::new(Severity::Suspect, FindingKind::Units, message));
    let spread = spread(&inertial.in_link_axes(&inertial.inertia), inertial.mass);
    let gyration = spread.trace().max(0.0).sqrt();
    let com = inertial.center_of_mass();
    let radii = || evidence.sets.iter().map(|(_, filled)| filled.radius());
    let (least, most) = (radii().fold(f64::INFINITY, f64::min), radii().fold(0.0, f64::max));
    if most == 0.0 {
        let limit = (20.0 * scale_m).max(SMALL_M);
        return if gyration > limit {
            suspect(format!(
                "the radius of gyration is {} m, the whole model about {} m: an inertia in another unit than kg m^2",
                digits(gyration),
                digits(scale_m)
            ))
        } else {
            None
        };
    }
    let distance = |factor: f64| {
        evidence.sets.iter().map(|(_, filled)| (com * factor - filled.centre).norm()).fold(f64::INFINITY, f64::min)
    };
    if distance(1.0) > 50.0 * most && distance(1e-3) <= 1.5 * most {
        return suspect(format!(
            "the centre of mass is {} m from its shapes, which reach {} m; in mm it is inside them",
            digits(distance(1.0)),
            digits(most)
        ));
    }
    if !evidence.sets.iter().any(|(_, filled)| is_around(filled, inertial)) {
        return None;
    }
    if gyration > 10.0 * most {
        let share = |factor: f64| gyration / factor.sqrt() / most;
        let fitting: Vec<&str> =
            UNITS.iter().filter(|(factor, _)| USUAL_SHARE.contains(&share(*factor))).map(|(_, name)| *name).collect();
        let guess =
            if fitting.is_empty() { String::new() } else { format!(": in {} it would fit", fitting.join(", or ")) };
        return suspect(format!(
            "the radius of gyration is {} m, its shapes reach {} m from their middle{guess}",
            digits(gyration),
            digits(most)
        ));
    }
    let volume = evidence.sets.iter().map(|(_, filled)| filled.volume).fold(0.0, f64::max);
    let density = inertial.mass / volume;
    let is_within = evidence
        .sets
        .iter()
        .all(|(_, filled)| is_around(filled, inertial) && excess(filled, &com, &spread, SLACK).is_none());
    if gyration < 0.01 * least {
        let guess = if USUAL_SHARE.contains(&(1e3 * gyration / least)) && least > SMALL_M {
            "; in mm the shapes would fit"
        } else if density > *USUAL_DENSITY.end() && USUAL_DENSITY.contains(&(1e-3 * density)) {
            "; in g the mass would fit"
        } else {
            ""
        };
        return suspect(format!(
            "the radius of gyration is {} m, its shapes reach {} m from their middle: almost all mass in one point{guess}",
            digits(gyration),
            digits(least)
        ));
    }
    if density > TOO_DENSE && is_within && USUAL_DENSITY.contains(&(1e-3 * density)) {
        return suspect(format!(
            "its shapes filled have {} kg/m^3, no matter is so dense; in g the mass would fit",
            digits(density)
        ));
    }
    None
}

/// Whether the centre of mass is within the box around the shapes.
fn is_around(filled: &super::Filled, inertial: &Inertial) -> bool {
    let com = inertial.center_of_mass();
    Matrix3::identity().column_iter().all(|axis| {
        let axis = axis.into_owned();
        let (low, high) = filled.interval(&axis);
        (low..=high).contains(&com.dot(&axis))
    })
}

/// Whether two numbers are the same as people write them.
fn is_same(number: f64, other: f64) -> bool {
    (number / other - 1.0).abs() < 1e-12
}

/// Whether a number is a power of ten.
fn is_power_of_ten(number: f64) -> bool {
    (-12..=3).any(|power| is_same(number, 10_f64.powi(power)))
}

/// Three equal moments of a round number and no products, where the shapes or the other links say that it is not meant.
pub(super) fn placeholder(inertial: &Inertial, evidence: &Evidence, masses: &Masses) -> Option<Finding> {
    let j = &inertial.inertia;
    let value = j.m11;
    let is_round = *j == Matrix3::identity() * value && is_power_of_ten(value);
    if !is_round {
        return None;
    }
    let own = spread(j, inertial.mass).trace();
    let ratio = evidence.sets.iter().map(|(_, filled)| own / filled.spread.trace());
    let is_far = |ratio: f64| !(0.25..=4.0).contains(&ratio);
    let said = format!("three equal moments of {value} kg m^2 and no products");
    let (severity, reason) = if evidence.sets.is_empty() {
        if is_same(inertial.mass, 1.0) && is_same(value, 1.0) {
            (Severity::Suspect, "with a mass of 1 kg: what programs write that know nothing".to_owned())
        } else if masses.shared(value, inertial.mass) {
            (Severity::Suspect, "as other links of another mass have: a number to be replaced".to_owned())
        } else {
            (Severity::Note, "perhaps a number to be replaced".to_owned())
        }
    } else if ratio.clone().all(is_far) {
        let first = ratio.fold(0.0, f64::max);
        (Severity::Suspect, format!("{} times what its shapes would have: a number to be replaced", digits(first)))
    } else {
        return None;
    };
    Some(Finding::new(severity, FindingKind::Placeholder, format!("{said}, {reason}")))
}

/// Who of a model has mass.
pub(super) struct Masses {
    /// Of the link and everything fixed to it, and of everything that it carries.
    rigid: Vec<bool>,
    carried: Vec<bool>,
    any: bool,
    /// Equal round moments, with the mass that has them.
    round: Vec<(f64, f64)>,
}

impl Masses {
    pub fn of(model: &Model) -> Self {
        let own = |link: &super::ModelLink| match &link.inertial {
            Some(inertial) if !model.from_shapes => inertial.mass != 0.0,
            // MuJoCo takes it from the geoms
            _ => {
                model.kind == ModelKind::Mjcf
                    && [&link.collision, &link.visual].iter().any(|set| set.as_ref().is_none_or(|set| !set.is_empty()))
            }
        };
        let mut rigid: Vec<bool> = model.links.iter().map(own).collect();
        let mut carried = rigid.clone();
        for index in model.roots_first().into_iter().rev() {
            let Some(link) = model.links.get(index) else { continue };
            let Some(parent) = link.parent else { continue };
            if carried[index] {
                carried[parent] = true;
            }
            if rigid[index] && !link.moves {
                rigid[parent] = true;
            }
        }
        let any = carried.iter().any(|has| *has);
        let inertials = model.links.iter().filter_map(|link| link.inertial.as_ref());
        let round = inertials
            .filter(|inertial| inertial.inertia == Matrix3::identity() * inertial.inertia.m11)
            .map(|inertial| (inertial.inertia.m11, inertial.mass))
            .collect();
        Self { rigid, carried, any, round }
    }

    /// Whether another link has the same moments with a quite different mass.
    fn shared(&self, value: f64, mass: f64) -> bool {
        self.round.iter().any(|(other, of)| is_same(*other, value) && !(0.5..=2.0).contains(&(of / mass)))
    }

    /// What is to be said of a link without mass.
    pub fn missing(&self, model: &Model, index: usize) -> Option<Finding> {
        let link = model.links.get(index)?;
        let (rigid, carried) = (*self.rigid.get(index)?, *self.carried.get(index)?);
        let above = link.parent.is_none_or(|parent| self.carried.get(parent).copied().unwrap_or(false));
        if link.moves && self.any && !carried && above {
            let message = "it moves, and neither it nor what it carries has mass";
            return Some(Finding::new(Severity::Suspect, FindingKind::Massless, message));
        }
        if link.moves && self.any && !rigid && carried && model.kind == ModelKind::Mjcf {
            let message = "it moves and has no mass of its own, which the simulator refuses";
            return Some(Finding::new(Severity::Suspect, FindingKind::Massless, message));
        }
        if link.inertial.is_none() {
            let from_shapes = model.kind == ModelKind::Mjcf && rigid;
            let message = if from_shapes { "not stated: the simulator takes it from the geoms" } else { "not stated" };
            return Some(Finding::new(Severity::Note, FindingKind::NotStated, message));
        }
        None
    }
}
