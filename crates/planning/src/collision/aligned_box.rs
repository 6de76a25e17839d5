//! Ellipsoids and spheres against boxes along the axes, whose sides may be infinite.
//!
//! The nearest point of the box lies within one of its faces, edges or corners. Seen along the directions in which that
//! feature extends, the ellipsoid is an ellipsoid of one to three dimensions and the feature a point: an exact problem.
//! The right feature is found by adding sides that are passed and dropping those that pull; the plane proves the answer.

use super::distance::{Distance, length};
use super::sphere::{normal_across, outward_normal};
use super::{Ellipsoid, Sphere};
use nalgebra::{Matrix3, Vector3};
use tumble_dynamics::AlignedBox;

/// Where a coordinate of the nearest point of the box is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Side {
    Lower,
    Between,
    Upper,
}

/// An ellipsoid at the origin and a box.
struct Problem<'a> {
    body: &'a Ellipsoid,
    shape: Matrix3<f64>,
    lower: Vector3<f64>,
    upper: Vector3<f64>,
}

/// A plane and how wide the slab to the box is.
#[derive(Clone, Copy)]
struct Slab {
    normal: Vector3<f64>,
    height: f64,
    width_m: f64,
}

/// Signed distance of an ellipsoid and a solid box: exact, with certificate, while they are apart; minus the best
/// separating translation over all faces, edges and corners where they overlap.
///
/// # Shape
/// Sides of the box may be infinite; lower not above upper. In a box without any side the distance is minus infinity.
pub fn ellipsoid_to_box(a: &Ellipsoid, b: &AlignedBox) -> Distance {
    let problem = Problem {
        body: a,
        shape: a.factor() * a.factor().transpose(),
        lower: b.lower_world - a.center(),
        upper: b.upper_world - a.center(),
    };
    let slab = problem.feature().unwrap_or_else(|| problem.best_of_all());
    problem.answer(&slab)
}

/// Signed distance of a sphere and a solid box, inside as well: exact everywhere.
pub fn sphere_to_box(a: &Sphere, b: &AlignedBox) -> Distance {
    // What is no number stays none.
    let nearest = Vector3::from_fn(|axis, _| match a.center[axis] {
        position if position < b.lower_world[axis] => b.lower_world[axis],
        position if position > b.upper_world[axis] => b.upper_world[axis],
        position => position,
    });
    let offset = nearest - a.center;
    let apart = length(&offset);
    let (normal, to_center, point_on_b) = if apart > 0.0 {
        (offset / apart, apart, nearest)
    } else {
        let (mut normal, mut width, mut point_on_b) =
            (Vector3::x(), if apart.is_nan() { apart } else { f64::NEG_INFINITY }, a.center);
        for axis in 0..3 {
            for (sign, side) in [(1.0, b.lower_world[axis]), (-1.0, b.upper_world[axis])] {
                let gap = sign * (side - a.center[axis]);
                if gap > width {
                    width = gap;
                    (normal, point_on_b) = (Vector3::zeros(), a.center);
                    normal[axis] = sign;
                    point_on_b[axis] = side;
                }
            }
        }
        (normal, width, point_on_b)
    };
    let distance_m = to_center - a.radius_m;
    Distance {
        distance_m,
        lower_bound_m: distance_m - 8.0 * f64::EPSILON * (to_center.abs() + a.radius_m),
        normal,
        point_on_a: a.center + normal * a.radius_m,
        point_on_b,
    }
}

impl Problem<'_> {
    fn slab(&self, normal: Vector3<f64>) -> Slab {
        let height = length(&self.body.factor().tr_mul(&normal));
        let mut width_m = -height;
        for axis in 0..3 {
            if normal[axis] > 0.0 {
                width_m += normal[axis] * self.lower[axis];
            } else if normal[axis] < 0.0 {
                width_m += normal[axis] * self.upper[axis];
            }
        }
        Slab { normal, height, width_m }
    }

    fn at(&self, axis: usize, side: Side) -> f64 {
        match side {
            Side::Lower => self.lower[axis],
            Side::Upper => self.upper[axis],
            Side::Between => 0.0,
        }
    }

    /// The normal at the point of the ellipsoid nearest to a feature that is extended without end; `across`: nearest among
    /// those on the other side of the ellipsoid, where there is one.
    #[inline]
    fn normal(&self, sides: [Side; 3], across: bool) -> Option<Vector3<f64>> {
        let at = Vector3::from_fn(|axis, _| self.at(axis, sides[axis]));
        let sign = |axis: usize| if sides[axis] == Side::Lower { 1.0 } else { -1.0 };
        match sides.map(|side| side != Side::Between) {
            [true, true, true] => {
                let semi_axes = (*self.body.semi_axes()).into();
                let local = self.body.factor().tr_mul(&at).component_div(self.body.semi_axes()).into();
                let outward =
                    if across { normal_across(&semi_axes, &local)? } else { outward_normal(&semi_axes, &local) };
                Some(self.body.factor() * Vector3::from(outward).component_div(self.body.semi_axes()))
            }
            [true, true, false] => self.normal_to_edge(&at, 0, 1, across),
            [true, false, true] => self.normal_to_edge(&at, 0, 2, across),
            [false, true, true] => self.normal_to_edge(&at, 1, 2, across),
            _ if across => None,
            [true, false, false] => Some(Vector3::x() * sign(0)),
            [false, true, false] => Some(Vector3::y() * sign(1)),
            [false, false, true] => Some(Vector3::z() * sign(2)),
            [false, false, false] => None,
        }
    }

    /// The ellipsoid seen along an edge is an ellipse in the plane of axes i and j, the edge a point.
    #[inline]
    fn normal_to_edge(&self, at: &Vector3<f64>, i: usize, j: usize, across: bool) -> Option<Vector3<f64>> {
        let (ii, ij, jj) = (self.shape[(i, i)], self.shape[(i, j)], self.shape[(j, j)]);
        let (mean, half) = (0.5 * (ii + jj), 0.5 * (ii - jj));
        let radius = f64::sqrt(half * half + ij * ij);
        let major = mean + radius;
        let minor = ((ii * jj - ij * ij) / major).max(f64::MIN_POSITIVE);
        let (x, y) = if half >= 0.0 { (half + radius, ij) } else { (ij, radius - half) };
        let norm = f64::sqrt(x * x + y * y);
        let (x, y) = if norm > 0.0 { (x / norm, y / norm) } else { (1.0, 0.0) };
        let semi_axes = [f64::sqrt(major), f64::sqrt(minor)];
        let local = [x * at[i] + y * at[j], x * at[j] - y * at[i]];
        let [u, v] = if across { normal_across(&semi_axes, &local)? } else { outward_normal(&semi_axes, &local) };
        let mut normal = Vector3::zeros();
        normal[i] = x * u - y * v;
        normal[j] = y * u + x * v;
        Some(normal)
    }

    /// The feature that satisfies all conditions of a nearest one; none where the bodies overlap or the search turns round.
    fn feature(&self) -> Option<Slab> {
        let mut sides = [Side::Between; 3];
        for (axis, side) in sides.iter_mut().enumerate() {
            if self.lower[axis] > 0.0 {
                *side = Side::Lower;
            } else if self.upper[axis] < 0.0 {
                *side = Side::Upper;
            }
        }
        for _ in 0..8 {
            let slab = self.slab(self.normal(sides, false)?);
            if slab.width_m <= 0.0 {
                return None;
            }
            let point = self.shape * slab.normal / slab.height;
            let mut changed = false;
            for (axis, side) in sides.iter_mut().enumerate() {
                let better = match *side {
                    Side::Between if point[axis] < self.lower[axis] => Side::Lower,
                    Side::Between if point[axis] > self.upper[axis] => Side::Upper,
                    Side::Lower if slab.normal[axis] < 0.0 => Side::Between,
                    Side::Upper if slab.normal[axis] > 0.0 => Side::Between,
                    same => same,
                };
                changed |= better != *side;
                *side = better;
            }
            if !changed {
                return Some(slab);
            }
        }
        None
    }

    /// The widest slab of all features: every slab is a lower bound, and the nearest feature is among them.
    ///
    /// Where the bodies overlap, the locally widest slabs belong to features too: each has at most two.
    fn best_of_all(&self) -> Slab {
        const SIDES: [Side; 3] = [Side::Lower, Side::Between, Side::Upper];
        let mut best = Slab { normal: Vector3::x(), height: f64::sqrt(self.shape[(0, 0)]), width_m: f64::NEG_INFINITY };
        for free in [2, 1, 0] {
            for sides in SIDES.iter().flat_map(|x| SIDES.iter().flat_map(|y| SIDES.iter().map(|z| [*x, *y, *z]))) {
                let between = sides.iter().filter(|side| **side == Side::Between).count();
                let at = Vector3::from_fn(|axis, _| self.at(axis, sides[axis]));
                if between != free || at.amax() == f64::INFINITY {
                    continue;
                }
                let Some(nearest) = self.normal(sides, false) else { continue };
                let slab = self.slab(nearest);
                if slab.width_m > best.width_m {
                    best = slab;
                }
                // No slab is wider than the one to the feature alone.
                if nearest.dot(&at) - slab.height > best.width_m
                    && let Some(normal) = self.normal(sides, true)
                {
                    let slab = self.slab(normal);
                    if slab.width_m > best.width_m {
                        best = slab;
                    }
                }
            }
        }
        best
    }

    fn answer(&self, slab: &Slab) -> Distance {
        let on_body = self.shape * slab.normal / slab.height;
        let on_box = Vector3::from_fn(|axis, _| {
            if slab.width_m > 0.0 || slab.normal[axis] == 0.0 {
                on_body[axis].max(self.lower[axis]).min(self.upper[axis])
            } else if slab.normal[axis] > 0.0 {
                self.lower[axis]
            } else {
                self.upper[axis]
            }
        });
        let terms = slab.normal.component_mul(&on_box).abs().sum() + self.body.semi_axes().max();
        Distance {
            distance_m: if slab.width_m > 0.0 { length(&(on_box - on_body)) } else { slab.width_m },
            lower_bound_m: slab.width_m - 16.0 * f64::EPSILON * terms,
            normal: slab.normal,
            point_on_a: self.body.center() + on_body,
            point_on_b: self.body.center() + on_box,
        }
    }
}
