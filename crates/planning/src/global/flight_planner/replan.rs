//! When the world changes under way: what is left of the plan is checked again, and mended from a state ahead.

use super::FlightPlanner;
use super::flight::{Flight, part, states_from};
use crate::budget::Budget;
use crate::collision::{CollisionWorld, Contact};
use crate::error::{PlanningError, finite};
use crate::global::{GlobalAnswer, GlobalRequest};
use crate::motion::ArcPath;

/// A plan that is being flown.
#[derive(Clone, Copy, Debug)]
pub struct UnderWay<'p> {
    /// The plan.
    pub path: &'p ArcPath,
    /// Mission time at which it began, s.
    pub started_s: f64,
    /// Mission time now, s; what came before is not looked at.
    pub now_s: f64,
    /// Mission time from which on another plan can be flown, s, not before now: that of the answer, and some more.
    pub splice_s: f64,
}

/// What is to become of a plan under way.
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
pub enum Replanning {
    /// It stays free. Whether it still leads to the goal of the request is not looked at, nor whether a better one exists.
    Keep,
    /// It is hit before another plan could be flown, or turns until then; the time counts from [`UnderWay::now_s`].
    TooLate(Contact),
    /// It is hit later on.
    Replace {
        /// Where; the time counts from [`UnderWay::now_s`].
        contact: Contact,
        /// What is still flown of the old plan, from its beginning.
        kept: ArcPath,
        /// Mission time at which that ends, s: [`UnderWay::splice_s`], or soon after where the body turns then.
        splice_s: f64,
        /// The plan from there on.
        answer: GlobalAnswer,
    },
}

impl FlightPlanner {
    /// Checks what is left of a plan in the world of the request, at its mission times, and plans anew from a state ahead
    /// where it is not free. States of the old plan are tried first.
    ///
    /// The request's own start, attitude and start time are not looked at: those of the old plan at the splice take their
    /// place.
    ///
    /// # Errors
    /// As [`crate::global::GlobalPlanner::plan`]; times that are not finite, a splice that is over already.
    pub fn replan<W: CollisionWorld + ?Sized>(
        &mut self,
        request: &GlobalRequest<'_, W>,
        under_way: &UnderWay<'_>,
        budget: &mut dyn Budget,
    ) -> Result<Replanning, PlanningError> {
        let UnderWay { path, started_s, now_s, splice_s } = *under_way;
        finite("the mission time at which the plan began", started_s)?;
        finite("the mission time now", now_s)?;
        finite("the mission time of the splice", splice_s)?;
        if splice_s < now_s {
            let (what, upper) = ("the mission time of the splice", f64::INFINITY);
            return Err(PlanningError::OutOfRange { what, value: splice_s, lower: now_s, upper });
        }
        let flight = Flight { arcs: path.arcs().to_vec(), duration_s: path.duration_s(), cost: 0.0 };
        let Some(contact) = remaining_contact(request, &flight, started_s, now_s)? else { return Ok(Replanning::Keep) };
        let Some(cut) = flight.cut(splice_s - started_s).filter(|cut| started_s + cut.time_s < now_s + contact.time_s)
        else {
            return Ok(Replanning::TooLate(contact));
        };
        let splice_s = started_s + cut.time_s;
        let seeds = states_from(&flight, cut.time_s);
        let request = GlobalRequest {
            world: request.world,
            body: request.body,
            start: cut.node.translation,
            attitude: cut.node.attitude,
            start_s: splice_s,
            belief: request.belief,
            ..*request
        };
        let answer = self.plan_from_seeds(&request, &seeds, budget)?;
        let kept = flight.cut(0.0).map(|from| ArcPath::new(flight.between(&from, Some(&cut)))).unwrap_or_default();
        Ok(Replanning::Replace { contact, kept, splice_s, answer })
    }
}

/// First contact of what is left of a flight, its time since `now_s`.
fn remaining_contact<W: CollisionWorld + ?Sized>(
    request: &GlobalRequest<'_, W>,
    flight: &Flight,
    started_s: f64,
    now_s: f64,
) -> Result<Option<Contact>, PlanningError> {
    let mut since_s = started_s;
    for arc in &flight.arcs {
        let end_s = since_s + arc.duration_s;
        if end_s >= now_s {
            // Of an arc on which the body turns, what is over is looked at too: a contact there counts as one at once.
            let over_s = if arc.is_level() { (now_s - since_s).max(0.0) } else { 0.0 };
            let left = part(arc, over_s, arc.duration_s);
            let begin_s = since_s + over_s;
            let contact = request.world.first_contact(request.body, &left, begin_s, request.margin_m)?;
            if let Some(contact) = contact {
                return Ok(Some(Contact { time_s: (begin_s + contact.time_s - now_s).max(0.0), ..contact }));
            }
        }
        since_s = end_s;
    }
    Ok(None)
}
