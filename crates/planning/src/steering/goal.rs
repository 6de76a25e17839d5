//! To a region rather than a state.

use super::axis::{Axis, Durations, Ends};
use super::synchronise::{Steering, common, steer};
use super::{TranslationLimits, axis};
use crate::global::GoalRegion;
use crate::motion::TranslationState;
use nalgebra::Vector3;

/// Halvings of the duration in search of the least in which the region is reached.
const HALVINGS: usize = 20;

/// Steps of the search for the velocity to arrive with, per duration.
const STEPS: usize = 12;

/// Relative width of the bracket of durations that ends the search.
const RESOLUTION: f64 = 1e-6;

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
    /// Durations in which some state of the interval is reached.
    ///
    /// The states reached in a time are a convex set, so those with an admissible arrival speed lie in an interval of
    /// displacements; a motion exists where it meets the region's. Its upper end belongs to the highest arrival speed.
    fn durations(&self) -> Durations {
        let Self { velocity, acceleration, arrival, slack, displacement: [least, most], .. } = *self;
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
/// Each axis is asked for the interval of positions and speeds that the region spans along it; exact for a region that is a
/// state of rest.
pub fn least_time_to_goal_s(from: &TranslationState, goal: &GoalRegion, limits: &TranslationLimits) -> f64 {
    let durations = |index: usize| {
        let (position, center) = (from.position[index], goal.position[index]);
        let speed = limits.speed_m_s[index];
        let velocity = from.velocity[index];
        let is_within = velocity.abs() <= speed * (1.0 + axis::SPEED_TOLERANCE);
        if !is_within {
            return Durations::NONE;
        }
        let reach = Reach {
            velocity,
            displacement: [center - position - goal.radius_m, center - position + goal.radius_m],
            arrival: goal.speed_m_s.min(speed),
            speed,
            acceleration: limits.acceleration_m_s2[index],
            slack: axis::ROUNDINGS * (position.abs() + center.abs() + goal.radius_m),
        };
        reach.durations()
    };
    common(&[durations(0), durations(1), durations(2)], 0.0)
}

/// A motion into the region within all limits, of a duration near the least; `None` where none was found.
///
/// For each duration the state nearest to the region's centre is a convex problem in the arrival velocity; the duration is
/// halved towards [`least_time_to_goal_s`]. Exact for a region that is a state of rest.
pub fn steer_to_goal(from: &TranslationState, goal: &GoalRegion, limits: &TranslationLimits) -> Option<Steering> {
    let mut best = steer(from, &TranslationState::at_rest(goal.position), limits);
    if goal.radius_m <= 0.0 && goal.speed_m_s <= 0.0 {
        return best;
    }
    let mut low_s = least_time_to_goal_s(from, goal, limits);
    // The centre may be out of reach, or the way to rest there out of the box, where the rest of the region is not.
    let mut high_s = best.as_ref().map_or(4.0 * low_s + slowest_stop_s(limits), Steering::duration_s);
    if !(low_s.is_finite() && high_s.is_finite()) {
        return best;
    }
    let mut duration_s = low_s;
    for _ in 0..HALVINGS {
        match arrival(from, goal, limits, duration_s).and_then(|to| steer(from, &to, limits)) {
            Some(steering) => {
                high_s = duration_s.min(steering.duration_s());
                if best.as_ref().is_none_or(|best| steering.duration_s() < best.duration_s()) {
                    best = Some(steering);
                }
            }
            None => low_s = duration_s,
        }
        if high_s - low_s <= RESOLUTION * high_s {
            break;
        }
        duration_s = 0.5 * (low_s + high_s);
    }
    best
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
    for step in 0..STEPS {
        let (mut offset, mut uphill) = (Vector3::zeros(), Vector3::zeros());
        for index in 0..3 {
            let velocities = [from.velocity[index], velocity[index]];
            let (speed, acceleration) = (limits.speed_m_s[index], limits.acceleration_m_s2[index]);
            let [least, most] = axis::band(velocities, speed, acceleration, duration_s);
            let nearest = wanted[index].max(least.displacement).min(most.displacement);
            let slope = if nearest > wanted[index] { least.slope_s } else { most.slope_s };
            offset[index] = nearest - wanted[index];
            uphill[index] = offset[index] * slope;
        }
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
        let corner = reachable(downhill * (speed / f64::sqrt(downhill.norm_squared())));
        velocity += (corner - velocity) * (2.0 / (step as f64 + 2.0));
    }
    None
}
