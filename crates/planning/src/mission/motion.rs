//! What is flown: a plan, then the stop after it, then rest.

use crate::control::ReferenceMotion;
use nalgebra::Vector3;
use tumble_dynamics::{BodyAcceleration, PoseReference, RigidBodyState};
use tumble_lie::{Pose, Twist};

/// How hard a stop after a plan brakes.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct StopLimits {
    /// Along the velocity of the body origin, m/s^2; positive.
    pub acceleration_m_s2: f64,
    /// About the axis of the rate, rad/s^2; positive.
    pub angular_acceleration_rad_s2: f64,
}

/// A motion over all times: rest before its start, what was planned, the stop after it, rest.
#[derive(Clone, Debug)]
pub struct MissionMotion {
    resting: Pose<f64>,
    from_s: f64,
}

impl MissionMotion {
    /// Rest at a pose.
    pub fn resting(world_from_body: Pose<f64>, from_s: f64) -> Self {
        Self { resting: world_from_body, from_s }
    }

    /// When it begins, s.
    pub fn start_s(&self) -> f64 {
        self.from_s
    }

    /// When what was planned ends, and the stop begins, s.
    pub fn end_s(&self) -> f64 {
        self.from_s
    }

    /// When it comes to rest, s.
    pub fn rest_s(&self) -> f64 {
        self.from_s
    }
}

impl ReferenceMotion for MissionMotion {
    fn at(&self, _time_s: f64) -> PoseReference {
        PoseReference {
            state: RigidBodyState { world_from_body: self.resting, twist_body: Twist::zero() },
            acceleration: BodyAcceleration {
                angular_acceleration_body: Vector3::zeros(),
                acceleration_origin_body: Vector3::zeros(),
            },
        }
    }
}
