//! A map that moved, or a motion that is not where it was believed: when it begins anew, and from what.

use super::filtered::{Filtered, Jump, Rules, Unsettled};
use super::flight_motion::{BODY, COORDINATES, WANDER};
use crate::estimator::{Gauss, Measurement};
use crate::lie::LieGroup;
use nalgebra::{ComplexField, Matrix3, Vector3};

/// Two poses seen after a jump are the same within so many standard deviations.
const AGREE: f64 = 6.0;
/// Without agreement the motion begins anew after so many times the patience, and the body is in doubt.
const OUT_OF_PATIENCE: f64 = 2.0;
/// A localisation that moved is not to be learned from for so long.
pub(super) const SETTLING_NS: i64 = 5_000_000_000;
/// One that keeps moving for longer than this is right, and it is the body that is not what is believed.
const LONGEST_SETTLING_NS: i64 = 10_000_000_000;

impl Filtered {
    /// Counts an unlikely measurement; true where there were enough of them and motion begins anew at this one. `localised`: whether
    /// attitude and position were seen.
    pub(super) fn begins_anew(&mut self, rules: &Rules, measurement: &Measurement, localised: [bool; 2]) -> bool {
        let (now_ns, expected) = (measurement.stamp_ns, self.state.joint.motion.world_from_body);
        let settings = &rules.settings;
        let mut seen = expected;
        let mut deviations = [0.0; 2];
        if let Some(attitude) = &measurement.attitude {
            (seen.rotation, deviations[0]) = (attitude.value, largest_deviation(attitude));
        }
        if let Some(position) = &measurement.position_world {
            (seen.translation, deviations[1]) = (position.value.into(), largest_deviation(position));
        }
        let has_pose = localised.contains(&true);
        let seen_from_expected = seen.compose(&expected.inverse());
        let fresh =
            Jump { since_ns: now_ns, agreeing_since_ns: now_ns, agreeing: 1, of: localised, seen_from_expected };
        let jump = match self.jump {
            None => fresh,
            // A pose that repeats the last one to the bit agrees with nothing, nor does a place with an attitude.
            Some(jump) if !has_pose || (jump.of != localised && jump.of.contains(&true)) => jump,
            Some(jump) => {
                let apart = LieGroup::log(&jump.seen_from_expected.compose(&expected).between(&seen));
                let within = |k: usize| {
                    !localised[k]
                        || apart.fixed_rows::<3>(3 * k).amax() <= AGREE * core::f64::consts::SQRT_2 * deviations[k]
                };
                if jump.of == localised && within(0) && within(1) {
                    Jump { agreeing: jump.agreeing.saturating_add(1), ..jump }
                } else {
                    Jump { since_ns: jump.since_ns, ..fresh }
                }
            }
        };
        self.jump = Some(jump);
        let agreed =
            now_ns - jump.agreeing_since_ns >= rules.relocalise_after_ns && jump.agreeing >= settings.relocalise_count;
        let waited = (now_ns - jump.since_ns) as f64 >= OUT_OF_PATIENCE * rules.relocalise_after_ns as f64;
        // Where nothing but rates was unlikely there is nothing else to begin at.
        let has_begin = has_pose
            || measurement.attitude.is_none()
                && measurement.position_world.is_none()
                && !jump.of.contains(&true)
                && (measurement.rate_body.is_some() || measurement.velocity_world.is_some());
        let agreed = agreed && has_pose;
        if !(agreed || waited) || !has_begin {
            return false;
        }
        let is_the_body = self.keeps_moving(agreed, now_ns);
        self.monitor = self.monitor.doubting(is_the_body);
        self.jump = None;
        self.begin_at(rules, measurement);
        true
    }

    /// Takes note of a localisation that moved; whether it is rather the body that moves otherwise than believed. What moved by
    /// as much at every moment is a map; after it the estimate may glide back, by something else at every moment.
    fn keeps_moving(&mut self, agreed: bool, now_ns: i64) -> bool {
        let before = self.unsettled.filter(|before| now_ns < before.until_ns);
        let since_ns = before.map_or(now_ns, |before| before.since_ns);
        let is_the_body = before.is_none() && !agreed || now_ns - since_ns > LONGEST_SETTLING_NS;
        let until_ns = now_ns.saturating_add(SETTLING_NS);
        self.unsettled = (!is_the_body).then_some(Unsettled { since_ns, until_ns });
        is_the_body
    }

    /// Motion from a measurement, without memory; the body as it is.
    fn begin_at(&mut self, rules: &Rules, measurement: &Measurement) {
        let before = self.covariance.fixed_view::<BODY, BODY>(0, 0).into_owned();
        let (motion, known) =
            rules.model.begun_at(&self.state.joint.motion, &before, measurement, &rules.settings.start_deviation);
        self.state.joint.motion = motion;
        self.covariance.fixed_view_mut::<BODY, COORDINATES>(0, 0).fill(0.0);
        self.covariance.fixed_view_mut::<COORDINATES, BODY>(0, 0).fill(0.0);
        self.covariance.fixed_view_mut::<BODY, BODY>(0, 0).copy_from(&known);
        self.begin_wander(rules);
    }

    /// Of a motion that was just taken from a measurement: that is off by a wander of which no more is known than how large it is.
    fn begin_wander(&mut self, rules: &Rules) {
        self.state.wander = [Vector3::zeros(); 3];
        self.covariance.fixed_view_mut::<9, COORDINATES>(WANDER, 0).fill(0.0);
        self.covariance.fixed_view_mut::<COORDINATES, 9>(0, WANDER).fill(0.0);
        let body_from_world = self.state.joint.motion.world_from_body.rotation.inverse().to_rotation_matrix();
        let turns = [Matrix3::identity(), body_from_world.into_inner(), body_from_world.into_inner()];
        for (k, (error, turn)) in rules.settings.slow.wander().iter().zip(turns).enumerate() {
            let (motion, wander, variance) = ([0, 3, 9][k], WANDER + 3 * k, error.sigma * error.sigma);
            let shared = turn * -variance;
            for i in 0..3 {
                self.covariance[(wander + i, wander + i)] = variance;
                if !(rules.settings.planar && self.covariance[(motion + i, motion + i)] == 0.0) {
                    self.covariance[(motion + i, motion + i)] += variance;
                    for j in 0..3 {
                        self.covariance[(motion + i, wander + j)] = shared[(i, j)];
                        self.covariance[(wander + j, motion + i)] = shared[(i, j)];
                    }
                }
            }
        }
    }
}

/// The largest standard deviation of an axis that was measured.
fn largest_deviation<V>(seen: &Gauss<V>) -> f64 {
    let variances = seen.covariance.diagonal();
    ComplexField::sqrt(variances.iter().filter(|variance| variance.is_finite()).fold(0.0, |a, b| f64::max(a, *b)))
}
