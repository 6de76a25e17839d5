//! Products and factors of matrices whose size is known when compiled, and of slices.
//!
//! Sums are written so that they run along rows, in an order that is the same everywhere.

/// `a + b`.
#[inline]
pub(super) fn sum<const N: usize>(a: &[f64; N], b: &[f64; N]) -> [f64; N] {
    core::array::from_fn(|i| a[i] + b[i])
}

/// `a - b`.
#[inline]
pub(super) fn difference<const N: usize>(a: &[f64; N], b: &[f64; N]) -> [f64; N] {
    core::array::from_fn(|i| a[i] - b[i])
}

/// `matrix * vector`, by four partial sums for each row.
#[inline]
pub(super) fn matrix_times<const R: usize, const C: usize>(matrix: &[[f64; C]; R], vector: &[f64; C]) -> [f64; R] {
    core::array::from_fn(|i| dot(&matrix[i], vector))
}

/// `matrix' * vector`.
#[inline]
pub(in crate::local) fn transpose_times<const R: usize, const C: usize>(
    matrix: &[[f64; C]; R],
    vector: &[f64; R],
) -> [f64; C] {
    let mut product = [0.0; C];
    for (row, factor) in matrix.iter().zip(vector) {
        accumulate(*factor, row, &mut product);
    }
    product
}

/// `y += factor x`.
#[inline]
pub(super) fn axpy(factor: f64, x: &[f64], y: &mut [f64]) {
    y.iter_mut().zip(x).for_each(|(y, x)| *y += factor * x);
}

/// `y += factor x` of a size known when compiled, so that `y` stays in registers.
#[inline(always)]
pub(in crate::local) fn accumulate<const N: usize>(factor: f64, x: &[f64; N], y: &mut [f64; N]) {
    for i in 0..N {
        y[i] += factor * x[i];
    }
}

/// Dot product by four partial sums, in an order that is the same everywhere.
#[inline]
pub(super) fn dot(a: &[f64], b: &[f64]) -> f64 {
    let ((a, a_rest), (b, b_rest)) = (a.as_chunks::<4>(), b.as_chunks::<4>());
    let mut partial = [0.0; 4];
    for (a, b) in a.iter().zip(b) {
        for lane in 0..4 {
            partial[lane] += a[lane] * b[lane];
        }
    }
    let mut rest = 0.0;
    for (a, b) in a_rest.iter().zip(b_rest) {
        rest += a * b;
    }
    (partial[0] + partial[2]) + (partial[1] + partial[3]) + rest
}

/// `to += matrix`.
#[inline]
pub(super) fn add<const R: usize, const C: usize>(matrix: &[[f64; C]; R], to: &mut [[f64; C]; R]) {
    for (to, row) in to.iter_mut().zip(matrix) {
        axpy(1.0, row, to);
    }
}

/// `a b`.
#[inline(never)]
pub(super) fn product<const R: usize, const K: usize, const C: usize>(
    a: &[[f64; K]; R],
    b: &[[f64; C]; K],
) -> [[f64; C]; R] {
    let mut product = [[0.0; C]; R];
    for (out, factors) in product.iter_mut().zip(a) {
        *out = transpose_times(b, factors);
    }
    product
}

/// `to += a' b`.
#[inline(never)]
pub(super) fn add_transpose_product<const R: usize, const K: usize, const C: usize>(
    a: &[[f64; R]; K],
    b: &[[f64; C]; K],
    to: &mut [[f64; C]; R],
) {
    for i in 0..R {
        let mut row = to[i];
        for k in 0..K {
            accumulate(a[k][i], &b[k], &mut row);
        }
        to[i] = row;
    }
}

/// `from -= a b`.
#[inline(never)]
pub(super) fn subtract_product<const R: usize, const K: usize, const C: usize>(
    a: &[[f64; K]; R],
    b: &[[f64; C]; K],
    from: &mut [[f64; C]; R],
) {
    for i in 0..R {
        let mut row = from[i];
        for k in 0..K {
            accumulate(-a[i][k], &b[k], &mut row);
        }
        from[i] = row;
    }
}

/// `matrix'`.
#[inline(never)]
pub(super) fn transpose<const R: usize, const C: usize>(matrix: &[[f64; C]; R]) -> [[f64; R]; C] {
    core::array::from_fn(|j| core::array::from_fn(|i| matrix[i][j]))
}

/// The upper triangle from the lower one.
#[inline]
pub(super) fn mirror<const N: usize>(matrix: &mut [[f64; N]; N]) {
    for i in 0..N {
        for j in 0..i {
            matrix[j][i] = matrix[i][j];
        }
    }
}

/// Cholesky factor with the inverse of its diagonal.
#[inline]
pub(super) fn cholesky<const N: usize>(matrix: &[[f64; N]; N]) -> Option<([[f64; N]; N], [f64; N])> {
    let (mut factor, mut inverse_diagonal) = ([[0.0; N]; N], [0.0; N]);
    for j in 0..N {
        let mut pivot = matrix[j][j];
        for k in 0..j {
            pivot -= factor[j][k] * factor[j][k];
        }
        if !(pivot > 0.0 && pivot < f64::INFINITY) {
            return None;
        }
        let root = f64::sqrt(pivot);
        factor[j][j] = root;
        inverse_diagonal[j] = 1.0 / root;
        for i in j + 1..N {
            let mut entry = matrix[i][j];
            for k in 0..j {
                entry -= factor[i][k] * factor[j][k];
            }
            factor[i][j] = entry * inverse_diagonal[j];
        }
    }
    Some((factor, inverse_diagonal))
}

/// Inverse of a lower triangle whose diagonal's inverse is known.
#[inline]
pub(super) fn inverse_lower<const N: usize>(factor: &[[f64; N]; N], inverse_diagonal: &[f64; N]) -> [[f64; N]; N] {
    let mut inverse = [[0.0; N]; N];
    for i in 0..N {
        let mut row = [0.0; N];
        row[i] = 1.0;
        for j in 0..i {
            accumulate(-factor[i][j], &inverse[j], &mut row);
        }
        inverse[i] = row.map(|entry| entry * inverse_diagonal[i]);
    }
    inverse
}
