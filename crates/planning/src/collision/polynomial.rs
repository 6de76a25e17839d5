//! Polynomials in time: expansion about another time, and how long one certainly stays positive.

use crate::motion::COEFFICIENTS;
use nalgebra::Vector3;

/// Numbers that can be coefficients here.
pub(crate) trait Coefficient: Copy + core::ops::Add<Output = Self> + core::ops::Mul<f64, Output = Self> {}
impl Coefficient for f64 {}
impl Coefficient for Vector3<f64> {}

/// How often [`stays_positive`] cuts an interval before it is content with a part of it.
const CUTS: usize = 24;

/// `C(i, k) / C(5, k)`: power basis to Bernstein basis.
const TO_BERNSTEIN: [[f64; COEFFICIENTS]; COEFFICIENTS] = [
    [1.0, 0.0, 0.0, 0.0, 0.0, 0.0],
    [1.0, 0.2, 0.0, 0.0, 0.0, 0.0],
    [1.0, 0.4, 0.1, 0.0, 0.0, 0.0],
    [1.0, 0.6, 0.3, 0.1, 0.0, 0.0],
    [1.0, 0.8, 0.6, 0.4, 0.2, 0.0],
    [1.0, 1.0, 1.0, 1.0, 1.0, 1.0],
];

/// Coefficients in powers of `time - shift`.
#[inline]
pub(crate) fn about<C: Coefficient>(coefficients: &[C; COEFFICIENTS], degree: usize, shift: f64) -> [C; COEFFICIENTS] {
    let mut shifted = *coefficients;
    if degree <= 2 {
        let [first, second, third, ..] = *coefficients;
        shifted[0] = first + (second + third * shift) * shift;
        shifted[1] = second + third * (2.0 * shift);
        return shifted;
    }
    for pass in 0..COEFFICIENTS - 1 {
        for index in (pass..COEFFICIENTS - 1).rev() {
            shifted[index] = shifted[index] + shifted[index + 1] * shift;
        }
    }
    shifted
}

/// Bernstein coefficients on `[0, length]`: the values there lie between the least and the largest of them.
#[inline]
pub(super) fn bernstein(coefficients: &[f64; COEFFICIENTS], length: f64) -> [f64; COEFFICIENTS] {
    let mut power = 1.0;
    let mut scaled = [0.0; COEFFICIENTS];
    for (scaled, coefficient) in scaled.iter_mut().zip(coefficients) {
        *scaled = coefficient * power;
        power *= length;
    }
    TO_BERNSTEIN.map(|row| row.iter().zip(&scaled).map(|(weight, scaled)| weight * scaled).sum())
}

/// Least and largest value on `[0, length]`, or beyond: exact up to degree two.
#[inline]
pub(super) fn range(coefficients: &[f64; COEFFICIENTS], degree: usize, length: f64) -> (f64, f64) {
    if degree <= 2 {
        let [value, slope, bend, ..] = *coefficients;
        let end = value + (slope + bend * length) * length;
        let (mut least, mut largest) = (value.min(end), value.max(end));
        let turning = -slope / (2.0 * bend);
        if turning > 0.0 && turning < length {
            let there = value + 0.5 * slope * turning;
            least = least.min(there);
            largest = largest.max(there);
        }
        return (least, largest);
    }
    let points = bernstein(coefficients, length);
    points
        .iter()
        .fold((f64::INFINITY, f64::NEG_INFINITY), |(least, largest), point| (least.min(*point), largest.max(*point)))
}

/// A length, at most `length`, up to which the polynomial is certainly not negative; its value at zero is positive. The
/// first root up to degree two; beyond, the first root or, after a bounded number of cuts, somewhat less.
#[inline]
pub(super) fn stays_positive(coefficients: &[f64; COEFFICIENTS], degree: usize, length: f64) -> f64 {
    if degree <= 2 { quadratic(coefficients, length) } else { by_hull(coefficients, length) }
}

/// First root, in the form that does not cancel.
#[inline]
fn quadratic(&[value, slope, bend, ..]: &[f64; COEFFICIENTS], length: f64) -> f64 {
    let discriminant = slope * slope - 4.0 * bend * value;
    let root = if slope < 0.0 {
        if discriminant < 0.0 {
            return length;
        }
        2.0 * value / (f64::sqrt(discriminant) - slope)
    } else if bend < 0.0 {
        (slope + f64::sqrt(discriminant)) / (-2.0 * bend)
    } else {
        return length;
    };
    root.min(length)
}

/// Cuts off, again and again, what lies before the first place where the hull of the control points reaches zero; of an
/// interval too long for a good hull, the first half is looked at first.
fn by_hull(coefficients: &[f64; COEFFICIENTS], length: f64) -> f64 {
    let (mut begin, mut end) = (0.0, length);
    for _ in 0..CUTS {
        let points = bernstein(&about(coefficients, COEFFICIENTS - 1, begin), end - begin);
        if let Some(cut) = hull_reaches_zero(&points) {
            let gained = cut * (end - begin);
            begin += gained;
            if gained <= 1e-9 * begin {
                break;
            }
            if cut < 0.25 {
                end = 0.5 * (begin + end);
            }
        } else {
            begin = end;
            if begin >= length {
                return length;
            }
            end = length;
        }
    }
    begin
}

/// Where in `[0, 1]` the lower hull of equally spaced points first reaches zero; none where no point is negative.
#[inline]
fn hull_reaches_zero(points: &[f64; COEFFICIENTS]) -> Option<f64> {
    const STEP: f64 = 1.0 / (COEFFICIENTS - 1) as f64;
    let mut first: Option<f64> = None;
    for (after, low) in points.iter().enumerate().skip(1) {
        if *low < 0.0 {
            for (before, high) in points.iter().enumerate().take(after) {
                // A rounding error below zero at the start counts as zero.
                let high = if before == 0 { high.max(0.0) } else { *high };
                if high >= 0.0 {
                    let at = (before as f64 + (after - before) as f64 * (high / (high - low))) * STEP;
                    first = Some(first.map_or(at, |first| first.min(at)));
                }
            }
        }
    }
    first
}

#[cfg(test)]
mod tests {
    use super::*;

    fn value(c: &[f64; COEFFICIENTS], t: f64) -> f64 {
        c.iter().rev().fold(0.0, |value, c| value * t + c)
    }

    /// Polynomials with these roots, leading sign so that the value at zero is positive.
    fn with_roots(roots: &[f64]) -> [f64; COEFFICIENTS] {
        let mut c = [0.0; COEFFICIENTS];
        c[0] = 1.0;
        for root in roots {
            let before = c;
            for k in 0..COEFFICIENTS {
                c[k] = before[k] * root - if k > 0 { before[k - 1] } else { 0.0 };
            }
        }
        let sign = c[0].signum();
        c.map(|c| c * sign)
    }

    #[test]
    fn the_first_root_is_found_and_never_passed() {
        for roots in
            [&[0.3, 0.8][..], &[0.7, -2.0], &[0.5, 0.9, 1.7], &[0.2, 0.21, 0.9, -1.0], &[0.4, 0.6, 0.7, 2.0, 3.0]]
        {
            let c = with_roots(roots);
            let degree = roots.len();
            let first = roots.iter().copied().filter(|root| *root > 0.0).fold(f64::INFINITY, f64::min);
            for length in [0.1, 0.25, 1.0, 4.0] {
                let found = stays_positive(&c, degree, length);
                let exact = first.min(length);
                assert!(found <= exact * (1.0 + 1e-12) && found > 0.5 * exact, "{roots:?} {length}: {found}");
            }
            let near = stays_positive(&about(&c, degree, 0.9 * first), degree, 1.0);
            assert!((near - 0.1 * first).abs() < 1e-9, "{roots:?}: {near}");
        }
        assert!(stays_positive(&[1.0, -1.0, 0.3, 0.0, 0.0, 0.0], 2, 9.0) >= 9.0);
        assert!(stays_positive(&[1.0, 0.0, 0.0, 0.0, 0.0, 1.0], 5, 9.0) >= 9.0);
    }

    #[test]
    fn expansion_and_range_hold() {
        let c = [0.3, -1.2, 0.7, 0.4, -0.9, 0.25];
        for degree in [1, 2, 5] {
            let mut c = c;
            c[degree + 1..].fill(0.0);
            let shifted = about(&c, degree, 0.37);
            let (least, largest) = range(&c, degree, 2.0);
            let mut tight = (f64::INFINITY, f64::NEG_INFINITY);
            for step in 0..=1000 {
                let t = 0.002 * f64::from(step);
                let there = value(&c, t);
                assert!((value(&shifted, t - 0.37) - there).abs() < 1e-13);
                assert!(least <= there + 1e-14 && there <= largest + 1e-14);
                tight = (tight.0.min(there), tight.1.max(there));
            }
            if degree <= 2 {
                assert!((tight.0 - least).abs() < 1e-5 && (tight.1 - largest).abs() < 1e-5);
            }
        }
    }
}
