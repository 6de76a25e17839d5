//! Executable laws for everyone's groups (feature `testing`).

use std::fmt;

/// A law that an implementation breaks: which one, on what, by how much.
#[derive(Clone, Debug, PartialEq)]
pub struct LawViolation {
    /// Name of the law.
    pub law: &'static str,
    /// The inputs that break it.
    pub inputs: String,
    /// What the law demands.
    pub expected: String,
    /// What the implementation gave.
    pub found: String,
    /// Size of the difference.
    pub error: f64,
    /// Largest accepted difference.
    pub tolerance: f64,
}

impl fmt::Display for LawViolation {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(
            f,
            "law '{}' broken on {}: expected {}, found {}, error {:e} > {:e}",
            self.law, self.inputs, self.expected, self.found, self.error, self.tolerance
        )
    }
}
impl std::error::Error for LawViolation {}

/// `Ok` when `error <= tolerance` (a NaN error is a violation), else the violation.
///
/// # Errors
/// The violation.
pub fn require(
    law: &'static str,
    inputs: &dyn fmt::Debug,
    expected: &dyn fmt::Debug,
    found: &dyn fmt::Debug,
    error: f64,
    tolerance: f64,
) -> Result<(), LawViolation> {
    if error <= tolerance {
        return Ok(());
    }
    Err(LawViolation {
        law,
        inputs: format!("{inputs:?}"),
        expected: format!("{expected:?}"),
        found: format!("{found:?}"),
        error,
        tolerance,
    })
}
