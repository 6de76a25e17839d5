//! How a search for a plan is run, and how it ends.

/// Most pairs of a step and its change of gradient that there is room for.
pub const MOST_PAIRS: usize = 20;
/// Largest violation, in units of the limit, that is rounding.
pub(super) const FEASIBLE: f64 = 1e-6;

/// How a search is run.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SqpSettings {
    /// Residual of the optimality conditions at which it has converged.
    pub tolerance: f64,
    /// Largest violation of a row that counts as none.
    pub feasibility: f64,
    /// Most iterations: quadratic programs solved.
    pub iterations: usize,
    /// Damping of the first step; zero where the start is near the optimum.
    pub damping: f64,
    /// Cost of a unit of the largest violation, at first; it grows as the multipliers ask for.
    pub penalty: f64,
    /// Most pairs of a step and its change of gradient that are kept, up to [`MOST_PAIRS`].
    pub pairs: usize,
    /// Largest step, in any unknown, that makes a pair: longer ones hold no curvature of the end.
    pub pair_step: f64,
}

impl SqpSettings {
    /// For a start that is nothing but a guess.
    pub const COLD: Self = Self {
        tolerance: 1e-4,
        feasibility: 1e-6,
        iterations: 200,
        damping: 0.01,
        penalty: 5.0,
        pairs: 20,
        pair_step: 0.1,
    };
    /// For a start near the optimum.
    pub const WARM: Self = Self { damping: 0.0, ..Self::COLD };
}

/// How a search ended.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum SqpStatus {
    /// The optimality conditions hold to the tolerance.
    Converged,
    /// No step makes it better.
    Stalled,
    /// As many iterations as allowed.
    IterationLimit,
    /// The budget was spent.
    BudgetSpent,
}

/// Where a search ended.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SqpOutcome {
    /// Why it ended.
    pub status: SqpStatus,
    /// Cost.
    pub cost: f64,
    /// Residual of the optimality conditions: largest entry of the gradient of the Lagrangian; infinite where unknown.
    pub optimality: f64,
    /// Largest violation of a row.
    pub violation: f64,
    /// The row violated most, where it is more than allowed.
    pub worst_row: Option<usize>,
    /// Quadratic programs solved.
    pub iterations: usize,
    /// Rows and bounds active in the last of them.
    pub active: usize,
}
