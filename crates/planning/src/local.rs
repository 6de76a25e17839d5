//! One stretch of the way, planned for progress and for information at once.
//!
//! The way through: [`InformativeModel`] steps a robot and differentiates the step; `shooting` turns inputs into motion, cost and
//! rows `c >= 0`, with `information` (what the motion tells) and [`Surroundings`] (what must not be hit); [`Stages`] and
//! [`Curvature`] are the quadratic model; [`minimise`] searches; [`InformativePlanner`] begins once on each side of an
//! obstacle and flies what it found in shorter steps before it answers. [`InformationWeighting`] says what knowledge is worth.
//!
//! # Source
//! Thesis 2.4, 6.2.2, (6.4)-(6.9).

mod about_com;
mod answer;
mod bends;
#[cfg(test)]
mod clarabel_route;
mod criterion;
mod curvature;
mod flown;
#[cfg(test)]
mod frozen_problem;
mod information;
mod knowledge;
mod model;
#[cfg(feature = "dual")]
mod parametric;
mod passing;
mod planar_body;
mod planner;
mod problem;
mod quadratic_program;
mod quasi_newton;
mod request;
mod rigid_body;
mod rows;
mod shooting;
mod sqp;
mod sqp_settings;
mod stages;
mod surroundings;
#[cfg(test)]
mod toy_problem;
mod tracking_loss;
mod weighting;

pub(crate) use about_com::sizes_about_com;
pub use about_com::{body_by_mass_center_and_inertia, body_by_principal};
pub use answer::{CostParts, LocalAnswer, LocalStatus, LocalTrajectory};
pub use criterion::Criterion;
pub use curvature::{Curvature, Factorisation};
pub(crate) use knowledge::{QUANTITIES, covariance_about_com, whitened};
pub use model::{Array2, InformativeModel, KINEMATICS, Kinematics, Knowledge, StepDerivatives};
#[cfg(feature = "dual")]
pub use parametric::{
    BelievedParameters, BodyStep, MuntheKaasBodyModel, ParametricInformative, UncertainBody, UnknownParameter,
    VariationalBodyModel,
};
pub use passing::{Crossing, MOST_WAYS, PassingWay, PassingWays, passing_ways};
pub use planar_body::{PlanarBodyModel, PlanarState};
pub use planner::InformativePlanner;
pub use problem::CondensedProblem;
pub use request::{
    Guess, LocalPlanner, LocalRequest, LocalSettings, Reference, SpeedLimits, TerminalRegion, WrenchSet,
};
pub use rigid_body::{BodyParameters, Nuisance, RigidBodyModel};
pub use rows::{MotionRow, MovingContact};
pub use sqp::{SqpWorkspace, minimise};
pub use sqp_settings::{MOST_PAIRS, SqpOutcome, SqpSettings, SqpStatus};
pub use stages::Stages;
pub use surroundings::{Barrier, Hull, MotionBounds, RowSettings, Surroundings};
pub use tracking_loss::{ClosedLoop, TrackedMotion, TrackingLoss};
pub use weighting::{
    BeliefWeighting, CovarianceWeighting, ExponentialWeighting, FixedWeighting, Hysteresis, InformationWeighting,
    ShutOff, StepWeighting, WeightingContext,
};
