//! Primal-dual interior point for several 4×4 linear matrix inequalities and lower bounds, of any number.
//!
//! As [`InteriorPoint`](crate::InteriorPoint) for one body: Mehrotra's predictor-corrector with Nesterov-Todd scaling,
//! each Newton step the QR factorisation of two stacked triangles. RᵀR is never formed. The inequalities meet only in the
//! objective: one linear matrix inequality for each link.

use super::layout::BODY;
use super::link_information::LinkInformation;
use super::reflections::{Reflections, back_substitute, back_substitute_transposed, fold};
use crate::consistency::interior_point::{congruence, gram_schmidt, lower_root, relative_smallest, smat, svec};
use crate::error::IdentificationError;
use crate::jacobi::orthogonalize_columns;
use nalgebra::{DMatrix, DVector, Matrix4, Vector4};

/// Ordinary problems take ten to thirty.
const MAX_ITERATIONS: usize = 100;

/// Largest fraction of the way to the boundary that one step goes.
const STEP_FRACTION: f64 = 0.99;

/// Duality gap relative to the objective that is good enough where consistency is dear.
const RELATIVE_GAP: f64 = 1e-10;

/// The same where rounding ends the search before: errors of the dual grow while the complementarity still falls.
const ROUNDED_GAP: f64 = 1e-8;

/// A step below this fraction is stopped by rounding.
const SHORTEST_STEP: f64 = 1e-8;

/// Where the search starts: a uniform ball over [1, x, y, z], and the inverse.
const BALL: [f64; 4] = [1.0, 1.0 / 3.0, 1.0 / 3.0, 1.0 / 3.0];

/// min ½|R x − z|², R nonsingular, where svec⁻¹ of each of the first `bodies` tens of unknowns is positive semidefinite and
/// the unknowns in `bounded` are not negative; all others are free.
pub(super) struct ConeProgram {
    pub(super) information: LinkInformation,
    pub(super) bodies: usize,
    pub(super) bounded: Vec<usize>,
}

/// A minimiser strictly inside, with the proof of its quality.
pub(super) struct ConeSolution {
    pub(super) primal: DVector<f64>,
    /// Multipliers in the same coordinates; zero for free unknowns.
    pub(super) dual: DVector<f64>,
    /// Proven bound on the objective above the least.
    pub(super) duality_gap: f64,
    pub(super) iterations: usize,
}

impl ConeProgram {
    /// A point with the duality gap asked for, or one of 1e-10 of the objective; where rounding stops all progress before, the best
    /// point on the way if its gap is 1e-8 of the objective.
    pub(super) fn solve(&self, gap_tolerance: f64) -> Result<ConeSolution, IdentificationError> {
        let mut state = self.start();
        let (mut best, mut least_gap, mut reached) = (None, f64::INFINITY, 0);
        for iterations in 1..=MAX_ITERATIONS {
            reached = iterations;
            let duality_gap = self.duality_gap(&state);
            let objective = 0.5 * self.information.residual(&state.primal).norm_squared();
            let State { primal, dual } = &state;
            let solution = || ConeSolution { primal: primal.clone(), dual: dual.clone(), duality_gap, iterations };
            if duality_gap <= gap_tolerance.max(RELATIVE_GAP * objective) {
                return Ok(solution());
            }
            if duality_gap < least_gap {
                least_gap = duality_gap;
                best = (duality_gap <= ROUNDED_GAP * objective).then(solution);
            }
            if self.step(&mut state).is_none() {
                break;
            }
        }
        best.ok_or(IdentificationError::NotConverged {
            iterations: reached,
            duality_gap: least_gap,
            tolerance: gap_tolerance,
        })
    }

    /// Balls of each body's size, and the point on their central path that fits the gradient best.
    fn start(&self) -> State {
        let unknowns = self.information.unknowns();
        let (mut primal, mut inverse) = (DVector::zeros(unknowns), DVector::zeros(unknowns));
        for body in 0..self.bodies {
            let ball = Vector4::from(BALL);
            set_body(&mut primal, body, &svec(&Matrix4::from_diagonal(&ball)));
            set_body(&mut inverse, body, &svec(&Matrix4::from_diagonal(&ball.map(f64::recip))));
        }
        for &column in &self.bounded {
            primal[column] = 1.0;
            inverse[column] = 1.0;
        }
        let residual = self.information.residual(&primal);
        let image = back_substitute_transposed(self.information.factor(), inverse.clone());
        let weight = residual.dot(&image) / image.norm_squared();
        let size = residual.norm() / image.norm();
        State { primal, dual: inverse * weight.max(0.1 * size) }
    }

    /// ⟨X, Z⟩ + ½|R x − z − R⁻ᵀ Z|²: the objective minus the Lagrange dual, a bound for any Z in the dual cone.
    fn duality_gap(&self, state: &State) -> f64 {
        let image = back_substitute_transposed(self.information.factor(), state.dual.clone());
        let mismatch = self.information.residual(&state.primal) - image;
        state.primal.dot(&state.dual) + 0.5 * mismatch.norm_squared()
    }

    /// One predictor-corrector step; `None` where rounding stops all progress.
    fn step(&self, state: &mut State) -> Option<()> {
        let scalings: Vec<BodyScaling> = (0..self.bodies)
            .map(|body| BodyScaling::new(&body_of(&state.primal, body), &body_of(&state.dual, body)))
            .collect::<Option<_>>()?;
        let bounds: Vec<BoundScaling> =
            self.bounded.iter().map(|&column| BoundScaling::new(column, state)).collect::<Option<_>>()?;
        let newton = NewtonSystem::new(self, &scalings, &bounds);
        let residual = self.information.residual(&state.primal);

        let rows = BODY * self.bodies + bounds.len();
        let predictor = newton.solve(&residual, DVector::zeros(rows));
        let primal_steps: Vec<Matrix4<f64>> =
            scalings.iter().enumerate().map(|(body, scaling)| scaling.scaled(&body_of(&predictor, body))).collect();
        let dual_steps: Vec<Matrix4<f64>> =
            scalings.iter().zip(&primal_steps).map(|(scaling, primal)| -scaling.diagonal() - primal).collect();
        let mut length = 1.0_f64;
        for ((scaling, primal), dual) in scalings.iter().zip(&primal_steps).zip(&dual_steps) {
            length = length.min(scaling.longest_step(primal, dual));
        }
        for bound in &bounds {
            let primal = bound.scaled(&predictor);
            length = length.min(bound.longest_step(primal, -bound.lambda - primal));
        }
        let (mut product, mut affine) = (0.0, 0.0);
        for ((scaling, primal), dual) in scalings.iter().zip(&primal_steps).zip(&dual_steps) {
            let diagonal = scaling.diagonal();
            product += scaling.lambda.norm_squared();
            affine += (diagonal + primal * length).dot(&(diagonal + dual * length));
        }
        for bound in &bounds {
            let primal = bound.scaled(&predictor);
            product += bound.lambda * bound.lambda;
            affine += (bound.lambda + primal * length) * (bound.lambda - (bound.lambda + primal) * length);
        }
        let rank = (4 * self.bodies + bounds.len()) as f64;
        let ratio = (affine / product).clamp(0.0, 1.0);
        let target = ratio * ratio * ratio * product / rank;

        let mut rhs = DVector::zeros(rows);
        let mut complementarities = Vec::with_capacity(scalings.len());
        for (body, scaling) in scalings.iter().enumerate() {
            let complementarity = scaling.complementarity(target, &primal_steps[body], &dual_steps[body]);
            set_body(&mut rhs, body, &scaling.rhs(&complementarity));
            complementarities.push(complementarity);
        }
        let bound_complementarities: Vec<f64> =
            bounds.iter().map(|bound| bound.complementarity(target, bound.scaled(&predictor))).collect();
        for (i, (bound, complementarity)) in bounds.iter().zip(&bound_complementarities).enumerate() {
            rhs[BODY * self.bodies + i] = bound.lambda + complementarity;
        }
        let corrector = newton.solve(&residual, rhs);
        // A quadratic objective couples primal and dual: one length for both.
        let mut longest = f64::INFINITY;
        for (body, (scaling, complementarity)) in scalings.iter().zip(&mut complementarities).enumerate() {
            let primal = scaling.scaled(&body_of(&corrector, body));
            *complementarity -= primal;
            longest = longest.min(scaling.longest_step(&primal, complementarity));
        }
        for (bound, complementarity) in bounds.iter().zip(&bound_complementarities) {
            let primal = bound.scaled(&corrector);
            longest = longest.min(bound.longest_step(primal, complementarity - primal));
        }
        let length = (STEP_FRACTION * longest).min(1.0);
        for (body, (scaling, dual_step)) in scalings.iter().zip(&complementarities).enumerate() {
            let change = svec(&scaling.dual_step(dual_step)).map(|entry| length * entry);
            for (value, change) in state.dual.iter_mut().skip(BODY * body).zip(change) {
                *value += change;
            }
        }
        for (bound, complementarity) in bounds.iter().zip(&bound_complementarities) {
            state.dual[bound.column] += length * bound.weight * (complementarity - bound.scaled(&corrector));
        }
        state.primal.axpy(length, &corrector, 1.0);
        (length > SHORTEST_STEP).then_some(())
    }
}

/// svec of the primal and the dual matrices, both positive definite, and the bounded unknowns.
struct State {
    primal: DVector<f64>,
    dual: DVector<f64>,
}

/// Nesterov-Todd scaling of one body: N X Nᵀ = N⁻ᵀ Z N⁻¹ = Λ, N = rotation · root with an upper triangular root.
struct BodyScaling {
    scaling: Matrix4<f64>,
    rotation: Matrix4<f64>,
    root: Matrix4<f64>,
    lambda: Vector4<f64>,
}

impl BodyScaling {
    fn new(primal: &[f64; BODY], dual: &[f64; BODY]) -> Option<Self> {
        let (primal_root, dual_root) = (lower_root(&smat(primal))?, lower_root(&smat(dual))?);
        let mut left = dual_root.transpose() * primal_root;
        orthogonalize_columns(&mut left, None);
        let mut lambda = Vector4::zeros();
        for j in 0..4 {
            lambda[j] = left.column(j).norm();
            left.column_mut(j).scale_mut(1.0 / (lambda[j] * lambda[j].sqrt()));
        }
        let scaling = left.transpose();
        let (rotation, upper) = gram_schmidt(&scaling);
        let dual_root = dual_root.transpose();
        Some(Self { scaling: scaling * dual_root, rotation, root: upper * dual_root, lambda })
    }

    fn diagonal(&self) -> Matrix4<f64> {
        Matrix4::from_diagonal(&self.lambda)
    }

    fn scaled(&self, step: &[f64; BODY]) -> Matrix4<f64> {
        self.scaling * smat(step) * self.scaling.transpose()
    }

    /// Largest length at which both stay inside.
    fn longest_step(&self, primal: &Matrix4<f64>, dual: &Matrix4<f64>) -> f64 {
        let inverse_root = self.lambda.map(|l| 1.0 / l.sqrt());
        let smallest = relative_smallest(primal, &inverse_root).min(relative_smallest(dual, &inverse_root));
        if smallest < 0.0 { -1.0 / smallest } else { f64::INFINITY }
    }

    /// Sum of the scaled primal and dual steps that leads to the target, second order included.
    fn complementarity(&self, target: f64, primal: &Matrix4<f64>, dual: &Matrix4<f64>) -> Matrix4<f64> {
        let (product, lambda) = (primal * dual, &self.lambda);
        Matrix4::from_fn(|i, j| {
            let centre = if i == j { target - lambda[i] * lambda[i] } else { 0.0 };
            (2.0 * centre - product[(i, j)] - product[(j, i)]) / (lambda[i] + lambda[j])
        })
    }

    /// Right-hand side of this body's rows of the Newton system.
    fn rhs(&self, complementarity: &Matrix4<f64>) -> [f64; BODY] {
        svec(&(self.rotation.transpose() * (self.diagonal() + complementarity) * self.rotation))
    }

    fn dual_step(&self, scaled: &Matrix4<f64>) -> Matrix4<f64> {
        let step = self.scaling.transpose() * scaled * self.scaling;
        (step + step.transpose()) * 0.5
    }
}

/// The same for one bounded unknown: weight · x = z / weight = λ.
struct BoundScaling {
    column: usize,
    weight: f64,
    lambda: f64,
}

impl BoundScaling {
    fn new(column: usize, state: &State) -> Option<Self> {
        let (x, z) = (state.primal[column], state.dual[column]);
        (x > 0.0 && z > 0.0).then(|| Self { column, weight: (z / x).sqrt(), lambda: (x * z).sqrt() })
    }

    fn scaled(&self, step: &DVector<f64>) -> f64 {
        self.weight * step[self.column]
    }

    fn longest_step(&self, primal: f64, dual: f64) -> f64 {
        let smallest = primal.min(dual) / self.lambda;
        if smallest < 0.0 { -1.0 / smallest } else { f64::INFINITY }
    }

    /// The predictor's dual step is −λ − primal.
    fn complementarity(&self, target: f64, primal: f64) -> f64 {
        let square = self.lambda * self.lambda;
        (target - square + primal * (self.lambda + primal)) / self.lambda
    }
}

/// min |R dx + residual|² + |B dx − rhs|², B one triangular congruence for each body and one weight for each bound.
struct NewtonSystem {
    factor: DMatrix<f64>,
    reflections: Reflections,
}

impl NewtonSystem {
    fn new(program: &ConeProgram, scalings: &[BodyScaling], bounds: &[BoundScaling]) -> Self {
        let bodies = BODY * scalings.len();
        let mut rows = DMatrix::zeros(bodies + bounds.len(), program.information.unknowns());
        for (body, scaling) in scalings.iter().enumerate() {
            for (i, row) in congruence(&scaling.root).iter().enumerate() {
                for (j, entry) in row.iter().enumerate() {
                    rows[(BODY * body + i, BODY * body + j)] = *entry;
                }
            }
        }
        for (i, bound) in bounds.iter().enumerate() {
            rows[(bodies + i, bound.column)] = bound.weight;
        }
        let mut factor = program.information.factor().clone();
        let reflections = fold(&mut factor, rows);
        Self { factor, reflections }
    }

    fn solve(&self, residual: &DVector<f64>, mut rhs: DVector<f64>) -> DVector<f64> {
        let mut step = -residual;
        self.reflections.apply(&mut step, &mut rhs);
        back_substitute(&self.factor, step)
    }
}

pub(super) fn body_of(unknowns: &DVector<f64>, body: usize) -> [f64; BODY] {
    core::array::from_fn(|k| unknowns[BODY * body + k])
}

pub(super) fn set_body(unknowns: &mut DVector<f64>, body: usize, values: &[f64; BODY]) {
    for (entry, value) in unknowns.iter_mut().skip(BODY * body).zip(values) {
        *entry = *value;
    }
}
