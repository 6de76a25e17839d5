//! How far velocities and rates bend between two nodes.

use super::surroundings::MotionBounds;
use nalgebra::Vector3;

/// Largest angular acceleration of a free body by its own turning, over the squared rate.
///
/// By Euler's equations it is `k_i w_j w_k` about each principal axis, with `k_i = (J_j - J_k) / J_i`, and the vector of the
/// products is at most `w^2 / sqrt(3)` long.
pub(super) fn own_turning(moments: &Vector3<f64>) -> f64 {
    let unlike = |i: usize| ((moments[(i + 1) % 3] - moments[(i + 2) % 3]) / moments[i]).abs();
    (0..3).map(unlike).fold(0.0, f64::max) / f64::sqrt(3.0)
}

/// Farthest that a component of the velocity of the origin and one of the rate are from the straight line between two nodes,
/// m/s and rad/s, for a body with this [`own_turning`] under a wrench held in body axes.
///
/// That is `step^2 / 8` times the largest second derivative. A free body's own turning gives it at most `g w^2` of angular
/// acceleration at a rate `w`; with `b` for all of it, the rate has `2 g w b`, the velocity of the centre of mass `w a`, and that of
/// the origin besides `2 g w b + 3 w b + w^3` times its distance from there.
pub(super) fn bends(step_s: f64, bounds: &MotionBounds, own_turning: f64) -> [f64; 2] {
    let bend = step_s * step_s / 8.0 * bounds.rate_rad_s;
    let squared_rate = bounds.rate_rad_s * bounds.rate_rad_s;
    let turn = bounds.angular_acceleration_rad_s2 + own_turning * squared_rate;
    let lever = bounds.center_of_mass_m * ((2.0 * own_turning + 3.0) * turn + squared_rate);
    [bend * (bounds.acceleration_m_s2 + lever), bend * 2.0 * own_turning * turn]
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::UnitQuaternion;

    /// Motions integrated with fine steps, by Euler's equations about the centre of mass.
    #[test]
    fn velocities_and_rates_bend_no_more() {
        const COUNT: usize = 200;
        let mut largest = [0.0_f64; 2];
        for seed in 0..400_u32 {
            let draw = |i: u32| libm::sin(f64::from(seed) * 12.9898 + f64::from(i) * 78.233 + 1.0);
            let vector = |i: u32| Vector3::new(draw(i), draw(i + 1), draw(i + 2));
            // second moments of the mass: bodies from rods to balls
            let spread = vector(0).map(|x| libm::pow(10.0, 1.5 * x));
            let moments = spread.map(|x| spread.sum() - x);
            let (arm, push) = (vector(3) * 0.1, vector(6) * 0.05);
            let spin = if seed % 3 == 0 { 0.0 } else { 0.3 };
            let torque = (vector(9) * spin).component_mul(&moments);
            let step_s = 1.0;
            let fine = step_s / COUNT as f64;
            let (mut rate, mut velocity, mut attitude) = (vector(12), vector(15), UnitQuaternion::identity());
            let change = |w: &Vector3<f64>| (torque - w.cross(&moments.component_mul(w))).component_div(&moments);
            let (mut fastest, mut motions) = (0.0_f64, Vec::new());
            for _ in 0..=COUNT {
                motions.push([velocity - attitude * rate.cross(&arm), rate]);
                fastest = fastest.max(f64::sqrt(rate.norm_squared()));
                let middle_rate = rate + change(&rate) * (0.5 * fine);
                velocity += attitude * UnitQuaternion::from_scaled_axis(rate * (0.5 * fine)) * push * fine;
                attitude *= UnitQuaternion::from_scaled_axis(middle_rate * fine);
                rate += change(&middle_rate) * fine;
            }
            let bounds = MotionBounds {
                acceleration_m_s2: f64::sqrt(push.norm_squared()),
                rate_rad_s: fastest,
                angular_acceleration_rad_s2: f64::sqrt(torque.component_div(&moments).norm_squared()),
                center_of_mass_m: f64::sqrt(arm.norm_squared()),
            };
            let bound = bends(step_s, &bounds, own_turning(&moments));
            for kind in 0..2 {
                let (from, to) = (motions[0][kind], motions[COUNT][kind]);
                for (i, motion) in motions.iter().enumerate() {
                    let apart = motion[kind] - (from + (to - from) * (i as f64 / COUNT as f64));
                    largest[kind] = largest[kind].max(apart.amax() / bound[kind]);
                }
            }
        }
        assert!(largest.iter().all(|ratio| (0.2..1.0).contains(ratio)), "{largest:?} of the bounds");
    }

    #[test]
    fn a_ball_does_not_turn_of_its_own() {
        assert!(own_turning(&Vector3::repeat(0.3)) < 1e-15);
        // a rod: about its own axis nothing opposes
        assert!((own_turning(&Vector3::new(1.0, 1.0, 1e-6)) - 1.0 / f64::sqrt(3.0)).abs() < 1e-6);
    }
}
