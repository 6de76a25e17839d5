//! Factorisation stage by stage.

use super::arrow::{Arrow, LANES};
use super::small::{
    add, add_transpose_product, axpy, cholesky, difference, inverse_lower, matrix_times, mirror, product,
    subtract_product, sum, transpose, transpose_times,
};
use crate::local::Stages;

/// What the elimination of one stage's input leaves. Products run along rows: what is used from both sides is there twice.
#[derive(Clone, Debug)]
struct Eliminated<const X: usize, const U: usize> {
    /// Inverse of the Cholesky factor of the input's curvature, cost to go included.
    inverse_factor: [[f64; U]; U],
    /// What a change of the state makes the input do, with the opposite sign.
    gain: [[f64; X]; U],
    gain_transposed: [[f64; U]; X],
    /// Change of the next state by the input in units of its curvature's root.
    input_way: [[f64; U]; X],
    input_way_transposed: [[f64; X]; U],
    /// Change of the next state by the state, the input's answer included.
    closed_loop: [[f64; X]; X],
    closed_loop_transposed: [[f64; X]; X],
}

/// `H + damping I = L (I + Y Y') L'`: `L^-1` is a sweep back in time, its transpose one forward, and `Y = L^-1 C` for the arrow's
/// columns `C`.
#[derive(Clone, Debug)]
pub(super) struct Riccati<const X: usize, const U: usize> {
    eliminated: Vec<Eliminated<X, U>>,
    arrow: Arrow,
}

impl<const X: usize, const U: usize> Riccati<X, U> {
    /// Room for a horizon and columns.
    pub(super) fn new(steps: usize, columns: usize) -> Self {
        Self { eliminated: Vec::with_capacity(steps), arrow: Arrow::new(steps * U, columns) }
    }

    /// Factorises consistent stages; false where the matrix is not positive definite.
    pub(super) fn factorise(&mut self, stages: &Stages<X, U>, damping: f64) -> bool {
        self.eliminated.clear();
        let mut to_go = [[0.0; X]; X];
        let motion = stages.by_state.iter().zip(&stages.by_input);
        let curvatures = stages.state_curvature.iter().zip(&stages.input_curvature);
        for ((by_state, by_input), (of_state, of_input)) in motion.zip(curvatures).rev() {
            add(of_state, &mut to_go);
            let along_state = product(&to_go, by_state);
            let along_input = product(&to_go, by_input);
            let mut curvature = *of_input;
            for (i, row) in curvature.iter_mut().enumerate() {
                row[i] += damping;
            }
            add_transpose_product(by_input, &along_input, &mut curvature);
            let mut coupling = [[0.0; X]; U];
            add_transpose_product(by_input, &along_state, &mut coupling);
            let Some(inverse_factor) = cholesky(&curvature).map(|(factor, inverse)| inverse_lower(&factor, &inverse))
            else {
                return false;
            };
            let coupling = product(&inverse_factor, &coupling);

            to_go = [[0.0; X]; X];
            add_transpose_product(by_state, &along_state, &mut to_go);
            for row in &coupling {
                for i in 0..X {
                    axpy(-row[i], row, &mut to_go[i]);
                }
            }
            mirror(&mut to_go);

            let mut gain = [[0.0; X]; U];
            add_transpose_product(&inverse_factor, &coupling, &mut gain);
            let input_way_transposed = product(&inverse_factor, &transpose(by_input));
            let input_way = transpose(&input_way_transposed);
            let mut closed_loop = *by_state;
            subtract_product(by_input, &gain, &mut closed_loop);
            self.eliminated.push(Eliminated {
                inverse_factor,
                gain,
                gain_transposed: transpose(&gain),
                input_way,
                input_way_transposed,
                closed_loop,
                closed_loop_transposed: transpose(&closed_loop),
            });
        }
        self.eliminated.reverse();

        let unknowns = stages.unknowns();
        for group in self.arrow.take(unknowns, stages.arrow_columns()) {
            let mut costate = [[0.0; LANES]; X];
            for (stage, rows) in self.eliminated.iter().zip(group.as_chunks_mut::<U>().0).rev() {
                let mut earlier = [[0.0; LANES]; X];
                add_transpose_product(&stage.closed_loop, &costate, &mut earlier);
                add_transpose_product(&stage.gain, rows, &mut earlier);
                *rows = product(&stage.inverse_factor, rows);
                subtract_product(&stage.input_way_transposed, &costate, rows);
                costate = earlier;
            }
        }
        self.arrow.factorise(unknowns)
    }

    /// Solves in place.
    ///
    /// From stage to stage only the closed loop hangs on what was before: one product each, the rest goes beside it.
    pub(super) fn solve(&mut self, x: &mut [f64]) {
        let mut costate = [0.0; X];
        for (stage, x) in self.eliminated.iter().zip(x.as_chunks_mut::<U>().0).rev() {
            let beside = transpose_times(&stage.gain, x);
            let own = matrix_times(&stage.inverse_factor, x);
            *x = difference(&own, &transpose_times(&stage.input_way, &costate));
            costate = sum(&beside, &transpose_times(&stage.closed_loop, &costate));
        }
        self.arrow.solve(x);
        let mut change = [0.0; X];
        for (stage, x) in self.eliminated.iter().zip(x.as_chunks_mut::<U>().0) {
            let beside = transpose_times(&stage.input_way_transposed, x);
            let own = transpose_times(&stage.inverse_factor, x);
            *x = difference(&own, &transpose_times(&stage.gain_transposed, &change));
            change = sum(&beside, &transpose_times(&stage.closed_loop_transposed, &change));
        }
    }
}
