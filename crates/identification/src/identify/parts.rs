//! A body that changed within a record: said, and on request identified in parts.

use super::body_change::SURELY;
use super::identification::Identification;
use super::identify;
use super::settings::{FLIGHT_LIKELIHOOD, Settings};
use crate::dynamics::InertialParameters;
use crate::error::IdentificationError;
use crate::estimator::{Estimate, StandardDeviations, standard_deviations};
use crate::likelihood::{FlightLikelihood, Place, Stages};
use crate::motion::MotionSample;
use core::ops::Range;
use nalgebra::{SMatrix, SVector};
use std::borrow::Cow;

/// Most parts that a record is taken into.
const MOST_PARTS: usize = 16;

/// A part of a record in which the body stayed the same.
#[derive(Clone, Debug, PartialEq)]
pub struct Part {
    /// Its samples.
    pub samples: Range<usize>,
    /// What they say.
    pub found: Identification,
}

/// What one body has more than another: the cargo that a robot took, or with negative mass what it let go.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Difference {
    /// Difference of the ten parameters about the body origin, body axes; no body by itself where what they are known to allows for none.
    pub parameters: InertialParameters<f64>,
    /// Covariance of [`InertialParameters::to_vector`] of the difference (kg, kg m, kg m^2): what both bodies owe to one set of sensors cancels.
    pub covariance: SMatrix<f64, 10, 10>,
    /// Standard deviations derived from it, centre of mass and inertia about it those of the difference itself.
    pub std: StandardDeviations,
    /// Which of its mass, centre of mass (x, y, z) and inertia about it (xx, yy, zz, xy, xz, yz) are known: those of both bodies, and where its
    /// mass is.
    pub determined: [bool; 10],
}

/// A change of the body between two parts.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PartChange {
    /// When it happened most likely, by the clock of the record, ns.
    pub time_ns: i64,
    /// It happened no earlier, ns.
    pub earliest_ns: i64,
    /// It happened no later, ns.
    pub latest_ns: i64,
    /// The body after less the body before; none where either is not identified.
    pub difference: Option<Difference>,
}

/// A record taken into parts.
#[derive(Clone, Debug, PartialEq)]
pub struct Parts {
    /// In the order of time.
    pub parts: Vec<Part>,
    /// Between each part and the next.
    pub changes: Vec<PartChange>,
}

impl Difference {
    /// Of the bodies of two parts; `None` where either is not identified.
    fn new(
        parameters: &SVector<f64, 10>,
        covariance: &SMatrix<f64, 10, 10>,
        [before, after]: [&Identification; 2],
    ) -> Option<Self> {
        let (of_before, of_after) = (before.determined(), after.determined());
        let std = standard_deviations(parameters, covariance);
        let has_mass = parameters[0].abs() > SURELY * std.mass_kg;
        let determined = core::array::from_fn(|i| of_before[i] && of_after[i] && (i == 0 || has_mass));
        let parameters = InertialParameters::from_vector(parameters);
        let identified = before.verdict.is_identified() && after.verdict.is_identified();
        identified.then_some(Self { parameters, covariance: *covariance, std, determined })
    }

    /// Of two parts that have nothing in common but the robot.
    fn of(pair: [&Identification; 2]) -> Option<Self> {
        let [a, b] = [body_of(pair[0])?, body_of(pair[1])?];
        Self::new(&(b.parameters.to_vector() - a.parameters.to_vector()), &(a.covariance + b.covariance), pair)
    }
}

fn body_of(found: &Identification) -> Option<&Estimate> {
    found.estimate.as_ref().or(found.regularised.as_ref())
}

/// The parts of a record between changes of the body, in the order of time, each by [`identify`]; one part where nothing
/// changed.
///
/// The stretch in which a change may lie belongs to no part. A part too short to say anything is left out; a prior enters the
/// first part only, which is the body it is about. From a log that asks for a model of the sensors a body that stays for less
/// than sixteen seconds is not seen but at the ends.
///
/// # Errors
/// Those of [`identify`] of the whole record.
pub fn identify_parts(record: &[MotionSample], settings: &Settings) -> Result<Parts, IdentificationError> {
    in_parts(record, settings, &FlightLikelihood::default(), |_| Ok(Cow::Borrowed(record)), identify)
}

/// The same by any way to identify, with what is known of the sensors, and with all that acts on what was found of the whole record.
pub(super) fn in_parts<'a, E: From<IdentificationError>>(
    record: &[MotionSample],
    settings: &Settings,
    flown: &FlightLikelihood,
    acted: impl Fn(&Identification) -> Result<Cow<'a, [MotionSample]>, IdentificationError>,
    identify: impl Fn(&[MotionSample], &Settings) -> Result<Identification, E>,
) -> Result<Parts, E> {
    let time_ns = |sample: usize| record.get(sample).or(record.last()).map_or(0, |sample| sample.time_ns);
    let (mut parts, mut open, mut times) = (Vec::<Part>::new(), Vec::new(), Vec::new());
    open.push(0..record.len());
    while let Some(samples) = open.pop() {
        let settings = if parts.is_empty() { *settings } else { Settings { prior: None, ..*settings } };
        let found = match identify(&record[samples.clone()], &settings) {
            Ok(found) => found,
            Err(error) if samples.len() == record.len() => return Err(error),
            Err(_) => continue,
        };
        if samples.len() == record.len()
            && asks_for_sensors(&found)
            && let Some(stages) = flown.under(&settings).stages(&acted(&found)?)
        {
            return staged(record, &settings, &stages, identify);
        }
        match found.marks.changed_ns {
            Some([earliest_ns, time_ns, latest_ns]) if parts.len() + open.len() + 1 < MOST_PARTS => {
                let end = record.partition_point(|sample| sample.time_ns <= earliest_ns);
                let start = record.partition_point(|sample| sample.time_ns < latest_ns);
                times.push(time_ns);
                open.push(start..samples.end);
                open.push(samples.start..end);
            }
            _ => parts.push(Part { samples, found }),
        }
    }
    let change = |pair: &[Part]| {
        let (earliest_ns, latest_ns) = (time_ns(pair[0].samples.end - 1), time_ns(pair[1].samples.start));
        let within = times.iter().copied().find(|time_ns| (earliest_ns..=latest_ns).contains(time_ns));
        let time_ns = within.unwrap_or(earliest_ns + (latest_ns - earliest_ns) / 2);
        PartChange { time_ns, earliest_ns, latest_ns, difference: Difference::of([&pair[0].found, &pair[1].found]) }
    };
    let changes = parts.windows(2).map(change).collect();
    Ok(Parts { parts, changes })
}

/// Whether only a model of the sensors, if any, explains the record.
fn asks_for_sensors(found: &Identification) -> bool {
    found.method == FLIGHT_LIKELIHOOD || found.marks.likelihood_failed || found.marks.on_table
}

/// The parts between changes that the likelihood with a model of the sensors found.
fn staged<E: From<IdentificationError>>(
    record: &[MotionSample],
    settings: &Settings,
    stages: &Stages,
    identify: impl Fn(&[MotionSample], &Settings) -> Result<Identification, E>,
) -> Result<Parts, E> {
    let starts = core::iter::once(0).chain(stages.changes.iter().map(|place| place.first_after));
    let ends = stages.changes.iter().map(|place| place.last_before).chain([record.len()]);
    let mut parts = Vec::new();
    for samples in starts.zip(ends).map(|(start, end)| start..end) {
        let settings = if parts.is_empty() { *settings } else { Settings { prior: None, ..*settings } };
        let found = identify(&record[samples.clone()], &settings)?;
        parts.push(Part { samples, found });
    }
    let change = |(index, place): (usize, &Place)| {
        let pair = [&parts[index].found, &parts[index + 1].found];
        let (difference, covariance) = stages.difference(index);
        PartChange {
            time_ns: record[place.likeliest].time_ns,
            earliest_ns: record[place.last_before].time_ns,
            latest_ns: record[place.first_after].time_ns,
            difference: Difference::new(&difference, &covariance, pair),
        }
    };
    let changes = stages.changes.iter().enumerate().map(change).collect();
    Ok(Parts { parts, changes })
}
