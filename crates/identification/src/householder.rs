//! Householder reflections that keep the zeros of a triangle: column j of [R; rows] meets only R_jj and the rows.

/// √x, correctly rounded and so the same number in every build.
///
/// [`ComplexField::sqrt`](nalgebra::ComplexField::sqrt) is libm's, which is the SSE instruction `sqrtsd` in inline
/// assembly: in code compiled for AVX, and not preceded by `vzeroupper`, it costs a hundred nanoseconds.
#[inline(always)]
pub(crate) fn sqrt(x: f64) -> f64 {
    #[cfg(feature = "std")]
    return x.sqrt();
    #[cfg(not(feature = "std"))]
    return nalgebra::ComplexField::sqrt(x);
}

/// The reflection that folds `column` into the diagonal entry above it.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Reflection<const ROWS: usize> {
    column: [f64; ROWS],
    diagonal: f64,
    /// Length of (diagonal, column): the new diagonal.
    pub(crate) norm: f64,
    inverse_norm: f64,
    inverse_sum: f64,
}

impl<const ROWS: usize> Reflection<ROWS> {
    /// `None` where the column is zero and nothing is to be done.
    ///
    /// The reflection maps a non-negative diagonal to −norm, which cancels nothing; the sign of the pivot row is then
    /// flipped, so that diagonals stay non-negative.
    #[inline(always)]
    pub(crate) fn new(diagonal: f64, column: [f64; ROWS]) -> Option<Self> {
        let tail: f64 = column.iter().map(|c| c * c).sum();
        if tail == 0.0 {
            return None;
        }
        let norm = sqrt(diagonal * diagonal + tail);
        Some(Self { column, diagonal, norm, inverse_norm: 1.0 / norm, inverse_sum: 1.0 / (diagonal + norm) })
    }

    /// Applies the reflection to a pivot row and the first `active` rows of the block, the others having a zero column.
    #[inline(always)]
    pub(crate) fn apply_to_rows<const P: usize>(
        &self,
        pivot: &mut [f64; P],
        rows: &mut [[f64; P]; ROWS],
        active: usize,
    ) {
        let mut image = pivot.map(|r| self.diagonal * r);
        for (c, row) in self.column.iter().zip(rows.iter()).take(active) {
            for (t, h) in image.iter_mut().zip(row) {
                *t += c * h;
            }
        }
        let mut step = [0.0; P];
        for ((t, s), r) in image.iter().zip(&mut step).zip(pivot.iter_mut()) {
            let t = t * self.inverse_norm;
            *s = (*r + t) * self.inverse_sum;
            *r = t;
        }
        for (c, row) in self.column.iter().zip(rows.iter_mut()).take(active) {
            for (h, s) in row.iter_mut().zip(&step) {
                *h -= c * s;
            }
        }
    }

    /// Applies the reflection to one further column: its pivot entry and its tail.
    #[inline(always)]
    pub(crate) fn apply(&self, pivot: &mut f64, tail: &mut [f64; ROWS]) {
        let product: f64 = self.column.iter().zip(tail.iter()).map(|(c, t)| c * t).sum();
        let image = (self.diagonal * *pivot + product) * self.inverse_norm;
        let step = (*pivot + image) * self.inverse_sum;
        *pivot = image;
        for (c, t) in self.column.iter().zip(tail) {
            *t -= c * step;
        }
    }
}
