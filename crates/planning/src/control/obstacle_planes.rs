//! Planes between a body and its obstacles along a plan, chosen so that a plan that kept off stays one that can be followed.
//!
//! For an obstacle and a segment of the plan, from node `step - 1` to node `step`, a plane `n . r <= offset` keeps the tracked point
//! `r` where the body does not touch the obstacle: the offset is the least `n . y` of the points `y` of the obstacle at any time of
//! the segment, less the farthest that the body reaches along `n` in any attitude that the reference has during the segment, turned
//! by any angle up to the certified error. A plan must keep the plane at both ends of its segment, with its tube.
//!
//! # Laws
//! * Between decisions: the tracked point is no farther from the straight line between its true positions at both ends than the
//!   overshoot that is part of the tube's slack, and both ends keep the plane with tube and slack; so the body touches nothing at any
//!   time of the segment.
//! * From decision to decision: a plane is replaced only by one that the shifted plan keeps, with its tube. Otherwise its normal
//!   stays, and what is behind it, the same segment, the same times, is the same. The segment that is new takes the normal of the
//!   last: the shifted plan rests there. It holds in every attitude, or in that of the last node where the reference has ended. So
//!   as long as obstacles at rest, or moving ones in the segment that is new, do not cut a plane that is kept, a plan that could be
//!   followed has a shifted one that can be. Where one is cut, that is said ([`PlaneUpdate::cut`]): the planes still hold what
//!   they promise, but there may be no plan that keeps them.
//! * The first segment begins at a place the plan cannot choose. It kept the plane of that segment as the end of the one before.

mod hull;
mod separation;

use super::coupled_axes::AxisPlane;
use super::reach::Reach;
use crate::collision::{BodyShape, MovingObstacle, keep_in_complement};
use crate::error::{PlanningError, finite, not_negative};
use crate::local::Barrier;
use hull::{Cover, Obstacle, Swept, TrackedBody};
use nalgebra::{UnitQuaternion, Vector3};
use separation::separating_normal;
use tumble_dynamics::World;

/// What the shifted plan may exceed a plane that is kept by, m: the solver's rounding.
const ROUNDING_M: f64 = 1e-8;

/// Where the tracked point may be in one segment so that the body keeps off one obstacle: `normal . r <= offset`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ObstaclePlane {
    /// Index of the obstacle.
    pub obstacle: usize,
    /// The segment from node `step - 1` to node `step`.
    pub step: usize,
    /// Unit vector from the body to the obstacle, world axes.
    pub normal_world: Vector3<f64>,
    /// Largest `normal . r`, m.
    pub offset_m: f64,
}

/// What a reference does beyond the last node.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum EndAttitude {
    /// It keeps the attitude of that node.
    Held,
    /// It may turn to any.
    Any,
}

/// A plan, with its tube, and the attitudes meanwhile.
#[derive(Clone, Copy, Debug)]
pub struct NominalPath<'a> {
    /// Mission time of the first node, s.
    pub start_s: f64,
    /// Length of a segment, s.
    pub step_s: f64,
    /// Nominal positions of the tracked point at the nodes, in the axes of the plan.
    pub positions: &'a [Vector3<f64>],
    /// Half-widths of the tube of this plan, slack included, along the axes of the plan, m.
    pub tube_m: Vector3<f64>,
    /// The axes of the plan.
    pub world_from_axes: UnitQuaternion<f64>,
    /// Attitudes of the reference at the nodes, world from body.
    pub attitudes: &'a [UnitQuaternion<f64>],
    /// Largest rate at which the reference turns, rad/s.
    pub turn_rad_s: f64,
    /// After the last node.
    pub end: EndAttitude,
    /// Largest angle between the body and the reference, rad.
    pub attitude_error_rad: f64,
}

/// What became of the planes in an update.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct PlaneUpdate {
    /// Planes with a new normal, kept by the shifted plan.
    pub replaced: usize,
    /// Planes whose normal stays.
    pub kept: usize,
    /// Planes that the plan given does not keep.
    pub cut: usize,
    /// Largest excess of the plan given over a plane that is cut, m.
    pub excess_m: f64,
}

/// The planes of all obstacles along a plan.
#[derive(Clone, Debug)]
pub struct ObstaclePlanes {
    body: TrackedBody,
    obstacles: Vec<Obstacle>,
    steps: usize,
    /// Of each obstacle and segment, those of one obstacle one after the other; none where it cannot be reached.
    planes: Vec<Option<ObstaclePlane>>,
    covers: Vec<Cover>,
    nodes_world: Vec<Vector3<f64>>,
}

/// Obstacles, keep-out boxes, and the complement of the keep-in boxes where they are more than one: one alone is walls.
pub fn barriers_of(world: &World) -> Vec<Barrier> {
    let outside = if world.keep_in.len() > 1 { keep_in_complement(&world.keep_in) } else { Vec::new() };
    let boxes = world.keep_out.iter().copied().chain(outside).map(Barrier::Box);
    let ellipsoids = world.obstacles.iter().map(|solid| Barrier::Ellipsoid(MovingObstacle::at_rest(*solid)));
    boxes.chain(ellipsoids).collect()
}

impl ObstaclePlanes {
    /// Planes for a body, whose point `tracked_body` (body axes, m) is planned for, and these obstacles.
    ///
    /// # Errors
    /// Obstacles that cannot be; no steps.
    pub fn try_new(
        body: &BodyShape,
        tracked_body: &Vector3<f64>,
        barriers: &[Barrier],
        steps: usize,
    ) -> Result<Self, PlanningError> {
        if steps == 0 {
            return Err(PlanningError::WrongCount { what: "steps", given: 0, expected: 1 });
        }
        finite("the tracked point", tracked_body.sum())?;
        let body = TrackedBody::new(body, tracked_body);
        let obstacles = barriers.iter().enumerate().map(|(index, barrier)| Obstacle::try_new(index, barrier));
        let obstacles = obstacles.collect::<Result<Vec<_>, _>>()?;
        Ok(Self {
            planes: vec![None; obstacles.len() * steps],
            covers: (0..steps).map(|_| body.room()).collect(),
            nodes_world: vec![Vector3::zeros(); steps + 1],
            obstacles,
            body,
            steps,
        })
    }

    /// Forgets all planes: the next update begins anew.
    pub fn forget(&mut self) {
        self.planes.fill(None);
    }

    /// The planes within reach.
    pub fn planes(&self) -> impl Iterator<Item = &ObstaclePlane> {
        self.planes.iter().flatten()
    }

    /// Moves all planes on by a step, after [`Self::update`] has been called for one before: the last segment keeps its normal.
    pub fn advance(&mut self) {
        for planes in self.planes.chunks_exact_mut(self.steps) {
            planes.rotate_left(1);
            let last = planes.len() - 1;
            planes[last] = if last > 0 { planes[last - 1] } else { planes[last] };
            for (index, plane) in planes.iter_mut().enumerate() {
                if let Some(plane) = plane {
                    plane.step = index + 1;
                }
            }
        }
    }

    /// Chooses the planes of this decision, for a plan that may be followed: the shifted one, or a first guess.
    ///
    /// # Errors
    /// Not one position and one attitude for each node; angles that are negative or no numbers.
    pub fn update(&mut self, path: &NominalPath<'_>, reach: &Reach) -> Result<PlaneUpdate, PlanningError> {
        let nodes = self.steps + 1;
        for (what, given) in [("positions", path.positions.len()), ("attitudes", path.attitudes.len())] {
            if given != nodes {
                return Err(PlanningError::WrongCount { what, given, expected: nodes });
            }
        }
        finite("the start of the plan", path.start_s)?;
        let error_rad = not_negative("the attitude error", path.attitude_error_rad)?;
        let turn_rad = not_negative("the rate of the reference", path.turn_rad_s)? * path.step_s;
        for (world, position) in self.nodes_world.iter_mut().zip(path.positions) {
            *world = path.world_from_axes * position;
        }
        for (cover, pair) in self.covers.iter_mut().zip(path.attitudes.windows(2)) {
            if let [from, to] = pair {
                // no time of the segment is farther from both ends than half of its turn
                self.body.cover_turned([from, to], error_rad + 0.5 * turn_rad, cover);
            }
        }
        if let (EndAttitude::Any, Some(cover)) = (path.end, self.covers.last_mut()) {
            self.body.cover_all(cover);
        }
        let mut update = PlaneUpdate::default();
        for (index, obstacle) in self.obstacles.iter().enumerate() {
            let first = index * self.steps;
            let mut hint = None;
            for (k, cover) in self.covers.iter().enumerate() {
                let from_s = path.start_s + path.step_s * k as f64;
                let to_s = path.start_s + path.step_s * (k + 1) as f64;
                let slot = &mut self.planes[first + k];
                let swept = obstacle.swept(from_s, to_s);
                let swept = swept.filter(|swept| is_within(swept, path, reach, k, self.body.radius_m));
                let Some(swept) = swept else {
                    *slot = None;
                    continue;
                };
                let ends = [self.nodes_world[k], self.nodes_world[k + 1]];
                let segment = Segment { path, cover, swept: &swept, ends };
                let chosen = segment.choose(slot.map(|plane| plane.normal_world), hint, &mut update);
                hint = Some(chosen.normal_world);
                *slot = Some(ObstaclePlane { obstacle: index, step: k + 1, ..chosen });
            }
        }
        Ok(update)
    }

    /// Writes the planes as rows over a plan's nodes in its axes, without those that no plan can reach and those that another
    /// implies.
    pub fn rows(&self, path: &NominalPath<'_>, reach: &Reach, rows: &mut Vec<AxisPlane>) {
        rows.clear();
        let tube_m = reach.tube_m();
        for planes in self.planes.chunks_exact(self.steps) {
            for (k, plane) in planes.iter().enumerate() {
                let Some(plane) = plane else { continue };
                let normal = path.world_from_axes.inverse() * plane.normal_world;
                let offset_m = plane.offset_m;
                let neighbour = |other: Option<&Option<ObstaclePlane>>| {
                    other.copied().flatten().filter(|other| other.normal_world == plane.normal_world)
                };
                let after = neighbour(planes.get(k + 1)).filter(|after| after.offset_m < plane.offset_m);
                let before = k.checked_sub(1).and_then(|before| neighbour(planes.get(before)));
                let before = before.filter(|before| before.offset_m <= plane.offset_m);
                for (node, implied) in [(k, k == 0 || before.is_some()), (k + 1, after.is_some())] {
                    let (middle, half) = reach.at(path.step_s * node as f64);
                    let farthest = normal.dot(&middle) + normal.abs().dot(&(half + tube_m));
                    if !implied && farthest > offset_m {
                        let (obstacle, step) = (plane.obstacle, plane.step);
                        rows.push(AxisPlane { obstacle, step, node, normal, offset_m });
                    }
                }
            }
        }
    }
}

/// Whether an obstacle can be touched during a segment at all.
fn is_within(swept: &Swept<'_>, path: &NominalPath<'_>, reach: &Reach, k: usize, radius_m: f64) -> bool {
    let (lower, upper) = swept.extent();
    let ends = [k, k + 1].map(|node| reach.at(path.step_s * node as f64));
    let rotation = path.world_from_axes.to_rotation_matrix();
    let boxes = ends.map(|(middle, half)| {
        let middle = rotation * middle;
        let half = rotation.matrix().abs() * (half + reach.tube_m());
        (middle - half, middle + half)
    });
    let [first, second] = boxes;
    let grown = (first.0.inf(&second.0).add_scalar(-radius_m), first.1.sup(&second.1).add_scalar(radius_m));
    (0..3).all(|axis| grown.0[axis] <= upper[axis] && grown.1[axis] >= lower[axis])
}

/// One obstacle and one segment.
struct Segment<'a> {
    path: &'a NominalPath<'a>,
    cover: &'a Cover,
    swept: &'a Swept<'a>,
    /// Nominal positions of both ends, world axes.
    ends: [Vector3<f64>; 2],
}

impl Segment<'_> {
    /// The plane with a normal.
    fn plane(&self, normal_world: Vector3<f64>) -> ObstaclePlane {
        let offset_m = self.swept.least(&normal_world) - self.cover.support(&normal_world);
        ObstaclePlane { obstacle: 0, step: 0, normal_world, offset_m }
    }

    /// How far the plan, with its tube, stays below a plane, m.
    fn room_m(&self, plane: &ObstaclePlane) -> f64 {
        let normal = self.path.world_from_axes.inverse() * plane.normal_world;
        let tube_m = normal.abs().dot(&self.path.tube_m);
        let [from, to] = self.ends.map(|end| plane.normal_world.dot(&end));
        plane.offset_m - f64::max(from, to) - tube_m
    }

    /// The point of body and tube that lies farthest along a unit normal.
    fn farthest(&self, normal: &Vector3<f64>) -> Vector3<f64> {
        let [from, to] = self.ends;
        let end = if normal.dot(&from) > normal.dot(&to) { from } else { to };
        let rotation = self.path.world_from_axes;
        let along = rotation.inverse() * normal;
        let corner = self.path.tube_m.zip_map(&along, |half: f64, along: f64| half.copysign(along));
        end + rotation * corner + self.cover.support_point(normal)
    }

    /// The normal of the widest gap.
    fn widest(&self, hint: &Vector3<f64>) -> Option<Vector3<f64>> {
        let place = self.ends[0];
        // beyond this a box without an end is cut off
        let within_m = 4.0 * (1.0 + self.cover.support(hint).abs() + f64::sqrt((self.ends[1] - place).norm_squared()));
        let obstacle = |normal: &Vector3<f64>| self.swept.support_point(normal, &place, within_m);
        let normal = separating_normal(|normal| self.farthest(normal), obstacle, hint)?;
        match self.swept {
            Swept::Ellipsoid { .. } => Some(normal),
            Swept::Box(aligned) => {
                // across a side without an end there is nothing but rounding
                let cleaned = Vector3::from_fn(|axis, _| {
                    let is_open = aligned.lower_world[axis].is_infinite() || aligned.upper_world[axis].is_infinite();
                    if is_open && normal[axis].abs() < 1e-9 { 0.0 } else { normal[axis] }
                });
                Some(cleaned / f64::sqrt(cleaned.norm_squared()))
            }
        }
    }

    /// The plane of this decision.
    fn choose(
        &self,
        kept: Option<Vector3<f64>>,
        hint: Option<Vector3<f64>>,
        update: &mut PlaneUpdate,
    ) -> ObstaclePlane {
        let start = kept.or(hint).unwrap_or_else(Vector3::x);
        let widest = self.widest(&start);
        if let Some(plane) = widest.map(|normal| self.plane(normal))
            && self.room_m(&plane) >= 0.0
        {
            update.replaced += 1;
            return plane;
        }
        if let Some(plane) = kept.map(|normal| self.plane(normal))
            && self.room_m(&plane) >= -ROUNDING_M
        {
            update.kept += 1;
            return plane;
        }
        // none is kept by the plan: the one it exceeds least
        let axes = [Vector3::x(), Vector3::y(), Vector3::z()];
        let sides = axes.into_iter().flat_map(|axis| [axis, -axis]);
        let mut best = self.plane(start);
        for normal in kept.into_iter().chain(widest).chain(sides) {
            let plane = self.plane(normal);
            if self.room_m(&plane) > self.room_m(&best) {
                best = plane;
            }
        }
        let room_m = self.room_m(&best);
        if room_m >= 0.0 {
            update.replaced += 1;
        } else {
            update.cut += 1;
            update.excess_m = f64::max(update.excess_m, -room_m);
        }
        best
    }
}
