//! Solving with the curvature of a plan.

mod arrow;
mod cholesky;
mod dense;
mod riccati;
#[allow(clippy::needless_range_loop, reason = "triangles are read by rows and by columns")]
pub(super) mod small;

use super::stages::Stages;
use dense::Dense;
use riccati::Riccati;
use small::{dot, matrix_times, sum, transpose_times};

/// Which factorisation solves.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Default)]
#[non_exhaustive]
pub enum Factorisation {
    /// Stage by stage, linear in the length of the horizon.
    #[default]
    Riccati,
    /// One dense matrix of all inputs.
    Dense,
}

#[derive(Clone, Debug)]
enum Route<const X: usize, const U: usize> {
    Riccati(Riccati<X, U>),
    Dense(Dense<X, U>),
}

/// The factorised curvature `H + damping I` of [`Stages`].
///
/// Stages whose parts differ in length have no curvature: nothing is factorised, multiplied or solved.
#[derive(Clone, Debug)]
pub struct Curvature<const X: usize, const U: usize> {
    route: Route<X, U>,
    damping: f64,
    factorised: bool,
    /// Curvature times change of each node but the first.
    costs: Vec<[f64; X]>,
}

impl<const X: usize, const U: usize> Curvature<X, U> {
    /// Room for a horizon of `steps` and up to `columns` columns; more of either allocates once.
    pub fn new(factorisation: Factorisation, steps: usize, columns: usize) -> Self {
        let route = match factorisation {
            Factorisation::Riccati => Route::Riccati(Riccati::new(steps, columns)),
            Factorisation::Dense => Route::Dense(Dense::new(steps)),
        };
        Self { route, damping: 0.0, factorised: false, costs: Vec::with_capacity(steps) }
    }

    /// Factorises; false where the matrix is not positive definite or not finite. [`Factorisation::Riccati`] refuses also what
    /// the columns alone make positive definite.
    pub fn factorise(&mut self, stages: &Stages<X, U>, damping: f64) -> bool {
        self.damping = damping;
        self.factorised = stages.is_consistent()
            && match &mut self.route {
                Route::Riccati(riccati) => riccati.factorise(stages, damping),
                Route::Dense(dense) => dense.factorise(stages, damping),
            };
        self.factorised
    }

    /// `product = (H + damping I) x` with the damping of the last factorisation, by a sweep forward and one back: it owes
    /// nothing to the factors, so that what [`Curvature::solve`] leaves over can be measured.
    pub fn times(&mut self, stages: &Stages<X, U>, x: &[f64], product: &mut [f64]) {
        let (inputs, _) = x.as_chunks::<U>();
        let (products, _) = product.as_chunks_mut::<U>();
        if !stages.is_consistent() || inputs.len() != stages.by_input.len() || products.len() != inputs.len() {
            return;
        }
        self.costs.clear();
        let mut change = [0.0; X];
        let motion = stages.by_state.iter().zip(&stages.by_input).zip(&stages.state_curvature);
        for (((by_state, by_input), curvature), input) in motion.zip(inputs) {
            change = sum(&matrix_times(by_state, &change), &matrix_times(by_input, input));
            // Symmetric: along its rows, which needs no sums across.
            self.costs.push(transpose_times(curvature, &change));
        }
        let mut costate = [0.0; X];
        let motion = stages.by_state.iter().zip(&stages.by_input).zip(&stages.input_curvature);
        let backward = motion.zip(&self.costs).zip(inputs).zip(products).rev();
        for (((((by_state, by_input), curvature), cost), input), product) in backward {
            costate = sum(&costate, cost);
            *product = sum(&transpose_times(by_input, &costate), &transpose_times(curvature, input));
            product.iter_mut().zip(input).for_each(|(product, input)| *product += self.damping * input);
            costate = transpose_times(by_state, &costate);
        }
        for column in stages.arrow_columns() {
            let along = dot(column, x);
            product.iter_mut().zip(column).for_each(|(product, entry)| *product += along * entry);
        }
    }

    /// Solves in place with the matrix factorised last, from these stages; without one `x` stays.
    pub fn solve(&mut self, stages: &Stages<X, U>, x: &mut [f64]) {
        if !self.factorised || !stages.is_consistent() || x.len() != stages.unknowns() {
            return;
        }
        match &mut self.route {
            Route::Riccati(riccati) => riccati.solve(x),
            Route::Dense(dense) => dense.solve(x),
        }
    }
}

#[cfg(test)]
mod tests;
