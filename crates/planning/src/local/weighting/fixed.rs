//! Weights that never change.

use super::{InformationWeighting, WeightingContext, base_weights};
use crate::error::PlanningError;

/// The same weights for every plan.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FixedWeighting<const P: usize> {
    weights: [f64; P],
}

impl<const P: usize> FixedWeighting<P> {
    /// These weights.
    ///
    /// # Errors
    /// Weights that are negative or not finite.
    pub fn try_new(weights: [f64; P]) -> Result<Self, PlanningError> {
        base_weights(&weights)?;
        Ok(Self { weights })
    }

    /// Only one quantity counts.
    ///
    /// The other weightings do the same when all their base weights but one are zero.
    ///
    /// # Errors
    /// A weight that is negative or not finite; [`PlanningError::OutOfRange`] where there is no such quantity.
    pub fn only(quantity: usize, weight: f64) -> Result<Self, PlanningError> {
        if quantity >= P {
            let (value, upper) = (quantity as f64, P as f64 - 1.0);
            return Err(PlanningError::OutOfRange { what: "the index of a quantity", value, lower: 0.0, upper });
        }
        Self::try_new(core::array::from_fn(|i| if i == quantity { weight } else { 0.0 }))
    }
}

impl<const P: usize> InformationWeighting<P> for FixedWeighting<P> {
    fn weights(&mut self, _context: &WeightingContext<P>) -> Result<[f64; P], PlanningError> {
        Ok(self.weights)
    }
}
