//! From a motion log to mass, centre of mass and inertia with covariance: the library's front door.
//!
//! All scalars are `f64`: decisions are made here.

use crate::WrenchTiming;
use crate::dynamics::InertialParameters;
use crate::error::IdentificationError;
use crate::motion::MotionSample;
use core::fmt;
use nalgebra::{Matrix3, SMatrix, SVector, Vector3};

/// Which equations tie the motion to the parameters.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Default)]
#[non_exhaustive]
pub enum Method {
    /// Chosen from the columns present, the wrench timing and the noise found; [`Identification::method`] says which.
    #[default]
    Auto,
    /// Newton-Euler with measured velocities and rates, in integral (momentum) form.
    NewtonEuler,
    /// Variational regressor of order 2, poses only.
    Variational,
    /// Extrapolated variational regressor of order 4, poses only.
    Variational4,
    /// Extrapolated variational regressor of order 6, poses only.
    Variational6,
}

/// What is known of the body beforehand: independent Gaussian knowledge of each of the ten parameters.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Prior {
    /// Expected parameters.
    pub mean: InertialParameters<f64>,
    /// Standard deviations in the order of [`InertialParameters::to_vector`]; infinite where nothing is known.
    pub standard_deviation: SVector<f64, 10>,
}

/// How [`identify`] works.
#[derive(Clone, Copy, Debug, PartialEq, Default)]
pub struct Settings {
    /// Regression to use.
    pub method: Method,
    /// When the logged wrench acts.
    pub wrench_timing: WrenchTiming,
    /// Gravitational acceleration, inertial axes, m/s^2.
    pub gravity_world: Vector3<f64>,
    /// Prior knowledge that enters the estimate; none unless given.
    pub prior: Option<Prior>,
    /// Samples between the poses of one regression row; `None` chooses it from the noise found.
    pub lag: Option<usize>,
}

/// One standard deviation of each reported quantity.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct StandardDeviations {
    /// Of the mass, kg.
    pub mass_kg: f64,
    /// Of the centre of mass, body axes, m.
    pub center_of_mass_m: Vector3<f64>,
    /// Of the entries of the inertia about the centre of mass, kg m^2.
    pub inertia_about_com_kg_m2: Matrix3<f64>,
}

/// A physically consistent body with its uncertainty.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Estimate {
    /// The ten parameters about the body origin; always a body that exists.
    pub parameters: InertialParameters<f64>,
    /// Covariance of [`InertialParameters::to_vector`], of the solution before the consistency constraint.
    pub covariance: SMatrix<f64, 10, 10>,
    /// Standard deviations derived from the covariance.
    pub std: StandardDeviations,
    /// True where the consistency constraint moved the solution.
    pub lmi_active: bool,
}

/// Noise levels found in the data, one standard deviation per sample and axis.
#[derive(Clone, Copy, Debug, PartialEq, Default)]
pub struct Noise {
    /// Wrench noise that explains the torque residual, N m.
    pub torque_n_m: f64,
    /// Wrench noise that explains the force residual, N.
    pub force_n: f64,
    /// Attitude noise, rad.
    pub attitude_rad: f64,
    /// Position noise, m.
    pub position_m: f64,
}

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

/// Things a reader of the result must know.
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
pub enum Warning {
    /// Steps longer than 1.5 times the median step; rows never reach across one.
    Gaps {
        /// How many.
        count: usize,
        /// The longest, s.
        longest_s: f64,
    },
    /// Windows skipped because their steps differ by more than 1 %.
    UnequalSteps {
        /// Windows skipped.
        skipped: usize,
        /// Windows looked at.
        windows: usize,
    },
    /// Nodes skipped because a needed column was empty there.
    MissingValues {
        /// Nodes skipped.
        skipped: usize,
    },
    /// Every wrench in the record is zero: the scale of mass and inertia cannot be known.
    ZeroWrench,
    /// The poses are noisy compared with the motion inside one row.
    NoisyPoses {
        /// Estimated position noise, m.
        position_m: f64,
        /// Estimated attitude noise, rad.
        attitude_rad: f64,
        /// Share of the regressor's signal, at the lag used, that is noise: the relative bias of plain least squares.
        noise_share: f64,
        /// Lag used, samples.
        lag: usize,
    },
    /// The error of discretisation is a visible part of the uncertainty (and is included in it).
    Discretisation {
        /// Largest ratio of discretisation error to total standard deviation over the ten parameters.
        share: f64,
    },
    /// The unconstrained solution was not a body; the consistency constraint moved it.
    ConstraintActive,
    /// Few rows: the covariance itself is uncertain.
    FewRows {
        /// Rows used.
        rows: usize,
    },
}

impl fmt::Display for Warning {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match *self {
            Self::Gaps { count, longest_s } => {
                write!(f, "{count} gap(s) in time, the longest {longest_s:.3} s; no row reaches across one")
            }
            Self::UnequalSteps { skipped, windows } => {
                write!(f, "{skipped} of {windows} windows skipped: their steps differ by more than 1 %")?;
                if 2 * skipped > windows {
                    write!(f, "; most of the record is unused: the method maximum-likelihood uses true step lengths")?;
                }
                Ok(())
            }
            Self::MissingValues { skipped } => write!(f, "{skipped} nodes skipped: a needed column is empty there"),
            Self::ZeroWrench => {
                write!(f, "the wrench is zero throughout: mass and inertia are known up to a common factor only")
            }
            Self::NoisyPoses { position_m, attitude_rad, noise_share, lag } => write!(
                f,
                "poses look noisy ({position_m:.1e} m, {attitude_rad:.1e} rad): {:.1} % of the regression signal at lag \
                 {lag} is noise; rows of disjoint poses serve as instruments, and measured rates and velocities or the \
                 method maximum-likelihood would do better",
                100.0 * noise_share
            ),
            Self::Discretisation { share } => write!(
                f,
                "discretisation error is {:.0} % of the stated standard deviation (included); a higher order or a \
                 shorter step would reduce it",
                100.0 * share
            ),
            Self::ConstraintActive => {
                write!(f, "the unconstrained solution is not a body; moved to the nearest consistent one")
            }
            Self::FewRows { rows } => write!(f, "only {rows} rows: the stated uncertainty is itself uncertain"),
        }
    }
}

/// What [`identify`] found.
#[derive(Clone, Debug, PartialEq)]
pub struct Identification {
    /// Method used; never [`Method::Auto`].
    pub method: Method,
    /// When the wrench was taken to act.
    pub wrench_timing: WrenchTiming,
    /// Samples between the poses of one row.
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
    /// Directions the data leave free, in words.
    pub null_directions: Vec<String>,
    /// The body, where the data (and the prior asked for) determine it.
    pub estimate: Option<Estimate>,
    /// Below rank ten: the body completed by a weak physical prior, not knowledge from the data.
    pub regularised: Option<Estimate>,
    /// Noise found.
    pub noise: Noise,
    /// What the model leaves unexplained, node by node; empty without any estimate.
    pub residuals: Vec<NodeResidual>,
    /// What a reader must know.
    pub warnings: Vec<Warning>,
}

/// What a record can answer, before any wrench is believed.
#[derive(Clone, Debug, PartialEq)]
pub struct Prediction {
    /// Number of parameter directions the motion determines.
    pub rank: usize,
    /// Condition number of the regressor, its columns in like units.
    pub condition_number: f64,
    /// Directions left free, in words.
    pub null_directions: Vec<String>,
    /// Predicted standard deviations for the given wrench noise; `None` below rank ten.
    pub std: Option<StandardDeviations>,
    /// Rows the record gives.
    pub rows: usize,
}

/// How well an estimate explains a record it was not made from.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Validation {
    /// Nodes judged.
    pub nodes: usize,
    /// Root mean square of the torque residual, N m.
    pub torque_rms_n_m: f64,
    /// Root mean square of the force residual, N.
    pub force_rms_n: f64,
    /// Root mean square of the residual in units of what noise and covariance predict: near one when all is well.
    pub normalised_rms: f64,
    /// Share of the wrench's mean square that the body explains, from minus infinity to one.
    pub explained: f64,
}

/// The body that explains a record.
///
/// # Errors
/// [`IdentificationError::TooFewSamples`] where not one row can be formed; data that say too little are not an error
/// but a result with its rank.
pub fn identify(record: &[MotionSample], settings: &Settings) -> Result<Identification, IdentificationError> {
    let _ = settings;
    Err(IdentificationError::TooFewSamples { samples: record.len(), needed: 3 })
}

/// What the motion of a record can answer, given the noise of its wrench (torque, force; one standard deviation).
///
/// # Errors
/// As [`identify`].
pub fn predict(
    record: &[MotionSample],
    settings: &Settings,
    wrench_noise: (f64, f64),
) -> Result<Prediction, IdentificationError> {
    let _ = (settings, wrench_noise);
    Err(IdentificationError::TooFewSamples { samples: record.len(), needed: 3 })
}

/// How well `found` explains another record of the same body.
///
/// # Errors
/// As [`identify`]; also [`IdentificationError::NoEstimate`].
pub fn validate(
    found: &Identification,
    record: &[MotionSample],
    settings: &Settings,
) -> Result<Validation, IdentificationError> {
    let _ = (found, settings);
    Err(IdentificationError::TooFewSamples { samples: record.len(), needed: 3 })
}
