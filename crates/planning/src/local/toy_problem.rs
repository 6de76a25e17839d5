//! Small problems with explicit matrices, for tests.

use super::problem::CondensedProblem;
use nalgebra::{Cholesky, DMatrix, DVector, Dyn};

type Scalar = Box<dyn Fn(&[f64]) -> f64>;
type Vector = Box<dyn Fn(&[f64]) -> DVector<f64>>;
type Matrix = Box<dyn Fn(&[f64]) -> DMatrix<f64>>;
type Model = Box<dyn Fn(&[f64], &[f64]) -> DMatrix<f64>>;

/// A cost and rows as functions, with their derivatives and a model of the curvature.
pub(super) struct ToyProblem {
    pub unknowns: usize,
    pub rows: usize,
    pub cost: Scalar,
    pub gradient: Vector,
    pub row_values: Vector,
    /// One row of the matrix for each row.
    pub row_gradients: Matrix,
    /// At a point, with multipliers.
    pub model: Model,
    pub point: Point,
    pub evaluations: usize,
}

/// What is known of the current point.
pub(super) struct Point {
    z: Vec<f64>,
    cost: f64,
    gradient: DVector<f64>,
    row_values: DVector<f64>,
    row_gradients: DMatrix<f64>,
    curvature: DMatrix<f64>,
    factor: Option<Cholesky<f64, Dyn>>,
}

impl Point {
    pub(super) fn none() -> Self {
        Self {
            z: Vec::new(),
            cost: 0.0,
            gradient: DVector::zeros(0),
            row_values: DVector::zeros(0),
            row_gradients: DMatrix::zeros(0, 0),
            curvature: DMatrix::zeros(0, 0),
            factor: None,
        }
    }
}

impl ToyProblem {
    /// `1/2 z' H z + g . z` with rows `c + A z`.
    pub(super) fn quadratic(h: DMatrix<f64>, g: DVector<f64>, c: DVector<f64>, a: DMatrix<f64>) -> Self {
        let (h1, h2, g1, a1) = (h.clone(), h.clone(), g.clone(), a.clone());
        let vector = |z: &[f64]| DVector::from_column_slice(z);
        Self {
            unknowns: g.len(),
            rows: c.len(),
            cost: Box::new(move |z| 0.5 * vector(z).dot(&(&h * vector(z))) + g.dot(&vector(z))),
            gradient: Box::new(move |z| &h1 * vector(z) + &g1),
            row_values: Box::new(move |z| &c + &a * vector(z)),
            row_gradients: Box::new(move |_| a1.clone()),
            model: Box::new(move |_, _| h2.clone()),
            point: Point::none(),
            evaluations: 0,
        }
    }
}

impl CondensedProblem for ToyProblem {
    fn unknowns(&self) -> usize {
        self.unknowns
    }

    fn rows(&self) -> usize {
        self.rows
    }

    fn evaluate(&mut self, z: &[f64], rows: &mut [f64]) -> f64 {
        self.evaluations += 1;
        rows.copy_from_slice((self.row_values)(z).as_slice());
        (self.cost)(z)
    }

    fn linearize(&mut self, z: &[f64]) -> bool {
        self.point = Point {
            z: z.to_vec(),
            cost: (self.cost)(z),
            gradient: (self.gradient)(z),
            row_values: (self.row_values)(z),
            row_gradients: (self.row_gradients)(z),
            curvature: DMatrix::zeros(0, 0),
            factor: None,
        };
        self.point.cost.is_finite()
    }

    fn cost(&self) -> f64 {
        self.point.cost
    }

    fn gradient(&self) -> &[f64] {
        self.point.gradient.as_slice()
    }

    fn row_values(&self) -> &[f64] {
        self.point.row_values.as_slice()
    }

    fn rows_along(&mut self, x: &[f64], changes: &mut [f64]) {
        changes.copy_from_slice((&self.point.row_gradients * DVector::from_column_slice(x)).as_slice());
    }

    fn add_row(&mut self, row: usize, factor: f64, gradient: &mut [f64]) {
        for (gradient, entry) in gradient.iter_mut().zip(self.point.row_gradients.row(row).iter()) {
            *gradient += factor * entry;
        }
    }

    fn add_rows(&mut self, factors: &[f64], gradient: &mut [f64]) {
        for (row, factor) in factors.iter().enumerate() {
            self.add_row(row, *factor, gradient);
        }
    }

    fn factorise(&mut self, multipliers: &[f64], damping: f64) -> bool {
        let mut curvature = (self.model)(&self.point.z, multipliers);
        for i in 0..self.unknowns {
            curvature[(i, i)] += damping;
        }
        self.point.factor = Cholesky::new(curvature.clone());
        self.point.curvature = curvature;
        self.point.factor.is_some()
    }

    fn curvature_times(&mut self, x: &[f64], product: &mut [f64]) {
        product.copy_from_slice((&self.point.curvature * DVector::from_column_slice(x)).as_slice());
    }

    fn solve(&mut self, x: &mut [f64]) {
        let solution = self.point.factor.as_ref().unwrap().solve(&DVector::from_column_slice(x));
        x.copy_from_slice(solution.as_slice());
    }
}
