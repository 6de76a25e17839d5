//! What a body may cover while it follows a turning reference, and what an obstacle covers in a time.

use crate::collision::{BodyShape, Ellipsoid, MovingObstacle};
use crate::error::PlanningError;
use crate::local::Barrier;
use nalgebra::{Matrix3, UnitQuaternion, Vector3};
use tumble_dynamics::AlignedBox;

/// A body about the point that is tracked.
#[derive(Clone, Debug)]
pub(super) struct TrackedBody {
    /// Parts about that point, body axes.
    parts: Vec<Ellipsoid>,
    /// No point of the body is farther from it, m.
    pub radius_m: f64,
}

/// A solid ball or ellipsoid, grown by a ball.
#[derive(Clone, Copy, Debug)]
struct GrownPart {
    center: Vector3<f64>,
    /// None for a ball.
    ellipsoid: Option<Ellipsoid>,
    ball_m: f64,
}

/// Everything that the body may cover about the tracked point during a segment: in one of the parts, and in a ball.
#[derive(Clone, Debug, Default)]
pub(super) struct Cover {
    parts: Vec<GrownPart>,
    radius_m: f64,
}

impl TrackedBody {
    pub fn new(body: &BodyShape, tracked_body: &Vector3<f64>) -> Self {
        let about = |solid: &Ellipsoid| solid.moved_to(solid.center() - tracked_body);
        let parts: Vec<Ellipsoid> = body
            .parts()
            .iter()
            .map(|part| about(&Ellipsoid::posed(&part.body_from_ellipsoid, &part.semi_axes)))
            .collect();
        let reach = |part: &Ellipsoid| f64::sqrt(part.center().norm_squared()) + part.semi_axes().max();
        Self { radius_m: parts.iter().map(reach).fold(0.0, f64::max), parts }
    }

    /// A cover with room for a segment.
    pub fn room(&self) -> Cover {
        Cover { parts: Vec::with_capacity(2 * self.parts.len()), radius_m: self.radius_m }
    }

    /// Covers the body in all attitudes no farther than an angle from one of two.
    ///
    /// A turn by an angle moves no point at a distance r by more than r times the angle, nor by more than 2 r.
    pub fn cover_turned(&self, attitudes: [&UnitQuaternion<f64>; 2], angle_rad: f64, cover: &mut Cover) {
        cover.parts.clear();
        let share = angle_rad.clamp(0.0, 2.0);
        let is_same = attitudes[0] == attitudes[1];
        for attitude in attitudes.into_iter().skip(usize::from(is_same)) {
            let world_from_body: Matrix3<f64> = *attitude.to_rotation_matrix().matrix();
            for part in &self.parts {
                let center = world_from_body * part.center();
                let moved_m = share * f64::sqrt(part.center().norm_squared());
                let (least_m, largest_m) = (part.semi_axes().min(), part.semi_axes().max());
                let turned_m = share * largest_m;
                cover.parts.push(if least_m + turned_m < largest_m {
                    let ellipsoid = Some(part.turned_to(&world_from_body, center));
                    GrownPart { center, ellipsoid, ball_m: moved_m + turned_m }
                } else {
                    // the ball about it is no larger than the ellipsoid grown
                    GrownPart { center, ellipsoid: None, ball_m: moved_m + largest_m }
                });
            }
        }
    }

    /// Covers the body in every attitude.
    pub fn cover_all(&self, cover: &mut Cover) {
        cover.parts.clear();
        cover.parts.push(GrownPart { center: Vector3::zeros(), ellipsoid: None, ball_m: self.radius_m });
    }
}

impl GrownPart {
    fn support(&self, normal: &Vector3<f64>) -> f64 {
        normal.dot(&self.center) + self.ball_m + self.ellipsoid.as_ref().map_or(0.0, |solid| solid.support(normal))
    }

    fn support_point(&self, normal: &Vector3<f64>) -> Vector3<f64> {
        let own = self.ellipsoid.as_ref().map_or(self.center, |solid| solid.support_point(normal));
        own + normal * self.ball_m
    }
}

impl Cover {
    /// How far it reaches along a unit normal from the tracked point, m.
    pub fn support(&self, normal: &Vector3<f64>) -> f64 {
        let of_parts = self.parts.iter().map(|part| part.support(normal)).fold(f64::NEG_INFINITY, f64::max);
        of_parts.min(self.radius_m)
    }

    /// Its point that lies farthest along a unit normal, from the tracked point.
    pub fn support_point(&self, normal: &Vector3<f64>) -> Vector3<f64> {
        let (mut most, mut farthest) = (f64::NEG_INFINITY, Vector3::zeros());
        for part in &self.parts {
            let support = part.support(normal);
            if support > most {
                (most, farthest) = (support, part.support_point(normal));
            }
        }
        if most > self.radius_m { normal * self.radius_m } else { farthest }
    }
}

/// An obstacle as its barrier says, ready to be asked.
#[derive(Clone, Debug)]
pub(super) enum Obstacle {
    Ellipsoid { solid: Ellipsoid, obstacle: Box<MovingObstacle> },
    Box(AlignedBox),
}

/// What an obstacle covers in a time: a solid, moved to all points of the hull of these.
#[derive(Clone, Copy, Debug)]
pub(super) enum Swept<'a> {
    Ellipsoid { solid: &'a Ellipsoid, centers: [Vector3<f64>; 6], count: usize },
    Box(&'a AlignedBox),
}

impl Obstacle {
    pub fn try_new(index: usize, barrier: &Barrier) -> Result<Self, PlanningError> {
        Ok(match barrier {
            Barrier::Ellipsoid(obstacle) => Self::Ellipsoid {
                solid: obstacle.checked(index)?.moved_to(Vector3::zeros()),
                obstacle: Box::new(*obstacle),
            },
            Barrier::Box(aligned) => {
                for (lower, upper) in aligned.lower_world.iter().zip(&aligned.upper_world) {
                    let is_ordered = lower <= upper;
                    if !is_ordered {
                        let what = "an edge's length";
                        return Err(PlanningError::InvalidWorld {
                            part: "keep-out box",
                            index,
                            what,
                            value: upper - lower,
                        });
                    }
                }
                Self::Box(*aligned)
            }
        })
    }

    /// Between two mission times; none where it is not there then.
    pub fn swept(&self, from_s: f64, to_s: f64) -> Option<Swept<'_>> {
        match self {
            Self::Ellipsoid { solid, obstacle } => obstacle.is_present(from_s, to_s).then(|| {
                let centers = obstacle.way(from_s, to_s - from_s);
                let count = if centers.iter().all(|center| *center == centers[0]) { 1 } else { centers.len() };
                Swept::Ellipsoid { solid, centers, count }
            }),
            Self::Box(aligned) => Some(Swept::Box(aligned)),
        }
    }
}

impl Swept<'_> {
    /// Least `normal . x` of its points, m; minus infinity where it has no end.
    pub fn least(&self, normal: &Vector3<f64>) -> f64 {
        match self {
            Self::Ellipsoid { solid, centers, count } => {
                let nearest = centers.iter().take(*count).map(|center| normal.dot(center));
                nearest.fold(f64::INFINITY, f64::min) - solid.support(normal)
            }
            Self::Box(aligned) => {
                let side = |axis: usize| match normal[axis] {
                    along if along > 0.0 => along * aligned.lower_world[axis],
                    along if along < 0.0 => along * aligned.upper_world[axis],
                    _ => 0.0,
                };
                (0..3).map(side).sum()
            }
        }
    }

    /// Its point that lies farthest along a unit normal, of those no farther than `within_m` from a place along each axis.
    pub fn support_point(&self, normal: &Vector3<f64>, place: &Vector3<f64>, within_m: f64) -> Vector3<f64> {
        match self {
            Self::Ellipsoid { solid, centers, count } => {
                let (mut most, mut farthest) = (f64::NEG_INFINITY, Vector3::zeros());
                for center in centers.iter().take(*count) {
                    let along = normal.dot(center);
                    if along > most {
                        (most, farthest) = (along, *center);
                    }
                }
                farthest + solid.support_point(normal)
            }
            Self::Box(aligned) => Vector3::from_fn(|axis, _| {
                let near = (place[axis] - within_m, place[axis] + within_m);
                if normal[axis] >= 0.0 {
                    aligned.upper_world[axis].min(f64::max(near.1, aligned.lower_world[axis]))
                } else {
                    aligned.lower_world[axis].max(f64::min(near.0, aligned.upper_world[axis]))
                }
            }),
        }
    }

    /// The box that holds it: least and largest coordinates.
    pub fn extent(&self) -> (Vector3<f64>, Vector3<f64>) {
        match self {
            Self::Ellipsoid { solid, centers, count } => {
                let half = solid.half_extent();
                let mut ends = (centers[0], centers[0]);
                for center in centers.iter().take(*count) {
                    ends = (ends.0.inf(center), ends.1.sup(center));
                }
                (ends.0 - half, ends.1 + half)
            }
            Self::Box(aligned) => (aligned.lower_world, aligned.upper_world),
        }
    }
}
