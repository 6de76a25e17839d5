//! Apparent inverse mass of each axis: the scale between logged forces and measured accelerations.

use super::sum_over_distances;
use crate::error::IdentificationError;
use crate::likelihood::identifiability::Verdict;
use nalgebra::Vector3;

/// What forces and accelerations along one body axis say about each other.
#[derive(Clone, Debug, PartialEq)]
pub struct AxisScale {
    /// `theta + theta'`: acceleration per unit of logged force, 1/kg; not a number where no force acted.
    pub inverse_mass_per_kg: f64,
    /// Its standard deviation, 1/kg.
    pub sigma_per_kg: f64,
    /// Whether the force along this axis was enough to tell.
    pub verdict: Verdict,
}

impl AxisScale {
    /// `theta'` of the print, 1/kg, for a body whose mass is known.
    pub fn excess_per_kg(&self, mass_kg: f64) -> f64 {
        self.inverse_mass_per_kg - 1.0 / mass_kg
    }

    /// The dimensionless factor `(theta + theta') m` for a body whose mass is known: one where nothing is scaled.
    pub fn factor(&self, mass_kg: f64) -> f64 {
        self.inverse_mass_per_kg * mass_kg
    }

    /// This axis against another: the ratio of the scales and its standard deviation. It needs no mass; the scale of both
    /// together is not separable from the mass.
    pub fn relative_to(&self, other: &Self) -> (f64, f64) {
        let ratio = self.inverse_mass_per_kg / other.inverse_mass_per_kg;
        let part = |axis: &Self| axis.sigma_per_kg / axis.inverse_mass_per_kg;
        (ratio, ratio.abs() * part(self).hypot(part(other)))
    }
}

/// Regresses acceleration on force, axis by axis.
///
/// Only for a body that hardly turns or whose acceleration is that of the centre of mass; what a turning lever arm adds
/// enters as noise. Noise in the forces pulls the scale towards zero by its share of their power. The standard deviation
/// allows for residuals correlated over `correlation_length` samples.
///
/// # Frame
/// Body axes; entry k of both at one time.
/// # Errors
/// [`IdentificationError::TooFewSamples`]; [`IdentificationError::NotFinite`] naming the sample.
/// # Source
/// Thesis (6.12), (6.13).
/// # Deviation
/// The values of its table 6.5 are the factors `(theta + theta') m`, not `theta'` (test `golden_factors_of_table_6_5`).
pub fn relative_scale(
    forces_body: &[Vector3<f64>],
    accelerations_body: &[Vector3<f64>],
    correlation_length: usize,
) -> Result<[AxisScale; 3], IdentificationError> {
    let samples = forces_body.len().min(accelerations_body.len());
    if samples < 2 {
        return Err(IdentificationError::TooFewSamples { samples, needed: 2 });
    }
    let finite = |k: usize| forces_body[k].iter().chain(accelerations_body[k].iter()).all(|x| x.is_finite());
    if let Some(row) = (0..samples).find(|&k| !finite(k)) {
        return Err(IdentificationError::NotFinite { row });
    }
    Ok([0, 1, 2].map(|axis| {
        let pairs: Vec<(f64, f64)> =
            forces_body.iter().zip(accelerations_body).map(|(f, a)| (f[axis], a[axis])).collect();
        let power: f64 = pairs.iter().map(|(f, _)| f * f).sum();
        let inverse_mass_per_kg = pairs.iter().map(|(f, a)| f * a).sum::<f64>() / power;
        let residuals: Vec<f64> = pairs.iter().map(|(f, a)| a - f * inverse_mass_per_kg).collect();
        let freedom = samples as f64 / (samples - 1) as f64;
        // Autocovariance of the residual against that of the force.
        let at_distance: Vec<f64> = (0..=(2 * correlation_length).min(samples - 1))
            .map(|lag| {
                let covariance: f64 = residuals.iter().zip(&residuals[lag..]).map(|(a, b)| a * b).sum();
                let forces: f64 = pairs.iter().zip(&pairs[lag..]).map(|(a, b)| a.0 * b.0).sum();
                covariance * forces / (samples - lag) as f64
            })
            .collect();
        let spread = sum_over_distances(&at_distance, correlation_length);
        let sigma_per_kg = (spread * freedom).sqrt() / power;
        // Three sigma from zero: below that not even the sign is known.
        let seen = power > 0.0 && inverse_mass_per_kg.abs() > 3.0 * sigma_per_kg;
        let verdict = if seen { Verdict::Identifiable } else { Verdict::NotIdentifiable };
        AxisScale { inverse_mass_per_kg, sigma_per_kg, verdict }
    }))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::noise::Gaussian;

    fn random(seed: u64) -> impl FnMut() -> f64 {
        let mut dice = Gaussian::from_seed(seed);
        move || dice.normal()
    }

    #[test]
    fn golden_factors_of_table_6_5() {
        let (mass_kg, factors) = (9.58, [1.774, 1.0201, 1.2088]);
        let forces: Vec<Vector3<f64>> =
            (0..50).map(|k| Vector3::new((0.3 * f64::from(k)).sin(), 0.2, -0.1 * f64::from(k))).collect();
        let accelerations: Vec<Vector3<f64>> =
            forces.iter().map(|f| f.component_mul(&Vector3::from(factors)) / mass_kg).collect();
        let found = relative_scale(&forces, &accelerations, 5).unwrap();
        let excess = [0.080_793_3, 0.002_098_1, 0.021_795_4];
        for axis in 0..3 {
            assert!((found[axis].factor(mass_kg) - factors[axis]).abs() < 1e-12);
            assert!((found[axis].excess_per_kg(mass_kg) - excess[axis]).abs() < 5e-8);
            assert_eq!(found[axis].verdict, Verdict::Identifiable);
        }
        assert!((found[1].relative_to(&found[0]).0 - 1.0201 / 1.774).abs() < 1e-12);
    }

    #[test]
    fn sigma_covers_white_and_correlated_noise_and_idle_axes_are_named() {
        for correlated in [false, true] {
            let (runs, mut inside, mut normalized) = (400_u32, 0_u32, 0.0);
            for seed in 0..runs {
                let mut noise = random(u64::from(seed));
                let mut coloured = Vector3::zeros();
                let (mut forces, mut accelerations) = (Vec::new(), Vec::new());
                for k in 0..2400 {
                    let t = 0.05 * f64::from(k);
                    let force = Vector3::new(0.3 * (0.7 * t).sin(), 0.2 * (1.9 * t).cos(), 0.0);
                    let white = Vector3::new(noise(), noise(), noise()) * 0.01;
                    coloured = if correlated { coloured * 0.7 + white } else { white };
                    forces.push(force);
                    accelerations.push(force * 0.1 + coloured);
                }
                let found = relative_scale(&forces, &accelerations, if correlated { 25 } else { 0 }).unwrap();
                for axis in &found[..2] {
                    let error = (axis.inverse_mass_per_kg - 0.1) / axis.sigma_per_kg;
                    normalized += error * error / f64::from(2 * runs);
                    inside += u32::from(error.abs() < 1.96);
                }
                assert_eq!(found[2].verdict, Verdict::NotIdentifiable);
            }
            // 800 trials for intervals, and the mean of their squares.
            let share = f64::from(inside) / f64::from(2 * runs);
            let coverage = crate::statistics::coverage_band(0.95, 2 * runs as usize, 0.999);
            let squares = crate::statistics::mean_square_band(1.0, 2 * runs as usize, 0.999);
            assert!(coverage.contains(share) && squares.contains(normalized), "{correlated} {share} {normalized}");
        }
    }
}
