//! What is asked of [`identify`](super::identify).

use crate::WrenchTiming;
use crate::dynamics::InertialParameters;
use crate::likelihood::Nuisances;
use nalgebra::{SVector, Vector3};

/// Chosen from the columns present, the wrench timing and the noise found; [`Identification::method`](super::Identification::method) says what was chosen.
pub(crate) const AUTO: &str = "auto";
/// Name of the maximum likelihood; where it leaves a direction free, the best regression answers instead and says which.
pub const MAXIMUM_LIKELIHOOD: &str = "maximum-likelihood";
/// Name of the likelihood with a model of the sensors in it: wander, filters, gains, biases, delays.
pub const FLIGHT_LIKELIHOOD: &str = "flight-likelihood";
/// Name of the answer by smooth test functions, for a body on a table that no error of its wrench explains.
pub const WEAK_FORM: &str = "weak-form";

/// What is known of the body beforehand: independent Gaussian knowledge of each of the ten parameters.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Prior {
    /// Expected parameters.
    pub mean: InertialParameters<f64>,
    /// Standard deviations in the order of [`InertialParameters::to_vector`]; infinite where nothing is known.
    pub standard_deviation: SVector<f64, 10>,
}

/// How [`identify`](super::identify) works.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Settings {
    /// Name of the method, as [`methods`](super::methods) or a [`Pipeline`](super::Pipeline) lists it: `auto`, `newton-euler`, `variational`, `variational4`,
    /// `variational6`, `maximum-likelihood`, `flight-likelihood`, `rls`, `recursive-sdp`, `ekf`, `ukf`, or one of the user's.
    pub method: &'static str,
    /// When the logged wrench acts.
    pub wrench_timing: WrenchTiming,
    /// Gravitational acceleration, inertial axes, m/s^2.
    pub gravity_world: Vector3<f64>,
    /// Prior knowledge that enters the estimate; none unless given.
    pub prior: Option<Prior>,
    /// Samples between the poses of one regression row; `None` chooses it from the noise found.
    pub lag: Option<usize>,
    /// What the likelihood estimates beside the ten parameters.
    pub estimate: Nuisances,
}

impl Default for Settings {
    fn default() -> Self {
        Self {
            method: AUTO,
            wrench_timing: WrenchTiming::default(),
            gravity_world: Vector3::zeros(),
            prior: None,
            lag: None,
            estimate: Nuisances::default(),
        }
    }
}
