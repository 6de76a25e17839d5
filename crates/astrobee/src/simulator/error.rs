//! What a simulator can refuse.

use crate::propulsion::constants::CONTROL_PERIOD_S;
use tumble_dynamics::{DynamicsError, ForeignError};

/// What a simulator can refuse.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum SimulatorError {
    /// A duration that is no whole number of control periods.
    #[error("{duration_s} s is no whole, positive number of control periods of {CONTROL_PERIOD_S} s")]
    NotControlPeriods {
        /// The duration, s.
        duration_s: f64,
    },
    /// A body that leans, or moves out of the plane, where there are three degrees of freedom.
    #[error("on the table the body stands upright and moves in x, y and yaw: out of the plane by {excess}")]
    OutOfPlane {
        /// Largest offending component: of the quaternion, of the rate in rad/s or of the velocity in m/s.
        excess: f64,
    },
    /// A payload is to be attached while another one is held.
    #[error("a payload is held already")]
    PayloadHeld,
    /// A payload is to be released where none is held.
    #[error("no payload is held")]
    NoPayload,
    /// The integrator refused a step: the body is much too fast, or has an absurd mass.
    #[error(
        "the motion cannot be computed ({0}): too large a wrench (`drive`), or too fast a start, for the mass and inertia of `body`"
    )]
    Dynamics(#[source] DynamicsError),
    /// Actuators from outside refuse. Two are equal where they are the same object.
    #[error("{by}: {source}")]
    Foreign {
        /// Their name.
        by: &'static str,
        /// What they say.
        source: ForeignError,
    },
}

impl From<DynamicsError> for SimulatorError {
    fn from(error: DynamicsError) -> Self {
        match error {
            DynamicsError::Foreign { by, source } => Self::Foreign { by, source },
            other => Self::Dynamics(other),
        }
    }
}
