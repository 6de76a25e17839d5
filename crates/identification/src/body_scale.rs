//! The size of a body: what makes kilograms and kilogram square metres comparable.

use crate::error::IdentificationError;
use nalgebra::{ComplexField, SVector};

/// Characteristic mass and length of a body.
///
/// Every tolerance of this crate is relative to it, so that scaling mass or length scales the answers and nothing else.
/// A rough value serves: the expected mass and the radius of gyration about the body origin.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct BodyScale {
    mass_kg: f64,
    length_m: f64,
}

impl BodyScale {
    /// A kilogram and a metre: for what is told in units of itself.
    #[cfg(feature = "std")]
    pub(crate) const UNIT: Self = Self { mass_kg: 1.0, length_m: 1.0 };

    /// A body of about this mass and radius of gyration.
    ///
    /// # Errors
    /// [`IdentificationError::InvalidScale`] unless both are positive and finite.
    pub fn try_new(mass_kg: f64, length_m: f64) -> Result<Self, IdentificationError> {
        let valid = |x: f64| x.is_finite() && x > 0.0;
        if valid(mass_kg) && valid(length_m) {
            Ok(Self { mass_kg, length_m })
        } else {
            Err(IdentificationError::InvalidScale { mass_kg, length_m })
        }
    }

    /// The scale of a known body: its mass and its radius of gyration √(tr J / 2m) about the origin.
    ///
    /// # Shape
    /// `parameters` in Newton-Euler order `[m, h, J11, J12, J13, J22, J23, J33]`.
    ///
    /// # Errors
    /// As [`try_new`](Self::try_new).
    pub fn of(parameters: &SVector<f64, 10>) -> Result<Self, IdentificationError> {
        let mass_kg = parameters[0];
        let trace = parameters[4] + parameters[7] + parameters[9];
        Self::try_new(mass_kg, ComplexField::sqrt((0.5 * trace / mass_kg).max(0.0)))
    }

    /// Mass, kg.
    pub fn mass_kg(&self) -> f64 {
        self.mass_kg
    }

    /// Length, m.
    pub fn length_m(&self) -> f64 {
        self.length_m
    }

    /// Typical sizes m, mℓ (three times) and mℓ² (six times) of the ten parameters.
    pub fn parameter_magnitudes(&self) -> SVector<f64, 10> {
        let first_moment = self.mass_kg * self.length_m;
        let inertia = first_moment * self.length_m;
        SVector::from_fn(|i, _| match i {
            0 => self.mass_kg,
            1..=3 => first_moment,
            _ => inertia,
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn scale_of_a_ball_and_of_nonsense() {
        // A uniform ball of radius r has radius of gyration √(3/5) r about its centre.
        let j = 0.4 * 2.0 * 0.25;
        let ball = SVector::from([2.0, 0.0, 0.0, 0.0, j, 0.0, 0.0, j, 0.0, j]);
        let scale = BodyScale::of(&ball).unwrap();
        assert!((scale.mass_kg() - 2.0).abs() < 1e-15 && (scale.length_m() - 0.15_f64.sqrt()).abs() < 1e-15);
        assert_eq!(
            BodyScale::of(&-ball),
            Err(IdentificationError::InvalidScale { mass_kg: -2.0, length_m: 0.15_f64.sqrt() })
        );
        for (mass_kg, length_m) in [(0.0, 1.0), (1.0, -1.0), (f64::NAN, 1.0), (1.0, f64::INFINITY)] {
            assert!(matches!(BodyScale::try_new(mass_kg, length_m), Err(IdentificationError::InvalidScale { .. })));
        }
    }
}
