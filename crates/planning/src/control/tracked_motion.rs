//! What a tube is asked to follow, axis by axis.

use nalgebra::{UnitQuaternion, Vector2};

/// The tracked point on each axis of the tube: where it is, and where it should be at each node of the plan.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct TrackedMotion {
    /// Mission time of the first node, s.
    pub start_s: f64,
    /// Measured position and velocity, m, m/s.
    pub states: [Vector2<f64>; 3],
    /// Wanted position and velocity at each node, the first one now; the last stands for those missing.
    pub references: [Vec<Vector2<f64>>; 3],
    /// Wanted attitude at each node, world from body; only obstacles ask for it.
    pub attitudes: Vec<UnitQuaternion<f64>>,
}

impl TrackedMotion {
    pub(super) fn is_finite(&self) -> bool {
        let nodes = self.references.iter().flatten().chain(&self.states);
        nodes.into_iter().all(|node| node.x.is_finite() && node.y.is_finite())
    }
}
