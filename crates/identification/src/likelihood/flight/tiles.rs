//! Sums of products of rows, tile by tile: what a tile adds up stays in registers.

/// Sides of a tile.
pub(super) const TILE: usize = 4;
/// Rows of a factor at most.
pub(super) const DEPTH: usize = 24;

/// So many entries, filled up to whole tiles.
pub(super) const fn padded(entries: usize) -> usize {
    entries.next_multiple_of(TILE)
}

/// Rows one after another, each of whole tiles.
#[derive(Clone, Copy)]
pub(super) struct Rows<'a> {
    pub(super) width: usize,
    pub(super) values: &'a [f64],
}

impl<'a> Rows<'a> {
    fn tiles(self, row: usize) -> &'a [[f64; TILE]] {
        self.values[row * self.width..(row + 1) * self.width].as_chunks::<TILE>().0
    }

    /// Which rows are not zero in a tile.
    fn acting(self, tile: usize) -> ([usize; DEPTH], usize) {
        let (mut acting, mut count) = ([0; DEPTH], 0);
        for row in 0..(self.values.len() / self.width).min(DEPTH) {
            if self.tiles(row)[tile].iter().any(|entry| *entry != 0.0) {
                acting[count] = row;
                count += 1;
            }
        }
        (acting, count)
    }
}

/// Adds `left^T right`, of at most [`DEPTH`] rows, to the first rows of `sums`, which are as wide as `right` or wider; where only the `upper`
/// triangle is asked for, tiles below the diagonal stay as they are.
pub(super) fn add_product(sums: &mut [f64], width: usize, left: Rows<'_>, right: Rows<'_>, upper: bool) {
    for tall in 0..left.width / TILE {
        let (acting, count) = left.acting(tall);
        if count == 0 {
            continue;
        }
        let mut factors = [[0.0; TILE]; DEPTH];
        let mut rows: [&[[f64; TILE]]; DEPTH] = [&[]; DEPTH];
        for ((factors, values), &row) in factors.iter_mut().zip(&mut rows).zip(&acting[..count]) {
            *factors = left.tiles(row)[tall];
            *values = right.tiles(row);
        }
        let (_, below) = sums.split_at_mut(tall * TILE * width);
        let (first, below) = below.split_at_mut(width);
        let (second, below) = below.split_at_mut(width);
        let (third, fourth) = below.split_at_mut(width);
        let mut out = [first, second, third, &mut fourth[..width]].map(|row| row.as_chunks_mut::<TILE>().0);
        for wide in if upper { tall } else { 0 }..right.width / TILE {
            let mut tile = [[0.0; TILE]; TILE];
            for (factors, row) in factors[..count].iter().zip(&rows[..count]) {
                let values = &row[wide];
                for (sums, factor) in tile.iter_mut().zip(factors) {
                    for (sum, value) in sums.iter_mut().zip(values) {
                        *sum += factor * value;
                    }
                }
            }
            for (out, tile) in out.iter_mut().zip(&tile) {
                for (sum, more) in out[wide].iter_mut().zip(tile) {
                    *sum += more;
                }
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::noise::Gaussian;

    /// Numbers of these rows and columns, some columns zero but for one row.
    fn rows(count: usize, width: usize, gaussian: &mut Gaussian) -> Vec<f64> {
        let sparse = |at: usize| at % width / TILE == 1 && at / width != 2;
        (0..count * width).map(|at| if sparse(at) { 0.0 } else { gaussian.normal() }).collect()
    }

    #[test]
    fn products_are_those_of_the_definition() {
        let mut gaussian = Gaussian::from_seed(1);
        for (count, tall, wide) in [(1, 4, 8), (DEPTH, 12, 8), (7, 8, 16)] {
            let (a, b) = (rows(count, tall, &mut gaussian), rows(count, wide, &mut gaussian));
            let before = rows(tall, wide + TILE, &mut gaussian);
            for upper in [false, true] {
                let mut found = before.clone();
                let (left, right) = (Rows { width: tall, values: &a }, Rows { width: wide, values: &b });
                add_product(&mut found, wide + TILE, left, right, upper);
                for (at, (found, before)) in found.iter().zip(&before).enumerate() {
                    let (i, k) = (at / (wide + TILE), at % (wide + TILE));
                    let asked = k < wide && (!upper || k / TILE >= i / TILE);
                    let sum: f64 =
                        (0..count).map(|row| if asked { a[row * tall + i] * b[row * wide + k] } else { 0.0 }).sum();
                    assert!((found - before - sum).abs() < 1e-12, "{count} {i} {k}: {found}");
                }
            }
        }
    }
}
