//! What a local plan must keep off.

mod closest;
mod gap;
mod gauge;
mod hermite;
mod pair_rows;
mod turn;

use super::model::{KINEMATICS, Kinematics};
use super::rows::MotionRow;
use crate::collision::{
    Blocker, BodyEllipsoid, BodyShape, Ellipsoid, EllipsoidWorld, MovingObstacle, Sphere, keep_in_complement,
};
use crate::error::PlanningError;
use gap::{Approach, Part, Solid};
use gauge::Gauge;
use hermite::Segment;
use nalgebra::Vector3;
pub use pair_rows::RowSettings;
use pair_rows::node_row;
use tumble_dynamics::{AlignedBox, World};
use turn::Turn;

/// What a body is for its surroundings.
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
pub enum Hull {
    /// Its origin: obstacles are inflated already.
    Point,
    /// Its ellipsoids.
    Shape(BodyShape),
}

/// A convex solid to keep off.
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
pub enum Barrier {
    /// An ellipsoid, at rest or moving, for all times or some.
    Ellipsoid(MovingObstacle),
    /// A box; its sides may be infinite.
    Box(AlignedBox),
}

/// The solids around a body, and the body's shape.
#[derive(Clone, Debug, PartialEq)]
pub struct Surroundings {
    hull: Hull,
    /// Those of the hull.
    parts: Vec<Part>,
    barriers: Vec<(Blocker, Barrier)>,
    /// The ellipsoids of the barriers as they are when their motion begins, none for boxes.
    solids: Vec<Option<Ellipsoid>>,
}

/// How fast the motion of a rigid body under a wrench held in body axes can change.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct MotionBounds {
    /// Largest acceleration of the centre of mass, m/s^2.
    pub acceleration_m_s2: f64,
    /// Largest angular rate, rad/s.
    pub rate_rad_s: f64,
    /// Largest angular acceleration that the torques give, rad/s^2.
    pub angular_acceleration_rad_s2: f64,
    /// Distance of the centre of mass from the origin, m.
    pub center_of_mass_m: f64,
}

impl MotionBounds {
    /// Farthest that a point of the body, `reach_m` from its origin, may be from the cubic with its positions and velocities at
    /// both ends of a step: what [`Surroundings::interpolation_error_m`] derives.
    pub(crate) fn hermite_error_m(&self, step_s: f64, reach_m: f64) -> f64 {
        let squared_step = step_s * step_s;
        let rate = self.rate_rad_s * self.rate_rad_s;
        let turn = self.angular_acceleration_rad_s2 + 0.58 * rate;
        let of_center = self.acceleration_m_s2 * (rate + turn);
        let of_turn = rate * rate + 12.0 * rate * turn + 4.2 * turn * turn;
        squared_step * squared_step / 384.0 * (of_center + (reach_m + self.center_of_mass_m) * of_turn)
    }
}

/// The value of a row whose obstacle is not there: nothing asks for it to be kept.
const ABSENT: f64 = 1.0;

impl Surroundings {
    /// Nothing around.
    pub fn none() -> Self {
        Self { parts: parts_of(&Hull::Point), hull: Hull::Point, barriers: Vec::new(), solids: Vec::new() }
    }

    /// Obstacles, keep-out boxes and the complement of the keep-in boxes of a world. Blockers have the indices of
    /// [`EllipsoidWorld`].
    ///
    /// # Errors
    /// A world that cannot be: those of [`EllipsoidWorld::new`].
    pub fn of_world(world: &World, hull: Hull) -> Result<Self, PlanningError> {
        EllipsoidWorld::new(world)?;
        let keep_out = world.keep_out.iter().enumerate().map(|(index, aligned)| (Blocker::KeepOut(index), *aligned));
        let keep_in = keep_in_complement(&world.keep_in).into_iter().map(|aligned| (Blocker::KeepIn, aligned));
        let barriers: Vec<_> =
            keep_out.chain(keep_in).map(|(blocker, aligned)| (blocker, Barrier::Box(aligned))).collect();
        let solids = vec![None; barriers.len()];
        Self { parts: parts_of(&hull), hull, barriers, solids }
            .with_moving(world.obstacles.iter().map(|solid| MovingObstacle::at_rest(*solid)))
    }

    /// The same with more obstacles; their indices are the next free ones.
    ///
    /// # Errors
    /// [`PlanningError::InvalidWorld`], [`PlanningError::TooUnlike`].
    pub fn with_moving(mut self, obstacles: impl IntoIterator<Item = MovingObstacle>) -> Result<Self, PlanningError> {
        let is_obstacle = |(blocker, _): &&(Blocker, Barrier)| matches!(blocker, Blocker::Obstacle(_));
        let first = self.barriers.iter().filter(is_obstacle).count();
        for (index, obstacle) in (first..).zip(obstacles) {
            self.solids.push(Some(obstacle.checked(index)?));
            self.barriers.push((Blocker::Obstacle(index), Barrier::Ellipsoid(obstacle)));
        }
        Ok(self)
    }

    /// The shape that may hit.
    pub fn hull(&self) -> &Hull {
        &self.hull
    }

    /// What is kept off, with the names under which it is reported.
    pub fn barriers(&self) -> &[(Blocker, Barrier)] {
        &self.barriers
    }

    /// Farthest that a point of the hull may be from where the interpolation of rows on segments takes it to be, for motions
    /// within bounds.
    ///
    /// Between nodes a row takes the origin to follow the cubic that has the positions and velocities of both nodes; no
    /// function is farther from that than `step^4 / 384` times its largest fourth derivative. Under a force held in body axes that is
    /// at most `a (w^2 + a')`, for acceleration a, rate w and angular acceleration a'; and for a point fixed to the body about
    /// the centre of mass, under a torque held in body axes, `w^4 + 12 w^2 a' + 4.2 a'^2` times its distance from there. To what the
    /// torque gives, a free body's own turning adds at most `0.58 w^2`.
    ///
    /// # Source
    /// Davis, "Interpolation and Approximation" (1963), 3.5: remainder of Hermite interpolation.
    pub fn interpolation_error_m(&self, step_s: f64, bounds: &MotionBounds) -> f64 {
        let reach_m = match &self.hull {
            Hull::Point => 0.0,
            Hull::Shape(shape) => shape.bounding_radius_m(),
        };
        bounds.hermite_error_m(step_s, reach_m)
    }

    /// Number of rows of a motion of so many segments: the same for every motion.
    pub fn rows(&self, segments: usize, settings: &RowSettings) -> usize {
        self.barriers.len() * self.parts.len() * rows_of_one(segments, settings)
    }

    /// The values of the rows of a motion.
    pub fn values(&self, motion: &[Kinematics], settings: &RowSettings, values: &mut [f64]) {
        let mut places = values.iter_mut();
        self.each_row::<false>(motion, settings, &mut |row| {
            if let Some(place) = places.next() {
                *place = row.value;
            }
        });
    }

    /// The rows with their gradients, in the same order; `rows` has their number.
    ///
    /// A row is that of a node, where its `by_start` is zero, or that of the segment before this node; all rows of one obstacle
    /// come one after the other. The row of an obstacle that is not there, at that time, is one, whatever the motion.
    pub fn linearize(&self, motion: &[Kinematics], settings: &RowSettings, rows: &mut [MotionRow]) {
        let mut places = rows.iter_mut();
        self.each_row::<true>(motion, settings, &mut |row| {
            if let Some(place) = places.next() {
                *place = row;
            }
        });
    }

    /// What the row with this index keeps off.
    pub fn blocker(&self, row: usize, segments: usize, settings: &RowSettings) -> Option<Blocker> {
        let barrier = row.checked_div(self.parts.len() * rows_of_one(segments, settings))?;
        self.barriers.get(barrier).map(|(blocker, _)| *blocker)
    }

    /// Support function of a barrier at a mission time: the largest `direction . x` of its points, infinite where it has no end.
    pub(super) fn support(&self, barrier: usize, direction: &Vector3<f64>, time_s: f64) -> f64 {
        match (self.barriers.get(barrier), self.solids.get(barrier)) {
            (Some((_, Barrier::Ellipsoid(obstacle))), Some(Some(solid))) => {
                direction.dot(&obstacle.center_at(time_s)) + solid.support(direction)
            }
            (Some((_, Barrier::Box(aligned))), _) => {
                let side = |axis: usize| match direction[axis] {
                    along if along > 0.0 => along * aligned.upper_world[axis],
                    along if along < 0.0 => along * aligned.lower_world[axis],
                    _ => 0.0,
                };
                (0..3).map(side).sum()
            }
            _ => f64::NEG_INFINITY,
        }
    }

    /// True where a barrier is there at a mission time.
    pub(super) fn is_present(&self, barrier: usize, time_s: f64) -> bool {
        match self.barriers.get(barrier) {
            Some((_, Barrier::Ellipsoid(obstacle))) => obstacle.is_present(time_s, time_s),
            Some((_, Barrier::Box(_))) => true,
            None => false,
        }
    }

    fn each_row<const GRADIENT: bool>(
        &self,
        motion: &[Kinematics],
        settings: &RowSettings,
        put: &mut impl FnMut(MotionRow),
    ) {
        let on_segments_m = settings.margin_m + settings.interpolation_error_m;
        for ((_, barrier), solid) in self.barriers.iter().zip(&self.solids) {
            let (obstacle, solid) = match (barrier, solid) {
                (Barrier::Ellipsoid(obstacle), Some(solid)) => (Some(obstacle), Solid::Ellipsoid(solid)),
                (Barrier::Box(aligned), _) => (None, Solid::Box(aligned)),
                (Barrier::Ellipsoid(_), None) => continue,
            };
            if let (Hull::Point, Solid::Ellipsoid(solid)) = (&self.hull, solid) {
                let at_nodes = Gauge::new(solid, settings.margin_m);
                let on_segments = Gauge::new(solid, on_segments_m);
                let at_node =
                    |node: usize, end: &Kinematics, center: &Vector3<f64>| at_nodes.node_row(node, end, center);
                let on_segment = |node: usize, ends: [&Kinematics; 2], way: &[Vector3<f64>; 6]| {
                    let segment = Segment::new(ends[0], ends[1], settings.step_s);
                    on_segments.segment_row::<GRADIENT>(node, &segment, way)
                };
                rows_of_pair(motion, settings, obstacle, at_node, on_segment, put);
                continue;
            }
            for part in &self.parts {
                let at_node = |node: usize, end: &Kinematics, center: &Vector3<f64>| {
                    node_row(node, part, &solid, center, end, settings)
                };
                let on_segment = |node: usize, ends: [&Kinematics; 2], way: &[Vector3<f64>; 6]| {
                    let segment = Segment::new(ends[0], ends[1], settings.step_s);
                    let turn = Turn::new(ends[0], ends[1], settings.step_s);
                    let approach = Approach { part, solid, way, segment: &segment, turn: &turn };
                    approach.row::<GRADIENT>(node, settings)
                };
                rows_of_pair(motion, settings, obstacle, at_node, on_segment, put);
            }
        }
    }
}

/// The rows of one part of the hull against one barrier.
fn rows_of_pair(
    motion: &[Kinematics],
    settings: &RowSettings,
    obstacle: Option<&MovingObstacle>,
    at_node: impl Fn(usize, &Kinematics, &Vector3<f64>) -> MotionRow,
    on_segment: impl Fn(usize, [&Kinematics; 2], &[Vector3<f64>; 6]) -> MotionRow,
    put: &mut impl FnMut(MotionRow),
) {
    for (node, (start, end)) in motion.iter().zip(motion.iter().skip(1)).enumerate() {
        let [from_s, to_s] = [node, node + 1].map(|node| settings.start_s + settings.step_s * node as f64);
        let is_present = |from_s: f64, to_s: f64| obstacle.is_none_or(|obstacle| obstacle.is_present(from_s, to_s));
        put(if is_present(to_s, to_s) {
            at_node(node, end, &obstacle.map_or_else(Vector3::zeros, |obstacle| obstacle.center_at(to_s)))
        } else {
            absent(node)
        });
        if settings.on_segments {
            put(if is_present(from_s, to_s) {
                let rest = [Vector3::zeros(); 6];
                let way = obstacle.map_or(rest, |obstacle| obstacle.way(from_s, settings.step_s));
                on_segment(node, [start, end], &way)
            } else {
                absent(node)
            });
        }
    }
}

/// A point is a ball of no size.
fn parts_of(hull: &Hull) -> Vec<Part> {
    let part = |part: &BodyEllipsoid| {
        let radius_m = part.semi_axes.max();
        if part.semi_axes.min() >= radius_m {
            Part::Ball(Sphere { center: part.body_from_ellipsoid.translation.vector, radius_m })
        } else {
            Part::Ellipsoid(Ellipsoid::posed(&part.body_from_ellipsoid, &part.semi_axes))
        }
    };
    match hull {
        Hull::Point => vec![Part::Ball(Sphere { center: Vector3::zeros(), radius_m: 0.0 })],
        Hull::Shape(shape) => shape.parts().iter().map(part).collect(),
    }
}

fn rows_of_one(segments: usize, settings: &RowSettings) -> usize {
    if settings.on_segments { 2 * segments } else { segments }
}

fn absent(node: usize) -> MotionRow {
    MotionRow { node, value: ABSENT, by_start: [0.0; KINEMATICS], by_end: [0.0; KINEMATICS], contact: None }
}
