//! Convex pieces of parry's shapes, and how far two of them are apart.

use crate::error::PlanningError;
use nalgebra::Vector3;
use parry3d_f64::math::{Pose, Vector};
use parry3d_f64::query::epa::EPA;
use parry3d_f64::query::gjk::{CsoPoint, VoronoiSimplex};
use parry3d_f64::shape::{Cuboid, HalfSpace, Segment, SharedShape, SupportMap, Triangle, TypedShape};
use tumble_dynamics::AlignedBox;

/// What a clearance of a [`ParryWorld`](super::ParryWorld) may fall short of the distance: this many m, or this share of the distance
/// where that is more. It never exceeds the distance but by rounding.
pub const PARRY_TOLERANCE: f64 = 1e-6;

/// Farthest that anything may be, m: squares of lengths stay finite.
pub(super) const FARTHEST_M: f64 = 1e100;

/// Most steps of one search.
const STEPS: usize = 200;
/// A search ends with bounds that are this close, m or share of the distance.
const ENOUGH: f64 = 1e-8;
/// A few roundings.
const ROUNDING: f64 = 1e-15;

/// The shape that a piece is, up to a layer of the same thickness all around.
#[derive(Clone)]
pub(super) enum Core {
    Point,
    Segment(Segment),
    Triangle(Triangle),
    Convex(SharedShape),
}

impl SupportMap for Core {
    fn local_support_point(&self, direction: Vector) -> Vector {
        match self {
            Self::Point => Vector::ZERO,
            Self::Segment(segment) => segment.local_support_point(direction),
            Self::Triangle(triangle) => triangle.local_support_point(direction),
            // Only what has a support map becomes a core.
            Self::Convex(shape) => {
                shape.as_support_map().map_or(Vector::NAN, |convex| convex.local_support_point(direction))
            }
        }
    }
}

/// A convex piece: a core and a layer around it.
#[derive(Clone)]
pub(super) struct Piece {
    pub core: Core,
    pub frame_from_core: Pose,
    pub layer_m: f64,
    /// Its box, in the frame.
    pub bounds: AlignedBox,
    /// Largest distance of its points from the origin of the frame, m.
    pub reach_m: f64,
}

/// What a shape is made of.
pub(super) enum Part {
    Piece(Piece),
    /// Everything on the other side of the plane `normal . x = offset_m`; the normal points out.
    HalfSpace {
        normal: Vector,
        offset_m: f64,
    },
}

/// A distance between two bounds, m.
#[derive(Clone, Copy, Debug)]
pub(super) struct Bounds {
    pub lower_m: f64,
    pub upper_m: f64,
}

impl Bounds {
    pub fn gap_m(&self) -> f64 {
        self.upper_m - self.lower_m
    }
}

fn to_ours(v: Vector) -> Vector3<f64> {
    Vector3::new(v.x, v.y, v.z)
}

impl Piece {
    fn new(core: Core, frame_from_core: Pose, layer_m: f64) -> Self {
        let place = |point: Vector| frame_from_core * point;
        let (points, sphere) = match &core {
            Core::Point => (vec![place(Vector::ZERO)], None),
            Core::Segment(segment) => (vec![place(segment.a), place(segment.b)], None),
            Core::Triangle(triangle) => (vec![place(triangle.a), place(triangle.b), place(triangle.c)], None),
            Core::Convex(shape) => {
                let bounds = shape.compute_aabb(&frame_from_core);
                (vec![bounds.mins, bounds.maxs], Some(shape.compute_bounding_sphere(&frame_from_core)))
            }
        };
        let infinite = Vector3::repeat(f64::INFINITY);
        let (mut lower, mut upper) = (infinite, -infinite);
        for point in &points {
            lower = lower.inf(&to_ours(*point));
            upper = upper.sup(&to_ours(*point));
        }
        let lengths = points.iter().map(|point| point.length());
        // A maximum would leave out what is not a number.
        let all = lengths.clone().sum::<f64>();
        let farthest = if all.is_finite() { lengths.fold(0.0, f64::max) } else { all };
        let reach_m = sphere.map_or(farthest, |sphere| sphere.center.length() + sphere.radius) + layer_m;
        let layer = Vector3::repeat(layer_m);
        let bounds = AlignedBox { lower_world: lower - layer, upper_world: upper + layer };
        Self { core, frame_from_core, layer_m, bounds, reach_m }
    }

    /// A ball about the origin of the frame.
    pub fn is_round(&self) -> bool {
        matches!(self.core, Core::Point) && self.frame_from_core.translation == Vector::ZERO
    }

    /// Why it is none, if so: what is wrong, and its value.
    fn defect(&self) -> Option<(&'static str, f64)> {
        if !(self.layer_m >= 0.0 && self.layer_m < FARTHEST_M) {
            return Some(("a radius", self.layer_m));
        }
        let axes = [Vector::X, Vector::Y, Vector::Z, -Vector::X, -Vector::Y, -Vector::Z];
        let points = axes.map(|axis| self.core.support_point(&self.frame_from_core, axis));
        let coordinates = points.iter().flat_map(|point| [point.x, point.y, point.z]);
        let AlignedBox { lower_world, upper_world } = &self.bounds;
        let coordinates = coordinates.chain(lower_world.iter().copied()).chain(upper_world.iter().copied());
        for coordinate in coordinates.chain([self.reach_m]) {
            // Nor may it be no number.
            let is_near = coordinate.abs() < FARTHEST_M;
            if !is_near {
                return Some(("a coordinate", coordinate));
            }
        }
        // What is searched by boxes must be inside of them.
        let beyond = |point: &Vector| (lower_world - to_ours(*point)).sup(&(to_ours(*point) - upper_world)).max();
        let beyond_m = points.iter().map(beyond).fold(f64::NEG_INFINITY, f64::max);
        (beyond_m > 1e-12 * self.reach_m).then_some(("a point's distance from the shape's own box", beyond_m))
    }
}

/// The convex pieces and half-spaces of a shape.
pub(super) fn decompose(
    shape: &SharedShape,
    frame_from_shape: Pose,
    index: usize,
    parts: &mut Vec<Part>,
) -> Result<(), PlanningError> {
    let mut add = |core: Core, frame_from_core: Pose, layer_m: f64| {
        let piece = Piece::new(core, frame_from_core, layer_m);
        match piece.defect() {
            None => parts.push(Part::Piece(piece)),
            Some((what, value)) => return Err(PlanningError::InvalidWorld { part: "shape", index, what, value }),
        }
        Ok(())
    };
    let at = frame_from_shape;
    match shape.as_typed_shape() {
        TypedShape::Ball(ball) => add(Core::Point, at, ball.radius),
        TypedShape::Capsule(capsule) => add(Core::Segment(capsule.segment), at, capsule.radius),
        TypedShape::Segment(segment) => add(Core::Segment(*segment), at, 0.0),
        TypedShape::Triangle(triangle) => add(Core::Triangle(*triangle), at, 0.0),
        TypedShape::RoundTriangle(round) => add(Core::Triangle(round.inner_shape), at, round.border_radius),
        TypedShape::RoundCuboid(round) => {
            add(Core::Convex(SharedShape::new(round.inner_shape)), at, round.border_radius)
        }
        TypedShape::RoundCylinder(round) => {
            add(Core::Convex(SharedShape::new(round.inner_shape)), at, round.border_radius)
        }
        TypedShape::RoundCone(round) => add(Core::Convex(SharedShape::new(round.inner_shape)), at, round.border_radius),
        TypedShape::RoundConvexPolyhedron(round) => {
            add(Core::Convex(SharedShape::new(round.inner_shape.clone())), at, round.border_radius)
        }
        TypedShape::TriMesh(mesh) => mesh.triangles().try_for_each(|triangle| add(Core::Triangle(triangle), at, 0.0)),
        TypedShape::HeightField(field) => {
            field.triangles().try_for_each(|triangle| add(Core::Triangle(triangle), at, 0.0))
        }
        TypedShape::Polyline(line) => line.segments().try_for_each(|segment| add(Core::Segment(segment), at, 0.0)),
        TypedShape::Voxels(voxels) => {
            let cube = SharedShape::new(Cuboid::new(voxels.voxel_size() * 0.5));
            let filled = voxels.voxels().filter(|voxel| !voxel.state.is_empty());
            filled
                .into_iter()
                .try_for_each(|voxel| add(Core::Convex(cube.clone()), at * Pose::from_translation(voxel.center), 0.0))
        }
        TypedShape::Compound(compound) => {
            compound.shapes().iter().try_for_each(|(pose, part)| decompose(part, at * *pose, index, parts))
        }
        TypedShape::HalfSpace(HalfSpace { normal }) => {
            let normal = at.rotation * *normal;
            let (length, offset_m) = (normal.length(), normal.dot(at.translation));
            if !(f64::abs(length - 1.0) < 1e-6 && offset_m.abs() < FARTHEST_M) {
                return Err(PlanningError::InvalidWorld {
                    part: "shape",
                    index,
                    what: "a half-space's normal or offset",
                    value: length,
                });
            }
            parts.push(Part::HalfSpace { normal: normal / length, offset_m: offset_m / length });
            Ok(())
        }
        TypedShape::Cuboid(_) | TypedShape::ConvexPolyhedron(_) | TypedShape::Cylinder(_) | TypedShape::Cone(_) => {
            add(Core::Convex(shape.clone()), at, 0.0)
        }
        TypedShape::Custom(custom) => match custom.as_support_map() {
            Some(_) => add(Core::Convex(shape.clone()), at, 0.0),
            None => Err(PlanningError::Unsupported { query: "measure a custom shape without a support map" }),
        },
    }
}

/// Two cores, as the first one sees them.
struct Pair<'a> {
    a: &'a Core,
    b: &'a Core,
    a_from_b: Pose,
}

impl Pair<'_> {
    /// The difference of a point of the first and one of the second core that is farthest along a direction.
    fn support(&self, direction: Vector) -> CsoPoint {
        CsoPoint::from_shapes(&self.a_from_b, self.a, self.b, direction)
    }

    /// Looks for the difference nearest to the origin (Gilbert, Johnson, Keerthi). Where the simplex, close to the end,
    /// has no better one to offer, it starts again from the best difference known. None where the cores overlap: the
    /// simplex is then about the origin.
    fn approach(&self, first: Vector, limit_m: f64, simplex: &mut VoronoiSimplex) -> Option<Bounds> {
        let start = self.support(first);
        simplex.reset(start);
        let mut bounds = Bounds { lower_m: f64::NEG_INFINITY, upper_m: f64::INFINITY };
        let mut size_m = start.point.length();
        let mut is_fresh = true;
        for _ in 0..STEPS {
            let nearest = simplex.project_origin_and_reduce();
            let distance_m = nearest.length();
            if simplex.dimension() == 3 || distance_m <= ROUNDING * size_m {
                // Only where no plane separates the two.
                if bounds.lower_m <= ROUNDING * size_m {
                    return None;
                }
                break;
            }
            let is_stuck = distance_m >= bounds.upper_m;
            bounds.upper_m = bounds.upper_m.min(distance_m);
            let toward = nearest / -distance_m;
            let next = self.support(toward);
            size_m = size_m.max(next.point.length());
            bounds.lower_m = bounds.lower_m.max(-next.point.dot(toward));
            if bounds.lower_m > limit_m || bounds.gap_m() <= ENOUGH * bounds.upper_m.max(1.0) {
                break;
            }
            if is_stuck || !simplex.add_point(next) {
                if is_fresh {
                    break;
                }
                simplex.reset(CsoPoint::single_point(nearest));
                is_fresh = simplex.add_point(next);
            } else {
                is_fresh = false;
            }
        }
        Some(bounds)
    }

    /// Depth of an overlap (expanding polytope): parry's face gives the upper bound, the planes across it the lower
    /// one.
    fn depth(&self, simplex: &VoronoiSimplex) -> Bounds {
        let nothing = Bounds { lower_m: f64::NEG_INFINITY, upper_m: 0.0 };
        let found = EPA::new().closest_points(&self.a_from_b, self.a, self.b, simplex);
        let Some((on_a, on_b, normal)) = found else { return nothing };
        let Some(normal) = normal.try_normalize() else { return nothing };
        let lower_m = -self.support(normal).point.dot(normal);
        Bounds { lower_m, upper_m: (on_b - on_a).dot(normal).min(0.0) }
    }
}

/// Bounds of the signed distance of two pieces; the upper one need not be close where the lower one is above `limit_m`.
///
/// Whatever the search finds is only taken for a direction: the gap between two planes across it that touch the pieces
/// is never more than their distance, and at the best direction it is the distance, apart or overlapping. Layers
/// shorten it by their thickness, exactly.
pub(super) fn signed_distance(a: &Piece, world_from_a: &Pose, b: &Piece, world_from_b: &Pose, limit_m: f64) -> Bounds {
    let pair = Pair { a: &a.core, b: &b.core, a_from_b: world_from_a.inv_mul(world_from_b) };
    let layers_m = a.layer_m + b.layer_m;
    let centers = pair.a_from_b.translation.try_normalize().unwrap_or(Vector::X);
    let mut bounds = Bounds { lower_m: f64::NEG_INFINITY, upper_m: f64::INFINITY };
    let (mut simplex, mut is_overlap) = (VoronoiSimplex::new(), false);
    // The polytope now and then closes too early: another simplex then leads elsewhere.
    for first in [centers, Vector::X, Vector::Y, Vector::Z, -Vector::X, -Vector::Y, -Vector::Z] {
        let apart = pair.approach(first, limit_m + layers_m, &mut simplex);
        is_overlap |= apart.is_none();
        let found = apart.unwrap_or_else(|| pair.depth(&simplex));
        bounds.lower_m = bounds.lower_m.max(found.lower_m);
        bounds.upper_m = bounds.upper_m.min(found.upper_m).max(bounds.lower_m);
        if bounds.lower_m > limit_m + layers_m || bounds.gap_m() <= PARRY_TOLERANCE * bounds.upper_m.abs().max(1.0) {
            return Bounds { lower_m: bounds.lower_m - layers_m, upper_m: bounds.upper_m - layers_m };
        }
    }
    // Of the depth of such an overlap nothing but the bounds is known, and of the upper one only this.
    let upper_m = if is_overlap { bounds.lower_m.max(0.0) } else { bounds.upper_m };
    Bounds { lower_m: bounds.lower_m - layers_m, upper_m: upper_m - layers_m }
}

/// Signed distance of a piece from a half-space, m.
pub(super) fn distance_to_half_space(piece: &Piece, world_from_piece: &Pose, normal: Vector, offset_m: f64) -> f64 {
    piece.core.support_point(world_from_piece, -normal).dot(normal) - offset_m - piece.layer_m
}
