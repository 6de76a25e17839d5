//! The rows of a part and a solid: the least gap on a segment, the gap at its end.

use super::closest::{Closest, closest};
use super::gap::{Approach, Part, Place, Solid};
use super::gauge::LEAST_CURVATURE;
use super::turn::Attitude;
use crate::local::model::{KINEMATICS, Kinematics};
use crate::local::rows::{MotionRow, MovingContact};
use nalgebra::Vector3;

/// What is farther than so many length scales counts by the balls that hold it.
const FAR: f64 = 5.0;
/// What a search for the least gap may leave, in length scales; it is taken off the gap found.
const TOLERANCE: f64 = 1e-3;
/// Step of differences along a segment.
const STEP: f64 = 1e-3;

/// How the rows of a motion are made.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RowSettings {
    /// Mission time of the first node, s.
    pub start_s: f64,
    /// Length of a segment, s.
    pub step_s: f64,
    /// Distance kept, m.
    pub margin_m: f64,
    /// Farthest that the body may be, between nodes, from where the interpolation of rows on segments takes it to be, m:
    /// see [`Surroundings::interpolation_error_m`](super::Surroundings::interpolation_error_m).
    pub interpolation_error_m: f64,
    /// Length over which rows measure distances, m: a row of a distance changes by one over it.
    pub length_scale_m: f64,
    /// On whole segments; otherwise at nodes only.
    pub on_segments: bool,
}

/// At the end of a segment.
pub(super) fn node_row(
    node: usize,
    part: &Part,
    solid: &Solid<'_>,
    center: &Vector3<f64>,
    end: &Kinematics,
    settings: &RowSettings,
) -> MotionRow {
    let position = end.world_from_body.translation.vector;
    let attitude = end.world_from_body.rotation.to_rotation_matrix();
    let mut gap = solid.ball_gap(part, center, &position, attitude.matrix());
    if gap.distance_m - settings.margin_m < FAR * settings.length_scale_m {
        gap = solid.gap(part, center, &position, attitude.matrix());
    }
    let per_m = 1.0 / settings.length_scale_m;
    let mut by_end = [0.0; KINEMATICS];
    for axis in 0..3 {
        by_end[axis] = per_m * gap.normal[axis];
        by_end[6 + axis] = per_m * gap.moment[axis];
    }
    let value = (gap.distance_m - settings.margin_m) * per_m;
    MotionRow { node, value, by_start: [0.0; KINEMATICS], by_end, contact: None }
}

impl Approach<'_> {
    /// The least on a segment.
    ///
    /// Of what is far the row is a lower bound: that of the balls around both in the middle, less what the motion can take off it.
    pub fn row<const GRADIENT: bool>(&self, node: usize, settings: &RowSettings) -> MotionRow {
        let per_m = 1.0 / settings.length_scale_m;
        let margin_m = settings.margin_m + settings.interpolation_error_m;
        let (balls, attitude) = self.of_balls(0.5);
        let bound_m = balls.gap.distance_m - 0.5 * self.bounds().0 - margin_m;
        if bound_m > FAR * settings.length_scale_m {
            return self.with_gradient(node, bound_m * per_m, &balls, &attitude, per_m);
        }
        let tolerance_m = TOLERANCE * settings.length_scale_m;
        let Closest { sides: [place, other], share, short_m } = closest(self, tolerance_m);
        let value = (place.gap.distance_m - margin_m - f64::max(tolerance_m, short_m)) * per_m;
        if !GRADIENT {
            return MotionRow { node, value, by_start: [0.0; KINEMATICS], by_end: [0.0; KINEMATICS], contact: None };
        }
        let attitude = self.turn.at(place.s);
        let mut row = self.with_gradient(node, value, &place, &attitude, per_m * (1.0 - share));
        if share > 0.0 {
            let other = self.with_gradient(node, value, &other, &self.turn.at(other.s), per_m * share);
            for (sum, term) in row.by_start.iter_mut().zip(&other.by_start) {
                *sum += term;
            }
            for (sum, term) in row.by_end.iter_mut().zip(&other.by_end) {
                *sum += term;
            }
        } else if place.s > 0.0 && place.s < 1.0 {
            row.contact = Some(self.contact(place.s, per_m));
        }
        row
    }

    fn with_gradient(&self, node: usize, value: f64, place: &Place, attitude: &Attitude, factor: f64) -> MotionRow {
        let [by_start, by_end] = self.by_ends(place, attitude).map(|ends| ends.map(|entry| entry * factor));
        MotionRow { node, value, by_start, by_end, contact: None }
    }

    /// By differences along the segment: the change of the slope by the ends is that of the gradient along `s`. This enters the
    /// curvature only.
    fn contact(&self, s: f64, factor: f64) -> MovingContact {
        let [(before, start), (after, end)] = [s - STEP, s + STEP].map(|s| self.with_attitude(s));
        let (before_by, after_by) = (self.by_ends(&before, &start), self.by_ends(&after, &end));
        let per = factor * 0.5 / STEP;
        let [by_start, by_end] =
            [0, 1].map(|end: usize| core::array::from_fn(|entry| (after_by[end][entry] - before_by[end][entry]) * per));
        let curvature = f64::max((after.slope - before.slope) * per, LEAST_CURVATURE);
        MovingContact { by_start, by_end, curvature }
    }
}
