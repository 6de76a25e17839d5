//! The next seconds of the way, whatever the number of unknowns and axes.

use super::motion::MissionMotion;
use crate::belief::ModelBelief;
use crate::budget::Budget;
use crate::collision::Blocker;
use crate::error::PlanningError;
use crate::local::{LocalStatus, Surroundings};
use crate::motion::ArcPath;
use tumble_dynamics::{Environment, RigidBodyState};

/// A stretch to plan.
pub struct StretchTask<'a> {
    /// The state at its start, as it is predicted.
    pub start: RigidBodyState<f64>,
    /// Mission time of the start, s.
    pub start_s: f64,
    /// Mission time of the belief, s: what the last plan taught between then and the start will be known by the start.
    pub asked_s: f64,
    /// The way to follow.
    pub way: &'a ArcPath,
    /// Mission time at which the way begins, s.
    pub way_start_s: f64,
    /// What the body is taken for.
    pub belief: &'a ModelBelief,
    /// What may be hit.
    pub surroundings: &'a Surroundings,
    /// What acts besides the actuators.
    pub environment: &'a Environment,
    /// Whether information has any weight: not where only arriving counts.
    pub is_informative: bool,
    /// Mission time since the first way, s, for weights that follow a schedule.
    pub elapsed_s: f64,
}

/// A stretch as planned.
#[derive(Clone, Debug)]
pub struct StretchAnswer {
    /// What to fly: it begins where the task said; no stop after it yet.
    pub motion: MissionMotion,
    /// Whether it ends at rest at the end of the way.
    pub is_last: bool,
    /// Mission time from which on it stays there, s; none where it does not end there.
    pub arrival_s: Option<f64>,
    /// How the planner ended.
    pub status: LocalStatus,
    /// Names of the quantities that are not known.
    pub quantities: Vec<&'static str>,
    /// Weight of the variance of each.
    pub weights: Vec<f64>,
    /// Standard deviation of each at the start and as predicted at the end.
    pub sigma: Vec<[f64; 2]>,
}

impl StretchAnswer {
    /// A part of a way, flown as it is.
    pub fn along_way(way: &ArcPath, way_start_s: f64, from_s: f64, until_s: f64) -> Self {
        Self {
            motion: MissionMotion::along(way, way_start_s, from_s, until_s),
            is_last: until_s >= way_start_s + way.duration_s(),
            arrival_s: (until_s >= way_start_s + way.duration_s()).then_some(until_s),
            status: LocalStatus::Feasible,
            quantities: Vec::new(),
            weights: Vec::new(),
            sigma: Vec::new(),
        }
    }
}

/// Why there is none.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct StretchRefusal {
    /// Largest violation, in units of the limit.
    pub violation: f64,
    /// What was in the way, where it was that.
    pub blocker: Option<Blocker>,
}

/// What a planner of stretches answers.
#[derive(Clone, Debug)]
pub enum StretchOutcome {
    /// A stretch.
    Planned(Box<StretchAnswer>),
    /// None, and why.
    Refused(StretchRefusal),
}

impl StretchOutcome {
    /// The stretch, where there is one.
    pub fn planned(self) -> Option<StretchAnswer> {
        match self {
            Self::Planned(answer) => Some(*answer),
            Self::Refused(_) => None,
        }
    }

    /// Why there is none, where there is none.
    pub fn refused(&self) -> Option<&StretchRefusal> {
        match self {
            Self::Planned(_) => None,
            Self::Refused(refusal) => Some(refusal),
        }
    }
}

/// A planner of stretches: a [`crate::local::LocalPlanner`] with its weighting, its sizes hidden;
/// [`InformativeStretch`](super::InformativeStretch) makes one of any.
///
/// # Example
/// ```
/// use tumble_planning::mission::{StretchOutcome, StretchPlanner, StretchRefusal, StretchTask};
/// use tumble_planning::{Budget, PlanningError};
///
/// /// Refuses everything, so that the way is flown as it is.
/// struct Lazy;
/// impl StretchPlanner for Lazy {
///     fn horizon_s(&self) -> f64 {
///         10.0
///     }
///     fn plan(&mut self, _task: &StretchTask<'_>, _budget: &mut dyn Budget) -> Result<StretchOutcome, PlanningError> {
///         Ok(StretchOutcome::Refused(StretchRefusal { violation: 1.0, blocker: None }))
///     }
/// }
/// let planner: Box<dyn StretchPlanner> = Box::new(Lazy);
/// assert_eq!(planner.horizon_s(), 10.0);
/// ```
/// Tutorial: [layers of your own](https://github.com/tumble-robotics/tumble/blob/main/crates/planning/tests/suite/custom_robot/own_layers.rs).
pub trait StretchPlanner {
    /// Length of a stretch, s.
    fn horizon_s(&self) -> f64;

    /// Plans one.
    ///
    /// # Errors
    /// A task that cannot be. That no plan keeps the limits is an answer.
    fn plan(&mut self, task: &StretchTask<'_>, budget: &mut dyn Budget) -> Result<StretchOutcome, PlanningError>;
}

/// Stretches that are the way as it is: nothing is searched for, and nothing learned on purpose.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct AlongWay {
    /// Length of a stretch, s.
    pub horizon_s: f64,
}

impl StretchPlanner for AlongWay {
    fn horizon_s(&self) -> f64 {
        self.horizon_s
    }

    fn plan(&mut self, task: &StretchTask<'_>, _budget: &mut dyn Budget) -> Result<StretchOutcome, PlanningError> {
        let until_s = (task.start_s + self.horizon_s).min(task.way_start_s + task.way.duration_s());
        let answer = StretchAnswer::along_way(task.way, task.way_start_s, task.start_s, until_s);
        Ok(StretchOutcome::Planned(Box::new(answer)))
    }
}

impl<T: StretchPlanner + ?Sized> StretchPlanner for Box<T> {
    fn horizon_s(&self) -> f64 {
        (**self).horizon_s()
    }

    fn plan(&mut self, task: &StretchTask<'_>, budget: &mut dyn Budget) -> Result<StretchOutcome, PlanningError> {
        (**self).plan(task, budget)
    }
}
