//! What a loop is told about its mission.

use super::brake::BrakeLimits;
use super::coordinator::Schedule;
use super::motion::StopLimits;
use crate::collision::{BodyShape, EllipsoidWorld};
use crate::error::PlanningError;
use crate::global::{GoalRegion, MotionLimits, Objective};
use crate::local::{Hull, Surroundings};
use tumble_dynamics::{Environment, World};
use tumble_identification::recursive::LearningTargets;

/// What is around the robot, as far as it knows.
#[derive(Clone, Debug)]
pub struct Scene<W> {
    /// For ways and checks.
    pub world: W,
    /// The same for stretches.
    pub surroundings: Surroundings,
}

impl Scene<EllipsoidWorld> {
    /// Walls and solids at rest, for a body of this shape.
    ///
    /// # Errors
    /// A world that cannot be.
    pub fn of_world(world: &World, body: &BodyShape) -> Result<Self, PlanningError> {
        let surroundings = Surroundings::of_world(world, Hull::Shape(body.clone()))?;
        Ok(Self { world: EllipsoidWorld::new(world)?, surroundings })
    }
}

/// When the robot is where it was to be.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct AtGoal {
    /// Distance from the goal, m.
    pub distance_m: f64,
    /// Angle from its attitude, rad.
    pub angle_rad: f64,
    /// Speed, m/s.
    pub speed_m_s: f64,
    /// Rate, rad/s.
    pub rate_rad_s: f64,
}

impl Default for AtGoal {
    /// Two centimetres, three degrees, and hardly a motion.
    fn default() -> Self {
        Self { distance_m: 0.02, angle_rad: 0.05, speed_m_s: 0.005, rate_rad_s: 0.01 }
    }
}

/// What a closed loop is told about its mission.
#[derive(Clone, Debug)]
pub struct LoopSettings<B> {
    /// Times and limits of the decisions.
    pub schedule: Schedule,
    /// Control periods between decisions.
    pub decision_periods: u64,
    /// Time between two beliefs, ns.
    pub belief_period_ns: i64,
    /// Whether beliefs reach planners and controller.
    pub feedback: bool,
    /// What moves.
    pub body: B,
    /// Where to; ignored where only stretches are counted.
    pub goal: GoalRegion,
    /// When that is reached.
    pub at_goal: AtGoal,
    /// What a way keeps within.
    pub limits: MotionLimits,
    /// What is least of a way.
    pub objective: Objective,
    /// Distance kept by ways and stretches, m.
    pub margin_m: f64,
    /// Distance below which a stretch is not flown, m; less than the margin.
    pub check_margin_m: f64,
    /// How stops brake as long as no more is known of the body than at first; when it is known to be lighter than it might have
    /// been, they brake harder.
    pub stop: StopLimits,
    /// What the brake may use where such a stop would hit something.
    pub brake: BrakeLimits,
    /// What acts on the body besides its actuators: told here once, estimator, planners, controller and stops reckon with it. The
    /// time of the models is the mission's.
    pub environment: Environment,
    /// Budget of a way from rest, and of one after a search in vain.
    pub way_units: u64,
    /// Budget of a new way in flight.
    pub new_way_units: u64,
    /// Budget of a stretch.
    pub stretch_units: u64,
    /// When the body is known well enough, so that information has no more weight; never where absent.
    pub known: Option<LearningTargets>,
    /// Relative change of the mass that asks for another way.
    pub material_change: f64,
    /// All chance follows from it.
    pub seed: u64,
}

impl<B> LoopSettings<B> {
    /// The usual times, margins and budgets for a body of some decimetres that flies to a goal with some centimetres per second,
    /// decides at every twelfth control period and learns as it flies.
    ///
    /// A way takes a second to plan, a stretch about as long; 4.5 cm are planned for around everything, and what is flown keeps 2.7.
    /// Times of the decisions are those of [`Schedule::default`].
    pub fn new(body: B, goal: GoalRegion, limits: MotionLimits, stop: StopLimits, brake: BrakeLimits) -> Self {
        Self {
            schedule: Schedule::default(),
            decision_periods: 12,
            belief_period_ns: 2_000_000_000,
            feedback: true,
            body,
            goal,
            at_goal: AtGoal::default(),
            limits,
            objective: Objective::Duration,
            margin_m: 0.045,
            check_margin_m: 0.027,
            stop,
            brake,
            environment: Environment::default(),
            way_units: 20_000,
            new_way_units: 1_200,
            stretch_units: 25_600,
            known: None,
            material_change: 0.15,
            seed: 1,
        }
    }
}
