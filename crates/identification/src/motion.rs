//! One row of a motion log.

use crate::lie::{Pose, Wrench};
use nalgebra::Vector3;

/// What was measured at one time. Only the pose is compulsory.
///
/// # Frame
/// As the names say; `acceleration_origin_body` is the inertial acceleration of the body origin in body axes, what an
/// ideal accelerometer there reads where there is no gravity. The wrench is everything except gravity.
/// # Units
/// ns, m, rad/s, m/s, m/s^2, N m, N.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct MotionSample {
    /// Time, ns; an integer, so that a clock that counts from 1970 loses nothing.
    pub time_ns: i64,
    /// Pose of the body frame in the inertial frame.
    pub world_from_body: Pose<f64>,
    /// Velocity of the body origin, inertial axes.
    pub velocity_origin_world: Option<Vector3<f64>>,
    /// Angular velocity, body axes.
    pub rate_body: Option<Vector3<f64>>,
    /// Inertial acceleration of the body origin, body axes.
    pub acceleration_origin_body: Option<Vector3<f64>>,
    /// Wrench on the body about its origin, body axes; [`WrenchTiming`](crate::WrenchTiming) says when it acts. Of wheels it
    /// holds the reaction to their motors, not the torque of turning what they hold.
    pub wrench_body: Option<Wrench<f64>>,
    /// Angular momentum of wheels relative to the body at this time, body axes, N m s; `None` without wheels.
    pub stored_momentum_body: Option<Vector3<f64>>,
}
