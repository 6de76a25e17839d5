//! The random numbers of these tests and of the studies and benches that share their scenarios: the same on every machine.
#![allow(dead_code)] // each user takes its part

use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::{Rng, SeedableRng};
use tumble_identification::lie::nalgebra::{Quaternion, SVector, UnitQuaternion, Vector3};

pub struct Random(ChaCha8Rng);

impl Random {
    pub fn new(seed: u64) -> Self {
        Self(ChaCha8Rng::seed_from_u64(seed))
    }

    /// Uniform between zero and one, neither of which it is.
    pub fn share(&mut self) -> f64 {
        ((self.0.next_u64() >> 11) as f64 + 0.5) / (1_u64 << 53) as f64
    }

    pub fn uniform(&mut self, low: f64, high: f64) -> f64 {
        low + (high - low) * self.share()
    }

    /// Log-uniform.
    pub fn magnitude(&mut self, low: f64, high: f64) -> f64 {
        self.uniform(low.ln(), high.ln()).exp()
    }

    /// Box and Muller's: the tails of a gate need a true normal.
    pub fn normal(&mut self) -> f64 {
        let (radius, turn) = (self.share(), self.share());
        (-2.0 * radius.ln()).sqrt() * (std::f64::consts::TAU * turn).cos()
    }

    pub fn normals<const N: usize>(&mut self) -> SVector<f64, N> {
        SVector::from_fn(|_, _| self.normal())
    }

    pub fn normal3(&mut self, sigma: f64) -> Vector3<f64> {
        self.normals() * sigma
    }

    pub fn direction(&mut self) -> Vector3<f64> {
        self.normal3(1.0).normalize()
    }

    pub fn attitude(&mut self) -> UnitQuaternion<f64> {
        let [w, x, y, z] = self.normals::<4>().into();
        UnitQuaternion::new_normalize(Quaternion::new(w, x, y, z))
    }
}
