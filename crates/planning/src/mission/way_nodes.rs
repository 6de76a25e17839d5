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

#[cfg(test)]
#[allow(clippy::float_cmp, reason = "the same operations give the same bits")]
mod tests {
    use super::*;
    use crate::motion::{BodyArc, TranslationState};
    use nalgebra::{UnitQuaternion, Vector3};
    use tumble_lie::LieGroup;

    fn way() -> ArcPath {
        let start = TranslationState { position: Vector3::new(1.0, 2.0, 3.0), velocity: Vector3::new(0.1, -0.05, 0.0) };
        let attitude = UnitQuaternion::from_euler_angles(0.3, -0.2, 1.0);
        let first = BodyArc::accelerated(4.0, &start, Vector3::new(0.0, 0.01, -0.02), attitude);
        let next = first.translation(4.0).0;
        let axis = nalgebra::Unit::new_normalize(Vector3::new(1.0, -2.0, 0.5));
        let second = BodyArc::accelerated(3.0, &next, Vector3::new(0.02, 0.0, 0.01), attitude);
        ArcPath::new([first, second.turning(axis, [0.0, 0.2, 0.05, -0.02, 0.0, 0.0])])
    }

    /// Velocities, rates and accelerations against quotients of poses, velocities and rates.
    #[test]
    fn nodes_move_as_the_way_does() {
        let (way, width) = (way(), 1e-4);
        for time_s in [0.7, 3.1, 4.6, 6.2] {
            let [before, here, after] = [-width, 0.0, width].map(|offset| motion_on(&way, time_s + offset).unwrap());
            let by = 1.0 / (2.0 * width);
            let quotient = (after.0.position_world() - before.0.position_world()) * by;
            assert!((quotient - here.0.velocity_world).amax() < 1e-9);
            assert!(((after.0.velocity_world - before.0.velocity_world) * by - here.1).amax() < 1e-9);
            let turned = before.0.world_from_body.rotation.inverse() * after.0.world_from_body.rotation;
            assert!((turned.log() * by - here.0.rate_body).amax() < 1e-7);
            assert!(((after.0.rate_body - before.0.rate_body) * by - here.2).amax() < 1e-7);
        }
    }

    #[test]
    fn a_way_rests_before_it_begins_and_after_it_ends() {
        let way = way();
        for (time_s, at_s) in [(-1.0, 0.0), (7.0, 7.0), (1e9, 7.0), (f64::INFINITY, 7.0)] {
            let (motion, acceleration, angular) = motion_on(&way, time_s).unwrap();
            let (arc, within_s) = way.at(at_s).unwrap();
            assert_eq!(motion, Kinematics::at_rest(arc.pose(within_s)), "{time_s}");
            assert_eq!((acceleration, angular), (Vector3::zeros(), Vector3::zeros()));
        }
        assert_eq!(motion_on(&ArcPath::default(), 1.0), None);
    }
}
