//! The widest gap between two convex solids that are known by their farthest points.

use nalgebra::Vector3;

/// Rounds of the search.
const ROUNDS: usize = 48;
/// Share of the gap that a normal may leave.
const CONTENT: f64 = 1e-3;
/// Gap, as a share of what it is the difference of, below which two solids count as touching.
const TOUCHING: f64 = 1e-12;

/// Unit normal, from the first solid to the second, across which they are apart by nearly as much as they can be; `None` where
/// no gap is found. `farthest` of each gives its point that lies farthest along a direction.
///
/// # Source
/// Gilbert, Johnson and Keerthi, "A fast procedure for computing the distance between complex objects in three-dimensional
/// space", IEEE Journal of Robotics and Automation 4 (1988).
pub(super) fn separating_normal(
    farthest_of_a: impl Fn(&Vector3<f64>) -> Vector3<f64>,
    farthest_of_b: impl Fn(&Vector3<f64>) -> Vector3<f64>,
    hint: &Vector3<f64>,
) -> Option<Vector3<f64>> {
    let between = |normal: &Vector3<f64>| farthest_of_b(&-normal) - farthest_of_a(normal);
    let mut simplex = Simplex { points: [Vector3::zeros(); 4], count: 0 };
    let mut nearest = simplex.with(between(hint))?;
    let mut scale = nearest.norm_squared();
    for _ in 0..ROUNDS {
        let squared = nearest.norm_squared();
        if squared <= TOUCHING * TOUCHING * scale {
            return None;
        }
        let normal = nearest / f64::sqrt(squared);
        let next = between(&normal);
        scale = f64::max(scale, next.norm_squared());
        // the plane through the next point bounds the distance from below
        if squared - nearest.dot(&next) <= CONTENT * squared {
            return Some(normal);
        }
        let before = squared;
        nearest = simplex.with(next)?;
        if nearest.norm_squared() >= before {
            // as near as rounding allows
            return Some(normal);
        }
    }
    let normal = nearest / f64::sqrt(nearest.norm_squared());
    Some(normal)
}

/// Up to four points, those of the face that is nearest to the origin.
struct Simplex {
    points: [Vector3<f64>; 4],
    count: usize,
}

impl Simplex {
    /// Takes in a point and drops those that do not matter; the point of the hull nearest to the origin, `None` where the origin
    /// is inside.
    fn with(&mut self, point: Vector3<f64>) -> Option<Vector3<f64>> {
        let mut old = [Vector3::zeros(); 3];
        let olds = self.count.min(3);
        old[..olds].copy_from_slice(&self.points[..olds]);
        let mut best: Option<(f64, Vector3<f64>, usize)> = None;
        // the face holds the new point: it is the only one beyond the plane through the last
        for chosen in 0..1usize << olds {
            let mut face = [point; 4];
            let mut size = 1;
            for (index, other) in old.iter().enumerate().take(olds) {
                if chosen >> index & 1 == 1 {
                    face[size] = *other;
                    size += 1;
                }
            }
            if let Some(nearest) = nearest_of_face(&face[..size]) {
                let squared = nearest.norm_squared();
                if best.is_none_or(|(least, _, _)| squared < least) {
                    best = Some((squared, nearest, chosen));
                }
            }
        }
        let (_, nearest, chosen) = best?;
        self.points[0] = point;
        self.count = 1;
        for (index, other) in old.iter().enumerate().take(olds) {
            if chosen >> index & 1 == 1 {
                self.points[self.count] = *other;
                self.count += 1;
            }
        }
        (self.count < 4).then_some(nearest)
    }
}

/// The point nearest to the origin of the plane through all these points, where it is a mean of them.
fn nearest_of_face(face: &[Vector3<f64>]) -> Option<Vector3<f64>> {
    let mean = |inside: bool, point: Vector3<f64>| inside.then_some(point);
    match *face {
        [a] => Some(a),
        [a, b] => {
            let along = b - a;
            let squared = along.norm_squared();
            let share = -a.dot(&along) / squared;
            mean(share > 0.0 && share < 1.0, a + along * share)
        }
        [a, b, c] => {
            let (u, v) = (b - a, c - a);
            let normal = u.cross(&v);
            let squared = normal.norm_squared();
            // where the line through the origin along the normal meets the plane
            let foot = normal * (a.dot(&normal) / squared);
            let to_foot = foot - a;
            let of_b = to_foot.cross(&v).dot(&normal) / squared;
            let of_c = u.cross(&to_foot).dot(&normal) / squared;
            mean(of_b > 0.0 && of_c > 0.0 && of_b + of_c < 1.0, foot)
        }
        [a, b, c, d] => {
            let (u, v, w) = (b - a, c - a, d - a);
            let volume = u.dot(&v.cross(&w));
            let to_origin = -a;
            let of_b = to_origin.dot(&v.cross(&w)) / volume;
            let of_c = u.dot(&to_origin.cross(&w)) / volume;
            let of_d = u.dot(&v.cross(&to_origin)) / volume;
            mean(of_b > 0.0 && of_c > 0.0 && of_d > 0.0 && of_b + of_c + of_d < 1.0, Vector3::zeros())
        }
        _ => None,
    }
}

#[cfg(test)]
#[cfg(feature = "testing")]
mod tests {
    use super::*;
    use crate::collision::{Ellipsoid, distance};
    use nalgebra::Vector3;
    use tumble_dynamics::strategies::{draws, poses};

    fn ellipsoid(values: &[f64], pose: &tumble_lie::Pose<f64>) -> Ellipsoid {
        let semi_axes = Vector3::new(values[0].abs(), values[1].abs(), values[2].abs()).add_scalar(0.05);
        Ellipsoid::try_new(pose, &semi_axes).unwrap()
    }

    /// The distance module has its own search (Newton's on the sphere): the gap across the normal is that distance.
    #[test]
    fn the_gap_is_the_distance_of_two_ellipsoids() {
        let mut apart = 0;
        let all = draws(&(poses(3.0), poses(3.0)), 8, 400);
        for (index, (first, second)) in all.iter().enumerate() {
            let value = |i: usize| f64::sin((index * 7 + i) as f64);
            let a = ellipsoid(&[value(0), value(1), value(2)], first);
            let b = ellipsoid(&[value(3), value(4), value(5)], second);
            let expected = distance(&a, &b);
            let found = separating_normal(|n| a.support_point(n), |n| b.support_point(n), &Vector3::new(0.6, 0.0, 0.8));
            if expected.distance_m > 1e-6 {
                apart += 1;
                let normal = found.unwrap();
                let gap = normal.dot(&(b.center() - a.center())) - a.support(&normal) - b.support(&normal);
                assert!(gap <= expected.distance_m + 1e-9, "{index}: {gap} {}", expected.distance_m);
                assert!(gap >= expected.distance_m * (1.0 - 2e-3), "{index}: {gap} {}", expected.distance_m);
            } else if expected.distance_m < -1e-6 {
                // a plane that is none would have a negative gap
                if let Some(normal) = found {
                    let gap = normal.dot(&(b.center() - a.center())) - a.support(&normal) - b.support(&normal);
                    assert!(gap <= 0.0, "{index}");
                }
            }
        }
        assert!(apart > 100, "{apart}");
    }
}
