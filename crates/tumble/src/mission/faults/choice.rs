//! `drop:2`: a fault and how bad it is, as text.

use crate::mission::options::{FaultChoice, FaultName};
use clap::ValueEnum;
use std::fmt;
use std::str::FromStr;

/// A fault that is none.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum FaultChoiceError {
    /// A name that no fault has.
    #[error("there is no fault `{name}`{near}; there are {known}")]
    Unknown {
        /// What was given.
        name: String,
        /// The name that may have been meant.
        near: String,
        /// All names.
        known: String,
    },
    /// A severity other than 1, 2, 3.
    #[error("the severity of `{name}` is 1, 2 or 3, not `{given}`: write `{name}:2`")]
    Severity {
        /// Name of the fault.
        name: String,
        /// What was given.
        given: String,
    },
}

impl FaultName {
    /// All of them, in the order of the command line's help.
    pub const ALL: [Self; 14] = [
        Self::Drop,
        Self::Delay,
        Self::Duplicate,
        Self::Clock,
        Self::Malformed,
        Self::Frozen,
        Self::Jump,
        Self::Saturation,
        Self::Nozzle,
        Self::Power,
        Self::MassStep,
        Self::Divergence,
        Self::Planner,
        Self::LateObstacle,
    ];
}

impl fmt::Display for FaultName {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        self.to_possible_value().map_or(Ok(()), |value| f.write_str(value.get_name()))
    }
}

impl fmt::Display for FaultChoice {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}:{}", self.name, self.severity)
    }
}

impl FromStr for FaultChoice {
    type Err = FaultChoiceError;

    fn from_str(text: &str) -> Result<Self, FaultChoiceError> {
        let (name, severity) = text.split_once(':').unwrap_or((text, "1"));
        let Ok(found) = <FaultName as ValueEnum>::from_str(name, false) else {
            let known = FaultName::ALL.map(|name| name.to_string());
            let near = tumble_formats::place::suggestion(name, known.iter().map(String::as_str));
            return Err(FaultChoiceError::Unknown { name: name.to_owned(), near, known: known.join(", ") });
        };
        match severity {
            "1" => Ok(Self { name: found, severity: 1 }),
            "2" => Ok(Self { name: found, severity: 2 }),
            "3" => Ok(Self { name: found, severity: 3 }),
            _ => Err(FaultChoiceError::Severity { name: name.to_owned(), given: severity.to_owned() }),
        }
    }
}
