//! A sample as the likelihood reads it.

use super::flow::Input;
use nalgebra::{UnitQuaternion, Vector3};

/// One sample as the likelihood reads it.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Sample {
    /// Since the first sample.
    pub(crate) time_s: f64,
    /// To the next sample.
    pub(crate) step_s: f64,
    pub(crate) input: Input,
    /// Whether the pose was seen; where it was not it is a guess that only begins the search.
    pub(crate) posed: bool,
    pub(crate) position: Vector3<f64>,
    pub(crate) world_from_body: UnitQuaternion<f64>,
    pub(crate) velocity: Option<Vector3<f64>>,
    pub(crate) rate: Option<Vector3<f64>>,
    pub(crate) acceleration: Option<Vector3<f64>>,
}
