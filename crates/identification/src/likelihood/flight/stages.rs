//! Bodies that a record shows one after another: cargo taken and let go.
//!
//! Windows of the record are fitted one by one; neighbours that contradict each other enclose a change. Its place is the one at which what the
//! body before leaves of the record up to it and what the body after leaves from it on are least. What the sensors are stays the same, so that
//! their gains hardly enter the difference of two bodies.

use super::super::coordinates::Coordinates;
use super::fit::{Fit, solved};
use super::grid::Grid;
use super::layout::BODY;
use super::{FlightEstimate, FlightLikelihood, Plane};
use crate::BodyScale;
use crate::dynamics::InertialParameters;
use crate::error::IdentificationError;
use crate::motion::MotionSample;
use crate::sensing::Sensing;
use crate::statistics::chi_square_exceedance;
use crate::units::Units;
use core::ops::Range;
use nalgebra::{DMatrix, DVector, SMatrix, SVector};

/// Length of a window, s, and fewest samples of it.
const WINDOW_S: f64 = 8.0;
const FEWEST_SAMPLES: usize = 64;
/// Most windows that a record is taken into.
const MOST_WINDOWS: usize = 200;
/// Chance below which two windows are not of one body.
const CHANCE: f64 = 1e-6;
/// A change counts for what it surely is, less so many standard deviations, and from this share of mass, mass times length or inertia on.
const SURELY: f64 = 3.0;
const OTHER_BODY: f64 = 0.02;
/// Cost above the least, in squared standard deviations, up to which a place of a change is not ruled out: half of it is left out of both parts.
const NOT_RULED_OUT: f64 = 30.0;
/// Segments added on either side: what a stream is late or a filter owes moves a change by as much.
const AROUND: usize = 3;
/// A step longer than this, by the mean, is a gap.
const GAP: f64 = 4.0;
/// Segments between places that are looked at first.
const COARSE: usize = 8;

/// Where the body changed, in samples of the record.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) struct Place {
    pub(crate) last_before: usize,
    pub(crate) likeliest: usize,
    pub(crate) first_after: usize,
}

/// Bodies in the order of time, one more than changes.
#[derive(Clone, Debug)]
pub(crate) struct Stages {
    pub(crate) changes: Vec<Place>,
    pub(crate) bodies: Vec<InertialParameters<f64>>,
    /// Joint covariance of all their `to_vector`.
    pub(crate) covariance: DMatrix<f64>,
}

/// What a fit says of the body and, beside it, of all else.
pub(super) struct Joint {
    body: Coordinates,
    columns: Vec<usize>,
    values: Vec<f64>,
    /// Of the body's free columns and the others, priors included.
    information: DMatrix<f64>,
    prior: Vec<f64>,
    mean: Vec<f64>,
}

impl Joint {
    pub(super) fn of(fit: &Fit<'_>) -> Self {
        let shifted = |column: usize| fit.whole_row_delay_s(column);
        Self {
            body: fit.coordinates(),
            columns: fit.free.clone(),
            values: fit.free.iter().map(|&column| fit.eta[column] + shifted(column)).collect(),
            information: fit.information.clone(),
            prior: fit.prior.clone(),
            mean: fit.free.iter().map(|&column| fit.mean[column] + shifted(column)).collect(),
        }
    }

    fn of_body(&self) -> usize {
        self.columns.iter().filter(|column| **column < BODY).count()
    }
}

impl Stages {
    /// Bodies that share all that is not the body.
    fn of(joints: &[Joint]) -> Option<(Vec<InertialParameters<f64>>, DMatrix<f64>)> {
        let first = joints.first()?;
        if joints.iter().any(|joint| joint.columns != first.columns) {
            return None;
        }
        let (n, b) = (joints.len(), first.of_body());
        let shared = first.columns.len() - b;
        let size = n * b + shared;
        let (mut information, mut right) = (DMatrix::<f64>::zeros(size, size), DVector::<f64>::zeros(size));
        for (at, joint) in joints.iter().enumerate() {
            let place = |i: usize| if i < b { at * b + i } else { n * b + i - b };
            // One prior for all: the first part brings it.
            let twice = |i: usize| if at > 0 && i >= b { joint.prior[i] } else { 0.0 };
            for i in 0..b + shared {
                for j in 0..b + shared {
                    information[(place(i), place(j))] += joint.information[(i, j)];
                    right[place(i)] += joint.information[(i, j)] * joint.values[j];
                }
                information[(place(i), place(i))] -= twice(i);
                right[place(i)] -= twice(i) * joint.mean[i];
            }
        }
        // A weak hold of each body, as for one alone.
        for (at, joint) in joints.iter().enumerate() {
            let sizes = joint.body.sizes();
            for i in 0..b {
                let more = 1e-6 / sizes[joint.columns[i]].powi(2);
                information[(at * b + i, at * b + i)] += more;
                right[at * b + i] += more * joint.values[i];
            }
        }
        let found = solved(&information, &DMatrix::from_column_slice(size, 1, right.as_slice()))?;
        let covariance = solved(&information, &DMatrix::identity(size, size))?;
        let mut bodies = Vec::new();
        let mut by_eta = DMatrix::<f64>::zeros(10 * n, n * b);
        for (at, joint) in joints.iter().enumerate() {
            let step = DVector::from_fn(BODY, |i, _| {
                let free = joint.columns[..b].iter().position(|column| *column == i);
                free.map_or(0.0, |free| found[at * b + free] - joint.values[free])
            });
            let moved = joint.body.advanced(&step);
            let derivative = moved.parameters_by_eta();
            for (free, &column) in joint.columns[..b].iter().enumerate() {
                for row in 0..10 {
                    by_eta[(10 * at + row, at * b + free)] = derivative[(row, column)];
                }
            }
            bodies.push(moved.parameters());
        }
        let of_bodies = covariance.view((0, 0), (n * b, n * b)).into_owned();
        Some((bodies, &by_eta * of_bodies * by_eta.transpose()))
    }

    /// What the body after change `index` has more than the one before, and its covariance.
    pub(crate) fn difference(&self, index: usize) -> (SVector<f64, 10>, SMatrix<f64, 10, 10>) {
        let at = |a: usize, b: usize| self.covariance.fixed_view::<10, 10>(10 * a, 10 * b);
        let (a, b) = (index, index + 1);
        let covariance = at(a, a) + at(b, b) - at(a, b) - at(b, a);
        (self.bodies[b].to_vector() - self.bodies[a].to_vector(), (covariance + covariance.transpose()) * 0.5)
    }

    fn in_units(mut self, units: &Units) -> Self {
        let factors = units.parameter_factors();
        for body in &mut self.bodies {
            *body = InertialParameters::from_vector(&body.to_vector().component_mul(&factors));
        }
        self.covariance = DMatrix::from_fn(self.covariance.nrows(), self.covariance.ncols(), |i, j| {
            self.covariance[(i, j)] * factors[i % 10] * factors[j % 10]
        });
        self
    }
}

/// Whether two windows may be of one body, as far as both see it.
fn agree(a: &FlightEstimate, b: &FlightEstimate) -> bool {
    let seen: Vec<usize> = (0..BODY).filter(|&i| a.determined[i] && b.determined[i]).collect();
    let apart = Coordinates::of(&a.parameters).difference(&Coordinates::of(&b.parameters));
    let n = seen.len();
    let joint = DMatrix::from_fn(n, n, |i, j| a.covariance[(seen[i], seen[j])] + b.covariance[(seen[i], seen[j])]);
    let apart = DMatrix::from_fn(n, 1, |i, _| apart[seen[i]]);
    n == 0 || solved(&joint, &apart).is_none_or(|x| chi_square_exceedance(n as f64, x.dot(&apart)) > CHANCE)
}

/// Windows of one body: the first and the last of them, and the one that knows it best.
struct Stay {
    first: Range<usize>,
    last: Range<usize>,
    windows: usize,
    best: (FlightEstimate, Joint),
}

impl Stay {
    fn of(window: Range<usize>, found: (FlightEstimate, Joint)) -> Self {
        Self { first: window.clone(), last: window, windows: 1, best: found }
    }

    /// Takes the next stay in where it is of the same body, else gives it back.
    fn taking(&mut self, next: Self) -> Option<Self> {
        if !agree(&self.best.0, &next.best.0) {
            return Some(next);
        }
        let known = |stay: &Self| stay.best.0.determined.iter().filter(|known| **known).count();
        let spread = |stay: &Self| stay.best.0.covariance[(0, 0)];
        let better = known(&next) > known(self) || known(&next) == known(self) && spread(&next) < spread(self);
        self.last = next.last;
        self.windows += next.windows;
        if better {
            self.best = next.best;
        }
        None
    }
}

fn joined(stays: Vec<Stay>) -> Vec<Stay> {
    let mut out: Vec<Stay> = Vec::new();
    for stay in stays {
        let other = match out.last_mut() {
            Some(last) => last.taking(stay),
            None => Some(stay),
        };
        out.extend(other);
    }
    out
}

impl FlightLikelihood {
    /// The bodies that a record shows one after another; `None` where it shows one only, or too little of any.
    ///
    /// A body that stays for less than two windows of eight seconds is not seen but at the ends of the record.
    pub(crate) fn stages(&self, record: &[MotionSample]) -> Option<Stages> {
        let units = Units::of_record(record);
        let told = Self { plane: if self.is_planar(record) { Plane::Planar } else { Plane::Free }, ..self.clone() };
        match units.record(record).filter(|_| self.sensing == Sensing::default()) {
            Some(scaled) => {
                let told = Self { gravity_world: units.gravity(&self.gravity_world), ..told };
                Some(told.stages_as_told(&scaled)?.in_units(&units.back()))
            }
            None => told.stages_as_told(record),
        }
    }

    fn stages_as_told(&self, record: &[MotionSample]) -> Option<Stages> {
        let (first, last) = (record.first()?, record.last()?);
        let step_s = (last.time_ns - first.time_ns) as f64 * 1e-9 / record.len() as f64;
        let samples =
            super::grid::whole(WINDOW_S / step_s).max(FEWEST_SAMPLES).max(record.len().div_ceil(MOST_WINDOWS));
        let windows = record.len() / samples;
        let stays: Vec<Stay> = (0..windows)
            .filter_map(|w| {
                let end = if w + 1 == windows { record.len() } else { (w + 1) * samples };
                let of = w * samples..end;
                Some(Stay::of(of.clone(), self.of_part(record, of)?))
            })
            .collect();
        // A window within which the body changes is of neither.
        let mut stays = joined(stays);
        let last = stays.len().saturating_sub(1);
        let mut at = 0;
        stays.retain(|stay| {
            at += 1;
            stay.windows > 1 || at == 1 || at == last + 1
        });
        let stays = joined(stays);
        let mut parts: Vec<Range<usize>> = core::iter::once(0..record.len()).collect();
        let mut changes = Vec::new();
        for pair in stays.windows(2) {
            let place = self.place(record, &pair[0], &pair[1])?;
            parts.last_mut()?.end = place.last_before;
            parts.push(place.first_after..record.len());
            changes.push(place);
        }
        // Bodies that stay the same for all that can be said are one.
        loop {
            if changes.is_empty() {
                return None;
            }
            let fits: Option<Vec<(FlightEstimate, Joint)>> =
                parts.iter().map(|part| self.of_part(record, part.clone())).collect();
            let (_, joints): (Vec<_>, Vec<_>) = fits?.into_iter().unzip();
            let (bodies, covariance) = Stages::of(&joints)?;
            let stages = Stages { changes: changes.clone(), bodies, covariance };
            let small = (0..changes.len()).find(|&index| {
                let (difference, covariance) = stages.difference(index);
                let Ok(scale) = BodyScale::of(&stages.bodies[index].to_vector()) else { return false };
                let surely = SVector::<f64, 10>::from_fn(|i, _| {
                    difference[i].abs() - SURELY * covariance[(i, i)].max(0.0).sqrt()
                });
                surely.component_div(&scale.parameter_magnitudes()).max() < OTHER_BODY
            });
            let Some(small) = small else { return Some(stages) };
            changes.remove(small);
            parts[small].end = parts[small + 1].end;
            parts.remove(small + 1);
        }
    }

    /// The same of a part of the record.
    fn part_of(&self, samples: &Range<usize>) -> Self {
        let thrusters = self.thrusters.as_ref().map(|all| all.of_part(samples));
        Self { thrusters, ..self.clone() }
    }

    fn of_part(&self, record: &[MotionSample], samples: Range<usize>) -> Option<(FlightEstimate, Joint)> {
        let part = record.get(samples.clone())?;
        self.part_of(&samples).fitted_from(part, Vec::new()).ok()
    }

    /// Where the one body gives way to the other.
    fn place(&self, record: &[MotionSample], before: &Stay, after: &Stay) -> Option<Place> {
        let samples = before.last.start..after.first.end;
        let part = record.get(samples.clone())?;
        let told = self.part_of(&samples);
        let mut of_before = told.held(&before.best, part).ok()?;
        let mut of_after = told.held(&after.best, part).ok()?;
        let segments = of_before.segments;
        let starts: Vec<usize> =
            (0..segments).map(|j| samples.start + of_before.grid.source[j * of_before.samples]).collect();
        let mut total = |j: usize| of_before.cost(0..j) + of_after.cost(j..segments);
        let least = |places: &mut dyn Iterator<Item = usize>, total: &mut dyn FnMut(usize) -> f64| {
            places.map(|j| (j, total(j))).min_by(|a, b| a.1.total_cmp(&b.1))
        };
        let (near, _) = least(&mut (1..segments).step_by(COARSE), &mut total)?;
        let around = near.saturating_sub(COARSE).max(1)..(near + COARSE + 1).min(segments);
        let (likeliest, cost) = least(&mut around.clone(), &mut total)?;
        let possible = |j: usize, total: &mut dyn FnMut(usize) -> f64| total(j) < cost + NOT_RULED_OUT;
        let mut from = likeliest;
        while from > 1 && possible(from - 1, &mut total) {
            from -= 1;
        }
        let mut to = likeliest;
        while to + 1 < segments && possible(to + 1, &mut total) {
            to += 1;
        }
        let last_before = starts[from.saturating_sub(AROUND)];
        let first_after = starts[(to + AROUND).min(segments - 1)];
        // Nothing tells where within a gap it was.
        let gap_ns =
            GAP * (record[samples.end - 1].time_ns - record[samples.start].time_ns) as f64 / samples.len() as f64;
        let is_gap = |k: usize| (record[k + 1].time_ns - record[k].time_ns) as f64 > gap_ns;
        let gaps: Vec<usize> =
            (last_before.saturating_sub(1)..(first_after + 1).min(record.len() - 1)).filter(|&k| is_gap(k)).collect();
        Some(Place {
            last_before: gaps.first().map_or(last_before, |&gap| last_before.min(gap)),
            likeliest: starts[likeliest],
            first_after: gaps.last().map_or(first_after, |&gap| first_after.max(gap + 1)),
        })
    }

    /// What a body leaves of a record, all else as its own fit found it.
    fn held(
        &self,
        (found, joint): &(FlightEstimate, Joint),
        record: &[MotionSample],
    ) -> Result<Fit<'_>, IdentificationError> {
        let grid = Grid::try_new(record, self.wrench_timing, &self.added(record), self.thrusters.as_ref())?;
        let mut fit = Fit::new(self, grid, found.planar)?;
        fit.hold(&joint.body, joint.columns.iter().copied().zip(joint.values.iter().copied()), &found.levels)?;
        Ok(fit)
    }
}
