//! What follows a plan.

use super::MassInterval;
use crate::belief::{ModelBelief, Plan};
use crate::error::PlanningError;
use core::fmt;
use tumble_dynamics::{PoseReference, RigidBodyState};
use tumble_lie::Wrench;

/// A motion to follow, at every mission time: before its start it rests there, after its end at its end.
///
/// # Example
/// A function of time is one:
/// ```
/// use tumble_planning::control::ReferenceMotion;
/// use tumble_planning::dynamics::{BodyAcceleration, PoseReference, RigidBodyState};
/// use tumble_planning::lie::{Pose, Twist};
/// use tumble_planning::nalgebra::Vector3;
///
/// let drift = |time_s: f64| PoseReference {
///     state: RigidBodyState {
///         world_from_body: Pose::translation(0.1 * time_s, 0.0, 0.0),
///         twist_body: Twist::new(Vector3::zeros(), Vector3::x() * 0.1),
///     },
///     acceleration: BodyAcceleration { angular_acceleration_body: Vector3::zeros(), acceleration_origin_body: Vector3::zeros() },
/// };
/// assert_eq!(drift.at(3.0).state.world_from_body.translation.x, 0.1 * 3.0);
/// ```
/// Tutorial: [legs from rest to rest](https://github.com/tumble-robotics/tumble/blob/main/xtask/studies/src/model_knowledge/impulse.rs).
pub trait ReferenceMotion {
    /// Wanted state and acceleration at a mission time, s.
    fn at(&self, time_s: f64) -> PoseReference;
}

impl<F: Fn(f64) -> PoseReference> ReferenceMotion for F {
    fn at(&self, time_s: f64) -> PoseReference {
        self(time_s)
    }
}

/// What a controller is asked at each of its output times.
#[derive(Clone, Copy)]
pub struct ControlRequest<'a> {
    /// Mission time, s.
    pub time_s: f64,
    /// The body as measured or estimated now.
    pub state: &'a RigidBodyState<f64>,
    /// What to follow, and the revision of the belief it was planned with.
    pub plan: &'a Plan<&'a dyn ReferenceMotion>,
}

/// What became of a belief offered to a controller.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum Adoption {
    /// It is used from now on.
    Adopted,
    /// It waits: from the first decision at which every promise can be kept with it, it is used, and commands name it. Until then,
    /// or until a newer one comes, the revision named is kept. A controller that must brake on the way drops what waits: the
    /// next belief is offered to it anew.
    Postponed {
        /// The revision still in use.
        kept: u64,
    },
    /// It contradicts what was certain before: the estimator is wrong, or was. The revision named is kept.
    Contradicts {
        /// The revision still in use.
        kept: u64,
    },
}

/// Why a controller left its main road.
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
pub enum FallbackReason {
    /// The search for the best inputs was cut off.
    IterationCap,
    /// Rounding spoiled the search.
    Numerical,
    /// The measured state is outside of the tube: a jump of the localisation, or a disturbance larger than assumed.
    OutsideTube {
        /// Largest excess over the tube's faces, as a share of their distance from the centre.
        excess: f64,
    },
    /// No plan keeps every limit from here.
    Infeasible,
    /// The reference ran out, or is no number.
    NoReference,
}

impl fmt::Display for FallbackReason {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::IterationCap => f.write_str("the search for the best inputs was cut off"),
            Self::Numerical => f.write_str("rounding spoiled the search"),
            Self::OutsideTube { excess } => {
                write!(f, "the robot is outside of its tube, by {:.1} % of its half-width", 100.0 * excess)
            }
            Self::Infeasible => f.write_str("no plan keeps every limit from here"),
            Self::NoReference => f.write_str("there is nothing to follow"),
        }
    }
}

/// What a controller does where it cannot do what it should, in the order in which it is tried.
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
pub enum Fallback {
    /// The last plan, shifted by one step; it keeps every limit.
    Shifted(FallbackReason),
    /// A new plan from the measured state with the widest tube.
    Restarted(FallbackReason),
    /// Braking with all the force there is, then holding; a new plan is needed.
    Braking(FallbackReason),
}

impl fmt::Display for Fallback {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Shifted(reason) => write!(f, "the last plan goes on: {reason}"),
            Self::Restarted(reason) => write!(f, "planned anew from where the robot is: {reason}"),
            Self::Braking(reason) => write!(f, "braking: {reason}"),
        }
    }
}

impl Fallback {
    /// Why the main road was left.
    pub fn reason(&self) -> FallbackReason {
        match self {
            Self::Shifted(reason) | Self::Restarted(reason) | Self::Braking(reason) => *reason,
        }
    }
}

/// A wrench to apply until the next command.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ControlCommand {
    /// Body axes, torque about the body origin.
    pub wrench_body: Wrench<f64>,
    /// [`ModelBelief::revision`] of the belief used; zero before the first.
    pub model_revision: u64,
    /// Where the controller left its main road.
    pub fallback: Option<Fallback>,
    /// The interval the mass is taken to be in, where the controller has one.
    pub mass: Option<MassInterval>,
}

/// Follows plans.
///
/// # Example
/// ```
/// use tumble_planning::control::{ControlRequest, Controller, PoseTracking, ReferenceMotion};
/// use tumble_planning::dynamics::{
///     BodyAcceleration, FreeFlyer, InertialParameters, PoseReference, PoseTracker, RigidBodyState, WrenchBox,
/// };
/// use tumble_planning::lie::Pose;
/// use tumble_planning::nalgebra::Vector3;
/// use tumble_planning::{Plan, PlanningError};
///
/// let body = FreeFlyer::new(InertialParameters::solid_box(10.0, [0.3; 3]));
/// let tracker = PoseTracker::critically_damped(body, 1.0, 0.6);
/// let mut controller: Box<dyn Controller> = Box::new(PoseTracking::try_new(tracker, WrenchBox::in_every_axis(0.1, 0.5))?);
/// let ahead = |_time_s: f64| PoseReference {
///     state: RigidBodyState { world_from_body: Pose::translation(3.0, 0.0, 0.0), ..RigidBodyState::at_rest() },
///     acceleration: BodyAcceleration {
///         angular_acceleration_body: Vector3::zeros(),
///         acceleration_origin_body: Vector3::zeros(),
///     },
/// };
/// let plan = Plan { trajectory: &ahead as &dyn ReferenceMotion, model_revision: 0 };
/// let command = controller.command(&ControlRequest { time_s: 0.0, state: &RigidBodyState::at_rest(), plan: &plan })?;
/// assert_eq!(command.wrench_body.force.x, 0.5); // all that the limits let through
/// # Ok::<(), PlanningError>(())
/// ```
/// Tutorial: [a controller of your own](https://github.com/tumble-robotics/tumble/blob/main/crates/planning/tests/suite/custom_controller.rs).
pub trait Controller {
    /// Takes over a belief, where that loses no promise made before.
    ///
    /// # Errors
    /// A belief in a body that cannot be.
    fn adopt(&mut self, belief: &ModelBelief) -> Result<Adoption, PlanningError>;

    /// The wrench to apply now. Called at every output time, with times that grow; a controller that decides less often holds its
    /// decision and turns its force with the body.
    ///
    /// # Errors
    /// Numbers that are not finite; not that the state is out of bounds, which is answered by a [`Fallback`].
    fn command(&mut self, request: &ControlRequest<'_>) -> Result<ControlCommand, PlanningError>;

    /// How far from what it follows the position may be along each world axis while the controller keeps its promises, m; zero
    /// where it promises nothing.
    fn tube_m(&self) -> [f64; 3] {
        [0.0; 3]
    }

    /// Largest acceleration along each world axis that it promises to follow, whatever the body is of those it reckons with, m/s^2: plans
    /// keep within it. Infinite where it promises nothing.
    fn acceleration_m_s2(&self) -> [f64; 3] {
        [f64::INFINITY; 3]
    }
}

impl<T: Controller + ?Sized> Controller for Box<T> {
    fn adopt(&mut self, belief: &ModelBelief) -> Result<Adoption, PlanningError> {
        (**self).adopt(belief)
    }

    fn command(&mut self, request: &ControlRequest<'_>) -> Result<ControlCommand, PlanningError> {
        (**self).command(request)
    }

    fn tube_m(&self) -> [f64; 3] {
        (**self).tube_m()
    }

    fn acceleration_m_s2(&self) -> [f64; 3] {
        (**self).acceleration_m_s2()
    }
}
