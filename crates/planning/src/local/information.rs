//! Information gathered over a plan, what it costs to lack it, and how both change with the inputs.

use super::criterion::Criterion;
use super::model::{Array2, InformativeModel, Knowledge, StepDerivatives};
use crate::error::{PlanningError, indefinite, not_negative};
use nalgebra::{Cholesky, Const, SMatrix, SVector};

/// The squaring of the smoothed largest eigenvalue: `(tr K^8)^(1/8)` is at most `P^(1/8)` times the largest.
const POWER: f64 = 8.0;
/// Pivots smaller than this, relative to the largest, are rounding.
const PIVOT: f64 = 1e-13;

/// The weighted measure of the covariance that a plan makes small.
#[derive(Clone, Debug)]
pub(super) struct InformationCost<const P: usize> {
    criterion: Criterion,
    /// Change of the weighted quantities by the coordinates: row `i` of the quantities times the root of its weight.
    weighted: SMatrix<f64, P, P>,
    is_weighted: [bool; P],
    /// Only for D: the mean weighted prior variance, which gives the logarithm the units of the cost, and the logarithm of the
    /// prior determinant, against which it is measured.
    scale: f64,
    offset: f64,
    pub prior: SMatrix<f64, P, P>,
}

/// A cost of information and its derivatives by the information matrix `M`.
#[derive(Clone, Debug)]
pub(super) struct InformationValue<const P: usize> {
    pub value: f64,
    /// `M^-1`.
    pub covariance: SMatrix<f64, P, P>,
    /// Minus the gradient: `d cost = -tr(C dM)`.
    pub gradient: SMatrix<f64, P, P>,
    /// The model of the second derivative is `curvature * tr(C dM M^-1 dM)`.
    pub curvature: f64,
}

fn inverse<const P: usize>(matrix: SMatrix<f64, P, P>) -> Option<(SMatrix<f64, P, P>, Cholesky<f64, Const<P>>)> {
    let cholesky = matrix.cholesky()?;
    Some((cholesky.inverse(), cholesky))
}

fn log_determinant<const P: usize>(cholesky: &Cholesky<f64, Const<P>>) -> f64 {
    cholesky.l_dirty().diagonal().iter().map(|pivot| 2.0 * libm::log(*pivot)).sum()
}

impl<const P: usize> InformationCost<P> {
    /// # Errors
    /// Weights that are negative or not finite; a prior that is not positive definite.
    pub fn try_new(criterion: Criterion, weights: &[f64; P], knowledge: &Knowledge<P>) -> Result<Self, PlanningError> {
        let mut weighted = knowledge.quantities;
        for (i, weight) in weights.iter().enumerate() {
            let root = f64::sqrt(not_negative("an information weight", *weight)?);
            weighted.row_mut(i).scale_mut(root);
        }
        let is_weighted = weights.map(|weight| weight > 0.0);
        let prior = knowledge.information;
        let mut cost = Self { criterion, weighted, is_weighted, scale: 1.0, offset: 0.0, prior };
        let what = "the least eigenvalue of the prior information";
        let (covariance, _) = inverse(prior).ok_or_else(|| indefinite(what, &prior))?;
        if criterion == Criterion::D && cost.matters() {
            let spread = cost.spread(&covariance);
            let what = "the least eigenvalue of the covariance of what has a weight";
            let count = is_weighted.iter().filter(|is_weighted| **is_weighted).count();
            cost.scale = spread.trace() / count as f64;
            let completed = cost.completed(spread);
            cost.offset = log_determinant(&inverse(completed).ok_or_else(|| indefinite(what, &completed))?.1);
        }
        Ok(cost)
    }

    /// False where no quantity has a weight.
    pub fn matters(&self) -> bool {
        self.is_weighted.contains(&true)
    }

    /// Covariance of the weighted quantities.
    fn spread(&self, covariance: &SMatrix<f64, P, P>) -> SMatrix<f64, P, P> {
        self.weighted * covariance * self.weighted.transpose()
    }

    /// With a one for every quantity without a weight, so that the determinant is that of the others.
    fn completed(&self, mut spread: SMatrix<f64, P, P>) -> SMatrix<f64, P, P> {
        for (i, is_weighted) in self.is_weighted.iter().enumerate() {
            if !is_weighted {
                spread[(i, i)] = 1.0;
            }
        }
        spread
    }

    /// The cost of an information matrix, the prior included; `None` where it is not positive definite.
    pub fn of(&self, information: &SMatrix<f64, P, P>) -> Option<InformationValue<P>> {
        let (covariance, _) = inverse(*information)?;
        let spread = self.spread(&covariance);
        let (value, by_spread, curvature) = match self.criterion {
            Criterion::A => (spread.trace(), SMatrix::identity(), 2.0),
            Criterion::D => {
                let (inverse, factor) = inverse(self.completed(spread))?;
                (self.scale * (log_determinant(&factor) - self.offset), inverse * self.scale, 1.0)
            }
            Criterion::E => {
                let size = spread.trace();
                if size <= 0.0 {
                    (0.0, SMatrix::zeros(), 2.0)
                } else {
                    let one = spread / size;
                    let two = one * one;
                    let four = two * two;
                    let sum = (four * four).trace();
                    let root = libm::pow(sum, 1.0 / POWER);
                    (size * root, four * two * one * (root / sum), 2.0)
                }
            }
        };
        let weighted = self.weighted * covariance;
        let mut gradient = weighted.transpose() * by_spread * weighted;
        gradient = (gradient + gradient.transpose()) * 0.5;
        Some(InformationValue { value, covariance, gradient, curvature })
    }
}

/// Number of entries of a symmetric matrix.
pub(super) const fn pairs(parameters: usize) -> usize {
    parameters * (parameters + 1) / 2
}

/// Entries `(i, j)`, `i <= j`, in the order of the columns of [`information_columns`].
pub(super) fn pair_list(parameters: usize) -> impl Iterator<Item = (usize, usize)> {
    (0..parameters).flat_map(move |i| (i..parameters).map(move |j| (i, j)))
}

/// Adds what the measurements of one node tell: `phi' W phi`.
pub(super) fn gather<const X: usize, const P: usize>(
    information: &mut SMatrix<f64, P, P>,
    measurement: &Array2<X, X>,
    sensitivity: &Array2<P, X>,
) {
    for (i, row) in sensitivity.iter().enumerate() {
        let weighted = times(measurement, row);
        for (j, other) in sensitivity.iter().enumerate().skip(i) {
            let sum: f64 = weighted.iter().zip(other).map(|(a, b)| a * b).sum();
            information[(i, j)] += sum;
            if i != j {
                information[(j, i)] += sum;
            }
        }
    }
}

fn times<const X: usize>(matrix: &Array2<X, X>, vector: &[f64; X]) -> [f64; X] {
    let mut product = [0.0; X];
    // symmetric: columns are rows
    for (row, factor) in matrix.iter().zip(vector) {
        if *factor != 0.0 {
            for (sum, entry) in product.iter_mut().zip(row) {
                *sum += factor * entry;
            }
        }
    }
    product
}

/// Workspace of [`information_columns`].
#[derive(Clone, Debug)]
pub(super) struct ColumnSweep<const X: usize> {
    /// One adjoint per pair.
    chain: Vec<[f64; X]>,
    /// One adjoint per parameter.
    adjoint: Vec<[f64; X]>,
}

impl<const X: usize> ColumnSweep<X> {
    pub fn new(parameters: usize) -> Self {
        Self { chain: vec![[0.0; X]; pairs(parameters)], adjoint: vec![[0.0; X]; parameters] }
    }
}

/// The derivative of every entry of the information matrix by the scaled inputs: columns of `N U`, one per pair of parameters.
///
/// One backward sweep with an adjoint per parameter and one per pair: an entry `phi_i' W phi_j` changes by
/// `w_j' d phi_i + w_i' d phi_j`, and `d phi` at the end of a step is `A R d phi` plus the change of `A R phi + E` with state and
/// input, `R` what measurements [retain](super::LocalSettings::retained).
///
/// # Source
/// Adjoint of thesis (6.8).
pub(super) fn information_columns<M, const X: usize, const U: usize, const P: usize>(
    derivatives: &[StepDerivatives<X, U, P>],
    sensitivities: &[Array2<P, X>],
    (measurement, retained): (&Array2<X, X>, &[f64; X]),
    limit: &[f64; U],
    sweep: &mut ColumnSweep<X>,
    columns: &mut [f64],
) where
    M: InformativeModel<X, U, P>,
{
    let steps = derivatives.len();
    sweep.chain.fill([0.0; X]);
    sweep.adjoint.fill([0.0; X]);
    for (k, step) in derivatives.iter().enumerate().rev() {
        let Some(sensitivity) = sensitivities.get(k + 1) else { return };
        for (adjoint, row) in sweep.adjoint.iter_mut().zip(sensitivity) {
            for (sum, entry) in adjoint.iter_mut().zip(times(measurement, row)) {
                *sum += entry;
            }
        }
        // pulled[i][j]: change of the weighted end of phi_i in the direction of the adjoint of j
        let mut by_state = [[[0.0; X]; P]; P];
        let mut by_input = [[[0.0; U]; P]; P];
        for i in 0..P {
            for (j, adjoint) in sweep.adjoint.iter().enumerate() {
                let (state, input) = (&mut by_state[i][j], &mut by_input[i][j]);
                for (r, factor) in adjoint.iter().enumerate() {
                    let from = &step.sensitivity_by_state[i][r];
                    for (sum, entry) in state[M::FIRST_ACTIVE..].iter_mut().zip(&from[M::FIRST_ACTIVE..]) {
                        *sum += factor * entry;
                    }
                    for (sum, entry) in input.iter_mut().zip(&step.sensitivity_by_input[i][r]) {
                        *sum += factor * entry;
                    }
                }
            }
        }
        for (pair, ((i, j), chain)) in pair_list(P).zip(&mut sweep.chain).enumerate() {
            let mut state = [0.0; X];
            let mut input = [0.0; U];
            for (sum, (a, b)) in state.iter_mut().zip(by_state[i][j].iter().zip(&by_state[j][i])) {
                *sum = a + b;
            }
            for (sum, (a, b)) in input.iter_mut().zip(by_input[i][j].iter().zip(&by_input[j][i])) {
                *sum = a + b;
            }
            let rows = chain.iter().zip(step.by_state.iter().zip(&step.by_input));
            for (factor, (by_state, by_input)) in rows.skip(M::FIRST_ACTIVE) {
                for (sum, entry) in state[M::FIRST_ACTIVE..].iter_mut().zip(&by_state[M::FIRST_ACTIVE..]) {
                    *sum += factor * entry;
                }
                for (sum, entry) in input.iter_mut().zip(by_input) {
                    *sum += factor * entry;
                }
            }
            *chain = state;
            let start = (pair * steps + k) * U;
            for ((entry, value), scale) in columns[start..start + U].iter_mut().zip(&input).zip(limit) {
                *entry = value * scale;
            }
        }
        for adjoint in &mut sweep.adjoint {
            let mut pulled = [0.0; X];
            for (factor, row) in adjoint.iter().zip(&step.by_state) {
                for (sum, entry) in pulled.iter_mut().zip(row) {
                    *sum += factor * entry;
                }
            }
            for (entry, share) in pulled.iter_mut().zip(retained) {
                *entry *= share;
            }
            *adjoint = pulled;
        }
    }
}

/// Adds the gradient of the cost: minus `tr(C dM)`.
pub(super) fn add_information_gradient<const P: usize>(
    value: &InformationValue<P>,
    columns: &[f64],
    gradient: &mut [f64],
) {
    let unknowns = gradient.len();
    for ((i, j), column) in pair_list(P).zip(columns.chunks_exact(unknowns)) {
        let factor = if i == j { -value.gradient[(i, i)] } else { -2.0 * value.gradient[(i, j)] };
        for (sum, entry) in gradient.iter_mut().zip(column) {
            *sum += factor * entry;
        }
    }
}

/// Workspace of [`arrow_columns`].
#[derive(Clone, Debug)]
pub(super) struct ArrowFactor {
    lower: Vec<f64>,
}

impl ArrowFactor {
    pub fn new(parameters: usize) -> Self {
        Self { lower: vec![0.0; pairs(parameters) * pairs(parameters)] }
    }

    /// The columns whose squares are the positive part of the cost's curvature: `V D V' = (V L)(V L)'` with
    /// `D_ab = curvature * tr(C E_a M^-1 E_b)`, appended to `arrow`.
    pub fn append<const P: usize>(
        &mut self,
        value: &InformationValue<P>,
        columns: &[f64],
        unknowns: usize,
        arrow: &mut Vec<f64>,
    ) {
        let size = pairs(P);
        let (c, p) = (&value.gradient, &value.covariance);
        let lower = &mut self.lower;
        for (a, (i, j)) in pair_list(P).enumerate() {
            for (b, (k, l)) in pair_list(P).enumerate().take(a + 1) {
                // tr(C E_a P E_b), E symmetric units, symmetrised in a and b
                let mut sum = c[(l, i)] * p[(j, k)] + p[(l, i)] * c[(j, k)];
                if i != j {
                    sum += c[(l, j)] * p[(i, k)] + p[(l, j)] * c[(i, k)];
                }
                if k != l {
                    sum += c[(k, i)] * p[(j, l)] + p[(k, i)] * c[(j, l)];
                    if i != j {
                        sum += c[(k, j)] * p[(i, l)] + p[(k, j)] * c[(i, l)];
                    }
                }
                lower[a * size + b] = 0.5 * value.curvature * sum;
            }
        }
        factorise_semidefinite(lower, size);
        let start = arrow.len();
        arrow.resize(start + size * unknowns, 0.0);
        for (b, sums) in arrow[start..].chunks_exact_mut(unknowns).enumerate() {
            for (a, column) in columns.chunks_exact(unknowns).enumerate().skip(b) {
                let factor = lower[a * size + b];
                if factor != 0.0 {
                    for (sum, entry) in sums.iter_mut().zip(column) {
                        *sum += factor * entry;
                    }
                }
            }
        }
    }
}

/// Cholesky factor of a positive semidefinite matrix, in place, lower triangle row by row; columns of vanishing pivots are zero.
fn factorise_semidefinite(lower: &mut [f64], size: usize) {
    let largest = (0..size).map(|i| lower[i * size + i]).fold(0.0, f64::max);
    for j in 0..size {
        for i in j..size {
            let mut sum = lower[i * size + j];
            for k in 0..j {
                sum -= lower[i * size + k] * lower[j * size + k];
            }
            lower[i * size + j] = sum;
        }
        let pivot = lower[j * size + j];
        let scale = if pivot > PIVOT * largest { 1.0 / f64::sqrt(pivot) } else { 0.0 };
        for i in j..size {
            lower[i * size + j] *= scale;
        }
    }
}

/// Directions about which a plan tells next to nothing: unit vectors in prior standard deviations of the quantities, with the
/// ratio of predicted to prior standard deviation along each.
pub(super) fn unobservable<const P: usize>(
    knowledge: &Knowledge<P>,
    gathered: &SMatrix<f64, P, P>,
    threshold: f64,
) -> Vec<([f64; P], f64)> {
    let Some(factor) = knowledge.information.cholesky() else { return Vec::new() };
    let root = factor.l();
    let Some(inverse_root) = root.try_inverse() else { return Vec::new() };
    let whitened = inverse_root * gathered * inverse_root.transpose();
    let whitened = nalgebra::DMatrix::from_fn(P, P, |i, j| 0.5 * (whitened[(i, j)] + whitened[(j, i)]));
    let eigen = whitened.symmetric_eigen();
    let prior = factor.inverse();
    let spread = knowledge.quantities * prior * knowledge.quantities.transpose();
    let mut directions: Vec<([f64; P], f64)> = Vec::new();
    for (index, value) in eigen.eigenvalues.iter().enumerate() {
        let ratio = 1.0 / f64::sqrt(1.0 + value.max(0.0));
        if ratio >= threshold {
            let vector = SVector::<f64, P>::from_fn(|i, _| eigen.eigenvectors[(i, index)]);
            let change = knowledge.quantities * (inverse_root.transpose() * vector);
            let mut direction: [f64; P] =
                core::array::from_fn(|i| change[i] / f64::sqrt(spread[(i, i)].max(f64::MIN_POSITIVE)));
            let length = f64::sqrt(direction.iter().map(|x| x * x).sum());
            direction = direction.map(|x| x / length.max(f64::MIN_POSITIVE));
            directions.push((direction, ratio));
        }
    }
    directions.sort_by(|a, b| b.1.total_cmp(&a.1));
    directions
}

#[cfg(test)]
mod tests {
    use super::*;

    const P: usize = 4;
    type Matrix = SMatrix<f64, P, P>;

    /// Numbers without structure.
    fn number(seed: usize) -> f64 {
        libm::sin(1.0 + (12.9898 + 0.37 * seed as f64) * seed as f64)
    }

    fn matrix(seed: usize) -> Matrix {
        Matrix::from_fn(|i, j| number(seed + P * i + j))
    }

    fn information(seed: usize) -> Matrix {
        let root = matrix(seed);
        root * root.transpose() + Matrix::identity() * 0.5
    }

    fn knowledge() -> Knowledge<P> {
        Knowledge { information: information(50), quantities: matrix(80), names: ["a", "b", "c", "d"], units: [""; P] }
    }

    fn cost(criterion: Criterion, weights: [f64; P]) -> InformationCost<P> {
        InformationCost::try_new(criterion, &weights, &knowledge()).unwrap()
    }

    const WEIGHTS: [f64; P] = [2.0, 0.7, 0.0, 5.0];

    #[test]
    fn gradients_are_those_of_the_values() {
        for criterion in [Criterion::A, Criterion::D, Criterion::E] {
            let cost = cost(criterion, WEIGHTS);
            for seed in 0..5 {
                let at = information(100 * seed);
                let direction = matrix(7 + seed) + matrix(7 + seed).transpose();
                let value = |step: f64| cost.of(&(at + direction * step)).unwrap().value;
                let slope = |step: f64| (value(step) - value(-step)) / (2.0 * step);
                let extrapolated = (4.0 * slope(5e-4) - slope(1e-3)) / 3.0;
                let gradient = -(cost.of(&at).unwrap().gradient * direction).trace();
                assert!(
                    (gradient - extrapolated).abs() < 1e-8 * (1.0 + gradient.abs()),
                    "{criterion:?} {gradient} {extrapolated}"
                );
            }
        }
    }

    /// For A the model of the second derivative is the second derivative.
    #[test]
    fn the_curvature_of_a_is_exact() {
        let cost = cost(Criterion::A, WEIGHTS);
        let (at, direction) = (information(3), matrix(9) + matrix(9).transpose());
        let value = |step: f64| cost.of(&(at + direction * step)).unwrap().value;
        let h = 2e-3;
        let second = (-value(2.0 * h) + 16.0 * value(h) - 30.0 * value(0.0) + 16.0 * value(-h) - value(-2.0 * h))
            / (12.0 * h * h);
        let InformationValue { covariance, gradient, curvature, .. } = cost.of(&at).unwrap();
        let model = curvature * (gradient * direction * covariance * direction).trace();
        assert!((second - model).abs() < 1e-6 * model, "{second} {model}");
    }

    #[test]
    fn d_is_the_logarithm_of_what_has_weight() {
        let cost = cost(Criterion::D, [1.0, 0.0, 0.0, 4.0]);
        let spread = |information: &Matrix| {
            let quantities = knowledge().quantities;
            let all = quantities * information.try_inverse().unwrap() * quantities.transpose();
            all[(0, 0)] * all[(3, 3)] - all[(0, 3)] * all[(3, 0)]
        };
        let at = information(11);
        let expected = libm::log(spread(&at) / spread(&knowledge().information)) * cost.scale;
        assert!((cost.of(&at).unwrap().value - expected).abs() < 1e-12);
        assert!(cost.of(&knowledge().information).unwrap().value.abs() < 1e-12);
    }

    #[test]
    fn e_is_near_the_largest_eigenvalue() {
        let (cost, at) = (cost(Criterion::E, WEIGHTS), information(21));
        let spread = cost.spread(&at.try_inverse().unwrap());
        let largest = nalgebra::DMatrix::from_fn(P, P, |i, j| spread[(i, j)]).symmetric_eigenvalues().max();
        let value = cost.of(&at).unwrap().value;
        assert!(
            value >= largest * (1.0 - 1e-12) && value <= largest * libm::pow(4.0, 1.0 / POWER),
            "{value} {largest}"
        );
    }

    /// `V L` squared is `V D V'`: for any direction of the inputs, the second derivative of the cost's model.
    #[test]
    fn arrows_are_the_curvature_of_the_information() {
        const UNKNOWNS: usize = 7;
        for criterion in [Criterion::A, Criterion::D] {
            let value = cost(criterion, WEIGHTS).of(&information(31)).unwrap();
            let columns: Vec<f64> = (0..pairs(P) * UNKNOWNS).map(number).collect();
            let mut arrow = Vec::new();
            ArrowFactor::new(P).append(&value, &columns, UNKNOWNS, &mut arrow);
            let x: Vec<f64> = (0..UNKNOWNS).map(|i| number(1000 + i)).collect();
            let mut change = Matrix::zeros();
            for ((i, j), column) in pair_list(P).zip(columns.chunks_exact(UNKNOWNS)) {
                let along: f64 = column.iter().zip(&x).map(|(a, b)| a * b).sum();
                (change[(i, j)], change[(j, i)]) = (along, along);
            }
            let expected = value.curvature * (value.gradient * change * value.covariance * change).trace();
            let squares =
                arrow.chunks_exact(UNKNOWNS).map(|column| column.iter().zip(&x).map(|(a, b)| a * b).sum::<f64>());
            let model: f64 = squares.map(|along| along * along).sum();
            assert!((model - expected).abs() < 1e-10 * expected, "{criterion:?} {model} {expected}");
        }
    }

    #[test]
    fn what_nothing_is_told_about_is_found() {
        let mut knowledge = knowledge();
        (knowledge.information, knowledge.quantities) = (Matrix::identity(), Matrix::identity() * 3.0);
        let told = SVector::<f64, P>::new(1.0, 1.0, 0.0, 0.0);
        let gathered =
            told * told.transpose() * 50.0 + Matrix::from_diagonal(&SVector::<f64, P>::new(0.0, 0.0, 9.0, 0.0));
        let directions = unobservable(&knowledge, &gathered, 0.99);
        assert_eq!(directions.len(), 2);
        for (direction, ratio) in directions {
            assert!((ratio - 1.0).abs() < 1e-12);
            assert!((direction[0] + direction[1]).abs() < 1e-12 && direction[2].abs() < 1e-12);
        }
    }

    #[test]
    fn weights_that_are_none_are_refused() {
        for weight in [-1.0, f64::NAN, f64::INFINITY] {
            assert!(InformationCost::<P>::try_new(Criterion::A, &[weight, 0.0, 0.0, 0.0], &knowledge()).is_err());
        }
        assert!(!cost(Criterion::A, [0.0; P]).matters());
    }
}
