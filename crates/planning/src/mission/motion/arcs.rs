//! Arcs as something to follow: what they are at a time, what is left of them, and how a motion comes to rest.

use crate::collision::polynomial::about;
use crate::motion::{ArcPath, BodyArc, COEFFICIENTS, TranslationState};
use nalgebra::{Unit, Vector3};
use tumble_dynamics::{BodyAcceleration, InertialParameters, PoseReference, RigidBodyState};
use tumble_lie::{Pose, Twist};

/// How hard a stop after a plan brakes.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct StopLimits {
    /// Along the velocity of the body origin, m/s^2; positive.
    pub acceleration_m_s2: f64,
    /// About the axis of the rate, rad/s^2; positive.
    pub angular_acceleration_rad_s2: f64,
}

impl StopLimits {
    /// As hard as a force (N) and a torque (N m), in any direction, can brake a body: let it be the heaviest that there may be.
    pub fn for_body(heaviest: &InertialParameters<f64>, force_n: f64, torque_n_m: f64) -> Self {
        let moment = heaviest.inertia_about_com().diagonal().max();
        Self { acceleration_m_s2: force_n / heaviest.mass, angular_acceleration_rad_s2: torque_n_m / moment }
    }
}

/// State and acceleration at a time within an arc, exactly consistent.
pub(super) fn reference(arc: &BodyArc, within_s: f64) -> PoseReference {
    let (TranslationState { position, velocity }, acceleration) = arc.translation(within_s);
    let (_, rate, rate_change) = arc.turn(within_s);
    let attitude = arc.attitude_at(within_s);
    let (body_from_world, axis) = (attitude.inverse(), arc.axis_body.into_inner());
    PoseReference {
        state: RigidBodyState {
            world_from_body: Pose::from_parts(position.into(), attitude),
            twist_body: Twist::new(axis * rate, body_from_world * velocity),
        },
        acceleration: BodyAcceleration {
            angular_acceleration_body: axis * rate_change,
            acceleration_origin_body: body_from_world * acceleration,
        },
    }
}

/// Rest at a pose.
pub(super) fn at_rest(world_from_body: Pose<f64>) -> PoseReference {
    PoseReference {
        state: RigidBodyState { world_from_body, twist_body: Twist::zero() },
        acceleration: BodyAcceleration {
            angular_acceleration_body: Vector3::zeros(),
            acceleration_origin_body: Vector3::zeros(),
        },
    }
}

/// The same motion between two times of an arc.
pub(super) fn part(arc: &BodyArc, begin_s: f64, end_s: f64) -> BodyArc {
    let duration_s = end_s - begin_s;
    if begin_s <= 0.0 {
        return BodyArc { duration_s, ..*arc };
    }
    let mut angle = about(&arc.angle, COEFFICIENTS - 1, begin_s);
    angle[0] = 0.0;
    let position = about(&arc.position, COEFFICIENTS - 1, begin_s);
    BodyArc { duration_s, position, attitude: arc.attitude_at(begin_s), axis_body: arc.axis_body, angle }
}

/// Staying at a pose.
pub(super) fn staying(world_from_body: &Pose<f64>, duration_s: f64) -> BodyArc {
    let start = TranslationState::at_rest(world_from_body.translation.vector);
    BodyArc::accelerated(duration_s, &start, Vector3::zeros(), world_from_body.rotation)
}

/// The part of a path between two times since its start.
pub(super) fn between(way: &ArcPath, begin_s: f64, end_s: f64) -> ArcPath {
    let mut since_s = 0.0;
    ArcPath::new(way.arcs().iter().map(|arc| {
        let (from_s, to_s) = (f64::max(begin_s - since_s, 0.0), f64::min(end_s - since_s, arc.duration_s));
        since_s += arc.duration_s;
        part(arc, f64::min(from_s, arc.duration_s), to_s)
    }))
}

/// Unit vector and length; no direction where there is no length.
fn direction(vector: &Vector3<f64>) -> (Vector3<f64>, f64) {
    Unit::try_new_and_get(*vector, 0.0).map_or((Vector3::zeros(), 0.0), |(unit, length)| (unit.into_inner(), length))
}

/// Time in which a speed is braked to zero; none where there is no such time.
fn braking_s(speed: f64, deceleration: f64) -> f64 {
    let time_s = speed / deceleration;
    if time_s.is_finite() && time_s > 0.0 { time_s } else { 0.0 }
}

/// From a state to rest, braking at a constant deceleration along the velocity of the origin, and of the rate about its axis.
pub(super) fn stop(state: &RigidBodyState<f64>, limits: &StopLimits) -> ArcPath {
    let RigidBodyState { world_from_body: Pose { rotation, translation }, twist_body } = state;
    let (ahead, speed) = direction(&(rotation * twist_body.linear));
    let (axis, rate) = direction(&twist_body.angular);
    let moving_s = braking_s(speed, limits.acceleration_m_s2);
    let turning_s = braking_s(rate, limits.angular_acceleration_rad_s2);
    let mut braking = staying(&Pose::from_parts(*translation, *rotation), f64::max(moving_s, turning_s));
    if moving_s > 0.0 {
        braking.position[1] = ahead * speed;
        braking.position[2] = ahead * (-0.5 * speed / moving_s);
    }
    if turning_s > 0.0 {
        braking.axis_body = Unit::new_unchecked(axis);
        braking.angle[1] = rate;
        braking.angle[2] = -0.5 * rate / turning_s;
    }
    let first_s = f64::min(moving_s, turning_s);
    let mut rest = part(&braking, first_s, braking.duration_s);
    if moving_s <= turning_s {
        rest.position = staying(&rest.pose(0.0), 0.0).position;
    }
    if turning_s <= moving_s {
        rest.angle = [0.0; COEFFICIENTS];
    }
    ArcPath::new([BodyArc { duration_s: first_s, ..braking }, rest])
}
