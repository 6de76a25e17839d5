//! Least convex quadratic over rows between bounds, where only the linear part and the bounds change from solve to solve.
//!
//! The way through: [`GramProgram`] is what stays, the curvature and the rows, with their products; [`GramWorkspace`] is what a
//! solve works in and what it leaves behind, among it the rows that were active, where the next one begins.

mod blocks;
mod ending;
mod exchange;
mod factor;
mod panels;
mod search;
mod workspace;

use crate::error::{PlanningError, finite};
use crate::vectors::{add_scaled, dot};
pub(super) use blocks::{BlockProgram, JointPart};
use core::ops::Range;
pub use ending::{GramSettings, GramStatus};
use panels::RowPanels;
use search::Programmed;
pub use workspace::GramWorkspace;

/// Share of a diagonal entry of the curvature that is left as pivot, below which it counts as none.
const LEAST_PIVOT: f64 = 1e-15;

/// `minimise 1/2 x' H x + f . x` over `lower <= A x <= upper`, with a constant positive definite `H` and constant `A`.
///
/// Dual active set: starts from the least value over the rows that were active last, and takes in violated ones, one at a time.
/// It needs only products of rows in `H^-1`, the Gram matrix `A H^-1 A'`, which never changes. Rows are scaled to unit length
/// in `H^-1`, so that violations compare. All memory is set up beforehand: a solve allocates nothing.
///
/// # Source
/// Goldfarb and Idnani, A numerically stable dual method for solving strictly convex quadratic programs, 1983, in the form of
/// Lawson and Hanson, Solving Least Squares Problems, 23.
#[derive(Clone, Debug)]
pub struct GramProgram {
    unknowns: usize,
    equality: Vec<bool>,
    equations: Vec<usize>,
    /// What each row was multiplied by.
    scales: Vec<f64>,
    /// `H`, row by row; and in panels, `H` and its inverse.
    hessian: RowPanels,
    inverse: RowPanels,
    /// Scaled `A`, row by row, with the stretch of each that is not zero; and in panels.
    normals: Vec<f64>,
    used: Vec<Range<usize>>,
    by_panels: RowPanels,
    /// `H^-1 A'`, column by column, with the stretch of each that is not zero.
    columns: Vec<f64>,
    reached: Vec<Range<usize>>,
    /// `A H^-1 A'`, row by row.
    gram: Vec<f64>,
    /// Of the Gram matrix: two programs that differ in it cannot share a factor.
    fingerprint: u64,
}

impl GramProgram {
    /// With `hessian` `n x n` and `rows` `m x n`, row by row, and which of the `m` rows are equations; those are fulfilled
    /// before all others.
    ///
    /// # Errors
    /// [`PlanningError::WrongCount`], [`PlanningError::NotFinite`], [`PlanningError::Asymmetric`]; [`PlanningError::NotPositive`]
    /// where the curvature is not positive definite.
    pub fn try_new(hessian: &[f64], rows: &[f64], equality: &[bool]) -> Result<Self, PlanningError> {
        let unknowns = hessian.len().isqrt();
        if unknowns * unknowns != hessian.len() || hessian.is_empty() {
            let expected = (unknowns * unknowns).max(1);
            return Err(PlanningError::WrongCount { what: "entries of the curvature", given: hessian.len(), expected });
        }
        if rows.len() != equality.len() * unknowns {
            let expected = equality.len() * unknowns;
            return Err(PlanningError::WrongCount { what: "entries of the rows", given: rows.len(), expected });
        }
        for entry in hessian {
            finite("an entry of the curvature", *entry)?;
        }
        for entry in rows {
            finite("an entry of a row", *entry)?;
        }
        let transposed = |i: usize| hessian[i % unknowns * unknowns + i / unknowns];
        let is_like = |a: f64, b: f64| (a - b).abs() <= 1e-9 * (a.abs() + b.abs());
        if !hessian.iter().enumerate().all(|(i, entry)| is_like(*entry, transposed(i))) {
            return Err(PlanningError::Asymmetric { what: "the curvature" });
        }
        let root = inverse_factor(hessian, unknowns)?;
        let mut inverse = vec![0.0; hessian.len()];
        for row in root.chunks_exact(unknowns) {
            for (entry, into) in row.iter().zip(inverse.chunks_exact_mut(unknowns)) {
                add_scaled(into, *entry, row);
            }
        }

        let mut normals = rows.to_vec();
        let mut columns = vec![0.0; rows.len()];
        // The rows where `H^-1` measures lengths as the identity does: products of these lose less to rounding.
        let mut straight = vec![0.0; rows.len()];
        let mut scales = vec![1.0; equality.len()];
        let each = normals.chunks_exact_mut(unknowns).zip(columns.chunks_exact_mut(unknowns));
        for (((normal, column), straight), scale) in each.zip(straight.chunks_exact_mut(unknowns)).zip(&mut scales) {
            for (entry, root) in straight.iter_mut().zip(root.chunks_exact(unknowns)) {
                *entry = dot(root, normal);
            }
            let square = finite("the square of a row", dot(straight, straight))?;
            if square > 0.0 {
                *scale = 1.0 / f64::sqrt(square);
                normal.iter_mut().chain(&mut *straight).for_each(|entry| *entry *= *scale);
            }
            for (entry, root) in straight.iter().zip(root.chunks_exact(unknowns)) {
                add_scaled(column, *entry, root);
            }
        }
        let used = normals.chunks_exact(unknowns).map(stretch).collect();
        let reached = columns.chunks_exact(unknowns).map(stretch).collect();
        let mut gram = vec![0.0; equality.len() * equality.len()];
        for (i, one) in straight.chunks_exact(unknowns).enumerate() {
            let used = stretch(one);
            for (j, other) in straight.chunks_exact(unknowns).take(i + 1).enumerate() {
                let product = dot(&one[used.clone()], &other[used.clone()]);
                gram[i * equality.len() + j] = product;
                gram[j * equality.len() + i] = product;
            }
        }
        for product in &gram {
            finite("a product of rows", *product)?;
        }
        let mix = |hash: u64, x: &f64| (hash ^ x.to_bits()).wrapping_mul(0x0000_0100_0000_01b3).rotate_left(23);
        Ok(Self {
            unknowns,
            equality: equality.to_vec(),
            equations: (0..equality.len()).filter(|row| equality[*row]).collect(),
            hessian: RowPanels::new(hessian, unknowns),
            inverse: RowPanels::new(&inverse, unknowns),
            by_panels: RowPanels::new(&normals, unknowns),
            fingerprint: gram.iter().fold(0xcbf2_9ce4_8422_2325, mix),
            scales,
            normals,
            used,
            columns,
            reached,
            gram,
        })
    }

    /// Number of unknowns.
    pub fn unknowns(&self) -> usize {
        self.unknowns
    }

    /// Number of rows.
    pub fn rows(&self) -> usize {
        self.equality.len()
    }

    /// Minimises with this linear part between these bounds, from the rows on that `workspace` holds active.
    ///
    /// A bound that is infinite is none. The two bounds of an equation must agree.
    pub fn solve(
        &self,
        linear: &[f64],
        lower: &[f64],
        upper: &[f64],
        settings: &GramSettings,
        workspace: &mut GramWorkspace,
    ) -> GramStatus {
        search::solve(self, linear, [lower, upper], settings, workspace)
    }
}

impl GramWorkspace {
    /// For a program, or any other of as many unknowns and rows.
    pub fn new(program: &GramProgram) -> Self {
        let (unknowns, rows) = (program.unknowns(), program.rows());
        let padded_rows = program.by_panels.padded_rows();
        Self::with_room([unknowns, program.inverse.padded_rows()], [rows, padded_rows], padded_rows)
    }
}

impl Programmed for GramProgram {
    fn rows(&self) -> usize {
        self.equality.len()
    }

    fn unknowns(&self) -> usize {
        self.unknowns
    }

    fn room(&self) -> usize {
        self.inverse.padded_rows()
    }

    fn fingerprint(&self) -> u64 {
        self.fingerprint
    }

    fn equations(&self) -> impl Iterator<Item = usize> {
        self.equations.iter().copied()
    }

    fn is_equation(&self, row: usize) -> bool {
        self.equality[row]
    }

    fn scale(&self, row: usize) -> f64 {
        self.scales[row]
    }

    fn product(&self, row: usize, other: usize) -> f64 {
        self.gram[row * self.equality.len() + other]
    }

    fn value(&self, row: usize, x: &[f64]) -> f64 {
        let used = self.used[row].clone();
        dot(&self.normals[row * self.unknowns..][used.clone()], &x[used])
    }

    fn values(&self, x: &[f64], values: &mut [f64]) {
        self.by_panels.times(x, values);
    }

    fn add_column(&self, row: usize, factor: f64, x: &mut [f64]) {
        let reached = self.reached[row].clone();
        add_scaled(&mut x[reached.clone()], factor, &self.columns[row * self.unknowns..][reached]);
    }

    fn add_normal(&self, row: usize, factor: f64, x: &mut [f64]) {
        let used = self.used[row].clone();
        add_scaled(&mut x[used.clone()], factor, &self.normals[row * self.unknowns..][used]);
    }

    fn times_inverse(&self, x: &[f64], product: &mut [f64]) {
        self.inverse.times(x, product);
    }

    fn times_hessian(&self, x: &[f64], product: &mut [f64]) {
        self.hessian.times(x, product);
    }
}

/// From the first entry that is not zero to the last.
fn stretch(vector: &[f64]) -> Range<usize> {
    let first = vector.iter().position(|entry| *entry != 0.0).unwrap_or(0);
    first..vector.iter().rposition(|entry| *entry != 0.0).map_or(first, |last| last + 1)
}

/// Inverse of the Cholesky factor of a positive definite matrix, row by row: `L^-1` of `L L'`.
fn inverse_factor(matrix: &[f64], size: usize) -> Result<Vec<f64>, PlanningError> {
    let mut lower = vec![0.0; size * size];
    let mut inverse = vec![0.0; size * size];
    for i in 0..size {
        for j in 0..=i {
            let rest = matrix[i * size + j] - dot(&lower[i * size..][..j], &lower[j * size..][..j]);
            lower[i * size + j] = if i > j {
                rest / lower[j * size + j]
            } else if rest > LEAST_PIVOT * matrix[i * size + i].abs() {
                f64::sqrt(rest)
            } else {
                return Err(PlanningError::NotPositive { what: "a pivot of the curvature", value: rest });
            };
        }
        let (done, row) = inverse.split_at_mut(i * size);
        let row = &mut row[..size];
        row[i] = 1.0;
        for (entry, done) in lower[i * size..][..i].iter().zip(done.chunks_exact(size)) {
            add_scaled(row, -entry, done);
        }
        let pivot = lower[i * size + i];
        for entry in row {
            *entry /= pivot;
        }
    }
    Ok(inverse)
}

#[cfg(test)]
mod tests;
