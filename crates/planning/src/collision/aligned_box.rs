//! Ellipsoids and spheres against boxes along the axes, whose sides may be infinite.
//!
//! The nearest point of the box lies within one of its faces, edges or corners. Seen along the directions in which that
//! feature extends, the ellipsoid is an ellipsoid of one to three dimensions and the feature a point: an exact problem.
//! The right feature is found by adding sides that are passed and dropping those that pull; the plane proves the answer.

use super::distance::{Distance, length};
use super::sphere::outward_normal;
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
/// Sides of the box may be infinite; lower not above upper.
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
    let nearest = Vector3::from_fn(|axis, _| a.center[axis].max(b.lower_world[axis]).min(b.upper_world[axis]));
    let offset = nearest - a.center;
    let apart = length(&offset);
    let (normal, to_center, point_on_b) = if apart > 0.0 {
        (offset / apart, apart, nearest)
    } else {
        let (mut normal, mut width) = (Vector3::x(), f64::NEG_INFINITY);
        for axis in 0..3 {
            for (sign, side) in [(1.0, b.lower_world[axis]), (-1.0, b.upper_world[axis])] {
                let gap = sign * (side - a.center[axis]);
                if gap > width {
                    width = gap;
                    normal = Vector3::zeros();
                    normal[axis] = sign;
                }
            }
        }
        (normal, width, a.center + normal * width)
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

    /// The normal at the point of the ellipsoid nearest to a feature that is extended without end.
    fn normal(&self, sides: &[Side; 3]) -> Option<Vector3<f64>> {
        let mut fixed = [0; 3];
        let mut count = 0;
        for axis in 0..3 {
            if sides[axis] != Side::Between {
                fixed[count] = axis;
                count += 1;
            }
        }
        let mut normal = Vector3::zeros();
        match count {
            0 => return None,
            1 => normal[fixed[0]] = if sides[fixed[0]] == Side::Lower { 1.0 } else { -1.0 },
            2 => {
                let [i, j, _] = fixed;
                let (ii, ij, jj) = (self.shape[(i, i)], self.shape[(i, j)], self.shape[(j, j)]);
                let (mean, half) = (0.5 * (ii + jj), 0.5 * (ii - jj));
                let radius = f64::sqrt(half * half + ij * ij);
                let major = mean + radius;
                let minor = ((ii * jj - ij * ij) / major).max(f64::MIN_POSITIVE);
                let (x, y) = if half >= 0.0 { (half + radius, ij) } else { (ij, radius - half) };
                let norm = f64::sqrt(x * x + y * y);
                let (x, y) = if norm > 0.0 { (x / norm, y / norm) } else { (1.0, 0.0) };
                let (p, q) = (self.at(i, sides[i]), self.at(j, sides[j]));
                let [u, v] = outward_normal(&[f64::sqrt(major), f64::sqrt(minor)], &[x * p + y * q, x * q - y * p]);
                normal[i] = x * u - y * v;
                normal[j] = y * u + x * v;
            }
            _ => {
                let corner = Vector3::from_fn(|axis, _| self.at(axis, sides[axis]));
                let semi_axes = self.body.semi_axes();
                let local = self.body.factor().tr_mul(&corner).component_div(semi_axes);
                let outward = Vector3::from(outward_normal(&(*semi_axes).into(), &local.into()));
                normal = self.body.factor() * outward.component_div(semi_axes);
            }
        }
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
            let slab = self.slab(self.normal(&sides)?);
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
    fn best_of_all(&self) -> Slab {
        const SIDES: [Side; 3] = [Side::Lower, Side::Between, Side::Upper];
        let mut best = Slab { normal: Vector3::x(), height: self.shape[(0, 0)], width_m: f64::NEG_INFINITY };
        for x in SIDES {
            for y in SIDES {
                for z in SIDES {
                    let sides = [x, y, z];
                    if (0..3).any(|axis| self.at(axis, sides[axis]).is_infinite()) {
                        continue;
                    }
                    let Some(normal) = self.normal(&sides) else { continue };
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
        let terms = slab.normal.component_mul(&on_box).abs().sum() + slab.height;
        Distance {
            distance_m: if slab.width_m > 0.0 { length(&(on_box - on_body)) } else { slab.width_m },
            lower_bound_m: slab.width_m - 16.0 * f64::EPSILON * terms,
            normal: slab.normal,
            point_on_a: self.body.center() + on_body,
            point_on_b: self.body.center() + on_box,
        }
    }
}
