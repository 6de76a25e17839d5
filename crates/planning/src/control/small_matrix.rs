//! Linear algebra of matrices so small that their size is a type.

use nalgebra::{SMatrix, SVector};

/// Solution of `matrix x = right` by elimination with row exchanges; `None` where the matrix is singular or no number.
pub(crate) fn solve<const N: usize, const C: usize>(
    mut matrix: SMatrix<f64, N, N>,
    mut right: SMatrix<f64, N, C>,
) -> Option<SMatrix<f64, N, C>> {
    for column in 0..N {
        let mut pivot = column;
        for row in column + 1..N {
            if matrix[(row, column)].abs() > matrix[(pivot, column)].abs() {
                pivot = row;
            }
        }
        matrix.swap_rows(column, pivot);
        right.swap_rows(column, pivot);
        let largest = matrix[(column, column)];
        if !(largest.abs() > 0.0 && largest.is_finite()) {
            return None;
        }
        for row in column + 1..N {
            let factor = matrix[(row, column)] / largest;
            for j in column + 1..N {
                matrix[(row, j)] -= factor * matrix[(column, j)];
            }
            for j in 0..C {
                right[(row, j)] -= factor * right[(column, j)];
            }
        }
    }
    for column in (0..N).rev() {
        for j in 0..C {
            let mut sum = right[(column, j)];
            for k in column + 1..N {
                sum -= matrix[(column, k)] * right[(k, j)];
            }
            right[(column, j)] = sum / matrix[(column, column)];
        }
    }
    right.iter().all(|x| x.is_finite()).then_some(right)
}

/// Lower triangular `L` with `L L' = matrix`; `None` where the matrix is not positive definite. Only its lower half is read.
pub(crate) fn cholesky<const N: usize>(matrix: &SMatrix<f64, N, N>) -> Option<SMatrix<f64, N, N>> {
    let mut lower = SMatrix::<f64, N, N>::zeros();
    for column in 0..N {
        for row in column..N {
            let mut sum = matrix[(row, column)];
            for k in 0..column {
                sum -= lower[(row, k)] * lower[(column, k)];
            }
            if row > column {
                lower[(row, column)] = sum / lower[(column, column)];
            } else if sum > 0.0 && sum.is_finite() {
                lower[(row, row)] = f64::sqrt(sum);
            } else {
                return None;
            }
        }
    }
    Some(lower)
}

/// Inverse of a lower triangular matrix without a zero on its diagonal.
pub(crate) fn inverse_of_lower<const N: usize>(lower: &SMatrix<f64, N, N>) -> SMatrix<f64, N, N> {
    let mut inverse = SMatrix::<f64, N, N>::zeros();
    for column in 0..N {
        inverse[(column, column)] = 1.0 / lower[(column, column)];
        for row in column + 1..N {
            let mut sum = 0.0;
            for k in column..row {
                sum += lower[(row, k)] * inverse[(k, column)];
            }
            inverse[(row, column)] = -sum / lower[(row, row)];
        }
    }
    inverse
}

/// Length of a vector, also where its square would leave the floating-point numbers.
pub(crate) fn length<const N: usize>(vector: &SVector<f64, N>) -> f64 {
    let largest = crate::vectors::largest(vector.as_slice());
    if largest > 0.0 && largest.is_finite() { largest * f64::sqrt((vector / largest).norm_squared()) } else { largest }
}

/// Squarings in [`spectral_radius`].
const SQUARINGS: usize = 24;

/// An upper bound of the moduli of a matrix's eigenvalues, after Gelfand: the norm of its power `2^24`, of which the root is
/// taken; above them by less than `1e-6` of them, unless it is far from normal. Of a symmetric matrix it is a bound of the norm.
/// Infinite where a number is not finite.
pub(crate) fn spectral_radius<const N: usize>(matrix: &SMatrix<f64, N, N>) -> f64 {
    let mut norms = [0.0; SQUARINGS + 1];
    let mut power = *matrix;
    for norm in &mut norms {
        *norm = f64::sqrt(power.norm_squared());
        if !norm.is_finite() {
            return f64::INFINITY;
        }
        if *norm == 0.0 {
            return 0.0;
        }
        power /= *norm;
        power *= power;
    }
    norms.iter().rev().fold(1.0, |root, norm| norm * f64::sqrt(root))
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::{Matrix2, Matrix3, Vector3};

    #[test]
    fn a_system_that_needs_row_exchanges_is_solved() {
        let matrix = Matrix3::new(0.0, 2.0, 1.0, 1.0, 1.0, 0.0, 3.0, 0.0, 1.0);
        let x = Vector3::new(1.0, -2.0, 3.0);
        assert!((solve(matrix, matrix * x).unwrap() - x).amax() < 1e-15);
        assert!(solve(Matrix2::new(1.0, 2.0, 2.0, 4.0), Matrix2::identity()).is_none());
        assert!(solve(Matrix2::new(1.0, f64::NAN, 2.0, 4.0), Matrix2::identity()).is_none());
    }

    #[test]
    fn factors_give_the_matrix_back() {
        let matrix = Matrix3::new(4.0, 2.0, -1.0, 2.0, 5.0, 0.5, -1.0, 0.5, 3.0);
        let lower = cholesky(&matrix).unwrap();
        assert!((lower * lower.transpose() - matrix).amax() < 1e-15 && lower[(0, 2)].abs() <= 0.0);
        assert!((inverse_of_lower(&lower) * lower - Matrix3::identity()).amax() < 1e-15);
        assert!(
            cholesky(&Matrix2::new(1.0, 2.0, 2.0, 1.0)).is_none()
                && cholesky(&Matrix2::new(f64::NAN, 0.0, 0.0, 1.0)).is_none()
        );
    }

    #[test]
    fn lengths_beyond_the_range_of_squares() {
        assert!((length(&Vector3::new(3e-200, 0.0, -4e-200)) / 5e-200 - 1.0).abs() < 1e-15);
        assert!((length(&Vector3::new(3e200, 4e200, 0.0)) / 5e200 - 1.0).abs() < 1e-15);
        assert!(length(&Vector3::new(f64::NAN, 0.0, 0.0)).is_infinite() && length(&Vector3::zeros()).abs() <= 0.0);
    }

    #[test]
    fn radii_of_rotation_defective_and_nilpotent_matrices() {
        // eigenvalues 0.6 +- 0.5i; 0.9 twice with one eigenvector; none but zero
        let radius = |a, b, c, d| spectral_radius(&Matrix2::new(a, b, c, d));
        assert!((radius(0.6, 5.0, -0.05, 0.6) - f64::sqrt(0.61)).abs() < 1e-6);
        let defective = radius(0.9, 10.0, 0.0, 0.9);
        assert!((0.9..0.9 + 3e-6).contains(&defective), "{defective}");
        assert!(radius(0.0, 1.0, 0.0, 0.0).abs() <= 0.0 && radius(0.0, f64::NAN, 0.0, 0.0).is_infinite());
        // symmetric: the norm, from above
        let norm = spectral_radius(&Matrix3::new(2.0, 1.0, 0.0, 1.0, 2.0, 0.0, 0.0, 0.0, -2.9));
        assert!((3.0..3.0 + 1e-6).contains(&norm), "{norm}");
    }
}
