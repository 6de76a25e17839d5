//! From a problem to a motion.

use super::channel::{Channel, Limit};
use super::criterion::ExcitationCriterion;
use super::interior_point::{Effort, Limits, minimize};
use super::objective::{Channels, Objective};
use super::problem::{ExcitationProblem, LimitsHold};
use crate::dynamics::{Actuation, InertialParameters};
use crate::error::IdentificationError;
use crate::fourier::{AttitudeChart, FourierMotion};
use crate::lie::Wrench;
use nalgebra::{DMatrix, SMatrix, SVector, Vector6};
use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::{Rng, SeedableRng};

/// Random motions looked at for each start; the best is where the solver starts.
const CANDIDATES: usize = 32;
/// Samples of the limits per harmonic.
const LIMIT_SAMPLES: usize = 32;
/// Samples per harmonic on which the limits are checked in the end.
const CHECKED_SAMPLES: usize = 512;

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
    /// The same seed gives the same motion.
    ///
    /// # Errors
    /// [`IdentificationError::NoDesign`] where the criterion could judge no motion at all.
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
        let mut best: Option<(f64, Vec<Channels>)> = None;
        let mut cost_per_start = Vec::with_capacity(starts);
        for _ in 0..starts {
            let Some(start) = best_candidate(&mut limits, &mut objective, &mut generator) else {
                cost_per_start.push(None);
                continue;
            };
            let found = minimize(&mut limits, |z, gradient| objective.gradient(z, gradient), &start, Effort::FULL);
            let cost = found.and_then(|found| {
                let mut free = vec![[0.0; 6]; self.basis.coefficients() - 3];
                limits.free_numbers(&found.scaled, &mut free);
                let cost = found.cost;
                if best.as_ref().is_none_or(|(least, _)| cost < *least) {
                    best = Some((cost, free));
                }
                Some(cost)
            });
            cost_per_start.push(cost);
        }
        let (cost, free) = best.ok_or(IdentificationError::NoDesign { starts })?;
        let (information, _) = objective.information(&free).ok_or(IdentificationError::NoDesign { starts })?;
        let free = DMatrix::from_fn(free.len(), 6, |row, column| free[row][column]);
        let motion = FourierMotion::try_new(self.basis, AttitudeChart::EulerZyx, self.basis.rest_to_rest() * free)?;
        Ok(ExcitationDesign {
            motion,
            cost,
            cost_per_start,
            information,
            utilization: Vec::new(),
            wrench_utilization: Vec::new(),
        })
    }
}

/// The best of some random motions well inside the limits.
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
