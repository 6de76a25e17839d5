//! A constant matrix in panels of eight rows, so that products with it add up eight rows side by side.

/// Rows of a panel.
pub(super) const LANES: usize = 8;

/// A matrix whose rows are mostly zero outside one stretch, which is all that is kept of a panel.
#[derive(Clone, Debug, Default)]
pub(super) struct RowPanels {
    panels: Vec<Panel>,
    /// Column by column within a panel.
    entries: Vec<[f64; LANES]>,
}

#[derive(Clone, Copy, Debug)]
struct Panel {
    first_column: usize,
    first_entry: usize,
    columns: usize,
}

impl RowPanels {
    /// Of a matrix given row by row.
    pub(super) fn new(matrix: &[f64], columns: usize) -> Self {
        let mut all = Self::default();
        for rows in matrix.chunks(LANES * columns.max(1)) {
            let is_used = |column: &usize| rows.iter().skip(*column).step_by(columns).any(|entry| *entry != 0.0);
            let first_column = (0..columns).find(is_used).unwrap_or(columns);
            let end = (first_column..columns).rev().find(is_used).map_or(first_column, |last| last + 1);
            all.panels.push(Panel { first_column, first_entry: all.entries.len(), columns: end - first_column });
            for column in first_column..end {
                let mut lanes = [0.0; LANES];
                for (lane, entry) in lanes.iter_mut().zip(rows.iter().skip(column).step_by(columns)) {
                    *lane = *entry;
                }
                all.entries.push(lanes);
            }
        }
        all
    }

    /// Number of rows, filled up with zeros to whole panels.
    pub(super) fn padded_rows(&self) -> usize {
        self.panels.len() * LANES
    }

    /// Writes the product with a vector; `product` has room for the padded rows.
    pub(super) fn times(&self, x: &[f64], product: &mut [f64]) {
        for (panel, product) in self.panels.iter().zip(product.as_chunks_mut::<LANES>().0) {
            let entries = &self.entries[panel.first_entry..panel.first_entry + panel.columns];
            let x = &x[panel.first_column..panel.first_column + panel.columns];
            let mut sums = [0.0; LANES];
            for (entries, x) in entries.iter().zip(x) {
                for lane in 0..LANES {
                    sums[lane] += entries[lane] * x;
                }
            }
            *product = sums;
        }
    }
}

#[cfg(test)]
#[allow(clippy::float_cmp, reason = "small whole numbers")]
mod tests {
    use super::*;

    #[test]
    fn products_are_those_of_the_definition() {
        for (rows, columns) in [(1, 1), (7, 3), (8, 5), (9, 5), (20, 4)] {
            // Zeros at either end of some rows, and rows of nothing else.
            let entry =
                |i: usize, j: usize| if (i / 8 + i) % 3 <= j && i != 4 { (i * 7 + j * 3) as f64 - 9.0 } else { 0.0 };
            let matrix: Vec<f64> = (0..rows * columns).map(|k| entry(k / columns, k % columns)).collect();
            let x: Vec<f64> = (0..columns).map(|j| 2.0 - j as f64).collect();
            let panels = RowPanels::new(&matrix, columns);
            let mut product = vec![f64::NAN; panels.padded_rows()];
            panels.times(&x, &mut product);
            for (i, value) in product.iter().enumerate() {
                let expected = (0..columns).map(|j| if i < rows { entry(i, j) * x[j] } else { 0.0 }).sum::<f64>();
                assert_eq!(*value, expected, "row {i} of {rows} x {columns}");
            }
        }
    }

    #[test]
    fn nothing_times_nothing_is_nothing() {
        let panels = RowPanels::new(&[], 3);
        panels.times(&[1.0, 2.0, 3.0], &mut []);
        assert_eq!(panels.padded_rows(), 0);
    }
}
