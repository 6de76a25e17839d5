//! Weights that go down as the mission goes on.

use super::{InformationWeighting, WeightingContext, base_weights};
use crate::error::{PlanningError, not_negative};

/// Weights in steps: each step lasts until its share of the mission has passed; after the last one nothing weighs.
///
/// ```
/// use tumble_planning::local::{InformationWeighting, StepWeighting, WeightingContext};
/// use tumble_planning::nalgebra::SMatrix;
/// let mut weighting = StepWeighting::try_new([50.0, 20.0], vec![(0.25, 1.0), (0.5, 0.8)]).unwrap();
/// let known = SMatrix::<f64, 2, 2>::identity();
/// let mut at = |elapsed_s| weighting.weights(&WeightingContext::try_new(known, known, elapsed_s, 100.0).unwrap()).unwrap();
/// assert_eq!((at(24.9), at(25.0), at(50.0)), ([50.0, 20.0], [40.0, 16.0], [0.0, 0.0]));
/// ```
#[derive(Clone, Debug, PartialEq)]
pub struct StepWeighting<const P: usize> {
    base: [f64; P],
    steps: Vec<(f64, f64)>,
}

impl<const P: usize> StepWeighting<P> {
    /// Base weights, and for each step the share of the mission at which it ends and the factor until then.
    ///
    /// # Errors
    /// Weights or factors that are negative or not finite; [`PlanningError::OutOfRange`] for an end that is not beyond the
    /// one before.
    pub fn try_new(base: [f64; P], steps: Vec<(f64, f64)>) -> Result<Self, PlanningError> {
        base_weights(&base)?;
        let mut before = 0.0;
        for &(end, factor) in &steps {
            not_negative("the end of a step of weights", end)?;
            not_negative("the factor of a step of weights", factor)?;
            if end <= before {
                let (what, upper) = ("the end of a step of weights", f64::INFINITY);
                return Err(PlanningError::OutOfRange { what, value: end, lower: before, upper });
            }
            before = end;
        }
        Ok(Self { base, steps })
    }
}

impl<const P: usize> InformationWeighting<P> for StepWeighting<P> {
    fn weights(&mut self, context: &WeightingContext<P>) -> Result<[f64; P], PlanningError> {
        let share = context.elapsed_share();
        let factor = self.steps.iter().find(|(end, _)| share < *end).map_or(0.0, |(_, factor)| *factor);
        Ok(self.base.map(|weight| weight * factor))
    }
}

/// Weights that decay with the share of the mission that has passed, and end where little is left of them.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ExponentialWeighting<const P: usize> {
    base: [f64; P],
    rate: f64,
    least: f64,
}

impl<const P: usize> ExponentialWeighting<P> {
    /// Base weights times `exp(-rate * share)`, zero where that is below `least`.
    ///
    /// # Errors
    /// Numbers that are negative or not finite.
    pub fn try_new(base: [f64; P], rate: f64, least: f64) -> Result<Self, PlanningError> {
        base_weights(&base)?;
        not_negative("the rate of decay of weights", rate)?;
        not_negative("the least factor of weights", least)?;
        Ok(Self { base, rate, least })
    }
}

impl<const P: usize> InformationWeighting<P> for ExponentialWeighting<P> {
    fn weights(&mut self, context: &WeightingContext<P>) -> Result<[f64; P], PlanningError> {
        let factor = libm::exp(-self.rate * context.elapsed_share());
        let factor = if factor < self.least { 0.0 } else { factor };
        Ok(self.base.map(|weight| weight * factor))
    }
}
