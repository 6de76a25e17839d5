//! The outer approximation of the smallest invariant set by a finite sum, blown up.

use super::{Contraction, ConvexSet, Zonotope};
use crate::error::{PlanningError, positive};
use nalgebra::{SMatrix, SVector};

/// Terms after which the disturbance is taken not to reach every direction.
const MOST_TERMS: usize = 10_000;

/// `(W + A W + … + A^(s-1) W) / (1 - alpha)` with `A^s W` inside `alpha W`, `alpha < 1`: invariant, and for `s` large enough nearly the
/// smallest such set. [`super::MinimalInvariantSet`] needs none of this; it is here to be compared with.
///
/// # Source
/// Rakovic, Kerrigan, Kouramas, Mayne: Invariant approximations of the minimal robust positively invariant set, 2005.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RakovicSet<const N: usize, W> {
    closed_loop: SMatrix<f64, N, N>,
    disturbance: W,
    terms: usize,
    alpha: f64,
}

impl<const N: usize, W: ConvexSet<N>> RakovicSet<N, W> {
    /// The one with fewest terms that is within `epsilon`, in the largest coordinate, of the smallest invariant set.
    ///
    /// # Shape
    /// The disturbance is the polytope with the facet normals given.
    ///
    /// # Errors
    /// [`PlanningError::NotContractive`]; an `epsilon` that is not positive; [`PlanningError::OutOfRange`] where the origin is not
    /// inside of the disturbance.
    pub fn try_new(
        closed_loop: SMatrix<f64, N, N>,
        disturbance: W,
        normals: &[SVector<f64, N>],
        epsilon: f64,
    ) -> Result<Self, PlanningError> {
        Contraction::try_new(&closed_loop)?;
        positive("the error of an invariant set", epsilon)?;
        let mut power = SMatrix::<f64, N, N>::identity();
        let (mut above, mut below) = (SVector::<f64, N>::zeros(), SVector::<f64, N>::zeros());
        let mut alpha = f64::INFINITY;
        for terms in 1..MOST_TERMS {
            for axis in 0..N {
                let direction = power.row(axis).transpose();
                above[axis] += disturbance.support(&direction);
                below[axis] += disturbance.support(&-direction);
            }
            power *= closed_loop;
            alpha = left_over(&power, &disturbance, normals);
            if alpha <= epsilon / (epsilon + above.max().max(below.max())) {
                return Ok(Self { closed_loop, disturbance, terms, alpha });
            }
        }
        Err(too_much(alpha))
    }

    /// The one with a given number of terms.
    ///
    /// # Errors
    /// [`PlanningError::OutOfRange`] where these are so few that `alpha` is not below one, and the sum cannot be blown up to an
    /// invariant set.
    pub fn with_terms(
        closed_loop: SMatrix<f64, N, N>,
        disturbance: W,
        normals: &[SVector<f64, N>],
        terms: usize,
    ) -> Result<Self, PlanningError> {
        let power = (0..terms).fold(SMatrix::<f64, N, N>::identity(), |power, _| power * closed_loop);
        let alpha = left_over(&power, &disturbance, normals);
        if alpha < 1.0 { Ok(Self { closed_loop, disturbance, terms, alpha }) } else { Err(too_much(alpha)) }
    }

    /// Terms of the sum.
    pub fn terms(&self) -> usize {
        self.terms
    }

    /// Share of the disturbance that what is left out of the sum fits into; below one.
    pub fn alpha(&self) -> f64 {
        self.alpha
    }
}

impl<const N: usize, const G: usize> RakovicSet<N, Zonotope<N, G>> {
    /// Generators of the set.
    pub fn generators(&self) -> Vec<SVector<f64, N>> {
        let mut generators = Vec::with_capacity(self.terms * G);
        let mut columns = self.disturbance.0 / (1.0 - self.alpha);
        for _ in 0..self.terms {
            generators.extend((0..G).map(|generator| columns.column(generator).into_owned()));
            columns = self.closed_loop * columns;
        }
        generators
    }
}

impl<const N: usize, W: ConvexSet<N>> ConvexSet<N> for RakovicSet<N, W> {
    fn support(&self, direction: &SVector<f64, N>) -> f64 {
        let (mut sum, mut direction) = (0.0, *direction);
        for _ in 0..self.terms {
            sum += self.disturbance.support(&direction);
            direction = self.closed_loop.tr_mul(&direction);
        }
        sum / (1.0 - self.alpha)
    }
}

/// Least `alpha` with `power W` inside `alpha W`.
fn left_over<const N: usize>(
    power: &SMatrix<f64, N, N>,
    disturbance: &impl ConvexSet<N>,
    normals: &[SVector<f64, N>],
) -> f64 {
    let ratio = |normal: &SVector<f64, N>| disturbance.support(&power.tr_mul(normal)) / disturbance.support(normal);
    normals.iter().map(ratio).fold(0.0, |most, ratio| if ratio <= most { most } else { ratio })
}

fn too_much(alpha: f64) -> PlanningError {
    PlanningError::OutOfRange {
        what: "the share of a disturbance that is left out",
        value: alpha,
        lower: 0.0,
        upper: 1.0,
    }
}
