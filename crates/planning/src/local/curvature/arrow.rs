//! The identity with a few columns' squares added.

use super::cholesky::LowerTriangle;

/// Columns side by side.
pub(super) const LANES: usize = 8;

/// Square of the length from which on a column needs corrections.
const LONG: f64 = 1e3;

/// Most corrections of a solution.
const CORRECTIONS: usize = 3;

/// Relative size of a correction after which the next one is rounding.
const SMALL: f64 = 1e-11;

/// `I + Y Y'` for a few columns `Y`.
#[derive(Clone, Debug)]
pub(super) struct Arrow {
    columns: usize,
    /// Rows of `LANES` columns; group after group.
    groups: Vec<[f64; LANES]>,
    /// Factor of `I + Y'Y`.
    capacitance: LowerTriangle,
    /// Whether columns are so long that rounding shows.
    are_long: bool,
    along: Vec<f64>,
    correction: Vec<f64>,
}

impl Arrow {
    /// Room for so many unknowns and columns.
    pub(super) fn new(unknowns: usize, columns: usize) -> Self {
        let padded = columns.next_multiple_of(LANES);
        Self {
            columns: 0,
            groups: Vec::with_capacity(unknowns * padded / LANES),
            capacitance: LowerTriangle::new(columns),
            are_long: false,
            along: Vec::with_capacity(padded),
            correction: Vec::with_capacity(padded),
        }
    }

    /// Takes columns, one after the other, the last group filled up with zeros; gives the groups, one after the other.
    pub(super) fn take<'a>(
        &mut self,
        unknowns: usize,
        columns: impl ExactSizeIterator<Item = &'a [f64]>,
    ) -> impl Iterator<Item = &mut [[f64; LANES]]> {
        self.columns = columns.len();
        let padded = self.columns.next_multiple_of(LANES);
        self.groups.clear();
        self.groups.resize(unknowns * padded / LANES, [0.0; LANES]);
        for (index, column) in columns.enumerate() {
            let group = self.groups.iter_mut().skip(index / LANES * unknowns);
            for (row, entry) in group.zip(column) {
                row[index % LANES] = *entry;
            }
        }
        for work in [&mut self.along, &mut self.correction] {
            work.clear();
            work.resize(padded, 0.0);
        }
        self.groups.chunks_exact_mut(unknowns.max(1))
    }

    /// Factorises `I + Y'Y`; false where it is not finite.
    pub(super) fn factorise(&mut self, unknowns: usize) -> bool {
        self.are_long = false;
        self.capacitance.clear(self.columns);
        let groups = self.groups.chunks_exact(unknowns.max(1));
        let mut rows = self.capacitance.rows_mut();
        for (i, left) in groups.clone().enumerate() {
            let mut block: [Option<&mut [f64]>; LANES] = core::array::from_fn(|_| rows.next());
            for (j, right) in groups.clone().enumerate().take(i + 1) {
                let products = gram(left, right);
                for (row, products) in block.iter_mut().zip(&products) {
                    let entries = row.as_deref_mut().and_then(|row| row.get_mut(j * LANES..)).unwrap_or(&mut []);
                    entries.iter_mut().zip(products).for_each(|(entry, product)| *entry = *product);
                }
            }
            for (lane, row) in block.iter_mut().enumerate() {
                if let Some(diagonal) = row.as_deref_mut().and_then(|row| row.get_mut(i * LANES + lane)) {
                    *diagonal += 1.0;
                    self.are_long |= *diagonal > LONG;
                }
            }
        }
        drop(rows);
        self.capacitance.factorise()
    }

    /// `x := (I + Y Y')^-1 x`.
    ///
    /// With long columns, what `x - Y (I + Y'Y)^-1 Y'x` leaves of `x` along them is rounding. The answer `z = x - Y s` must satisfy
    /// `s = Y'z`; what it lacks of that is put right, again where it was much.
    pub(super) fn solve(&mut self, x: &mut [f64]) {
        if self.columns == 0 {
            return;
        }
        let Self { columns, groups, capacitance, are_long, along, correction } = self;
        let (columns, unknowns) = (*columns, x.len());
        along.fill(0.0);
        for _ in 0..=CORRECTIONS {
            transpose_times(groups, unknowns, x, correction);
            correction.iter_mut().zip(&*along).for_each(|(is, should)| *is -= should);
            let Some(solution) = correction.get_mut(..columns) else { return };
            capacitance.solve_lower(solution);
            capacitance.solve_upper(solution);
            subtract_product(groups, unknowns, correction, x);
            along.iter_mut().zip(&*correction).for_each(|(along, correction)| *along += correction);
            let largest = |x: &[f64]| x.iter().fold(0.0, |most, x| f64::max(most, x.abs()));
            if !*are_long || largest(correction) <= SMALL * largest(along) {
                return;
            }
        }
    }
}

/// Products of the columns of two groups.
fn gram(left: &[[f64; LANES]], right: &[[f64; LANES]]) -> [[f64; LANES]; LANES] {
    let mut products = [[0.0; LANES]; LANES];
    for (left, right) in left.iter().zip(right) {
        for i in 0..LANES {
            for j in 0..LANES {
                products[i][j] += left[i] * right[j];
            }
        }
    }
    products
}

/// `product = Y' x`.
fn transpose_times(groups: &[[f64; LANES]], unknowns: usize, x: &[f64], product: &mut [f64]) {
    for (group, product) in groups.chunks_exact(unknowns.max(1)).zip(product.as_chunks_mut::<LANES>().0) {
        let (rows, _) = group.as_chunks::<2>();
        let (factors, _) = x.as_chunks::<2>();
        let mut partial = [[0.0; LANES]; 2];
        for (rows, factors) in rows.iter().zip(factors) {
            for (partial, (row, factor)) in partial.iter_mut().zip(rows.iter().zip(factors)) {
                for lane in 0..LANES {
                    partial[lane] += row[lane] * factor;
                }
            }
        }
        *product = core::array::from_fn(|lane| partial[0][lane] + partial[1][lane]);
        if unknowns % 2 == 1
            && let (Some(row), Some(factor)) = (group.last(), x.last())
        {
            product.iter_mut().zip(row).for_each(|(product, entry)| *product += entry * factor);
        }
    }
}

/// `x -= Y factors`.
fn subtract_product(groups: &[[f64; LANES]], unknowns: usize, factors: &[f64], x: &mut [f64]) {
    for (group, factors) in groups.chunks_exact(unknowns.max(1)).zip(factors.as_chunks::<LANES>().0) {
        for (x, row) in x.iter_mut().zip(group) {
            let products: [f64; LANES] = core::array::from_fn(|lane| row[lane] * factors[lane]);
            let quarters: [f64; 4] = core::array::from_fn(|lane| products[lane] + products[lane + 4]);
            *x -= (quarters[0] + quarters[2]) + (quarters[1] + quarters[3]);
        }
    }
}
