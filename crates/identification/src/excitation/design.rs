//! From a problem to a motion.

use super::channel::{Channel, Limit};
use super::criterion::ExcitationCriterion;
use super::interior_point::{Effort, Minimum, minimize};
use super::limit_samples::Limits;
use super::objective::{Channels, Objective};
use super::problem::{ExcitationProblem, LimitsHold};
use crate::dynamics::{Actuation, InertialParameters};
use crate::error::IdentificationError;
use crate::fourier::{AttitudeChart, ChannelExtremes, FourierBasis, FourierMotion};
use crate::lie::Wrench;
use crate::noise::signed_unit;
use nalgebra::{DMatrix, SMatrix, Vector6};
use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::SeedableRng;

/// Random motions looked at for each descent; it starts at the best.
const CANDIDATES: usize = 8;
/// Samples of the limits per harmonic.
const LIMIT_SAMPLES: usize = 32;
/// The same while it is not the end that counts.
const ROUGH_LIMIT_SAMPLES: usize = 16;
/// Harmonics to begin with: minima of many harmonics from random motions are poorer than those of few.
const RUNGS: [usize; 3] = [3, 5, 8];
/// Random descents of each start with the fewest harmonics; the best goes on.
const DESCENTS: usize = 4;
/// Random descents with more harmonics, beside that which goes on.
const FURTHER_DESCENTS: usize = 1;
/// Share of the wrench limits that is used at the samples at first, to leave some for the time between them.
const WRENCH_SHARE: f64 = 0.998;
/// Times that a motion is looked for with less and less of the wrench limits.
const ATTEMPTS: usize = 8;
/// Instants per harmonic at which an actuator is asked.
const ACTUATION_SAMPLES: usize = 256;

/// How much of a limit a motion uses.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Utilization {
    /// Channel.
    pub channel: Channel,
    /// Which of its limits.
    pub limit: Limit,
    /// Largest value over the limit: one is at the limit.
    pub share: f64,
}

/// A motion designed to show `P` parameters.
#[derive(Clone, Debug, PartialEq)]
pub struct ExcitationDesign<const P: usize> {
    /// The motion; channels that do not move have zero coefficients.
    pub motion: FourierMotion,
    /// Its cost.
    pub cost: f64,
    /// Cost reached from each start, `None` where the criterion could not judge any motion; the motion is of the lowest.
    pub cost_per_start: Vec<Option<f64>>,
    /// Information of one period, in SI units: the inverse is the Cramer-Rao bound of a single period.
    pub information: SMatrix<f64, P, P>,
    /// Of every finite limit of every channel that moves.
    pub utilization: Vec<Utilization>,
    /// Largest wrench over the bound, for each half-space of the wrench limits.
    pub wrench_utilization: Vec<f64>,
}

impl<const P: usize> ExcitationProblem<P> {
    /// The best motion found from this many random starts.
    ///
    /// A start is several descents from the best of some random motions of at most three harmonics, of which the best is
    /// followed with five, eight and all harmonics, and at last to the end. Limits that hold everywhere are kept at a grid
    /// while going down; what a channel exceeds between its points is made up for in the end by making it smaller, and where
    /// it is a wrench by looking again with less allowed. The same seed gives the same motion.
    ///
    /// # Errors
    /// [`IdentificationError::NoDesign`] where the criterion could judge no motion at all, such as from no starts.
    pub fn design(
        &self,
        criterion: &impl ExcitationCriterion<P>,
        starts: usize,
        seed: u64,
    ) -> Result<ExcitationDesign<P>, IdentificationError> {
        self.design_reporting(criterion, starts, seed, |_| {})
    }

    /// The same, telling `report` after each start the cost reached from each so far: many harmonics take long.
    ///
    /// # Errors
    /// As [`design`](Self::design).
    pub fn design_reporting(
        &self,
        criterion: &impl ExcitationCriterion<P>,
        starts: usize,
        seed: u64,
        mut report: impl FnMut(&[Option<f64>]),
    ) -> Result<ExcitationDesign<P>, IdentificationError> {
        let problems = self.rungs();
        let mut rungs: Vec<_> =
            problems.iter().map(|problem| Rung::new(problem, criterion, ROUGH_LIMIT_SAMPLES)).collect();
        let mut last = Rung::new(self, criterion, LIMIT_SAMPLES);
        let mut objective = Objective::new(self, criterion);
        let generator = ChaCha8Rng::seed_from_u64(seed);
        let mut best: Option<(f64, FourierMotion)> = None;
        let mut cost_per_start = Vec::new();
        for start in 0..starts {
            // Each start has its own numbers, however many of them another number of harmonics takes.
            let mut generator = generator.clone();
            generator.set_stream(start as u64);
            let motion = from_one_start(&mut rungs, &mut last, &mut generator);
            let found = motion.and_then(|motion| Some((objective.cost(&self.free_numbers(&motion))?, motion)));
            cost_per_start.push(found.as_ref().map(|(cost, _)| *cost));
            report(&cost_per_start);
            if let Some(found) = found.filter(|found| best.as_ref().is_none_or(|best| found.0 < best.0)) {
                best = Some(found);
            }
        }
        let motion = best.map(|(_, motion)| motion);
        let judged = motion.and_then(|motion| self.judged(motion, &mut objective, cost_per_start));
        judged.ok_or(IdentificationError::NoDesign { starts })
    }

    /// A design made smaller, all channels alike, until an actuator gives the wrenches that the body needs.
    ///
    /// The actuator is asked at 256 instants per harmonic. A wrench has about three times the motion's harmonics, so that
    /// between them it may come out larger by a share of (3 pi / 256)^2 / 2: the motion is made smaller by twice that. This
    /// is an argument from the bandwidth and no bound, since turns by large angles have harmonics without end; the check
    /// is to ask the actuator again on a finer grid. Bounds hold for [`WrenchLimits`](super::WrenchLimits), which are in
    /// [`ExcitationDesign::wrench_utilization`].
    ///
    /// # Errors
    /// [`IdentificationError::NotRealizable`]; [`IdentificationError::NoDesign`] where the criterion cannot judge the
    /// smaller motion; those of the actuator.
    pub fn shrunk_into(
        &self,
        design: ExcitationDesign<P>,
        criterion: &impl ExcitationCriterion<P>,
        actuation: &impl Actuation,
        body: &InertialParameters<f64>,
    ) -> Result<ExcitationDesign<P>, IdentificationError> {
        const SMALLEST: f64 = 1e-6;
        let parameters = body.to_vector();
        let count = ACTUATION_SAMPLES * self.basis.harmonics();
        let times: Vec<f64> = (0..count).map(|i| self.basis.period_s() * i as f64 / count as f64).collect();
        let is_realized = |scale: f64| -> Result<bool, IdentificationError> {
            let motion = scaled(&design.motion, &[scale; 6])?;
            for &time_s in &times {
                let Some(instant) = motion.at(time_s) else { return Ok(false) };
                let wanted = instant.regressor() * parameters;
                let realized = actuation.realize(&actuation.allocate(&Wrench::from(wanted))?).to_vector();
                let is_given = (realized - wanted).norm() <= 1e-9 * wanted.norm();
                if !is_given {
                    return Ok(false);
                }
            }
            Ok(true)
        };
        if is_realized(1.0)? {
            return Ok(design);
        }
        let (mut inside, mut outside) = (SMALLEST, 1.0);
        if !is_realized(inside)? {
            return Err(IdentificationError::NotRealizable { smallest_scale: SMALLEST });
        }
        while outside - inside > 1e-4 * inside {
            let middle: f64 = 0.5 * (inside + outside);
            *(if is_realized(middle)? { &mut inside } else { &mut outside }) = middle;
        }
        let turn = 3.0 * core::f64::consts::PI / ACTUATION_SAMPLES as f64;
        let motion = scaled(&design.motion, &[inside * (1.0 - turn * turn); 6])?;
        let starts = design.cost_per_start.len();
        let judged = self.judged(motion, &mut Objective::new(self, criterion), design.cost_per_start);
        judged.ok_or(IdentificationError::NoDesign { starts })
    }

    /// The same of few harmonics first, up to its own.
    fn rungs(&self) -> Vec<Self> {
        let own = self.basis.harmonics();
        let harmonics = RUNGS.into_iter().filter(|few| *few < own).chain([own]);
        let bases = harmonics.filter_map(|harmonics| FourierBasis::try_new(self.basis.period_s(), harmonics).ok());
        bases.map(|basis| Self { basis, ..self.clone() }).collect()
    }

    pub(super) fn motion(&self, free: &[Channels]) -> Option<FourierMotion> {
        let free = DMatrix::from_fn(free.len(), 6, |row, column| free[row][column]);
        FourierMotion::try_new(self.basis, AttitudeChart::EulerZyx, self.basis.rest_to_rest() * free).ok()
    }

    /// The columns of the basis from rest to rest are orthonormal.
    pub(super) fn free_numbers(&self, motion: &FourierMotion) -> Vec<Channels> {
        let free = self.basis.rest_to_rest().tr_mul(motion.coefficients());
        (0..free.nrows()).map(|row| core::array::from_fn(|channel| free[(row, channel)])).collect()
    }

    /// The channels made smaller until none of their limits is exceeded at any time that it must hold at.
    fn with_channels_inside(&self, motion: FourierMotion) -> Option<FourierMotion> {
        if self.limits_hold == LimitsHold::AtSamples {
            return Some(motion);
        }
        let mut factors = [1.0; 6];
        for used in self.utilization(&motion) {
            let factor = &mut factors[used.channel as usize];
            // What rounding adds again.
            *factor = f64::min(*factor, (1.0 - 1e-12) / used.share);
        }
        scaled(&motion, &factors).ok()
    }

    /// Largest share of a wrench limit at any time that it must hold at; zero without one.
    fn largest_wrench_share(&self, motion: &FourierMotion) -> Option<f64> {
        if self.limits_hold == LimitsHold::AtSamples {
            return Some(0.0);
        }
        Some(self.wrench_utilization(motion)?.into_iter().fold(0.0, f64::max))
    }

    fn utilization(&self, motion: &FourierMotion) -> Vec<Utilization> {
        let extremes = motion.extremes();
        let of_channel = |(channel, limits): &(Channel, super::limits::ChannelLimits)| {
            let ChannelExtremes { least, largest, largest_rate, largest_acceleration } = extremes[*channel as usize];
            let shares = [
                (Limit::Lower, least / limits.lower, limits.lower),
                (Limit::Upper, largest / limits.upper, limits.upper),
                (Limit::Rate, largest_rate / limits.rate, limits.rate),
                (Limit::Acceleration, largest_acceleration / limits.acceleration, limits.acceleration),
            ];
            let channel = *channel;
            shares.into_iter().filter(|(.., limit)| limit.is_finite()).map(move |(limit, share, _)| Utilization {
                channel,
                limit,
                share,
            })
        };
        self.channels.iter().flat_map(of_channel).collect()
    }

    fn wrench_utilization(&self, motion: &FourierMotion) -> Option<Vec<f64>> {
        let Some(limits) = &self.wrench_limits else { return Some(Vec::new()) };
        let body = InertialParameters::from_vector(limits.parameters());
        let share = |(normal, bound): &(Vector6<f64>, f64)| Some(motion.largest_wrench_along(normal, &body)? / bound);
        limits.half_spaces().iter().map(share).collect()
    }

    fn judged(
        &self,
        motion: FourierMotion,
        objective: &mut Objective<'_, impl ExcitationCriterion<P>, P>,
        cost_per_start: Vec<Option<f64>>,
    ) -> Option<ExcitationDesign<P>> {
        let free = self.free_numbers(&motion);
        let (cost, (information, _)) = (objective.cost(&free)?, objective.information(&free)?);
        let (utilization, wrench_utilization) = (self.utilization(&motion), self.wrench_utilization(&motion)?);
        Some(ExcitationDesign { motion, cost, cost_per_start, information, utilization, wrench_utilization })
    }
}

/// Each channel at its own scale.
fn scaled(motion: &FourierMotion, factors: &[f64; 6]) -> Result<FourierMotion, IdentificationError> {
    let mut coefficients = motion.coefficients().clone();
    for (mut column, factor) in coefficients.column_iter_mut().zip(factors) {
        column *= *factor;
    }
    FourierMotion::try_new(*motion.basis(), motion.chart(), coefficients)
}

/// A problem of some of the harmonics, ready to go down.
struct Rung<'a, C, const P: usize> {
    problem: &'a ExcitationProblem<P>,
    limits: Limits<'a>,
    objective: Objective<'a, C, P>,
}

impl<'a, C: ExcitationCriterion<P>, const P: usize> Rung<'a, C, P> {
    fn new(problem: &'a ExcitationProblem<P>, criterion: &'a C, limit_samples: usize) -> Self {
        let samples = match problem.limits_hold {
            LimitsHold::AtSamples => problem.samples,
            LimitsHold::Everywhere => limit_samples * problem.basis.harmonics(),
        };
        Self { problem, limits: Limits::new(problem, samples), objective: Objective::new(problem, criterion) }
    }

    fn minimize(&mut self, start: &[f64], effort: Effort) -> Option<Minimum> {
        let objective = &mut self.objective;
        minimize(&mut self.limits, |free, gradient| objective.gradient(free, gradient), start, effort)
    }

    fn motion(&self, scaled: &[f64]) -> Option<FourierMotion> {
        let mut free = vec![[0.0; 6]; self.limits.free()];
        self.limits.free_numbers(scaled, &mut free);
        self.problem.motion(&free)
    }

    /// Inside the limits, a motion of the same or fewer harmonics.
    fn start(&mut self, motion: &FourierMotion) -> Option<Vec<f64>> {
        let (few, many) = (motion.basis().harmonics(), self.problem.basis.harmonics());
        let mut coefficients = DMatrix::zeros(self.problem.basis.coefficients(), 6);
        coefficients.rows_mut(0, few + 1).copy_from(&motion.coefficients().rows(0, few + 1));
        coefficients.rows_mut(many + 1, few).copy_from(&motion.coefficients().rows(few + 1, few));
        let motion = FourierMotion::try_new(self.problem.basis, motion.chart(), coefficients).ok()?;
        let mut scaled = self.limits.scaled_numbers(&self.problem.free_numbers(&motion))?;
        self.limits.retreat(&mut scaled, 0.98);
        Some(scaled)
    }

    /// Descents along the middle of the feasible motions, from a motion of fewer harmonics and from the best of some random
    /// ones, so many times: the best end.
    fn roughly(
        &mut self,
        fewer: Option<&FourierMotion>,
        descents: usize,
        generator: &mut ChaCha8Rng,
    ) -> Option<FourierMotion> {
        let mut best =
            fewer.and_then(|motion| self.start(motion)).and_then(|start| self.minimize(&start, Effort::ROUGH));
        for _ in 0..descents {
            let Some(start) = self.best_candidate(generator) else { continue };
            let found = self.minimize(&start, Effort::ROUGH);
            if let Some(found) = found.filter(|found| best.as_ref().is_none_or(|best| found.cost < best.cost)) {
                best = Some(found);
            }
        }
        self.motion(&best?.scaled)
    }

    /// From there to the minimum, whose limits hold between the samples too.
    ///
    /// A smaller motion may need a larger wrench, where parts of it had cancelled: a motion that needs too much between the
    /// samples is not made smaller but found again with as much less allowed at them.
    fn finely(&mut self, motion: &FourierMotion) -> Option<FourierMotion> {
        let mut share = if self.problem.limits_hold == LimitsHold::AtSamples { 1.0 } else { WRENCH_SHARE };
        for _ in 0..ATTEMPTS {
            self.limits.keep_wrench_within(share);
            let start = self.start(motion)?;
            let found = self.minimize(&start, Effort::FINE)?;
            let found = self.problem.with_channels_inside(self.motion(&found.scaled)?)?;
            let largest = self.problem.largest_wrench_share(&found)?;
            if largest <= 1.0 {
                return Some(found);
            }
            share -= 1.5 * (largest - 1.0);
        }
        None
    }

    /// The best of some random motions well inside the limits, as scaled numbers.
    fn best_candidate(&mut self, generator: &mut ChaCha8Rng) -> Option<Vec<f64>> {
        let mut best: Option<(f64, Vec<f64>)> = None;
        let mut slacks = Vec::new();
        let mut free = vec![[0.0; 6]; self.limits.free()];
        for _ in 0..CANDIDATES {
            let mut scaled: Vec<f64> = (0..self.limits.numbers()).map(|_| signed_unit(generator)).collect();
            self.limits.shrink(&mut scaled, 0.8);
            if !self.limits.slacks(&scaled, &mut slacks) {
                continue;
            }
            self.limits.free_numbers(&scaled, &mut free);
            let Some(cost) = self.objective.cost(&free) else { continue };
            if best.as_ref().is_none_or(|(least, _)| cost < *least) {
                best = Some((cost, scaled));
            }
        }
        Some(best?.1)
    }
}

/// From random motions of few harmonics to the best of all.
fn from_one_start<C: ExcitationCriterion<P>, const P: usize>(
    rungs: &mut [Rung<'_, C, P>],
    last: &mut Rung<'_, C, P>,
    generator: &mut ChaCha8Rng,
) -> Option<FourierMotion> {
    let mut motion = None;
    for rung in rungs {
        let descents = if motion.is_none() { DESCENTS } else { FURTHER_DESCENTS };
        motion = rung.roughly(motion.as_ref(), descents, generator);
    }
    last.finely(&motion?)
}
