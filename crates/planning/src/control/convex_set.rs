//! Sets of disturbances, known by their support functions.

use nalgebra::{SMatrix, SVector};

/// A convex and bounded set that holds the origin, known by how far it reaches.
///
/// Implement [`Self::support`]; a set that is asked often gives [`Self::supports_of_rows`] too.
///
/// # Example
/// ```
/// use tumble_planning::control::{ConvexSet, MinimalInvariantSet};
/// use tumble_planning::nalgebra::{SMatrix, SVector};
///
/// /// Gusts of at most so much in any direction.
/// struct Gusts(f64);
/// impl<const N: usize> ConvexSet<N> for Gusts {
///     fn support(&self, direction: &SVector<f64, N>) -> f64 {
///         self.0 * direction.norm()
///     }
/// }
/// let halved = SMatrix::<f64, 2, 2>::identity() * 0.5; // what a controller leaves of an error, each step
/// let reached = MinimalInvariantSet::try_new(halved, Gusts(0.1))?.support(&SVector::from([1.0, 0.0]), 1e-6);
/// assert!(reached.lower <= 0.2 && 0.2 <= reached.upper && reached.upper < 0.2001); // 0.1 + 0.05 + 0.025 + ...
/// # Ok::<(), tumble_planning::PlanningError>(())
/// ```
/// Tutorial: [the sets that come with it](https://github.com/tumble-robotics/tumble/blob/main/crates/planning/src/control/convex_set.rs).
pub trait ConvexSet<const N: usize> {
    /// Largest product of a direction, of any length, with a point of the set; never negative.
    fn support(&self, direction: &SVector<f64, N>) -> f64;

    /// [`Self::support`] of each row.
    ///
    /// # Shape
    /// `D x N`, so that what is done to one coordinate of all directions is done to neighbours in memory.
    fn supports_of_rows<const D: usize>(&self, rows: &SMatrix<f64, D, N>) -> SVector<f64, D> {
        SVector::from_fn(|row, _| self.support(&rows.row(row).transpose()))
    }
}

/// A box about the origin, by its half-widths, none of which is negative.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SymmetricBox<const N: usize>(pub SVector<f64, N>);

impl<const N: usize> SymmetricBox<N> {
    /// The same set by generators along the axes.
    pub fn zonotope(&self) -> Zonotope<N, N> {
        Zonotope(SMatrix::from_diagonal(&self.0))
    }
}

impl<const N: usize> ConvexSet<N> for SymmetricBox<N> {
    #[inline]
    fn support(&self, direction: &SVector<f64, N>) -> f64 {
        direction.iter().zip(&self.0).map(|(direction, width)| direction.abs() * width).sum()
    }

    #[inline]
    fn supports_of_rows<const D: usize>(&self, rows: &SMatrix<f64, D, N>) -> SVector<f64, D> {
        let mut sums = [0.0; D];
        for (column, width) in rows.data.0.iter().zip(&self.0.data.0[0]) {
            for lane in 0..D {
                sums[lane] += column[lane].abs() * width;
            }
        }
        SVector::from(sums)
    }
}

/// The sums of generators, each taken from minus once to plus once.
///
/// # Shape
/// A generator per column.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Zonotope<const N: usize, const G: usize>(pub SMatrix<f64, N, G>);

impl<const N: usize, const G: usize> ConvexSet<N> for Zonotope<N, G> {
    #[inline]
    fn support(&self, direction: &SVector<f64, N>) -> f64 {
        self.0.column_iter().map(|generator| generator.dot(direction).abs()).sum()
    }

    #[inline]
    fn supports_of_rows<const D: usize>(&self, rows: &SMatrix<f64, D, N>) -> SVector<f64, D> {
        let mut sums = [0.0; D];
        for generator in &self.0.data.0 {
            for (sum, x) in sums.iter_mut().zip(combination(&rows.data.0, generator)) {
                *sum += x.abs();
            }
        }
        SVector::from(sums)
    }
}

/// The points `w` with `w'S⁻¹w <= 1`, by `S`, which is symmetric and positive semidefinite.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SymmetricEllipsoid<const N: usize>(pub SMatrix<f64, N, N>);

impl<const N: usize> ConvexSet<N> for SymmetricEllipsoid<N> {
    #[inline]
    fn support(&self, direction: &SVector<f64, N>) -> f64 {
        f64::sqrt(direction.dot(&(self.0 * direction)).max(0.0))
    }

    #[inline]
    fn supports_of_rows<const D: usize>(&self, rows: &SMatrix<f64, D, N>) -> SVector<f64, D> {
        let mut squares = [0.0; D];
        for (column, shape) in rows.data.0.iter().zip(&self.0.data.0) {
            for ((square, x), y) in squares.iter_mut().zip(column).zip(combination(&rows.data.0, shape)) {
                *square += x * y;
            }
        }
        SVector::from(squares.map(|square| f64::sqrt(square.max(0.0))))
    }
}

/// The sums of a point of one set and a point of another.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct MinkowskiSum<A, B>(pub A, pub B);

impl<const N: usize, A: ConvexSet<N>, B: ConvexSet<N>> ConvexSet<N> for MinkowskiSum<A, B> {
    #[inline]
    fn support(&self, direction: &SVector<f64, N>) -> f64 {
        self.0.support(direction) + self.1.support(direction)
    }

    #[inline]
    fn supports_of_rows<const D: usize>(&self, rows: &SMatrix<f64, D, N>) -> SVector<f64, D> {
        self.0.supports_of_rows(rows) + self.1.supports_of_rows(rows)
    }
}

impl<const N: usize, W: ConvexSet<N>> ConvexSet<N> for &W {
    #[inline]
    fn support(&self, direction: &SVector<f64, N>) -> f64 {
        (**self).support(direction)
    }

    #[inline]
    fn supports_of_rows<const D: usize>(&self, rows: &SMatrix<f64, D, N>) -> SVector<f64, D> {
        (**self).supports_of_rows(rows)
    }
}

/// Columns, each times its factor, summed.
#[inline]
pub(super) fn combination<const D: usize, const N: usize>(columns: &[[f64; D]; N], factors: &[f64; N]) -> [f64; D] {
    let mut sums = [0.0; D];
    for (column, factor) in columns.iter().zip(factors) {
        for lane in 0..D {
            sums[lane] += column[lane] * factor;
        }
    }
    sums
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::{Matrix2, Matrix2x3, Vector2};

    /// Largest product over corners, or over points of the rim, of a set in the plane.
    fn over(points: &[Vector2<f64>], direction: &Vector2<f64>) -> f64 {
        points.iter().map(|point| point.dot(direction)).fold(f64::NEG_INFINITY, f64::max)
    }

    fn rim(radius: f64) -> impl Iterator<Item = Vector2<f64>> {
        (0..20_000).map(move |i| {
            let angle = core::f64::consts::TAU * f64::from(i) / 20_000.0;
            Vector2::new(libm::cos(angle), libm::sin(angle)) * radius
        })
    }

    fn corners<const G: usize>(zonotope: &Zonotope<2, G>) -> Vec<Vector2<f64>> {
        let sign = |bits: usize, g: usize| if bits >> g & 1 == 0 { 1.0 } else { -1.0 };
        (0..1 << G).map(|bits| zonotope.0 * SVector::<f64, G>::from_fn(|g, _| sign(bits, g))).collect()
    }

    #[test]
    fn supports_are_the_largest_products_with_points() {
        let a_box = SymmetricBox(Vector2::new(0.5, 2.0));
        let zonotope = Zonotope(Matrix2x3::new(1.0, -0.3, 0.2, 0.4, 0.5, -2.0));
        let half = Matrix2::new(0.7, 0.0, -0.4, 1.1);
        let ellipsoid = SymmetricEllipsoid(half * half.transpose());
        let sum = MinkowskiSum(zonotope, ellipsoid);
        let round: Vec<_> = rim(1.0).map(|point| half * point).collect();
        for direction in rim(3.0).step_by(1111) {
            assert!((a_box.support(&direction) - over(&corners(&a_box.zonotope()), &direction)).abs() < 1e-14);
            assert!((zonotope.support(&direction) - over(&corners(&zonotope), &direction)).abs() < 1e-14);
            let slack = ellipsoid.support(&direction) - over(&round, &direction);
            assert!((0.0..1e-6).contains(&(slack + 1e-15)), "{slack}");
            let both = over(&corners(&zonotope), &direction) + ellipsoid.support(&direction);
            assert!((sum.support(&direction) - both).abs() < 1e-14);
        }
    }

    #[test]
    fn rows_are_asked_as_directions_are() {
        struct Plain<W>(W);
        impl<W: ConvexSet<2>> ConvexSet<2> for Plain<W> {
            fn support(&self, direction: &Vector2<f64>) -> f64 {
                self.0.support(direction)
            }
        }
        fn check(set: impl ConvexSet<2>) {
            let rows = SMatrix::<f64, 9, 2>::from_fn(|i, j| i as f64 - 3.7 - 2.9 * j as f64);
            let together = set.supports_of_rows(&rows);
            let one_by_one = Plain(&set).supports_of_rows(&rows);
            assert!((together - one_by_one).amax() < 1e-14, "{together} {one_by_one}");
            assert!((0..9).all(|i| (one_by_one[i] - set.support(&rows.row(i).transpose())).abs() <= 0.0));
        }
        let a_box = SymmetricBox(Vector2::new(0.5, 2.0));
        let ellipsoid = SymmetricEllipsoid(Matrix2::new(2.0, 0.5, 0.5, 1.0));
        check(a_box);
        check(Zonotope(Matrix2x3::new(1.0, -0.3, 0.2, 0.4, 0.5, -2.0)));
        check(ellipsoid);
        check(MinkowskiSum(a_box, ellipsoid));
    }
}
