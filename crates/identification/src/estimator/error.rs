//! Errors that carry another's.

use crate::dynamics::ForeignError;
use crate::error::IdentificationError;
#[cfg(feature = "std")]
use crate::registry::UnknownName;
use core::error::Error;
use core::fmt;

/// The error of every estimator: the library's own, or one of an implementation from outside.
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
pub enum EstimatorError {
    /// Of the library.
    Library(IdentificationError),
    /// Of an implementation from outside.
    Foreign {
        /// Its name.
        by: &'static str,
        /// What it says.
        source: ForeignError,
    },
    /// A name that no entry of a registry bears.
    #[cfg(feature = "std")]
    Unknown(UnknownName),
    /// An implementation handed over what cannot be.
    Refused {
        /// What.
        what: &'static str,
        /// Which component.
        index: usize,
        /// Its value.
        value: f64,
    },
}

impl EstimatorError {
    /// An error that lives for ever.
    pub const fn fixed(by: &'static str, source: &'static (dyn Error + Send + Sync)) -> Self {
        Self::Foreign { by, source: ForeignError::fixed(source) }
    }

    /// An error with numbers of its own.
    #[cfg(feature = "std")]
    pub fn foreign(by: &'static str, source: impl Error + Send + Sync + 'static) -> Self {
        Self::Foreign { by, source: ForeignError::made(source) }
    }
}

impl fmt::Display for EstimatorError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Library(error) => error.fmt(f),
            #[cfg(feature = "std")]
            Self::Unknown(unknown) => unknown.fmt(f),
            Self::Foreign { by, source } => write!(f, "{by}: {source}"),
            Self::Refused { what, index, value } => write!(f, "{what}: component {index} is {value}"),
        }
    }
}

impl Error for EstimatorError {
    fn source(&self) -> Option<&(dyn Error + 'static)> {
        match self {
            Self::Library(error) => error.source(),
            Self::Foreign { source, .. } => Some(&**source),
            #[cfg(feature = "std")]
            Self::Unknown(_) => None,
            Self::Refused { .. } => None,
        }
    }
}

impl From<IdentificationError> for EstimatorError {
    fn from(error: IdentificationError) -> Self {
        Self::Library(error)
    }
}

#[cfg(feature = "std")]
impl From<UnknownName> for EstimatorError {
    fn from(unknown: UnknownName) -> Self {
        Self::Unknown(unknown)
    }
}
