//! Random numbers of the planner.

use nalgebra::{Quaternion, UnitQuaternion, Vector3};
use rand_chacha::ChaCha8Rng;
use rand_core::SeedableRng;
use tumble_identification::noise::{between, signed_unit, unit_interval};

/// A seeded stream of what the planner draws.
pub(super) struct Chance(ChaCha8Rng);

impl Chance {
    pub fn new(seed: u64) -> Self {
        Self(ChaCha8Rng::seed_from_u64(seed))
    }

    /// Uniform in `[0, 1)`.
    pub fn uniform(&mut self) -> f64 {
        unit_interval(&mut self.0)
    }

    /// Uniform in `[-1, 1)`.
    pub fn signed(&mut self) -> f64 {
        signed_unit(&mut self.0)
    }

    /// Uniform between two numbers.
    pub fn between(&mut self, low: f64, high: f64) -> f64 {
        between(&mut self.0, low, high)
    }

    /// True with this probability.
    pub fn happens(&mut self, probability: f64) -> bool {
        self.uniform() < probability
    }

    /// Between `2^-octaves` and 1, every octave as likely as any other.
    pub fn scale(&mut self, octaves: f64) -> f64 {
        let mut exponent = octaves * self.uniform();
        let mut scale = 1.0;
        while exponent >= 1.0 {
            scale *= 0.5;
            exponent -= 1.0;
        }
        scale * (1.0 - 0.5 * exponent)
    }

    /// Uniform in the cube `[-1, 1)^3`.
    pub fn in_cube(&mut self) -> Vector3<f64> {
        Vector3::new(self.signed(), self.signed(), self.signed())
    }

    /// Uniform in the unit ball.
    pub fn in_ball(&mut self) -> Vector3<f64> {
        loop {
            let point = self.in_cube();
            if point.norm_squared() <= 1.0 {
                return point;
            }
        }
    }

    /// Uniform over all attitudes.
    pub fn attitude(&mut self) -> UnitQuaternion<f64> {
        loop {
            let point = Quaternion::new(self.signed(), self.signed(), self.signed(), self.signed());
            let square = point.norm_squared();
            if (0.01..=1.0).contains(&square) {
                return UnitQuaternion::new_unchecked(point / f64::sqrt(square));
            }
        }
    }
}
