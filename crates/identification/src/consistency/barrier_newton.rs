//! Path following on a barrier: slower, and good for every feasible set.

use super::{ConstrainedEstimate, ConstrainedLeastSquares, FeasibleSet, pulled_inside};
use crate::error::IdentificationError;
use crate::householder::sqrt;
use crate::square_root_information::SquareRootInformation;
use nalgebra::SMatrix;

const DEFAULT_GAP: f64 = 1e-7;
const MAX_ITERATIONS: usize = 500;

/// Constrained least squares over any [`FeasibleSet`], by Newton's method on ½|R p − z|² + μ φ(p) with falling μ.
///
/// For sets of yours, owned or borrowed; [`InteriorPoint`](super::InteriorPoint) is the fast solver for the pseudo-inertia cone.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct BarrierNewton<S> {
    set: S,
    gap_tolerance: f64,
}

impl<S> BarrierNewton<S> {
    /// Solver over `set` to a duality gap of 1e-7 in units of half a chi-square.
    pub fn new(set: S) -> Self {
        Self { set, gap_tolerance: DEFAULT_GAP }
    }
}

impl<S: FeasibleSet<P>, const P: usize> ConstrainedLeastSquares<P> for BarrierNewton<S> {
    fn solve(&self, information: &SquareRootInformation<P>) -> Result<ConstrainedEstimate<P>, IdentificationError> {
        let unconstrained = information.solve(&self.set.magnitudes())?;
        let margin = self.set.margin(&unconstrained);
        if margin > 0.0 {
            return Ok(ConstrainedEstimate {
                parameters: unconstrained,
                margin,
                objective: 0.0,
                duality_gap: 0.0,
                iterations: 0,
            });
        }
        let factor = information.factor();
        let hessian = factor.transpose() * factor;
        let nu = self.set.barrier_parameter();
        let mut parameters = self.set.interior_point();
        let mut mu = information.objective(&parameters).max(self.gap_tolerance) / nu;
        let (mut duality_gap, mut reached) = (f64::INFINITY, 0);
        for iterations in 1..=MAX_ITERATIONS {
            reached = iterations;
            let barrier = self.set.barrier(&parameters);
            let Some(barrier) = barrier else { break };
            let gradient = factor.transpose() * information.residual(&parameters) / mu + barrier.gradient;
            let system: SMatrix<f64, P, P> = hessian / mu + barrier.hessian;
            let Some(cholesky) = system.cholesky() else { break };
            let step = -cholesky.solve(&gradient);
            let decrement = sqrt(-gradient.dot(&step));
            if decrement < 0.1 {
                // On the central path the gap is νμ; this close to it, at most (ν + √ν) μ.
                duality_gap = (nu + sqrt(nu)) * mu;
                if duality_gap <= self.gap_tolerance {
                    let (parameters, margin) = pulled_inside(&self.set, parameters + step);
                    let objective = information.objective(&parameters);
                    return Ok(ConstrainedEstimate { parameters, margin, objective, duality_gap, iterations });
                }
                mu *= 0.1;
            }
            // The damped step of self-concordant theory: inside the set without a line search.
            parameters += step / (1.0 + decrement);
        }
        Err(IdentificationError::NotConverged { iterations: reached, duality_gap, tolerance: self.gap_tolerance })
    }
}
