//! Whether the body changed within a record.

use super::fit::Fit;
use super::warning::Warning;
use crate::BodyScale;
use crate::body_change::{CUTS, Quadratic, likeliest_cut};
use crate::likelihood::BodyChange;
use crate::motion::MotionSample;
use nalgebra::{SMatrix, SVector, Vector6};

/// A change of less than this share of mass, mass times length or inertia is no other body: delays and lags of actuators and
/// sensors that nobody modelled look like as much, and no controller would notice.
const OTHER_BODY: f64 = 0.02;
/// A change counts for what it surely is: less so many standard deviations.
pub(super) const SURELY: f64 = 3.0;

impl Warning {
    /// The change in words, with when it was no earlier, most likely and no later, ns; `None` where it is small, or no body explains the record anyway.
    pub(super) fn of_change(
        record: &[MotionSample],
        change: &BodyChange,
        scale: BodyScale,
        explained: bool,
    ) -> Option<([i64; 3], Self)> {
        let surely = (change.after - change.before).abs() - change.deviation * SURELY;
        let size = surely.component_div(&scale.parameter_magnitudes()).max();
        let time_ns = |sample: usize| record.get(sample).or(record.last()).map_or(0, |sample| sample.time_ns);
        let places = [change.last_before, change.first_after, change.first_sure];
        let [earliest_ns, time_ns, latest_ns] = places.map(time_ns);
        let told = Self::BodyChanged {
            time_ns,
            earliest_ns,
            latest_ns,
            mass_before_kg: change.before[0],
            mass_after_kg: change.after[0],
        };
        (size > OTHER_BODY && explained).then_some(([earliest_ns, time_ns, latest_ns], told))
    }
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
