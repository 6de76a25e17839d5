//! What a local plan is asked for.

use super::answer::LocalAnswer;
use crate::belief::ModelBelief;
use crate::budget::Budget;
use crate::error::{PlanningError, not_negative, positive};
use nalgebra::{SMatrix, Vector3};
use tumble_dynamics::WrenchBox;

/// Where the states should be.
#[derive(Debug, PartialEq)]
#[non_exhaustive]
pub enum Reference<'a, S> {
    /// At one state all along: the next way point.
    Hold(&'a S),
    /// At these, one for each node, the start included.
    Nodes(&'a [S]),
}

// Derived, these would ask for a state that can be copied.
impl<S> Clone for Reference<'_, S> {
    fn clone(&self) -> Self {
        *self
    }
}

impl<S> Copy for Reference<'_, S> {}

/// Where a search begins. An input that is zero all along is a stationary point of what it could tell: where information has a
/// weight, such inputs are stirred before the search begins.
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
pub enum Guess<'a, const U: usize> {
    /// Small, deterministic, without structure, and one search for each side on which obstacles can be passed.
    Excited,
    /// From these inputs, one per step, SI units, cut to the limits.
    Inputs(&'a [[f64; U]]),
    /// The same, with the first step taken without damping: from inputs near the optimum, such as the last plan's moved on.
    Near(&'a [[f64; U]]),
}

/// Inputs that actuators can give: a box, and half-spaces such as those of nozzles that share a plenum.
#[derive(Clone, Debug, PartialEq)]
pub struct WrenchSet<const U: usize> {
    /// Largest absolute value of each input, positive.
    pub limit: [f64; U],
    /// `normal . u <= offset`, in SI units; offsets are positive, so that rest is inside.
    pub half_spaces: Vec<([f64; U], f64)>,
}

impl<const U: usize> WrenchSet<U> {
    /// What is left of it on every side where so much of each input is needed besides.
    ///
    /// # Errors
    /// Nothing is left of an input or of a half-space.
    pub fn without(&self, reserved: &[f64; U]) -> Result<Self, PlanningError> {
        let what = "what is left of an input limit beside what else acts";
        let mut left = self.clone();
        for (limit, reserved) in left.limit.iter_mut().zip(reserved) {
            *limit = positive(what, *limit - not_negative("what is reserved of an input", *reserved)?)?;
        }
        for (normal, offset) in &mut left.half_spaces {
            let reserved: f64 = normal.iter().zip(reserved).map(|(entry, reserved)| entry.abs() * reserved).sum();
            *offset = positive(what, *offset - reserved)?;
        }
        Ok(left)
    }
}

impl From<WrenchBox> for WrenchSet<6> {
    fn from(limits: WrenchBox) -> Self {
        let (torque, force) = (limits.torque_limit, limits.force_limit);
        Self { limit: [torque.x, torque.y, torque.z, force.x, force.y, force.z], half_spaces: Vec::new() }
    }
}

/// How fast a body may move and turn.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SpeedLimits {
    /// Along each world axis, m/s; infinite for any.
    pub speed_m_s: Vector3<f64>,
    /// About each body axis, rad/s; infinite for any.
    pub rate_rad_s: Vector3<f64>,
}

/// Where the last state must be, beside what its weights ask for.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TerminalRegion {
    /// Centre, world axes, m.
    pub position_world: Vector3<f64>,
    /// Largest distance from it, m.
    pub radius_m: f64,
    /// Largest speed, m/s.
    pub speed_m_s: f64,
}

/// What stays the same from plan to plan.
#[derive(Clone, Debug, PartialEq)]
pub struct LocalSettings<const X: usize, const U: usize> {
    /// Steps of the horizon.
    pub steps: usize,
    /// Length of a step, s.
    pub step_s: f64,
    /// Weight of each squared coordinate of the tracking error, at every node before the last; not negative.
    pub tracking: [f64; X],
    /// The same at the last node.
    pub terminal: [f64; X],
    /// Weight of each squared input, at every step, per SI unit; positive.
    pub effort: [f64; U],
    /// Weight of the squared acceleration of the origin, (m/s^2)^-2, and of the angular acceleration, (rad/s^2)^-2: what
    /// cameras lose their features by.
    pub acceleration: [f64; 2],
    /// What the inputs must keep within.
    pub wrench: WrenchSet<U>,
    /// How fast it may go.
    pub speed: SpeedLimits,
    /// Information that the measurements of one node give about the coordinates of its state: `H' R^-1 H` times the number of
    /// independent samples per step.
    pub measurement: SMatrix<f64, X, X>,
    /// Of what a parameter has moved each coordinate by, the share that the measurements of one node leave to later ones: one
    /// where the state at the start is known and errors are white, so that all of it shows again and again; less where an
    /// estimator has to follow the state beside the parameters, because something unknown pushes the body or a localisation wanders.
    /// With `measurement` the inverse covariance of such an estimator's innovations, their sum is its information.
    pub retained: [f64; X],
    /// What is to be small of the covariance.
    pub criterion: super::Criterion,
    /// Distance kept from obstacles, m.
    pub margin_m: f64,
    /// Length over which distances to obstacles are measured: a clearance of so much counts as one.
    pub length_scale_m: f64,
    /// Obstacles are kept off on whole segments; otherwise at nodes only.
    pub on_segments: bool,
    /// Residual of the optimality conditions at which a plan counts as converged; 1e-4 leaves 1e-6 of cost.
    pub tolerance: f64,
    /// Most iterations.
    pub iterations: usize,
}

/// One local plan to make.
#[derive(Clone, Debug)]
pub struct LocalRequest<'a, S, const U: usize, const P: usize> {
    /// The state at its start.
    pub start: &'a S,
    /// Mission time of the start, s.
    pub start_s: f64,
    /// Where to go.
    pub reference: Reference<'a, S>,
    /// A region in which the plan must end, if any.
    pub terminal: Option<TerminalRegion>,
    /// What the body is taken for, and how well it is known.
    pub belief: &'a ModelBelief,
    /// Weight of the predicted variance of each quantity of the model, per its SI unit squared; all zero for a plan that does
    /// not care.
    pub information: [f64; P],
    /// How much of each input is needed to hold against what else acts, so that inputs keep so far within their limits on both sides;
    /// SI units, zero where nothing else acts. Inputs of a plan are what moves the body, without that.
    pub reserved: [f64; U],
    /// What may be hit, and the shape that may hit it.
    pub surroundings: &'a super::Surroundings,
    /// Where to begin.
    pub guess: Guess<'a, U>,
}

/// A planner of one stretch.
///
/// # Laws
/// `laws::check_local_planner`.
///
/// # Example
/// ```
/// use tumble_planning::local::{Guess, LocalAnswer, LocalPlanner, LocalRequest, LocalStatus, Reference, Surroundings};
/// use tumble_planning::dynamics::InertialParameters;
/// use tumble_planning::{Budget, ModelBelief, PlanningError, Units};
///
/// /// Knows no way to anywhere, and says so.
/// struct Stuck;
/// impl LocalPlanner<1, 1> for Stuck {
///     type State = f64;
///     fn plan(&mut self, _request: &LocalRequest<'_, f64, 1, 1>, _budget: &mut dyn Budget)
///         -> Result<LocalAnswer<f64, 1, 1>, PlanningError> {
///         Ok(LocalAnswer {
///             status: LocalStatus::Infeasible { violation: 1.0, blocker: None },
///             plan: None,
///             cost: None,
///             optimality: f64::INFINITY,
///             violation: 1.0,
///             iterations: 0,
///             units: 0,
///             unobservable: Vec::new(),
///         })
///     }
/// }
/// let request = LocalRequest {
///     start: &0.0,
///     start_s: 0.0,
///     reference: Reference::Hold(&1.0),
///     terminal: None,
///     belief: &ModelBelief::certain(1, InertialParameters::solid_box(9.5, [0.3; 3])),
///     information: [0.0],
///     reserved: [0.0],
///     surroundings: &Surroundings::none(),
///     guess: Guess::Excited,
/// };
/// assert!(Stuck.plan(&request, &mut Units::new(10))?.plan.is_none());
/// # Ok::<(), PlanningError>(())
/// ```
/// Tutorial: [a planner that tries](https://github.com/tumble-robotics/tumble/blob/main/crates/planning/tests/suite/cart/mod.rs); the crate's own is [`InformativePlanner`](super::InformativePlanner).
pub trait LocalPlanner<const U: usize, const P: usize> {
    /// A state.
    type State: Clone;

    /// Answers a request; the same request and budget give the same answer.
    ///
    /// # Errors
    /// Ill-posed requests. That no plan keeps the limits is an answer.
    fn plan(
        &mut self,
        request: &LocalRequest<'_, Self::State, U, P>,
        budget: &mut dyn Budget,
    ) -> Result<LocalAnswer<Self::State, U, P>, PlanningError>;
}
