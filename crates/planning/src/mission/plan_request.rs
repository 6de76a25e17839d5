//! What a loop asks to be planned, and what it is answered.

use super::event::{Ambition, FoundStretch};
use super::loop_settings::{LoopSettings, Scene};
use super::motion::StopLimits;
use super::stretch::{StretchAnswer, StretchRefusal};
use crate::belief::ModelBelief;
use crate::collision::CollisionWorld;
use crate::error::PlanningError;
use crate::global::GlobalAnswer;
use crate::motion::ArcPath;
use nalgebra::Vector3;
use std::sync::Arc;
use tumble_dynamics::{AlignedBox, Environment, RigidBodyState};

/// Speed below which a plan starts at rest, m/s.
const REST_M_S: f64 = 1e-6;

/// A layer, for those who measure what it costs.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
#[non_exhaustive]
pub enum Layer {
    /// A way from rest, and a way after a search in vain.
    Way,
    /// A new way in flight.
    NewWay,
    /// Stretches.
    Stretch,
    /// Control: once a control period.
    Control,
    /// Estimation: once a measurement.
    Estimator,
}

/// All that a plan needs, owned or shared, so that it may wait or go to another thread.
pub struct PlanRequest<W>
where
    W: CollisionWorld,
    W::Body: Sized,
{
    /// Its number; requests of one loop are numbered in the order in which they are made.
    pub request: u64,
    /// What is asked for.
    pub asked: Asked,
    /// The state at the start of the plan, as it is predicted.
    pub start: RigidBodyState<f64>,
    /// Mission time of the start, ns.
    pub start_ns: i64,
    /// Mission time at which it was asked for, with the belief of then, ns.
    pub asked_ns: i64,
    /// What is around the robot.
    pub scene: Arc<Scene<W>>,
    /// Number of that world.
    pub world_revision: u64,
    /// What the body is taken for.
    pub belief: Arc<ModelBelief>,
    /// What acts besides the actuators: that of the settings, and the torque of the momentum that was stored when it was asked.
    pub environment: Environment,
    /// How the stop after a stretch brakes.
    pub stop: StopLimits,
    /// Largest acceleration along each world axis that the controller promises to follow when this is asked, m/s^2.
    pub followed_m_s2: [f64; 3],
    /// Goal, limits, margins, budgets.
    pub settings: Arc<LoopSettings<W::Body>>,
}

/// What is asked for.
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
pub enum Asked {
    /// A way that stays where it begins, for missions that only learn.
    Stay,
    /// A way to the goal.
    Way {
        /// The way that is known, where there is one that may still do.
        known: Option<Arc<ArcPath>>,
        /// Distance to be kept, m; less where the start itself is nearer to something, see [`serve`](super::serve).
        margin_m: f64,
    },
    /// A stretch of a way.
    Stretch {
        /// The way.
        way: Arc<ArcPath>,
        /// Mission time at which it begins, ns.
        way_start_ns: i64,
        /// How the stretch is made.
        ambition: Ambition,
        /// Mission time since the first way, s.
        elapsed_s: f64,
    },
}

impl<W> PlanRequest<W>
where
    W: CollisionWorld,
    W::Body: Sized,
{
    /// The layer that has to search for it; none where nothing is searched for.
    ///
    /// Who flies has little time to look for another way. Who rests has as much as for the first one, and needs it: a way may not begin
    /// where the known one did, or may have to be another one.
    pub fn layer(&self) -> Option<Layer> {
        match &self.asked {
            Asked::Way { known: Some(_), .. } if !self.starts_at_rest() => Some(Layer::NewWay),
            Asked::Way { .. } => Some(Layer::Way),
            Asked::Stretch { ambition: Ambition::Informative | Ambition::Plain, .. } => Some(Layer::Stretch),
            Asked::Stay | Asked::Stretch { ambition: Ambition::AlongWay, .. } => None,
        }
    }

    /// Whether a stretch is asked for; a way otherwise.
    pub fn is_stretch(&self) -> bool {
        matches!(self.asked, Asked::Stretch { .. })
    }

    /// Where the body may be, the start included.
    pub(super) fn position_limits(&self) -> AlignedBox {
        let (limits, start) = (&self.settings.limits.position, &self.start.world_from_body.translation.vector);
        AlignedBox { lower_world: limits.lower_world.inf(start), upper_world: limits.upper_world.sup(start) }
    }

    /// Force that a way may ask for along each world axis, N: that of the mission, as far as the controller promises to follow what it does
    /// to the believed body.
    pub(super) fn force_limit_n(&self) -> Vector3<f64> {
        self.settings.limits.force_n.inf(&(Vector3::from(self.followed_m_s2) * self.belief.parameters().mass))
    }

    pub(super) fn starts_at_rest(&self) -> bool {
        self.start.twist_body.linear.norm() <= REST_M_S
    }
}

/// An answer to a request.
#[derive(Clone, Debug)]
pub struct PlanAnswer {
    /// The request.
    pub request: u64,
    /// The world that was planned in.
    pub world_revision: u64,
    /// Units spent, for those who simulate how long it took.
    pub units: u64,
    /// What was found.
    pub found: Found,
}

/// What was found.
#[derive(Clone, Debug)]
#[non_exhaustive]
pub enum Found {
    /// A way that stays where it begins, and the revision of the belief at that time.
    Stay(ArcPath, u64),
    /// What the planner of ways says: a way, or why there is none.
    Way(Box<GlobalAnswer>),
    /// Why there is no way, one from a start that is nearer to something than one may stay to where more room is left, and the revision of the
    /// belief at that time.
    Retreat(Box<GlobalAnswer>, ArcPath, u64),
    /// A stretch with the stop after it, and whether both keep clear.
    Stretch(FoundStretch, Box<StretchAnswer>),
    /// No stretch, and why, where the planner said so.
    NoStretch(Option<StretchRefusal>),
    /// The planner, or the world that it asked, erred.
    Failed {
        /// Whether a stretch was asked for; a way otherwise.
        is_stretch: bool,
        /// What they say.
        error: PlanningError,
    },
}

/// Seconds of a mission time.
pub(super) fn seconds(time_ns: i64) -> f64 {
    time_ns as f64 * 1e-9
}

/// The nearest nanosecond.
pub(super) fn nanoseconds(time_s: f64) -> i64 {
    #[allow(clippy::cast_possible_truncation)] // saturates, far beyond any mission
    let time_ns = nalgebra::ComplexField::round(time_s * 1e9) as i64;
    time_ns
}
