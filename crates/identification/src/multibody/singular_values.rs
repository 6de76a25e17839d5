//! One-sided Jacobi rotations for a size known only at run time; see the module `jacobi` for why not nalgebra's.
//!
//! Nor faer's: it is accurate relative to the largest value, these rotations to each. Columns of a tree are graded over many
//! decades, and with faer's values the cone program did not reach its gap, nor a payload its tolerance.

use super::reflections::dot;
use nalgebra::{DMatrix, DVector};

/// Sweeps after which the rotations stop; convergence takes six to ten.
const MAX_SWEEPS: usize = 60;

/// Singular values in descending order, the right singular vectors and their images A V, as columns in the same order.
pub(super) struct SingularValues {
    pub(super) values: DVector<f64>,
    pub(super) right: DMatrix<f64>,
    pub(super) images: DMatrix<f64>,
}

impl SingularValues {
    pub(super) fn of(a: DMatrix<f64>) -> Self {
        let (rows, columns) = a.shape();
        let largest = a.norm();
        // Columns as short as this are rounding: their directions never settle.
        let rounding = (f64::EPSILON * largest).powi(2);
        let mut images = a;
        let mut right = DMatrix::identity(columns, columns);
        for _ in 0..MAX_SWEEPS {
            let mut rotated = false;
            for p in 0..columns {
                for q in p + 1..columns {
                    let (x, y) = pair(&mut images, rows, p, q);
                    let (xx, yy, xy) = (dot(x, x), dot(y, y), dot(x, y));
                    if xx.min(yy) <= rounding || xy * xy <= (4.0 * f64::EPSILON).powi(2) * xx * yy {
                        continue;
                    }
                    rotated = true;
                    let theta = (yy - xx) / (2.0 * xy);
                    let t = 1.0_f64.copysign(theta) / (theta.abs() + (1.0 + theta * theta).sqrt());
                    let c = 1.0 / (1.0 + t * t).sqrt();
                    rotate(x, y, c, c * t);
                    let (x, y) = pair(&mut right, columns, p, q);
                    rotate(x, y, c, c * t);
                }
            }
            if !rotated {
                break;
            }
        }
        let lengths: Vec<f64> = images.column_iter().map(|column| column.norm()).collect();
        let mut order: Vec<usize> = (0..columns).collect();
        order.sort_by(|&a, &b| lengths[b].total_cmp(&lengths[a]));
        Self {
            values: DVector::from_fn(columns, |i, _| lengths[order[i]]),
            right: right.select_columns(&order),
            images: images.select_columns(&order),
        }
    }
}

/// Columns p < q of a matrix with this many rows.
fn pair(a: &mut DMatrix<f64>, rows: usize, p: usize, q: usize) -> (&mut [f64], &mut [f64]) {
    let (head, tail) = a.as_mut_slice().split_at_mut(q * rows);
    (&mut head[p * rows..(p + 1) * rows], &mut tail[..rows])
}

fn rotate(x: &mut [f64], y: &mut [f64], c: f64, s: f64) {
    for (u, v) in x.iter_mut().zip(y) {
        (*u, *v) = (c * *u - s * *v, s * *u + c * *v);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn recovers_graded_values_and_exact_rank() {
        // Products of known factors: rank 7 of 12, over eight decades.
        let wave = |k: usize| (1.3 * k as f64 + (0.7 * (k * k % 97) as f64).cos()).sin();
        let left = DMatrix::from_fn(15, 7, |i, j| wave(17 * i + j));
        let sizes = DVector::from_fn(7, |i, _| 10.0_f64.powf(-(i as f64) * 8.0 / 6.0));
        let right = DMatrix::from_fn(7, 12, |i, j| wave(1000 + 13 * i + j));
        let a = left * DMatrix::from_diagonal(&sizes) * right;
        let found = SingularValues::of(a.clone());
        assert_eq!(found.values.iter().filter(|&&value| value > 1e-12 * found.values[0]).count(), 7);
        assert!((found.right.transpose() * &found.right - DMatrix::identity(12, 12)).amax() < 1e-14);
        assert!((&a * &found.right - &found.images).amax() < 1e-14 * a.norm());
        for i in 0..7 {
            for j in 0..i {
                let cosine = found.images.column(i).dot(&found.images.column(j)) / (found.values[i] * found.values[j]);
                assert!(cosine.abs() < 1e-13, "{i} {j} {cosine:e}");
            }
        }
    }
}
