//! True distance of two ellipsoids, and how deep they overlap.
//!
//! For a unit vector `n` the slab between the supporting planes is `g(n) = n . (c_b - c_a) - |L_a' n| - |L_b' n|` wide. Its
//! maximum is the signed distance, so every `n` gives a certified lower bound; the gradient of `g` is the vector between
//! the two support points, whose length is an upper bound while the bodies are apart. `g` is concave, its Hessian is minus
//! the sum of the radii of curvature: Newton's method on the sphere has two unknowns and an explicit matrix.

use super::Ellipsoid;
use super::contact_function::{Separation, separation};
use nalgebra::{Matrix3, Vector3};

/// How far apart two bodies are, with the plane that proves it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Distance {
    /// Signed distance, m. Positive: the length between the two points, which no true distance exceeds. Negative: minus
    /// the shortest translation found that separates the bodies.
    pub distance_m: f64,
    /// What the signed distance is certainly not below, rounding included, m: the width of the slab across `normal`.
    pub lower_bound_m: f64,
    /// Unit vector from a to b.
    pub normal: Vector3<f64>,
    /// The point of a farthest along the normal; the nearest one while the bodies are apart. World axes, m.
    pub point_on_a: Vector3<f64>,
    /// The point of b farthest against the normal. World axes, m.
    pub point_on_b: Vector3<f64>,
}

impl Distance {
    /// The same seen from the other body.
    pub fn swapped(&self) -> Self {
        Self { normal: -self.normal, point_on_a: self.point_on_b, point_on_b: self.point_on_a, ..*self }
    }
}

/// Signed distance of two ellipsoids.
///
/// While they are apart the answer is the distance, to rounding, between a certified lower and a certified upper bound.
/// Where they overlap it is minus the best of several local minima of the depth of penetration: `-lower_bound_m` certainly
/// suffices as a translation of b along `normal`, while a shorter one is not excluded.
pub fn distance(a: &Ellipsoid, b: &Ellipsoid) -> Distance {
    let pair = Pair::new(a, b);
    pair.finish(pair.start(), None)
}

/// The same, from the normal of a similar pose; faster where the hint is good, the same answer where it is not.
pub fn distance_from_hint(a: &Ellipsoid, b: &Ellipsoid, normal_hint: &Vector3<f64>) -> Distance {
    let pair = Pair::new(a, b);
    match unit(normal_hint).map(|normal| pair.slab(normal)) {
        Some(hint) if hint.width_m > 0.0 => pair.finish(hint, None),
        hint => pair.finish(pair.start(), hint),
    }
}

/// A normal across which two ellipsoids are apart by nearly as much more than `margin_m` as they can be: all but a hundredth of
/// the excess; or, where they are not so far apart, the best normal. None where they overlap.
pub(super) fn separating_normal(
    a: &Ellipsoid,
    b: &Ellipsoid,
    normal_hint: Option<&Vector3<f64>>,
    margin_m: f64,
) -> Option<Vector3<f64>> {
    let pair = Pair::new(a, b);
    let hinted = normal_hint.map(|normal| pair.slab(*normal)).filter(|slab| slab.width_m > 0.0);
    let start = match hinted {
        Some(slab) => slab,
        None => match separation(a, b) {
            Separation::Overlapping(_) => return None,
            Separation::Apart(plane) => pair.slab(unit(&plane.normal)?),
        },
    };
    Some(pair.widest(start, f64::NEG_INFINITY, Some(margin_m)).normal)
}

/// Newton steps before the bounds are returned as they are.
const STEPS: usize = 60;
/// Length of the part of the gradient along the sphere at which the search ends, relative to the distance.
const RESIDUAL: f64 = 1e-9;
/// Twice the share of the excess over a margin that a nearly best plane may leave.
const CONTENT: f64 = 0.02;

/// Length by the processor's square root (nalgebra's is emulated here).
#[inline]
pub(super) fn length(v: &Vector3<f64>) -> f64 {
    f64::sqrt(v.norm_squared())
}

/// `v` at length one, where it has a direction.
#[inline]
pub(super) fn unit(v: &Vector3<f64>) -> Option<Vector3<f64>> {
    let length = length(v);
    (length > 0.0 && length < f64::INFINITY).then(|| v * (1.0 / length))
}

/// The columns, without an index that could be out of range.
#[inline]
fn columns(matrix: &Matrix3<f64>) -> [Vector3<f64>; 3] {
    matrix.data.0.map(Vector3::from)
}

/// `matrix^-1 right` for a symmetric matrix, where it can be inverted.
#[inline]
fn solve_symmetric(matrix: &Matrix3<f64>, right: &Vector3<f64>) -> Option<Vector3<f64>> {
    let [x, y, z] = columns(matrix);
    let (yz, zx, xy) = (y.cross(&z), z.cross(&x), x.cross(&y));
    let determinant = x.dot(&yz);
    (determinant > 0.0).then(|| Vector3::new(yz.dot(right), zx.dot(right), xy.dot(right)) * (1.0 / determinant))
}

#[inline]
fn add_to_diagonal(matrix: &mut Matrix3<f64>, value: f64) {
    matrix.m11 += value;
    matrix.m22 += value;
    matrix.m33 += value;
}

/// Two ellipsoids and what every evaluation of the slab needs.
struct Pair<'a> {
    a: &'a Ellipsoid,
    b: &'a Ellipsoid,
    /// From centre to centre.
    offset: Vector3<f64>,
    /// `L L'` of each.
    shapes: [Matrix3<f64>; 2],
    /// How far rounding can move the width of a slab, m.
    noise_m: f64,
}

/// The slab across a normal.
#[derive(Clone, Copy)]
struct Slab {
    normal: Vector3<f64>,
    width_m: f64,
    /// Support heights of a and b over their centres.
    heights: [f64; 2],
    /// Support points of a along and of b against the normal, each from its centre; b's with its sign turned.
    points: [Vector3<f64>; 2],
    /// From the support point of a to that of b.
    between: Vector3<f64>,
}

impl Slab {
    fn or_wider(self, other: Self) -> Self {
        if other.width_m > self.width_m { other } else { self }
    }

    /// The gradient along the sphere.
    #[inline]
    fn slope(&self) -> Vector3<f64> {
        self.between - self.normal * self.width_m
    }
}

impl<'a> Pair<'a> {
    #[inline]
    fn new(a: &'a Ellipsoid, b: &'a Ellipsoid) -> Self {
        let shapes = [a, b].map(|body| body.factor() * body.factor().transpose());
        let offset = b.center() - a.center();
        let noise_m = 8.0 * f64::EPSILON * (length(&offset) + a.semi_axes().max() + b.semi_axes().max());
        Self { a, b, offset, shapes, noise_m }
    }

    #[inline]
    fn slab(&self, normal: Vector3<f64>) -> Slab {
        let [on_a, on_b] = [self.a, self.b].map(|body| body.factor().tr_mul(&normal));
        let heights = [length(&on_a), length(&on_b)];
        let points = [self.a.factor() * (on_a * (1.0 / heights[0])), self.b.factor() * (on_b * (1.0 / heights[1]))];
        Slab {
            normal,
            width_m: normal.dot(&self.offset) - heights[0] - heights[1],
            heights,
            points,
            between: self.offset - points[0] - points[1],
        }
    }

    /// A slab of positive width wherever the bodies are apart.
    #[inline]
    fn start(&self) -> Slab {
        let along = self.slab(unit(&self.offset).unwrap_or_else(Vector3::x));
        // Both heights replaced by quadratic bounds that touch at this normal: the maximum moves to a wider slab.
        let [first, second] = self.shapes;
        let mut curvature = first * (1.0 / along.heights[0]) + second * (1.0 / along.heights[1]);
        add_to_diagonal(&mut curvature, along.width_m.max(0.0));
        let bent = solve_symmetric(&curvature, &self.offset).and_then(|v| unit(&v)).map(|normal| self.slab(normal));
        match bent {
            Some(bent) if bent.width_m > 0.0 => bent,
            _ if along.width_m > 0.0 => along,
            Some(bent) => self.contact_start(bent),
            None => along,
        }
    }

    /// The normal of the contact function, whose maximum over one unknown is exact about overlap.
    fn contact_start(&self, fallback: Slab) -> Slab {
        let (mut low, mut high) = (0.0, 1.0);
        let mut share = fallback.heights[0] / (fallback.heights[0] + fallback.heights[1]);
        let mut best = fallback;
        for _ in 0..STEPS {
            let mixed = self.shapes[0] * (1.0 - share) + self.shapes[1] * share;
            let Some(normal) = solve_symmetric(&mixed, &self.offset) else { break };
            let [on_a, on_b] = [self.a, self.b].map(|body| length(&body.factor().tr_mul(&normal)));
            if let Some(normal) = unit(&normal) {
                best = best.or_wider(self.slab(normal));
            }
            let (inside_a, inside_b) = ((1.0 - share) * on_a, share * on_b);
            // A point of both bodies was found, or a plane between them.
            if best.width_m > 0.0 || inside_a.max(inside_b) <= 1.0 {
                break;
            }
            if inside_a > inside_b {
                low = share;
            } else {
                high = share;
            }
            let next = on_a / (on_a + on_b);
            share = if next > low && next < high { next } else { 0.5 * (low + high) };
            if share <= low || share >= high {
                break;
            }
        }
        best
    }

    fn finish(&self, start: Slab, hint: Option<Slab>) -> Distance {
        let mut best = self.widest(start, f64::NEG_INFINITY, None);
        if best.width_m <= 0.0 {
            if let Some(hint) = hint {
                best = best.or_wider(self.widest(hint, best.width_m, None));
            }
            // The depth has several local minima: near the short axes of either body, turned towards b.
            for body in [self.a, self.b] {
                for (along, semi_axis) in columns(body.factor()).iter().zip(body.semi_axes()) {
                    // Across the longest axis no translation is shortest, but for a sphere, where the first search suffices.
                    if *semi_axis >= body.semi_axes().max() {
                        continue;
                    }
                    let towards = if along.dot(&self.offset) < 0.0 { -along } else { *along };
                    let Some(normal) = unit(&towards) else { continue };
                    best = best.or_wider(self.widest(self.slab(normal), best.width_m, None));
                }
            }
        }
        self.answer(&best)
    }

    /// Climbs to the widest slab near this one; gives up where it will not be wider than `at_least_m`, and is content with
    /// nearly all of what exceeds a margin, where there is one.
    #[inline]
    fn widest(&self, start: Slab, at_least_m: f64, margin_m: Option<f64>) -> Slab {
        let mut slab = start;
        let noise = 0.5 * self.noise_m;
        for _ in 0..STEPS {
            let slope = slab.slope();
            let residual = RESIDUAL * slab.width_m.abs() + noise;
            // The distance is not above the length of the gradient, whose square is that of the width and of the slope.
            let enough = margin_m.map_or(0.0, |margin_m| CONTENT * slab.width_m * (slab.width_m - margin_m).max(0.0));
            if slope.norm_squared() <= f64::max(residual * residual, enough) {
                break;
            }
            let Some(step) = self.step(&slab, &slope) else { break };
            let rise = slope.dot(&step);
            // Newton's model promises half of this.
            if slab.width_m + 4.0 * rise < at_least_m {
                break;
            }
            let mut fraction = 1.0;
            let mut next = None;
            while fraction > 1e-6 {
                let Some(normal) = unit(&(slab.normal + step * fraction)) else { break };
                let trial = self.slab(normal);
                if trial.width_m >= slab.width_m + 0.1 * fraction * rise - noise {
                    next = Some(trial);
                    break;
                }
                fraction *= 0.25;
            }
            match next {
                Some(trial) if trial.width_m > slab.width_m || trial.slope().norm_squared() < slope.norm_squared() => {
                    slab = trial;
                }
                _ => break,
            }
            // A depth has no second bound to close; the error left is the square of this.
            if slab.width_m < 0.0 && rise < 1e-12 * -slab.width_m {
                break;
            }
        }
        slab
    }

    /// Newton's step along the sphere, or one along a direction of ascent where the slab is not concave there.
    #[inline]
    fn step(&self, slab: &Slab, slope: &Vector3<f64>) -> Option<Vector3<f64>> {
        let curvature = (self.shapes[0] - slab.points[0] * slab.points[0].transpose()) * (1.0 / slab.heights[0])
            + (self.shapes[1] - slab.points[1] * slab.points[1].transpose()) * (1.0 / slab.heights[1]);
        // Along the normal the curvature vanishes; any positive number there keeps the matrix regular and the step tangent.
        let trace = curvature.trace();
        let solve = |width: f64| {
            let mut matrix = curvature + slab.normal * slab.normal.transpose() * (trace + width.abs() - width);
            add_to_diagonal(&mut matrix, width);
            solve_symmetric(&matrix, slope)
        };
        if slab.width_m >= 0.0 {
            return solve(slab.width_m);
        }
        // The smaller of the two radii of curvature, from trace and sum of minors.
        let minors = 0.5 * (trace * trace - curvature.norm_squared());
        let root = f64::sqrt((trace * trace - 4.0 * minors).max(0.0));
        let smallest = 2.0 * minors.max(0.0) / (trace + root);
        // Newton's step also where the top is nearly flat; elsewhere one of bounded length.
        solve(if slab.width_m > -0.999 * smallest { slab.width_m } else { -0.9 * smallest })
    }

    #[inline]
    fn answer(&self, slab: &Slab) -> Distance {
        let distance_m = if slab.width_m > 0.0 { length(&slab.between) } else { slab.width_m };
        Distance {
            distance_m,
            lower_bound_m: slab.width_m - self.noise_m,
            normal: slab.normal,
            point_on_a: self.a.center() + slab.points[0],
            point_on_b: self.b.center() - slab.points[1],
        }
    }
}
