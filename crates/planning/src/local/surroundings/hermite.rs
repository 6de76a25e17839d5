//! How a body is taken to move between two nodes.

use crate::local::model::Kinematics;
use nalgebra::Vector3;

/// The cubic that has the positions and velocities of both ends; its parameter `s` goes from 0 to 1.
pub(super) struct Segment {
    /// Control points of its Bernstein form.
    pub points: [Vector3<f64>; 4],
    pub step_s: f64,
}

/// What the position, velocity of the start, position, velocity of the end count.
#[derive(Clone, Copy)]
pub(super) struct Weights(pub [f64; 4]);

impl Segment {
    pub fn new(start: &Kinematics, end: &Kinematics, step_s: f64) -> Self {
        let [from, to] = [start, end].map(|node| node.world_from_body.translation.vector);
        let third = step_s / 3.0;
        Self { points: [from, from + start.velocity_world * third, to - end.velocity_world * third, to], step_s }
    }

    /// For the position at `s`.
    pub fn position(&self, s: f64) -> Weights {
        let h = self.step_s;
        let r = 1.0 - s;
        Weights([r * r * (1.0 + 2.0 * s), h * s * r * r, s * s * (3.0 - 2.0 * s), -h * s * s * r])
    }

    /// For its derivative by `s`.
    pub fn slope(&self, s: f64) -> Weights {
        let h = self.step_s;
        let r = 1.0 - s;
        Weights([-6.0 * s * r, h * r * (1.0 - 3.0 * s), 6.0 * s * r, h * s * (3.0 * s - 2.0)])
    }
}

/// A curve in Bernstein form of degree `N - 1`, `s` from 0 to 1: value, first and second derivative.
#[inline]
pub(super) fn evaluate<const N: usize>(points: &[Vector3<f64>; N], s: f64) -> [Vector3<f64>; 3] {
    let mut b = *points;
    let degree = N as f64 - 1.0;
    let mut bend = Vector3::zeros();
    let mut slope = Vector3::zeros();
    for left in (1..N).rev() {
        if left == 2 {
            bend = (b[2] - b[1] * 2.0 + b[0]) * (degree * (degree - 1.0));
        }
        if left == 1 {
            slope = (b[1] - b[0]) * degree;
        }
        for i in 0..left {
            b[i] += (b[i + 1] - b[i]) * s;
        }
    }
    [b[0], slope, bend]
}
