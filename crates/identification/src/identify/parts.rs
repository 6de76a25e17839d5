//! A body that changed within a record: said, and on request identified in parts.

use super::fit::Fit;
use super::{Identification, Settings, Warning, identify};
use crate::BodyScale;
use crate::body_change::{CUTS, Quadratic, likeliest_cut};
use crate::error::IdentificationError;
use crate::likelihood::BodyChange;
use crate::motion::MotionSample;
use core::ops::Range;
use nalgebra::{SMatrix, SVector, Vector6};

/// A change of less than this share of mass, mass times length or inertia is no other body: delays and lags of actuators and
/// sensors that nobody modelled look like as much, and no controller would notice.
const OTHER_BODY: f64 = 0.02;
/// A change counts for what it surely is: less so many standard deviations.
const SURELY: f64 = 3.0;
/// Most parts that a record is taken into.
const MOST_PARTS: usize = 16;

impl Warning {
    /// The change in words with the times between which it lies, ns; `None` where it is small, or no body explains the record anyway.
    pub(super) fn of_change(
        record: &[MotionSample],
        change: &BodyChange,
        scale: BodyScale,
        explained: bool,
    ) -> Option<((i64, i64), Self)> {
        let surely = (change.after - change.before).abs() - change.deviation * SURELY;
        let size = surely.component_div(&scale.parameter_magnitudes()).max();
        let time_ns = |sample: usize| record.get(sample).or(record.last()).map_or(0, |sample| sample.time_ns);
        let (earliest_ns, latest_ns) = (time_ns(change.last_before), time_ns(change.first_sure));
        let told = Self::BodyChanged {
            time_ns: time_ns(change.first_after),
            earliest_ns,
            latest_ns,
            mass_before_kg: change.before[0],
            mass_after_kg: change.after[0],
        };
        (size > OTHER_BODY && explained).then_some(((earliest_ns, latest_ns), told))
    }
}

/// A part of a record in which the body stayed the same.
#[derive(Clone, Debug, PartialEq)]
pub struct Part {
    /// Its samples.
    pub samples: Range<usize>,
    /// What they say.
    pub found: Identification,
}

/// The parts of a record between changes of the body, in the order of time, each by [`identify`]; one part where nothing
/// changed.
///
/// The stretch in which a change may lie belongs to no part. A part too short to say anything is left out; a prior enters the
/// first part only, which is the body it is about.
///
/// # Errors
/// Those of [`identify`] of the whole record.
pub fn identify_parts(record: &[MotionSample], settings: &Settings) -> Result<Vec<Part>, IdentificationError> {
    let whole = 0..record.len();
    let (mut parts, mut open) = (Vec::<Part>::new(), vec![whole]);
    while let Some(samples) = open.pop() {
        let settings = if parts.is_empty() { *settings } else { Settings { prior: None, ..*settings } };
        let found = match identify(&record[samples.clone()], &settings) {
            Ok(found) => found,
            Err(error) if samples.len() == record.len() => return Err(error),
            Err(_) => continue,
        };
        match found.marks.changed_ns {
            Some((earliest_ns, latest_ns)) if parts.len() + open.len() + 1 < MOST_PARTS => {
                let end = record.partition_point(|sample| sample.time_ns <= earliest_ns);
                let start = record.partition_point(|sample| sample.time_ns < latest_ns);
                open.push(start..samples.end);
                open.push(samples.start..end);
            }
            _ => parts.push(Part { samples, found }),
        }
    }
    Ok(parts)
}

/// Whether the rows of a regression ask for another body from some row on; `None` too where noise in the poses made
/// instruments necessary, for whose rows this does not hold.
pub(super) fn body_change(fit: &Fit, parameters: &SVector<f64, 10>) -> Option<BodyChange> {
    let found = fit.least_squares.as_ref().filter(|_| fit.scheme.lag == 1)?;
    let rows = &fit.rows.all;
    let (torque, force) = (found.torque_residual.powi(-2), found.force_residual.powi(-2));
    let weight = Vector6::new(torque, torque, torque, force, force, force);
    let every = rows.len().div_ceil(CUTS).max(1);
    let mut sum = Quadratic { information: SMatrix::zeros(), gradient: SVector::zeros() };
    let mut parts = Vec::new();
    for (i, row) in rows.iter().enumerate().rev() {
        let weighted = SMatrix::<f64, 6, 10>::from_fn(|r, c| weight[r] * row.regressor[(r, c)]);
        sum.information += weighted.transpose() * row.regressor;
        sum.gradient += weighted.transpose() * (row.wrench - row.regressor * parameters);
        if i > 0 && i.is_multiple_of(every) {
            parts.push((i, sum));
        }
    }
    // Neighbouring rows share samples: the covariance knows by how much independent rows would say too much.
    let magnitudes = SMatrix::from_diagonal(&fit.scale().parameter_magnitudes());
    let factor = (magnitudes * sum.information * magnitudes).cholesky()?.l();
    let inverse = magnitudes.try_inverse()?;
    let inflation = factor.transpose() * inverse * found.covariance * inverse * factor;
    let inflation = inflation.symmetric_eigenvalues().max().max(1.0);
    let cut = likeliest_cut(&sum, parts.into_iter(), inflation)?;
    let at = |i: usize| rows.get(i).map_or(usize::MAX, |row| row.index);
    Some(BodyChange {
        last_before: at(cut.place - every),
        first_after: at(cut.place),
        first_sure: at(cut.place + every),
        before: parameters + cut.before,
        after: parameters + cut.after,
        deviation: cut.covariance.diagonal().map(f64::sqrt),
    })
}
