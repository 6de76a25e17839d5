//! What clearance and continuous test need to know of an obstacle.

use super::distance::{Distance, distance, separating_normal};
use super::sphere::outward_normal;
use super::{Ellipsoid, Sphere, ellipsoid_to_box, ellipsoid_to_sphere, sphere_to_box};
use nalgebra::{Matrix3, Vector3};
use tumble_dynamics::AlignedBox;

/// A convex obstacle about a reference point: an ellipsoid about its centre, a box about the origin of the world.
#[derive(Clone, Debug)]
pub(super) enum Solid {
    Ellipsoid(AxedEllipsoid),
    /// Its sides may be infinitely far.
    Box(AlignedBox),
}

/// An ellipsoid with its axes at hand.
#[derive(Clone, Debug)]
pub(super) struct AxedEllipsoid {
    /// About the origin.
    solid: Ellipsoid,
    /// Columns are unit axes, world coordinates.
    axes: Matrix3<f64>,
    semi_axes: Vector3<f64>,
}

/// `v` at length one; some unit vector where it has no direction.
pub(super) fn unit(v: &Vector3<f64>) -> Vector3<f64> {
    let length = f64::sqrt(v.norm_squared());
    if length > 0.0 { v / length } else { Vector3::x() }
}

impl AxedEllipsoid {
    fn new(solid: &Ellipsoid) -> Self {
        let mut axes = *solid.factor();
        for (mut column, semi_axis) in axes.column_iter_mut().zip(solid.semi_axes()) {
            column /= *semi_axis;
        }
        Self { solid: solid.moved_to(Vector3::zeros()), axes, semi_axes: *solid.semi_axes() }
    }

    /// The unit normal at the point of the surface that is nearest to a point.
    #[inline]
    fn normal_to_point(&self, point: &Vector3<f64>) -> Vector3<f64> {
        self.axes * Vector3::from(outward_normal(&self.semi_axes.into(), &self.axes.tr_mul(point).into()))
    }
}

impl Solid {
    /// The ellipsoid, about its centre.
    pub fn ellipsoid(solid: &Ellipsoid) -> Self {
        Self::Ellipsoid(AxedEllipsoid::new(solid))
    }

    /// Takes an offset from an ellipsoid's centre to the space where it is a unit ball; and the semi-axes.
    pub fn to_ball(&self) -> Option<(Matrix3<f64>, Vector3<f64>)> {
        match self {
            Self::Ellipsoid(ellipsoid) => {
                let mut to_ball = ellipsoid.axes.transpose();
                for (mut row, semi_axis) in to_ball.row_iter_mut().zip(&ellipsoid.semi_axes) {
                    row /= *semi_axis;
                }
                Some((to_ball, ellipsoid.semi_axes))
            }
            Self::Box(_) => None,
        }
    }

    /// Support function about the reference point.
    #[inline]
    pub fn support(&self, normal: &Vector3<f64>) -> f64 {
        match self {
            Self::Ellipsoid(ellipsoid) => ellipsoid.solid.support(normal),
            Self::Box(aligned) => (0..3).map(|axis| box_side(aligned, normal, axis)).sum(),
        }
    }

    /// Largest finite coordinate about the reference point, m.
    pub fn reach_m(&self) -> f64 {
        match self {
            Self::Ellipsoid(ellipsoid) => ellipsoid.semi_axes.max(),
            Self::Box(aligned) => {
                let coordinates = aligned.lower_world.iter().chain(&aligned.upper_world);
                coordinates.filter(|x| x.is_finite()).fold(0.0, |reach, x| f64::max(reach, x.abs()))
            }
        }
    }

    /// Half the gradient of the squared distance as the obstacle, grown by `growth_m`, measures it from its reference point;
    /// the offset itself for a box.
    #[inline]
    pub fn measured(&self, offset: &Vector3<f64>, growth_m: f64) -> Vector3<f64> {
        match self {
            Self::Ellipsoid(AxedEllipsoid { axes, semi_axes, .. }) => {
                let seen = axes.tr_mul(offset);
                axes * seen.zip_map(semi_axes, |seen, a| seen / ((a + growth_m) * (a + growth_m)))
            }
            Self::Box(_) => *offset,
        }
    }

    /// From the nearest point of a box, or from the centre of an ellipsoid.
    #[inline]
    pub fn offset(&self, point: &Vector3<f64>) -> Vector3<f64> {
        match self {
            Self::Ellipsoid(_) => *point,
            Self::Box(aligned) => point - point.sup(&aligned.lower_world).inf(&aligned.upper_world),
        }
    }

    /// Normal of the best plane between the obstacle and a point outside of it.
    #[inline]
    pub fn normal_to_point(&self, point: &Vector3<f64>) -> Vector3<f64> {
        match self {
            Self::Ellipsoid(ellipsoid) => ellipsoid.normal_to_point(point),
            Self::Box(aligned) => -sphere_to_box(&Sphere { center: *point, radius_m: 0.0 }, aligned).normal,
        }
    }

    /// Normal of a nearly best plane between the obstacle and an ellipsoid that are farther apart than a margin, from the obstacle
    /// to the ellipsoid; the best one where they are not. None where the two share a point that is found at once.
    pub fn normal_to(&self, other: &Ellipsoid, hint: Option<&Vector3<f64>>, margin_m: f64) -> Option<Vector3<f64>> {
        match self {
            _ if self.clearly_meets(other) => None,
            Self::Ellipsoid(obstacle) => separating_normal(&obstacle.solid, other, hint, margin_m),
            Self::Box(_) => Some(self.distance(other).normal),
        }
    }

    /// True where an ellipsoid certainly shares a point with the obstacle: one between the centres, the point of the box
    /// nearest to the centre, or the point that reaches farthest towards that. Cheap; deep overlaps need no distance.
    fn clearly_meets(&self, other: &Ellipsoid) -> bool {
        match self {
            Self::Ellipsoid(AxedEllipsoid { solid, .. }) => {
                // Each covers a share of the way between the centres.
                1.0 / solid.gauge(other.center()) + 1.0 / other.gauge(other.center()) > 1.0
            }
            Self::Box(aligned) => {
                let offset = self.offset(other.center());
                let is_in_box = |point: Vector3<f64>| point >= aligned.lower_world && point <= aligned.upper_world;
                other.gauge(&offset) < 1.0 || is_in_box(other.support_point(&-offset))
            }
        }
    }

    /// Distance to an ellipsoid, from the obstacle to it; both as the reference point sees them.
    pub fn distance(&self, ellipsoid: &Ellipsoid) -> Distance {
        match self {
            Self::Ellipsoid(obstacle) => distance(&obstacle.solid, ellipsoid),
            Self::Box(aligned) => ellipsoid_to_box(ellipsoid, aligned).swapped(),
        }
    }

    /// Signed distance to a sphere, as the reference point sees it.
    pub fn distance_to_sphere(&self, sphere: &Sphere) -> f64 {
        match self {
            Self::Ellipsoid(obstacle) => ellipsoid_to_sphere(&obstacle.solid, sphere).distance_m,
            Self::Box(aligned) => sphere_to_box(sphere, aligned).distance_m,
        }
    }
}

/// What one axis adds to the support function of a box; an infinite side counts only across its normal.
#[inline]
fn box_side(aligned: &AlignedBox, normal: &Vector3<f64>, axis: usize) -> f64 {
    let along = normal[axis];
    if along > 0.0 {
        along * aligned.upper_world[axis]
    } else if along < 0.0 {
        along * aligned.lower_world[axis]
    } else {
        0.0
    }
}
