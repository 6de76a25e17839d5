//! Exact motions between states of a body that may be pushed so hard and move so fast along each world axis: closed forms,
//! nothing integrated, nothing sampled.
//!
//! Along one axis all motions between two states in a given time reach an interval of displacements, so the durations in
//! which a motion exists are known exactly; they have a gap where both speeds point the same way. Three axes meet in the
//! least duration that all of them allow.
//!
//! # Source
//! Derived here; the double integrator's bang-coast-bang is classical.

mod axis;
mod goal;
#[cfg(feature = "research")]
mod impulse;
mod slew;
mod synchronise;

pub use goal::{least_time_to_goal_s, steer_to_goal};
#[cfg(feature = "research")]
pub use impulse::least_velocity_change_m_s;
pub use slew::{Slew, slew};
pub use synchronise::{PIECES, Piece, Steering, least_time_s, steer, steer_in};

use crate::error::{PlanningError, not_negative, positive};
use crate::global::MotionLimits;
use nalgebra::Vector3;
use tumble_dynamics::AlignedBox;

/// Where the body origin may be, how fast, and how hard it may be accelerated; world axes, per axis. Those from
/// [`MotionLimits::translation`] are sound.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TranslationLimits {
    /// Where the body origin may be; sides may be infinite.
    pub position: AlignedBox,
    /// Largest speed along each axis, m/s.
    pub speed_m_s: Vector3<f64>,
    /// Largest acceleration along each axis, m/s^2.
    pub acceleration_m_s2: Vector3<f64>,
}

impl MotionLimits {
    /// The limits of the origin of a body with this mass.
    ///
    /// # Errors
    /// A mass that is not positive and finite; limits of speed or force that are negative or not finite; accelerations beyond
    /// 1e20 m/s^2 or, but for zero, below 1e-20 m/s^2; a box whose sides are not numbers, or that is empty.
    pub fn translation(&self, mass_kg: f64) -> Result<TranslationLimits, PlanningError> {
        positive("the mass of the body", mass_kg)?;
        for (what, limit) in [("the limit of speed", &self.speed_m_s), ("the limit of force", &self.force_n)] {
            for value in limit {
                not_negative(what, *value)?;
            }
        }
        let what = "the box that limits the position";
        for (axis, (lower, upper)) in self.position.lower_world.iter().zip(&self.position.upper_world).enumerate() {
            for value in [*lower, *upper] {
                if value.is_nan() {
                    return Err(PlanningError::NotFinite { what, value });
                }
            }
            if lower > upper {
                return Err(PlanningError::EmptyBox { what, axis, lower: *lower, upper: *upper });
            }
        }
        let acceleration_m_s2 = self.force_n / mass_kg;
        for acceleration in &acceleration_m_s2 {
            crate::error::zero_or_moderate("the limit of acceleration", *acceleration)?;
        }
        Ok(TranslationLimits { position: self.position, speed_m_s: self.speed_m_s, acceleration_m_s2 })
    }
}
