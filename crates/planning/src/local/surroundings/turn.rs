//! How a body is taken to turn between two nodes.

use crate::local::model::{KINEMATICS, Kinematics};
use nalgebra::{Matrix3, Vector3};
use tumble_lie::{rotation_jacobian, rotation_jacobian_inverse, series, skew};

/// The rotation vector since the start is the cubic that has the attitudes and rates of both ends.
pub(super) struct Turn {
    /// `world_from_body` at the start.
    start: Matrix3<f64>,
    /// Control points of its Bernstein form: those of the start (zero), of both rates, of the end.
    pub points: [Vector3<f64>; 4],
    /// The rate of the end, over a third of the step.
    end_rate: Vector3<f64>,
    step_s: f64,
}

/// Attitude at one place, how it turns there with `s`, and how it changes with the ends.
pub(super) struct Attitude {
    pub world_from_body: Matrix3<f64>,
    /// Rotation by `s`, body axes.
    pub rate: Vector3<f64>,
    phi: Vector3<f64>,
    s: f64,
}

impl Turn {
    pub fn new(start: &Kinematics, end: &Kinematics, step_s: f64) -> Self {
        let [from, to] = [start, end].map(|node| node.world_from_body.rotation);
        let phi = (from.inverse() * to).scaled_axis();
        let third = step_s / 3.0;
        let end_rate = end.rate_body * third;
        let before_end = phi - rotation_jacobian_inverse(&phi) * end_rate;
        let points = [Vector3::zeros(), start.rate_body * third, before_end, phi];
        Self { start: *from.to_rotation_matrix().matrix(), points, end_rate, step_s }
    }

    pub fn at(&self, s: f64) -> Attitude {
        let [phi, slope, _] = super::hermite::evaluate(&self.points, s);
        let turned = nalgebra::Rotation3::from_scaled_axis(phi);
        Attitude { world_from_body: self.start * turned.matrix(), rate: rotation_jacobian(&phi) * slope, phi, s }
    }

    /// Adds what a moment (a gradient by the attitude there, body axes) is by attitude and rate of both ends.
    pub fn spread(
        &self,
        attitude: &Attitude,
        moment: &Vector3<f64>,
        by_start: &mut [f64; KINEMATICS],
        by_end: &mut [f64; KINEMATICS],
    ) {
        let Attitude { phi, s, .. } = attitude;
        let r = 1.0 - s;
        // Bernstein polynomials of the control points.
        let [_, first, second, third] = [r * r * r, 3.0 * s * r * r, 3.0 * s * s * r, s * s * s];
        let by_phi = rotation_jacobian(phi).tr_mul(moment);
        let end = &self.points[3];
        let inverse = rotation_jacobian_inverse(end);
        let by_end_phi = by_phi * (second + third) - end_slope(end, &self.end_rate).tr_mul(&by_phi) * second;
        let by_end_attitude = inverse.tr_mul(&by_end_phi);
        // The start turns what comes after it: as seen from `s`, and from the end.
        let turn = nalgebra::Rotation3::from_scaled_axis(*phi);
        let by_start_attitude = turn * moment - inverse * by_end_phi;
        let a_third = self.step_s / 3.0;
        let by_start_rate = by_phi * (first * a_third);
        let by_end_rate = inverse.tr_mul(&by_phi) * (-second * a_third);
        for axis in 0..3 {
            by_start[6 + axis] += by_start_attitude[axis];
            by_start[9 + axis] += by_start_rate[axis];
            by_end[6 + axis] += by_end_attitude[axis];
            by_end[9 + axis] += by_end_rate[axis];
        }
    }
}

/// Change of `Jr^-1(phi) v = v + phi x v / 2 + c phi x (phi x v)` by `phi`.
fn end_slope(phi: &Vector3<f64>, v: &Vector3<f64>) -> Matrix3<f64> {
    let inverse = series::inverse_jacobian(phi.norm_squared());
    let across = phi.cross(v);
    let twice = phi.cross(&across);
    skew(v) * -0.5 - (skew(&across) + skew(phi) * skew(v)) * inverse.c
        + twice * phi.transpose() * (2.0 * inverse.c_rate)
}
