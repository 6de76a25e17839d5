//! Following a reference pose with a fixed model (`f64`: a decision).

use crate::free_flyer::{BodyAcceleration, FreeFlyer};
use crate::state::RigidBodyState;
use tumble_lie::{LieGroup, Wrench};

/// Where the body should be, and how it should move, at one instant.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PoseReference {
    /// Wanted pose and twist, in the axes of the wanted body frame.
    pub state: RigidBodyState<f64>,
    /// Wanted acceleration, in the axes of the wanted body frame.
    pub acceleration: BodyAcceleration<f64>,
}

/// Proportional-derivative tracking with feed-forward of a nominal body; no belief, no limits.
///
/// The error of the body obeys `e'' + damping e' + stiffness e = 0` when the nominal body is the true one.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PoseTracker {
    /// Nominal body.
    pub body: FreeFlyer<f64>,
    /// Angular acceleration per rotation error, 1/s^2.
    pub rotation_stiffness: f64,
    /// Angular acceleration per angular velocity error, 1/s.
    pub rotation_damping: f64,
    /// Acceleration per position error, 1/s^2.
    pub position_stiffness: f64,
    /// Acceleration per velocity error, 1/s.
    pub position_damping: f64,
}

impl PoseTracker {
    /// Critically damped with the given natural frequencies of rotation and position, rad/s.
    pub fn critically_damped(body: FreeFlyer<f64>, rotation_rad_s: f64, position_rad_s: f64) -> Self {
        Self {
            body,
            rotation_stiffness: rotation_rad_s * rotation_rad_s,
            rotation_damping: 2.0 * rotation_rad_s,
            position_stiffness: position_rad_s * position_rad_s,
            position_damping: 2.0 * position_rad_s,
        }
    }

    /// The wrench to ask for, body axes, torque about the body origin.
    pub fn wrench_body(&self, state: &RigidBodyState<f64>, reference: &PoseReference) -> Wrench<f64> {
        let body_from_world = state.world_from_body.rotation.inverse();
        let body_from_wanted = body_from_world * reference.state.world_from_body.rotation;
        let wanted_angular_velocity = body_from_wanted * reference.state.twist_body.angular;
        let angular_velocity = &state.twist_body.angular;
        let rotation_error = LieGroup::log(&body_from_wanted);
        let position_error = body_from_world
            * (reference.state.world_from_body.translation.vector - state.world_from_body.translation.vector);
        let velocity_error = body_from_wanted * reference.state.twist_body.linear - state.twist_body.linear;
        // the wanted rate is carried into axes that themselves turn
        let angular_acceleration_body = body_from_wanted * reference.acceleration.angular_acceleration_body
            - angular_velocity.cross(&wanted_angular_velocity)
            + rotation_error * self.rotation_stiffness
            + (wanted_angular_velocity - angular_velocity) * self.rotation_damping;
        let acceleration_origin_body = body_from_wanted * reference.acceleration.acceleration_origin_body
            + position_error * self.position_stiffness
            + velocity_error * self.position_damping;
        let acceleration = BodyAcceleration { angular_acceleration_body, acceleration_origin_body };
        self.body.inverse(&state.twist_body, &acceleration)
    }
}
