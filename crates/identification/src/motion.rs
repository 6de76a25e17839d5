//! One row of a motion log.

use crate::lie::{LieGroup, Pose, Wrench};
use nalgebra::{UnitQuaternion, Vector3};

/// What was measured at one time. Only the time is compulsory: a gyroscope between two star fixes, an accelerometer alone.
///
/// What is made of a record needs more: rows from poses, poses; Newton-Euler rows poses, rates and velocities, or rates and
/// accelerations where nothing falls; the likelihood and the filters at least some poses. What is missing is named in
/// [`IdentificationError::MissingColumn`](crate::IdentificationError::MissingColumn).
///
/// # Frame
/// As the names say; `acceleration_origin_body` is the inertial acceleration of the body origin in body axes, what an
/// ideal accelerometer there reads where there is no gravity. The wrench is everything except gravity.
/// # Units
/// ns, m, rad/s, m/s, m/s^2, N m, N.
///
/// # Example
/// ```
/// use tumble_identification::MotionSample;
/// use tumble_identification::nalgebra::Vector3;
/// let gyroscope = MotionSample { time_ns: 40_000_000, rate_body: Some(Vector3::z() * 0.1), ..MotionSample::default() };
/// assert!(gyroscope.world_from_body.is_none());
/// ```
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct MotionSample {
    /// Time, ns; an integer, so that a clock that counts from 1970 loses nothing.
    pub time_ns: i64,
    /// Pose of the body frame in the inertial frame; `None` where it was not seen.
    pub world_from_body: Option<Pose<f64>>,
    /// Velocity of the body origin, inertial axes.
    pub velocity_origin_world: Option<Vector3<f64>>,
    /// Angular velocity, body axes.
    pub rate_body: Option<Vector3<f64>>,
    /// Inertial acceleration of the body origin, body axes.
    pub acceleration_origin_body: Option<Vector3<f64>>,
    /// Wrench on the body about its origin, body axes; [`WrenchTiming`](crate::WrenchTiming) says when it acts. Of wheels it
    /// holds the reaction to their motors, not the torque of turning what they hold.
    pub wrench_body: Option<Wrench<f64>>,
    /// What acts on the body beside that wrench at this time, body axes, torque about the origin: gravity gradient, drag. It
    /// varies smoothly, whatever the timing of the wrench; [`with_all_that_acts`](crate::with_all_that_acts) fills it in.
    pub besides_body: Option<Wrench<f64>>,
    /// Angular momentum of wheels relative to the body at this time, body axes, N m s; `None` without wheels, and where it was not
    /// sampled: it changes evenly between two samples of it, as what acts beside does.
    pub stored_momentum_body: Option<Vector3<f64>>,
}

impl MotionSample {
    /// Whether more acts than the logged wrench.
    pub(crate) fn has_more_than_logged(&self) -> bool {
        self.stored_momentum_body.is_some() || self.besides_body.is_some()
    }
}

/// Whether nothing acts, by all that is logged.
pub(crate) fn is_without_wrench(record: &[MotionSample]) -> bool {
    let is_all_logged = !record.iter().any(MotionSample::has_more_than_logged);
    is_all_logged && record.iter().filter_map(|s| s.wrench_body).all(|w| w.to_vector().amax() == 0.0)
}

/// The poses of a record, those that were not seen filled in between those that were: turned by the rates where there are
/// some, else evenly; before the first and after the last they keep their place. `None` where none was seen.
pub(crate) fn filled_poses(record: &[MotionSample]) -> Option<Vec<Pose<f64>>> {
    let seen: Vec<usize> = (0..record.len()).filter(|&i| record[i].world_from_body.is_some()).collect();
    let pose = |i: usize| record[i].world_from_body.unwrap_or_default();
    let first = *seen.first()?;
    let mut poses = vec![pose(first); record.len()];
    let seconds = |from: usize, to: usize| (record[to].time_ns - record[from].time_ns) as f64 * 1e-9;
    let mut next = 0;
    for i in first..record.len() {
        if seen.get(next) == Some(&i) {
            poses[i] = pose(i);
            next += 1;
            continue;
        }
        let (before, after) = (seen[next - 1], seen.get(next).copied());
        let rate = |i: usize| record[i].rate_body;
        let turn =
            rate(i - 1).or(rate(i)).zip(rate(i).or(rate(i - 1))).map(|(a, b)| (a + b) * (0.5 * seconds(i - 1, i)));
        let share = |after: usize| seconds(before, i) / seconds(before, after).max(f64::MIN_POSITIVE);
        let evenly = |after: usize| {
            let whole: Vector3<f64> = LieGroup::log(&pose(before).rotation.between(&pose(after).rotation));
            pose(before).rotation * UnitQuaternion::from_scaled_axis(whole * share(after))
        };
        let rotation = match (turn, after) {
            (Some(turn), _) => poses[i - 1].rotation * UnitQuaternion::from_scaled_axis(turn),
            (None, Some(after)) => evenly(after),
            (None, None) => pose(before).rotation,
        };
        let place = |i: usize| pose(i).translation.vector;
        let translation =
            after.map_or(place(before), |after| place(before) + (place(after) - place(before)) * share(after));
        poses[i] = Pose::from_parts(translation.into(), rotation);
    }
    Some(poses)
}

/// Noise levels found in the data, one standard deviation per sample and axis.
#[derive(Clone, Copy, Debug, PartialEq, Default)]
pub struct Noise {
    /// Wrench noise that explains the torque residual, N m.
    pub torque_n_m: f64,
    /// Wrench noise that explains the force residual, N.
    pub force_n: f64,
    /// Attitude noise, rad.
    pub attitude_rad: f64,
    /// Position noise, m.
    pub position_m: f64,
    /// Noise of the angular velocity, rad/s; zero where it was not measured or not used.
    pub rate_rad_s: f64,
    /// Noise of the velocity, m/s; zero where it was not measured or not used.
    pub velocity_m_s: f64,
    /// Noise of the acceleration, m/s^2; zero where it was not measured or not used.
    pub acceleration_m_s2: f64,
}
