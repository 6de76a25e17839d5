//! What [`identify`](super::identify) found.

use super::warning::Warning;
use crate::error::Column;
use crate::estimator::{Estimate, Evidence, Verdict};
use crate::likelihood::{Exchange, FoundDelay, FoundThrusters, NuisanceEstimate};
use crate::motion::Noise;
use crate::{BodyScale, NullDirection, SquareRootInformation, WrenchTiming};
use nalgebra::Vector3;

/// What the model leaves unexplained at one node: wrench by the estimated body minus wrench applied.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct NodeResidual {
    /// Time of the node, ns.
    pub time_ns: i64,
    /// Torque, body axes about the body origin, N m.
    pub torque: Vector3<f64>,
    /// Force, body axes, N.
    pub force: Vector3<f64>,
}

/// What [`identify`](super::identify) found.
#[derive(Clone, Debug, PartialEq)]
pub struct Identification {
    /// Name of the method that answered; never `auto`.
    pub method: &'static str,
    /// When the wrench was taken to act.
    pub wrench_timing: WrenchTiming,
    /// Samples between the poses of one row; for the likelihood, samples that share one error of the wrench.
    pub lag: usize,
    /// Median step of the record, s.
    pub step_s: f64,
    /// Samples that take part in at least one row.
    pub samples_used: usize,
    /// Samples that take part in none.
    pub samples_rejected: usize,
    /// Number of parameter directions the data determine; a prior does not count.
    pub rank: usize,
    /// Condition number of the whitened regressor, its columns in like units; infinite where the rank is below ten.
    pub condition_number: f64,
    /// Directions the data leave free; displayed, they say so in words.
    pub null_directions: Vec<NullDirection>,
    /// What the data alone say, whitened, before prior and constraint; what [`merge`](super::merge) adds up.
    pub information: SquareRootInformation<10>,
    /// Mass and length in whose units the ten parameters are compared.
    pub scale: BodyScale,
    /// The body, where the data (and the prior asked for) determine it.
    pub estimate: Option<Estimate>,
    /// Below rank ten: the body completed by a weak physical prior, not knowledge from the data.
    pub regularised: Option<Estimate>,
    /// Share of the wrench's mean square (torque counted at the body's own length) that the estimate explains
    /// (below rank ten: the fit without prior and constraint); at most one.
    pub explained: Option<f64>,
    /// Whether the numbers may be used: by these numbers and those of [`evidence`](Self::evidence), never by the list of warnings.
    pub verdict: Verdict,
    /// What the record says of the answer, counted by the library.
    pub evidence: Evidence,
    /// Which part of the wrench says nothing.
    pub silence: Silence,
    /// Noise found.
    pub noise: Noise,
    /// Delay of everything measured against the wrench, where it was estimated, s.
    pub delay_s: Option<f64>,
    /// What was asked for beside the ten parameters; empty unless by maximum likelihood.
    pub calibration: Vec<NuisanceEstimate>,
    /// What of it and of the ten parameters the data do not separate.
    pub exchanges: Vec<Exchange>,
    /// Scales of the thrusters behind the wrench, where they were told.
    pub thrusters: Option<FoundThrusters>,
    /// Age of what the sensors say against the wrench, where thrusters were told: that of the rate, or without one of the poses.
    pub age: Option<FoundDelay>,
    /// What the model leaves unexplained, node by node; empty without any estimate.
    pub residuals: Vec<NodeResidual>,
    /// What a reader must know; nothing is decided by it.
    pub warnings: Vec<Warning>,
    pub(crate) marks: Marks,
}

/// How well an estimate explains a record it was not made from.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Validation {
    /// Nodes judged; for `flight-likelihood` samples.
    pub nodes: usize,
    /// Root mean square of the residual in units of what noise and covariance predict: near one when all is well. For
    /// likelihoods the residual is the step from the estimate to the one the record itself gives.
    pub normalised_rms: f64,
    /// What of the record's wrench the estimate leaves; none of `flight-likelihood`, which has no wrench of a motion without a body of its own.
    pub wrench: Option<UnexplainedWrench>,
}

/// What an estimate leaves of the wrench of a record it was not made from.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct UnexplainedWrench {
    /// Root mean square of the torque residual, N m.
    pub torque_rms_n_m: f64,
    /// Root mean square of the force residual, N.
    pub force_rms_n: f64,
    /// Share of the wrench's mean square that the body explains, from minus infinity to one.
    pub explained: f64,
}

/// Which part of the wrench says nothing.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Default)]
#[non_exhaustive]
pub enum Silence {
    /// None.
    #[default]
    Nothing,
    /// The force is zero or noise: the mass cannot be known.
    Force,
    /// The force is no noise, and the motion does not follow it: the mass cannot be known.
    Unfollowed,
    /// Every wrench is zero: mass and inertia have no scale.
    Wrench,
}

/// What decides how a result is used further on; the warnings only tell.
#[derive(Clone, Copy, Debug, PartialEq, Default)]
#[allow(clippy::struct_excessive_bools)] // each says something else, all combinations occur
pub(crate) struct Marks {
    /// The likelihood was tried and did not settle.
    pub(super) likelihood_failed: bool,
    /// A likelihood has explained the motion, and not called it noise.
    pub(super) leaves_noise_only: bool,
    /// The motion is confined to a plane.
    pub(super) is_planar: bool,
    /// Taken for one of a body that a table holds: four of the ten are all there is to know.
    pub(super) on_table: bool,
    /// Errors of some column are visibly not white, or the likelihood of white ones did not settle.
    pub(super) errors_not_white: bool,
    /// This column beside the poses is one of them; the poses without it have not been asked.
    pub(super) poses_without: Option<Column>,
    /// The body changed no earlier, most likely and no later, ns.
    pub(super) changed_ns: Option<[i64; 3]>,
}
