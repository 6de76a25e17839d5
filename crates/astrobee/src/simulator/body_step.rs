//! A body that changes at once, unannounced.

use tumble_dynamics::nalgebra::Vector3;

/// A body that changes at once, with what comes or goes moving as the robot does: the twist stays.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum BodyStep {
    /// All ten parameters times a factor: more or less of the same.
    Scaled(f64),
    /// A ball added to the robot.
    Lump {
        /// Its mass over that of the whole.
        mass_share: f64,
        /// Its centre, body axes, m.
        center_body: Vector3<f64>,
        /// Its radius, m; of uniform density.
        radius_m: f64,
    },
}
