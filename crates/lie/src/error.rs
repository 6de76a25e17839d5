//! Errors of this crate.

/// What can be wrong with geometric input. No trait of this crate has a method that fails, so that there is no error from outside to carry.
#[derive(Debug, Clone, Copy, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum LieError {
    /// A quaternion whose norm is not one within the stated tolerance.
    #[error("quaternion norm {norm} differs from 1 by more than {tolerance}")]
    NotUnit {
        /// Norm found.
        norm: f64,
        /// Largest accepted difference from one.
        tolerance: f64,
    },
    /// An increment outside the domain of the (Phi, Psi) chart, that is `|Phi| >= 1`.
    #[error("increment too large for one step: |Phi| = {norm}, must be below 1")]
    IncrementTooLarge {
        /// `|Phi|`, the sine of half the rotation angle of the step.
        norm: f64,
    },
    /// Euler angle rates asked for where they do not exist.
    #[error("Euler angle rates do not exist at pitch {pitch_rad} rad")]
    GimbalLock {
        /// Pitch, rad.
        pitch_rad: f64,
    },
    /// A value that is not finite.
    #[error("value is not finite")]
    NotFinite,
}
