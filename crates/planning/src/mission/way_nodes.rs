//! The way as nodes of a stretch.

use crate::local::Kinematics;
use crate::motion::ArcPath;
use nalgebra::Vector3;
use tumble_lie::Pose;

/// Motion on a way and its acceleration (of the origin, world axes; angular, body axes) at a time since its start: rest
/// before it begins and after it ends. `None` for a way without arcs.
pub(super) fn motion_on(way: &ArcPath, time_s: f64) -> Option<(Kinematics, Vector3<f64>, Vector3<f64>)> {
    let (arc, within_s) = way.at(time_s)?;
    let world_from_body = Pose::from_parts(arc.translation(within_s).0.position.into(), arc.attitude_at(within_s));
    if time_s < 0.0 || time_s >= way.duration_s() {
        return Some((Kinematics::at_rest(world_from_body), Vector3::zeros(), Vector3::zeros()));
    }
    let (translation, acceleration_world) = arc.translation(within_s);
    let (_, rate, angular) = arc.turn(within_s);
    let axis = arc.axis_body.into_inner();
    let motion = Kinematics { world_from_body, velocity_world: translation.velocity, rate_body: axis * rate };
    Some((motion, acceleration_world, axis * angular))
}
