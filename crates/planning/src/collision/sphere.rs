//! Spheres, and points against ellipsoids.

use super::Ellipsoid;
use super::distance::{Distance, length, unit};
use nalgebra::Vector3;

/// A solid sphere.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Sphere {
    /// World axes, m.
    pub center: Vector3<f64>,
    /// Not negative; zero is a point. m.
    pub radius_m: f64,
}

/// Signed distance of two spheres.
pub fn sphere_to_sphere(a: &Sphere, b: &Sphere) -> Distance {
    let offset = b.center - a.center;
    let normal = unit(&offset).unwrap_or_else(Vector3::x);
    let apart = length(&offset);
    let distance_m = apart - a.radius_m - b.radius_m;
    Distance {
        distance_m,
        lower_bound_m: distance_m - 8.0 * f64::EPSILON * (apart + a.radius_m + b.radius_m),
        normal,
        point_on_a: a.center + normal * a.radius_m,
        point_on_b: b.center - normal * b.radius_m,
    }
}

/// Signed distance of a solid ellipsoid and a point, inside as well: exact everywhere, centre and planes of symmetry
/// included.
pub fn ellipsoid_to_point(a: &Ellipsoid, point: &Vector3<f64>) -> Distance {
    ellipsoid_to_sphere(a, &Sphere { center: *point, radius_m: 0.0 })
}

/// Signed distance of an ellipsoid and a sphere, inside as well: exact everywhere.
///
/// # Source
/// The nearest point solves the secular equation of the trust-region problem; Newton's method on the inverse square root
/// of its left side climbs to the root from below, because that function is concave.
pub fn ellipsoid_to_sphere(a: &Ellipsoid, b: &Sphere) -> Distance {
    let (factor, semi_axes, offset) = (a.factor(), a.semi_axes(), b.center - a.center());
    let local = factor.tr_mul(&offset).component_div(semi_axes);
    let normal = Vector3::from(outward_normal(&(*semi_axes).into(), &local.into()));
    let pulled_back = normal.component_mul(semi_axes);
    let height = length(&pulled_back);
    let on_surface = pulled_back.component_mul(semi_axes) / height;
    let width = normal.dot(&local) - height;
    let to_center = if width > 0.0 { length(&(local - on_surface)) } else { width };
    let world = |v: &Vector3<f64>| factor * v.component_div(semi_axes);
    let normal = world(&normal);
    Distance {
        distance_m: to_center - b.radius_m,
        lower_bound_m: width - b.radius_m - 16.0 * f64::EPSILON * (length(&local) + height + b.radius_m),
        normal,
        point_on_a: a.center() + world(&on_surface),
        point_on_b: b.center - normal * b.radius_m,
    }
}

/// Unit normal, in the axes of an ellipsoid (ellipse) of these semi-axes, at the point of its surface nearest to `point`.
pub(super) fn outward_normal<const N: usize>(semi_axes: &[f64; N], point: &[f64; N]) -> [f64; N] {
    let mut shortest = 0;
    for axis in 1..N {
        if semi_axes[axis] < semi_axes[shortest] {
            shortest = axis;
        }
    }
    // The unknown is the multiplier plus the smallest squared semi-axis: exact where the point nears the medial plane.
    let least = semi_axes[shortest];
    let excess: [f64; N] = core::array::from_fn(|axis| (semi_axes[axis] - least) * (semi_axes[axis] + least));
    let weights: [f64; N] = core::array::from_fn(|axis| semi_axes[axis] * point[axis].abs());
    let mut root = 0.0_f64;
    let (mut squares, mut widest) = (0.0, 0.0_f64);
    for axis in 0..N {
        root = root.max(weights[axis] - excess[axis]);
        squares += weights[axis] * weights[axis];
        widest = widest.max(excess[axis]);
    }
    root = root.max(f64::sqrt(squares) - widest);
    let mut inside = 0.0;
    for _ in 0..100 {
        let (mut sum, mut slope) = (0.0, 0.0);
        for axis in 0..N {
            if weights[axis] > 0.0 {
                let term = weights[axis] / (root + excess[axis]);
                sum += term * term;
                slope += term * term / (root + excess[axis]);
            }
        }
        inside = sum;
        let ratio = f64::sqrt(sum);
        if ratio <= 1.0 {
            break;
        }
        let next = root + sum * (ratio - 1.0) / slope;
        if !(next > root) {
            break;
        }
        root = next;
    }
    let mut normal: [f64; N] =
        core::array::from_fn(|axis| if weights[axis] > 0.0 { point[axis] / (root + excess[axis]) } else { 0.0 });
    if root == 0.0 && weights[shortest] == 0.0 {
        // On the medial plane: either side is as near; the positive one is taken.
        normal[shortest] = f64::sqrt((1.0 - inside).max(0.0)) / least;
    }
    let mut norm = 0.0;
    for component in normal {
        norm += component * component;
    }
    let norm = f64::sqrt(norm);
    normal.map(|component| component / norm)
}
