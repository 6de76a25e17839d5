//! Motions designed, flown and processed as in thesis 4.2 to 4.4.

use nalgebra::{SVector, Vector6};
use tumble::flight_log::measured;
use tumble::space_cobot::{self, wrench_box};
use tumble_dynamics::{
    FreeFlyer, InertialParameters, MuntheKaas4, PoseTracker, RigidBodyState, SimulatedBody, WrenchBox,
};
use tumble_formats::excitation_file::NoiseTable;
use tumble_identification::excitation::{
    ChannelLimits, Execution, ExecutionSample, NormalizedCondition, Saturation, SpaceExcitation, execute,
};
use tumble_identification::fourier::{FourierBasis, FourierMotion};
use tumble_identification::harmonics::{
    FourierFit, HarmonicCandidate, HarmonicSettings, PeriodicLeastSquares, PeriodicRecord, SelectionRule,
    average_cycles, maximum_likelihood, select_harmonics,
};
use tumble_identification::noise::Gaussian;
use tumble_identification::{DOptimality, IdentificationError, MaximumLikelihood, WrenchTiming};
use tumble_lie::Pose;

use crate::flights::Errors;

/// Harmonics of the reference, and the most that the fit may have.
pub const REFERENCE_HARMONICS: usize = 3;
pub const LARGEST_HARMONICS: usize = 10;
pub const CYCLES: usize = 10;
pub const STEP_S: f64 = 0.01;
/// Workspace of the designs, m and rad.
pub const WORKSPACE: [f64; 2] = [0.75, 0.8];
/// Cost per degree of freedom below which a likelihood has harmonics enough.
const EXPLAINED: f64 = 1.1;
/// Samples per period that a design is judged by.
const DESIGN_SAMPLES: usize = 100;
/// Reward of V1 per root mean square of a channel.
pub const RMS_WEIGHT: f64 = 20.0;
/// Noise of one sample and axis.
pub const NOISE: NoiseTable = NoiseTable { position_m: 0.05, attitude_rad: 0.03, force_n: 0.01, torque_n_m: 0.001 };
/// Natural frequencies of the tracker, rad/s.
pub const TRACKER_RAD_S: [f64; 2] = [10.0, 5.0];

/// What a motion was designed by.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum Criterion {
    V1,
    V2,
}

/// A motion from one random start.
pub fn design(
    criterion: Criterion,
    period_s: f64,
    limits: &[ChannelLimits; 6],
    start: u64,
) -> Result<FourierMotion, IdentificationError> {
    let basis = FourierBasis::try_new(period_s, REFERENCE_HARMONICS)?;
    let (torque, force) = (NOISE.torque_n_m, NOISE.force_n);
    let problem = SpaceExcitation::try_new(basis, limits, DESIGN_SAMPLES)?
        .with_wrench_noise(Vector6::new(torque, torque, torque, force, force, force))?;
    let design = match criterion {
        Criterion::V1 => problem.design(&NormalizedCondition { rms_weights: [RMS_WEIGHT; 6] }, 1, start)?,
        Criterion::V2 => problem.design(&DOptimality, 1, start)?,
    };
    Ok(design.motion)
}

/// Limits of position and of angle: the workspace alone, or with rate and acceleration.
pub fn channel_limits(acceleration: Option<[f64; 2]>) -> [ChannelLimits; 6] {
    std::array::from_fn(|channel| {
        let largest = acceleration.map_or(f64::INFINITY, |limits| limits[channel / 3]);
        ChannelLimits::symmetric(WORKSPACE[channel / 3], f64::INFINITY, largest)
    })
}

/// Actuators without limits.
pub fn unlimited() -> WrenchBox {
    wrench_box(f64::INFINITY, f64::INFINITY)
}

/// Tracks a motion with the robot's own body as nominal one while it carries the load.
pub fn fly(
    motion: &FourierMotion,
    load: &InertialParameters<f64>,
    limits: WrenchBox,
    cycles: usize,
) -> Result<Execution, IdentificationError> {
    let tracker =
        PoseTracker::critically_damped(FreeFlyer::new(space_cobot::body()), TRACKER_RAD_S[0], TRACKER_RAD_S[1]);
    let mut plant =
        SimulatedBody::try_new(FreeFlyer::new(*load), MuntheKaas4, limits, RigidBodyState::at_rest(), STEP_S)?;
    execute(motion, &tracker, &mut plant, &Pose::identity(), cycles, STEP_S)
}

/// The motion itself, and the wrench that the loaded body needs for it.
pub fn follow_exactly(
    motion: &FourierMotion,
    load: &InertialParameters<f64>,
    cycles: usize,
) -> Result<Execution, IdentificationError> {
    let period_s = motion.basis().period_s();
    let body = FreeFlyer::new(*load);
    let cycle = fly(motion, load, unlimited(), 1)?;
    let instants: Vec<ExecutionSample> = cycle
        .samples
        .iter()
        .filter_map(|sample| {
            let reference = motion.at(sample.time_s)?.reference(&Pose::identity());
            let wrench = body.inverse(&reference.state.twist_body, &reference.acceleration);
            let state = reference.state;
            Some(ExecutionSample { state, wanted_wrench_body: wrench, realized_wrench_body: wrench, ..*sample })
        })
        .collect();
    let later = |cycle: usize| {
        let moved = move |sample: &ExecutionSample| ExecutionSample {
            time_s: sample.time_s + period_s * cycle as f64,
            ..*sample
        };
        instants.iter().map(moved)
    };
    let samples: Vec<ExecutionSample> = (0..cycles).flat_map(later).collect();
    Ok(Execution { samples, samples_per_cycle: instants.len(), saturation: Saturation::default() })
}

/// Errors of one estimate in the order of [`GROUPS`](crate::flights::GROUPS): inertia about the origin (six numbers) by its
/// norm, centre of mass in m, mass by itself. Infinite where there is no estimate.
pub type GroupErrors = [f64; 3];

const NO_ANSWER: GroupErrors = [f64::INFINITY; 3];

/// Inertia and mass by their own size.
fn relative(found: &SVector<f64, 10>, truth: &InertialParameters<f64>) -> GroupErrors {
    let [inertia, center, mass] = Errors::of(found, truth).norms();
    [inertia / truth.to_vector().fixed_rows::<6>(4).norm(), center, mass / truth.mass]
}

/// Which estimators answer beside least squares.
#[derive(Clone, Copy, Default)]
pub struct Beside {
    /// The likelihood in coefficient space with the first of these numbers of harmonics that leaves nothing but noise, else the
    /// last that answers.
    pub coefficients: &'static [usize],
    pub coefficients_as_chosen: bool,
    pub trajectory: bool,
}

impl Beside {
    /// Without the likelihood in coefficient space unless it is wanted.
    pub fn only_if(self, wanted: bool) -> Self {
        if wanted { self } else { Self { trajectory: self.trajectory, ..Self::default() } }
    }
}

/// What became of one flight.
#[derive(Clone, Debug)]
pub struct Outcome {
    /// Share of time with any component of the wrench at its limit.
    pub saturation: f64,
    /// Rms deviation from the motion: distance in m, angle in rad.
    pub deviation: [f64; 2],
    /// Least squares with 3, 4 .. 10 harmonics.
    pub by_harmonics: Vec<GroupErrors>,
    /// The residuals by which a number is chosen.
    pub candidates: Vec<HarmonicCandidate>,
    /// Number of harmonics of least residual of the wrench, and of least residual of power.
    pub chosen: [usize; 2],
    /// Parameters by least squares with the first of them, in the thesis's order (4.9), and the truth.
    pub least_squares: Option<SVector<f64, 10>>,
    pub truth: SVector<f64, 10>,
    /// Likelihood in coefficient space with harmonics enough to leave nothing but noise, where asked for.
    pub by_coefficients: Option<GroupErrors>,
    /// The same with the number of harmonics that least squares chose, where asked for.
    pub by_coefficients_as_chosen: Option<GroupErrors>,
    /// Likelihood of the trajectory with the wrench that acted, where asked for.
    pub by_trajectory: Option<GroupErrors>,
}

impl Outcome {
    /// Errors of least squares with the chosen number of harmonics.
    pub fn errors(&self) -> GroupErrors {
        self.with_harmonics(self.chosen[0])
    }

    pub fn with_harmonics(&self, harmonics: usize) -> GroupErrors {
        self.by_harmonics.get(harmonics.wrapping_sub(REFERENCE_HARMONICS)).copied().unwrap_or(NO_ANSWER)
    }

    /// The number of harmonics with the least error of each group.
    pub fn best(&self) -> [usize; 3] {
        std::array::from_fn(|group| {
            let errors = self.by_harmonics.iter().map(|errors| errors[group]).enumerate();
            REFERENCE_HARMONICS + errors.min_by(|a, b| a.1.total_cmp(&b.1)).map_or(0, |(index, _)| index)
        })
    }
}

/// Adds noise to a flight and estimates its load.
pub fn process(
    motion: &FourierMotion,
    load: &InertialParameters<f64>,
    flown: &Execution,
    timing: WrenchTiming,
    beside: Beside,
    seed: u64,
) -> Outcome {
    let log = measured(flown, &NOISE, &mut Gaussian::from_seed(seed));
    let settings = HarmonicSettings {
        wrench_timing: timing,
        largest_harmonics: LARGEST_HARMONICS,
        // As the thesis does it; the library would look for the transient.
        dropped_cycles: Some(1),
        ..HarmonicSettings::new(motion.basis().period_s(), REFERENCE_HARMONICS)
    };
    let mut outcome = Outcome {
        saturation: flown.saturation.any,
        deviation: deviation(motion, flown),
        by_harmonics: Vec::new(),
        candidates: Vec::new(),
        chosen: [0; 2],
        least_squares: None,
        truth: load.to_vector(),
        by_coefficients: (!beside.coefficients.is_empty()).then_some(NO_ANSWER),
        by_coefficients_as_chosen: beside.coefficients_as_chosen.then_some(NO_ANSWER),
        by_trajectory: beside.trajectory.then_some(NO_ANSWER),
    };
    if beside.trajectory {
        let likelihood = MaximumLikelihood { wrench_timing: timing, ..MaximumLikelihood::default() };
        let found = likelihood.estimate(&log).ok();
        outcome.by_trajectory = Some(found.map_or(NO_ANSWER, |found| relative(&found.parameters.to_vector(), load)));
    }
    // A body that turned over has no periodic Euler angles.
    let Ok(cycles) = average_cycles(&log, &settings) else { return outcome };
    if fourier(&cycles.record, load, &mut outcome).is_err() {
        return outcome;
    }
    if !beside.coefficients.is_empty() {
        outcome.by_coefficients = Some(by_coefficients(&cycles.record, load, beside.coefficients));
    }
    if beside.coefficients_as_chosen {
        let found = maximum_likelihood(&cycles.record, outcome.chosen[0]).ok();
        let found = found.map(|found| relative(&found.estimate.parameters.to_vector(), load));
        outcome.by_coefficients_as_chosen = Some(found.unwrap_or(NO_ANSWER));
    }
    outcome
}

fn by_coefficients(record: &PeriodicRecord, load: &InertialParameters<f64>, harmonics: &[usize]) -> GroupErrors {
    let mut last = NO_ANSWER;
    for &harmonics in harmonics {
        if let Ok(found) = maximum_likelihood(record, harmonics) {
            last = relative(&found.estimate.parameters.to_vector(), load);
            if found.reduced_chi_square() < EXPLAINED {
                break;
            }
        }
    }
    last
}

/// Least squares with every number of harmonics, and the choice among them.
fn fourier(
    record: &PeriodicRecord,
    load: &InertialParameters<f64>,
    outcome: &mut Outcome,
) -> Result<(), IdentificationError> {
    let (fit, candidates) =
        select_harmonics(record, REFERENCE_HARMONICS..=LARGEST_HARMONICS, SelectionRule::LeastSquaresResidual)?;
    let by_power = candidates.iter().min_by(|a, b| a.power_residual_w.total_cmp(&b.power_residual_w));
    outcome.chosen = [fit.motion.basis().harmonics(), by_power.map_or(0, |candidate| candidate.harmonics)];
    outcome.candidates = candidates;
    for harmonics in REFERENCE_HARMONICS..=LARGEST_HARMONICS {
        let found = FourierFit::new(record, harmonics).and_then(|fit| PeriodicLeastSquares::fit(record, &fit)).ok();
        if harmonics == outcome.chosen[0] {
            outcome.least_squares = found.as_ref().map(|found| found.parameters);
        }
        outcome.by_harmonics.push(found.map_or(NO_ANSWER, |found| relative(&found.parameters, load)));
    }
    Ok(())
}

/// Rms distance and angle between where the body was and where the motion wanted it, after the first cycle.
fn deviation(motion: &FourierMotion, flown: &Execution) -> [f64; 2] {
    let (mut squares, mut count) = ([0.0; 2], 0.0);
    for sample in flown.samples.iter().skip(flown.samples_per_cycle).step_by(10) {
        if let Some(wanted) = motion.at(sample.time_s) {
            let (wanted, is) = (wanted.world_from_body, sample.state.world_from_body);
            squares[0] += (wanted.translation.vector - is.translation.vector).norm_squared();
            squares[1] += wanted.rotation.angle_to(&is.rotation).powi(2);
            count += 1.0;
        }
    }
    squares.map(|square: f64| (square / count).sqrt())
}
