//! Where the nodes of a plan can be.

use nalgebra::{Vector2, Vector3};

/// Where a plan's nodes can be at all, whatever its accelerations.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Reach {
    /// Measured position and velocity of each axis.
    pub states: [Vector2<f64>; 3],
    /// Largest tube of each axis, of position and of velocity, slack included.
    pub tubes: [Vector2<f64>; 3],
    /// Largest nominal acceleration of each axis, m/s^2.
    pub accelerations_m_s2: Vector3<f64>,
}

impl Reach {
    /// Middle and half-widths of the box of the nominal positions after a time.
    pub fn at(&self, time_s: f64) -> (Vector3<f64>, Vector3<f64>) {
        let middle = Vector3::from_fn(|i, _| self.states[i].x + time_s * self.states[i].y);
        let half = Vector3::from_fn(|i, _| {
            self.tubes[i].x + time_s * (self.tubes[i].y + 0.5 * time_s * self.accelerations_m_s2[i])
        });
        (middle, half)
    }

    /// Half-widths of the largest tube, m.
    pub(super) fn tube_m(&self) -> Vector3<f64> {
        Vector3::from_fn(|i, _| self.tubes[i].x)
    }
}
