//! Maximum likelihood from noisy poses and noisy wrenches: multiple shooting with states and wrench noise eliminated.
//!
//! All scalars are `f64`, standard-library mathematics: this is estimation after the fact.

mod calibration;
mod chain;
mod coordinates;
#[cfg(feature = "argmin")]
mod cost;
mod drive;
mod elimination;
mod flight;
mod flow;
pub(crate) mod identifiability;
mod lanes;
mod nodes;
mod noise;
mod ordinary;
mod record;
mod rounding;
mod sample;
mod segment;
mod stream;
mod window;

pub use calibration::{Nuisance, NuisancePrior, Nuisances};
#[cfg(feature = "argmin")]
pub use cost::LikelihoodCost;
pub use flight::{
    FlightEstimate, FlightLikelihood, FoundDelay, FoundFactor, FoundLevels, FoundThrusters, Halves, Plane, Thrusters,
};
pub(crate) use flight::{Place, Stages};
pub use identifiability::{Exchange, Quantity, Verdict};
pub(crate) use rounding::whole;
pub use window::{FixedLag, FixedLagSettings, FixedLagStep, Innovation};

use crate::body_change::{CUTS, Quadratic, likeliest_cut};
use crate::dynamics::InertialParameters;
use crate::error::{Column, IdentificationError};
use crate::lie::Wrench;
use crate::motion::MotionSample;
use crate::statistics::{Whiteness, chi_square_exceedance};
use crate::synchronize::{self, Signals};
use crate::units::Units;
use crate::{Noise, WrenchTiming};
use calibration::Calibration;
use chain::{Chain, Sweep};
use coordinates::{Coordinates, ParameterStep};
use elimination::{Indefinite, Schur};
use identifiability::{Identifiability, inflation};
use nalgebra::{DMatrix, DVector, Matrix3, SMatrix, SVector, Vector3};
use noise::{Levels, WrenchPrior};
use record::Record;
use segment::{ATTITUDE, GATE, HUBER, MEASUREMENTS, POSITION, Robust};

/// Iterations after which an estimate that still moves is given up.
const MAX_ITERATIONS: usize = 30;
/// Iterations after which rows and wrenches stay paired as they are.
const ROWS_STAY: usize = 15;
/// Iterations under a weak prior.
const WEAK_ITERATIONS: usize = 12;
/// A step whose squared length in standard deviations is below this has converged: a hundredth of a sigma.
const SMALL_DECREMENT: f64 = 1e-4;
/// Longest delay that is believed, as a fraction of the record.
const LONGEST_DELAY: f64 = 0.25;
/// Rows that are correlated for a start of the delay, and the longest delay looked for, s.
const CORRELATED_ROWS: usize = 2000;
const LONGEST_CORRELATED_S: f64 = 0.6;
/// Standard deviations of the weak prior: ln m, centre of mass in m, inertia by the mean inertia of the start.
const WEAK: (f64, f64, f64) = (1.5, 0.3, 0.5);
/// Second window of the first guess, by the first.
const SHORTER_WINDOW: f64 = 0.3;
/// Factor by which a doubt of the wrench falls when the iterations under it are near their optimum.
const DOUBT_FALLS: f64 = 10.0;
/// Largest component of a node's step at convergence (rad, rad/s, m, m/s).
const SMALL_STEP: f64 = 1e-3;
/// Within so many squared standard deviations the levels of noise and outliers may be judged.
const NEAR: f64 = 1e2;
/// Samples of the longest segment.
const LONGEST_SEGMENT: usize = 16;
/// Longest segment from a start that may be far off, s.
const FIRST_SEGMENT_S: f64 = 0.3;
/// Largest turn by the logged torque over the first segments, rad: a start too light for it flies off beyond all tangents,
/// one too heavy never does.
const FIRST_TURN: f64 = 0.3;
/// Iteration from which the gate works in any case.
const GATED: usize = 4;
/// Mean square of a normal residual 3-vector under these bounds, over three.
const CONSISTENCY: f64 = 0.957_918;
/// Restricted-likelihood steps on one linearisation, and linearisations on which they are done.
const ROUNDS: usize = 3;
const REFINEMENTS: usize = 3;
/// Parts whose pulls are compared at most, and what scatter counts: above this factor, where chance does so less often.
const SCATTER_PARTS: usize = 24;
const VISIBLE_SCATTER: (f64, f64) = (1.2, 1e-4);
/// A direction weaker than this fraction of the strongest is not shown.
const SHOWN: f64 = 1e-12;

/// Maximum likelihood of the ten parameters from poses and wrenches that are both noisy; rates, velocities and
/// accelerations are used where present.
///
/// The record is cut into segments. Attitude, rate, centre of mass and velocity at each segment's start and one constant
/// error of the wrench over each segment are unknowns beside the ten parameters; they are eliminated segment by segment.
/// Gauss-Newton converges from a sphere of 10 kg: with the motion taken from the poses, one step of the flow is linear in
/// 1/m and the inverse inertia.
///
/// A record whose step, lever arm or wrench is far from those of a robot is taken in units in which they are not, unless nuisances are asked
/// for: what a data sheet says of these is in seconds and metres.
///
/// # Source
/// The likelihood of the model of thesis (2.4) with a held wrench; consistency as (5.35)-(5.38), about the centre of mass.
#[derive(Clone, Debug, PartialEq)]
pub struct MaximumLikelihood {
    /// When the logged wrench acts.
    pub wrench_timing: WrenchTiming,
    /// Gravitational acceleration, inertial axes, m/s^2.
    pub gravity_world: Vector3<f64>,
    /// Noise of one sample and axis where it is known; `None` estimates all levels.
    pub noise: Option<Noise>,
    /// What to estimate beside the ten parameters.
    pub nuisances: Vec<Nuisance>,
    /// What is known of them; those not named start where nothing is wrong.
    pub nuisance_priors: Vec<NuisancePrior>,
    /// Whether outliers among the measurements lose their weight.
    pub robust: bool,
    /// Samples in a segment; `None` chooses from the noise found.
    pub segment_samples: Option<usize>,
    /// Poses within this time of a segment's start give its first guess, s; the default is for a record of an ordinary step.
    pub node_window_s: f64,
    /// Body to start from; the default is for an ordinary wrench and lever arm.
    pub start: InertialParameters<f64>,
}

impl Default for MaximumLikelihood {
    fn default() -> Self {
        Self {
            wrench_timing: WrenchTiming::default(),
            gravity_world: Vector3::zeros(),
            noise: None,
            nuisances: Vec::new(),
            nuisance_priors: Vec::new(),
            robust: true,
            segment_samples: None,
            node_window_s: 0.6,
            start: InertialParameters::about_com(10.0, Vector3::zeros(), Matrix3::identity() * 0.15),
        }
    }
}

/// One Gauss-Newton iteration.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Iteration {
    /// Weighted squares of all residuals before the step.
    pub cost: f64,
    /// Squared length of the parameter step in standard deviations.
    pub decrement: f64,
    /// Largest component by which a segment's end misses the next one's start (rad, rad/s, m, m/s).
    pub largest_defect: f64,
}

/// What was found about a nuisance.
#[derive(Clone, Debug, PartialEq)]
pub struct NuisanceEstimate {
    /// Which.
    pub nuisance: Nuisance,
    /// Its value; `None` where the data do not determine it.
    pub value: Option<f64>,
    /// One standard deviation, where there is a value.
    pub std: Option<f64>,
    /// Whether the data alone determine it.
    pub verdict: Verdict,
    /// Factors by which estimating it raises the standard deviations of mass, centre of mass and inertia.
    pub inflation: [f64; 3],
}

/// What [`MaximumLikelihood::estimate`] found.
#[derive(Clone, Debug, PartialEq)]
pub struct LikelihoodEstimate {
    /// The most likely body that exists.
    pub parameters: InertialParameters<f64>,
    /// Most likely parameters if they need not be a body, to first order about [`parameters`](Self::parameters); in the
    /// order of [`InertialParameters::to_vector`].
    pub unconstrained: SVector<f64, 10>,
    /// Covariance of the ten parameters in that order, without the consistency constraint.
    pub covariance: SMatrix<f64, 10, 10>,
    /// One standard deviation of `[ln m, c, J_C (11, 12, 13, 22, 23, 33)]`.
    pub std: SVector<f64, 10>,
    /// Body axis along which the consistency constraint holds the body thick enough; `None` where it is not active.
    pub active_axis: Option<Vector3<f64>>,
    /// The nuisances asked for.
    pub nuisances: Vec<NuisanceEstimate>,
    /// Combinations of them and the ten parameters that the data do not determine. Where there is one, the nuisances in it
    /// are held near their expected values by a weak prior, and all standard deviations are those that this prior leaves.
    pub exchanges: Vec<Exchange>,
    /// Noise levels used.
    pub noise: Noise,
    /// Noise that the logged wrenches show by themselves, sample against sample: N m and N. Far more in
    /// [`noise`](Self::noise) is wrench that the log does not hold. Infinite where it shows none or was not looked for.
    pub visible_wrench_noise: [f64; 2],
    /// Weighted squares of all residuals.
    pub cost: f64,
    /// Log determinant of the information of all unknowns; with [`cost`](Self::cost) and the noise levels it gives the
    /// restricted likelihood, by which noise models compare. In the units the record was fitted in: compare only fits of one record
    /// with nuisances in both or in neither.
    pub log_determinant: f64,
    /// What each iteration did; the first ones of a second start are by a likelihood that doubts the wrench.
    pub iterations: Vec<Iteration>,
    /// Samples in a segment.
    pub segment_samples: usize,
    /// Wrench that the motion asks for beyond the one logged, in temporal order.
    pub residuals: Vec<SegmentResidual>,
    /// Poses given no weight, position or attitude.
    pub outliers: usize,
    /// Whether what the measurements leave unexplained is white, column by column. The standard deviations assume it is.
    pub whiteness: Vec<(Column, Whiteness)>,
    /// Where the record asks for one body before and another after; not looked for where nuisances were asked for, nor by
    /// [`FixedLag`].
    pub body_change: Option<BodyChange>,
    /// By what factor the parts of the record pull at the parameters more than the standard deviations, which take noise for
    /// white, allow; one where that is chance, and by [`FixedLag`], which does not look for it.
    pub scatter: f64,
}

/// A record that one body does not explain, and two do better than chance allows.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct BodyChange {
    /// Last sample that surely belongs to the body before.
    pub last_before: usize,
    /// The likeliest first sample of the body after.
    pub first_after: usize,
    /// First sample that surely belongs to the body after.
    pub first_sure: usize,
    /// Parameters that the part before asks for, to first order.
    pub before: SVector<f64, 10>,
    /// Parameters that the part after asks for, to first order.
    pub after: SVector<f64, 10>,
    /// Standard deviations of `after - before`, widened by what neighbouring stretches of the record disagree.
    pub deviation: SVector<f64, 10>,
}

impl LikelihoodEstimate {
    /// The delay, where it was asked for and is determined, s.
    pub fn delay_s(&self) -> Option<f64> {
        self.nuisances.iter().find(|found| found.nuisance == Nuisance::Delay).and_then(|found| found.value)
    }
}

/// What the model leaves unexplained over one segment.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SegmentResidual {
    /// First sample of the segment.
    pub first_sample: usize,
    /// Constant wrench, body axes about the body origin.
    pub wrench: Wrench<f64>,
}

impl MaximumLikelihood {
    /// The most likely body for a record.
    ///
    /// # Errors
    /// [`IdentificationError::TooFewSamples`], [`IdentificationError::TimesNotIncreasing`],
    /// [`IdentificationError::MissingColumn`], [`IdentificationError::NotFinite`] for a record that cannot be used;
    /// [`IdentificationError::NotExcited`] where it does not determine the parameters asked for;
    /// [`IdentificationError::LikelihoodNotConverged`].
    pub fn estimate(&self, record: &[MotionSample]) -> Result<LikelihoodEstimate, IdentificationError> {
        // The iterations begin from a body of some kilograms and with stretches of some tenths of a second. So is what is known beforehand
        // of nuisances, which is not scaled.
        let units = Units::of_record(record);
        let scaled = if self.nuisances.is_empty() { units.record(record) } else { None };
        match scaled.map(|scaled| self.in_units(&units).estimate_as_told(&scaled)) {
            Some(Ok(found)) => Ok(found.in_units(&units.back())),
            _ => self.estimate_as_told(record),
        }
    }

    fn estimate_as_told(&self, record: &[MotionSample]) -> Result<LikelihoodEstimate, IdentificationError> {
        match self.estimate_from_poses(record, Approach::Direct) {
            // A body that turns far within the window of the first guess needs a shorter one. Poor poses give poor states in
            // either, and a wrench much better than they are ties the states over longer times than tangents reach.
            Err(error) if is_about_the_start(&error) => {
                let hasty = Self { node_window_s: self.node_window_s * SHORTER_WINDOW, ..self.clone() };
                hasty.estimate_from_poses(record, Approach::DoubtedWrench)
            }
            found => found,
        }
    }

    fn estimate_from_poses(
        &self,
        record: &[MotionSample],
        approach: Approach,
    ) -> Result<LikelihoodEstimate, IdentificationError> {
        let delay_s = self.correlated_delay_s(record);
        let record = Record::try_new(record, self.wrench_timing, self.robust)?;
        let mut calibration = self.calibration(record.samples.iter().any(|sample| sample.acceleration.is_some()));
        calibration.start_late(delay_s);
        match calibration.columns() {
            0..=13 => self.run::<32>(record, calibration, approach),
            14..=21 => self.run::<40>(record, calibration, approach),
            _ => self.run::<56>(record, calibration, approach),
        }
    }

    /// How a given body fits a record: states and errors of the wrench are found for it as it is.
    ///
    /// # Errors
    /// As [`estimate`](Self::estimate); the noise must be known.
    pub(crate) fn judge(
        &self,
        record: &[MotionSample],
        body: &InertialParameters<f64>,
        covariance: &SMatrix<f64, 10, 10>,
        noise: &Noise,
    ) -> Result<Judged, IdentificationError> {
        let record = Record::try_new(record, self.wrench_timing, self.robust)?;
        let (eta, levels) = (Coordinates::of(body), Levels::of(noise));
        let calibration = Calibration::new(&[], &[]);
        let starts = record.segments(segment_length(&levels, &eta, record.median_step_s), &drive::Passage::default());
        let nodes = nodes::from_poses(&record, &starts, self.node_window_s, &eta.center);
        let mut chain = Chain::<32>::new(record, self.gravity_world, starts, nodes, &calibration);
        let robust = self.robust.then_some(Robust { huber: HUBER, gate: f64::INFINITY });
        for iteration in 1..=MAX_ITERATIONS {
            chain.sweep(&eta, &calibration, &levels, robust);
            let schur = chain.eliminate(&levels).map_err(not_excited)?;
            let largest = chain.follow(&ParameterStep::none(&eta, schur.gradient.len()));
            if largest < SMALL_STEP {
                break;
            }
            if iteration == MAX_ITERATIONS {
                return Err(IdentificationError::LikelihoodNotConverged { iterations: iteration, decrement: largest });
            }
        }
        chain.sweep(&eta, &calibration, &levels, robust);
        let schur = chain.eliminate(&levels).map_err(not_excited)?;
        let misfit = misfit(&schur, &eta, covariance).ok_or(not_excited(Indefinite))?;
        Ok(Judged { misfit, residuals: residuals(&chain) })
    }

    /// Where a delay of several samples starts: the likelihood's own search reaches as far as the motion is straight. Zero
    /// where the stretch that is driven most does not show it.
    fn correlated_delay_s(&self, record: &[MotionSample]) -> f64 {
        let known = self.nuisance_priors.iter().any(|prior| prior.nuisance == Nuisance::Delay);
        if known || !self.nuisances.contains(&Nuisance::Delay) {
            return 0.0;
        }
        let drive = |rows: &[MotionSample]| -> f64 {
            rows.iter().filter_map(|row| row.wrench_body).map(|wrench| wrench.force.norm_squared()).sum()
        };
        let driven = record.chunks(CORRELATED_ROWS).max_by(|a, b| drive(a).total_cmp(&drive(b))).unwrap_or(record);
        let found = Signals::from_record(driven, self.wrench_timing, &self.gravity_world)
            .and_then(|signals| synchronize::delay(&signals, LONGEST_CORRELATED_S));
        found.ok().filter(|found| found.verdict == Verdict::Identifiable).map_or(0.0, |found| found.delay_s)
    }

    /// The nuisances asked for, and where times are among them, that of the accelerometer, which may have its own.
    fn calibration(&self, with_accelerations: bool) -> Calibration {
        let mut nuisances = self.nuisances.clone();
        let late = [Nuisance::Delay, Nuisance::ActuatorLag].iter().any(|late| nuisances.contains(late));
        if late && with_accelerations {
            nuisances.push(Nuisance::AccelerationDelay);
        }
        Calibration::new(&nuisances, &self.nuisance_priors)
    }

    /// The optimum held by a weak prior about the start, nuisances left alone, and that prior's precisions.
    fn weakly_held(&self, record: Record) -> Result<(Fit<32>, SVector<f64, 10>), IdentificationError> {
        let plain = Self { nuisances: Vec::new(), ..self.clone() };
        let inertia = WEAK.2 * self.start.inertia_about_com().trace() / 3.0;
        let precision = SVector::from_fn(|i, _| match i {
            0 => WEAK.0.powi(-2),
            1..=3 => WEAK.1.powi(-2),
            _ => inertia.powi(-2),
        });
        let calibration = plain.calibration(false);
        Ok((plain.fit::<32>(record, calibration, Some(&precision), Approach::Direct)?, precision))
    }

    /// The optimum for a record that does not determine everything, a weak prior about the start filling in, and the
    /// information of the record alone about [`InertialParameters::to_vector`].
    pub(crate) fn partial(
        &self,
        record: &[MotionSample],
    ) -> Result<(LikelihoodEstimate, SMatrix<f64, 10, 10>), IdentificationError> {
        // The weak prior is of an ordinary body.
        let units = Units::of_record(record);
        let Some(scaled) = units.record(record) else { return self.partial_as_told(record) };
        let (found, information) = self.in_units(&units).partial_as_told(&scaled)?;
        let factors = units.parameter_factors();
        let information = SMatrix::from_fn(|i, j| information[(i, j)] * factors[i] * factors[j]);
        Ok((found.in_units(&units.back()), information))
    }

    fn partial_as_told(
        &self,
        record: &[MotionSample],
    ) -> Result<(LikelihoodEstimate, SMatrix<f64, 10, 10>), IdentificationError> {
        let record = Record::try_new(record, self.wrench_timing, self.robust)?;
        let (fit, precision) = self.weakly_held(record)?;
        let by_parameters = fit.eta.parameters_by_eta().try_inverse().ok_or(not_excited(Indefinite))?;
        let alone = fit.schur.information.fixed_view::<10, 10>(0, 0) - SMatrix::from_diagonal(&precision);
        Ok((result(&fit)?, by_parameters.transpose() * alone * by_parameters))
    }

    fn run<const W: usize>(
        &self,
        record: Record,
        calibration: Calibration,
        approach: Approach,
    ) -> Result<LikelihoodEstimate, IdentificationError> {
        let mut fit = self.fit::<W>(record, calibration, None, approach)?;
        let found = result(&fit)?;
        let body_change = if self.nuisances.is_empty() { body_change(&mut fit)? } else { None };
        Ok(LikelihoodEstimate { body_change, scatter: scatter(&mut fit)?, ..found })
    }

    /// The optimum, with a prior about the start or without.
    fn fit<const W: usize>(
        &self,
        record: Record,
        mut calibration: Calibration,
        weak: Option<&SVector<f64, 10>>,
        approach: Approach,
    ) -> Result<Fit<W>, IdentificationError> {
        let (mut levels, prior) = if let Some(noise) = &self.noise {
            (Levels::of(noise), None)
        } else {
            let (levels, prior) = Levels::from_differences(&record);
            (levels, Some(prior))
        };
        let first = || whole(FIRST_SEGMENT_S / record.median_step_s).clamp(1, LONGEST_SEGMENT);
        let mut length = self.segment_samples.unwrap_or_else(first).max(1);
        let step_s = record.median_step_s;
        let start = Coordinates::of(&self.start);
        let mut eta =
            start.heavier(record.largest_torque(&start.center) * (length as f64 * step_s).powi(2) / FIRST_TURN);
        let longest_delay_s = LONGEST_DELAY * step_s * record.samples.len() as f64;
        calibration.shift(step_s, longest_delay_s);
        let starts = record.segments(length, &calibration.passage());
        let nodes = nodes::from_poses(&record, &starts, self.node_window_s, &eta.center);
        let mut chain = Chain::<W>::new(record, self.gravity_world, starts, nodes, &calibration);
        if let Some(precision) = weak {
            chain.add_prior(precision, &eta.difference(&start));
        }
        let mut approached = Vec::new();
        if approach == Approach::DoubtedWrench {
            approached = self.approach(&mut chain, &mut eta, &mut calibration, &levels)?;
        }
        let mut progress = Progress::default();
        loop {
            let robust = self.robust.then(|| progress.robust(prior.is_none()));
            let sweep = chain.sweep(&eta, &calibration, &levels, robust);
            let (mut schur, _) = eliminated(&mut chain, &calibration, &levels)?;
            let cost = cost(&sweep, &levels);
            let mut settled = true;
            if prior.is_some() && progress.near() && !progress.judged {
                // Differences may miss what is not white; nothing may be called an outlier by their word alone.
                chain.residual_levels(&mut levels);
                progress.judged = true;
                (schur, _) = eliminated(&mut chain, &calibration, &levels)?;
            // Directions that a weak prior holds would pass for noise.
            } else if let Some(prior) = prior.as_ref().filter(|_| weak.is_none() && progress.refines()) {
                let consistency = if self.robust { CONSISTENCY } else { 1.0 };
                settled = false;
                for round in 0..ROUNDS {
                    let Some(evidence) = chain.evidence(&schur, &levels) else { break };
                    let change = levels.refine(&evidence, &sweep.tally, consistency, prior);
                    (schur, _) = eliminated(&mut chain, &calibration, &levels)?;
                    if Levels::settled(change) {
                        settled = round == 0;
                        break;
                    }
                }
                progress.refinements += 1;
            }
            let halved = progress.diverges();
            let gradient = if halved { &schur.gradient * 0.5 } else { schur.gradient.clone() };
            let step = eta.step(&schur.information, &gradient).ok_or(not_excited(Indefinite))?;
            let decrement = step.step.dot(&(&schur.information * &step.step));
            let largest_step = chain.follow(&step);
            eta = step.next;
            calibration.advance(step.step.as_slice());
            let gated = robust.is_none_or(|robust| robust.gate.is_finite());
            progress.iterations.push(Iteration { cost, decrement, largest_defect: sweep.largest_defect });
            // Between two rows there is a place where each says that the other is nearer.
            let shifted = progress.iterations.len() < ROWS_STAY && calibration.shift(step_s, longest_delay_s);
            let still = decrement < SMALL_DECREMENT && largest_step < SMALL_STEP && !shifted;
            let refined = prior.is_none()
                || weak.is_some()
                || progress.refinements > 0 && (settled || progress.refinements >= REFINEMENTS);
            // Where the data say next to nothing the optimum is ill defined, and not needed: more data follow.
            let enough = weak.is_some() && decrement.is_finite() && progress.iterations.len() >= WEAK_ITERATIONS;
            if still && gated && refined || enough {
                let robust = self.robust.then(|| progress.robust(prior.is_none()));
                let sweep = chain.sweep(&eta, &calibration, &levels, robust);
                let (schur, identifiability) = eliminated(&mut chain, &calibration, &levels)?;
                let (iterations, constrained) = ([approached, progress.iterations].concat(), step.constrained);
                return Ok(Fit {
                    chain,
                    eta,
                    calibration,
                    levels,
                    sweep,
                    schur,
                    identifiability,
                    iterations,
                    constrained,
                    segment_samples: length,
                    visible_wrench_noise: prior.as_ref().map_or([f64::INFINITY; 2], WrenchPrior::visible),
                });
            }
            let iterations = progress.iterations.len();
            if !decrement.is_finite() || iterations >= MAX_ITERATIONS {
                return Err(IdentificationError::LikelihoodNotConverged { iterations, decrement });
            }
            if shifted && chain.record.segments(length, &calibration.passage()) != chain.starts {
                // The states stay: thrown away, they would be judged by the gate as poor as they began.
                chain = chain.resegmented(length, (&eta, &calibration), self.node_window_s);
            } else if self.segment_samples.is_none() && decrement < NEAR {
                let wanted = segment_length(&levels, &eta, step_s);
                if wanted < length {
                    length = wanted;
                    chain = chain.resegmented(length, (&eta, &calibration), self.node_window_s);
                }
            }
        }
    }

    /// Comes near the optimum from states that are poor for so good a wrench: at first the wrench counts as no better than it
    /// is large, so that each stretch is explained by itself, and this doubt is taken back step by step.
    fn approach<const W: usize>(
        &self,
        chain: &mut Chain<W>,
        eta: &mut Coordinates,
        calibration: &mut Calibration,
        levels: &Levels,
    ) -> Result<Vec<Iteration>, IdentificationError> {
        let robust = self.robust.then_some(Robust { huber: HUBER, gate: f64::INFINITY });
        let mut doubt = levels.largest_doubt(&chain.record);
        let mut iterations = Vec::new();
        while doubt > 1.0 && iterations.len() < MAX_ITERATIONS {
            let doubtful = levels.with_doubt(doubt);
            let sweep = chain.sweep(eta, calibration, &doubtful, robust);
            let (schur, _) = eliminated(chain, calibration, &doubtful)?;
            let step = eta.step(&schur.information, &schur.gradient).ok_or(not_excited(Indefinite))?;
            let decrement = step.step.dot(&(&schur.information * &step.step));
            chain.follow(&step);
            *eta = step.next;
            calibration.advance(step.step.as_slice());
            let cost = cost(&sweep, &doubtful);
            iterations.push(Iteration { cost, decrement, largest_defect: sweep.largest_defect });
            if decrement < NEAR {
                doubt /= DOUBT_FALLS;
            }
        }
        Ok(iterations)
    }
}

/// Whether other first states or a start of another size may do better.
fn is_about_the_start(error: &IdentificationError) -> bool {
    matches!(
        error,
        IdentificationError::NotExcited { .. }
            | IdentificationError::Indefinite { .. }
            | IdentificationError::LikelihoodNotConverged { .. }
    )
}

/// How the iterations come near the optimum.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Approach {
    /// With the likelihood as it is.
    Direct,
    /// With a wrench that is believed little by little.
    DoubtedWrench,
}

fn result<const W: usize>(fit: &Fit<W>) -> Result<LikelihoodEstimate, IdentificationError> {
    let Fit { chain, eta, calibration, levels, sweep, schur, identifiability, .. } = fit;
    let factor = schur.information.clone().cholesky().ok_or(not_excited(Indefinite))?;
    let covariance = factor.inverse();
    let by_eta = eta.parameters_by_eta();
    let body = covariance.fixed_view::<10, 10>(0, 0).into_owned();
    let pull = factor.solve(&schur.gradient);
    let parameters = eta.parameters();
    let nuisances = calibration.nuisances().iter().zip(&identifiability.verdicts).enumerate();
    let nuisance = |(index, (&nuisance, verdict)): (usize, (&Nuisance, &Verdict))| {
        let column = 10 + index;
        let (value, std) = calibration.reported(index, covariance[(column, column)].sqrt());
        let known = *verdict == Verdict::Identifiable;
        NuisanceEstimate {
            nuisance,
            value: known.then_some(value),
            std: known.then_some(std),
            verdict: verdict.clone(),
            inflation: inflation(&schur.information, &covariance, column),
        }
    };
    Ok(LikelihoodEstimate {
        parameters,
        unconstrained: parameters.to_vector() + by_eta * pull.fixed_rows::<10>(0),
        covariance: by_eta * body * by_eta.transpose(),
        std: body.diagonal().map(f64::sqrt),
        active_axis: fit.constrained.then(|| eta.thinnest_axis()),
        nuisances: nuisances.map(nuisance).collect(),
        exchanges: identifiability.exchanges.clone(),
        noise: levels.noise(&chain.groups),
        visible_wrench_noise: fit.visible_wrench_noise,
        cost: cost(sweep, levels),
        log_determinant: schur.log_determinant + factor.l_dirty().diagonal().iter().map(|x| 2.0 * x.ln()).sum::<f64>(),
        iterations: fit.iterations.clone(),
        segment_samples: fit.segment_samples,
        residuals: residuals(chain),
        outliers: sweep.tally.rejected[POSITION].max(sweep.tally.rejected[ATTITUDE]),
        whiteness: chain.whiteness(levels),
        body_change: None,
        scatter: 1.0,
    })
}

/// At the optimum: one more elimination.
fn body_change<const W: usize>(fit: &mut Fit<W>) -> Result<Option<BodyChange>, IdentificationError> {
    let Fit { chain, eta, levels, .. } = fit;
    let every = chain.starts.len().div_ceil(CUTS).max(1);
    let (whole, parts) = chain.eliminate_parts(every, levels).map_err(not_excited)?;
    let quadratic = |schur: &Schur| Quadratic {
        information: schur.information.fixed_view::<10, 10>(0, 0).into_owned(),
        gradient: schur.gradient.fixed_rows::<10>(0).into_owned(),
    };
    let parts = parts.iter().map(|(segment, schur)| (*segment, quadratic(schur)));
    let Some(cut) = likeliest_cut(&quadratic(&whole), parts, 1.0) else { return Ok(None) };
    let (parameters, by_eta) = (eta.parameters().to_vector(), eta.parameters_by_eta());
    let at = |segment: usize| chain.starts.get(segment).copied().unwrap_or(chain.record.samples.len());
    Ok(Some(BodyChange {
        last_before: at(cut.place - every),
        first_after: at(cut.place),
        first_sure: at(cut.place + every),
        before: parameters + by_eta * cut.before,
        after: parameters + by_eta * cut.after,
        deviation: (by_eta * cut.covariance * by_eta.transpose()).diagonal().map(f64::sqrt),
    }))
}

/// By what factor the pulls of parts of the record at the parameters exceed what their information allows: one more
/// elimination, and the largest factor over parts of several lengths, of which the longest hold noise that wanders slowly.
///
/// # Source
/// Batch means of the score: the trace of the sandwich covariance of White (1982) over that of the information.
fn scatter<const W: usize>(fit: &mut Fit<W>) -> Result<f64, IdentificationError> {
    let every = fit.chain.starts.len().div_ceil(SCATTER_PARTS).max(1);
    let (whole, parts) = fit.chain.eliminate_parts(every, &fit.levels).map_err(not_excited)?;
    let Some(factor) = whole.information.clone().cholesky() else { return Ok(1.0) };
    let (lower, n) = (factor.l(), whole.gradient.len());
    // In steps in which the information of the whole is the identity; from the last part to the whole.
    let whitened = |schur: &Schur| {
        let half = lower.solve_lower_triangular(&schur.information)?;
        Some((lower.solve_lower_triangular(&half.transpose())?, lower.solve_lower_triangular(&schur.gradient)?))
    };
    let Some(sums) = parts.iter().map(|(_, part)| part).chain([&whole]).map(whitened).collect::<Option<Vec<_>>>()
    else {
        return Ok(1.0);
    };
    let Some((_, all)) = sums.last() else { return Ok(1.0) };
    let mut largest: f64 = 1.0;
    for length in [1, 2, 4] {
        let mut before = (DMatrix::zeros(n, n), DVector::zeros(n));
        let (mut squares, mut mean, mut half_variance) = (0.0, 0.0, 0.0);
        // The whole closes the earliest part, whatever its length.
        for sum in sums.iter().rev().step_by(length).collect::<Vec<_>>().into_iter().rev() {
            let (share, pull) = (&sum.0 - &before.0, &sum.1 - &before.1);
            let expected = &share - &share * &share;
            squares += (pull - &share * all).norm_squared();
            mean += expected.trace();
            half_variance += expected.norm_squared();
            before = sum.clone();
        }
        let (ratio, freedom) = (squares / mean, mean * mean / half_variance);
        let by_chance = chi_square_exceedance(freedom, ratio * freedom);
        if ratio.sqrt() > VISIBLE_SCATTER.0 && by_chance < VISIBLE_SCATTER.1 {
            largest = largest.max(ratio.sqrt());
        }
    }
    Ok(largest)
}

/// Where the iterations ended.
struct Fit<const W: usize> {
    chain: Chain<W>,
    eta: Coordinates,
    calibration: Calibration,
    levels: Levels,
    sweep: Sweep,
    schur: Schur,
    identifiability: Identifiability,
    iterations: Vec<Iteration>,
    constrained: bool,
    segment_samples: usize,
    visible_wrench_noise: [f64; 2],
}

/// The quadratic in the parameters, priors included, and what it determines without them.
fn eliminated<const W: usize>(
    chain: &mut Chain<W>,
    calibration: &Calibration,
    levels: &Levels,
) -> Result<(Schur, Identifiability), IdentificationError> {
    let mut schur = chain.eliminate(levels).map_err(not_excited)?;
    let identifiability = Identifiability::new(&schur.information, calibration);
    identifiability.hold(calibration, &mut schur.information, &mut schur.gradient);
    Ok((schur, identifiability))
}

/// How far the iterations have come.
#[derive(Default)]
struct Progress {
    iterations: Vec<Iteration>,
    refinements: usize,
    /// Measurement levels have been taken from residuals.
    judged: bool,
}

impl Progress {
    fn near(&self) -> bool {
        self.iterations.last().is_some_and(|last| last.decrement < NEAR)
    }

    fn robust(&self, known_noise: bool) -> Robust {
        let gated = (known_noise || self.judged) && (self.near() || self.iterations.len() >= GATED);
        let gate = if gated { GATE } else { f64::INFINITY };
        Robust { huber: HUBER, gate }
    }

    fn refines(&self) -> bool {
        self.judged && self.near() && self.refinements < REFINEMENTS
    }

    /// The decrement grew twice in a row.
    fn diverges(&self) -> bool {
        matches!(self.iterations.as_slice(), [.., a, b, c] if c.decrement > b.decrement && b.decrement > a.decrement)
    }
}

/// A quarter of the time over which the wrench noise moves the body as far as the poses scatter.
///
/// # Source
/// The time constant of the smoother, the smaller of that of position and that of attitude.
fn segment_length(levels: &Levels, eta: &Coordinates, step_s: f64) -> usize {
    let body = eta.body();
    let ([torque, force], [position, attitude, ..]) = (levels.wrench, levels.measurements);
    let linear = (position * body.mass / force).sqrt();
    let angular = (attitude * body.inertia.trace() / 3.0 / torque).sqrt();
    whole(0.25 * linear.min(angular) / step_s).clamp(1, LONGEST_SEGMENT)
}

/// How a body fits a record.
pub(crate) struct Judged {
    /// Distance to the record's own estimate, in standard deviations of the difference, root mean square over the
    /// directions that the record shows.
    pub(crate) misfit: f64,
    pub(crate) residuals: Vec<SegmentResidual>,
}

/// The record would move the parameters by d = S^-1 g with covariance S^-1; with the stated covariance C of the parameters
/// d^T (S^-1 + C)^-1 d is a chi-square.
fn misfit(schur: &Schur, eta: &Coordinates, covariance: &SMatrix<f64, 10, 10>) -> Option<f64> {
    let by_eta = eta.parameters_by_eta().try_inverse()?;
    let covariance = by_eta * covariance * by_eta.transpose();
    let scale = covariance.diagonal().map(f64::sqrt);
    let unit = SMatrix::<f64, 10, 10>::from_fn(|i, j| covariance[(i, j)] / (scale[i] * scale[j]));
    let lower = SMatrix::<f64, 10, 10>::from_diagonal(&scale) * unit.cholesky()?.l();
    let information = schur.information.fixed_view::<10, 10>(0, 0).into_owned();
    let eigen = (lower.transpose() * information * lower).symmetric_eigen();
    let gradient = eigen.eigenvectors.transpose() * lower.transpose() * schur.gradient.fixed_rows::<10>(0);
    let (mut sum, mut shown) = (0.0, 0.0);
    for (value, pull) in eigen.eigenvalues.iter().zip(gradient.iter()) {
        if *value > SHOWN * eigen.eigenvalues.max() {
            sum += pull * pull / (value + value * value);
            shown += 1.0;
        }
    }
    Some((sum / shown).sqrt())
}

/// Errors of the wrench, segment by segment.
fn residuals<const W: usize>(chain: &Chain<W>) -> Vec<SegmentResidual> {
    let segments = chain.starts.iter().zip(&chain.noise);
    segments
        .map(|(&first_sample, noise)| SegmentResidual { first_sample, wrench: Wrench::from(SVector::from(*noise)) })
        .collect()
}

/// Weighted squares of all residuals, those of the wrench noise included.
fn cost(sweep: &Sweep, levels: &Levels) -> f64 {
    let measured: f64 = (0..MEASUREMENTS).map(|g| sweep.tally.squares[g] / levels.measurements[g].powi(2)).sum();
    measured + sweep.noise_squares.iter().sum::<f64>()
}

fn not_excited(_: Indefinite) -> IdentificationError {
    IdentificationError::Indefinite { parameters: 10 }
}

#[cfg(test)]
mod golden;
#[cfg(test)]
mod tangents;
