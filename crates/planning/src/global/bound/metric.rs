//! Lengths in seconds at full speed, and the least times over them.

use super::least_time::{least_time, least_time_from};
use crate::collision::CollisionWorld;
use crate::error::{PlanningError, not_negative};
use crate::global::GlobalRequest;
use crate::global::diagnosis::acceleration_m_s2;
use nalgebra::Vector3;

/// Start, goal and limits in seconds at full speed.
#[derive(Clone, Debug)]
pub(super) struct Metric {
    pub(super) start: Vector3<f64>,
    pub(super) goal: Vector3<f64>,
    pub(super) radius_m: f64,
    /// Speed limits, m/s.
    pub(super) speed_m_s: Vector3<f64>,
    /// Acceleration per speed limit, 1/s.
    pub(super) acceleration: Vector3<f64>,
    /// Start velocity per speed limit.
    pub(super) first: Vector3<f64>,
    /// Largest speed on arrival per speed limit.
    pub(super) last: Vector3<f64>,
}

impl Metric {
    pub(super) fn new<W: CollisionWorld + ?Sized>(request: &GlobalRequest<'_, W>) -> Result<Self, PlanningError> {
        let limits = &request.limits;
        for speed in &limits.speed_m_s {
            not_negative("a speed limit", *speed)?;
        }
        let acceleration_m_s2 = acceleration_m_s2(&limits.force_n, request.belief.parameters().mass)?;
        let per_limit = |value: &Vector3<f64>| {
            value.zip_map(&limits.speed_m_s, |value, limit| if limit > 0.0 { value / limit } else { 0.0 })
        };
        Ok(Self {
            start: request.start.position,
            goal: request.goal.position,
            radius_m: not_negative("the radius of the goal region", request.goal.radius_m)?,
            speed_m_s: limits.speed_m_s,
            acceleration: per_limit(&acceleration_m_s2),
            first: per_limit(&request.start.velocity),
            last: per_limit(&Vector3::repeat(not_negative("the speed on arrival", request.goal.speed_m_s)?)),
        })
    }

    /// Time at full speed over a distance along an axis, s; zero for none, infinite where the axis is fixed.
    pub(super) fn seconds(&self, axis: usize, distance_m: f64) -> f64 {
        if distance_m > 0.0 { distance_m / self.speed_m_s[axis] } else { 0.0 }
    }

    /// Least time over a path of this length, from these scaled velocities to the goal's; s.
    pub(super) fn along(&self, length_s: f64, first: f64, last: f64) -> f64 {
        least_time(length_s, first, last, self.acceleration.max())
    }

    /// Per-axis lower bound from a state to the goal region without any wall, s.
    pub(super) fn unhindered_s(&self, position: &Vector3<f64>, first: &Vector3<f64>) -> f64 {
        let axis_time = |axis: usize| {
            let away = self.goal[axis] - position[axis];
            let direction = if away < 0.0 { -1.0 } else { 1.0 };
            let length_s = self.seconds(axis, away.abs() - self.radius_m);
            let (speed, slowing) = (first[axis], self.acceleration[axis]);
            let travel = least_time_from(length_s, direction * speed, self.last[axis], slowing);
            let excess = speed.abs().min(1.0) - self.last[axis];
            let slow_down = if excess > 0.0 { excess / slowing * (1.0 - 1e-12) } else { 0.0 };
            travel.max(slow_down)
        };
        (0..3).map(axis_time).fold(0.0, f64::max)
    }
}

/// Least length of a path that ends `steps` cells away and starts `depth_s` from the faces of its cell, s.
pub(super) fn length_s(steps: u32, depth_s: f64, edge_s: f64) -> f64 {
    if steps == 0 { 0.0 } else { (depth_s + f64::from(steps - 1) * edge_s) * (1.0 - 1e-12) }
}
