//! First contacts for any world that can tell a clearance.

use super::polynomial::{about, stays_positive};
use super::world::check_arc;
use super::{CollisionWorld, Contact};
use crate::error::{PlanningError, positive};
use crate::motion::{BodyArc, COEFFICIENTS};

/// Most clearances asked for.
const QUERIES: usize = 10_000;

/// First contact of a motion, from clearances alone: for a world of one's own, whose obstacles are at rest.
///
/// No point of the body moves farther than its origin does and the turn carries it, `reach_m` times the angle. So where the
/// clearance is `d` the motion is free until that path is `d` long, and from there one goes on. A clearance at most
/// `tolerance_m` above the margin counts as contact: the time found is early by what it takes to pass the tolerance, never
/// late. A motion whose freedom is not proven after ten thousand clearances is in contact where the proof ends.
///
/// The obstacles rest while the body moves: the clearance at a pose must not depend on the time within the arc.
///
/// # Errors
/// Those of the world's clearance; a world that does not say what is nearest; a tolerance that is not positive.
pub fn conservative_first_contact<W: CollisionWorld + ?Sized>(
    world: &W,
    body: &W::Body,
    arc: &BodyArc,
    start_s: f64,
    margin_m: f64,
    tolerance_m: f64,
) -> Result<Option<Contact>, PlanningError> {
    check_arc(arc)?;
    positive("the tolerance of a contact", tolerance_m)?;
    let reach_m = world.reach_m(body);
    let mut time_s = 0.0;
    for query in 0.. {
        let clearance = world.clearance(body, &arc.pose(time_s), start_s + time_s)?;
        let spare_m = clearance.distance_m - margin_m;
        let is_free = spare_m > tolerance_m && query < QUERIES;
        if !is_free {
            let unnamed = PlanningError::Unsupported { query: "say what is nearest" };
            return clearance.nearest.map(|blocker| Some(Contact { time_s, blocker })).ok_or(unnamed);
        }
        let left_s = arc.duration_s - time_s;
        let translation = about(&arc.position, COEFFICIENTS - 1, time_s);
        let angle = about(&arc.angle, COEFFICIENTS - 1, time_s);
        let mut spare = [spare_m.min(f64::MAX), 0.0, 0.0, 0.0, 0.0, 0.0];
        for ((spare, moved), turned) in spare.iter_mut().zip(&translation).zip(&angle).skip(1) {
            *spare = -f64::sqrt(moved.norm_squared()) - reach_m * turned.abs();
        }
        let step_s = stays_positive(&spare, COEFFICIENTS - 1, left_s);
        if step_s >= left_s {
            break;
        }
        time_s += step_s;
    }
    Ok(None)
}
