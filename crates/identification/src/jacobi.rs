//! One-sided Jacobi rotations: singular values to high relative accuracy, in fixed storage.
//!
//! Used instead of nalgebra's `svd`, whose vectors are wrong on ordinary inputs, and of eigenvalues of a Gram matrix,
//! which lose the small singular values this crate is about.

use crate::householder::sqrt;
use nalgebra::{SMatrix, SVector};

/// Sweeps after which the rotations stop; convergence takes four to eight.
const MAX_SWEEPS: usize = 40;

/// Rotates the columns of `a` until they are orthogonal: `a ← a V` with `V` orthogonal, accumulated in `right` if given.
pub(crate) fn orthogonalize_columns<const ROWS: usize, const COLS: usize>(
    a: &mut SMatrix<f64, ROWS, COLS>,
    mut right: Option<&mut SMatrix<f64, COLS, COLS>>,
) {
    for _ in 0..MAX_SWEEPS {
        let mut rotated = false;
        for p in 0..COLS {
            for q in p + 1..COLS {
                let (head, tail) = a.data.0.split_at_mut(q);
                let (Some(x), Some(y)) = (head.get_mut(p), tail.first_mut()) else { continue };
                let (mut xx, mut yy, mut xy) = (0.0, 0.0, 0.0);
                for (u, v) in x.iter().zip(y.iter()) {
                    xx += u * u;
                    yy += v * v;
                    xy += u * v;
                }
                if xy * xy <= f64::EPSILON * f64::EPSILON * xx * yy {
                    continue;
                }
                rotated = true;
                let (t, c) = rotation((yy - xx) / (2.0 * xy));
                rotate(x, y, c, c * t);
                if let Some(v) = right.as_deref_mut() {
                    let (head, tail) = v.data.0.split_at_mut(q);
                    if let (Some(x), Some(y)) = (head.get_mut(p), tail.first_mut()) {
                        rotate(x, y, c, c * t);
                    }
                }
            }
        }
        if !rotated {
            break;
        }
    }
}

/// Eigenvalues of a symmetric matrix in no particular order, by two-sided rotations.
///
/// nalgebra's take libm's square root, see [`sqrt`].
pub(crate) fn symmetric_eigenvalues<const N: usize>(a: SMatrix<f64, N, N>) -> SVector<f64, N> {
    diagonalized(a, None)
}

/// Eigenvalues of a symmetric matrix in no particular order, and the eigenvectors as columns in the same order.
pub(crate) fn symmetric_eigen<const N: usize>(a: SMatrix<f64, N, N>) -> (SVector<f64, N>, SMatrix<f64, N, N>) {
    let mut vectors = SMatrix::<f64, N, N>::identity();
    let values = diagonalized(a, Some(&mut vectors));
    (values, vectors)
}

fn diagonalized<const N: usize>(
    mut a: SMatrix<f64, N, N>,
    mut vectors: Option<&mut SMatrix<f64, N, N>>,
) -> SVector<f64, N> {
    let negligible = 0.1 * f64::EPSILON * sqrt(a.norm_squared());
    for _ in 0..MAX_SWEEPS {
        let mut rotated = false;
        for p in 0..N {
            for q in p + 1..N {
                let off_diagonal = a[(p, q)];
                if off_diagonal.abs() <= negligible {
                    continue;
                }
                rotated = true;
                let (t, c) = rotation((a[(q, q)] - a[(p, p)]) / (2.0 * off_diagonal));
                let s = c * t;
                a[(p, p)] -= t * off_diagonal;
                a[(q, q)] += t * off_diagonal;
                for k in 0..N {
                    if k != p && k != q {
                        let (x, y) = (a[(p.min(k), p.max(k))], a[(q.min(k), q.max(k))]);
                        a[(p.min(k), p.max(k))] = c * x - s * y;
                        a[(q.min(k), q.max(k))] = s * x + c * y;
                    }
                }
                a[(p, q)] = 0.0;
                if let Some(vectors) = vectors.as_deref_mut() {
                    let (head, tail) = vectors.data.0.split_at_mut(q);
                    if let (Some(x), Some(y)) = (head.get_mut(p), tail.first_mut()) {
                        rotate(x, y, c, s);
                    }
                }
            }
        }
        if !rotated {
            break;
        }
    }
    a.diagonal()
}

/// Tangent and cosine of the rotation with cot 2φ = `theta`.
#[inline(always)]
fn rotation(theta: f64) -> (f64, f64) {
    let t = 1.0_f64.copysign(theta) / (theta.abs() + sqrt(1.0 + theta * theta));
    (t, 1.0 / sqrt(1.0 + t * t))
}

#[inline(always)]
fn rotate<const N: usize>(x: &mut [f64; N], y: &mut [f64; N], c: f64, s: f64) {
    for (u, v) in x.iter_mut().zip(y) {
        (*u, *v) = (c * *u - s * *v, s * *u + c * *v);
    }
}

/// Singular values in descending order and the right singular vectors as columns in the same order.
pub(crate) fn singular_values<const ROWS: usize, const COLS: usize>(
    mut a: SMatrix<f64, ROWS, COLS>,
) -> (SVector<f64, COLS>, SMatrix<f64, COLS, COLS>) {
    let mut right = SMatrix::<f64, COLS, COLS>::identity();
    orthogonalize_columns(&mut a, Some(&mut right));
    let mut values = SVector::<f64, COLS>::from_fn(|j, _| sqrt(a.column(j).norm_squared()));
    for j in 0..COLS {
        let largest = (j..COLS).max_by(|&a, &b| values[a].total_cmp(&values[b])).unwrap_or(j);
        values.swap_rows(j, largest);
        right.swap_columns(j, largest);
    }
    (values, right)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn recovers_graded_singular_values_and_vectors() {
        // Hilbert-like matrix with columns spread over twelve decades.
        let size = [1.0, 1e-4, 1e-8, 1e-12];
        let a = SMatrix::<f64, 6, 4>::from_fn(|i, j| size[j] / (1.0 + i as f64 + (j * j) as f64));
        let (values, right) = singular_values(a);
        assert!((right.transpose() * right - SMatrix::<f64, 4, 4>::identity()).amax() < 1e-14);
        for j in 0..4 {
            let image = a * right.column(j);
            assert!((image.norm() - values[j]).abs() <= 1e-13 * values[j], "{j}: {} {}", image.norm(), values[j]);
        }
        assert!(values[0] > values[1] && values[1] > values[2] && values[2] > values[3] && values[3] > 0.0);
    }

    #[test]
    fn recovers_eigenvalues_of_any_sign() {
        for k in 0..50_usize {
            let entry = |i: usize, j: usize| (k % 7) as f64 - (k * (3 + i * j + i + j) % 11) as f64;
            let a = SMatrix::<f64, 4, 4>::from_fn(entry);
            let sorted = |values: SVector<f64, 4>| {
                let mut values = values.data.0[0];
                values.sort_by(f64::total_cmp);
                SVector::from(values)
            };
            let a = 0.5 * (a + a.transpose());
            let difference = sorted(symmetric_eigenvalues(a)) - sorted(a.symmetric_eigenvalues());
            assert!(difference.amax() <= 1e-14 * a.norm(), "{k}: {difference}");
            let (values, vectors) = symmetric_eigen(a);
            let rebuilt = vectors * SMatrix::<f64, 4, 4>::from_diagonal(&values) * vectors.transpose();
            assert!((rebuilt - a).amax() <= 1e-14 * a.norm(), "{k}: {rebuilt}");
        }
    }

    #[test]
    fn keeps_exact_rank() {
        let a = SMatrix::<f64, 5, 3>::from_fn(|i, j| (i + 1) as f64 * (j + 1) as f64);
        let (values, _) = singular_values(a);
        assert!(values[1] <= 1e-14 * values[0] && values[2] <= 1e-14 * values[0]);
    }
}
