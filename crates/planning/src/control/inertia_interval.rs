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
