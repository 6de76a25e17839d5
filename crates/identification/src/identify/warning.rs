//! What a reader of the result must know.

use crate::WeakDirection;
use crate::error::Column;
use core::fmt;
use nalgebra::Vector3;

/// Fewer nodes than this leave the covariance uncertain.
pub(super) const FEW_NODES: usize = 20;

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
    /// The forces are zero or noise: the scale of the mass cannot be known.
    SilentForce,
    /// The best body explains too little of the wrench: the log does not mean what it is taken to mean.
    PoorFit {
        /// Share of the wrench's mean square that is explained.
        explained: f64,
    },
    /// The motion is no more than the noise of its sensors.
    AtRest,
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
    /// Rates and velocities are noisy compared with their change over one row.
    NoisyRates {
        /// Estimated noise of the angular velocity, rad/s.
        rate_rad_s: f64,
        /// Estimated noise of the velocity, m/s.
        velocity_m_s: f64,
        /// Share of the regressor's signal, at the lag used, that is noise.
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
    /// Windows skipped because the body turns by half a turn or more between two of their poses.
    HalfTurns {
        /// Windows skipped.
        skipped: usize,
    },
    /// The record is long: the likelihood took its first rows as a batch and slid over the rest.
    SlidingWindow {
        /// Rows of the batch.
        batch: usize,
        /// Rows in all.
        rows: usize,
    },
    /// Samples without a wrench, taken to act under the last one logged.
    HeldWrenches {
        /// How many.
        samples: usize,
    },
    /// The calibration asked for is missing: the likelihood, which alone estimates it, did not settle or left a direction
    /// of the parameters free, and a regression answers in its place.
    NotCalibrated {
        /// Rows without it.
        rows: usize,
    },
    /// The record is too long to be taken at once: the calibration is the weighted mean of that of its stretches.
    CalibratedInStretches {
        /// How many stretches show it.
        stretches: usize,
    },
    /// One body does not explain the record, two do: something was grasped, released or lost. The estimate is a mixture;
    /// [`identify_parts`](crate::identify_parts) takes the parts separately.
    BodyChanged {
        /// Likeliest time, ns.
        time_ns: i64,
        /// Last time that surely belongs to the body before, ns.
        earliest_ns: i64,
        /// First time that surely belongs to the body after, ns.
        latest_ns: i64,
        /// Mass that the part before asks for, to first order, kg.
        mass_before_kg: f64,
        /// Mass that the part after asks for, to first order, kg.
        mass_after_kg: f64,
    },
    /// Few rows: the covariance itself is uncertain.
    FewRows {
        /// Rows used.
        rows: usize,
    },
    /// The likelihood was asked for, or called for by the noise, and did not settle or explained too little.
    LikelihoodFailed,
    /// The noise of the poses is alike over neighbouring samples, the instruments of a regression fail, and its answer is
    /// biased.
    BiasedByNoise {
        /// By how many standard deviations the answer moves with other instruments.
        deviations: f64,
    },
    /// The filter asked for flew off; a regression answers in its place.
    FilterDiverged {
        /// Time of the sample at which it did, ns.
        time_ns: i64,
    },
    /// The forces logged are not noise, but the motion does not follow them.
    UnfollowedForce {
        /// Share of the mean square of the force that the best body explains.
        explained: f64,
    },
    /// The motion is confined to a plane, as on an air bearing.
    PlanarMotion {
        /// Normal of the plane, world axes, unit length.
        normal_world: Vector3<f64>,
    },
    /// The motion is that of a body on a table.
    OnTable,
    /// The likelihood did not settle, and nothing stands in for it.
    NoAnswer,
    /// So many samples were rejected that they are not outliers.
    ManyOutliers {
        /// Samples rejected.
        rejected: usize,
        /// Of so many.
        rows: usize,
    },
    /// The motion asks for wrenches that the log does not hold.
    UnmodelledWrench {
        /// Torque noise per sample that would explain the motion, N m.
        torque_n_m: f64,
        /// Force noise per sample that would explain it, N.
        force_n: f64,
        /// Largest ratio to the noise that the logged wrench shows by itself.
        times: f64,
    },
    /// What a column leaves unexplained is not white: neighbouring errors are alike, and the standard deviations, which
    /// assume that they are independent, are too small.
    ColouredNoise {
        /// Which column.
        column: Column,
        /// Factor by which standard deviations fall short where this column decides them.
        sigma_inflation: f64,
    },
    /// Parts of the record pull at the parameters more than white noise would: all standard deviations are widened.
    WidenedSigma {
        /// By this factor.
        factor: f64,
    },
    /// Measured velocities, rates and accelerations are left out: their errors are not white noise, those of the poses are.
    PosesAlone {
        /// A column that says so.
        column: Column,
    },
    /// A controller's answer to the noise of the measurements is a large part of the wrench.
    Feedback {
        /// Share of the mean square of force or torque, the larger of both.
        share: f64,
    },
    /// The motion shows a direction of the parameters badly or not at all.
    WeakExcitation {
        /// What is not determined, and the simple motion that would show it.
        direction: WeakDirection,
        /// One standard deviation in units of the body's own scale; infinite where it is not determined.
        std: f64,
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
                write!(f, "the wrench is zero throughout: the scale of the mass and that of the inertia stay unknown")
            }
            Self::SilentForce => write!(f, "the force is zero or noise throughout: the mass cannot be known"),
            Self::PoorFit { explained } => write!(
                f,
                "the best body explains {:.0} % of the wrench: check the sign, frame and timing of the wrench, the order and \
                 direction of the quaternion, units, gravity, delays, and whether the body stayed the same",
                100.0 * explained
            ),
            Self::AtRest => write!(
                f,
                "the motion is no more than the noise of its sensors: a body at rest shows nothing of itself, whatever wrench is logged"
            ),
            Self::NoisyPoses { position_m, attitude_rad, noise_share, lag } => write!(
                f,
                "poses look noisy ({position_m:.1e} m, {attitude_rad:.1e} rad): {:.1} % of the regression signal at lag \
                 {lag} is noise; rows of disjoint poses serve as instruments; the stated sigma does not hold all of this noise",
                100.0 * noise_share
            ),
            Self::NoisyRates { rate_rad_s, velocity_m_s, noise_share, lag } => write!(
                f,
                "rates and velocities look noisy ({rate_rad_s:.1e} rad/s, {velocity_m_s:.1e} m/s): {:.1} % of the \
                 regression signal at lag {lag} is noise; rows of disjoint samples serve as instruments",
                100.0 * noise_share
            ),
            Self::Discretisation { share } => write!(
                f,
                "discretisation error is {:.0} % of the stated standard deviation (included); a higher order or a \
                 shorter step would reduce it",
                100.0 * share
            ),
            Self::HalfTurns { skipped } => {
                write!(f, "{skipped} windows skipped: the body turns by half a turn or more between two poses")
            }
            Self::ConstraintActive => {
                write!(f, "the unconstrained solution is not a body; moved to the nearest consistent one")
            }
            Self::SlidingWindow { batch, rows } => {
                write!(f, "long log: noise levels from its first {batch} rows, then a sliding window over all {rows}")
            }
            Self::HeldWrenches { samples } => {
                write!(f, "{samples} samples without a wrench: the last one logged is taken to act on")
            }
            Self::LikelihoodFailed => write!(
                f,
                "maximum likelihood did not settle on this log or explains too little of it; a regression answers instead, and \
                 noise in the poses may bias it beyond the stated sigma"
            ),
            Self::BiasedByNoise { deviations } => write!(
                f,
                "errors of neighbouring poses or velocities are alike (an onboard filter, wandering localisation): with rows further \
                 apart the regression moves by {deviations:.0} sigma (included in the stated one), and more may be hidden; not an \
                 identification: fly a stronger excitation, or let the likelihood estimate the filter's delay"
            ),
            Self::FilterDiverged { time_ns } => write!(
                f,
                "the filter diverged at t = {:.3} s; a regression answers instead: use the method maximum-likelihood",
                time_ns as f64 * 1e-9
            ),
            Self::UnfollowedForce { explained } => write!(
                f,
                "the logged force is not noise, but the best body explains {:.0} % of it: gaps, jumps or a delay of the localisation \
                 hide what it does; the mass is not known from this log",
                100.0 * explained
            ),
            Self::NoAnswer => write!(
                f,
                "the likelihood did not settle on this log, and no other method knows a table or thrusters that are off: check the timing of \
                 the wrench and what the actuators really give; no numbers"
            ),
            Self::OnTable => write!(
                f,
                "the motion stays in the xy plane: taken for that of a body on a table, which holds it against every force and torque out \
                 of the plane; no such motion shows the six other parameters"
            ),
            Self::PlanarMotion { normal_world: n } => write!(
                f,
                "the motion is confined to the plane with the normal ({:.2}, {:.2}, {:.2}), as on an air bearing: forces and torques \
                 that the table takes up move nothing, and a free body explains them badly; such a log can show no more than the \
                 mass, the centre of mass in the plane and the inertia about the normal",
                n.x, n.y, n.z
            ),
            Self::ManyOutliers { rejected, rows } => write!(
                f,
                "{rejected} of {rows} samples are rejected, too many for outliers: the body or its localisation may have changed; \
                 look at the residuals and identify the parts separately"
            ),
            Self::UnmodelledWrench { torque_n_m, force_n, times } => write!(
                f,
                "the motion asks for wrench noise of {torque_n_m:.1e} N m, {force_n:.1e} N, {times:.0} times what the logged wrench \
                 shows: if that is not the actuators' own noise, something is not in the model (delay, scale, lag or bias, which `estimate` \
                 finds; wrench timing, gravity, drag, noise of the poses that wanders, a body that changes), and the stated sigma \
                 does not hold it"
            ),
            Self::ColouredNoise { column, sigma_inflation } => write!(
                f,
                "what the {column} leave unexplained is not white noise: neighbouring errors are alike, and the stated sigma may \
                 be too small by a factor of up to {sigma_inflation:.1}"
            ),
            Self::WidenedSigma { factor } => write!(
                f,
                "the parts of this log contradict each other {factor:.1} times as much as white noise would: the stated sigma is \
                 widened by that factor, and errors that wander as slowly as the motion does may still lie beyond it"
            ),
            Self::PosesAlone { column } => write!(
                f,
                "the poses alone answer: measured velocities, rates and accelerations are left out, for what the {column} leave \
                 unexplained is not white noise (filters, biases and errors of scale do that)"
            ),
            Self::Feedback { share } => write!(
                f,
                "{:.0} % of the wrench is the controller's answer to the noise of poses and velocities: what moves the body follows the \
                 errors that its motion is compared with, and that biases every estimate; fly an excitation that is large beside it, or \
                 filter what the controller is told",
                100.0 * share
            ),
            Self::WeakExcitation { direction, std } if std.is_finite() => write!(
                f,
                "weakly excited (one sigma {:.0} % of the body's scale): {}; to see it better, {}",
                100.0 * std,
                direction.direction,
                direction.remedy
            ),
            Self::WeakExcitation { direction, .. } => {
                write!(f, "not excited: {}; to see it, {}", direction.direction, direction.remedy)
            }
            Self::NotCalibrated { rows } => write!(
                f,
                "what was asked for beside the body is not estimated on {rows} rows: the likelihood does not settle there or \
                 leaves a direction free; ask for less of it, or record more varied motion"
            ),
            Self::CalibratedInStretches { stretches } => write!(
                f,
                "long log: what was asked for beside the body is the weighted mean over {stretches} stretches of it"
            ),
            Self::BodyChanged { time_ns, mass_before_kg, mass_after_kg, .. } => write!(
                f,
                "the body changed at about t = {:.2} s: mass {mass_before_kg:.4} -> {mass_after_kg:.4} kg; identify the parts \
                 separately",
                time_ns as f64 * 1e-9
            ),
            Self::FewRows { rows } => write!(f, "only {rows} rows: the stated uncertainty is itself uncertain"),
        }
    }
}
