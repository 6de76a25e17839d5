//! Laws of collision worlds.

use super::broken_unless;
use crate::collision::{CollisionWorld, polynomial};
use crate::error::PlanningError;
use crate::motion::{BodyArc, COEFFICIENTS};
use nalgebra::{UnitQuaternion, Vector3};
use tumble_lie::Pose;
use tumble_lie::laws::{LawViolation, require};

/// Clearances asked for along each motion.
const SAMPLES: usize = 64;

/// A motion on which [`check_collision_world`] tries the laws.
#[derive(Clone, Copy, Debug)]
pub struct CollisionSample {
    /// The motion.
    pub arc: BodyArc,
    /// Mission time of its start, s.
    pub start_s: f64,
    /// Distance to be kept, m.
    pub margin_m: f64,
}

/// The same motion backwards.
pub fn reversed(arc: &BodyArc) -> BodyArc {
    let mut reversed = *arc;
    reversed.position = polynomial::about(&arc.position, COEFFICIENTS - 1, arc.duration_s);
    reversed.angle = polynomial::about(&arc.angle, COEFFICIENTS - 1, arc.duration_s);
    reversed.angle[0] = 0.0;
    for power in (1..COEFFICIENTS).step_by(2) {
        reversed.position[power] = -reversed.position[power];
        reversed.angle[power] = -reversed.angle[power];
    }
    reversed.attitude = arc.attitude_at(arc.duration_s);
    reversed
}

/// The answer to a query.
fn answer<T>(sample: &CollisionSample, answer: Result<T, PlanningError>) -> Result<T, LawViolation> {
    answer.map_err(|error| LawViolation {
        law: "every query has an answer",
        inputs: format!("{sample:?}"),
        expected: "an answer".to_owned(),
        found: format!("{error:?}"),
        error: f64::INFINITY,
        tolerance: 0.0,
    })
}

/// The laws of a [`CollisionWorld`], tried along motions.
///
/// "every query has an answer"; "the clearance changes by no more than the origin moves": at any one time and attitude;
/// "the clearance changes by no more than the reach is turned"; "a round body may turn": without any change; "what lasts is farther than what is there": the lasting
/// clearance bounds the clearance at any later time; "nothing is touched before the first contact", or at all where there
/// is none; "a contact is one": the clearance there is the margin, unless something appears or the motion begins in
/// contact; "a wider margin is met no later"; "a later begin changes nothing" and "the way back is as free as the way
/// there", both where the world says that it is still.
///
/// `tolerance_m` is that of clearances, to be chosen above the world's rounding.
///
/// # Errors
/// The first broken law.
pub fn check_collision_world<W: CollisionWorld + ?Sized>(
    world: &W,
    body: &W::Body,
    samples: &[CollisionSample],
    tolerance_m: f64,
) -> Result<(), LawViolation> {
    for sample in samples {
        check_clearance(world, body, sample, tolerance_m)?;
        check_first_contact(world, body, sample, tolerance_m)?;
    }
    Ok(())
}

/// The laws of clearances alone.
fn check_clearance<W: CollisionWorld + ?Sized>(
    world: &W,
    body: &W::Body,
    sample: &CollisionSample,
    tolerance_m: f64,
) -> Result<(), LawViolation> {
    let CollisionSample { arc, start_s, .. } = sample;
    let reach_m = world.reach_m(body);
    for step in 0..SAMPLES {
        let time_s = arc.duration_s * step as f64 / (SAMPLES - 1) as f64;
        let at_s = start_s + time_s;
        let clearance_m = |pose: &Pose<f64>| answer(sample, world.clearance(body, pose, at_s)).map(|it| it.distance_m);
        let pose = arc.pose(time_s);
        let here_m = clearance_m(&pose)?;
        let (begin, end) = (arc.pose(0.0), arc.pose(arc.duration_s));
        for (origin, share) in [(begin, 0.01), (end, 0.01), (begin, 1.0), (end, 1.0)] {
            let move_world = (origin.translation.vector - pose.translation.vector) * share;
            let mut moved = pose;
            moved.translation.vector += move_world;
            let change_m = f64::abs(clearance_m(&moved)? - here_m);
            // Two infinite clearances do not differ.
            let change_m = if change_m.is_nan() { 0.0 } else { change_m };
            let law = "the clearance changes by no more than the origin moves";
            let excess_m = change_m - f64::sqrt(move_world.norm_squared());
            require(law, &(sample, pose, moved), &"no more", &change_m, excess_m, tolerance_m)?;
        }
        for axis in [Vector3::x_axis(), Vector3::y_axis(), Vector3::z_axis(), arc.axis_body] {
            let angle = 0.1 + 0.01 * step as f64;
            let turned = pose * UnitQuaternion::from_axis_angle(&axis, angle);
            let change_m = f64::abs(clearance_m(&turned)? - here_m);
            let change_m = if change_m.is_nan() { 0.0 } else { change_m };
            let law = "the clearance changes by no more than the reach is turned";
            let excess_m = change_m - reach_m * angle;
            require(law, &(sample, pose, turned), &"no more", &change_m, excess_m, tolerance_m)?;
            let law = "a round body may turn";
            let excess_m = if world.is_round(body) { change_m } else { 0.0 };
            require(law, &(sample, pose, turned), &"no change", &change_m, excess_m, tolerance_m)?;
        }
        let lasting_m = answer(sample, world.lasting_clearance(body, &pose, *start_s))?.distance_m;
        let law = "what lasts is farther than what is there";
        let excess_m = if lasting_m >= here_m { 0.0 } else { here_m - lasting_m };
        require(law, &(sample, pose), &here_m, &lasting_m, excess_m, tolerance_m)?;
    }
    Ok(())
}

/// The laws of first contacts.
fn check_first_contact<W: CollisionWorld + ?Sized>(
    world: &W,
    body: &W::Body,
    sample: &CollisionSample,
    tolerance_m: f64,
) -> Result<(), LawViolation> {
    let CollisionSample { arc, start_s, margin_m } = sample;
    let first = |arc: &BodyArc, start_s: f64, margin_m: f64| {
        let contact = answer(sample, world.first_contact(body, arc, start_s, margin_m))?;
        Ok::<_, LawViolation>(contact.map(|contact| contact.time_s))
    };
    let spare_m = |time_s: f64| {
        let clearance = answer(sample, world.clearance(body, &arc.pose(time_s), start_s + time_s))?;
        Ok::<_, LawViolation>(clearance.distance_m - margin_m)
    };
    let found = first(arc, *start_s, *margin_m)?;
    let until_s = found.unwrap_or(arc.duration_s);
    for step in 0..SAMPLES {
        // Up to the contact, which may be something that appears there.
        let time_s = until_s * step as f64 / SAMPLES as f64;
        if time_s < until_s || found.is_none() {
            let depth_m = -spare_m(time_s)?;
            let law = "nothing is touched before the first contact";
            require(law, &(sample, time_s), &found, &-depth_m, depth_m, tolerance_m)?;
        }
    }
    if let Some(time_s) = found {
        let law = "a contact is one";
        let there_m = spare_m(time_s)?.min(spare_m(time_s + 1e-9)?);
        require(law, &(sample, time_s), &"contact", &there_m, there_m, tolerance_m)?;
    }
    let wider = first(arc, *start_s, margin_m + 0.01)?;
    let is_later = wider.unwrap_or(f64::INFINITY) > found.unwrap_or(f64::INFINITY);
    let law = "a wider margin is met no later";
    require(law, sample, &found, &wider, broken_unless(!is_later), 0.0)?;
    if world.is_still_from(*start_s) {
        let later = first(arc, start_s + 10.0, *margin_m)?;
        let law = "a later begin changes nothing";
        require(law, sample, &found, &later, broken_unless(later == found), 0.0)?;
        let back = first(&reversed(arc), *start_s, *margin_m)?;
        let law = "the way back is as free as the way there";
        require(law, sample, &found, &back, broken_unless(back.is_some() == found.is_some()), 0.0)?;
        if let (Some(found), Some(back)) = (found, back) {
            let law = "the way back meets what the way there meets";
            let excess_s = found - (arc.duration_s - back);
            require(law, sample, &(arc.duration_s - back), &found, excess_s, 1e-9 * arc.duration_s)?;
        }
    }
    Ok(())
}
