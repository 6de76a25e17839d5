//! What the robot holds: momentum through a grasp and a release.

use tumble_dynamics::nalgebra::Vector3;
use tumble_dynamics::{InertialParameters, RigidBodyState, body_momentum, twist_of_momentum};
use tumble_lie::{Pose, Twist};

/// A payload and how it is held.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Grasp {
    /// The payload about the origin of its own frame.
    pub payload: InertialParameters<f64>,
    /// Grasp pose: the payload's frame in the robot's.
    pub robot_from_payload: Pose<f64>,
}

/// How a payload moves before it is taken hold of.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[non_exhaustive]
pub enum PayloadMotion {
    /// As if it were part of the robot already: the twist does not change.
    #[default]
    WithRobot,
    /// It floats at rest in the world, and the robot jerks.
    AtRest,
}

/// A payload that flies on its own again.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ReleasedPayload {
    /// The payload about the origin of its own frame.
    pub payload: InertialParameters<f64>,
    /// Pose and twist of its frame.
    pub state: RigidBodyState<f64>,
}

impl ReleasedPayload {
    /// What leaves a robot in this state.
    pub fn leaving(grasp: &Grasp, robot: &RigidBodyState<f64>) -> Self {
        let state = RigidBodyState {
            world_from_body: robot.world_from_body * grasp.robot_from_payload,
            twist_body: robot.twist_body.transformed_by(&grasp.robot_from_payload.inverse()),
        };
        Self { payload: grasp.payload, state }
    }
}

/// The robot's twist after it became one with `payload`, both described in the robot's frame: the momenta add.
pub(super) fn twist_after_attach(
    robot: &InertialParameters<f64>,
    payload: &InertialParameters<f64>,
    twist_body: &Twist<f64>,
    motion: PayloadMotion,
) -> Twist<f64> {
    match motion {
        PayloadMotion::WithRobot => *twist_body,
        PayloadMotion::AtRest => twist_of_momentum(&(*robot + *payload), &body_momentum(robot, twist_body)),
    }
}

/// What of a body counts for motion in x, y and yaw: nothing that would couple them with the other three directions.
///
/// Linear in the body, so that parts may be added before or after.
#[must_use]
pub fn planar_part(body: &InertialParameters<f64>) -> InertialParameters<f64> {
    let mut part = *body;
    part.first_moment = Vector3::new(body.first_moment.x, body.first_moment.y, 0.0);
    for (row, column) in [(0, 2), (2, 0), (1, 2), (2, 1)] {
        part.inertia_about_origin[(row, column)] = 0.0;
    }
    part
}
