//! Where the mass certainly is.

use crate::belief::ModelBelief;
use crate::error::{PlanningError, not_negative, positive};

/// An interval of masses, by their inverses: accelerations are linear in `1 / m`, so its middle there is what commands are scaled by.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct MassInterval {
    /// `1 / m` of the largest mass, 1/kg; positive.
    least_per_kg: f64,
    /// `1 / m` of the least mass, 1/kg; finite.
    largest_per_kg: f64,
}

impl MassInterval {
    /// From one mass to another, kg.
    ///
    /// # Errors
    /// [`PlanningError::NotPositive`], [`PlanningError::NotFinite`]; [`PlanningError::OutOfRange`] where they are the wrong way round.
    pub fn between(least_kg: f64, largest_kg: f64) -> Result<Self, PlanningError> {
        let (least, largest) = (positive("the least mass", least_kg)?, positive("the largest mass", largest_kg)?);
        if least > largest {
            let what = "the least mass";
            return Err(PlanningError::OutOfRange { what, value: least, lower: 0.0, upper: largest });
        }
        Ok(Self { least_per_kg: 1.0 / largest, largest_per_kg: 1.0 / least })
    }

    /// The masses that a belief holds possible, `1 / m` within so many standard deviations of its estimate, as far as they are in
    /// an interval that is certain; `None` where none is: the estimator or that interval is wrong.
    ///
    /// # Errors
    /// A mass that is not positive, a variance that is negative or no number.
    pub fn believed(belief: &ModelBelief, sigmas: f64, certain: &Self) -> Result<Option<Self>, PlanningError> {
        let mass_kg = positive("the believed mass", belief.parameters().mass)?;
        let variance = not_negative("the variance of the mass", belief.estimate.covariance[(0, 0)])?;
        let middle = 1.0 / mass_kg;
        let reach = positive("the standard deviations taken", sigmas)? * f64::sqrt(variance) * middle * middle;
        let least_per_kg = (middle - reach).max(certain.least_per_kg);
        let largest_per_kg = (middle + reach).min(certain.largest_per_kg);
        Ok((least_per_kg <= largest_per_kg).then_some(Self { least_per_kg, largest_per_kg }))
    }

    /// Least mass, kg.
    pub fn least_kg(&self) -> f64 {
        1.0 / self.largest_per_kg
    }

    /// Largest mass, kg.
    pub fn largest_kg(&self) -> f64 {
        1.0 / self.least_per_kg
    }

    /// The mass whose inverse is in the middle, kg.
    pub fn center_kg(&self) -> f64 {
        2.0 / (self.least_per_kg + self.largest_per_kg)
    }

    /// `center / m = 1 + d` with `|d|` at most this; below one.
    pub fn uncertainty(&self) -> f64 {
        (self.largest_per_kg - self.least_per_kg) / (self.largest_per_kg + self.least_per_kg)
    }

    /// Whether another lies inside.
    pub fn contains(&self, inner: &Self) -> bool {
        inner.least_per_kg >= self.least_per_kg && inner.largest_per_kg <= self.largest_per_kg
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use tumble_dynamics::InertialParameters;

    #[test]
    fn half_more_and_half_less_is_half_uncertain_about_three_quarters() {
        let interval = MassInterval::between(0.5, 1.5).unwrap();
        assert!((interval.center_kg() - 0.75).abs() < 1e-15 && (interval.uncertainty() - 0.5).abs() < 1e-15);
        for mass in [0.5, 0.7, 1.5] {
            let share = interval.center_kg() / mass - 1.0;
            assert!(share.abs() <= interval.uncertainty() + 1e-15, "{mass}");
        }
        assert!(MassInterval::between(2.0, 1.0).is_err() && MassInterval::between(0.0, 1.0).is_err());
        assert!(MassInterval::between(1.0, f64::INFINITY).is_err());
    }

    #[test]
    fn a_belief_narrows_and_one_outside_contradicts() {
        let mut belief = ModelBelief::certain(3, InertialParameters::solid_box(10.0, [0.3, 0.3, 0.3]));
        belief.estimate.covariance[(0, 0)] = 0.01;
        let prior = MassInterval::between(5.0, 20.0).unwrap();
        let narrow = MassInterval::believed(&belief, 3.0, &prior).unwrap().unwrap();
        assert!(prior.contains(&narrow) && (narrow.largest_kg() - 10.0 / 0.97).abs() < 1e-12);
        // less is known of the inverse than nothing: the prior stays
        belief.estimate.covariance[(0, 0)] = 400.0;
        assert_eq!(MassInterval::believed(&belief, 3.0, &prior).unwrap(), Some(prior));
        belief.estimate.covariance[(0, 0)] = 1e-4;
        let elsewhere = MassInterval::between(11.0, 12.0).unwrap();
        assert_eq!(MassInterval::believed(&belief, 3.0, &elsewhere).unwrap(), None);
        belief.estimate.covariance[(0, 0)] = f64::NAN;
        assert!(MassInterval::believed(&belief, 3.0, &prior).is_err());
    }
}
