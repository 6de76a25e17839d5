//! Errors of the robot: each with a code and the remedy. All codes stand in `docs/errors.md`.

use crate::simulator::SimulatorError;

/// What the simulated robot refuses. An error of actuators from outside is a [`SimulatorError::Foreign`], and its `source()`.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum AstrobeeError {
    /// T025: a sensing setting out of its range.
    #[error("sensing: `{key}` is {value}, it must be {lowest} to {highest}{rule}")]
    SensingOutOfRange {
        /// The key, with its tables.
        key: &'static str,
        /// Value found.
        value: f64,
        /// Least accepted.
        lowest: f64,
        /// Largest accepted.
        highest: f64,
        /// What else is asked of it.
        rule: &'static str,
    },
    /// T025: sensors that the simulator does not fly.
    #[error("sensing: the simulator does not fly `{key}` as stated; it does: {accepted}")]
    SensingNotFlown {
        /// The key of the file of sensors.
        key: &'static str,
        /// What would be flown.
        accepted: &'static str,
    },
    /// T027: the simulator refuses.
    #[error(transparent)]
    Simulator(#[from] SimulatorError),
}

impl AstrobeeError {
    /// The code under which `docs/errors.md` explains this error.
    pub fn code(&self) -> &'static str {
        match self {
            Self::Simulator(SimulatorError::Foreign { .. }) => "T037",
            Self::Simulator(_) => "T027",
            Self::SensingOutOfRange { .. } | Self::SensingNotFlown { .. } => "T025",
        }
    }

    /// What the user can do about it.
    pub fn remedy(&self) -> &'static str {
        match self {
            Self::SensingNotFlown { .. } => {
                "correct the named key; `docs/sensing.md` says what of such a file is flown"
            }
            Self::SensingOutOfRange { .. } => "`docs/sensing.md` lists every key with unit and range",
            Self::Simulator(SimulatorError::Foreign { .. }) => {
                "the actuators named say what they lack: correct that, or ask for another `kind` in `[propulsion]`"
            }
            Self::Simulator(_) => {
                "a scenario's `body`, `payload`, `start` and `drive` must fit: a wrench far beyond what the mass and inertia bear makes it \
                 too fast within one step; `docs/scenarios.md` describes every key"
            }
        }
    }
}
