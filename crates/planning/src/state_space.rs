//! What a search needs to know of states.

use core::fmt::Debug;
use rand_core::Rng;

/// A set of states with a metric, usable as `dyn`.
///
/// # Laws
/// `laws::check_state_space`.
///
/// # Example
/// ```
/// use tumble_planning::rand_core::Rng;
/// use tumble_planning::{StateSpace, unit_interval};
///
/// /// Places on a rail two metres long.
/// struct Rail;
/// impl StateSpace for Rail {
///     type State = f64;
///     fn distance(&self, from: &f64, to: &f64) -> f64 {
///         (to - from).abs()
///     }
///     fn interpolate(&self, from: &f64, to: &f64, fraction: f64) -> f64 {
///         from * (1.0 - fraction) + to * fraction
///     }
///     fn contains(&self, state: &f64) -> bool {
///         (0.0..=2.0).contains(state)
///     }
///     fn sample(&self, rng: &mut dyn Rng) -> f64 {
///         2.0 * unit_interval(rng)
///     }
/// }
/// let space: &dyn StateSpace<State = f64> = &Rail;
/// assert_eq!(space.interpolate(&0.5, &1.5, 0.5), 1.0);
/// assert!(space.contains(&1.9) && !space.contains(&2.1));
/// ```
/// Tutorial: [a robot of your own to plan for](https://github.com/tumble-robotics/tumble/blob/main/crates/planning/tests/suite/custom_robot_plan.rs).
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
