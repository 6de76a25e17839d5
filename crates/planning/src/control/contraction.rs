//! A measure of length in which a closed loop shrinks every error.

use super::ConvexSet;
use super::small_matrix::{cholesky, inverse_of_lower, length, spectral_radius};
use crate::error::PlanningError;
use nalgebra::{SMatrix, SVector};

/// Where the rate asked for lies between the spectral radius and one: near it the lengths of the measure become unlike, near one
/// tails become long.
const MARGIN: f64 = 0.3;

/// Doublings of the series of the measure; twice as many as the slowest closed loop that doubles can tell from one needs.
const DOUBLINGS: usize = 64;

/// Share of itself below which a term of a series is not added.
const SETTLED: f64 = 1e-17;

/// Far above the rounding of the measured rate, far below what matters.
const SAFETY: f64 = 1e-12;

/// The length `‖L'x‖` in which `‖A x‖ <= rate ‖x‖` for every error `x`.
///
/// That the rate holds is measured, with whatever `L` came out: rounding makes it worse but never wrong.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Contraction<const N: usize> {
    /// `L`, lower triangular.
    factor: SMatrix<f64, N, N>,
    inverse: SMatrix<f64, N, N>,
    rate: f64,
}

impl<const N: usize> Contraction<N> {
    /// A measure for a closed loop.
    ///
    /// # Errors
    /// [`PlanningError::NotContractive`] where there is none, or none that doubles can show.
    pub fn try_new(closed_loop: &SMatrix<f64, N, N>) -> Result<Self, PlanningError> {
        let spectral_radius = spectral_radius(closed_loop);
        let refusal = || PlanningError::NotContractive { spectral_radius };
        if spectral_radius >= 1.0 {
            return Err(refusal());
        }
        // P = sum of (A'/r)^i (A/r)^i, so that A'PA = r^2 (P - 1)
        let mut power = closed_loop / (spectral_radius + MARGIN * (1.0 - spectral_radius));
        let mut measure = SMatrix::<f64, N, N>::identity();
        for _ in 0..DOUBLINGS {
            let added = power.transpose() * measure * power;
            measure += added;
            power *= power;
            if added.amax() <= SETTLED * measure.amax() {
                break;
            }
        }
        let factor = cholesky(&measure).ok_or_else(refusal)?;
        let inverse = inverse_of_lower(&factor);
        let in_measure = factor.transpose() * closed_loop * inverse.transpose();
        let rate = f64::sqrt(self::spectral_radius(&(in_measure.transpose() * in_measure))) * (1.0 + SAFETY);
        if rate < 1.0 { Ok(Self { factor, inverse, rate }) } else { Err(refusal()) }
    }

    /// Factor by which an error is shorter after a step, at least; below one.
    pub fn rate(&self) -> f64 {
        self.rate
    }

    /// Length of an error.
    pub fn length(&self, error: &SVector<f64, N>) -> f64 {
        length(&(self.factor.transpose() * error))
    }

    /// Largest product of a direction with an error of length one.
    #[inline]
    pub fn support(&self, direction: &SVector<f64, N>) -> f64 {
        f64::sqrt((self.inverse * direction).norm_squared())
    }

    /// What no error of a set is longer than.
    pub fn reach(&self, set: &impl ConvexSet<N>) -> f64 {
        length(&SVector::<f64, N>::from_fn(|axis, _| {
            let direction = self.factor.column(axis).into_owned();
            set.support(&direction).max(set.support(&-direction))
        }))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::control::SymmetricBox;
    use nalgebra::{Matrix2, Matrix3, Vector2, Vector3};

    fn wave(i: usize) -> f64 {
        libm::sin(1.7 * i as f64 * i as f64)
    }

    #[test]
    fn every_error_shrinks_by_the_rate_and_none_of_a_set_is_longer_than_its_reach() {
        let mut tightest = 0.0_f64;
        for seed in 0..50 {
            let mut matrix = Matrix3::from_fn(|i, j| wave(17 * seed + 3 * i + j));
            matrix *= (0.3 + 0.013 * seed as f64) / spectral_radius(&matrix);
            let contraction = Contraction::try_new(&matrix).unwrap();
            let set = SymmetricBox(Vector3::new(0.1, 2.0, 0.5));
            for k in 0..200 {
                let error = Vector3::from_fn(|i, _| wave(1000 + 7 * k + i));
                let shrunk = contraction.length(&(matrix * error)) / contraction.length(&error);
                assert!(shrunk <= contraction.rate());
                tightest = tightest.max(shrunk / contraction.rate());
                let corner = Vector3::from_fn(|i, _| set.0[i] * error[i].signum());
                assert!(contraction.length(&corner) <= contraction.reach(&set) * (1.0 + 1e-14));
                let direction = Vector3::from_fn(|i, _| wave(5000 + 7 * k + i));
                let product = direction.dot(&error) / contraction.length(&error);
                assert!(product <= contraction.support(&direction) * (1.0 + 1e-14));
            }
        }
        assert!(tightest > 0.99, "{tightest}");
    }

    #[test]
    fn a_set_to_one_side_reaches_as_far_as_its_mirror_image() {
        struct Segment(Vector2<f64>);
        impl ConvexSet<2> for Segment {
            fn support(&self, direction: &Vector2<f64>) -> f64 {
                self.0.dot(direction).max(0.0)
            }
        }
        let contraction = Contraction::try_new(&Matrix2::new(0.9, 0.2, -0.05, 0.7)).unwrap();
        let end = Vector2::new(-1.0, -2.0);
        assert!((contraction.reach(&Segment(end)) / contraction.length(&end) - 1.0).abs() < 1e-14);
        assert!((contraction.reach(&Segment(-end)) / contraction.length(&end) - 1.0).abs() < 1e-14);
    }

    #[test]
    fn the_rate_lies_between_the_spectral_radius_and_what_was_asked_for() {
        let matrix = Matrix2::new(0.9, 0.2, -0.05, 0.7);
        let radius = spectral_radius(&matrix);
        let rate = Contraction::try_new(&matrix).unwrap().rate();
        assert!(rate >= radius && rate <= radius + MARGIN * (1.0 - radius) + 1e-9, "{rate} {radius}");
    }

    #[test]
    fn closed_loops_that_do_not_contract_are_refused_with_their_radius() {
        let radius = |matrix: Matrix2<f64>| match Contraction::try_new(&matrix) {
            Err(PlanningError::NotContractive { spectral_radius }) => spectral_radius,
            other => panic!("{other:?}"),
        };
        assert!((radius(Matrix2::new(1.1, 0.3, 0.0, 0.2)) - 1.1).abs() < 1e-6);
        assert!((radius(Matrix2::identity()) - 1.0).abs() < 1e-6);
        assert!((radius(Matrix2::new(1.0, 0.2, 0.0, 1.0)) - 1.0).abs() < 1e-5);
        assert!(radius(Matrix2::new(f64::NAN, 0.0, 0.0, 0.5)).is_infinite());
        assert!(radius(Matrix2::new(0.5, 1e300, 0.0, 0.5)).is_infinite());
        // slow, and still shown
        assert!(Contraction::try_new(&Matrix2::new(1.0 - 1e-7, 0.2, 0.0, 0.5)).is_ok());
        assert!(Contraction::try_new(&Matrix2::zeros()).unwrap().reach(&SymmetricBox(Vector2::new(3.0, 4.0))) >= 5.0);
    }
}
