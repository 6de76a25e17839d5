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
    let inverse = semi_axes.map(|semi_axis| 1.0 / semi_axis);
    let local = factor.tr_mul(&offset).component_mul(&inverse);
    let normal = Vector3::from(outward_normal(&(*semi_axes).into(), &local.into()));
    let pulled_back = normal.component_mul(semi_axes);
    let height = length(&pulled_back);
    let on_surface = pulled_back.component_mul(semi_axes) * (1.0 / height);
    let width = normal.dot(&local) - height;
    let to_center = if width > 0.0 { length(&(local - on_surface)) } else { width };
    let world = |v: &Vector3<f64>| factor * v.component_mul(&inverse);
    let normal = world(&normal);
    Distance {
        distance_m: to_center - b.radius_m,
        lower_bound_m: width - b.radius_m - 16.0 * f64::EPSILON * (length(&local) + semi_axes.max() + b.radius_m),
        normal,
        point_on_a: a.center() + world(&on_surface),
        point_on_b: b.center - normal * b.radius_m,
    }
}

/// Unit normal, in the axes of an ellipsoid (ellipse) of these semi-axes, at the point of its surface nearest to `point`.
pub(super) fn outward_normal<const N: usize>(semi_axes: &[f64; N], point: &[f64; N]) -> [f64; N] {
    let secular = Secular::new(semi_axes, point);
    let mut root = secular.at_least;
    let mut sum = 0.0;
    for _ in 0..STEPS {
        let slope;
        (sum, slope) = secular.sum(root);
        let ratio = f64::sqrt(sum);
        let next = root + sum * (ratio - 1.0) / slope;
        // Also where rounding ends the climb, or where all weights vanish.
        if ratio <= 1.0 || next <= root || next.is_nan() {
            break;
        }
        root = next;
        // The error left is the square of this.
        if ratio < 1.0 + 1e-9 {
            break;
        }
    }
    secular.normal(root, sum, 1.0)
}

/// The normal at the second local minimum of the distance to the surface, across the medial plane; a point inside may have one.
pub(super) fn normal_across<const N: usize>(semi_axes: &[f64; N], point: &[f64; N]) -> Option<[f64; N]> {
    let secular = Secular::new(semi_axes, point);
    let mut root = -secular.weights[secular.shortest];
    let mut sum = 0.0;
    for _ in 0..STEPS {
        let slope;
        (sum, slope) = secular.sum(root);
        let next = root + 0.5 * (sum - 1.0) / slope;
        if root == 0.0 || sum <= 1.0 || next >= root {
            break;
        }
        // The sum is convex between its poles: past its least value there is no such point.
        if slope >= 0.0 || next <= -secular.next_excess() {
            return None;
        }
        root = next;
    }
    (root < 0.0 || sum <= 1.0).then(|| secular.normal(root, sum, -1.0))
}

const STEPS: usize = 100;

/// The equation `sum (weights / (root + excess))^2 = 1`.
///
/// The unknown is the multiplier plus the smallest squared semi-axis: exact where the point nears the medial plane.
struct Secular<'a, const N: usize> {
    semi_axes: &'a [f64; N],
    point: &'a [f64; N],
    shortest: usize,
    excess: [f64; N],
    weights: [f64; N],
    at_least: f64,
}

impl<'a, const N: usize> Secular<'a, N> {
    #[inline]
    fn new(semi_axes: &'a [f64; N], point: &'a [f64; N]) -> Self {
        let mut shortest = 0;
        for axis in 1..N {
            if semi_axes[axis] < semi_axes[shortest] {
                shortest = axis;
            }
        }
        let least = semi_axes[shortest];
        let excess: [f64; N] = core::array::from_fn(|axis| (semi_axes[axis] - least) * (semi_axes[axis] + least));
        let weights: [f64; N] = core::array::from_fn(|axis| semi_axes[axis] * point[axis].abs());
        let (mut at_least, mut squares, mut largest) = (0.0_f64, 0.0, 0.0_f64);
        for axis in 0..N {
            at_least = at_least.max(weights[axis] - excess[axis]);
            squares += weights[axis] * weights[axis];
            largest = largest.max(excess[axis]);
        }
        at_least = at_least.max(f64::sqrt(squares) - largest);
        Self { semi_axes, point, shortest, excess, weights, at_least }
    }

    /// The left side, and minus half its derivative.
    #[inline]
    fn sum(&self, root: f64) -> (f64, f64) {
        let (mut sum, mut slope) = (0.0, 0.0);
        for axis in 0..N {
            if self.weights[axis] > 0.0 {
                let inverse = 1.0 / (root + self.excess[axis]);
                let term = self.weights[axis] * inverse;
                sum += term * term;
                slope += term * term * inverse;
            }
        }
        (sum, slope)
    }

    /// The second smallest excess.
    fn next_excess(&self) -> f64 {
        let mut next = f64::INFINITY;
        for axis in 0..N {
            if axis != self.shortest {
                next = next.min(self.excess[axis]);
            }
        }
        next
    }

    #[inline]
    fn normal(&self, root: f64, sum: f64, side: f64) -> [f64; N] {
        let mut normal: [f64; N] = core::array::from_fn(|axis| {
            if self.weights[axis] > 0.0 { self.point[axis] / (root + self.excess[axis]) } else { 0.0 }
        });
        if root == 0.0 && self.weights[self.shortest] == 0.0 {
            // On the medial plane both sides are as near.
            normal[self.shortest] = side * f64::sqrt((1.0 - sum).max(0.0)) / self.semi_axes[self.shortest];
        }
        let mut squares = 0.0;
        for component in normal {
            squares += component * component;
        }
        let inverse = 1.0 / f64::sqrt(squares);
        normal.map(|component| component * inverse)
    }
}
