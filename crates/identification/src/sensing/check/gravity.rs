//! Gravity that the publisher of accelerations put back by an attitude that errs.

use super::attitude::Attitude;
use super::found::Found;
use super::regression::{Rows, spans};
use super::turned::{Turned, series};
use crate::motion::MotionSample;
use nalgebra::{UnitQuaternion, Vector3};

/// Span of the increments, s: slow errors of an attitude change within it, and an integrated rate hardly errs.
const SPAN_S: f64 = 2.0;
/// Gravity, and what a bias adds as the body turns; m/s^2.
const PRIORS: [f64; 4] = [30.0, 10.0, 10.0, 10.0];
/// More rows than these are thinned.
const MOST_ROWS: usize = 4000;
/// Known no better than this it is not known, m/s^2.
const KNOWN: f64 = 1.0;

/// Along the inertial z axis, m/s^2.
///
/// The unit feels gravity along the true vertical; whoever takes it out along the vertical of the published attitude leaves the difference,
/// which stands out from the motion because the integrated rate knows how that vertical should have turned.
pub(super) fn added(record: &[MotionSample], attitude: &Attitude, turned: &Turned) -> Option<Found> {
    let age_s = attitude.age.map_or(0.0, |age| age.value);
    // Axes about which nothing turned are where they should be.
    let is_aligned = attitude.misalignment.iter().all(Option::is_some);
    let pose_from_rate = if is_aligned { attitude.pose_from_rate } else { UnitQuaternion::identity() };
    let (times, seen) = series(record, |row| {
        let up_pose = row.world_from_body?.rotation.inverse_transform_vector(&Vector3::z());
        Some((pose_from_rate.inverse_transform_vector(&up_pose), row.acceleration_origin_body?))
    });
    let every = times.len().div_ceil(MOST_ROWS);
    let times: Vec<f64> = times.into_iter().step_by(every.max(1)).collect();
    let seen: Vec<_> = seen.into_iter().step_by(every.max(1)).collect();
    let mut rows = Rows::new(PRIORS.len());
    for (i, j) in spans(&times, SPAN_S) {
        let Some((from, to)) = turned.between(times[i] - age_s, times[j] - age_s) else { continue };
        let back = to.attitude.conjugate() * from.attitude;
        let changed = |then: &Vector3<f64>, now: &Vector3<f64>| now - back * then;
        let ((up_then, felt_then), (up, felt)) = (&seen[i], &seen[j]);
        let bias = |axis: Vector3<f64>| changed(&axis, &axis);
        let changes = [changed(up_then, up), bias(Vector3::x()), bias(Vector3::y()), bias(Vector3::z())];
        let felt = changed(felt_then, felt);
        rows.push(times[i], felt, felt, &changes);
    }
    let found = rows.solve(&PRIORS, 2.0 * SPAN_S)?;
    (found.sigma[0] < KNOWN).then_some(Found { value: found.step[0], sigma: found.sigma[0] })
}
