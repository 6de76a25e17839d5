//! The world of ellipsoids and boxes: what a body may hit, at rest or moving, there always or for a time.

use super::broad_phase::{BoxTree, box_gap};
use super::obstacle::Solid;
use super::sweep::{MovingPart, degree, first_contact, path_box};
use super::{
    Blocker, BodyEllipsoid, BodyShape, Clearance, CollisionWorld, Contact, Ellipsoid, Sphere, keep_in_complement,
};
use crate::error::{PlanningError, attitude, finite, length, moderate, pose};
use crate::motion::{BodyArc, COEFFICIENTS};
use nalgebra::Vector3;
use tumble_dynamics::{AlignedBox, ObstacleEllipsoid, World};
use tumble_lie::Pose;

/// An ellipsoid that moves without turning, and is there for a time only.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct MovingObstacle {
    /// The ellipsoid as it is at the mission time [`Self::since_s`].
    pub ellipsoid: ObstacleEllipsoid,
    /// Displacement of its centre in powers of the mission time since [`Self::since_s`], world axes, m / s^k.
    pub displacement: [Vector3<f64>; COEFFICIENTS],
    /// Mission time from which the displacement counts, s.
    pub since_s: f64,
    /// First mission time at which it is there, s; may be minus infinity.
    pub appear_s: f64,
    /// Last mission time at which it is there, s; may be infinite.
    pub vanish_s: f64,
}

impl MovingObstacle {
    /// At rest and there always.
    pub fn at_rest(ellipsoid: ObstacleEllipsoid) -> Self {
        Self {
            ellipsoid,
            displacement: [Vector3::zeros(); COEFFICIENTS],
            since_s: 0.0,
            appear_s: f64::NEG_INFINITY,
            vanish_s: f64::INFINITY,
        }
    }

    /// The same, moving at a constant velocity; its centre is the given one at the mission time `since_s`.
    pub fn drifting(mut self, velocity_world: Vector3<f64>, since_s: f64) -> Self {
        self.displacement = [Vector3::zeros(); COEFFICIENTS];
        self.displacement[1] = velocity_world;
        self.since_s = since_s;
        self
    }

    /// The same, there only from one mission time to another, both included.
    pub fn present(mut self, appear_s: f64, vanish_s: f64) -> Self {
        self.appear_s = appear_s;
        self.vanish_s = vanish_s;
        self
    }

    /// The ellipsoid when its motion begins, of an obstacle that can be.
    ///
    /// # Errors
    /// [`PlanningError::InvalidWorld`] under this index, [`PlanningError::TooUnlike`].
    pub(crate) fn checked(&self, index: usize) -> Result<Ellipsoid, PlanningError> {
        let Self { ellipsoid, displacement, since_s, appear_s, vanish_s } = self;
        let part = "obstacle";
        for semi_axis in &ellipsoid.semi_axes {
            if length("", *semi_axis).is_err() {
                return Err(invalid(part, index, "a semi-axis", *semi_axis));
            }
        }
        let pose = &ellipsoid.world_from_ellipsoid;
        let numbers = pose.translation.vector.iter().chain(pose.rotation.coords.iter());
        for number in numbers.chain(displacement.iter().flatten()).chain([since_s]) {
            if moderate("", *number).is_err() {
                return Err(invalid(part, index, "a coordinate of its pose or motion", *number));
            }
        }
        // Neither may be NaN.
        let is_ordered = appear_s <= vanish_s;
        if !is_ordered {
            return Err(invalid(part, index, "the time for which it is there", vanish_s - appear_s));
        }
        Ellipsoid::try_new(pose, &ellipsoid.semi_axes)
    }

    /// Where its centre is at a mission time, there or not; world axes, m.
    pub fn center_at(&self, time_s: f64) -> Vector3<f64> {
        let along = |value: Vector3<f64>, term: &Vector3<f64>| value * (time_s - self.since_s) + term;
        let moved = self.displacement.iter().rev().fold(Vector3::zeros(), along);
        self.ellipsoid.world_from_ellipsoid.translation.vector + moved
    }

    /// True where it is there at some mission time of an interval, both ends included.
    pub fn is_present(&self, from_s: f64, to_s: f64) -> bool {
        self.appear_s <= to_s && from_s <= self.vanish_s
    }

    /// The way of its centre over a time that begins at a mission time: control points of its Bernstein form.
    pub(crate) fn way(&self, from_s: f64, duration_s: f64) -> [Vector3<f64>; COEFFICIENTS] {
        let center = self.ellipsoid.world_from_ellipsoid.translation.vector;
        if self.displacement.iter().all(|coefficient| *coefficient == Vector3::zeros()) {
            return [center; COEFFICIENTS];
        }
        let moved = super::polynomial::about(&self.displacement, COEFFICIENTS - 1, from_s - self.since_s);
        let along = [0, 1, 2].map(|axis: usize| super::polynomial::bernstein(&moved.map(|v| v[axis]), duration_s));
        core::array::from_fn(|i| center + Vector3::new(along[0][i], along[1][i], along[2][i]))
    }
}

/// A displacement in time.
#[derive(Clone, Debug)]
struct Motion {
    displacement: [Vector3<f64>; COEFFICIENTS],
    since_s: f64,
}

/// One obstacle, keep-out box, or box of the complement of what is kept in.
#[derive(Clone, Debug)]
pub(super) struct Entry {
    blocker: Blocker,
    pub solid: Solid,
    /// Where the solid's reference point is, at rest or when its motion begins.
    reference: Vector3<f64>,
    /// The solid's box about its reference point.
    pub extent: AlignedBox,
    motion: Option<Motion>,
    appear_s: f64,
    vanish_s: f64,
}

/// Obstacle ellipsoids, keep-out boxes and keep-in boxes, with the body a union of ellipsoids.
///
/// Distances to what is kept in are those to the boxes that fill its complement: exact wherever the body is inside.
#[derive(Clone, Debug)]
pub struct EllipsoidWorld {
    /// Boxes first, then obstacles by their index.
    entries: Vec<Entry>,
    boxes: usize,
    /// Entries that every query looks at.
    always: Vec<usize>,
    /// Entries that move.
    moving: Vec<usize>,
    /// The obstacles at rest, where they are many.
    tree: BoxTree,
}

/// From so many obstacles at rest on the tree is faster than looking at each one's box.
const MANY: usize = 48;

/// The error of a part of a world.
fn invalid(part: &'static str, index: usize, what: &'static str, value: f64) -> PlanningError {
    PlanningError::InvalidWorld { part, index, what, value }
}

/// Checks that a box has finite corners in their order.
fn check_box(part: &'static str, index: usize, aligned: &AlignedBox) -> Result<(), PlanningError> {
    for (lower, upper) in aligned.lower_world.iter().zip(&aligned.upper_world) {
        for coordinate in [*lower, *upper] {
            if moderate("", coordinate).is_err() {
                return Err(invalid(part, index, "a coordinate", coordinate));
            }
        }
        if lower > upper {
            return Err(invalid(part, index, "an edge's length", upper - lower));
        }
    }
    Ok(())
}

impl Entry {
    fn aligned(blocker: Blocker, aligned: AlignedBox) -> Self {
        Self {
            blocker,
            solid: Solid::Box(aligned),
            reference: Vector3::zeros(),
            extent: aligned,
            motion: None,
            appear_s: f64::NEG_INFINITY,
            vanish_s: f64::INFINITY,
        }
    }

    fn ellipsoid(index: usize, obstacle: &MovingObstacle) -> Result<Self, PlanningError> {
        let MovingObstacle { displacement, since_s, appear_s, vanish_s, .. } = obstacle;
        let solid = obstacle.checked(index)?;
        let half_extent = solid.half_extent();
        let is_moving = displacement.iter().any(|coefficient| *coefficient != Vector3::zeros());
        Ok(Self {
            blocker: Blocker::Obstacle(index),
            solid: Solid::ellipsoid(&solid),
            reference: *solid.center(),
            extent: AlignedBox { lower_world: -half_extent, upper_world: half_extent },
            motion: is_moving.then_some(Motion { displacement: *displacement, since_s: *since_s }),
            appear_s: *appear_s,
            vanish_s: *vanish_s,
        })
    }

    pub fn is_present(&self, time_s: f64) -> bool {
        self.appear_s <= time_s && time_s <= self.vanish_s
    }

    /// There from this time on for ever, and at rest.
    fn lasts_from(&self, time_s: f64) -> bool {
        self.appear_s <= time_s && self.vanish_s >= f64::INFINITY && self.motion.is_none()
    }

    /// Its box where it is, at rest.
    fn placed_box(&self) -> AlignedBox {
        AlignedBox {
            lower_world: self.extent.lower_world + self.reference,
            upper_world: self.extent.upper_world + self.reference,
        }
    }

    /// Where the reference point is.
    #[inline]
    pub fn reference_at(&self, time_s: f64) -> Vector3<f64> {
        match &self.motion {
            None => self.reference,
            Some(motion) => {
                let along = |value: Vector3<f64>, term: &Vector3<f64>| value * (time_s - motion.since_s) + term;
                self.reference + motion.displacement.iter().rev().fold(Vector3::zeros(), along)
            }
        }
    }

    /// First contact of a part of a body within a window of the arc's time.
    fn first_contact(
        &self,
        part: &MovingPart<'_>,
        duration_s: f64,
        start_s: f64,
        margin_m: f64,
        window_s: (f64, f64),
    ) -> Option<Contact> {
        let path = self.seen(&part.path, start_s);
        let (lower, upper) = if self.motion.is_none() {
            (part.swept.0 - self.reference, part.swept.1 - self.reference)
        } else {
            let (lower, upper) = path_box(&path, degree(&path), duration_s);
            (lower - part.half_extent, upper + part.half_extent)
        };
        if box_gap(&lower, &upper, &self.extent) > margin_m {
            return None;
        }
        let scale_m = part.path[0].amax() + self.reference.amax();
        let time_s = first_contact(part, &self.solid, &path, scale_m, margin_m, window_s)?;
        Some(Contact { time_s, blocker: self.blocker })
    }

    /// A path, in powers of the time since the mission time `start_s`, as the reference point sees it.
    fn seen(&self, path: &[Vector3<f64>; COEFFICIENTS], start_s: f64) -> [Vector3<f64>; COEFFICIENTS] {
        let mut seen = *path;
        seen[0] -= self.reference;
        if let Some(motion) = &self.motion {
            let moved = super::polynomial::about(&motion.displacement, COEFFICIENTS - 1, start_s - motion.since_s);
            for (seen, moved) in seen.iter_mut().zip(&moved) {
                *seen -= moved;
            }
        }
        seen
    }
}

/// A part of a body at a pose.
#[derive(Clone, Copy, Debug)]
pub(super) enum PosedPart {
    Ball(Sphere),
    Ellipsoid(Ellipsoid),
}

impl PosedPart {
    pub fn new(part: &BodyEllipsoid, world_from_body: &Pose<f64>) -> Self {
        let radius_m = part.semi_axes.max();
        if part.semi_axes.min() >= radius_m {
            let offset = part.body_from_ellipsoid.translation.vector;
            Self::Ball(Sphere { center: world_from_body.transform_point(&offset.into()).coords, radius_m })
        } else {
            Self::Ellipsoid(Ellipsoid::of_body(part, world_from_body))
        }
    }

    fn center(&self) -> &Vector3<f64> {
        match self {
            Self::Ball(sphere) => &sphere.center,
            Self::Ellipsoid(solid) => solid.center(),
        }
    }

    fn half_extent(&self) -> Vector3<f64> {
        match self {
            Self::Ball(sphere) => Vector3::repeat(sphere.radius_m),
            Self::Ellipsoid(solid) => solid.half_extent(),
        }
    }

    fn distance_m(&self, solid: &Solid, relative: &Vector3<f64>) -> f64 {
        match self {
            Self::Ball(sphere) => solid.distance_to_sphere(&Sphere { center: *relative, ..*sphere }),
            Self::Ellipsoid(part) => solid.distance(&part.moved_to(*relative)).distance_m,
        }
    }
}

impl EllipsoidWorld {
    /// The queries of a world of obstacles, keep-out and keep-in boxes.
    ///
    /// # Errors
    /// [`PlanningError::TooUnlike`]; [`PlanningError::InvalidWorld`]: numbers that are not finite, semi-axes that are not positive, boxes upside down.
    pub fn new(world: &World) -> Result<Self, PlanningError> {
        for (index, aligned) in world.keep_out.iter().enumerate() {
            check_box("keep-out box", index, aligned)?;
        }
        for (index, aligned) in world.keep_in.iter().enumerate() {
            check_box("keep-in box", index, aligned)?;
        }
        let keep_out = world.keep_out.iter().enumerate().map(|(index, aligned)| (Blocker::KeepOut(index), *aligned));
        let keep_in = keep_in_complement(&world.keep_in).into_iter().map(|aligned| (Blocker::KeepIn, aligned));
        let entries: Vec<Entry> =
            keep_out.chain(keep_in).map(|(blocker, aligned)| Entry::aligned(blocker, aligned)).collect();
        let world_of_boxes =
            Self { boxes: entries.len(), entries, always: Vec::new(), moving: Vec::new(), tree: BoxTree::default() };
        world_of_boxes.with_obstacles(world.obstacles.iter().map(|ellipsoid| MovingObstacle::at_rest(*ellipsoid)))
    }

    /// The same world with one more obstacle; its index is the next free one.
    ///
    /// # Errors
    /// [`PlanningError::InvalidWorld`].
    pub fn with_obstacle(self, obstacle: MovingObstacle) -> Result<Self, PlanningError> {
        self.with_obstacles([obstacle])
    }

    /// The same world with more obstacles; their indices are the next free ones.
    ///
    /// # Errors
    /// [`PlanningError::InvalidWorld`].
    pub fn with_obstacles(
        mut self,
        obstacles: impl IntoIterator<Item = MovingObstacle>,
    ) -> Result<Self, PlanningError> {
        for obstacle in obstacles {
            self.entries.push(Entry::ellipsoid(self.obstacle_count(), &obstacle)?);
        }
        let is_placed = |entry: &Entry| entry.motion.is_none() && matches!(entry.blocker, Blocker::Obstacle(_));
        let (mut placed, mut always) = (Vec::new(), Vec::new());
        for (index, entry) in self.entries.iter().enumerate() {
            if is_placed(entry) { placed.push((index, entry.placed_box())) } else { always.push(index) }
        }
        if placed.len() < MANY {
            always = (0..self.entries.len()).collect();
            placed.clear();
        }
        (self.always, self.tree) = (always, BoxTree::new(&placed));
        self.moving = (0..self.entries.len())
            .filter(|index| self.entries.get(*index).is_some_and(|e| e.motion.is_some()))
            .collect();
        Ok(self)
    }

    /// Checks that what moves is within what can be computed with, between two times.
    pub(super) fn check_moved(&self, from_s: f64, to_s: f64) -> Result<(), PlanningError> {
        for index in &self.moving {
            let Some(Entry { motion: Some(motion), .. }) = self.entries.get(*index) else { continue };
            let since_s = f64::max((from_s - motion.since_s).abs(), (to_s - motion.since_s).abs());
            let along = |sum: f64, term: &Vector3<f64>| sum * since_s + term.abs().sum();
            moderate("the way of an obstacle", motion.displacement.iter().rev().fold(0.0, along))?;
        }
        Ok(())
    }

    /// How many obstacles there are.
    pub fn obstacle_count(&self) -> usize {
        self.entries.len() - self.boxes
    }

    /// All that can be hit.
    pub(super) fn boxes_and_ellipsoids(&self) -> (&[Entry], &[Entry]) {
        self.entries.split_at(self.boxes.min(self.entries.len()))
    }

    /// What is nearest to a part, of the entries that count, if it is nearer than a limit.
    pub(super) fn nearest_to(
        &self,
        part: &PosedPart,
        time_s: f64,
        limit_m: f64,
        counts: impl Fn(&Entry) -> bool,
    ) -> Option<(f64, Blocker)> {
        let half_extent = part.half_extent();
        let mut nearest_m = limit_m;
        let mut nearest = None;
        let mut look = |index: &usize| {
            if let Some(entry) = self.entries.get(*index).filter(|entry| counts(entry)) {
                let relative = part.center() - entry.reference_at(time_s);
                let bound_m = box_gap(&(relative - half_extent), &(relative + half_extent), &entry.extent);
                if bound_m < nearest_m {
                    let distance_m = part.distance_m(&entry.solid, &relative);
                    if distance_m < nearest_m {
                        nearest_m = distance_m;
                        nearest = Some((distance_m, entry.blocker));
                    }
                }
            }
            nearest_m
        };
        let limit_m = self.always.iter().fold(limit_m, |_, index| look(index));
        let (lower, upper) = (part.center() - half_extent, part.center() + half_extent);
        self.tree.visit(&lower, &upper, limit_m, true, |index| look(&index));
        nearest
    }

    /// What is nearest to a body at a pose, of the entries that count.
    fn nearest(
        &self,
        body: &BodyShape,
        world_from_body: &Pose<f64>,
        time_s: f64,
        counts: impl Fn(&Entry) -> bool,
    ) -> Result<Clearance, PlanningError> {
        pose(world_from_body)?;
        self.check_moved(time_s, time_s)?;
        let mut nearest = Clearance { distance_m: f64::INFINITY, nearest: None };
        for part in body.parts() {
            let part = PosedPart::new(part, world_from_body);
            if let Some((distance_m, blocker)) = self.nearest_to(&part, time_s, nearest.distance_m, &counts) {
                nearest = Clearance { distance_m, nearest: Some(blocker) };
            }
        }
        Ok(nearest)
    }
}

impl CollisionWorld for EllipsoidWorld {
    type Body = BodyShape;

    fn clearance(
        &self,
        body: &BodyShape,
        world_from_body: &Pose<f64>,
        time_s: f64,
    ) -> Result<Clearance, PlanningError> {
        moderate("the mission time", time_s)?;
        self.nearest(body, world_from_body, time_s, |entry| entry.is_present(time_s))
    }

    /// First time at which `body` comes nearer than `margin_m` to anything.
    ///
    /// A clearance below 1e-13 of the lengths that enter it counts as contact, and so does, at the time reached, a motion
    /// whose freedom is not proven after a fixed number of planes. Both are on the safe side; nothing is ever silently free.
    fn first_contact(
        &self,
        body: &BodyShape,
        arc: &BodyArc,
        start_s: f64,
        margin_m: f64,
    ) -> Result<Option<Contact>, PlanningError> {
        moderate("the mission time", start_s)?;
        check_arc(arc)?;
        if moderate("the margin", margin_m)? < 0.0 {
            return Err(PlanningError::Negative { what: "the margin", value: margin_m });
        }
        self.check_moved(start_s, start_s + arc.duration_s)?;
        let mut first: Option<Contact> = None;
        let mut end_s = arc.duration_s;
        for part in body.parts() {
            let part = MovingPart::new(part, arc);
            let mut look = |index: &usize| {
                if let Some(entry) = self.entries.get(*index) {
                    let window_s = (f64::max(0.0, entry.appear_s - start_s), f64::min(end_s, entry.vanish_s - start_s));
                    if window_s.0 <= window_s.1 {
                        let found = entry.first_contact(&part, arc.duration_s, start_s, margin_m, window_s);
                        // Of what is hit at the same time the first of all counts.
                        let is_earlier = |contact: &Contact| {
                            first.is_none_or(|first| (contact.time_s, contact.blocker) < (first.time_s, first.blocker))
                        };
                        if let Some(contact) = found.filter(is_earlier) {
                            first = Some(contact);
                            end_s = contact.time_s;
                        }
                    }
                }
                margin_m
            };
            for index in &self.always {
                look(index);
            }
            let (lower, upper) = part.swept;
            self.tree.visit(&lower, &upper, margin_m, false, |index| look(&index));
        }
        Ok(first)
    }

    fn is_still_from(&self, time_s: f64) -> bool {
        // What has vanished by then does not count.
        self.entries.iter().all(|entry| entry.vanish_s < time_s || entry.lasts_from(time_s))
    }

    fn lasting_clearance(
        &self,
        body: &BodyShape,
        world_from_body: &Pose<f64>,
        from_s: f64,
    ) -> Result<Clearance, PlanningError> {
        moderate("the mission time", from_s)?;
        self.nearest(body, world_from_body, from_s, |entry| entry.lasts_from(from_s))
    }

    fn is_round(&self, body: &BodyShape) -> bool {
        body.parts().iter().all(|part| {
            part.body_from_ellipsoid.translation.vector == Vector3::zeros()
                && part.semi_axes.min() >= part.semi_axes.max()
        })
    }

    fn reach_m(&self, body: &BodyShape) -> f64 {
        body.bounding_radius_m()
    }
}

/// Checks that an arc is one, and stays within what can be computed with.
pub(super) fn check_arc(arc: &BodyArc) -> Result<(), PlanningError> {
    if moderate("the duration of an arc", arc.duration_s)? < 0.0 {
        return Err(PlanningError::Negative { what: "the duration of an arc", value: arc.duration_s });
    }
    attitude(&arc.attitude)?;
    let what = "the squared norm of an arc's axis";
    let is_axis = (finite(what, arc.axis_body.norm_squared())? - 1.0).abs() < 1e-3;
    // Each coefficient by itself, and what it amounts to by the end.
    let (mut amount, mut power) = (0.0, 1.0);
    for (position, angle) in arc.position.iter().zip(&arc.angle) {
        amount += (position.abs().sum() + angle.abs()) * f64::max(1.0, power);
        power *= arc.duration_s;
    }
    moderate("the sum of an arc's numbers", amount)?;
    if is_axis || arc.is_level() {
        Ok(())
    } else {
        Err(PlanningError::OutOfRange { what, value: arc.axis_body.norm_squared(), lower: 0.999, upper: 1.001 })
    }
}
