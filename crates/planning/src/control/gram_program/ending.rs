//! When a solve ends, and how.

/// When a solve ends.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct GramSettings {
    /// Largest violation of a row, in units of the row's length in `H^-1`.
    pub tolerance: f64,
    /// Largest number of changes of the set of active rows.
    pub iterations: usize,
}

impl Default for GramSettings {
    fn default() -> Self {
        Self { tolerance: 1e-10, iterations: 1000 }
    }
}

/// How a solve ended.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum GramStatus {
    /// With the solution.
    Solved,
    /// With a proof that no `x` fulfils all rows: [`GramWorkspace::certificate`](super::GramWorkspace::certificate).
    Infeasible,
    /// At the largest number of iterations.
    Capped,
    /// Where rounding does not allow an answer, or with an input that is no number or of another length.
    Numerical,
}
