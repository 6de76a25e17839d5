//! What can be said of a problem without a search.

use super::{GlobalRequest, Obstruction};
use crate::collision::{Clearance, CollisionWorld};
use crate::error::{PlanningError, moderate, not_negative, positive, zero_or_moderate};
use nalgebra::{Translation3, UnitQuaternion, Vector3};
use tumble_lie::Pose;

/// Cells along each axis of the box around the goal region.
const CELLS: u32 = 10;

/// Why there certainly is no plan, where that shows at the start, at the goal region or in the limits.
///
/// `None` says nothing: the way between may still be closed, see [`super::RouteBound`]. The goal of a body that may arrive with
/// another attitude than it starts with is never called blocked.
///
/// # Errors
/// Numbers that are not finite or have the wrong sign; what the world cannot answer.
pub fn diagnose<W: CollisionWorld + ?Sized>(
    request: &GlobalRequest<'_, W>,
) -> Result<Option<Obstruction>, PlanningError> {
    check_numbers(request)?;
    let margin_m = request.margin_m;
    if let Some(obstruction) = outside_limits(request)? {
        return Ok(Some(obstruction));
    }
    let world_from_body = Pose::from_parts(Translation3::from(request.start.position), request.attitude);
    let clearance = request.world.clearance(request.body, &world_from_body, request.start_s)?;
    if let (true, Some(blocker)) = (clearance.distance_m < margin_m, clearance.nearest) {
        return Ok(Some(Obstruction::StartBlocked { blocker, clearance_m: clearance.distance_m }));
    }
    goal_blocked(request)
}

/// Checks that every number that a request brings is one, and can be computed with.
///
/// # Errors
/// Numbers that are not finite, have the wrong sign, or are beyond 1e20; a box that is empty.
pub(super) fn check_numbers<W: CollisionWorld + ?Sized>(request: &GlobalRequest<'_, W>) -> Result<(), PlanningError> {
    for number in request.start.position.iter().chain(&request.start.velocity).chain(&request.goal.position) {
        moderate("a coordinate of the start or the goal", *number)?;
    }
    moderate("the margin", request.margin_m)?;
    moderate("the time of the start", request.start_s)?;
    crate::error::attitude(&request.attitude)?;
    moderate("the radius of the goal region", not_negative("the radius of the goal region", request.goal.radius_m)?)?;
    moderate("the speed on arrival", not_negative("the speed on arrival", request.goal.speed_m_s)?)?;
    let limits = &request.limits;
    for limit in &limits.speed_m_s {
        zero_or_moderate("a speed limit", not_negative("a speed limit", *limit)?)?;
    }
    acceleration_m_s2(&limits.force_n, request.belief.parameters().mass)?;
    for axis in 0..3 {
        let (lower, upper) = (limits.position.lower_world[axis], limits.position.upper_world[axis]);
        if lower > upper || lower.is_nan() || upper.is_nan() {
            return Err(PlanningError::EmptyBox { what: "the position limit", axis, lower, upper });
        }
        for side in [lower, upper].into_iter().filter(|side| side.is_finite()) {
            moderate("the position limit", side)?;
        }
    }
    Ok(())
}

/// Acceleration along each axis, m/s^2.
///
/// # Errors
/// Limits that are negative or not finite, a mass that is not positive.
pub(super) fn acceleration_m_s2(force_n: &Vector3<f64>, mass_kg: f64) -> Result<Vector3<f64>, PlanningError> {
    let mass_kg = positive("the mass", mass_kg)?;
    for force in force_n {
        not_negative("a force limit", *force)?;
    }
    let acceleration_m_s2 = force_n / mass_kg;
    for acceleration in &acceleration_m_s2 {
        zero_or_moderate("the limit of acceleration", *acceleration)?;
    }
    Ok(acceleration_m_s2)
}

fn outside_limits<W: CollisionWorld + ?Sized>(
    request: &GlobalRequest<'_, W>,
) -> Result<Option<Obstruction>, PlanningError> {
    let limits = &request.limits;
    let radius_m = request.goal.radius_m;
    let acceleration = acceleration_m_s2(&limits.force_n, request.belief.parameters().mass)?;
    for axis in 0..3 {
        let (lower, upper) = (limits.position.lower_world[axis], limits.position.upper_world[axis]);
        let largest = limits.speed_m_s[axis];
        let (start, speed) = (request.start.position[axis], request.start.velocity[axis]);
        let outside = |what, value, limit| Ok(Some(Obstruction::OutsideLimits { what, value, limit }));
        if start < lower {
            return outside("the start is below the least position", start, lower);
        }
        if start > upper {
            return outside("the start is above the largest position", start, upper);
        }
        if speed.abs() > largest {
            return outside("the start is faster than the speed limit", speed.abs(), largest);
        }
        let goal = request.goal.position[axis];
        if goal + radius_m < lower {
            return outside("the goal region is below the least position", goal + radius_m, lower);
        }
        if goal - radius_m > upper {
            return outside("the goal region is above the largest position", goal - radius_m, upper);
        }
        if (goal - start).abs() > radius_m {
            if largest == 0.0 {
                return Ok(Some(Obstruction::LimitTooSmall { what: "speed_m_s", axis, value: largest }));
            }
            if acceleration[axis] == 0.0 && speed == 0.0 {
                return Ok(Some(Obstruction::LimitTooSmall { what: "force_n", axis, value: limits.force_n[axis] }));
            }
        }
    }
    Ok(None)
}

/// The attitude that the body certainly arrives with, or one as good; `None` where it may turn to another.
fn arrival_attitude<W: CollisionWorld + ?Sized>(request: &GlobalRequest<'_, W>) -> Option<UnitQuaternion<f64>> {
    let can_turn = request.limits.rate_rad_s > 0.0 && request.limits.torque_n_m.max() > 0.0;
    let is_held = !can_turn || request.world.is_round(request.body);
    request.goal.attitude.or(is_held.then_some(request.attitude))
}

/// The goal region is blocked where every cell of a grid over it certainly is, for all times.
fn goal_blocked<W: CollisionWorld + ?Sized>(
    request: &GlobalRequest<'_, W>,
) -> Result<Option<Obstruction>, PlanningError> {
    let (goal, margin_m) = (&request.goal, request.margin_m);
    // Of a body that may arrive with any attitude nothing is certain here.
    let Some(attitude) = arrival_attitude(request) else { return Ok(None) };
    let lasting_clearance = |position: &Vector3<f64>| {
        let world_from_body = Pose::from_parts(Translation3::from(*position), attitude);
        request.world.lasting_clearance(request.body, &world_from_body, request.start_s)
    };
    let Clearance { distance_m: clearance_m, nearest } = lasting_clearance(&goal.position)?;
    let Some(blocker) = nearest.filter(|_| clearance_m < margin_m) else { return Ok(None) };
    let blocked = Ok(Some(Obstruction::GoalBlocked { blocker, clearance_m }));
    if goal.radius_m == 0.0 || clearance_m + goal.radius_m * (1.0 + 1e-9) < margin_m {
        return blocked;
    }
    // Only what lies within the position limits counts; the corners of the box around the ball do not.
    let lower = (goal.position - Vector3::repeat(goal.radius_m)).sup(&request.limits.position.lower_world);
    let upper = (goal.position + Vector3::repeat(goal.radius_m)).inf(&request.limits.position.upper_world);
    let edges = (upper - lower) / f64::from(CELLS);
    let half_diagonal_m = 0.5 * f64::sqrt(edges.norm_squared()) * (1.0 + 1e-9);
    let layers = |axis: usize| if edges[axis] > 0.0 { CELLS } else { 1 };
    for x in 0..layers(0) {
        for y in 0..layers(1) {
            for z in 0..layers(2) {
                let place = Vector3::new(f64::from(x), f64::from(y), f64::from(z));
                let center = lower + (place + Vector3::repeat(0.5)).component_mul(&edges);
                let away_m = f64::sqrt((center - goal.position).norm_squared());
                let is_in_reach = away_m <= (goal.radius_m + half_diagonal_m) * (1.0 + 1e-9);
                if is_in_reach && lasting_clearance(&center)?.distance_m + half_diagonal_m >= margin_m {
                    return Ok(None);
                }
            }
        }
    }
    blocked
}
