//! Sets in the plane by their corners: to draw them, to measure their area, to see that they are invariant.

use super::ConvexSet;
use nalgebra::{Matrix2, Vector2};

/// The points `e` of the plane with `|normals e| <= bounds`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Strips<const R: usize> {
    /// Across the strips.
    pub normals: [Vector2<f64>; R],
    /// Half the width of each times the length of its normal; not negative.
    pub bounds: [f64; R],
}

impl<const R: usize> ConvexSet<2> for Strips<R> {
    /// Infinite where all strips are parallel.
    fn support(&self, direction: &Vector2<f64>) -> f64 {
        if direction.amax() == 0.0 {
            return 0.0;
        }
        let mut least = f64::INFINITY;
        for j in 0..R {
            for k in j + 1..R {
                let determinant = self.normals[j].perp(&self.normals[k]);
                if determinant != 0.0 {
                    let of_j = (direction.perp(&self.normals[k]) / determinant).abs();
                    let of_k = (self.normals[j].perp(direction) / determinant).abs();
                    least = least.min(of_j * self.bounds[j] + of_k * self.bounds[k]);
                }
            }
        }
        least
    }
}

/// A convex polygon.
#[derive(Clone, Debug, PartialEq)]
pub struct Polygon {
    /// Counter-clockwise.
    vertices: Vec<Vector2<f64>>,
}

impl Polygon {
    /// The sums of generators, each taken from minus once to plus once.
    pub fn of_generators(generators: impl IntoIterator<Item = Vector2<f64>>) -> Self {
        let upward = |g: Vector2<f64>| if g.y < 0.0 || (g.y == 0.0 && g.x < 0.0) { -g } else { g };
        let is_something = |g: &Vector2<f64>| g.x != 0.0 || g.y != 0.0;
        let mut edges: Vec<_> =
            generators.into_iter().filter(is_something).map(upward).map(|g| (libm::atan2(g.y, g.x), g)).collect();
        edges.sort_by(|(a, _), (b, _)| a.total_cmp(b));
        let mut vertices = Vec::with_capacity(2 * edges.len());
        let mut corner = -edges.iter().map(|(_, g)| g).sum::<Vector2<f64>>();
        for (_, edge) in &edges {
            vertices.push(corner);
            corner += 2.0 * edge;
        }
        let opposite: Vec<_> = vertices.iter().map(|vertex| -vertex).collect();
        vertices.extend(opposite);
        Self { vertices }
    }

    /// What lies in all strips; empty where these are all parallel.
    pub fn of_strips<const R: usize>(strips: &Strips<R>) -> Self {
        let determinant = |j: usize, k: usize| strips.normals[j].perp(&strips.normals[k]);
        let mut most = (0, 0);
        for j in 0..R {
            for k in j + 1..R {
                if determinant(j, k).abs() > determinant(most.0, most.1).abs() {
                    most = (j, k);
                }
            }
        }
        let (j, k) = most;
        if R == 0 || determinant(j, k) == 0.0 {
            return Self { vertices: Vec::new() };
        }
        // the parallelogram of two strips, by the edges along them
        let along = |of: usize, across: usize| {
            let edge = Vector2::new(-strips.normals[of].y, strips.normals[of].x);
            edge * (strips.bounds[across] / determinant(j, k))
        };
        let mut vertices = Self::of_generators([along(j, k), along(k, j)]).vertices;
        for (normal, bound) in strips.normals.iter().zip(&strips.bounds) {
            vertices = clipped(&clipped(&vertices, normal, *bound), &-normal, *bound);
        }
        Self { vertices }
    }

    /// Corners, counter-clockwise.
    pub fn vertices(&self) -> &[Vector2<f64>] {
        &self.vertices
    }

    /// Area.
    pub fn area(&self) -> f64 {
        0.5 * self.edges().map(|(from, to)| from.perp(&to)).sum::<f64>()
    }

    /// Outward unit normals of the edges.
    pub fn normals(&self) -> Vec<Vector2<f64>> {
        let outward = |(from, to): (Vector2<f64>, Vector2<f64>)| Vector2::new(to.y - from.y, from.x - to.x);
        let is_edge = |normal: &Vector2<f64>| normal.norm_squared() > 0.0;
        self.edges().map(outward).filter(is_edge).map(|normal| normal / f64::sqrt(normal.norm_squared())).collect()
    }

    /// The farthest that one step from the polygon reaches beyond an edge, as a share of how far that edge is from the origin:
    /// at most one where the polygon is invariant.
    pub fn invariance_ratio(&self, closed_loop: &Matrix2<f64>, disturbance: &impl ConvexSet<2>) -> f64 {
        let ratio = |normal: &Vector2<f64>| {
            let after = self.support(&closed_loop.tr_mul(normal)) + disturbance.support(normal);
            after / self.support(normal)
        };
        self.normals().iter().map(ratio).fold(0.0, f64::max)
    }

    fn edges(&self) -> impl Iterator<Item = (Vector2<f64>, Vector2<f64>)> {
        let next = self.vertices.iter().cycle().skip(1);
        self.vertices.iter().zip(next).map(|(from, to)| (*from, *to))
    }
}

impl ConvexSet<2> for Polygon {
    fn support(&self, direction: &Vector2<f64>) -> f64 {
        self.vertices.iter().map(|vertex| vertex.dot(direction)).fold(0.0, f64::max)
    }
}

/// The part of a convex polygon on the inner side of a line.
fn clipped(vertices: &[Vector2<f64>], normal: &Vector2<f64>, bound: f64) -> Vec<Vector2<f64>> {
    let mut inside = Vec::with_capacity(vertices.len() + 1);
    let next = vertices.iter().cycle().skip(1);
    for (from, to) in vertices.iter().zip(next) {
        // what only rounding puts outside stays
        let slack = 1e-14 * bound;
        let (excess, excess_next) = (normal.dot(from) - bound, normal.dot(to) - bound);
        if excess <= slack {
            inside.push(*from);
        }
        if (excess > slack) != (excess_next > slack) {
            inside.push(from + (to - from) * (excess / (excess - excess_next)));
        }
    }
    inside
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::control::{SymmetricBox, Zonotope};
    use nalgebra::Matrix2x3;

    #[test]
    fn a_square_and_a_hexagon_from_generators() {
        let square = Polygon::of_generators([Vector2::x(), -Vector2::y(), Vector2::zeros()]);
        assert_eq!(square.vertices().len(), 4);
        assert!((square.area() - 4.0).abs() < 1e-15);
        let generators = Matrix2x3::new(1.0, -0.3, 0.2, 0.4, 0.5, -2.0);
        let hexagon = Polygon::of_generators((0..3).map(|i| generators.column(i).into_owned()));
        // the area of a zonotope: four times the sum of the determinants of its pairs
        let pairs = [(0, 1), (0, 2), (1, 2)];
        let area: f64 = pairs.iter().map(|(i, j)| generators.column(*i).perp(&generators.column(*j)).abs()).sum();
        assert!((hexagon.area() - 4.0 * area).abs() < 1e-14);
        for i in 0..40 {
            let direction = Vector2::new(f64::from(i) - 20.3, 7.7);
            assert!((hexagon.support(&direction) - Zonotope(generators).support(&direction)).abs() < 1e-13);
        }
        assert!(hexagon.normals().len() == 6 && Polygon::of_generators([]).vertices().is_empty());
    }

    #[test]
    fn strips_by_corners_reach_as_far_as_by_pairs() {
        let strips = Strips {
            normals: [Vector2::x(), Vector2::y(), Vector2::new(1.0, 1.0), Vector2::new(-2.0, 1.0)],
            bounds: [1.0, 1.0, 1.5, 100.0],
        };
        let polygon = Polygon::of_strips(&strips);
        // a square of which two corners are cut off; the last strip cuts nothing
        assert_eq!(polygon.vertices().len(), 6);
        assert!((polygon.area() - (4.0 - 0.25)).abs() < 1e-14);
        for i in 0..40 {
            let direction = Vector2::new(f64::from(i) - 20.3, 7.7);
            assert!(
                (polygon.support(&direction) - strips.support(&direction)).abs() < 1e-13 * polygon.support(&direction)
            );
        }
        let parallel = Strips { normals: [Vector2::x(), 2.0 * Vector2::x()], bounds: [1.0, 1.0] };
        assert!(parallel.support(&Vector2::y()).is_infinite() && parallel.support(&Vector2::zeros()).abs() <= 0.0);
        assert!(Polygon::of_strips(&parallel).vertices().is_empty());
    }

    #[test]
    fn the_ratio_of_a_square() {
        let square = Polygon::of_generators([Vector2::x(), Vector2::y()]);
        let quarter = Matrix2::new(0.0, -0.5, 0.5, 0.0);
        let ratio = square.invariance_ratio(&quarter, &SymmetricBox(Vector2::new(0.25, 0.75)));
        assert!((ratio - 1.25).abs() < 1e-15);
    }
}
