//! What a body may hit, and exactly when.

mod aligned_box;
mod batch;
mod broad_phase;
mod conservative;
mod contact_function;
mod distance;
mod double_double;
mod ellipsoid;
mod half_space;
mod keep_in;
mod margin;
mod obstacle;
#[cfg(feature = "parry")]
mod parry;
pub(crate) mod polynomial;
mod sphere;
mod sweep;
mod world;

pub use aligned_box::{ellipsoid_to_box, sphere_to_box};
pub use conservative::conservative_first_contact;
pub use contact_function::{Plane, Separation, overlap, separation};
pub use distance::{Distance, distance, distance_from_hint};
pub use ellipsoid::Ellipsoid;
pub use half_space::{HalfSpace, ellipsoid_to_half_space, sphere_to_half_space};
pub use keep_in::{KEEP_IN_GAP_M, keep_in_complement};
pub use margin::{ScalingMargin, scaling_margin};
#[cfg(feature = "parry")]
pub use parry::{PARRY_TOLERANCE, ParryBody, ParryWorld};
pub use sphere::{Sphere, ellipsoid_to_point, ellipsoid_to_sphere, sphere_to_sphere};
pub use world::{EllipsoidWorld, MovingObstacle};

use crate::error::PlanningError;
use crate::motion::BodyArc;
use nalgebra::Vector3;
use tumble_lie::Pose;

/// What stands in the way.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
#[non_exhaustive]
pub enum Blocker {
    /// The obstacle with this index: in [`EllipsoidWorld`] those of the world first, then those added, in their order.
    Obstacle(usize),
    /// The keep-out box with this index.
    KeepOut(usize),
    /// The end of the volume that the keep-in boxes allow.
    KeepIn,
}

impl core::fmt::Display for Blocker {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        match self {
            Self::Obstacle(index) => write!(f, "obstacle {index}"),
            Self::KeepOut(index) => write!(f, "keep-out box {index}"),
            Self::KeepIn => f.write_str("the end of where it may be"),
        }
    }
}

/// How far a body is from what it may hit.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Clearance {
    /// Distance, m: zero at contact, negative inside, infinite in an empty world.
    pub distance_m: f64,
    /// What is nearest.
    pub nearest: Option<Blocker>,
}

/// The first contact of a motion.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Contact {
    /// Time since the start of the motion, s.
    pub time_s: f64,
    /// What is hit.
    pub blocker: Blocker,
}

/// Everything a body may hit. Times are those of the mission, so that what moves or appears later can be there.
///
/// # Laws
/// `laws::check_collision_world`: the clearance changes by no more than the body's origin moves at a constant attitude, at
/// any one time; a motion reported free has no pose of negative clearance; a contact reported is one.
///
/// # Example
/// ```
/// use tumble_planning::collision::{Blocker, Clearance, CollisionWorld, Contact, conservative_first_contact};
/// use tumble_planning::lie::Pose;
/// use tumble_planning::nalgebra::{UnitQuaternion, Vector3};
/// use tumble_planning::{BodyArc, PlanningError, TranslationState};
///
/// /// Everything below z = 0 is floor; the body is a ball by its radius, m.
/// struct Floor;
/// impl CollisionWorld for Floor {
///     type Body = f64;
///     fn clearance(&self, radius_m: &f64, world_from_body: &Pose<f64>, _time_s: f64) -> Result<Clearance, PlanningError> {
///         Ok(Clearance { distance_m: world_from_body.translation.z - radius_m, nearest: Some(Blocker::Obstacle(0)) })
///     }
///     fn first_contact(&self, radius_m: &f64, arc: &BodyArc, start_s: f64, margin_m: f64)
///         -> Result<Option<Contact>, PlanningError> {
///         conservative_first_contact(self, radius_m, arc, start_s, margin_m, 1e-9)
///     }
///     fn reach_m(&self, radius_m: &f64) -> f64 {
///         *radius_m
///     }
/// }
/// let start = TranslationState { position: Vector3::z(), velocity: Vector3::z() * -0.1 };
/// let falling = BodyArc::accelerated(20.0, &start, Vector3::zeros(), UnitQuaternion::identity());
/// let contact = Floor.first_contact(&0.2, &falling, 0.0, 0.0)?.ok_or("it falls through")?;
/// assert!((contact.time_s - 8.0).abs() < 1e-7);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
/// Tutorial: [a collision world of your own](https://github.com/tumble-robotics/tumble/blob/main/crates/planning/tests/suite/custom_collision_world.rs).
pub trait CollisionWorld {
    /// What moves.
    type Body: ?Sized;

    /// Distance of `body` at a pose and time.
    ///
    /// # Errors
    /// What the back end cannot answer. Never a silent "free".
    fn clearance(
        &self,
        body: &Self::Body,
        world_from_body: &Pose<f64>,
        time_s: f64,
    ) -> Result<Clearance, PlanningError>;

    /// First time at which `body`, moving along `arc` from the mission time `start_s` on, comes nearer than `margin_m` to
    /// anything; `None` where it certainly never does.
    ///
    /// # Errors
    /// What the back end cannot answer. Never a silent "free".
    fn first_contact(
        &self,
        body: &Self::Body,
        arc: &BodyArc,
        start_s: f64,
        margin_m: f64,
    ) -> Result<Option<Contact>, PlanningError>;

    /// True where nothing moves, appears or vanishes from this mission time on, so that a motion found free stays free
    /// when it begins later; false where that is not known.
    fn is_still_from(&self, _time_s: f64) -> bool {
        false
    }

    /// True where the attitude of the body makes no difference; false where that is not known.
    fn is_round(&self, _body: &Self::Body) -> bool {
        false
    }

    /// Clearance from what is there at every time from `from_s` on and never moves: an upper bound of the clearance at
    /// any such time, which changes by no more than the origin moves. Only this may prove that no way exists, or how long the
    /// shortest one is at least.
    ///
    /// A world that never changes answers `self.clearance(body, world_from_body, from_s)`. The default knows of nothing
    /// that lasts: infinite, which is always true and proves nothing.
    ///
    /// # Errors
    /// What the back end cannot answer.
    fn lasting_clearance(
        &self,
        _body: &Self::Body,
        _world_from_body: &Pose<f64>,
        _from_s: f64,
    ) -> Result<Clearance, PlanningError> {
        Ok(Clearance { distance_m: f64::INFINITY, nearest: None })
    }

    /// Largest distance of a point of the body from its origin, m.
    fn reach_m(&self, body: &Self::Body) -> f64;
}

/// One ellipsoid of a body.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct BodyEllipsoid {
    /// Centre and axes.
    pub body_from_ellipsoid: Pose<f64>,
    /// Semi-axes, m.
    pub semi_axes: Vector3<f64>,
}

/// A body as the union of ellipsoids.
#[derive(Clone, Debug, PartialEq)]
pub struct BodyShape {
    parts: Vec<BodyEllipsoid>,
}

impl BodyShape {
    /// A union of ellipsoids.
    ///
    /// # Errors
    /// No parts; semi-axes that are not positive and finite; lengths beyond 1e20 m, semi-axes below 1e-20 m or
    /// more unlike than the factor 1e4.
    pub fn try_new(parts: Vec<BodyEllipsoid>) -> Result<Self, PlanningError> {
        if parts.is_empty() {
            return Err(PlanningError::NoBody);
        }
        for part in &parts {
            crate::error::semi_axes("a semi-axis of the body", &part.semi_axes)?;
            crate::error::pose(&part.body_from_ellipsoid)?;
        }
        Ok(Self { parts })
    }

    /// A sphere about the body origin.
    ///
    /// # Errors
    /// A radius that is not positive and finite.
    pub fn sphere(radius_m: f64) -> Result<Self, PlanningError> {
        Self::try_new(vec![BodyEllipsoid {
            body_from_ellipsoid: Pose::identity(),
            semi_axes: Vector3::repeat(radius_m),
        }])
    }

    /// The parts.
    pub fn parts(&self) -> &[BodyEllipsoid] {
        &self.parts
    }

    /// Radius of a ball about the body origin that lies inside one part, m; zero where no part holds the origin. Whatever
    /// blocks this ball blocks the body in every attitude.
    pub fn inscribed_radius_m(&self) -> f64 {
        let inscribed = |part: &BodyEllipsoid| {
            let origin = part.body_from_ellipsoid.inverse().translation.vector;
            (1.0 - f64::sqrt(origin.component_div(&part.semi_axes).norm_squared())) * part.semi_axes.min()
        };
        self.parts.iter().map(inscribed).fold(0.0, f64::max)
    }

    /// Radius of the smallest sphere about the body origin that holds every part's bounding sphere, m.
    pub fn bounding_radius_m(&self) -> f64 {
        let reach = |part: &BodyEllipsoid| part.body_from_ellipsoid.translation.vector.norm() + part.semi_axes.max();
        self.parts.iter().map(reach).fold(0.0, f64::max)
    }
}
