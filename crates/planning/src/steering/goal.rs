//! To a region rather than a state.

use super::axis::{Axis, Durations, Ends};
use super::synchronise::{Steering, common, steer};
use super::{TranslationLimits, axis};
use crate::error::LARGEST;
use crate::global::GoalRegion;
use crate::motion::TranslationState;
use nalgebra::Vector3;

/// Halvings of the duration in search of the least in which the region is reached.
const HALVINGS: usize = 16;

/// Parts of the way from the bound to a known duration that are tried first.
const PARTS: [f64; 7] = [0.0, 0.5e-4, 0.5e-3, 0.5e-2, 0.03, 0.1, 0.3];

/// Steps of the search for the velocity to arrive with, per duration.
const STEPS: usize = 12;

/// Relative width of the bracket of durations that ends the search.
const RESOLUTION: f64 = 1e-4;

/// How far inside the region's limits an arrival is sought, relative to them.
const MARGIN: f64 = 1e-12;

/// The region along one axis: the interval of positions and speeds that the region's ball and arrival speed allow at most.
#[derive(Clone, Copy, Debug)]
struct Reach {
    velocity: f64,
    /// Least and largest displacement that ends in the region, m.
    displacement: [f64; 2],
    /// Largest arrival speed.
    arrival: f64,
    speed: f64,
    acceleration: f64,
    /// What rounding of the ends can change a displacement by, m.
    slack: f64,
}

impl Reach {
    /// From a velocity to the region whose centre lies at a displacement, within these limits of speed and acceleration.
    fn new(velocity: f64, center: f64, goal: &GoalRegion, [speed, acceleration]: [f64; 2], slack: f64) -> Self {
        Self {
            velocity,
            displacement: [center - goal.radius_m, center + goal.radius_m],
            arrival: goal.speed_m_s.min(speed),
            speed,
            acceleration,
            slack,
        }
    }

    /// Durations in which some state of the interval is reached.
    ///
    /// The states reached in a time are a convex set, so those with an admissible arrival speed lie in an interval of
    /// displacements; a motion exists where it meets the region's. Its upper end belongs to the highest arrival speed.
    fn durations(&self) -> Durations {
        let Self { velocity, acceleration, arrival, slack, displacement: [least, most], .. } = *self;
        let is_within = velocity.abs() <= self.speed * (1.0 + axis::SPEED_TOLERANCE);
        if !is_within {
            return Durations::NONE;
        }
        if acceleration <= 0.0 {
            return self.drift();
        }
        // Into the band of arrival speeds first: everything needs that long.
        let excess = (velocity.abs() - arrival).max(0.0);
        let enter_s = excess / acceleration;
        let entered = 0.5 * (velocity + (velocity.abs() - excess).copysign(velocity)) * enter_s;
        let least_s = if entered < least - slack {
            self.climb(least, 1.0)
        } else if entered > most + slack {
            self.climb(-most, -1.0)
        } else {
            enter_s
        };
        let mut durations = Durations { least_s, ..Durations::NONE };
        // Who moves through the region and brakes too late overshoots it and has to come back.
        let (forward, room) = if velocity > 0.0 { (velocity, most) } else { (-velocity, -least) };
        let given = room + slack;
        let left = forward * forward - 2.0 * acceleration * given;
        if entered.abs() <= given && room >= -slack && left > 0.0 {
            let left = f64::sqrt(left);
            let until_s = (2.0 * given / (forward + left)).max(least_s);
            durations.gap_s = [until_s, ((forward + left) / acceleration).max(until_s)];
        }
        durations
    }

    /// Least time to a displacement in the direction `sign`, arriving as fast as that makes it shortest.
    fn climb(&self, displacement: f64, sign: f64) -> f64 {
        let velocity = sign * self.velocity;
        let squared = velocity * velocity + 2.0 * self.acceleration * displacement;
        if velocity <= self.arrival && squared <= self.arrival * self.arrival {
            let arrival = f64::sqrt(squared.max(0.0));
            return if velocity > 0.0 {
                2.0 * displacement / (velocity + arrival)
            } else {
                (arrival - velocity) / self.acceleration
            };
        }
        let ends = Ends {
            position: [0.0, displacement],
            velocity: [velocity, self.arrival],
            speed: self.speed,
            acceleration: self.acceleration,
        };
        Axis::new(ends).map_or(f64::INFINITY, |axis| axis.durations().least_s)
    }

    /// Without acceleration the region is crossed or not.
    #[cold]
    fn drift(&self) -> Durations {
        let Self { velocity, slack, displacement: [least, most], .. } = *self;
        let (near, far) = if velocity < 0.0 { (-most, -least) } else { (least, most) };
        let (near, far) = (near - slack, far + slack);
        if velocity.abs() > self.arrival || far < 0.0 || (velocity == 0.0 && near > 0.0) {
            return Durations::NONE;
        }
        if velocity == 0.0 {
            return Durations { least_s: 0.0, ..Durations::NONE };
        }
        let least_s = (near / velocity.abs()).max(0.0);
        Durations { least_s, gap_s: [(far / velocity.abs()).max(least_s), f64::INFINITY], ..Durations::NONE }
    }
}

/// Lower bound on the duration of any motion from a state into the region within the limits of speed and acceleration, s;
/// infinite where there is none. The position box is not looked at.
///
/// Each axis, and the line towards the centre, is asked for the interval of positions and speeds that the region spans along
/// it; exact for a region that is a state of rest.
pub fn least_time_to_goal_s(from: &TranslationState, goal: &GoalRegion, limits: &TranslationLimits) -> f64 {
    if !is_moderate(from, goal, limits) {
        return f64::INFINITY;
    }
    let along = |index: usize| {
        let (position, center) = (from.position[index], goal.position[index]);
        let (speed, acceleration) = (limits.speed_m_s[index], limits.acceleration_m_s2[index]);
        let slack = axis::ROUNDINGS * (position.abs() + center.abs() + goal.radius_m);
        Reach::new(from.velocity[index], center - position, goal, [speed, acceleration], slack).durations()
    };
    let [x, y, z] = [along(0), along(1), along(2)];
    let axes = common(&[x, y, z], 0.0);
    let wanted = goal.position - from.position;
    let distance = f64::sqrt(wanted.norm_squared());
    let is_region = goal.radius_m > 0.0 || goal.speed_m_s > 0.0;
    if !(is_region && distance.is_finite() && distance > 0.0 && axes.is_finite()) {
        return axes;
    }
    // Towards the centre, with the most that the boxes of speed and acceleration allow in that direction.
    let direction = wanted / distance;
    let most = |limit: &Vector3<f64>| limit.dot(&direction.abs());
    let slack = 4.0 * axis::ROUNDINGS * (from.position.abs().sum() + goal.position.abs().sum() + goal.radius_m);
    let velocity = from.velocity.dot(&direction);
    let most = [most(&limits.speed_m_s) * (1.0 + 1e-15), most(&limits.acceleration_m_s2) * (1.0 + 1e-15)];
    let sight = Reach::new(velocity, distance, goal, most, slack).durations();
    common(&[x, y, z, sight], axes)
}

/// A motion into the region within all limits, of a duration near the least; `None` where none was found.
///
/// For each duration the state nearest to the region's centre is a convex problem in the arrival velocity; the duration is
/// halved towards [`least_time_to_goal_s`]. Exact for a region that is a state of rest.
pub fn steer_to_goal(from: &TranslationState, goal: &GoalRegion, limits: &TranslationLimits) -> Option<Steering> {
    if !is_moderate(from, goal, limits) {
        return None;
    }
    let is_slow = f64::sqrt(from.velocity.norm_squared()) <= goal.speed_m_s;
    if is_slow && f64::sqrt((from.position - goal.position).norm_squared()) <= goal.radius_m {
        return steer(from, from, limits);
    }
    let mut best = steer(from, &TranslationState::at_rest(goal.position), limits);
    if goal.radius_m <= 0.0 && goal.speed_m_s <= 0.0 {
        return best;
    }
    let low_s = least_time_to_goal_s(from, goal, limits);
    let mut failed_s = low_s;
    // The centre may be out of reach, or the way to rest there out of the box, where the rest of the region is not.
    let mut high_s = best.as_ref().map_or(4.0 * low_s + slowest_stop_s(limits), Steering::duration_s);
    if !(low_s.is_finite() && high_s.is_finite()) {
        return best;
    }
    let mut attempt = |duration_s: f64| {
        let steering = arrival(from, goal, limits, duration_s).and_then(|to| steer(from, &to, limits))?;
        if best.as_ref().is_none_or(|best| steering.duration_s() < best.duration_s()) {
            best = Some(steering);
        }
        Some(duration_s.min(steering.duration_s()))
    };
    // Near the bound there may be durations, and a gap after them that halving from above would not look behind.
    let span_s = high_s - low_s;
    for part in PARTS {
        let duration_s = low_s + part * span_s;
        if let Some(found_s) = attempt(duration_s) {
            high_s = found_s;
            break;
        }
        failed_s = duration_s;
    }
    for _ in 0..HALVINGS {
        if high_s - failed_s <= RESOLUTION * high_s {
            break;
        }
        let duration_s = 0.5 * (failed_s + high_s);
        match attempt(duration_s) {
            Some(found_s) => high_s = found_s,
            None => failed_s = duration_s,
        }
    }
    best
}

/// Whether all numbers are some, and square to numbers; an infinite limit of speed is none.
fn is_moderate(from: &TranslationState, goal: &GoalRegion, limits: &TranslationLimits) -> bool {
    let states = from.position.iter().chain(&from.velocity).chain(&goal.position);
    let mut numbers = states.chain([&goal.radius_m, &goal.speed_m_s]).chain(&limits.acceleration_m_s2);
    let is_push = |limit: &f64| *limit == 0.0 || (1.0 / LARGEST..=LARGEST).contains(limit);
    numbers.all(|number| number.abs() <= LARGEST)
        && limits.speed_m_s.iter().all(|limit| *limit >= 0.0)
        && limits.acceleration_m_s2.iter().all(is_push)
}

/// Longest time from full speed to rest along an axis that can be accelerated, s.
fn slowest_stop_s(limits: &TranslationLimits) -> f64 {
    let stop = |(speed, acceleration): (&f64, &f64)| if *acceleration > 0.0 { speed / acceleration } else { 0.0 };
    limits.speed_m_s.iter().zip(&limits.acceleration_m_s2).map(stop).fold(0.0, f64::max)
}

/// A state of the region that is reached in `duration_s`, found by conditional gradients over the ball of arrival
/// velocities; `None` where none was found.
fn arrival(
    from: &TranslationState,
    goal: &GoalRegion,
    limits: &TranslationLimits,
    duration_s: f64,
) -> Option<TranslationState> {
    // Inside by some roundings, so that whoever computes the norms again finds it inside too.
    let (radius, speed) = (goal.radius_m * (1.0 - MARGIN), goal.speed_m_s * (1.0 - MARGIN));
    let change = limits.acceleration_m_s2 * duration_s;
    let lowest = (from.velocity - change).sup(&-limits.speed_m_s);
    let highest = (from.velocity + change).inf(&limits.speed_m_s);
    let reachable = |velocity: Vector3<f64>| velocity.sup(&lowest).inf(&highest);
    let wanted = goal.position - from.position;
    let mut velocity = reachable(Vector3::zeros());
    for _ in 0..STEPS {
        let (mut offset, mut slopes) = (Vector3::zeros(), Vector3::zeros());
        for index in 0..3 {
            let velocities = [from.velocity[index], velocity[index]];
            let (speed, acceleration) = (limits.speed_m_s[index], limits.acceleration_m_s2[index]);
            let [least, most] = axis::band(velocities, speed, acceleration, duration_s);
            let nearest = wanted[index].max(least.displacement).min(most.displacement);
            let slope = if nearest > wanted[index] { least.slope_s } else { most.slope_s };
            offset[index] = nearest - wanted[index];
            slopes[index] = if offset[index] == 0.0 { 0.0 } else { slope };
        }
        let uphill = offset.component_mul(&slopes);
        let is_slow = f64::sqrt(velocity.norm_squared()) <= speed;
        if is_slow && f64::sqrt(offset.norm_squared()) <= radius {
            return Some(TranslationState { position: goal.position + offset, velocity });
        }
        // The corner of the ball towards which the squared miss falls fastest.
        let steepness = uphill.amax();
        if !(is_slow && steepness > 0.0) {
            return None;
        }
        let downhill = uphill / -steepness;
        let corner = downhill * (speed / f64::sqrt(downhill.norm_squared()));
        // The miss is convex in the velocity: its tangent at the corner bounds it from below over the whole ball.
        if 0.5 * offset.norm_squared() + uphill.dot(&(corner - velocity)) > 0.5 * goal.radius_m * goal.radius_m {
            return None;
        }
        let step = reachable(corner) - velocity;
        let curvature = slopes.component_mul(&step).norm_squared();
        if curvature <= 0.0 {
            return None;
        }
        velocity += step * (-uphill.dot(&step) / curvature).clamp(0.0, 1.0);
    }
    None
}
