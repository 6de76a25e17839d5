//! When a logged wrench acts, and what right-hand side that gives a regressor.

use crate::lie::Wrench;

/// When the wrench of a row acts.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Default)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub enum WrenchTiming {
    /// Constant in body axes from this row's time to the next row's: what a flight computer applies.
    #[default]
    Held,
    /// A continuous wrench sampled at this row's time.
    Sampled,
}
