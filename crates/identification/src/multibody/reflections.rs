//! Householder reflections that fold rows into a triangle of any size: column j of [R; rows] meets only R_jj and the rows.

use nalgebra::{DMatrix, DVector};

/// A square this small is the rounding of rounding, many times over: a row that tells nothing new leaves less with each
/// column, until its length underflows.
const NOTHING: f64 = f64::MIN_POSITIVE / f64::EPSILON;

/// The reflections of one folding, to be applied to right-hand sides.
pub(super) struct Reflections {
    /// Tail of the j-th reflection in column j.
    tails: DMatrix<f64>,
    /// Diagonal entry that each found and the one that it left; `None` where nothing was to be done.
    diagonals: Vec<Option<(f64, f64)>>,
}

/// Folds `rows` into the upper triangular `factor`, whose diagonal is and stays non-negative.
///
/// A reflection maps a non-negative diagonal to minus the norm, which cancels nothing; the pivot row's sign is then flipped.
pub(super) fn fold(factor: &mut DMatrix<f64>, rows: DMatrix<f64>) -> Reflections {
    let (columns, length) = (factor.ncols(), rows.nrows());
    let mut tails = rows;
    let mut diagonals = vec![None; columns];
    for (j, found) in diagonals.iter_mut().enumerate() {
        let (head, others) = tails.as_mut_slice().split_at_mut((j + 1) * length);
        let tail = &head[j * length..];
        // Rows of blocks further down meet this column not at all.
        let active = tail.iter().rposition(|&entry| entry != 0.0).map_or(0, |last| last + 1);
        let tail = &tail[..active];
        let (diagonal, square) = (factor[(j, j)], dot(tail, tail));
        if square < NOTHING {
            continue;
        }
        let norm = (diagonal * diagonal + square).sqrt();
        factor[(j, j)] = norm;
        *found = Some((diagonal, norm));
        for (l, other) in (j + 1..columns).zip(others.chunks_exact_mut(length)) {
            reflect(diagonal, norm, tail, &mut factor[(j, l)], &mut other[..active]);
        }
    }
    Reflections { tails, diagonals }
}

impl Reflections {
    /// Applies all of them to one further column: its entries beside the triangle and beside the rows.
    pub(super) fn apply(&self, pivots: &mut DVector<f64>, tail: &mut DVector<f64>) {
        for ((column, pivot), found) in self.tails.column_iter().zip(pivots.iter_mut()).zip(&self.diagonals) {
            if let Some((diagonal, norm)) = *found {
                reflect(diagonal, norm, column.as_slice(), pivot, tail.as_mut_slice());
            }
        }
    }
}

fn reflect(diagonal: f64, norm: f64, tail: &[f64], pivot: &mut f64, other: &mut [f64]) {
    let image = (diagonal * *pivot + dot(tail, other)) / norm;
    let step = (*pivot + image) / (diagonal + norm);
    *pivot = image;
    for (value, entry) in other.iter_mut().zip(tail) {
        *value -= entry * step;
    }
}

/// Sum of products in eight strands, so that it does not wait for itself.
pub(super) fn dot(a: &[f64], b: &[f64]) -> f64 {
    let mut strands = [0.0; 8];
    let (a, b) = (a.chunks_exact(8), b.chunks_exact(8));
    let rest: f64 = a.remainder().iter().zip(b.remainder()).map(|(x, y)| x * y).sum();
    for (a, b) in a.zip(b) {
        for ((strand, x), y) in strands.iter_mut().zip(a).zip(b) {
            *strand += x * y;
        }
    }
    strands.iter().sum::<f64>() + rest
}

/// R⁻¹ w for a nonsingular triangle.
pub(super) fn back_substitute(factor: &DMatrix<f64>, mut w: DVector<f64>) -> DVector<f64> {
    for j in (0..w.len()).rev() {
        w[j] /= factor[(j, j)];
        let solved = w[j];
        for (value, entry) in w.iter_mut().zip(factor.column(j).iter()).take(j) {
            *value -= entry * solved;
        }
    }
    w
}

/// R⁻ᵀ w for a nonsingular triangle.
pub(super) fn back_substitute_transposed(factor: &DMatrix<f64>, mut w: DVector<f64>) -> DVector<f64> {
    for j in 0..w.len() {
        let column = factor.column(j);
        let known = dot(&column.as_slice()[..j], &w.as_slice()[..j]);
        w[j] = (w[j] - known) / column[j];
    }
    w
}
