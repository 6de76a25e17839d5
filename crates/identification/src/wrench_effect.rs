//! What may be wrong with a logged wrench beside white noise: columns of known shape and unknown size.

use crate::lie::Wrench;

/// A wrench that acted beside the logged one, known but for its factor: the scale of a thruster, the sag of a common supply.
///
/// The true wrench is the logged one and `factor * wrench_body` of each effect; the factor is expected to be zero, with a standard deviation
/// of `sigma`.
#[derive(Clone, Debug, PartialEq)]
pub struct WrenchEffect {
    /// What it is, for people: the name of a thruster's column.
    pub name: String,
    /// One standard deviation of the factor; zero holds it at zero.
    pub sigma: f64,
    /// Sample by sample over the step that begins there, body axes, torque about the body origin, N m and N.
    pub wrench_body: Vec<Wrench<f64>>,
}

impl WrenchEffect {
    /// Of no sample yet.
    pub const fn new(name: String, sigma: f64) -> Self {
        Self { name, sigma, wrench_body: Vec::new() }
    }
}
