//! What it costs that walls force an axis out and back.
//!
//! Where every way to the goal must reach farther along an axis than both the start and the goal region do, that coordinate
//! is largest at some time in between, and the axis stands still there. So the duration is at least, over all cells that may
//! hold that farthest point, the least sum of the times to it (arriving at rest along the axis) and from it (leaving at rest).

use super::grid::Grid;
use super::least_time::{least_time, least_time_from};
use super::metric::{Metric, length_s};
use super::survey::{Cell, NEVER, Stop, Survey, layer_of};
use crate::collision::CollisionWorld;

/// One axis in one direction.
struct Direction<'a> {
    metric: &'a Metric,
    axis: usize,
    sign: f64,
}

impl Direction<'_> {
    /// Coordinate along the direction at the near face of a cell, m.
    fn near_face(&self, grid: &Grid, cell: usize) -> f64 {
        let (lower, upper) = grid.span(cell, self.axis);
        if self.sign > 0.0 { lower } else { -upper }
    }

    /// Least times to come from the start to rest at `farthest_m`, and from rest there to the goal region, s.
    fn there_and_back(&self, farthest_m: f64) -> (f64, f64) {
        let (metric, axis) = (self.metric, self.axis);
        let acceleration = metric.acceleration[axis];
        let first = self.sign * metric.first[axis];
        let out = metric.seconds(axis, farthest_m - self.sign * metric.start[axis]);
        let back = metric.seconds(axis, farthest_m - self.sign * metric.goal[axis] - metric.radius_m);
        let stop = if first > 0.0 { 0.5 * first * first / acceleration } else { 0.0 };
        (
            least_time_from(out.max(stop), first, 0.0, acceleration),
            least_time(back, 0.0, metric.last[axis], acceleration),
        )
    }
}

/// Least duration because of forced turns, s; zero where there are none.
pub(super) fn least_time_s<W: CollisionWorld + ?Sized>(
    survey: &mut Survey<'_, W>,
    metric: &Metric,
    start: usize,
    goals: &[usize],
    steps_from_start: &[u32],
    steps_to_goal: &[u32],
) -> Result<f64, Stop> {
    let mut is_goal = vec![false; survey.level.grid.len()];
    for goal in goals {
        is_goal[*goal] = survey.look(*goal)? != Cell::Blocked;
    }
    let mut best_s = 0.0_f64;
    for axis in 0..3 {
        for is_downward in [false, true] {
            let Some(highest) = survey.least_highest_layer(start, &is_goal, axis, is_downward)? else { continue };
            let direction = Direction { metric, axis, sign: if is_downward { -1.0 } else { 1.0 } };
            let grid = &survey.level.grid;
            let reach = |position: f64| direction.sign * position;
            let beyond = reach(metric.start[axis]).max(reach(metric.goal[axis]) + metric.radius_m);
            let mut least_s = f64::INFINITY;
            for cell in 0..grid.len() {
                let (before, after) = (steps_from_start[cell], steps_to_goal[cell]);
                if before == NEVER || after == NEVER || layer_of(grid, cell, axis, is_downward) < highest {
                    continue;
                }
                let near = direction.near_face(grid, cell);
                if near <= beyond {
                    // The farthest point may be the start or the goal: nothing is forced.
                    least_s = 0.0;
                    break;
                }
                let (out_s, back_s) = direction.there_and_back(near);
                if out_s + back_s >= least_s {
                    continue;
                }
                let acceleration = metric.acceleration.max();
                let to = length_s(before, grid.depth_s(&metric.start), grid.edge_s());
                let from = length_s(after, 0.0, grid.edge_s());
                let first_leg = out_s.max(least_time(to, metric.first.amax(), 1.0, acceleration));
                let second_leg = back_s.max(least_time(from, 1.0, metric.last.max(), acceleration));
                least_s = least_s.min(first_leg + second_leg);
            }
            if least_s.is_finite() {
                best_s = best_s.max(least_s);
            }
        }
    }
    survey.pay(u32::try_from(survey.level.grid.len() / 16).unwrap_or(u32::MAX))?;
    Ok(best_s)
}
