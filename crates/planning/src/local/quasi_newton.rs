//! What steps have taught about the curvature, on top of a model of it.

use super::problem::CondensedProblem;
use crate::vectors::{add_scaled, dot};

/// Least share of the curvature known before that a pair may leave along its step: keeps the matrix positive definite.
const LEAST_SHARE: f64 = 0.1;

/// Pairs of a step and the change of the Lagrangian's gradient along it, applied to the factorised matrix of a problem as
/// updates of Broyden, Fletcher, Goldfarb and Shanno, damped where the curvature along a step is small or negative.
///
/// # Source
/// Nocedal and Wright, Numerical Optimization, algorithms 7.4 and procedure 18.2.
#[derive(Clone, Debug)]
pub(super) struct CurvaturePairs {
    unknowns: usize,
    capacity: usize,
    count: usize,
    /// One vector per pair, each of the four.
    steps: Vec<f64>,
    changes: Vec<f64>,
    damped_changes: Vec<f64>,
    images: Vec<f64>,
    /// One number per pair, each of the three.
    change_curvatures: Vec<f64>,
    image_curvatures: Vec<f64>,
    weights: Vec<f64>,
}

impl CurvaturePairs {
    /// Room for so many pairs.
    pub(super) fn new(unknowns: usize, capacity: usize) -> Self {
        let vectors = vec![0.0; unknowns * capacity];
        let numbers = vec![0.0; capacity];
        Self {
            unknowns,
            capacity,
            count: 0,
            steps: vectors.clone(),
            changes: vectors.clone(),
            damped_changes: vectors.clone(),
            images: vectors,
            change_curvatures: numbers.clone(),
            image_curvatures: numbers.clone(),
            weights: numbers,
        }
    }

    /// Forgets all pairs.
    pub(super) fn clear(&mut self) {
        self.count = 0;
    }

    /// Keeps a pair, the oldest of too many goes.
    pub(super) fn remember(&mut self, step: &[f64], change: &[f64], most: usize) {
        let most = most.min(self.capacity);
        if most == 0 {
            return;
        }
        if self.count >= most {
            let first = (self.count + 1 - most) * self.unknowns;
            let last = self.count * self.unknowns;
            self.steps.copy_within(first..last, 0);
            self.changes.copy_within(first..last, 0);
            self.count = most - 1;
        }
        let range = self.count * self.unknowns..(self.count + 1) * self.unknowns;
        self.steps[range.clone()].copy_from_slice(step);
        self.changes[range].copy_from_slice(change);
        self.count += 1;
    }

    /// Applies the pairs to the matrix that the problem factorised last, which has `damping` times the identity in it.
    pub(super) fn build<P: CondensedProblem>(&mut self, problem: &mut P, damping: f64) {
        for pair in 0..self.count {
            let start = pair * self.unknowns;
            let range = start..start + self.unknowns;
            let (images, image) = self.images.split_at_mut(start);
            let image = &mut image[..self.unknowns];
            let step = &self.steps[range.clone()];
            problem.curvature_times(step, image);
            for earlier in 0..pair {
                let range = earlier * self.unknowns..(earlier + 1) * self.unknowns;
                let (change, earlier_image) = (&self.damped_changes[range.clone()], &images[range]);
                add_scaled(image, dot(change, step) / self.change_curvatures[earlier], change);
                add_scaled(image, -dot(earlier_image, step) / self.image_curvatures[earlier], earlier_image);
            }
            let known = dot(step, image);
            if known.is_nan() || known <= 0.0 {
                // A step too small to say anything: infinite curvatures take the pair out.
                self.image_curvatures[pair] = f64::INFINITY;
                self.change_curvatures[pair] = f64::INFINITY;
                continue;
            }
            let change = &self.changes[range.clone()];
            let learned = dot(step, change) + damping * dot(step, step);
            let share =
                if learned < LEAST_SHARE * known { (1.0 - LEAST_SHARE) * known / (known - learned) } else { 1.0 };
            let damped = &mut self.damped_changes[range];
            for (((damped, change), step), image) in damped.iter_mut().zip(change).zip(step).zip(image.iter()) {
                *damped = share * (change + damping * step) + (1.0 - share) * image;
            }
            self.image_curvatures[pair] = known;
            self.change_curvatures[pair] = share * learned + (1.0 - share) * known;
        }
    }

    /// Solves in place with the matrix built last.
    pub(super) fn solve<P: CondensedProblem>(&mut self, problem: &mut P, x: &mut [f64]) {
        for pair in (0..self.count).rev() {
            let range = pair * self.unknowns..(pair + 1) * self.unknowns;
            let weight = dot(&self.steps[range.clone()], x) / self.change_curvatures[pair];
            add_scaled(x, -weight, &self.damped_changes[range]);
            self.weights[pair] = weight;
        }
        problem.solve(x);
        for pair in 0..self.count {
            let range = pair * self.unknowns..(pair + 1) * self.unknowns;
            let weight = dot(&self.damped_changes[range.clone()], x) / self.change_curvatures[pair];
            add_scaled(x, self.weights[pair] - weight, &self.steps[range]);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::super::toy_problem::ToyProblem;
    use super::*;
    use nalgebra::{DMatrix, DVector};
    use proptest::prelude::*;

    const N: usize = 6;

    fn problem(base: &DMatrix<f64>) -> ToyProblem {
        let none = DMatrix::zeros(0, N);
        ToyProblem::quadratic(base.clone(), DVector::zeros(N), DVector::zeros(0), none)
    }

    /// The updates as they are defined, on an explicit matrix.
    fn updated(base: &DMatrix<f64>, pairs: &[(DVector<f64>, DVector<f64>)], damping: f64) -> DMatrix<f64> {
        let mut matrix = base + DMatrix::identity(N, N) * damping;
        for (step, change) in pairs {
            let image = &matrix * step;
            let (known, change) = (step.dot(&image), change + step * damping);
            let learned = step.dot(&change);
            let share = if learned < 0.1 * known { 0.9 * known / (known - learned) } else { 1.0 };
            let damped = change * share + &image * (1.0 - share);
            matrix += &damped * damped.transpose() / step.dot(&damped) - &image * image.transpose() / known;
        }
        matrix
    }

    proptest! {
        #[test]
        fn solves_with_the_matrix_of_the_definition(
            entries in prop::collection::vec(-1.0..1.0_f64, N * N),
            vectors in prop::collection::vec(prop::collection::vec(-1.0..1.0_f64, 2 * N), 0..9),
            x in prop::collection::vec(-1.0..1.0_f64, N),
            damping in prop_oneof![Just(0.0), 1e-3..10.0_f64],
        ) {
            let root = DMatrix::from_vec(N, N, entries);
            let base = &root * root.transpose() + DMatrix::identity(N, N) * 0.1;
            let all: Vec<_> = vectors
                .iter()
                .map(|v| (DVector::from_column_slice(&v[..N]), DVector::from_column_slice(&v[N..])))
                .collect();
            prop_assume!(all.iter().all(|(step, _)| step.norm() > 0.1));
            let mut pairs = CurvaturePairs::new(N, 5);
            for (step, change) in &all {
                pairs.remember(step.as_slice(), change.as_slice(), 5);
            }
            let matrix = updated(&base, &all[all.len().saturating_sub(5)..], damping);
            prop_assert!(matrix.symmetric_eigenvalues().min() > 0.0);
            let mut problem = problem(&base);
            prop_assert!(problem.linearize(&[0.0; N]) && problem.factorise(&[], damping));
            pairs.build(&mut problem, damping);
            let mut solution = x.clone();
            pairs.solve(&mut problem, &mut solution);
            let back = &matrix * DVector::from_vec(solution.clone());
            let scale = 1.0 + matrix.norm() * DVector::from_vec(solution).norm();
            prop_assert!((back - DVector::from_vec(x)).norm() < 1e-9 * scale);
        }
    }

    #[test]
    fn a_step_of_zero_teaches_nothing() {
        let base = DMatrix::identity(N, N) * 2.0;
        let mut pairs = CurvaturePairs::new(N, 3);
        pairs.remember(&[0.0; N], &[1.0; N], 3);
        let mut problem = problem(&base);
        assert!(problem.linearize(&[0.0; N]) && problem.factorise(&[], 0.0));
        pairs.build(&mut problem, 0.0);
        let mut x = [1.0; N];
        pairs.solve(&mut problem, &mut x);
        assert!(x.iter().all(|x| (x - 0.5).abs() < 1e-15));
    }

    #[test]
    fn as_many_pairs_as_unknowns_hold_a_quadratic_exactly() {
        // Conjugate steps and exact changes: after N of them the matrix is the true one.
        let truth = DMatrix::from_fn(N, N, |i, j| if i == j { 3.0 } else { 1.0 / (2.0 + i as f64 + j as f64) });
        let mut pairs = CurvaturePairs::new(N, N);
        let eigen = truth.clone().symmetric_eigen();
        for i in 0..N {
            let step = eigen.eigenvectors.column(i).into_owned();
            let change = &truth * &step;
            pairs.remember(step.as_slice(), change.as_slice(), N);
        }
        let mut problem = problem(&DMatrix::identity(N, N));
        assert!(problem.linearize(&[0.0; N]) && problem.factorise(&[], 0.0));
        pairs.build(&mut problem, 0.0);
        let mut x = [1.0, -2.0, 0.5, 3.0, 0.0, 1.0];
        let expected = truth.lu().solve(&DVector::from_column_slice(&x)).unwrap();
        pairs.solve(&mut problem, &mut x);
        assert!((DVector::from_column_slice(&x) - expected).norm() < 1e-12);
    }
}
