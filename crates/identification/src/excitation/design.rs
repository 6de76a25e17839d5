//! From a problem to a motion.

use super::channel::{Channel, Limit};
use super::criterion::ExcitationCriterion;
use super::interior_point::{Effort, Minimum, minimize};
use super::limit_samples::Limits;
use super::objective::{Channels, Objective};
use super::problem::{ExcitationProblem, LimitsHold};
use crate::dynamics::{Actuation, InertialParameters};
use crate::error::IdentificationError;
use crate::fourier::{AttitudeChart, ChannelExtremes, FourierMotion};
use crate::lie::Wrench;
use nalgebra::{DMatrix, SMatrix, Vector6};
use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::{Rng, SeedableRng};

/// Random motions looked at for each descent; it starts at the best.
const CANDIDATES: usize = 8;
/// Samples of the limits per harmonic.
const LIMIT_SAMPLES: usize = 32;
/// Random descents of each start; the best goes on to the end.
const DESCENTS: usize = 4;
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
    /// A start is several descents from the best of some random motions, of which the best is followed to the end. Limits
    /// that hold everywhere are kept at a grid while going down; what is exceeded between its points is made up for in the
    /// end by making the channel smaller, or all of them where it is a wrench. The same seed gives the same motion.
    ///
    /// # Errors
    /// [`IdentificationError::NoDesign`] where the criterion could judge no motion at all, such as from no starts.
    pub fn design(
        &self,
        criterion: &impl ExcitationCriterion<P>,
        starts: usize,
        seed: u64,
    ) -> Result<ExcitationDesign<P>, IdentificationError> {
        let samples = match self.limits_hold {
            LimitsHold::AtSamples => self.samples,
            LimitsHold::Everywhere => LIMIT_SAMPLES * self.basis.harmonics(),
        };
        let mut limits = Limits::new(self, samples);
        let mut objective = Objective::new(self, criterion);
        let mut generator = ChaCha8Rng::seed_from_u64(seed);
        let mut best: Option<(f64, FourierMotion)> = None;
        let mut cost_per_start = Vec::with_capacity(starts);
        for _ in 0..starts {
            let free = from_one_start(&mut limits, &mut objective, &mut generator);
            let motion = free.and_then(|free| self.inside(self.motion(&free)?));
            let found = motion.and_then(|motion| Some((objective.cost(&self.free_numbers(&motion))?, motion)));
            cost_per_start.push(found.as_ref().map(|(cost, _)| *cost));
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
    /// between them it may come out larger by a share of (3 pi / 256)^2 / 2: the motion is made smaller by twice that.
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

    fn motion(&self, free: &[Channels]) -> Option<FourierMotion> {
        let free = DMatrix::from_fn(free.len(), 6, |row, column| free[row][column]);
        FourierMotion::try_new(self.basis, AttitudeChart::EulerZyx, self.basis.rest_to_rest() * free).ok()
    }

    /// The columns of the basis from rest to rest are orthonormal.
    fn free_numbers(&self, motion: &FourierMotion) -> Vec<Channels> {
        let free = self.basis.rest_to_rest().tr_mul(motion.coefficients());
        (0..free.nrows()).map(|row| core::array::from_fn(|channel| free[(row, channel)])).collect()
    }

    /// The motion made smaller until no limit is exceeded at any time that it must hold at.
    fn inside(&self, motion: FourierMotion) -> Option<FourierMotion> {
        if self.limits_hold == LimitsHold::AtSamples {
            return Some(motion);
        }
        let mut factors = [1.0; 6];
        for used in self.utilization(&motion) {
            let factor = &mut factors[used.channel as usize];
            // What rounding adds again.
            *factor = f64::min(*factor, (1.0 - 1e-12) / used.share);
        }
        let mut motion = scaled(&motion, &factors).ok()?;
        // Wrenches grow at least about as fast as the motion; where they do not, the next time it is made smaller by more.
        for attempt in 0..40 {
            let largest = self.wrench_utilization(&motion)?.into_iter().fold(0.0, f64::max);
            if largest <= 1.0 {
                return Some(motion);
            }
            motion = scaled(&motion, &[(1.0 - 1e-4 * f64::from(attempt)) / largest; 6]).ok()?;
        }
        None
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

/// Several descents along the middle of the feasible motions, and the rest of the way for the best of them.
fn from_one_start<const P: usize>(
    limits: &mut Limits<'_>,
    objective: &mut Objective<'_, impl ExcitationCriterion<P>, P>,
    generator: &mut ChaCha8Rng,
) -> Option<Vec<Channels>> {
    let mut best: Option<Minimum> = None;
    for _ in 0..DESCENTS {
        let Some(start) = best_candidate(limits, objective, generator) else { continue };
        let found = minimize(limits, |free, gradient| objective.gradient(free, gradient), &start, Effort::ROUGH);
        if let Some(found) = found.filter(|found| best.as_ref().is_none_or(|best| found.cost < best.cost)) {
            best = Some(found);
        }
    }
    let start = best?.scaled;
    let found = minimize(limits, |free, gradient| objective.gradient(free, gradient), &start, Effort::FINE)?;
    let mut free = vec![[0.0; 6]; limits.free()];
    limits.free_numbers(&found.scaled, &mut free);
    Some(free)
}

/// The best of some random motions well inside the limits, as scaled numbers.
fn best_candidate<const P: usize>(
    limits: &mut Limits<'_>,
    objective: &mut Objective<'_, impl ExcitationCriterion<P>, P>,
    generator: &mut ChaCha8Rng,
) -> Option<Vec<f64>> {
    let mut best: Option<(f64, Vec<f64>)> = None;
    let mut slacks = Vec::new();
    let mut free = vec![[0.0; 6]; limits.free()];
    for _ in 0..CANDIDATES {
        let mut scaled: Vec<f64> = (0..limits.numbers()).map(|_| uniform(generator)).collect();
        limits.shrink(&mut scaled, 0.8);
        if !limits.slacks(&scaled, &mut slacks) {
            continue;
        }
        limits.free_numbers(&scaled, &mut free);
        let Some(cost) = objective.cost(&free) else { continue };
        if best.as_ref().is_none_or(|(least, _)| cost < *least) {
            best = Some((cost, scaled));
        }
    }
    Some(best?.1)
}

/// Uniform in [-1, 1).
fn uniform(generator: &mut ChaCha8Rng) -> f64 {
    const UNIT: f64 = 1.0 / (1_u64 << 53) as f64;
    2.0 * (generator.next_u64() >> 11) as f64 * UNIT - 1.0
}
