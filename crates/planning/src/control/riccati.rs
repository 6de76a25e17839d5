//! The linear-quadratic regulator of a system whose size is a type.

use super::small_matrix::{cholesky, solve, spectral_radius};
use crate::error::{PlanningError, finite, indefinite};
use nalgebra::SMatrix;

/// Doublings before giving up: what is not done after the matrix to the power of `2^64` never will be.
const DOUBLINGS: usize = 64;

/// Share of itself by which the cost matrix may still change at the end.
const SETTLED: f64 = 1e-15;

/// Gain `K` of the feedback `u = K x` that minimises the sum of `x'Qx + u'Ru` along `x⁺ = A x + B u`, and the matrix `P` of the
/// least cost `x'Px`.
///
/// By doubling: each iterate is the cost over twice as many steps as the one before.
///
/// # Errors
/// [`PlanningError::NotFinite`]; [`PlanningError::Asymmetric`] weights; [`PlanningError::NotPositive`] where the weight of the input
/// is not positive definite; [`PlanningError::NotContractive`] where no feedback stabilises what can be seen in the cost.
///
/// # Source
/// Chu, Fan, Lin, Wang: Structure-preserving algorithms for periodic discrete-time algebraic Riccati equations, 2004.
pub fn discrete_lqr<const N: usize, const M: usize>(
    a: &SMatrix<f64, N, N>,
    b: &SMatrix<f64, N, M>,
    state_weight: &SMatrix<f64, N, N>,
    input_weight: &SMatrix<f64, M, M>,
) -> Result<(SMatrix<f64, M, N>, SMatrix<f64, N, N>), PlanningError> {
    for number in a.iter().chain(b.iter()).chain(state_weight.iter()).chain(input_weight.iter()) {
        finite("a number of a linear-quadratic problem", *number)?;
    }
    symmetric("the weight of the state", state_weight)?;
    symmetric("the weight of the input", input_weight)?;
    let what = "the least eigenvalue of the weight of the input";
    let not_positive = || indefinite(what, input_weight);
    cholesky(input_weight).ok_or_else(not_positive)?;
    let by_input = solve(*input_weight, b.transpose()).ok_or_else(not_positive)?;
    let unstable = |radius: f64| PlanningError::NotContractive { spectral_radius: radius };

    let (mut step, mut reach, mut cost) = (*a, halved(&(b * by_input)), *state_weight);
    let mut is_settled = false;
    for _ in 0..DOUBLINGS {
        let coupled = SMatrix::<f64, N, N>::identity() + reach * cost;
        let by_step = solve(coupled, step).ok_or_else(|| unstable(f64::INFINITY))?;
        let by_reach = solve(coupled, reach * step.transpose()).ok_or_else(|| unstable(f64::INFINITY))?;
        let added = halved(&(step.transpose() * cost * by_step));
        reach += halved(&(step * by_reach));
        cost += added;
        step *= by_step;
        is_settled = added.amax() <= SETTLED * cost.amax();
        if is_settled {
            break;
        }
    }
    let by_next = b.transpose() * cost;
    let gain = -solve(input_weight + by_next * b, by_next * a).ok_or_else(|| unstable(f64::INFINITY))?;
    let radius = spectral_radius(&(a + b * gain));
    if is_settled && radius < 1.0 { Ok((gain, cost)) } else { Err(unstable(radius)) }
}

/// The symmetric part.
fn halved<const N: usize>(matrix: &SMatrix<f64, N, N>) -> SMatrix<f64, N, N> {
    (matrix + matrix.transpose()) * 0.5
}

fn symmetric<const N: usize>(what: &'static str, matrix: &SMatrix<f64, N, N>) -> Result<(), PlanningError> {
    let is_symmetric = (matrix - matrix.transpose()).amax() <= 1e-12 * matrix.amax();
    if is_symmetric { Ok(()) } else { Err(PlanningError::Asymmetric { what }) }
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::{Matrix1, Matrix2, Matrix3, Matrix6, Matrix6x3, Vector2, Vector6};

    #[test]
    fn a_scalar_by_hand() {
        // p = 1 + p - p^2 / (1 + p): the golden section
        let one = Matrix1::new(1.0);
        let (gain, cost) = discrete_lqr(&one, &one, &one, &one).unwrap();
        let golden = f64::midpoint(1.0, f64::sqrt(5.0));
        assert!((cost.x - golden).abs() < 1e-15 && (gain.x + golden / (1.0 + golden)).abs() < 1e-15);
    }

    #[test]
    fn the_gain_of_a_body_of_9_58_kg_at_one_second_and_at_a_fifth() {
        // three decoupled axes at 0.2 s: the gain of SciPy's solver
        let (mass_kg, step_s) = (9.5838, 0.2);
        let identity = Matrix3::identity();
        let mut a = Matrix6::identity();
        a.fixed_view_mut::<3, 3>(0, 3).copy_from(&(identity * step_s));
        let mut b = Matrix6x3::zeros();
        b.fixed_view_mut::<3, 3>(0, 0).copy_from(&(identity * (0.5 * step_s * step_s / mass_kg)));
        b.fixed_view_mut::<3, 3>(3, 0).copy_from(&(identity * (step_s / mass_kg)));
        let weight = Matrix6::from_diagonal(&Vector6::new(10.0, 10.0, 10.0, 1.0, 1.0, 1.0));
        let (gain, cost) = discrete_lqr(&a, &b, &weight, &identity).unwrap();
        assert!((gain[(0, 0)] + 2.91367).abs() < 5e-6 && (gain[(0, 3)] + 7.52974).abs() < 5e-6, "{gain}");
        assert!(gain[(0, 1)].abs() < 1e-13 && (gain[(2, 5)] - gain[(0, 3)]).abs() < 1e-13);
        // the Riccati equation itself
        let closed = a + b * gain;
        let residual = closed.transpose() * cost * closed + weight + gain.transpose() * gain - cost;
        assert!(residual.amax() < 1e-11 * cost.amax(), "{}", residual.amax());
    }

    #[test]
    fn the_cost_is_that_of_the_recursion_and_no_other_gain_is_cheaper() {
        let a = Matrix2::new(1.0, 1.0, 0.0, 1.0);
        let b = Vector2::new(0.5, 1.0) / 9.58;
        let (weight, input) = (Matrix2::from_diagonal(&Vector2::new(5.0, 10.0)), Matrix1::new(2.0));
        let (gain, cost) = discrete_lqr(&a, &b, &weight, &input).unwrap();
        let mut recursion = weight;
        for _ in 0..400 {
            let through = a.transpose() * recursion * b;
            let least = (input + b.transpose() * recursion * b).x;
            recursion = weight + a.transpose() * recursion * a - through * through.transpose() / least;
        }
        assert!((recursion - cost).amax() < 1e-11 * cost.amax());
        let cost_with = |gain: nalgebra::RowVector2<f64>| {
            let (mut state, mut sum) = (Vector2::new(1.0, -0.3), 0.0);
            for _ in 0..2000 {
                let u = gain * state;
                sum += state.dot(&(weight * state)) + (input * u.x * u.x).x;
                state = a * state + b * u.x;
            }
            sum
        };
        let least = cost_with(gain);
        assert!((least - Vector2::new(1.0, -0.3).dot(&(cost * Vector2::new(1.0, -0.3)))).abs() < 1e-10 * least);
        for change in [Vector2::new(0.01, 0.0), Vector2::new(0.0, 0.01)] {
            assert!(cost_with(gain + change.transpose()) > least && cost_with(gain - change.transpose()) > least);
        }
    }

    #[test]
    fn what_cannot_be_stabilised_or_weighed_is_refused() {
        let identity = Matrix2::identity();
        let (runaway, deaf) = (Matrix2::new(1.2, 0.0, 0.0, 0.5), Vector2::new(0.0, 1.0));
        let outcome = discrete_lqr(&runaway, &deaf, &identity, &Matrix1::new(1.0));
        assert!(matches!(outcome, Err(PlanningError::NotContractive { .. })), "{outcome:?}");
        let integrator = Matrix2::new(1.0, 1.0, 0.0, 1.0);
        let b = Vector2::new(0.5, 1.0);
        let unseen = discrete_lqr(&integrator, &b, &Matrix2::zeros(), &Matrix1::new(1.0));
        assert!(matches!(unseen, Err(PlanningError::NotContractive { .. })), "{unseen:?}");
        let free = discrete_lqr(&integrator, &b, &identity, &Matrix1::new(0.0));
        assert!(matches!(free, Err(PlanningError::NotPositive { .. })));
        let skew = discrete_lqr(&integrator, &b, &Matrix2::new(1.0, 0.1, 0.0, 1.0), &Matrix1::new(1.0));
        assert!(matches!(skew, Err(PlanningError::Asymmetric { .. })));
        assert!(discrete_lqr(&integrator, &b, &identity, &Matrix1::new(f64::NAN)).is_err());
    }
}
