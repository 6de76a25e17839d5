//! What a search needs to know of states.

use core::fmt::Debug;
use rand_core::Rng;

/// A set of states with a metric, usable as `dyn`.
///
/// # Laws
/// `laws::check_state_space`.
pub trait StateSpace {
    /// A state.
    type State: Clone + Debug;

    /// How far two states are apart: a metric.
    fn distance(&self, from: &Self::State, to: &Self::State) -> f64;

    /// The state this share (0 to 1) of the way from one state to the other, both ends exactly.
    fn interpolate(&self, from: &Self::State, to: &Self::State, fraction: f64) -> Self::State;

    /// Whether the state is one of the set.
    fn contains(&self, state: &Self::State) -> bool;

    /// Any state of the set.
    fn sample(&self, rng: &mut dyn Rng) -> Self::State;
}

/// Uniform in [0, 1): the 53 high bits of one draw.
pub fn unit_interval(rng: &mut dyn Rng) -> f64 {
    const SPACING: f64 = 1.0 / (1_u64 << 53) as f64;
    (rng.next_u64() >> 11) as f64 * SPACING
}
