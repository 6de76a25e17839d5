//! The least impulse between two states.

use super::TranslationLimits;
use super::synchronise::axes;
use crate::motion::TranslationState;

/// Lower bound on the integral of the sum of the acceleration's absolute components over any motion between two states that
/// takes at most `latest_s`, m/s; infinite where there is none. Times the mass it bounds the impulse, N s.
///
/// Along each axis the change of velocity is a bound, which a motion with enough time attains by a coast at a speed between
/// the two; with less time it has to go faster, by what [`super::steer_in`] spends. Each axis may take its own time here, so
/// the sum is a bound, and exact where the same duration suits all axes.
pub fn least_velocity_change_m_s(
    from: &TranslationState,
    to: &TranslationState,
    limits: &TranslationLimits,
    latest_s: f64,
) -> f64 {
    let Some((axes, durations)) = axes(from, to, limits) else { return f64::INFINITY };
    axes.iter().zip(&durations).map(|(axis, durations)| axis.least_change(durations, latest_s)).sum()
}
