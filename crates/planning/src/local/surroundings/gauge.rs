//! A point against an ellipsoid: `c = |p|^2 - 1` in the space where the ellipsoid is the unit ball.

use super::hermite::{Segment, Weights, evaluate};
use crate::collision::Ellipsoid;
use crate::local::model::{KINEMATICS, Kinematics};
use crate::local::rows::{MotionRow, MovingContact};
use nalgebra::{Matrix3, Vector3};

/// The measure of an ellipsoid grown by a margin.
pub(super) struct Gauge {
    /// Columns are unit axes, world coordinates.
    axes: Matrix3<f64>,
    semi_axes: Vector3<f64>,
}

/// Below this the place of least distance is not worth following: all of the segment is as near, to half of this.
pub(super) const LEAST_CURVATURE: f64 = 1e-4;

impl Gauge {
    /// The ellipsoid of least sum of squared semi-axes, with these axes, that holds all that is nearer than the margin:
    /// `(1 + t) a^2 + (1 + 1/t) margin^2` with `t = margin / root mean square of a`. Semi-axes longer by the margin would not do.
    ///
    /// # Source
    /// Kurzhanski and Valyi, "Ellipsoidal Calculus for Estimation and Control" (1997), 2.3: the outer ellipsoids of a sum.
    pub fn new(solid: &Ellipsoid, margin_m: f64) -> Self {
        let mut axes = *solid.factor();
        for (mut column, semi_axis) in axes.column_iter_mut().zip(solid.semi_axes()) {
            column /= *semi_axis;
        }
        let size_m = f64::sqrt(solid.semi_axes().norm_squared() / 3.0);
        let grown = |a: f64| f64::sqrt(a * a * (1.0 + margin_m / size_m) + margin_m * (margin_m + size_m));
        let semi_axes = if margin_m > 0.0 { solid.semi_axes().map(grown) } else { *solid.semi_axes() };
        Self { axes, semi_axes }
    }

    fn seen(&self, offset: &Vector3<f64>) -> Vector3<f64> {
        self.axes.tr_mul(offset).component_div(&self.semi_axes)
    }

    fn pulled_back(&self, seen: &Vector3<f64>) -> Vector3<f64> {
        self.axes * seen.component_div(&self.semi_axes)
    }

    /// At the end of a segment.
    pub fn node_row(&self, node: usize, end: &Kinematics, center: &Vector3<f64>) -> MotionRow {
        let seen = self.seen(&(end.world_from_body.translation.vector - center));
        let mut by_end = [0.0; KINEMATICS];
        add(&mut by_end, 0, &self.pulled_back(&seen), 2.0);
        MotionRow { node, value: seen.norm_squared() - 1.0, by_start: [0.0; KINEMATICS], by_end, contact: None }
    }

    /// The least on a segment, while the centre goes its own way (in Bernstein form of degree five).
    pub fn segment_row<const GRADIENT: bool>(
        &self,
        node: usize,
        segment: &Segment,
        center: &[Vector3<f64>; 6],
    ) -> MotionRow {
        let is_cubic = center.iter().all(|point| *point == center[0]);
        let (s, value, [seen, slope, bend]) = if is_cubic {
            least(&segment.points.map(|point| self.seen(&(point - center[0]))))
        } else {
            let quartic: [_; 5] = raised(&segment.points);
            let mut points: [_; 6] = raised(&quartic);
            for (point, center) in points.iter_mut().zip(center) {
                *point = self.seen(&(*point - center));
            }
            least(&points)
        };
        let mut row = MotionRow {
            node,
            value: value - 1.0,
            by_start: [0.0; KINEMATICS],
            by_end: [0.0; KINEMATICS],
            contact: None,
        };
        if !GRADIENT {
            return row;
        }
        let (gradient, turning) = (self.pulled_back(&seen) * 2.0, self.pulled_back(&slope) * 2.0);
        let (weights, slopes) = (segment.position(s), segment.slope(s));
        spread(&weights, &gradient, &mut row.by_start, &mut row.by_end);
        if s > 0.0 && s < 1.0 {
            let curvature = 2.0 * (slope.norm_squared() + seen.dot(&bend));
            let mut contact = MovingContact {
                by_start: [0.0; KINEMATICS],
                by_end: [0.0; KINEMATICS],
                curvature: curvature.max(LEAST_CURVATURE),
            };
            spread(&weights, &turning, &mut contact.by_start, &mut contact.by_end);
            spread(&slopes, &gradient, &mut contact.by_start, &mut contact.by_end);
            row.contact = Some(contact);
        }
        row
    }
}

fn add(gradient: &mut [f64; KINEMATICS], from: usize, vector: &Vector3<f64>, factor: f64) {
    for (entry, component) in gradient.iter_mut().skip(from).zip(vector) {
        *entry += factor * component;
    }
}

/// Adds a gradient by the position on a segment to those by the positions and velocities of its ends.
pub(super) fn spread(
    weights: &Weights,
    gradient: &Vector3<f64>,
    by_start: &mut [f64; KINEMATICS],
    by_end: &mut [f64; KINEMATICS],
) {
    let Weights([start, start_velocity, end, end_velocity]) = *weights;
    add(by_start, 0, gradient, start);
    add(by_start, 3, gradient, start_velocity);
    add(by_end, 0, gradient, end);
    add(by_end, 3, gradient, end_velocity);
}

/// The same curve in Bernstein form of the next degree.
fn raised<const N: usize, const M: usize>(points: &[Vector3<f64>; N]) -> [Vector3<f64>; M] {
    core::array::from_fn(|i| {
        let share = i as f64 / N as f64;
        let (before, here) = (i.checked_sub(1).and_then(|i| points.get(i)), points.get(i));
        before.map_or_else(Vector3::zeros, |point| point * share)
            + here.map_or_else(Vector3::zeros, |point| point * (1.0 - share))
    })
}

/// Most coefficients of half the derivative of a squared distance.
const COEFFICIENTS: usize = 10;
/// An interval with more than one stationary point is halved so often, at most.
const HALVINGS: u32 = 16;

/// Where a curve in Bernstein form is nearest to the origin: `s`, the squared distance, and the curve there with its derivatives.
fn least<const N: usize>(points: &[Vector3<f64>; N]) -> (f64, f64, [Vector3<f64>; 3]) {
    let mut search = Search { points, nearest: (0.0, f64::INFINITY), rounding: 0.0 };
    search.look(0.0);
    search.look(1.0);
    let (mut coefficients, mut largest) = ([0.0; COEFFICIENTS], 0.0);
    let degree = N - 1;
    for (i, point) in points.iter().enumerate() {
        for (j, pair) in points.windows(2).enumerate() {
            if let ([from, to], Some(coefficient)) = (pair, coefficients.get_mut(i + j)) {
                let share = binomial(degree, i) * binomial(degree - 1, j) / binomial(2 * degree - 1, i + j);
                *coefficient += share * point.dot(&(to - from));
            }
        }
        largest = f64::max(largest, point.norm_squared());
    }
    search.rounding = 1e-15 * largest;
    search.between(&coefficients, 0.0, 1.0, HALVINGS);
    let (s, value) = search.nearest;
    (s, value, evaluate(points, s))
}

/// `n` over `k`, up to 9.
fn binomial(n: usize, k: usize) -> f64 {
    (0..k.min(n)).fold(1.0, |product, i| product * (n - i) as f64 / (i + 1) as f64)
}

/// The search for the least distance of a curve: every stationary point is found, since a polynomial has no more roots in an
/// interval than its Bernstein coefficients have changes of sign.
struct Search<'a, const N: usize> {
    points: &'a [Vector3<f64>; N],
    /// Where, and how far squared.
    nearest: (f64, f64),
    /// Coefficients not larger than this say nothing.
    rounding: f64,
}

impl<const N: usize> Search<'_, N> {
    fn look(&mut self, s: f64) {
        let value = evaluate(self.points, s)[0].norm_squared();
        if value < self.nearest.1 {
            self.nearest = (s, value);
        }
    }

    /// Half the derivative of the squared distance, and the derivative of that.
    fn pull(&self, s: f64) -> (f64, f64) {
        let [value, slope, bend] = evaluate(self.points, s);
        (value.dot(&slope), slope.norm_squared() + value.dot(&bend))
    }

    fn between(&mut self, coefficients: &[f64; COEFFICIENTS], from: f64, to: f64, halvings: u32) {
        let Some(used) = coefficients.get(..2 * (N - 1)) else { return };
        let (mut first, mut last, mut changes) = (0.0, 0.0, 0);
        for coefficient in used.iter().filter(|coefficient| coefficient.abs() > self.rounding) {
            if first == 0.0 {
                first = *coefficient;
            } else if (last < 0.0) != (*coefficient < 0.0) {
                changes += 1;
            }
            last = *coefficient;
        }
        if changes == 1 && first < 0.0 {
            self.descend(from, to);
        } else if changes > 1 {
            let middle = 0.5 * (from + to);
            self.look(middle);
            if halvings > 0 {
                let (mut left, mut right) = (*coefficients, *coefficients);
                halve(&mut left, &mut right, 2 * (N - 1));
                self.between(&left, from, middle, halvings - 1);
                self.between(&right, middle, to, halvings - 1);
            }
        }
    }

    /// The one stationary point of an interval, on whose left the distance falls and on whose right it rises.
    fn descend(&mut self, mut from: f64, mut to: f64) {
        let mut s = 0.5 * (from + to);
        for _ in 0..60 {
            let (pull, stiffness) = self.pull(s);
            if pull < 0.0 {
                from = s;
            } else {
                to = s;
            }
            let newton = s - pull / stiffness;
            let next = if newton > from && newton < to { newton } else { 0.5 * (from + to) };
            let is_done = (next - s).abs() <= 2.0 * f64::EPSILON;
            s = next;
            if is_done {
                break;
            }
        }
        self.look(s);
    }
}

/// De Casteljau's halves of a polynomial of so many coefficients.
fn halve(left: &mut [f64; COEFFICIENTS], right: &mut [f64; COEFFICIENTS], count: usize) {
    for (level, left) in left.iter_mut().enumerate().take(count).skip(1) {
        for i in 0..count - level {
            right[i] = 0.5 * (right[i] + right[i + 1]);
        }
        *left = right[0];
    }
}
