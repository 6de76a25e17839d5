//! What a local planner answers.

use crate::belief::Plan;
use crate::collision::Blocker;
use nalgebra::SMatrix;

/// How a local planner ended.
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
pub enum LocalStatus {
    /// The optimality conditions hold to the tolerance.
    Converged,
    /// The plan keeps every limit; the budget, the iterations or rounding ended the search before it converged.
    Feasible,
    /// No iterate kept every limit, so that the answer has no plan; that there can be none is not proven. What was violated most.
    Infeasible {
        /// Largest violation, in units of the limit.
        violation: f64,
        /// The obstacle, where it is one.
        blocker: Option<Blocker>,
    },
}

/// The parts of a cost.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct CostParts {
    /// Tracking, the terminal state included.
    pub tracking: f64,
    /// Effort and acceleration.
    pub effort: f64,
    /// Weighted variances.
    pub information: f64,
}

impl CostParts {
    /// Their sum.
    pub fn total(&self) -> f64 {
        self.tracking + self.effort + self.information
    }
}

/// A motion with what it will tell.
#[derive(Clone, Debug, PartialEq)]
pub struct LocalTrajectory<S, const U: usize, const P: usize> {
    /// Mission time of the first node, s.
    pub start_s: f64,
    /// Length of a step, s.
    pub step_s: f64,
    /// States, one more than inputs.
    pub states: Vec<S>,
    /// Inputs, each held for a step.
    pub inputs: Vec<[f64; U]>,
    /// Covariance of the quantities predicted for each node, by what was measured up to it; the first is the belief's.
    pub covariances: Vec<SMatrix<f64, P, P>>,
    /// Information gathered over the whole plan about the model's coordinates, the prior not included.
    pub gathered: SMatrix<f64, P, P>,
}

impl<S, const U: usize, const P: usize> LocalTrajectory<S, U, P> {
    /// The inputs from a step on, with nothing at the end for the steps that are missing: where the search for the next plan
    /// begins.
    pub fn inputs_from(&self, step: usize) -> Vec<[f64; U]> {
        let later = self.inputs.iter().skip(step).copied();
        later.chain(core::iter::repeat([0.0; U])).take(self.inputs.len()).collect()
    }

    /// Predicted standard deviation of each quantity at a node; `None` beyond the end.
    pub fn sigma(&self, node: usize) -> Option<[f64; P]> {
        let covariance = self.covariances.get(node)?;
        Some(core::array::from_fn(|i| f64::sqrt(covariance[(i, i)].max(0.0))))
    }
}

/// A local planner's answer.
#[derive(Clone, Debug, PartialEq)]
pub struct LocalAnswer<S, const U: usize, const P: usize> {
    /// How it ended.
    pub status: LocalStatus,
    /// The plan; none where no iterate kept every limit.
    pub plan: Option<Plan<LocalTrajectory<S, U, P>>>,
    /// Its cost, in parts.
    pub cost: Option<CostParts>,
    /// Residual of its optimality conditions.
    pub optimality: f64,
    /// Its largest violation of a limit, in units of the limit.
    pub violation: f64,
    /// Iterations, of all starts.
    pub iterations: usize,
    /// Units spent.
    pub units: u64,
    /// Directions of the quantities (unit vectors in prior standard deviations) about which the plan tells next to nothing,
    /// with the ratio of predicted to prior standard deviation along each.
    pub unobservable: Vec<([f64; P], f64)>,
}
