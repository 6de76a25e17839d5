//! Everything a planner is asked.

use tumble_astrobee::simulator::ObstacleMotion;
use tumble_astrobee::worlds::WorldPreset;
use tumble_dynamics::World;
use tumble_dynamics::nalgebra::UnitQuaternion;
use tumble_planning::collision::BodyShape;
use tumble_planning::global::{GoalRegion, MotionLimits};
use tumble_planning::{ModelBelief, TranslationState};

/// Everything a planner is asked.
#[derive(Clone, Debug)]
pub struct PlanningProblem {
    /// Where.
    pub place: WorldPreset,
    /// Volumes and obstacles, as they are at time zero.
    pub world: World,
    /// Those of the obstacles that move, appear or vanish.
    pub obstacle_motions: Vec<ObstacleMotion>,
    /// What moves.
    pub body: BodyShape,
    /// Where it starts.
    pub start: TranslationState,
    /// Its attitude there.
    pub attitude: UnitQuaternion<f64>,
    /// Where to.
    pub goal: GoalRegion,
    /// What the motion keeps within.
    pub limits: MotionLimits,
    /// What the robot is taken for.
    pub belief: ModelBelief,
    /// Distance kept from everything, m.
    pub margin_m: f64,
}
