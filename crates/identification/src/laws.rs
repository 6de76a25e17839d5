//! Executable laws for feasible sets, constrained solvers, estimators, recursive ones, linear models and criteria, yours
//! included.

mod criterion;
mod estimator;
mod filter_model;
mod linear_model;
#[cfg(feature = "trees")]
mod multibody;
mod recursive_estimator;
mod sensing;
mod state_estimator;
mod units;

pub use criterion::{
    check_change_of_units, check_excitation_criterion, check_more_information, check_optimality_criterion,
};
pub use estimator::{Case, Make, Retold, check_coverage, check_estimator};
pub use filter_model::{check_differentiable_model, check_filter_model};
pub use linear_model::check_linear_model;
#[cfg(feature = "trees")]
pub use multibody::{Determined, check_base_parameters, check_links_solver};
pub use recursive_estimator::{
    Begin, EstimatorPromises, Told, check_gate, check_innovation, check_recursive_estimator, check_unit_equivariance,
};
pub use sensing::{Publish, SensingTrial, check_sensing};
pub use state_estimator::{BeginFlight, StateTrial, check_state_estimator};
pub use units::{BeginFlightIn, Identifies, Units, check_flight_units, check_identification_units};

use crate::consistency::{BarrierNewton, ConstrainedLeastSquares, FeasibleSet};
use crate::square_root_information::SquareRootInformation;
use nalgebra::{SMatrix, SVector};
use tumble_lie::laws::{LawViolation, require};

/// Laws of a [`FeasibleSet`], tried at the set's interior point, at `points` (inside or outside) and between them.
///
/// `tolerance` is relative; 1e-5 suits derivatives checked by central differences.
///
/// # Errors
/// The first broken law: `interior point is inside`, `barrier exists exactly inside`, `margin is concave`,
/// `barrier gradient is the derivative`, `barrier Hessian is the second derivative`,
/// `barrier parameter bounds the decrement`, `barrier grows towards the boundary`.
pub fn check_feasible_set<const P: usize>(
    set: &dyn FeasibleSet<P>,
    points: &[SVector<f64, P>],
    tolerance: f64,
) -> Result<(), LawViolation> {
    let centre = set.interior_point();
    let depth = set.margin(&centre);
    let inside = depth > 0.0 && set.barrier(&centre).is_some();
    require("interior point is inside", &centre, &"a positive margin", &depth, broken_unless(inside), 0.0)?;
    let magnitudes = set.magnitudes();
    for point in points {
        let on_ray = |fraction: f64| centre + (point - centre) * fraction;
        for fraction in [0.0, 0.25, 0.5, 0.75, 1.0] {
            let here = on_ray(fraction);
            let margin = set.margin(&here);
            if margin.abs() > 1e-12 {
                let agrees = set.barrier(&here).is_some() == (margin > 0.0);
                require("barrier exists exactly inside", &here, &margin, &"otherwise", broken_unless(agrees), 0.0)?;
            }
            let (below, above) = (set.margin(&on_ray(fraction - 0.25)), set.margin(&on_ray(fraction + 0.25)));
            let size = margin.abs() + below.abs() + above.abs();
            let excess = 0.5 * (below + above) - margin;
            require("margin is concave", &here, &margin, &(below, above), excess, tolerance * size)?;
            if margin > 1e-3 * depth {
                check_barrier(set, &here, &(point - centre), &magnitudes, tolerance)?;
            }
        }
        if set.margin(point) < 0.0 {
            let (mut inner, mut outer) = (0.0, 1.0);
            for _ in 0..60 {
                let middle = 0.5 * (inner + outer);
                if set.margin(&on_ray(middle)) > 0.0 { inner = middle } else { outer = middle }
            }
            let value = |distance: f64| set.barrier(&on_ray(inner * (1.0 - distance))).map_or(f64::NAN, |b| b.value);
            // A logarithm gains ln 1000 over three decades.
            let gain = value(1e-9) - value(1e-6);
            require("barrier grows towards the boundary", point, &"at least 3", &gain, 3.0 - gain, 0.0)?;
        }
    }
    Ok(())
}

fn check_barrier<const P: usize>(
    set: &dyn FeasibleSet<P>,
    here: &SVector<f64, P>,
    along: &SVector<f64, P>,
    magnitudes: &SVector<f64, P>,
    tolerance: f64,
) -> Result<(), LawViolation> {
    let Some(barrier) = set.barrier(here) else {
        return require("barrier exists exactly inside", here, &"a barrier", &"none", f64::NAN, 0.0);
    };
    // Each axis, and the way towards the point.
    let axes = (0..P).map(|k| SVector::from_fn(|i, _| if i == k { magnitudes[k] } else { 0.0 }));
    for direction in axes.chain(core::iter::once(*along)) {
        let curvature = direction.dot(&(barrier.hessian * direction));
        if curvature <= 0.0 {
            continue;
        }
        // One ten-thousandth of the local length scale of the barrier.
        let step = 1e-4 / curvature.sqrt();
        let (Some(ahead), Some(behind)) =
            (set.barrier(&(here + direction * step)), set.barrier(&(here - direction * step)))
        else {
            return require("barrier exists exactly inside", here, &"a neighbourhood", &"none", f64::NAN, 0.0);
        };
        let slope = (ahead.value - behind.value) / (2.0 * step);
        let size = curvature.sqrt();
        let stated = barrier.gradient.dot(&direction);
        require("barrier gradient is the derivative", here, &slope, &stated, (slope - stated).abs(), tolerance * size)?;
        let bend = (ahead.gradient - behind.gradient) / (2.0 * step);
        let difference = (bend - barrier.hessian * direction).component_mul(magnitudes).norm();
        let size = (barrier.hessian * direction).component_mul(magnitudes).norm();
        require(
            "barrier Hessian is the second derivative",
            here,
            &bend,
            &(barrier.hessian * direction),
            difference,
            tolerance * size,
        )?;
    }
    let nu = set.barrier_parameter();
    let scaled_hessian = SMatrix::<f64, P, P>::from_fn(|i, j| barrier.hessian[(i, j)] * magnitudes[i] * magnitudes[j]);
    let scaled_gradient = barrier.gradient.component_mul(magnitudes);
    if let Some(cholesky) = scaled_hessian.cholesky() {
        let decrement = scaled_gradient.dot(&cholesky.solve(&scaled_gradient));
        require("barrier parameter bounds the decrement", here, &nu, &decrement, decrement - nu, tolerance * nu)?;
    }
    Ok(())
}

/// Laws of a [`ConstrainedLeastSquares`] solver over `set`, tried on `problems`.
///
/// `gap` is the largest excess objective to accept, in units of ½|R p − z|².
///
/// # Errors
/// The first broken law: `solver succeeds`, `estimate is strictly inside`, `objective is the objective`,
/// `inactive equals unconstrained`, `no feasible point is better`, `duality gap is small`,
/// `duality gap bounds the excess`.
pub fn check_constrained_solver<const P: usize>(
    solver: &dyn ConstrainedLeastSquares<P>,
    set: &dyn FeasibleSet<P>,
    problems: &[SquareRootInformation<P>],
    gap: f64,
) -> Result<(), LawViolation> {
    let reference_solver = BarrierNewton::new(set);
    for problem in problems {
        let (estimate, reference) = match (solver.solve(problem), reference_solver.solve(problem)) {
            (Ok(estimate), Ok(reference)) => (estimate, reference),
            outcome => return require("solver succeeds", problem, &"an estimate", &outcome, f64::NAN, 0.0),
        };
        let p = estimate.parameters;
        let margin = set.margin(&p);
        let inside = margin > 0.0 && (estimate.margin - margin).abs() <= 1e-12 * (1.0 + margin);
        require("estimate is strictly inside", problem, &margin, &estimate.margin, broken_unless(inside), 0.0)?;
        let objective = problem.objective(&p);
        let residual = (objective - estimate.objective).abs();
        require("objective is the objective", problem, &objective, &estimate.objective, residual, gap)?;
        if let Ok(unconstrained) = problem.solve(&set.magnitudes())
            && set.margin(&unconstrained) > 0.0
        {
            let difference = (p - unconstrained).component_div(&set.magnitudes()).amax();
            require("inactive equals unconstrained", problem, &unconstrained, &p, difference, 1e-9)?;
            continue;
        }
        let excess = objective - reference.objective;
        require("no feasible point is better", problem, &reference.objective, &objective, excess, gap)?;
        // First-order optimality: downhill leads out of the set, whichever feasible point one walks towards.
        let gradient = problem.factor().transpose() * problem.residual(&p);
        for target in [reference.parameters, set.interior_point()] {
            let descent = -gradient.dot(&(target - p));
            let curvature = (problem.factor() * (target - p)).norm_squared();
            // The least value of objective − t·descent + t²·curvature/2 on the segment.
            let fraction = if curvature > 0.0 { (descent / curvature).clamp(0.0, 1.0) } else { 0.0 };
            let better = fraction * descent - 0.5 * fraction * fraction * curvature;
            require("no feasible point is better", problem, &0.0, &target, better, gap)?;
        }
        require("duality gap is small", problem, &gap, &estimate.duality_gap, estimate.duality_gap, gap)?;
        let unexplained = excess - estimate.duality_gap;
        let rounding = 1e-12 * (problem.rhs().norm_squared() + 1.0);
        require("duality gap bounds the excess", problem, &estimate.duality_gap, &excess, unexplained, rounding)?;
    }
    Ok(())
}

/// Regressor rows and outputs, divided by their standard deviations.
pub type WhitenedBlock<const ROWS: usize, const P: usize> = (SMatrix<f64, ROWS, P>, SVector<f64, ROWS>);

/// What a recursion reports after a sequence of whitened blocks: R, z and the residual sum of squares.
pub type SquareRootOf<const P: usize> = (SMatrix<f64, P, P>, SVector<f64, P>, f64);

/// Laws of a square-root recursion: `recursion` folds a sequence of whitened blocks (H, y) into (R, z, residual).
///
/// # Errors
/// The first broken law: `factor is upper triangular`, `equals batch`, `order independent`, `keeps the residual`.
pub fn check_square_root_information<const ROWS: usize, const P: usize>(
    recursion: &dyn Fn(&[WhitenedBlock<ROWS, P>]) -> SquareRootOf<P>,
    blocks: &[WhitenedBlock<ROWS, P>],
    tolerance: f64,
) -> Result<(), LawViolation> {
    let (mut gram, mut moment, mut energy) = (SMatrix::<f64, P, P>::zeros(), SVector::<f64, P>::zeros(), 0.0);
    for (block, rhs) in blocks {
        gram += block.transpose() * block;
        moment += block.transpose() * rhs;
        energy += rhs.norm_squared();
    }
    let (factor, rhs, residual) = recursion(blocks);
    let below = factor.lower_triangle() - SMatrix::from_diagonal(&factor.diagonal());
    let negative = factor.diagonal().iter().map(|d| (-d).max(0.0)).fold(0.0, f64::max);
    require("factor is upper triangular", &"blocks", &"zeros below", &factor, below.amax() + negative, 0.0)?;
    let error = (factor.transpose() * factor - gram).amax() / gram.amax().max(f64::MIN_POSITIVE);
    require("equals batch", &"information", &gram, &(factor.transpose() * factor), error, tolerance)?;
    let size = (gram.amax() * energy).sqrt().max(f64::MIN_POSITIVE);
    let error = (factor.transpose() * rhs - moment).amax() / size;
    require("equals batch", &"right-hand side", &moment, &(factor.transpose() * rhs), error, tolerance)?;
    let total = rhs.norm_squared() + residual;
    let error = (total - energy).abs() / energy.max(f64::MIN_POSITIVE);
    require("keeps the residual", &"|z|² + residual", &energy, &total, error, tolerance)?;
    let backwards: Vec<_> = blocks.iter().rev().copied().collect();
    let (reversed, reversed_rhs, _) = recursion(&backwards);
    let error = (reversed.transpose() * reversed - gram).amax() / gram.amax().max(f64::MIN_POSITIVE)
        + (reversed.transpose() * reversed_rhs - moment).amax() / size;
    require("order independent", &"blocks backwards", &factor, &reversed, error, 2.0 * tolerance)
}

fn broken_unless(holds: bool) -> f64 {
    if holds { 0.0 } else { f64::INFINITY }
}
