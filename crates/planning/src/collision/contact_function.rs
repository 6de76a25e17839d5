//! Whether two ellipsoids overlap, decided exactly and with a certificate.
//!
//! With `A = L_a L_a'`, `B = L_b L_b'`, `d` from centre to centre and a weight `t > 0`, let `(A + t B) n = d`. Every `n` gives a
//! plane that separates the solids if `n . d > |L_a' n| + |L_b' n|`, and `L_a (L_a' n)`, taken from the centre of a, is a point of
//! both if `|L_a' n| <= 1` and `t |L_b' n| <= 1`. At the one weight where these two lengths are equal they are the factor by
//! which both solids must grow about their centres to touch (the root of the contact function), so that one of the certificates
//! holds there unless they touch; mostly one holds much earlier.
//!
//! # Source
//! Perram and Wertheim, "Statistical mechanics of hard ellipsoids", Journal of Computational Physics 58 (1985), with
//! `t = s / (1 - s)`.

use super::Ellipsoid;
use super::double_double::{DoubleDouble, Real};
use nalgebra::Vector3;

/// A plane `normal . x = offset`. The normal is not of unit length.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Plane {
    /// Points from the first solid to the second, world axes.
    pub normal: Vector3<f64>,
    /// `normal . x` on the plane.
    pub offset: f64,
}

/// The answer to "do they overlap?", with what proves it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Separation {
    /// The first solid lies on the negative side of this plane, the second on the positive side. The normal is the proof,
    /// `normal . (centre of b - centre of a)` exceeds both supports together; the offset, half way, is rounded.
    Apart(Plane),
    /// This point lies in both solids, but for the rounding of its coordinates; world axes, m.
    Overlapping(Vector3<f64>),
}

/// Whether two solids overlap, and what proves it.
///
/// `Apart` is only said with a plane that separates the solids as they are stored, so that no overlap is missed. Solids nearer
/// to each other than about 1e-20 of their size, where 106 bits cannot tell, count as overlapping.
#[inline]
pub fn separation(a: &Ellipsoid, b: &Ellipsoid) -> Separation {
    match at_once(a, b) {
        Ok(decided) => decided,
        Err(weight) => by_weight(a, b, weight),
    }
}

/// Whether two solids overlap; touching counts.
#[inline]
pub fn overlap(a: &Ellipsoid, b: &Ellipsoid) -> bool {
    matches!(separation(a, b), Separation::Overlapping(_))
}

/// Semi-axes may differ by this factor from what the factor of an ellipsoid spans, where its attitude is not quite a rotation.
const SLACK: f64 = 1.01;

/// What the spheres about and inside the solids and the plane across the line of centres decide, or a weight to go on from.
#[inline]
fn at_once(a: &Ellipsoid, b: &Ellipsoid) -> Result<Separation, f64> {
    let between = b.center() - a.center();
    let squared = between.norm_squared();
    let (smallest_a, smallest_b) = (smallest(a), smallest(b));
    let inner = smallest_a + smallest_b;
    if squared * (SLACK * SLACK) < inner * inner {
        return Ok(Separation::Overlapping(a.center() + between * (smallest_a / inner)));
    }
    let outer = SLACK * (largest(a) + largest(b));
    let (pulled_a, pulled_b) = (a.factor().tr_mul(&between), b.factor().tr_mul(&between));
    let (reach_a, reach_b) = (f64::sqrt(pulled_a.norm_squared()), f64::sqrt(pulled_b.norm_squared()));
    let size = taxicab(&[between.x, between.y, between.z]);
    if squared - reach_a - reach_b > error_bound::<f64>(size, size + outer) {
        return Ok(Separation::Apart(plane(a, b, between)));
    }
    Err(reach_a / reach_b)
}

fn smallest(ellipsoid: &Ellipsoid) -> f64 {
    let axes = ellipsoid.semi_axes();
    axes.x.min(axes.y).min(axes.z)
}

fn largest(ellipsoid: &Ellipsoid) -> f64 {
    let axes = ellipsoid.semi_axes();
    axes.x.max(axes.y).max(axes.z)
}

fn taxicab(vector: &[f64; 3]) -> f64 {
    vector[0].abs() + vector[1].abs() + vector[2].abs()
}

/// Bounds the error of `normal . d - |L_a' normal| - |L_b' normal|` for a normal and lengths of this size. What underflow can
/// do is below the constant.
#[inline(always)]
fn error_bound<N: Real>(normal: f64, lengths: f64) -> f64 {
    N::ROUNDING * (normal * lengths) + 1e-140
}

/// The plane half way between the solids along a normal.
#[inline]
fn plane(a: &Ellipsoid, b: &Ellipsoid, normal: Vector3<f64>) -> Plane {
    let end_of_a = normal.dot(a.center()) + a.support(&normal);
    let start_of_b = normal.dot(b.center()) - b.support(&normal);
    Plane { normal, offset: 0.5 * (end_of_a + start_of_b) }
}

/// Goes from weight to weight, first in 53 bits and then, where those do not decide, in 106.
fn by_weight(a: &Ellipsoid, b: &Ellipsoid, weight: f64) -> Separation {
    const STEPS: usize = 12;
    let pair = Pair::<f64>::new(a, b, 1.0);
    let mut search = Search::from(weight);
    // The point of the thinner solid is taken, as the thicker one has more room for the solution's error.
    let (smallest_a, smallest_b) = (smallest(a), smallest(b));
    let room = smallest_a.max(smallest_b) / SLACK;
    for _ in 0..STEPS {
        let found = pair.at(search.weight);
        if pair.gap(&found.normal) > 0.0 {
            return Separation::Apart(plane(a, b, Vector3::from(found.normal)));
        }
        let left = 1.0 - f64::sqrt(found.upper());
        if left > 0.0 && left * room > found.residual(&pair) {
            return Separation::Overlapping(common_point(a, b, &found, smallest_a < smallest_b));
        }
        if search.step(&found) < 1e-13 {
            break;
        }
    }
    in_double_double(a, b, search.weight)
}

/// The same in double-double numbers, in units of about the scene's size.
#[cold]
#[inline(never)]
fn in_double_double(a: &Ellipsoid, b: &Ellipsoid, weight: f64) -> Separation {
    const STEPS: usize = 40;
    let across = (b.center() * 0.5 - a.center() * 0.5).amax();
    let scale = inverse_power_of_two(across.max(largest(a)).max(largest(b)));
    let pair = Pair::<DoubleDouble>::new(a, b, scale);
    let along = pair.between.map(Real::nearest);
    if pair.gap(&along) > 0.0 {
        return Separation::Apart(plane(a, b, Vector3::from(along)));
    }
    let is_usable = weight > 0.0 && weight < f64::MAX;
    let mut search = Search::from(DoubleDouble::exact(if is_usable { weight } else { largest(a) / largest(b) }));
    let mut point = *a.center();
    for _ in 0..STEPS {
        let found = pair.at(search.weight);
        let normal = found.normal.map(Real::nearest);
        if pair.gap(&normal) > 0.0 {
            return Separation::Apart(plane(a, b, Vector3::from(normal)));
        }
        // Here only the rounding to `f64` is an error: less so from the centre of the smaller solid.
        point = common_point(a, b, &found, largest(a) < largest(b));
        // Within 1e-25 or so; that the solids touch or not, this is the safe side.
        if found.upper() <= 1.0 || search.step(&found) < 1e-24 {
            break;
        }
    }
    Separation::Overlapping(point)
}

/// The point that `n` gives, from the centre of a or that of b.
fn common_point<N: Real>(a: &Ellipsoid, b: &Ellipsoid, found: &Found<N>, is_from_a: bool) -> Vector3<f64> {
    let place = |solid: &Ellipsoid, pulled: &[N; 3]| solid.factor() * Vector3::from(pulled.map(N::nearest));
    if is_from_a {
        a.center() + place(a, &found.pulled_a)
    } else {
        b.center() - place(b, &found.pulled_b) * found.weight.nearest()
    }
}

/// The power of two that brings a positive number to between one and two, or near it at the ends of the range.
fn inverse_power_of_two(value: f64) -> f64 {
    const EXPONENT: u64 = 0x7ff0_0000_0000_0000;
    const LARGEST: f64 = f64::from_bits(0x7fc0_0000_0000_0000);
    1.0 / f64::from_bits(value.to_bits() & EXPONENT).clamp(1.0 / LARGEST, LARGEST)
}

/// A symmetric matrix: xx, xy, xz, yy, yz, zz.
type Symmetric<N> = [N; 6];

/// Two solids in the numbers of the search. Factors are by columns.
pub(super) struct Pair<N> {
    between: [N; 3],
    factor_a: [[N; 3]; 3],
    factor_b: [[N; 3]; 3],
    shape_a: Symmetric<N>,
    shape_b: Symmetric<N>,
    /// Bounds what enters the error bounds: the distance of the centres and both solids.
    lengths: f64,
}

/// What one weight `t` gives.
pub(super) struct Found<N> {
    /// `n` with `(A + t B) n = d`.
    pub(super) normal: [N; 3],
    /// `L_a' n`.
    pub(super) pulled_a: [N; 3],
    /// `L_b' n`.
    pub(super) pulled_b: [N; 3],
    pub(super) weight: N,
    /// `n' A n`.
    pub(super) square_a: N,
    /// `n' B n`.
    pub(super) square_b: N,
    /// The adjugate of `A + t B`.
    pub(super) adjugate: Symmetric<N>,
    /// One over its determinant.
    pub(super) inverse_determinant: N,
    /// `B n`.
    pub(super) image_b: [N; 3],
}

#[inline(always)]
fn dot<N: Real>(left: &[N; 3], right: &[N; 3]) -> N {
    left[0] * right[0] + left[1] * right[1] + left[2] * right[2]
}

#[inline(always)]
fn pull<N: Real>(columns: &[[N; 3]; 3], vector: &[N; 3]) -> [N; 3] {
    [dot(&columns[0], vector), dot(&columns[1], vector), dot(&columns[2], vector)]
}

#[inline(always)]
fn rows<N: Real>(columns: &[[N; 3]; 3]) -> [[N; 3]; 3] {
    let [[xx, yx, zx], [xy, yy, zy], [xz, yz, zz]] = *columns;
    [[xx, xy, xz], [yx, yy, yz], [zx, zy, zz]]
}

#[inline(always)]
fn push<N: Real>(columns: &[[N; 3]; 3], vector: &[N; 3]) -> [N; 3] {
    rows(columns).map(|row| dot(&row, vector))
}

/// `L L'`.
#[inline(always)]
fn squared<N: Real>(columns: &[[N; 3]; 3]) -> Symmetric<N> {
    let [x, y, z] = rows(columns);
    [dot(&x, &x), dot(&x, &y), dot(&x, &z), dot(&y, &y), dot(&y, &z), dot(&z, &z)]
}

#[inline(always)]
fn apply<N: Real>(matrix: &Symmetric<N>, vector: &[N; 3]) -> [N; 3] {
    let [xx, xy, xz, yy, yz, zz] = *matrix;
    [dot(&[xx, xy, xz], vector), dot(&[xy, yy, yz], vector), dot(&[xz, yz, zz], vector)]
}

impl<N: Real> Pair<N> {
    #[inline(always)]
    pub(super) fn new(a: &Ellipsoid, b: &Ellipsoid, scale: f64) -> Self {
        let columns = |ellipsoid: &Ellipsoid| {
            let factor = ellipsoid.factor();
            let column = |j: usize| [0, 1, 2].map(|i| N::exact(factor[(i, j)] * scale));
            [column(0), column(1), column(2)]
        };
        let between = [0, 1, 2].map(|i| N::difference(b.center()[i] * scale, a.center()[i] * scale));
        let (factor_a, factor_b) = (columns(a), columns(b));
        let lengths = taxicab(&between.map(N::nearest)) + SLACK * scale * (largest(a) + largest(b));
        Self { between, factor_a, factor_b, shape_a: squared(&factor_a), shape_b: squared(&factor_b), lengths }
    }

    #[inline(always)]
    pub(super) fn at(&self, weight: N) -> Found<N> {
        let mut matrix = self.shape_a;
        for (entry, of_b) in matrix.iter_mut().zip(&self.shape_b) {
            *entry = *entry + weight * *of_b;
        }
        let [xx, xy, xz, yy, yz, zz] = matrix;
        let adjugate = [
            yy * zz - yz * yz,
            xz * yz - xy * zz,
            xy * yz - xz * yy,
            xx * zz - xz * xz,
            xy * xz - xx * yz,
            xx * yy - xy * xy,
        ];
        let determinant = xx * adjugate[0] + xy * adjugate[1] + xz * adjugate[2];
        let inverse_determinant = N::exact(1.0) / determinant;
        let normal = apply(&adjugate, &self.between).map(|entry| entry * inverse_determinant);
        let (pulled_a, pulled_b) = (pull(&self.factor_a, &normal), pull(&self.factor_b, &normal));
        let (square_a, square_b) = (dot(&pulled_a, &pulled_a), dot(&pulled_b, &pulled_b));
        let image_b = push(&self.factor_b, &pulled_b);
        Found { normal, pulled_a, pulled_b, weight, square_a, square_b, adjugate, inverse_determinant, image_b }
    }

    /// How far the plane with this normal certainly keeps the solids apart, in units of the normal.
    #[inline(always)]
    fn gap(&self, normal: &[f64; 3]) -> f64 {
        let size = taxicab(normal);
        let normal = normal.map(N::exact);
        let (pulled_a, pulled_b) = (pull(&self.factor_a, &normal), pull(&self.factor_b, &normal));
        let reach = dot(&pulled_a, &pulled_a).root() + dot(&pulled_b, &pulled_b).root();
        (dot(&normal, &self.between) - reach).nearest() - error_bound::<N>(size, self.lengths)
    }

    /// The weight at which both lengths are equal, as well as 53 bits allow.
    #[inline]
    pub(super) fn balanced(&self, weight: N) -> Found<N> {
        const STEPS: usize = 24;
        let mut search = Search::from(weight);
        for _ in 0..STEPS {
            let found = self.at(search.weight);
            // The step converges quadratically: the next weight is as good as it gets.
            if search.step(&found) < 1e-8 {
                break;
            }
        }
        self.at(search.weight)
    }
}

impl<N: Real> Found<N> {
    /// The square of the larger of both lengths: bounds the contact function from above.
    #[inline(always)]
    fn upper(&self) -> f64 {
        self.square_a.nearest().max((self.weight * self.weight * self.square_b).nearest())
    }

    /// `n' B (A + t B)^-1 B n`.
    #[inline(always)]
    pub(super) fn curvature_b(&self) -> N {
        dot(&self.image_b, &apply(&self.adjugate, &self.image_b)) * self.inverse_determinant
    }

    /// Bounds the distance between the point as seen from a and as seen from b, which is not zero as `n` is rounded.
    #[inline(always)]
    fn residual(&self, pair: &Pair<N>) -> f64 {
        let from_a = push(&pair.factor_a, &self.pulled_a);
        let rest = [0, 1, 2].map(|i| (pair.between[i] - from_a[i] - self.weight * self.image_b[i]).nearest());
        taxicab(&rest) + N::ROUNDING * pair.lengths
    }
}

/// Newton's method on the logarithm of `|L_a' n| / (t |L_b' n|)` by the logarithm of `t`, which decreases, in a bracket.
struct Search<N> {
    weight: N,
    low: f64,
    high: f64,
}

impl<N: Real> Search<N> {
    #[inline(always)]
    fn from(weight: N) -> Self {
        Self { weight, low: 0.0, high: f64::INFINITY }
    }

    /// Goes to the next weight; returns the relative size of the step.
    #[inline(always)]
    fn step(&mut self, found: &Found<N>) -> f64 {
        let weight = self.weight.nearest();
        let (length_a, length_b) = (found.square_a.root(), self.weight * found.square_b.root());
        // (r - 1) / (r + 1) for a ratio r: half its logarithm where it is near one.
        let off = (length_a - length_b).nearest() / (length_a + length_b).nearest();
        if off > 0.0 {
            self.low = weight;
        } else {
            self.high = weight;
        }
        let (square_a, square_b) = (found.square_a.nearest(), found.square_b.nearest());
        let share = weight * found.curvature_b().nearest() / square_b;
        let slope = (1.0 - share) * (1.0 + weight * square_b / square_a);
        let half = (off / slope).clamp(-0.8, 0.8);
        let relative = 2.0 * half / (1.0 - half);
        let next = self.weight + self.weight * N::exact(relative);
        let is_inside = next.nearest() >= self.low && next.nearest() <= self.high;
        self.weight = if is_inside { next } else { N::exact(f64::sqrt(self.low) * f64::sqrt(self.high)) };
        relative.abs()
    }
}
