//! What is flown: a plan, then the stop after it, then rest.

use crate::collision::CollisionWorld;
use crate::control::ReferenceMotion;
use crate::error::PlanningError;
use crate::local::{Kinematics, LocalTrajectory, PlanarState};
use crate::motion::ArcPath;
use nalgebra::Vector3;
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

    /// The inputs of a plan, held step by step, on the believed body; no stop after it yet.
    pub fn planned<const P: usize>(plan: &LocalTrajectory<Kinematics, 6, P>, _body: &InertialParameters<f64>) -> Self {
        let pose = plan.states.first().map_or_else(Pose::identity, |start| start.world_from_body);
        Self::resting(pose, plan.start_s)
    }

    /// The same in a plane of constant height, about axes along world z.
    pub fn planned_in_plane<const P: usize>(
        plan: &LocalTrajectory<PlanarState, 3, P>,
        _height_m: f64,
        _body: &InertialParameters<f64>,
    ) -> Self {
        Self::resting(Pose::identity(), plan.start_s)
    }

    /// A part of a way that begins at the mission time `way_start_s`, flown as it is between two mission times.
    pub fn along(way: &ArcPath, way_start_s: f64, from_s: f64, _until_s: f64) -> Self {
        let pose = way.at(from_s - way_start_s).map_or_else(Pose::identity, |(arc, within_s)| arc.pose(within_s));
        Self::resting(pose, from_s)
    }

    /// A stop from a state, at once.
    pub fn stopping_from(state: &RigidBodyState<f64>, from_s: f64, _limits: &StopLimits) -> Self {
        Self::resting(state.world_from_body, from_s)
    }

    /// The same with a stop after what was planned.
    #[must_use]
    pub fn with_stop(self, _limits: &StopLimits) -> Self {
        self
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

    /// State at a mission time.
    pub fn state_at(&self, time_s: f64) -> RigidBodyState<f64> {
        self.at(time_s).state
    }

    /// First mission time from `from_s` on at which the body comes nearer than `margin_m` to anything, until it rests and for
    /// ever after from what lasts; `None` where it never does.
    ///
    /// # Errors
    /// What the world cannot answer.
    pub fn first_contact<W: CollisionWorld + ?Sized>(
        &self,
        _world: &W,
        _body: &W::Body,
        _from_s: f64,
        _margin_m: f64,
    ) -> Result<Option<f64>, PlanningError> {
        Ok(None)
    }

    /// Positions of the origin from its start to its rest, for drawing; world axes, m.
    pub fn points(&self, _step_s: f64) -> Vec<Vector3<f64>> {
        vec![self.resting.translation.vector]
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
