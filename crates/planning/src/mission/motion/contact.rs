//! Whether what is left of a motion hits anything.

use super::{MissionMotion, Planned, arcs};
use crate::collision::CollisionWorld;
use crate::error::{PlanningError, finite};
use crate::motion::BodyArc;

/// A margin beyond this is a contact, m: nothing is known of where the body is.
const LARGEST_MARGIN_M: f64 = 1e6;

/// What is asked of the world.
struct Query<'a, W: CollisionWorld + ?Sized> {
    world: &'a W,
    body: &'a W::Body,
    from_s: f64,
    margin_m: f64,
}

impl<W: CollisionWorld + ?Sized> Query<'_, W> {
    /// First contact of an arc that begins at a mission time, by a body that may be so far from it.
    fn along(&self, arc: &BodyArc, begin_s: f64, apart_m: f64) -> Result<Option<f64>, PlanningError> {
        let over_s = f64::max(self.from_s - begin_s, 0.0);
        if over_s > arc.duration_s {
            return Ok(None);
        }
        let margin_m = self.margin_m + apart_m;
        if margin_m.is_nan() || margin_m > LARGEST_MARGIN_M {
            return Ok(Some(begin_s + over_s));
        }
        let left = arcs::part(arc, over_s, arc.duration_s);
        let contact = self.world.first_contact(self.body, &left, begin_s + over_s, margin_m)?;
        Ok(contact.map(|contact| begin_s + over_s + contact.time_s))
    }

    /// The same for arcs one after the other.
    fn along_all(&self, path: &[BodyArc], mut begin_s: f64) -> Result<Option<f64>, PlanningError> {
        for arc in path {
            if let Some(contact_s) = self.along(arc, begin_s, 0.0)? {
                return Ok(Some(contact_s));
            }
            begin_s += arc.duration_s;
        }
        Ok(None)
    }
}

impl MissionMotion {
    /// First mission time from `from_s` on at which the body comes nearer than `margin_m` to anything, until it rests, and after
    /// that to what lasts; `None` where it certainly never does. What comes after it rests, or passes by there, is not looked for:
    /// see [`MissionMotion::first_contact_until`].
    ///
    /// The whole motion is looked at, not samples: parts that are arcs as they are, planned parts as arcs of a tenth of a
    /// second or less, with what they may be apart from the motion added to the margin.
    ///
    /// # Errors
    /// What the world cannot answer; a time that is no number.
    pub fn first_contact<W: CollisionWorld + ?Sized>(
        &self,
        world: &W,
        body: &W::Body,
        from_s: f64,
        margin_m: f64,
    ) -> Result<Option<f64>, PlanningError> {
        self.first_contact_until(world, body, from_s, self.rest_s, margin_m)
    }

    /// The same with rest looked at until a mission time: what moves or appears there is found too.
    ///
    /// # Errors
    /// What the world cannot answer; a time that is no number.
    pub fn first_contact_until<W: CollisionWorld + ?Sized>(
        &self,
        world: &W,
        body: &W::Body,
        from_s: f64,
        until_s: f64,
        margin_m: f64,
    ) -> Result<Option<f64>, PlanningError> {
        let (from_s, until_s) = (finite("the mission time", from_s)?, finite("the mission time", until_s)?);
        let query = Query { world, body, from_s, margin_m };
        if from_s < self.start_s {
            let waiting = arcs::staying(&self.before, self.start_s - from_s);
            if let Some(contact_s) = query.along(&waiting, from_s, 0.0)? {
                return Ok(Some(contact_s));
            }
        }
        let planned = match &self.planned {
            Planned::Arcs(path) => query.along_all(path.arcs(), self.start_s)?,
            Planned::Held(held) if from_s <= self.end_s => {
                let reach_m = world.reach_m(body);
                let (first, _) = held.place(f64::max(from_s - self.start_s, 0.0));
                let mut contact_s = None;
                for (since_s, piece) in held.arcs(first) {
                    let apart_m = piece.apart_m + piece.apart_rad * reach_m;
                    contact_s = query.along(&piece.arc, self.start_s + since_s, apart_m)?;
                    if contact_s.is_some() {
                        break;
                    }
                }
                contact_s
            }
            Planned::Nothing | Planned::Held(_) => None,
        };
        if planned.is_some() {
            return Ok(planned);
        }
        if let Some(contact_s) = query.along_all(self.stop.arcs(), self.end_s)? {
            return Ok(Some(contact_s));
        }
        let rest_s = f64::max(from_s, self.rest_s);
        let resting = arcs::staying(&self.after, f64::max(until_s - rest_s, 0.0));
        if let Some(contact_s) = query.along(&resting, rest_s, 0.0)? {
            return Ok(Some(contact_s));
        }
        let lasting = world.lasting_clearance(body, &self.after, rest_s)?;
        Ok((lasting.distance_m < margin_m).then_some(rest_s))
    }
}
