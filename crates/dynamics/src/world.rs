//! What surrounds a body: plain data, no queries.

use alloc::vec::Vec;
use tumble_lie::Pose;
use tumble_lie::nalgebra::Vector3;

/// A box with its edges along the inertial axes.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct AlignedBox {
    /// Least coordinates, inertial axes, m.
    pub lower_world: Vector3<f64>,
    /// Largest coordinates, inertial axes, m.
    pub upper_world: Vector3<f64>,
}

impl AlignedBox {
    /// The box with these two opposite corners, in whatever order their coordinates come.
    pub fn between(corner_world: Vector3<f64>, opposite_world: Vector3<f64>) -> Self {
        Self { lower_world: corner_world.inf(&opposite_world), upper_world: corner_world.sup(&opposite_world) }
    }
}

/// An ellipsoid that the body must stay out of.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ObstacleEllipsoid {
    /// Centre and axes.
    pub world_from_ellipsoid: Pose<f64>,
    /// Semi-axes, m.
    pub semi_axes: Vector3<f64>,
}

/// Keep-in boxes (their union is allowed), keep-out boxes and obstacles.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct World {
    /// The union of these is where the body may be; empty means everywhere.
    pub keep_in: Vec<AlignedBox>,
    /// The body stays out of each, wherever `keep_in` would let it be.
    pub keep_out: Vec<AlignedBox>,
    /// The body stays out of each.
    pub obstacles: Vec<ObstacleEllipsoid>,
}
