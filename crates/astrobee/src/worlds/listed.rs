//! What the lists of a place hold.

use tumble_dynamics::nalgebra::{Quaternion, Translation3, UnitQuaternion, Vector3};
use tumble_lie::Pose;

/// An axis-aligned ellipsoid as its source lists it: semi-axes, then centre, m.
pub(super) type Listed = ([f64; 3], [f64; 3]);

/// A named pose.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct NamedPose {
    /// Name in scenarios.
    pub name: &'static str,
    /// Body origin, world axes, m.
    pub position_m: [f64; 3],
    /// Body to world, scalar last.
    pub quaternion_xyzw: [f64; 4],
}

impl NamedPose {
    /// The pose, its quaternion normalised.
    pub fn world_from_body(&self) -> Pose<f64> {
        let [x, y, z, w] = self.quaternion_xyzw;
        let rotation = Quaternion::new(w, x, y, z);
        Pose::from_parts(Translation3::from(Vector3::from(self.position_m)), UnitQuaternion::new_normalize(rotation))
    }
}
