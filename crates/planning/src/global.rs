//! Long plans around obstacles: a kinodynamic planner that says how far from optimal it is.

mod bound;
mod diagnosis;
mod flight_planner;
mod primitive_rrt;

pub use bound::{Reachability, RouteBound};
pub use diagnosis::diagnose;
pub use flight_planner::{FlightPlanner, FlightPlannerSettings, Replanning, UnderWay};
pub use primitive_rrt::{EdgeCheck, PrimitiveRrt, PrimitiveRrtSettings};

use crate::belief::{ModelBelief, Plan};
use crate::budget::Budget;
use crate::collision::{Blocker, CollisionWorld};
use crate::error::PlanningError;
use crate::motion::{ArcPath, TranslationState};
use nalgebra::{UnitQuaternion, Vector3};
use tumble_dynamics::AlignedBox;
use tumble_lie::Pose;

/// Where the body may be, how fast, and how hard it may be pushed. All in world axes, per axis.
///
/// On a table the box has no height: its least and largest z are those of the start.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct MotionLimits {
    /// Where the body origin may be.
    pub position: AlignedBox,
    /// Largest speed along each axis, m/s.
    pub speed_m_s: Vector3<f64>,
    /// Largest force along each axis, N. World axes: for a body that turns, what is admissible in every attitude.
    pub force_n: Vector3<f64>,
    /// Largest torque about each body axis, N m; only for plans that turn. Zero about an axis: no turn about it, so that on
    /// a table only z has a torque.
    pub torque_n_m: Vector3<f64>,
    /// Largest turning rate, rad/s; only for plans that turn; zero for none.
    pub rate_rad_s: f64,
}

/// Where to arrive.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct GoalRegion {
    /// Centre, world axes, m.
    pub position: Vector3<f64>,
    /// How far from the centre is near enough, m; zero for exactly there.
    pub radius_m: f64,
    /// How fast one may be on arrival, m/s (norm); zero for at rest.
    pub speed_m_s: f64,
    /// The attitude to arrive with, `world_from_body`; any where absent.
    pub attitude: Option<UnitQuaternion<f64>>,
}

impl GoalRegion {
    /// Exactly this pose, at rest.
    pub fn pose(world_from_body: &Pose<f64>) -> Self {
        let (position, attitude) = (world_from_body.translation.vector, Some(world_from_body.rotation));
        Self { position, radius_m: 0.0, speed_m_s: 0.0, attitude }
    }
}

/// What is to be least.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum Objective {
    /// The duration, s.
    Duration,
    /// The impulse, N s: the integral of the sum of the force's absolute components.
    Impulse,
}

/// When a planner may end before its budget does.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum Until {
    /// The first plan that holds.
    FirstPlan,
    /// The cost meets the lower bound, or the budget ends.
    BudgetSpent,
}

/// A planning problem.
#[derive(Debug)]
pub struct GlobalRequest<'a, W: CollisionWorld + ?Sized> {
    /// What may be hit.
    pub world: &'a W,
    /// What moves.
    pub body: &'a W::Body,
    /// Where it starts.
    pub start: TranslationState,
    /// Attitude at the start, `world_from_body`; the rate there is zero.
    pub attitude: UnitQuaternion<f64>,
    /// Mission time of the start, s.
    pub start_s: f64,
    /// Where to.
    pub goal: GoalRegion,
    /// What the motion keeps within.
    pub limits: MotionLimits,
    /// What the body is taken for; its mass turns force into acceleration.
    pub belief: &'a ModelBelief,
    /// What is to be least.
    pub objective: Objective,
    /// Distance kept from everything, m; not negative.
    pub margin_m: f64,
    /// When to end.
    pub until: Until,
    /// All chance follows from it.
    pub seed: u64,
}

/// Why there is no plan.
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
pub enum Obstruction {
    /// Where it starts the body is nearer to something than the margin.
    StartBlocked {
        /// What.
        blocker: Blocker,
        /// Its signed distance there, m: below the margin.
        clearance_m: f64,
    },
    /// Every point of the goal region is blocked.
    GoalBlocked {
        /// What covers its centre.
        blocker: Blocker,
        /// Signed distance at the centre, m.
        clearance_m: f64,
    },
    /// No way leads from the start to the goal.
    Enclosed {
        /// What walls the start off, each once.
        blockers: Vec<Blocker>,
    },
    /// Start or goal lies outside the limits of position or speed.
    OutsideLimits {
        /// Which of the two, and which limit.
        what: &'static str,
        /// Its value.
        value: f64,
        /// The limit.
        limit: f64,
    },
    /// A limit that allows no motion along an axis on which the goal is away.
    LimitTooSmall {
        /// Which limit.
        what: &'static str,
        /// 0 to 2.
        axis: usize,
        /// Its value.
        value: f64,
    },
}

impl core::fmt::Display for Obstruction {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        match self {
            Self::StartBlocked { blocker, clearance_m } => {
                write!(f, "the start is {clearance_m:.3} m from {blocker}, nearer than the margin")
            }
            Self::GoalBlocked { blocker, clearance_m } => {
                write!(f, "the goal is {clearance_m:.3} m from {blocker}, and all of it nearer than the margin")
            }
            Self::Enclosed { blockers } => write!(f, "the start is walled off from the goal by {}", listed(blockers)),
            Self::OutsideLimits { what, value, limit } => write!(f, "{what}: {value}, the limit is {limit}"),
            Self::LimitTooSmall { what, axis, value } => {
                let axis = ["x", "y", "z"].get(*axis).copied().unwrap_or("another axis");
                write!(f, "the limit `{what}` along {axis} is {value}, which allows no motion there")
            }
        }
    }
}

/// Blockers in words.
fn listed(blockers: &[Blocker]) -> String {
    let names: Vec<String> = blockers.iter().map(Blocker::to_string).collect();
    if names.is_empty() { "nothing in particular".to_owned() } else { names.join(", ") }
}

impl core::fmt::Display for Status {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        match self {
            Self::Optimal => f.write_str("a plan, and none is better"),
            Self::Feasible => f.write_str("a plan"),
            Self::Infeasible(obstruction) => write!(f, "there is none: {obstruction}"),
            Self::BudgetSpent(blockers) => write!(f, "not within the budget, most in the way: {}", listed(blockers)),
        }
    }
}

/// How a planner ended.
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
pub enum Status {
    /// The plan's cost is the least there is, to the tolerance of the planner.
    Optimal,
    /// There is a plan; the budget, or the wish for a first plan, ended the search.
    Feasible,
    /// There certainly is none.
    Infeasible(Obstruction),
    /// None was found within the budget; what stood most in the way, the worst first, empty where nothing was hit. Proves
    /// nothing.
    BudgetSpent(Vec<Blocker>),
}

/// A plan's cost at the time it was found.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Improvement {
    /// Units spent by then.
    pub units: u64,
    /// Cost: s or N s.
    pub cost: f64,
}

/// A planner's answer.
#[derive(Clone, Debug, PartialEq)]
pub struct GlobalAnswer {
    /// How it ended.
    pub status: Status,
    /// The best plan; its times count from [`GlobalRequest::start_s`], see [`ArcPath::at`].
    pub plan: Option<Plan<ArcPath>>,
    /// Its cost, s or N s; infinite without a plan.
    pub cost: f64,
    /// No plan costs less; infinite where there is none.
    pub lower_bound: f64,
    /// Units spent.
    pub units: u64,
    /// Each plan that was better than all before it.
    pub history: Vec<Improvement>,
    /// The search tree's edges, for drawing: two positions each, m.
    pub tree: Vec<[Vector3<f64>; 2]>,
}

/// A planner of long motions.
///
/// # Laws
/// `laws::check_global_planner`.
///
/// # Example
/// ```
/// use tumble_planning::collision::CollisionWorld;
/// use tumble_planning::global::{GlobalAnswer, GlobalPlanner, GlobalRequest, Status};
/// use tumble_planning::{Budget, PlanningError};
///
/// /// Knows no way to anywhere, and claims no more than that.
/// struct Lost;
/// impl<W: CollisionWorld + ?Sized> GlobalPlanner<W> for Lost {
///     fn plan(&mut self, _request: &GlobalRequest<'_, W>, _budget: &mut dyn Budget) -> Result<GlobalAnswer, PlanningError> {
///         Ok(GlobalAnswer {
///             status: Status::BudgetSpent(Vec::new()),
///             plan: None,
///             cost: f64::INFINITY,
///             lower_bound: 0.0,
///             units: 0,
///             history: Vec::new(),
///             tree: Vec::new(),
///         })
///     }
/// }
/// use tumble_planning::collision::{BodyShape, EllipsoidWorld};
/// use tumble_planning::dynamics::{AlignedBox, InertialParameters, World};
/// use tumble_planning::global::{GoalRegion, MotionLimits, Objective, Until};
/// use tumble_planning::nalgebra::{UnitQuaternion, Vector3};
/// use tumble_planning::{ModelBelief, TranslationState, Units};
/// let request = GlobalRequest {
///     world: &EllipsoidWorld::new(&World::default())?,
///     body: &BodyShape::sphere(0.2)?,
///     start: TranslationState::at_rest(Vector3::zeros()),
///     attitude: UnitQuaternion::identity(),
///     start_s: 0.0,
///     goal: GoalRegion { position: Vector3::x(), radius_m: 0.1, speed_m_s: 0.0, attitude: None },
///     limits: MotionLimits {
///         position: AlignedBox::between(Vector3::repeat(-2.0), Vector3::repeat(2.0)),
///         speed_m_s: Vector3::repeat(0.2),
///         force_n: Vector3::repeat(0.4),
///         torque_n_m: Vector3::zeros(),
///         rate_rad_s: 0.0,
///     },
///     belief: &ModelBelief::certain(1, InertialParameters::solid_box(9.5, [0.3; 3])),
///     objective: Objective::Duration,
///     margin_m: 0.05,
///     until: Until::BudgetSpent,
///     seed: 1,
/// };
/// let mut planner: Box<dyn GlobalPlanner<EllipsoidWorld>> = Box::new(Lost);
/// assert!(planner.plan(&request, &mut Units::new(100))?.plan.is_none());
/// # Ok::<(), PlanningError>(())
/// ```
/// Tutorial: [a planner of straight lines and one corner](https://github.com/tumble-robotics/tumble/blob/main/examples/servicer/src/dogleg.rs).
pub trait GlobalPlanner<W: CollisionWorld + ?Sized> {
    /// Answers a request; the same request and budget give the same answer.
    ///
    /// # Errors
    /// Ill-posed requests, and what the world cannot answer. That there is no plan is an answer.
    fn plan(&mut self, request: &GlobalRequest<'_, W>, budget: &mut dyn Budget) -> Result<GlobalAnswer, PlanningError>;

    /// The same where a plan to this goal is known, of another body, of another world or from elsewhere: most of it may still do,
    /// and need not be looked for. A planner that does not write this plans as if nothing were known.
    ///
    /// # Errors
    /// As [`plan`](Self::plan).
    fn plan_anew(
        &mut self,
        request: &GlobalRequest<'_, W>,
        known: &ArcPath,
        budget: &mut dyn Budget,
    ) -> Result<GlobalAnswer, PlanningError> {
        let _ = known;
        self.plan(request, budget)
    }
}

impl<W: CollisionWorld + ?Sized, T: GlobalPlanner<W> + ?Sized> GlobalPlanner<W> for Box<T> {
    fn plan(&mut self, request: &GlobalRequest<'_, W>, budget: &mut dyn Budget) -> Result<GlobalAnswer, PlanningError> {
        (**self).plan(request, budget)
    }

    fn plan_anew(
        &mut self,
        request: &GlobalRequest<'_, W>,
        known: &ArcPath,
        budget: &mut dyn Budget,
    ) -> Result<GlobalAnswer, PlanningError> {
        (**self).plan_anew(request, known, budget)
    }
}
