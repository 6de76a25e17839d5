//! `L D L'` of the Gram matrix of the active rows, kept up to date as rows come and go.

use crate::vectors::{add_scaled, dot};

/// Unit lower triangular `L`, its columns one after the other, and the diagonal `D`.
#[derive(Clone, Debug)]
pub(super) struct ActiveFactor {
    capacity: usize,
    size: usize,
    lower: Vec<f64>,
    pivots: Vec<f64>,
    column: Vec<f64>,
}

impl ActiveFactor {
    /// Room for so many rows; none of them is in.
    pub(super) fn new(capacity: usize) -> Self {
        Self {
            capacity,
            size: 0,
            lower: vec![0.0; capacity * capacity],
            pivots: vec![0.0; capacity],
            column: vec![0.0; capacity],
        }
    }

    pub(super) fn clear(&mut self) {
        self.size = 0;
    }

    /// Takes in a row by its products with those that are in and with itself. Where the square of the share of it that is new is at
    /// most `least`, it counts as a combination of them: it stays out and `products` become the factors of that combination.
    #[must_use]
    pub(super) fn append(&mut self, products: &mut [f64], square: f64, least: f64) -> bool {
        let (size, stride) = (self.size, self.capacity);
        self.solve_lower(products);
        let mut pivot = square;
        for (entry, diagonal) in products.iter_mut().zip(&self.pivots) {
            let share = *entry / diagonal;
            pivot -= *entry * share;
            *entry = share;
        }
        // Not a number counts as dependent, too.
        if size == stride || pivot.is_nan() || pivot <= least * square {
            self.solve_upper(products);
            return false;
        }
        for (slot, entry) in self.lower.iter_mut().skip(size).step_by(stride).zip(&*products) {
            *slot = *entry;
        }
        self.pivots[size] = pivot;
        self.size += 1;
        true
    }

    /// Takes out the row at a position.
    pub(super) fn remove(&mut self, position: usize) {
        let (size, stride) = (self.size, self.capacity);
        for column in 0..position {
            let start = column * stride;
            self.lower.copy_within(start + position + 1..start + size, start + position);
        }
        // Its column, times its pivot, is what the rows after it gain.
        let start = position * stride;
        self.column[position + 1..size].copy_from_slice(&self.lower[start + position + 1..start + size]);
        let mut weight = self.pivots[position];
        for column in position + 1..size {
            let from = column * stride;
            self.lower.copy_within(from + column + 1..from + size, from - stride + column);
            let (gain, rest) = (self.column[column], &mut self.column[column + 1..size]);
            let pivot = self.pivots[column];
            let updated = pivot + weight * gain * gain;
            let share = weight * gain / updated;
            weight *= pivot / updated;
            self.pivots[column - 1] = updated;
            let entries = &mut self.lower[from - stride + column..from - stride + size - 1];
            for (entry, rest) in entries.iter_mut().zip(rest) {
                *rest -= gain * *entry;
                *entry += share * *rest;
            }
        }
        self.size -= 1;
    }

    /// Solves with the Gram matrix in place.
    pub(super) fn solve(&self, x: &mut [f64]) {
        self.solve_lower(x);
        for (x, pivot) in x.iter_mut().zip(&self.pivots[..self.size]) {
            *x /= pivot;
        }
        self.solve_upper(x);
    }

    fn solve_lower(&self, x: &mut [f64]) {
        for column in 0..self.size {
            let start = column * self.capacity;
            let factor = -x[column];
            add_scaled(&mut x[column + 1..], factor, &self.lower[start + column + 1..start + self.size]);
        }
    }

    fn solve_upper(&self, x: &mut [f64]) {
        for column in (0..self.size).rev() {
            let start = column * self.capacity;
            x[column] -= dot(&self.lower[start + column + 1..start + self.size], &x[column + 1..]);
        }
    }
}
