//! What can go wrong in identification, with the numbers needed to act on it.

/// Errors of this crate.
#[derive(Debug, Clone, Copy, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum IdentificationError {
    /// The data (and the prior, if any) leave some parameter directions undetermined.
    #[error(
        "only {rank} of {expected} parameter directions are determined \
         (smallest relative singular value {smallest_singular_value:e}): excite the body more, or state a prior"
    )]
    NotExcited {
        /// Number of determined directions.
        rank: usize,
        /// Number of parameters.
        expected: usize,
        /// Smallest singular value of the scaled square-root information, relative to the largest.
        smallest_singular_value: f64,
    },
    /// A measurement, regressor, weight or prior is NaN or infinite.
    #[error("row {row} of the block is not finite")]
    NotFinite {
        /// First offending row, from zero.
        row: usize,
    },
    /// A standard deviation that is zero, negative or NaN.
    #[error("standard deviation {value} of component {index} is not positive")]
    NotPositive {
        /// Component, from zero.
        index: usize,
        /// Offending value.
        value: f64,
    },
    /// The mass or the length that sets the scale of the body is not a positive finite number.
    #[error("body scale {mass_kg} kg, {length_m} m is not positive and finite")]
    InvalidScale {
        /// Offered mass.
        mass_kg: f64,
        /// Offered length.
        length_m: f64,
    },
    /// The constrained solver did not reach the requested duality gap.
    #[error("duality gap {duality_gap:e} after {iterations} iterations, above {tolerance:e}")]
    NotConverged {
        /// Iterations done.
        iterations: usize,
        /// Duality gap reached, in units of ½|R p − z|².
        duality_gap: f64,
        /// Duality gap asked for.
        tolerance: f64,
    },
    /// The residual variance was asked for with no more rows than parameters.
    #[error("{rows} rows leave no residual to judge {parameters} parameters by")]
    NoResidual {
        /// Rows received.
        rows: usize,
        /// Number of parameters.
        parameters: usize,
    },
}
