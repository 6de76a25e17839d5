//! Better flights out of a good one: parts of it replaced by edges that cost less.

use super::flight::{Cut, Flight, Node};
use super::search::{End, Search};
use crate::collision::CollisionWorld;
use crate::global::{GoalRegion, Objective};
use crate::motion::{BodyArc, TranslationState};
use crate::steering::{TranslationLimits, least_time_s};
use nalgebra::{Quaternion, UnitQuaternion, Vector3};

/// Replaced parts are as short as the flight halved so often.
const SPAN_OCTAVES: f64 = 2.0;

/// Changes of a state are as small as the largest halved so often.
const CHANGE_OCTAVES: f64 = 12.0;

/// Share of the new parts that run through a changed state; the others are single edges.
const VIA_SHARE: f64 = 0.9;
/// Attempts refused before a collision check that count as one unit.
const REFUSED_PER_UNIT: u32 = 8;
/// A gain below this share of the cost is none.
const LEAST_GAIN: f64 = 1e-9;

/// Workspace of the improvement.
#[derive(Default)]
pub(super) struct Improve {
    middle: Vec<BodyArc>,
    rest: Vec<BodyArc>,
    /// What a new middle runs through, its end included.
    states: Vec<Node>,
}

impl Improve {
    /// Spends `units` on making `flight` cheaper, and offers what comes of it.
    pub fn run<W: CollisionWorld + ?Sized>(
        &mut self,
        search: &mut Search<'_, '_, W>,
        flight: &mut Flight,
        units: u64,
    ) -> Result<(), End> {
        let last = search.units.saturating_add(units);
        let mut refused = 0;
        while search.units < last && !search.is_optimal(flight.cost) {
            let before = search.units;
            self.attempt(search, flight)?;
            if search.units == before {
                refused += 1;
                if refused == REFUSED_PER_UNIT {
                    refused = 0;
                    search.spend(1)?;
                }
            }
        }
        Ok(())
    }

    fn attempt<W: CollisionWorld + ?Sized>(
        &mut self,
        search: &mut Search<'_, '_, W>,
        flight: &mut Flight,
    ) -> Result<(), End> {
        let duration_s = flight.duration_s;
        let span_s = duration_s * search.chance.scale(SPAN_OCTAVES);
        // Parts at both ends are as likely to be replaced as any other.
        let begin_s = search.chance.uniform() * (duration_s + span_s) - span_s;
        let end_s = begin_s + span_s;
        let Some(from) = flight.cut(begin_s.max(0.0)) else { return Ok(()) };
        let to = if end_s < duration_s { flight.cut(end_s) } else { None };
        if to.is_some_and(|to| to.time_s <= from.time_s) {
            return Ok(());
        }
        let until_s = to.map_or(duration_s, |to| to.time_s);
        let end = match to {
            Some(to) => to.node,
            None => match flight.end() {
                Some(end) => Self::arrival(search, &end),
                None => return Ok(()),
            },
        };
        self.states.clear();
        if search.chance.happens(VIA_SHARE) {
            let via_s = from.time_s + (until_s - from.time_s) * search.chance.uniform();
            if let Some(via) = flight.cut(via_s).filter(|via| via.time_s < until_s) {
                self.states.push(changed(search, &via.node, span_s));
            }
        }
        self.states.push(end);
        self.replace(search, flight, &from, to.as_ref())
    }

    /// Another state within the goal region, near the present one.
    fn arrival<W: CollisionWorld + ?Sized>(search: &mut Search<'_, '_, W>, end: &Node) -> Node {
        let goal = &search.request.goal;
        let chance = &mut search.chance;
        let position =
            end.translation.position + chance.in_cube() * (2.0 * goal.radius_m * chance.scale(CHANGE_OCTAVES));
        let velocity =
            end.translation.velocity + chance.in_cube() * (2.0 * goal.speed_m_s * chance.scale(CHANGE_OCTAVES));
        let translation = within_goal(&TranslationState { position, velocity }, goal, &search.limits);
        let is_free_to_turn = goal.attitude.is_none();
        let attitude = if is_free_to_turn { turned(search, &end.attitude) } else { end.attitude };
        Node { translation, attitude }
    }

    /// Replaces what lies between two cuts by edges through [`Self::states`], where that is cheaper and free.
    fn replace<W: CollisionWorld + ?Sized>(
        &mut self,
        search: &mut Search<'_, '_, W>,
        flight: &mut Flight,
        from: &Cut,
        to: Option<&Cut>,
    ) -> Result<(), End> {
        let old_s = to.map_or(flight.duration_s, |to| to.time_s) - from.time_s;
        let mut least_s = 0.0;
        let mut here = &from.node;
        for next in &self.states {
            least_s += least_time_s(&here.translation, &next.translation, &search.limits);
            here = next;
        }
        let is_fast = search.request.objective == Objective::Duration;
        let least_gain = LEAST_GAIN * flight.cost;
        let latest_s = old_s + if is_fast { 0.0 } else { (search.longest_s - flight.duration_s).max(0.0) };
        if least_s > latest_s || is_fast && least_s >= old_s - least_gain {
            return Ok(());
        }
        // The impulse is less with more time: up to three times the least, where the plan may last that long.
        let stretch = if is_fast { 1.0 } else { search.chance.between(1.0, (latest_s / least_s).min(3.0)) };
        let middle = &mut self.middle;
        middle.clear();
        let mut here = &from.node;
        for next in &self.states {
            if !search.append_slowly(here, next, stretch, middle)? {
                return Ok(());
            }
            here = next;
        }
        let new_s: f64 = middle.iter().map(|arc| arc.duration_s).sum();
        let old_cost = if is_fast { old_s } else { flight.between(from, to).map(|arc| search.cost(&[arc])).sum() };
        let is_gain = search.cost(middle) < old_cost - least_gain && new_s <= latest_s;
        if !is_gain || !search.is_free(middle, from.time_s)? {
            return Ok(());
        }
        if let Some(to) = to.filter(|_| !search.is_still) {
            self.rest.clear();
            self.rest.extend(flight.between(to, None));
            if !search.is_free(&self.rest, from.time_s + new_s)? {
                return Ok(());
            }
        }
        flight.replace(from, to, middle, &mut self.rest);
        search.rate(flight);
        search.offer(flight)
    }
}

/// A state near another one, within the limits.
fn changed<W: CollisionWorld + ?Sized>(search: &mut Search<'_, '_, W>, node: &Node, span_s: f64) -> Node {
    let limits = &search.limits;
    let chance = &mut search.chance;
    let reach = chance.in_cube().component_mul(&limits.speed_m_s) * (span_s * chance.scale(CHANGE_OCTAVES));
    let push = chance.in_cube().component_mul(&limits.speed_m_s) * (2.0 * chance.scale(CHANGE_OCTAVES));
    let translation =
        TranslationState { position: node.translation.position + reach, velocity: node.translation.velocity + push };
    Node { translation: within_limits(&translation, limits), attitude: turned(search, &node.attitude) }
}

/// An attitude near another one, or that of the start; the same where the body does not turn.
fn turned<W: CollisionWorld + ?Sized>(
    search: &mut Search<'_, '_, W>,
    attitude: &UnitQuaternion<f64>,
) -> UnitQuaternion<f64> {
    if !search.may_turn || search.chance.happens(0.5) {
        return *attitude;
    }
    if search.chance.happens(0.3) {
        return search.request.attitude;
    }
    let size = search.chance.scale(CHANGE_OCTAVES);
    let change = search.chance.in_cube() * size;
    let change = search.driven(change);
    let turned = attitude.quaternion() * Quaternion::from_parts(1.0, change);
    UnitQuaternion::new_unchecked(turned / f64::sqrt(turned.norm_squared()))
}

pub(super) fn within_limits(state: &TranslationState, limits: &TranslationLimits) -> TranslationState {
    let (lower, upper) = (&limits.position.lower_world, &limits.position.upper_world);
    let height = upper - lower;
    let velocity = state.velocity.sup(&-limits.speed_m_s).inf(&limits.speed_m_s);
    TranslationState {
        position: state.position.sup(lower).inf(upper),
        velocity: velocity.zip_map(&height, |velocity, height| if height > 0.0 { velocity } else { 0.0 }),
    }
}

/// The state with its position and velocity brought into the goal region.
pub(super) fn within_goal(state: &TranslationState, goal: &GoalRegion, limits: &TranslationLimits) -> TranslationState {
    let state = within_limits(state, limits);
    TranslationState {
        position: goal.position + within_ball(state.position - goal.position, goal.radius_m),
        velocity: within_ball(state.velocity, goal.speed_m_s),
    }
}

/// Shortened to a length of at most `radius`.
fn within_ball(vector: Vector3<f64>, radius: f64) -> Vector3<f64> {
    let length = f64::sqrt(vector.norm_squared());
    // A little less, so that rounding does not put it outside.
    if length < radius { vector } else { vector * (radius * (1.0 - 1e-12) / length.max(f64::MIN_POSITIVE)) }
}
