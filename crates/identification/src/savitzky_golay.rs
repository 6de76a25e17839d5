//! Polynomials fitted in a moving window: smoothing and differentiation of equally spaced samples, also of poses.

use crate::error::IdentificationError;
use crate::lie::{LieGroup, Pose};
use nalgebra::{Translation3, UnitQuaternion, Vector3};

/// Least-squares polynomial of a given order over `2 half_window + 1` equally spaced samples (Savitzky-Golay).
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct SavitzkyGolay {
    half_window: usize,
    order: usize,
}

/// Pose and its first two derivatives, as a smoother sees them.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SmoothedMotion {
    /// Pose of the body frame in the inertial frame.
    pub world_from_body: Pose<f64>,
    /// Velocity of the body origin, inertial axes, m/s.
    pub velocity_origin_world: Vector3<f64>,
    /// Acceleration of the body origin, inertial axes, m/s^2.
    pub acceleration_origin_world: Vector3<f64>,
    /// Angular velocity, body axes, rad/s.
    pub rate_body: Vector3<f64>,
    /// Its derivative, body axes, rad/s^2.
    pub rate_derivative_body: Vector3<f64>,
}

impl SavitzkyGolay {
    /// A window of `2 half_window + 1` samples and a polynomial of this order.
    ///
    /// # Errors
    /// [`IdentificationError::WindowTooShort`] where the window has no more samples than the order.
    pub fn try_new(half_window: usize, order: usize) -> Result<Self, IdentificationError> {
        let samples = 2 * half_window + 1;
        if samples <= order {
            return Err(IdentificationError::WindowTooShort { samples, order });
        }
        Ok(Self { half_window, order })
    }

    /// Samples on each side of the centre.
    pub fn half_window(&self) -> usize {
        self.half_window
    }

    /// Weights of the samples whose sum is the `derivative`-th derivative of the polynomial, `position` samples after the
    /// centre; with samples a step h apart divide by h to that power.
    ///
    /// Sums over orthogonal (Gram) polynomials, which stay exact where normal equations of powers do not.
    pub fn weights(&self, derivative: usize, position: f64) -> Vec<f64> {
        let nodes: Vec<f64> = (0..=2 * self.half_window).map(|i| i as f64 - self.half_window as f64).collect();
        polynomial_weights(&nodes, self.order, derivative, position)
    }

    /// Value, first and second derivative at the centre of every full window; entry 0 belongs to sample `half_window`.
    pub fn smooth_vectors(&self, samples: &[Vector3<f64>], step_s: f64) -> Vec<[Vector3<f64>; 3]> {
        let weights = self.three_weights(step_s);
        samples.windows(2 * self.half_window + 1).map(|window| weighted(&weights, window)).collect()
    }

    /// Pose, velocity and acceleration at the centre of every full window; entry 0 belongs to sample `half_window`.
    ///
    /// Rotations are fitted in the logarithm's chart about the centre, then once more about the smoothed rotation, where the
    /// chart's own curvature no longer enters.
    ///
    /// # Frame
    /// As the names of [`SmoothedMotion`] say.
    pub fn smooth_poses(&self, world_from_body: &[Pose<f64>], step_s: f64) -> Vec<SmoothedMotion> {
        let weights = self.three_weights(step_s);
        let fit_about = |centre: &UnitQuaternion<f64>, window: &[Pose<f64>]| {
            let turns: Vec<Vector3<f64>> =
                window.iter().map(|pose| LieGroup::log(&(centre.inverse() * pose.rotation))).collect();
            weighted(&weights, &turns)
        };
        world_from_body
            .windows(2 * self.half_window + 1)
            .map(|window| {
                // Positions relative to the centre, so that a distant origin costs no digits.
                let origin = window[self.half_window].translation.vector;
                let offsets: Vec<Vector3<f64>> = window.iter().map(|pose| pose.translation.vector - origin).collect();
                let [position, velocity, acceleration] = weighted(&weights, &offsets);
                let raw = window[self.half_window].rotation;
                let [turn, ..] = fit_about(&raw, window);
                let centre = raw * <UnitQuaternion<f64> as LieGroup>::exp(&turn);
                let [rest, rate, rate_derivative] = fit_about(&centre, window);
                let jacobian = <UnitQuaternion<f64> as LieGroup>::right_jacobian(&rest);
                SmoothedMotion {
                    world_from_body: Pose::from_parts(
                        Translation3::from(origin + position),
                        centre * <UnitQuaternion<f64> as LieGroup>::exp(&rest),
                    ),
                    velocity_origin_world: velocity,
                    acceleration_origin_world: acceleration,
                    rate_body: jacobian * rate,
                    // The derivative of the Jacobian to first order in what is left of the turn.
                    rate_derivative_body: jacobian * rate_derivative + rate.cross(&rest.cross(&rate)) / 6.0,
                }
            })
            .collect()
    }

    fn three_weights(&self, step_s: f64) -> [Vec<f64>; 3] {
        let per_s = 1.0 / step_s;
        [(0, 1.0), (1, per_s), (2, per_s * per_s)]
            .map(|(derivative, scale)| self.weights(derivative, 0.0).into_iter().map(|w| w * scale).collect())
    }
}

/// Weights of the samples at these nodes whose sum is a derivative, at `position`, of the polynomial of this order through them.
///
/// Sums over orthogonal polynomials of the nodes by their three-term recursion.
pub(crate) fn polynomial_weights(nodes: &[f64], order: usize, derivative: usize, position: f64) -> Vec<f64> {
    let mut weights = vec![0.0; nodes.len()];
    // Values of the polynomial before and the present one at the nodes, and their derivatives 0..=derivative at `position`.
    let (mut before, mut present) = (vec![0.0; nodes.len()], vec![1.0; nodes.len()]);
    let (mut before_at, mut present_at) = (vec![0.0; derivative + 1], vec![0.0; derivative + 1]);
    present_at[0] = 1.0;
    let mut norm_before = 1.0;
    for degree in 0..=order {
        let norm: f64 = present.iter().map(|p| p * p).sum();
        for (weight, p) in weights.iter_mut().zip(&present) {
            *weight += p * present_at[derivative] / norm;
        }
        let alpha = nodes.iter().zip(&present).map(|(x, p)| x * p * p).sum::<f64>() / norm;
        let beta = if degree == 0 { 0.0 } else { norm / norm_before };
        let next = |x: f64, p: f64, b: f64| (x - alpha) * p - beta * b;
        let after: Vec<f64> = nodes.iter().zip(&present).zip(&before).map(|((x, p), b)| next(*x, *p, *b)).collect();
        let after_at: Vec<f64> = (0..=derivative)
            .map(|d| {
                let from_product = if d == 0 { 0.0 } else { d as f64 * present_at[d - 1] };
                next(position, present_at[d], before_at[d]) + from_product
            })
            .collect();
        (before, present) = (present, after);
        (before_at, present_at) = (present_at, after_at);
        norm_before = norm;
    }
    weights
}

fn weighted(weights: &[Vec<f64>; 3], window: &[Vector3<f64>]) -> [Vector3<f64>; 3] {
    [0, 1, 2].map(|d| weights[d].iter().zip(window).fold(Vector3::zeros(), |sum, (w, x)| sum + x * *w))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::noise::Gaussian;

    fn close(found: &[f64], numerators: &[i32], denominator: f64) {
        assert_eq!(found.len(), numerators.len());
        for (f, n) in found.iter().zip(numerators) {
            assert!((f - f64::from(*n) / denominator).abs() < 1e-14, "{found:?}");
        }
    }

    /// The tables of Savitzky and Golay (1964).
    #[test]
    fn published_tables() {
        let weights = |m, order, d| SavitzkyGolay::try_new(m, order).unwrap().weights(d, 0.0);
        close(&weights(2, 2, 0), &[-3, 12, 17, 12, -3], 35.0);
        close(&weights(2, 2, 1), &[-2, -1, 0, 1, 2], 10.0);
        close(&weights(2, 2, 2), &[2, -1, -2, -1, 2], 7.0);
        close(&weights(3, 3, 1), &[22, -67, -58, 0, 58, 67, -22], 252.0);
        close(&weights(3, 4, 0), &[5, -30, 75, 131, 75, -30, 5], 231.0);
        // Two samples either side, order 4: the five-point formulas.
        close(&weights(2, 4, 1), &[1, -8, 0, 8, -1], 12.0);
        close(&weights(2, 4, 2), &[-1, 16, -30, 16, -1], 12.0);
    }

    #[test]
    fn polynomials_are_reproduced_everywhere_in_the_window() {
        for (m, order) in [(3_u32, 6_i32), (10, 4), (40, 7)] {
            let m = m as usize;
            let filter = SavitzkyGolay::try_new(m, order.unsigned_abs() as usize).unwrap();
            for power in 0..=order {
                for position in [0.0, 0.3, -(m as f64), m as f64] {
                    let scale = m as f64;
                    for (d, expected) in [
                        (0, (position / scale).powi(power)),
                        (1, f64::from(power) * (position / scale).powi((power - 1).max(0)) / scale),
                    ] {
                        let sum: f64 = filter
                            .weights(d, position)
                            .iter()
                            .enumerate()
                            .map(|(i, w)| w * ((i as f64 - m as f64) / scale).powi(power))
                            .sum();
                        assert!((sum - expected).abs() < 1e-11, "{m} {order} {power} {position} {d}: {sum} {expected}");
                    }
                }
            }
        }
        assert!(matches!(
            SavitzkyGolay::try_new(2, 5),
            Err(IdentificationError::WindowTooShort { samples: 5, order: 5 })
        ));
    }

    /// Angles, rates and accelerations of `reference/equations.md` e: golden body rate and its derivative.
    #[test]
    fn golden_rates_of_euler_angles() {
        let at = |t: f64| {
            let angle = |x: f64, v: f64, a: f64| x + v * t + a * t * t / 2.0;
            let rotation =
                UnitQuaternion::from_euler_angles(angle(0.3, 0.2, -0.1), angle(-0.2, -0.1, 0.3), angle(0.5, 0.3, 0.15));
            Pose::from_parts(Translation3::new(100.0 + 0.025 * t * t, 0.05 * t * t, 3.0 * t - 0.1 * t * t), rotation)
        };
        let step_s = 0.02;
        let poses: Vec<_> = (-8..=8).map(|k| at(f64::from(k) * step_s)).collect();
        let found = SavitzkyGolay::try_new(8, 6).unwrap().smooth_poses(&poses, step_s);
        assert_eq!(found.len(), 1);
        let motion = found[0];
        let rate = Vector3::new(0.259_600_799_238_52, -0.008_644_805_624_91, 0.310_440_029_741_39);
        let rate_derivative = Vector3::new(-0.040_797_603_045_5, 0.390_372_050_278_97, 0.047_823_021_834_85);
        assert!((motion.rate_body - rate).amax() < 1e-9, "{}", (motion.rate_body - rate).amax());
        assert!((motion.rate_derivative_body - rate_derivative).amax() < 1e-7);
        assert!((motion.acceleration_origin_world - Vector3::new(0.05, 0.1, -0.2)).amax() < 1e-9);
        assert!((motion.velocity_origin_world - Vector3::new(0.0, 0.0, 3.0)).amax() < 1e-11);
        assert!(motion.world_from_body.rotation.angle_to(&at(0.0).rotation) < 1e-9);
        assert!((motion.world_from_body.translation.vector - Vector3::new(100.0, 0.0, 0.0)).amax() < 1e-12);
    }

    #[test]
    fn noise_is_averaged_about_the_smoothed_rotation() {
        // A steady spin seen through noise: with re-centring the rate has no bias of the chart.
        let mut dice = Gaussian::from_seed(1);
        let mut noise = || (dice.uniform() - 0.5) * 0.02 * 12.0_f64.sqrt();
        let rate = Vector3::new(0.4, -1.2, 0.7);
        let (step_s, filter) = (0.016, SavitzkyGolay::try_new(10, 3).unwrap());
        let mut sum = Vector3::zeros();
        let mut sum_of_squares = 0.0;
        let poses: Vec<Pose<f64>> = (0..6000)
            .map(|k| {
                let true_rotation = <UnitQuaternion<f64> as LieGroup>::exp(&(rate * (f64::from(k) * step_s)));
                let jitter = <UnitQuaternion<f64> as LieGroup>::exp(&Vector3::new(noise(), noise(), noise()));
                Pose::from_parts(Translation3::identity(), true_rotation * jitter)
            })
            .collect();
        let smoothed = filter.smooth_poses(&poses, step_s);
        for motion in &smoothed {
            sum += motion.rate_body - rate;
            sum_of_squares += (motion.rate_body - rate).norm_squared() / 3.0;
        }
        let n = smoothed.len() as f64;
        // Predicted: the root sum of squares of the weights; 21 samples correlate neighbours.
        let weights: f64 = filter.weights(1, 0.0).iter().map(|w| w * w).sum();
        let expected = 0.02 * weights.sqrt() / step_s;
        assert!(
            ((sum_of_squares / n).sqrt() / expected - 1.0).abs() < 0.1,
            "{} {expected}",
            (sum_of_squares / n).sqrt()
        );
        assert!((sum / n).amax() < 4.0 * expected * (10.0 / n).sqrt(), "{}", sum / n);
    }
}
