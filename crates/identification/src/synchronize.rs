//! Putting what was measured and what was commanded on one time: order of time stamps, delay, and the scale between them.

#[cfg(feature = "std")]
mod delay;
mod ordering;
#[cfg(feature = "research")]
mod scale;

#[cfg(feature = "std")]
pub use delay::{Delay, Signals, delay};
pub use ordering::{Held, Released, TimeOrdering};
#[cfg(feature = "research")]
pub use scale::{AxisScale, relative_scale};

/// Sum over all distances, on either side, of products of correlation that `at_distance` holds for 0, 1, ...: a variance.
///
/// Flat to the distance `reach` beyond which noise is independent and falling to zero at twice that, which is without bias;
/// where chance makes that negative, falling from the start (Bartlett).
#[cfg(feature = "std")]
fn sum_over_distances(at_distance: &[f64], reach: usize) -> f64 {
    let sum = |taper: &dyn Fn(f64) -> f64| -> f64 {
        let both_sides = |lag: usize| if lag == 0 { 1.0 } else { 2.0 };
        at_distance
            .iter()
            .enumerate()
            .map(|(lag, c)| both_sides(lag) * taper(lag as f64 / (reach + 1) as f64) * c)
            .sum()
    };
    let flat = sum(&|x| (2.0 - x).clamp(0.0, 1.0));
    if flat > 0.0 { flat } else { sum(&|x| (1.0 - 0.5 * x).max(0.0)) }.max(0.0)
}
