//! Where the inertia certainly is, and the centre of mass.

use crate::belief::ModelBelief;
use crate::error::{PlanningError, finite, not_negative, positive};
use nalgebra::{Matrix3, SMatrix, SVector};

/// An interval that holds the principal moments of inertia about the centre of mass, and how wrong the believed tensor may be.
///
/// That principal moments obey the triangle inequality narrows nothing: with the moments `a <= b <= c` of a belief that exists, `c <= a + b`,
/// so both bounds it gives, `c' <= a' + b' <= a + b + 2 e` and `a' >= c' - b' >= c - b - 2 e`, lie outside of `c + e` and `a - e`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct InertiaInterval {
    least: f64,
    largest: f64,
    error: f64,
    believed_least: f64,
    believed_largest: f64,
}

impl InertiaInterval {
    /// From one moment to another, kg m^2; whatever tensor is believed, its moments lie in it too.
    ///
    /// # Errors
    /// [`PlanningError::NotPositive`], [`PlanningError::NotFinite`]; [`PlanningError::OutOfRange`] where they are the wrong way round.
    pub fn between(least_kg_m2: f64, largest_kg_m2: f64) -> Result<Self, PlanningError> {
        let least = positive("the least moment of inertia", least_kg_m2)?;
        let largest = positive("the largest moment of inertia", largest_kg_m2)?;
        if least > largest {
            let what = "the least moment of inertia";
            return Err(PlanningError::OutOfRange { what, value: least, lower: 0.0, upper: largest });
        }
        Ok(Self { least, largest, error: largest - least, believed_least: least, believed_largest: largest })
    }

    /// The inertias that a belief holds possible, every entry of the tensor within so many standard deviations, as far as they are in an
    /// interval that is certain; `None` where none is.
    ///
    /// By Weyl, no moment is farther from the believed one than the spectral norm of the error, which is at most the least of the
    /// Frobenius norm and the largest sum of a row of the deviations.
    ///
    /// # Errors
    /// A body that cannot be, a deviation that is negative or no number.
    pub fn believed(belief: &ModelBelief, sigmas: f64, certain: &Self) -> Result<Option<Self>, PlanningError> {
        positive("the believed mass", belief.parameters().mass)?;
        let inertia = belief.parameters().inertia_about_com();
        let deviations = &belief.estimate.std.inertia_about_com_kg_m2;
        for deviation in deviations {
            not_negative("the standard deviation of an inertia", *deviation)?;
        }
        for entry in &inertia {
            finite("a believed inertia", *entry)?;
        }
        let error = positive("the standard deviations taken", sigmas)? * spectral_norm_at_most(deviations);
        let moments = inertia.symmetric_eigenvalues();
        let (believed_least, believed_largest) = (moments.min(), moments.max());
        positive("the least believed moment of inertia", believed_least)?;
        let (least, largest) =
            ((believed_least - error).max(certain.least), (believed_largest + error).min(certain.largest));
        Ok((least <= largest).then_some(Self { least, largest, error, believed_least, believed_largest }))
    }

    /// Least moment, kg m^2.
    pub fn least_kg_m2(&self) -> f64 {
        self.least
    }

    /// Largest moment, kg m^2.
    pub fn largest_kg_m2(&self) -> f64 {
        self.largest
    }

    /// Bound on the spectral norm of believed minus true inertia, kg m^2.
    pub fn error_kg_m2(&self) -> f64 {
        self.error
    }

    /// Half the difference of the true extreme moments: `|w x J w|` is at most this times `|w|^2`, kg m^2.
    pub(super) fn half_spread(&self) -> f64 {
        0.5 * (self.largest - self.least)
    }

    /// The same of the believed tensor, kg m^2.
    pub(super) fn believed_half_spread(&self) -> f64 {
        0.5 * (self.believed_largest - self.believed_least)
    }

    /// Largest moment of the believed tensor, kg m^2.
    pub(super) fn believed_largest(&self) -> f64 {
        self.believed_largest
    }
}

/// Of any symmetric matrix whose entries are at most these in size.
fn spectral_norm_at_most(sizes: &Matrix3<f64>) -> f64 {
    let rows = sizes.row_iter().map(|row| row.sum()).fold(0.0, f64::max);
    f64::sqrt(sizes.norm_squared()).min(rows)
}

/// How far the centre of mass may be from the believed one: the longest semi-axis of its ellipsoid of so many standard deviations, m.
///
/// `c = h / m` is linearised: `m dc = dh - c dm`.
///
/// # Errors
/// A mass that is not positive, a covariance that is no number.
pub fn center_of_mass_uncertainty_m(belief: &ModelBelief, sigmas: f64) -> Result<f64, PlanningError> {
    let mass = positive("the believed mass", belief.parameters().mass)?;
    let center = belief.parameters().center_of_mass();
    let covariance: SMatrix<f64, 4, 4> = belief.estimate.covariance.fixed_view::<4, 4>(0, 0).into_owned();
    for entry in &covariance {
        finite("a covariance", *entry)?;
    }
    let map = SMatrix::<f64, 3, 4>::from_columns(&[
        -center / mass,
        SVector::<f64, 3>::x() / mass,
        SVector::<f64, 3>::y() / mass,
        SVector::<f64, 3>::z() / mass,
    ]);
    let spread = map * covariance * map.transpose();
    let largest = ((spread + spread.transpose()) * 0.5).symmetric_eigenvalues().max();
    Ok(positive("the standard deviations taken", sigmas)? * f64::sqrt(finite("a variance", largest)?.max(0.0)))
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::Vector3;
    use rand_chacha::ChaCha8Rng;
    use rand_core::{Rng, SeedableRng};
    use tumble_dynamics::InertialParameters;

    fn unit(rng: &mut ChaCha8Rng) -> f64 {
        f64::from(rng.next_u32()) / f64::from(u32::MAX)
    }

    fn belief(deviations: Matrix3<f64>) -> ModelBelief {
        let inertia = Matrix3::new(0.15, 0.01, 0.02, 0.01, 0.2, -0.03, 0.02, -0.03, 0.25);
        let parameters = InertialParameters::about_com(9.0, Vector3::new(0.05, -0.1, 0.02), inertia);
        let mut belief = ModelBelief::certain(1, parameters);
        belief.estimate.std.inertia_about_com_kg_m2 = deviations;
        belief
    }

    #[test]
    fn every_body_within_the_deviations_is_inside() {
        let deviations = Matrix3::new(3.0, 1.0, 2.0, 1.0, 4.0, 0.5, 2.0, 0.5, 2.0) * 1e-3;
        let (belief, wide) = (belief(deviations), InertiaInterval::between(1e-3, 10.0).unwrap());
        let interval = InertiaInterval::believed(&belief, 3.0, &wide).unwrap().unwrap();
        let believed = belief.parameters().inertia_about_com();
        let mut rng = ChaCha8Rng::seed_from_u64(1);
        let mut worst = 0.0_f64;
        for run in 0..2000 {
            // every other one a corner of the box of entries
            let size = |value: f64| if run % 2 == 0 { f64::signum(value) } else { value };
            let mut error = Matrix3::zeros();
            for i in 0..3 {
                for j in i..3 {
                    let entry = 3.0 * deviations[(i, j)] * size(2.0 * unit(&mut rng) - 1.0);
                    (error[(i, j)], error[(j, i)]) = (entry, entry);
                }
            }
            let moments = (believed + error).symmetric_eigenvalues();
            assert!(moments.min() >= interval.least_kg_m2() && moments.max() <= interval.largest_kg_m2());
            worst = worst.max(error.symmetric_eigenvalues().amax() / interval.error_kg_m2());
        }
        assert!((0.85..=1.0).contains(&worst), "{worst}");
        let moments = believed.symmetric_eigenvalues();
        assert!((interval.least_kg_m2() - (moments.min() - interval.error_kg_m2())).abs() < 1e-15);
        assert!((interval.believed_largest() - moments.max()).abs() < 1e-15);
        assert!((interval.believed_half_spread() - 0.5 * (moments.max() - moments.min())).abs() < 1e-15);
        assert!((interval.half_spread() - interval.believed_half_spread() - interval.error_kg_m2()).abs() < 1e-15);
    }

    #[test]
    fn the_spectral_norm_is_bounded_both_ways() {
        // equal entries: the row sum is exact; a diagonal one: too; one far entry: the Frobenius norm would be sqrt(2) more
        let ones = Matrix3::from_element(2.0);
        assert!((spectral_norm_at_most(&ones) - 6.0).abs() < 1e-15);
        let diagonal = Matrix3::from_diagonal(&Vector3::new(1.0, 3.0, 2.0));
        assert!((spectral_norm_at_most(&diagonal) - 3.0).abs() < 1e-15);
        // an arrow: the Frobenius norm is the better one
        let arrow = Matrix3::new(0.0, 1.0, 1.0, 1.0, 0.0, 0.0, 1.0, 0.0, 0.0);
        assert!((spectral_norm_at_most(&arrow) - 2.0).abs() < 1e-15);
        let row = Matrix3::new(2.0, 1.0, 1.0, 1.0, 0.0, 0.0, 1.0, 0.0, 0.0);
        assert!((spectral_norm_at_most(&row) - f64::sqrt(8.0)).abs() < 1e-15);
    }

    #[test]
    fn what_is_certain_stays_so_and_contradictions_are_told() {
        let certain = InertiaInterval::between(0.1, 0.2).unwrap();
        let unsure = belief(Matrix3::from_element(1.0));
        let interval = InertiaInterval::believed(&unsure, 3.0, &certain).unwrap().unwrap();
        assert_eq!((interval.least_kg_m2(), interval.largest_kg_m2()), (0.1, 0.2));
        let elsewhere = InertiaInterval::between(1.0, 2.0).unwrap();
        assert_eq!(InertiaInterval::believed(&belief(Matrix3::zeros()), 3.0, &elsewhere).unwrap(), None);
        assert!(InertiaInterval::believed(&belief(Matrix3::from_element(f64::NAN)), 3.0, &certain).is_err());
        assert!(InertiaInterval::believed(&unsure, 0.0, &certain).is_err());
        assert!(InertiaInterval::between(0.2, 0.1).is_err() && InertiaInterval::between(0.0, 0.1).is_err());
        assert!((certain.error_kg_m2() - 0.1).abs() < 1e-16);
    }

    #[test]
    fn the_centre_of_mass_is_as_unsure_as_first_moment_and_mass_make_it() {
        let mut belief = belief(Matrix3::zeros());
        for axis in 1..4 {
            belief.estimate.covariance[(axis, axis)] = 0.09 * 0.09;
        }
        assert!((center_of_mass_uncertainty_m(&belief, 3.0).unwrap() - 0.03).abs() < 1e-14);
        // a mass that is unsure while the centre of mass is known moves both together
        let (center, variance) = (belief.parameters().center_of_mass(), 0.25);
        let column = nalgebra::Vector4::new(1.0, center.x, center.y, center.z);
        let together = column * column.transpose() * variance;
        belief.estimate.covariance.fixed_view_mut::<4, 4>(0, 0).copy_from(&together);
        assert!(center_of_mass_uncertainty_m(&belief, 3.0).unwrap() < 1e-8);
        // and one that moves alone leaves the first moment behind
        belief.estimate.covariance.fill(0.0);
        belief.estimate.covariance[(0, 0)] = variance;
        let expected = center.norm() * 0.5 / 9.0;
        assert!((center_of_mass_uncertainty_m(&belief, 1.0).unwrap() - expected).abs() < 1e-15);
        belief.estimate.covariance[(0, 0)] = f64::NAN;
        assert!(center_of_mass_uncertainty_m(&belief, 1.0).is_err());
    }
}
