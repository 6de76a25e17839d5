//! The design of a motion as a problem of argmin, for optimisers of one's own (feature `argmin`).

use super::criterion::ExcitationCriterion;
use super::objective::{Channels, Objective, RestTable, channels};
use super::problem::ExcitationProblem;
use crate::error::IdentificationError;
use crate::fourier::FourierMotion;
use argmin::core::{CostFunction, Error, Gradient};
use std::sync::{Mutex, MutexGuard, PoisonError};

/// The cost of a motion, with a penalty where it exceeds the limits of its channels at the samples.
///
/// argmin knows no constraints: raise the weight from run to run, each from where the last one ended. Limits of the wrench are
/// not in the penalty.
///
/// # Shape
/// As many unknowns as [`unknowns`](Self::unknowns) says: the free numbers of the first channel that moves, then those of the
/// next. A motion that the criterion cannot judge costs infinity.
pub struct ExcitationCost<'a, C, const P: usize> {
    problem: &'a ExcitationProblem<P>,
    /// Its memory is written at every call.
    objective: Mutex<Objective<'a, C, P>>,
    table: RestTable,
    weight: f64,
}

impl<const P: usize> ExcitationProblem<P> {
    /// The cost that [`design`](Self::design) minimises, plus half of `weight` times the sum of squares of the shares by which
    /// limits are exceeded.
    pub fn cost_function<'a, C: ExcitationCriterion<P>>(
        &'a self,
        criterion: &'a C,
        weight: f64,
    ) -> ExcitationCost<'a, C, P> {
        let objective = Mutex::new(Objective::new(self, criterion));
        ExcitationCost { problem: self, objective, table: RestTable::new(&self.basis, self.samples), weight }
    }
}

impl<'a, C: ExcitationCriterion<P>, const P: usize> ExcitationCost<'a, C, P> {
    /// Number of unknowns.
    pub fn unknowns(&self) -> usize {
        self.free() * self.problem.channels.len()
    }

    /// The unknowns of a motion.
    pub fn unknowns_of(&self, motion: &FourierMotion) -> Vec<f64> {
        self.flat(&self.problem.free_numbers(motion))
    }

    /// The motion of these unknowns; `None` where they are none or of another number.
    pub fn motion(&self, unknowns: &[f64]) -> Option<FourierMotion> {
        self.problem.motion(&self.numbers(unknowns)?)
    }

    fn free(&self) -> usize {
        self.problem.basis.coefficients() - 3
    }

    fn numbers(&self, unknowns: &[f64]) -> Option<Vec<Channels>> {
        let free = self.free();
        let mut numbers = vec![[0.0; 6]; free];
        for ((channel, _), own) in self.problem.channels.iter().zip(unknowns.chunks_exact(free)) {
            for (numbers, number) in numbers.iter_mut().zip(own) {
                numbers[*channel as usize] = *number;
            }
        }
        (unknowns.len() == self.unknowns()).then_some(numbers)
    }

    fn flat(&self, numbers: &[Channels]) -> Vec<f64> {
        let moving = self.problem.channels.iter();
        moving.flat_map(|(channel, _)| numbers.iter().map(|numbers| numbers[*channel as usize])).collect()
    }

    fn objective(&self) -> MutexGuard<'_, Objective<'a, C, P>> {
        self.objective.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// The penalty, and its derivatives by the free numbers added to `gradient`.
    fn penalty(&self, free: &[Channels], mut gradient: Option<&mut [Channels]>) -> f64 {
        let mut penalty = 0.0;
        for functions in self.table.samples() {
            let at = channels(functions, free);
            for (channel, limits) in &self.problem.channels {
                let channel = *channel as usize;
                for (order, [lower, upper]) in limits.intervals().into_iter().enumerate() {
                    let (value, size) = (at[order][channel], 0.5 * (upper - lower));
                    let excess = (value - value.clamp(lower, upper)) / size;
                    penalty += 0.5 * self.weight * excess * excess;
                    for (gradient, function) in
                        gradient.iter_mut().flat_map(|gradient| gradient.iter_mut()).zip(functions)
                    {
                        gradient[channel] += self.weight * excess / size * function[order];
                    }
                }
            }
        }
        penalty
    }
}

impl<C: ExcitationCriterion<P>, const P: usize> CostFunction for ExcitationCost<'_, C, P> {
    type Param = Vec<f64>;
    type Output = f64;

    fn cost(&self, unknowns: &Vec<f64>) -> Result<f64, Error> {
        let Some(free) = self.numbers(unknowns) else { return Ok(f64::INFINITY) };
        let cost = self.objective().cost(&free);
        Ok(cost.map_or(f64::INFINITY, |cost| cost + self.penalty(&free, None)))
    }
}

impl<C: ExcitationCriterion<P>, const P: usize> Gradient for ExcitationCost<'_, C, P> {
    type Param = Vec<f64>;
    type Gradient = Vec<f64>;

    fn gradient(&self, unknowns: &Vec<f64>) -> Result<Vec<f64>, Error> {
        let given = unknowns.len();
        let free =
            self.numbers(unknowns).ok_or(IdentificationError::UnknownCount { given, expected: self.unknowns() })?;
        let mut gradient = vec![[0.0; 6]; free.len()];
        let judged = self.objective().gradient(&free, &mut gradient);
        judged.ok_or(IdentificationError::NoDesign { starts: 1 })?;
        self.penalty(&free, Some(&mut gradient));
        Ok(self.flat(&gradient))
    }
}
