//! What can go wrong in identification, with the numbers needed to act on it.

use crate::dynamics::ForeignError;
use crate::excitation::{Channel, Limit};
use core::error::Error;

/// Errors of this crate.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum IdentificationError {
    /// An error of a model, set or solver from outside. Two are equal where they are the same object.
    #[error("{by}: {source}")]
    Foreign {
        /// Its name.
        by: &'static str,
        /// What it says.
        source: ForeignError,
    },
    /// The data (and the prior, if any) leave some parameter directions undetermined.
    #[error(
        "only {rank} of {expected} parameter directions are determined \
         (smallest relative singular value {smallest_singular_value:e}): excite the body more, or state a prior"
    )]
    NotExcited {
        /// Number of determined directions.
        rank: usize,
        /// Number of parameters.
        expected: usize,
        /// Smallest singular value of the scaled square-root information, relative to the largest.
        smallest_singular_value: f64,
    },
    /// Normal equations that no factorisation solves: the data, and the prior if any, leave some direction undetermined, and how many was
    /// not counted.
    #[error("the normal equations of {parameters} parameters are indefinite: excite the body more, or state a prior")]
    Indefinite {
        /// Number of parameters.
        parameters: usize,
    },
    /// The ten parameters are known, but one of them not to better than a share of the body's own size.
    #[error(
        "one sigma of some direction is above {largest} of the body's scale: excite the body more, or state a prior"
    )]
    NotKnown {
        /// Widest standard deviation that is accepted, in units of the body's size.
        largest: f64,
    },
    /// A filter whose state or covariance was lost.
    #[error("the filter diverged at t = {:.3} s", *time_ns as f64 * 1e-9)]
    FilterDiverged {
        /// Time of the sample at which it did, ns.
        time_ns: i64,
    },
    /// Every window of rows holds half a turn or more between two of its poses.
    #[error("in all of {windows} windows the body turns by half a turn or more between two poses: sample faster")]
    HalfTurns {
        /// Windows looked at.
        windows: usize,
    },
    /// A method that is not built in; a pipeline of the user's may know more.
    #[error(
        "no method is called `{asked}`; known: auto, newton-euler, variational, variational4, variational6, maximum-likelihood, \
         flight-likelihood, rls, recursive-sdp, ekf, ukf"
    )]
    UnknownMethod {
        /// The name asked for.
        asked: &'static str,
    },
    /// A measurement, regressor, weight or prior is NaN or infinite.
    #[error("row {row} of the block is not finite")]
    NotFinite {
        /// First offending row, from zero.
        row: usize,
    },
    /// A description of sensors that no sensors have.
    #[error("the sensors cannot be as described: {what} is {value}")]
    ImpossibleSensing {
        /// Which value of the description.
        what: &'static str,
        /// Offending value.
        value: f64,
    },
    /// A standard deviation that is zero, negative or NaN.
    #[error("standard deviation {value} of component {index} is not positive")]
    NotPositive {
        /// Component, from zero.
        index: usize,
        /// Offending value.
        value: f64,
    },
    /// Coefficients that do not fill whole rows of the unknowns.
    #[error("{coefficients} coefficients do not fill {rows} rows of {columns} unknowns")]
    RowShape {
        /// Coefficients offered.
        coefficients: usize,
        /// Rows, as the right-hand sides count them.
        rows: usize,
        /// Unknowns of each.
        columns: usize,
    },
    /// A vector or an information about another number of unknowns.
    #[error("{given} unknowns, where the layout has {expected}")]
    UnknownCount {
        /// Unknowns offered.
        given: usize,
        /// Unknowns there are.
        expected: usize,
    },
    /// A nuisance without a usable size or bound.
    #[error(
        "nuisance {index}: its magnitude {magnitude} must be positive and finite, its lower bound {lower_bound} finite"
    )]
    InvalidNuisance {
        /// Nuisance, from zero.
        index: usize,
        /// Offered magnitude.
        magnitude: f64,
        /// Offered lower bound; zero where there is none.
        lower_bound: f64,
    },
    /// The period of a motion is not a positive finite time.
    #[error("a period of {period_s} s is not positive and finite")]
    InvalidPeriod {
        /// Offending period.
        period_s: f64,
    },
    /// A Fourier series without harmonics.
    #[error("a Fourier series needs at least one harmonic: state how many the reference motion has")]
    NoHarmonics,
    /// Coefficients of another shape than the series has.
    #[error("{rows} x {columns} coefficients, where the series has {expected_rows} x {expected_columns}")]
    CoefficientShape {
        /// Rows offered.
        rows: usize,
        /// Columns offered.
        columns: usize,
        /// Rows of the series: two per harmonic and one.
        expected_rows: usize,
        /// Columns of the series: three and the attitude's.
        expected_columns: usize,
    },
    /// Harmonics from a number to a smaller one.
    #[error("harmonics from {first} to {last}: the last must not be below the first")]
    HarmonicRange {
        /// Smallest number of harmonics asked for.
        first: usize,
        /// Largest number asked for.
        last: usize,
    },
    /// More harmonics than the samples of one period determine.
    #[error("{harmonics} harmonics need more than {} samples in a period, there are {samples}", 2 * harmonics)]
    TooManyHarmonics {
        /// Harmonics asked for.
        harmonics: usize,
        /// Samples in a period.
        samples: usize,
    },
    /// The first cycle starts at no time of the record.
    #[error("cycles that start {start_s} s after the first sample: not a time within the record")]
    InvalidStart {
        /// Offending start.
        start_s: f64,
    },
    /// Steps that differ by more than 1 %.
    #[error(
        "the step before sample {index} is {step_s} s where {typical_s} s is usual: cycles need equal steps, to 1 %"
    )]
    UnequalSteps {
        /// Sample after the offending step, from zero.
        index: usize,
        /// Offending step.
        step_s: f64,
        /// Median step.
        typical_s: f64,
    },
    /// A period that is not a whole number of steps, so that samples of different cycles do not meet.
    #[error(
        "a period of {period_s} s is not a whole number of steps of {step_s} s: \
         take {nearest_period_s} s, or sample every {nearest_step_s} s"
    )]
    PeriodNotWhole {
        /// Period stated.
        period_s: f64,
        /// Step of the record.
        step_s: f64,
        /// Nearest period that fits the step.
        nearest_period_s: f64,
        /// Nearest step that fits the period.
        nearest_step_s: f64,
    },
    /// A motion whose attitude coordinates name no attitude: the quaternion zero.
    #[error("the attitude of the motion is not defined at {time_s} s")]
    AttitudeUndefined {
        /// Where, s.
        time_s: f64,
    },
    /// A limit that leaves a channel no room to move.
    #[error("the {limit} limit of {channel} is {value}: it admits no motion")]
    NoMotionWithinLimit {
        /// Channel.
        channel: Channel,
        /// Which of its limits.
        limit: Limit,
        /// Offending value.
        value: f64,
    },
    /// A wrench limit that the zero wrench is not inside of.
    #[error("half-space {half_space} of the wrench limits has the bound {bound}: it admits no motion")]
    NoMotionWithinWrenchLimit {
        /// Half-space, from zero.
        half_space: usize,
        /// Offending bound.
        bound: f64,
    },
    /// A channel that may go any distance at any speed.
    #[error("{channel} has no limit of workspace, rate or acceleration: a motion of it could grow without end")]
    UnlimitedChannel {
        /// Channel.
        channel: Channel,
    },
    /// Too few harmonics for a motion from rest to rest.
    #[error("{harmonics} harmonics leave no motion from rest to rest but standing still: two are needed")]
    NoFreeCoefficients {
        /// Harmonics.
        harmonics: usize,
    },
    /// No start led to a motion that the criterion could judge.
    #[error("from none of {starts} starts came a motion that shows all parameters")]
    NoDesign {
        /// Starts tried.
        starts: usize,
    },
    /// An actuator that cannot give even the smallest wrenches of a motion.
    #[error("the actuator gives the wrenches of the motion at no size, not even at {smallest_scale:e} of it")]
    NotRealizable {
        /// Smallest size tried, of the motion's.
        smallest_scale: f64,
    },
    /// A table of a periodic record of another shape than its samples and channels have.
    #[error(
        "a table of {rows} x {columns} in a periodic record, where {expected_rows} x {expected_columns} are needed"
    )]
    RecordShape {
        /// Rows offered.
        rows: usize,
        /// Columns offered.
        columns: usize,
        /// Rows needed: one per sample.
        expected_rows: usize,
        /// Columns needed.
        expected_columns: usize,
    },
    /// More samples in a period than any motion is sampled with.
    #[error("{samples:e} samples in a period of {period_s} s at steps of {step_s:e} s: at most {largest}")]
    TooManySamples {
        /// Period.
        period_s: f64,
        /// Step.
        step_s: f64,
        /// Samples in a period.
        samples: f64,
        /// Most samples in a period.
        largest: usize,
    },
    /// Fewer than two whole cycles to average.
    #[error(
        "{samples} samples from the start are {cycles:.4} cycles, {dropped} of them to be dropped: at least two whole cycles must remain, \
         {needed} samples in all"
    )]
    TooFewCycles {
        /// Cycles in the record, from the start of the first.
        cycles: f64,
        /// Of these to be dropped.
        dropped: usize,
        /// Samples from the start of the first cycle.
        samples: usize,
        /// Samples that would do.
        needed: usize,
    },
    /// A likelihood with so many samples and harmonics that it would take minutes.
    #[error(
        "the likelihood of {samples} samples with {harmonics} harmonics is too much work, after {work:.1e} multiplications"
    )]
    SeriesTooLong {
        /// Harmonics that would have been next.
        harmonics: usize,
        /// Samples in a period.
        samples: usize,
        /// Multiplications done.
        work: f64,
    },
    /// More harmonics hardly help, and what they leave is no noise.
    #[error(
        "a series of {harmonics} harmonics leaves {reduced_chi_square:.1} times the variance of the noise, and more harmonics hardly help"
    )]
    NoSeriesExplains {
        /// Harmonics tried last.
        harmonics: usize,
        /// Weighted squares of the residuals per degree of freedom.
        reduced_chi_square: f64,
        /// Multiplications done.
        work: f64,
    },
    /// A row without a wrench where each row needs one.
    #[error("sample {index} has no wrench: averaging over cycles needs one in every row")]
    WrenchMissing {
        /// First such sample, from zero.
        index: usize,
    },
    /// A coordinate of the attitude that does not come back after a period.
    #[error(
        "attitude coordinate {coordinate} changes by {change} over one period: the motion turns on and is no Fourier series \
         in this chart"
    )]
    NotPeriodic {
        /// Coordinate of the chart, from zero.
        coordinate: usize,
        /// Its change.
        change: f64,
    },
    /// A probability that is not strictly between zero and one.
    #[error("{value} is not a probability strictly between 0 and 1")]
    NotAProbability {
        /// Offending value.
        value: f64,
    },
    /// The mass or the length that sets the scale of the body is not a positive finite number.
    #[error("body scale {mass_kg} kg, {length_m} m is not positive and finite")]
    InvalidScale {
        /// Offered mass.
        mass_kg: f64,
        /// Offered length.
        length_m: f64,
    },
    /// The constrained solver did not reach the requested duality gap.
    #[error("duality gap {duality_gap:e} after {iterations} iterations, above {tolerance:e}")]
    NotConverged {
        /// Iterations done.
        iterations: usize,
        /// Duality gap reached, in units of ½|R p − z|².
        duality_gap: f64,
        /// Duality gap asked for.
        tolerance: f64,
    },
    /// Wrenches that depend on the body never came to rest with it.
    #[error(
        "what acts beside the logged wrench depends too much on the body: still {sigmas:.2} sigmas after {passes} passes"
    )]
    EnvironmentUnsettled {
        /// Passes done.
        passes: u32,
        /// How far the last one moved the body, sigmas.
        sigmas: f64,
    },
    /// Momentum of wheels, or what acts beside the logged wrench, in a row of an estimator that does not take it.
    #[error(
        "the sliding window and periodic identification know the logged wrench only: identify a record with stored momentum \
         or an environment by another method"
    )]
    WrenchBeside,
    /// A delay or a lag was asked of an estimator that slides.
    #[error("a delay or an actuator lag needs the whole record: estimate it from a part by the batch likelihood")]
    NeedsWholeRecord,
    /// The iterations of the likelihood did not settle.
    #[error("the likelihood still moves after {iterations} iterations: last step squared {decrement:e} (in sigmas)")]
    LikelihoodNotConverged {
        /// Iterations done.
        iterations: usize,
        /// Squared length of the last step in standard deviations.
        decrement: f64,
    },
    /// The search for the maximum of a likelihood ended where it still rises.
    #[error(
        "the likelihood still promises to rise by {promise:e} (logarithm) after {iterations} steps; start elsewhere"
    )]
    LikelihoodNotMaximal {
        /// Steps done.
        iterations: usize,
        /// Rise of the logarithm that its quadratic model promises.
        promise: f64,
    },
    /// The residual variance was asked for with no more rows than parameters.
    #[error("{rows} rows leave no residual to judge {parameters} parameters by")]
    NoResidual {
        /// Rows received.
        rows: usize,
        /// Number of parameters.
        parameters: usize,
    },
    /// Too few samples in equal steps to form a single row.
    #[error("{samples} samples, too few: {needed} in equal steps without a gap are needed to form one row")]
    TooFewSamples {
        /// Samples given.
        samples: usize,
        /// Samples needed.
        needed: usize,
    },
    /// A window with no more samples than the order of the polynomial to be fitted in it.
    #[error("a window of {samples} samples is too short for a polynomial of order {order}")]
    WindowTooShort {
        /// Samples in the window.
        samples: usize,
        /// Order asked for.
        order: usize,
    },
    /// Times that go back or repeat.
    #[error("time of sample {index} is not after the one before")]
    TimesNotIncreasing {
        /// Offending sample, from zero.
        index: usize,
    },
    /// A column the method needs is empty throughout.
    #[error("the method needs {0}, which the record does not hold")]
    MissingColumn(Column),
    /// Validation of a result that holds no body.
    #[error("there is no estimate to validate: the data determined {rank} of ten directions")]
    NoEstimate {
        /// Directions determined.
        rank: usize,
    },
    /// A throw whose free fall is shorter than its averaging windows need, or too sparsely sampled.
    #[error(
        "free fall of {fall_s} s in {samples} samples, too short: {needed_s} s in {needed_samples} samples are needed"
    )]
    FallTooShort {
        /// Free fall found, s.
        fall_s: f64,
        /// Samples in it.
        samples: usize,
        /// Free fall needed, s.
        needed_s: f64,
        /// Samples needed in it.
        needed_samples: usize,
    },
    /// Samples missing in the free fall, across which the attitude is not known.
    #[error("{gap_s} s without a sample after {time_s} s, within the free fall")]
    GapInFall {
        /// Last time before the gap, s.
        time_s: f64,
        /// Length of the gap, s.
        gap_s: f64,
    },
    /// A gyro at the end of its range: the rate is not known.
    #[error(
        "rate {rate_rad_s} rad/s at {time_s} s, at or above the gyro's {full_scale_rad_s} rad/s: throw with less spin"
    )]
    GyroSaturated {
        /// Time of the sample, s.
        time_s: f64,
        /// Largest component of the rate, rad/s.
        rate_rad_s: f64,
        /// Full scale, rad/s.
        full_scale_rad_s: f64,
    },
    /// A wheel that hardly changes its speed in free fall, so that nothing scales the inertia.
    #[error("the wheel's speed spans {span_rad_s} rad/s in free fall, {needed_rad_s} are needed: spin it up and down")]
    WheelNotSpinning {
        /// Largest less smallest speed, rad/s.
        span_rad_s: f64,
        /// Needed, rad/s.
        needed_rad_s: f64,
    },
    /// No throw of a kind the calibration needs.
    #[error("a calibration needs throws of the device alone and with the proof block: got {device} and {proof}")]
    CalibrationIncomplete {
        /// Throws of the device alone.
        device: usize,
        /// Throws of the device with the proof block.
        proof: usize,
    },
    /// An error of a body.
    #[error(transparent)]
    Dynamics(#[from] tumble_dynamics::DynamicsError),
    /// A geometric error in the motion, such as half a turn between two poses of one row.
    #[error(transparent)]
    Lie(#[from] tumble_lie::LieError),
}

impl IdentificationError {
    /// An error of somebody else's filter model, feasible set or solver, with numbers of its own.
    ///
    /// ```
    /// use tumble_identification::IdentificationError;
    /// let error = IdentificationError::foreign("my cone", std::io::Error::other("facet 7 is missing"));
    /// assert_eq!(error.to_string(), "my cone: facet 7 is missing");
    /// assert!(std::error::Error::source(&error).is_some_and(|source| source.is::<std::io::Error>()));
    /// ```
    #[cfg(feature = "std")]
    pub fn foreign(by: &'static str, source: impl Error + Send + Sync + 'static) -> Self {
        Self::Foreign { by, source: ForeignError::made(source) }
    }

    /// One that lives for ever (`&MY_ERROR`), which needs no allocator.
    pub const fn fixed(by: &'static str, source: &'static (dyn Error + Send + Sync)) -> Self {
        Self::Foreign { by, source: ForeignError::fixed(source) }
    }
}

/// A column of a motion log.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[non_exhaustive]
pub enum Column {
    /// Force and torque.
    Wrench,
    /// Angular velocity.
    Rate,
    /// Velocity of the origin.
    Velocity,
    /// Position of the origin.
    Position,
    /// Attitude.
    Attitude,
    /// Position and attitude.
    Pose,
    /// Acceleration of the origin.
    Acceleration,
}

impl core::fmt::Display for Column {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        f.write_str(match self {
            Self::Wrench => "wrenches (f_*, tau_*)",
            Self::Rate => "angular velocities (w_*)",
            Self::Velocity => "velocities (v_*)",
            Self::Position => "positions (p_*)",
            Self::Attitude => "attitudes (q_*)",
            Self::Pose => "poses (p_*, q_*)",
            Self::Acceleration => "accelerations (a_*)",
        })
    }
}
