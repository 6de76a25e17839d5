//! From a plan and a measured state to a wrench, with a bound on the error that holds.
//!
//! The way through: a [`Controller`] adopts a belief and answers each [`ControlRequest`] with a [`ControlCommand`].
//!
//! # Source
//! Thesis 2.4.2, 6.2.3.

#[cfg(feature = "research")]
mod additive_tube;
mod attitude;
mod attitude_certificate;
mod axis_problem;
mod axis_template;
mod axis_tube;
mod believed_body;
mod cascade;
mod contraction;
mod controller;
mod convex_set;
mod coupled_axes;
mod estimate_noise;
mod feedback;
mod force_box;
mod gram_program;
mod inertia_interval;
mod invariant_set;
mod mass_interval;
mod obstacle_planes;
#[cfg(feature = "research")]
mod original_tube;
mod peak_gain;
mod plain_mpc;
mod polygon;
mod pose_tracking;
#[cfg(feature = "research")]
mod rakovic;
mod reach;
mod riccati;
#[cfg(feature = "research")]
mod rotated_box;
mod small_matrix;
mod tracked_motion;
mod translation_tube;
mod tube_axes;
mod tube_controller;

#[cfg(feature = "research")]
pub use additive_tube::{AdditiveTube, TruncatedSet, force_gain, mass_disturbance};
pub use attitude::{AttitudeController, AttitudeError, AttitudeGains, AttitudeLaw, AttitudeTorque};
pub use attitude_certificate::{
    AttitudeCertificate, AttitudeConditions, AttitudeLoop, AttitudeNoise, AttitudeRefusal, ReferenceTurning,
    TorqueBudget,
};
pub use axis_problem::{AxisLimits, AxisProblem, AxisRequest, Terminal, TubeDisturbance, TubeWeights};
pub use axis_template::{AxisGain, AxisTemplate, TEMPLATE_ROWS};
pub use axis_tube::{AxisPlan, AxisTube};
pub use cascade::{Cascade, TranslationDecision, TranslationLaw, TranslationRequest};
pub use contraction::Contraction;
pub use controller::{Adoption, ControlCommand, ControlRequest, Controller, Fallback, FallbackReason, ReferenceMotion};
pub use convex_set::{ConvexSet, MinkowskiSum, SymmetricBox, SymmetricEllipsoid, Zonotope};
pub use coupled_axes::{AxisPlane, CoupledAxes};
pub use estimate_noise::{AxisSensing, Corrections, EstimateNoise};
pub use feedback::{LinearFeedback, LqrController, TranslationWeights};
pub use force_box::AttitudeSpan;
pub use gram_program::{GramProgram, GramSettings, GramStatus, GramWorkspace};
pub use inertia_interval::{InertiaInterval, center_of_mass_uncertainty_m};
pub use invariant_set::{MinimalInvariantSet, Support};
pub use mass_interval::MassInterval;
pub use obstacle_planes::{EndAttitude, NominalPath, ObstaclePlane, ObstaclePlanes, PlaneUpdate, barriers_of};
#[cfg(feature = "research")]
pub use original_tube::{
    OriginalDisturbance, OriginalErrors, OriginalSettings, OriginalTube, OriginalTubeController, OriginalWeights,
    original_disturbance,
};
pub use peak_gain::AttitudeTiming;
pub use plain_mpc::{LinearMpc, LinearMpcSettings, PlainMpcController};
pub use polygon::{Polygon, Strips};
pub use pose_tracking::PoseTracking;
#[cfg(feature = "research")]
pub use rakovic::RakovicSet;
pub use reach::Reach;
pub use riccati::discrete_lqr;
#[cfg(feature = "research")]
pub use rotated_box::{available_share, rotation_share};
pub use tracked_motion::TrackedMotion;
pub use translation_tube::{TrackedPoint, TranslationTube, TubeCounts, TubeSettings};
pub use tube_axes::TubeObstacles;
pub use tube_controller::TubeController;
