//! Cholesky factors of matrices whose size is known only at run time.

use super::small::{axpy, dot};

/// Columns eliminated at once.
const PANEL: usize = 8;

/// A square matrix of which the lower triangle counts, row after row.
#[derive(Clone, Debug)]
pub(super) struct LowerTriangle {
    size: usize,
    /// Distance of neighbouring rows.
    stride: usize,
    entries: Vec<f64>,
    /// Inverse of the diagonal of the factor.
    inverse_diagonal: Vec<f64>,
    /// The panel's part of every row below it, transposed.
    panel: [Vec<f64>; PANEL],
}

impl LowerTriangle {
    /// Room for a size.
    pub(super) fn new(size: usize) -> Self {
        Self {
            size: 0,
            stride: 0,
            entries: Vec::with_capacity(size * size),
            inverse_diagonal: Vec::with_capacity(size),
            panel: core::array::from_fn(|_| Vec::with_capacity(size)),
        }
    }

    /// Makes it the zero matrix of a size.
    pub(super) fn clear(&mut self, size: usize) {
        (self.size, self.stride) = (size, size);
        self.entries.clear();
        self.entries.resize(size * size, 0.0);
        self.inverse_diagonal.clear();
        self.inverse_diagonal.resize(size, 0.0);
        for row in &mut self.panel {
            row.clear();
            row.resize(size, 0.0);
        }
    }

    /// Its rows, of full length.
    pub(super) fn rows_mut(&mut self) -> impl Iterator<Item = &mut [f64]> {
        self.entries.chunks_exact_mut(self.stride.max(1))
    }

    /// So many rows from one on.
    pub(super) fn block_rows(&mut self, first: usize, number: usize) -> impl Iterator<Item = &mut [f64]> {
        self.rows_mut().skip(first).take(number)
    }

    /// Adds `c c'` for each of the columns, which come one after the other.
    pub(super) fn add_squares(&mut self, columns: &[f64]) {
        let n = self.size.max(1);
        for columns in columns.chunks(PANEL * n) {
            let mut each = columns.chunks_exact(n);
            let columns: [&[f64]; PANEL] = core::array::from_fn(|_| each.next().unwrap_or(&[]));
            for (i, row) in self.rows_mut().enumerate() {
                let factors = columns.map(|column| -column.get(i).copied().unwrap_or(0.0));
                subtract_combination(&factors, &columns, row.get_mut(..=i).unwrap_or(&mut []));
            }
        }
    }

    /// Takes its Cholesky factor's place; false where it is not positive definite.
    pub(super) fn factorise(&mut self) -> bool {
        let n = self.size;
        let mut first = 0;
        while first < n {
            let last = (first + PANEL).min(n);
            let (above, below) = self.entries.split_at_mut(last * self.stride);
            let Some(diagonal) = above.get_mut(first * self.stride..) else { return false };
            if !factorise_panel(diagonal, self.stride, first, last, &mut self.inverse_diagonal) {
                return false;
            }
            // The rows below, then what they take from the rest of the triangle.
            for (offset, row) in below.chunks_exact_mut(self.stride).enumerate() {
                let Some((panel, rest)) = row.get_mut(first..).and_then(|row| row.split_at_mut_checked(last - first))
                else {
                    return false;
                };
                for j in 0..panel.len() {
                    let pivot_row = diagonal.get(j * n + first..j * n + first + j).unwrap_or(&[]);
                    let (known, unknown) = panel.split_at_mut(j);
                    let taken: f64 = pivot_row.iter().zip(&*known).map(|(a, b)| a * b).sum();
                    if let (Some(entry), Some(inverse)) = (unknown.first_mut(), self.inverse_diagonal.get(first + j)) {
                        *entry = (*entry - taken) * inverse;
                    }
                }
                let mut factors = [0.0; PANEL];
                factors.iter_mut().zip(&*panel).for_each(|(factor, entry)| *factor = *entry);
                for (transposed, factor) in self.panel.iter_mut().zip(&factors) {
                    if let Some(entry) = transposed.get_mut(offset) {
                        *entry = *factor;
                    }
                }
                let transposed = self.panel.each_ref().map(Vec::as_slice);
                subtract_combination(&factors, &transposed, rest.get_mut(..=offset).unwrap_or(&mut []));
            }
            first = last;
        }
        true
    }

    /// `x := L^-1 x`.
    pub(super) fn solve_lower(&self, x: &mut [f64]) {
        let rows = self.entries.chunks_exact(self.stride.max(1)).zip(&self.inverse_diagonal);
        for (i, (row, inverse)) in rows.enumerate().take(x.len()) {
            let (known, unknown) = x.split_at_mut(i);
            if let Some(entry) = unknown.first_mut() {
                *entry = (*entry - dot(row.get(..i).unwrap_or(&[]), known)) * inverse;
            }
        }
    }

    /// `x := L'^-1 x`.
    pub(super) fn solve_upper(&self, x: &mut [f64]) {
        let rows = self.entries.chunks_exact(self.stride.max(1)).zip(&self.inverse_diagonal);
        for (i, (row, inverse)) in rows.enumerate().take(x.len()).rev() {
            let (unknown, known) = x.split_at_mut(i);
            if let Some(entry) = known.first_mut() {
                *entry *= inverse;
                axpy(-*entry, row, unknown);
            }
        }
    }
}

/// Factorises the square block of the panel; `rows` begins with the row `first`.
fn factorise_panel(rows: &mut [f64], stride: usize, first: usize, last: usize, inverse_diagonal: &mut [f64]) -> bool {
    for i in 0..last - first {
        for j in 0..=i {
            let mut entry = rows.get(i * stride + first + j).copied().unwrap_or(0.0);
            for k in 0..j {
                let factor = |row: usize| rows.get(row * stride + first + k).copied().unwrap_or(0.0);
                entry -= factor(i) * factor(j);
            }
            if i == j {
                if !(entry > 0.0 && entry < f64::INFINITY) {
                    return false;
                }
                entry = f64::sqrt(entry);
                if let Some(inverse) = inverse_diagonal.get_mut(first + i) {
                    *inverse = 1.0 / entry;
                }
            } else {
                entry *= inverse_diagonal.get(first + j).copied().unwrap_or(0.0);
            }
            if let Some(slot) = rows.get_mut(i * stride + first + j) {
                *slot = entry;
            }
        }
    }
    true
}

/// `row -= sum of factors[p] * rows[p]`; rows that are too short count as zero.
#[inline]
fn subtract_combination(factors: &[f64; PANEL], rows: &[&[f64]; PANEL], row: &mut [f64]) {
    let n = row.len();
    if let [Some(a), Some(b), Some(c), Some(d), Some(e), Some(f), Some(g), Some(h)] = rows.map(|row| row.get(..n)) {
        for i in 0..n {
            let even = factors[0] * a[i] + factors[2] * c[i] + (factors[4] * e[i] + factors[6] * g[i]);
            let odd = factors[1] * b[i] + factors[3] * d[i] + (factors[5] * f[i] + factors[7] * h[i]);
            row[i] -= even + odd;
        }
    } else {
        for (factor, from) in factors.iter().zip(rows).filter(|(_, from)| from.len() >= n) {
            axpy(-factor, from, row);
        }
    }
}
