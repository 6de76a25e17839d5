//! The smallest invariant set of a closed loop under a disturbance, by its support function.

use super::convex_set::combination;
use super::{Contraction, ConvexSet};
use crate::error::PlanningError;
use crate::vectors::largest;
use nalgebra::{ArrayStorage, SMatrix, SVector};

/// Terms of the series that are taken at once.
const LANES: usize = 8;

/// Terms after which the series is cut off, with the tail that is left then.
const MOST_TERMS: usize = 1 << 20;

/// A support below this share of its first bound is taken for none: the disturbance does not reach the direction.
const BLIND: f64 = 1e-12;

/// Finest tolerance that sums of this many terms can keep.
const FINEST: f64 = 1e-15;

/// A support, between two bounds.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Support {
    /// Certain not to be exceeded, up to the rounding of a sum.
    pub upper: f64,
    /// Certain to be reached, up to the rounding of a sum.
    pub lower: f64,
    /// Terms of the series that were summed.
    pub terms: usize,
}

/// All that the error `e⁺ = A e + w` can become, from zero, when `w` is any sequence in a set: `Z = W + A W + A² W + …`, exactly.
///
/// No error that starts in it leaves it, and no smaller closed set has this property. It is never built: its support is the sum
/// of the supports of its terms, and what the contraction leaves for the tail is added.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct MinimalInvariantSet<const N: usize, W> {
    closed_loop: SMatrix<f64, N, N>,
    disturbance: W,
    contraction: Contraction<N>,
    /// What the tail of the series adds up to for a direction of dual length one.
    tail: f64,
    /// Coordinate `k` of `A'^j e_i` at `[i][k][j]`.
    first_terms: [[[f64; LANES]; N]; N],
    /// The power by which the next terms differ.
    leap: [[f64; N]; N],
}

impl<const N: usize, W: ConvexSet<N>> MinimalInvariantSet<N, W> {
    /// The set of a closed loop `A` under a disturbance.
    ///
    /// # Errors
    /// [`PlanningError::NotContractive`]; [`PlanningError::NotFinite`] where the disturbance has no bound.
    pub fn try_new(closed_loop: SMatrix<f64, N, N>, disturbance: W) -> Result<Self, PlanningError> {
        let contraction = Contraction::try_new(&closed_loop)?;
        let reach = crate::error::finite("the reach of a disturbance", contraction.reach(&disturbance))?;
        let mut first_terms = [[[0.0; LANES]; N]; N];
        let mut power = SMatrix::<f64, N, N>::identity();
        for lane in 0..LANES {
            for (i, terms) in first_terms.iter_mut().enumerate() {
                for (k, terms) in terms.iter_mut().enumerate() {
                    terms[lane] = power[(i, k)];
                }
            }
            power *= closed_loop;
        }
        let tail = reach / (1.0 - contraction.rate());
        Ok(Self { closed_loop, disturbance, contraction, tail, first_terms, leap: power.data.0 })
    }

    /// The closed loop `A`.
    pub fn closed_loop(&self) -> &SMatrix<f64, N, N> {
        &self.closed_loop
    }

    /// The disturbance `W`.
    pub fn disturbance(&self) -> &W {
        &self.disturbance
    }

    /// What certifies the tails.
    pub fn contraction(&self) -> &Contraction<N> {
        &self.contraction
    }

    /// Support in a direction of any length, its bounds apart by at most a share `tolerance` of the lower one, except where the
    /// closed loop is so slow that a million terms do not do, or the direction is blind to the disturbance.
    ///
    /// # Source
    /// Kolmanovsky, Gilbert: Theory and computation of disturbance invariant sets, 1998, for the set.
    pub fn support(&self, direction: &SVector<f64, N>, tolerance: f64) -> Support {
        let scale = largest(direction.as_slice());
        if scale == 0.0 {
            return Support { upper: 0.0, lower: 0.0, terms: 0 };
        }
        let unit = direction / scale;
        let tolerance = tolerance.max(FINEST);
        let mut tail = self.tail * self.contraction.support(&unit);
        let least = BLIND * tail;
        // row j is A'^j times the direction
        let mut rows = [[0.0; LANES]; N];
        for (terms, factor) in self.first_terms.iter().zip(&unit) {
            for (row, terms) in rows.iter_mut().zip(terms) {
                for (x, term) in row.iter_mut().zip(terms) {
                    *x += factor * term;
                }
            }
        }
        let mut sums = [0.0; LANES];
        let mut lower = 0.0;
        let mut terms = 0;
        while tail > tolerance * f64::max(lower, least) && terms < MOST_TERMS {
            let supports = self.disturbance.supports_of_rows(&SMatrix::from_array_storage(ArrayStorage(rows)));
            for (sum, support) in sums.iter_mut().zip(&supports) {
                *sum += support;
            }
            lower = ((sums[0] + sums[4]) + (sums[1] + sums[5])) + ((sums[2] + sums[6]) + (sums[3] + sums[7]));
            rows = self.leapt(&rows);
            terms += LANES;
            tail = self.tail * self.contraction.support(&SVector::from(rows.map(|row| row[0])));
        }
        Support { upper: scale * (lower + tail), lower: scale * lower, terms }
    }

    /// The rows, a power of the closed loop later.
    #[inline]
    fn leapt(&self, rows: &[[f64; LANES]; N]) -> [[f64; LANES]; N] {
        let mut next = [[0.0; LANES]; N];
        for (next, factors) in next.iter_mut().zip(&self.leap) {
            *next = combination(rows, factors);
        }
        next
    }

    /// Upper bounds of the supports in several directions, each by at most a share `tolerance` above the support.
    ///
    /// # Shape
    /// A direction per column.
    pub fn supports<const D: usize>(&self, directions: &SMatrix<f64, N, D>, tolerance: f64) -> SVector<f64, D> {
        SVector::from(directions.data.0.map(|direction| self.support(&SVector::from(direction), tolerance).upper))
    }
}

/// Upper bounds, to nearly all digits.
impl<const N: usize, W: ConvexSet<N>> ConvexSet<N> for MinimalInvariantSet<N, W> {
    fn support(&self, direction: &SVector<f64, N>) -> f64 {
        self.support(direction, 1e-12).upper
    }
}
