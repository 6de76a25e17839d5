//! Errors that carry another's.

use crate::error::IdentificationError;
#[cfg(feature = "std")]
use crate::registry::UnknownName;
use core::error::Error;
use core::fmt;

/// The error of every estimator: the library's own, `Copy` and comparable as it is, or one of an implementation from outside.
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
        source: Source,
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

/// An error from outside. Without an allocator it is one that lives for ever (`&MY_ERROR`), with one any.
#[derive(Clone)]
#[non_exhaustive]
pub enum Source {
    /// A constant.
    Static(&'static (dyn Error + Send + Sync)),
    /// Made at run time.
    #[cfg(feature = "std")]
    Shared(std::sync::Arc<dyn Error + Send + Sync>),
}

impl core::ops::Deref for Source {
    type Target = dyn Error + Send + Sync + 'static;

    fn deref(&self) -> &Self::Target {
        match self {
            Self::Static(error) => *error,
            #[cfg(feature = "std")]
            Self::Shared(error) => &**error,
        }
    }
}

impl EstimatorError {
    /// An error that lives for ever.
    pub fn fixed(by: &'static str, source: &'static (dyn Error + Send + Sync)) -> Self {
        Self::Foreign { by, source: Source::Static(source) }
    }

    /// An error with numbers of its own.
    #[cfg(feature = "std")]
    pub fn foreign(by: &'static str, source: impl Error + Send + Sync + 'static) -> Self {
        Self::Foreign { by, source: Source::Shared(std::sync::Arc::new(source)) }
    }
}

/// The same object, not one that says the same.
impl PartialEq for Source {
    fn eq(&self, other: &Self) -> bool {
        core::ptr::addr_eq(&raw const **self, &raw const **other)
    }
}

impl fmt::Debug for Source {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        fmt::Debug::fmt(&**self, f)
    }
}

impl fmt::Display for Source {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        fmt::Display::fmt(&**self, f)
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
            Self::Foreign { source, .. } => Some(&**source),
            _ => None,
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
