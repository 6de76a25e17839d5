//! Primal-dual interior point for ten parameters and one 4×4 linear matrix inequality.
//!
//! Mehrotra's predictor-corrector with Nesterov-Todd scaling, fixed size throughout. The scaling is written with an
//! upper triangular root K; with the homogeneous coordinate first, the congruence X ↦ K X Kᵀ is then an upper triangular
//! 10×10 matrix in the order of the parameters, and each Newton step is the QR factorisation of two stacked triangles.
//! RᵀR is never formed.

use super::{ConstrainedEstimate, ConstrainedLeastSquares, FeasibleSet, PseudoInertiaCone, pulled_inside};
use crate::error::IdentificationError;
use crate::householder::{Reflection, sqrt};
use crate::jacobi::orthogonalize_columns;
use crate::square_root_information::SquareRootInformation;
use core::f64::consts::{FRAC_1_SQRT_2, SQRT_2};
use nalgebra::{Matrix4, SMatrix, SVector, Vector4};

/// Duality gap at which a solution is accepted, in units of ½|R p − z|², half a chi-square.
const DEFAULT_GAP: f64 = 1e-7;

/// Duality gap that must do, relative to |z|², where the absolute one is out of reach of rounding.
const RELATIVE_GAP: f64 = 1e-9;

/// Ordinary problems take five to twelve.
const MAX_ITERATIONS: usize = 60;

/// Largest fraction of the way to the boundary that one step goes.
const STEP_FRACTION: f64 = 0.99;

/// Upper triangle of a 4×4 matrix over [1, x, y, z], in the order of the parameters.
const UPPER: [(usize, usize); 10] = [(0, 0), (0, 1), (0, 2), (0, 3), (1, 1), (1, 2), (1, 3), (2, 2), (2, 3), (3, 3)];

/// The library's solver for the pseudo-inertia cone: allocation-free, a few tens of microseconds where the cone binds,
/// one microsecond where it does not.
///
/// # Source
/// Thesis (5.34)-(5.38), posed with the quadratic objective itself instead of the epigraph form (2.29).
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct InteriorPoint {
    cone: PseudoInertiaCone,
    gap_tolerance: f64,
    relative_gap: f64,
}

impl InteriorPoint {
    /// Solver over `cone` to a duality gap of 1e-7 in units of half a chi-square; where data without noise contradict every body, the
    /// objective is huge, rounding forbids that, and a gap of 1e-9 |z|² must do.
    pub fn new(cone: PseudoInertiaCone) -> Self {
        Self { cone, gap_tolerance: DEFAULT_GAP, relative_gap: RELATIVE_GAP }
    }

    /// The same with another duality gap, in units of ½|R p − z|², which nothing relaxes.
    pub fn with_gap_tolerance(cone: PseudoInertiaCone, gap_tolerance: f64) -> Self {
        Self { cone, gap_tolerance, relative_gap: 0.0 }
    }

    /// ½|R p − z|² in the unknown svec(X), where P(p) = floor + D X D and X is a matrix over [1, x, y, z].
    fn normalized_information(
        &self,
        information: &SquareRootInformation<10>,
    ) -> Result<SquareRootInformation<10>, IdentificationError> {
        let magnitudes = self.cone.magnitudes();
        let mut factor = SMatrix::<f64, 10, 10>::zeros();
        for (i, row) in information.factor_rows.iter().enumerate() {
            let column = |j: usize| row[j] * magnitudes[j];
            factor.set_row(
                i,
                &[
                    column(0),
                    column(1) * FRAC_1_SQRT_2,
                    column(2) * FRAC_1_SQRT_2,
                    column(3) * FRAC_1_SQRT_2,
                    column(7) + column(9),
                    -column(5) * FRAC_1_SQRT_2,
                    -column(6) * FRAC_1_SQRT_2,
                    column(4) + column(9),
                    -column(8) * FRAC_1_SQRT_2,
                    column(4) + column(7),
                ]
                .into(),
            );
        }
        SquareRootInformation::from_square_root(&factor, &-information.residual(&self.cone.floor_parameters()))
    }

    /// p with P(p) = floor + D X D.
    fn parameters(&self, x: &[f64; 10]) -> SVector<f64, 10> {
        let magnitudes = self.cone.magnitudes();
        let h = FRAC_1_SQRT_2;
        let normalized = [
            x[0],
            h * x[1],
            h * x[2],
            h * x[3],
            x[7] + x[9],
            -h * x[5],
            -h * x[6],
            x[4] + x[9],
            -h * x[8],
            x[4] + x[7],
        ];
        self.cone.floor_parameters() + SVector::from(normalized).component_mul(&magnitudes)
    }
}

impl ConstrainedLeastSquares<10> for InteriorPoint {
    fn solve(&self, information: &SquareRootInformation<10>) -> Result<ConstrainedEstimate<10>, IdentificationError> {
        let unconstrained = information.solve(&self.cone.magnitudes())?;
        let margin = self.cone.margin(&unconstrained);
        if margin > 0.0 {
            return Ok(ConstrainedEstimate {
                parameters: unconstrained,
                margin,
                objective: 0.0,
                duality_gap: 0.0,
                iterations: 0,
            });
        }
        let normalized = self.normalized_information(information)?;
        self.iterate(information, &normalized, self.gap_tolerance).or_else(|error| {
            let relaxed = self.relative_gap * information.rhs().norm_squared();
            if relaxed > self.gap_tolerance { self.iterate(information, &normalized, relaxed) } else { Err(error) }
        })
    }
}

impl InteriorPoint {
    /// From the outside of the cone to this duality gap.
    fn iterate(
        &self,
        information: &SquareRootInformation<10>,
        normalized: &SquareRootInformation<10>,
        tolerance: f64,
    ) -> Result<ConstrainedEstimate<10>, IdentificationError> {
        let mut state = State::start(normalized);
        let (mut duality_gap, mut reached) = (f64::INFINITY, 0);
        for iterations in 1..=MAX_ITERATIONS {
            reached = iterations;
            duality_gap = state.duality_gap(normalized);
            if duality_gap <= tolerance {
                let (parameters, margin) = pulled_inside(&self.cone, self.parameters(&state.primal));
                let objective = information.objective(&parameters);
                return Ok(ConstrainedEstimate { parameters, margin, objective, duality_gap, iterations });
            }
            if state.step(normalized).is_none() {
                break;
            }
        }
        Err(IdentificationError::NotConverged { iterations: reached, duality_gap, tolerance })
    }
}

/// svec of the primal matrix X and the dual matrix Z, both positive definite.
struct State {
    primal: [f64; 10],
    dual: Matrix4<f64>,
}

impl State {
    /// The uniform ball of the characteristic size, and the point on its central path that fits the gradient best.
    fn start(information: &SquareRootInformation<10>) -> Self {
        let third = 1.0 / 3.0;
        let ball = Matrix4::from_diagonal(&Vector4::new(1.0, third, third, third));
        let inverse = Matrix4::from_diagonal(&Vector4::new(1.0, 3.0, 3.0, 3.0));
        let primal = svec(&ball);
        let residual = information.residual(&SVector::from(primal));
        let image = SVector::from(information.back_substitute_transposed(svec(&inverse)));
        let weight = residual.dot(&image) / image.norm_squared();
        let size = sqrt(residual.norm_squared() / image.norm_squared());
        Self { primal, dual: inverse * weight.max(0.1 * size) }
    }

    /// ½|R x − z|² at the primal point minus the Lagrange dual at the dual point: ⟨X, Z⟩ + ½|R x − z − R⁻ᵀ svec Z|².
    ///
    /// A bound for any pair of positive definite matrices, feasible for the dual or not.
    fn duality_gap(&self, information: &SquareRootInformation<10>) -> f64 {
        let dual = svec(&self.dual);
        let mismatch = information.residual(&SVector::from(self.primal))
            - SVector::from(information.back_substitute_transposed(dual));
        dot(&self.primal, &dual) + 0.5 * mismatch.norm_squared()
    }

    /// One predictor-corrector step; `None` where rounding stops all progress.
    fn step(&mut self, information: &SquareRootInformation<10>) -> Option<()> {
        let primal_root = lower_root(&smat(&self.primal))?;
        let dual_root = lower_root(&self.dual)?;
        // Nesterov-Todd: with dual_rootᵀ primal_root = U Λ Vᵀ and N = Λ^-½ Uᵀ dual_rootᵀ, N X Nᵀ = N⁻ᵀ Z N⁻¹ = Λ.
        let mut left = dual_root.transpose() * primal_root;
        orthogonalize_columns(&mut left, None);
        let mut lambda = Vector4::zeros();
        for j in 0..4 {
            let square = left.column(j).norm_squared();
            lambda[j] = sqrt(square);
            left.column_mut(j).scale_mut(1.0 / (lambda[j] * sqrt(lambda[j])));
        }
        // N = (rotation · upper) · dual_rootᵀ = rotation · K with K upper triangular.
        let scaling = left.transpose();
        let (rotation, upper) = gram_schmidt(&scaling);
        let dual_root_transposed = dual_root.transpose();
        let newton = NewtonSystem::new(information, &(upper * dual_root_transposed));
        let scaling = scaling * dual_root_transposed;

        let diagonal = Matrix4::from_diagonal(&lambda);
        let residual = information.residual(&SVector::from(self.primal));
        let inverse_lambda_root = lambda.map(|l| 1.0 / sqrt(l));
        let to_scaled = |dx: &[f64; 10]| scaling * smat(dx) * scaling.transpose();
        let longest_step = |a: &Matrix4<f64>, b: &Matrix4<f64>| {
            let (a, b) = (relative_smallest(a, &inverse_lambda_root), relative_smallest(b, &inverse_lambda_root));
            let smallest = a.min(b);
            if smallest < 0.0 { -1.0 / smallest } else { f64::INFINITY }
        };

        let predictor = newton.solve(&residual, [0.0; 10]);
        let primal_step = to_scaled(&predictor);
        let dual_step = -diagonal - primal_step;
        let length = longest_step(&primal_step, &dual_step).min(1.0);
        let mu = lambda.norm_squared() / 4.0;
        let affine = (diagonal + primal_step * length).dot(&(diagonal + dual_step * length)) / 4.0;
        let ratio = (affine / mu).clamp(0.0, 1.0);
        let target = ratio * ratio * ratio * mu;

        let product = primal_step * dual_step;
        let complementarity = Matrix4::from_fn(|i, j| {
            let centre = if i == j { target - lambda[i] * lambda[i] } else { 0.0 };
            (2.0 * centre - product[(i, j)] - product[(j, i)]) / (lambda[i] + lambda[j])
        });
        let rhs = svec(&(rotation.transpose() * (diagonal + complementarity) * rotation));
        let corrector = newton.solve(&residual, rhs);
        let primal_step = to_scaled(&corrector);
        let dual_step = complementarity - primal_step;
        // A quadratic objective couples primal and dual: one length for both.
        let length = (STEP_FRACTION * longest_step(&primal_step, &dual_step)).min(1.0);
        for (x, dx) in self.primal.iter_mut().zip(corrector) {
            *x += length * dx;
        }
        let dual_step = scaling.transpose() * dual_step * scaling;
        self.dual += (dual_step + dual_step.transpose()) * (0.5 * length);
        (length > 1e-8).then_some(())
    }
}

/// min |R dx + residual|² + |B dx − rhs|², B the triangular congruence by K.
struct NewtonSystem {
    factor: [[f64; 10]; 10],
    reflections: [Option<Reflection<10>>; 10],
}

impl NewtonSystem {
    fn new(information: &SquareRootInformation<10>, k: &Matrix4<f64>) -> Self {
        let mut factor = information.factor_rows;
        let mut rows = congruence(k);
        let mut reflections = [None; 10];
        for j in 0..10 {
            let column = core::array::from_fn(|i| rows[i][j]);
            if let Some(reflection) = Reflection::new(factor[j][j], column) {
                reflection.apply_to_rows(&mut factor[j], &mut rows, j + 1);
                factor[j][j] = reflection.norm;
                for row in &mut rows {
                    row[j] = 0.0;
                }
                reflections[j] = Some(reflection);
            }
        }
        Self { factor, reflections }
    }

    fn solve(&self, residual: &SVector<f64, 10>, mut rhs: [f64; 10]) -> [f64; 10] {
        let mut step: [f64; 10] = core::array::from_fn(|i| -residual[i]);
        for (reflection, pivot) in self.reflections.iter().zip(&mut step) {
            if let Some(reflection) = reflection {
                reflection.apply(pivot, &mut rhs);
            }
        }
        for i in (0..10).rev() {
            for j in i + 1..10 {
                step[i] -= self.factor[i][j] * step[j];
            }
            step[i] /= self.factor[i][i];
        }
        step
    }
}

pub(crate) fn svec(m: &Matrix4<f64>) -> [f64; 10] {
    core::array::from_fn(|k| {
        let (i, j) = UPPER[k];
        if i == j { m[(i, j)] } else { SQRT_2 * m[(i, j)] }
    })
}

pub(crate) fn smat(v: &[f64; 10]) -> Matrix4<f64> {
    let mut m = Matrix4::zeros();
    for (&(i, j), &value) in UPPER.iter().zip(v) {
        let value = if i == j { value } else { FRAC_1_SQRT_2 * value };
        m[(i, j)] = value;
        m[(j, i)] = value;
    }
    m
}

fn dot(a: &[f64; 10], b: &[f64; 10]) -> f64 {
    a.iter().zip(b).map(|(a, b)| a * b).sum()
}

/// Rows of svec(X) ↦ svec(K X Kᵀ), upper triangular because K is.
pub(crate) fn congruence(k: &Matrix4<f64>) -> [[f64; 10]; 10] {
    let mut rows = [[0.0; 10]; 10];
    for (r, row) in rows.iter_mut().enumerate() {
        let (i, j) = UPPER[r];
        let weight = if i == j { FRAC_1_SQRT_2 } else { 1.0 };
        for (c, entry) in row.iter_mut().enumerate().skip(r) {
            let (p, q) = UPPER[c];
            *entry = if p == q {
                SQRT_2 * weight * k[(i, p)] * k[(j, p)]
            } else {
                weight * (k[(i, p)] * k[(j, q)] + k[(i, q)] * k[(j, p)])
            };
        }
    }
    rows
}

/// Lower triangular L with L Lᵀ = a; `None` unless positive definite. nalgebra's takes libm's square root, see [`sqrt`].
pub(crate) fn lower_root(a: &Matrix4<f64>) -> Option<Matrix4<f64>> {
    let mut l = Matrix4::<f64>::zeros();
    for j in 0..4 {
        let pivot = a[(j, j)] - (0..j).map(|k| l[(j, k)] * l[(j, k)]).sum::<f64>();
        if pivot.is_nan() || pivot <= 0.0 {
            return None;
        }
        let root = sqrt(pivot);
        let inverse = 1.0 / root;
        l[(j, j)] = root;
        for i in j + 1..4 {
            l[(i, j)] = (a[(i, j)] - (0..j).map(|k| l[(i, k)] * l[(j, k)]).sum::<f64>()) * inverse;
        }
    }
    Some(l)
}

/// Orthogonal and upper triangular factor of a well-conditioned matrix.
pub(crate) fn gram_schmidt(a: &Matrix4<f64>) -> (Matrix4<f64>, Matrix4<f64>) {
    let (mut q, mut r) = (*a, Matrix4::zeros());
    for j in 0..4 {
        for i in 0..j {
            r[(i, j)] = q.column(i).dot(&q.column(j));
            let projection = q.column(i) * r[(i, j)];
            let mut column = q.column_mut(j);
            column -= projection;
        }
        r[(j, j)] = sqrt(q.column(j).norm_squared());
        q.column_mut(j).scale_mut(1.0 / r[(j, j)]);
    }
    (q, r)
}

/// A lower bound, tight to a fraction of a percent, of the smallest eigenvalue of S m S with S = diag(s).
///
/// Laguerre's iteration on the characteristic polynomial, started from Samuelson's bound: it rises monotonically to the
/// smallest root, so that a step length computed from it is never too long.
pub(crate) fn relative_smallest(m: &Matrix4<f64>, s: &Vector4<f64>) -> f64 {
    let mut a = Matrix4::from_fn(|i, j| s[i] * m[(i, j)] * s[j]);
    let mean = a.trace() / 4.0;
    for i in 0..4 {
        a[(i, i)] -= mean;
    }
    let spread = sqrt(a.norm_squared());
    if spread == 0.0 {
        return mean;
    }
    a /= spread;
    let square = a * a;
    // With zero trace and unit norm: t⁴ − t²/2 − e3 t + e4.
    let e3 = square.dot(&a) / 3.0;
    let e4 = (0.5 - square.norm_squared()) / 4.0;
    let mut root = -sqrt(0.75);
    for _ in 0..8 {
        let value = ((root * root - 0.5) * root - e3) * root + e4;
        if value <= 0.0 {
            break;
        }
        let slope = ((4.0 * root * root - 1.0) * root - e3) / value;
        let curvature = slope * slope - (12.0 * root * root - 1.0) / value;
        let discriminant = (3.0 * (4.0 * curvature - slope * slope)).max(0.0);
        let rise = 4.0 / (sqrt(discriminant) - slope);
        root += rise;
        if rise < 1e-4 {
            break;
        }
    }
    mean + spread * root
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::body_scale::BodyScale;

    #[test]
    fn golden_projection_onto_the_closed_cone() {
        let p0 = SVector::from([6.047, 0.6, 0.0, 0.0, 0.0153, 0.0, 0.0, 0.0517, 0.0, 0.0919]);
        let expected = SVector::from([6.047, 0.6, 0.0, 0.0, 0.0236, 0.0, 0.0, 0.06, 0.0, 0.0836]);
        let information = SquareRootInformation::from_square_root(&SMatrix::identity(), &p0).unwrap();
        let cone = PseudoInertiaCone::with_relative_floor(BodyScale::of(&p0).unwrap(), 0.0);
        let estimate = InteriorPoint::with_gap_tolerance(cone, 1e-15).solve(&information).unwrap();
        assert!((estimate.parameters - expected).amax() < 1e-11, "{:e}", estimate.parameters - expected);
        assert!((estimate.objective - 1.5 * 0.0083 * 0.0083).abs() < 1e-11 * 2e-4, "{:e}", estimate.objective);
        assert!(estimate.margin > 0.0 && estimate.margin < 1e-10);
    }

    #[test]
    fn eigenvalue_bound_is_safe_and_tight() {
        let m = |a: f64| Matrix4::from_fn(|i, j| nalgebra::ComplexField::sin(a * (1.0 + (i * j + i + j) as f64)));
        for k in 1..200 {
            let m = m(0.37 * f64::from(k));
            let exact = m.symmetric_eigenvalues().min();
            let bound = relative_smallest(&m, &Vector4::repeat(1.0));
            assert!(bound <= exact + 1e-12 && bound > exact - 1e-3 * m.norm(), "{k}: {bound} {exact}");
        }
    }
}
