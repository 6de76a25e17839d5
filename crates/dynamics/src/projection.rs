//! The nearest body that exists (`f64`: a decision).

use crate::error::DynamicsError;
use crate::inertia::{InertialParameters, from_pseudo_inertia, pseudo_inertia};
use crate::parameter_vector::PARAMETERS;
use tumble_lie::nalgebra::{Cholesky, Const, Matrix4, SMatrix, SVector};

type Vector10 = SVector<f64, PARAMETERS>;

/// Bound on the iterations; ten to twenty are usual.
const MAX_ITERATIONS: u32 = 60;

impl InertialParameters<f64> {
    /// The nearest consistent body in the Euclidean norm of the ten numbers; itself where it is consistent.
    ///
    /// To keep away from the boundary, project what lies around a core (say a small sphere) that the body must at
    /// least contain: `(estimate - core).nearest_consistent()? + core`.
    ///
    /// Minimises `1/2 |p - p0|^2` subject to `P(p) >= 0` by a primal-dual interior-point method on the ten parameters;
    /// the optimality conditions are `p = p0 + A*(Z)`, `P(p) Z = 0`, `P(p), Z >= 0`. The answer lies on the boundary to
    /// rounding, from inside; its distance is the least to 1e-10 of the largest of the ten numbers
    /// (the numbers themselves are usually exact to 1e-10, to 1e-6 where the distance hardly depends on them).
    /// # Errors
    /// [`DynamicsError::NotFinite`]; [`DynamicsError::ProjectionNotConverged`] where rounding stops the iteration
    /// before that.
    /// # Source
    /// Thesis (5.35) as a set.
    pub fn nearest_consistent(&self) -> Result<Self, DynamicsError> {
        if self.consistency_margin().is_nan() {
            return Err(DynamicsError::NotFinite);
        }
        let target = self.to_vector();
        let size = target.amax();
        let symmetric = Self::from_vector(&target);
        if symmetric.is_consistent() {
            return Ok(symmetric);
        }
        project(&(target / size)).map(|nearest| Self::from_vector(&(nearest * size)))
    }
}

fn image(p: &Vector10) -> Matrix4<f64> {
    pseudo_inertia(&InertialParameters::from_vector(p))
}

/// Adjoint of the linear map from parameters to pseudo-inertia: `<A*(z), p> = tr(z P(p))`, `z` symmetric.
fn adjoint(z: &Matrix4<f64>) -> Vector10 {
    let half_trace = 0.5 * (z.m11 + z.m22 + z.m33);
    SVector::from([
        z.m44,
        2.0 * z.m14,
        2.0 * z.m24,
        2.0 * z.m34,
        half_trace - z.m11,
        -2.0 * z.m12,
        -2.0 * z.m13,
        half_trace - z.m22,
        -2.0 * z.m23,
        half_trace - z.m33,
    ])
}

fn symmetric(m: &Matrix4<f64>) -> Matrix4<f64> {
    (m + m.transpose()) * 0.5
}

/// Largest step in (0, 1] that keeps `factor factor^T + step * direction` positive definite, with a margin.
fn largest_step(factor: &Cholesky<f64, Const<4>>, direction: &Matrix4<f64>) -> f64 {
    let l = factor.l_dirty();
    let (mut half, mut least) = (*direction, 0.0);
    if l.solve_lower_triangular_mut(&mut half) {
        let mut whole = half.transpose();
        if l.solve_lower_triangular_mut(&mut whole) {
            least = symmetric(&whole).symmetric_eigenvalues().min();
        }
    }
    if least < -0.995 { -0.995 / least } else { 1.0 }
}

/// Duality gap and infeasibility at which the answer is as exact as its numbers, and at which it is good enough where
/// rounding stops the iteration first. Both relative to the largest of the ten numbers.
const ACCURACY: (f64, f64) = (2e-13, 1e-9);

/// `target` has largest entry one.
fn project(target: &Vector10) -> Result<Vector10, DynamicsError> {
    // start: the given matrix with its eigenvalues lifted well inside
    let eigen = image(target).symmetric_eigen();
    let lifted = eigen.eigenvalues.map(|value| value.abs().max(0.1));
    let start = eigen.eigenvectors * Matrix4::from_diagonal(&lifted) * eigen.eigenvectors.transpose();
    let mut p = from_pseudo_inertia(&start).to_vector();
    let mut z = Matrix4::<f64>::identity();
    let mut best = (p, f64::INFINITY);
    let mut iterations = 0;
    while iterations < MAX_ITERATIONS && best.1 > ACCURACY.0 {
        let s = image(&p);
        let (Some(s_factor), Some(z_factor)) = (s.cholesky(), z.cholesky()) else { break };
        let residual = target + adjoint(&z) - p;
        let gap = ((s * z).trace() / z.norm()).max(residual.amax());
        if gap < best.1 {
            best = (p, gap);
        }
        let s_inverse = s_factor.inverse();
        let mut system = SMatrix::<f64, PARAMETERS, PARAMETERS>::identity();
        for j in 0..PARAMETERS {
            let mut unit = Vector10::zeros();
            unit[j] = 1.0;
            let column = adjoint(&symmetric(&(z * image(&unit) * s_inverse)));
            system.set_column(j, &(column + unit));
        }
        let Some(system) = ((system + system.transpose()) * 0.5).cholesky() else { break };
        let mu = (s * z).trace() / 4.0;
        // Z changes by mu_target S^-1 - Z - Z dS S^-1 - correction S^-1; the correction is the second-order term dZ dS
        let direction = |mu_target: f64, correction: &Matrix4<f64>| {
            let z_change = s_inverse * mu_target - z - symmetric(&(correction * s_inverse));
            let p_step = system.solve(&(residual + adjoint(&z_change)));
            let s_step = image(&p_step);
            (p_step, s_step, z_change - symmetric(&(z * s_step * s_inverse)))
        };
        let (_, s_step, z_step) = direction(0.0, &Matrix4::zeros());
        let (alpha_s, alpha_z) = (largest_step(&s_factor, &s_step), largest_step(&z_factor, &z_step));
        let mu_after = ((s + s_step * alpha_s) * (z + z_step * alpha_z)).trace() / 4.0;
        let ratio = (mu_after / mu).clamp(0.0, 1.0);
        // not faster, so that P and Z stay central, nor further, where the smallest eigenvalue of P would be rounding
        let mu_target = (mu * (ratio * ratio * ratio).max(0.05)).max(1e-14 * z.norm());
        let (p_step, s_step, z_step) = direction(mu_target, &(z_step * s_step));
        // one step length for both, or p = p0 + A*(Z) would be lost again
        let alpha = largest_step(&s_factor, &s_step).min(largest_step(&z_factor, &z_step));
        p += p_step * alpha;
        z = symmetric(&(z + z_step * alpha));
        iterations += 1;
    }
    let (nearest, gap) = best;
    if gap <= ACCURACY.1 { Ok(nearest) } else { Err(DynamicsError::ProjectionNotConverged { gap, iterations }) }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn golden_projection() {
        let p0 = SVector::from([6.047, 0.6, 0.0, 0.0, 0.0153, 0.0, 0.0, 0.0517, 0.0, 0.0919]);
        let golden = SVector::from([6.047, 0.6, 0.0, 0.0, 0.0236, 0.0, 0.0, 0.06, 0.0, 0.0836]);
        let nearest = InertialParameters::from_vector(&p0).nearest_consistent().unwrap();
        let error = (nearest.to_vector() - golden).amax();
        assert!(error < 1e-11, "{error:e}");
        assert!(((nearest.to_vector() - p0).norm_squared() - 3.0 * 0.0083 * 0.0083).abs() < 1e-13);
        assert!(pseudo_inertia(&nearest).symmetric_eigenvalues().min().abs() < 1e-11);
        assert!(nearest.is_consistent());
    }

    #[test]
    fn the_adjoint_is_the_adjoint() {
        let p = Vector10::from_fn(|i, _| (1.3 * i as f64).sin());
        let z = symmetric(&Matrix4::from_fn(|i, j| ((3 * i + 5 * j) as f64).cos()));
        assert!((adjoint(&z).dot(&p) - (z * image(&p)).trace()).abs() < 1e-14);
    }
}
