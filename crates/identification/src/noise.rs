//! Seeded random numbers: one named generator, `libm` functions, so the same seed gives the same bytes everywhere.

use nalgebra::Vector3;
use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::{Rng, SeedableRng};

/// A stream of standard normal numbers.
pub struct Gaussian {
    rng: ChaCha8Rng,
    spare: Option<f64>,
}

impl Gaussian {
    /// The stream that belongs to `seed`.
    pub fn from_seed(seed: u64) -> Self {
        Self { rng: ChaCha8Rng::seed_from_u64(seed), spare: None }
    }

    /// Uniform on [0, 1).
    pub fn uniform(&mut self) -> f64 {
        unit_interval(&mut self.rng)
    }

    /// One standard normal number (Marsaglia's polar method).
    pub fn normal(&mut self) -> f64 {
        if let Some(spare) = self.spare.take() {
            return spare;
        }
        loop {
            let (x, y) = (2.0 * self.uniform() - 1.0, 2.0 * self.uniform() - 1.0);
            let s = x * x + y * y;
            if s > 0.0 && s < 1.0 {
                let factor = libm::sqrt(-2.0 * libm::log(s) / s);
                self.spare = Some(y * factor);
                return x * factor;
            }
        }
    }

    /// Three independent normal numbers of standard deviation `sigma`.
    pub fn vector(&mut self, sigma: f64) -> Vector3<f64> {
        Vector3::new(self.normal(), self.normal(), self.normal()) * sigma
    }
}

/// Uniform in [0, 1): the 53 high bits of one draw.
pub fn unit_interval(rng: &mut (impl Rng + ?Sized)) -> f64 {
    const SPACING: f64 = 1.0 / (1_u64 << 53) as f64;
    (rng.next_u64() >> 11) as f64 * SPACING
}

/// Uniform in [-1, 1).
pub fn signed_unit(rng: &mut (impl Rng + ?Sized)) -> f64 {
    2.0 * unit_interval(rng) - 1.0
}

/// Uniform in [low, high).
pub fn between(rng: &mut (impl Rng + ?Sized), low: f64, high: f64) -> f64 {
    low + (high - low) * unit_interval(rng)
}

/// A bijection of 64 bits whose every output bit depends on every input bit.
pub fn spread(x: u64) -> u64 {
    let x = x.wrapping_add(0x9E37_79B9_7F4A_7C15);
    let x = (x ^ (x >> 30)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
    let x = (x ^ (x >> 27)).wrapping_mul(0x94D0_49BB_1331_11EB);
    x ^ (x >> 31)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn moments_of_the_normal_stream() {
        let mut noise = Gaussian::from_seed(3);
        let n = 100_000;
        let samples: Vec<f64> = (0..n).map(|_| noise.normal()).collect();
        let moment = |k: i32| samples.iter().map(|x| x.powi(k)).sum::<f64>() / f64::from(n);
        // Four standard errors of each sample moment.
        let se = |variance: f64| 4.0 * (variance / f64::from(n)).sqrt();
        assert!(moment(1).abs() < se(1.0));
        assert!((moment(2) - 1.0).abs() < se(2.0));
        assert!((moment(4) - 3.0).abs() < se(96.0));
        assert_ne!(Gaussian::from_seed(3).normal().to_bits(), Gaussian::from_seed(4).normal().to_bits());
    }
}
