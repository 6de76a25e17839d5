//! What is said of an identification, from numbers alone.

use super::identification::{Identification, Silence};
use super::plan::Plan;
use crate::dynamics::InertialParameters;
use crate::error::IdentificationError;
use crate::estimator::{Estimate, Evidence, Finding, Judge, Verdict};
use crate::likelihood::Quantity;
use crate::{BodyScale, SquareRootInformation};
use nalgebra::SVector;

/// Step of the difference quotient along a null direction, in units of the body's scale.
const NUDGE: f64 = 1e-4;
/// A quantity that changes by less than this share of its scale along a null direction is determined.
const LARGEST_SLOPE: f64 = 1e-3;

/// The verdict on what a record says, `information` being that of the data alone.
pub(super) fn verdict(
    plan: &Plan<'_>,
    scale: BodyScale,
    information: &SquareRootInformation<10>,
    estimate: Option<&Estimate>,
    evidence: &Evidence,
    beside: Option<&Beside>,
) -> Result<Verdict, IdentificationError> {
    let magnitudes = scale.parameter_magnitudes();
    let mut all = *information;
    let mut prior = SquareRootInformation::new();
    if let Some(known) = &plan.settings.prior {
        prior.add_prior(&known.mean.to_vector(), &known.standard_deviation)?;
        all.merge(&prior);
    }
    let mut found = Finding::of_information(all, magnitudes).with_prior(prior);
    if let Some(estimate) = estimate {
        found = found.at(estimate.parameters.to_vector());
    }
    if let Some((nis, freedom)) = beside.and_then(|beside| beside.surprise) {
        found = found.with_surprise(nis, freedom);
    }
    let judge = Judge { scale, ..plan.judge };
    judge.judge(&found, evidence, beside.and_then(|beside| beside.other.as_ref()))
}

/// What stands beside a finding: how much its own observations surprised it, and another finding of the same record.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Beside {
    pub(super) surprise: Option<(f64, usize)>,
    pub(super) other: Option<Finding>,
}

/// Place among mass, centre of mass and inertia about it (xx, yy, zz, xy, xz, yz).
pub(super) fn place(quantity: Quantity) -> Option<usize> {
    match quantity {
        Quantity::Mass => Some(0),
        Quantity::CenterOfMass(axis) => Some(1 + axis),
        Quantity::Inertia(i, j) => [[4, 7, 8], [7, 5, 9], [8, 9, 6]].get(i).and_then(|row| row.get(j)).copied(),
        _ => None,
    }
}

/// Mass, centre of mass, inertia about it.
fn quantities(parameters: &SVector<f64, 10>) -> [f64; 10] {
    let body = InertialParameters::from_vector(parameters);
    let (c, j) = (body.center_of_mass(), body.inertia_about_com());
    [body.mass, c.x, c.y, c.z, j[(0, 0)], j[(1, 1)], j[(2, 2)], j[(0, 1)], j[(0, 2)], j[(1, 2)]]
}

impl Identification {
    /// Whether the motion was taken for that of a body on a table: mass, centre of mass in the plane and inertia about its normal are all
    /// that any such motion shows.
    pub fn is_on_table(&self) -> bool {
        self.marks.on_table
    }

    /// Which of mass, centre of mass (x, y, z) and inertia about it (xx, yy, zz, xy, xz, yz) the record determines: those of the estimate
    /// that nothing asked for beside the body can be exchanged with, or, below rank ten, those of the completed body that no free
    /// direction changes.
    pub fn determined(&self) -> [bool; 10] {
        match (&self.estimate, &self.regularised) {
            (None, Some(completed)) => self.unchanged_by_free_directions(&completed.parameters),
            _ => self.not_exchangeable(),
        }
    }

    /// The widest standard deviation of what is determined, in units of the body's size.
    pub(super) fn widest(&self) -> f64 {
        let Some(body) = self.estimate.as_ref().or(self.regularised.as_ref()) else { return 0.0 };
        let (mass, length) = (self.scale.mass_kg(), self.scale.length_m());
        let inertia = &body.std.inertia_about_com_kg_m2;
        let of_inertia =
            [(0, 0), (1, 1), (2, 2), (0, 1), (0, 2), (1, 2)].map(|entry| inertia[entry] / (mass * length * length));
        let of_center = body.std.center_of_mass_m.iter().map(|sigma| sigma / length);
        let all = core::iter::once(body.std.mass_kg / mass).chain(of_center).chain(of_inertia);
        all.zip(self.determined()).filter(|(_, determined)| *determined).map(|(sigma, _)| sigma).fold(0.0, f64::max)
    }

    fn not_exchangeable(&self) -> [bool; 10] {
        let mut separable = [true; 10];
        for (quantity, _) in self.exchanges.iter().flat_map(|exchange| &exchange.parts) {
            if let Some(shown) = place(*quantity).and_then(|place| separable.get_mut(place)) {
                *shown = false;
            }
        }
        separable
    }

    fn unchanged_by_free_directions(&self, body: &InertialParameters<f64>) -> [bool; 10] {
        let (center, length) = (body.to_vector(), self.scale.length_m());
        // Without any wrench only ratios can be known: the centre of mass perhaps, no mass and no inertia; without force no mass.
        let mut result: [bool; 10] = core::array::from_fn(|i| match (self.silence, i) {
            (Silence::Wrench, _) => matches!(i, 1..=3),
            (Silence::Force, 0) => false,
            _ => true,
        });
        for direction in &self.null_directions {
            let change = direction.parameters() * NUDGE;
            let (plus, minus) = (quantities(&(center + change)), quantities(&(center - change)));
            for (i, determined) in result.iter_mut().enumerate() {
                let magnitude = match i {
                    0 => self.scale.mass_kg(),
                    1..=3 => length,
                    _ => self.scale.mass_kg() * length * length,
                };
                let slope = (plus[i] - minus[i]) / (2.0 * NUDGE * magnitude);
                *determined &= slope.abs() < LARGEST_SLOPE;
            }
        }
        result
    }
}
