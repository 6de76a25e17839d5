//! Noise levels: first guesses from high differences, refinement by restricted likelihood.

use super::segment::MEASUREMENTS;
use crate::Noise;

/// Standard deviations of one sample and axis.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Levels {
    /// By measurement group; one for groups not measured.
    pub(crate) measurements: [f64; MEASUREMENTS],
    /// Torque and force.
    pub(crate) wrench: [f64; 2],
}

impl Levels {
    pub(crate) fn of(noise: &Noise) -> Self {
        let or_one = |x: f64| if x > 0.0 { x } else { 1.0 };
        Self {
            measurements: [
                or_one(noise.position_m),
                or_one(noise.attitude_rad),
                or_one(noise.velocity_m_s),
                or_one(noise.rate_rad_s),
                or_one(noise.acceleration_m_s2),
            ],
            wrench: [or_one(noise.torque_n_m), or_one(noise.force_n)],
        }
    }

    /// In words of the public interface; zero for what was not measured.
    pub(crate) fn noise(&self, groups: &[usize]) -> Noise {
        let level = |group: usize| if groups.contains(&group) { self.measurements[group] } else { 0.0 };
        Noise {
            torque_n_m: self.wrench[0],
            force_n: self.wrench[1],
            position_m: level(0),
            attitude_rad: level(1),
            velocity_m_s: level(2),
            rate_rad_s: level(3),
            acceleration_m_s2: level(4),
        }
    }
}
