//! What the likelihood is told of robot and sensors.

use super::thrusters::Thrusters;
use crate::WrenchTiming;
use crate::dynamics::InertialParameters;
use crate::sensing::Sensing;
use nalgebra::{Matrix3, Vector3};

/// Length of a segment where nobody says, s: shorter than what a loop of control takes to answer.
const SEGMENT_S: f64 = 0.128;

/// Whether the body moves in a plane, the xy plane of both the inertial frame and the body.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Plane {
    /// Where z, roll and pitch of the record are constant or move by their noise only.
    #[default]
    Found,
    /// It does.
    Planar,
    /// It does not.
    Free,
}

/// Maximum likelihood of the ten parameters from the log of a robot whose sensors wander, filter, lag, and are off in scale and bias.
///
/// Every stream may be missing: what is there is answered at its own bound. Poses may come more seldom than the rest. Where a level, a bias, a
/// gain or a delay is not known it is found, and what is stated is the covariance with all of them unknown.
///
/// Where nothing is said of the sensors and of thrusters, a record whose step, lever arm or wrench is far from those of a robot is taken in
/// units in which they are not.
///
/// # Source
/// The likelihood of thesis (2.4) under a held wrench u with white error e, for segments of M samples. The mean over a segment of what is
/// published, less the model, is white with variance s^2/M and the wander's own part:
/// position, attitude, velocity: mean(h(x) - y) + (w_j + w_(j+1))/2, where w_(j+1) = phi w_j + d n, phi = exp(-T/tau), d = s_w sqrt(1 - phi^2);
/// rate: (1 + K) [w - J^-1 (t_G - c x f_G - n_G)] + b, where G is what the filter still owes of the impulse;
/// acceleration: (1 + K) [f_H/m + a_H x (r - c) + (W_H - tr W_H)(r - c) - w x (w x r)] + b, where H is the filtered wrench and W = w w^T;
/// n is w x J w, and with momentum s in wheels w x (J w + s).
///
/// # Example
/// ```
/// use tumble_identification::{FlightLikelihood, IdentificationError};
/// let error = FlightLikelihood::default().estimate(&[]).unwrap_err();
/// assert!(matches!(error, IdentificationError::TooFewSamples { samples: 0, .. }));
/// ```
#[derive(Clone, Debug, PartialEq)]
pub struct FlightLikelihood {
    /// What the columns of the log are of the true motion.
    pub sensing: Sensing,
    /// When the logged wrench acts.
    pub wrench_timing: WrenchTiming,
    /// Gravitational acceleration, inertial axes, m/s^2; a table that carries the body takes it up.
    pub gravity_world: Vector3<f64>,
    /// Whether the body moves in a plane.
    pub plane: Plane,
    /// Thrusts behind the wrench; none where the wrench is what it says but for white errors.
    pub thrusters: Option<Thrusters>,
    /// White error of the logged wrench per sample and axis, N m and N, where it is known; where not, the wrench may also be off by what moves
    /// with it and leaves no trace, up to 1 % of it.
    pub wrench_noise: Option<[f64; 2]>,
    /// Length of a segment, s, at least a sample: longer gains little, and under feedback it must stay below the loop's own delay.
    pub segment_s: f64,
    /// Body to start from; it need not be near.
    pub start: InertialParameters<f64>,
}

impl Default for FlightLikelihood {
    fn default() -> Self {
        Self {
            sensing: Sensing::default(),
            wrench_timing: WrenchTiming::default(),
            gravity_world: Vector3::zeros(),
            plane: Plane::default(),
            thrusters: None,
            wrench_noise: None,
            segment_s: SEGMENT_S,
            start: InertialParameters::about_com(10.0, Vector3::zeros(), Matrix3::identity() * 0.15),
        }
    }
}
